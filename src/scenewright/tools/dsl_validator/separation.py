"""Which entry times keep two agents from interacting (SEMANTICS 4, certificate).

Whoever is in the scene already is known by the nodes of its path, and from when until when its
footprint is about each of them. A newcomer's path meets some of these nodes; each meeting bars the
entry times that would bring both there at once, or too shortly after one another.

Meetings are geometry: found once per path, for all who are present, whatever the times. Distances
are measured along the four axes of the two rectangles, which tells overlap from none exactly and
never says more than the true clearance; a pedestrian counts as the square about its disc.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from scenewright.scene.base import FloatArray
from scenewright.scene.candidates import Candidate, evenly
from scenewright.scene.track import STEP
from scenewright.tools.dsl_validator.actor import Actor
from scenewright.tools.encounter import IntArray, axis_gap, close_nodes, occupancy
from scenewright.tools.time_law import Motion

Steps = NDArray[np.int64]

_NODE = {"vehicle": 0.8, "pedestrian": 0.4}
"""Distance of path nodes [m]: no more than the clearance that they must not miss."""


@dataclass(frozen=True)
class Separation:
    """How far apart in space [m] and time [s] two agents must stay."""

    clearance: float
    gap: float


FOREGROUND = Separation(clearance=0.8, gap=1.75)
BACKGROUND = Separation(clearance=0.8, gap=1.25)
WALKERS = Separation(clearance=0.15, gap=0.0)
AFTER_YIELD = Separation(clearance=0.0, gap=2.4)
"""Around where a yielding agent would have been unheld: no second cause for its stop."""

WALKER_AHEAD = 8.4
"""Nobody else crosses so shortly [s] before a vehicle that waits for one pedestrian."""


@dataclass(frozen=True, eq=False)
class Corridor:
    """The swept path of a candidate as nodes.

    Attributes:
        s: [N] arc length of the nodes [m], evenly spaced.
        pose: [4, N] x, y and the cosine and sine of the heading; centre of the footprint.
        half: half length and half width of the footprint [m].
        walks: a pedestrian's.
    """

    s: FloatArray
    pose: FloatArray
    half: tuple[float, float]
    walks: bool

    @cached_property
    def reach(self) -> float:
        """Half the diagonal of the footprint [m]."""
        return float(np.hypot(*self.half))


@lru_cache(maxsize=512)
def corridor_of(candidate: Candidate) -> Corridor:
    """The nodes of a candidate's path; candidates are known by identity."""
    path, shape, kind = candidate.path, candidate.shape, candidate.route.type
    s = evenly(path.length, max(2, round(path.length / _NODE[kind]) + 1))
    heading = np.interp(s, path.s, path.heading)
    pose = np.empty((4, len(s)))
    pose[0], pose[1] = (np.interp(s, path.s, path.xy[:, axis]) for axis in (0, 1))
    pose[2], pose[3] = np.cos(heading), np.sin(heading)
    return Corridor(s, pose, (shape.length / 2, shape.width / 2), kind == "pedestrian")


@dataclass(frozen=True, eq=False)
class _Meetings:
    """Where a newcomer's nodes meet the nodes of those present, run by run.

    Attributes:
        row: [R] node of the newcomer.
        first, last: [R] first and last of consecutive nodes of one agent present.
        touching: how many runs, the last of all, are in touch; those before are within the
            clearance.
    """

    row: IntArray
    first: IntArray
    last: IntArray
    touching: int


