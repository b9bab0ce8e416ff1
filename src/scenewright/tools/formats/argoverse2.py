"""Argoverse 2 motion forecasting: a Parquet of tracks and a JSON of the map per scenario.

`length`, `width` and `kind` are columns of our own: Argoverse 2 states no sizes.
"""

from __future__ import annotations

import io
import json
from collections import Counter
from importlib import import_module
from typing import Any

import numpy as np

from scenewright.errors import InputError
from scenewright.scene.map import IntersectionMap
from scenewright.tools.formats.exported_scene import ExportedAgent, ExportedScene
from scenewright.tools.formats.lanes import (
    find_crosswalk_edges,
    find_neighbours,
    list_points,
    list_predecessors,
    number_lanes,
)
from scenewright.tools.formats.sample_table import SampleTable
from scenewright.tools.formats.sampled_recording import SampledRecording, find_road_user

WINDOW, OBSERVED, EVENT = 110, 50, 80
"""Steps of a scenario of the dataset, how many are observed, and where a window has its event."""
FOCAL, SCORED, UNSCORED = 3, 2, 1
NANOSECONDS = 1e-9
_NEEDED = (
    "track_id", "object_type", "timestep", "position_x", "position_y", "heading",
    "start_timestamp", "end_timestamp", "num_timestamps",
)  # fmt: skip
_OWN = ("length", "width", "kind")
"""Columns that our exporter adds: Argoverse 2 states no sizes."""


def write(scene: ExportedScene, *, form: str = "window") -> dict[str, bytes]:
    """The 11 s of the dataset around the event, or the whole scene; the ego is the track `AV`."""
    if form == "window":
        scene = scene.cut_window(WINDOW, now=OBSERVED - 1, event=EVENT)
    folder = scene.name
    chart = json.dumps(_describe_map(scene.intersection_map), separators=(",", ":"))
    return {
        f"{folder}/scenario_{scene.name}.parquet": _write_tracks(scene),
        f"{folder}/log_map_archive_{scene.name}.json": chart.encode(),
    }


def _write_tracks(scene: ExportedScene) -> bytes:
    arrow, parquet = import_module("pyarrow"), import_module("pyarrow.parquet")
    # Whom the ego meets in an event, if it is there at the last observed step; else the ego.
    there = {a.id: a for a in scene.agents if a.first < OBSERVED <= a.last + 1}
    pairs = [{event.from_, event.to} for event in scene.events]
    met = [n for pair in pairs if scene.ego.id in pair for n in pair - {scene.ego.id}]
    focal = next((there[n] for n in met if n in there), scene.ego)
    parts = [_describe_track(each, scene, focal) for each in (*scene.agents, *scene.objects)]
    columns: dict[str, Any] = {
        key: np.concatenate([part[key] for part in parts]) for key in parts[0]
    }
    about = {
        "scenario_id": scene.name,
        "start_timestamp": 0,
        "end_timestamp": round((scene.steps - 1) * scene.step * 1e9),
        "num_timestamps": scene.steps,
        "focal_track_id": _name_track(focal, scene),
        "city": scene.intersection_map.name,
        "map_id": scene.record.meta.map_id,
        "slice_id": scene.record.meta.scene_id,
    }
    count = len(columns["timestep"])
    table = arrow.table(columns | {key: [value] * count for key, value in about.items()})
    stream = io.BytesIO()
    parquet.write_table(table, stream)
    return stream.getvalue()


def _name_track(agent: ExportedAgent, scene: ExportedScene) -> str:
    """The dataset's name for the recording vehicle, which is our ego; else the agent's number."""
    return "AV" if agent.id == scene.ego.id else str(agent.id)


def _describe_track(
    agent: ExportedAgent, scene: ExportedScene, focal: ExportedAgent
) -> dict[str, Any]:
    steps, count = agent.first + np.arange(len(agent.xy)), len(agent.xy)
    foreground = SCORED if agent.role == "foreground" else UNSCORED
    return {
        "observed": steps < OBSERVED,
        "track_id": np.array([_name_track(agent, scene)] * count),
        "object_type": np.array([agent.names.argoverse2] * count),
        "object_category": np.full(count, FOCAL if agent.id == focal.id else foreground),
        "timestep": steps,
        "position_x": agent.xy[:, 0],
        "position_y": agent.xy[:, 1],
        "heading": agent.heading,
        "velocity_x": agent.velocity[:, 0],
        "velocity_y": agent.velocity[:, 1],
        "length": np.full(count, agent.length),
        "width": np.full(count, agent.width),
        "kind": np.array([agent.names.tracks] * count),
    }


