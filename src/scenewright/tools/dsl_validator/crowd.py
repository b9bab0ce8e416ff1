"""Everybody else in time: candidate and entry time of agents that no relation binds.

Two ways. In turn (`seat_in_turn`): each agent takes the first of its options that keeps clear of
those seated before it, as near to the time it was drawn for as may be; who finds no room makes way
for a spare. That is a draw among the surviving combinations, one agent after the other.

At once (`seat`), the least-cost combination, exactly:

Lazy CP-SAT (ARCHITECTURE section 4). One Boolean per option (a candidate with a time law and
edits), one integer entry time per agent; the summed NLL is least subject to the certificate of no
other interaction. Pair constraints are added only for options actually chosen, until none is
broken, so that the optimum is that of the full model without building it.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import astuple, dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenewright.scene.base import AgentClass
from scenewright.scene.candidates import Candidate, Path
from scenewright.scene.track import STEP
from scenewright.tools.dsl_validator.actor import Actor
from scenewright.tools.encounter import Encounter, Intervals, encounter, meeting_offsets, meetings
from scenewright.tools.time_law import Motion

_NODE = {"vehicle": 0.6, "pedestrian": 0.25}
"""Distance of path nodes [m]: small beside the clearance that they must not miss."""

_SCALE = 100
"""Objective units per nat."""

_SOLVER_SECONDS = 0.5
_MAX_ROUNDS = 40
_SPARE_COST = 5.0
"""Nats that a spare guest costs: those drawn first go first."""


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
class Option:
    """One way in which an agent may take part.

    Attributes:
        make: builds candidate and motion, entering at time 0, when first looked at.
        starts: [N] allowed entry times in steps of 0.1 s, ascending.
        cost: -log density of it [nats].
        wish: entry time [steps] that it was drawn for.
    """

    make: Callable[[], Actor]
    index: int
    starts: NDArray[np.int64]
    cost: float
    wish: int = 0

    @cached_property
    def actor(self) -> Actor:
        """The agent as this option has it; its entry time is a placeholder."""
        return self.make()


@dataclass(frozen=True, eq=False)
class Guest:
    """An agent to be placed.

    Attributes:
        make: builds its options when they are first looked at.
        foreground: keeps the stricter distance to all, and must take part.
        spare: drawn beyond the number wanted; takes part only if somebody else cannot.
        behind: an option that queues behind those who stand in its way, given them in scene time.
    """

    name: str
    type: AgentClass
    foreground: bool
    make: Callable[[], tuple[Option, ...]]
    spare: bool = False
    behind: Callable[[Sequence[Actor]], Option | None] | None = None

    @cached_property
    def options(self) -> tuple[Option, ...]:
        """The ways in which it may take part."""
        return self.make()


@dataclass(frozen=True, eq=False)
class Seating:
    """Chosen option and entry time [steps] of every guest that takes part."""

    chosen: Mapping[str, tuple[Option, int]]
    optimal: bool
    rounds: int
    pairs: int


Place = tuple[int, int, int]
"""Guest, option and entry time [steps]."""


def seat(guests: Sequence[Guest], table: Table, wanted: Mapping[AgentClass, int]) -> Seating | str:
    """The least-cost seating around the fixed actors, or why there is none.

    Args:
        table: of the fixed actors; knows what earlier seatings around them found out.
        wanted: how many background guests of each class take part.
    """
    problem = _Problem(guests, table, wanted)
    for rounds in range(1, _MAX_ROUNDS + 1):
        solved = problem.solve()
        if solved is None:
            return f"no arrangement of {sum(wanted.values())} further agents keeps everybody apart"
        barred = table.barred(guests, solved)
        for guest, option in barred:
            problem.bar(guest, option)
        settled = [place for place in solved if place[:2] not in barred]
        broken = table.broken(guests, settled)
        for conflict in broken:
            problem.forbid(conflict)
        if not barred and not broken:
            chosen = {guests[i].name: (guests[i].options[k], start) for i, k, start in solved}
            return Seating(chosen, problem.optimal, rounds, table.evaluated)
    return "the search for an arrangement ran out of rounds"


def seat_in_turn(
    guests: Sequence[Guest], table: Table, wanted: Mapping[AgentClass, int]
) -> Seating | str:
    """Guests seated in the order given until every class has as many as wanted."""
    left = dict(wanted)
    seated: list[tuple[Guest, Option, int]] = []
    for guest in sorted(guests, key=lambda each: not each.foreground):
        if not guest.foreground and left[guest.type] <= 0:
            continue
        found = _first_room(guest, seated, table)
        if found is not None:
            seated.append((guest, *found))
            left[guest.type] -= not guest.foreground
        elif guest.foreground:
            return f"{guest.name} finds no moment at which it would not interact"
    if any(left.values()):
        return f"no room for {sum(left.values())} of {sum(wanted.values())} further agents"
    chosen = {guest.name: (option, start) for guest, option, start in seated}
    return Seating(chosen, optimal=False, rounds=1, pairs=table.evaluated)


def _first_room(
    guest: Guest, seated: list[tuple[Guest, Option, int]], table: Table
) -> tuple[Option, int] | None:
    """The guest's cheapest option with room, and its entry time nearest to the one wished for."""
    options = sorted(guest.options, key=lambda each: each.cost)
    for option in itertools.chain(options, _queueing(guest, seated, table)):
        free = table.clear_of_fixed(option)
        for other, taken, start in seated:
            if not len(free):
                break
            strict = guest.foreground or other.foreground
            free = _outside(free, start, table.between(taken, option, strict))
        if len(free):
            return option, int(free[np.argmin(np.abs(free - option.wish))])
    return None


