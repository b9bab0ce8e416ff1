"""Car-following of a background vehicle among the agents scheduled before it.

It enters at its drawn time, or when there is room, follows the vehicle ahead in its lane, stops
at red and behind queues, and when turning gives way to pedestrians and others; it neither crosses
the path of a foreground agent near it in time nor gives way to it. Each agent that it meets blocks
nodes of its path for a time; the blocks that it would run into become walls, behind which it drives
by the intelligent driver model (Treiber, Hennecke, Helbing 2000); behind one that draws away in the
form of Schakel, van Arem and Netten (2010), so that queues discharge. The motion becomes a pace
and stops.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from scenewright.compiled import compiled
from scenewright.geometry.driving_profile import (
    StopCommand,
    compute_arrival,
    compute_squared_speed_limit,
)
from scenewright.scene.base import FloatArray
from scenewright.scene.candidates import PACE_STEP, DrivingProfile
from scenewright.scene.selection import Stop
from scenewright.scene.track import STEP
from scenewright.tools.map_grounding.signal_plan import get_phases, is_showing_at
from scenewright.tools.segment_editor import make_stop_command
from scenewright.tools.solver.entry_times import START_LAG, SceneTiming
from scenewright.tools.solver.path_conflict import IntArray
from scenewright.tools.solver.reservation import IN_LANE, Bars, ReservationTable, get_corridor
from scenewright.tools.solver.scheduled_agent import ScheduledAgent

_HEADWAY, _HEADWAY_SPREAD = 1.1, 0.25
"""From the rear ahead to its own front [s]: median and spread of the logarithm. At 9 m/s that is
about 2 s from front to front with the gap at standstill, as queues discharge."""
_GAP = (0.9, 1.8)
_FURTHER = 0.4
"""At standstill, on top of the clearance of 0.8 m [m]; behind others, than before a line [m]."""
_LINE = (0.4, 1.6)
"""From the front of the first in the queue to the line [m]."""
_ROUNDS = 12
_HARDEST = 3.2
"""A vehicle that would brake harder [m/s^2] than this for others enters at another time: from 3.4
on, close behind another, it would count as a near miss."""
_HARDEST_AT_LINE = 3.6
"""The same before a line [m/s^2]."""
_HARDEST_DRIVEN = 3.35
"""Hardest braking of the resulting pace [m/s^2]: a pace overstates it a little."""
_FORESEES = 1.5
"""How far ahead drivers anticipate the motion of others, by brake lights and traffic ahead [s]."""
_EAGER = 2.5
"""How much harder than comfortably a vehicle behind another would accelerate, had it all the room:
so it sets off as fast as the one ahead before the gap has grown."""
_ENTRANCE = 5.0
"""Within this distance of its entry [m] a vehicle needs a free path."""
_AFTER = 4.0
"""How long beyond the scene's end the motion is computed [s]."""
_STANDS, _SHORTEST = 0.3, 0.8
"""Slower than this [m/s] for at least that long [s] is a standstill."""
_CREEPS = 1.0
"""A vehicle that moves less [m] between two standstills has one standstill."""
_LEAST = 0.7
"""Least speed of a pace [m/s]: standstills are edits of their own."""

_Greens = tuple[FloatArray, NDArray[np.bool_], float, float]
"""What `_list_greens` gives."""


def follow_traffic(
    actor: ScheduledAgent,
    enters: float,
    present: ReservationTable,
    moment: SceneTiming,
    rng: np.random.Generator,
) -> ScheduledAgent | None:
    """Compute the vehicle's motion among those present if it enters at scene time `enters` [s].

    Returns:
        Its motion, entering at local time 0; None where it cannot be driven.
    """
    candidate, law = actor.candidate, actor.candidate.time_law
    corridor = get_corridor(candidate)
    line = np.inf if actor.landmarks.line is None else actor.landmarks.line
    moved = _drive_among(
        corridor.s, present.list_bars(corridor, in_lane=IN_LANE), enters,
        moment.duration + _AFTER - enters,
        candidate.path.s, np.sqrt(compute_squared_speed_limit(candidate)),
        law.acceleration, law.braking,
        min(_HEADWAY * math.exp(_HEADWAY_SPREAD * rng.standard_normal()), 2.6),
        rng.uniform(*_GAP), line, line - rng.uniform(*_LINE), rng.uniform(*START_LAG),
        _list_greens(actor, moment), candidate.route.movement != "straight",
    )  # fmt: skip
    if not len(moved):
        return None
    driven = _convert_to_pace(actor, moved, moment.duration - enters)
    if _brakes_hard(driven, actor.candidate.time_law.braking) or not _passes_on_green(
        driven, enters, moment
    ):
        return None
    return driven


