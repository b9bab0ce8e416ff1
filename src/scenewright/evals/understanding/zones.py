"""Where the ways of two agents overlap, and when each of them would be there.

How many of a few dozen futures touch says little about how surely two would: those that turn the
same two ways are a handful. So for these the stretch is looked at that the two swept paths share
(SEMANTICS section 4, conflict zone), and how the two stays in it lie to one another in time.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scenewright.evals.understanding.futures import DT, TICKS, Future
from scenewright.evals.understanding.intent import rows_interp
from scenewright.evals.understanding.observing import Seen
from scenewright.scene.base import FloatArray

OF_ZONE = ("offset", "both_there", "wait", "at_odds", "offset_spread")
"""By how much their stays lie apart, middle to middle, in units of half of both together (below 1
they overlap), median; the share of futures where they overlap; how long either would have to wait
to be clear of the other [s]; the same as the first, softly; the standard deviation of the time
from middle to middle [s]."""
IN_ZONE = ("lead", "zone", "zone_in", "zone_for", "zone_needs", "decides")
"""By how much earlier than the other it is there, middle to middle [s]; how far it goes until it
enters [m], when that is, and for how long it stays [s]; the braking that stops it before [m/s^2];
the time left until it would have to begin to brake as people do [s]."""

_STEP = 0.75
_GRID = np.arange(0.0, 75.0, _STEP)
"""Places along a way that are looked at [m from where the agent is]."""
_LONGEST = int(5.0 / _STEP)
"""Of a shared lane only the first 5 m belong to the zone, in steps of the grid."""
_ROWS = 16
"""Futures of a pair that are looked at, at most."""
_TOUCH, _SOFT = 0.95, 0.36
"""Stays overlap surely below this offset; how softly it is told."""
_ROOM, _BRAKING = 0.8, 2.2
"""How far from the zone people stand [m], and how they brake for it [m/s^2]."""
_NOWHERE, _LATE, _HARD = 60.0, 20.0, 12.0
NONE = ((9.0, 0.0, 9.0, 0.0, 9.0), (0.0, _NOWHERE, _LATE, _LATE, 0.0, _LATE))
"""Of both, and of each, where their ways do not overlap."""

BoolArray = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class _Stay:
    """One of the two in N futures: how far to the zone [m]; in and out [s from now]."""

    ahead: FloatArray
    in_: FloatArray
    out: FloatArray

    @property
    def middle(self) -> FloatArray:
        return (self.in_ + self.out) / 2

    @property
    def half(self) -> FloatArray:
        return (self.out - self.in_) / 2


def zone_values(
    one: tuple[Seen, Future], two: tuple[Seen, Future], mine: BoolArray
) -> tuple[list[float], list[float], list[float]]:
    """`OF_ZONE`, and `IN_ZONE` of the first and of the second, from futures `mine` [K]."""
    rows = np.flatnonzero(mine)
    rows = rows[:: -(-len(rows) // _ROWS)] if len(rows) > _ROWS else rows
    stays = _stays(one, two, rows) if len(rows) else None
    if stays is None:
        return list(NONE[0]), list(NONE[1]), list(NONE[1])
    a, b = stays
    lead = b.middle - a.middle
    half = np.maximum(a.half + b.half, 0.05)
    offset = np.abs(lead) / half
    both = [
        float(np.median(offset)), float((offset < _TOUCH).mean()),
        float(np.median(np.maximum(np.abs(lead) - half, 0.0))),
        float(np.exp(-(offset**2) / (2 * _SOFT)).mean()), float(lead.std()),
    ]  # fmt: skip
    return both, _own(one[0], a, float(np.median(lead))), _own(two[0], b, -float(np.median(lead)))


def _own(agent: Seen, stay: _Stay, lead: float) -> list[float]:
    v, ahead = float(agent.speed[-1]), float(np.median(stay.ahead))
    room = max(ahead - _ROOM, 0.3)
    left = (room - v * v / (2.0 * _BRAKING)) / max(v, 0.5)
    return [
        lead, ahead, float(np.median(stay.in_)), float(np.median(stay.out - stay.in_)),
        min(v * v / (2.0 * room), _HARD), float(np.clip(left, -5.0, _LATE)),
    ]  # fmt: skip


def _stays(
    one: tuple[Seen, Future], two: tuple[Seen, Future], rows: NDArray[np.intp]
) -> tuple[_Stay, _Stay] | None:
    """The stays of both in the zone, in those futures of `rows` that have one."""
    (a, first), (b, second) = one, two
    (s_a, at_a), (s_b, at_b) = _even(first, rows), _even(second, rows)
    dx = at_a[:, :, None, 0] - at_b[:, None, :, 0]
    dy = at_a[:, :, None, 1] - at_b[:, None, :, 1]
    on_map = (s_a[:, -1:] >= _GRID)[:, :, None] & (s_b[:, -1:] >= _GRID)[:, None]
    near = (dx * dx + dy * dy < ((a.width + b.width) / 2 + 0.05) ** 2) & on_map
    there = near.any(axis=(1, 2))
    if not there.any():
        return None
    in_a, in_b = (np.asarray(near[there].any(axis=axis)) for axis in (2, 1))
    return _stay(a, s_a[there], in_a), _stay(b, s_b[there], in_b)


def _even(future: Future, rows: NDArray[np.intp]) -> tuple[FloatArray, FloatArray]:
    """[N, T] way by tick [m], rising; [N, G, 2] places at even steps along it."""
    xy = future.xy[rows]
    step = np.diff(xy, axis=1)
    s = np.zeros(xy.shape[:2])
    np.cumsum(np.hypot(step[..., 0], step[..., 1]) + 1e-6, axis=1, out=s[:, 1:])
    grid = np.broadcast_to(_GRID, (len(rows), len(_GRID)))
    return s, np.stack([rows_interp(grid, s, xy[..., d]) for d in (0, 1)], axis=-1)


def _stay(agent: Seen, s: FloatArray, near: BoolArray) -> _Stay:
    """From the first place of the zone to the last that hangs together with it."""
    first = near.argmax(axis=1)
    places = np.arange(near.shape[1])
    broken = ~near & (places > first[:, None])
    last = np.where(broken.any(axis=1), broken.argmax(axis=1) - 1, near.shape[1] - 1)
    last = np.minimum(last, first + _LONGEST)
    # A row of discs, as wide as the way that it sweeps; the zone ends between two places.
    reach = (agent.length - agent.width + _STEP) / 2
    begins, ends = _GRID[first] - reach, _GRID[last] + reach
    ticks = np.broadcast_to(DT * np.arange(TICKS), s.shape)
    speed = max(float(agent.speed[-1]), 0.5)
    in_, out = (rows_interp(at[:, None], s, ticks)[:, 0] for at in (begins, ends))
    # Whoever is in it already came in at about its present speed.
    return _Stay(begins, np.where(begins < 0.0, begins / speed, in_), out)
