"""Surrogate measures of safety: path TTC, two-dimensional TTC, DRAC (SEMANTICS section 4).

Only path TTC decides anything (near misses); the others are reported beside it.
"""

from __future__ import annotations

import numpy as np

from scenewright.compiled import compiled
from scenewright.scene.base import FloatArray
from scenewright.tools.relation_checker.curve import at_distance
from scenewright.tools.relation_checker.footprints import Box, Place, gap_of, place_at
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
Pose = tuple[float, float, float]
"""x, y [m] and heading [rad]."""


def _straight_on(mover: Mover, times: FloatArray, ahead: FloatArray) -> State:
    xy, heading = mover.at(times)
    moved = xy[:, None] + ahead[:, None] * mover.velocity[mover.indices(times)][:, None]
    return moved, np.repeat(heading[:, None], len(ahead), axis=1)


def _along_path(mover: Mover, times: FloatArray, ahead: FloatArray) -> State:
    k = mover.indices(times)
    s = mover.s[k][:, None] + mover.speed[k][:, None] * ahead
    xy, heading = at_distance(mover.path, s)
    still = mover.speed[k] < 0.1
    heading[still] = mover.heading[k[still], None]
    return xy, heading


def _first_touch(first: Mover, second: Mover, one: State, two: State) -> FloatArray:
    """[n] first time ahead at which footprints touch [s]; inf if never for 5 ms."""
    boxes = [(m.half_length, m.half_width, m.radius) for m in (first, second)]
    return _touched(*one, *two, (first.reach, second.reach), *boxes)


@compiled
def _touched(
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
                ends = _ends(xy, heading, n, k)
                other_ends = _ends(other_xy, other_heading, n, k)
                part = _part_at_touch(ends, other_ends, size, other_size, most)
                if part <= 1.0:
                    found[n] = RESOLUTION * (k + part)
                    break
    return found


@compiled
def _ends(xy: FloatArray, heading: FloatArray, n: int, k: int) -> tuple[Pose, Pose]:
    return (
        (xy[n, k, 0], xy[n, k, 1], heading[n, k]),
        (xy[n, k + 1, 0], xy[n, k + 1, 1], heading[n, k + 1]),
    )


@compiled
def _part_at_touch(
    a: tuple[Pose, Pose], b: tuple[Pose, Pose], a_size: Box, b_size: Box, most: float
) -> float:
    """The part of the way at which they touch first; more than 1 where they do not.

    Args:
        most: by how much the gap may shrink on the way [m].
    """
    before = gap_of(_between(0.0, a), a_size, _between(0.0, b), b_size)
    if before + gap_of(_between(1.0, a), a_size, _between(1.0, b), b_size) > most:
        return np.inf
    if before <= 0.0:
        return 0.0
    for k in range(1, PARTS + 1):
        part = k / PARTS
        after = gap_of(_between(part, a), a_size, _between(part, b), b_size)
        if after <= 0.0:
            return float((k - 1 + before / max(before - after, 1e-9)) / PARTS)
        before = after
    return np.inf


@compiled
def _between(part: float, ends: tuple[Pose, Pose]) -> Place:
    (x, y, heading), (then_x, then_y, turned) = ends
    return place_at(
        x + part * (then_x - x), y + part * (then_y - y), heading + part * (turned - heading)
    )
