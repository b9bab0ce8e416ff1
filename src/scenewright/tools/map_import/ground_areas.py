"""The ground of a surveyed junction: road, sidewalks, crosswalks and the paths along them."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from scenewright.geometry.polyline import resample_by_spacing, rotate_left
from scenewright.scene.base import FloatArray
from scenewright.tools.map_import.legs import SurveyLeg, orient_outwards
from scenewright.tools.map_import.map_parts import geos, list_lines, list_points
from scenewright.tools.map_import.mapped_crosswalks import MappedCrosswalk

_SIDEWALK_WIDTH, _CROSSWALK_WIDTH = 3.0, 4.0
"""Of derived ones [m]."""
_WALK = 15.0
"""How far beside a crosswalk pedestrians come from and go to [m]."""
_CLOSING = 2.5
"""Gaps of up to twice that between lanes are paved, and kerbs are rounded with it [m]."""
_SMALLEST_ISLAND = 120.0
"""Islands smaller than this are paved [m^2]."""
_SETBACK, STOP_GAP = 0.6, 1.2
"""Of a crosswalk from the curve of its kerb, and of traffic that waits before it [m]."""
_SLACK = 2.5
"""How much longer a crosswalk may be than the shortest line across its leg [m]."""
_SAME_KERB = 0.75
"""A crosswalk's drawn end that lies closer to our kerb is there [m]."""
_LANE_ROOM = 1.2
"""From the middle of a lane that a crosswalk crosses to its end, at least [m]."""
_BROADEST = 6.0
"""So far out of our kerb a drawn end may lie [m]: the road has lanes there that we drop."""
_FARTHEST_KERB = 15.0
"""Ground so far beyond a drawn end is another road's [m]."""
_CORNER = 4.0
"""Crosswalks that meet nearer to an end of either meet at a corner [m]."""
_MOST_SHARED = 0.5
"""Of the smaller one's area that two crosswalks may have in common."""
_BESIDE = 4.5
"""An end of a crosswalk that lies farther from the middle of every sidewalk is on an island [m]."""
_STEP_OFF = 1.2
"""So far beyond its end people on an island begin and end [m]."""
_SEARCH = 22.0
"""How far out of the junction a place for a crosswalk is looked for [m]."""


@dataclass(frozen=True, eq=False)
class CrosswalkPlacement:
    """Where a crosswalk crosses a leg.

    Attributes:
        distance: outwards from the leg's throat [m].
        ends: [2, 2] kerb on the left and on the right, looking outwards [m].
        mapped: what the file holds of it; None if it was derived.
        refuges: [n, 2, 2] from its ends over ground without lanes to our kerb [m].
    """

    distance: float
    ends: FloatArray
    width: float
    mapped: MappedCrosswalk | None = None
    refuges: tuple[FloatArray, ...] = ()

    @property
    def area(self) -> Any:
        """The marked area, from kerb to kerb, over any island in between."""
        return geos.LineString(self.ends).buffer(self.width / 2, cap_style="flat")

    @property
    def middle(self) -> FloatArray:
        """[2] halfway between its ends [m]."""
        return np.asarray(self.ends.mean(axis=0))

    def find_refuge(self, road: Any, corners: Sequence[FloatArray | None]) -> Any:
        """Ground beside its ends on which people walk to the sidewalk, or end: an island's.

        Args:
            corners: see `build_crossing_line`.
        """
        half = self.width / 2
        strips = [
            geos.LineString(refuge).buffer(half, cap_style="square") for refuge in self.refuges
        ]
        islands = [
            geos.Point(self._step_off(i)).buffer(2 * _STEP_OFF).difference(road)
            for i, corner in enumerate(corners)
            if self._find_nearest(i, corner) is None
        ]
        return geos.union_all([*strips, *islands])

    def _step_off(self, i: int) -> FloatArray:
        """[2] a place on the ground beyond one of its ends [m]."""
        ahead = self.ends[i] - self.ends[1 - i]
        return np.asarray(self.ends[i] + _STEP_OFF * ahead / max(float(np.hypot(*ahead)), 1e-9))

    def _find_nearest(self, i: int, corner: FloatArray | None) -> int | None:
        """Which point of a corner line lies beside one of its ends; None if it is an island's."""
        if corner is None:
            return None
        kerb = next(
            (x[1] for x in self.refuges if np.array_equal(x[0], self.ends[i])), self.ends[i]
        )
        away = np.hypot(*(corner - kerb).T)
        return int(away.argmin()) if away.min() < _BESIDE else None

    def follow(self, i: int, corner: FloatArray | None, *, towards_start: bool) -> FloatArray:
        """[P, 2] from beside one of its ends some metres along the sidewalk; on an island a step.

        Args:
            towards_start: whether against the direction of the corner line.
        """
        k = self._find_nearest(i, corner)
        if corner is None or k is None:
            return self._step_off(i)[None]
        part = corner[k::-1] if towards_start else corner[k:]
        return part[: max(round(_WALK / 0.5), 2) + 1]

    def crosses(self, other: CrosswalkPlacement) -> bool:
        """Whether it crosses another one or lies on it; that corners of both meet is neither."""
        common = self.area.intersection(other.area).area
        if common > _MOST_SHARED * min(self.area.area, other.area.area):
            return True
        meeting = geos.LineString(self.ends).intersection(geos.LineString(other.ends))
        ends = geos.MultiPoint(np.concatenate([self.ends, other.ends]))
        return not meeting.is_empty and float(meeting.distance(ends)) > _CORNER


