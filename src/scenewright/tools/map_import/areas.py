"""The ground of a surveyed junction: road, sidewalks, crosswalks and the ways along them."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy as np

from scenewright.scene.base import FloatArray
from scenewright.tools.map_import.legs import SurveyLeg
from scenewright.tools.map_import.survey import SurveyCrossing

geos: Any = import_module("shapely")
"""Shapely's functions carry no types; one name keeps that in one place."""

SIDEWALK = 3.0
"""Width of a derived sidewalk [m]."""
CROSSWALK = 4.0
"""Width of a derived crosswalk [m]."""
WALK = 15.0
"""How far beside a crosswalk those who cross come from and go to [m]."""
_CLOSING = 2.5
"""Gaps of up to twice that between lanes are paved, and kerbs are rounded with it [m]."""
_HOLE = 120.0
"""Islands smaller than this are paved [m^2]."""
_SETBACK, _STOP_GAP = 0.6, 1.2
_SLACK = 2.5
"""How much longer a crosswalk may be than the shortest way across its leg [m]."""
_SEARCH = 22.0
"""How far out of the junction a place for a crosswalk is looked for [m]."""


@dataclass(frozen=True, eq=False)
class Section:
    """A straight way across a leg.

    Attributes:
        at: distance outwards from the leg's throat [m].
        ends: [2, 2] kerb on the left and on the right, looking outwards [m].
        width: of the crosswalk; mapped: whether the file has it.
        light: the survey's light that rules it.
    """

    at: float
    ends: FloatArray
    width: float
    mapped: bool
    light: str | None


def road_of(strips: Sequence[tuple[FloatArray, float]], outlines: Sequence[FloatArray]) -> Any:
    """The paved area of lanes (line, width) and outlines, small gaps and islands closed."""
    parts = [geos.LineString(line).buffer(width / 2, cap_style="flat") for line, width in strips]
    parts += [geos.Polygon(outline).buffer(0) for outline in outlines if len(outline) > 2]
    road = geos.union_all([part for part in parts if not part.is_empty])
    road = road.buffer(_CLOSING, quad_segs=8).buffer(-_CLOSING, quad_segs=8).union(road)
    return largest(_paved(road)).simplify(0.02)


def _paved(road: Any) -> Any:
    pieces = [
        geos.Polygon(p.exterior, [h for h in p.interiors if geos.Polygon(h).area > _HOLE])
        for p in polygons(road)
    ]
    return geos.union_all(pieces)


def polygons(area: Any) -> list[Any]:
    """The polygons of any geometry."""
    return [p for p in getattr(area, "geoms", [area]) if p.geom_type == "Polygon" and p.area > 0]


def largest(area: Any) -> Any:
    """Its largest polygon."""
    return max(polygons(area), key=lambda p: float(p.area))


def box(extent: float) -> Any:
    """The square that a map covers."""
    return geos.box(-extent, -extent, extent, extent)


def section_of(
    leg: SurveyLeg, road: Any, crossings: Sequence[SurveyCrossing], *, room: float
) -> Section | None:
    """Where the leg is crossed: as mapped, else at the first place past the kerbs' curves.

    Args:
        room: how far outwards from the throat it may lie at most [m].
    """
    own = [each for each in crossings if _on_leg(each, leg)]
    if own:
        made = _mapped(own, leg, road)
        if made is not None and made.at < room:
            return made
    first = _SETBACK + CROSSWALK / 2 + _outermost(leg)
    places = np.arange(first, max(min(first + _SEARCH, room), first + 0.6), 0.5)
    found = [(float(t), _across(leg, road, float(t), None)) for t in places]
    known = [(t, ends) for t, ends in found if ends is not None]
    if not known:
        return None
    lengths = [_length(ends) for _, ends in known]
    enough = min(lengths) + _SLACK
    t, ends = next(each for each, n in zip(known, lengths, strict=True) if n <= enough)
    return Section(t, ends, CROSSWALK, False, None)