class Presence:
    """Everybody whose times are settled."""

    def __init__(self, actors: Iterable[Actor] = (), *, foreground: bool = True) -> None:
        self._stays: list[FloatArray] = []
        self._nodes: _Nodes | None = None
        self._met: dict[int, tuple[Corridor, _Meetings]] = {}
        for actor in actors:
            self.add(actor, foreground=foreground)

    def add(self, actor: Actor, *, foreground: bool) -> None:
        """One more, at its own scene times."""
        self._nodes, self._met = None, {}
        inner = FOREGROUND if foreground else BACKGROUND
        self._stays.append(_stay(actor, actor.motion, inner, FOREGROUND))
        waits = any(stop.reason == "gives_way" for stop in actor.stops)
        # Who brakes for one would, unheld, come near others too: the same as who waits.
        if not waits and not (actor.slowings and actor.contact is None):
            return
        self._stays.append(_stay(actor, actor.free, AFTER_YIELD, AFTER_YIELD))
        if actor.candidate.route.type == "vehicle":
            touch = Separation(clearance=0.0, gap=0.0)
            self._stays.append(_stay(actor, actor.motion, touch, touch, ahead=WALKER_AHEAD))

    def free(self, actor: Actor, starts: Steps, *, foreground: bool) -> Steps:
        """Of the entry times [steps], those at which the actor would meet nobody."""
        if not self._stays or not len(starts):
            return starts
        low, high = self.barred(actor, foreground=foreground)
        base, size = int(starts[0]), int(starts[-1] - starts[0]) + 1
        first, last = _floor(low), _ceil(high)
        if size == 1:
            return starts[:0] if ((first <= base) & (base <= last)).any() else starts
        begin = np.minimum(np.maximum(first - base, 0), size)
        end = np.minimum(np.maximum(last + 1 - base, begin), size)
        count = np.bincount(begin, minlength=size + 1) - np.bincount(end, minlength=size + 1)
        unmet: Steps = starts[np.cumsum(count)[starts - base] == 0]
        return unmet

    def barred(self, actor: Actor, *, foreground: bool) -> tuple[FloatArray, FloatArray]:
        """[N] ends of the intervals of entry times [s] that would bring about a meeting."""
        corridor = corridor_of(actor.candidate)
        nodes = self._gathered()
        runs = self._meetings(corridor, nodes)
        come, leave = occupancy(corridor.s, actor.motion, 0.5)
        # Who never comes to a node is there at infinity: no finite interval is left of it.
        with np.errstate(invalid="ignore"):
            low = nodes.come[runs.first] - leave[runs.row]
            high = nodes.leave[runs.last] - come[runs.row]
        touch = slice(len(low) - runs.touching, None)
        there = runs.first[touch]
        gap = (nodes.gap_outer if foreground else nodes.gap_inner)[there]
        low[touch] -= np.maximum(gap, nodes.ahead[there]) if corridor.walks else gap
        high[touch] += gap
        real = np.isfinite(low) & np.isfinite(high)
        return low[real], high[real]

    def _gathered(self) -> _Nodes:
        if self._nodes is None:
            self._nodes = _Nodes(self._stays)
        return self._nodes

    def _meetings(self, corridor: Corridor, nodes: _Nodes) -> _Meetings:
        """Runs within the clearance, and runs in touch."""
        key = id(corridor)
        if key not in self._met:
            i, j, apart = _close(corridor, nodes)
            clearance = nodes.clearance[j]
            if corridor.walks:
                # Two pedestrians may come close, and have no time gap to keep.
                both = nodes.walks[j]
                clearance = np.where(both, WALKERS.clearance, clearance)
                touch = (apart <= 0.0) & ~both
            else:
                touch = apart <= 0.0
            # What only touch concerns has no clearance to keep beyond it.
            near = (apart <= clearance) & (clearance > 0.0)
            self._met[key] = (corridor, _runs(i, j, near, touch, nodes.slot))
        return self._met[key][1]


class _Nodes:
    """The nodes of all present, one after the other; see `_stay`."""

    def __init__(self, stays: list[FloatArray]) -> None:
        table = np.concatenate(stays, axis=1)
        self.pose, self.reach = table[:6], table[6]
        self.come, self.leave, self.walks = table[7], table[8], table[9] > 0.0
        self.clearance, self.gap_inner, self.gap_outer, self.ahead = table[10:]
        # Numbered so that only neighbours of one agent have numbers that follow each other.
        owner = np.repeat(np.arange(len(stays)), [stay.shape[1] for stay in stays])
        self.slot = np.arange(len(owner)) + owner


