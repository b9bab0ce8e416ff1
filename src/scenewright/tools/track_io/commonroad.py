"""Dynamic obstacles of CommonRoad XML files (versions 2018b and 2020a)."""

from __future__ import annotations

from xml.etree import ElementTree

import numpy as np

from scenewright.errors import InputError
from scenewright.tools.track_io.sampled_recording import (
    AgentSamples,
    SampledRecording,
    find_road_user,
    sort_out,
)
from scenewright.tools.track_io.xml_reading import parse_number

_Element = ElementTree.Element
_STATE = ("time/exact", "position/point/x", "position/point/y", "orientation/exact")


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
    shapes = list(obstacle.iterfind("shape/*"))
    if len(shapes) != 1 or shapes[0].tag not in ("rectangle", "circle"):
        raise InputError(f"{name}: only shapes of one rectangle or one circle can be read")
    shape = shapes[0]
    if float(shape.findtext("orientation") or 0.0):
        raise InputError(f"{name}: rectangles that are turned in their own frame cannot be read")
    if shape.tag == "circle":
        length = width = 2 * parse_number(shape.findtext("radius"), name=name, what="radius")
    else:
        length, width = (
            parse_number(shape.findtext(key), name=name, what=key) for key in ("length", "width")
        )
    rows = []
    for state in (obstacle.find("initialState"), *obstacle.iterfind("trajectory/state")):
        if state is None:
            continue
        if any(state.find(path) is None for path in _STATE):
            raise InputError(
                f"{name}: only states with exact time, place and orientation can be read"
            )
        rows.append([
            parse_number(state.findtext(path), name=name, what=path.split("/", maxsplit=1)[0])
            for path in _STATE
        ])  # fmt: skip
    if not rows:
        raise InputError(f"{name}: it has no states")
    t, x, y, heading = np.array(rows).T
    # The middle of the shape may lie beside the origin of the obstacle's own frame.
    ahead, left = (float(shape.findtext(f"center/{axis}") or 0.0) for axis in ("x", "y"))
    c, s = np.cos(heading), np.sin(heading)
    xy = np.stack([x + (c * ahead - s * left), y + (s * ahead + c * left)], axis=1)
    return AgentSamples(obstacle.get("id", ""), subtype, t * step, xy, heading, length, width)
