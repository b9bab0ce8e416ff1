"""Trajectories in OpenSCENARIO files (.xosc, versions 1.0 to 1.3).

Read are the polylines of FollowTrajectoryActions with world positions; routes, speeds and other
actions say where an agent would drive in a simulator, not where it was.
"""

from __future__ import annotations

from xml.etree import ElementTree

import numpy as np

from scenewright.errors import InputError
from scenewright.scene.base import FloatArray
from scenewright.scene.track import STEP
from scenewright.tools.track_io.sampled_recording import (
    AgentSamples,
    SampledRecording,
    find_road_user,
    resample_if_uneven,
    sort_out,
)
from scenewright.tools.track_io.xml_reading import parse_number, parse_xml

_Element = ElementTree.Element
_HELD_FROM = 0.5
"""Nothing stands still within a step from such a speed [m/s]."""
_FOLLOW = "Action/PrivateAction/RoutingAction/FollowTrajectoryAction"
_TIME = "StartTrigger/ConditionGroup/Condition/ByValueCondition/SimulationTimeCondition"


def read_openscenario(data: bytes, *, name: str) -> list[SampledRecording]:
    """The trajectories of all entities that have one.

    Vertices that are not evenly 0.1 s apart are resampled, as the standard defines the track
    between two vertices.

    Raises:
        InputError: no OpenSCENARIO, no trajectory, or one that is not in world positions.
    """
    root = parse_xml(data, name=name)
    if root.tag != "OpenSCENARIO":
        raise InputError(f"{name} is no OpenSCENARIO file: its root is {root.tag[:40]!r}")
    entities = {each.get("name", ""): each for each in root.iterfind("Entities/ScenarioObject")}
    found = []
    for group in root.iter("ManeuverGroup"):
        actors = [each.get("entityRef", "") for each in group.iterfind("Actors/EntityRef")]
        for event in group.iterfind("Maneuver/Event"):
            follow = event.find(_FOLLOW)
            if follow is not None:
                found += [_read_agent(entities.get(a), a, event, follow, name) for a in actors]
    if not found:
        raise InputError(f"{name} has no trajectories; routes and speeds cannot be checked")
    return [sort_out("", found)]


def _read_agent(
    entity: _Element | None, actor: str, event: _Element, follow: _Element, name: str
) -> tuple[str, AgentSamples | None]:
    """The word for what the entity is, and its samples if it is a road user."""
    if entity is None:
        raise InputError(f"{name}: no entity {actor[:40]!r}")
    # What the entity is in a word, and its element, where it is not in a catalogue.
    word, body = "object", None
    for part in entity:
        if part.tag in ("Vehicle", "Pedestrian"):
            animal = part.get("pedestrianCategory") == "animal"
            walks = "animal" if animal else "pedestrian"
            word = part.get("vehicleCategory", "") if part.tag == "Vehicle" else walks
            body = part
            break
        if part.tag == "CatalogReference":
            entry = part.get("entryName", "").replace("_", " ").split()
            word = next((each for each in entry if find_road_user(each)), "catalogue entry")
            break
    subtype = find_road_user(word)
    if subtype is None:
        return word, None
    t, places = _read_vertices(event, follow, f"{name}, {actor[:40]}")
    size = None if body is None else body.find("BoundingBox/Dimensions")
    middle = None if body is None else body.find("BoundingBox/Center")
    heading = places[:, 2] if np.isfinite(places[:, 2]).all() else None
    xy = places[:, :2]
    if middle is not None and heading is not None:
        x, y = (parse_number(middle.get(axis), name=name, what=axis) for axis in ("x", "y"))
        c, s = np.cos(heading), np.sin(heading)
        xy = xy + np.stack([c * x - s * y, s * x + c * y], axis=1)
    length, width = (
        None if size is None else parse_number(size.get(key), name=name, what=key)
        for key in ("length", "width")
    )
    agent = AgentSamples(actor, subtype, t, xy, heading, length, width)
    return word, resample_if_uneven(agent, STEP)


def _read_vertices(event: _Element, follow: _Element, name: str) -> tuple[FloatArray, FloatArray]:
    """[T] times [s] on the scenario's clock and [T, 3] x, y, heading (NaN where not stated)."""
    vertices = list(follow.iter("Vertex"))
    if not vertices:
        raise InputError(f"{name}: only trajectories as polylines can be checked")
    if any(vertex.get("time") is None for vertex in vertices):
        raise InputError(f"{name}: the trajectory has no times, so where it is when is open")
    rows = np.full((len(vertices), 3), np.nan)
    for row, vertex in zip(rows, vertices, strict=True):
        place = vertex.find("Position/WorldPosition")
        if place is None:
            raise InputError(f"{name}: only trajectories in world positions can be checked")
        for k, axis in enumerate(("x", "y", "h")):
            if axis != "h" or place.get("h") is not None:
                row[k] = parse_number(place.get(axis), name=name, what=axis)
    t = np.array([parse_number(each.get("time"), name=name, what="time") for each in vertices])
    timing = follow.find("TimeReference/Timing")
    if timing is None:
        raise InputError(f"{name}: the trajectory has no timing, so where it is when is open")
    scale, offset = (
        parse_number(timing.get(key, default), name=name, what=key)
        for key, default in (("scale", "1"), ("offset", "0"))
    )
    t = scale * t + offset
    if timing.get("domainAbsoluteRelative") != "absolute":
        trigger = event.find(_TIME)
        if trigger is None:
            raise InputError(f"{name}: it starts by a trigger other than time, so when is open")
        t = t + parse_number(trigger.get("value"), name=name, what="trigger")
    if (np.diff(t) <= 0).any():
        raise InputError(f"{name}: the times of the vertices do not rise")
    if len(t) > 2 and (rows[-1] == rows[-2]).all():
        before = np.hypot(*(rows[-2] - rows[-3])[:2]) / (t[-2] - t[-3])
        if before > _HELD_FROM:  # the last one only holds an agent whose track a collision ended
            return t[:-1], rows[:-1]
    return t, rows
