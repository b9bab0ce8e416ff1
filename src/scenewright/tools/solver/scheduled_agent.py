"""A candidate placed in time, with its standstills and end; a schedule of several and events."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from scenewright.geometry.driving_profile import (
    Motion,
    StopCommand,
    compute_arrival,
    compute_motion,
)
from scenewright.geometry.landmarks import Landmarks
from scenewright.geometry.spline import sample_poses
from scenewright.scene.base import FloatArray, Point
from scenewright.scene.candidates import Candidate
from scenewright.scene.constraints import PairClause
from scenewright.scene.selection import Push, Slowing, Stop
from scenewright.scene.track import STEP
from scenewright.tools.segment_editor import end_motion, make_stop_command, push_motion

FOR_GOOD = 60.0
"""How long who stands for good does [s]: longer than any scene."""


@dataclass(frozen=True, eq=False)
class ScheduledAgent:
    """A candidate placed in time.

    Attributes:
        enters: scene time of its motion's first sample [s], a multiple of the step.
        motion: as edited; free: by its driving profile and the lights it waits at alone.
        contact: scene time [s] at which a collision ends it.
        push: a collision before that one, which pushes it on; `motion` holds it.
    """

    candidate: Candidate
    landmarks: Landmarks
    enters: float
    motion: Motion
    free: Motion
    stops: tuple[Stop, ...] = ()
    slowings: tuple[Slowing, ...] = ()
    contact: float | None = None
    push: Push | None = None

    @classmethod
    def build_unplaced(cls, candidate: Candidate, landmarks: Landmarks) -> ScheduledAgent:
        """Build the agent with its free motion, entering at time 0."""
        motion = compute_motion(candidate)
        return cls(candidate, landmarks, 0.0, motion, motion)

    def get_poses(self, times: FloatArray) -> FloatArray:
        """Return poses [N, 3] (x, y, heading) at scene times [s]."""
        return sample_poses(self.candidate.path, self.motion.compute_positions(times - self.enters))

    def get_pose(self, s: float) -> tuple[float, float, float]:
        """Return (x, y, heading) at arc length `s` [m]."""
        x, y, heading = sample_poses(self.candidate.path, np.array([s]))[0].tolist()
        return x, y, heading

    def get_pose_at(self, time: float) -> tuple[float, float, float]:
        """Return (x, y, heading) at a scene time [s]."""
        x, y, heading = self.get_poses(np.array([time]))[0].tolist()
        return x, y, heading

    def find_place(self, time: float) -> float:
        """Find its arc length [m] at a scene time [s]."""
        return float(np.interp(time - self.enters, self.motion.clock, self.motion.s))

    def find_speed(self, time: float) -> float:
        """Find its speed [m/s] at a scene time [s]."""
        return self.motion.find_speed_at(time - self.enters)

    @property
    def leaves(self) -> float:
        """Scene time of its last sample [s]."""
        return self.enters + STEP * (len(self.motion.s) - 1)

    def build_stop(
        self,
        s: float,
        reason: str,
        *,
        lasts: float = FOR_GOOD,
        braking: float | None = None,
        anchor: str = "stopping_point",
    ) -> Stop:
        """Build its standstill at `s` [m], so long [s] from when it gets there; inf: never."""
        start = self.enters + compute_arrival(self.candidate, StopCommand(s, 0.0, braking))
        return Stop(anchor, s, start, start + lasts, reason, braking)

    def edit(
        self, *, stops: tuple[Stop, ...], slowings: tuple[Slowing, ...] = ()
    ) -> ScheduledAgent:
        """Return the same agent with other stops."""
        holds = tuple(make_stop_command(stop, self.enters) for stop in stops)
        motion = compute_motion(self.candidate, holds=holds, slowings=slowings)
        return ScheduledAgent(
            self.candidate, self.landmarks, self.enters, motion, self.free, stops, slowings,
            self.contact,
        )  # fmt: skip

    def hold_at_lights(self, stops: tuple[Stop, ...]) -> ScheduledAgent:
        """Return the same agent with these stops, which its free motion has as well."""
        held = self.edit(stops=stops)
        return replace(held, free=held.motion)

    def shift(self, seconds: float) -> ScheduledAgent:
        """Return the same agent, shifted by a multiple of the step."""
        stops = tuple(
            replace(stop, start=stop.start + seconds, until=stop.until + seconds)
            for stop in self.stops
        )
        contact = None if self.contact is None else self.contact + seconds
        # Many are shifted, and `replace` looks at every field first.
        enters = round(self.enters + seconds, 1)
        return ScheduledAgent(
            self.candidate, self.landmarks, enters, self.motion, self.free, stops, self.slowings,
            contact, None if self.push is None else self.push.shift(seconds),
        )  # fmt: skip

    def lead_member(self, candidate: Candidate, landmarks: Landmarks) -> ScheduledAgent:
        """Return a member of its group, which walks as it does on a path of its own."""
        own = replace(candidate, time_law=self.candidate.time_law)
        member = ScheduledAgent.build_unplaced(own, landmarks)
        moved = replace(member, enters=self.enters)
        return moved.edit(stops=self.stops, slowings=self.slowings)

    def cut_after(self, time: float) -> ScheduledAgent:
        """Return its motion before scene time `time`; nothing later can meet another agent."""
        steps = max(int((time - self.enters) / STEP + 1e-6), 1)
        if steps >= len(self.motion.s) - 1:
            return self
        motion = Motion(self.motion.candidate, self.motion.s[: steps + 1], self.motion.ended)
        return ScheduledAgent(
            self.candidate, self.landmarks, self.enters, motion, self.free, self.stops,
            self.slowings, self.contact, self.push,
        )  # fmt: skip

    def push_on(self, push: Push) -> ScheduledAgent:
        """Return the same agent, standing, pushed on by a collision from behind."""
        local = push.shift(-self.enters)
        return replace(self, motion=push_motion(self.motion, local), push=push)

    def end_at(self, time: float) -> ScheduledAgent:
        """Cut it at the first sample not before scene time `time`, where it stays as a wreck."""
        return replace(self, motion=end_motion(self.motion, time - self.enters), contact=time)


def get_shared_times(a: ScheduledAgent, b: ScheduledAgent) -> FloatArray | None:
    """Return sample times [s] at which both are in the scene; None if they never are."""
    start, end = max(a.enters, b.enters), min(a.leaves, b.leaves)
    steps = round((end - start) / STEP)
    return None if steps < 1 else start + STEP * np.arange(steps + 1, dtype=np.float64)


def compute_bumper_gaps(a: ScheduledAgent, b: ScheduledAgent, times: FloatArray) -> FloatArray:
    """Compute distances [N] from the front of one to the rear of the other ahead of it [m]."""
    ahead = b.get_poses(times)[:, :2] - a.get_poses(times)[:, :2]
    room = (a.candidate.shape.length + b.candidate.shape.length) / 2
    return np.asarray(np.hypot(*ahead.T) - room)


Pairing = tuple[str, str]

_ENDED = 1.5
"""How long the scene is visible after an event at least [s]."""


@dataclass(frozen=True)
class ScheduledEvent:
    """A scheduled event: when [s] and where.

    Attributes:
        begins, ends: [s] the span that must be visible, and until which `first` is busy with it.
        freed: [s] until when `second` is busy with it.
    """

    clause: PairClause
    time: float
    begins: float
    ends: float
    freed: float
    location: Point

    def shift(self, seconds: float) -> ScheduledEvent:
        """Shift the event in time."""
        return replace(
            self,
            time=self.time + seconds,
            begins=self.begins + seconds,
            ends=self.ends + seconds,
            freed=self.freed + seconds,
        )


@dataclass(frozen=True, eq=False)
class PartialSchedule:
    """Agents placed so far, and the events between them."""

    actors: Mapping[str, ScheduledAgent] = field(default_factory=dict)
    events: tuple[ScheduledEvent, ...] = ()

    def find_busy_end(self, name: str) -> float:
        """Find until when [s] the agent is busy with events so far; -inf if with none."""
        first = [event.ends for event in self.events if name == event.clause.first]
        second = [event.freed for event in self.events if name == event.clause.second]
        return max([*first, *second], default=-float("inf"))

    def is_too_soon(self, time: float, clause: PairClause) -> bool:
        """Return whether the clause would happen before earlier events of its agents have ended."""
        return any(time < self.find_busy_end(name) + 0.5 for name in get_pair(clause))

    def has_event(self, clause: PairClause) -> bool:
        """Return whether an event is scheduled already between the clause's two agents."""
        pair = set(get_pair(clause))
        return any(set(get_pair(event.clause)) == pair for event in self.events)

    def add_event(
        self, event: ScheduledEvent, a: ScheduledAgent, b: ScheduledAgent
    ) -> PartialSchedule:
        """Add an event, and its two agents as they are now."""
        first, second = get_pair(event.clause)
        return PartialSchedule({**self.actors, first: a, second: b}, (*self.events, event))

    def place(
        self, clause: PairClause, a: ScheduledAgent, b: ScheduledAgent, delta: float
    ) -> tuple[ScheduledAgent, ScheduledAgent]:
        """Place both agents with o_b - o_a = delta (to the step); an agent placed already stays."""
        delta = round(delta, 1)
        first, second = get_pair(clause)
        if second in self.actors:
            return (a if first in self.actors else a.shift(b.enters - delta - a.enters)), b
        return a, b.shift(a.enters + delta - b.enters)

    def shift(self, seconds: float) -> PartialSchedule:
        """Shift the schedule by a multiple of the step."""
        actors = {name: actor.shift(seconds) for name, actor in self.actors.items()}
        events = tuple(event.shift(seconds) for event in self.events)
        return PartialSchedule(actors, events)


def find_needed_end(schedule: PartialSchedule) -> float:
    """Find the scene time [s] by which every event has visibly ended."""
    ends = [max(event.time, event.ends) + _ENDED for event in schedule.events]
    for actor in schedule.actors.values():
        ends += [stop.until + _ENDED for stop in actor.stops if stop.reason == "gives_way"]
    return max(ends)


def get_pair(clause: PairClause) -> Pairing:
    """Return the clause's two agents."""
    return clause.first, str(clause.second)
