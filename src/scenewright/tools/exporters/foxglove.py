"""Foxglove: a scene to look at, as JSON messages of Foxglove's own schemas in MCAP."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Sequence
from typing import Any

from scenewright.tools.exporters.exported_scene import ExportedAgent, ExportedScene
from scenewright.tools.exporters.mcap_writing import Topic, write_mcap

FRAME = "map"
_OBJECT = json.dumps({"type": "object"}).encode()
_UPDATE = "foxglove.SceneUpdate"
_TOPICS = {
    "/map": Topic("/map", _UPDATE, "jsonschema", _OBJECT, "json"),
    "/agents": Topic("/agents", _UPDATE, "jsonschema", _OBJECT, "json"),
    "/events": Topic("/events", "foxglove.Log", "jsonschema", _OBJECT, "json"),
}
_NO_TIME = {"sec": 0, "nsec": 0}
_INFO = 2
_PEDESTRIAN, _VEHICLE, _FOREGROUND = (0.2, 0.6, 0.9), (0.6, 0.6, 0.65), (0.9, 0.3, 0.2)
_LINE_STRIP = 0
_LINES = {"lane": (0.5, 0.5, 0.5), "crosswalk": (0.9, 0.9, 0.9)}


def write_foxglove(scene: ExportedScene) -> dict[str, bytes]:
    """Lanes and crosswalks on /map, boxes on /agents every 0.1 s, a line per event on /events."""
    messages = sorted(_list_messages(scene), key=lambda each: each[1])
    content = write_mcap(
        ((_TOPICS[name], nanos, json.dumps(body, separators=(",", ":")).encode())
         for name, nanos, body in messages),
        metadata={"scenewright": {"instruction": scene.record.meta.user_prompt}},
    )  # fmt: skip
    return {f"{scene.name}.foxglove.mcap": content}


def _list_messages(scene: ExportedScene) -> Iterator[tuple[str, int, dict[str, Any]]]:
    lines = [(each.id, "lane", each.centreline) for each in scene.intersection_map.lanelets]
    lines += [
        (each.id, "crosswalk", (*each.polygon, each.polygon[0]))
        for each in scene.intersection_map.crosswalks
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
    names = {agent.id: agent.name for agent in scene.agents}
    for event in scene.record.events:
        if event.time is not None:
            nanos = round((event.time - scene.offset * scene.step) * 1e9)
            message = f"{event.type}: {names.get(event.from_ or 0)}, {names.get(event.to or 0)}"
            yield "/events", nanos, {
                "timestamp": _build_stamp(nanos), "level": _INFO, "message": message,
                "name": "scenewright", "file": "", "line": 0,
            }  # fmt: skip


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
    (x, y), half = agent.xy[k].tolist(), float(agent.heading[k]) / 2
    foreground = agent.role == "foreground"
    usual = _VEHICLE if agent.names.is_vehicle else _PEDESTRIAN
    box = {
        "pose": {
            "position": {"x": x, "y": y, "z": agent.height / 2},
            "orientation": {"x": 0.0, "y": 0.0, "z": math.sin(half), "w": math.cos(half)},
        },
        "size": {"x": agent.length, "y": agent.width, "z": agent.height},
        "color": _choose_colour(_FOREGROUND if foreground else usual),
    }
    entity = _describe_entity(agent.name, nanos, cubes=[box])
    # It disappears with its last sample instead of staying for good.
    return entity | {"lifetime": _build_stamp(round(agent.step * 1e9))}


def _describe_line(name: str, kind: str, points: Sequence[Sequence[float]]) -> dict[str, Any]:
    line = {
        "type": _LINE_STRIP,
        "pose": {
            "position": {"x": 0.0, "y": 0.0, "z": 0.0},
            "orientation": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0},
        },
        "thickness": 0.1, "scale_invariant": False, "color": _choose_colour(_LINES[kind]),
        "points": [{"x": float(x), "y": float(y), "z": 0.0} for x, y in points],
        "colors": [], "indices": [],
    }  # fmt: skip
    return _describe_entity(name, 0, lines=[line])
