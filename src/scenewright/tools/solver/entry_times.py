"""Entry times of agents that no relation binds: on green, or waiting at red."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from scenewright.compiled import compiled
from scenewright.geometry.driving_profile import (
    compute_arc_lengths,
    compute_squared_speed_limit,
    find_time_at_place,
)
from scenewright.scene.base import FloatArray, Point
from scenewright.scene.map import IntersectionMap
from scenewright.scene.map_elements import Route, SignalProgram
from scenewright.scene.selection import Stop
from scenewright.scene.track import STEP
from scenewright.tools.map_grounding.signal_plan import (
    Greens,
    SignalClock,
    find_green,
    get_phases,
    get_red_duration,
    is_green,
    is_showing_at,
)
from scenewright.tools.solver.reservation import (
    Corridor,
    Reservations,
    ReservationTable,
    get_corridor,
    meets_any,
)
from scenewright.tools.solver.scheduled_agent import ScheduledAgent

LINE_GAP = (0.3, 1.5)
"""From a waiting vehicle to the line [m]."""

KERB_GAP, KERB_ROW, _ROWS = 0.45, (0.7, 1.0), 3
"""Waiting pedestrians: from the kerb, and from one row of them to the next [m]; rows."""

START_LAG = (0.8, 1.5)
"""From green to the start of who waits [s]."""

SEEN, _GRID = 4.0, 0.5
"""How long every agent is visible at least; spacing of the entry times of random arrivals [s]."""

_IN_VIEW, _NEAR_CONFLICT = 22.0, 3.5
"""How far from a conflict, and how long before or after it, pedestrians come and go [m, s]."""

_STARTED = -6.0
"""An agent that set off longer before the scene than this has hardly anything of its start left
[s]."""

_GREEN_MARGIN = 0.3
"""How long before and after it is passed a light must be green [s]."""

_MARGIN = 0.5
"""How far beside a crosswalk a pedestrian counts as on it [m]."""

_LEAST_WAY = 2.0
"""An agent that moves less in the whole scene [m] only stands about."""

_ROOM_TO_STOP = 3.0
"""Least distance from its entry to where an agent waits [m]."""

_BEYOND_SCENE = 10.0
"""Who waits so long beyond the scene does not set off in it [s]."""


@dataclass(frozen=True)
class SceneTiming:
    """When agents may come: lights and scene length [s].

    Attributes:
        conflicts: time [s] and place of the events, in view of which no pedestrian comes or goes.
    """

    clock: SignalClock | None
    duration: float
    conflicts: tuple[tuple[float, Point], ...] = ()


def build_red_light_stop(actor: ScheduledAgent, s: float) -> Stop:
    """Build its stop at `s` [m], before its light, until the moment in which it begins."""
    anchor = "kerb" if actor.candidate.route.type == "pedestrian" else "stop_line"
    return actor.build_stop(s, "red_light", lasts=0.0, anchor=anchor)


def list_greens(actor: ScheduledAgent, moment: SceneTiming) -> Greens:
    """List when its light is green."""
    group, clock = actor.landmarks.group, moment.clock
    if actor.landmarks.line is None or group is None or clock is None:
        return np.empty(0), np.empty(0, dtype=np.bool_), 0.0, 1.0
    return clock.get_greens(group)


def pass_or_wait(
    actor: ScheduledAgent,
    wished: FloatArray,
    present: ReservationTable,
    moment: SceneTiming,
    rng: np.random.Generator,
    *,
    foreground: bool = False,
) -> ScheduledAgent | None:
    """Let an agent pass on green, or wait first at its line or kerb, at the first time it can.

    Pedestrians neither come nor go in view of a conflict, and wait in rows.

    Args:
        actor: entering at time 0; wished: [N] entry times [s] in the order to be tried.
        foreground: keeps the stricter distance.

    Returns:
        The agent in scene time; None where it meets others at every time.
    """
    candidate, law, marks = actor.candidate, actor.candidate.time_law, actor.landmarks
    walks, line = candidate.route.type == "pedestrian", marks.line
    gaps = np.full(len(wished), KERB_GAP) if walks else rng.uniform(*LINE_GAP, len(wished))
    rows = rng.uniform(*KERB_ROW, len(wished)) if walks else np.zeros(len(wished))
    lags = rng.uniform(*START_LAG, len(wished))
    red = marks.crosswalks if _is_red_at_start(actor, moment) else ()
    own = [each[1:] for each in red if each[0] == marks.own_crosswalk]
    conflicts = [(time, *place) for time, place in moment.conflicts if walks]
    n, stop, release = _find_entry(
        wished.round(1), gaps, rows, lags, candidate.path.s, candidate.path.xy,
        compute_squared_speed_limit(candidate), law.acceleration, law.braking, actor.motion.s,
        np.inf if line is None else line, list_greens(actor, moment), moment.duration,
        np.array(own, dtype=np.float64).reshape(-1, 2),
        np.array(conflicts, dtype=np.float64).reshape(-1, 3),
        get_corridor(candidate), foreground, present.get_reservations(),
    )  # fmt: skip
    if n < 0:
        return None
    placed = actor.shift(float(wished[n]))
    if np.isnan(stop):
        return placed
    stands = build_red_light_stop(placed, stop)
    held = placed.edit(stops=(replace(stands, until=max(release, stands.start)),))
    return held.cut_after(moment.duration)


def _is_red_at_start(actor: ScheduledAgent, moment: SceneTiming) -> bool:
    """Return whether its light is red when the scene begins."""
    group, clock = actor.landmarks.group, moment.clock
    return clock is not None and group is not None and clock.get_colour(group, 0.0) == "red"


def starts_on_red(actor: ScheduledAgent, moment: SceneTiming) -> bool:
    """Return whether a pedestrian starts the scene on its crosswalk while its light is red."""
    if actor.enters >= 0.0 or not _is_red_at_start(actor, moment):
        return False
    s = actor.find_place(0.0)
    own = [
        crosswalk
        for crosswalk in actor.landmarks.crosswalks
        if crosswalk[0] == actor.landmarks.own_crosswalk
    ]
    return any(begin - _MARGIN < s < end + _MARGIN for _, begin, end in own)


def compute_arrival_entry(free: ScheduledAgent, moment: SceneTiming, chance: float) -> float:
    """Compute when a random arrival enters [s], given that it is visible; `chance` picks the
    quantile.

    Arrivals are uniform in time. An agent that came to a green light long before the scene has
    gone; one that came to a red light then still stands there when the scene begins. So the entry
    times reach back as far as the light has been red.
    """
    first, last = SEEN - STEP * len(free.motion.s), moment.duration - SEEN
    line, group, clock = free.landmarks.line, free.landmarks.group, moment.clock
    if clock is None or line is None or group is None:
        return first + chance * (last - first)
    cycle = clock.program.cycle
    enters = np.arange(min(first, -cycle), last, _GRID)
    edges, green = get_phases(clock.program, group, ("green",))
    way = free.motion.find_time_at(line)
    moments = _select_visible(enters, way, first, edges, green, cycle, clock.offset)
    return float(moments[int(chance * len(moments))]) if len(moments) else first


@compiled
def _select_visible(
    enters: FloatArray,
    way: float,
    first: float,
    edges: FloatArray,
    green: NDArray[np.bool_],
    cycle: float,
    offset: float,
) -> FloatArray:
    """Select, of evenly spaced entry times, those at which the agent is on its way or at its light
    [s].

    Args:
        way: time to the light; first: from when on an agent that meets green is visible [s].
        edges, green: phases of the light; cycle, offset: of its programme [s].
    """
    goes, seen, count = np.inf, np.empty(len(enters)), 0
    for k in range(int(cycle / _GRID) + 1, 0, -1):
        after = enters[-1] + way + _GRID * k
        goes = after if is_showing_at(after + offset, edges, green, cycle) else goes
    for n in range(len(enters) - 1, -1, -1):
        crosses = enters[n] + way
        goes = crosses if is_showing_at(crosses + offset, edges, green, cycle) else goes
        if enters[n] >= first or (goes > crosses and goes > _STARTED):
            count += 1
            seen[-count] = enters[n]
    return seen[len(seen) - count :]


def count_visible_agents(
    program: SignalProgram,
    offsets: FloatArray,
    arrivals: Iterable[Route],
    *,
    duration: float,
    intersection_map: IntersectionMap,
) -> FloatArray:
    """Count the random arrivals [N] visible under each signal offset, relatively.

    Arrivals are uniform in time; a scene shows those of its own duration [s] and those still
    waiting at a light that was red before. A scene shows as many under every offset; under one that
    brings a queue more are visible.
    """
    people = list(arrivals)
    return duration * max(len(people), 1) + _compute_total_red(
        program, offsets, people, intersection_map=intersection_map
    )


def compute_queue_growth(
    program: SignalProgram,
    offsets: FloatArray,
    arrivals: Iterable[Route],
    *,
    duration: float,
    intersection_map: IntersectionMap,
) -> FloatArray:
    """Compute how much queues [N] grow during a scene, by signal offset [s of red].

    The mean over the vehicles of how long their lights have not been green. Below 0,
    more set off in the scene than come to stand; over all moments of a programme it is 0.
    """
    drivers = [route for route in arrivals if route.type == "vehicle"]
    begin, end = (
        _compute_total_red(program, moments, drivers, intersection_map=intersection_map)
        for moments in (offsets, offsets + duration)
    )
    return np.asarray((end - begin) / max(len(drivers), 1))


def _compute_total_red(
    program: SignalProgram,
    offsets: FloatArray,
    arrivals: Iterable[Route],
    *,
    intersection_map: IntersectionMap,
) -> FloatArray:
    """Compute the summed time [N] since the lights of several agents were last green [s]."""
    groups = Counter(intersection_map.find_signal_group(route) for route in arrivals)
    red = np.zeros(len(offsets))
    for group, count in groups.items():
        if group is not None:
            red += count * get_red_duration(program, group, offsets)
    return red


def passes_on_green(actor: ScheduledAgent, moment: SceneTiming, enters: float) -> bool:
    """Return whether an agent that enters at scene time [s] has green at its line, or never
    arrives.

    The light may have changed again since the vehicle ahead in its queue left.
    """
    line, group, clock = actor.landmarks.line, actor.landmarks.group, moment.clock
    if clock is None or line is None or group is None:
        return True
    crosses = enters + actor.motion.find_time_at(line)
    return bool(np.isinf(crosses)) or clock.get_colour(group, crosses) == "green"


@compiled
def _find_entry(
    wished: FloatArray,
    gaps: FloatArray,
    rows: FloatArray,
    lags: FloatArray,
    nodes: FloatArray,
    xy: FloatArray,
    limit: FloatArray,
    acceleration: float,
    braking: float,
    free: FloatArray,
    line: float,
    greens: Greens,
    duration: float,
    crosswalks: FloatArray,
    conflicts: FloatArray,
    corridor: Corridor,
    foreground: bool,
    table: Reservations,
) -> tuple[int, float, float]:
    """Find the first entry time at which the agent may come and meets no other.

    Args:
        wished: [T] entry times [s]; gaps, rows, lags: [T] where it would wait, and how late it
            would start.
        nodes, xy, limit: [P] of its path; free: [M] its motion where nothing holds it.
        crosswalks: [C, 2] where it may not be at the start of the scene [m].
        conflicts: [K, 3] time [s] and place [m] in view of which it may not come or go.

    Returns:
        Index of the time, -1 for none; where it waits [m], NaN for nowhere; until when [s].
    """
    nothing = np.empty((0, 5))
    for n in range(len(wished)):
        enters = wished[n]
        if enters > duration - SEEN:
            continue
        crosses = enters + find_time_at_place(free, line)
        holds = not is_green_around(crosses, _GREEN_MARGIN, greens)
        for row in range(_ROWS if holds and rows[n] > 0.0 else 1):
            stop, release, moved = np.nan, 0.0, free
            if holds:
                stop = line - gaps[n] - row * rows[n]
                release = _find_release(
                    enters + find_time_at_place(free, max(stop, 0.0)), lags[n], greens
                )
                if stop < _ROOM_TO_STOP or release < _STARTED:
                    continue
                release = min(release, duration + _BEYOND_SCENE)
                hold = np.array([[stop, release - enters, braking, 0.0, 0.0]])
                moved = compute_arc_lengths(nodes, limit, hold, nothing, acceleration)
                moved = moved[: max(int((duration - enters) / STEP + 1e-6), 1) + 1]
            if not is_seen_moving(moved, enters, duration):
                continue
            at = moved[round(-enters / STEP)] if enters < 0.0 else -np.inf
            if _is_within(crosswalks, at, stop):
                continue
            if _is_in_view(conflicts, enters, duration, moved, nodes, xy):
                continue
            start = round(enters / STEP)
            if not meets_any(start, corridor, moved, False, foreground, False, table):
                return n, stop, release
    return -1, np.nan, 0.0


@compiled
def is_seen_moving(moved: FloatArray, enters: float, duration: float) -> bool:
    """Return whether an agent is in the scene for 4 s at least, and does not stand all that time.

    Args:
        moved: its arc length every 0.1 s [m]; enters: scene time of its entry [s].
    """
    first, last = max(round(-enters / STEP), 0), round((duration - enters) / STEP)
    last = min(last, len(moved) - 1)
    return last - first >= SEEN / STEP and moved[last] - moved[first] > _LEAST_WAY


@compiled
def is_green_around(crosses: float, margin: float, greens: Greens) -> bool:
    """Return whether the light is green so long [s] before it is passed, then and after; True
    where there is none, or it is never passed."""
    if len(greens[0]) == 0 or crosses == np.inf:
        return True
    before, after = crosses - margin, crosses + margin
    return is_green(before, greens) and is_green(crosses, greens) and is_green(after, greens)


@compiled
def _find_release(reaches: float, lag: float, greens: Greens) -> float:
    """Find when [s] who comes to its place at `reaches` sets off; -inf if it need not wait."""
    for late in (-1.5, 0.5, 2.5):
        if is_green(reaches + late, greens):
            return -np.inf
    return find_green(reaches, greens) + lag


@compiled
def _is_within(crosswalks: FloatArray, s: float, stop: float) -> bool:
    """Return whether it is on a crosswalk at arc length `s`, and not only waiting before it."""
    if s <= stop + 0.1:
        return False
    for k in range(len(crosswalks)):
        if crosswalks[k, 0] - _MARGIN < s < crosswalks[k, 1] + _MARGIN:
            return True
    return False


@compiled
def _is_in_view(
    conflicts: FloatArray,
    enters: float,
    duration: float,
    moved: FloatArray,
    nodes: FloatArray,
    xy: FloatArray,
) -> bool:
    """Return whether it comes or goes in view of a conflict, during the scene."""
    if len(conflicts) == 0:
        return False
    leaves = enters + STEP * (len(moved) - 1)
    last = min(np.searchsorted(nodes, moved[-1]), len(nodes) - 1)
    for k in range(len(conflicts)):
        time, x, y = conflicts[k, 0], conflicts[k, 1], conflicts[k, 2]
        comes = enters > 0.0 and abs(enters - time) < _NEAR_CONFLICT
        if comes and np.hypot(xy[0, 0] - x, xy[0, 1] - y) < _IN_VIEW:
            return True
        goes = leaves < duration and abs(leaves - time) < _NEAR_CONFLICT
        if goes and np.hypot(xy[last, 0] - x, xy[last, 1] - y) < _IN_VIEW:
            return True
    return False
