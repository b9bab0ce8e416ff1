"""`gives_way`: one is held upstream of the conflict zone until the other has left it.

The offset is such that, unheld, it would have been there while the other was (SEMANTICS 4, cause).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from scenewright.scene.base import FloatArray
from scenewright.scene.candidates import TimeLaw
from scenewright.scene.constraints import GivesWay, PairClause, TimeGap
from scenewright.scene.selection import Stop
from scenewright.scene.track import STEP
from scenewright.tools.dsl_validator.actor import Actor
from scenewright.tools.dsl_validator.impact import least_clearance
from scenewright.tools.dsl_validator.setting import Setting
from scenewright.tools.dsl_validator.shortfall import Reached
from scenewright.tools.dsl_validator.staging import Happening, Staging, point_of
from scenewright.tools.encounter import Encounter, gap_to, meeting_offsets
from scenewright.tools.landmarks import STOP_GAP
from scenewright.tools.time_law import Hold, Motion, arrival, move

MERGE_METRES = 5.0
"""How much of a shared lane belongs to the conflict zone (SEMANTICS 4)."""

_STANDS = 1.6
"""Least standstill of who gives way [s], start and end smoothed away included."""

_CAUSE = 1.2
"""How far [s] from the other's time in the zone it would have been there unheld (2 s)."""

_FREE = {"acceleration": 2.0, "braking": 2.0, "lateral": 3.0}
"""Free speed as SEMANTICS section 4 defines it."""

_ROADSIDE = 2.4
"""How far onto the road a pedestrian may wait: the parking lane's width [m]."""

_UPSTREAM = {"vehicle": 18.0, "pedestrian": 4.3}
"""Farthest before the zone that giving way counts (SEMANTICS 4: 20 m and 5 m, less a margin)."""

_CLEARANCE, _PETS = 0.4, (0.6, 7.0)
"""What a yield keeps: least clearance [m], range of its PET [s]."""


def yields(clause: GivesWay, staging: Staging, setting: Setting) -> Iterator[Staging]:
    """Every staging (lazily) in which the first gives way to the second."""
    a, b = setting.both(clause, staging)
    if a.contact is not None or b.contact is not None:
        words = f"one of {clause.first} and {clause.second} has been in a collision before"
        setting.missed(clause, Reached.PATHS, words)
        return
    zone = zone_of(clause, a, b, setting)
    if not len(zone.i):
        words = f"the paths of {clause.first} and {clause.second} never touch"
        setting.missed(clause, Reached.PATHS, words)
        return
    words = f"{clause.first} has no place to wait near where {clause.second} passes"
    setting.missed(clause, Reached.PATHS, words)
    for anchor, hold in _stopping_places(a, b, zone, setting):
        yield from _held(clause, staging, setting, zone, (anchor, hold))


def zone_of(clause: PairClause, a: Actor, b: Actor, setting: Setting) -> Encounter:
    """The nodes of the pair's conflict zone."""
    zone = setting.encounter(clause).within(0.0)
    return zone.first_metres(MERGE_METRES) if _merging(a, b) else zone


def _held(
    clause: GivesWay,
    staging: Staging,
    setting: Setting,
    zone: Encounter,
    place: tuple[str, Hold],
) -> Iterator[Staging]:
    a, b = setting.both(clause, staging)
    anchor, hold = place
    others = tuple(stop for stop in a.stops if abs(stop.s - hold.s) > 0.5)
    stands = arrival(a.candidate, hold, _holds(others, a.enters))
    b_in, b_out = passage(b.motion, zone.s_b[zone.j])
    a_in, a_out = _unheld(a, hold, stands, zone.s_a[zone.i])
    react = float(setting.rng.uniform(0.3, 0.8))
    wanted = setting.pet_of(clause)
    if wanted is not None:
        react = (wanted.low + wanted.high) / 2 - _rolls(a, hold, stands, zone)
    low = max(stands + _STANDS - react, a_in - _CAUSE) - b_out
    high = min(stands + 5.0 - b_out - react, a_out + _CAUSE - b_in)
    if not np.isfinite(low + high) or low > high:
        words = f"{clause.first}, unheld, would not have met {clause.second}, so it has no reason"
        setting.missed(clause, Reached.ROLES, words)
        if wanted is not None and np.isfinite(low + high):
            longer = low - high if stands + _STANDS - react >= a_in - _CAUSE else high - low
            _pet_is((wanted.low + wanted.high) / 2 + longer, clause, wanted, setting)
        return
    for delta in setting.rng.uniform(low, high, 3):
        placed_a, placed_b = staging.placed(clause, a, b, float(delta))
        start = placed_a.enters + stands
        ahead = float(zone.s_a[zone.i].min()) - hold.s
        stop = Stop(anchor, hold.s, start, 0.0, "gives_way", hold.braking, ahead)
        release = placed_b.enters + b_out + react
        held = _released(clause, placed_a, placed_b, replace(stop, until=release), zone, setting)
        if held is None:
            continue
        enters = placed_a.enters + held.motion.time_at(float(zone.s_a[zone.i].min()))
        passed = placed_b.enters + b_out
        spot = point_of(held, start)
        happening = Happening(clause, start, start - 5.0, enters, passed, spot)
        yield staging.with_event(happening, held, placed_b)


