"""Whether two futures would touch, and how much earlier or later either would have to be.

Footprints are rows of discs. Two futures are laid against one another with the second one late by
a few tenths of a second to a few seconds; the least delay at which they touch is their PET.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scenewright.evals.understanding.futures import DT, Future
from scenewright.evals.understanding.observing import Seen
from scenewright.scene.base import FloatArray

SHIFTS = np.array([0, 1, -1, 2, -2, 3, -3, 4, -4, 6, -6, 8, -8, 12, -12])
"""Delays of the second that are tried [multiples of `DT`], least first."""
NEVER = 99.0
_NEAR = 1.0


@dataclass(frozen=True, eq=False)
class Meeting:
    """Two agents in K futures.

    Attributes:
        gap: [K] least delay of the second at which they touch [s], positive if the second comes
            first and would have to be later; `NEVER` where they do not touch.
        time: [K] when they touch then [s from now], halfway between their clocks.
        angle: [K] between their headings there [rad], 0 to pi.
    """

    gap: FloatArray
    time: FloatArray
    angle: FloatArray


def discs_of(agent: Seen) -> tuple[FloatArray, float]:
    """Offsets of the discs along the heading [m], and their radius [m]."""
    if not agent.vehicle:
        return np.zeros(1), agent.width / 2
    count = int(np.ceil(agent.length / agent.width)) + 1
    half = agent.length / 2 - agent.width / 2
    return np.linspace(-half, half, count), agent.width / 2 * 1.03


def meeting(one: tuple[Seen, Future], two: tuple[Seen, Future]) -> Meeting | None:
    """How the futures of two agents meet; None where none of them comes near the other."""
    (a, first), (b, second) = one, two
    reach = (a.length + b.length) / 2 + _NEAR
    if _far(first, second, reach):
        return None
    size, ticks = first.there.shape
    gap, time, angle = np.full(size, NEVER), np.full(size, NEVER), np.zeros(size)
    rows = _near_rows(first, second, reach)
    for shift in SHIFTS.tolist():
        if not len(rows):
            break
        i = slice(max(shift, 0), ticks + min(shift, 0))
        j = slice(max(-shift, 0), ticks + min(-shift, 0))
        dx = first.xy[rows, i, 0] - second.xy[rows, j, 0]
        dy = first.xy[rows, i, 1] - second.xy[rows, j, 1]
        near = dx * dx + dy * dy < reach**2
        k, t = np.nonzero(near & first.there[rows, i] & second.there[rows, j])
        if not len(k):
            continue
        hit = _touch(a, b, first, second, rows[k], t + i.start, t + j.start)
        which, at = np.unique(k[hit], return_index=True)
        row, tick = rows[which], t[hit][at]
        gap[row], time[row] = shift * DT, (tick + (i.start + j.start) / 2) * DT
        turn = first.heading[row, tick + i.start] - second.heading[row, tick + j.start]
        angle[row] = np.abs((turn + np.pi) % (2 * np.pi) - np.pi)
        rows = np.delete(rows, which)
    return Meeting(gap, time, angle)


def _near_rows(one: Future, two: Future, reach: float) -> NDArray[np.intp]:
    """Futures in which the boxes round the two ways overlap."""
    low = np.maximum(one.box[0], two.box[0])
    high = np.minimum(one.box[1], two.box[1])
    return np.flatnonzero((low - high < reach).all(axis=1))


def _far(one: Future, two: Future, reach: float) -> bool:
    """Whether the boxes round all futures of the two lie apart."""
    low = np.maximum(one.box[0].min(axis=0), two.box[0].min(axis=0))
    high = np.minimum(one.box[1].max(axis=0), two.box[1].max(axis=0))
    return bool((low - high > reach).any())


def _touch(
    a: Seen,
    b: Seen,
    first: Future,
    second: Future,
    rows: NDArray[np.intp],
    i: NDArray[np.intp],
    j: NDArray[np.intp],
) -> NDArray[np.bool_]:
    """[N] whether footprints overlap, in future `rows`, at ticks i and j."""
    (places_a, radius_a), (places_b, radius_b) = discs_of(a), discs_of(b)
    (x_a, y_a), (x_b, y_b) = (
        _discs(agent, rows, t, places)
        for agent, t, places in ((first, i, places_a), (second, j, places_b))
    )
    dx, dy = x_a[:, :, None] - x_b[:, None], y_a[:, :, None] - y_b[:, None]
    near = dx * dx + dy * dy < (radius_a + radius_b) ** 2
    return np.asarray(near.reshape(len(rows), -1).any(axis=1))


def _discs(
    agent: Future, rows: NDArray[np.intp], t: NDArray[np.intp], places: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """[N, D] x and y of the discs; by axis, as summing over the last one of two is slow."""
    xy, heading = agent.xy[rows, t], agent.heading[rows, t]
    return (
        xy[:, :1] + places * np.cos(heading)[:, None],
        xy[:, 1:] + places * np.sin(heading)[:, None],
    )
