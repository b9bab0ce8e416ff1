"""Records of the Waymo Open Motion Dataset in a TFRecord, without TensorFlow.

The schema holds the fields of the dataset's scenario.proto and map.proto that are used, by their
numbers. A tf.Example holds the same content as tensors of fixed shapes: 128 objects, 10 past steps,
the current one and 80 future ones, 16 lights, 30,000 points of the map.
"""

from __future__ import annotations

import struct
from collections import Counter
from collections.abc import Iterable, Iterator
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenewright.compiled import compiled
from scenewright.errors import InputError
from scenewright.geometry.polyline import measure_distances, resample_by_spacing
from scenewright.scene.base import FloatArray
from scenewright.scene.map import IntersectionMap
from scenewright.tools.formats.exported_scene import ExportedAgent, ExportedScene
from scenewright.tools.formats.lanes import list_points, list_predecessors, number_lanes
from scenewright.tools.formats.protobuf_schema import build_messages
from scenewright.tools.formats.sample_table import SampleTable
from scenewright.tools.formats.sampled_recording import SampledRecording

WINDOW, CURRENT, EVENT = 91, 10, 60
"""Steps of a scenario of the dataset, which of them is now, and where a window has its event."""
MPH = 0.44704
_STATES = {"red": 4, "yellow": 5, "green": 6, None: 0}
_SURFACE_STREET, _BOUNDARY = 2, 1
PACKAGE = "waymo.open_dataset"
SCHEMA = """
MapPoint: x 1 double, y 2 double, z 3 double
LaneCenter: speed_limit_mph 1 double, type 2 int32, polyline 8 *MapPoint, entry_lanes 9 *int64, exit_lanes 10 *int64
RoadEdge: type 1 int32, polyline 2 *MapPoint
Crosswalk: polygon 1 *MapPoint
MapFeature: id 1 int64, lane 3 LaneCenter, road_edge 5 RoadEdge, crosswalk 8 Crosswalk
TrafficSignalLaneState: lane 1 int64, state 2 int32, stop_point 3 MapPoint
DynamicMapState: lane_states 1 *TrafficSignalLaneState
ObjectState: center_x 2 double, center_y 3 double, center_z 4 double, length 5 float, width 6 float, height 7 float, heading 8 float, velocity_x 9 float, velocity_y 10 float, valid 11 bool
Track: id 1 int32, object_type 2 int32, states 3 *ObjectState
RequiredPrediction: track_index 1 int32, difficulty 2 int32
Scenario: timestamps_seconds 1 *double, tracks 2 *Track, objects_of_interest 4 *int32, scenario_id 5 string, sdc_track_index 6 int32, dynamic_map_states 7 *DynamicMapState, map_features 8 *MapFeature, current_time_index 10 int32, tracks_to_predict 11 *RequiredPrediction
"""  # noqa: E501
_TYPES = {1: "car", 2: "pedestrian", 3: "bicycle"}
_EXAMPLE = """
BytesList: value 1 *bytes
FloatList: value 1 +float
Int64List: value 1 +int64
Feature: bytes_list 1 BytesList, float_list 2 FloatList, int64_list 3 Int64List
FeatureEntry: key 1 string, value 2 Feature
Features: feature 1 *FeatureEntry
Example: features 1 Features
"""
PARTS = {"past": slice(0, 10), "current": slice(10, 11), "future": slice(11, 91)}
"""Steps of a record that each part of its names holds."""
STATES = (
    "x", "y", "z", "length", "width", "height", "bbox_yaw", "vel_yaw", "velocity_x", "velocity_y",
    "timestamp_micros", "valid",
)  # fmt: skip
"""What a record says of an object at a step."""
_Tensors = dict[str, np.ndarray[Any, Any]]
OBJECTS, LIGHTS, POINTS = 128, 16, 30_000
SPACING = 0.5
"""Between the points of the map [m]."""
_MAP_TYPES = {"lane": 2, "road_edge": 15, "crosswalk": 18}
"""LaneCenter-SurfaceStreet, RoadEdgeBoundary and Crosswalk."""
_NOTHING = -1
"""Value of everything that is not there."""


