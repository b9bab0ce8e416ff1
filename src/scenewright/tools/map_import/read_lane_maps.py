"""Lanes of CommonRoad XML, Argoverse 2 maps and Waymo Open Motion records, as lane graphs.

All three draw each lane for itself. CommonRoad and Argoverse 2 give both bounds; Waymo gives the
middle alone, and its lanes are taken to be 3.5 m wide.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from scenewright.errors import InputError
from scenewright.geometry.polyline import (
    compute_normals,
    drop_doubled_points,
    measure_length,
    resample_by_spacing,
)
from scenewright.scene.base import FloatArray
from scenewright.tools.map_import.lane_graph import USUAL_LIMIT, FileLane, LaneGraph
from scenewright.tools.map_import.mapped_crosswalks import build_area_crossing
from scenewright.tools.map_import.survey import SurveyCrossing

_WAYMO_WIDTH = 3.5
_WAYMO_NOTE = "lanes are drawn by their middle alone; they were taken to be 3.5 m wide"
_WAYMO_STREETS = (1, 2)
"""Types of Waymo's lanes that cars drive on: freeways and surface streets."""


def load_lane_map(file: Path, map_format: str) -> LaneGraph:
    """The lanes of a file.

    Raises:
        InputError: unreadable.
    """
    try:
        lanes, crossings, others = _READERS[map_format](file)
    except (KeyError, TypeError, ValueError, IndexError) as fault:
        raise InputError(f"{file} cannot be read: {str(fault)[:80]} is missing or wrong") from None
    notes = [_WAYMO_NOTE] * (map_format == "womd")
    return LaneGraph.build(file, lanes, others, *notes, crossings=tuple(crossings))


_DRIVEN = ("VEHICLE", "BUS")
"""Types of Argoverse's lanes; those of buses lie beside those of cars."""
_Found = tuple[list[FileLane], list[SurveyCrossing], int]
"""Lanes that cars drive on, crossings, and how many other lanes there are."""
_COMMONROAD_OTHERS = frozenset(
    (
        *("sidewalk", "bicycleLane", "border", "shoulder", "restricted"),
        *("busLane", "busStop", "parking", "driveWay"),
    )
)


def _read_commonroad(file: Path) -> _Found:
    lanes, crossings, others = [], [], 0
    for element in ElementTree.parse(file).getroot().iter("lanelet"):
        left, right = (_read_bound(element, side) for side in ("leftBound", "rightBound"))
        if left is None or right is None:
            continue
        kinds = {(each.text or "").strip() for each in element.iterfind("laneletType")}
        if "crosswalk" in kinds:
            crossings.append(build_area_crossing(np.concatenate([left, right])))
        elif kinds & _COMMONROAD_OTHERS:
            others += 1
        else:
            lanes.append(FileLane(element.get("id", ""), left, right))
    return lanes, crossings, others


def _read_bound(element: ElementTree.Element, side: str) -> FloatArray | None:
    points = [
        (float(point.findtext("x", "")), float(point.findtext("y", "")))
        for point in element.iterfind(f"{side}/point")
    ]
    return _clean(np.array(points)) if len(points) > 1 else None


def _clean(line: FloatArray) -> FloatArray:
    if not np.isfinite(line).all() or measure_length(line) < 0.01:
        raise ValueError("a bound with length")
    return drop_doubled_points(line)


def _read_argoverse2(file: Path) -> _Found:
    held = json.loads(file.read_text(encoding="utf-8"))
    lanes = [
        FileLane(
            str(each["id"]), _list_points(each["left_lane_boundary"]),
            _list_points(each["right_lane_boundary"]),
        )
        for each in held["lane_segments"].values()
        if each.get("lane_type", "VEHICLE") in _DRIVEN
    ]  # fmt: skip
    crossings = [
        build_area_crossing(np.concatenate([_list_points(each[e]) for e in ("edge1", "edge2")]))
        for each in held.get("pedestrian_crossings", {}).values()
    ]
    return lanes, crossings, len(held["lane_segments"]) - len(lanes)


def _list_points(points: Sequence[Any]) -> FloatArray:
    return _clean(np.array([(float(point["x"]), float(point["y"])) for point in points]))


def _read_womd(file: Path) -> _Found:
    from google.protobuf.message import DecodeError

    from scenewright.tools.formats.womd import load_scenario_class, read_example, read_records

    record = next(iter(read_records(file.read_bytes(), name=str(file))), b"")
    if read_example(record) is not None:
        raise InputError(f"{file} holds tf.Example, whose maps are points; give Scenario records")
    try:
        scenario = load_scenario_class().FromString(record)
    except DecodeError:
        raise InputError(f"{file} is no file of Waymo's Scenario records") from None
    lanes = []
    for feature in scenario.map_features:
        if feature.HasField("lane") and feature.lane.type in _WAYMO_STREETS:
            mph = feature.lane.speed_limit_mph
            limit = round(1.609344 * mph) / 3.6 if mph > 0 else USUAL_LIMIT
            lines = _list_lines(feature.lane.polyline)
            lanes += [FileLane(str(feature.id), *_widen(line), speed=limit) for line in lines]
    crossings = [
        build_area_crossing(np.array([(p.x, p.y) for p in feature.crosswalk.polygon]))
        for feature in scenario.map_features
        if feature.HasField("crosswalk") and len(feature.crosswalk.polygon) >= 4
    ]
    others = sum(
        feature.HasField("lane") and feature.lane.type not in _WAYMO_STREETS
        for feature in scenario.map_features
    )
    return lanes, crossings, others


def _list_lines(points: Any) -> Iterator[FloatArray]:
    line = np.array([(point.x, point.y) for point in points])
    if len(line) > 1 and measure_length(line) > 0.5:
        yield drop_doubled_points(line)


def _widen(line: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The bounds of a lane about its middle."""
    line = resample_by_spacing(line, 1.0)
    aside = compute_normals(line) * _WAYMO_WIDTH / 2
    return line + aside, line - aside


_READERS = {"commonroad": _read_commonroad, "argoverse2": _read_argoverse2, "womd": _read_womd}
