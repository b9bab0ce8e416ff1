"""Every event in a set of tracks, with precedence and evidence (SEMANTICS section 4)."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any

import numpy as np

from scenewright.scene.events import Event
from scenewright.scene.map import IntersectionMap
from scenewright.scene.record import SignalRecord
from scenewright.tools.relation_checker.collisions import (
    IMPACT_SPEED,
    cause_of,
    impact,
    kind_of,
    late_braker,
    red_run,
    striking,
)
from scenewright.tools.relation_checker.contact import (
    Closeness,
    Crowd,
    closeness,
    common_times,
    gather,
    least_clearance,
    meeting_point,
)
from scenewright.tools.relation_checker.encroachment import Encounter, encounters
from scenewright.tools.relation_checker.following import LaneGaps, followings, lane_gaps
from scenewright.tools.relation_checker.footprints import BoolArray
from scenewright.tools.relation_checker.ground import ground_of
from scenewright.tools.relation_checker.motion import Mover, RoadUser, as_movers, extended
from scenewright.tools.relation_checker.paths import SHARED, Stay, Zone, conflict_zones, zone_stay
from scenewright.tools.relation_checker.planar import geos
from scenewright.tools.relation_checker.signals import Lights
from scenewright.tools.relation_checker.surrogates import drac, path_ttc, ttc_2d
from scenewright.tools.relation_checker.yielding import (
    LIMITS,
    MAX_PET,
    RESUME_WITHIN,
    Giving,
    Passage,
    Surroundings,
    find_yield,
    held_throughout,
    leads,
)

NEAR_MISS_PET = 1.5
NEAR_MISS_TTC = 1.5
NEAR_MISS_BRAKING = 3.4
YIELD_CLEARANCE = 0.3
YIELD_PET = 0.5
YIELD_BRAKING = 5.0
CUT = 0.2 + 1e-6
"""A track that ends this shortly before the scene, or after a contact [s], was ended by it."""
ONWARDS = {"vehicle": 15.0, "pedestrian": 5.0}
"""How far who still waits at the end is taken to go straight on, if nothing was asked for [m]."""

Pair = tuple[int, int]


@dataclass(frozen=True, eq=False)
class Observation:
    """Everything measured in one set of tracks.

    Attributes:
        crowd: all movers on one grid; near: their gaps and contacts; meetings: encounters with
            their PET; lanes: who is behind whom; lights: who meets which light.
        events: in order of time.
    """

    crowd: Crowd
    near: Closeness
    meetings: tuple[Encounter, ...]
    lanes: tuple[LaneGaps, ...]
    lights: Lights
    events: tuple[Event, ...]

    @property
    def movers(self) -> tuple[Mover, ...]:
        """All movers, in the order given."""
        return self.crowd.movers

    def pet(self, pair: Pair) -> float | None:
        """Least PET of a pair of ids [s]; None above 8.5 s or without conflict."""
        ids = [m.id for m in self.movers]
        found = [e.pet for e in self.meetings if {ids[e.first], ids[e.second]} == set(pair)]
        return min(found, default=None)


def find_events(
    users: Sequence[RoadUser],
    *,
    ground: IntersectionMap | None = None,
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
    return observe(users, ground=ground, signals=signals, until=until).events


def observe(
    users: Sequence[RoadUser],
    *,
    ground: IntersectionMap | None = None,
    signals: Sequence[SignalRecord] = (),
    asked: Collection[Pair] = (),
    detailed: Collection[int] | None = None,
    until: float | None = None,
) -> Observation:
    """Measures all pairs and finds all events.

    Args:
        asked: pairs of ids bound by a relation, `from` first; the path of a giver that still waits
            when the scene ends is followed on further for them.
        detailed: ids whose events carry TTC and DRAC as evidence; None means all.
        until: end of the scene [s], which may cut a wait short; None means the last sample.
    """
    crowd = gather(as_movers(list(users)))
    near = closeness(crowd)
    meetings = encounters(crowd.movers)
    lanes = lane_gaps(crowd)
    lights = Lights(signals, ground)
    lights.meet(crowd.movers)
    until = float(crowd.times[-1]) if until is None and len(crowd.times) else until or 0.0
    search = _Search(crowd, near, meetings, ground, lights, frozenset(asked), until)
    wanted = {m.id for m in crowd.movers} if detailed is None else set(detailed)
    events = [*search.events(wanted), *_follow_events(crowd.movers, lanes)]
    events.sort(key=lambda e: (e.time, e.from_, e.to))
    return Observation(crowd, near, meetings, lanes, lights, tuple(events))


def _follow_events(movers: tuple[Mover, ...], lanes: tuple[LaneGaps, ...]) -> list[Event]:
    return [
        _event(
            "follow", (movers[f.follower], movers[f.leader]), time=f.start,
            place=tuple(movers[f.follower].xy[movers[f.follower].index(f.start)]),
            evidence={"until": f.end, "least_gap": f.least_gap, "least_headway": f.least_headway},
        )
        for f in followings(lanes)
    ]  # fmt: skip


def _event(
    name: str,
    pair: tuple[Mover, Mover],
    *,
    time: float,
    place: tuple[float, ...],
    evidence: dict[str, Any],
    **more: Any,
) -> Event:
    rounded = {k: round(v, 3) if isinstance(v, float) else v for k, v in evidence.items()}
    return Event.model_validate({
        "type": name, "from": pair[0].id, "to": pair[1].id, "time": round(time, 3),
        "location": (round(float(place[0]), 3), round(float(place[1]), 3)),
        "evidence": {k: v for k, v in rounded.items() if v is not None}, **more,
    })  # fmt: skip


@dataclass(frozen=True, eq=False)
class _Search:
    """Looks for events pair by pair, with precedence."""

    crowd: Crowd
    near: Closeness
    meetings: tuple[Encounter, ...]
    ground: IntersectionMap | None
    lights: Lights
    asked: frozenset[Pair]
    until: float

    @cached_property
    def by_pair(self) -> dict[Pair, list[Encounter]]:
        """Encounters by the indices of their movers."""
        table: dict[Pair, list[Encounter]] = {}
        for meeting in self.meetings:
            table.setdefault((meeting.first, meeting.second), []).append(meeting)
        return table

    def events(self, detailed: set[int]) -> list[Event]:
        """Collisions, yields and near misses."""
        found: list[Event] = []
        braked = self._braked_pairs()
        for row, (i, j) in enumerate(self.crowd.pairs.tolist()):
            pair = self.crowd.movers[i], self.crowd.movers[j]
            if row in self.near.contacts:
                found += self._collision(row, *pair)
            elif pair[0].is_vehicle or pair[1].is_vehicle:
                full = pair[0].id in detailed or pair[1].id in detailed
                found += self._passing(row, (i, j), braked.get(row, ()), full)
        return found

    def _collision(self, row: int, first: Mover, second: Mover) -> list[Event]:
        contact = self.near.contacts[row]
        if contact.initial:
            return []
        hit = impact(first, second, time=contact.time)
        left_hand = self.ground is not None and self.ground.left_hand_traffic
        if hit.relative_speed < IMPACT_SPEED:
            return []
        k = striking(first, second, hit)
        order = (first, second) if k == 0 else (second, first)
        cause = cause_of(first, second, time=contact.time, lights=self.lights)
        evidence = {
            "relative_speed": hit.relative_speed, "speed_from": hit.speeds[k],
            "speed_to": hit.speeds[1 - k], "angle": hit.angle,
            "side_from": hit.sides[k], "side_to": hit.sides[1 - k],
            "point_from": hit.points[k], "point_to": hit.points[1 - k],
            "cause_agent": cause[1] if cause else None,
            "late_brake": late_braker(first, second, time=contact.time),
        }  # fmt: skip
        return [
            _event(
                "collision", order, time=contact.time, place=hit.place, evidence=evidence,
                kind=kind_of(first, second, hit, time=contact.time, left_hand=left_hand),
                cause=cause[0] if cause else None,
            )
        ]  # fmt: skip

    def _passing(self, row: int, pair: Pair, braked: Sequence[float], full: bool) -> list[Event]:
        """Yields and near misses of a pair that never touches, one per encounter."""
        found: list[Event] = []
        covered: list[tuple[float, float]] = []
        for meeting in self.by_pair.get(pair, ()):
            giving = self._giving(row, meeting)
            if giving is not None:
                covered.append((giving.begin, giving.cleared))
            event = self._classified(pair, meeting, giving, full)
            found += [event] if event is not None else []
        if not found:
            found += self._unfinished(row, pair, full)
        close_calls = [t for t in braked if not any(a <= t <= b for a, b in covered)]
        if close_calls and not any(e.type == "near_miss" for e in found):
            found += self._near_miss(pair, None, full, around=close_calls)
        return found

    def _classified(
        self, pair: Pair, meeting: Encounter, giving: Giving | None, full: bool
    ) -> Event | None:
        harsh = giving is not None and (meeting.pet < YIELD_PET or giving.braking > YIELD_BRAKING)
        if giving is not None and not harsh:
            return self._yield_event(meeting, giving, full)
        if harsh or meeting.pet <= NEAR_MISS_PET:
            moments = [meeting.first_time, meeting.second_time]
            return next(iter(self._near_miss(pair, meeting.pet, full, around=moments)), None)
        return None

    def _giving(self, row: int, meeting: Encounter) -> Giving | None:
        if meeting.pet > MAX_PET or float(self.near.gaps[row].min()) < YIELD_CLEARANCE:
            return None
        later = meeting.second_time > meeting.first_time
        i, j = (meeting.second, meeting.first) if later else (meeting.first, meeting.second)
        giver, other = self.crowd.movers[i], self.crowd.movers[j]
        if not _slows(giver, until=max(meeting.first_time, meeting.second_time)):
            return None
        zone = _nearest_zone(giver, other, meeting, later)
        return None if zone is None else self._yields_at(zone, giver, other)

    def _yields_at(
        self, zone: Zone, giver: Mover, other: Mover, real_end: float | None = None
    ) -> Giving | None:
        stay, passing = zone_stay(giver, zone.polygon), zone_stay(other, zone.polygon)
        if stay is None or passing is None:
            return None
        around = self._surroundings(zone, giver, other, stay)
        return find_yield(Passage(giver, stay, passing, around, real_end))

    def _surroundings(self, zone: Zone, giver: Mover, other: Mover, stay: Stay) -> Surroundings:
        brink = float(np.interp(stay.enter, giver.times, giver.s)) + giver.nose
        others = [m for m in self.crowd.movers if m.id not in (giver.id, other.id)]
        real = next(m for m in self.crowd.movers if m.id == giver.id)

        def leader(time: float) -> bool:
            return any(leads(real, m, time=time, before=brink) for m in others)

        def on_crosswalk(time: float) -> bool:
            if self.ground is None or other.is_vehicle:
                return False
            xy, _ = other.at(np.array([time]))
            walks = (each.area for each in ground_of(self.ground).crosswalks)
            return other.start <= time <= other.end and any(
                w.intersects(zone.polygon) and w.intersects(geos.Point(xy[0])) for w in walks
            )

        return Surroundings(
            red=partial(self._red, real),
            leader=leader,
            excused=lambda t: self._excused(real, other, t),
            on_crosswalk=on_crosswalk,
        )

    def _red(self, giver: Mover, since: float, until: float) -> bool:
        """Whether a light that is not green holds the giver at some time of a span [s]."""
        return self.lights.held(giver, since=since, until=until)

    def _excused(self, giver: Mover, other: Mover, time: float) -> bool:
        """Whether the giver waits for yet another agent that a relation binds it to."""
        partners = {a if b == giver.id else b for a, b in self.asked if giver.id in (a, b)}
        for meeting in self.meetings:
            ends = [
                (self.crowd.movers[meeting.first].id, meeting.first_time),
                (self.crowd.movers[meeting.second].id, meeting.second_time),
            ]
            mine = [t for n, t in ends if n == giver.id]
            theirs = [t for n, t in ends if n in partners - {other.id}]
            if mine and theirs and theirs[0] < mine[0] and theirs[0] >= time - 4.0:
                return True
        return False

    @cached_property
    def _cut_off(self) -> list[bool]:
        """Of every mover, whether it slowed and the scene's end or a collision ends its track."""
        ended = [m.end >= self.until - CUT for m in self.movers]
        for row, contact in self.near.contacts.items():
            for k in self.crowd.pairs[row].tolist():
                ended[k] |= contact.time >= self.movers[k].end - CUT
        return [end and _slows(m, until=m.end) for end, m in zip(ended, self.movers, strict=True)]

    @cached_property
    def _crossed(self) -> BoolArray:
        """[N, N] whether the second crosses the way ahead of the first, which was cut off."""
        return _ahead(self.crowd, [k for k, cut in enumerate(self._cut_off) if cut])

    def _unfinished(self, row: int, pair: Pair, full: bool) -> list[Event]:
        """A yield whose giver still waits when the scene, or a collision, ends its track."""
        found: list[Event] = []
        for i, j in (pair, pair[::-1]):
            giver, other = self.crowd.movers[i], self.crowd.movers[j]
            asked = (giver.id, other.id) in self.asked
            onwards = 25.0 if asked else ONWARDS[giver.type]
            if not self._cut_off[i] or not (asked or self._crossed[i, j]):
                continue
            if float(self.near.gaps[row].min()) < YIELD_CLEARANCE:
                continue
            further = extended(giver, distance=onwards, speed=2.0 if giver.is_vehicle else 1.0)
            if held_throughout(further, giver.end, partial(self._red, giver)):
                continue
            for zone in conflict_zones(further, other):
                giving = self._yields_at(zone, further, other, real_end=giver.end)
                if giving is not None and giving.braking <= YIELD_BRAKING:
                    found.append(self._yield_event(None, giving, full, movers=(giver, other)))
                    break
        return found[:1]

    def _yield_event(
        self,
        meeting: Encounter | None,
        giving: Giving,
        full: bool,
        movers: tuple[Mover, Mover] | None = None,
    ) -> Event:
        if movers is None and meeting is not None:
            both = self.crowd.movers[meeting.first], self.crowd.movers[meeting.second]
            movers = both if meeting.first_time > meeting.second_time else (both[1], both[0])
        if movers is None:
            raise ValueError("a yield needs an encounter or its movers")
        evidence = {
            "pet": meeting.pet if meeting else None, "approach_speed": giving.approach,
            "lowest_speed": giving.lowest, "begins_to_slow": giving.begin,
            "braking": giving.braking, "other_cleared": giving.cleared, "entered": giving.enter,
            "would_have_entered": giving.arrival,
        } | (_measures(*movers, until=giving.cleared) if full else {})  # fmt: skip
        cause = red_run(movers[1], movers[0], time=giving.cleared, lights=self.lights)
        if cause is not None:
            evidence["cause_agent"] = cause[1]
        return _event(
            "yielding", movers, time=giving.time, place=giving.place, evidence=evidence,
            cause=cause[0] if cause else None,
        )  # fmt: skip

    def _near_miss(
        self, pair: Pair, pet: float | None, full: bool, *, around: Sequence[float]
    ) -> list[Event]:
        first, second = (self.crowd.movers[k] for k in pair)
        closest = _closest(first, second, min(around), max(around))
        if closest is None:
            return []
        time, clearance = closest
        cause = cause_of(first, second, time=time, lights=self.lights)
        evidence = {
            "pet": pet, "clearance": clearance, "cause_agent": cause[1] if cause else None,
            "late_brake": late_braker(first, second, time=time),
        } | (_measures(first, second, until=max(*around, time)) if full else {})  # fmt: skip
        place = meeting_point(first, second, time=time)
        return [
            _event(
                "near_miss", (first, second), time=time, place=place, evidence=evidence,
                cause=cause[0] if cause else None,
            )
        ]  # fmt: skip

    def _braked_pairs(self) -> dict[int, list[float]]:
        """By row of pairs: times of path TTC <= 1.5 s while one of the two brakes hard."""
        found: dict[int, list[float]] = {}
        hard = [m.is_vehicle and (m.acceleration < -NEAR_MISS_BRAKING).any() for m in self.movers]
        for row, (i, j) in enumerate(self.crowd.pairs.tolist()):
            if not (hard[i] or hard[j]) or row in self.near.contacts:
                continue
            times = self._hard_times(row, self.movers[i], self.movers[j])
            if len(times):
                ttc = path_ttc(self.movers[i], self.movers[j], times=times, horizon=NEAR_MISS_TTC)
                close = times[ttc <= NEAR_MISS_TTC]
                if len(close):
                    found[row] = close.tolist()
        return found

    @property
    def movers(self) -> tuple[Mover, ...]:
        return self.crowd.movers

    def _hard_times(
        self, row: int, first: Mover, second: Mover
    ) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
        times = common_times(first, second)
        i, j = first.indices(times), second.indices(times)
        hard = np.minimum(first.acceleration[i], second.acceleration[j]) < -NEAR_MISS_BRAKING
        k = np.round((times - self.crowd.times[0]) / 0.1).astype(np.intp)
        reach = (first.speed[i] + second.speed[j]) * NEAR_MISS_TTC + 1.0
        return np.asarray(times[hard & (self.near.gaps[row, k] <= reach)])