def _describe_map(intersection: IntersectionMap) -> dict[str, Any]:
    numbers = number_lanes(intersection)
    before = list_predecessors(intersection)
    beside = {edge: n for edge, (n, same) in find_neighbours(intersection).items() if same}
    lanes = [
        {
            "id": numbers[lanelet.id],
            "is_intersection": lanelet.kind == "connector",
            "lane_type": "VEHICLE",
            "left_lane_boundary": list_points(lanelet.left),
            "right_lane_boundary": list_points(lanelet.right),
            "left_lane_mark_type": "UNKNOWN",
            "right_lane_mark_type": "UNKNOWN",
            "predecessors": [numbers[name] for name in before[lanelet.id]],
            "successors": [numbers[name] for name in lanelet.successors],
            "left_neighbor_id": numbers.get(beside.get((lanelet.id, "left"), "")),
            "right_neighbor_id": numbers.get(beside.get((lanelet.id, "right"), "")),
        }
        for lanelet in intersection.lanelets
        if lanelet.id in numbers
    ]
    first = len(numbers) + 1
    edges = [
        map(list_points, find_crosswalk_edges(crosswalk)) for crosswalk in intersection.crosswalks
    ]
    crossings = [
        {"id": first + k, "edge1": left, "edge2": right} for k, (left, right) in enumerate(edges)
    ]
    first += len(crossings)
    areas = [{"id": first + k, "area_boundary": list_points(area.exterior)}
             for k, area in enumerate(intersection.road)]  # fmt: skip
    return {
        "pedestrian_crossings": {str(crossing["id"]): crossing for crossing in crossings},
        "lane_segments": {str(lane["id"]): lane for lane in lanes},
        "drivable_areas": {str(area["id"]): area for area in areas},
    }


def read(data: bytes, *, name: str) -> list[SampledRecording]:
    """The tracks of one scenario; sizes are the usual ones unless our exporter wrote the file.

    Raises:
        InputError: no Parquet file, or not the columns of a scenario.
    """
    arrow, parquet = import_module("pyarrow"), import_module("pyarrow.parquet")
    try:
        file = parquet.ParquetFile(io.BytesIO(data))
        names = file.schema_arrow.names
        if missing := [column for column in _NEEDED if column not in names]:
            raise InputError(
                f"{name} is no Argoverse 2 scenario: no column {', '.join(missing)[:120]}"
            )
        own = [column for column in _OWN if column in names]
        columns: dict[str, list[Any]] = file.read([*_NEEDED, *own]).to_pydict()
    except (arrow.ArrowException, OSError, ValueError) as error:
        raise InputError(f"{name} is no Parquet file that can be read") from error
    if not columns["track_id"]:
        raise InputError(f"{name} holds no tracks")
    steps, ids = np.array(columns["timestep"]), columns["track_id"]
    start, end, count = (columns[key][0] for key in _NEEDED[-3:])
    step = (end - start) * NANOSECONDS / max(count - 1, 1)
    table, others = SampleTable(name), dict[str, str]()
    first = {who: k for k, who in reversed(list(enumerate(ids)))}
    for k in sorted(range(len(ids)), key=lambda k: (first[ids[k]], steps[k])):
        who, word = str(ids[k]), str(columns["kind" if "kind" in columns else "object_type"][k])
        if (subtype := find_road_user(word)) is None:
            others[who] = word
            continue
        names = {"x": "position_x", "y": "position_y", "heading": "heading"} | {
            key: key for key in own if key != "kind"
        }
        place = {key: float(columns[column][k]) for key, column in names.items()}
        table.add(None, who, subtype, {"t": round(float(steps[k] * step), 4)} | place)
    return [SampledRecording("", table.list_agents(), Counter(others.values()))]
