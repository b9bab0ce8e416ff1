"""Surrogate measures of safety: path TTC, two-dimensional TTC, DRAC (SEMANTICS section 4).

Only path TTC decides anything (near misses); the others are reported beside it.
"""

from __future__ import annotations

import numpy as np

from scenewright.scene.base import FloatArray
from scenewright.tools.relation_checker.curve import at_distance
from scenewright.tools.relation_checker.footprints import IntArray, extent, gap
from scenewright.tools.relation_checker.motion import Mover

RESOLUTION = 0.1
PARTS = 20


def path_ttc(first: Mover, second: Mover, *, times: FloatArray, horizon: float = 5.0) -> FloatArray:
    """Time to contact if both keep their present speed along their own paths.

    Paths go on straight beyond the last position.

    Args:
        times: [n] at which both are present [s].
        horizon: longest time to contact that is looked for [s].

    Returns:
        [n] seconds; inf where there is no contact within the horizon; 0 in contact.
    """
    ahead = np.arange(0.0, horizon + RESOLUTION, RESOLUTION)
    states = (_along_path(mover, times, ahead) for mover in (first, second))
    return _first_touch(first, second, *states)


def ttc_2d(first: Mover, second: Mover, *, times: FloatArray, horizon: float = 5.0) -> FloatArray:
    """Time to contact if both keep their present velocity vectors and headings [s]; inf if none."""
    ahead = np.arange(0.0, horizon + RESOLUTION, RESOLUTION)
    states = (_straight_on(mover, times, ahead) for mover in (first, second))
    return _first_touch(first, second, *states)


def drac(
    first: Mover, second: Mover, *, times: FloatArray, ttc: FloatArray | None = None
) -> FloatArray:
    """Deceleration rate to avoid the crash: closing speed / (2 * 2-D TTC) [m/s^2]; 0 if none.

    The constant braking that would just use up the gap; closing speed is the length of the relative
    velocity (Cooper and Ferguson 1976, in two dimensions).

    Args:
        ttc: [n] 2-D TTC at the times [s], where it is known already.
    """
    ttc = ttc_2d(first, second, times=times) if ttc is None else ttc
    k, j = (m.indices(times) for m in (first, second))
    relative = first.velocity[k] - second.velocity[j]
    return np.asarray(np.hypot(relative[:, 0], relative[:, 1]) / (2 * np.maximum(ttc, 1e-3)))


State = tuple[FloatArray, FloatArray]
"""Positions [n, m, 2] and headings [n, m] of one agent, at n times and m times ahead of each."""


def _straight_on(mover: Mover, times: FloatArray, ahead: FloatArray) -> State:
    xy, heading = mover.at(times)
    moved = xy[:, None] + ahead[:, None] * mover.velocity[mover.indices(times)][:, None]
    return moved, np.broadcast_to(heading[:, None], moved.shape[:2])


def _along_path(mover: Mover, times: FloatArray, ahead: FloatArray) -> State:
    k = mover.indices(times)
    s = mover.s[k][:, None] + mover.speed[k][:, None] * ahead
    xy, heading = at_distance(mover.path, s)
    still = mover.speed[k] < 0.1
    heading[still] = mover.heading[k[still], None]
    return xy, heading


def _first_touch(first: Mover, second: Mover, one: State, two: State) -> FloatArray:
    """[n] first time ahead at which footprints touch [s]; inf if never for 5 ms.

    Between the moments that are 0.1 s apart both move straight on. Where the gap could close there,
    20 parts of the way are tried: a contact at a corner is often over within 0.1 s.
    """
    row, col = _may_touch(first, second, one, two)
    part = np.linspace(0.0, 1.0, PARTS + 1)
    (xy, heading), (other_xy, other_heading) = (
        [np.moveaxis(v[row, col] + np.multiply.outer(part, v[row, col + 1] - v[row, col]), 0, 1)
         for v in state]
        for state in (one, two)
    )  # fmt: skip
    gaps = gap(
        xy, heading, extent(first),
        other_xy=other_xy, other_heading=other_heading, other_size=extent(second),
    )  # fmt: skip
    hit = np.flatnonzero((gaps <= 0).any(axis=1))
    hit = hit[np.diff(row[hit], prepend=-1) > 0]
    k = np.argmax(gaps[hit] <= 0, axis=1)
    before, after = gaps[hit, np.maximum(k - 1, 0)], gaps[hit, k]
    within = np.where(k > 0, k - 1 + before / np.maximum(before - after, 1e-9), 0.0)
    result = np.full(len(one[0]), np.inf)
    result[row[hit]] = RESOLUTION * (col[hit] + within / PARTS)
    return result


def _may_touch(first: Mover, second: Mover, one: State, two: State) -> tuple[IntArray, IntArray]:
    """Rows and steps in which the gap may close: it shrinks by no more than both move and turn."""
    away = one[0] - two[0]
    apart = np.hypot(away[..., 0], away[..., 1]) - (first.reach + second.reach)
    shift = np.diff(away, axis=1)
    turn = [m.reach * np.abs(np.diff(h, axis=1)) for m, (_, h) in ((first, one), (second, two))]
    most = np.hypot(shift[..., 0], shift[..., 1]) + turn[0] + turn[1]
    row, col = np.nonzero(apart[:, :-1] + apart[:, 1:] <= most)
    both = _gaps(first, second, one, two, row, col) + _gaps(first, second, one, two, row, col + 1)
    near = both <= most[row, col]
    return row[near], col[near]


def _gaps(
    first: Mover, second: Mover, one: State, two: State, row: IntArray, col: IntArray
) -> FloatArray:
    return gap(
        one[0][row, col], one[1][row, col], extent(first),
        other_xy=two[0][row, col], other_heading=two[1][row, col], other_size=extent(second),
    )  # fmt: skip
