"""Assignment of all background agents at once: the least-cost combination, exactly (paper Eq. 4).

Each background agent offers candidates, each with the options (driving profile, edits, entry
times) that it allows; the summed cost is least subject to the certificate of no other interaction.
Three steps, each of which may already prove the optimum:

1. Sequential: each agent takes its cheapest option, at the free entry time nearest to the drawn
   one. Nothing can cost less.
2. Windows: of each agent only options that cost little more than its cheapest. An option from
   outside alone costs more than the window is wide, so an optimum that costs no more than the
   narrowest window is the optimum of all. Otherwise the windows grow; where the problem is
   infeasible only those of the agents in conflict with one another.
3. Within the windows, lazy CP-SAT: one Boolean per option, one integer entry time per agent. What
   two options forbid of one another is computed and added only once a solution breaks it, until
   none does, so that the optimum is that of the full model without building it.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from scenewright.scene.base import AgentClass
from scenewright.scene.track import STEP
from scenewright.tools.solver.assignment_model import (
    AgentQuota,
    AssignmentModel,
    FoundAssignment,
    OptionConflict,
    OptionPair,
    Placement,
    SearchState,
    WindowResult,
)
from scenewright.tools.solver.background_assignment import Assignment, ConflictTable
from scenewright.tools.solver.offers import SCALE, AgentOffers, OptionWindow
from scenewright.tools.solver.reservation import ReservationTable
from scenewright.tools.solver.scheduled_agent import ScheduledAgent

_WINDOW, _WIDER = 1.0, 2
"""First window [nats], and the factor by which a window grows that is too narrow."""

_MOST_SECONDS, _MOST_PAIRS = 1.0, 4000
"""The solver's deterministic time, and pairs of options looked at, that one search may take."""

_KIN = 8
"""Options of either agent that are compared with the other's when two are in conflict."""

_CLEAR_STEPS = 30
"""An agent that leaves this long before another comes [steps] cannot meet it: the widest gap."""


def assign_min_cost(
    agents: Sequence[AgentOffers],
    table: ConflictTable,
    wanted: Mapping[AgentClass, int],
    *,
    effort: float = 1.0,
) -> Assignment | str:
    """Find the least-cost assignment around the fixed agents, or the reason why there is none.

    Args:
        table: of the fixed agents; keeps what earlier assignments around them computed.
        wanted: how many background agents of each class take part.
        effort: share of the bounds of the search that may be spent before it settles for what it
            has, or gives up.
    """
    return _Search(agents, table, wanted, effort).run()


def assign_cheapest(
    agents: Sequence[AgentOffers], table: ConflictTable, wanted: Mapping[AgentClass, int]
) -> Assignment | None:
    """Run step 1 alone: each agent's cheapest option; None if these conflict."""
    return _Search(agents, table, wanted, 0.0).assign_cheapest_options()


