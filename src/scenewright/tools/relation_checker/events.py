"""Every event in a set of tracks, with precedence and evidence (SEMANTICS section 4)."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache, partial
from itertools import groupby
from operator import itemgetter
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
    find_causes,
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
    FirstContact,
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
from scenewright.tools.relation_checker.footprints import BoolArray, compute_angle_between
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
"""How far who still waits at the end, if nothing was asked for, or collides is taken to go straight
on [m]."""

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

    @cached_property
    def encounters_by_pair(self) -> dict[frozenset[int], list[Encounter]]:
        """Encounters by the ids of their two movers."""
        table: dict[frozenset[int], list[Encounter]] = {}
        for encounter in self.encounters:
            pair = frozenset((self.ids[encounter.first], self.ids[encounter.second]))
            table.setdefault(pair, []).append(encounter)
        return table

    def find_closest(self, pair: Collection[int]) -> Encounter | None:
        """The encounter of a pair of ids with the least PET, if that is up to 8.5 s."""
        encounters = self.encounters_by_pair.get(frozenset(pair), ())
        return min(encounters, key=lambda each: each.pet, default=None)

    def pet(self, pair: Pair) -> float | None:
        """Least PET of a pair of ids [s]; None above 8.5 s or without conflict."""
        closest = self.find_closest(pair)
        return None if closest is None else closest.pet


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
    encounters = find_encounters(grid.tracks, asked=asked, among=grid.table.pairs)
    lanes = measure_lane_gaps(grid)
    lights = SignalPlan(signals, intersection_map)
    observed = SceneObservation(grid, near, encounters, lanes, lights, ())
    events = _EventSearch(
        observed, intersection_map, frozenset(asked),
        frozenset(observed.ids if detailed is None else detailed),
        float(grid.table.times[-1]) if until is None else until, timely,
    ).list_events()  # fmt: skip
    for f in find_followings(lanes):
        follower, leader = grid.tracks[f.follower], grid.tracks[f.leader]
        events.append(_build_event(
            "follow", (follower, leader), time=f.start, evidence={"until": f.end},
            place=tuple(follower.xy[follower.index(f.start)]),
            when={k: _build_moment(follower, leader, *least) for k, least in f.least.items()},
        ))  # fmt: skip
    events.sort(key=lambda e: (e.time, e.from_, e.to))
    return replace(observed, events=tuple(events))


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
    """Looks for events pair by pair, with precedence; see `observe` for what it is given."""

    observed: SceneObservation
    intersection_map: IntersectionMap | None
    asked: frozenset[Pair]
    detailed: frozenset[int]
    until: float
    timely: bool

    @property
    def tracks(self) -> tuple[Trajectory, ...]:
        return self.observed.tracks

    @property
    def _left_hand(self) -> bool:
        return self.intersection_map is not None and self.intersection_map.left_hand_traffic

    @cached_property
    def _index(self) -> dict[int, int]:
        """Position of every mover, by id."""
        return {n: k for k, n in enumerate(self.observed.ids)}

    def _is_asked(self, first: Trajectory, second: Trajectory) -> bool:
        return not self.asked.isdisjoint(((first.id, second.id), (second.id, first.id)))

    def list_events(self) -> list[Event]:
        """Collisions, yields and near misses."""
        grid, near, found = self.observed.grid, self.observed.near, list[Event]()
        pairs, braked = grid.table.pairs, self._find_braked_pairs()
        # Rows of the pairs that may have an event; many others never have to do with another.
        waits = np.array(self._cut_off, dtype=np.bool_)[pairs].any(axis=1)
        wanted = grid.find_rows(
            [(encounter.first, encounter.second) for encounter in self.observed.encounters]
        )
        wanted |= self._crossed.any(axis=1)
        wanted |= waits & grid.find_rows([(self._index[a], self._index[b]) for a, b in self.asked])
        # One rides, the other drives.
        wheels = np.array([m.is_rider - 0.5 if m.is_vehicle else 0.0 for m in self.tracks])
        wanted |= (wheels[pairs].prod(axis=1) < 0.0) & np.isfinite(near.least)
        wanted[[*near.contacts, *braked]] = True
        for row in np.flatnonzero(wanted).tolist():
            first, second = (self.tracks[k] for k in pairs[row])
            if row in near.contacts:
                found += self._find_collision(near.contacts[row], first, second)
            # Unasked, people on foot may pass closely.
            elif first.is_vehicle or second.is_vehicle or self._is_asked(first, second):
                found += self._find_encounter_events(row, first, second, braked.get(row, ()))
        return found

    def _find_collision(
        self, contact: FirstContact, first: Trajectory, second: Trajectory
    ) -> list[Event]:
        time = contact.time
        hit = None if contact.initial else measure_impact(first, second, time=time)
        if hit is None or hit.relative_speed < IMPACT_SPEED:
            return []
        k = find_striker(first, second, hit)
        cause, late = find_causes(first, second, time=time, lights=self.observed.lights)
        evidence = {
            "relative_speed": hit.relative_speed, "speed_from": hit.speeds[k],
            "speed_to": hit.speeds[1 - k], "angle": hit.angle,
            "side_from": hit.sides[k], "side_to": hit.sides[1 - k],
            "point_from": hit.points[k], "point_to": hit.points[1 - k],
            "cause_agent": None, "late_brake": late,
        }  # fmt: skip
        return [_build_event(
            "collision", (first, second) if k == 0 else (second, first), time=time, place=hit.place,
            evidence=evidence,
            kind=classify_collision(first, second, hit, time=time, left_hand=self._left_hand),
            cause=cause,
        )]  # fmt: skip

    def _find_encounter_events(
        self, row: int, first: Trajectory, second: Trajectory, braked: Sequence[float]
    ) -> list[Event]:
        """Yields and near misses of a pair that never touches, one per encounter."""
        found: list[Event] = []
        covered: list[tuple[float, float]] = []
        apart = self.observed.near.least[row] >= YIELD_CLEARANCE
        for encounter in self._list_encounters(first, second):
            yielded = self._find_yield(encounter) if apart else None
            if yielded is not None:
                covered.append((yielded.begin, yielded.cleared))
            harsh = yielded is not None and (
                encounter.pet < YIELD_PET or yielded.braking > YIELD_BRAKING
            )
            times = encounter.first_time, encounter.second_time
            if yielded is not None and not harsh:
                order = (first, second) if times[0] > times[1] else (second, first)
                found.append(self._build_yield_event(order, yielded, encounter))
            elif harsh or encounter.pet <= NEAR_MISS_PET:
                found += self._find_near_miss(first, second, around=times, encounter=encounter)
        if not found and apart:
            found += self._find_unfinished_yield(row, (first, second))
        close_calls = [t for t in braked if not any(a <= t <= b for a, b in covered)]
        if close_calls and not any(e.type == "near_miss" for e in found):
            found += self._find_near_miss(first, second, around=close_calls)
        if not found:
            passed = find_close_overtaking(first, second, left_hand=self._left_hand)
            if passed is not None:
                found += self._find_near_miss(first, second, around=passed[:1])
        return found

    def _list_encounters(self, first: Trajectory, second: Trajectory) -> Sequence[Encounter]:
        return self.observed.encounters_by_pair.get(frozenset((first.id, second.id)), ())

    def _find_yield(self, encounter: Encounter) -> YieldEvent | None:
        movers = (self.tracks[encounter.first], self.tracks[encounter.second])
        times = (encounter.first_time, encounter.second_time)
        other, giver = movers if times[1] > times[0] else movers[::-1]
        if encounter.pet > MAX_PET or not _slows(giver, until=max(times)):
            return None
        zone = find_nearest_zone(giver, other, giver.at(np.array([max(times)]))[0][0])
        return None if zone is None else self._find_yield_at(zone, giver, other)

    def _find_yield_at(
        self, zone: Area, giver: Trajectory, other: Trajectory, real_end: float | None = None
    ) -> YieldEvent | None:
        stay, passing = (find_zone_occupancy(each, zone) for each in (giver, other))
        if stay is None or passing is None:
            return None
        brink = float(np.interp(stay.enter, giver.times, giver.s)) + giver.nose
        real, grid = self.observed.by_id[giver.id], self.observed.grid

        def has_leader(time: float) -> bool:
            longest = float(grid.table.reach.max())
            reach = 3.0 * float(real.speed.max()) + 20.0 + real.nose + longest
            near = grid.list_near(real.at(np.array([time]))[0], time, within=reach)
            others = (m for m in near if m is not real and m.id != other.id)
            return any(is_leading(real, m, time=time, before=brink) for m in others)

        def is_on_crosswalk(time: float) -> bool:
            if self.intersection_map is None or other.is_vehicle:
                return False
            xy, _ = other.at(np.array([time]))
            walks = (
                crosswalk.area for crosswalk in get_ground_raster(self.intersection_map).crosswalks
            )
            return other.start <= time <= other.end and any(
                w.intersects(zone) and w.intersects(geos.Point(xy[0])) for w in walks
            )

        return find_yield(ZonePassage(
            giver, stay, passing, red=partial(self.observed.lights.is_held, real),
            leader=has_leader, excused=lambda t: self._waits_for_another(real, other, t),
            real_end=real_end, on_crosswalk=is_on_crosswalk,
            other_start=other.start if self.timely else None,
        ))  # fmt: skip

    def _waits_for_another(self, giver: Trajectory, other: Trajectory, time: float) -> bool:
        """Whether the giver waits for yet another agent that a relation binds it to."""
        partners = {a if b == giver.id else b for a, b in self.asked if giver.id in (a, b)}
        for partner in partners - {other.id}:
            for encounter in self._list_encounters(giver, self.observed.by_id[partner]):
                times = (encounter.first_time, encounter.second_time)
                own, theirs = times if self.tracks[encounter.first] is giver else times[::-1]
                if time - 4.0 <= theirs < own:
                    return True
        return False

    @cached_property
    def _cut_off(self) -> list[bool]:
        """Of every mover, whether it slowed and the scene's end or a collision ends its track."""
        ended = [m.end >= self.until - CUT for m in self.tracks]
        for row, contact in self.observed.near.contacts.items():
            for k in self.observed.grid.table.pairs[row].tolist():
                ended[k] |= contact.time >= self.tracks[k].end - CUT
        return [end and _slows(m, until=m.end) for end, m in zip(ended, self.tracks, strict=True)]

    @cached_property
    def _crossed(self) -> BoolArray:
        """[M, 2] whether a pair's second crosses the way straight ahead of where its first was cut
        off, and the reverse.

        Cheap and necessary for a yield. And late enough: an agent standing at the end has not done
        so for more than 4 s since.
        """
        onwards = [
            ONWARDS[m.type] if cut else -1.0
            for m, cut in zip(self.tracks, self._cut_off, strict=True)
        ]
        since = [
            m.end - (RESUME_WITHIN + 1.0 if m.speed[-1] <= LIMITS[m.type].resumed else MAX_PET)
            for m in self.tracks
        ]
        return _search_crossers_ahead(self.observed.grid.table, np.array(onwards), np.array(since))

    def _find_unfinished_yield(
        self, row: int, movers: tuple[Trajectory, Trajectory]
    ) -> list[Event]:
        """A yield whose giver still waits when the scene, or a collision, ends its track."""
        for side, (giver, other) in enumerate((movers, movers[::-1])):
            asked = (giver.id, other.id) in self.asked
            cut_off = self._cut_off[self._index[giver.id]]
            if not cut_off or not (asked or self._crossed[row, side]):
                continue
            onwards = 25.0 if asked else ONWARDS[giver.type]
            further = _drive_on(giver, onwards, self.observed.lights)
            if further is None:
                continue
            for zone in find_conflict_zones(further, other):
                yielded = self._find_yield_at(zone, further, other, real_end=giver.end)
                if yielded is not None and yielded.braking <= YIELD_BRAKING:
                    return [self._build_yield_event((giver, other), yielded)]
        return []

    def _build_yield_event(
        self,
        tracks: tuple[Trajectory, Trajectory],
        yielded: YieldEvent,
        encounter: Encounter | None = None,
    ) -> Event:
        evidence = {
            "pet": None, "approach_speed": yielded.approach,
            "lowest_speed": yielded.lowest, "begins_to_slow": yielded.begin,
            "braking": yielded.braking, "other_cleared": yielded.cleared, "entered": yielded.enter,
            "would_have_entered": yielded.arrival,
        }  # fmt: skip
        cleared, lights = yielded.cleared, self.observed.lights
        return _build_event(
            "yielding", tracks, time=yielded.time, place=yielded.place, evidence=evidence,
            cause=find_red_run(tracks[1], tracks[0], time=cleared, lights=lights),
            **self._measure_moments(*tracks, encounter, until=cleared),
        )  # fmt: skip

    def _find_near_miss(
        self,
        first: Trajectory,
        second: Trajectory,
        *,
        around: Sequence[float],
        encounter: Encounter | None = None,
    ) -> list[Event]:
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
        cause, late = find_causes(first, second, time=time, lights=self.observed.lights)
        return [_build_event(
            "near_miss", (first, second), time=time,
            place=find_contact_point(first, second, time=time),
            evidence={"pet": None, "clearance": clearance, "cause_agent": None, "late_brake": late},
            cause=cause,
            **self._measure_moments(first, second, encounter, until=max(*around, time)),
        )]  # fmt: skip

    def _measure_moments(
        self, first: Trajectory, second: Trajectory, encounter: Encounter | None, *, until: float
    ) -> dict[str, dict[str, Moment]]:
        """`when` and `worst` of an event: the figures of its encounter and of the 6 s before a
        time, and the worst of the whole scene between two that a relation binds."""
        when = {} if encounter is None else {"pet": self._build_pet_moment(encounter)}
        if self.detailed.isdisjoint((first.id, second.id)):
            return {"when": when}
        when |= _measure_surrogates(first, second, until=until)
        if not self._is_asked(first, second):
            return {"when": when}
        worst = {}
        if (least := self.observed.find_closest((first.id, second.id))) is not None:
            worst["pet"] = self._build_pet_moment(least)
        if (closest := find_least_clearance(first, second)) is not None:
            worst["clearance"] = _build_moment(first, second, closest[1], closest[0])
        return {"when": when, "worst": worst | _measure_surrogates(first, second)}

    def _build_pet_moment(self, encounter: Encounter) -> Moment:
        return _build_moment(
            self.tracks[encounter.first], self.tracks[encounter.second],
            encounter.pet, encounter.first_time, encounter.second_time,
        )  # fmt: skip

    def _find_braked_pairs(self) -> dict[int, list[float]]:
        """By row of pairs: times of path TTC <= 1.5 s while one of the two brakes hard."""
        found: dict[int, list[float]] = {}
        table, contacts = self.observed.grid.table, self.observed.near.contacts
        speed, acceleration = (
            np.concatenate([np.zeros(0), *(getattr(m, name) for m in self.tracks)])
            for name in ("speed", "acceleration")
        )
        hard = [m.is_vehicle and (m.acceleration < -NEAR_MISS_BRAKING).any() for m in self.tracks]
        steps = _find_hard_braking(table, np.array(hard, dtype=np.bool_), speed, acceleration)
        for row, samples in groupby(steps, key=itemgetter(0)):
            if row in contacts:
                continue
            first, second = (self.tracks[n] for n in table.pairs[row])
            times = find_common_times(first, second)[[k for _, k in samples]]
            ttc = compute_path_ttc(first, second, times=times, horizon=NEAR_MISS_TTC)
            if len(close := times[ttc <= NEAR_MISS_TTC]):
                found[row] = close.tolist()
        return found


