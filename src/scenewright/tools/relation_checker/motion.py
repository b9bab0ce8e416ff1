"""One road user's track with everything that is derived from it (SEMANTICS section 5).

All derivatives are taken on a grid of 0.1 s. Velocity is the central difference of positions, speed
its length; acceleration is the central difference of speed, averaged over three samples (0.3 s). At
the ends, where a central difference does not exist, velocity is the one-sided difference and
acceleration holds the nearest value that has a full window.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from scenewright.errors import InputError
from scenewright.scene.base import AgentClass, FloatArray
from scenewright.scene.track import STEP, Shape, Track
from scenewright.tools.relation_checker.curve import Path, curve

IntArray = np.ndarray[tuple[int, ...], np.dtype[np.intp]]


@dataclass(frozen=True, eq=False)
class RoadUser:
    """One agent of any origin: a scene, a log, another simulator.

    Attributes:
        id: unique among the agents checked together.
        track: centre positions and headings.
        shape: class and size.
    """

    id: int
    track: Track
    shape: Shape


@dataclass(frozen=True, eq=False)
class Mover:
    """A road user on the 0.1 s grid, with its kinematics.

    Attributes:
        half_length, half_width: of the rectangle [m]; 0 for pedestrians.
        radius: of the disc [m]; 0 for vehicles.
        start: time of the first sample [s], a multiple of 0.1.
        xy: [T, 2] positions [m]; heading: [T], unwrapped [rad].
        s: [T] arc length driven since the first sample [m].
        velocity: [T, 2] [m/s]; speed: [T].
        acceleration: [T] rate of change of speed [m/s^2], negative when braking.
    """

    id: int
    type: AgentClass
    length: float
    width: float
    start: float
    xy: FloatArray
    heading: FloatArray

    def __len__(self) -> int:
        return len(self.xy)

    @property
    def is_vehicle(self) -> bool:
        """Whether the footprint is a rectangle."""
        return self.type == "vehicle"

    @property
    def half_length(self) -> float:
        """Half the rectangle's length [m]; 0 for a disc."""
        return self.length / 2 if self.is_vehicle else 0.0

    @property
    def half_width(self) -> float:
        """Half the rectangle's width [m]; 0 for a disc."""
        return self.width / 2 if self.is_vehicle else 0.0

    @property
    def radius(self) -> float:
        """Radius of the disc [m]; 0 for a rectangle."""
        return 0.0 if self.is_vehicle else self.width / 2

    @property
    def nose(self) -> float:
        """Distance from the centre to the foremost point [m]."""
        return self.half_length + self.radius

    @cached_property
    def reach(self) -> float:
        """Radius of the circle round the footprint [m]."""
        return float(np.hypot(self.half_length, self.half_width)) + self.radius

    @cached_property
    def times(self) -> FloatArray:
        """[T] sample times [s]."""
        return np.asarray(self.start + STEP * np.arange(len(self.xy)), dtype=np.float64)

    @property
    def end(self) -> float:
        """Time of the last sample [s]."""
        return self.start + STEP * (len(self.xy) - 1)

    @cached_property
    def steps(self) -> FloatArray:
        """[T-1] distance between successive samples [m]."""
        delta = np.diff(self.xy, axis=0)
        return np.hypot(delta[:, 0], delta[:, 1])

    @cached_property
    def s(self) -> FloatArray:
        """[T] arc length since the first sample [m]."""
        return np.append(0.0, np.cumsum(self.steps))

    @cached_property
    def velocity(self) -> FloatArray:
        """[T, 2] velocity by central differences [m/s]."""
        return central_difference(self.xy)

    @cached_property
    def speed(self) -> FloatArray:
        """[T] length of the velocity [m/s]."""
        return np.hypot(self.velocity[:, 0], self.velocity[:, 1])

    @cached_property
    def acceleration(self) -> FloatArray:
        """[T] rate of change of speed [m/s^2]."""
        return windowed_derivative(self.speed)

    @cached_property
    def lateral_acceleration(self) -> FloatArray:
        """[T] acceleration across the direction of motion, v^2 times curvature [m/s^2], >= 0."""
        push = windowed_derivative(self.velocity)
        across = self.velocity[:, 0] * push[:, 1] - self.velocity[:, 1] * push[:, 0]
        return np.abs(across) / np.maximum(self.speed, 0.1)

    @cached_property
    def path(self) -> Path:
        """The curve of the whole track."""
        return curve(self.xy, self.s, self.heading)

    @cached_property
    def lane(self) -> Path:
        """The path every metre, with 15 m straight before and 25 m after it."""
        return self.path.extended(before=15.0, after=25.0).coarser()

    def index(self, time: float) -> int:
        """The sample nearest to a time, within the track."""
        return int(np.clip(round((time - self.start) / STEP), 0, len(self.xy) - 1))

    def indices(self, times: FloatArray) -> IntArray:
        """The samples nearest to times, within the track."""
        k = np.rint((times - self.start) / STEP).astype(np.intp)
        return np.asarray(np.clip(k, 0, len(self.xy) - 1))

    def at(self, times: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Positions [..., 2] and headings [...] at times [s], linear in between, held outside."""
        f = np.clip((times - self.start) / STEP, 0.0, len(self.xy) - 1.0)
        low = np.minimum(f.astype(np.intp), max(len(self.xy) - 2, 0))
        high = np.minimum(low + 1, len(self.xy) - 1)
        part = f - low
        xy = self.xy[low] + part[..., None] * (self.xy[high] - self.xy[low])
        return xy, self.heading[low] + part * (self.heading[high] - self.heading[low])


def central_difference(values: FloatArray) -> FloatArray:
    """Derivative of samples 0.1 s apart: (x[i+1] - x[i-1]) / 0.2 s; one-sided at the ends."""
    result = np.zeros_like(values)
    if len(values) > 1:
        result[1:-1] = (values[2:] - values[:-2]) / (2 * STEP)
        result[0] = (values[1] - values[0]) / STEP
        result[-1] = (values[-1] - values[-2]) / STEP
    return result


def windowed_derivative(values: FloatArray) -> FloatArray:
    """Central difference averaged over 0.3 s; ends hold the nearest value with a full window."""
    raw = central_difference(values)
    if len(values) < 7:
        return raw if len(values) >= 3 else np.zeros_like(values)
    mean = (raw[2:-4] + raw[3:-3] + raw[4:-2]) / 3
    return np.concatenate((np.repeat(mean[:1], 3, axis=0), mean, np.repeat(mean[-1:], 3, axis=0)))


def extended(mover: Mover, *, distance: float, speed: float) -> Mover:
    """The same mover, driving on straight ahead after its last sample."""
    count = int(np.ceil(distance / (speed * STEP)))
    ahead = np.array((np.cos(mover.heading[-1]), np.sin(mover.heading[-1])))
    more = mover.xy[-1] + speed * STEP * np.arange(1, count + 1)[:, None] * ahead
    return Mover(
        mover.id, mover.type, mover.length, mover.width, mover.start,
        np.concatenate((mover.xy, more)),
        np.concatenate((mover.heading, np.full(count, mover.heading[-1]))),
    )  # fmt: skip


def as_mover(user: RoadUser) -> Mover:
    """The road user on the common 0.1 s grid.

    Tracks already on the grid are taken as they are; finer ones are interpolated linearly, coarser
    ones by cubic Hermite splines through the samples.
    """
    track, heading = user.track, np.unwrap(user.track.heading)
    first = round(track.start / STEP)
    if abs(track.step - STEP) < 1e-9 and abs(track.start - first * STEP) < 1e-6:
        return _mover(user, first * STEP, track.xy, heading)
    count = max(round((track.end - first * STEP) / STEP), 0) + 1
    position = np.clip((first * STEP - track.start + STEP * np.arange(count)) / track.step, 0, None)
    position = np.minimum(position, len(heading) - 1)
    xy = _hermite(track.xy, position) if track.step > STEP else _linear(track.xy, position)
    return _mover(user, first * STEP, xy, np.interp(position, np.arange(len(heading)), heading))


def _mover(user: RoadUser, start: float, xy: FloatArray, heading: FloatArray) -> Mover:
    shape = user.shape
    return Mover(user.id, shape.type, shape.length, shape.width, start, xy, heading)


def _linear(xy: FloatArray, position: FloatArray) -> FloatArray:
    grid = np.arange(len(xy))
    return np.stack([np.interp(position, grid, xy[:, k]) for k in (0, 1)], axis=1)


def _hermite(xy: FloatArray, position: FloatArray) -> FloatArray:
    if len(xy) < 3:
        return _linear(xy, position)
    slope = np.gradient(xy, axis=0)
    low = np.minimum(position.astype(np.intp), len(xy) - 2)
    u = (position - low)[:, None]
    return np.asarray(
        (1 + 2 * u) * (1 - u) ** 2 * xy[low] + u * (1 - u) ** 2 * slope[low]
        + u**2 * (3 - 2 * u) * xy[low + 1] + u**2 * (u - 1) * slope[low + 1]
    )  # fmt: skip


def as_movers(users: tuple[RoadUser, ...] | list[RoadUser]) -> tuple[Mover, ...]:
    """All road users on the common grid.

    Raises:
        InputError: an id twice, an empty track, a step or a size that is not positive.
    """
    seen: set[int] = set()
    for user in users:
        if user.id in seen:
            raise InputError(f"agent id {user.id} occurs twice; ids must be unique")
        seen.add(user.id)
        if len(user.track.xy) == 0:
            raise InputError(f"agent {user.id} has an empty trajectory")
        if not (np.isfinite(user.track.step) and user.track.step > 0):
            raise InputError(f"agent {user.id}: time step {user.track.step} s must be positive")
        if not (0 < user.shape.length < 100 and 0 < user.shape.width < 100):
            raise InputError(
                f"agent {user.id}: size {user.shape.length} x {user.shape.width} m is not usable"
            )
    return tuple(as_mover(user) for user in users)
