"""From a survey of a junction to the map of an intersection, with a report of what was assumed."""

from __future__ import annotations

import math
import zlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations, product
from operator import attrgetter
from typing import Any

import numpy as np

from scenewright.errors import InputError
from scenewright.geometry.polyline import (
    measure_courses,
    measure_length,
    resample_by_spacing,
    rotate_left,
    smooth_gaussian,
)
from scenewright.scene.base import Compass, FloatArray
from scenewright.scene.map import IntersectionMap
from scenewright.scene.map_elements import (
    Crosswalk,
    GoalRegion,
    Lanelet,
    Leg,
    SignalProgram,
    StopLine,
    VehicleMovement,
)
from scenewright.tools.map_import import ground_areas as ground
from scenewright.tools.map_import.check_file import MapFormat
from scenewright.tools.map_import.compass import find_sides, name_turn
from scenewright.tools.map_import.curves import LEAST_RADIUS, measure_least_radius, round_curves
from scenewright.tools.map_import.ground_areas import CrosswalkPlacement
from scenewright.tools.map_import.legs import (
    CLEARLY_STRAIGHT,
    CLEARLY_TURNED,
    SurveyLeg,
    find_legs,
    name_legs,
    orient_outwards,
)
from scenewright.tools.map_import.map_parts import (
    SIDEWALKS,
    RouteLines,
    build_area,
    build_conflict_zones,
    build_lanelet,
    build_pedestrian_routes,
    build_ring,
    build_vehicle_route,
    geos,
    round_points,
)
from scenewright.tools.map_import.mapped_crosswalks import choose_crossings
from scenewright.tools.map_import.quality_report import (
    CrosswalkFact,
    describe_crosswalk,
    list_crosswalk_notes,
    rate_crosswalks,
)
from scenewright.tools.map_import.signal_programs import (
    SignalInput,
    build_signal_program,
    find_lit_legs,
)
from scenewright.tools.map_import.survey import ReportItem, Survey, SurveyConnection, SurveyLane

_EXTENTS = (50.0, 90.0)
_ROOM = 28.0
"""How much of every leg a map shows beyond its throat at least [m]."""
_CROSSING_ROOM = 14.0
"""How much of a leg it shows beyond its crosswalk [m]."""
_SPEED_LIMITS = (4.0, 19.0)
_LONGEST_U_TURN = 40.0
"""A longer way back into its own leg is a detour inside the junction, no way of the file [m]."""
_ON_GROUND = 0.9
"""Share of a walked path that lies on sidewalks and its crosswalk."""

_Movements = Mapping[tuple[int, int], list[int]]
"""Connections by entry and exit leg; those of the gentlest curve first."""


@dataclass(frozen=True, eq=False)
class ImportedMap:
    """A map of one junction of a file, with what a map does not hold.

    Attributes:
        route_lines: by route id, the middles of the paths that it may take; for pedestrians one.
        notes: what was derived, assumed or dropped, one fact a line.
        crosswalks: where the crosswalk of each leg comes from.
        items: what was read, derived and assumed, one for each kind of thing.
        survey: what the file said.
    """

    intersection_map: IntersectionMap
    route_lines: RouteLines
    notes: tuple[str, ...]
    map_format: MapFormat
    crosswalks: tuple[CrosswalkFact, ...]
    items: tuple[ReportItem, ...]
    survey: Survey


def assemble_map(
    survey: Survey,
    map_format: MapFormat,
    *,
    name: str,
    extent: float | None = None,
    title: str | None = None,
    signals: str = "keep",
) -> ImportedMap:
    """The map of a surveyed junction.

    Args:
        extent: half the side of the square that the map covers [m]; None takes what it needs.
        signals: `keep` what the file has, `assume` a programme where it has none, or `none`.

    Raises:
        InputError: too few legs, or no path through.
    """
    assembly = _Assembly(survey, extent)
    intersection_map = assembly.build_map(name, title, signals)
    assembly.notes += list_crosswalk_notes(assembly.crosswalk_facts)
    return ImportedMap(
        intersection_map,
        {**assembly.vehicle_lines, **{k: (line,) for k, line in assembly.crossing_lines.items()}},
        tuple(assembly.notes),
        map_format,
        assembly.crosswalk_facts,
        assembly.rate_items(map_format),
        survey,
    )