@compiled
def _find_hard_braking(
    grid: GridTable, hard: BoolArray, speed: FloatArray, acceleration: FloatArray
) -> list[tuple[int, int]]:
    """Rows and common samples at which one of two that come near brakes hard."""
    found = [(0, 0) for _ in range(0)]
    for row in range(len(grid.pairs)):
        a, b = grid.pairs[row]
        for k in range(grid.common[row, 1] if hard[a] or hard[b] else 0):
            column = grid.common[row, 0] + k
            i, j = grid.shift[a] + column, grid.shift[b] + column
            if min(acceleration[i], acceleration[j]) < -NEAR_MISS_BRAKING:
                most = (speed[i] + speed[j]) * NEAR_MISS_TTC + 1.0
                if compute_gap_at(grid, row, k) <= most:
                    found.append((row, k))
    return found


@lru_cache(maxsize=64)
def _drive_on(giver: Trajectory, onwards: float, lights: SignalPlan) -> Trajectory | None:
    """A giver that goes straight on for so far [m]; None if a light held it until its track ends.

    Several pairs ask for the same ones; movers and lights are known by identity.
    """
    further = extend_straight(giver, distance=onwards, speed=2.0 if giver.is_vehicle else 1.0)
    held = is_held_throughout(further, giver.end, partial(lights.is_held, giver))
    return None if held else further


