"""Everybody else at once: the least-cost combination, exactly (paper Eq. 4).

Every guest offers candidates, each with the options (time laws, edits, entry times) that it allows;
the summed cost is least subject to the certificate of no other interaction. Three steps, each of
which may already prove the optimum:

1. In turn: each guest takes its cheapest option, at the free moment nearest to its wish. Nothing
   can cost less.
2. Windows: of each guest only options that cost little more than its cheapest. Whoever takes an
   option from outside pays for it alone more than the window is wide, so an optimum that costs no
   more than the narrowest window is the optimum of all. Else the windows grow, where nobody finds
   room only those of the guests that are in one another's way.
3. In the windows, lazy CP-SAT: one Boolean per option, one integer entry time per guest. What two
   options forbid of one another is computed and added only once a solution breaks it, until none
   does, so that the optimum is that of the full model without building it.
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
"""First window [nats], and by how much one grows that is too narrow."""

_MOST_SECONDS, _MOST_PAIRS = 1.0, 4000
"""The solver's deterministic time, and pairs of options looked at, that one search may take."""

_KIN = 8
"""Options of either guest that are compared with the other's when two are in each other's way."""

_CLEAR_STEPS = 30
"""Whoever leaves this long before another comes [steps] is out of its way: the widest gap."""


def assign_min_cost(
    agents: Sequence[AgentOffers],
    table: ConflictTable,
    wanted: Mapping[AgentClass, int],
    *,
    effort: float = 1.0,
) -> Assignment | str:
    """The least-cost seating around the fixed actors, or why there is none.

    Args:
        table: of the fixed actors; knows what earlier seatings around them found out.
        wanted: how many background guests of each class take part.
        effort: share of the bounds of the search that may be spent before it settles for what it
            has, or gives up.
    """
    return _Search(agents, table, wanted, effort).run()


def assign_cheapest(
    agents: Sequence[AgentOffers], table: ConflictTable, wanted: Mapping[AgentClass, int]
) -> Assignment | None:
    """Step 1 alone: everybody on its cheapest option, at once; None if that does not come off."""
    return _Search(agents, table, wanted, 0.0).at_a_glance()


