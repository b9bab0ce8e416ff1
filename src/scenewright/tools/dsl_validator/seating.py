"""Everybody else at once: the least-cost combination, exactly (paper Eq. 4).

Lazy CP-SAT (ARCHITECTURE section 4). One Boolean per option (a candidate with a time law and
edits), one integer entry time per agent; the summed NLL is least subject to the certificate of no
other interaction. Pair constraints are added only for options actually chosen, until none is
broken, so that the optimum is that of the full model without building it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import astuple, dataclass
from typing import Any

from scenewright.scene.base import AgentClass
from scenewright.tools.dsl_validator.crowd import Guest, Option, Seating, Table

_SCALE = 100
"""Objective units per nat."""

_SOLVER_SECONDS = 0.5
_MAX_ROUNDS = 40
_SPARE_COST = 5.0
"""Nats that a spare guest costs: those drawn first go first."""


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
        barred = _barred(table, guests, solved)
        for guest, option in barred:
            problem.bar(guest, option)
        settled = [place for place in solved if place[:2] not in barred]
        broken = _broken(table, guests, settled)
        for conflict in broken:
            problem.forbid(conflict)
        if not barred and not broken:
            chosen = {guests[i].name: (guests[i].options[k], start) for i, k, start in solved}
            return Seating(chosen, problem.optimal, rounds, table.evaluated)
    return "the search for an arrangement ran out of rounds"


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


def _barred(table: Table, guests: Sequence[Guest], solved: list[Place]) -> list[tuple[int, int]]:
    """(guest, option) that meet a fixed actor after all: of each guest whose choice does."""
    wrong = [g for g, k, _ in solved if not len(table.clear_of_fixed(guests[g].options[k]))]
    return [
        (g, k)
        for g in wrong
        for k, option in enumerate(guests[g].options)
        if len(option.starts) == 1 and not len(table.clear_of_fixed(option))
    ]


def _broken(table: Table, guests: Sequence[Guest], solved: list[Place]) -> list[_Conflict]:
    """Separations that the solution breaks, and their kin: either option with all others."""
    found: dict[tuple[int, ...], _Conflict] = {}
    for n, one in enumerate(solved):
        for other in solved[:n]:
            for conflict in _kin(table, guests, one, other):
                found[astuple(conflict)] = conflict
    return list(found.values())


def _kin(table: Table, guests: Sequence[Guest], one: Place, other: Place) -> list[_Conflict]:
    (i, option_i, start_i), (j, option_j, start_j) = one, other
    first, second = guests[i].options, guests[j].options
    strict = guests[i].foreground or guests[j].foreground
    between = table.between(second[option_j], first[option_i], strict)
    if not any(low < start_i - start_j < high for low, high in between):
        return []
    pairs = [(k, option_j) for k in range(len(first)) if _flexible(first[k])]
    pairs += [(option_i, k) for k in range(len(second)) if _flexible(second[k])]
    pairs = list(dict.fromkeys([(option_i, option_j), *pairs]))
    return [
        conflict
        for k, m in pairs
        for conflict in _conflicts(table, (i, k, first[k]), (j, m, second[m]), strict)
    ]


def _conflicts(
    table: Table, one: tuple[int, int, Option], other: tuple[int, int, Option], strict: bool
) -> list[_Conflict]:
    """What the pair of options forbids of the entry times that they still have."""
    (i, k, a), (j, m, b) = one, other
    free_a, free_b = table.open_starts(a), table.open_starts(b)
    if not len(free_a) or not len(free_b):
        return []
    least, most = int(free_a[0] - free_b[-1]), int(free_a[-1] - free_b[0])
    return [
        _Conflict(i, k, j, m, low, high, always=low < least and most < high)
        for low, high in table.between(b, a, strict)
        if low < most and least < high
    ]


def _flexible(option: Option) -> bool:
    return len(option.starts) > 1