def find_entrance(actor: ScheduledAgent, wished: float, present: ReservationTable) -> float:
    """Find the first scene time [s] from `wished` on at which the agent has room to enter."""
    corridor = get_corridor(actor.candidate)
    bars = present.list_bars(corridor, in_lane=IN_LANE)
    speed = math.sqrt(compute_squared_speed_limit(actor.candidate)[0])
    return math.ceil(_find_entrance(corridor.s, bars, speed, wished) / STEP - 1e-6) * STEP


def _brakes_hard(driven: ScheduledAgent, usual: float) -> bool:
    """Return whether, by its pace, it brakes harder than allowed for others and for itself.

    Args:
        usual: its own comfortable braking [m/s^2]; measured over 0.3 s, as the checker does.
    """
    s = driven.motion.s
    if len(s) < 6:
        return False
    change = (s[5:] - s[3:-2]) - (s[2:-3] - s[:-5])
    most = max(_HARDEST_DRIVEN, 1.06 * usual)
    return bool(change.min() < -most * 2 * STEP * 3 * STEP)


def _list_greens(actor: ScheduledAgent, moment: SceneTiming) -> _Greens:
    """List when the phases of its light end [s], which are green, offset and cycle."""
    group, clock = actor.landmarks.group, moment.clock
    if actor.landmarks.line is None or group is None or clock is None:
        return np.empty(0), np.empty(0, dtype=np.bool_), 0.0, 1.0
    edges, green = get_phases(clock.program, group, ("green",))
    return edges, green, float(clock.offset), float(clock.program.cycle)


def _passes_on_green(driven: ScheduledAgent, enters: float, moment: SceneTiming) -> bool:
    """Return whether its light is green when it passes; a pace is exact to about 0.1 s."""
    line, group, clock = driven.landmarks.line, driven.landmarks.group, moment.clock
    crosses = np.inf if line is None else enters + driven.motion.find_time_at(line)
    if group is None or clock is None or math.isinf(crosses):
        return True
    return all(clock.get_colour(group, crosses + near) == "green" for near in (-0.15, 0.0, 0.15))


BESIDE, AHEAD, CROSSING, UNTOUCHABLE = range(4)
"""What blocks a node: the clearance to a follower of the same lane or to any agent; the vehicle
ahead in the lane; a crossing agent; a crossing foreground agent."""


def _convert_to_pace(actor: ScheduledAgent, moved: FloatArray, until: float) -> ScheduledAgent:
    """Convert the motion to a pace and stops of the agent."""
    candidate, law = actor.candidate, actor.candidate.time_law
    speed, pace, fastest, slowest = _compute_pace(
        moved, candidate.path.s, compute_squared_speed_limit(candidate)
    )
    stops = _list_stops(actor, moved, speed)
    own = DrivingProfile(
        law.speed,
        max(law.acceleration, fastest) * 1.05,
        max(law.braking, -slowest) * 1.05,
        law.lateral,
        tuple((pace / law.speed).round(4).tolist()),
    )
    driven = ScheduledAgent.build_unplaced(replace(candidate, time_law=own), actor.landmarks)
    # A vehicle behind must see how it continues after the scene.
    return driven.edit(stops=_time_stops(driven, stops)).cut_after(until + _AFTER)


def _time_stops(driven: ScheduledAgent, stops: tuple[Stop, ...]) -> tuple[Stop, ...]:
    """Time each stop from when a vehicle of that pace stands there."""
    timed: list[Stop] = []
    for stop in stops:
        held = tuple(make_stop_command(each, 0.0) for each in timed)
        start = compute_arrival(driven.candidate, StopCommand(stop.s, 0.0), held)
        timed.append(replace(stop, start=start, until=max(stop.until, start)))
    return tuple(timed)


