"""Surrogate measures of safety: path TTC, two-dimensional TTC, DRAC (SEMANTICS section 4).

Only path TTC decides anything (near misses); the others are reported beside it.
"""

from __future__ import annotations

import numpy as np

from scenewright.scene.base import FloatArray
from scenewright.tools.relation_checker.curve import at_distance
from scenewright.tools.relation_checker.footprints import extent, gap
from scenewright.tools.relation_checker.motion import Mover

RESOLUTION = 0.1


def path_ttc(first: Mover, second: Mover, *, times: FloatArray, horizon: float = 5.0) -> FloatArray:
    """Time to contact if both keep their present speed along their own paths.

    Paths go on straight beyond the last position. The footprints are tried every 0.1 s ahead and
    the contact is interpolated linearly in the gap.

    Args:
        times: [n] at which both are present [s].
        horizon: longest time to contact that is looked for [s].

    Returns:
        [n] seconds; inf where there is no contact within the horizon; 0 in contact.
    """
    ahead = np.arange(0.0, horizon + RESOLUTION, RESOLUTION)
    xy, heading = _along_path(first, times, ahead)
    other_xy, other_heading = _along_path(second, times, ahead)
    gaps = gap(
        xy, heading, extent(first),
        other_xy=other_xy, other_heading=other_heading, other_size=extent(second),
    )  # fmt: skip
    return _first_zero(gaps, ahead)


def ttc_2d(first: Mover, second: Mover, *, times: FloatArray, horizon: float = 5.0) -> FloatArray:
    """Time to contact if both keep their present velocity vectors and headings [s]; inf if none."""
    ahead = np.arange(0.0, horizon + RESOLUTION, RESOLUTION)
    states = []
    for mover in (first, second):
        xy, heading = mover.at(times)
        k = mover.indices(times)
        moved = xy[:, None] + ahead[:, None] * mover.velocity[k][:, None]
        states.append((moved, np.broadcast_to(heading[:, None], moved.shape[:2])))
    (xy, heading), (other_xy, other_heading) = states
    gaps = gap(
        xy, heading, extent(first),
        other_xy=other_xy, other_heading=other_heading, other_size=extent(second),
    )  # fmt: skip
    return _first_zero(gaps, ahead)


def drac(first: Mover, second: Mover, *, times: FloatArray) -> FloatArray:
    """Deceleration rate to avoid the crash: closing speed / (2 * 2-D TTC) [m/s^2]; 0 if none.

    The constant braking that would just use up the gap; closing speed is the length of the relative
    velocity (Cooper and Ferguson 1976, in two dimensions).
    """
    ttc = np.maximum(ttc_2d(first, second, times=times), 1e-3)
    k, j = (m.indices(times) for m in (first, second))
    relative = first.velocity[k] - second.velocity[j]
    return np.asarray(np.hypot(relative[:, 0], relative[:, 1]) / (2 * ttc))


def _along_path(
    mover: Mover, times: FloatArray, ahead: FloatArray
) -> tuple[FloatArray, FloatArray]:
    k = mover.indices(times)
    s = mover.s[k][:, None] + mover.speed[k][:, None] * ahead
    xy, heading = at_distance(mover.path, s)
    still = mover.speed[k] < 0.1
    heading[still] = mover.heading[k[still], None]
    return xy, heading


def _first_zero(gaps: FloatArray, ahead: FloatArray) -> FloatArray:
    """First ahead at which each row of gaps reaches 0, linear in between; inf if never."""
    touch = gaps <= 0
    k = np.argmax(touch, axis=1)
    row = np.arange(len(gaps))
    before, after = gaps[row, np.maximum(k - 1, 0)], gaps[row, k]
    part = np.where(k > 0, before / np.maximum(before - after, 1e-9), 0.0)
    value = np.where(k > 0, ahead[np.maximum(k - 1, 0)] + part * RESOLUTION, 0.0)
    return np.asarray(np.where(touch.any(axis=1), value, np.inf))