def _rolls(a: Actor, hold: Hold, stands: float, zone: Encounter) -> float:
    """How long it takes from its release to the zone [s]."""
    release = stands + _STANDS
    motion = move(a.candidate, holds=(replace(hold, release=release),))
    return motion.time_at(float(zone.s_a[zone.i].min())) - release


def _released(
    clause: GivesWay, a: Actor, b: Actor, stop: Stop, zone: Encounter, setting: Setting
) -> Actor | None:
    """Who gives way, held until then, or until the PET asked for; None if that is no yield."""
    held = a.edited(stops=_joined(a.stops, stop))
    wanted = setting.pet_of(clause)
    if wanted is None:
        return held if _passes_well(clause, held, b, zone, setting) else None
    middle = (wanted.low + wanted.high) / 2
    later = middle - _pet(held, b, zone)
    earliest = stop.start + _STANDS
    until = max(stop.until + later, earliest) if np.isfinite(later) else stop.until
    held = a.edited(stops=_joined(a.stops, replace(stop, until=until)))
    return held if _passes_well(clause, held, b, zone, setting) else None


def _stopping_places(
    a: Actor, b: Actor, zone: Encounter, setting: Setting
) -> Iterator[tuple[str, Hold]]:
    """Where to wait: at the stop line or kerb if near enough, else short of the zone."""
    kind = a.candidate.route.type
    first = float(zone.s_a[zone.i].min())
    line = a.marks.line
    turning = a.candidate.route.movement in ("left", "right", "uturn")
    room = (0.9, 2.0) if kind == "vehicle" else (0.6, 1.1)
    short = first - float(setting.rng.uniform(*room))
    places: list[tuple[str, float]] = []
    waits = [s for s in a.stops if s.reason == "gives_way"]
    for stop in waits:
        if 0.3 <= first - stop.s < _UPSTREAM[kind]:
            yield stop.anchor, Hold(stop.s, 0.0, stop.braking)
    if waits:
        return
    if line is not None and line - STOP_GAP <= short and first - line < _UPSTREAM[kind]:
        anchor = "stop_line" if kind == "vehicle" else "kerb"
        places = [(anchor, line - min(STOP_GAP, 0.3 if kind == "pedestrian" else STOP_GAP))]
    free = kind == "vehicle" or setting.lenient or line is None or short < line + _ROADSIDE
    if free and (line is None or short > line + 1.0):
        at_zone = ("yield_point", short)
        places = [at_zone, *places] if turning else [*places, at_zone]
    if kind == "vehicle":
        places = _off_crosswalks(places, a, b, first)
    for anchor, s in places:
        for braking in (None, 3.2):
            if s > 2.0:
                yield anchor, Hold(s, 0.0, braking)


def _off_crosswalks(
    places: list[tuple[str, float]], a: Actor, b: Actor, first: float
) -> list[tuple[str, float]]:
    """The same, but before any crosswalk that the other does not walk on.

    Args:
        first: where the zone begins [m].
    """
    found: list[tuple[str, float]] = []
    for anchor, wished in places:
        s = a.marks.off_crosswalks(wished, own=b.marks.own_crosswalk)
        near = any(abs(s - other) < 1.0 for _, other in found)
        if first - s < _UPSTREAM["vehicle"] and not near:
            found.append((anchor, s))
    return found