def _outermost(leg: SurveyLeg) -> float:
    """How far out of its throat the last of a leg's lanes leaves the junction [m]."""
    starts = [lane.line[-1] for lane in leg.approaches] + [lane.line[0] for lane in leg.exits]
    reach = [float((start - leg.throat) @ leg.outwards) for start in starts]
    return float(np.clip(max(reach), 0.0, 8.0))


def _on_leg(crossing: SurveyCrossing, leg: SurveyLeg) -> bool:
    middle = crossing.line.mean(axis=0) - leg.throat
    aside = abs(float(middle @ [-leg.outwards[1], leg.outwards[0]]))
    way = crossing.line[1] - crossing.line[0]
    slant = abs(float(way @ leg.outwards)) / max(float(np.hypot(*way)), 1e-9)
    half = 3.5 * len(leg.lanes) + 6.0
    return -8.0 < float(middle @ leg.outwards) < _SEARCH and aside < half and slant < 0.6


def _mapped(own: Sequence[SurveyCrossing], leg: SurveyLeg, road: Any) -> Section | None:
    """One way across from all the pieces that islands part a crossing into."""
    points = np.concatenate([c.line for c in own])
    middle = points.mean(axis=0)
    at = float((middle - leg.throat) @ leg.outwards)
    way = np.linalg.svd(points - middle)[2][0]
    ends = _across(leg, road, at, way, through=middle)
    if ends is None:
        return None
    light = next((c.light for c in own if c.light is not None), None)
    width = float(np.median([c.width for c in own]))
    return Section(at, ends, float(np.clip(width, 2.0, 6.0)), True, light)


def _across(
    leg: SurveyLeg,
    road: Any,
    at: float,
    way: FloatArray | None,
    through: FloatArray | None = None,
) -> FloatArray | None:
    """[2, 2] kerbs left and right of a place on the leg, looking outwards; None off the road."""
    middle = leg.throat + at * leg.outwards if through is None else through
    left = np.array([-leg.outwards[1], leg.outwards[0]])
    if way is not None:
        left = way if float(way @ left) > 0 else -way
    line = geos.LineString([middle + 45.0 * left, middle - 45.0 * left])
    cut = line.intersection(road)
    parts = [p for p in getattr(cut, "geoms", [cut]) if p.geom_type == "LineString" and p.length]
    own = [p for p in parts if any(_meets_lane(p, line) for line in _prolonged(leg))]
    if not own:
        return None
    ends = np.concatenate([np.array(p.coords)[:, :2] for p in own])
    order = np.argsort((ends - middle) @ -left)
    return np.asarray(ends[order[[0, -1]]])


def _prolonged(leg: SurveyLeg) -> Iterator[FloatArray]:
    """The leg's lanes, each twenty metres farther into the junction."""
    for lane in leg.approaches:
        yield np.concatenate([lane.line, lane.line[-1:] - 20.0 * leg.outwards])
    for lane in leg.exits:
        yield np.concatenate([lane.line[:1] - 20.0 * leg.outwards, lane.line])


def _meets_lane(part: Any, line: FloatArray) -> bool:
    return bool(part.distance(geos.LineString(line)) < 0.5)


def _length(ends: FloatArray) -> float:
    return float(np.hypot(*(ends[1] - ends[0])))


def stop_distance(section: Section) -> float:
    """Where traffic stops before a crosswalk, outwards from the throat [m]."""
    return section.at + section.width / 2 + _STOP_GAP


def crosswalk_area(section: Section) -> Any:
    """The marked area, from kerb to kerb, over whatever island lies between."""
    return geos.LineString(section.ends).buffer(section.width / 2, cap_style="flat")


def sidewalks_of(road: Any, extent: float) -> Any:
    """Derived sidewalks: a strip along every outer kerb."""
    outer = geos.union_all([geos.Polygon(p.exterior) for p in polygons(road)])
    strip = outer.buffer(SIDEWALK, quad_segs=8).difference(outer)
    return strip.intersection(box(extent))