def _list_stops(actor: ScheduledAgent, moved: FloatArray, speed: FloatArray) -> tuple[Stop, ...]:
    """List where and when [local s] this motion stands."""
    stands = np.concatenate(([False], speed < _STANDS, [False]))
    edges = np.flatnonzero(np.diff(stands))
    found: list[Stop] = []
    for first, last in zip(edges[::2].tolist(), (edges[1::2] - 1).tolist(), strict=True):
        if STEP * (last - first) < _SHORTEST:
            continue
        # A vehicle that still creeps stands where it first has all but stopped.
        s, line = float(moved[min(first + 4, last)]), actor.landmarks.line
        at_line = line is not None and 0.0 <= line - s < _LINE[1] + 0.5
        anchor = "stop_line" if at_line else "queue"
        until = STEP * last + (100.0 if last == len(moved) - 1 else 0.0)
        if found and s < found[-1].s + _CREEPS:
            found[-1] = replace(found[-1], until=until)
        else:
            found.append(Stop(anchor, s, STEP * first, until, "red_light"))
    return tuple(found)


# ---- as machine code ----------------------------------------------------------------------------


@compiled
def _drive_among(
    nodes: FloatArray,
    bars: Bars,
    enters: float,
    until: float,
    places: FloatArray,
    free: FloatArray,
    acceleration: float,
    braking: float,
    headway: float,
    gap: float,
    line: float,
    stop: float,
    lag: float,
    greens: _Greens,
    turns: bool,
) -> FloatArray:
    """Compute the arc length [T] every 0.1 s behind all it would run into; empty if impossible.

    Args:
        nodes: arc lengths [N]; bars: see `ReservationTable.list_bars`.
        enters: scene time of its entry [s]; until: how long the motion is computed [s].
        places, free: arc lengths [P] and free speed there.
        line, stop: arc length of its line, and where it stands at red [m].
    """
    rows, low, high, who, kind = bars
    low, high = low - enters, high - enters
    walls, release, steps = np.full(len(nodes), -np.inf), -np.inf, int(until / STEP)
    for _ in range(_ROUNDS):
        moved, hardest = _follow(
            nodes, walls, stop, release, places, free, acceleration, braking,
            max(headway - IN_LANE, 0.1), gap, steps,
        )  # fmt: skip
        if hardest > _HARDEST:
            break
        red = _find_red(moved, line, enters, lag, greens)
        if red > release:
            release = red
            continue
        met = _find_met(nodes, moved, rows, low, high, until)
        if met < 0:
            return moved
        if kind[met] != AHEAD and not (kind[met] == CROSSING and turns):
            break
        if not _raise_walls(walls, rows, high, who, kind, met):
            break
    return np.empty(0)


@compiled
def _compute_pace(
    moved: FloatArray, nodes: FloatArray, limit: FloatArray
) -> tuple[FloatArray, FloatArray, float, float]:
    """Compute speeds [T], the speed every `PACE_STEP` of its path, and the extreme rates."""
    last = len(moved) - 1
    speed, highest, lowest = np.empty(len(moved)), 0.0, 0.0
    for k in range(len(moved)):
        before, after = max(k - 1, 0), min(k + 1, last)
        speed[k] = (moved[after] - moved[before]) / (STEP * (after - before))
        if k > 0:
            rate = (speed[k] - speed[k - 1]) / STEP
            highest, lowest = max(highest, rate), min(lowest, rate)
    pace, cell, step = np.empty(int(np.ceil(nodes[-1] / PACE_STEP + 1.0))), 0, 0
    for n in range(len(pace)):
        at = n * PACE_STEP
        while cell < len(nodes) - 2 and nodes[cell + 1] <= at:
            cell += 1
        slope = (limit[cell + 1] - limit[cell]) / (nodes[cell + 1] - nodes[cell])
        free = np.sqrt(slope * (min(at, nodes[-1]) - nodes[cell]) + limit[cell])
        if at <= moved[-1]:
            while step < last - 1 and moved[step + 1] + 1e-6 * (step + 1) <= at:
                step += 1
            way = moved[step] + 1e-6 * step
            slope = (speed[step + 1] - speed[step]) / (moved[step + 1] + 1e-6 * (step + 1) - way)
            passed = slope * (at - way) + speed[step]
        else:
            passed = free
        pace[n] = min(max(passed, _LEAST), max(free, _LEAST))
    return speed, pace, highest, lowest