class _Assembly:
    """The parts of one junction's map, each derived when it is first needed."""

    def __init__(self, survey: Survey, extent: float | None) -> None:
        self.survey = survey
        self.notes = [survey.side.describe(), *survey.notes]
        self.rounded = 0
        self.crossed: dict[int, str] = {}
        self.refused: dict[int, str] = {}
        self.legs = find_legs(survey)
        self.leg_of_lane = {lane.id: k for k, leg in enumerate(self.legs) for lane in leg.lanes}
        self.crossings = choose_crossings(survey, self.legs)
        # How far from the middle the file's crosswalks reach, seen along their legs [m].
        reaches = [
            float(np.abs(self.legs[k].throat).max())
            + float((mapped.middle - self.legs[k].throat) @ self.legs[k].outwards)
            for k, mapped in self.crossings.by_leg.items()
        ]
        self.extent = _choose_extent(self.legs, extent, max(reaches, default=0.0))
        pairs = [(connection, self._find_leg_pair(connection)) for connection in survey.connections]
        self.connections = [each for each, (entry, exit_) in pairs if entry != exit_]
        if len(self.connections) < len(pairs):
            self._add_note("ways that turn back into their own leg were dropped")
        if not self.connections:
            raise InputError(f"{survey.title} has no way for vehicles from one leg to another")
        self.names = name_legs(
            self.legs,
            [
                (*self._find_leg_pair(connection), self._measure_turn(connection))
                for connection in self.connections
            ],
        )
        self.lane_names = {
            lane.id: f"{name}:{side}:{n}"
            for name, leg in zip(self.names, self.legs, strict=True)
            for side, lanes in (("approach", leg.approaches), ("exit", leg.exits))
            for n, lane in enumerate(lanes, start=1)
        }
        self.extended = {
            lane.id: _extend_lane(
                lane, is_approach, self.extent + 20.0, leg.approaches if is_approach else leg.exits
            )
            for leg in self.legs
            for lane, is_approach in leg.directed_lanes
        }

    def _add_note(self, line: str) -> None:
        if line not in self.notes:
            self.notes.append(line)

    def _find_leg_pair(self, connection: SurveyConnection) -> tuple[int, int]:
        return self.leg_of_lane[connection.approach], self.leg_of_lane[connection.exit]

    def _measure_turn(self, connection: SurveyConnection) -> float:
        """How far a connection turns, positive to the left [rad]."""
        before = self.survey.approaches[connection.approach].line
        after = self.survey.exits[connection.exit].line
        whole = np.concatenate(
            [_take_end(before, 12.0), connection.line, _take_end(after[::-1], 12.0)[::-1]]
        )
        course = measure_courses(resample_by_spacing(whole, 1.0))
        return float(course[-3:].mean() - course[:3].mean())

    @cached_property
    def road(self) -> Any:
        strips = [(self.extended[x.id], max(x.width, 2.8)) for leg in self.legs for x in leg.lanes]
        # As they are driven: a curve drawn anew may leave the ground of the file's line.
        for each, line in zip(self.connections, self.whole, strict=True):
            strips.append((line, max(self.survey.approaches[each.approach].width, 3.0)))
        island = {"smallest_island": 12.0} if self.survey.is_roundabout else {}
        return ground.build_road(strips, self.survey.areas, **island)

    @cached_property
    def placements(self) -> dict[int, CrosswalkPlacement]:
        """By leg: where its crosswalk lies; none crosses another one."""
        found = {}
        for k, leg in enumerate(self.legs):
            room = self.extent - 9.0 - float(np.abs(leg.throat).max())
            mapped = self.crossings.by_leg.get(k)
            found[k], why = ground.place_crosswalk(leg, self.road, mapped, room=room)
            if why:
                self.refused[k] = why
        kept: dict[int, CrosswalkPlacement] = {}
        # Of two that cross, that stays which lies nearest to the middle of the file's.
        off = {
            k: math.inf
            if placed is None or placed.mapped is None
            else round(math.dist(placed.middle, placed.mapped.middle), 3)
            for k, placed in found.items()
        }
        for k, placed in sorted(found.items(), key=lambda each: (off[each[0]], each[0])):
            if placed is None:
                self._add_note(f"no crosswalk found room on the {self.names[k]} leg")
            elif crossed := [j for j, other in sorted(kept.items()) if placed.crosses(other)]:
                self.crossed[k] = f"would cross the crosswalk of the {self.names[crossed[0]]} leg"
                self._add_note(f"the {self.names[k]} leg has no crosswalk: it {self.crossed[k]}")
            else:
                kept[k] = placed
        return dict(sorted(kept.items()))

    @cached_property
    def crosswalk_facts(self) -> tuple[CrosswalkFact, ...]:
        """By leg: where its crosswalk comes from, and how far it is from what the file holds."""
        placements = self.placements
        choice = self.crossings.leave_out(self.crossed)
        return tuple(
            describe_crosswalk(
                name, placements.get(k), choice, k, self.survey.crossings, self.refused.get(k, "")
            )
            for k, name in enumerate(self.names)
        )

    def _clip_approach(self, lane: SurveyLane, k: int) -> FloatArray:
        """An approach from the map's edge to its stop line."""
        line = resample_by_spacing(self.extended[lane.id], 0.5)
        placed = self.placements.get(k)
        if placed is None or placed.mapped is None:
            ahead = (line - self.legs[k].throat) @ self.legs[k].outwards
            stop = 0.0
            if placed is not None:
                stop = placed.distance + placed.width / 2 + ground.STOP_GAP
            return _take_last_run(line, self._is_inside(line) & (ahead >= stop))
        # On to a mapped crosswalk along its straightest way if that lies inside.
        ways = [connection for connection in self.connections if connection.approach == lane.id]
        if ways:
            onwards = min(ways, key=lambda each: round(abs(self._measure_turn(each)), 3)).line
            line = np.concatenate([line, onwards])
        longer = resample_by_spacing(line, 0.5)
        clear = placed.area.buffer(ground.STOP_GAP, join_style="mitre")
        met = np.flatnonzero(geos.contains_xy(clear, *longer.T))
        kept = longer[: met[0]] if len(met) else line
        return _take_last_run(kept, self._is_inside(kept))

    def _clip_exit(self, lane: SurveyLane) -> FloatArray:
        line = resample_by_spacing(self.extended[lane.id], 0.5)[::-1]
        return _take_last_run(line, self._is_inside(line))[::-1]

    def _is_inside(self, line: FloatArray) -> Any:
        return np.abs(line).max(axis=1) <= self.extent

    @cached_property
    def whole(self) -> list[FloatArray]:
        """By connection: its path from map edge to map edge, smoothed."""
        found = []
        for connection in self.connections:
            before, after = self.extended[connection.approach], self.extended[connection.exit]
            # Without the corners that readers leave where pieces meet; a point every half metre.
            even = resample_by_spacing(np.concatenate([before, connection.line, after]), 0.5)
            smooth = smooth_gaussian(even, 3.0)
            line = round_curves(smooth)
            self.rounded += line is not smooth  # it was sharper than cars can drive
            inside = np.flatnonzero(self._is_inside(line))
            found.append(line[inside[0] : inside[-1] + 1] if len(inside) > 1 else line[-2:])
        return found

    @cached_property
    def by_movement(self) -> _Movements:
        groups: dict[tuple[int, int], list[int]] = {}
        for i, connection in enumerate(self.connections):
            groups.setdefault(self._find_leg_pair(connection), []).append(i)
        # The largest turn between two steps of each path [rad].
        turns = (np.abs(np.diff(measure_courses(line))).max(initial=0.0) for line in self.whole)
        sharpness = [round(float(turn), 6) for turn in turns]
        return {
            pair: sorted(found, key=sharpness.__getitem__) for pair, found in sorted(groups.items())
        }

    def build_map(self, name: str, title: str | None, signals: str) -> IntersectionMap:
        lanelets = tuple(self._build_lanelets())
        stop_lines = tuple(self._build_stop_lines())
        crosswalks = tuple(self._build_crosswalks())
        entries, exits = (
            [k for k, leg in enumerate(self.legs) if lanes(leg)]
            for lanes in (attrgetter("approaches"), attrgetter("exits"))
        )
        for a, b in product(entries, exits):
            own = [self.connections[i] for i in self.by_movement.get((a, b), ())]
            between = f"from {self.names[a]} to {self.names[b]}"
            if not own and a != b:
                self._add_note(f"no way leads {between}")
            elif own and all(each.is_added for each in own):
                self._add_note(f"the way {between} was added: the file allows it, no line is drawn")
        program = self._build_signals(crosswalks, signals)
        movements = self._build_movements(program)
        lines = {m.id: self.vehicle_lines[f"vehicle:{m.id}"] for m in movements}
        crossed = {route.split(":")[1] for route in self.crossing_lines}
        road = self.road.intersection(ground.build_square(self.extent))
        self._add_note(f"sidewalks were derived: {self._describe_sidewalks()}")
        walkable = geos.union_all([self.sidewalks, *self.refuges.values()])
        return IntersectionMap(
            name=name,
            map_id=zlib.crc32(name.encode()) % 1_000_000,
            title=(title or self.survey.title)[:90],
            extent=self.extent,
            left_hand_traffic=self.survey.side.left_hand,
            legs=tuple(
                Leg(name=n, road=(leg.road or f"{n} road")[:60], bearing=round(leg.bearing, 6))
                for n, leg in zip(self.names, self.legs, strict=True)
            ),
            lanelets=lanelets,
            stop_lines=stop_lines,
            crosswalks=crosswalks,
            road=tuple(map(build_area, ground.list_polygons(road))),
            walkable=tuple(map(build_area, ground.list_polygons(walkable))),
            goal_regions=(*self._build_vehicle_goals(), *self._build_pedestrian_goals()),
            movements=movements,
            conflict_zones=tuple(build_conflict_zones(lines, movements, crosswalks)),
            signals=program,
            routes=(
                *map(build_vehicle_route, movements),
                *build_pedestrian_routes(leg for leg in self.names if leg in crossed),
            ),
        )

    def _describe_sidewalks(self) -> str:
        walked = sum(geos.Polygon(outline).area for outline in self.survey.walks)
        more = f", and {walked:.0f} m² on which people were seen to walk" if walked else ""
        return f"3 m along every outer kerb{more}"

    def _build_signals(self, crosswalks: Sequence[Crosswalk], mode: str) -> SignalProgram | None:
        # By entry leg, the survey's lights of its straightest connections.
        found: dict[Compass, list[tuple[float, str]]] = {}
        for (entry, _), own in self.by_movement.items():
            for connection in (self.connections[i] for i in own):
                if connection.light is not None:
                    turn = round(abs(self._measure_turn(connection)), 1)
                    found.setdefault(self.names[entry], []).append((turn, connection.light))
        # By crosswalk, the survey's lights of its stages.
        walks = {}
        for k, placed in self.placements.items():
            stages = () if placed.mapped is None else placed.mapped.stages
            lights = [x.crossing.light for x in stages if x.crossing.light is not None]
            if lights and len(lights) == len(stages):
                walks[f"{self.names[k]}:crosswalk"] = lights
        program, self.signal_item = build_signal_program(
            self.survey,
            SignalInput(
                straight=self._find_straight_pairs(),
                clashes=self._find_clashes(),
                lights={
                    leg: [light for turn, light in each if turn <= min(each)[0] + 0.2]
                    for leg, each in found.items()
                },
                walks=walks,
                groups={
                    self.names[k]: name
                    for k, name in find_lit_legs(self.survey, self.legs, self.crossings).items()
                },
            ),
            movements=self._build_movements(None),
            crosswalks=crosswalks,
            mode=mode,
            add_note=self._add_note,
        )
        return program

    def _find_clashes(self) -> set[tuple[Compass, Compass]]:
        """Entry legs whose ways straight on cross."""
        straight = self._find_straight_pairs()
        lines = {
            (self.names[a], self.names[b]): geos.LineString(self.whole[own[0]])
            for (a, b), own in self.by_movement.items()
            if (self.names[a], self.names[b]) in straight
        }
        return {
            (first[0], second[0])
            for first, second in combinations(lines, 2)
            if first[1] != second[1] and lines[first].crosses(lines[second])
        }

    def _find_straight_pairs(self) -> set[tuple[Compass, Compass]]:
        """By entry, the exit that it leads to with the least turning, if that is no turn."""
        turns: dict[int, list[tuple[float, int]]] = {}
        for (a, b), found in self.by_movement.items():
            turn = abs(self._measure_turn(self.connections[found[0]]))
            turns.setdefault(a, []).append((turn, b))
        best = {a: min(own) for a, own in turns.items()}
        return {
            (self.names[a], self.names[b]) for a, (turn, b) in best.items() if turn < CLEARLY_TURNED
        }

    def _name_lanes(self, i: int) -> tuple[str, str, str]:
        """The names of the approach, the connector and the exit of a connection."""
        each = self.connections[i]
        return self.lane_names[each.approach], f"connector:{i + 1}", self.lane_names[each.exit]

    def _build_lanelets(self) -> Iterator[Lanelet]:
        ways = [self._name_lanes(i) for i in range(len(self.connections))]
        for k, leg in enumerate(self.legs):
            for lane in leg.approaches:
                name = self.lane_names[lane.id]
                onwards = tuple(inner for approach, inner, _ in ways if approach == name)
                yield _build_lanelet(
                    self._clip_approach(lane, k), lane, id=name, kind="approach",
                    leg=self.names[k], successors=onwards,
                )  # fmt: skip
            for lane in leg.exits:
                yield _build_lanelet(
                    self._clip_exit(lane), lane, id=self.lane_names[lane.id], kind="exit",
                    leg=self.names[k],
                )  # fmt: skip
        for i, (_, inner, onto) in enumerate(ways):
            lane = self.survey.approaches[self.connections[i].approach]
            yield _build_lanelet(
                self._cut_connector(i), lane, id=inner, kind="connector", leg=None,
                successors=(onto,),
            )  # fmt: skip

    def _cut_connector(self, i: int) -> FloatArray:
        """The part of a connection between its stop line and its exit lane."""
        connection, line = self.connections[i], self.whole[i]
        lane = self.survey.approaches[connection.approach]
        begin = self._clip_approach(lane, self.leg_of_lane[lane.id])[-1]
        end = self._clip_exit(self.survey.exits[connection.exit])[0]
        first, last = (int(np.argmin(np.hypot(*(line - point).T))) for point in (begin, end))
        return line[first : max(last, first + 1) + 1]

    def _build_stop_lines(self) -> Iterator[StopLine]:
        for k, leg in enumerate(self.legs):
            if not leg.approaches:
                continue
            name, placed = self.names[k], self.placements.get(k)
            left = rotate_left(leg.outwards)  # along the stop line, looking outwards
            if placed is not None and placed.mapped is not None:
                across = placed.ends[0] - placed.ends[1]
                left = across / np.hypot(*across)
            ends = np.array([self._clip_approach(lane, k)[-1] for lane in leg.approaches])
            outwards = -rotate_left(left)
            distance = float(np.mean([(end - leg.throat) @ outwards for end in ends]))
            lateral = [
                float((end - leg.throat) @ left) + sign * lane.width / 2
                for end, lane in zip(ends, leg.approaches, strict=True)
                for sign in (-1, 1)
            ]
            base = leg.throat + distance * outwards
            line = round_points([base + min(lateral) * left, base + max(lateral) * left])
            ids = tuple(self.lane_names[lane.id] for lane in leg.approaches)
            yield StopLine(id=f"{name}:stop", leg=name, lanelets=ids, line=(line[0], line[1]))

    def _build_movements(self, program: SignalProgram | None) -> tuple[VehicleMovement, ...]:
        groups = {m: g.id for g in program.groups for m in g.movements} if program else {}
        found = []
        for (a, b), own in self.by_movement.items():
            entry, exit_ = self.names[a], self.names[b]
            turn = _classify_turn(entry, exit_, self._measure_turn(self.connections[own[0]]))
            name = f"{entry}>{exit_}:{turn}"
            movement = VehicleMovement(
                id=name,
                entry=entry,
                exit=exit_,
                turn=turn,
                lanelets=tuple(lane for i in own for lane in self._name_lanes(i)),
                stop_line=f"{entry}:stop",
                centreline=round_points(self.whole[own[0]]),
                signal_group=groups.get(name),
            )
            found.append(movement)
        return tuple(found)

    @cached_property
    def vehicle_lines(self) -> dict[str, tuple[FloatArray, ...]]:
        """By route id, the middles of the paths of vehicles."""
        movements = zip(self._build_movements(None), self.by_movement.values(), strict=True)
        return {f"vehicle:{m.id}": tuple(self.whole[i] for i in own) for m, own in movements}

    def rate_items(self, map_format: MapFormat) -> tuple[ReportItem, ...]:
        """What was read, derived and assumed of the map."""
        side, kept = self.survey.side, len(self.connections)
        back = sum(
            measure_length(connection.line) < _LONGEST_U_TURN
            for connection in self.survey.connections
            if connection not in self.connections
        )
        held = kept + back + self.survey.lost
        added = sum(connection.is_added for connection in self.connections)
        lanes = ReportItem("lanes", "read", 1.0, "as drawn")
        if map_format == "osm":
            lanes = ReportItem("lanes", "partly read", 0.5, "guessed where the file has no tags")
        return (
            lanes,
            ReportItem(
                "ways through", "read" if kept == held else "partly read", round(kept / held, 3),
                f"{kept} of {held} kept" + (f", {added} added" if added else ""),
            ),
            self._rate_curves(),
            rate_crosswalks(self.crosswalk_facts),
            self.signal_item,
            ReportItem(
                "side of the road", "read" if side.is_known else "assumed",
                1.0 if side.is_known else 0.5, side.describe(),
            ),
            ReportItem("sidewalks", "derived", None, self._describe_sidewalks()),
        )  # fmt: skip

    def _rate_curves(self) -> ReportItem:
        """How sharp the ways through bend, and how many were sharper in the file."""
        least = min(measure_least_radius(line) for line in self.whole)
        radius = f"the sharpest has a radius of {least:.1f} m" if least < 100 else "all straight"
        if not self.rounded:
            return ReportItem("curves", "read", 1.0, radius)
        detail = f"{self.rounded} of {len(self.whole)} sharper than {LEAST_RADIUS:.0f} m rounded"
        if still := sum(measure_least_radius(line) < LEAST_RADIUS for line in self.whole):
            detail += f", {still} of them only in part, as the file's lines leave no room"
        share = 1 - self.rounded / len(self.whole)
        return ReportItem("curves", "partly read", round(share, 3), f"{detail}; {radius}")

    def _build_crosswalks(self) -> Iterator[Crosswalk]:
        for k, placed in self.placements.items():
            leg, ends = self.names[k], round_points(placed.ends)
            yield Crosswalk(
                id=f"{leg}:crosswalk",
                leg=leg,
                polygon=build_ring(placed.area),
                centreline=(ends[0], ends[1]),
                sides=find_sides(leg),
                width=placed.width,
            )

    @cached_property
    def crossing_lines(self) -> dict[str, FloatArray]:
        """By route id, the path of pedestrians over a crosswalk, for each pair of sidewalks."""
        found = {}
        for k, placed in self.placements.items():
            key, (a, b) = f"pedestrian:{self.names[k]}", find_sides(self.names[k])
            lines = {
                pair: ground.build_crossing_line(
                    placed, self._list_corners(k), before=pair[0], after=pair[1]
                )
                for pair in product(SIDEWALKS, SIDEWALKS)
            }
            for pair, line in lines.items():  # without sharp corners, ends kept
                smooth = smooth_gaussian(resample_by_spacing(line, 0.25), 3.0)
                lines[pair] = resample_by_spacing(smooth, 0.5)
            walked = geos.union_all([self.sidewalks, placed.area, self.refuges[k]]).buffer(0.3)
            shares = (geos.contains_xy(walked, *line.T).mean() for line in lines.values())
            if not all(share > _ON_GROUND for share in shares):
                self._add_note(
                    f"the crosswalk on the {self.names[k]} leg ends on no sidewalk: nobody walks "
                    "over it"
                )
                continue
            for (before, after), line in lines.items():
                found[f"{key}:{a}>{b}:{before}>{after}"] = line
                found[f"{key}:{b}>{a}:{after}>{before}"] = line[::-1]
        return found

    @cached_property
    def corners(self) -> dict[int, FloatArray]:
        """By leg: the middle of the sidewalk from it to the next leg."""
        return ground.build_corner_lines(self.road, self.legs, self.extent)

    def _list_corners(self, k: int) -> tuple[FloatArray | None, FloatArray | None]:
        """The sidewalks to the left and to the right of a leg, looking outwards."""
        return self.corners.get(k), self.corners.get((k - 1) % len(self.legs))

    @cached_property
    def refuges(self) -> dict[int, Any]:
        """By leg: ground beside its crosswalk that is no sidewalk."""
        return {
            k: placed.find_refuge(self.road, self._list_corners(k))
            for k, placed in self.placements.items()
        }

    @cached_property
    def sidewalks(self) -> Any:
        """The derived sidewalks and where people were seen to walk, off the road."""
        walks = [geos.Polygon(outline).buffer(0) for outline in self.survey.walks]
        seen = geos.union_all(walks).difference(self.road)
        derived = ground.build_sidewalks(self.road, self.extent)
        return derived.union(seen).intersection(ground.build_square(self.extent))

    def _build_vehicle_goals(self) -> Iterator[GoalRegion]:
        for name, leg in zip(self.names, self.legs, strict=True):
            strips = [
                geos.LineString(_take_end(self._clip_exit(x), 5.0)).buffer(
                    x.width / 2, cap_style="flat"
                )
                for x in leg.exits
            ]
            if strips:
                area = build_ring(geos.union_all(strips).convex_hull)
                yield GoalRegion(id=f"{name}:goal", type="vehicle", leg=name, polygon=area)

    def _build_pedestrian_goals(self) -> Iterator[GoalRegion]:
        ends = {
            (route.split(":")[1], tuple(np.round(line[-1], 1).tolist())): line[-1]
            for route, line in self.crossing_lines.items()
        }
        for number, ((leg, _), end) in enumerate(sorted(ends.items(), key=lambda e: e[0]), start=1):
            area = build_ring(geos.Point(end).buffer(1.5, quad_segs=2))
            name = f"{leg}:goal:sidewalk_{number}"
            fields = {"id": name, "type": "pedestrian", "leg": leg, "polygon": area}
            yield GoalRegion.model_validate(fields)


