"""Foxglove: a scene to look at, as JSON messages of Foxglove's own schemas in MCAP."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Sequence
from typing import Any

from scenewright.tools.formats.exported_scene import ExportedAgent, ExportedScene
from scenewright.tools.formats.lanes import find_light_places
from scenewright.tools.formats.mcap_writing import Topic, write_mcap

FRAME = "map"
_SCHEMAS = {
    "Time": "sec integer, nsec integer",
    "Vector3": "x number, y number, z number",
    "Quaternion": "x number, y number, z number, w number",
    "Color": "r number, g number, b number, a number",
    "Pose": "position Vector3, orientation Quaternion",
    "Solid": "pose Pose, size Vector3, color Color",
    "Line": "type integer, pose Pose, thickness number, scale_invariant boolean, color Color, "
    "points *Vector3, colors *Color, indices *integer",
    "Entity": "timestamp Time, frame_id string, id string, lifetime Time, frame_locked boolean, "
    "metadata *object, arrows *object, cubes *Solid, spheres *Solid, cylinders *object, "
    "lines *Line, triangles *object, texts *object, models *object",
    "SceneUpdate": "deletions *object, entities *Entity",
    "Log": "timestamp Time, level integer, message string, name string, file string, line integer",
}
"""Fields of Foxglove's message types that are used, a star before the type of each one of many."""
_TOPIC_TYPES = {"/map": "SceneUpdate", "/agents": "SceneUpdate", "/lights": "SceneUpdate",
                "/events": "Log"}  # fmt: skip
_NO_TIME = {"sec": 0, "nsec": 0}
_INFO = 2
_PEDESTRIAN, _VEHICLE, _FOREGROUND = (0.2, 0.6, 0.9), (0.6, 0.6, 0.65), (0.9, 0.3, 0.2)
_LIGHTS = {
    "red": (0.9, 0.1, 0.1), "yellow": (0.95, 0.8, 0.1), "green": (0.1, 0.8, 0.2),
    None: (0.4, 0.4, 0.4),
}  # fmt: skip
_LIGHT_SIZE, _LIGHT_HEIGHT = 0.6, 3.0
_LINE_STRIP = 0
_LINES = {"lane": (0.5, 0.5, 0.5), "crosswalk": (0.9, 0.9, 0.9)}


def write(scene: ExportedScene) -> dict[str, bytes]:
    """Lanes on /map, boxes on /agents every 0.1 s, changes of /lights, a line per event."""
    messages = sorted(_list_messages(scene), key=lambda each: each[1])
    topics = {
        name: Topic(
            name, f"foxglove.{kind}", "jsonschema", json.dumps(_build_schema(kind)).encode(), "json"
        )
        for name, kind in _TOPIC_TYPES.items()
    }
    content = write_mcap(
        ((topics[name], nanos, json.dumps(body, separators=(",", ":")).encode())
         for name, nanos, body in messages),
        metadata={"scenewright": {"instruction": scene.record.meta.user_prompt}},
    )  # fmt: skip
    return {f"{scene.name}.foxglove.mcap": content}


def _build_schema(kind: str) -> dict[str, Any]:
    """The JSON schema of a message type, or of a plain one."""
    if kind.startswith("*"):
        return {"type": "array", "items": _build_schema(kind[1:])}
    if kind not in _SCHEMAS:
        return {"type": kind}
    fields = (each.split() for each in _SCHEMAS[kind].split(","))
    return {
        "title": f"foxglove.{kind}", "type": "object",
        "properties": {name: _build_schema(part) for name, part in fields},
    }  # fmt: skip