@compiled
def _find_entrance(nodes: FloatArray, bars: Bars, speed: float, wished: float) -> float:
    """Find the first time [s] from `wished` on at which the beginning of its path is free.

    Args:
        speed: at which it comes [m/s].
    """
    rows, low, high, _, _ = bars
    at, moved = wished, True
    while moved:
        moved = False
        for k in range(len(rows)):
            after = nodes[rows[k]] / max(speed, 1.0)
            if nodes[rows[k]] < _ENTRANCE and low[k] < at + after < high[k] - 1e-6:
                at, moved = high[k] - after, True
    return at


@compiled
def _find_red(moved: FloatArray, line: float, enters: float, lag: float, greens: _Greens) -> float:
    """Find the local time [s] until which its light holds this motion; -inf if not at all."""
    if len(greens[0]) == 0 or moved[-1] < line:
        return -np.inf
    crosses = enters + STEP * float(np.searchsorted(moved, line))
    before, after = _is_green(crosses - 0.35, greens), _is_green(crosses + 0.35, greens)
    if before and after and _is_green(crosses, greens):
        return -np.inf
    if not before and after:
        return crosses - enters + 0.5
    return _find_green(crosses, greens) + lag - enters


@compiled
def _is_green(time: float, greens: _Greens) -> bool:
    edges, green, offset, cycle = greens
    return is_showing_at(time + offset, edges, green, cycle)


@compiled
def _find_green(time: float, greens: _Greens) -> float:
    """Find the first scene time [s] from `time` on at which the light turns, or is, green."""
    edges, green, offset, cycle = greens
    if _is_green(time, greens):
        return time
    at = (time + offset) % cycle
    for lap in range(2):
        for k in range(len(edges)):
            begins = lap * cycle + (edges[k - 1] if k else 0.0)
            if begins >= at and green[k]:
                return time + begins - at
    return np.inf


@compiled
def _follow(
    nodes: FloatArray,
    walls: FloatArray,
    line: float,
    release: float,
    places: FloatArray,
    free: FloatArray,
    acceleration: float,
    braking: float,
    headway: float,
    gap: float,
    steps: int,
) -> tuple[FloatArray, float]:
    """Compute arc length [T] every 0.1 s behind walls, and the hardest braking [m/s^2].

    It ends where a vehicle would brake too hard.

    Args:
        nodes, walls: arc lengths [N] and until when each may not be reached [s].
        line, release: where it stands until then as well.
        places, free: arc lengths [P] and free speed there.
    """
    moved, s, v, hardest = np.empty(steps + 1), 0.0, free[0], 0.0
    cell = near = far = 0
    for k in range(steps + 1):
        moved[k] = s
        if s >= nodes[-1]:
            return moved[: k + 1], hardest
        t = STEP * k
        while near < len(nodes) and walls[near] <= t:
            near += 1
        while far < len(nodes) and walls[far] <= t + _FORESEES:
            far += 1
        at = _find_wall(nodes, walls, near, t)
        later = _find_wall(nodes, walls, far, t + _FORESEES)
        speed = v if later == np.inf else (later - at) / _FORESEES
        weight, apart = 1.0, gap + _FURTHER
        if t < release and line < at and s < line + gap:
            at, speed, weight = line + gap, 0.0, _HARDEST / _HARDEST_AT_LINE
            apart = gap
        while cell < len(places) - 2 and places[cell + 1] <= s:
            cell += 1
        share = (s - places[cell]) / (places[cell + 1] - places[cell])
        limit = max(free[cell] + (free[cell + 1] - free[cell]) * share, 0.5)
        if at < s - 0.3:
            return moved[: k + 1], np.inf
        rate = _accelerate(v, limit, at - s, speed, acceleration, braking, headway, apart)
        while k == 0 and rate < -0.8 * braking and v > speed + 0.3:
            v *= 0.95  # it anticipated the vehicle ahead before it entered
            rate = _accelerate(v, limit, at - s, speed, acceleration, braking, headway, apart)
        rate = max(rate, -9.0)
        after = min(max(v + rate * STEP, 0.0), max(limit, v - braking * STEP))
        if after < 0.02 and rate < 0.0:
            after = 0.0
        if at < np.inf:
            hardest = max(hardest, weight * (v - after) / STEP)
            if hardest > _HARDEST:
                return moved[: k + 1], hardest
        s += 0.5 * (v + after) * STEP
        v = after
    return moved, hardest


