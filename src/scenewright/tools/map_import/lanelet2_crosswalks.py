"""Crossings of Lanelet2 files: crosswalk lanelets, and pairs of zebra lines without a lanelet."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

from scenewright.geometry.polyline import rotate_left
from scenewright.scene.base import FloatArray
from scenewright.tools.map_import.survey import SurveyCrossing

if TYPE_CHECKING:
    from scenewright.tools.map_import.lane_graph import FileLane
    from scenewright.tools.map_import.read_lanelet2 import FileElements

_MARKS = ("zebra_marking", "pedestrian_marking", "zebra")
"""Types of ways; the last is SinD's, the others are those of Lanelet2."""
_WIDTHS = (1.5, 10.0)
"""Between the two lines of one crosswalk [m]."""
_PARALLEL = math.radians(20.0)
_SHARED = 0.6
"""Of the shorter line's length that lies beside the other."""
_SHORTEST_MARK = 2.5
"""A mark shorter than this is a stripe, not the border of a crosswalk [m]."""
_ASSUMED_WIDTH = 3.0
"""Of a crosswalk of which one border is drawn [m]."""
_SAME_PLACE = 2.0
"""Marks whose middle lies closer to a crosswalk lanelet's are its own [m]."""


def read_lanelet2_crossings(
    elements: FileElements, crosswalks: Sequence[FileLane]
) -> list[SurveyCrossing]:
    """Crossings in metres: crosswalk lanelets, and marks that are not such a lanelet's."""
    lanelets = [
        SurveyCrossing(
            each.line[[0, -1]], float(np.clip(each.width, 1.0, 12.0)),
            source=f"crosswalk lanelet {each.id}",
        )
        for each in crosswalks
    ]  # fmt: skip
    drawn = _pair_marks(dict(_list_marks(elements)))
    places = [each.line.mean(axis=0) for each in lanelets]
    return [
        *lanelets,
        *(
            each
            for each in drawn
            if all(math.dist(each.line.mean(axis=0), place) >= _SAME_PLACE for place in places)
        ),
    ]


def _list_marks(elements: FileElements) -> Iterator[tuple[str, FloatArray]]:
    """Ends [2, 2] [m] of every mark that is no bound of a crosswalk lanelet."""
    own = (members for _, tags, members in elements.list_relations("lanelet")
           if tags.get("subtype") == "crosswalk")  # fmt: skip
    bounds = {ref for members in own for _, ref in members}
    for name, (tags, _) in elements.ways.items():
        if tags.get("type") in _MARKS and name not in bounds:
            line = elements.trace_way(name)
            if len(line) > 1 and math.dist(line[0], line[-1]) >= _SHORTEST_MARK:
                yield name, line[[0, -1]]


def _pair_marks(marks: Mapping[str, FloatArray]) -> Iterator[SurveyCrossing]:
    """A crossing for each two marks beside one another, nearest first; then for single ones."""
    pairs = []
    for a, b in combinations(sorted(marks), 2):
        if (width := _measure_gap(marks[a], marks[b])) is not None:
            pairs.append((width, a, b))
    left = set(marks)
    for width, a, b in sorted(pairs):
        if {a, b} <= left:
            left -= {a, b}
            first, second = marks[a], _align(marks[b], marks[a])
            yield SurveyCrossing((first + second) / 2, width, source=f"zebra lines {a} and {b}")
    for name in sorted(left):
        yield SurveyCrossing(marks[name], _ASSUMED_WIDTH, source=f"zebra line {name}")


def _align(line: FloatArray, other: FloatArray) -> FloatArray:
    """A line in the direction of another."""
    return line if float((line[1] - line[0]) @ (other[1] - other[0])) > 0 else line[::-1]


def _measure_gap(a: FloatArray, b: FloatArray) -> float | None:
    """How far apart two lines run beside one another [m]; None if they do not."""
    b = _align(b, a)
    lengths = [float(np.hypot(*(line[1] - line[0]))) for line in (a, b)]
    ahead = (a[1] - a[0]) / lengths[0]
    left = rotate_left(ahead)
    turn = math.asin(min(abs(float((b[1] - b[0]) @ left)) / lengths[1], 1.0))
    along = (b - a[0]) @ ahead
    shared = min(along.max(), lengths[0]) - max(along.min(), 0.0)
    aside = abs(float((b - a[0]).mean(axis=0) @ left))
    fits = _WIDTHS[0] <= aside <= _WIDTHS[1] and shared >= _SHARED * min(lengths)
    return aside if turn < _PARALLEL and fits else None
