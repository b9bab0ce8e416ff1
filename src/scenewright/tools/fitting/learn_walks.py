"""Where people walk: crosswalks and sidewalks that a map only derives, from tracks of walkers.

A pedestrian that passes from one side of a leg's road to the other crosses it. Where several
do so at one place, there is a crosswalk. Ground beside the road and the derived
sidewalks over which several people walk is sidewalk, too.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from scenewright.geometry.map_areas import merge_areas
from scenewright.geometry.polyline import resample_by_spacing, rotate_left
from scenewright.scene.base import Compass, FloatArray
from scenewright.scene.map import IntersectionMap
from scenewright.scene.map_elements import Crosswalk
from scenewright.tools.map_import.map_parts import geos
from scenewright.tools.map_import.survey import LEARNED, SurveyCrossing

_LEAST_WALKERS = 5
"""So few people make no crosswalk."""
_LEAST_SHARE = 0.5
"""Of those who cross a leg, that cross it at one place."""
_TOGETHER = 3.0
"""Largest distance of a crossing pedestrian from the middle of the crossing place [m]."""
_REACH = (12.0, 25.0)
"""So far inwards and outwards of the derived crosswalk a crossing is the leg's [m]."""
_LEAST_ACROSS = np.cos(np.radians(45.0))
_WIDTHS = (2.5, 6.0)
_CELL = 1.0
_LEAST_ON_CELL = 3
"""People who walk over one square metre that is sidewalk."""
_LEAST_AREA = 10.0
_GAP = 1.5
"""Between places of sidewalk that are one [m]."""


@dataclass(frozen=True, eq=False)
class LegWalks:
    """Those who cross one leg.

    Attributes:
        walkers: who cross it at one place; others: who cross it elsewhere.
        place: [2] the middle of that place, across: [2] unit vector along which they walk.
        width: within which most of them walk [m]; moved: from the map's crosswalk [m].
    """

    leg: Compass
    walkers: int
    others: int
    place: FloatArray
    across: FloatArray
    width: float
    moved: float

    def build_crossing(self, length: float) -> SurveyCrossing:
        """The crossing as an import would read it."""
        ends = self.place + np.outer([-0.5, 0.5], length * self.across)
        return SurveyCrossing(
            ends, self.width, source=f"{LEARNED} {self.walkers} people walk", is_bounded=False
        )


def learn_crossings(place: IntersectionMap, tracks: Sequence[FloatArray]) -> list[LegWalks]:
    """Where people cross each leg that has a crosswalk, where enough of them do so at one place.

    Args:
        tracks: [T, 2] of people on foot, in the map's frame [m].
    """
    lines = [resample_by_spacing(xy, 0.5) for xy in tracks if len(xy) > 1]
    found = (_learn_leg(walk, place, lines) for walk in place.crosswalks)
    return [each for each in found if each is not None]


def _learn_leg(
    walk: Crosswalk, place: IntersectionMap, lines: Sequence[FloatArray]
) -> LegWalks | None:
    ends = np.array(walk.centreline)
    middle, across = ends.mean(axis=0), ends[1] - ends[0]
    half = float(np.hypot(*across)) / 2
    across = across / (2 * half)
    outwards = rotate_left(across)
    bearing = next(leg.bearing for leg in place.legs if leg.name == walk.leg)
    outwards = outwards if outwards @ (np.cos(bearing), np.sin(bearing)) > 0 else -outwards
    met = [_meet_axis(line, middle, across, outwards, half) for line in lines]
    passed = [each for each in met if each is not None]
    if not passed:
        return None
    s = np.array([where for where, _ in passed])
    centre = float(np.median(s))
    near = np.abs(s - centre) < _TOGETHER
    if near.sum() < _LEAST_WALKERS or near.mean() < _LEAST_SHARE:
        return None
    centre = float(np.median(s[near]))
    low, high = np.quantile(s[near], (0.1, 0.9))
    ways = np.array([way for _, way in passed])[near].mean(axis=0)
    return LegWalks(
        leg=walk.leg, walkers=int(near.sum()), others=int((~near).sum()),
        place=middle + centre * outwards, across=ways / np.hypot(*ways),
        width=round(float(np.clip(high - low + 1.0, *_WIDTHS)), 2), moved=centre,
    )  # fmt: skip


def _meet_axis(
    line: FloatArray, middle: FloatArray, across: FloatArray, outwards: FloatArray, half: float
) -> tuple[float, FloatArray] | None:
    """How far outwards [m] a walk passes the middle of a leg, and in which direction [2].

    None if it does not pass from one half of the road to the other.
    """
    side, out = (line - middle) @ across, (line - middle) @ outwards
    all_changes = np.flatnonzero(side[:-1] * side[1:] <= 0).tolist()
    changes = [k for k in all_changes if -_REACH[0] < out[k] < _REACH[1]]
    if not changes or side.min() > -0.6 * half or side.max() < 0.6 * half:
        return None
    k = changes[0]
    around = line[max(k - 4, 0) : k + 6]
    way = around[-1] - around[0]
    length = float(np.hypot(*way))
    if length < 1.0 or abs(float(way @ across)) < _LEAST_ACROSS * length:
        return None
    return float(out[k]), way / length * np.sign(way @ across)


def learn_sidewalks(place: IntersectionMap, tracks: Sequence[FloatArray]) -> list[FloatArray]:
    """[P, 2] outlines of ground off road and sidewalks of the map that several people walk on."""
    cells: dict[tuple[int, int], set[int]] = defaultdict(set)
    for number, xy in enumerate(tracks):
        inside = xy[np.abs(xy).max(axis=1) < place.extent]
        for x, y in np.unique(np.floor(inside / _CELL), axis=0).astype(int).tolist():
            cells[x, y].add(number)
    known = merge_areas((*place.road, *place.walkable))
    walked = [
        geos.box(x * _CELL, y * _CELL, (x + 1) * _CELL, (y + 1) * _CELL)
        for (x, y), people in sorted(cells.items())
        if len(people) >= _LEAST_ON_CELL
    ]
    ground = geos.union_all(walked).buffer(_GAP).buffer(-_GAP / 2).difference(known)
    return [
        np.array(part.exterior.coords)
        for part in getattr(ground, "geoms", [ground])
        if part.area >= _LEAST_AREA and part.distance(known) < _GAP
    ]


def say_what_was_learned(found: Iterable[LegWalks], kept: Iterable[str]) -> list[str]:
    """A line for each leg.

    Args:
        kept: legs whose crosswalk is the file's, which stays where it is.
    """
    own = set(kept)
    return [
        f"{each.leg}: {each.walkers} people cross {abs(each.moved):.1f} m "
        f"{'outwards' if each.moved > 0 else 'inwards'} of "
        + (
            "the file's crosswalk, which stays"
            if each.leg in own
            else f"the derived crosswalk, which lies there now, {each.width:.1f} m wide"
        )
        + (f"; {each.others} more cross elsewhere" if each.others else "")
        for each in found
    ]
