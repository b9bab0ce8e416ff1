"""The search for a surviving combination (paper Eq. 4), without enumerating the product.

The foreground is scheduled first, over tuples of its candidates. Then the signal programme gets an
offset, and all other agents are assigned around the foreground. Here the tuples come in the order
drawn and the first that survives is taken: Eq. 4's argmin sends every agent down its modal path,
which destroys diversity. `min_cost_search` computes it all the same.
"""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from typing import cast

import numpy as np
from numpy.typing import NDArray

from scenewright.errors import Rejected
from scenewright.geometry.landmarks import Landmarks, find_landmarks
from scenewright.geometry.map_areas import MapAreas
from scenewright.scene.base import FloatArray
from scenewright.scene.candidates import AgentCandidates, Candidate, CandidateSet
from scenewright.scene.constraints import (
    AgentFigure,
    AgentMotion,
    Before,
    BrakesFor,
    ConstraintProgram,
    Contact,
    GivesWay,
    Headway,
    MinLength,
    Near,
    NoReaction,
    PairClause,
    PairFigure,
    PassesBeside,
    Reacts,
    RunsRed,
    RunsYellow,
    SameLane,
    SpeedBetween,
    StopsBehind,
    Strikes,
    TimeGap,
    UnaryClause,
)
from scenewright.scene.kinds import has_trait, list_kinds, load_function
from scenewright.scene.objects import ObjectRecord, name_door
from scenewright.scene.rejection import Rejection
from scenewright.scene.selection import PlannedEvent, SelectedAgent, Selection
from scenewright.scene.social import DEFAULT_LEAD, ObjectNode
from scenewright.scene.track import STEP
from scenewright.tools.dsl_validator.check import check
from scenewright.tools.dsl_validator.parse import format_clause
from scenewright.tools.map_grounding.signal_plan import (
    SignalClock,
    SignalDemand,
    find_feasible_offsets,
)
from scenewright.tools.solver.background_assignment import (
    Assignment,
    BackgroundAgent,
    PlacedAgent,
    Street,
    assign_in_turn,
)
from scenewright.tools.solver.car_following import enter_traffic
from scenewright.tools.solver.context import NearestMisses, SolverContext
from scenewright.tools.solver.encounters import (
    Earlier,
    ObjectEncounter,
    find_meeting,
    list_meetings,
    meet_at,
    place_encounter,
)
from scenewright.tools.solver.entry_times import (
    SEEN,
    SceneTiming,
    compute_arrival_entry,
    compute_queue_growth,
    count_visible_agents,
    pass_or_wait,
    passes_on_green,
    starts_on_red,
)
from scenewright.tools.solver.figures import describe_miss, find_unmet_figure
from scenewright.tools.solver.foreground import (
    ForegroundSolver,
    join_names,
    list_separations,
    passes_first,
)
from scenewright.tools.solver.motions import MotionTemplate
from scenewright.tools.solver.objects import ObjectPlacer, is_in_way
from scenewright.tools.solver.path_conflict import find_path_conflict
from scenewright.tools.solver.reactions import ReactionRequests
from scenewright.tools.solver.red_lights import (
    add_red_light_runners,
    draw_red_light_starts,
    list_signal_demands,
    runs_first,
    runs_in_time,
)
from scenewright.tools.solver.reservation import find_blocked_offsets
from scenewright.tools.solver.scheduled_agent import (
    PartialSchedule,
    ScheduledAgent,
    find_needed_end,
    get_pair,
)
from scenewright.work_limit import WorkLimitReachedError, count_work, limit_work

MAX_SECONDS = 30.0
"""Length of a scene [s]: as long as the windows in which p_tod counts agents."""
_FIRST_EVENT = (3.0, 26.5)
"""When the first event happens [s], as far as its approach and end are visible."""

_HIDDEN_FIRST = (4.0, 3.5, 3.0)
"""When the first event may happen [s] where a pedestrian is hidden up to it."""

_DISCHARGE = 1.0
"""How much likelier the lights are under which queues set off in view than those under which they
form, per second of red. An event keeps many from setting off and none from queueing; in
traffic both are equally frequent. Chosen on other requests and the validation hours."""

_SIGHT = 0.2
"""How long the scene is visible before the beginning of an event at least [s]."""

_TUPLES = 14
_HOPELESS = 7
"""Tuples per relation that are tried; after which routes are given up if none is scheduled."""
_MOST_STEPS = 1_000
"""Steps after which all agents are drawn afresh: a long search is mostly in the wrong place."""
_STAGINGS_PER_TUPLE = 4
_SEATINGS = 3
"""Assignments tried before all agents are drawn afresh (`draw`)."""

WAITING_ALREADY = 4.0
"""How long before the scene begins [s] an agent that is already waiting arrived."""

_LATER, _APART = np.array([0.0, 1.2, 2.6, 4.5, 7.0]), 1.5
"""How much later than drawn an agent enters among others [s], and how far apart all other times
are. Vehicles are assigned in order of arrival, so that one without room delays the next."""