def _queueing(
    guest: Guest, seated: list[tuple[Guest, Option, int]], table: Table
) -> Iterator[Option]:
    """Lazily, the option behind whoever stands: foreground, wrecks, and those seated."""
    if guest.behind is None:
        return
    present = [option.actor.shifted(STEP * start) for _, option, start in seated]
    option = guest.behind([*table.fixed, *present])
    if option is not None:
        yield option


def _outside(
    free: NDArray[np.int64], start: int, forbidden: list[tuple[int, int]]
) -> NDArray[np.int64]:
    """Entry times whose difference from `start` lies in none of the open intervals."""
    for low, high in forbidden:
        free = free[(free - start <= low) | (free - start >= high)]
    return free


@dataclass(frozen=True)
class _Conflict:
    """Forbids low < start_i - start_j < high [steps] while both options are taken.

    Attributes:
        always: no entry times that the two still have would do.
    """

    i: int
    option_i: int
    j: int
    option_j: int
    low: int
    high: int
    always: bool


class _Problem:
    """The CP-SAT model, growing by one round of pair constraints at a time."""

    def __init__(
        self, guests: Sequence[Guest], table: Table, wanted: Mapping[AgentClass, int]
    ) -> None:
        from ortools.sat.python import cp_model

        self._cp = cp_model
        model: Any = cp_model.CpModel()
        self._model = model
        self.optimal = True
        self._takes: list[list[Any]] = []
        self._starts: list[Any] = []
        costs: list[Any] = []
        for guest in guests:
            takes = [self._model.new_bool_var("") for _ in guest.options]
            self._takes.append(takes)
            self._starts.append(self._start(guest, takes, table))
            if guest.foreground:
                self._model.add_exactly_one(takes)
            else:
                self._model.add_at_most_one(takes)
            costs += _costs(guest, takes)
        for kind, count in wanted.items():
            crowd = [g for g, guest in enumerate(guests) if _counts(guest, kind)]
            self._model.add(sum(take for g in crowd for take in self._takes[g]) == count)
        self._model.minimize(sum(costs))

    def _start(self, guest: Guest, takes: list[Any], table: Table) -> Any:
        """The guest's entry time; options with a choice of it already keep clear of the fixed."""
        everything: Any = None
        for take, option in zip(takes, guest.options, strict=True):
            free = table.open_starts(option)
            if not len(free):
                self._model.add(take == 0)
                continue
            domain = self._cp.Domain.from_values(free.tolist())
            everything = domain if everything is None else everything.union_with(domain)
        if everything is None:
            return self._model.new_constant(0)
        start = self._model.new_int_var_from_domain(everything, "")
        for take, option in zip(takes, guest.options, strict=True):
            free = table.open_starts(option)
            if len(free):
                domain = self._cp.Domain.from_values(free.tolist())
                self._model.add_linear_expression_in_domain(start, domain).only_enforce_if(take)
        return start

    def solve(self) -> list[Place] | None:
        """Who takes part, how and when; None if there is no arrangement."""
        solver: Any = self._cp.CpSolver()
        solver.parameters.num_workers = 1
        solver.parameters.catch_sigint_signal = False
        solver.parameters.random_seed = 1
        solver.parameters.max_deterministic_time = _SOLVER_SECONDS
        solver.parameters.cp_model_presolve = False
        status = solver.solve(self._model)
        if status not in (self._cp.OPTIMAL, self._cp.FEASIBLE):
            return None
        self.optimal &= status == self._cp.OPTIMAL
        return [
            (g, k, solver.value(start))
            for g, (takes, start) in enumerate(zip(self._takes, self._starts, strict=True))
            for k, take in enumerate(takes)
            if solver.value(take)
        ]

    def bar(self, guest: int, option: int) -> None:
        """Takes an option out of the choice."""
        self._model.add(self._takes[guest][option] == 0)

    def forbid(self, conflict: _Conflict) -> None:
        """Adds one separation."""
        taken = (
            self._takes[conflict.i][conflict.option_i],
            self._takes[conflict.j][conflict.option_j],
        )
        either = [~each for each in taken]
        if not conflict.always:
            difference = self._starts[conflict.i] - self._starts[conflict.j]
            below, above = self._model.new_bool_var(""), self._model.new_bool_var("")
            self._model.add(difference <= conflict.low).only_enforce_if(below)
            self._model.add(difference >= conflict.high).only_enforce_if(above)
            either += [below, above]
        self._model.add_bool_or(either)


