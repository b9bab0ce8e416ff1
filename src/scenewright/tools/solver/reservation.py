"""Reservation table: entry times that keep two agents from interacting (SEMANTICS 4, certificate).

Each scheduled agent is known by the nodes of its path, and by the times between which its
footprint is about each of them. A new agent's path meets some of these nodes; each meeting blocks
the entry times at which both would be there at once, or too shortly after one another.

Meetings are geometry: found once per path, for all scheduled agents, whatever the times. Distances
are measured along the four axes of the two rectangles, which decides overlap exactly and
never exceeds the true clearance; a pedestrian counts as the square about its disc.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from scenewright.compiled import compiled, compiled_to_write
from scenewright.geometry.driving_profile import Motion
from scenewright.geometry.spline import sample_nodes, sample_poses, to_cosines
from scenewright.scene.base import RIDERS, AgentClass, FloatArray
from scenewright.scene.candidates import Candidate, Path
from scenewright.scene.track import STEP, Shape
from scenewright.tools.solver.path_conflict import (
    SLACK,
    Half,
    IntArray,
    compute_axis_gap,
    compute_passing_times,
)
from scenewright.tools.solver.scheduled_agent import ScheduledAgent
from scenewright.work_limit import count_work

Steps = NDArray[np.int64]
ConflictRuns = tuple[IntArray, IntArray]
"""Runs of consecutive nodes of one scheduled agent that a node of a new agent meets, within the
clearance and in touch: [N, 4] node of the new agent, first and last of the run, its agent."""
Bars = tuple[IntArray, FloatArray, FloatArray, IntArray, IntArray]
"""What `list_bars` gives."""

_NODE = {"vehicle": 0.8, "pedestrian": 0.4}
"""Distance of path nodes [m]: no more than the clearance that they must not miss."""


@dataclass(frozen=True)
class SafetyMargin:
    """How far apart in space [m] and time [s] two agents must stay."""

    clearance: float
    gap: float


FOREGROUND = SafetyMargin(clearance=0.8, gap=1.75)
BACKGROUND = SafetyMargin(clearance=0.8, gap=1.25)
WALKERS = SafetyMargin(clearance=0.15, gap=0.0)
AFTER_YIELD = SafetyMargin(clearance=0.0, gap=2.4)
"""Around where a yielding agent would have been without stopping: no second cause for its stop."""

IN_LANE = 0.95
"""Between two of the background in one lane [s], rear to front: the checker asks for 0.8 s."""
_ALONG = 0.87
"""Cosine of the most by which headings in one lane differ."""

_WIDEST, _WALKERS_APART = FOREGROUND.clearance, WALKERS.clearance

_BESIDE_RIDERS = 0.75
"""Room beside a rider [m] on top of the clearance: closer than 1.5 m it would be overtaken."""

AHEAD, CROSSING, UNTOUCHABLE = range(3)
"""What blocks a node: the vehicle ahead in the lane, a crossing agent, or one of the foreground."""

WALKER_AHEAD = 8.4
"""No other agent crosses so shortly [s] before a vehicle that waits for one pedestrian."""


class Corridor(NamedTuple):
    """The swept path of a candidate as nodes.

    Attributes:
        s: [N] arc length of the nodes [m], evenly spaced.
        pose: [4, N] x, y and the cosine and sine of the heading; centre of the footprint.
        half: half length and half width of the footprint [m]; reach: half its diagonal.
        walks: a pedestrian's.
    """

    s: FloatArray
    pose: FloatArray
    half: Half
    reach: float
    walks: bool


class Reservations(NamedTuple):
    """All scheduled agents: their nodes, when they are there, and how to keep clear of them.

    Attributes:
        nodes: [N, 6] pose (x, y, cosine, sine), and from when until when the footprint is about
            the node [s].
        keeping: [M, `_KEEPING`] what is the same at all nodes of one: half length and half width,
            half diagonal, distance between nodes [m]; whether it walks; clearance [m] and gap [s]
            to others in the background, gap to those in the foreground; how long before its own
            coming no other agent crosses [s], where that is more than the gap; and whether it is
            of the background.
        ends: [M + 1] where the nodes of one begin, and those of the last end.
    """

    nodes: FloatArray
    keeping: FloatArray
    ends: IntArray


def get_corridor(candidate: Candidate) -> Corridor:
    """Return the nodes of a candidate's path."""
    return _build_corridor(candidate.path, candidate.shape, candidate.route.type)


