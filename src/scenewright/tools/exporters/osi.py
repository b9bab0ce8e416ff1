"""ASAM OSI 3.7 ground truth in MCAP, with the map as OpenDRIVE, as omega-prime reads it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from importlib import import_module
from typing import Any

from scenewright.tools.exporters.exported_scene import ExportedAgent, ExportedScene
from scenewright.tools.exporters.lanes import find_light_places
from scenewright.tools.exporters.mcap_writing import Topic, write_mcap
from scenewright.tools.exporters.opendrive import number_signals, write_opendrive
from scenewright.tools.track_io.osi import PACKAGE, SCHEMA, load_osi_classes
from scenewright.tools.track_io.protobuf_schema import describe_file

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


def write_osi(scene: ExportedScene) -> dict[str, bytes]:
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
        there = [each for each in users if each.first <= k <= each.last]
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
