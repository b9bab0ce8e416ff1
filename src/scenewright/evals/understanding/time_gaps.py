"""Time gaps between the futures of two agents.

Footprints are rows of discs. The futures are laid over one another with the second one delayed by
up to a few seconds; the least delay at which they touch is their PET.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scenewright.evals.understanding.forecast import DT, AgentForecast
from scenewright.evals.understanding.observation import ObservedAgent
from scenewright.scene.base import FloatArray

IntArray = NDArray[np.intp]

SHIFTS = (0, 1, -1, 2, -2, 3, -3, 4, -4, 6, -6, 8, -8, 12, -12)
"""Delays of the second that are tried [multiples of `DT`], least first."""
NEVER = 99.0
_NEAR = 1.0


@dataclass(frozen=True, eq=False)
class TimeGaps:
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


def compute_time_gaps(
    one: tuple[ObservedAgent, AgentForecast], two: tuple[ObservedAgent, AgentForecast]
) -> TimeGaps | None:
    """Compute the gap in each future; None where no futures come near one another."""
    (a, first), (b, second) = one, two
    reach = (a.length + b.length) / 2 + _NEAR
    if _are_apart(first, second, reach):
        return None
    size, ticks = first.present.shape
    gap, time, angle = np.full(size, NEVER), np.full(size, NEVER), np.zeros(size)
    rows = _find_near_rows(first, second, reach)
    for shift in SHIFTS:
        if not len(rows):
            break
        i = slice(max(shift, 0), ticks + min(shift, 0))
        j = slice(max(-shift, 0), ticks + min(-shift, 0))
        dx = first.xy[rows, i, 0] - second.xy[rows, j, 0]
        dy = first.xy[rows, i, 1] - second.xy[rows, j, 1]
        near = dx * dx + dy * dy < reach**2
        k, t = np.nonzero(near & first.present[rows, i] & second.present[rows, j])
        if not len(k):
            continue
        hit = _do_touch(
            _place_discs(a, first, rows[k], t + i.start),
            _place_discs(b, second, rows[k], t + j.start),
        )
        which, at = np.unique(k[hit], return_index=True)
        row, tick = rows[which], t[hit][at]
        gap[row], time[row] = shift * DT, (tick + (i.start + j.start) / 2) * DT
        turn = first.heading[row, tick + i.start] - second.heading[row, tick + j.start]
        angle[row] = np.abs((turn + np.pi) % (2 * np.pi) - np.pi)
        rows = np.delete(rows, which)
    return TimeGaps(gap, time, angle)


def _find_near_rows(one: AgentForecast, two: AgentForecast, reach: float) -> IntArray:
    """Futures in which the boxes round the two tracks overlap."""
    low = np.maximum(one.box[0], two.box[0])
    high = np.minimum(one.box[1], two.box[1])
    return np.flatnonzero((low - high < reach).all(axis=1))


def _are_apart(one: AgentForecast, two: AgentForecast, reach: float) -> bool:
    """Whether the boxes round all futures of the two lie apart."""
    low = np.maximum(one.box[0].min(axis=0), two.box[0].min(axis=0))
    high = np.minimum(one.box[1].max(axis=0), two.box[1].max(axis=0))
    return bool((low - high > reach).any())


_Discs = tuple[FloatArray, FloatArray, float]


def _place_discs(
    agent: ObservedAgent, future: AgentForecast, rows: IntArray, t: IntArray
) -> _Discs:
    """[N, D] x and y of the discs of a footprint, in futures `rows` at ticks t; their radius [m].

    By axis, as summing over a last axis of two is slow.
    """
    offsets, radius = np.zeros(1), agent.width / 2
    if agent.is_vehicle:
        half = agent.length / 2 - agent.width / 2
        count = int(np.ceil(agent.length / agent.width)) + 1
        offsets, radius = np.linspace(-half, half, count), radius * 1.03
    xy, heading = future.xy[rows, t], future.heading[rows, t]
    return (
        xy[:, :1] + offsets * np.cos(heading)[:, None],
        xy[:, 1:] + offsets * np.sin(heading)[:, None],
        radius,
    )


def _do_touch(one: _Discs, two: _Discs) -> NDArray[np.bool_]:
    """[N] whether footprints overlap."""
    (x_a, y_a, radius_a), (x_b, y_b, radius_b) = one, two
    dx, dy = x_a[:, :, None] - x_b[:, None], y_a[:, :, None] - y_b[:, None]
    near = dx * dx + dy * dy < (radius_a + radius_b) ** 2
    return np.asarray(near.reshape(len(near), -1).any(axis=1))