class _Search:
    """State of one call of `assign_min_cost`."""

    def __init__(
        self,
        agents: Sequence[AgentOffers],
        table: ConflictTable,
        wanted: Mapping[AgentClass, int],
        effort: float,
    ) -> None:
        menus = [OptionWindow(agent) for agent in agents]
        self._state = SearchState(
            table, menus, _list_quotas(agents, wanted), effort * _MOST_SECONDS
        )
        self._table, self._menus, self._option = table, menus, self._state.get_option
        self._most_pairs = table.evaluated + effort * _MOST_PAIRS
        self._rounds = 0

    def assign_cheapest_options(self) -> Assignment | None:
        """Assign each agent its cheapest option; None if these conflict."""
        best = None if self._find_short_class() else self._assign_sequentially()
        if best is None or best.cost > self._compute_lower_bound():
            return None
        return self._build_assignment(best, optimal=True)

    def run(self) -> Assignment | str:
        """Find the least-cost assignment, or the reason why there is none."""
        if self._find_short_class():
            return self._find_short_class()
        assignment = self.assign_cheapest_options()
        if assignment is not None:
            return assignment
        self._widen(range(len(self._menus)), round(SCALE * _WINDOW))
        best = self._assign_sequentially()
        answer = WindowResult(
            best, proven=best is not None and best.cost <= self._compute_lower_bound()
        )
        while not answer.proven:
            answer = self._solve_in_window(best)
            best = answer.found or best
            if not answer.proven:
                break
            answer = self._extend_to_full_problem(answer, best)
        if best is None:
            return self._describe_failure(answer)
        return self._build_assignment(best, optimal=answer.proven)

    def _find_short_class(self) -> str:
        """Return the class with too few agents; empty if there is none."""
        short = (need for need in self._state.needs if len(need.agents) < need.count)
        return "".join(f"only {len(each.agents)} of {each.count} agents came" for each in short)

    def _extend_to_full_problem(
        self, answer: WindowResult, best: FoundAssignment | None
    ) -> WindowResult:
        """Turn a window's result into one of the full problem; if it is none, widen the windows."""
        all_agents = range(len(self._menus))
        if best is not None:
            narrow = [g for g in all_agents if self._menus[g].width < best.cost - 1]
            narrow = [g for g in narrow if not self._menus[g].complete]
            if not narrow:
                return WindowResult(best, proven=True)
            width = _WIDER * min(self._menus[g].width for g in narrow)
            self._widen(narrow, min(width, best.cost - 1))
            return WindowResult(best, proven=False)
        in_the_way = {g for need in answer.core for g in need.agents}
        narrow = [g for g in in_the_way if not self._menus[g].complete]
        if not narrow:
            return answer
        self._widen(narrow, _WIDER * min(self._menus[g].width for g in narrow))
        return WindowResult(None, proven=False)

    def _widen(self, agents: Iterable[int], width: int) -> None:
        for g in agents:
            self._menus[g].widen(width)

    def _compute_lower_bound(self) -> int:
        """Compute a lower bound on the cost of any assignment [units]."""
        return sum(
            sum(sorted(self._menus[g].least for g in need.agents)[: need.count])
            for need in self._state.needs
        )

    def _assign_sequentially(self, only: Mapping[int, int] | None = None) -> FoundAssignment | None:
        """Give each agent its cheapest feasible option, in order; None if one has none.

        Args:
            only: the option that each agent shall take, if it is settled.
        """
        present, places = ReservationTable(self._table.fixed), list[Placement]()
        for need in self._state.needs:
            left = need.count
            for g in sorted(need.agents, key=lambda g: self._menus[g].least):
                room = self._find_free_option(g, present, only) if left else None
                if room is not None:
                    places.append((g, *room))
                    left -= 1
                    actor = self._option(g, room[0]).actor.shift(STEP * room[1])
                    present.add(actor, foreground=self._menus[g].agent.foreground)
            if left:
                return None
        return FoundAssignment(places, sum(self._menus[g].ways[k].cost for g, k, _ in places))

    def _find_free_option(
        self, g: int, present: ReservationTable, only: Mapping[int, int] | None
    ) -> tuple[int, int] | None:
        menu = self._menus[g]
        settled = None if only is None else [only[g]] if g in only else []
        for k in menu.list_in_window() if settled is None else settled:
            option = menu.ways[k].option
            free = self._table.list_clear_times(option)
            if len(free):
                free = present.find_free_times(option.actor, free, foreground=menu.agent.foreground)
            if len(free):
                return k, int(free[np.argmin(np.abs(free - option.drawn_time))])
        return None

    def _solve_in_window(self, best: FoundAssignment | None) -> WindowResult:
        """Find the least-cost assignment within the windows that costs less than `best`."""
        model = AssignmentModel(self._state, best)
        while self._state.seconds > 0.0 and self._table.evaluated < self._most_pairs:
            self._rounds += 1
            answer = model.solve()
            if answer.found is None:
                return answer if best is not None else self._add_core(answer)
            blocked = self._forbid_blocked_option(answer.found.places, model)
            broken = self._find_broken_conflicts(answer.found.places)
            for conflict in broken:
                model.add_conflict(conflict)
            if not blocked and not broken:
                return answer
        return WindowResult(None, proven=False)

    def _add_core(self, answer: WindowResult) -> WindowResult:
        """Add the quotas that cannot be met together within the windows."""
        if not answer.proven:
            return answer
        return replace(
            answer, core=AssignmentModel(self._state, None, explain=True).find_core_quotas()
        )

    def _forbid_blocked_option(self, places: list[Placement], model: AssignmentModel) -> bool:
        """Return whether an option taken meets a fixed agent; if so, forbid all options like it."""
        wrong = [
            g for g, k, _ in places if not len(self._table.list_clear_times(self._option(g, k)))
        ]
        for g in wrong:
            for k in self._menus[g].list_in_window():
                option = self._option(g, k)
                if len(option.starts) == 1 and not len(self._table.list_clear_times(option)):
                    self._state.blocked.add((g, k))
                    model.forbid_option(g, k)
        return bool(wrong)

    def _find_broken_conflicts(self, places: list[Placement]) -> list[OptionConflict]:
        """Find conflicts that the assignment breaks, and those of similar option pairs."""
        return [
            conflict
            for n, one in enumerate(places)
            for other in places[:n]
            if self._are_in_conflict(one, other)
            for key in self._list_similar_pairs(one, other)
            for conflict in self._compute_conflicts(key)
        ]

    def _are_in_conflict(self, one: Placement, other: Placement) -> bool:
        (i, k, start_i), (j, m, start_j) = one, other
        a, b = self._option(i, k), self._option(j, m)
        if _comes_too_late(a.actor, b.actor, start_j - start_i):
            return False
        if _comes_too_late(b.actor, a.actor, start_i - start_j):
            return False
        forbidden = self._table.compute_conflicts(b, a, self._needs_strict_margin(i, j))
        return any(low < start_i - start_j < high for low, high in forbidden)

    def _list_similar_pairs(self, one: Placement, other: Placement) -> list[OptionPair]:
        """List the pair of options, and the cheapest unknown pairs of either with others."""
        (i, k, _), (j, m, _) = one, other
        mine = ((i, x, j, m) for x in self._menus[i].list_in_window())
        theirs = ((i, k, j, y) for y in self._menus[j].list_in_window())
        new = [
            itertools.islice((key for key in keys if key not in self._state.conflicts), _KIN)
            for keys in (mine, theirs)
        ]
        return [(i, k, j, m), *itertools.chain.from_iterable(new)]

    def _compute_conflicts(self, key: OptionPair) -> list[OptionConflict]:
        """Compute what a pair of options forbids of their entry times; empty if known already."""
        if key in self._state.conflicts:
            return []
        i, k, j, m = key
        a, b = self._option(i, k), self._option(j, m)
        free_a, free_b = self._table.list_open_times(a), self._table.list_open_times(b)
        found: list[OptionConflict] = []
        if len(free_a) and len(free_b):
            least, most = int(free_a[0] - free_b[-1]), int(free_a[-1] - free_b[0])
            found = [
                OptionConflict(key, low, high, below=least <= low, above=high <= most)
                for low, high in self._table.compute_conflicts(
                    b, a, self._needs_strict_margin(i, j)
                )
                if low < most and least < high
            ]
        self._state.conflicts[key] = found
        return found

    def _needs_strict_margin(self, i: int, j: int) -> bool:
        return self._menus[i].agent.foreground or self._menus[j].agent.foreground

    def _build_assignment(self, best: FoundAssignment, *, optimal: bool) -> Assignment:
        if self._rounds:
            best = self._assign_sequentially({g: k for g, k, _ in best.places}) or best
        chosen = {
            self._menus[g].agent.name: (self._option(g, k), start) for g, k, start in best.places
        }
        return Assignment(chosen, optimal, self._rounds, self._table.evaluated)

    def _describe_failure(self, answer: WindowResult) -> str:
        if not answer.proven:
            return "no arrangement of the further agents was found within the bounds of the search"
        names = [self._menus[g].agent.name for need in answer.core for g in need.agents]
        if len(names) == 1:
            return f"{names[0]} finds no moment at which it would not interact"
        wanted = sum(need.count for need in answer.core)
        few = "" if wanted == len(names) else f"{wanted} of "
        return f"no arrangement keeps {few}{', '.join(sorted(names))} apart"


def _list_quotas(
    agents: Sequence[AgentOffers], wanted: Mapping[AgentClass, int]
) -> tuple[AgentQuota, ...]:
    """List the quotas: the foreground, so many of each class; each agent if all are needed."""
    needs = [AgentQuota((g,), 1) for g, agent in enumerate(agents) if agent.foreground]
    for kind, count in wanted.items():
        members = [
            g for g, agent in enumerate(agents) if agent.type == kind and not agent.foreground
        ]
        if count == len(members):
            needs += [AgentQuota((g,), 1) for g in members]
        else:
            needs.append(AgentQuota(tuple(members), count))
    return tuple(needs)


def _comes_too_late(one: ScheduledAgent, other: ScheduledAgent, steps: int) -> bool:
    """Return whether `other`, which comes `steps` after `one`, comes too late to meet it."""
    gives_way = any(stop.reason == "gives_way" for stop in (*one.stops, *other.stops))
    if one.motion.ended or gives_way:
        return False
    return steps > len(one.motion.s) + _CLEAR_STEPS
