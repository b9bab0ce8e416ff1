"""Tracks in records of the Waymo Open Motion Dataset, without TensorFlow.

The schema holds the fields of the dataset's scenario.proto and map.proto that tracks, lights and
lanes need, by their numbers.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable, Iterator
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenewright.compiled import compiled
from scenewright.errors import InputError
from scenewright.tools.track_io.protobuf_schema import build_messages
from scenewright.tools.track_io.sampled_recording import AgentSamples, SampledRecording, sort_out

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


@cache
def load_scenario_class() -> Any:
    """The message class of a scenario."""
    return build_messages(PACKAGE, SCHEMA)["Scenario"]


def read_womd(data: bytes, *, name: str) -> list[SampledRecording]:
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
    times = np.array(scenario.timestamps_seconds).round(4)
    found = []
    for track in scenario.tracks:
        if len(track.states) != len(times):
            raise InputError(f"{name}: track {track.id} has no state for every time")
        subtype = _TYPES.get(track.object_type)
        agent = None if subtype is None else _read_track(track, subtype, times)
        found.append((f"type {track.object_type}", agent))
    return sort_out(str(scenario.scenario_id), found)


def _read_track(track: Any, subtype: str, times: np.ndarray) -> AgentSamples:
    valid = [k for k, state in enumerate(track.states) if state.valid]
    states = [track.states[k] for k in valid]
    rows = np.array(
        [(s.center_x, s.center_y, s.heading, s.length, s.width) for s in states]
    ).reshape(-1, 5)
    sizes = np.median(rows[:, 3:], axis=0).round(4).tolist() if states else (None, None)
    length, width = (size or None for size in sizes)
    return AgentSamples(
        str(track.id), subtype, times[valid], rows[:, :2], rows[:, 2], length, width
    )


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
    found: _Tensors = {}
    for entry in entries:
        value = entry.value
        held = value.float_list.value or value.int64_list.value or value.bytes_list.value
        found[entry.key] = np.array(list(held))
    return found if "state/id" in found else None


def _read_example_tracks(tensors: _Tensors, name: str) -> SampledRecording:
    """The tracks of a tf.Example record.

    Raises:
        InputError: a tensor is missing, or not of the size that the dataset has.
    """
    objects = len(tensors["state/id"])
    states = {each: _join(tensors, each, objects, name) for each in STATES}
    found: list[tuple[str, AgentSamples | None]] = []
    for k, number in enumerate(tensors["state/id"]):
        valid = states["valid"][k] > 0
        if not valid.any():
            continue
        kind = int(_get(tensors, "state/type", objects, name)[k])
        agent, subtype = None, _TYPES.get(kind)
        if subtype is not None:
            here = {each: values[k][valid] for each, values in states.items()}
            sizes = (round(float(np.median(here[each])), 4) for each in ("length", "width"))
            agent = AgentSamples(
                f"{number:.0f}", subtype, (here["timestamp_micros"] * 1e-6).round(4),
                np.stack([here["x"], here["y"]], axis=1), here["bbox_yaw"],
                *(size if size > 0 else None for size in sizes),
            )  # fmt: skip
        found.append((f"type {kind}", agent))
    title = tensors.get("scenario/id", np.array([b""]))[0]
    return sort_out(title.decode(errors="replace") if isinstance(title, bytes) else "", found)


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
