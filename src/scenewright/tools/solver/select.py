"""Candidate selection (paper Eq. 4): the surviving combination, drawn or likeliest."""

from __future__ import annotations

import heapq
import itertools
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Literal

import numpy as np

from scenewright.geometry.landmarks import Landmarks
from scenewright.geometry.map_areas import MapAreas
from scenewright.scene.base import FloatArray
from scenewright.scene.candidates import AgentCandidates, Candidate, CandidateSet
from scenewright.scene.constraints import ConstraintProgram
from scenewright.scene.frozen_agents import FrozenAgents
from scenewright.scene.selection import Selection
from scenewright.scene.social import ObjectNode
from scenewright.tools.solver.background_assignment import assign_in_turn
from scenewright.tools.solver.context import SolverContext, find_contact_nodes
from scenewright.tools.solver.foreground import ForegroundSolver
from scenewright.tools.solver.frozen_agents import FrozenAgentsSearch
from scenewright.tools.solver.scheduled_agent import PartialSchedule
from scenewright.tools.solver.search import Search, add_tuple_count

_MAP_TUPLES, _MAP_ASSIGNMENTS = 200, 48
"""Tuples, and timings with all other agents, after which `map` returns the best found."""

_MAP_PLAYS, _MAP_STAGINGS, _MAP_FRAMINGS = 4, 8, 8
"""For one tuple: how often it is scheduled afresh, schedules checked each time, and timings in
which all others are assigned."""

_SAME = 1e-6
"""Costs so near one another are equal [nats]."""


class MinCostSearch(Search):
    """Tuples by ascending cost, the other agents cheaply; a bound on what may be cheaper."""

    _patience = None

    def _find_survivor(self) -> Selection | None:
        """Find the least-cost combination: tuples by ascending lower bound, until none can be
        better.

        The bound of a tuple is its own cost and the cheapest candidate of every other agent. A
        tuple that stays above its bound at every moment tried is left undecided: the optimum is
        certain only if it costs no more than the bounds of these.
        """
        others = sum(map(self._compute_least_cost, self._others))
        best: Selection | None = None
        undecided, tried = float("inf"), 0
        draws = [self._pool.agents[name] for name in self._bound]
        for indices in enumerate_best_first([draw.nll + draw.time_nll for draw in draws]):
            choice = dict(zip(self._bound, indices, strict=True))
            floor = others + sum(self._get_cost(name, m) for name, m in choice.items())
            spent = tried >= _MAP_TUPLES or self._glances >= _MAP_ASSIGNMENTS
            if spent or (best is not None and floor >= best.cost - _SAME):
                undecided = min(undecided, floor)
                break
            tried += 1
            found, decided = self._find_cheapest(choice, floor)
            if found is not None and (best is None or found.cost < best.cost):
                best = found
            undecided = undecided if decided else min(undecided, floor)
        if best is None:
            return None
        gap = max(best.cost - undecided, 0.0)
        found = add_tuple_count(best, tried)
        figures = {**found.figures, "gap": gap}
        return replace(found, optimal=gap <= _SAME, figures=figures)

    def _find_cheapest(self, choice: dict[str, int], floor: float) -> tuple[Selection | None, bool]:
        """Find the cheapest selection with a tuple, and whether it is certain that none is
        cheaper."""
        set_up = self._set_up(choice)
        if set_up is None:
            return None, True
        best: Selection | None = None
        before, framings = self._staged, 0
        for schedule in self._list_schedules(*set_up):
            self._staged += 1
            timed = self._time_schedule(schedule, choice)
            if timed is None:
                continue
            framings += 1
            self._glances += 1
            fixed = [actor.cut_after(timed.duration) for actor in timed.schedule.actors.values()]
            others = self._list_background(timed, [each.name for each in self._others])
            assignment = assign_in_turn(others, fixed, self._pool.background, self._pool.least)
            if isinstance(assignment, str):
                self._failures[assignment] += 1
            else:
                selection = self._build_selection(timed, choice, assignment)
                if selection.cost <= floor + _SAME:
                    return selection, True
                best = min(best or selection, selection, key=lambda each: each.cost)
            if framings >= _MAP_FRAMINGS:
                break
        if self._staged == before:
            pairs = ((set_up[0][c.first], set_up[0][str(c.second)]) for c in self._events)
            return None, not all(find_contact_nodes(*pair).touches for pair in pairs)
        return best, False

    def _list_candidates(self, draws: AgentCandidates) -> Iterable[int]:
        """Rank candidates by ascending cost."""
        return [int(m) for m in np.argsort(draws.nll + draws.time_nll, kind="stable")]

    def _list_schedules(
        self, candidates: Mapping[str, Candidate], landmarks: Mapping[str, Landmarks]
    ) -> Iterator[PartialSchedule]:
        """List schedules of a tuple, drawn afresh several times."""
        context = SolverContext(
            candidates, landmarks, self._rng, lenient=self._lenient,
            misses=self._shortfalls, yielding_model=self._pool.yielding_model,
        )  # fmt: skip
        stage = ForegroundSolver(context)
        for _ in range(_MAP_PLAYS):
            played = itertools.islice(
                stage.schedule_all(self._events, PartialSchedule()), _MAP_STAGINGS
            )
            yield from filter(self._runs_come_first, played)

    @cached_property
    def _others(self) -> list[AgentCandidates]:
        """All agents but the foreground tuple and the reserve, by their least cost."""
        others = [each for name, each in self._pool.agents.items() if name not in self._bound]
        return sorted((o for o in others if not o.reserve), key=self._compute_least_cost)

    def _compute_least_cost(self, draws: AgentCandidates) -> float:
        """Compute the least cost of an agent's candidates that meet every unary clause; inf if
        none."""
        for m in self._list_candidates(draws):
            if self._get_candidate(draws.name, m) is not None:
                return self._get_cost(draws.name, m)
        return float("inf")