def _choose_extent(legs: Sequence[SurveyLeg], wanted: float | None, crossings: float) -> float:
    far = max(float(np.abs(leg.throat).max()) for leg in legs)
    if wanted is None:
        needed = max(far + _ROOM, crossings + _CROSSING_ROOM)
        extent = float(np.clip(math.ceil(needed), *_EXTENTS))
        if far + 10.0 > extent:
            raise InputError(
                f"the junction reaches {far:.0f} m from its middle, too far for one map; choose a "
                "part of the file by --center, or give --extent"
            )
        return extent
    if not far + 10.0 <= wanted <= 200.0:
        raise InputError(
            f"an extent of {wanted:g} m does not do: the junction needs {far + 10.0:.0f} to 200 m"
        )
    return wanted


def _classify_turn(entry: Compass, exit_: Compass, angle: float) -> Any:
    """The turn of a movement by its angle; between straight and turned, as its legs are named."""
    side = "left" if angle > 0 else "right"
    if abs(angle) > CLEARLY_TURNED:
        return side
    return (
        side if abs(angle) >= CLEARLY_STRAIGHT and name_turn(entry, exit_) == side else "straight"
    )


def _extend_lane(
    lane: SurveyLane, is_approach: bool, reach: float, beside: Sequence[SurveyLane]
) -> FloatArray:
    """The lane's middle, prolonged until it is beyond the map's edge.

    A turning lane, that begins where the one beside it has long begun, leaves that one; others go
    straight on.
    """
    line = orient_outwards(lane, is_approach)
    for each in beside:
        other = resample_by_spacing(orient_outwards(each, is_approach), 1.0)
        apart = np.hypot(*(other - line[-1]).T)
        if apart.min() < _BESIDE and len(other) - apart.argmin() > _TAPER + 10:
            line = np.concatenate([line, other[apart.argmin() + _TAPER :]])
            break
    if not (np.abs(line).max(axis=1) > reach).any():
        tail = _take_end(line, 8.0)
        ahead = (tail[-1] - tail[0]) / max(float(np.hypot(*(tail[-1] - tail[0]))), 1e-9)
        line = resample_by_spacing(np.concatenate([line, [line[-1] + 3.0 * reach * ahead]]), 1.0)
    beyond = np.flatnonzero(np.abs(line).max(axis=1) > reach)
    line = line[: max(beyond[0], 1) + 1] if len(beyond) else line
    return np.asarray(line[::-1] if is_approach else line)


