"""Windows of 3.2 s of one agent's motion, as features for a classifier.

Positions are smoothed over 1 s in all first, on both sides: real ones jitter, and no classifier
shall win by that. Nothing in a window says where on a map it was.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scenewright.evals.realism.sources import TrackSource
from scenewright.geometry.kinematics import smooth
from scenewright.scene.base import AgentClass, FloatArray
from scenewright.scene.track import STEP, Track

SPAN = 32
"""Steps of 0.1 s in a window."""
SMOOTHING = 1.0 / math.sqrt(12.0)
"""Standard deviation of the Gaussian that goes over positions first [s]: that of a mean over 1 s. A
Gaussian with a standard deviation of 1 s would reach over 6 s, twice the length of a window, and
hide how speeds change within one."""
TRIMMED = 5
"""Samples left out at either end of a track, where the smoothing has but one side."""
EVERY = 4
"""Samples from value to value of what the classifier sees."""
_STANDS = 0.3
_CHANGES = {"vehicle": 1.0, "pedestrian": 0.3}
"""Change of speed within a window [m/s] from which it speeds up or slows."""
_TURNS = 0.35
"""Change of course within a window [rad] that makes it a turn."""
_BANDS = {"vehicle": (2.0, 5.0, 8.0, 11.0), "pedestrian": (0.8, 1.1, 1.4, 1.7)}
"""Mean speeds [m/s] between bands within which windows are matched."""


@dataclass(frozen=True, eq=False)
class Windows:
    """Windows of one class and source.

    Attributes:
        features: [W, F]; speed: [W, 33] smoothed [m/s]; situation: [W] what it does; band: [W] of
            its mean speed; group: [W] agents that are split together; foreground: [W].
    """

    features: FloatArray
    speed: FloatArray
    situation: NDArray[np.str_]
    band: NDArray[np.int64]
    group: NDArray[np.str_]
    foreground: NDArray[np.bool_]

    def __len__(self) -> int:
        return len(self.features)

    def select(self, chosen: NDArray[np.bool_] | NDArray[np.int64]) -> Windows:
        """Select some of the windows."""
        return Windows(*(getattr(self, name)[chosen] for name in self.__dataclass_fields__))


def cut_windows(source: TrackSource, kind: AgentClass) -> Windows:
    """Cut the windows of a class, one every 1.6 s of every track, without standing agents."""
    rows = [
        (features, speed, _classify_situation(speed, turned, kind), stretch.groups[user.id],
         user.id in stretch.foreground)
        for stretch in source.stretches
        for user in stretch.users
        if user.shape.type == kind
        for features, speed, turned in _cut_track(user.track)
        if speed.max() > _STANDS
    ]  # fmt: skip
    if not rows:
        return Windows(
            np.zeros((0, 1)), np.zeros((0, SPAN + 1)), np.array([], dtype=np.str_),
            np.zeros(0, np.int64), np.array([], dtype=np.str_), np.zeros(0, np.bool_),
        )  # fmt: skip
    speed = np.stack([row[1] for row in rows])
    return Windows(
        np.stack([row[0] for row in rows]), speed, np.array([row[2] for row in rows]),
        np.searchsorted(_BANDS[kind], speed.mean(axis=1)), np.array([row[3] for row in rows]),
        np.array([row[4] for row in rows], dtype=np.bool_),
    )  # fmt: skip


def _cut_track(track: Track) -> Iterator[tuple[FloatArray, FloatArray, float]]:
    """Cut a track into windows: features, speeds [33] and change of course [rad] of each."""
    if abs(track.step - STEP) > 1e-6 or len(track.xy) < SPAN + 3 + 2 * TRIMMED:
        return
    xy = smooth(track.xy, SMOOTHING)
    velocity = (xy[2:] - xy[:-2]) / (2 * STEP)
    velocity = velocity[TRIMMED - 1 : len(velocity) - TRIMMED + 1]
    for first in range(0, len(velocity) - SPAN, SPAN // 2):
        yield _compute_features(velocity[first : first + SPAN + 1])


def _compute_features(velocity: FloatArray) -> tuple[FloatArray, FloatArray, float]:
    """Compute features of a window of velocities [33, 2]; its course is 0 at the middle."""
    speed = np.hypot(*velocity.T)
    moving = speed > _STANDS
    course = np.unwrap(np.arctan2(velocity[:, 1], velocity[:, 0]))
    course = np.where(moving, course - course[len(course) // 2], 0.0)
    acceleration = np.gradient(speed, STEP)
    turning = np.where(moving, np.gradient(course, STEP), 0.0)
    turned = float(np.ptp(course[moving])) if moving.any() else 0.0
    features = [speed[::EVERY], acceleration[::EVERY], np.abs(turning[::EVERY]), [
        speed.std(), np.ptp(speed), acceleration.std(), acceleration.min(), acceleration.max(),
        np.gradient(acceleration, STEP).std(), turning.std(), turned,
        np.abs(np.diff(acceleration)).max(),
    ]]  # fmt: skip
    return np.concatenate([np.asarray(each) for each in features]), speed, turned


def classify_motion(velocity: FloatArray, kind: AgentClass) -> str:
    """Classify what an agent with velocities [N, 2] every 0.1 s does, as windows are matched."""
    _, speed, turned = _compute_features(velocity)
    return _classify_situation(speed, turned, kind)


def _classify_situation(speed: FloatArray, turned: float, kind: AgentClass) -> str:
    change = float(speed[-1] - speed[0])
    if speed.min() <= _STANDS:
        return "sets off" if change > 0 else "comes to stand"
    if turned > _TURNS:
        return "turns"
    if abs(change) > _CHANGES.get(kind, 1.0):
        return "speeds up" if change > 0 else "slows down"
    return "goes on"


def find_constant_speed(windows: Windows) -> list[bool]:
    """Return for each moving window whether its first 3 s keep one speed within 0.05 m/s."""
    speed = windows.speed[:, :31]
    return [bool(np.ptp(row) <= 0.1) for row in speed[speed.min(axis=1) > _STANDS]]
