"""How an agent moves along its path: time laws inside the limits of SEMANTICS section 5.

A cubic spline in *time* overshoots and reverses; here the path is a spline (paper Eq. 3) and time
gets a law of its own. Over w = v^2 the limits are linear in arc length, so that one forward and
one backward running minimum give the fastest motion within them:

    w' <= w + 2 a ds,   w <= w' + 2 b ds,   w <= a_lat / |curvature|,   w = 0 at a hold.

Between nodes the acceleration is constant, so times and positions are exact. The motion is then
smoothed by a short symmetric kernel in time, which bounds jerk, keeps every standstill longer
than the kernel where it was, and leaves constant speed alone.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from scenewright.scene.base import FloatArray, frozen
from scenewright.scene.candidates import Candidate, Path, TimeLaw
from scenewright.scene.selection import Slowing
from scenewright.scene.track import STEP, Track

_KERNEL = np.convolve(np.ones(5), np.ones(5)) / 25.0
"""Triangular smoothing over 0.8 s at the output step."""

_HALF = len(_KERNEL) // 2
_BEYOND = np.arange(1, _HALF + 1)
"""Steps by which either end goes straight on to be smoothed."""

_CREEP = 0.05
"""Least speed between nodes [m/s]; keeps travel times finite next to a hold."""


@dataclass(frozen=True)
class Hold:
    """A standstill: the centre stays at arc length `s` [m] until `release`.

    Attributes:
        release: [s], in the time frame of whoever uses it (local or scene time).
        braking: deceleration towards it [m/s^2]; None = as comfortable as the time law says.
        speed: driven there [m/s]; above 0 nobody stands, and `release` says nothing.
    """

    s: float
    release: float
    braking: float | None = None
    speed: float = 0.0


@dataclass(frozen=True, eq=False)
class Motion:
    """Arc length over time: a candidate (or an edit of it) in motion.

    Attributes:
        candidate: whose path it travels.
        s: [T] arc length of the centre [m] every 0.1 s since it entered the map, never falling.
        ended: the agent stays where its motion ends (a wreck); else it has left the map.
    """

    candidate: Candidate
    s: FloatArray
    ended: bool = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "s", frozen(self.s))

    @property
    def path(self) -> Path:
        """The path travelled."""
        return self.candidate.path

    @property
    def speed(self) -> FloatArray:
        """[T] speed along the path [m/s]."""
        return np.gradient(self.s, STEP) if len(self.s) > 1 else np.zeros(1)

    def time_at(self, s: float) -> float:
        """First time [s, local] at which the centre is at arc length `s`; inf if it never is."""
        index = int(self.s.searchsorted(s - 1e-9))
        if index >= len(self.s):
            return float("inf")
        if index == 0:
            return 0.0
        low, high = self.s[index - 1 : index + 1].tolist()
        return STEP * (index - 1 + float((s - low) / max(high - low, 1e-9)))

    def position(self, times: FloatArray) -> FloatArray:
        """Arc length [m] at local times [s]; held at both ends."""
        return np.interp(times, STEP * np.arange(len(self.s)), self.s)

    def cut(self, steps: int) -> Motion:
        """The motion up to sample `steps`, where the agent then stays (Terminate)."""
        return replace(self, s=self.s[: steps + 1], ended=True)


def speed_limit(path: Path, law: TimeLaw) -> FloatArray:
    """[P] squared free speed: the law's speed, less in curves, reached with its own rates."""
    lateral = law.lateral / np.maximum(np.abs(path.curvature), 1e-6)
    ceiling = np.minimum(law.speed**2, lateral)
    return _reach(path.s, ceiling, accelerate=law.acceleration, brake=law.braking)


def move(
    candidate: Candidate, *, holds: tuple[Hold, ...] = (), slowings: tuple[Slowing, ...] = ()
) -> Motion:
    """The candidate in motion; hold releases are in local time (0 = enters the map)."""
    return _moved(
        candidate,
        tuple(Hold(h.s, round(h.release, 6), h.braking, h.speed) for h in holds),
        slowings,
    )


@lru_cache(maxsize=1024)
def _moved(candidate: Candidate, holds: tuple[Hold, ...], slowings: tuple[Slowing, ...]) -> Motion:
    """Solver, summary and editor ask for the same motions; candidates are known by identity."""
    ordered = sorted((hold for hold in holds if hold.s < candidate.path.length), key=_at)
    drive = _drive(candidate, _unreleased(ordered), slowings)
    times = drive.times
    for hold in ordered:
        times = _dwell(drive.s, times, hold)
    return Motion(candidate, _smooth(_sample(drive, times)))


def arrival(candidate: Candidate, hold: Hold, earlier: tuple[Hold, ...] = ()) -> float:
    """Local time [s] at which the candidate comes to a standstill at `hold`."""
    ordered = sorted((*earlier, hold), key=_at)
    drive = _drive(candidate, _unreleased(ordered), ())
    times = drive.times
    for each in ordered:
        if each.s < hold.s:
            times = _dwell(drive.s, times, each)
    return float(times[drive.s.searchsorted(hold.s - 1e-9)])


def track_of(motion: Motion, *, enters: float, until: float) -> Track | None:
    """The motion as a track of scene time, cut to [0, until]; None if nothing of it remains.

    Args:
        enters: scene time [s] of local time 0; a multiple of the output step, may be negative.
        until: end of the scene [s].
    """
    first = max(0, round(-enters / STEP))
    last = min(len(motion.s) - 1, round((until - enters) / STEP))
    if last - first < 1:
        return None
    s = motion.s[first : last + 1]
    path = motion.path
    xy = np.empty((len(s), 2))
    xy[:, 0], xy[:, 1] = (np.interp(s, path.s, path.xy[:, axis]) for axis in (0, 1))
    heading = np.interp(s, path.s, path.heading)
    return Track(xy=xy.round(3), heading=heading, start=round(enters + first * STEP, 1))