def write(scene: ExportedScene, *, form: str = "window") -> dict[str, bytes]:
    """One record: the 9.1 s of the dataset around the event, or the whole scene.

    Args:
        form: `window` or `whole`, a Scenario; `example`, the window as tf.Example.
    """
    if form != "whole":
        scene = scene.cut_window(WINDOW, now=CURRENT, event=EVENT)
    if form == "example":
        features, lights = _describe_map(scene.intersection_map), _describe_lights(scene)
        record = write_example(scene, features, lights)
        return {f"{scene.name}.tfexample.tfrecord": write_records([record])}
    scenario = load_scenario_class()(
        scenario_id=scene.name,
        timestamps_seconds=scene.times.tolist(),
        current_time_index=find_current_step(scene),
        tracks=[_describe_track(a, scene.steps) for a in (*scene.agents, *scene.objects)],
        sdc_track_index=[agent.id for agent in scene.agents].index(scene.ego.id),
        objects_of_interest=scene.list_event_agents()[:2],
        tracks_to_predict=[
            {"track_index": index, "difficulty": 0}
            for index, agent in enumerate(scene.agents)
            if is_predicted(agent, scene)
        ],
        map_features=_describe_map(scene.intersection_map),
        dynamic_map_states=_describe_lights(scene),
    )
    record = scenario.SerializeToString(deterministic=True)
    return {f"{scene.name}.tfrecord": write_records([record])}


def _describe_track(agent: ExportedAgent, steps: int) -> dict[str, Any]:
    """A state for every step; those at which the agent is not there are invalid."""
    heading = np.where(agent.heading >= np.pi, -np.pi, agent.heading)
    states: list[dict[str, Any]] = [{"valid": False}] * steps
    for k, ((x, y), (vx, vy), turn) in enumerate(
        zip(agent.xy.tolist(), agent.velocity.tolist(), heading.tolist(), strict=True)
    ):
        states[agent.first + k] = {
            "center_x": x, "center_y": y, "center_z": agent.height / 2,
            "length": agent.length, "width": agent.width, "height": agent.height,
            "heading": turn, "velocity_x": vx, "velocity_y": vy, "valid": True,
        }  # fmt: skip
    return {"id": agent.id, "object_type": agent.names.womd, "states": states}


def _describe_map(intersection: IntersectionMap) -> list[dict[str, Any]]:
    numbers = number_lanes(intersection)
    before = list_predecessors(intersection)
    features: list[dict[str, Any]] = [
        {
            "id": numbers[lanelet.id],
            "lane": {
                "speed_limit_mph": lanelet.speed_limit / MPH,
                "type": _SURFACE_STREET,
                "polyline": list_points(lanelet.centreline),
                "entry_lanes": [numbers[name] for name in before[lanelet.id]],
                "exit_lanes": [numbers[name] for name in lanelet.successors],
            },
        }
        for lanelet in intersection.lanelets
        if lanelet.id in numbers
    ]
    rings = [ring for area in intersection.road for ring in (area.exterior, *area.holes)]
    areas: list[dict[str, Any]] = [
        {"road_edge": {"type": _BOUNDARY, "polyline": list_points((*ring, ring[0]))}}
        for ring in rings
    ]
    areas += [{"crosswalk": {"polygon": list_points(c.polygon)}} for c in intersection.crosswalks]
    return features + [{"id": len(numbers) + k, **each} for k, each in enumerate(areas, start=1)]


def _describe_lights(scene: ExportedScene) -> list[dict[str, Any]]:
    """At every step the light of each lane that ends at a stop line."""
    numbers, lights = number_lanes(scene.intersection_map), scene.list_lane_lights()
    return [
        {
            "lane_states": [
                {
                    "lane": numbers[lane], "state": _STATES[colours[k]],
                    "stop_point": list_points([end])[0],
                }
                for lane, end, colours in lights
            ]
        }
        for k in range(scene.steps)
    ]  # fmt: skip


@cache
def load_scenario_class() -> Any:
    """The message class of a scenario."""
    return build_messages(PACKAGE, SCHEMA)["Scenario"]


def read(data: bytes, *, name: str) -> list[SampledRecording]:
    """The scenarios of a file of Scenario or tf.Example records.

    Raises:
        InputError: damaged, or records of another kind.
    """
    records = enumerate(read_records(data, name=name))
    return [_read_record(record, f"{name}, record {number}") for number, record in records]


