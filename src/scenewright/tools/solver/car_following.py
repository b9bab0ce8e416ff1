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

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from scenewright.compiled import compiled, compiled_to_write
from scenewright.geometry.driving_profile import (
    Motion,
    compute_arc_lengths,
    compute_squared_speed_limit,
    find_hold_arrival,
    find_time_at_place,
    limit_speed,
)
from scenewright.scene.base import FloatArray
from scenewright.scene.candidates import FORESIGHT, PACE_STEP, DrivingProfile
from scenewright.scene.selection import Stop
from scenewright.scene.track import STEP
from scenewright.tools.map_grounding.signal_plan import Greens, find_green, is_green
from scenewright.tools.solver.entry_times import (
    SEEN,
    START_LAG,
    SceneTiming,
    is_green_around,
    is_seen_moving,
    list_greens,
)
from scenewright.tools.solver.path_conflict import IntArray
from scenewright.tools.solver.reservation import (
    AHEAD,
    CROSSING,
    IN_LANE,
    Bars,
    Corridor,
    Reservations,
    ReservationTable,
    get_corridor,
    list_bars,
    meets_any,
)
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
_QUEUES = 10.0
"""How long a vehicle waits for room to enter [s]; it stays away if its lane is full for longer."""
_LONGEST_HEADWAY = 2.6
_EXACT_PACE = 0.15
"""How long before and after it is passed a light must be green [s]: a pace is exact to 0.1 s."""


def enter_traffic(
    actor: ScheduledAgent,
    wished: FloatArray,
    present: ReservationTable,
    moment: SceneTiming,
    rng: np.random.Generator,
) -> ScheduledAgent | None:
    """Let a vehicle drive among those present, from the first entry time at which it can.

    Args:
        actor: entering at time 0; wished: [N] entry times [s] in the order to be tried, each moved
            on to when there is room to enter.

    Returns:
        The vehicle in scene time; None where it cannot be driven.
    """
    candidate, law = actor.candidate, actor.candidate.time_law
    path, line = candidate.path, actor.landmarks.line
    count = len(wished)
    headway = _HEADWAY * np.exp(_HEADWAY_SPREAD * rng.standard_normal(count))
    drawn = (headway, rng.uniform(*_GAP, count), rng.uniform(*_LINE, count),
             rng.uniform(*START_LAG, count))  # fmt: skip
    enters, pace, rates, stops, driven = _find_drive(
        np.minimum(wished, moment.duration - SEEN), np.column_stack(drawn), moment.duration,
        get_corridor(candidate), present.get_reservations(),
        path.s, path.curvature, compute_squared_speed_limit(candidate),
        (law.speed, law.acceleration, law.braking, law.lateral),
        np.inf if line is None else line, list_greens(actor, moment),
        candidate.route.movement != "straight",
    )  # fmt: skip
    if not len(pace):
        return None
    profile = DrivingProfile(law.speed, *rates, law.lateral, tuple(pace.tolist()))
    own, enters = replace(candidate, time_law=profile), round(enters, 1)
    motion = Motion(own, driven)
    held = tuple(
        Stop(
            "stop_line" if line is not None and 0.0 <= line - s < _LINE[1] + 0.5 else "queue",
            s, start + enters, until + enters, "red_light",
        )
        for s, start, until in stops.tolist()
    )  # fmt: skip
    return ScheduledAgent(own, actor.landmarks, enters, motion, motion, held)


# ---- as machine code ----------------------------------------------------------------------------


