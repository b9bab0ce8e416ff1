"""One road user's track with everything that is derived from it (SEMANTICS section 5).

All derivatives are taken on a grid of 0.1 s. Velocity is the central difference of positions, speed
its length; acceleration is the central difference of speed, averaged over three samples (0.3 s). At
the ends, where a central difference does not exist, velocity is the one-sided difference, and the
last three samples hold the acceleration over the 0.2 s nearest to the end.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field, fields
from functools import cached_property, lru_cache

import numpy as np

from scenewright.compiled import compiled
from scenewright.errors import InputError
from scenewright.scene.base import AgentClass, FloatArray
from scenewright.scene.track import STEP, Shape, Track
from scenewright.tools.relation_checker.footprints import BoolArray, IntArray
from scenewright.tools.relation_checker.track_path import (
    LaneTable,
    TrackPath,
    build_path,
    prolong_paths,
    unwrap_angles,
)

ON_GRID = 1e-4
"""Samples this near to a time of the grid [s] are on it."""
FULL_WINDOW = 3
"""Samples at either end of a track that have no full window for the acceleration."""

FARTHEST = 1e8
"""Positions [m] and headings beyond this are refused."""
LONGEST = 5e6
"""Tracks that are longer than this together [m] are refused: paths are kept every 0.5 m."""


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
class Trajectory:
    """A road user on the 0.1 s grid, with its kinematics.

    Attributes:
        is_vehicle: whether it is on wheels, so that its footprint is a rectangle; else a disc.
        is_rider: a cyclist or the rider of a scooter.
        half_length, half_width: of the rectangle [m]; 0 for pedestrians.
        radius: of the disc [m]; 0 for vehicles.
        nose: distance from the centre to the foremost point [m].
        reach: radius of the circle round the footprint [m].
        start: time of the first sample [s], a multiple of 0.1 but for the offset of the grid.
        xy: [T, 2] positions [m]; heading: [T], unwrapped [rad].
        steps: [T-1] distance between successive samples [m].
        s: [T] arc length driven since the first sample [m].
        velocity: [T, 2] by central differences [m/s]; speed: [T] its length.
        acceleration: [T] rate of change of speed [m/s^2], negative when braking.
        lateral_acceleration: [T] across the direction of motion, v^2 times curvature, >= 0.
        bounds: west, south, east and north end of the positions [m].
    """

    id: int
    type: AgentClass
    length: float
    width: float
    start: float
    xy: FloatArray
    heading: FloatArray
    is_vehicle: bool = field(init=False)
    is_rider: bool = field(init=False)
    half_length: float = field(init=False)
    half_width: float = field(init=False)
    radius: float = field(init=False)
    nose: float = field(init=False)
    reach: float = field(init=False)
    steps: FloatArray = field(init=False)
    s: FloatArray = field(init=False)
    velocity: FloatArray = field(init=False)
    speed: FloatArray = field(init=False)
    acceleration: FloatArray = field(init=False)
    lateral_acceleration: FloatArray = field(init=False)
    bounds: tuple[float, float, float, float] = field(init=False)

    def __post_init__(self) -> None:
        drives = self.type != "pedestrian"
        length, width = (self.length / 2, self.width / 2) if drives else (0.0, 0.0)
        radius = 0.0 if drives else self.width / 2
        xy, heading = (np.ascontiguousarray(each, np.float64) for each in (self.xy, self.heading))
        values = (
            xy, heading, drives, self.type in ("cyclist", "scooter"), length, width, radius,
            length + radius, float(np.hypot(length, width)) + radius, *_derive_motion(xy),
        )  # fmt: skip
        for name, value in zip(("xy", "heading", *_DERIVED), values, strict=True):
            object.__setattr__(self, name, value)

    def __len__(self) -> int:
        return len(self.xy)

    @property
    def box(self) -> tuple[float, float, float]:
        """Half length, half width and radius of the footprint [m]."""
        return self.half_length, self.half_width, self.radius

    @cached_property
    def times(self) -> FloatArray:
        """[T] sample times [s]."""
        return np.asarray(self.start + STEP * np.arange(len(self.xy)), dtype=np.float64)

    @cached_property
    def end(self) -> float:
        """Time of the last sample [s]."""
        return self.start + STEP * (len(self.xy) - 1)

    @cached_property
    def path(self) -> TrackPath:
        """The curve of the whole track."""
        return build_path(self.xy, self.s, self.heading)

    def index(self, time: float) -> int:
        """The sample nearest to a time, within the track."""
        return min(max(round((time - self.start) / STEP), 0), len(self.xy) - 1)

    def find_indices(self, times: FloatArray) -> IntArray:
        """The samples nearest to times, within the track."""
        k = np.rint((times - self.start) / STEP).astype(np.intp)
        return np.asarray(np.minimum(np.maximum(k, 0), len(self.xy) - 1))

    def at(self, times: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Positions [..., 2] and headings [...] at times [s], linear in between, held outside."""
        xy, heading = interpolate_samples(times.ravel(), self.start, self.xy, self.heading)
        return xy.reshape(*times.shape, 2), heading.reshape(times.shape)