def build_road(
    lanes: Sequence[tuple[FloatArray, float]],
    outlines: Sequence[FloatArray],
    *,
    smallest_island: float = _SMALLEST_ISLAND,
) -> Any:
    """The paved area of lanes (line, width) and outlines, small gaps and islands closed.

    Args:
        smallest_island: that is not paved [m^2].
    """
    parts = [geos.LineString(line).buffer(width / 2, cap_style="flat") for line, width in lanes]
    parts += [geos.Polygon(outline).buffer(0) for outline in outlines if len(outline) > 2]
    road = geos.union_all([part for part in parts if not part.is_empty])
    road = road.buffer(_CLOSING, quad_segs=8).buffer(-_CLOSING, quad_segs=8).union(road)
    paved = geos.union_all(
        [
            geos.Polygon(
                polygon.exterior,
                [h for h in polygon.interiors if geos.Polygon(h).area > smallest_island],
            )
            for polygon in list_polygons(road)
        ]
    )
    return max(list_polygons(paved), key=lambda p: float(p.area)).simplify(0.02)


def list_polygons(area: Any) -> list[Any]:
    """The polygons of any geometry."""
    return [p for p in getattr(area, "geoms", [area]) if p.geom_type == "Polygon" and p.area > 0]


def build_square(extent: float) -> Any:
    """The square that a map covers."""
    return geos.box(-extent, -extent, extent, extent)