def _passes_well(
    clause: GivesWay, held: Actor, other: Actor, zone: Encounter, setting: Setting
) -> bool:
    """The yield as edited: clear of the other by 0.4 m, PET between 0.6 and 7 s, or as asked."""
    wanted = setting.pet_of(clause)
    low, high = _PETS if wanted is None else (wanted.low, wanted.high)
    clearance, _, _ = least_clearance(held, other)
    pet = _pet(held, other, zone)
    if clearance >= _CLEARANCE and low - 0.02 <= pet <= high + 0.02:
        return True
    if clearance < _CLEARANCE:
        words = f"{clause.first} keeps only {max(clearance, 0.0):.1f} m clear of {clause.second}"
        setting.missed(clause, Reached.PLACE, words)
        return False
    if wanted is not None:
        _pet_is(pet, clause, wanted, setting)
    else:
        words = f"a PET of {low:g} to {high:g} s after the yield: it is {pet:.1f} s"
        setting.missed(clause, Reached.MEASURE, words, off=max(low - pet, pet - high))
    return False


def _pet_is(pet: float, clause: GivesWay, wanted: TimeGap, setting: Setting) -> None:
    """Tells that only this PET [s] was possible."""
    asked, extreme = (wanted.low + wanted.high) / 2, "shortest" if pet > wanted.high else "longest"
    words = f"a PET of {asked:g} s after the yield: the {extreme} possible is {pet:.1f} s"
    setting.missed(clause, Reached.MEASURE, words, off=max(wanted.low - pet, pet - wanted.high))


def _pet(held: Actor, other: Actor, zone: Encounter) -> float:
    meetings = meeting_offsets(zone, held.motion, other.motion, c=0.0, exact=True)
    return gap_to(meetings, other.enters - held.enters)


def _joined(stops: tuple[Stop, ...], stop: Stop) -> tuple[Stop, ...]:
    """One standstill at one place, as long as the longer of the two needs."""
    same = [each for each in stops if abs(each.s - stop.s) <= 0.5]
    rest = tuple(each for each in stops if each not in same)
    if not same:
        return tuple(sorted((*rest, stop), key=lambda each: each.s))
    until = max(stop.until, *(each.until for each in same))
    return tuple(sorted((*rest, replace(same[0], until=until)), key=lambda each: each.s))


def _holds(stops: tuple[Stop, ...], enters: float) -> tuple[Hold, ...]:
    return tuple(Hold(stop.s, stop.until - enters, stop.braking) for stop in stops)


def passage(motion: Motion, nodes: FloatArray) -> tuple[float, float]:
    """Local times [s] of reaching the first and leaving the last of the nodes."""
    return motion.time_at(float(nodes.min())), motion.time_at(float(nodes.max()))


def _unheld(a: Actor, hold: Hold, stands: float, nodes: FloatArray) -> tuple[float, float]:
    """Local times [s] of reaching and leaving the zone, free from where it began to slow.

    It began at the last moment at which it still drove its approach speed (less 0.3 m/s).
    """
    motion = move(a.candidate, holds=(replace(hold, release=stands + 9.0),))
    until = int(stands / STEP)
    speed, s = motion.speed[: until + 1], motion.s[: until + 1]
    reach = 40.0 if a.candidate.route.type == "vehicle" else 5.0
    approach = float(speed[s >= hold.s - 1.5 * reach].max())
    begin = int(np.nonzero(speed >= approach - min(0.3, 0.3 * approach))[0][-1])
    law = TimeLaw(speed=approach, **_FREE)
    free = move(replace(a.candidate, time_law=law))
    shift = STEP * begin - free.time_at(float(s[begin]))
    first, last = passage(free, nodes)
    return first + shift, last + shift


def _merging(a: Actor, b: Actor) -> bool:
    """Whether the two go on in one lane after the zone."""
    if "pedestrian" in (a.candidate.route.type, b.candidate.route.type):
        return False
    return a.candidate.route.exit == b.candidate.route.exit
