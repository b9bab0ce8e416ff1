"""From a survey of a junction to the map of an intersection, with a report of what was assumed."""

from __future__ import annotations

import math
import zlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import Any

import numpy as np

from scenewright.errors import InputError
from scenewright.scene.base import Compass, FloatArray
from scenewright.scene.map import (
    Crosswalk,
    GoalRegion,
    IntersectionMap,
    Lanelet,
    Leg,
    Polyline,
    Route,
    StopLine,
    VehicleMovement,
)
from scenewright.tools.map_import import areas
from scenewright.tools.map_import.areas import Section, even, geos, len_of
from scenewright.tools.map_import.legs import (
    CLEARLY_STRAIGHT,
    CLEARLY_TURNED,
    RING,
    SurveyLeg,
    legs_of,
    named,
    turn_by_name,
)
from scenewright.tools.map_import.lights import programme
from scenewright.tools.map_import.map_builder import (
    area_of,
    conflict_zones,
    pedestrian_route,
    ring,
    vehicle_route,
)
from scenewright.tools.map_import.survey import Survey, SurveyLane, SurveyWay

LEAST_EXTENT, MOST_EXTENT = 50.0, 90.0
_ROOM = 28.0
"""How much of every leg a map shows beyond its throat at least [m]."""
_LEAST_SPEED, _MOST_SPEED = 4.0, 19.0
_SMOOTHING = 3.0
"""Of ways through the junction [points of 0.5 m]: readers leave corners where pieces meet."""
_SIDES = ("along", "leg")


@dataclass(frozen=True, eq=False)
class Assembled:
    """A map, and beside it what a map does not say.

    Attributes:
        place: the map.
        lines: by route id, the middles of the ways that it may take [m]: a way for each lane,
            for pedestrians one.
        notes: what was derived, assumed or dropped, one fact a line.
    """

    place: IntersectionMap
    lines: Mapping[str, tuple[FloatArray, ...]]
    notes: tuple[str, ...]


def assemble(
    survey: Survey,
    *,
    name: str,
    extent: float | None = None,
    title: str | None = None,
    signals: str = "keep",
) -> Assembled:
    """The map of a surveyed junction.

    Args:
        extent: half the side of the square that the map covers [m]; None takes what it needs.
        signals: `keep` what the file has, `assume` a programme where it has none, or `none`.

    Raises:
        InputError: too few legs, or no way through.
    """
    return _Assembly(survey, name, extent, title, signals).made()