_TAPER = 15
"""Within so much a turning lane leaves the one beside it [m]."""
_BESIDE = 5.0
"""Lanes whose middles lie closer are side by side [m]."""


def _take_end(line: FloatArray, distance: float) -> FloatArray:
    """The last stretch of a line, a point every half metre."""
    return resample_by_spacing(line, 0.5)[-max(round(distance / 0.5), 2) - 1 :]


def _take_last_run(line: FloatArray, inside: Any) -> FloatArray:
    """The last stretch of a line that is inside."""
    where = np.flatnonzero(inside)
    if len(where) < 2:
        return line[-2:]
    run = np.split(where, np.flatnonzero(np.diff(where) > 1) + 1)[-1]
    return line[run[0] : run[-1] + 1]


def _build_lanelet(line: FloatArray, lane: SurveyLane, **fields: Any) -> Lanelet:
    if not measure_length(line) > 0.01:
        raise InputError(
            f"lane {lane.id} has no length inside the map, as where a junction is as wide as its "
            "legs are long; give a larger --extent, or choose another junction"
        )
    thin = resample_by_spacing(line, 2.0) if measure_length(line) > 2.0 else line
    limit = float(np.clip(lane.speed, *_SPEED_LIMITS))
    return build_lanelet(thin, width=lane.width, speed_limit=limit, **fields)