@compiled
def _find_drive(
    wished: FloatArray,
    drawn: FloatArray,
    duration: float,
    corridor: Corridor,
    table: Reservations,
    places: FloatArray,
    curvature: FloatArray,
    limit: FloatArray,
    law: tuple[float, float, float, float],
    line: float,
    greens: Greens,
    turns: bool,
) -> tuple[float, FloatArray, tuple[float, float], FloatArray, FloatArray]:
    """Find the first entry time from which it can drive among the others.

    Args:
        wished: [T] entry times [s]; drawn: [T, 4] headway [s], gap [m], from its front to the line
            [m], lag [s].
        places, curvature, limit: [P] arc lengths of its path, squared free speed there.
        law: speed, acceleration, braking, lateral acceleration.

    Returns:
        Entry time [s], its pace (empty: none found), acceleration and braking, its stops [K, 3]
        (arc length [m], begin and end [local s]) and arc lengths [M] every 0.1 s, which go on
        after the scene: a vehicle behind must see how.
    """
    bars, free = list_bars(corridor, table), np.sqrt(limit)
    speed, acceleration, braking, lateral = law
    tried = np.full(len(wished), np.inf)
    for n in range(len(wished)):
        enters = _find_entrance(corridor.s, bars, free[0], wished[n])
        enters = np.ceil(enters / STEP - 1e-6) * STEP
        if enters > min(wished[n] + _QUEUES, duration - SEEN):
            continue
        if np.abs(tried - enters).min() < STEP / 2:
            continue
        tried[n] = enters
        headway, gap, before_line, lag = drawn[n]
        until = duration + _AFTER - enters
        moved = _drive_among(
            corridor.s, bars, enters, until, places, free, acceleration, braking,
            min(headway, _LONGEST_HEADWAY), gap, line, line - before_line, lag, greens, turns,
        )  # fmt: skip
        if len(moved) == 0:
            continue
        speeds, pace, fastest, slowest = _compute_pace(moved, places, limit)
        rates = (max(acceleration, fastest) * 1.05, max(braking, -slowest) * 1.05)
        pace = np.round(pace / speed, 4)
        own = limit_speed(
            places, curvature, speed * np.interp(places / PACE_STEP, np.arange(len(pace)), pace),
            lateral, rates[0], rates[1], FORESIGHT,
        )  # fmt: skip
        stops = _list_stops(moved, speeds)
        holds = _time_stops(stops, places, own, rates)
        driven = compute_arc_lengths(places, own, holds, holds[:0], rates[0])
        driven = driven[: max(int(until / STEP + 1e-6), 1) + 1]
        if not is_seen_moving(driven, enters, duration) or _brakes_hard(driven, braking):
            continue
        crosses = enters + find_time_at_place(driven, line)
        if not is_green_around(crosses, _EXACT_PACE, greens):
            continue
        if not meets_any(round(enters / STEP), corridor, driven, False, False, True, table):
            return enters, pace, rates, stops, driven
    return 0.0, np.empty(0), (acceleration, braking), np.empty((0, 3)), np.empty(0)


@compiled
def _list_stops(moved: FloatArray, speed: FloatArray) -> FloatArray:
    """List where [m] and from when until when [local s] a motion stands, [K, 3]."""
    stops, count, first = np.empty((len(moved) // 2 + 1, 3)), 0, -1
    for k in range(len(moved) + 1):
        if k < len(moved) and speed[k] < _STANDS:
            first = k if first < 0 else first
            continue
        last, begins, first = k - 1, first, -1
        if begins < 0 or STEP * (last - begins) < _SHORTEST:
            continue
        # A vehicle that still creeps stands where it first has all but stopped.
        s = moved[min(begins + 4, last)]
        until = STEP * last + (100.0 if last == len(moved) - 1 else 0.0)
        if count == 0 or s >= stops[count - 1, 0] + _CREEPS:
            stops[count, 0], stops[count, 1] = s, STEP * begins
            count += 1
        stops[count - 1, 2] = until
    return stops[:count]


@compiled_to_write
def _time_stops(
    stops: FloatArray, places: FloatArray, limit: FloatArray, rates: tuple[float, float]
) -> FloatArray:
    """Let each stop begin when a vehicle of that pace stands there; return them as holds [K, 5]."""
    holds = np.zeros((len(stops), 5))
    for k in range(len(stops)):
        holds[k, 0], holds[k, 2] = stops[k, 0], rates[1]
        start = find_hold_arrival(places, limit, holds[: k + 1], rates[0], stops[k, 0])
        stops[k, 1], stops[k, 2] = start, max(stops[k, 2], start)
        holds[k, 1] = stops[k, 2]
    return holds


@compiled
def _brakes_hard(s: FloatArray, usual: float) -> bool:
    """Return whether it brakes harder than allowed for others and for itself.

    Args:
        s: [T] arc length every 0.1 s [m]; usual: its own comfortable braking [m/s^2]; measured
            over 0.3 s, as the checker does.
    """
    most = max(_HARDEST_DRIVEN, 1.06 * usual) * 2 * STEP * 3 * STEP
    change = (s[5:] - s[3:-2]) - (s[2:-3] - s[:-5])
    return len(change) > 0 and change.min() < -most


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
    greens: Greens,
    turns: bool,
) -> FloatArray:
    """Compute the arc length [T] every 0.1 s behind all it would run into; empty if impossible.

    Args:
        nodes: arc lengths [N]; bars: see `list_bars`.
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
def _find_red(moved: FloatArray, line: float, enters: float, lag: float, greens: Greens) -> float:
    """Find the local time [s] until which its light holds this motion; -inf if not at all."""
    if len(greens[0]) == 0 or moved[-1] < line:
        return -np.inf
    crosses = enters + STEP * float(np.searchsorted(moved, line))
    before, after = is_green(crosses - 0.35, greens), is_green(crosses + 0.35, greens)
    if before and after and is_green(crosses, greens):
        return -np.inf
    if not before and after:
        return crosses - enters + 0.5
    return find_green(crosses, greens) + lag - enters


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


@compiled_to_write
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
