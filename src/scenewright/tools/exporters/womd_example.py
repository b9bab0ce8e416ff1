"""Waymo Motion scenes as tf.Example records: the same content as tensors of fixed shapes.

Shapes and names are those of the dataset's tf.Example form: 128 objects, 10 past steps, the
current one and 80 future ones, 16 lights, 30,000 points of the map.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from scenewright.geometry.polyline import measure_distances, resample_by_spacing
from scenewright.scene.base import FloatArray
from scenewright.tools.exporters.exported_scene import ExportedAgent, ExportedScene
from scenewright.tools.track_io.womd import PARTS, STATES, load_example_class

OBJECTS, LIGHTS, POINTS = 128, 16, 30_000
SPACING = 0.5
"""Between the points of the map [m]."""
_MAP_TYPES = {"lane": 2, "road_edge": 15, "crosswalk": 18}
"""LaneCenter-SurfaceStreet, RoadEdgeBoundary and Crosswalk."""
_NOTHING = -1
"""Value of everything that is not there."""

Features = dict[str, np.ndarray[Any, Any]]


def write_example(
    scene: ExportedScene, features: list[dict[str, Any]], lights: list[dict[str, Any]]
) -> bytes:
    """The record of a scene of 91 steps.

    Args:
        features, lights: map features and dynamic map states as Scenario records have them.
    """
    tensors = _describe_objects(scene) | _describe_map(features) | _describe_lights(scene, lights)
    entries = [{"key": "scenario/id", "value": {"bytes_list": {"value": [scene.name.encode()]}}}]
    for name in sorted(tensors):
        values = tensors[name].ravel()
        kind = "float_list" if values.dtype.kind == "f" else "int64_list"
        entries.append({"key": name, "value": {kind: {"value": values.tolist()}}})
    record: bytes = load_example_class()(features={"feature": entries}).SerializeToString(
        deterministic=True
    )
    return record


def find_current_step(scene: ExportedScene) -> int:
    """The eleventh step, or the next one at which the ego is there."""
    return min(max(PARTS["past"].stop, scene.ego.first), scene.ego.last)


def is_predicted(agent: ExportedAgent, scene: ExportedScene) -> bool:
    """Whether a track is to be predicted: the ego and the foreground that are there now."""
    wanted = agent.role == "foreground" or agent.id == scene.ego.id
    return wanted and agent.first <= find_current_step(scene) <= agent.last


def _describe_objects(scene: ExportedScene) -> Features:
    agents = _choose_objects(scene)
    numbers = [agent.id for agent in agents]
    events = scene.list_event_agents()[:2]
    flags = {
        "is_sdc": [agent.id == scene.ego.id for agent in agents],
        "objects_of_interest": [n in events for n in numbers],
        "tracks_to_predict": [is_predicted(agent, scene) for agent in agents],
    }
    found: Features = {f"state/{name}": _fill(values, 0) for name, values in flags.items()}
    found["state/id"] = _fill(numbers, _NOTHING).astype(np.float32)
    found["state/type"] = _fill([a.names.womd for a in agents], _NOTHING).astype(np.float32)
    steps = PARTS["future"].stop
    for name in STATES:
        dtype = np.int64 if name in ("valid", "timestamp_micros") else np.float32
        whole: np.ndarray[Any, Any] = np.full((OBJECTS, steps), _NOTHING, dtype)
        if name == "valid":
            whole[:] = 0
        for row, agent in zip(whole, agents, strict=False):
            heading = np.where(agent.heading >= np.pi, -np.pi, agent.heading)
            times = scene.times[agent.first : agent.last + 1]
            row[agent.first : agent.last + 1] = {
                "x": agent.xy[:, 0],
                "y": agent.xy[:, 1],
                "z": agent.height / 2,
                "length": agent.length,
                "width": agent.width,
                "height": agent.height,
                "bbox_yaw": heading,
                "vel_yaw": np.arctan2(agent.velocity[:, 1], agent.velocity[:, 0]),
                "velocity_x": agent.velocity[:, 0],
                "velocity_y": agent.velocity[:, 1],
                "timestamp_micros": np.round(times * 1e6),
                "valid": 1.0,
            }[name]
        found |= {f"state/{part}/{name}": whole[:, span] for part, span in PARTS.items()}
    return found


def _fill(values: list[Any], rest: int) -> np.ndarray[Any, Any]:
    """[OBJECTS] the values, and `rest` where there is no object."""
    filled = np.full(OBJECTS, rest, np.int64)
    filled[: len(values)] = values
    return filled


def _choose_objects(scene: ExportedScene) -> list[ExportedAgent]:
    """List all agents; where there are too many, those that come nearest to the ego, in order."""
    users, way = [*scene.agents, *scene.objects], scene.ego.xy[::5]
    kept = sorted(users, key=lambda each: measure_distances(each.xy, way).min())[:OBJECTS]
    return [agent for agent in users if any(agent is each for each in kept)]


def _describe_map(features: list[dict[str, Any]]) -> Features:
    """The polylines and outlines of the map as points with directions, padded."""
    parts = [_sample_feature(each) for each in features]
    rows = np.concatenate(parts)[:POINTS] if parts else np.zeros((0, 6))
    padded = np.full((POINTS, 6), float(_NOTHING))
    padded[: len(rows)] = rows
    flat = np.concatenate([padded[:, :2], np.zeros((POINTS, 1))], axis=1)
    course = np.concatenate([padded[:, 2:4], np.zeros((POINTS, 1))], axis=1)
    flat[len(rows) :], course[len(rows) :] = _NOTHING, _NOTHING
    return {
        "roadgraph_samples/xyz": flat.astype(np.float32),
        "roadgraph_samples/dir": course.astype(np.float32),
        "roadgraph_samples/type": padded[:, 4].astype(np.int64),
        "roadgraph_samples/id": padded[:, 5].astype(np.int64),
        "roadgraph_samples/valid": (np.arange(POINTS) < len(rows)).astype(np.int64),
    }


def _sample_feature(feature: dict[str, Any]) -> FloatArray:
    """[P, 6] x, y, direction x, y to the next point, type, id of one feature."""
    kind = next(name for name in _MAP_TYPES if name in feature)
    points = feature[kind].get("polyline") or feature[kind]["polygon"]
    line = np.array([(each["x"], each["y"]) for each in points])
    if kind == "crosswalk":
        line = np.concatenate([line, line[:1]])
    line = resample_by_spacing(line, SPACING)
    steps = np.diff(line, axis=0, append=line[-1:])
    steps[-1] = steps[-2]
    course = steps / np.maximum(np.hypot(*steps.T), 1e-9)[:, None]
    more = np.tile([float(_MAP_TYPES[kind]), float(feature["id"])], (len(line), 1))
    return np.concatenate([line, course, more], axis=1)


def _describe_lights(scene: ExportedScene, lights: list[dict[str, Any]]) -> Features:
    """State and place of the lights of up to 16 lanes, nearest to the ego's way first."""
    first = lights[0]["lane_states"] if lights else []
    stops = np.array([(s["stop_point"]["x"], s["stop_point"]["y"]) for s in first]).reshape(-1, 2)
    away = measure_distances(stops, scene.ego.xy).min(axis=1)
    chosen = np.argsort(away, kind="stable")[:LIGHTS]
    steps, k = PARTS["future"].stop, len(chosen)
    whole: Features = {
        name: np.full((steps, LIGHTS), _NOTHING, kind)
        for name, kind in (
            ("state", np.int64), ("id", np.int64),
            ("x", np.float32), ("y", np.float32), ("z", np.float32),
        )
    }  # fmt: skip
    valid = np.zeros((steps, LIGHTS), np.int64)
    there = min(steps, len(lights))
    valid[:there, :k] = 1
    whole["x"][:there, :k], whole["y"][:there, :k] = stops[chosen].T[:, None]
    whole["z"][:there, :k] = 0.0
    for step in range(there):
        rows = lights[step]["lane_states"]
        whole["state"][step, :k] = [rows[j]["state"] for j in chosen]
        whole["id"][step, :k] = [rows[j]["lane"] for j in chosen]
    micros = np.round(np.arange(steps) * scene.step * 1e6).astype(np.int64)
    found: Features = {}
    for part, span in PARTS.items():
        where = f"traffic_light_state/{part}"
        found |= {f"{where}/{name}": values[span] for name, values in whole.items()}
        found |= {f"{where}/valid": valid[span], f"{where}/timestamp_micros": micros[span]}
    return found
