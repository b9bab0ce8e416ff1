"""A candidate placed in time: where it is when, with its standstills and its end."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from scenewright.geometry.along import sample_poses
from scenewright.geometry.driving_profile import Motion, compute_motion
from scenewright.geometry.landmarks import Landmarks
from scenewright.scene.base import FloatArray
from scenewright.scene.candidates import Candidate
from scenewright.scene.selection import Slowing, Stop
from scenewright.scene.track import STEP
from scenewright.tools.segment_editor import end_motion, make_stop_command


@dataclass(frozen=True, eq=False)
class ScheduledAgent:
    """A candidate placed in time.

    Attributes:
        enters: scene time of its motion's first sample [s], a multiple of the step.
        motion: as edited; free: as its time law and the lights it waits at would have it.
        contact: scene time [s] at which a collision ends it.
    """

    candidate: Candidate
    landmarks: Landmarks
    enters: float
    motion: Motion
    free: Motion
    stops: tuple[Stop, ...] = ()
    slowings: tuple[Slowing, ...] = ()
    contact: float | None = None

    @classmethod
    def unplaced(cls, candidate: Candidate, landmarks: Landmarks) -> ScheduledAgent:
        """As its time law alone would have it, entering at time 0."""
        motion = compute_motion(candidate)
        return cls(candidate, landmarks, 0.0, motion, motion)

    def at(self, times: FloatArray) -> FloatArray:
        """[N, 3] poses (x, y, heading) at scene times [s]."""
        return sample_poses(self.candidate.path, self.motion.compute_positions(times - self.enters))

    def pose(self, s: float) -> tuple[float, float, float]:
        """(x, y, heading) at arc length `s` [m]."""
        x, y, heading = sample_poses(self.candidate.path, np.array([s]))[0].tolist()
        return x, y, heading

    @property
    def leaves(self) -> float:
        """Scene time of its last sample [s]."""
        return self.enters + STEP * (len(self.motion.s) - 1)

    def edited(
        self, *, stops: tuple[Stop, ...], slowings: tuple[Slowing, ...] = ()
    ) -> ScheduledAgent:
        """The same actor with other standstills."""
        holds = tuple(make_stop_command(stop, self.enters) for stop in stops)
        motion = compute_motion(self.candidate, holds=holds, slowings=slowings)
        return ScheduledAgent(
            self.candidate, self.landmarks, self.enters, motion, self.free, stops, slowings,
            self.contact,
        )  # fmt: skip

    def held_by_lights(self, stops: tuple[Stop, ...]) -> ScheduledAgent:
        """The same actor with these standstills, which its free motion has as well."""
        held = self.edited(stops=stops)
        return replace(held, free=held.motion)

    def shifted(self, seconds: float) -> ScheduledAgent:
        """The same actor, everything later by a multiple of the step."""
        stops = tuple(
            replace(stop, start=stop.start + seconds, until=stop.until + seconds)
            for stop in self.stops
        )
        contact = None if self.contact is None else self.contact + seconds
        # Many are shifted, and `replace` looks at every field first.
        enters = round(self.enters + seconds, 1)
        return ScheduledAgent(
            self.candidate, self.landmarks, enters, self.motion, self.free, stops, self.slowings,
            contact,
        )  # fmt: skip

    def led(self, candidate: Candidate, landmarks: Landmarks) -> ScheduledAgent:
        """A member of its group, who walks as it does on a path of its own."""
        own = replace(candidate, time_law=self.candidate.time_law)
        member = ScheduledAgent.unplaced(own, landmarks)
        moved = replace(member, enters=self.enters)
        return moved.edited(stops=self.stops, slowings=self.slowings)

    def until(self, time: float) -> ScheduledAgent:
        """What of it falls before scene time `time`; nothing later can meet anybody."""
        steps = max(int((time - self.enters) / STEP + 1e-6), 1)
        if steps >= len(self.motion.s) - 1:
            return self
        motion = Motion(self.motion.candidate, self.motion.s[: steps + 1], self.motion.ended)
        return ScheduledAgent(
            self.candidate, self.landmarks, self.enters, motion, self.free, self.stops,
            self.slowings, self.contact,
        )  # fmt: skip

    def ended(self, time: float) -> ScheduledAgent:
        """Cut at the first sample not before scene time `time`, where it stays as a wreck."""
        return replace(self, motion=end_motion(self.motion, time - self.enters), contact=time)


def get_shared_times(a: ScheduledAgent, b: ScheduledAgent) -> FloatArray | None:
    """Sample times [s] at which both are there; None if they never are."""
    start, end = max(a.enters, b.enters), min(a.leaves, b.leaves)
    steps = round((end - start) / STEP)
    return None if steps < 1 else start + STEP * np.arange(steps + 1, dtype=np.float64)
