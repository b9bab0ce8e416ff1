"""How an agent moves along its path: time laws inside the limits of SEMANTICS section 5.

A cubic spline in *time* overshoots and reverses; here the path is a spline (paper Eq. 3) and time
gets a law of its own. Over w = v^2 the limits are linear in arc length, so that one forward and
one backward running minimum give the fastest motion within them:

    w' <= w + 2 a ds,   w <= w' + 2 b ds,   w <= a_lat / |curvature|,   w = 0 at a hold.

Drivers are slowest before the middle of a bend, and speed up through it: recorded turns of 60 to
120 degrees (VTP-TL, K733) have their lowest speed 1.3 to 2 s before they have turned by half. So
the bend to come counts early.

Between nodes the acceleration is constant, so times and positions are exact. The motion is then
smoothed by a short symmetric kernel in time, which bounds jerk, keeps every standstill longer
than the kernel where it was, and leaves constant speed alone.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from operator import itemgetter

import numpy as np

from scenewright.compiled import compiled, compiled_to_write
from scenewright.geometry.spline import sample_poses
from scenewright.scene.base import FloatArray, frozen
from scenewright.scene.candidates import PACE_STEP, Candidate, DrivingProfile, Path
from scenewright.scene.selection import Slowing
from scenewright.scene.track import STEP, Track

_KERNEL = np.convolve(np.ones(5), np.ones(5)) / 25.0
"""Triangular smoothing over 0.8 s at the output step."""

_HALF = len(_KERNEL) // 2

_TIGHTER = 0.3
"""By which share of what it is tighter than here a bend ahead counts as tighter than it is."""

_BEND = 1 / 40.0
"""Only what is tighter [1/m] is a bend to slow down for early, and not how a lane sways."""

_CREEP = 0.05
"""Least speed between nodes [m/s]; keeps travel times finite next to a hold."""


@dataclass(frozen=True)
class StopCommand:
    """A standstill: the centre stays at arc length `s` [m] until `release`.

    Attributes:
        release: [s], in local or scene time, as its user has it.
        braking: deceleration towards it [m/s^2]; None = as comfortable as the time law says.
        speed: driven there [m/s]; above 0 it is no stop, and `release` has no meaning.
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

    @cached_property
    def speed(self) -> FloatArray:
        """[T] speed along the path [m/s]."""
        return _differentiate(self.s)

    @cached_property
    def acceleration(self) -> FloatArray:
        """[T] acceleration along the path [m/s^2]."""
        return _differentiate(self.speed)

    @cached_property
    def clock(self) -> FloatArray:
        """[T] local time of the samples [s]."""
        return STEP * np.arange(len(self.s), dtype=np.float64)

    def find_time_at(self, s: float) -> float:
        """First time [s, local] at which the centre is at arc length `s`; inf if it never is."""
        return find_time_at_place(self.s, s)

    def compute_positions(self, times: FloatArray) -> FloatArray:
        """Arc length [m] at local times [s]; held at both ends."""
        return np.interp(times, self.clock, self.s)

    def find_speed_at(self, time: float) -> float:
        """Speed [m/s] at a local time [s]; held at both ends."""
        return float(np.interp(time, self.clock, self.speed))

    def cut(self, steps: int) -> Motion:
        """The motion up to sample `steps`, where the agent then stays (Terminate)."""
        return replace(self, s=self.s[: steps + 1], ended=True)


def _differentiate(values: FloatArray) -> FloatArray:
    """[T] rate of values [T] every 0.1 s; as `np.gradient`, which takes ten times as long."""
    rate = np.zeros(len(values))
    if len(values) > 1:
        rate[1:-1] = (values[2:] - values[:-2]) / (2.0 * STEP)
        rate[0], rate[-1] = (values[1] - values[0]) / STEP, (values[-1] - values[-2]) / STEP
    return rate


def compute_motion(
    candidate: Candidate, *, holds: tuple[StopCommand, ...] = (), slowings: tuple[Slowing, ...] = ()
) -> Motion:
    """The candidate in motion; hold releases are in local time (0 = enters the map)."""
    return _compute_motion(
        candidate,
        tuple(StopCommand(h.s, round(h.release, 6), h.braking, h.speed) for h in holds),
        slowings,
    )


@lru_cache(maxsize=1024)
def _compute_motion(
    candidate: Candidate, holds: tuple[StopCommand, ...], slowings: tuple[Slowing, ...]
) -> Motion:
    """Solver, summary and editor ask for the same motions; candidates are known by identity."""
    law = candidate.time_law
    limit, held = compute_squared_speed_limit(candidate), _build_hold_table(holds, law)
    # As holds, but for the last column: how far the speed is kept [m].
    rows = [(slowing.s, 0.0, slowing.braking, slowing.speed, slowing.kept) for slowing in slowings]
    slow = np.array(rows) if rows else _NOWHERE
    s = compute_arc_lengths(candidate.path.s, limit, held, slow, law.acceleration)
    return Motion(candidate, s)


