"""Collisions of the ego in ScenarioNet pickles, by MetaDrive's own replay and physics.

MetaDrive needs none of its assets for this: fetching them is switched off. It reports collisions
of the ego only; whether it struck a vehicle or a person, its flags say. By default it gives every
vehicle one of four sizes, the longest 5.74 m, and every person a radius of 0.35 m; with
`use_bounding_box` all have the sizes that the file states.
"""

from __future__ import annotations

import contextlib
import json
import sys
from importlib.metadata import version
from pathlib import Path
from typing import Any

import metadrive
import numpy as np
from metadrive.engine.base_engine import BaseEngine
from metadrive.envs.scenario_env import ScenarioEnv
from metadrive.policy.replay_policy import ReplayEgoCarPolicy
from metadrive.scenario.scenario_description import ScenarioDescription
from metadrive.scenario.utils import read_scenario_data

BaseEngine.try_pull_asset = staticmethod(lambda: None)
_ASSETS = Path(metadrive.__file__).parent / "assets"
_ASSETS.mkdir(exist_ok=True)
if not (_ASSETS / "version.txt").exists():
    (_ASSETS / "version.txt").write_text("")
CONFIG = {
    "use_render": False, "show_terrain": False, "show_skybox": False, "preload_models": False,
    "agent_policy": ReplayEgoCarPolicy, "log_level": 50, "sequential_seed": True,
    "filter_overlapping_car": False, "use_bounding_box": True, "num_buffering_objects": 0,
}  # fmt: skip
CRASHES = {"crash_human": "person", "crash_vehicle": "vehicle", "crash_object": "object"}


def compare(question: dict[str, Any]) -> dict[str, Any]:
    """The sanity check, and how far the positions are from the scene's [m]."""
    scenario = read_scenario_data(question["file"])
    ScenarioDescription.sanity_check(scenario, check_self_type=False, valid_check=True)
    start = scenario["metadata"]["time_offset"]
    worst = 0.0
    for agent in question["agents"].values():
        track = scenario["tracks"].get(str(agent["id"]))
        if track is None:
            continue
        for t, xy in zip(agent["t"], agent["xy"], strict=True):
            k = round((t - start) / question["step"])
            if k >= 0:
                there = track["state"]["position"][k, :2]
                worst = max(worst, float(np.abs(there - np.array(xy)).max()))
    ego = scenario["tracks"][scenario["metadata"]["sdc_id"]]["state"]
    size = [float(ego[name][0]) for name in ("length", "width", "height")]
    return {
        "size": size, "position_error": worst, "start": start, "agents": len(scenario["tracks"]),
        "ego": scenario["metadata"]["sdc_id"], "length": scenario["length"],
    }  # fmt: skip


def drive(env: ScenarioEnv, index: int, about: dict[str, Any], step: float) -> dict[str, Any]:
    """When the replayed ego, in its own size, first strikes a person, a vehicle or an object."""
    length, width, height = about["size"]
    config = {"vehicle_model": "varying_dynamics_bounding_box", "length": length, "width": width,
              "height": height}  # fmt: skip
    env.config["vehicle_config"].update(config)
    for each in env.config["agent_configs"].values():
        each.update(config)
    env.reset(seed=index)
    for k in range(about["length"] - 1):
        *_, terminated, truncated, info = env.step([0, 0])
        for flag, what in CRASHES.items():
            if info.get(flag):
                time = round(about["start"] + (k + 1) * step, 3)
                return {**about, "crash": [what, time]}
        if terminated or truncated:
            break
    return {**about, "crash": None}


def main() -> None:
    request = json.load(sys.stdin)
    folder = str(Path(request["scenes"][0]["file"]).parent)
    with contextlib.redirect_stdout(sys.stderr):
        env = ScenarioEnv(
            {**CONFIG, "data_directory": folder, "num_scenarios": len(request["scenes"])}
        )
        order = {}
        answers = []
        for each in request["scenes"]:
            about = compare(each)
            if not order:
                env.reset(seed=0)
                names = env.engine.data_manager.summary_lookup
                order = {Path(name).name: k for k, name in enumerate(names)}
            index = order[Path(each["file"]).name]
            answers.append(drive(env, index, about, each["step"]))
    json.dump({"version": version("metadrive-simulator"), "scenes": answers}, sys.stdout)


if __name__ == "__main__":
    main()
