"""A scene made by hand for exporters: a strike, an agent that enters late, text that is markup."""

from __future__ import annotations

import math
from functools import cache
from typing import Any

import numpy as np

from scenewright.intersections import load_map
from scenewright.scene.record import SceneRecord
from scenewright.tools.formats import ExportedScene, prepare_scene

NASTY = """A <b>car</b> & "friends" ]]> hits 'him' <!ENTITY x SYSTEM "file:///etc/passwd">"""
CONTACT = 4.0
"""Sample [s] from which car and pedestrian touch."""


def make_agent(
    number: int, name: str, start: float, xy: np.ndarray, heading: float, **more: Any
) -> dict[str, Any]:
    """One agent of scene.json that moves along positions [T, 2]."""
    pedestrian = name.startswith("pedestrian")
    size = (0.6, 0.6) if pedestrian else (4.6, 1.85)
    return {
        "id": number, "type": "pedestrian" if pedestrian else "vehicle", "spawn_time": start,
        "goal": xy[-1].tolist(), "trajectory": xy.tolist(), "role": "foreground", "name": name,
        "subtype": None if pedestrian else "car", "entry": "south", "exit": "north",
        "movement": "crossing" if pedestrian else "straight",
        "route": "vehicle:south>north:straight", "heading": [heading] * len(xy),
        "length": size[0], "width": size[1],
    } | more  # fmt: skip


def make_line(start: tuple[float, float], speed: tuple[float, float], seconds: float) -> np.ndarray:
    """[T, 2] positions every 0.1 s of even motion, kept to 1 mm."""
    t = np.arange(round(seconds * 10) + 1)[:, None] / 10
    return np.round(np.array(start) + t * np.array(speed), 3)


@cache
def make_record() -> SceneRecord:
    """The scene, 10 s long: vehicle-1 strikes pedestrian-1, vehicle-2 comes 2 s late."""
    car = make_line((4.95, -49.0), (0.0, 10.0), 4.0)
    # The front of the car is at -6.7 when it reaches the pedestrian's disc.
    walker = make_line((9.0, -6.5), (-1.0, 0.0), 4.0)
    route = np.stack([np.full(10, 4.95), np.linspace(-49.0, 49.0, 10)], axis=1)
    late = make_line((49.0, 1.75), (-8.0, 0.0), 6.0)
    agents = [
        make_agent(1, "vehicle-1", 0.0, car, math.pi / 2 - 2 * math.pi, waypoints=route.tolist()),
        make_agent(2, "pedestrian-1", 0.0, walker, math.pi),
        make_agent(3, "vehicle-2", 2.0, late, math.pi + 0.01, role="background", entry="east",
                   exit="west", route="vehicle:east>west:straight", subtype="truck",
                   length=8.5, width=2.5),
    ]  # fmt: skip
    light = {"stop_line": "south:stop", "start": 0.0, "end": 6.0, "colour": "green"}
    meta = {
        "scene_id": "hand made/1", "map_id": 120, "timestamp": 28800.0, "user_prompt": NASTY,
        "intersection": "amsterdam_120", "step": 0.1, "duration": 10.0, "time_of_day": "08:00",
        "seed": 0,
    }  # fmt: skip
    event = {"type": "collision", "from": 1, "to": 2, "time": CONTACT, "location": [4.95, -6.5]}
    rows = [light, light | {"start": 6.0, "end": 10.0, "colour": "red"}]
    return SceneRecord.model_validate(
        {"meta": meta, "agents": agents, "events": [event], "signals": rows}
    )


@cache
def make_scene(ego: str | None = None) -> ExportedScene:
    """The same, prepared for exporters."""
    return prepare_scene(make_record(), load_map("amsterdam_120"), ego=ego)
