"""ASAM OSI 3.7 ground truth in MCAP, with the map as OpenDRIVE, as omega-prime reads it.

The schema holds the fields that are used, by their numbers; nested messages have names of their
own, which changes no bytes.
"""

from __future__ import annotations

import io
from collections import Counter
from collections.abc import Iterator, Mapping
from functools import cache
from importlib import import_module
from typing import Any

from scenewright.errors import InputError
from scenewright.tools.formats.exported_scene import ExportedAgent, ExportedScene
from scenewright.tools.formats.lanes import find_light_places
from scenewright.tools.formats.mcap_writing import Topic, write_mcap
from scenewright.tools.formats.opendrive import number_signals, write_opendrive
from scenewright.tools.formats.protobuf_schema import build_messages, describe_file
from scenewright.tools.formats.sample_table import SampleTable
from scenewright.tools.formats.sampled_recording import SampledRecording

VERSION = {"version_major": 3, "version_minor": 7, "version_patch": 0}
FIRST_LIGHT = 1_000_000
"""Ids of lights begin here; below are agents."""
_COLOURS = {"red": 2, "yellow": 3, "green": 4}
_CONSTANT, _OFF, _NO_ICON = 3, 2, 2
_CIVIL, _ROLES = 2, {"emergency": 1, "ambulance": 3, "fire_engine": 4, "police_car": 5, "bus": 6}
"""Roles of vehicles: civil, and by kind those that serve the public (1 is another one)."""
_OTHER = 1
"""Kind of a box, a bin, a container or a door: none that OSI names."""
_TRACE = "net.asam.osi.trace"
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


def write(scene: ExportedScene) -> dict[str, bytes]:
    """A GroundTruth message per step, and the map once."""
    about = {
        "version": "3.7.0", "min_osi_version": "3.7.0", "max_osi_version": "3.7.0",
        "min_protobuf_version": "4.0.0", "max_protobuf_version": "6.0.0",
        "description": scene.record.meta.user_prompt, "authors": "scenewright",
        "zero_time": "1970-01-01T00:00:00Z", "creation_time": "1970-01-01T00:00:00Z",
    }  # fmt: skip
    channel = {f"{_TRACE}.channel.osi_version": "3.7.0"}
    content = write_mcap(_list_messages(scene), metadata={_TRACE: about}, channel_metadata=channel)
    return {f"{scene.name}.mcap": content}


