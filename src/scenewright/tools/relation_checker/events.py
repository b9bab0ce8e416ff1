"""Every event in a set of tracks, with precedence and evidence (SEMANTICS section 4)."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, cached_property, partial
from typing import Any

import numpy as np

from scenewright.compiled import compiled
from scenewright.scene.base import FloatArray
from scenewright.scene.events import Event, Moment
from scenewright.scene.map import IntersectionMap
from scenewright.scene.record import SignalRecord
from scenewright.tools.relation_checker.collisions import (
    IMPACT_SPEED,
    classify_collision,
    find_cause,
    find_late_braker,
    find_red_run,
    find_striker,
    measure_impact,
)
from scenewright.tools.relation_checker.conflict_zones import (
    SHARED,
    find_conflict_zones,
    find_nearest_zone,
    find_zone_occupancy,
)
from scenewright.tools.relation_checker.contact import (
    GridTable,
    PairGaps,
    PairGrid,
    build_pair_grid,
    compute_gap_at,
    find_common_times,
    find_contact_point,
    find_least_clearance,
    measure_pair_gaps,
)
from scenewright.tools.relation_checker.encroachment import Encounter, find_encounters
from scenewright.tools.relation_checker.following import (
    LaneGaps,
    find_close_overtaking,
    find_followings,
    measure_lane_gaps,
)
from scenewright.tools.relation_checker.footprints import BoolArray, IntArray, double_room
from scenewright.tools.relation_checker.ground_raster import get_ground_raster
from scenewright.tools.relation_checker.planar import Area, geos
from scenewright.tools.relation_checker.signals import SignalPlan
from scenewright.tools.relation_checker.surrogates import (
    compute_drac,
    compute_path_ttc,
    compute_ttc_2d,
)
from scenewright.tools.relation_checker.trajectory import (
    RoadUser,
    Trajectory,
    build_trajectories,
    extend_straight,
)
from scenewright.tools.relation_checker.yielding import (
    LIMITS,
    MAX_PET,
    RESUME_WITHIN,
    YieldEvent,
    ZonePassage,
    find_yield,
    is_held_throughout,
    is_leading,
)

NEAR_MISS_PET = 1.5
NEAR_MISS_TTC = 1.5
NEAR_MISS_BRAKING = 3.4
YIELD_CLEARANCE = 0.3
YIELD_PET = 0.5
YIELD_BRAKING = 5.0
CUT = 0.2 + 1e-6
"""A track that ends this shortly before the scene, or after a contact [s], was ended by it."""
ONWARDS = {"vehicle": 15.0, "pedestrian": 5.0, "cyclist": 15.0, "scooter": 15.0}
"""How far who still waits at the end is taken to go straight on, if nothing was asked for [m]."""

Pair = tuple[int, int]


@dataclass(frozen=True, eq=False)
class SceneObservation:
    """Everything measured in one set of tracks.

    Attributes:
        grid: all tracks on one clock; near: their gaps and contacts; encounters: with their PET;
            lanes: leader of each follower; lights: the light of each agent.
        events: in order of time.
    """

    grid: PairGrid
    near: PairGaps
    encounters: tuple[Encounter, ...]
    lanes: tuple[LaneGaps, ...]
    lights: SignalPlan
    events: tuple[Event, ...]

    @property
    def tracks(self) -> tuple[Trajectory, ...]:
        """All tracks, in the order given."""
        return self.grid.tracks

    @cached_property
    def ids(self) -> list[int]:
        """Ids of the tracks, in the order given."""
        return [track.id for track in self.tracks]

    @cached_property
    def by_id(self) -> dict[int, Trajectory]:
        """The tracks by their ids."""
        return {track.id: track for track in self.tracks}

    def list_encounters(self, pair: Collection[int]) -> list[Encounter]:
        """Encounters of a pair of ids."""
        ids, wanted = self.ids, set(pair)
        return [e for e in self.encounters if {ids[e.first], ids[e.second]} == wanted]

    def pet(self, pair: Pair) -> float | None:
        """Least PET of a pair of ids [s]; None above 8.5 s or without conflict."""
        return min((each.pet for each in self.list_encounters(pair)), default=None)


def find_events(
    users: Sequence[RoadUser],
    *,
    intersection_map: IntersectionMap | None = None,
    signals: Sequence[SignalRecord] = (),
    until: float | None = None,
) -> tuple[Event, ...]:
    """All collisions, yields, near misses and follows in any tracks, in order of time.

    Needs neither roles nor relations nor a map; a map and its signals add the red light as a reason
    to stop and as a cause, and crosswalks as places where pedestrians have priority.

    Args:
        until: end of the recording [s]; None means the last sample.

    Raises:
        InputError: an id twice, an empty track, an unusable step or size.
    """
    return observe(
        users, intersection_map=intersection_map, signals=signals, until=until, near_only=True
    ).events


def observe(
    users: Sequence[RoadUser],
    *,
    intersection_map: IntersectionMap | None = None,
    signals: Sequence[SignalRecord] = (),
    asked: Collection[Pair] = (),
    detailed: Collection[int] | None = None,
    until: float | None = None,
    near_only: bool = False,
    timely: bool = True,
) -> SceneObservation:
    """Measures all pairs and finds all events.

    Args:
        asked: pairs of ids bound by a relation, `from` first; the path of a giver that still waits
            when the scene ends is followed on further for them.
        detailed: ids whose events carry TTC and DRAC as evidence; None means all.
        until: end of the scene [s], which may cut a wait short; None means the last sample.
        near_only: measure no gaps of pairs that are never near one another.
        timely: giving way to an agent that is not there yet, or has gone, is none (SEMANTICS 8);
            scenes made before there was that rule are held to the earlier one.
    """
    grid = build_pair_grid(build_trajectories(list(users)), near_only=near_only)
    near = measure_pair_gaps(grid)
    encounters = find_encounters(grid.tracks, asked=asked, among=grid.pairs)
    lanes = measure_lane_gaps(grid)
    lights = SignalPlan(signals, intersection_map)
    lights.find_all_crossings(grid.tracks)
    until = float(grid.times[-1]) if until is None and len(grid.times) else until or 0.0
    search = _EventSearch(
        grid, near, encounters, intersection_map, lights, frozenset(asked), until, timely
    )
    events = search.events({m.id for m in grid.tracks} if detailed is None else set(detailed))
    for f in find_followings(lanes):
        pair = follower, leader = grid.tracks[f.follower], grid.tracks[f.leader]
        least = {"least_gap": (f.least_gap, f.gap_time),
                 "least_headway": (f.least_headway, f.headway_time)}  # fmt: skip
        events.append(_build_event(
            "follow", pair, time=f.start, place=tuple(follower.xy[follower.index(f.start)]),
            evidence={"until": f.end} | {name: value for name, (value, _) in least.items()},
            when={name: _build_moment(follower, leader, value, time)
                  for name, (value, time) in least.items() if value is not None},
        ))  # fmt: skip
    events.sort(key=lambda e: (e.time, e.from_, e.to))
    return SceneObservation(grid, near, encounters, lanes, lights, tuple(events))


def _build_event(
    name: str,
    pair: tuple[Trajectory, Trajectory],
    *,
    time: float,
    place: tuple[float, ...],
    evidence: dict[str, Any],
    cause: tuple[str, int] | None = None,
    when: Mapping[str, Moment] | None = None,
    **more: Any,
) -> Event:
    """An event with rounded figures; the agent that caused it is part of the evidence."""
    evidence = evidence | {name: each.value for name, each in (when or {}).items()}
    rounded = {k: round(v, 3) if isinstance(v, float) else v for k, v in evidence.items()}
    if cause is not None:
        rounded["cause_agent"], more["cause"] = cause[1], cause[0]
    return Event.model_validate({
        "type": name, "from": pair[0].id, "to": pair[1].id, "time": round(time, 3),
        "location": (round(float(place[0]), 3), round(float(place[1]), 3)),
        "evidence": {k: v for k, v in rounded.items() if v is not None},
        "when": {k: each for k, each in (when or {}).items() if each.value}, **more,
    })  # fmt: skip


def _build_moment(
    first: Trajectory,
    second: Trajectory,
    value: float,
    time: float,
    other_time: float | None = None,
) -> Moment:
    """A figure of two agents: midway between them, at the later of two times [s]."""
    x, y = find_contact_point(first, second, time=time, other_time=other_time)
    later = max(time, time if other_time is None else other_time)
    return Moment(value=round(value, 3), time=round(later, 3), location=(round(x, 3), round(y, 3)))


@dataclass(frozen=True, eq=False)
class _EventSearch:
    """Looks for events pair by pair, with precedence."""

    grid: PairGrid
    near: PairGaps
    encounters: tuple[Encounter, ...]
    intersection_map: IntersectionMap | None
    lights: SignalPlan
    asked: frozenset[Pair]
    until: float
    timely: bool

    @cached_property
    def by_pair(self) -> dict[Pair, list[Encounter]]:
        """Encounters by the indices of their movers."""
        table: dict[Pair, list[Encounter]] = {}
        for encounter in self.encounters:
            table.setdefault((encounter.first, encounter.second), []).append(encounter)
        return table

    def events(self, detailed: set[int]) -> list[Event]:
        """Collisions, yields and near misses."""
        found: list[Event] = []
        braked = self._find_braked_pairs()
        # Rows of the pairs that may have an event; many others never have to do with another.
        asked = [(self._index[a], self._index[b]) for a, b in self.asked]
        waits = np.array(self._cut_off, dtype=np.bool_)[self.grid.pairs]
        wanted = self.grid.find_rows(self.by_pair) | self._crossed.any(axis=1)
        wanted |= waits.any(axis=1) & self.grid.find_rows(asked)
        # One rides, the other drives.
        wheels = np.array([m.is_rider - 0.5 if m.is_vehicle else 0.0 for m in self.tracks])
        wanted |= (wheels[self.grid.pairs].prod(axis=1) < 0.0) & np.isfinite(self.near.least)
        wanted[[*self.near.contacts, *braked]] = True
        for row in np.flatnonzero(wanted).tolist():
            i, j = self.grid.pairs[row].tolist()
            first, second = self.tracks[i], self.tracks[j]
            ids = first.id, second.id
            if row in self.near.contacts:
                found += self._find_collision(row, first, second)
            # Unasked, people on foot may pass closely.
            elif first.is_vehicle or second.is_vehicle or {ids, ids[::-1]} & self.asked:
                full = not detailed.isdisjoint(ids)
                found += self._find_encounter_events(row, (i, j), braked.get(row, ()), full)
        return found

    def _find_collision(self, row: int, first: Trajectory, second: Trajectory) -> list[Event]:
        contact = self.near.contacts[row]
        if contact.initial:
            return []
        hit = measure_impact(first, second, time=contact.time)
        if hit.relative_speed < IMPACT_SPEED:
            return []
        k = find_striker(first, second, hit)
        order = (first, second) if k == 0 else (second, first)
        cause = find_cause(first, second, time=contact.time, lights=self.lights)
        evidence = {
            "relative_speed": hit.relative_speed, "speed_from": hit.speeds[k],
            "speed_to": hit.speeds[1 - k], "angle": hit.angle,
            "side_from": hit.sides[k], "side_to": hit.sides[1 - k],
            "point_from": hit.points[k], "point_to": hit.points[1 - k],
            "cause_agent": None, "late_brake": find_late_braker(first, second, time=contact.time),
        }  # fmt: skip
        kind = classify_collision(first, second, hit, time=contact.time, left_hand=self._left_hand)
        return [_build_event(
            "collision", order, time=contact.time, place=hit.place, evidence=evidence, kind=kind,
            cause=cause,
        )]  # fmt: skip

    def _find_encounter_events(
        self, row: int, pair: Pair, braked: Sequence[float], full: bool
    ) -> list[Event]:
        """Yields and near misses of a pair that never touches, one per encounter."""
        first, second = (self.tracks[k] for k in pair)
        found: list[Event] = []
        covered: list[tuple[float, float]] = []
        for encounter in self.by_pair.get(pair, ()):
            yielded = self._find_yield(row, encounter)
            if yielded is not None:
                covered.append((yielded.begin, yielded.cleared))
            harsh = yielded is not None and (
                encounter.pet < YIELD_PET or yielded.braking > YIELD_BRAKING
            )
            times = encounter.first_time, encounter.second_time
            if yielded is not None and not harsh:
                order = (first, second) if times[0] > times[1] else (second, first)
                found.append(self._build_yield_event(order, yielded, full, encounter))
            elif harsh or encounter.pet <= NEAR_MISS_PET:
                found += self._find_near_miss(pair, encounter, full, around=times)
        if not found:
            found += self._find_unfinished_yield(row, pair, full)
        close_calls = [t for t in braked if not any(a <= t <= b for a, b in covered)]
        if close_calls and not any(e.type == "near_miss" for e in found):
            found += self._find_near_miss(pair, None, full, around=close_calls)
        if not found:
            passed = find_close_overtaking(first, second, left_hand=self._left_hand)
            if passed is not None:
                found += self._find_near_miss(pair, None, full, around=passed[:1])
        return found

    @property
    def _left_hand(self) -> bool:
        return self.intersection_map is not None and self.intersection_map.left_hand_traffic

    def _find_yield(self, row: int, encounter: Encounter) -> YieldEvent | None:
        if encounter.pet > MAX_PET or self.near.least[row] < YIELD_CLEARANCE:
            return None
        later = encounter.second_time > encounter.first_time
        i, j = (encounter.second, encounter.first) if later else (encounter.first, encounter.second)
        giver, other = self.tracks[i], self.tracks[j]
        time = encounter.second_time if later else encounter.first_time
        if not _slows(giver, until=max(encounter.first_time, encounter.second_time)):
            return None
        zone = find_nearest_zone(giver, other, giver.at(np.array([time]))[0][0])
        return None if zone is None else self._find_yield_at(zone, giver, other)

    def _find_yield_at(
        self, zone: Area, giver: Trajectory, other: Trajectory, real_end: float | None = None
    ) -> YieldEvent | None:
        stay, passing = (find_zone_occupancy(each, zone) for each in (giver, other))
        if stay is None or passing is None:
            return None
        brink = float(np.interp(stay.enter, giver.times, giver.s)) + giver.nose
        real = self.tracks[self._index[giver.id]]

        def has_leader(time: float) -> bool:
            reach = 3.0 * float(real.speed.max()) + 20.0 + real.nose + float(self.grid.reach.max())
            near = self.grid.list_near(real.at(np.array([time]))[0], time, within=reach)
            others = (m for m in near if m is not real and m.id != other.id)
            return any(is_leading(real, m, time=time, before=brink) for m in others)

        def is_on_crosswalk(time: float) -> bool:
            if self.intersection_map is None or other.is_vehicle:
                return False
            xy, _ = other.at(np.array([time]))
            walks = (each.area for each in get_ground_raster(self.intersection_map).crosswalks)
            return other.start <= time <= other.end and any(
                w.intersects(zone) and w.intersects(geos.Point(xy[0])) for w in walks
            )

        return find_yield(ZonePassage(
            giver, stay, passing, red=partial(self.lights.is_held, real), leader=has_leader,
            excused=lambda t: self._waits_for_another(real, other, t), real_end=real_end,
            on_crosswalk=is_on_crosswalk, other_start=other.start if self.timely else None,
        ))  # fmt: skip

    @cached_property
    def _index(self) -> dict[int, int]:
        """Position of every mover, by id."""
        return {m.id: k for k, m in enumerate(self.tracks)}

    def _waits_for_another(self, giver: Trajectory, other: Trajectory, time: float) -> bool:
        """Whether the giver waits for yet another agent that a relation binds it to."""
        partners = {a if b == giver.id else b for a, b in self.asked if giver.id in (a, b)}
        for each in self.encounters if partners else ():
            times = {
                self.tracks[each.first].id: each.first_time,
                self.tracks[each.second].id: each.second_time,
            }
            theirs = [times[n] for n in times.keys() & (partners - {other.id})]
            if giver.id in times and theirs and time - 4.0 <= theirs[0] < times[giver.id]:
                return True
        return False

    @cached_property
    def _cut_off(self) -> list[bool]:
        """Of every mover, whether it slowed and the scene's end or a collision ends its track."""
        ended = [m.end >= self.until - CUT for m in self.tracks]
        for row, contact in self.near.contacts.items():
            for k in self.grid.pairs[row].tolist():
                ended[k] |= contact.time >= self.tracks[k].end - CUT
        return [end and _slows(m, until=m.end) for end, m in zip(ended, self.tracks, strict=True)]

    @cached_property
    def _crossed(self) -> BoolArray:
        """[M, 2] whether a pair's second crosses the way straight ahead of where its first was cut
        off, and the reverse.

        Cheap and necessary for a yield. And late enough: an agent standing at the end has not done
        so for more than 4 s since.
        """
        table = np.array([
            (*m.xy[-1].tolist(), float(m.heading[-1]), ONWARDS[m.type],
             m.end - (RESUME_WITHIN + 1.0 if m.speed[-1] <= LIMITS[m.type].resumed else MAX_PET),
             cut, m.is_vehicle, m.half_width + m.radius, m.half_length, *m.bounds)
            for m, cut in zip(self.tracks, self._cut_off, strict=True)
        ]).reshape(-1, 13)  # fmt: skip
        return _search_crossers_ahead(self.grid.table, table)

    def _find_unfinished_yield(self, row: int, pair: Pair, full: bool) -> list[Event]:
        """A yield whose giver still waits when the scene, or a collision, ends its track."""
        for side, (i, j) in enumerate((pair, pair[::-1])):
            giver, other = self.grid.tracks[i], self.grid.tracks[j]
            asked = (giver.id, other.id) in self.asked
            onwards = 25.0 if asked else ONWARDS[giver.type]
            if not self._cut_off[i] or not (asked or self._crossed[row, side]):
                continue
            if self.near.least[row] < YIELD_CLEARANCE:
                continue
            further, held = self._drive_on(giver, onwards)
            if held:
                continue
            for zone in find_conflict_zones(further, other):
                yielded = self._find_yield_at(zone, further, other, real_end=giver.end)
                if yielded is not None and yielded.braking <= YIELD_BRAKING:
                    return [self._build_yield_event((giver, other), yielded, full)]
        return []

    @cached_property
    def _drive_on(self) -> Callable[[Trajectory, float], tuple[Trajectory, bool]]:
        """A giver that goes straight on for so far [m], and whether a light held it until then."""

        def drive_on(giver: Trajectory, onwards: float) -> tuple[Trajectory, bool]:
            speed = 2.0 if giver.is_vehicle else 1.0
            further = extend_straight(giver, distance=onwards, speed=speed)
            red = partial(self.lights.is_held, giver)
            return further, is_held_throughout(further, giver.end, red)

        return cache(drive_on)

    def _build_yield_event(
        self,
        tracks: tuple[Trajectory, Trajectory],
        yielded: YieldEvent,
        full: bool,
        encounter: Encounter | None = None,
    ) -> Event:
        when = {} if encounter is None else {"pet": self._build_pet_moment(encounter)}
        evidence = {
            "pet": None, "approach_speed": yielded.approach,
            "lowest_speed": yielded.lowest, "begins_to_slow": yielded.begin,
            "braking": yielded.braking, "other_cleared": yielded.cleared, "entered": yielded.enter,
            "would_have_entered": yielded.arrival,
        }  # fmt: skip
        when |= _measure_surrogates(*tracks, until=yielded.cleared) if full else {}
        cause = find_red_run(tracks[1], tracks[0], time=yielded.cleared, lights=self.lights)
        return _build_event(
            "yielding", tracks, time=yielded.time, place=yielded.place, cause=cause,
            evidence=evidence, when=when, worst=self._measure_worst(*tracks) if full else {},
        )  # fmt: skip

    def _build_pet_moment(self, encounter: Encounter) -> Moment:
        return _build_moment(
            self.tracks[encounter.first], self.tracks[encounter.second],
            encounter.pet, encounter.first_time, encounter.second_time,
        )  # fmt: skip

    def _measure_worst(self, first: Trajectory, second: Trajectory) -> dict[str, Moment]:
        """Each figure's worst value between two that a relation binds, over the whole scene."""
        if not {(first.id, second.id), (second.id, first.id)} & self.asked:
            return {}
        i, j = sorted((self._index[first.id], self._index[second.id]))
        encounters = self.by_pair.get((i, j), ())
        found = {}
        if encounters:
            least = min(encounters, key=lambda each: each.pet)
            found["pet"] = self._build_pet_moment(least)
        if (closest := find_least_clearance(first, second)) is not None:
            found["clearance"] = _build_moment(first, second, closest[1], closest[0])
        return found | _measure_surrogates(first, second)

    def _find_near_miss(
        self, pair: Pair, encounter: Encounter | None, full: bool, *, around: Sequence[float]
    ) -> list[Event]:
        first, second = (self.tracks[k] for k in pair)
        # The closest approach around the encounter, else of all.
        begin, end = min(around), max(around)
        closest = find_least_clearance(first, second, within=(begin - 3.0, end + 3.0))
        abreast = closest is not None and _face_one_way(first, second, closest[0])
        if abreast and not _face_one_way(first, second, begin):
            # Side by side on the approach is not yet where one turns across the other's way.
            closest = find_least_clearance(first, second, within=(begin, end)) or closest
        closest = closest or find_least_clearance(first, second)
        if closest is None:
            return []
        time, clearance = closest
        cause = find_cause(first, second, time=time, lights=self.lights)
        evidence = {
            "pet": None,
            "clearance": clearance,
            "cause_agent": None,
            "late_brake": find_late_braker(first, second, time=time),
        }
        when = {} if encounter is None else {"pet": self._build_pet_moment(encounter)}
        when |= _measure_surrogates(first, second, until=max(*around, time)) if full else {}
        place = find_contact_point(first, second, time=time)
        return [_build_event(
            "near_miss", (first, second), time=time, place=place, evidence=evidence, cause=cause,
            when=when, worst=self._measure_worst(first, second) if full else {},
        )]  # fmt: skip

    def _find_braked_pairs(self) -> dict[int, list[float]]:
        """By row of pairs: times of path TTC <= 1.5 s while one of the two brakes hard."""
        found: dict[int, list[float]] = {}
        speed, acceleration = (
            np.concatenate([np.zeros(0), *(getattr(m, name) for m in self.tracks)])
            for name in ("speed", "acceleration")
        )
        hard = [m.is_vehicle and (m.acceleration < -NEAR_MISS_BRAKING).any() for m in self.tracks]
        steps = _find_hard_braking(
            self.grid.table, np.array(hard, dtype=np.bool_), speed, acceleration
        )
        for row in np.unique(steps[0]).tolist():
            if row in self.near.contacts:
                continue
            first, second = (self.tracks[n] for n in self.grid.pairs[row])
            times = find_common_times(first, second)[steps[1][steps[0] == row]]
            ttc = compute_path_ttc(first, second, times=times, horizon=NEAR_MISS_TTC)
            close = times[ttc <= NEAR_MISS_TTC]
            if len(close):
                found[row] = close.tolist()
        return found

    @property
    def tracks(self) -> tuple[Trajectory, ...]:
        return self.grid.tracks


