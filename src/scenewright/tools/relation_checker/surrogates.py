"""Surrogate measures of safety: path TTC, two-dimensional TTC, DRAC (SEMANTICS section 4).

Only path TTC decides anything (near misses); the others are reported beside it.
"""

from __future__ import annotations

import numpy as np

from scenewright.compiled import compiled
from scenewright.scene.base import FloatArray
from scenewright.tools.relation_checker.footprints import (
    Box,
    Sample,
    compute_gap,
    get_step,
    interpolate_pose,
)
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
    courses: list[Course] = []
    for track in (first, second):
        k = track.find_indices(times)
        xy, heading = sample_path(track.path, track.s[k][:, None] + track.speed[k][:, None] * ahead)
        still = track.speed[k] < 0.1
        heading[still] = track.heading[k[still], None]
        courses.append((xy, heading, track.reach, track.box))
    return _find_first_touch(*courses)


def compute_ttc_2d(
    first: Trajectory, second: Trajectory, *, times: FloatArray, horizon: float = 5.0
) -> FloatArray:
    """Time to contact if both keep their present velocity vectors and headings [s]; inf if none."""
    ahead = np.arange(0.0, horizon + RESOLUTION, RESOLUTION)
    courses: list[Course] = []
    for track in (first, second):
        xy, heading = track.at(times)
        velocity = track.velocity[track.find_indices(times)]
        moved = xy[:, None] + ahead[:, None] * velocity[:, None]
        held = np.repeat(heading[:, None], len(ahead), axis=1)
        courses.append((moved, held, track.reach, track.box))
    return _find_first_touch(*courses)


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


Course = tuple[FloatArray, FloatArray, float, Box]
"""Positions [n, m, 2] and headings [n, m] of one agent, at n times and m times ahead of each; and
its reach and size [m]."""


@compiled
def _find_first_touch(one: Course, two: Course) -> FloatArray:
    """[n] first time ahead at which footprints touch [s]; inf if never for 5 ms.

    Between the moments that are 0.1 s apart both move straight on, and 20 parts are tried. A
    contact at a corner is often over within 0.1 s. Where the gap cannot close, as it shrinks by no
    more than both move and turn, nothing is tried.
    """
    xy, heading, reach, size = one
    other_xy, other_heading, other_reach, other_size = two
    found = np.full(len(xy), np.inf)
    for n in range(len(xy)):
        x, y = xy[n, 0, 0] - other_xy[n, 0, 0], xy[n, 0, 1] - other_xy[n, 0, 1]
        apart = np.hypot(x, y) - (reach + other_reach)
        for k in range(xy.shape[1] - 1):
            then_x = xy[n, k + 1, 0] - other_xy[n, k + 1, 0]
            then_y = xy[n, k + 1, 1] - other_xy[n, k + 1, 1]
            then_apart = np.hypot(then_x, then_y) - (reach + other_reach)
            turn = reach * abs(heading[n, k + 1] - heading[n, k])
            turn += other_reach * abs(other_heading[n, k + 1] - other_heading[n, k])
            most = np.hypot(then_x - x, then_y - y) + turn
            near = apart + then_apart <= most
            x, y, apart = then_x, then_y, then_apart
            if near:
                step = get_step(xy[n], heading[n], k)
                other_step = get_step(other_xy[n], other_heading[n], k)
                part = _find_touch_part(step, other_step, size, other_size, most)
                if part <= 1.0:
                    found[n] = RESOLUTION * (k + part)
                    break
    return found


@compiled
def _find_touch_part(
    a: tuple[Sample, Sample], b: tuple[Sample, Sample], a_size: Box, b_size: Box, most: float
) -> float:
    """The part of the way at which they touch first; more than 1 where they do not.

    Args:
        most: by how much the gap may shrink on the way [m].
    """
    before = compute_gap(interpolate_pose(0.0, a), a_size, interpolate_pose(0.0, b), b_size)
    after = compute_gap(interpolate_pose(1.0, a), a_size, interpolate_pose(1.0, b), b_size)
    if before + after > most:
        return np.inf
    if before <= 0.0:
        return 0.0
    for k in range(1, PARTS + 1):
        part = k / PARTS
        after = compute_gap(interpolate_pose(part, a), a_size, interpolate_pose(part, b), b_size)
        if after <= 0.0:
            return float((k - 1 + before / max(before - after, 1e-9)) / PARTS)
        before = after
    return np.inf
