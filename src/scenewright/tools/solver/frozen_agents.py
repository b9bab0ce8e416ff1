"""The search around agents of an earlier version that stay as they are (`scene/frozen_agents.py`).

A fixed agent keeps its motion and its entry time. A clause between two of them held before and is
not scheduled again; the checker verifies that it still holds. A clause between a fixed agent and
another is scheduled with the fixed one already placed, so that the other gets the time that fits.
Agents bound to no fixed agent are scheduled on their own and moved to where the lights, whose
programme keeps its offset, allow it. Background agents that stay keep their assignment; only those
in conflict with a new agent are assigned anew.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from scenewright.geometry.landmarks import find_landmarks
from scenewright.geometry.map_areas import MapAreas
from scenewright.scene.candidates import CandidateSet
from scenewright.scene.constraints import ConstraintProgram, PairClause
from scenewright.scene.frozen_agents import FrozenAgents, without_edits
from scenewright.scene.selection import SelectedAgent, Selection
from scenewright.scene.social import ObjectNode
from scenewright.tools.map_grounding.signal_plan import SignalDemand, find_feasible_offsets
from scenewright.tools.solver.background_assignment import (
    Assignment,
    PlacedAgent,
    assign_in_turn,
)
from scenewright.tools.solver.objects import is_in_way
from scenewright.tools.solver.reservation import ReservationTable
from scenewright.tools.solver.scheduled_agent import (
    PartialSchedule,
    ScheduledAgent,
    find_needed_end,
    get_pair,
)
from scenewright.tools.solver.search import MAX_SECONDS, Search, TimedSchedule

_SAME_WAY = 4
"""How often the candidates of the earlier version are tried before others."""

_MOST, _IN_VAIN, _MOST_UNSEATED = 7, 6, 2
"""Tuples tried per relation; failures after which it is given up if none is scheduled, or
assigned."""

_LATEST_FIRST = 22.0
"""Latest time [s] of a first event that is moved to where the lights allow it."""


class FrozenAgentsSearch(Search):
    """Tuples in the order drawn, the candidates of the earlier version first."""

    def __init__(
        self,
        program: ConstraintProgram,
        pool: CandidateSet,
        map_areas: MapAreas,
        rng: np.random.Generator,
        lenient: bool,
        *,
        frozen: FrozenAgents,
        objects: Sequence[ObjectNode] = (),
    ) -> None:
        super().__init__(program, pool, map_areas, rng, lenient, objects=objects)
        self._pins = frozen
        self._placer.keep_earlier(frozen.earlier.objects)
        self._unchanged = frozenset(frozen.same)
        self._events = tuple(event for event in self._events if self._needs_scheduling(event))
        self._near = tuple(each for each in self._near if self._needs_scheduling(each))
        self._before = tuple(each for each in self._before if self._needs_scheduling(each))
        acting = {name for each in self._events for name in get_pair(each)}
        self._bound = [n for n in self._bound if n in acting or n not in frozen.fixed]
        foreground = {n for n, draws in pool.agents.items() if draws.role == "foreground"}
        stay = {**frozen.placed, **frozen.fixed}
        settled = {
            n: a for n, a in stay.items() if n in foreground and self._leads.get(n, n) in stay
        }
        self._settled = {name: rebuild_agent(a, map_areas) for name, a in settled.items()}
        self._first_schedule = PartialSchedule(
            {name: self._settled[name] for name in acting & self._settled.keys()}
        )
        self._stays: dict[str, ScheduledAgent] = {}
        # An agent that came from a red light does so again if the lights allow it, and no other
        # one.
        for name, agent in frozen.known.items():
            self._red_first[name] = float(any(stop.at_red for stop in agent.stops))

    def _needs_scheduling(self, clause: PairClause) -> bool:
        """Return whether the clause is to be scheduled: one of the two is not fixed."""
        return not set(get_pair(clause)) <= self._pins.fixed.keys()

    def _find_survivor(self) -> Selection | None:
        """Find the first survivor; few are tried around fixed agents, as more may move after
        that."""
        if not self._pins.known:
            return super()._find_survivor()
        most = _MOST * max(len(self._events), 1)
        return self._try_tuples(most, _IN_VAIN, _MOST_UNSEATED)

    def _list_tuples(self) -> Iterator[dict[str, int]]:
        first = dict.fromkeys(self._bound, 0)
        if not self._pins.offered.keys() & set(self._bound):
            return super()._list_tuples()
        return itertools.chain(itertools.repeat(first, _SAME_WAY), super()._list_tuples())

    def _shift_to_scene_time(self, schedule: PartialSchedule) -> PartialSchedule | None:
        """Shift the schedule to scene time, with all fixed foreground agents."""
        if schedule.events and not self._first_schedule.actors:
            moved = self._shift_near_earlier(schedule)
            if moved is None:
                self._failures["the signal programme allows no such moment"] += 1
                return None
            schedule = moved
        begins = min((event.begins for event in schedule.events), default=0.0)
        if begins < 0.0 or (schedule.events and find_needed_end(schedule) > MAX_SECONDS - 0.2):
            self._failures["the events do not fit beside those that stay"] += 1
            return None
        return PartialSchedule({**self._settled, **schedule.actors}, schedule.events)

    def _shift_near_earlier(self, schedule: PartialSchedule) -> PartialSchedule | None:
        """Shift the schedule to about its earlier time, at a moment that the lights allow."""
        if not self._pins.lights:
            return super()._shift_to_scene_time(schedule)
        first = min(event.time for event in schedule.events)
        before = self._pins.earlier.first_event
        drawn_time = (float(self._rng.uniform(6.0, 15.0)) if before is None else before) - first
        earliest = 0.5 - min(event.begins for event in schedule.events)
        latest = min(MAX_SECONDS - 0.2 - find_needed_end(schedule), _LATEST_FIRST - first)
        program, offset = self._ground.intersection_map.signals, self._pins.earlier.signal_offset
        shifts = np.arange(-60.0, 60.0, 0.5)
        if program is not None and offset is not None:
            demands = self._list_demands(schedule, 4 * program.cycle)
            around = np.arange(-2, 3) * program.cycle
            shifts = (find_feasible_offsets(program, demands) - offset)[:, None] + around
            shifts = np.sort(shifts.ravel())
        shifts = shifts[(shifts >= earliest) & (shifts <= latest)]
        if not len(shifts):
            return None
        return schedule.shift(round(float(shifts[np.argmin(np.abs(shifts - drawn_time))]), 1))

    def _list_demands(self, schedule: PartialSchedule, until: float) -> tuple[SignalDemand, ...]:
        """List what the agents that do not stay need of the lights."""
        free = {n: actor for n, actor in schedule.actors.items() if n not in self._pins.same}
        return self._list_signal_demands(replace(schedule, actors=free), until)

    def _compute_duration(self, schedule: PartialSchedule) -> float:
        if not self._pins.lights:
            return super()._compute_duration(schedule)
        least = find_needed_end(schedule) if schedule.events else 0.0
        return float(max(self._pins.earlier.duration, np.ceil(min(least, MAX_SECONDS))))

    def _find_signal_offset(self, schedule: PartialSchedule, duration: float) -> float | None:
        program, offset = self._ground.intersection_map.signals, self._pins.earlier.signal_offset
        if not self._pins.lights or program is None or offset is None:
            return super()._find_signal_offset(schedule, duration)
        lawful = find_feasible_offsets(program, self._list_demands(schedule, duration))
        return offset if bool(np.any(np.abs(lawful - offset) < 1e-6)) else None

    def _assign_background(self, timed: TimedSchedule) -> Assignment | str:
        """Keep fixed agents where they were and assign the others around them."""
        actors = timed.schedule.actors
        self._stays = self._find_staying(timed)
        both = (*actors.values(), *self._stays.values())
        fixed = [actor.cut_after(timed.duration) for actor in both]
        wanted = dict(self._pool.background)
        for name in self._stays:
            wanted[self._pool.agents[name].route.type] -= 1
        if any(count < 0 for count in wanted.values()):
            return "more agents stay than there shall be"
        names = [n for n in self._pool.agents if n not in actors and n not in self._stays]
        agents = self._list_background(timed, names)
        return assign_in_turn(agents, fixed, wanted)

    def _find_staying(self, timed: TimedSchedule) -> dict[str, ScheduledAgent]:
        """Find the background agents, by name, that are in no new agent's way."""
        longer = timed.duration > self._pins.earlier.duration
        new = [a for n, a in timed.schedule.actors.items() if longer or n not in self._pins.same]
        present = ReservationTable(actor.cut_after(timed.duration) for actor in new)
        stays: dict[str, ScheduledAgent] = {}
        for name, agent in self._pins.fixed.items():
            if name in self._settled or name not in self._pool.agents:
                continue
            if is_in_way(agent.candidate, timed.objects):
                continue
            actor = rebuild_agent(agent, self._ground)
            if present.is_free(actor.cut_after(timed.duration), foreground=False):
                stays[name] = actor
                if longer or name not in self._pins.same:
                    present.add(actor.cut_after(timed.duration), foreground=False)
        return stays

    def _build_selection(
        self, timed: TimedSchedule, choice: dict[str, int], assignment: Assignment
    ) -> Selection:
        """Build the selection in which the fixed agents are unchanged."""
        staying = {name: PlacedAgent(actor, 0) for name, actor in self._stays.items()}
        index = dict.fromkeys(timed.schedule.actors, 0) | choice
        found = super()._build_selection(timed, index, {**assignment, **staying})
        stay = {
            name: agent
            for name, agent in self._pins.fixed.items()
            if name in self._settled or name in self._stays
        }
        agents = {name: stay.get(name, agent) for name, agent in found.agents.items()}
        same = [e for e in self._pins.earlier.events if {*e.agents} <= self._pins.same]
        kept = [e for e in same if frozenset(e.agents) in self._related]
        return replace(found, agents=agents, events=(*kept, *found.events))


def rebuild_agent(agent: SelectedAgent, map_areas: MapAreas) -> ScheduledAgent:
    """Rebuild a selected agent, placed in time as it was."""
    landmarks = find_landmarks(agent.candidate, map_areas=map_areas)
    actor = ScheduledAgent.build_unplaced(agent.candidate, landmarks).shift(agent.enters)
    if lights := without_edits(agent).stops:
        actor = actor.hold_at_lights(lights)
    if agent.stops or agent.slowings:
        actor = actor.edit(stops=agent.stops, slowings=agent.slowings)
    if agent.push is not None:
        actor = actor.push_on(agent.push)
    return actor if agent.contact is None else actor.end_at(agent.contact)