@compiled
def _find_wall(nodes: FloatArray, walls: FloatArray, n: int, t: float) -> float:
    """Find how far [m] it may have come at a time [s]; between nodes extrapolated.

    Args:
        n: the first node that may not be reached then; `len(nodes)` for none.
    """
    if n == len(nodes):
        return np.inf
    spacing = float(nodes[1] - nodes[0])
    at = float(nodes[n]) - spacing
    if n > 0 and walls[n - 1] > -np.inf and walls[n] - walls[n - 1] < 4.0:
        took = max(walls[n] - walls[n - 1], 0.02)
        at += spacing * min(max((t - walls[n - 1]) / took, 0.0), 1.0)
    return at


@compiled
def _accelerate(
    v: float,
    limit: float,
    room: float,
    speed: float,
    acceleration: float,
    braking: float,
    headway: float,
    gap: float,
) -> float:
    """Compute acceleration [m/s^2] at speed `v`, `room` [m] behind a wall that may move."""
    rate = float(acceleration * (1.0 - (v / limit) ** 4))
    if room == np.inf:
        return rate
    closing = v * (v - speed) / (2.0 * np.sqrt(acceleration * braking))
    wanted = gap + max(0.0, v * headway + closing)
    held = float(acceleration * (wanted / max(room, 0.05)) ** 2)
    # Behind one that draws away, the road and the vehicle ahead limit the acceleration apart.
    eager = min(rate, _EAGER * (acceleration - held))
    return rate - held + min(max(speed - v, 0.0), 1.0) * max(eager - rate + held, 0.0)


@compiled
def _raise_walls(
    walls: FloatArray, rows: IntArray, high: FloatArray, who: IntArray, kind: IntArray, met: int
) -> bool:
    """Wall off what the one met bars: all of its way in the lane, or the crossing from there on.

    Returns:
        Whether that changes anything.
    """
    raised, whole = False, kind[met] == AHEAD
    for change in (False, True):
        for b in range(len(rows)):
            if who[b] != who[met] or kind[b] != kind[met]:
                continue
            if not whole and rows[b] < rows[met]:
                continue
            if change:
                walls[rows[b]] = max(walls[rows[b]], high[b])
            elif high[b] > walls[rows[b]] + 1e-6:
                raised = True
    return raised


@compiled
def _find_met(
    nodes: FloatArray,
    moved: FloatArray,
    rows: NDArray[np.intp],
    low: FloatArray,
    high: FloatArray,
    until: float,
) -> int:
    """Find the index of the block that this motion meets first along its path; -1 if none."""
    reach = 0.5 * (nodes[1] - nodes[0])
    come, leave = np.full(len(nodes), np.inf), np.full(len(nodes), np.inf)
    k = 0
    for n in range(len(nodes)):
        while k < len(moved) and moved[k] < nodes[n] - reach:
            k += 1
        if k == len(moved):
            break
        come[n] = STEP * k
        j = k
        while j < len(moved) and moved[j] <= nodes[n] + reach:
            j += 1
        leave[n] = STEP * j
    met, first = -1, np.inf
    for b in range(len(rows)):
        n = rows[b]
        if come[n] < min(high[b] - 0.05, until) and leave[n] > low[b] + 0.05 and n < first:
            met, first = b, n
    return met