def _slows(giver: Mover, *, until: float) -> bool:
    """Cheap: whether it was moving and then fell to 0.6 of an earlier speed or less."""
    speed = giver.speed[: giver.index(until) + 1]
    peak = np.maximum.accumulate(speed)
    return bool(((peak >= LIMITS[giver.type].moving) & (speed <= 0.6 * peak)).any())


def _ahead(crowd: Crowd, givers: Sequence[int]) -> BoolArray:
    """[N, N] whether the second crosses the way straight ahead of a giver's last place.

    Cheap and necessary for a yield. And late enough: who stands at its end has not done so for more
    than 4 s since.
    """
    ahead = np.zeros((len(crowd.movers),) * 2, dtype=np.bool_)
    if not givers:
        return ahead
    movers = [crowd.movers[k] for k in givers]
    still = [RESUME_WITHIN + 1.0 if m.speed[-1] <= LIMITS[m.type].resumed else MAX_PET
             for m in movers]  # fmt: skip
    since = np.array([m.end for m in movers]) - still
    late = slice(int(np.searchsorted(crowd.times, since.min() - 1e-6)), None)
    x, y, facing, way = np.array(
        [(*m.xy[-1].tolist(), float(m.heading[-1]), ONWARDS[m.type]) for m in movers]
    ).T[..., None, None]
    east, north = crowd.xy[:, late, 0] - x, crowd.xy[:, late, 1] - y
    cos, sin, turn = np.cos(facing), np.sin(facing), crowd.heading[:, late] - facing
    alike = np.array([m.is_vehicle for m in crowd.movers])
    half = np.array([(m.half_width + m.radius, m.half_length) for m in crowd.movers])
    room = half[:, :1] + half[givers, :1, None] + half[:, 1:] * np.abs(np.sin(turn))
    along = cos * east + sin * north
    inside = (along >= 0) & (along <= way) & (np.abs(cos * north - sin * east) <= room)
    inside &= (np.cos(turn) < np.cos(SHARED)) | (alike[givers, None] != alike)[..., None]
    inside &= crowd.present[:, late] & (crowd.times[late] >= since[:, None, None])
    ahead[givers] = inside.any(axis=2)
    return ahead