@dataclass(eq=False)
class _Assembly:
    """One junction on its way to a map."""

    survey: Survey
    name: str
    wished: float | None
    title: str | None
    signals: str

    def __post_init__(self) -> None:
        self.notes = list(self.survey.notes)
        self.legs = legs_of(self.survey)
        self.of_lane = {lane.id: k for k, leg in enumerate(self.legs) for lane in leg.lanes}
        self.extent = self._extent()
        self.ways = [way for way in self.survey.ways if self._kept(way)]
        if not self.ways:
            raise InputError(f"{self.survey.title} has no way for vehicles from one leg to another")
        self.names = named(self.legs, self._turns())
        self.extended = {
            lane.id: _reaching(lane, approach, self.extent + 20.0)
            for leg in self.legs
            for lane, approach in _sided(leg)
        }

    def _extent(self) -> float:
        far = max(float(np.abs(leg.throat).max()) for leg in self.legs)
        if self.wished is not None:
            if not far + 10.0 <= self.wished <= 200.0:
                raise InputError(
                    f"an extent of {self.wished:g} m does not do: the junction needs "
                    f"{far + 10.0:.0f} to 200 m"
                )
            return self.wished
        return float(np.clip(math.ceil(far + _ROOM), LEAST_EXTENT, MOST_EXTENT))

    def _kept(self, way: SurveyWay) -> bool:
        same = self.of_lane[way.approach] == self.of_lane[way.exit]
        if same:
            self._note("ways that turn back into their own leg were dropped")
        return not same

    def _note(self, line: str) -> None:
        if line not in self.notes:
            self.notes.append(line)

    def _turns(self) -> list[tuple[int, int, float]]:
        return [(self.of_lane[w.approach], self.of_lane[w.exit], self._angle(w)) for w in self.ways]

    def _angle(self, way: SurveyWay) -> float:
        """How far a way turns, positive to the left [rad]."""
        a = self.survey.approaches[way.approach].line
        b = self.survey.exits[way.exit].line
        whole = even(np.concatenate([_end(a, 12.0), way.line, _end(b[::-1], 12.0)[::-1]]), 1.0)
        step = np.diff(whole, axis=0)
        course = np.unwrap(np.arctan2(step[:, 1], step[:, 0]))
        return float(course[-3:].mean() - course[:3].mean())

    @cached_property
    def road(self) -> Any:
        strips = [
            (self.extended[lane.id], max(lane.width, 2.8))
            for leg in self.legs
            for lane in leg.lanes
        ]
        strips += [
            (self._joined(way), max(self.survey.approaches[way.approach].width, 3.0))
            for way in self.ways
        ]
        return areas.road_of(strips, self.survey.areas)

    def _joined(self, way: SurveyWay) -> FloatArray:
        a, b = self.extended[way.approach], self.extended[way.exit]
        return _smooth(np.concatenate([_end(a, 6.0), way.line, _end(b[::-1], 6.0)[::-1]]))

    @cached_property
    def sections(self) -> dict[int, Section]:
        found = {}
        for k, leg in enumerate(self.legs):
            room = self.extent - 9.0 - float(np.abs(leg.throat).max())
            made = areas.section_of(leg, self.road, self.survey.crossings, room=room)
            if made is None:
                self._note(f"no crosswalk found room on the {self.names[k]} leg")
                continue
            found[k] = made
        derived = [self.names[k] for k, s in found.items() if not s.mapped]
        if derived:
            self._note(
                f"the file has no crosswalk that fits on {', '.join(derived)}: derived, 4 m wide, "
                "where the leg is narrow"
            )
        return found

    @cached_property
    def stops(self) -> dict[int, float]:
        """By leg: where traffic stops, outwards from the throat [m]."""
        return {
            k: areas.stop_distance(self.sections[k]) if k in self.sections else 0.0
            for k in range(len(self.legs))
        }

    def _cut(self, lane: SurveyLane, k: int) -> FloatArray:
        """An approach from the map's edge to its stop line."""
        line = even(self.extended[lane.id], 0.5)
        inside = np.abs(line).max(axis=1) <= self.extent
        ahead = (line - self.legs[k].throat) @ self.legs[k].outwards
        inside &= ahead >= self.stops[k]
        return _run(line, inside, towards_end=True)

    def _out(self, lane: SurveyLane) -> FloatArray:
        line = even(self.extended[lane.id], 0.5)
        return _run(line, np.abs(line).max(axis=1) <= self.extent, towards_end=False)

    @cached_property
    def whole(self) -> list[FloatArray]:
        """By way: from map edge to map edge, smoothed."""
        made = []
        for way in self.ways:
            a, b = self.extended[way.approach], self.extended[way.exit]
            line = _smooth(np.concatenate([a, way.line, b]))
            inside = np.abs(line).max(axis=1) <= self.extent
            made.append(_run(line, inside, towards_end=None))
        return made

    def _group(self) -> dict[tuple[int, int], list[int]]:
        """Ways by entry and exit leg; those of the gentlest curve first."""
        groups: dict[tuple[int, int], list[int]] = {}
        for i, way in enumerate(self.ways):
            key = (self.of_lane[way.approach], self.of_lane[way.exit])
            groups.setdefault(key, []).append(i)
        return {
            key: sorted(found, key=lambda i: _sharpness(self.whole[i]))
            for key, found in sorted(groups.items())
        }

    def made(self) -> Assembled:
        lanelets = list(self._lanelets())
        groups = self._group()
        stop_lines = tuple(self._stop_lines())
        movements = tuple(self._movements(groups))
        crosswalks = tuple(self._crosswalks())
        signals = programme(
            self.survey,
            legs=self.names,
            straight=self._straight(groups),
            movements=movements,
            lights=self._lights(groups),
            crosswalks=crosswalks,
            mode=self.signals,
            note=self._note,
        )
        if signals is not None:
            group_of = {m: g.id for g in signals.groups for m in g.movements}
            movements = tuple(
                m.model_copy(update={"signal_group": group_of.get(m.id)}) for m in movements
            )
        walks = dict(self._walks())
        lines = {
            m.id: [geos.LineString(self.whole[i]) for i in found]
            for m, found in zip(movements, groups.values(), strict=True)
        }
        place = IntersectionMap(
            name=self.name,
            map_id=zlib.crc32(self.name.encode()) % 1_000_000,
            title=(self.title or self.survey.title)[:90],
            extent=self.extent,
            left_hand_traffic=self.survey.left_hand,
            legs=tuple(
                Leg(name=n, road=(leg.road or f"{n} road")[:60], bearing=round(leg.bearing, 6))
                for n, leg in zip(self.names, self.legs, strict=True)
            ),
            lanelets=tuple(lanelets),
            stop_lines=stop_lines,
            crosswalks=crosswalks,
            road=tuple(area_of(p) for p in areas.polygons(self._road_here)),
            walkable=tuple(area_of(p) for p in areas.polygons(self._sidewalks)),
            goal_regions=tuple(self._goals(walks)),
            movements=movements,
            conflict_zones=tuple(conflict_zones(lines, movements, crosswalks)),
            signals=signals,
            routes=(*map(vehicle_route, movements), *self._pedestrian_routes(walks)),
        )
        kept = {f"vehicle:{m.id}": tuple(self.whole[i] for i in found)
                for m, found in zip(movements, groups.values(), strict=True)}  # fmt: skip
        return Assembled(
            place, kept | {name: (line,) for name, line in walks.items()}, tuple(self.notes)
        )

    def _straight(
        self, groups: Mapping[tuple[int, int], list[int]]
    ) -> set[tuple[Compass, Compass]]:
        """By entry, the exit that it leads to with the least turning, if that is no turn."""
        angle = {key: abs(self._angle(self.ways[found[0]])) for key, found in groups.items()}
        best = {a: min((turn, b) for (x, b), turn in angle.items() if x == a) for a, _ in angle}
        return {
            (self.names[a], self.names[b]) for a, (turn, b) in best.items() if turn < CLEARLY_TURNED
        }

    @cached_property
    def _road_here(self) -> Any:
        return self.road.intersection(areas.box(self.extent))

    @cached_property
    def _sidewalks(self) -> Any:
        self._note("sidewalks were derived: 3 m along every outer kerb")
        return areas.sidewalks_of(self.road, self.extent)

    def _lights(self, groups: Mapping[tuple[int, int], list[int]]) -> dict[str, list[str]]:
        """By entry leg, the survey's lights of its straightest ways."""
        found: dict[str, list[tuple[float, str]]] = {}
        for (a, _), ways in groups.items():
            for i in ways:
                light = self.ways[i].light
                if light is not None:
                    turn = abs(self._angle(self.ways[i]))
                    found.setdefault(self.names[a], []).append((round(turn, 1), light))
        return {
            leg: [light for turn, light in each if turn <= min(each)[0] + 0.2]
            for leg, each in found.items()
        }

    def _lane_name(self, lane: SurveyLane, k: int, side: str) -> str:
        leg = self.legs[k]
        own = leg.approaches if side == "approach" else leg.exits
        return f"{self.names[k]}:{side}:{own.index(lane) + 1}"

    def _lanelets(self) -> Iterator[Lanelet]:
        into: dict[str, list[str]] = {}
        for i, way in enumerate(self.ways):
            into.setdefault(way.approach, []).append(f"connector:{i + 1}")
        for k, leg in enumerate(self.legs):
            for lane in leg.approaches:
                yield _lanelet(
                    self._cut(lane, k),
                    lane,
                    id=self._lane_name(lane, k, "approach"),
                    kind="approach",
                    leg=self.names[k],
                    successors=tuple(into.get(lane.id, ())),
                )
            for lane in leg.exits:
                yield _lanelet(
                    self._out(lane),
                    lane,
                    id=self._lane_name(lane, k, "exit"),
                    kind="exit",
                    leg=self.names[k],
                )
        for i, way in enumerate(self.ways):
            lane = self.survey.approaches[way.approach]
            k = self.of_lane[way.exit]
            yield _lanelet(
                self._inner(i),
                lane,
                id=f"connector:{i + 1}",
                kind="connector",
                leg=None,
                successors=(self._lane_name(self.survey.exits[way.exit], k, "exit"),),
            )

    def _inner(self, i: int) -> FloatArray:
        """The part of a way between its stop line and its exit lane."""
        way, line = self.ways[i], self.whole[i]
        a = self._cut(self.survey.approaches[way.approach], self.of_lane[way.approach])[-1]
        b = self._out(self.survey.exits[way.exit])[0]
        first = int(np.argmin(np.hypot(*(line - a).T)))
        last = int(np.argmin(np.hypot(*(line - b).T)))
        return line[first : max(last, first + 1) + 1]

    def _stop_lines(self) -> Iterator[StopLine]:
        for k, leg in enumerate(self.legs):
            if not leg.approaches:
                continue
            across = np.array([-leg.outwards[1], leg.outwards[0]])
            ends = [self._cut(lane, k)[-1] for lane in leg.approaches]
            at = float(np.mean([(e - leg.throat) @ leg.outwards for e in ends]))
            side = [
                float((e - leg.throat) @ across) + sign * lane.width / 2
                for e, lane in zip(ends, leg.approaches, strict=True)
                for sign in (-1, 1)
            ]
            base = leg.throat + at * leg.outwards
            line = _points(np.array([base + min(side) * across, base + max(side) * across]))
            ids = tuple(self._lane_name(lane, k, "approach") for lane in leg.approaches)
            name = self.names[k]
            yield StopLine(id=f"{name}:stop", leg=name, lanelets=ids, line=(line[0], line[1]))

    def _movements(self, groups: Mapping[tuple[int, int], list[int]]) -> Iterator[VehicleMovement]:
        for (a, b), found in groups.items():
            entry, exit_ = self.names[a], self.names[b]
            turn = self._turn(entry, exit_, self._angle(self.ways[found[0]]))
            ids: list[str] = []
            for i in found:
                way = self.ways[i]
                ids += [
                    self._lane_name(self.survey.approaches[way.approach], a, "approach"),
                    f"connector:{i + 1}",
                    self._lane_name(self.survey.exits[way.exit], b, "exit"),
                ]
            yield VehicleMovement(
                id=f"{entry}>{exit_}:{turn}",
                entry=entry,
                exit=exit_,
                turn=turn,
                lanelets=tuple(ids),
                stop_line=f"{entry}:stop",
                centreline=_points(self.whole[found[0]]),
                signal_group=None,
            )

    def _turn(self, entry: Compass, exit_: Compass, angle: float) -> Any:
        if abs(angle) < CLEARLY_STRAIGHT:
            return "straight"
        if abs(angle) > CLEARLY_TURNED:
            return "left" if angle > 0 else "right"
        said = turn_by_name(entry, exit_)
        return said if said in ("straight", "left" if angle > 0 else "right") else "straight"

    def _crosswalks(self) -> Iterator[Crosswalk]:
        for k, section in self.sections.items():
            leg = self.names[k]
            ends = _points(section.ends)
            yield Crosswalk(
                id=f"{leg}:crosswalk",
                leg=leg,
                polygon=ring(areas.crosswalk_area(section)),
                centreline=(ends[0], ends[1]),
                sides=_sides(leg),
                width=section.width,
            )

    def _walks(self) -> Iterator[tuple[str, FloatArray]]:
        """By route id, the way of those who cross, for each pair of sidewalks."""
        corners = areas.corners_of(self.road, self.legs, self.extent)
        for k, section in self.sections.items():
            left, right = corners.get(k), corners.get((k - 1) % len(self.legs))
            if left is None or right is None:
                self._note(
                    f"the {self.names[k]} leg has no sidewalk on one side: nobody crosses it"
                )
                continue
            sides = _sides(self.names[k])
            for before, after in product(_SIDES, _SIDES):
                line = areas.walk_line(section, left, right, before=before, after=after)
                there = _rounded(line)
                key = f"pedestrian:{self.names[k]}"
                yield f"{key}:{sides[0]}>{sides[1]}:{before}>{after}", there
                yield f"{key}:{sides[1]}>{sides[0]}:{after}>{before}", there[::-1]

    def _pedestrian_routes(self, walks: Mapping[str, FloatArray]) -> Iterator[Route]:
        crossed = {name.split(":")[1] for name in walks}
        legs = [leg for leg in self.names if leg in crossed]
        for leg in legs:
            for entry, exit_ in (_sides(leg), _sides(leg)[::-1]):
                for before, after in product(_SIDES, _SIDES):
                    yield pedestrian_route(leg, entry, exit_, f"{before}>{after}")
        for leg in legs:
            for entry, exit_ in (_sides(leg), _sides(leg)[::-1]):
                yield pedestrian_route(leg, entry, exit_, None)

    def _goals(self, walks: Mapping[str, FloatArray]) -> Iterator[GoalRegion]:
        for k, leg in enumerate(self.legs):
            strips = [
                geos.LineString(_end(self._out(lane), 5.0)).buffer(lane.width / 2, cap_style="flat")
                for lane in leg.exits
            ]
            if strips:
                area = geos.union_all(strips).convex_hull
                name = self.names[k]
                yield GoalRegion(id=f"{name}:goal", type="vehicle", leg=name, polygon=ring(area))
        ends = {
            (name.split(":")[1], tuple(np.round(line[-1], 1).tolist())): line[-1]
            for name, line in walks.items()
        }
        for number, ((crossed, _), end) in enumerate(sorted(ends.items(), key=lambda e: e[0])):
            yield GoalRegion.model_validate(
                {
                    "id": f"{crossed}:goal:sidewalk_{number + 1}",
                    "type": "pedestrian",
                    "leg": crossed,
                    "polygon": ring(geos.Point(end).buffer(1.5, quad_segs=2)),
                }
            )


