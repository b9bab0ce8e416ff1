"""The CP-SAT model of an assignment: the option of each agent, and when it enters."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import reduce
from typing import Any

import numpy as np

from scenewright.tools.solver.background_assignment import ConflictTable, Option
from scenewright.tools.solver.offers import OptionWindow
from scenewright.tools.solver.reservation import Steps
from scenewright.work_limit import count_work

Placement = tuple[int, int, int]
"""Agent, option and entry time [steps]."""

OptionPair = tuple[int, int, int, int]
"""Agent and option of one, agent and option of another."""


@dataclass(frozen=True)
class AgentQuota:
    """So many of these agents must take part."""

    agents: tuple[int, ...]
    count: int


@dataclass(frozen=True)
class FoundAssignment:
    """An assignment and its cost [units]."""

    places: list[Placement]
    cost: int


@dataclass(frozen=True)
class OptionConflict:
    """Forbids low < start_i - start_j < high [steps] while both options are taken.

    Attributes:
        key: of agents i and j.
        below, above: whether the two have entry times left on that side.
    """

    key: OptionPair
    low: int
    high: int
    below: bool
    above: bool


@dataclass(frozen=True)
class WindowResult:
    """The result of one window.

    Attributes:
        found: the least-cost assignment in it; None if there is none.
        proven: whether that is certain.
        core: needs that cannot be met together; of no meaning where something was found.
    """

    found: FoundAssignment | None
    proven: bool
    core: tuple[AgentQuota, ...] = ()


@dataclass
class SearchState:
    """State of a search.

    Attributes:
        menus: by agent.
        conflicts: what pairs of options forbid, as far as computed.
        blocked: (agent, option) that conflict with an agent scheduled already.
        seconds: deterministic time that the solver may still spend.
    """

    table: ConflictTable
    menus: list[OptionWindow]
    needs: tuple[AgentQuota, ...]
    seconds: float
    conflicts: dict[OptionPair, list[OptionConflict]] = field(default_factory=dict)
    blocked: set[tuple[int, int]] = field(default_factory=set)

    def get_option(self, g: int, k: int) -> Option:
        """Return the k-th option of an agent."""
        return self.menus[g].ways[k].option

    def list_open_options(self, g: int) -> list[int]:
        """List the options within an agent's window that have entry times left."""
        return [
            k
            for k in self.menus[g].list_in_window()
            if (g, k) not in self.blocked and len(self.table.list_open_times(self.get_option(g, k)))
        ]


class AssignmentModel:
    """The CP-SAT model of the windows, growing by one round of conflicts at a time.

    Args:
        best: an assignment must cost less.
        explain: ask only which needs cannot be met together, if they cannot; costs do not matter.
    """

    def __init__(
        self, state: SearchState, best: FoundAssignment | None, *, explain: bool = False
    ) -> None:
        from ortools.sat.python import cp_model

        self._cp, self._state = cp_model, state
        self._model: Any = cp_model.CpModel()
        ways = [state.list_open_options(g) for g in range(len(state.menus))]
        self._takes = [{k: self._model.new_bool_var("") for k in each} for each in ways]
        self._starts = [self._add_entry_time(g) for g in range(len(ways))]
        self._literals: dict[int, AgentQuota] = {}
        for takes in self._takes:
            self._model.add_at_most_one(takes.values())
        for need in state.needs:
            self._add_quota(need, explain=explain)
        if not explain:
            self._minimize_cost(best)
        for conflicts in state.conflicts.values():
            for conflict in conflicts:
                self.add_conflict(conflict)

    def _add_entry_time(self, g: int) -> Any:
        """Add the agent's entry time; options with several already avoid the fixed agents."""
        table, takes = self._state.table, self._takes[g]
        domains = {
            k: self._build_domain(table.list_open_times(self._state.get_option(g, k)))
            for k in takes
        }
        if not domains:
            return self._model.new_constant(0)
        everything = reduce(lambda one, other: one.union_with(other), domains.values())
        start = self._model.new_int_var_from_domain(everything, "")
        for k, domain in domains.items():
            self._model.add_linear_expression_in_domain(start, domain).only_enforce_if(takes[k])
        return start

    def _build_domain(self, starts: Steps) -> Any:
        gaps = np.flatnonzero(np.diff(starts) > 1)
        low, high = starts[np.append(0, gaps + 1)], starts[np.append(gaps, len(starts) - 1)]
        return self._cp.Domain.from_intervals(np.column_stack([low, high]).tolist())

    def _add_quota(self, need: AgentQuota, *, explain: bool) -> None:
        met = self._model.add(
            sum(take for g in need.agents for take in self._takes[g].values()) == need.count
        )
        if explain:
            literal = self._model.new_bool_var("")
            met.only_enforce_if(literal)
            self._literals[literal.index] = need
            self._model.add_assumption(literal)

    def _minimize_cost(self, best: FoundAssignment | None) -> None:
        total = sum(
            self._state.menus[g].ways[k].cost * take
            for g, takes in enumerate(self._takes)
            for k, take in takes.items()
        )
        self._model.minimize(total)
        if best is not None:
            self._model.add(total <= best.cost - 1)

    def solve(self) -> WindowResult:
        """Find the least-cost assignment that breaks no known conflict."""
        solver, status = self._run()
        if status == self._cp.INFEASIBLE:
            return WindowResult(None, proven=True)
        if status not in (self._cp.OPTIMAL, self._cp.FEASIBLE):
            return WindowResult(None, proven=False)
        places = [
            (g, k, int(solver.value(self._starts[g])))
            for g, takes in enumerate(self._takes)
            for k, take in takes.items()
            if solver.value(take)
        ]
        cost = sum(self._state.menus[g].ways[k].cost for g, k, _ in places)
        return WindowResult(FoundAssignment(places, cost), proven=status == self._cp.OPTIMAL)

    def find_core_quotas(self) -> tuple[AgentQuota, ...]:
        """Find quotas that cannot be met together; all of them if nothing better is known."""
        solver, status = self._run()
        if status != self._cp.INFEASIBLE:
            return self._state.needs
        literals = solver.sufficient_assumptions_for_infeasibility()
        return tuple(self._literals[literal] for literal in literals) or self._state.needs

    def _run(self) -> tuple[Any, Any]:
        solver: Any = self._cp.CpSolver()
        solver.parameters.num_workers = 1
        solver.parameters.catch_sigint_signal = False
        solver.parameters.random_seed = 1
        solver.parameters.max_deterministic_time = max(self._state.seconds, 0.0)
        solver.parameters.cp_model_presolve = False
        count_work()
        status = solver.solve(self._model)
        self._state.seconds -= solver.response_proto.deterministic_time
        return solver, status

    def forbid_option(self, agent: int, option: int) -> None:
        """Forbid an option, if it is in the model."""
        if option in self._takes[agent]:
            self._model.add(self._takes[agent][option] == 0)

    def add_conflict(self, conflict: OptionConflict) -> None:
        """Add one conflict, if both options are in the model."""
        i, k, j, m = conflict.key
        if k not in self._takes[i] or m not in self._takes[j]:
            return
        either = [~self._takes[i][k], ~self._takes[j][m]]
        difference = self._starts[i] - self._starts[j]
        for possible, side in (
            (conflict.below, difference <= conflict.low),
            (conflict.above, difference >= conflict.high),
        ):
            if possible:
                literal = self._model.new_bool_var("")
                self._model.add(side).only_enforce_if(literal)
                either.append(literal)
        self._model.add_bool_or(either)
