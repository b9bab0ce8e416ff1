"""Tracks in ASAM OSI ground truth in MCAP files (extra `exports`).

The schema holds the fields of OSI 3.7 that moving objects, lights and the map need, by their
numbers; nested messages have names of their own, which changes no bytes.
"""

from __future__ import annotations

import io
from collections import Counter, defaultdict
from functools import cache
from importlib import import_module
from typing import Any

import numpy as np

from scenewright.errors import InputError
from scenewright.extras import require_extra
from scenewright.tools.track_io.protobuf_schema import build_messages
from scenewright.tools.track_io.sampled_recording import AgentSamples, SampledRecording

PACKAGE = "osi3"
SCHEMA = """
Identifier: value 1 uint64
Timestamp: seconds 1 int64, nanos 2 uint32
InterfaceVersion: version_major 1 uint32, version_minor 2 uint32, version_patch 3 uint32
Dimension3d: length 1 double, width 2 double, height 3 double
Vector3d: x 1 double, y 2 double, z 3 double
Orientation3d: roll 1 double, pitch 2 double, yaw 3 double
BaseMoving: dimension 1 Dimension3d, position 2 Vector3d, orientation 3 Orientation3d, velocity 4 Vector3d, acceleration 5 Vector3d
VehicleClassification: type 1 int32, role 5 int32
MovingObject: id 1 Identifier, base 2 BaseMoving, type 3 int32, vehicle_classification 6 VehicleClassification
BaseStationary: dimension 1 Dimension3d, position 2 Vector3d, orientation 3 Orientation3d
TrafficLightClassification: color 1 int32, icon 2 int32, mode 3 int32
TrafficLight: id 1 Identifier, base 2 BaseStationary, classification 3 TrafficLightClassification
StationaryClassification: type 1 int32
StationaryObject: id 1 Identifier, base 2 BaseStationary, classification 3 StationaryClassification
GroundTruth: version 1 InterfaceVersion, timestamp 2 Timestamp, host_vehicle_id 3 Identifier, stationary_object 4 *StationaryObject, moving_object 5 *MovingObject, traffic_light 7 *TrafficLight, map_reference 15 string
MapAsamOpenDrive: map_reference 1 string, open_drive_xml_content 2 string
"""  # noqa: E501
VEHICLE, PEDESTRIAN = 2, 3
_VEHICLES = {7: "truck", 8: "truck", 9: "truck", 16: "truck", 10: "motorcycle", 12: "bus"}
_VEHICLES |= dict.fromkeys((11, 17), "bicycle")


@cache
def load_osi_classes() -> dict[str, Any]:
    """The message classes of OSI, by name."""
    return build_messages(PACKAGE, SCHEMA)


def read_osi(data: bytes, *, name: str) -> list[SampledRecording]:
    """The moving objects of all ground truth in an MCAP file.

    Raises:
        InputError: damaged, no ground truth, or the package mcap is missing.
    """
    samples: dict[tuple[int, str], list[tuple[float, ...]]] = defaultdict(list)
    left_out = Counter[str]()
    for message in _read_messages(data, name):
        time = message.timestamp.seconds + 1e-9 * message.timestamp.nanos
        for thing in message.moving_object:
            if thing.type == PEDESTRIAN:
                subtype = "pedestrian"
            elif thing.type == VEHICLE:
                subtype = _VEHICLES.get(thing.vehicle_classification.type, "car")
            else:
                left_out[f"type {thing.type}"] += 1
                continue
            base = thing.base
            samples[thing.id.value, subtype].append(
                (round(time, 6), base.position.x, base.position.y, base.orientation.yaw,
                 base.dimension.length, base.dimension.width)
            )  # fmt: skip
    agents = []
    for (n, subtype), rows in samples.items():
        table = np.array(sorted(rows))
        length, width = (size or None for size in np.median(table[:, 4:], axis=0).tolist())
        t, xy, heading = table[:, 0], table[:, 1:3], table[:, 3]
        agents.append(AgentSamples(str(n), subtype, t, xy, heading, length, width))
    return [SampledRecording("", tuple(agents), left_out)]


def _read_messages(data: bytes, name: str) -> list[Any]:
    require_extra("exports", name, "mcap")
    library = import_module("mcap.reader")
    truth = load_osi_classes()["GroundTruth"]
    try:
        reader = library.make_reader(io.BytesIO(data), validate_crcs=True)
        contents = [
            message.data
            for schema, _, message in reader.iter_messages()
            if schema is not None and schema.name == "osi3.GroundTruth"
        ]
        found = [truth.FromString(content) for content in contents]
    except Exception as error:  # of a damaged file each decompressor raises its own
        raise InputError(f"{name} is no MCAP file that can be read") from error
    if not found:
        raise InputError(f"{name} has no OSI ground truth")
    return found
