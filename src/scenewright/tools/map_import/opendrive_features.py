"""What netconvert leaves out of an OpenDRIVE file: crosswalk objects, lights, the driving side."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
from numpy.polynomial import Polynomial

from scenewright.errors import InputError
from scenewright.scene.base import FloatArray
from scenewright.tools.map_import.mapped_crosswalks import build_area_crossing
from scenewright.tools.map_import.survey import SurveyCrossing, SurveyLight

_STEP = 0.25
"""Between points of a reference line [m]."""
_LONGEST, _LARGEST = 100_000.0, 1e9
"""Longest piece of a reference line that is traced [m]; largest number that is read."""
_LIGHTS = ("1000001", "1000007", "1000008", "1000009", "1000010", "1000011", "1000012",
           "1000013", "1000014", "1000016", "1000020")  # fmt: skip
"""Types of the OpenDRIVE catalogue that are lights for vehicles."""


@dataclass(frozen=True, eq=False)
class OpenDriveRoad:
    """A road: the XML element, and its reference line.

    Attributes:
        stations: [P] along it [m]; points: [P, 2] [m]; headings: [P] [rad].
    """

    id: str
    element: Any
    stations: FloatArray
    points: FloatArray
    headings: FloatArray

    def locate(self, s: float, t: float) -> FloatArray:
        """[2] a place along and beside the reference line [m]."""
        at = [float(np.interp(s, self.stations, column)) for column in self.points.T]
        heading = self.find_heading(s)
        return np.array([at[0] - t * math.sin(heading), at[1] + t * math.cos(heading)])

    def find_heading(self, s: float) -> float:
        """The direction of the reference line [rad]."""
        return float(np.interp(s, self.stations, self.headings))


@dataclass(frozen=True, eq=False)
class OpenDriveFile:
    """Roads and the elements beside them of a file."""

    root: Any
    roads: Sequence[OpenDriveRoad] = field(default_factory=tuple)

    @cached_property
    def rules(self) -> Mapping[str, int]:
        """How many roads say that traffic drives on the right (RHT) or on the left (LHT)."""
        return Counter(each.get("rule", "") for each in self.root.iter("road") if each.get("rule"))


def read_opendrive_file(file: Path) -> OpenDriveFile:
    """The roads of a file that is known to be well-formed.

    Raises:
        InputError: numbers that are none, or that no road has.
    """
    root = ElementTree.parse(file).getroot()
    for element in root.iter():
        element.tag = element.tag.rsplit("}", 1)[-1]
    roads = [road for each in root.iter("road") if (road := _build_road(each)) is not None]
    return OpenDriveFile(root, tuple(roads))


def _read(element: Any, name: str) -> float:
    """A number of an element, 0 where it has none; InputError if it cannot be computed with."""
    text = element.get(name) or "0"
    with suppress(ValueError):
        if abs(value := float(text)) <= _LARGEST:
            return value
    raise InputError(f"the map has a {element.tag} whose {name} is {text[:40]!r}, no usable number")


def _build_road(element: Any) -> OpenDriveRoad | None:
    pieces = [_trace_geometry(each) for each in element.iter("geometry")]
    pieces = [piece for piece in pieces if piece is not None]
    if not pieces:
        return None
    stations, x, y, headings = (np.concatenate(column) for column in zip(*pieces, strict=True))
    points = np.column_stack([x, y])
    return OpenDriveRoad(element.get("id", ""), element, stations, points, np.unwrap(headings))


def _trace_geometry(element: Any) -> tuple[FloatArray, ...] | None:
    """Stations, x, y and headings along one piece of a reference line."""
    length = _read(element, "length")
    if length > _LONGEST:
        raise InputError(
            f"the map has a road of {length:.4g} m; at most {_LONGEST:g} m can be read"
        )
    if length <= 0.0 or not len(element):
        return None
    ds = np.linspace(0.0, length, max(math.ceil(length / _STEP), 1) + 1)
    x, y, turn = _trace_shape(element[0], ds, length)
    heading = _read(element, "hdg")
    cos, sin = math.cos(heading), math.sin(heading)
    return (
        _read(element, "s") + ds,
        _read(element, "x") + cos * x - sin * y,
        _read(element, "y") + sin * x + cos * y,
        heading + turn,
    )


def _trace_shape(
    shape: Any, ds: FloatArray, length: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """x, y and heading of a shape in its own frame."""
    if shape.tag == "poly3":
        v = Polynomial([_read(shape, name) for name in "abcd"])
        return ds, v(ds), np.arctan(v.deriv()(ds))
    if shape.tag == "paramPoly3":
        p = ds if shape.get("pRange") == "arcLength" else ds / length
        u, v = (Polynomial([_read(shape, name + side) for name in "abcd"]) for side in "UV")
        return u(p), v(p), np.arctan2(v.deriv()(p), u.deriv()(p))
    begin = _read(shape, "curvature") if shape.tag == "arc" else _read(shape, "curvStart")
    end = begin if shape.tag == "arc" else _read(shape, "curvEnd")
    turn = begin * ds + (end - begin) * ds**2 / (2 * length)
    step = np.diff(ds)
    between = (turn[1:] + turn[:-1]) / 2
    x = np.concatenate([[0.0], np.cumsum(step * np.cos(between))])
    y = np.concatenate([[0.0], np.cumsum(step * np.sin(between))])
    return x, y, turn


def list_opendrive_crossings(file: OpenDriveFile, middle: FloatArray) -> list[SurveyCrossing]:
    """The crosswalk objects of a file, in metres from a place."""
    found = []
    for road in file.roads:
        for element in road.element.iter("object"):
            kind, name = ((element.get(key) or "").lower() for key in ("type", "name"))
            if kind != "crosswalk" and "crosswalk" not in name and "zebra" not in name:
                continue
            if (outline := _trace_outline(road, element)) is not None:
                source = f"object {element.get('id', '?')} of road {road.id}"
                found.append(build_area_crossing(outline - middle, source))
    return found


def _trace_outline(road: OpenDriveRoad, element: Any) -> FloatArray | None:
    """[P, 2] the outline of an object [m]."""
    s, t = _read(element, "s"), _read(element, "t")
    corners = [*element.iter("cornerRoad")]
    if corners:
        return np.array([road.locate(_read(c, "s"), _read(c, "t")) for c in corners])
    local = [(_read(c, "u"), _read(c, "v")) for c in element.iter("cornerLocal")]
    if not local:
        u, v = _read(element, "length") / 2, _read(element, "width") / 2
        local = [(u, v), (-u, v), (-u, -v), (u, -v)] if u > 0 and v > 0 else []
    if len(local) < 3:
        return None
    heading = road.find_heading(s) + _read(element, "hdg")
    turn = np.array(
        [[math.cos(heading), math.sin(heading)], [-math.sin(heading), math.cos(heading)]]
    )
    return np.asarray(road.locate(s, t) + np.array(local) @ turn)


def list_opendrive_lights(file: OpenDriveFile, middle: FloatArray) -> list[SurveyLight]:
    """A light for every road that a traffic light of the file controls, at the road's end.

    A light on a road inside a junction controls the road that leads into it.
    """
    lights = {
        each.get("id")
        for each in file.root.iter("signal")
        if each.get("dynamic") == "yes" and each.get("type") in (*_LIGHTS, "-1", "", None)
    }
    controllers = {
        control.get("signalId"): controller.get("id", "")
        for controller in file.root.iter("controller")
        for control in controller.iter("control")
    }
    roads = {road.id: road for road in file.roads}
    found = []
    for road in file.roads:
        for element in (*road.element.iter("signal"), *road.element.iter("signalReference")):
            name = element.get("id")
            if name in lights:
                group = controllers.get(name, "")
                found += [
                    SurveyLight(each - middle, group) for each in _locate(road, element, roads)
                ]
    return found


def _locate(
    road: OpenDriveRoad, element: Any, roads: Mapping[str, OpenDriveRoad]
) -> Iterator[FloatArray]:
    """[2] where the lanes that a light controls are [m]."""
    if road.element.get("junction", "-1") == "-1":
        yield road.locate(_read(element, "s"), 0.0)
        return
    begin = road.element.find("link/predecessor")
    if begin is not None and begin.get("elementId") in roads:
        before = roads[begin.attrib["elementId"]]
        at_end = begin.get("contactPoint") == "end"
        length = float(before.stations[-1])
        yield before.locate(max(length - 1.0, 0.0) if at_end else min(1.0, length), 0.0)
