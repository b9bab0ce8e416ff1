"""Windows: scenes of equal length cut from a recording, with all agents present."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scenewright.scene.base import FloatArray
from scenewright.scene.track import STEP
from scenewright.tools.track_io.recording import IntArray, Recording

BoolArray = NDArray[np.bool_]
TRAJNET_EVERY = 4
"""Samples of 0.1 s from one step of the refiner to the next (SEMANTICS section 1)."""


@dataclass(frozen=True, eq=False)
class RecordingWindow:
    """A scene cut from a recording.

    Attributes:
        start: time of the first step in the recording [s]; step: between steps [s].
        members: [A] positions of its agents in the recording.
        xy: [A, T, 2] positions [m]; heading: [A, T] [rad]; both 0 where the agent was not seen.
        present: [A, T] whether the agent was there.
    """

    start: float
    step: float
    members: IntArray
    xy: FloatArray
    heading: FloatArray
    present: BoolArray

    @property
    def whole(self) -> BoolArray:
        """[A] whether an agent is present at every step."""
        return np.asarray(self.present.all(axis=1))


def cut_windows(
    recording: Recording,
    *,
    steps: int = 21,
    every: int = TRAJNET_EVERY,
    stride: int | None = None,
    least_whole: int = 1,
) -> Iterator[RecordingWindow]:
    """Scenes of `steps` steps, in order of time; the same arguments give the same scenes.

    Args:
        steps: T, the number of steps; 9 + 12 are TrajNet++'s.
        every: samples of 0.1 s from step to step: 4 for 0.4 s, 1 for 0.1 s.
        stride: samples from one scene's start to the next; None joins them end to end.

        least_whole: fewest agents that must be there at every step.
    """
    if min(steps, every) < 1 or (stride is not None and stride < 1):
        raise ValueError("steps, every and stride are counted from 1")
    samples = recording.samples
    begin = int(np.ceil(recording.begin / STEP - 1e-6))
    end = int(np.floor(recording.end / STEP + 1e-6)) - (steps - 1) * every
    for start in range(begin, end + 1, stride or steps * every):
        grid = start + every * np.arange(steps)
        near = np.flatnonzero((samples.first <= grid[-1]) & (samples.last >= grid[0]))
        present = (grid >= samples.first[near, None]) & (grid <= samples.last[near, None])
        members, present = near[present.any(axis=1)], present[present.any(axis=1)]
        if not len(members) or int(present.all(axis=1).sum()) < least_whole:
            continue
        index = samples.origin[members, None] + grid - samples.first[members, None]
        index = np.where(present, index, 0)
        yield RecordingWindow(
            round(start * STEP, 1), every * STEP, members,
            np.where(present[..., None], samples.xy[index], 0.0),
            np.where(present, samples.heading[index], 0.0), present,
        )  # fmt: skip