def _sided(leg: SurveyLeg) -> Iterator[tuple[SurveyLane, bool]]:
    yield from ((lane, True) for lane in leg.approaches)
    yield from ((lane, False) for lane in leg.exits)


def _sides(leg: Compass) -> tuple[Compass, Compass]:
    """Compass sides on the left and on the right of a leg, looking outwards."""
    at = RING.index(leg)
    return RING[(at - 2) % len(RING)], RING[(at + 2) % len(RING)]


def _reaching(lane: SurveyLane, approach: bool, reach: float) -> FloatArray:
    """The lane's middle, prolonged straight on until it is beyond the map's edge."""
    line = lane.line[::-1] if approach else lane.line
    inside = np.abs(line).max(axis=1) <= reach
    beyond = np.flatnonzero(~inside)
    if len(beyond):
        line = line[: max(beyond[0], 1) + 1]
    else:
        tail = _end(line, 8.0)
        way = (tail[-1] - tail[0]) / max(float(np.hypot(*(tail[-1] - tail[0]))), 1e-9)
        line = np.concatenate([line, [line[-1] + 3.0 * reach * way]])
        more = even(line, 1.0)
        out = np.flatnonzero(np.abs(more).max(axis=1) > reach)
        line = more[: out[0] + 1] if len(out) else more
    return np.asarray(line[::-1] if approach else line)