def _costs(guest: Guest, takes: list[Any]) -> list[Any]:
    """Nats above the guest's likeliest option: who takes part is no matter of likelihood."""
    least = min((option.cost for option in guest.options), default=0.0)
    extra = _SPARE_COST if guest.spare else 0.0
    return [
        round(_SCALE * (option.cost - least + extra)) * take
        for option, take in zip(guest.options, takes, strict=True)
    ]


def _counts(guest: Guest, kind: AgentClass) -> bool:
    return guest.type == kind and not guest.foreground


class Table:
    """Forbidden differences of entry times, computed once per pair of options that meet.

    Args:
        fixed: actors whose times are settled. Options are known by identity: keep them alive.
    """

    def __init__(self, fixed: Iterable[Actor]) -> None:
        self.fixed = list(fixed)
        self._free: dict[int, NDArray[np.int64]] = {}
        self._pairs: dict[tuple[int, int], list[tuple[int, int]]] = {}
        self._geometry = Geometry()
        self.evaluated = 0

    def clear_of_fixed(self, option: Option) -> NDArray[np.int64]:
        """The option's entry times [steps] that keep clear of every fixed actor."""
        key = id(option)
        if key not in self._free:
            free = option.starts
            for actor in self.fixed if len(free) else ():
                shift = round(actor.enters / STEP)
                free = _outside(free, shift, self._forbidden(actor, option.actor, strict=True))
            self._free[key] = free
        return self._free[key]

    def open_starts(self, option: Option) -> NDArray[np.int64]:
        """Entry times to choose among; a single one is checked only once it is chosen."""
        return option.starts if len(option.starts) == 1 else self.clear_of_fixed(option)

    def barred(self, guests: Sequence[Guest], solved: list[Place]) -> list[tuple[int, int]]:
        """(guest, option) that meet a fixed actor after all: of each guest whose choice does."""
        wrong = [g for g, k, _ in solved if not len(self.clear_of_fixed(guests[g].options[k]))]
        return [
            (g, k)
            for g in wrong
            for k, option in enumerate(guests[g].options)
            if len(option.starts) == 1 and not len(self.clear_of_fixed(option))
        ]

    def broken(self, guests: Sequence[Guest], solved: list[Place]) -> list[_Conflict]:
        """Separations that the solution breaks, and their kin: either option with all others."""
        found: dict[tuple[int, ...], _Conflict] = {}
        for n, one in enumerate(solved):
            for other in solved[:n]:
                for conflict in self._kin(guests, one, other):
                    found[astuple(conflict)] = conflict
        return list(found.values())

    def _kin(self, guests: Sequence[Guest], one: Place, other: Place) -> list[_Conflict]:
        (i, option_i, start_i), (j, option_j, start_j) = one, other
        first, second = guests[i].options, guests[j].options
        strict = guests[i].foreground or guests[j].foreground
        between = self.between(second[option_j], first[option_i], strict)
        if not any(low < start_i - start_j < high for low, high in between):
            return []
        pairs = [(k, option_j) for k in range(len(first)) if _flexible(first[k])]
        pairs += [(option_i, k) for k in range(len(second)) if _flexible(second[k])]
        pairs = list(dict.fromkeys([(option_i, option_j), *pairs]))
        return [
            conflict
            for k, m in pairs
            for conflict in self._conflicts((i, k, first[k]), (j, m, second[m]), strict)
        ]

    def _conflicts(
        self, one: tuple[int, int, Option], other: tuple[int, int, Option], strict: bool
    ) -> list[_Conflict]:
        """What the pair of options forbids of the entry times that they still have."""
        (i, k, a), (j, m, b) = one, other
        free_a, free_b = self.open_starts(a), self.open_starts(b)
        if not len(free_a) or not len(free_b):
            return []
        least, most = int(free_a[0] - free_b[-1]), int(free_a[-1] - free_b[0])
        return [
            _Conflict(i, k, j, m, low, high, always=low < least and most < high)
            for low, high in self.between(b, a, strict)
            if low < most and least < high
        ]

    def between(self, a: Option, b: Option, strict: bool) -> list[tuple[int, int]]:
        """What the two options forbid of the difference of their entry times [steps]."""
        key = (id(a), id(b))
        if key not in self._pairs:
            self._pairs[key] = self._forbidden(a.actor, b.actor, strict=strict)
        return self._pairs[key]

    def _forbidden(self, a: Actor, b: Actor, *, strict: bool) -> list[tuple[int, int]]:
        self.evaluated += 1
        return forbidden_offsets(a, b, strict=strict, geometry=self._geometry)