@compiled
def _find_hard_braking(
    grid: GridTable, hard: BoolArray, speed: FloatArray, acceleration: FloatArray
) -> tuple[IntArray, IntArray]:
    """Rows and common samples at which one of two that come near brakes hard."""
    row: IntArray = np.empty(64, np.intp)
    step: IntArray = np.empty(64, np.intp)
    count = 0
    for n in range(len(grid.pairs)):
        a, b = grid.pairs[n]
        for k in range(grid.common[n, 1] if hard[a] or hard[b] else 0):
            column = grid.common[n, 0] + k
            i, j = grid.shift[a] + column, grid.shift[b] + column
            if min(acceleration[i], acceleration[j]) >= -NEAR_MISS_BRAKING:
                continue
            if compute_gap_at(grid, n, k) <= (speed[i] + speed[j]) * NEAR_MISS_TTC + 1.0:
                if count == len(row):
                    row, step = double_room(row), double_room(step)
                row[count], step[count] = n, k
                count += 1
    return row[:count], step[:count]


def _slows(giver: Trajectory, *, until: float) -> bool:
    """Cheap: whether it was moving and then fell to 0.6 of an earlier speed or less."""
    speed = giver.speed[: giver.index(until) + 1]
    peak = np.maximum.accumulate(speed)
    return bool(((peak >= LIMITS[giver.type].moving) & (speed <= 0.6 * peak)).any())