def _list_messages(scene: ExportedScene) -> Iterator[tuple[Topic, int, bytes]]:
    descriptors = import_module("google.protobuf.descriptor_pb2")
    files = descriptors.FileDescriptorSet(file=[describe_file(PACKAGE, SCHEMA)])
    definition = files.SerializeToString(deterministic=True)
    chart, truth = (
        Topic(name, f"osi3.{schema}", "protobuf", definition, "protobuf")
        for name, schema in (
            ("ground_truth_map", "MapAsamOpenDrive"), ("ground_truth", "GroundTruth")
        )
    )  # fmt: skip
    roads = load_osi_classes()["MapAsamOpenDrive"](
        map_reference=scene.intersection_map.name,
        open_drive_xml_content=write_opendrive(scene.intersection_map).decode(),
    )
    yield chart, 0, roads.SerializeToString(deterministic=True)
    colours = scene.list_colours()
    users = [*scene.agents, *scene.objects]
    for k, time in enumerate(scene.times.tolist()):
        nanos = round(time * 1e9)
        there = [user for user in users if user.first <= k <= user.last]
        message = load_osi_classes()["GroundTruth"](
            version=VERSION,
            timestamp={"seconds": nanos // 10**9, "nanos": nanos % 10**9},
            moving_object=[_describe_user(a, k - a.first) for a in there if a.names.osi[0]],
            stationary_object=[
                {
                    "id": {"value": each.id},
                    "base": _describe_box(each, k - each.first),
                    "classification": {"type": _OTHER},
                }
                for each in there
                if not each.names.osi[0]
            ],
            traffic_light=_describe_lights(scene, colours, k),
            map_reference=scene.intersection_map.name,
            **({"host_vehicle_id": {"value": scene.ego.id}} if scene.ego_named else {}),
        )
        yield truth, nanos, message.SerializeToString(deterministic=True)


def _describe_user(agent: ExportedAgent, k: int) -> dict[str, Any]:
    """Who moves or could move, as a parked vehicle could."""
    kind, subtype = agent.names.osi
    base = _describe_box(agent, k) | {
        "velocity": _build_point(agent.velocity[k], 0.0),
        "acceleration": _build_point(agent.acceleration[k], 0.0),
    }
    thing = {"id": {"value": agent.id}, "base": base, "type": kind}
    if agent.names.is_vehicle:
        role = _ROLES.get(agent.kind, _CIVIL)
        thing["vehicle_classification"] = {"type": subtype, "role": role}
    return thing


def _describe_box(agent: ExportedAgent, k: int) -> dict[str, Any]:
    return {
        "dimension": {"length": agent.length, "width": agent.width, "height": agent.height},
        "position": _build_point(agent.xy[k], agent.height / 2),
        "orientation": {"roll": 0.0, "pitch": 0.0, "yaw": float(agent.heading[k])},
    }


def _describe_lights(
    scene: ExportedScene, colours: Mapping[str, Any], k: int
) -> list[dict[str, Any]]:
    """Every light at a step, at the middle of its stop line or crosswalk, 3 m up."""
    ids, lights = number_signals(scene.intersection_map), []
    for name, place in find_light_places(scene.intersection_map).items():
        if name in ids and name in colours:
            colour = colours[name][k]
            lights.append({
                "id": {"value": FIRST_LIGHT + ids[name]},
                "base": {
                    "dimension": {"length": 0.3, "width": 0.3, "height": 0.9},
                    "position": _build_point(place, 3.0),
                    "orientation": {"roll": 0.0, "pitch": 0.0, "yaw": 0.0},
                },
                "classification": {
                    "color": _COLOURS.get(colour, 0), "icon": _NO_ICON,
                    "mode": _CONSTANT if colour else _OFF,
                },
            })  # fmt: skip
    return lights


def _build_point(xy: Any, z: float) -> dict[str, float]:
    return {"x": float(xy[0]), "y": float(xy[1]), "z": z}


@cache
def load_osi_classes() -> dict[str, Any]:
    """The message classes of OSI, by name."""
    return build_messages(PACKAGE, SCHEMA)


def read(data: bytes, *, name: str) -> list[SampledRecording]:
    """The moving objects of all ground truth in an MCAP file.

    Raises:
        InputError: damaged, no ground truth, or the package mcap is missing.
    """
    table, left_out = SampleTable(name), Counter[str]()
    messages = [
        (m.timestamp.seconds + 1e-9 * m.timestamp.nanos, m) for m in _read_messages(data, name)
    ]
    for time, message in sorted(messages, key=lambda each: each[0]):
        for thing in message.moving_object:
            if thing.type == PEDESTRIAN:
                subtype = "pedestrian"
            elif thing.type == VEHICLE:
                subtype = _VEHICLES.get(thing.vehicle_classification.type, "car")
            else:
                left_out[f"type {thing.type}"] += 1
                continue
            base = thing.base
            sizes = {"length": base.dimension.length, "width": base.dimension.width}
            place = {"x": base.position.x, "y": base.position.y, "heading": base.orientation.yaw}
            known = {key: size for key, size in sizes.items() if size}
            table.add(None, str(thing.id.value), subtype, {"t": round(time, 6)} | place | known)
    return [SampledRecording("", table.list_agents(), left_out)]


def _read_messages(data: bytes, name: str) -> list[Any]:
    library = import_module("mcap.reader")
    truth = load_osi_classes()["GroundTruth"]
    try:
        reader = library.make_reader(io.BytesIO(data), validate_crcs=True)
        contents = [
            message.data
            for schema, _, message in reader.iter_messages()
            if schema is not None and schema.name == "osi3.GroundTruth"
        ]
        messages = [truth.FromString(content) for content in contents]
    except Exception as error:  # of a damaged file each decompressor raises its own
        raise InputError(f"{name} is no MCAP file that can be read") from error
    if not messages:
        raise InputError(f"{name} has no OSI ground truth")
    return messages
