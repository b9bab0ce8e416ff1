"""Dynamic obstacles of CommonRoad XML files (versions 2018b and 2020a)."""

from __future__ import annotations

from xml.etree import ElementTree

import numpy as np

from scenewright.errors import InputError
from scenewright.scene.base import FloatArray
from scenewright.tools.track_io.sampled_recording import (
    AgentSamples,
    SampledRecording,
    find_road_user,
    sort_out,
)
from scenewright.tools.track_io.xml_reading import parse_number

_Element = ElementTree.Element


def read_commonroad(root: _Element, *, name: str) -> list[SampledRecording]:
    """The dynamic obstacles that have trajectories; static ones are left out.

    Raises:
        InputError: a state that is not exact, a shape other than one rectangle or circle, or a
            prediction by sets of places.
    """
    step = parse_number(root.get("timeStepSize"), name=name, what="timeStepSize")
    found: list[tuple[str, AgentSamples | None]] = [
        (each.findtext("type") or "static obstacle", None) for each in root.iter("staticObstacle")
    ]
    for obstacle in root.iter("dynamicObstacle"):
        word = (obstacle.findtext("type") or "").strip()
        subtype = find_road_user(word)
        where = f"{name}, obstacle {obstacle.get('id', '')[:40]}"
        agent = None if subtype is None else _read_obstacle(obstacle, subtype, step, where)
        found.append((word, agent))
    return [sort_out("", found)]


def _read_obstacle(obstacle: _Element, subtype: str, step: float, name: str) -> AgentSamples:
    if obstacle.find("occupancySet") is not None:
        raise InputError(f"{name}: it is predicted by sets of places; only trajectories are read")
    length, width, middle = _read_shape(obstacle, name)
    states = [obstacle.find("initialState"), *obstacle.iterfind("trajectory/state")]
    rows = np.array([_read_state(state, name) for state in states if state is not None])
    if not len(rows):
        raise InputError(f"{name}: it has no states")
    heading = rows[:, 3]
    c, s = np.cos(heading), np.sin(heading)
    offset = np.stack([c * middle[0] - s * middle[1], s * middle[0] + c * middle[1]], axis=1)
    who = obstacle.get("id", "")
    return AgentSamples(
        who, subtype, rows[:, 0] * step, rows[:, 1:3] + offset, heading, length, width
    )


def _read_shape(obstacle: _Element, name: str) -> tuple[float, float, FloatArray]:
    """Length, width and the middle of the shape in the obstacle's own frame [m]."""
    shapes = list(obstacle.iterfind("shape/*"))
    if len(shapes) != 1 or shapes[0].tag not in ("rectangle", "circle"):
        raise InputError(f"{name}: only shapes of one rectangle or one circle can be read")
    shape = shapes[0]
    if float(shape.findtext("orientation") or 0.0):
        raise InputError(f"{name}: rectangles that are turned in their own frame cannot be read")
    middle = np.array([float(shape.findtext(f"center/{axis}") or 0.0) for axis in ("x", "y")])
    if shape.tag == "circle":
        size = 2 * parse_number(shape.findtext("radius"), name=name, what="radius")
        return size, size, middle
    length, width = (
        parse_number(shape.findtext(key), name=name, what=key) for key in ("length", "width")
    )
    return length, width, middle


def _read_state(state: _Element, name: str) -> tuple[float, float, float, float]:
    """Time step, x, y and orientation."""
    paths = ("time/exact", "position/point/x", "position/point/y", "orientation/exact")
    if any(state.find(path) is None for path in paths):
        raise InputError(f"{name}: only states with exact time, place and orientation can be read")
    t, x, y, turn = (
        parse_number(state.findtext(path), name=name, what=path.split("/", maxsplit=1)[0])
        for path in paths
    )
    return t, x, y, turn