def _end(line: FloatArray, distance: float) -> FloatArray:
    """The last stretch of a line."""
    fine = even(line, 0.5)
    return fine[-max(round(distance / 0.5), 2) - 1 :]


def _run(line: FloatArray, inside: Any, *, towards_end: bool | None) -> FloatArray:
    """The stretch of a line that is inside: the last one, the first one, or from first to last."""
    where = np.flatnonzero(inside)
    if len(where) < 2:
        return line[:2] if towards_end is False else line[-2:]
    if towards_end is None:
        return line[where[0] : where[-1] + 1]
    breaks = np.flatnonzero(np.diff(where) > 1)
    if towards_end:
        first = where[breaks[-1] + 1] if len(breaks) else where[0]
        return line[first : where[-1] + 1]
    last = where[breaks[0]] if len(breaks) else where[-1]
    return line[where[0] : last + 1]


def _smooth(line: FloatArray) -> FloatArray:
    from scipy import ndimage

    filters: Any = ndimage
    fine = even(line, 0.5)
    return np.asarray(filters.gaussian_filter1d(fine, _SMOOTHING, axis=0, mode="nearest"))


def _rounded(line: FloatArray) -> FloatArray:
    """A walked line without sharp corners, ends kept."""
    from scipy import ndimage

    filters: Any = ndimage
    fine = even(line, 0.25)
    return even(np.asarray(filters.gaussian_filter1d(fine, 3.0, axis=0, mode="nearest")), 0.5)


def _sharpness(line: FloatArray) -> float:
    step = np.diff(line, axis=0)
    course = np.unwrap(np.arctan2(step[:, 1], step[:, 0]))
    return round(float(np.abs(np.diff(course)).max(initial=0.0)), 6)


def _points(line: FloatArray) -> Polyline:
    return tuple((round(float(x), 3) + 0.0, round(float(y), 3) + 0.0) for x, y in line)


def _lanelet(line: FloatArray, lane: SurveyLane, **fields: Any) -> Lanelet:
    thin = even(line, 2.0) if len_of(line) > 2.0 else line
    tangent = np.gradient(thin, axis=0)
    tangent /= np.maximum(np.hypot(*tangent.T), 1e-9)[:, None]
    normal = np.stack([-tangent[:, 1], tangent[:, 0]], axis=1) * lane.width / 2
    return Lanelet(
        left=_points(thin + normal),
        right=_points(thin - normal),
        centreline=_points(thin),
        width=round(lane.width, 3),
        speed_limit=round(float(np.clip(lane.speed, _LEAST_SPEED, _MOST_SPEED)), 3),
        **fields,
    )