def _list_messages(scene: ExportedScene) -> Iterator[tuple[str, int, dict[str, Any]]]:
    lines = [
        (lanelet.id, "lane", lanelet.centreline) for lanelet in scene.intersection_map.lanelets
    ]
    lines += [
        (crosswalk.id, "crosswalk", (*crosswalk.polygon, crosswalk.polygon[0]))
        for crosswalk in scene.intersection_map.crosswalks
    ]
    yield "/map", 0, {"deletions": [], "entities": [_describe_line(*line) for line in lines]}
    for k, time in enumerate(scene.times.tolist()):
        nanos = round(time * 1e9)
        boxes = [
            _describe_box(agent, k - agent.first, nanos)
            for agent in (*scene.agents, *scene.objects)
            if agent.first <= k <= agent.last
        ]
        yield "/agents", nanos, {"deletions": [], "entities": boxes}
    yield from _list_lights(scene)
    names = {each.id: each.name for each in (*scene.agents, *scene.objects)}
    for event in scene.events:
        if event.time is not None:
            nanos = round((event.time - scene.offset * scene.step) * 1e9)
            message = f"{event.type}: {names.get(event.from_ or 0)}, {names.get(event.to or 0)}"
            yield "/events", nanos, {
                "timestamp": _build_stamp(nanos), "level": _INFO, "message": message,
                "name": "scenewright", "file": "", "line": 0,
            }  # fmt: skip


def _list_lights(scene: ExportedScene) -> Iterator[tuple[str, int, dict[str, Any]]]:
    """Every light when it changes, over the middle of its stop line or crosswalk."""
    places = find_light_places(scene.intersection_map)
    for name, colours in scene.list_colours().items():
        for k, colour in enumerate(colours):
            if name in places and (k == 0 or colour != colours[k - 1]):
                nanos = round(float(scene.times[k]) * 1e9)
                ball = {
                    "pose": _build_pose(places[name], _LIGHT_HEIGHT),
                    "size": dict.fromkeys("xyz", _LIGHT_SIZE),
                    "color": _choose_colour(_LIGHTS[colour]),
                }
                entity = _describe_entity(name, nanos, spheres=[ball])
                yield "/lights", nanos, {"deletions": [], "entities": [entity]}


def _build_pose(xy: Any, z: float, turn: float = 0.0) -> dict[str, Any]:
    """A place [m], turned about the vertical [rad]."""
    return {
        "position": {"x": float(xy[0]), "y": float(xy[1]), "z": z},
        "orientation": {"x": 0.0, "y": 0.0, "z": math.sin(turn / 2), "w": math.cos(turn / 2)},
    }


def _build_stamp(nanos: int) -> dict[str, int]:
    return {"sec": nanos // 10**9, "nsec": nanos % 10**9}


def _choose_colour(rgb: tuple[float, float, float]) -> dict[str, float]:
    return dict(zip("rgba", (*rgb, 1.0), strict=True))


def _describe_entity(name: str, nanos: int, **primitives: Any) -> dict[str, Any]:
    kinds = ("arrows", "cubes", "spheres", "cylinders", "lines", "triangles", "texts", "models")
    return {
        "timestamp": _build_stamp(nanos), "frame_id": FRAME, "id": name, "lifetime": _NO_TIME,
        "frame_locked": True, "metadata": [], **{kind: [] for kind in kinds}, **primitives,
    }  # fmt: skip


def _describe_box(agent: ExportedAgent, k: int, nanos: int) -> dict[str, Any]:
    foreground = agent.role == "foreground"
    usual = _VEHICLE if agent.names.is_vehicle else _PEDESTRIAN
    box = {
        "pose": _build_pose(agent.xy[k], agent.height / 2, float(agent.heading[k])),
        "size": {"x": agent.length, "y": agent.width, "z": agent.height},
        "color": _choose_colour(_FOREGROUND if foreground else usual),
    }
    entity = _describe_entity(agent.name, nanos, cubes=[box])
    # It disappears with its last sample instead of staying for good.
    return entity | {"lifetime": _build_stamp(round(agent.step * 1e9))}


def _describe_line(name: str, kind: str, points: Sequence[Sequence[float]]) -> dict[str, Any]:
    line = {
        "type": _LINE_STRIP, "pose": _build_pose((0.0, 0.0), 0.0),
        "thickness": 0.1, "scale_invariant": False, "color": _choose_colour(_LINES[kind]),
        "points": [{"x": float(x), "y": float(y), "z": 0.0} for x, y in points],
        "colors": [], "indices": [],
    }  # fmt: skip
    return _describe_entity(name, 0, lines=[line])