class _Search:
    """One call of `assign_min_cost`."""

    def __init__(
        self,
        agents: Sequence[AgentOffers],
        table: ConflictTable,
        wanted: Mapping[AgentClass, int],
        effort: float,
    ) -> None:
        menus = [OptionWindow(agent) for agent in agents]
        self._state = SearchState(table, menus, _needs(agents, wanted), effort * _MOST_SECONDS)
        self._table, self._menus, self._option = table, menus, self._state.option
        self._most_pairs = table.evaluated + effort * _MOST_PAIRS
        self._rounds = 0

    def at_a_glance(self) -> Assignment | None:
        """Everybody on its cheapest option, if it comes off in turn."""
        best = None if self._short() else self._in_turn()
        if best is None or best.cost > self._floor():
            return None
        return self._seating(best, optimal=True)

    def run(self) -> Assignment | str:
        """The least-cost seating, or why there is none."""
        if self._short():
            return self._short()
        assignment = self.at_a_glance()
        if assignment is not None:
            return assignment
        self._widen(range(len(self._menus)), round(SCALE * _WINDOW))
        best = self._in_turn()
        answer = WindowResult(best, proven=best is not None and best.cost <= self._floor())
        while not answer.proven:
            answer = self._in_window(best)
            best = answer.found or best
            if not answer.proven:
                break
            answer = self._judged(answer, best)
        if best is None:
            return self._reason(answer)
        return self._seating(best, optimal=answer.proven)

    def _short(self) -> str:
        """Which class has too few guests; empty if none has."""
        short = (need for need in self._state.needs if len(need.agents) < need.count)
        return "".join(f"only {len(each.agents)} of {each.count} agents came" for each in short)

    def _judged(self, answer: WindowResult, best: FoundAssignment | None) -> WindowResult:
        """The answer as one for everything; unproven, and windows wider, if it is not."""
        everybody = range(len(self._menus))
        if best is not None:
            narrow = [g for g in everybody if self._menus[g].width < best.cost - 1]
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

    def _floor(self) -> int:
        """What any arrangement costs at least [units]."""
        return sum(
            sum(sorted(self._menus[g].least for g in need.agents)[: need.count])
            for need in self._state.needs
        )

    def _in_turn(self, only: Mapping[int, int] | None = None) -> FoundAssignment | None:
        """Everybody's cheapest way with room beside those before it; None if that fails.

        Args:
            only: the way that each guest shall take, if it is settled.
        """
        present, places = ReservationTable(self._table.fixed), list[Placement]()
        for need in self._state.needs:
            left = need.count
            for g in sorted(need.agents, key=lambda g: self._menus[g].least):
                room = self._room(g, present, only) if left else None
                if room is not None:
                    places.append((g, *room))
                    left -= 1
                    actor = self._option(g, room[0]).actor.shifted(STEP * room[1])
                    present.add(actor, foreground=self._menus[g].agent.foreground)
            if left:
                return None
        return FoundAssignment(places, sum(self._menus[g].ways[k].cost for g, k, _ in places))

    def _room(
        self, g: int, present: ReservationTable, only: Mapping[int, int] | None
    ) -> tuple[int, int] | None:
        menu = self._menus[g]
        settled = None if only is None else [only[g]] if g in only else []
        for k in menu.window() if settled is None else settled:
            option = menu.ways[k].option
            free = self._table.clear_of_fixed(option)
            if len(free):
                free = present.find_free_times(option.actor, free, foreground=menu.agent.foreground)
            if len(free):
                return k, int(free[np.argmin(np.abs(free - option.drawn_time))])
        return None

    def _in_window(self, best: FoundAssignment | None) -> WindowResult:
        """The least-cost arrangement within the windows that costs less than `best`."""
        model = AssignmentModel(self._state, best)
        while self._state.seconds > 0.0 and self._table.evaluated < self._most_pairs:
            self._rounds += 1
            answer = model.solve()
            if answer.found is None:
                return answer if best is not None else self._blamed(answer)
            blocked = self._bar(answer.found.places, model)
            broken = self._broken(answer.found.places)
            for conflict in broken:
                model.forbid(conflict)
            if not blocked and not broken:
                return answer
        return WindowResult(None, proven=False)

    def _blamed(self, answer: WindowResult) -> WindowResult:
        """With the needs that cannot be met together within the windows."""
        if not answer.proven:
            return answer
        return replace(answer, core=AssignmentModel(self._state, None, explain=True).core())

    def _bar(self, places: list[Placement], model: AssignmentModel) -> bool:
        """Whether one of the options taken meets a fixed actor after all; if so, all its like."""
        wrong = [g for g, k, _ in places if not len(self._table.clear_of_fixed(self._option(g, k)))]
        for g in wrong:
            for k in self._menus[g].window():
                option = self._option(g, k)
                if len(option.starts) == 1 and not len(self._table.clear_of_fixed(option)):
                    self._state.blocked.add((g, k))
                    model.bar(g, k)
        return bool(wrong)

    def _broken(self, places: list[Placement]) -> list[OptionConflict]:
        """Separations that the arrangement breaks, and their kin: either option with all others."""
        return [
            conflict
            for n, one in enumerate(places)
            for other in places[:n]
            if self._breaks(one, other)
            for key in self._kin(one, other)
            for conflict in self._learned(key)
        ]

    def _breaks(self, one: Placement, other: Placement) -> bool:
        (i, k, start_i), (j, m, start_j) = one, other
        a, b = self._option(i, k), self._option(j, m)
        if _far_apart(a.actor, b.actor, start_j - start_i):
            return False
        if _far_apart(b.actor, a.actor, start_i - start_j):
            return False
        forbidden = self._table.between(b, a, self._strict(i, j))
        return any(low < start_i - start_j < high for low, high in forbidden)

    def _kin(self, one: Placement, other: Placement) -> list[OptionPair]:
        """The pair of options, and the cheapest unknown pairs of either with others."""
        (i, k, _), (j, m, _) = one, other
        mine = ((i, x, j, m) for x in self._menus[i].window())
        theirs = ((i, k, j, y) for y in self._menus[j].window())
        new = [
            itertools.islice((key for key in keys if key not in self._state.conflicts), _KIN)
            for keys in (mine, theirs)
        ]
        return [(i, k, j, m), *itertools.chain.from_iterable(new)]

    def _learned(self, key: OptionPair) -> list[OptionConflict]:
        """What the pair of options forbids of the entry times that they have; nothing if known."""
        if key in self._state.conflicts:
            return []
        i, k, j, m = key
        a, b = self._option(i, k), self._option(j, m)
        free_a, free_b = self._table.open_starts(a), self._table.open_starts(b)
        found: list[OptionConflict] = []
        if len(free_a) and len(free_b):
            least, most = int(free_a[0] - free_b[-1]), int(free_a[-1] - free_b[0])
            found = [
                OptionConflict(key, low, high, below=least <= low, above=high <= most)
                for low, high in self._table.between(b, a, self._strict(i, j))
                if low < most and least < high
            ]
        self._state.conflicts[key] = found
        return found

    def _strict(self, i: int, j: int) -> bool:
        return self._menus[i].agent.foreground or self._menus[j].agent.foreground

    def _seating(self, best: FoundAssignment, *, optimal: bool) -> Assignment:
        if self._rounds:
            best = self._in_turn({g: k for g, k, _ in best.places}) or best
        chosen = {
            self._menus[g].agent.name: (self._option(g, k), start) for g, k, start in best.places
        }
        return Assignment(chosen, optimal, self._rounds, self._table.evaluated)

    def _reason(self, answer: WindowResult) -> str:
        if not answer.proven:
            return "no arrangement of the further agents was found within the bounds of the search"
        names = [self._menus[g].agent.name for need in answer.core for g in need.agents]
        if len(names) == 1:
            return f"{names[0]} finds no moment at which it would not interact"
        wanted = sum(need.count for need in answer.core)
        few = "" if wanted == len(names) else f"{wanted} of "
        return f"no arrangement keeps {few}{', '.join(sorted(names))} apart"


def _needs(
    agents: Sequence[AgentOffers], wanted: Mapping[AgentClass, int]
) -> tuple[AgentQuota, ...]:
    """The foreground, and so many of each class; each guest by itself where all are needed."""
    needs = [AgentQuota((g,), 1) for g, agent in enumerate(agents) if agent.foreground]
    for kind, count in wanted.items():
        crowd = [g for g, agent in enumerate(agents) if agent.type == kind and not agent.foreground]
        if count == len(crowd):
            needs += [AgentQuota((g,), 1) for g in crowd]
        else:
            needs.append(AgentQuota(tuple(crowd), count))
    return tuple(needs)


def _far_apart(one: ScheduledAgent, other: ScheduledAgent, steps: int) -> bool:
    """Whether `other`, who comes `steps` after `one`, comes too late to meet it."""
    gives_way = any(stop.reason == "gives_way" for stop in (*one.stops, *other.stops))
    if one.motion.ended or gives_way:
        return False
    return steps > len(one.motion.s) + _CLEAR_STEPS