def enumerate_best_first(costs: Sequence[FloatArray]) -> Iterator[tuple[int, ...]]:
    """Enumerate choices of one index per array by ascending sum of their costs.

    Args:
        costs: one array per agent: the cost of each of its candidates [nats].
    """
    orders = [np.argsort(cost, kind="stable") for cost in costs]
    ranked = [each[order] for each, order in zip(costs, orders, strict=True)]
    start = (0,) * len(costs)
    heap, seen = [(_sum_costs(ranked, start), start)], {start}
    while heap:
        _, ranks = heapq.heappop(heap)
        yield tuple(int(order[rank]) for order, rank in zip(orders, ranks, strict=True))
        for axis, rank in enumerate(ranks):
            step = (*ranks[:axis], rank + 1, *ranks[axis + 1 :])
            if rank + 1 < len(ranked[axis]) and step not in seen:
                seen.add(step)
                heapq.heappush(heap, (_sum_costs(ranked, step), step))


def _sum_costs(costs: Sequence[FloatArray], ranks: tuple[int, ...]) -> float:
    return float(sum(cost[rank] for cost, rank in zip(costs, ranks, strict=True)))


Mode = Literal["draw", "map"]


def select(
    program: ConstraintProgram,
    pool: CandidateSet,
    *,
    map_areas: MapAreas,
    rng: np.random.Generator,
    mode: Mode = "draw",
    lenient: bool = True,
    frozen: FrozenAgents | None = None,
    objects: Sequence[ObjectNode] = (),
) -> Selection:
    """Select the surviving combination.

    Args:
        mode: `draw`, the first survivor in the order drawn; `map`, the one of least cost.
        lenient: accept schedules that drivers would choose differently, if they do what was asked.
        frozen: agents of an earlier version that stay; the first survivor around them is taken.
        objects: the objects in the scene, to be placed.

    Raises:
        Rejected: `no_surviving_combination`, naming the clause that most tuples fail.
    """
    if frozen is not None:
        return FrozenAgentsSearch(
            program, pool, map_areas, rng, lenient, frozen=frozen, objects=objects
        ).run()
    search = MinCostSearch if mode == "map" else Search
    return search(program, pool, map_areas, rng, lenient, objects=objects).run()