@lru_cache(maxsize=512)
def _build_corridor(path: Path, shape: Shape, kind: AgentClass) -> Corridor:
    """Build the nodes of a path, known by identity: drivers of many paces try the same one."""
    s = sample_nodes(path, _NODE[kind])
    half = shape.length / 2, shape.width / 2 + (_BESIDE_RIDERS if shape.type in RIDERS else 0.0)
    pose = to_cosines(sample_poses(path, s))
    return Corridor(s, pose, half, math.hypot(*half), shape.type == "pedestrian")


_BLOCK = 8
"""Nodes of a new agent for which the nodes of others near them are looked for together."""

_KEEPING = 10
(
    _LONG,
    _WIDE,
    _REACH,
    _SPACING,
    _WALKS,
    _CLEARANCE,
    _GAP_IN_BACKGROUND,
    _GAP_TO_FOREGROUND,
    _WALKER_LEAD,
    _IS_BACKGROUND,
) = range(_KEEPING)


class ReservationTable:
    """All agents whose times are settled."""

    def __init__(self, actors: Iterable[ScheduledAgent] = (), *, foreground: bool = True) -> None:
        self._nodes, self._keeping = [np.empty((0, 6))], list[tuple[float, ...]]()
        self._reservations: Reservations | None = None
        for actor in actors:
            self.add(actor, foreground=foreground)

    def add(self, actor: ScheduledAgent, *, foreground: bool) -> None:
        """Add an agent, at its own scene times, with up to three entries.

        One is where it moves. Who gives way or brakes for another would, if it did not, be
        elsewhere: that is kept clear, too. Nobody walks just ahead of a vehicle that does so.
        """
        to_background = FOREGROUND if foreground else BACKGROUND
        self._reserve(actor, actor.motion, to_background, FOREGROUND)
        waits = any(stop.reason == "gives_way" for stop in actor.stops)
        if not waits and not (actor.slowings and actor.contact is None):
            return
        self._reserve(actor, actor.free, AFTER_YIELD, AFTER_YIELD)
        if actor.candidate.route.type == "vehicle":
            touch = SafetyMargin(clearance=0.0, gap=0.0)
            self._reserve(actor, actor.motion, touch, touch, ahead=WALKER_AHEAD)

    def _reserve(
        self,
        actor: ScheduledAgent,
        motion: Motion,
        to_background: SafetyMargin,
        to_foreground: SafetyMargin,
        ahead: float = 0.0,
    ) -> None:
        corridor = get_corridor(actor.candidate)
        self._nodes.append(
            _compute_node_times(corridor.s, corridor.pose, motion.s, motion.ended, actor.enters)
        )
        self._keeping.append((
            *corridor.half, corridor.reach, corridor.s[1], corridor.walks, to_background.clearance,
            to_background.gap, to_foreground.gap, ahead, to_background is BACKGROUND,
        ))  # fmt: skip
        self._reservations = None

    def get_reservations(self) -> Reservations:
        """Return the reservations of all agents."""
        if self._reservations is None:
            keeping = np.array(self._keeping, dtype=np.float64).reshape(-1, _KEEPING)
            ends = np.cumsum([len(nodes) for nodes in self._nodes], dtype=np.intp)
            self._reservations = Reservations(np.concatenate(self._nodes), keeping, ends)
        return self._reservations

    def is_free(self, actor: ScheduledAgent, *, foreground: bool) -> bool:
        """Return whether an agent would meet no other at its own scene times."""
        corridor, motion, start = get_corridor(actor.candidate), actor.motion, actor.enters / STEP
        return not meets_any(
            round(start), corridor, motion.s, motion.ended, foreground, False,
            self.get_reservations(),
        )  # fmt: skip

    def find_blocked_intervals(
        self, actor: ScheduledAgent, *, foreground: bool
    ) -> tuple[FloatArray, FloatArray]:
        """Find the ends [N] of the intervals of entry times [s] at which the agents would meet."""
        count_work()
        return _list_blocked(
            get_corridor(actor.candidate), actor.motion.s, actor.motion.ended, foreground,
            self.get_reservations(),
        )  # fmt: skip


def find_blocked_offsets(
    a: ScheduledAgent, b: ScheduledAgent, *, strict: bool
) -> list[tuple[int, int]]:
    """Find open intervals (low, high) [steps] that o_b - o_a must avoid so that the pair keeps
    apart."""
    low, high = _build_single_table(a, strict).find_blocked_intervals(b, foreground=strict)
    return _merge_intervals(
        np.floor(low / STEP).astype(np.int64) - 1, np.ceil(high / STEP).astype(np.int64) + 1
    )


