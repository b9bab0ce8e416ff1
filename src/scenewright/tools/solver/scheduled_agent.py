"""A candidate placed in time: where it is when, with its standstills and its end."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from scenewright.geometry.along import sample_poses
from scenewright.geometry.driving_profile import (
    Motion,
    StopCommand,
    compute_arrival,
    compute_motion,
)
from scenewright.geometry.landmarks import Landmarks
from scenewright.scene.base import FloatArray
from scenewright.scene.candidates import Candidate
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