@compiled
def _search_crossers_ahead(grid: GridTable, table: FloatArray) -> BoolArray:
    found = np.zeros((len(grid.pairs), 2), np.bool_)
    for n in range(2 * len(grid.pairs)):
        row, side = n // 2, n % 2
        giver, other = grid.pairs[row, side], grid.pairs[row, 1 - side]
        x, y, facing, onwards, since, cut = table[giver, :6]
        alike = table[giver, 6] == table[other, 6]
        west, south, east, north = table[other, 9:]
        beside = onwards + table[giver, 7] + table[other, 7] + table[other, 8]
        away = max(west - x, x - east, south - y, y - north)
        if not cut or away > beside:
            continue
        for k in range(grid.origin[other], grid.origin[other + 1]):
            if grid.times[k - grid.shift[other]] < since:
                continue
            east, north = grid.xy[k, 0] - x, grid.xy[k, 1] - y
            turn = grid.heading[k] - facing
            along = np.cos(facing) * east + np.sin(facing) * north
            aside = abs(np.cos(facing) * north - np.sin(facing) * east)
            room = table[giver, 7] + table[other, 7] + table[other, 8] * abs(np.sin(turn))
            inside = 0 <= along <= onwards and aside <= room
            if inside and (np.cos(turn) < np.cos(SHARED) or not alike):
                found[row, side] = True
                break
    return found