def place_crosswalk(
    leg: SurveyLeg,
    road: Any,
    mapped: MappedCrosswalk | None,
    *,
    room: float,
) -> tuple[CrosswalkPlacement | None, str]:
    """Where the leg is crossed, and why not as mapped.

    That is as mapped, else at the first place past the kerbs' curves. A place that is mapped so
    deep inside the junction that the line along it is much longer than the leg is wide is no
    crosswalk of the leg, unless the file draws the crosswalk as long.

    Args:
        room: how far outwards from the throat it may lie at most [m].
    """
    # How far out of its throat the last of the leg's lanes leaves the junction [m].
    starts = [orient_outwards(*lane)[0] for lane in leg.directed_lanes]
    reach = max(float((start - leg.throat) @ leg.outwards) for start in starts)
    first = _SETBACK + _CROSSWALK_WIDTH / 2 + float(np.clip(reach, 0.0, 8.0))
    distances = np.arange(first, max(min(first + _SEARCH, room), first + 0.6), 0.5).tolist()
    cuts = [(t, _cut_road(leg, road, leg.throat + t * leg.outwards)) for t in distances]
    found = [
        (float(np.hypot(*(ends[1] - ends[0]))), t, ends) for t, ends in cuts if ends is not None
    ]
    shortest = min((length for length, _, _ in found), default=math.inf)
    why = ""
    if mapped is not None:
        placed = _place_mapped_crosswalk(mapped, leg, road)
        if placed is None:
            why = "lies off our road"
        elif placed.distance >= room:
            why = "lies beyond the map"
        else:
            length = abs(float((placed.ends[1] - placed.ends[0]) @ rotate_left(leg.outwards)))
            # A single node of a road says nothing of how long the crosswalk is.
            is_drawn = mapped.is_bounded or len(mapped.stages) > 1
            drawn = mapped.ends if is_drawn else mapped.limits
            far = 0.0 if drawn is None else math.dist(*drawn)
            if length <= max(shortest + 2 * _SLACK, far + _SLACK):
                return placed, ""
            deep = f"lies {-placed.distance:.1f} m too deep inside the junction: "
            why = deep if placed.distance < 0 else ""
            why += f"the line along it is {length:.0f} m long, the leg {shortest:.0f} m wide"
    if not found:
        return None, why
    distance, ends = next((t, ends) for length, t, ends in found if length <= shortest + _SLACK)
    return CrosswalkPlacement(distance, ends, _CROSSWALK_WIDTH), why


def _place_mapped_crosswalk(
    mapped: MappedCrosswalk, leg: SurveyLeg, road: Any
) -> CrosswalkPlacement | None:
    """The mapped crosswalk from kerb to kerb; at the file's own ends where no lane lies beyond."""
    stages = [stage.middle for stage in mapped.stages]
    kerbs = _cut_road(leg, road, mapped.middle, across=mapped.across, places=stages)
    if kerbs is None:
        return None
    ends, refuges = kerbs.copy(), []
    drawn = mapped.ends if mapped.is_bounded else mapped.limits
    if drawn is not None:
        # Whether both lines lead the same way.
        drawn = drawn if (drawn[1] - drawn[0]) @ (kerbs[1] - kerbs[0]) > 0 else drawn[::-1]
        for i in (0, 1):
            end = _choose_end(kerbs[i], drawn[i], mapped.middle, leg)
            beyond = np.hypot(*(kerbs[i] - mapped.middle)) - np.hypot(*(end - mapped.middle))
            if beyond > 0.0:
                refuges.append(np.array([end, kerbs[i]]))
            # Ways of OpenStreetMap end on the sidewalk, so only what is drawn as an area counts.
            ends[i] = end if mapped.is_bounded or beyond > 0.0 else kerbs[i]
    distance = float((mapped.middle - leg.throat) @ leg.outwards)
    width = float(np.clip(mapped.width, 2.0, 8.0))
    return CrosswalkPlacement(distance, ends, width, mapped, tuple(refuges))


def _choose_end(
    kerb: FloatArray, drawn: FloatArray, middle: FloatArray, leg: SurveyLeg
) -> FloatArray:
    """Our kerb; the file's end where that is clearly elsewhere and cuts off no lane of the leg."""
    beyond = float(np.hypot(*(drawn - middle)) - np.hypot(*(kerb - middle)))
    if abs(beyond) < _SAME_KERB or beyond > _BROADEST:
        return kerb
    between = geos.LineString([drawn, kerb])
    lanes = (geos.LineString(line) for line in _extend_into_junction(leg))
    if -_FARTHEST_KERB < beyond < 0 and any(lane.distance(between) < _LANE_ROOM for lane in lanes):
        return kerb
    return drawn