@lru_cache(maxsize=512)
def _build_single_table(actor: ScheduledAgent, strict: bool) -> ReservationTable:
    """Build the table of one agent at its own local times; agents are known by identity."""
    return ReservationTable([actor.shift(-actor.enters)], foreground=strict)


# ---- as machine code ----------------------------------------------------------------------------


@compiled
def _compute_node_times(
    s: FloatArray, pose: FloatArray, moved: FloatArray, ended: bool, enters: float
) -> FloatArray:
    """Compute poses [N, 6], and from when until when it is there [s], of the nodes it reaches."""
    come, leave = compute_passing_times(s, moved, 0.5 * (s[1] - s[0]), ended)
    count = 1  # a node that it never reaches blocks nothing
    for n in range(len(come)):
        count = n + 1 if come[n] < np.inf else count
    nodes, left = np.empty((count, 6)), leave[0]
    for n in range(count):
        for row in range(4):
            nodes[n, row] = pose[row, n]
        # A run of nodes ends when the last that is reached is left.
        left = leave[n] if come[n] < np.inf else left
        nodes[n, 4], nodes[n, 5] = come[n] + enters, left + enters
    return nodes


@compiled
def _compute_clearance(keeping: FloatArray, walks: bool) -> tuple[bool, float]:
    """Return whether both walk, and the clearance to keep [m]; 0 where contact alone counts."""
    # Two pedestrians may come close, and have no time gap to keep.
    both = walks and keeping[_WALKS] > 0.0
    least = _WALKERS_APART if both else keeping[_CLEARANCE]
    return both, least if keeping[_CLEARANCE] > 0.0 else -np.inf


@compiled
def _is_in_lane(
    pose: FloatArray, i: int, nodes: FloatArray, j: int, keeping: FloatArray, foreground: bool
) -> bool:
    """Return whether two vehicles of the background drive in one lane where they touch."""
    if foreground or keeping[_IS_BACKGROUND] == 0.0 or keeping[_WALKS] > 0.0:
        return False
    return bool(pose[2, i] * nodes[j, 2] + pose[3, i] * nodes[j, 3] > _ALONG)


@compiled
def list_bars(corridor: Corridor, table: Reservations) -> Bars:
    """List nodes [N] where a background vehicle is blocked: when [s, s], by which agent, how."""
    near, touching = _find_runs(corridor, table)
    pose, nodes, keeping = corridor.pose, table.nodes, table.keeping
    room = len(near) + len(touching)
    rows, who, kind = np.empty(room, np.intp), np.empty(room, np.intp), np.empty(room, np.intp)
    low, high = np.empty(room), np.empty(room)
    count = 0
    for runs, touch in ((near, False), (touching, True)):
        for k in range(len(runs)):
            row, first, last, other = runs[k, 0], runs[k, 1], runs[k, 2], runs[k, 3]
            own = keeping[other]
            along = (
                own[_WALKS] == 0.0
                and pose[2, row] * nodes[first, 2] + pose[3, row] * nodes[first, 3] > _ALONG
            )
            begin, end = nodes[first, 4], nodes[last, 5]
            if not np.isfinite(begin):
                continue
            if touch:
                crowd = own[_IS_BACKGROUND] > 0.0
                before, after = own[_GAP_IN_BACKGROUND], own[_GAP_IN_BACKGROUND] + 0.1
                if along:
                    before, after = (IN_LANE, IN_LANE) if crowd else (before, after)
                begin, end = begin - before, end + after
            rows[count], low[count], high[count], who[count] = row, begin, end, other
            kind[count] = (
                AHEAD if along else (CROSSING if own[_IS_BACKGROUND] > 0.0 else UNTOUCHABLE)
            )
            count += 1
    return rows[:count], low[:count], high[:count], who[:count], kind[:count]


@compiled
def _compute_time_gaps(keeping: FloatArray, walks: bool, foreground: bool) -> tuple[float, float]:
    """Compute the time gaps before and after a scheduled agent that a new one must keep [s]."""
    after = keeping[_GAP_TO_FOREGROUND] if foreground else keeping[_GAP_IN_BACKGROUND]
    return max(after, keeping[_WALKER_LEAD]) if walks else after, after