def _flexible(option: Option) -> bool:
    return len(option.starts) > 1


class Geometry:
    """Encounters of paths, computed once per pair of paths."""

    def __init__(self) -> None:
        self._known: dict[tuple[int, int], Encounter | None] = {}
        self._alive: list[Path] = []

    def between(self, a: Actor, b: Actor) -> Encounter | None:
        """Where the two come within the widest clearance; None if they never do."""
        first, second = a.candidate, b.candidate
        key = (id(first.path), id(second.path))
        if key not in self._known:
            self._alive += [first.path, second.path]
            self._known[key] = None if _apart(a, b) else _encounter(first, second)
        return self._known[key]


def _encounter(a: Candidate, b: Candidate) -> Encounter | None:
    shapes = (a.shape, b.shape)
    spacing = (_NODE[a.route.type], _NODE[b.route.type])
    both_walk = a.route.type == b.route.type == "pedestrian"
    reach = (WALKERS if both_walk else FOREGROUND).clearance
    pair = encounter(a.path, b.path, shapes=shapes, reach=reach, spacing=spacing)
    return pair if len(pair.i) else None


def forbidden_offsets(
    a: Actor, b: Actor, *, strict: bool, geometry: Geometry | None = None
) -> list[tuple[int, int]]:
    """Open intervals (low, high) [steps] that o_b - o_a must avoid for the pair not to interact."""
    pair = (geometry or Geometry()).between(a, b)
    if pair is None:
        return []
    zones = [_widened(pair, a.motion, b.motion, _separation(a, b, strict))]
    if any(stop.reason == "gives_way" for stop in a.stops):
        zones.append(_widened(pair, a.free, b.motion, AFTER_YIELD))
        if a.candidate.route.type == "vehicle" and b.candidate.route.type == "pedestrian":
            touch = meeting_offsets(pair, a.motion, b.motion, c=0.0)
            zones.append(touch - [[WALKER_AHEAD, 0.0]])
    return _steps(np.concatenate(zones))


def _separation(a: Actor, b: Actor, strict: bool) -> Separation:
    if a.candidate.route.type == b.candidate.route.type == "pedestrian":
        return WALKERS
    return FOREGROUND if strict else BACKGROUND


def _apart(a: Actor, b: Actor) -> bool:
    """Whether the two paths never come near one another (bounding boxes)."""
    shapes = (a.candidate.shape, b.candidate.shape)
    reach = sum(np.hypot(each.length, each.width) / 2 for each in shapes) + FOREGROUND.clearance
    low_a, high_a = a.candidate.path.xy.min(axis=0), a.candidate.path.xy.max(axis=0)
    low_b, high_b = b.candidate.path.xy.min(axis=0), b.candidate.path.xy.max(axis=0)
    return bool((low_a > high_b + reach).any() or (low_b > high_a + reach).any())


def _widened(pair: Encounter, a: Motion, b: Motion, separation: Separation) -> Intervals:
    """C(clearance) and C(0) widened by the time gap."""
    found = meetings(pair, a, b)
    gap = np.array([[-separation.gap, separation.gap]])
    return np.concatenate([found.within(separation.clearance), found.within(0.0) + gap])


def _steps(intervals: Intervals) -> list[tuple[int, int]]:
    if not len(intervals):
        return []
    ordered = intervals[np.argsort(intervals[:, 0])]
    joined = [list(ordered[0])]
    for low, high in ordered[1:]:
        if low <= joined[-1][1]:
            joined[-1][1] = max(joined[-1][1], high)
        else:
            joined.append([low, high])
    return [(int(np.floor(low / STEP)) - 1, int(np.ceil(high / STEP)) + 1) for low, high in joined]
