"""Clearance over time and the first contact of two footprints, in continuous time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from scenewright.compiled import compiled
from scenewright.scene.base import FloatArray
from scenewright.scene.track import STEP
from scenewright.tools.relation_checker.footprints import (
    BoolArray,
    IntArray,
    Place,
    box_at,
    corners,
    doubled,
    extent,
    gap,
    gap_of,
    place_at,
)
from scenewright.tools.relation_checker.motion import Mover, strung
from scenewright.tools.relation_checker.planar import Area, geos

EXACT_BELOW = 1.2
"""Clearances below this are exact [m], others lower bounds."""
TOUCH = 1e-3
"""Footprints nearer than this are in contact [m]: the rounding of positions in scene files."""


@dataclass(frozen=True)
class Contact:
    """First contact of two movers.

    Attributes:
        time: [s]; initial: whether they touch already when the second of them appears.
    """

    time: float
    initial: bool


def common_times(first: Mover, second: Mover) -> FloatArray:
    """Sample times [s] at which both are present; empty if they never are."""
    start, end = max(first.start, second.start), min(first.end, second.end)
    count = max(round((end - start) / STEP) + 1, 0)
    return np.asarray(start + STEP * np.arange(count), dtype=np.float64)


def gap_at(
    first: Mover, second: Mover, *, times: FloatArray, second_times: FloatArray | None = None
) -> FloatArray:
    """Signed distance [m] of footprint first(t) and second(t), or second(t') for other times t'."""
    xy, heading = first.at(times)
    other_xy, other_heading = second.at(times if second_times is None else second_times)
    return gap(
        xy, heading, extent(first),
        other_xy=other_xy, other_heading=other_heading, other_size=extent(second),
    )  # fmt: skip


def clearance(first: Mover, second: Mover, *, times: FloatArray) -> FloatArray:
    """Distance between the two footprints [m], 0 in contact (SEMANTICS section 4, *Clearance*)."""
    return np.maximum(gap_at(first, second, times=times), 0.0)


def first_contact(first: Mover, second: Mover) -> Contact | None:
    """The first contact of two movers, also between samples; None if they never touch.

    Positions and headings are linear between samples. Within a step the search advances by the gap
    divided by the fastest possible approach, so it cannot jump over a contact; it ends within 1 mm.
    """
    return closeness(gather((first, second))).contacts.get(0)


def _advance(first: Mover, second: Mover, start: float) -> float | None:
    """The first contact within the step that begins at a sample time [s], None if there is none."""
    ends = start + np.array((0.0, STEP))
    states = [mover.at(ends) for mover in (first, second)]
    dx, dy = np.diff(states[1][0] - states[0][0], axis=0)[0]
    turn, other_turn = (np.abs(heading[1] - heading[0]) for _, heading in states)
    bound = float(np.hypot(dx, dy) + first.reach * turn + second.reach * other_turn)
    part = 0.0
    for _ in range(200):
        distance = _gap_between(first, second, states, part)
        if distance <= TOUCH:
            return start + part * STEP
        part += max(distance / max(bound, 1e-9), 1e-3)
        if part > 1.0:
            break
    return start + STEP if _gap_between(first, second, states, 1.0) <= TOUCH else None


def _gap_between(
    first: Mover, second: Mover, states: Sequence[tuple[FloatArray, FloatArray]], part: float
) -> float:
    """Gap [m] at a part of a step, from positions and headings at its two ends."""
    (xy, heading), (other_xy, other_heading) = (
        (xy[0] + part * (xy[1] - xy[0]), heading[0] + part * (heading[1] - heading[0]))
        for xy, heading in states
    )
    return float(gap(
        xy, heading, extent(first),
        other_xy=other_xy, other_heading=other_heading, other_size=extent(second),
    ))  # fmt: skip


def least_clearance(
    first: Mover, second: Mover, *, within: tuple[float, float] | None = None
) -> tuple[float, float] | None:
    """Time [s] and clearance [m] of the closest approach, to 0.01 s; None if never both present."""
    times = common_times(first, second)
    if within is not None:
        times = times[(times >= within[0]) & (times <= within[1])]
    if len(times) == 0:
        return None
    gaps = gap_at(first, second, times=times)
    best = float(times[int(np.argmin(gaps))])
    fine = np.clip(best + np.linspace(-STEP, STEP, 21), times[0], times[-1])
    gaps = gap_at(first, second, times=fine)
    k = int(np.argmin(gaps))
    return float(fine[k]), max(float(gaps[k]), 0.0)


def meeting_point(first: Mover, second: Mover, *, time: float) -> tuple[float, float]:
    """Middle of the contact [m]; of the shortest line between the footprints if they are apart."""
    one, two = _outline(first, time), _outline(second, time)
    if one.distance(two) > 0.05:
        line = geos.shortest_line(one, two)
        middle = line.interpolate(0.5, normalized=True)
        return float(middle.x), float(middle.y)
    overlap = one.buffer(0.05, quad_segs=2).intersection(two.buffer(0.05, quad_segs=2))
    middle = overlap.centroid
    return float(middle.x), float(middle.y)


def _outline(mover: Mover, time: float) -> Area:
    xy, heading = mover.at(np.array([time]))
    if not mover.is_vehicle:
        return geos.Point(xy[0]).buffer(mover.radius)
    return geos.Polygon(corners(xy, heading, length=mover.length, width=mover.width)[0])


def speed_before(mover: Mover, *, time: float) -> FloatArray:
    """[2] velocity just before a time [m/s].

    Linear extrapolation from the last two whole steps before it, so that an abrupt stop at the
    contact itself does not blur the impact speed.
    """
    k = min(int(np.floor((time - mover.start) / STEP + 1e-6)), len(mover) - 1)
    if k < 1:
        return np.asarray(mover.velocity[0])
    last = (mover.xy[k] - mover.xy[k - 1]) / STEP
    if k < 2:
        return np.asarray(last)
    change = last - (mover.xy[k - 1] - mover.xy[k - 2]) / STEP
    return np.asarray(last + change * ((time - mover.start) / STEP - k + 0.5))


@dataclass(frozen=True, eq=False)
class Crowd:
    """All movers on one time grid.

    Attributes:
        movers: N of them; times: [T] [s].
        xy: [N, T, 2] and heading: [N, T], held outside of a mover's own time.
        present: [N, T] bool; first: [N] column of each mover's first sample.
        origin: [N+1] where each mover's samples begin, if strung one after another.
        pairs: [M, 2] indices of all pairs.
    """

    movers: tuple[Mover, ...]
    times: FloatArray
    xy: FloatArray
    heading: FloatArray
    present: BoolArray
    first: IntArray
    origin: IntArray
    pairs: IntArray

    @cached_property
    def sizes(self) -> FloatArray:
        """[3, N] half length, half width and radius of each footprint [m]."""
        rows = [(m.half_length, m.half_width, m.radius) for m in self.movers]
        return np.ascontiguousarray(np.array(rows).reshape(-1, 3).T)

    @cached_property
    def reach(self) -> FloatArray:
        """[N] radius of the circle round each footprint [m]."""
        return np.array([m.reach for m in self.movers])


def gather(movers: tuple[Mover, ...]) -> Crowd:
    """Puts movers on one grid from the first start to the last end."""
    start = min((m.start for m in movers), default=0.0)
    end = max((m.end for m in movers), default=0.0)
    times = np.asarray(start + STEP * np.arange(round((end - start) / STEP) + 1), dtype=np.float64)
    xy, heading, origin = strung(movers)
    first = np.array([round((m.start - start) / STEP) for m in movers], dtype=np.intp)
    sample = np.arange(len(times)) - first[:, None]
    last = np.diff(origin)[:, None] - 1
    held = np.minimum(np.maximum(sample, 0), last)
    rows = origin[:-1, None] + held
    pairs = np.stack(np.triu_indices(len(movers), 1), axis=1)
    return Crowd(movers, times, xy[rows], heading[rows], held == sample, first, origin, pairs)


@dataclass(frozen=True, eq=False)
class Closeness:
    """Gaps of all pairs at all times.

    Attributes:
        gaps: [M, T] signed distance [m], exact below `EXACT_BELOW`, else a lower bound; inf where
            one of the two is absent.
        contacts: first contact of each pair that has one, by row of `Crowd.pairs`.
    """

    gaps: FloatArray
    contacts: dict[int, Contact]


def closeness(crowd: Crowd) -> Closeness:
    """Clearances and first contacts of all pairs; exact footprints only where centres are near."""
    gaps = _gaps_of_all(
        crowd.pairs, crowd.xy, crowd.heading, crowd.present, crowd.reach, crowd.sizes
    )  # fmt: skip
    return Closeness(gaps, _first_contacts(crowd, gaps))


def _first_contacts(crowd: Crowd, gaps: FloatArray) -> dict[int, Contact]:
    """By row of `Crowd.pairs`; steps in which a gap may close get the continuous search."""
    found: dict[int, Contact] = {}
    for row in np.flatnonzero((gaps <= TOUCH).any(axis=1)).tolist():
        first, second = (crowd.movers[k] for k in crowd.pairs[row])
        begin = int(np.argmax(np.isfinite(gaps[row])))
        if gaps[row, begin] <= TOUCH:
            found[row] = Contact(max(first.start, second.start), True)
    closing = _closing_steps(
        crowd.pairs, gaps, crowd.xy, crowd.heading, crowd.reach, crowd.sizes
    )  # fmt: skip
    for row, col in zip(*(each.tolist() for each in closing), strict=True):
        if row not in found:
            first, second = (crowd.movers[k] for k in crowd.pairs[row])
            time = _advance(first, second, float(crowd.times[col]))
            if time is not None:
                found[row] = Contact(time, False)
    return dict(sorted(found.items()))


# ---- as machine code ----------------------------------------------------------------------------


@compiled
def _gaps_of_all(
    pairs: IntArray,
    xy: FloatArray,
    heading: FloatArray,
    present: BoolArray,
    reach: FloatArray,
    sizes: FloatArray,
) -> FloatArray:
    """[M, T] `Closeness.gaps` of movers [N, T] and their sizes [3, N]."""
    gaps = np.full((len(pairs), xy.shape[1]), np.inf)
    for row in range(len(pairs)):
        a, b = pairs[row, 0], pairs[row, 1]
        for k in range(xy.shape[1]):
            if not (present[a, k] and present[b, k]):
                continue
            dx, dy = xy[b, k, 0] - xy[a, k, 0], xy[b, k, 1] - xy[a, k, 1]
            gap = np.sqrt(dx * dx + dy * dy) - (reach[a] + reach[b])
            if gap < EXACT_BELOW:
                one = place_at(xy[a, k, 0], xy[a, k, 1], heading[a, k])
                two = place_at(xy[b, k, 0], xy[b, k, 1], heading[b, k])
                gap = gap_of(one, box_at(sizes, a), two, box_at(sizes, b))
            gaps[row, k] = gap
    return gaps


@compiled
def _closing_steps(
    pairs: IntArray,
    gaps: FloatArray,
    xy: FloatArray,
    heading: FloatArray,
    reach: FloatArray,
    sizes: FloatArray,
) -> tuple[IntArray, IntArray]:
    """Pairs and steps, in order, in which the gap may close, after a look at their middle."""
    row: IntArray = np.empty(64, np.intp)
    col: IntArray = np.empty(64, np.intp)
    count = 0
    for pair in range(len(pairs)):
        a, b = pairs[pair, 0], pairs[pair, 1]
        for k in range(gaps.shape[1] - 1):
            before, after = gaps[pair, k], gaps[pair, k + 1]
            if before + after == np.inf:
                continue
            most = _most(a, k, xy, heading, reach) + _most(b, k, xy, heading, reach)
            if before + after > most:
                continue
            one, two = _halfway(a, k, xy, heading), _halfway(b, k, xy, heading)
            middle = gap_of(one, box_at(sizes, a), two, box_at(sizes, b))
            if min(middle, middle + min(before, after) - most / 2) <= 0:
                if count == len(row):
                    row, col = doubled(row), doubled(col)
                row[count], col[count] = pair, k
                count += 1
    return row[:count], col[:count]


@compiled
def _most(n: int, k: int, xy: FloatArray, heading: FloatArray, reach: FloatArray) -> float:
    """Most that any point of a footprint moves within a step [m], with some room."""
    dx, dy = xy[n, k + 1, 0] - xy[n, k, 0], xy[n, k + 1, 1] - xy[n, k, 1]
    turn = reach[n] * abs(heading[n, k + 1] - heading[n, k])
    return float(np.sqrt(dx * dx + dy * dy) + turn + 2 * TOUCH)


@compiled
def _halfway(n: int, k: int, xy: FloatArray, heading: FloatArray) -> Place:
    return place_at(
        (xy[n, k, 0] + xy[n, k + 1, 0]) / 2,
        (xy[n, k, 1] + xy[n, k + 1, 1]) / 2,
        (heading[n, k] + heading[n, k + 1]) / 2,
    )