@compiled
def _find_runs(corridor: Corridor, table: Reservations) -> ConflictRuns:
    """Find runs within the clearance, and runs in touch, of a new agent with all scheduled ones."""
    room = 64 * len(corridor.s)  # hardly ever too little: what is not written costs nothing
    while True:
        near, touching = np.empty((room, 4), np.intp), np.empty((room, 4), np.intp)
        found, touched = _write_runs(corridor, table, near, touching)
        if max(found, touched) < room:
            return near[:found], touching[:touched]
        room *= 2


@compiled_to_write
def _write_runs(
    corridor: Corridor, table: Reservations, near: IntArray, touching: IntArray
) -> tuple[int, int]:
    """Write runs into `near` and `touching`; return how many. If all are filled, some are
    missing.

    What lies between the first and the last node that a node of the new agent meets in one block
    counts as one run.
    """
    pose, half, spacing = corridor.pose, corridor.half, corridor.s[1]
    nodes, keeping, ends = table.nodes, table.keeping, table.ends
    found, touched, room = 0, 0, len(near) - _BLOCK
    for begin in range(0, pose.shape[1], _BLOCK):
        end = min(begin + _BLOCK, pose.shape[1])
        middle = (begin + end) // 2
        for who in range(len(keeping)):
            own = (keeping[who, _LONG], keeping[who, _WIDE])
            both, least = _compute_clearance(keeping[who], corridor.walks)
            radius = corridor.reach + keeping[who, _REACH] + _WIDEST + SLACK
            apart = keeping[who, _SPACING]
            first, last = _find_window(
                pose[0, middle], pose[1, middle], nodes, ends[who], ends[who + 1],
                radius + spacing * (middle - begin), apart,
            )  # fmt: skip
            if first > last:
                continue
            if max(found, touched) > room:
                return len(near), len(near)
            for i in range(begin, end):
                low, high = first, last
                if least > -np.inf:
                    low, high = _find_run(
                        pose, i, half, nodes, own, low, high, radius, apart, least
                    )  # fmt: skip
                    if low > high:
                        continue
                    near[found, 0], near[found, 1], near[found, 2] = i, low, high
                    near[found, 3] = who
                    found += 1
                if both:
                    continue
                low, high = _find_run(pose, i, half, nodes, own, low, high, radius, apart, 0.0)
                if low <= high:
                    touching[touched, 0], touching[touched, 1] = i, low
                    touching[touched, 2], touching[touched, 3] = high, who
                    touched += 1
    return found, touched


@compiled
def _find_window(
    x: float, y: float, nodes: FloatArray, begin: int, end: int, radius: float, spacing: float
) -> tuple[int, int]:
    """Find the first and the last node of one path within a radius of a place; (1, 0) if none.

    A path comes nearer no faster than it goes on, so that far nodes are passed over.
    """
    first, last = begin, end - 1
    while first <= last:
        dx, dy = x - nodes[first, 0], y - nodes[first, 1]
        beyond = np.sqrt(dx * dx + dy * dy) - radius
        if beyond <= 0.0:
            break
        first += 1 + int(beyond / spacing)
    while last > first:
        dx, dy = x - nodes[last, 0], y - nodes[last, 1]
        beyond = np.sqrt(dx * dx + dy * dy) - radius
        if beyond <= 0.0:
            break
        last -= 1 + int(beyond / spacing)
    return (first, max(first, last)) if first < end else (1, 0)


@compiled
def _find_run(
    pose: FloatArray,
    i: int,
    half: Half,
    nodes: FloatArray,
    own: Half,
    first: int,
    last: int,
    radius: float,
    spacing: float,
    least: float,
) -> tuple[int, int]:
    """Find the first and the last node of a window that node `i` is as near as `least` [m] to.

    Returns:
        The two; the first beyond the last for none.
    """
    low, high = first, last
    for step in (1, -1):
        j = low if step == 1 else high
        while low <= j <= high:
            dx, dy = pose[0, i] - nodes[j, 0], pose[1, i] - nodes[j, 1]
            square = dx * dx + dy * dy
            if square > radius * radius:
                j += step * (1 + int((np.sqrt(square) - radius) / spacing))
                continue
            gap = compute_axis_gap(
                pose[0, i], pose[1, i], pose[2, i], pose[3, i], half,
                nodes[j, 0], nodes[j, 1], nodes[j, 2], nodes[j, 3], own,
            )  # fmt: skip
            if gap <= least:
                break
            j += step
        low, high = (j, high) if step == 1 else (low, j)
    return low, high