def _read_record(record: bytes, name: str) -> SampledRecording:
    tensors = read_example(record)
    if tensors is not None:
        return _read_example_tracks(tensors, name)
    from google.protobuf.message import DecodeError

    try:
        scenario = load_scenario_class().FromString(record)
    except DecodeError as error:
        raise InputError(f"{name} is no Scenario and no tf.Example of a scene") from error
    if not scenario.tracks:
        raise InputError(f"{name} is no Scenario with tracks, and no tf.Example of one")
    times = np.array(scenario.timestamps_seconds).round(4).tolist()
    table, left_out = SampleTable(name), Counter[str]()
    for track in scenario.tracks:
        if len(track.states) != len(times):
            raise InputError(f"{name}: track {track.id} has no state for every time")
        if (subtype := _TYPES.get(track.object_type)) is None:
            left_out[f"type {track.object_type}"] += 1
            continue
        for t, s in zip(times, track.states, strict=True):
            if s.valid:
                sizes = {key: getattr(s, key) for key in ("length", "width") if getattr(s, key)}
                place = {"t": t, "x": s.center_x, "y": s.center_y, "heading": s.heading}
                table.add(None, str(track.id), subtype, place | sizes)
    return SampledRecording(str(scenario.scenario_id), table.list_agents(), left_out)


@cache
def load_example_class() -> Any:
    """The message class of tf.Example; a map of features has the bytes of repeated entries."""
    return build_messages("tensorflow", _EXAMPLE)["Example"]


def read_example(record: bytes) -> _Tensors | None:
    """The features of a record as flat arrays by name; None if it is no tf.Example of a scene."""
    from google.protobuf.message import DecodeError

    try:
        entries = load_example_class().FromString(record).features.feature
    except DecodeError:
        return None
    example: _Tensors = {}
    for entry in entries:
        value = entry.value
        held = value.float_list.value or value.int64_list.value or value.bytes_list.value
        example[entry.key] = np.array(list(held))
    return example if "state/id" in example else None


def _read_example_tracks(tensors: _Tensors, name: str) -> SampledRecording:
    """The tracks of a tf.Example record.

    Raises:
        InputError: a tensor is missing, or not of the size that the dataset has.
    """
    objects = len(tensors["state/id"])
    states = {state: _join(tensors, state, objects, name) for state in STATES}
    kinds = _get(tensors, "state/type", objects, name)
    table, left_out = SampleTable(name), Counter[str]()
    for k, number in enumerate(tensors["state/id"]):
        valid = states["valid"][k] > 0
        if not valid.any():
            continue
        if (subtype := _TYPES.get(int(kinds[k]))) is None:
            left_out[f"type {int(kinds[k])}"] += 1
            continue
        for j in np.flatnonzero(valid):
            here = {each: float(values[k, j]) for each, values in states.items()}
            sizes = {key: here[key] for key in ("length", "width") if here[key] > 0}
            place = {"x": here["x"], "y": here["y"], "heading": here["bbox_yaw"]}
            time = round(here["timestamp_micros"] * 1e-6, 4)
            table.add(None, f"{number:.0f}", subtype, {"t": time} | place | sizes)
    title = tensors.get("scenario/id", np.array([b""]))[0]
    title = title.decode(errors="replace") if isinstance(title, bytes) else ""
    return SampledRecording(title, table.list_agents(), left_out)


def _get(tensors: _Tensors, key: str, size: int, name: str) -> np.ndarray[Any, Any]:
    values = tensors.get(key)
    if values is None or len(values) != size:
        held = "is missing" if values is None else f"has {len(values)} values, not {size}"
        raise InputError(f"{name}: {key} {held}")
    return values


def _join(tensors: _Tensors, state: str, objects: int, name: str) -> np.ndarray[Any, Any]:
    """[objects, 91] a state from the past to the future; a part that is left out is invalid."""
    parts = []
    for part, span in PARTS.items():
        count = span.stop - span.start
        if f"state/{part}/valid" not in tensors:
            parts.append(np.zeros((objects, count)))
            continue
        values = _get(tensors, f"state/{part}/{state}", objects * count, name)
        parts.append(values.reshape(objects, count).astype(np.float64))
    return np.concatenate(parts, axis=1)


_POLYNOMIAL = 0x82F63B78
_MASK = 0xA282EAD8
_TABLE: NDArray[np.uint32] = np.arange(256, dtype=np.uint32)
"""[256] remainders by byte."""
for _ in range(8):
    _TABLE = np.where(_TABLE & 1, (_TABLE >> 1) ^ np.uint32(_POLYNOMIAL), _TABLE >> 1)