def _at(hold: Hold) -> float:
    return hold.s


def _unreleased(holds: list[Hold]) -> tuple[Hold, ...]:
    """The holds without the times of their release, which leave the driving between them alone."""
    return tuple(Hold(hold.s, 0.0, hold.braking, hold.speed) for hold in holds)


@dataclass(frozen=True, eq=False)
class _Drive:
    """A motion but for how long it dwells.

    Attributes:
        s: [N] nodes [m]; v: [N] speed there [m/s]; times: [N] when it is there without dwelling.
        way: [N - 1] from each node to the next [m]; took: the time that takes [s].
        rise: [N - 1] half the acceleration on the way [m/s^2].
    """

    s: FloatArray
    v: FloatArray
    times: FloatArray
    way: FloatArray
    took: FloatArray
    rise: FloatArray


@lru_cache(maxsize=256)
def _drive(candidate: Candidate, holds: tuple[Hold, ...], slowings: tuple[Slowing, ...]) -> _Drive:
    """The drive between holds: where one comes to stand is asked before until when."""
    s, w = _profile(candidate, holds, slowings)
    v, way = np.sqrt(w), s[1:] - s[:-1]
    took = 2.0 * way / np.maximum(v[:-1] + v[1:], 2 * _CREEP)
    times = np.zeros(len(s))
    np.add.accumulate(took, out=times[1:])
    return _Drive(s, v, times, way, took, 0.5 * (v[1:] - v[:-1]) / took)


@lru_cache(maxsize=1024)
def _limit(candidate: Candidate) -> FloatArray:
    return frozen(speed_limit(candidate.path, candidate.time_law))


def _profile(
    candidate: Candidate, holds: tuple[Hold, ...], slowings: tuple[Slowing, ...]
) -> tuple[FloatArray, FloatArray]:
    """Nodes [m] and squared speeds there, every hold and slowing on a node of its own."""
    path, law = candidate.path, candidate.time_law
    extra = [hold.s for hold in holds] + [slow.s for slow in slowings]
    if not extra:
        return path.s, _limit(candidate)
    s = _with_nodes(path.s, extra)
    w = np.interp(s, path.s, _limit(candidate))
    for hold in holds:
        w = _approach(s, w, at=hold.s, speed=hold.speed, braking=hold.braking or law.braking)
    for slow in slowings:
        w = _approach(s, w, at=slow.s, speed=slow.speed, braking=slow.braking)
    return s, _forward(s, w, law.acceleration)


def _with_nodes(s: FloatArray, extra: list[float]) -> FloatArray:
    """Ascending nodes [m] with further ones among them, none twice."""
    last = float(s[-1])
    every = np.concatenate([s, [min(max(each, 0.0), last) for each in extra]])
    every.sort()
    new = np.ones(len(every), dtype=np.bool_)
    np.not_equal(every[1:], every[:-1], out=new[1:])
    return np.asarray(every[new])


def _approach(
    s: FloatArray, w: FloatArray, *, at: float, speed: float, braking: float
) -> FloatArray:
    before, w = int(s.searchsorted(at + 1e-9, side="right")), w.copy()
    np.minimum(w[:before], speed**2 + 2.0 * braking * (at - s[:before]), out=w[:before])
    return w


def _reach(s: FloatArray, ceiling: FloatArray, *, accelerate: float, brake: float) -> FloatArray:
    back = np.minimum.accumulate((ceiling + 2.0 * brake * s)[::-1])[::-1] - 2.0 * brake * s
    return _forward(s, back, accelerate)


def _forward(s: FloatArray, w: FloatArray, acceleration: float) -> FloatArray:
    reached = np.minimum.accumulate(w - 2.0 * acceleration * s) + 2.0 * acceleration * s
    return np.maximum(reached, 0.0)


def _dwell(s: FloatArray, times: FloatArray, hold: Hold) -> FloatArray:
    if hold.speed > 0.0:
        return times
    node = int(s.searchsorted(hold.s - 1e-9))
    later = times.copy()
    later[node + 1 :] += max(0.0, hold.release - float(times[node]))
    return later


def _sample(drive: _Drive, times: FloatArray) -> FloatArray:
    """Arc length every 0.1 s; constant acceleration between nodes, standstill while dwelling.

    Args:
        times: [N] when it leaves each node [s].
    """
    grid = STEP * np.arange(int(times[-1] / STEP + 1e-9) + 1)
    cell = np.minimum(times.searchsorted(grid, side="right") - 1, len(drive.way) - 1)
    # A dwell sits at the start of its cell: the cell's own travel comes last.
    tau = np.maximum(grid - (times[1:] - drive.took)[cell], 0.0)
    within = (drive.v[cell] + drive.rise[cell] * tau) * tau
    within = np.minimum(np.maximum(within, 0.0), drive.way[cell])
    return np.asarray(np.maximum.accumulate(drive.s[cell] + within))


def _smooth(s: FloatArray) -> FloatArray:
    if len(s) < 2 * _HALF + 2:
        return s
    padded = np.empty(len(s) + 2 * _HALF)
    padded[:_HALF] = s[0] - (s[1] - s[0]) * _BEYOND[::-1]
    padded[_HALF:-_HALF] = s
    padded[-_HALF:] = s[-1] + (s[-1] - s[-2]) * _BEYOND
    return np.convolve(padded, _KERNEL, mode="valid")