def _slows(giver: Trajectory, *, until: float) -> bool:
    """Cheap: whether it was moving and then fell to 0.6 of an earlier speed or less."""
    speed = giver.speed[: giver.index(until) + 1]
    peak = np.maximum.accumulate(speed)
    return bool(((peak >= LIMITS[giver.type].moving) & (speed <= 0.6 * peak)).any())


@compiled
def _search_crossers_ahead(grid: GridTable, onwards: FloatArray, since: FloatArray) -> BoolArray:
    """What `_crossed` holds.

    Args:
        onwards: [N] how far each mover is thought to go straight on [m]; negative if not at all.
        since: [N] from when on others count that cross its way [s].
    """
    length, width = grid.sizes[0], grid.sizes[1] + grid.sizes[2]
    found = np.zeros((len(grid.pairs), 2), np.bool_)
    for n in range(2 * len(grid.pairs)):
        row, side = n // 2, n % 2
        giver, other = grid.pairs[row, side], grid.pairs[row, 1 - side]
        last = grid.origin[giver + 1] - 1
        facing, ahead = grid.heading[last], onwards[giver]
        alike = (grid.sizes[2, giver] > 0.0) == (grid.sizes[2, other] > 0.0)
        for k in range(grid.origin[other], grid.origin[other + 1] if ahead >= 0.0 else 0):
            if grid.times[k - grid.shift[other]] < since[giver]:
                continue
            east, north = grid.xy[k, 0] - grid.xy[last, 0], grid.xy[k, 1] - grid.xy[last, 1]
            if np.hypot(east, north) > ahead + width[giver] + width[other] + length[other]:
                continue
            turn = grid.heading[k] - facing
            along = np.cos(facing) * east + np.sin(facing) * north
            aside = abs(np.cos(facing) * north - np.sin(facing) * east)
            room = width[giver] + width[other] + length[other] * abs(np.sin(turn))
            inside = 0 <= along <= ahead and aside <= room
            if inside and (np.cos(turn) < np.cos(SHARED) or not alike):
                found[row, side] = True
                break
    return found


_ONE_WAY = np.radians(15.0)
"""Headings this close [rad] are of one direction."""


def _face_one_way(first: Trajectory, second: Trajectory, time: float) -> bool:
    headings = (track.at(np.array([time]))[1] for track in (first, second))
    return bool(compute_angle_between(*headings)[0] < _ONE_WAY)


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
