"""By how much two agents would have to shift in time to touch, in each of their futures."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scenewright.compiled import compiled
from scenewright.evals.understanding.boosted_trees import IntArray
from scenewright.evals.understanding.forecast import DT, AgentForecast, BoolArray
from scenewright.scene.base import FloatArray

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


def compute_time_gaps(first: AgentForecast, second: AgentForecast) -> TimeGaps | None:
    """Compute the gap in each future; None where no futures come near one another."""
    a, b = first.agent, second.agent
    reach = (a.length + b.length) / 2 + _NEAR
    low = np.maximum(first.box[0], second.box[0])  # of the boxes round the tracks of each future
    high = np.minimum(first.box[1], second.box[1])
    all_low = np.maximum(first.box[0].min(axis=0), second.box[0].min(axis=0))
    all_high = np.minimum(first.box[1].max(axis=0), second.box[1].max(axis=0))
    if (all_low - all_high > reach).any():
        return None
    size = len(first.present)
    gap, time, angle = np.full(size, NEVER), np.full(size, NEVER), np.zeros(size)
    near = np.flatnonzero((low - high < reach).all(axis=1))
    one, two = _get_outline(first), _get_outline(second)
    radii = (x.width / 2 * 1.03 if x.is_vehicle else x.width / 2 for x in (a, b))
    touch = sum(radii) ** 2
    shift, tick = _find_first_contacts(near, np.array(SHIFTS), one, two, reach**2, touch)
    found = tick >= 0
    row, shift, tick = near[found], shift[found], tick[found]
    at_a, at_b = tick + np.maximum(shift, 0), tick + np.maximum(-shift, 0)
    gap[row], time[row] = shift * DT, (at_a + at_b) / 2 * DT
    turn = first.heading[row, at_a] - second.heading[row, at_b]
    angle[row] = np.abs((turn + np.pi) % (2 * np.pi) - np.pi)
    return TimeGaps(gap, time, angle)


_Outline = tuple[FloatArray, BoolArray, FloatArray, FloatArray, FloatArray]
"""[K, T, 2] centre; [K, T] presence; [K, T] cosine and sine of the heading; [D] discs along it."""


def _get_outline(future: AgentForecast) -> _Outline:
    """The footprint of an agent in its futures as a row of discs."""
    agent, offsets = future.agent, np.zeros(1)
    if agent.is_vehicle:
        half = agent.length / 2 - agent.width / 2
        offsets = np.linspace(-half, half, int(np.ceil(agent.length / agent.width)) + 1)
    return future.xy, future.present, *future.facing, offsets


@compiled
def _find_first_contacts(
    rows: IntArray, shifts: IntArray, one: _Outline, two: _Outline, reach: float, touch: float
) -> tuple[IntArray, IntArray]:
    """[N] the first of the shifts at which futures `rows` touch; [N] the first tick then, or -1.

    Args:
        reach: squared distance of centres from which no discs can touch [m^2]; touch: of discs.
    """
    xy_a, present_a, xy_b, present_b = one[0], one[1], two[0], two[1]
    shift, tick = np.zeros(len(rows), np.intp), np.full(len(rows), -1)
    for n in range(len(rows)):
        k = rows[n]
        for s in shifts:
            for t in range(present_a.shape[1] - abs(s)):
                i, j = t + max(s, 0), t + max(-s, 0)
                if not (present_a[k, i] and present_b[k, j]):
                    continue
                dx, dy = xy_a[k, i, 0] - xy_b[k, j, 0], xy_a[k, i, 1] - xy_b[k, j, 1]
                if dx * dx + dy * dy < reach and _do_touch(one, two, (k, i, j), touch):
                    shift[n], tick[n] = s, t
                    break
            if tick[n] >= 0:
                break
    return shift, tick


@compiled
def _do_touch(one: _Outline, two: _Outline, at: tuple[int, int, int], touch: float) -> bool:
    """Whether a disc of one at (k, i) and a disc of the other at (k, j) overlap."""
    (xy_a, _, cos_a, sin_a, offsets_a), (xy_b, _, cos_b, sin_b, offsets_b) = one, two
    k, i, j = at
    for a in offsets_a:
        x, y = xy_a[k, i, 0] + a * cos_a[k, i], xy_a[k, i, 1] + a * sin_a[k, i]
        for b in offsets_b:
            dx = x - (xy_b[k, j, 0] + b * cos_b[k, j])
            dy = y - (xy_b[k, j, 1] + b * sin_b[k, j])
            if dx * dx + dy * dy < touch:
                return True
    return False
