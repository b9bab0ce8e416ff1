"""The least-cost combination (paper Eq. 4): tuples by ascending cost, everybody else at once."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from scenewright.geometry.landmarks import Landmarks
from scenewright.scene.base import AgentClass
from scenewright.scene.candidates import AgentCandidates, Candidate
from scenewright.scene.selection import Selection
from scenewright.scene.track import STEP, vehicle_shape
from scenewright.tools.solver.assignment import assign_cheapest, assign_min_cost
from scenewright.tools.solver.background_assignment import (
    ConflictTable,
    Option,
)
from scenewright.tools.solver.combinations import enumerate_best_first
from scenewright.tools.solver.context import SolverContext, find_contact_nodes
from scenewright.tools.solver.entry_times import (
    QUEUE_GAP,
    RedLightWait,
    find_entry_times,
    find_queue_tail,
)
from scenewright.tools.solver.foreground import ForegroundSolver
from scenewright.tools.solver.objects import is_in_way
from scenewright.tools.solver.offers import AgentOffers, CandidateOffer
from scenewright.tools.solver.schedule import PartialSchedule
from scenewright.tools.solver.scheduled_agent import ScheduledAgent
from scenewright.tools.solver.search import WAITING_ALREADY, Search, TimedSchedule, add_tuple_count

_MAP_TUPLES, _MAP_GLANCES, _MAP_UNSEATED = 200, 48, 4
"""Tuples, looks at whether everybody might have its cheapest, and futile seatings after which `map`
settles for the best found."""

_MAP_PLAYS, _MAP_STAGINGS, _MAP_FRAMINGS, _MAP_SEATINGS = 4, 8, 8, 2
"""For one tuple: how often it is staged afresh, stagings looked at each time, framings in which
everybody might have its cheapest, and framings in which the cheapest seating is computed."""

_MAP_EFFORT = 0.1
"""Share of its bounds that one such seating may spend: another framing is cheaper than a proof."""

_FOLLOWS_AFTER = 1.2
"""How much later than the first in its lane the second starts [s]."""

_SAME, _PREFERENCE = 1e-6, 1e-5
"""Costs so near one another are equal [nats]; and by so much a way of a candidate is cheaper than
the next."""


class MinCostSearch(Search):
    """Tuples by ascending cost, everybody else at least cost; a bound on what may be cheaper."""

    def _found(self) -> Selection | None:
        """The combination of least cost: tuples by ascending floor, until none can be better.

        The floor of a tuple is its own cost and the cheapest candidate of everybody else. A tuple
        that stays above its floor at every moment tried is left undecided: the optimum is certain
        only if it costs no more than the floors of these.
        """
        others = sum(self._least_cost(draws) for draws in self._unbound() if not draws.reserve)
        best: Selection | None = None
        undecided, tried = float("inf"), 0
        for choice in self._by_cost():
            floor = others + sum(self._cost(name, m) for name, m in choice.items())
            if self._spent(best, floor, tried):
                undecided = min(undecided, floor)
                break
            tried += 1
            found, decided = self._cheapest(choice, floor)
            if found is not None and (best is None or found.cost < best.cost):
                best = found
            undecided = undecided if decided else min(undecided, floor)
        if best is None:
            return None
        gap = max(best.cost - undecided, 0.0)
        found = add_tuple_count(best, tried)
        figures = {**found.figures, "gap": gap}
        return replace(found, optimal=gap <= _SAME, figures=figures)

    def _spent(self, best: Selection | None, floor: float, tried: int) -> bool:
        """Whether `map` goes no further: nothing cheaper is left, or not found in reason."""
        if best is not None and floor >= best.cost - _SAME:
            return True
        hopeless = self._unseated >= _MAP_UNSEATED and best is None
        return hopeless or tried >= _MAP_TUPLES or self._glances >= _MAP_GLANCES

    def _cheapest(self, choice: dict[str, int], floor: float) -> tuple[Selection | None, bool]:
        """The cheapest selection found with a tuple; whether there certainly is no cheaper one."""
        set_up = self._set_up(choice)
        if set_up is None:
            return None, True
        framings: list[TimedSchedule] = []
        before = self._staged
        for schedule in self._stagings(*set_up):
            self._staged += 1
            timed = self._framed(schedule, choice)
            if timed is None:
                continue
            framings.append(timed)
            self._glances += 1
            assignment = assign_cheapest(*self._party(timed))
            if assignment is not None:
                selection = self._selection(timed, choice, assignment)
                if selection.cost <= floor + _SAME:
                    return selection, True
            if len(framings) >= _MAP_FRAMINGS:
                break
        if self._staged == before:
            return None, not self._meet(set_up[0])
        return self._above(framings[:_MAP_SEATINGS], choice), False

    def _above(self, framings: list[TimedSchedule], choice: dict[str, int]) -> Selection | None:
        """The cheapest selection in one of these framings, if not everybody has its cheapest."""
        found: list[Selection] = []
        for timed in framings:
            if self._unseated >= _MAP_UNSEATED:
                break
            assignment = assign_min_cost(*self._party(timed), effort=_MAP_EFFORT)
            if isinstance(assignment, str):
                self._unseated += 1
                self._failures[assignment] += 1
            else:
                found.append(self._selection(timed, choice, assignment))
        return min(found, key=lambda each: each.cost, default=None)

    def _party(
        self, timed: TimedSchedule
    ) -> tuple[list[AgentOffers], ConflictTable, Mapping[AgentClass, int]]:
        """Everybody else, around the foreground."""
        table = ConflictTable(each.until(timed.duration) for each in timed.schedule.actors.values())
        return self._invited(timed, table.fixed), table, self._pool.background

    def _stagings(
        self, candidates: Mapping[str, Candidate], landmarks: Mapping[str, Landmarks]
    ) -> Iterator[PartialSchedule]:
        """Stagings of a tuple, drawn afresh several times."""
        context = SolverContext(
            candidates, landmarks, self._rng, lenient=self._lenient,
            misses=self._shortfalls, yielding_model=self._pool.yielding_model,
        )  # fmt: skip
        stage = ForegroundSolver(context)
        for _ in range(_MAP_PLAYS):
            played = itertools.islice(stage.play(self._events, PartialSchedule()), _MAP_STAGINGS)
            yield from filter(self._run_first, played)

    def _set_up(
        self, choice: Mapping[str, int]
    ) -> tuple[dict[str, Candidate], dict[str, Landmarks]] | None:
        """A tuple's candidates and landmarks; None if it fails at any time whatever."""
        built = {name: self._candidate(name, m) for name, m in choice.items()}
        candidates = {name: pair[0] for name, pair in built.items() if pair}
        landmarks = {name: pair[1] for name, pair in built.items() if pair}
        if None in built.values() or not self._paths_fit(candidates):
            return None
        return candidates, landmarks

    def _meet(self, candidates: Mapping[str, Candidate]) -> bool:
        """Whether the paths of all who have to do with one another touch."""
        pairs = ((candidates[c.first], candidates[str(c.second)]) for c in self._events)
        return all(find_contact_nodes(*pair).touches for pair in pairs)

    def _by_cost(self) -> Iterator[dict[str, int]]:
        draws = [self._pool.agents[name] for name in self._bound]
        for choice in enumerate_best_first([each.nll + each.time_nll for each in draws]):
            yield dict(zip(self._bound, choice, strict=True))

    def _unbound(self) -> list[AgentCandidates]:
        return [each for name, each in self._pool.agents.items() if name not in self._bound]

    def _least_cost(self, draws: AgentCandidates) -> float:
        """Of an agent's cheapest candidate on which every unary clause holds; inf if on none."""
        fits = (m for m in _ranked(draws) if self._candidate(draws.name, m) is not None)
        return next((self._cost(draws.name, m) for m in fits), float("inf"))

    def _invited(self, timed: TimedSchedule, fixed: Sequence[ScheduledAgent]) -> list[AgentOffers]:
        """Everybody else by their candidates, built when they are looked at."""
        return [
            AgentOffers(
                name=draws.name,
                type=draws.route.type,
                foreground=draws.role == "foreground",
                offers=self._offers(draws, timed, fixed),
            )
            for draws in self._unbound()
            if not draws.reserve
        ]

    def _offers(
        self, draws: AgentCandidates, timed: TimedSchedule, fixed: Sequence[ScheduledAgent]
    ) -> tuple[CandidateOffer, ...]:
        ways = partial(self._at_any_time, draws, timed=timed, fixed=fixed)
        return tuple(
            CandidateOffer(self._cost(draws.name, m), partial(ways, m)) for m in _ranked(draws)
        )

    def _at_any_time(
        self, draws: AgentCandidates, m: int, timed: TimedSchedule, fixed: Sequence[ScheduledAgent]
    ) -> Iterator[Option]:
        """Passing on green whenever there is room, else waiting: one candidate, one likelihood.

        Of ways that are equally likely, the earlier is preferred.
        """
        built, moment = self._candidate(draws.name, m), self._moment(timed)
        if built is None or is_in_way(built[0], timed.objects):
            return
        actor = ScheduledAgent.unplaced(*built)
        half = STEP * len(actor.motion.s) / 2
        around = (moment.duration / 2 if draws.arrival is None else draws.arrival) - half
        starts, cost = find_entry_times(actor, moment), self._cost(draws.name, m)
        if len(starts):
            yield Option(lambda: actor, m, starts, cost, round(around / STEP))
        drives = draws.route.type == "vehicle"
        last = find_queue_tail(built[0], fixed) if drives else None
        if last is not None:
            yield from self._behind(actor, m, cost + _PREFERENCE, around, moment, last)
        waiting = list(self._reds(actor, moment, around, -half - WAITING_ALREADY))
        waiting += [self._second(red) for red in waiting if drives]
        if moment.blocked:
            goes = [red for red in waiting if red.release < moment.duration]
            waiting += [replace(red, stays=True) for red in goes]
        for rank, red in enumerate((red for red in waiting if red.holds), start=2):
            step = np.array([round(red.enters / STEP)], dtype=np.int64)
            yield Option(red.actor, m, step, cost + rank * _PREFERENCE)

    def _second(self, red: RedLightWait) -> RedLightWait:
        """The same, with room for a car ahead."""
        room = vehicle_shape().length + float(self._rng.uniform(*QUEUE_GAP))
        return replace(red, gap=red.gap + room, lag=red.lag + _FOLLOWS_AFTER)


def _ranked(draws: AgentCandidates) -> list[int]:
    """Candidates by ascending cost."""
    return [int(m) for m in np.argsort(draws.nll + draws.time_nll, kind="stable")]