def corners_of(road: Any, legs: Sequence[SurveyLeg], extent: float) -> dict[int, FloatArray]:
    """By leg: the middle of the sidewalk from its left side round to the next leg's right side.

    [P, 2] every half metre, from the leg (looking outwards its left) to the next leg
    counter-clockwise. A corner without one is missing.
    """
    outer = geos.union_all([geos.Polygon(p.exterior) for p in polygons(road)])
    kerb = outer.buffer(SIDEWALK / 2, quad_segs=8).boundary.intersection(box(extent))
    merged = geos.line_merge(kerb)
    pieces = [np.array(p.coords) for p in getattr(merged, "geoms", [merged]) if p.length > 8.0]
    angles = [_where_it_leaves(leg, extent) for leg in legs]
    found: dict[int, tuple[float, FloatArray]] = {}
    for piece in pieces:
        gaps = [_gap(math.atan2(end[1], end[0]), angles) for end in piece[[0, -1]]]
        if gaps[0] != gaps[1]:
            continue
        k = gaps[0]
        start = math.atan2(piece[0][1], piece[0][0])
        ahead = (start - angles[k]) % math.tau
        behind = (math.atan2(piece[-1][1], piece[-1][0]) - angles[k]) % math.tau
        line = piece if ahead < behind else piece[::-1]
        # Islands between the two directions of a leg end close to where they began.
        if k not in found or abs(ahead - behind) > found[k][0]:
            found[k] = (abs(ahead - behind), even(line, 0.5))
    return {k: line for k, (_, line) in found.items()}


def _where_it_leaves(leg: SurveyLeg, extent: float) -> float:
    """The direction in which a leg leaves the map, seen from the origin [rad]."""
    places = []
    for lane, approach in [*((x, True) for x in leg.approaches), *((x, False) for x in leg.exits)]:
        line = even(lane.line[::-1] if approach else lane.line, 1.0)
        inside = np.abs(line).max(axis=1) <= extent
        places.append(line[np.flatnonzero(inside)[-1]] if inside.any() else line[0])
    middle = np.mean(places, axis=0)
    return math.atan2(middle[1], middle[0])


def _gap(angle: float, angles: Sequence[float]) -> int:
    """Behind which leg, counter-clockwise, a direction lies."""
    return min(range(len(angles)), key=lambda k: (angle - angles[k]) % math.tau)


def len_of(line: FloatArray) -> float:
    """Length of a line [P, 2] [m]."""
    return float(np.hypot(*np.diff(line, axis=0).T).sum())


def even(line: FloatArray, spacing: float) -> FloatArray:
    """The line with points evenly spaced, both ends kept."""
    kept = np.concatenate([[True], np.hypot(*np.diff(line, axis=0).T) > 1e-6])
    line = line[kept]
    s = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(line, axis=0).T))])
    wanted = np.linspace(0.0, s[-1], max(round(s[-1] / spacing), 2) + 1)
    return np.stack([np.interp(wanted, s, line[:, axis]) for axis in (0, 1)], axis=1)


def walk_line(
    section: Section, left: FloatArray, right: FloatArray, *, before: str, after: str
) -> FloatArray:
    """[P, 2] the way of somebody who crosses from the left side of a leg to its right side.

    Args:
        left: corner line from this leg to the next; right: from the leg before to this one.
        before, after: `leg` for the sidewalk of the leg crossed, `along` for the one beyond it.
    """
    a = _arm(left, section.ends[0], towards_start=before == "leg")[::-1]
    b = _arm(right, section.ends[1], towards_start=after == "along")
    return np.concatenate([a, b])


def _arm(corner: FloatArray, kerb: FloatArray, *, towards_start: bool) -> FloatArray:
    """From beside the kerb point WALK metres along the corner line, in one direction."""
    k = int(np.argmin(np.hypot(*(corner - kerb).T)))
    part = corner[k::-1] if towards_start else corner[k:]
    return part[: max(round(WALK / 0.5), 2) + 1]
