"""Tracks in records of the Waymo Open Motion Dataset, without TensorFlow.

The schema holds the fields of the dataset's scenario.proto and map.proto that tracks, lights and
lanes need, by their numbers.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np

from scenewright.errors import InputError
from scenewright.tools.track_io.protobuf_schema import build_messages
from scenewright.tools.track_io.sampled_recording import AgentSamples, SampledRecording, sort_out
from scenewright.tools.track_io.tfrecord import read_records
from scenewright.tools.track_io.womd_example import read_example, read_example_tracks

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
    return [
        _read_record(record, f"{name}, record {number}")
        for number, record in enumerate(read_records(data, name=name))
    ]


def _read_record(record: bytes, name: str) -> SampledRecording:
    tensors = read_example(record)
    if tensors is not None:
        return read_example_tracks(tensors, name, _TYPES)
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