def compute_arrival(
    candidate: Candidate, hold: StopCommand, earlier: tuple[StopCommand, ...] = ()
) -> float:
    """Local time [s] at which the candidate comes to a standstill at `hold`."""
    law = candidate.time_law
    held = _build_hold_table((*earlier, hold), law)
    return find_hold_arrival(
        candidate.path.s, compute_squared_speed_limit(candidate), held, law.acceleration, hold.s
    )


@lru_cache(maxsize=1024)
def compute_squared_speed_limit(candidate: Candidate) -> FloatArray:
    """[P] squared free speed: the law's speed, less in curves, reached with its own rates."""
    path, law = candidate.path, candidate.time_law
    speeds = law.speed * get_pace(law, path.s)
    # A pedestrian turns within one step, so no bend needs slowing down in advance.
    foresight = 0.0 if candidate.route.type == "pedestrian" else law.foresight
    limit = limit_speed(
        path.s, path.curvature, speeds, law.lateral, law.acceleration, law.braking, foresight
    )
    return frozen(limit)  # cached, so it must be read-only


def get_pace(law: DrivingProfile, s: FloatArray) -> FloatArray:
    """[N] share of the free speed at arc lengths [m]."""
    if not law.pace:
        return np.ones(len(s))
    return np.interp(s / PACE_STEP, np.arange(len(law.pace)), law.pace)


def sample_track(motion: Motion, *, enters: float, until: float) -> Track | None:
    """The motion as a track of scene time, cut to [0, until]; None if nothing of it remains.

    Args:
        enters: scene time [s] of local time 0; a multiple of the output step, may be negative.
        until: end of the scene [s].
    """
    first = max(0, round(-enters / STEP))
    last = min(len(motion.s) - 1, round((until - enters) / STEP))
    if last - first < 1:
        return None
    poses = sample_poses(motion.path, motion.s[first : last + 1])
    start = round(enters + first * STEP, 1)
    return Track(xy=poses[:, :2].round(3), heading=poses[:, 2], start=start)


_NOWHERE = np.empty((0, 5))


def _build_hold_table(holds: tuple[StopCommand, ...], law: DrivingProfile) -> FloatArray:
    """Build the [N, 5] table: place [m], release [s], braking [m/s^2], speed [m/s], 0; by place."""
    rows = [(h.s, h.release, h.braking or law.braking, h.speed, 0.0) for h in holds]
    return np.array(sorted(rows, key=itemgetter(0))) if rows else _NOWHERE


# ---- as machine code: arrays of arc lengths [m], squared speeds [m^2/s^2] and times [s] ----------


@compiled
def find_time_at_place(moved: FloatArray, s: float) -> float:
    """Find the first time [s] at which an arc length [m] is reached; inf if it never is."""
    index = np.searchsorted(moved, s - 1e-9)
    if index >= len(moved):
        return np.inf
    if index == 0:
        return 0.0
    low, high = moved[index - 1], moved[index]
    return float(STEP * (index - 1 + (s - low) / max(high - low, 1e-9)))


@compiled
def limit_speed(
    s: FloatArray,
    curvature: FloatArray,
    speeds: FloatArray,
    lateral: float,
    acceleration: float,
    braking: float,
    foresight: float,
) -> FloatArray:
    """Squared free speed at each node."""
    w = np.empty(len(s))
    least = np.inf
    for k in range(len(s) - 1, -1, -1):
        bend = abs(curvature[k])
        for ahead in range(k + 1, len(s)):
            if s[ahead] > s[k] + foresight:
                break
            tight = abs(curvature[ahead])
            if tight > _BEND:
                bend = max(bend, tight + _TIGHTER * (tight - abs(curvature[k])))
        ceiling = min(speeds[k] * speeds[k], lateral / max(bend, 1e-6))
        least = min(least, ceiling + 2.0 * braking * s[k])
        w[k] = least - 2.0 * braking * s[k]
    _reach_forward(s, w, acceleration)
    return w


@compiled_to_write
def _reach_forward(s: FloatArray, w: FloatArray, acceleration: float) -> None:
    """Takes from squared speeds what cannot be reached by accelerating."""
    least = np.inf
    for k in range(len(s)):
        least = min(least, w[k] - 2.0 * acceleration * s[k])
        w[k] = max(least + 2.0 * acceleration * s[k], 0.0)


@compiled
def compute_arc_lengths(
    nodes: FloatArray,
    limit: FloatArray,
    holds: FloatArray,
    slowings: FloatArray,
    acceleration: float,
) -> FloatArray:
    """Compute the arc length every 0.1 s; holds and slowings [N, 5], holds in order of place."""
    holds = holds[: _count_within(holds, nodes[-1])]
    s, w = _compute_profile(nodes, limit, holds, slowings, acceleration)
    v, times, took = _compute_times(s, w)
    for k in range(len(holds)):
        _delay_after_hold(s, times, holds[k])
    return _smooth(_sample(s, v, times, took))