_ONE_WAY = np.radians(15.0)
"""Headings this close [rad] are of one direction."""


def _face_one_way(first: Trajectory, second: Trajectory, time: float) -> bool:
    (one,), (two,) = first.at(np.array([time]))[1], second.at(np.array([time]))[1]
    return bool(abs(np.angle(np.exp(1j * (one - two)))) < _ONE_WAY)


def _measure_surrogates(
    first: Trajectory, second: Trajectory, *, until: float | None = None
) -> dict[str, Moment]:
    """Least path TTC and 2-D TTC, largest DRAC, in the 6 s before a time; None: of all times."""
    times = find_common_times(first, second)
    if until is not None:
        times = times[(times >= until - 6.0) & (times <= until + 1e-6)]
    if len(times) == 0:
        return {}
    along = compute_path_ttc(first, second, times=times)
    ttc = compute_ttc_2d(first, second, times=times)
    drac = compute_drac(first, second, times=times, ttc=ttc)
    found = {}
    for name, values, worst in (
        ("path_ttc", along, along.argmin()),
        ("ttc_2d", ttc, ttc.argmin()),
        ("drac", drac, drac.argmax()),
    ):
        if np.isfinite(values[worst]):
            value, time = float(values[worst]), float(times[worst])
            found[name] = _build_moment(first, second, value, time)
    return found