def _cut_road(
    leg: SurveyLeg,
    road: Any,
    middle: FloatArray,
    *,
    across: FloatArray | None = None,
    places: Sequence[FloatArray] = (),
) -> FloatArray | None:
    """[2, 2] kerbs left and right of a place on the leg, looking outwards; None off the road.

    Args:
        across: direction of the line from kerb to kerb; None is at right angles to the leg.
        places: [2] each, on other carriageways that the line crosses as well.
    """
    left = rotate_left(leg.outwards)
    if across is not None:
        left = across if float(across @ left) > 0 else -across
    line, at = geos.LineString([middle + 45.0 * left, middle - 45.0 * left]), geos.Point(middle)
    cut, known = line.intersection(road), [geos.Point(place) for place in places]
    for lane in _extend_into_junction(leg):
        # A lane that turns back is crossed twice.
        met = list_points(line.intersection(geos.LineString(lane)))
        known += sorted(met, key=at.distance)[:1]
    own = [p for p in list_lines(cut) if any(p.distance(each) < 0.5 for each in known)]
    if not own:
        return None
    ends = np.concatenate([np.array(p.coords)[:, :2] for p in own])
    order = np.argsort((ends - middle) @ -left)
    return np.asarray(ends[order[[0, -1]]])


def _extend_into_junction(leg: SurveyLeg) -> Iterator[FloatArray]:
    """The leg's lanes from the junction outwards, each beginning twenty metres farther inside."""
    for lane in leg.directed_lanes:
        line = orient_outwards(*lane)
        yield np.concatenate([line[:1] - 20.0 * leg.outwards, line])


def build_sidewalks(road: Any, extent: float) -> Any:
    """Derived sidewalks: a strip along every outer kerb."""
    outer = _fill_islands(road)
    strip = outer.buffer(_SIDEWALK_WIDTH, quad_segs=8).difference(outer)
    return strip.intersection(build_square(extent))


def _fill_islands(road: Any) -> Any:
    return geos.union_all([geos.Polygon(p.exterior) for p in list_polygons(road)])


def build_corner_lines(
    road: Any, legs: Sequence[SurveyLeg], extent: float
) -> dict[int, FloatArray]:
    """By leg: the middle of the sidewalk from its left side round to the next leg's right side.

    [P, 2] every half metre, from the leg (looking outwards its left) to the next leg
    counter-clockwise. A corner without one is missing.
    """
    kerb = _fill_islands(road).buffer(_SIDEWALK_WIDTH / 2, quad_segs=8).boundary
    merged = geos.line_merge(kerb.intersection(build_square(extent)))
    pieces = [np.array(p.coords) for p in getattr(merged, "geoms", [merged]) if p.length > 8.0]
    angles = [_find_exit_angle(leg, extent) for leg in legs]
    found: dict[int, tuple[float, FloatArray]] = {}
    for piece in pieces:
        ends = [math.atan2(end[1], end[0]) for end in piece[[0, -1]]]
        behind = [min(range(len(legs)), key=lambda k: (a - angles[k]) % math.tau) for a in ends]
        if behind[0] != behind[1]:
            continue
        k = behind[0]
        first, last = ((angle - angles[k]) % math.tau for angle in ends)
        line = piece if first < last else piece[::-1]
        # Islands between the two directions of a leg end close to where they began.
        if k not in found or abs(first - last) > found[k][0]:
            found[k] = (abs(first - last), resample_by_spacing(line, 0.5))
    return {k: line for k, (_, line) in found.items()}


def _find_exit_angle(leg: SurveyLeg, extent: float) -> float:
    """The direction in which a leg leaves the map, seen from the origin [rad]."""
    points = []
    for lane in leg.directed_lanes:
        line = resample_by_spacing(orient_outwards(*lane), 1.0)
        inside = np.abs(line).max(axis=1) <= extent
        points.append(line[np.flatnonzero(inside)[-1]] if inside.any() else line[0])
    middle = np.mean(points, axis=0)
    return math.atan2(middle[1], middle[0])


def build_crossing_line(
    placement: CrosswalkPlacement,
    corners: Sequence[FloatArray | None],
    *,
    before: str,
    after: str,
) -> FloatArray:
    """[P, 2] the path of a pedestrian crossing from the left side of a leg to its right side.

    Args:
        corners: corner line from this leg to the next, and from the leg before to this one.
        before, after: `leg` for the sidewalk of the leg crossed, `along` for the one beyond it.
    """
    start = placement.follow(0, corners[0], towards_start=before == "leg")[::-1]
    end = placement.follow(1, corners[1], towards_start=after == "along")
    return np.concatenate([start, end])