@compiled
def _list_blocked(
    corridor: Corridor, moved: FloatArray, ended: bool, foreground: bool, table: Reservations
) -> tuple[FloatArray, FloatArray]:
    """List the ends of intervals of entry times [s]; a node that is never reached blocks
    nothing."""
    near, touching = _find_runs(corridor, table)
    s, nodes, keeping = corridor.s, table.nodes, table.keeping
    come, leave = compute_passing_times(s, moved, 0.5 * (s[1] - s[0]), ended)
    low, high = np.empty(len(near) + len(touching)), np.empty(len(near) + len(touching))
    count = 0
    for runs, touch in ((near, False), (touching, True)):
        for k in range(len(runs)):
            row, first, last, who = runs[k, 0], runs[k, 1], runs[k, 2], runs[k, 3]
            begin, end = nodes[first, 4] - leave[row], nodes[last, 5] - come[row]
            if touch:
                before, after = _compute_time_gaps(keeping[who], corridor.walks, foreground)
                begin, end = begin - before, end + after
            if np.isfinite(begin) and np.isfinite(end):
                low[count], high[count] = begin, end
                count += 1
    return low[:count], high[:count]


@compiled
def meets_any(
    start: int,
    corridor: Corridor,
    moved: FloatArray,
    ended: bool,
    foreground: bool,
    follows: bool,
    table: Reservations,
) -> bool:
    """Return whether an agent that enters at `start` [steps] meets another (`_list_blocked`).

    Args:
        moved: its arc length every 0.1 s [m]; ended: whether it stays where that ends.
        foreground: it keeps the stricter distance.
        follows: it drives behind the vehicle ahead in its lane, so that `IN_LANE` suffices there.
    """
    s, pose, half, reach, walks = corridor
    nodes, keeping, ends = table
    come, leave = compute_passing_times(s, moved, 0.5 * (s[1] - s[0]), ended)
    for who in range(len(keeping)):
        own = (keeping[who, _LONG], keeping[who, _WIDE])
        both, least = _compute_clearance(keeping[who], walks)
        radius = reach + keeping[who, _REACH] + _WIDEST + SLACK
        before, after = _compute_time_gaps(keeping[who], walks, foreground)
        first = ends[who]
        for i in range(pose.shape[1]):
            if come[i] == np.inf:
                break
            # A scheduled agent comes to its nodes and leaves them in order.
            while first < ends[who + 1] and not _blocks_start(
                -np.inf, nodes[first, 5] - come[i] + after, start
            ):
                first += 1
            j = first
            while j < ends[who + 1] and _blocks_start(
                nodes[j, 4] - leave[i] - before, np.inf, start
            ):
                dx, dy = pose[0, i] - nodes[j, 0], pose[1, i] - nodes[j, 1]
                beyond = np.sqrt(dx * dx + dy * dy) - radius
                if beyond > 0.0:
                    j += 1 + int(beyond / keeping[who, _SPACING])
                    continue
                gap = compute_axis_gap(pose[0, i], pose[1, i], pose[2, i], pose[3, i], half,
                               nodes[j, 0], nodes[j, 1], nodes[j, 2], nodes[j, 3], own)  # fmt: skip
                begin, end = nodes[j, 4] - leave[i], nodes[j, 5] - come[i]
                if gap <= least and _blocks_start(begin, end, start):
                    return True
                if gap <= 0.0 and not both and _blocks_start(begin - before, end + after, start):
                    lane = follows and _is_in_lane(pose, i, nodes, j, keeping[who], foreground)
                    if not lane or _blocks_start(begin - IN_LANE, end + IN_LANE, start):
                        return True
                j += 1
    return False


@compiled
def _blocks_start(begin: float, end: float, start: int) -> bool:
    """Return whether an interval of entry times [s], rounded outwards, holds one [steps]."""
    return bool(np.floor(begin / STEP) <= start <= np.ceil(end / STEP))


def _merge_intervals(low: Steps, high: Steps) -> list[tuple[int, int]]:
    """Merge open intervals of steps into ascending disjoint ones."""
    if not len(low):
        return []
    order = np.argsort(low, kind="stable")
    low, reach = low[order], np.maximum.accumulate(high[order])
    # (1, 3) and (2, 5) leave nothing between them; (1, 3) and (3, 5) leave 3.
    breaks = np.flatnonzero(low[1:] >= reach[:-1])
    starts, ends = np.concatenate([[0], breaks + 1]), np.concatenate([breaks, [len(low) - 1]])
    return list(zip(low[starts].tolist(), reach[ends].tolist(), strict=True))
