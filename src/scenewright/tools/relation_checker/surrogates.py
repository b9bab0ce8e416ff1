"""Surrogate measures of safety: path TTC, two-dimensional TTC, DRAC (SEMANTICS section 4).

Only path TTC decides anything (near misses); the others are reported beside it.
"""

from __future__ import annotations

import numpy as np

from scenewright.compiled import compiled
from scenewright.scene.base import FloatArray
from scenewright.tools.relation_checker.footprints import Box, Pose, compute_gap, make_pose
from scenewright.tools.relation_checker.track_path import sample_path
from scenewright.tools.relation_checker.trajectory import Trajectory

RESOLUTION = 0.1
PARTS = 20


def compute_path_ttc(
    first: Trajectory, second: Trajectory, *, times: FloatArray, horizon: float = 5.0
) -> FloatArray:
    """Time to contact if both keep their present speed along their own paths.

    Paths go on straight beyond the last position.

    Args:
        times: [n] at which both are present [s].
        horizon: longest time to contact that is looked for [s].

    Returns:
        [n] seconds; inf where there is no contact within the horizon; 0 in contact.
    """
    ahead = np.arange(0.0, horizon + RESOLUTION, RESOLUTION)
    states: list[State] = []
    for track in (first, second):
        k = track.find_indices(times)
        xy, heading = sample_path(track.path, track.s[k][:, None] + track.speed[k][:, None] * ahead)
        still = track.speed[k] < 0.1
        heading[still] = track.heading[k[still], None]
        states.append((xy, heading))
    return _find_first_touch(first, second, *states)


def compute_ttc_2d(
    first: Trajectory, second: Trajectory, *, times: FloatArray, horizon: float = 5.0
) -> FloatArray:
    """Time to contact if both keep their present velocity vectors and headings [s]; inf if none."""
    ahead = np.arange(0.0, horizon + RESOLUTION, RESOLUTION)
    states: list[State] = []
    for track in (first, second):
        xy, heading = track.at(times)
        velocity = track.velocity[track.find_indices(times)]
        moved = xy[:, None] + ahead[:, None] * velocity[:, None]
        states.append((moved, np.repeat(heading[:, None], len(ahead), axis=1)))
    return _find_first_touch(first, second, *states)


def compute_drac(
    first: Trajectory, second: Trajectory, *, times: FloatArray, ttc: FloatArray | None = None
) -> FloatArray:
    """Deceleration rate to avoid the crash: closing speed / (2 * 2-D TTC) [m/s^2]; 0 if none.

    The constant braking that would just use up the gap; closing speed is the length of the relative
    velocity (Cooper and Ferguson 1976, in two dimensions).

    Args:
        ttc: [n] 2-D TTC at the times [s], where it is known already.
    """
    ttc = compute_ttc_2d(first, second, times=times) if ttc is None else ttc
    k, j = (m.find_indices(times) for m in (first, second))
    relative = first.velocity[k] - second.velocity[j]
    return np.asarray(np.hypot(relative[:, 0], relative[:, 1]) / (2 * np.maximum(ttc, 1e-3)))


State = tuple[FloatArray, FloatArray]
"""Positions [n, m, 2] and headings [n, m] of one agent, at n times and m times ahead of each."""
Sample = tuple[float, float, float]
"""x, y [m] and heading [rad]."""


def _find_first_touch(first: Trajectory, second: Trajectory, one: State, two: State) -> FloatArray:
    """[n] first time ahead at which footprints touch [s]; inf if never for 5 ms."""
    reach = first.reach, second.reach
    return _search_first_touch(*one, *two, reach, first.box, second.box)


@compiled
def _search_first_touch(
    xy: FloatArray,
    heading: FloatArray,
    other_xy: FloatArray,
    other_heading: FloatArray,
    reach: tuple[float, float],
    size: Box,
    other_size: Box,
) -> FloatArray:
    """Between the moments that are 0.1 s apart both move straight on, and 20 parts are tried.

    A contact at a corner is often over within 0.1 s. Where the gap cannot close, as it shrinks by
    no more than both move and turn, nothing is tried.
    """
    found = np.full(len(xy), np.inf)
    for n in range(len(xy)):
        x, y = xy[n, 0, 0] - other_xy[n, 0, 0], xy[n, 0, 1] - other_xy[n, 0, 1]
        apart = np.hypot(x, y) - (reach[0] + reach[1])
        for k in range(xy.shape[1] - 1):
            then_x = xy[n, k + 1, 0] - other_xy[n, k + 1, 0]
            then_y = xy[n, k + 1, 1] - other_xy[n, k + 1, 1]
            then_apart = np.hypot(then_x, then_y) - (reach[0] + reach[1])
            turn = reach[0] * abs(heading[n, k + 1] - heading[n, k])
            turn += reach[1] * abs(other_heading[n, k + 1] - other_heading[n, k])
            most = np.hypot(then_x - x, then_y - y) + turn
            near = apart + then_apart <= most
            x, y, apart = then_x, then_y, then_apart
            if near:
                ends = _get_step_ends(xy, heading, n, k)
                other_ends = _get_step_ends(other_xy, other_heading, n, k)
                part = _find_touch_part(ends, other_ends, size, other_size, most)
                if part <= 1.0:
                    found[n] = RESOLUTION * (k + part)
                    break
    return found


@compiled
def _get_step_ends(xy: FloatArray, heading: FloatArray, n: int, k: int) -> tuple[Sample, Sample]:
    return (
        (xy[n, k, 0], xy[n, k, 1], heading[n, k]),
        (xy[n, k + 1, 0], xy[n, k + 1, 1], heading[n, k + 1]),
    )


@compiled
def _find_touch_part(
    a: tuple[Sample, Sample], b: tuple[Sample, Sample], a_size: Box, b_size: Box, most: float
) -> float:
    """The part of the way at which they touch first; more than 1 where they do not.

    Args:
        most: by how much the gap may shrink on the way [m].
    """
    before = compute_gap(_interpolate_pose(0.0, a), a_size, _interpolate_pose(0.0, b), b_size)
    if (
        before + compute_gap(_interpolate_pose(1.0, a), a_size, _interpolate_pose(1.0, b), b_size)
        > most
    ):
        return np.inf
    if before <= 0.0:
        return 0.0
    for k in range(1, PARTS + 1):
        part = k / PARTS
        after = compute_gap(_interpolate_pose(part, a), a_size, _interpolate_pose(part, b), b_size)
        if after <= 0.0:
            return float((k - 1 + before / max(before - after, 1e-9)) / PARTS)
        before = after
    return np.inf


@compiled
def _interpolate_pose(part: float, ends: tuple[Sample, Sample]) -> Pose:
    (x, y, heading), (then_x, then_y, turned) = ends
    return make_pose(
        x + part * (then_x - x), y + part * (then_y - y), heading + part * (turned - heading)
    )