def forbidden_offsets(a: Actor, b: Actor, *, strict: bool) -> list[tuple[int, int]]:
    """Open intervals (low, high) [steps] that o_b - o_a must avoid for the pair not to interact."""
    low, high = _alone(a, strict).barred(b, foreground=strict)
    return _merged(_floor(low) - 1, _ceil(high) + 1)


@lru_cache(maxsize=512)
def _alone(actor: Actor, strict: bool) -> Presence:
    """An actor by itself, at its own local times; actors are known by identity."""
    return Presence([actor.shifted(-actor.enters)], foreground=strict)


def _stay(
    actor: Actor,
    motion: Motion,
    inner: Separation,
    outer: Separation,
    ahead: float = 0.0,
) -> FloatArray:
    """[14, N] one agent present: its nodes, when it is there, and how to keep clear of it.

    Rows: pose (x, y, cosine, sine), half length and half width, half diagonal [m]; from when until
    when its footprint is about the node [s]; whether it walks; clearance [m] and gap [s] to others
    in the background, gap to those in the foreground; and how long before its own coming nobody
    else crosses [s], where that is more than the gap.
    """
    corridor = corridor_of(actor.candidate)
    come, leave = occupancy(corridor.s, motion, 0.5)
    # A run of nodes ends when the last that is reached is left.
    reached = int(np.isfinite(come).sum())
    leave[reached:] = leave[max(reached - 1, 0)]
    rows = np.empty((14, len(come)))
    rows[:4], rows[7], rows[8] = corridor.pose, come + actor.enters, leave + actor.enters
    rows[4:7].T[:] = (*corridor.half, corridor.reach)
    rows[9:].T[:] = (corridor.walks, inner.clearance, inner.gap, outer.gap, ahead)
    return rows


def _close(a: Corridor, b: _Nodes) -> tuple[IntArray, IntArray, FloatArray]:
    """Pairs of nodes that may come within the widest clearance, and how far apart they are."""
    i, j = close_nodes(a.pose, b.pose, a.reach + b.reach + FOREGROUND.clearance)
    there = b.pose.take(j, axis=1)
    half = np.array(a.half)[:, None]
    return i, j, axis_gap(a.pose.take(i, axis=1), there[:4], half, there[4:])


def _runs(
    i: IntArray,
    j: IntArray,
    near: NDArray[np.bool_],
    touch: NDArray[np.bool_],
    slot: IntArray,
) -> _Meetings:
    """Pairs sorted by i and j, joined where j goes on along one owner's path."""
    at, touching = near.nonzero()[0], touch.nonzero()[0]
    at = np.concatenate([at, touching])
    if not len(at):
        return _Meetings(at, at, at, 0)
    i, j = i[at], j[at]
    place = i * (slot[-1] + 2) + slot[j]
    breaks = place[1:] - place[:-1] != 1
    edge = len(at) - len(touching)
    if 0 < edge < len(at):
        breaks[edge - 1] = True
    inner = breaks.nonzero()[0]
    starts, ends = np.concatenate([[0], inner + 1]), np.concatenate([inner, [len(i) - 1]])
    return _Meetings(i[starts], j[starts], j[ends], int(np.sum(starts >= edge)))


def _floor(seconds: FloatArray) -> Steps:
    return np.floor(seconds / STEP).astype(np.int64)


def _ceil(seconds: FloatArray) -> Steps:
    return np.ceil(seconds / STEP).astype(np.int64)


def _merged(low: Steps, high: Steps) -> list[tuple[int, int]]:
    """Open intervals of steps, ascending and apart."""
    if not len(low):
        return []
    order = np.argsort(low, kind="stable")
    low, reach = low[order], np.maximum.accumulate(high[order])
    # (1, 3) and (2, 5) leave nothing between them; (1, 3) and (3, 5) leave 3.
    breaks = np.flatnonzero(low[1:] >= reach[:-1])
    starts, ends = np.concatenate([[0], breaks + 1]), np.concatenate([breaks, [len(low) - 1]])
    return list(zip(low[starts].tolist(), reach[ends].tolist(), strict=True))