@compiled
def find_hold_arrival(
    nodes: FloatArray, limit: FloatArray, holds: FloatArray, acceleration: float, at: float
) -> float:
    """Find when the agent stands at the hold at `at`, after those before it."""
    s, w = _compute_profile(nodes, limit, holds, holds[:0], acceleration)
    _, times, _ = _compute_times(s, w)
    for k in range(len(holds)):
        if holds[k, 0] < at:
            _delay_after_hold(s, times, holds[k])
    return float(times[np.searchsorted(s, at - 1e-9)])


@compiled
def _count_within(holds: FloatArray, length: float) -> int:
    """Count the holds that lie on the path."""
    count = 0
    while count < len(holds) and holds[count, 0] < length:
        count += 1
    return count


@compiled
def _compute_profile(
    nodes: FloatArray,
    limit: FloatArray,
    holds: FloatArray,
    slowings: FloatArray,
    acceleration: float,
) -> tuple[FloatArray, FloatArray]:
    """Compute nodes and squared speeds, every hold and slowing on a node of its own."""
    s, w = nodes, limit
    for places in (holds, slowings):
        for k in range(len(places)):
            s, w = _insert_node(s, w, places[k, 0])
            if places[k, 4] > 0.0:
                s, w = _insert_node(s, w, places[k, 0] + places[k, 4])
    if len(holds) + len(slowings) > 0:
        w = w.copy()
        for places in (holds, slowings):
            for k in range(len(places)):
                _slow_down(s, w, places[k])
        _reach_forward(s, w, acceleration)
    return s, w


@compiled
def _insert_node(s: FloatArray, w: FloatArray, at: float) -> tuple[FloatArray, FloatArray]:
    """Insert a node unless it is there already; w is interpolated linearly."""
    at = min(max(at, 0.0), s[-1])
    k = np.searchsorted(s, at)
    if s[k] == at:
        return s, w
    more, there = np.empty(len(s) + 1), np.empty(len(s) + 1)
    for n in range(len(s)):
        more[n + (n >= k)], there[n + (n >= k)] = s[n], w[n]
    slope = (w[k] - w[k - 1]) / (s[k] - s[k - 1])
    more[k], there[k] = at, slope * (at - s[k - 1]) + w[k - 1]
    return more, there


@compiled_to_write
def _slow_down(s: FloatArray, w: FloatArray, place: FloatArray) -> None:
    """Slow down in time for a speed at a place, and keep to it as far as it says."""
    at, braking, speed, kept = place[0], place[2], place[3], place[4]
    for k in range(len(s)):
        if s[k] > at + kept + 1e-9:
            break
        w[k] = min(w[k], speed * speed + 2.0 * braking * max(at - s[k], 0.0))


@compiled
def _compute_times(s: FloatArray, w: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Compute speeds and times at the nodes without dwelling, and the time between nodes."""
    v = np.sqrt(w)
    times, took = np.zeros(len(s)), np.empty(len(s) - 1)
    for k in range(len(took)):
        took[k] = 2.0 * (s[k + 1] - s[k]) / max(v[k] + v[k + 1], 2 * _CREEP)
        times[k + 1] = times[k] + took[k]
    return v, times, took


@compiled_to_write
def _delay_after_hold(s: FloatArray, times: FloatArray, hold: FloatArray) -> None:
    """Delay everything after a hold by its remaining time."""
    if hold[3] > 0.0:
        return
    node = np.searchsorted(s, hold[0] - 1e-9)
    wait = max(0.0, hold[1] - times[node])
    for k in range(node + 1, len(times)):
        times[k] += wait


@compiled
def _sample(s: FloatArray, v: FloatArray, times: FloatArray, took: FloatArray) -> FloatArray:
    """Arc length every 0.1 s; constant acceleration between nodes, standstill while dwelling."""
    out = np.empty(int(times[-1] / STEP + 1e-9) + 1)
    cell, furthest = 0, -np.inf
    for k in range(len(out)):
        while cell < len(took) - 1 and times[cell + 1] <= STEP * k:
            cell += 1
        # A dwell sits at the start of its cell: the cell's own travel comes last.
        tau = max(STEP * k - (times[cell + 1] - took[cell]), 0.0)
        half = 0.5 * (v[cell + 1] - v[cell]) / took[cell]
        within = min(max((v[cell] + half * tau) * tau, 0.0), s[cell + 1] - s[cell])
        furthest = max(furthest, s[cell] + within)
        out[k] = furthest
    return out


@compiled
def _smooth(s: FloatArray) -> FloatArray:
    """Weighed means over the kernel; beyond either end it goes straight on."""
    n = len(s)
    if n < 2 * _HALF + 2:
        return s
    out = np.zeros(n)
    for k in range(n):
        for j in range(-_HALF, _HALF + 1):
            at = k + j
            if at < 0:
                value = s[0] + (s[1] - s[0]) * at
            elif at >= n:
                value = s[-1] + (s[-1] - s[-2]) * (at - n + 1)
            else:
                value = s[at]
            out[k] += value * _KERNEL[j + _HALF]
    return out