_DERIVED = tuple(each.name for each in fields(Trajectory) if not each.init)


@compiled
def interpolate_samples(
    times: FloatArray, start: float, xy: FloatArray, heading: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """`Trajectory.at` of samples from a start [s] on, for other machine code to call."""
    there, turned, last = np.empty((len(times), 2)), np.empty(len(times)), len(xy) - 1
    for n in range(len(times)):
        f = min(max((times[n] - start) / STEP, 0.0), float(last))
        low = min(int(f), max(last - 1, 0))
        high, part = min(low + 1, last), f - low
        there[n, 0] = xy[low, 0] + part * (xy[high, 0] - xy[low, 0])
        there[n, 1] = xy[low, 1] + part * (xy[high, 1] - xy[low, 1])
        turned[n] = heading[low] + part * (heading[high] - heading[low])
    return there, turned


def find_runs(holds: BoolArray) -> IntArray:
    """[R, 2] the first sample of every stretch in which something holds, and the first after it."""
    edges = np.flatnonzero(np.diff(holds, prepend=False, append=False))
    return np.asarray(edges.reshape(-1, 2))


def find_first_lasting(holds: BoolArray, *, least: float) -> int | None:
    """First sample from which something holds for a time [s]; None if it never does."""
    runs = find_runs(holds)
    lasting = runs[runs[:, 1] - runs[:, 0] > round(least / STEP)]
    return int(lasting[0, 0]) if len(lasting) else None


def concatenate_samples(tracks: Sequence[Trajectory]) -> tuple[FloatArray, FloatArray, IntArray]:
    """All movers' samples one after another, and where each mover's begin; not to be written to.

    Returns:
        xy [S, 2] [m]; heading [S] [rad]; origin [N+1], the last entry being S.
    """
    return _concatenate_samples(tuple(tracks))


@lru_cache(maxsize=4)
def _concatenate_samples(tracks: tuple[Trajectory, ...]) -> tuple[FloatArray, FloatArray, IntArray]:
    """Every measure asks for the same few; movers are known by identity."""
    xy = np.concatenate([np.zeros((0, 2)), *(m.xy for m in tracks)])
    heading = np.concatenate([np.zeros(0), *(m.heading for m in tracks)])
    return xy, heading, np.cumsum([0, *(len(m.xy) for m in tracks)])


@lru_cache(maxsize=1)
def get_lane_table(tracks: tuple[Trajectory, ...]) -> LaneTable:
    """The lanes of all movers, for many projections at once; movers are known by identity."""
    paths = [m.path for m in tracks]
    s, xy, direction = (
        np.concatenate([getattr(path, name) for path in paths]) for name in ("s", "xy", "direction")
    )
    origin = np.cumsum([0, *(len(path.s) for path in paths)])
    movers = (np.array([getattr(m, name) for m in tracks]) for name in LaneTable._fields[-3:])
    return LaneTable(*prolong_paths(s, xy, direction, origin), *movers)


Bounds = tuple[float, float, float, float]


@compiled
def _derive_motion(
    xy: FloatArray,
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray, FloatArray, Bounds]:
    """What `Trajectory` derives from positions, from `steps` to `bounds`."""
    count = len(xy)
    steps, s, speed, velocity = (
        np.empty(count - 1),
        np.zeros(count),
        np.empty(count),
        np.empty(xy.shape),
    )
    acceleration, lateral = np.empty(count), np.empty(count)
    low_x, low_y, high_x, high_y = xy[0, 0], xy[0, 1], xy[0, 0], xy[0, 1]
    for k in range(count):
        velocity[k, 0], velocity[k, 1] = _differentiate(xy[:, 0], k), _differentiate(xy[:, 1], k)
        speed[k] = np.hypot(velocity[k, 0], velocity[k, 1])
        if k > 0:
            steps[k - 1] = np.hypot(xy[k, 0] - xy[k - 1, 0], xy[k, 1] - xy[k - 1, 1])
            s[k] = s[k - 1] + steps[k - 1]
        low_x, high_x = min(low_x, xy[k, 0]), max(high_x, xy[k, 0])
        low_y, high_y = min(low_y, xy[k, 1]), max(high_y, xy[k, 1])
    for k in range(count):
        acceleration[k] = _differentiate_smoothly(speed, k)
        push_x = _differentiate_smoothly(velocity[:, 0], k)
        push_y = _differentiate_smoothly(velocity[:, 1], k)
        across = velocity[k, 0] * push_y - velocity[k, 1] * push_x
        lateral[k] = abs(across) / max(speed[k], 0.1)
    return steps, s, velocity, speed, acceleration, lateral, (low_x, low_y, high_x, high_y)


@compiled
def _differentiate(values: FloatArray, k: int) -> float:
    """Derivative of samples 0.1 s apart: (x[k+1] - x[k-1]) / 0.2 s; one-sided at the ends."""
    last = len(values) - 1
    if 0 < k < last:
        return float((values[k + 1] - values[k - 1]) / (2 * STEP))
    return float((values[min(k + 1, last)] - values[max(k - 1, 0)]) / STEP)


@compiled
def _differentiate_smoothly(values: FloatArray, k: int) -> float:
    """Central difference averaged over 0.3 s.

    The three samples at either end, which have no full window, hold the central difference of the
    third: that over the 0.2 s nearest to the end. Tracks of fewer than 7 samples have no full
    window and are not averaged; those of fewer than 3 have derivative 0.
    """
    count = len(values)
    if count <= 2 * FULL_WINDOW:
        return _differentiate(values, k) if count >= 3 else 0.0
    if k < FULL_WINDOW:
        return _differentiate(values, FULL_WINDOW - 1)
    if k >= count - FULL_WINDOW:
        return _differentiate(values, count - FULL_WINDOW)
    return (
        _differentiate(values, k - 1) + _differentiate(values, k) + _differentiate(values, k + 1)
    ) / 3


def extend_straight(track: Trajectory, *, distance: float, speed: float) -> Trajectory:
    """The same mover, driving on straight ahead after its last sample."""
    count = int(np.ceil(distance / (speed * STEP)))
    ahead = np.array((np.cos(track.heading[-1]), np.sin(track.heading[-1])))
    more = track.xy[-1] + speed * STEP * np.arange(1, count + 1)[:, None] * ahead
    return Trajectory(
        track.id, track.type, track.length, track.width, track.start,
        np.concatenate((track.xy, more)),
        np.concatenate((track.heading, np.full(count, track.heading[-1]))),
    )  # fmt: skip


def build_trajectory(user: RoadUser, *, offset: float = 0.0) -> Trajectory:
    """The road user on the common 0.1 s grid, which begins `offset` seconds after 0.

    Tracks already on the grid are taken as they are; finer ones are interpolated linearly, coarser
    ones by cubic Hermite splines through the samples. Ends that lie between two times of the grid
    are continued straight on to the next of them, so that nothing of a track is lost.
    """
    track, shape, heading = user.track, user.shape, unwrap_angles(user.track.heading)
    first, xy = round((track.start - offset) / STEP), track.xy
    even = abs(track.step - STEP) < 1e-9 and abs(track.start - offset - first * STEP) < ON_GRID
    if not even:
        first = math.floor((track.start - offset + ON_GRID) / STEP)
        last = math.ceil((track.end - offset - ON_GRID) / STEP)
        times, grid = offset + STEP * np.arange(first, max(last, first) + 1), np.arange(len(xy))
        wanted = (times - track.start) / track.step
        position = np.minimum(np.maximum(wanted, 0.0), len(heading) - 1.0)
        if track.step > STEP and len(xy) > 2:
            slope, low = np.gradient(xy, axis=0), np.minimum(position.astype(np.intp), len(xy) - 2)
            u = (position - low)[:, None]
            xy = np.asarray(
                (1 + 2 * u) * (1 - u) ** 2 * xy[low] + u * (1 - u) ** 2 * slope[low]
                + u**2 * (3 - 2 * u) * xy[low + 1] + u**2 * (u - 1) * slope[low + 1]
            )  # fmt: skip
        else:
            xy = np.stack([np.interp(position, grid, xy[:, k]) for k in (0, 1)], axis=1)
        for k, edge in ((0, slice(0, 2)), (-1, slice(-2, None))) if len(heading) > 1 else ():
            xy[k] += (wanted[k] - position[k]) * np.diff(track.xy[edge], axis=0)[0]
        heading = np.interp(position, grid, heading)
    start = offset + first * STEP
    return Trajectory(user.id, shape.type, shape.length, shape.width, start, xy, heading)


def build_trajectories(users: tuple[RoadUser, ...] | list[RoadUser]) -> tuple[Trajectory, ...]:
    """All road users on the common grid.

    Raises:
        InputError: an id twice, an empty track, a step or a size that is not positive, or positions
            that are no metres.
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
    # Where between two multiples of 0.1 s most tracks of that step have their samples [s]: so
    # tracks that all begin at, say, 0.037 s are taken as they are, not interpolated.
    even = (u.track.start for u in users if abs(u.track.step - STEP) < 1e-9)
    found = Counter(round(start % STEP, 4) % STEP for start in even)
    offset = max(found, key=lambda each: (found[each], -each), default=0.0)
    tracks = tuple(build_trajectory(user, offset=offset) for user in users)
    longest = max(tracks, key=lambda track: float(track.s[-1]), default=None)
    if longest is not None and sum(float(track.s[-1]) for track in tracks) > LONGEST:
        raise InputError(
            f"agent {longest.id}: its track is {longest.s[-1] / 1000:.4g} km long; tracks may be "
            f"{LONGEST / 1000:g} km together, and positions are metres"
        )
    return tracks