def _nearest_zone(giver: Mover, other: Mover, meeting: Encounter, later: bool) -> Zone | None:
    time = meeting.second_time if later else meeting.first_time
    xy, _ = giver.at(np.array([time]))
    point = geos.Point(xy[0])
    zones = conflict_zones(giver, other)
    return min(zones, key=lambda z: float(z.polygon.distance(point)), default=None)


def _closest(first: Mover, second: Mover, begin: float, end: float) -> tuple[float, float] | None:
    """Time and clearance of the closest approach around an encounter, else of all."""
    around = least_clearance(first, second, within=(begin - 3.0, end + 3.0))
    return around or least_clearance(first, second)


def _measures(first: Mover, second: Mover, *, until: float) -> dict[str, float | None]:
    """Least path TTC and 2-D TTC, largest DRAC, in the 6 s before a time."""
    times = common_times(first, second)
    times = times[(times >= until - 6.0) & (times <= until + 1e-6)]
    if len(times) == 0:
        return {}
    along = float(path_ttc(first, second, times=times).min())
    ttc = ttc_2d(first, second, times=times)
    straight = float(ttc.min())
    return {
        "path_ttc": along if np.isfinite(along) else None,
        "ttc_2d": straight if np.isfinite(straight) else None,
        "drac": float(drac(first, second, times=times, ttc=ttc).max()),
    }
