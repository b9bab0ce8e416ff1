"""Argoverse 2 scenarios read by av2's own API: tracks and static map."""

from __future__ import annotations

import json
import sys
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from av2.datasets.motion_forecasting.scenario_serialization import (
    load_argoverse_scenario_parquet,
)
from av2.map.map_api import ArgoverseStaticMap


def play(question: dict[str, Any]) -> dict[str, Any]:
    """How far the positions and times are from the scene's; lanes and crosswalks of the map."""
    file = Path(question["file"])
    scenario = load_argoverse_scenario_parquet(file)
    chart = ArgoverseStaticMap.from_json(next(file.parent.glob("log_map_archive_*.json")))
    tracks = {track.track_id: track for track in scenario.tracks}
    worst = 0.0
    for agent in question["agents"].values():
        states = tracks.get(str(agent["id"]), tracks["AV"]).object_states
        there = np.array([state.position for state in states])
        times = scenario.timestamps_ns[[state.timestep for state in states]] * 1e-9
        worst = max(worst, float(np.abs(there - np.array(agent["xy"])).max()))
        worst = max(worst, float(np.abs(times - np.array(agent["t"])).max()))
    return {
        "agents": len(tracks),
        "position_error": worst,
        "lanes": len(chart.vector_lane_segments),
        "crosswalks": len(chart.vector_pedestrian_crossings),
    }


def main() -> None:
    request = json.load(sys.stdin)
    answers = [play(each) for each in request["scenes"]]
    json.dump({"version": version("av2"), "scenes": answers}, sys.stdout)


if __name__ == "__main__":
    main()