_OFF_KERB = 0.4
"""Least distance from the kerb of an agent that waits with another [m]."""

_ONE_LANE = 0.5
"""How far footprints beside one another overlap if they share a lane [m]."""

_Event = (Contact, TimeGap, Headway, GivesWay, BrakesFor, StopsBehind, PassesBeside)
_EventClause = Contact | TimeGap | Headway | GivesWay | BrakesFor | StopsBehind | PassesBeside


@dataclass(frozen=True, eq=False)
class TimedSchedule:
    """A schedule in scene time, with the scene's length and the programme's offset [s].

    Attributes:
        objects: the objects in the scene.
    """

    schedule: PartialSchedule
    duration: float
    offset: float | None
    objects: tuple[ObjectRecord, ...] = ()


class Search:
    """Tuples in the order drawn, the others sequentially; the first survivor is taken."""

    _patience: int | None = 2
    """Number of candidates on which a background agent looks for room."""
    _unchanged: frozenset[str] = frozenset()
    """Agents that move as in an earlier version."""
    _first_schedule = PartialSchedule()
    """The schedule before anything is placed."""

    def __init__(
        self,
        program: ConstraintProgram,
        pool: CandidateSet,
        map_areas: MapAreas,
        rng: np.random.Generator,
        lenient: bool,
        *,
        objects: Sequence[ObjectNode] = (),
    ) -> None:
        self._lenient, self._to_meet = lenient, list_meetings(objects)
        self._meetings: dict[tuple[str, int], ObjectEncounter] = {}
        # What several meet stands where the first could meet it.
        self._stands: dict[str, ObjectRecord] = {}
        self._placer = ObjectPlacer(objects, map_areas.intersection_map, rng)
        self._pool, self._ground, self._rng = pool, map_areas, rng
        self._leads = {name: leader for leader, names in pool.groups.items() for name in names}
        clauses = program.clauses
        self._events = _order_clauses([c for c in clauses if isinstance(c, _Event)])
        self._related = {frozenset(get_pair(c)) for c in self._events}
        self._parts = join_names((), map(get_pair, self._events))
        self._near = tuple(c for c in clauses if isinstance(c, Near | SameLane))
        self._before = tuple(c for c in clauses if isinstance(c, Before))
        self._strikers = frozenset(get_pair(c) for c in clauses if isinstance(c, Strikes))
        self._unary = [c for c in clauses if isinstance(c, UnaryClause)]
        self._violators = set(_list_agents(clauses, RunsRed))
        self._at_yellow = set(_list_agents(clauses, RunsYellow))
        self._at_lights = self._violators | self._at_yellow
        self._reactions = _build_reaction_requests(clauses, objects)
        self._figures = tuple(c for c in clauses if isinstance(c, AgentFigure | PairFigure))
        pairs = [c for c in self._figures if isinstance(c, PairFigure)]
        self._times = [c for c in pairs if c.clause == "time"]
        self._measured = {name for c in pairs for name in (c.first, c.second)}.union(
            _list_agents(clauses, AgentFigure, SpeedBetween)
        )
        motions = [c for c in clauses if isinstance(c, AgentMotion)]
        self._motions = {c.agent: (c.clause, load_motion(c.clause)) for c in motions}
        draws = dict.fromkeys(kind.draw for _, kind in self._motions.values() if kind.draw)
        self._drawn = {draw: draw(rng) for draw in draws}
        self._chained = _find_chained(self._events)
        self._red_first = dict.fromkeys((*_list_agents(clauses, SpeedBetween), *self._chained), 0.0)
        self._bound = self._list_bound(_list_agents(clauses, RunsRed, RunsYellow))
        self._varied: frozenset[str] = frozenset()
        self._built: dict[tuple[str, int], tuple[Candidate, Landmarks] | None] = {}
        self._failures, self._shortfalls = Counter[str](), NearestMisses()
        self._least_off: dict[AgentFigure | PairFigure, float] = {}
        self._unseated = self._staged = self._glances = 0

    def _list_bound(self, runners: Sequence[str]) -> list[str]:
        """List the agents that are scheduled together, once each.

        Raises:
            Rejected: an agent has to do something with another one and does not, or must not.
        """
        related = [name for c in self._events for name in get_pair(c)]
        company = {name: kind.company for name, (_, kind) in sorted(self._motions.items())}
        lone = [name for name, needed in company.items() if needed == "cannot"]
        either = [name for name, needed in company.items() if needed == "may"]
        if busy := sorted({*related} & {*lone}):
            fault = "stops at its light or in the junction, so it can do nothing with another agent"
            raise _reject(busy, f"{busy[0]} {fault}")
        fault = "so it must also do something with another agent"
        if idle := sorted(self._pool.groups.keys() - {*related}):
            raise _reject(idle, f"{idle[0]} walks in a group, {fault}")
        for name in sorted(company.keys() - {*related}):
            if company[name] == "must":
                words = self._motions[name][0].replace("_", " ")
                raise _reject([name], f"{name} {words}, {fault}")
        return list(dict.fromkeys((*related, *runners, *lone, *self._to_meet, *either)))

    def run(self) -> Selection:
        """Run the search; Rejected where no combination survives, or it takes too many steps."""
        for clause in (*self._near, *self._before):
            if not {clause.first, clause.second} <= set(self._bound):
                raise _reject(
                    [clause.first, clause.second],
                    f"{format_clause(clause)}: both agents must also be in a contact, time_gap, "
                    "headway, gives_way, brakes_for or stops_behind clause",
                )
        try:
            with limit_work(_MOST_STEPS):
                found = self._find_survivor()
        except WorkLimitReachedError as spent:
            if spent.units != _MOST_STEPS:
                raise
            found = None
        if found is None:
            raise Rejected(self._build_rejection())
        return found

    def _find_survivor(self) -> Selection | None:
        """Find the first surviving combination in the order drawn."""
        wanted = max(len(self._events), 1) + len(self._figures)
        return self._try_tuples(_TUPLES * wanted, _HOPELESS * wanted, _SEATINGS)

    def _try_tuples(self, most: int, hopeless: int, seatings: int) -> Selection | None:
        """Find the first survivor among so many tuples, giving up after `hopeless` if none is
        scheduled, and after so many assignments that fail."""
        for tried, choice in enumerate(itertools.islice(self._list_tuples(), most), start=1):
            selection = self._try(choice)
            if selection is not None:
                return add_tuple_count(selection, tried)
            if self._unseated >= seatings or (tried >= hopeless and not self._staged):
                return None
        return None

    def _get_cost(self, name: str, m: int) -> float:
        draws = self._pool.agents[name]
        return float(draws.nll[m] + draws.time_nll[m])

    def _list_tuples(self) -> Iterator[dict[str, int]]:
        """List choices of one candidate per bound agent."""
        draws = [self._pool.agents[name] for name in self._bound]
        if not draws:
            yield {}
            return
        orders = [self._rng.permutation(len(draw.nll)) for draw in draws]
        tried = dict.fromkeys(self._bound, 0)
        for n in itertools.count():
            self._varied = frozenset()
            yield {
                each.name: int(order[tried[each.name] % len(order)])
                for each, order in zip(draws, orders, strict=True)
            }
            tried |= {name: tried[name] + 1 for name in self._varied or self._bound}
            if n and n % len(draws[0].nll) == 0:
                orders = [self._rng.permutation(len(draw.nll)) for draw in draws]

    def _set_up(
        self, choice: Mapping[str, int]
    ) -> tuple[dict[str, Candidate], dict[str, Landmarks]] | None:
        """Build a tuple's candidates and landmarks; None if it fails at any time whatever."""
        built = {name: self._get_candidate(name, m) for name, m in choice.items()}
        if None in built.values():
            self._vary_only(name for name, pair in built.items() if pair is None)
            return None
        candidates = {name: pair[0] for name, pair in built.items() if pair}
        landmarks = {name: pair[1] for name, pair in built.items() if pair}
        return (candidates, landmarks) if self._do_paths_fit(candidates) else None

    def _try(self, choice: dict[str, int]) -> Selection | None:
        """Find a survivor with a tuple, whose agents may wait at red before the first event."""
        count_work()
        set_up = self._set_up(choice)
        if set_up is None:
            return None
        waiting = draw_red_light_starts(
            *set_up,
            (*self._events, *self._before),
            intersection_map=self._ground.intersection_map,
            chances=self._red_first | dict.fromkeys(self._at_lights, 0.0),
            rng=self._rng,
        )
        for red_light_starts in (waiting, {}) if waiting else ({},):
            selection = self._schedule_tuple(choice, *set_up, red_light_starts)
            if selection is not None or self._unseated >= _SEATINGS:
                return selection
        return None

    def _schedule_tuple(
        self,
        choice: dict[str, int],
        candidates: Mapping[str, Candidate],
        landmarks: Mapping[str, Landmarks],
        red_light_starts: Mapping[str, ScheduledAgent],
    ) -> Selection | None:
        """Find the first survivor among the schedules of a tuple with this beginning."""
        held = {
            name: kind.hold(candidates[name], landmarks[name], self._rng)
            for name, (_, kind) in sorted(self._motions.items())
            if kind.hold is not None and name in candidates
        }
        context = SolverContext(
            candidates, landmarks, self._rng, lenient=self._lenient, misses=self._shortfalls,
            yielding_model=self._pool.yielding_model, red_light_starts={**red_light_starts, **held},
            figures=self._figures, reactions=self._reactions, strikers=self._strikers,
            do_lights_allow=lambda schedule: bool(self._find_lawful_offsets(schedule).any()),
        )  # fmt: skip
        stage = ForegroundSolver(context)
        met = {
            name: self._meetings[(name, choice[name])]
            if name in choice
            else self._keep_meeting(name, self._pool.agents[name].build(0))
            for name in self._to_meet
        }
        self._placer.block_paths(
            {name: each.place for name, each in met.items() if each},
            {name: (each.door, each.opens) for name, each in met.items() if each and each.door},
        )
        before = self._staged
        scheduled = stage.schedule_all(self._events, self._first_schedule)
        scheduled = filter(self._turns_come_first, filter(self._runs_come_first, scheduled))
        for schedule in filter(self._is_as_measured, filter(self._is_in_order, scheduled)):
            selection = self._finish(schedule, choice)
            if selection is not None:
                return selection
            self._staged += 1
            if self._staged - before >= _STAGINGS_PER_TUPLE or self._unseated >= _SEATINGS:
                return None
        if self._staged == before:
            self._vary_only(stage.unscheduled)
            self._failures["; ".join(map(format_clause, self._events))] += 1
        return None

    def _get_candidate(self, name: str, m: int) -> tuple[Candidate, Landmarks] | None:
        """Return the m-th candidate of an agent; None if a unary clause fails on it."""
        if (name, m) not in self._built:
            self._built[(name, m)] = self._build_candidate(name, m)
        return self._built[(name, m)]

    def _build_candidate(self, name: str, m: int) -> tuple[Candidate, Landmarks] | None:
        """Build it on the path on which it moves as asked; None if it cannot."""
        candidate = self._pool.agents[name].build(m)
        path = self._ground.trim(candidate.path)
        if path is not candidate.path:
            candidate = replace(candidate, path=path)
        if name in self._to_meet:
            met = self._find_meeting(name, candidate)
            if met is None:
                self._failures[f"{name} meets no {self._to_meet[name].id} on its way"] += 1
                return None
            self._meetings[(name, m)], candidate = met, met.candidate
        landmarks = find_landmarks(candidate, map_areas=self._ground)
        clause, kind = self._motions.get(name, ("", None))
        if kind is not None and kind.reshape is not None and not self._is_fixed(name):
            own = self._ground.intersection_map
            reshaped = kind.reshape(candidate, landmarks, own, self._rng)
            if reshaped is None:
                self._failures[f"{clause}({name}): {kind.fault}"] += 1
                return None
            candidate, landmarks = reshaped, find_landmarks(reshaped, map_areas=self._ground)
        shortens = kind is not None and kind.shortens
        refused = [
            rejection
            for each in self._unary
            if each.agent == name and not (shortens and isinstance(each, MinLength))
            for rejection in check(candidate, each, landmarks=landmarks, map_areas=self._ground)
        ]
        self._failures.update(rejection.detail for rejection in refused)
        return None if refused else (candidate, landmarks)

    def _is_fixed(self, name: str) -> bool:
        """Return whether the agent is placed before any clause is scheduled."""
        return name in self._first_schedule.actors

    def _find_meeting(self, name: str, candidate: Candidate) -> ObjectEncounter | None:
        """Find how it meets its object; a fixed agent meets it where it did."""
        node = self._to_meet[name]
        kept = self._keep_meeting(name, candidate) if self._is_fixed(name) else None
        if kept is not None:
            return kept
        if node.id in self._stands:
            return meet_at(node, self._stands[node.id], candidate, self._ground, self._rng)
        met = find_meeting(node, candidate, self._ground, self._rng)
        if met is not None and node.others:
            self._stands[node.id] = met.place
        return met

    def _keep_meeting(self, name: str, candidate: Candidate) -> ObjectEncounter | None:
        """Return how it met its object in an earlier version; None if that was not there."""
        node = self._to_meet[name]
        place, door = (self._placer.get_kept(each) for each in (node.id, name_door(node.id)))
        return None if place is None else ObjectEncounter(node, place, candidate, 0.0, door=door)

    def _do_paths_fit(self, candidates: Mapping[str, Candidate]) -> bool:
        for clause in self._near:
            a, b = candidates.get(clause.first), candidates.get(clause.second)
            if a is None or b is None:
                continue
            reach = clause.metres if isinstance(clause, Near) else -_ONE_LANE
            pair = find_path_conflict(a.path, b.path, shapes=(a.shape, b.shape), reach=reach)
            along = np.ptp(pair.s_a[pair.i]) if len(pair.i) else -1.0
            if along < (clause.metres if isinstance(clause, SameLane) else 0.0):
                self._failures[format_clause(clause)] += 1
                self._vary_only((clause.first, clause.second))
                return False
        return True

    def _vary_only(self, names: Iterable[str]) -> None:
        """Draw other candidates only for these agents and those bound to them; keep the rest.

        All are drawn anew where every relation shares an agent with another.
        """
        failed = set(names)
        if len(self._parts) > 1:
            groups = (part for part in self._parts if part & failed)
            self._varied = frozenset(failed.union(*groups) & set(self._bound))

    def _finish(self, schedule: PartialSchedule, choice: dict[str, int]) -> Selection | None:
        """Add scene time, lights and all other agents; None if one of these does not fit."""
        separations = list_separations(schedule, self._rng, self._find_lawful_offsets)
        found = (self._time_schedule(separation, choice) for separation in separations)
        timed = next((each for each in found if each is not None), None)
        if timed is None:
            return None
        assignment = self._assign_background(timed)
        if isinstance(assignment, str):
            self._unseated += 1
            self._failures[assignment] += 1
            return None
        return self._build_selection(timed, choice, assignment)

    def _time_schedule(
        self, schedule: PartialSchedule, choice: Mapping[str, int]
    ) -> TimedSchedule | None:
        """Add scene time and lights; None if one of these does not fit."""
        timed = self._shift_to_scene_time(schedule)
        for add in (self._add_encounters, self._add_lone, self._add_runners, self._add_members):
            timed = None if timed is None else add(timed, choice)
        if timed is None or not self._are_strangers_apart(timed):
            return None
        if not (self._is_in_order(timed) and self._is_as_measured(timed, timed=True)):
            return None
        duration = self._compute_duration(timed)
        if not self._all_runners_pass(timed, duration):
            return None
        offset = self._find_signal_offset(timed, duration)
        if offset is None and self._ground.intersection_map.signals is not None:
            self._failures["the signal programme allows no such moment"] += 1
            return None
        objects = self._placer.place(timed)
        if isinstance(objects, str):
            self._failures[objects] += 1
            return None
        return TimedSchedule(timed, duration, offset, objects)

    def _shift_to_scene_time(self, schedule: PartialSchedule) -> PartialSchedule | None:
        """Shift it so that the first event falls anywhere where its approach and end are
        visible."""
        if not schedule.events:
            return schedule
        first = min(event.time for event in schedule.events)
        begins = min(event.begins for event in schedule.events)
        last = MAX_SECONDS - 0.2 - find_needed_end(schedule)
        earliest = max(_FIRST_EVENT[0] - first, _SIGHT - begins)
        latest = max(min(_FIRST_EVENT[1] - first, last), earliest)
        shift = round(min(float(self._rng.uniform(earliest, latest)), last), 1)
        asked = (
            round((clause.low + clause.high) / 2 - event.time, 1)
            for clause, event in itertools.product(self._times, schedule.events)
            if {*get_pair(event.clause)} == {clause.first, clause.second}
        )
        shift = next(asked, shift)
        if begins + shift < 0.0:
            self._failures["the events do not fit into one scene of 30 s"] += 1
            return None
        timed = schedule.shift(shift)
        if self._placer.hides_pedestrian and not self._times:
            # The scene begins later, if only then no hidden pedestrian is visible too soon: a
            # driver far off looks along the sidewalk, behind what stands at the kerb.
            for time in (first + shift, *_HIDDEN_FIRST):
                moved = timed.shift(round(time - (first + shift), 1))
                if not isinstance(self._placer.place(moved), str):
                    return moved
        return timed

    def _compute_duration(self, _: PartialSchedule) -> float:
        """Compute the length of the scene [s]."""
        return MAX_SECONDS

    def _add_runners(self, schedule: PartialSchedule, choice: Mapping[str, int]) -> PartialSchedule:
        """Add agents that run red on their own."""
        alone = [name for name in self._bound if name not in schedule.actors]
        built = {name: self._get_candidate(name, choice[name]) for name in alone}
        known = {name: pair for name, pair in built.items() if pair is not None}
        return add_red_light_runners(schedule, known, self._rng)

    def _add_encounters(
        self, schedule: PartialSchedule, choice: Mapping[str, int]
    ) -> PartialSchedule | None:
        """Add agents that meet only an object; None if one cannot."""
        actors = dict(schedule.actors)
        earlier: dict[str, Earlier] = {}
        for name in (each for each in self._to_meet if each not in schedule.actors):
            built = self._get_candidate(name, choice[name])
            met = self._meetings.get((name, choice[name]))
            before = earlier.get(self._to_meet[name].id)
            placed = None
            if met and built:
                placed = place_encounter(met, built[1], self._rng, earlier=before)
            if placed is None:
                self._failures[f"{name} cannot stop before {self._to_meet[name].id}"] += 1
                return None
            actors[name], earlier[self._to_meet[name].id] = placed
        return replace(schedule, actors=actors)

    def _add_lone(
        self, schedule: PartialSchedule, choice: Mapping[str, int]
    ) -> PartialSchedule | None:
        """Add agents that move in a way of their own and meet no other; None if one cannot."""
        actors = dict(schedule.actors)
        for name in sorted(self._motions.keys() - actors.keys()):
            clause, kind = self._motions[name]
            if kind.place is None:
                continue
            built = self._get_candidate(name, choice[name])
            actor = None if built is None else kind.place(*built, self._rng)
            if actor is None:
                self._failures[f"{clause}({name}): {kind.fault}"] += 1
                return None
            actors[name] = actor
        return replace(schedule, actors=actors)

    def _add_members(
        self, schedule: PartialSchedule, choice: Mapping[str, int]
    ) -> PartialSchedule | None:
        """Add agents that walk in the groups of others; None if one has no room there."""
        members: dict[str, ScheduledAgent] = {}
        for leader, names in self._pool.groups.items():
            for name in names:
                if name in schedule.actors:
                    continue  # it stays as it was in an earlier version
                built = self._get_candidate(name, choice.get(leader, 0))
                if built is None:
                    return None
                members[name] = schedule.actors[leader].lead_member(*built)
        return replace(schedule, actors={**schedule.actors, **members}) if members else schedule

    def _runs_come_first(self, schedule: PartialSchedule) -> bool:
        """Return whether scheduled red-light runners run red before their other events."""
        there = sorted(self._at_lights & schedule.actors.keys())
        late = [name for name in there if not runs_first(name, schedule)]
        self._failures.update(
            f"{self._describe_run(name)} before what it does to others" for name in late
        )
        return not late

    def _turns_come_first(self, schedule: PartialSchedule) -> bool:
        """Return whether agents move as asked before they are hit."""
        for name in sorted(self._motions.keys() & schedule.actors.keys()):
            actor, (clause, kind) = schedule.actors[name], self._motions[name]
            if kind.is_done and actor.contact is not None and not kind.is_done(actor):
                self._failures[f"{clause}({name}) before it is hit"] += 1
                return False
        return True

    def _all_runners_pass(self, schedule: PartialSchedule, duration: float) -> bool:
        """Return whether all red-light runners pass their line in time."""
        for name in sorted(self._at_lights):
            if name not in schedule.actors or not runs_in_time(name, schedule, until=duration):
                self._failures[f"{self._describe_run(name)} within the scene"] += 1
                return False
        return True

    def _describe_run(self, name: str) -> str:
        return f"{'runs_yellow' if name in self._at_yellow else 'runs_red'}({name})"

    def _are_strangers_apart(self, schedule: PartialSchedule) -> bool:
        """Return whether no two meet that no clause relates, unless they did before."""
        for a, b in itertools.permutations(schedule.actors, 2):
            pair = frozenset((self._leads.get(a, a), self._leads.get(b, b)))
            if len(pair) == 1 or {a, b} <= self._unchanged or pair in self._related:
                continue
            first, second = (schedule.actors[name].cut_after(MAX_SECONDS) for name in (a, b))
            delta = (second.enters - first.enters) / STEP
            blocked = find_blocked_offsets(first, second, strict=True)
            if any(low < delta < high for low, high in blocked):
                self._failures[f"no_interaction({a}, {b})"] += 1
                return False
        return True

    def _is_as_measured(self, schedule: PartialSchedule, *, timed: bool = False) -> bool:
        """Return whether every figure asked for is in its range."""
        unmet = find_unmet_figure(self._figures, schedule, timed=timed)
        if unmet is None:
            return True
        clause, off = unmet
        self._least_off[clause] = min(off, self._least_off.get(clause, np.inf))
        return False

    def _is_in_order(self, schedule: PartialSchedule) -> bool:
        for clause in self._before:
            first, second = schedule.actors.get(clause.first), schedule.actors.get(clause.second)
            if first is None or second is None or not passes_first(first, second):
                self._failures[format_clause(clause)] += 1
                return False
        return True

    def _find_signal_offset(self, schedule: PartialSchedule, duration: float) -> float | None:
        program = self._ground.intersection_map.signals
        if program is None:
            return None
        demands = list(self._list_signal_demands(schedule, duration))
        for name, actor in schedule.actors.items():
            _, kind = self._motions.get(name, ("", None))
            if kind is not None and kind.demands is not None:
                demands += kind.demands(actor, self._drawn[kind.draw] if kind.draw else 0.0)
        offsets = find_feasible_offsets(program, tuple(demands))
        if not len(offsets):
            return None
        routes = [agent.route for agent in self._pool.agents.values() if agent.chance is not None]
        own = self._ground.intersection_map
        often = count_visible_agents(
            program, offsets, routes, duration=duration, intersection_map=own
        )
        if schedule.events:
            left = compute_queue_growth(
                program, offsets, routes, duration=duration, intersection_map=own
            )
            often = often * np.exp(_DISCHARGE * (left.min() - left))
        return float(self._rng.choice(offsets, p=often / often.sum()))

    def _find_lawful_offsets(self, schedule: PartialSchedule) -> NDArray[np.bool_]:
        """Find which offsets of the programme, on the grid, are lawful for the agents [N]."""
        program = self._ground.intersection_map.signals
        if program is None:
            return np.ones(1, dtype=np.bool_)
        demands = self._list_signal_demands(schedule, 3 * MAX_SECONDS)
        return np.isin(find_feasible_offsets(program, ()), find_feasible_offsets(program, demands))

    def _list_signal_demands(
        self, schedule: PartialSchedule, until: float
    ) -> tuple[SignalDemand, ...]:
        """List what the signal plan must show for the agents up to a time [s]."""
        return tuple(
            demand
            for name, actor in schedule.actors.items()
            for demand in list_signal_demands(
                actor,
                violates=name in self._violators,
                until=until,
                yellow=name in self._at_yellow,
            )
        )

    def _assign_background(self, timed: TimedSchedule) -> Assignment | str:
        """Assign all other agents around the foreground; reserves replace those without room."""
        actors = timed.schedule.actors
        fixed = [actor.cut_after(timed.duration) for actor in actors.values()]
        names = [name for name in self._pool.agents if name not in actors]
        agents = self._list_background(timed, names)
        return assign_in_turn(agents, fixed, self._pool.background, self._pool.least)

    def _list_background(self, timed: TimedSchedule, names: Iterable[str]) -> list[BackgroundAgent]:
        """List these agents, to be placed around a schedule."""
        program, clock = self._ground.intersection_map.signals, None
        if timed.offset is not None and program is not None:
            clock = SignalClock(program, timed.offset)
        events = (e for e in timed.schedule.events if not isinstance(e.clause, Headway))
        conflicts = tuple((event.time, event.location) for event in events)
        moment = SceneTiming(clock, timed.duration, conflicts)
        return [
            BackgroundAgent(
                name=draws.name,
                type=draws.route.type,
                foreground=draws.role == "foreground",
                place=partial(self._place_agent, draws, moment, timed.objects),
            )
            for draws in map(self._pool.agents.__getitem__, names)
        ]

    def _list_candidates(self, draws: AgentCandidates) -> Iterable[int]:
        """List the candidates of a background agent in the order to be tried."""
        return range(len(draws.nll))

    def _place_agent(
        self,
        draws: AgentCandidates,
        moment: SceneTiming,
        objects: Sequence[ObjectRecord],
        street: Street,
    ) -> PlacedAgent | None:
        """Place an agent beside its companion, or with the first candidate that finds room."""
        beside = self._walk_beside(draws, moment, street)
        if beside is not None:
            return beside
        tried = 0
        for m in self._list_candidates(draws):
            count_work()
            built = self._get_candidate(draws.name, m)
            if built is None or is_in_way(built[0], objects):
                continue
            actor = ScheduledAgent.build_unplaced(*built)
            foreground, wished = draws.role == "foreground", self._list_times(draws, actor, moment)
            if draws.route.type == "vehicle" and not foreground:
                placed = enter_traffic(actor, wished, street.present, moment, self._rng)
            else:
                placed = pass_or_wait(
                    actor, wished, street.present, moment, self._rng, foreground=foreground
                )
            if placed is not None:
                return PlacedAgent(placed, m)
            tried += 1
            if tried == self._patience:
                break
        return None

    def _list_times(
        self, draws: AgentCandidates, actor: ScheduledAgent, moment: SceneTiming
    ) -> FloatArray:
        """List entry times [s]: as drawn, a little later, and then all others, the nearest first.

        A pedestrian may also have waited since before the scene began.
        """
        seconds = STEP * len(actor.motion.s)
        drawn_time = (moment.duration if draws.arrival is None else 2 * draws.arrival) - seconds
        around = drawn_time / 2
        if draws.chance is not None:
            around = compute_arrival_entry(actor, moment, draws.chance)
        later = around + _LATER * self._rng.uniform(0.8, 1.2, len(_LATER))
        if draws.route.type == "pedestrian":
            later[-1] = -seconds / 2 - WAITING_ALREADY
        others = np.arange(SEEN - seconds, moment.duration - SEEN, _APART)
        return np.concatenate((later, others[np.argsort(np.abs(others - around))]))

    def _walk_beside(
        self, draws: AgentCandidates, moment: SceneTiming, street: Street
    ) -> PlacedAgent | None:
        """Place an agent with the one it walks with, on either side; both off the crosswalk at
        red."""
        leader = street.placed.get(draws.beside or "")
        for m in () if leader is None else (leader.index, ~leader.index):
            built = self._get_candidate(draws.name, m)
            if built is None or leader is None:
                continue
            actor, line = leader.actor.lead_member(*built), built[1].line or np.inf
            kerb = leader.actor.landmarks.line or np.inf
            beyond = any(stop.s < kerb and stop.s > line - _OFF_KERB for stop in actor.stops)
            lawful = passes_on_green(actor, moment, actor.enters)
            # A pedestrian at the kerb when the scene begins stands within the crosswalk's margin.
            apart = starts_on_red(actor, moment) and not starts_on_red(leader.actor, moment)
            may = lawful and not beyond and not apart
            if may and street.present.is_free(actor, foreground=False):
                return PlacedAgent(actor, leader.index)
        return None

    def _build_selection(
        self, timed: TimedSchedule, choice: dict[str, int], assignment: Assignment
    ) -> Selection:
        schedule, agents = timed.schedule, dict[str, SelectedAgent]()
        for name, draws in self._pool.agents.items():
            if name in schedule.actors:
                actor, index = schedule.actors[name], choice[self._leads.get(name, name)]
            elif name in assignment:
                actor, index = assignment[name].actor, assignment[name].index
            else:
                continue
            agents[name] = SelectedAgent(
                name=name,
                role=draws.role,
                candidate=actor.candidate,
                index=index,
                enters=actor.enters,
                stops=actor.stops,
                slowings=actor.slowings,
                contact=actor.contact,
                push=actor.push,
                violates=name in self._violators,
                group=self._leads.get(name),
                exact=name in self._measured | self._to_meet.keys() | self._chained,
            )
        events = tuple(
            PlannedEvent(
                format_clause(event.clause),
                get_pair(event.clause),
                round(event.time, 3),
                event.location,
            )
            for event in schedule.events
        )
        nll = sum(float(self._pool.agents[n].nll[a.index]) for n, a in agents.items())
        return Selection(
            agents=agents,
            events=events,
            duration=timed.duration,
            signal_offset=timed.offset,
            nll=nll,
            cost=sum(self._get_cost(name, agent.index) for name, agent in agents.items()),
            optimal=False,
            objects=timed.objects,
        )

    def _build_rejection(self) -> Rejection:
        most = self._failures.most_common(3)
        detail = "; ".join(f"{reason} ({count}x)" for reason, count in most)
        detail += self._placer.describe_nearest()
        if self._least_off:
            detail = "; ".join(describe_miss(c, off) for c, off in self._least_off.items())
        culprit = None if self._staged else self._shortfalls.find_culprit(self._events)
        if culprit is not None:
            detail = f"{format_clause(culprit.clause)}: {culprit.words}"
        return Rejection(
            stage="waypoint_filter",
            code="no_surviving_combination",
            agents=tuple(self._bound),
            detail=f"no combination of candidates survives: {detail or 'none was drawn'}",
            missed=None if culprit is None else (-culprit.reached, culprit.off),
        )


