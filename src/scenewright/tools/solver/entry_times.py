"""Entry times of agents that no relation binds: on green, waiting at red, or in a queue."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from scenewright.compiled import compiled
from scenewright.geometry.along import find_nearest_point
from scenewright.geometry.driving_profile import StopCommand, compute_arrival
from scenewright.scene.base import FloatArray, Point
from scenewright.scene.candidates import Candidate, DrivingProfile
from scenewright.scene.map import IntersectionMap, Route, SignalProgram
from scenewright.scene.selection import Stop
from scenewright.scene.track import STEP
from scenewright.tools.map_grounding.signal_plan import (
    SignalClock,
    get_phases,
    get_red_duration,
    is_showing,
    is_showing_at,
)
from scenewright.tools.solver.scheduled_agent import ScheduledAgent

LINE_GAP, QUEUE_GAP = (0.3, 1.5), (1.4, 2.6)
"""Waiting vehicles: to the line and to the next ahead [m]."""

KERB_GAP, KERB_ROW = 0.45, (0.7, 1.0)
"""Waiting pedestrians: from the kerb, and from one row of them to the next [m]."""

START_LAG, FOLLOW_LAG, STOP_LAG = (0.8, 1.5), (1.05, 1.7), (1.2, 4.0)
"""From green to the first one's start, from the start of the next ahead to its own, and from its
standstill to its own [s]: a follower with less lag comes too near on the way."""

_LANE_OFFSET, _ONE_WAY = 2.6, 0.85
"""A standing vehicle within 2.6 m of a path, with a heading this close (cosine), blocks it."""

_SEEN, _GRID = 4.0, 0.5
"""How long every agent is visible at least; spacing of the entry times tried [s]."""

_IN_VIEW, _NEAR_CONFLICT = 22.0, 3.5
"""How far from a conflict, and how long before or after it, pedestrians come and go [m, s]."""

STARTED = -6.0
"""An agent that set off longer before the scene than this has hardly anything of its start left
[s]."""

Span = tuple[float, float]


@dataclass(frozen=True)
class SceneTiming:
    """When agents may come: lights, scene length [s], whether a wreck will stand in the way.

    Attributes:
        conflicts: time [s] and place of the events, in view of which no pedestrian comes or goes.
    """

    clock: SignalClock | None
    duration: float
    blocked: bool
    conflicts: tuple[tuple[float, Point], ...] = ()


@dataclass(frozen=True, eq=False)
class RedLightWait:
    """An agent that arrives first in its lane at red, and waits.

    Attributes:
        gap: from its front, or on foot its middle, to the line [m].
        lag: from green to its start [s].
        stays: a wreck ahead keeps it there for good.
    """

    free: ScheduledAgent
    moment: SceneTiming
    enters: float
    gap: float
    lag: float
    stays: bool = False

    @property
    def s(self) -> float:
        """Arc length at which it stands [m]."""
        return (self.free.landmarks.line or 0.0) - self.gap

    @cached_property
    def reaches(self) -> float:
        """Scene time [s] at which it would stand, were braking free; good to about 2 s."""
        return self.enters + self.free.motion.find_time_at(max(self.s, 0.0))

    @property
    def holds(self) -> bool:
        """Return whether it can wait at red light, its end visible in the scene, with room to
        stand."""
        group, clock = self.free.landmarks.group, self.moment.clock
        if clock is None or self.free.landmarks.line is None or group is None or self.s < 3.0:
            return False
        if self.enters > self.moment.duration - 4.0:
            return False
        colours = [clock.get_colour(group, self.reaches + late) for late in (-1.5, 0.5, 2.5)]
        return "green" not in colours and self.release > STARTED

    @cached_property
    def release(self) -> float:
        """Scene time [s] at which it starts again."""
        if self.moment.clock is None or self.stays:
            return self.moment.duration + 10.0
        green = self.moment.clock.find_next_green(str(self.free.landmarks.group), self.reaches)
        return green + self.lag

    def actor(self) -> ScheduledAgent:
        """The agent in motion, entering at time 0."""
        stop = build_red_light_stop(self.free, self.s)
        until = max(self.release - self.enters, stop.start)
        held = self.free.edit(stops=(replace(stop, until=until),))
        return held.cut_after(self.moment.duration - self.enters)


def build_red_light_stop(actor: ScheduledAgent, s: float) -> Stop:
    """Build its stop at `s` [m], before its light, until the moment in which it begins."""
    anchor = "kerb" if actor.candidate.route.type == "pedestrian" else "stop_line"
    start = actor.enters + compute_arrival(actor.candidate, StopCommand(s, 0.0))
    return Stop(anchor, s, start, start, "red_light")


def find_entry_times(actor: ScheduledAgent, moment: SceneTiming) -> NDArray[np.int64]:
    """Find entry times [steps] at which the agent is visible for 4 s and obeys its light."""
    first, last = 4.0 - STEP * len(actor.motion.s), moment.duration - 4.0
    steps = np.arange(int(np.ceil(first / STEP)), int(last / STEP) + 1, dtype=np.int64)
    line, group, clock = actor.landmarks.line, actor.landmarks.group, moment.clock
    if clock is None or line is None or group is None or not len(steps):
        return steps
    crosses = STEP * steps + actor.motion.find_time_at(line) + clock.offset
    green = is_showing(clock.program, group, np.stack([crosses - 0.3, crosses + 0.3]), ("green",))
    allowed = green.all(axis=0)
    if actor.candidate.route.type == "pedestrian" and clock.get_colour(group, 0.0) == "red":
        allowed &= ~_is_on_crosswalk(actor, np.asarray(-STEP * steps, dtype=np.float64))
    return steps[allowed]


def select_unseen_times(
    actor: ScheduledAgent, starts: NDArray[np.int64], moment: SceneTiming
) -> NDArray[np.int64]:
    """Select the entry times [steps] at which it does not come or go in view of a conflict."""
    comes = STEP * starts
    goes = comes + STEP * (len(actor.motion.s) - 1)
    unseen = np.ones(len(starts), dtype=np.bool_)
    for times, there, s in (
        (comes, comes > 0.0, 0.0),
        (goes, goes < moment.duration, float(actor.motion.s[-1])),
    ):
        x, y, _ = actor.get_pose(s) if there.any() else (math.inf, math.inf, 0.0)
        for time, place in moment.conflicts:
            if math.dist((x, y), place) < _IN_VIEW:
                unseen &= ~(there & (np.abs(times - time) < _NEAR_CONFLICT))
    return starts[unseen]


def _is_on_crosswalk(actor: ScheduledAgent, times: FloatArray) -> NDArray[np.bool_]:
    """Return [N] whether a pedestrian is on its crosswalk at local times [s]."""
    own = [each for each in actor.landmarks.crosswalks if each[0] == actor.landmarks.own_crosswalk]
    s = np.where(times > 0.0, actor.motion.compute_positions(times), -np.inf)
    inside = [(begin - 0.5 < s) & (s < end + 0.5) for _, begin, end in own]
    return np.logical_or.reduce(inside) if inside else np.zeros(len(times), np.bool_)


def starts_on_red(actor: ScheduledAgent, moment: SceneTiming, enters: float) -> bool:
    """Return whether a pedestrian starts the scene on its crosswalk while its light is red."""
    group, clock = actor.landmarks.group, moment.clock
    if clock is None or group is None or clock.get_colour(group, 0.0) != "red":
        return False
    return bool(_is_on_crosswalk(actor, np.array([-enters]))[0])


def compute_arrival_entry(free: ScheduledAgent, moment: SceneTiming, chance: float) -> float:
    """Compute when a random arrival enters [s], given that it is visible; `chance` picks the
    quantile.

    Arrivals are uniform in time. An agent that came to a green light long before the scene has
    gone; one that came to a red light then still stands there when the scene begins. So the entry
    times reach back as far as the light has been red.
    """
    first, last = _SEEN - STEP * len(free.motion.s), moment.duration - _SEEN
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
        if enters[n] >= first or (goes > crosses and goes > STARTED):
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


def compute_red_span(free: ScheduledAgent, moment: SceneTiming, enters: float) -> Span:
    """Compute when [s] the light holds an agent that enters then; an empty span if it is green."""
    line, group, clock = free.landmarks.line, free.landmarks.group, moment.clock
    reaches = enters + free.motion.find_time_at(line or 0.0)
    if clock is None or group is None or line is None:
        return reaches, reaches
    return reaches, clock.find_next_green(group, reaches)


@dataclass(frozen=True)
class QueueTail:
    """The last vehicle of a queue.

    Attributes:
        rear: arc length [m] of its rear on the path of a follower.
        start, until: [s] of its standstill; law: how it drives.
    """

    rear: float
    start: float
    until: float
    law: DrivingProfile


def find_queue_tail(
    candidate: Candidate, standing: Sequence[ScheduledAgent], span: Span = (-np.inf, np.inf)
) -> QueueTail | None:
    """Find the last vehicle standing on the candidate's path at some time of a span [s]."""
    found: QueueTail | None = None
    for actor in standing:
        for (x, y, heading), start, until in actor.standstills:
            if until < span[0] or start > span[1]:
                continue
            path = candidate.path
            node, away = find_nearest_point(path.xy, x, y)
            if away > _LANE_OFFSET or math.cos(path.heading[node] - heading) < _ONE_WAY:
                continue
            rear = float(path.s[node]) - actor.candidate.shape.length / 2
            if found is None or rear < found.rear:
                found = QueueTail(rear, start, until, actor.candidate.time_law)
    return found


def limit_to_leader(candidate: Candidate, ahead: DrivingProfile) -> Candidate:
    """Limit the candidate's pace to its leader's, as it cannot drive through it."""
    law = candidate.time_law
    pace = replace(
        law,
        speed=min(law.speed, ahead.speed),
        acceleration=min(law.acceleration, ahead.acceleration),
    )
    return replace(candidate, time_law=pace)