def write_records(records: Iterable[bytes]) -> bytes:
    """The records as the content of a TFRecord file."""
    parts: list[bytes] = []
    for record in records:
        for part in (struct.pack("<Q", len(record)), record):
            parts += [part, struct.pack("<I", compute_masked_crc(part))]
    return b"".join(parts)


def read_records(data: bytes, *, name: str) -> Iterator[bytes]:
    """The records of a TFRecord file.

    Raises:
        InputError: cut off, or a checksum does not hold.
    """
    at, number = 0, 0
    while at < len(data):
        head, at = data[at : at + 12], at + 12
        if len(head) < 12 or struct.unpack("<I", head[8:])[0] != compute_masked_crc(head[:8]):
            raise InputError(f"{name}, record {number}: no TFRecord, or damaged")
        (length,) = struct.unpack("<Q", head[:8])
        record, tail = data[at : at + length], data[at + length : at + length + 4]
        if len(record) < length or len(tail) < 4:
            raise InputError(f"{name}, record {number}: the file is cut off")
        if struct.unpack("<I", tail)[0] != compute_masked_crc(record):
            raise InputError(f"{name}, record {number}: its checksum does not hold")
        yield record
        at, number = at + length + 4, number + 1


def compute_masked_crc(data: bytes) -> int:
    """CRC32C of the bytes (Castagnoli), rotated and shifted as TFRecord has it."""
    crc = int(_compute_crc32c(_TABLE, np.frombuffer(data, np.uint8)))
    return ((crc >> 15 | crc << 17) + _MASK) & 0xFFFFFFFF


@compiled
def _compute_crc32c(table: NDArray[np.uint32], data: NDArray[np.uint8]) -> int:
    crc = 0xFFFFFFFF
    for byte in data:
        crc = table[(crc ^ byte) & 0xFF] ^ (crc >> 8)
    return crc ^ 0xFFFFFFFF


def write_example(
    scene: ExportedScene, features: list[dict[str, Any]], lights: list[dict[str, Any]]
) -> bytes:
    """The record of a scene of 91 steps.

    Args:
        features, lights: map features and dynamic map states as Scenario records have them.
    """
    tensors = _tabulate_objects(scene) | _sample_map(features) | _tabulate_lights(scene, lights)
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


def _tabulate_objects(scene: ExportedScene) -> _Tensors:
    agents = _choose_objects(scene)
    numbers = [agent.id for agent in agents]
    events = scene.list_event_agents()[:2]
    flags = {
        "is_sdc": [agent.id == scene.ego.id for agent in agents],
        "objects_of_interest": [n in events for n in numbers],
        "tracks_to_predict": [is_predicted(agent, scene) for agent in agents],
    }
    found: _Tensors = {f"state/{name}": _fill(values, 0) for name, values in flags.items()}
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


def _sample_map(features: list[dict[str, Any]]) -> _Tensors:
    """The polylines and outlines of the map as points with directions, padded."""
    parts = [_sample_feature(feature) for feature in features]
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
    line = np.array([(point["x"], point["y"]) for point in points])
    if kind == "crosswalk":
        line = np.concatenate([line, line[:1]])
    line = resample_by_spacing(line, SPACING)
    steps = np.diff(line, axis=0, append=line[-1:])
    steps[-1] = steps[-2]
    course = steps / np.maximum(np.hypot(*steps.T), 1e-9)[:, None]
    more = np.tile([float(_MAP_TYPES[kind]), float(feature["id"])], (len(line), 1))
    return np.concatenate([line, course, more], axis=1)


def _tabulate_lights(scene: ExportedScene, lights: list[dict[str, Any]]) -> _Tensors:
    """State and place of the lights of up to 16 lanes, nearest to the ego's way first."""
    first = lights[0]["lane_states"] if lights else []
    stops = np.array([(s["stop_point"]["x"], s["stop_point"]["y"]) for s in first]).reshape(-1, 2)
    away = measure_distances(stops, scene.ego.xy).min(axis=1)
    chosen = np.argsort(away, kind="stable")[:LIGHTS]
    steps, k = PARTS["future"].stop, len(chosen)
    whole: _Tensors = {
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
    found: _Tensors = {}
    for part, span in PARTS.items():
        where = f"traffic_light_state/{part}"
        found |= {f"{where}/{name}": values[span] for name, values in whole.items()}
        found |= {f"{where}/valid": valid[span], f"{where}/timestamp_micros": micros[span]}
    return found