def _reject(names: list[str], fault: str) -> Rejected:
    return Rejected(
        Rejection(
            stage="waypoint_filter", code="malformed_program", agents=tuple(names), detail=fault
        )
    )


def _list_agents(
    clauses: Iterable[UnaryClause | PairClause], *kinds: type[UnaryClause]
) -> list[str]:
    return [c.agent for c in clauses if isinstance(c, kinds)]


def _find_chained(events: Iterable[_EventClause]) -> set[str]:
    """Find the agents of chain collisions, and who strikes the first that is struck in one."""
    pushes = [c for c in events if isinstance(c, Contact) and _is_pushed(c)]
    struck = {c.first for c in pushes}
    return (
        struck | {str(c.second) for c in pushes} | {c.first for c in events if c.second in struck}
    )


def _build_reaction_requests(
    clauses: Iterable[UnaryClause | PairClause], objects: Iterable[ObjectNode]
) -> ReactionRequests:
    """Build what is asked for of reactions, and who is hidden by objects how long."""
    return ReactionRequests(
        frozenset(_list_agents(clauses, NoReaction)),
        {
            frozenset((str(scene_object.hides), str(scene_object.hidden_from))): scene_object.lead
            or DEFAULT_LEAD
            for scene_object in objects
            if scene_object.hides is not None
        },
        {c.agent: c.how for c in clauses if isinstance(c, Reacts)},
    )


def _order_clauses(clauses: list[_EventClause]) -> tuple[_EventClause, ...]:
    """Put followers last, after their leader's other events; but before they run into it.

    A collision comes after the other events of its agents, as it ends them, but before the one into
    which an agent of it is pushed. Agents bound to placed
    ones come before others, as two that have come independently cannot be brought together.
    """
    # The leader's motion decides when it is followed where it gives way, or is not hit.
    waits = {clause.first for clause in clauses if isinstance(clause, GivesWay)}
    hits = [{*get_pair(clause)} for clause in clauses if isinstance(clause, Contact)]
    later = [
        clause
        for clause in clauses
        if isinstance(clause, Headway)
        and (clause.second in waits or {*get_pair(clause)} not in hits)
    ]
    sooner = [clause for clause in clauses if clause not in later]
    named = Counter(name for each in sooner for name in get_pair(each))
    contacts = (each for each in sooner if isinstance(each, Contact))
    ends = [contact for contact in contacts if max(named[name] for name in get_pair(contact)) > 1]
    ends.sort(key=_is_pushed)
    return _put_connected_first([*(each for each in sooner if each not in ends), *ends, *later])


def _is_pushed(clause: Contact) -> bool:
    return has_trait("manoeuvre", clause.cause, "chain")


def _put_connected_first(clauses: list[_EventClause]) -> tuple[_EventClause, ...]:
    """Put the clauses first that bind an agent that is placed already; else keep their order."""
    ordered: list[_EventClause] = []
    known: set[str] = set()
    rest = list(clauses)
    while rest:
        joins = (each for each in rest if known & {*get_pair(each)})
        ordered.append(next(joins, rest[0]))
        rest.remove(ordered[-1])
        known |= {*get_pair(ordered[-1])}
    return tuple(ordered)


@cache
def load_motion(clause: str) -> MotionTemplate:
    """The template of the kind that a clause stands for."""
    name = next(kind.template for kind in list_kinds("motion") if kind.clause == clause)
    return cast(MotionTemplate, load_function(str(name), __package__))


def add_tuple_count(selection: Selection, tried: int) -> Selection:
    """Return the selection with the number of tuples tried among its figures."""
    return replace(selection, figures={**selection.figures, "tuples": tried})
