"""When a threat is perceptible, and what reactions make of a motion, on straight roads."""

import numpy as np
import pytest

from scenewright.scene.constraints import Contact, TimeGap
from scenewright.scene.track import STEP
from scenewright.tools.solver.context import SolverContext, find_contact_nodes
from scenewright.tools.solver.foreground import ForegroundSolver
from scenewright.tools.solver.impact import find_first_contact
from scenewright.tools.solver.path_conflict import compute_gap, find_conflict_intervals
from scenewright.tools.solver.reactions import (
    ReactionRequests,
    find_threat,
    run_on,
    sees,
    slow_down,
)
from scenewright.tools.solver.scheduled_agent import PartialSchedule
from solver_agents import (
    BARE,
    EAST,
    NORTH,
    SOUTH,
    WESTBOUND,
    actor,
    candidate,
    law,
    straight,
    walker,
)

CAR, OTHER, WALKER = "vehicle-1", "vehicle-2", "pedestrian-1"
EASTWARDS = candidate(straight((-80.0, 0.0), EAST, 160.0), time_law=law(10.0))
NORTHWARDS = candidate(straight((0.0, -80.0), NORTH, 160.0), route=WESTBOUND, time_law=law(10.0))
ON_FOOT = walker(straight((5.0, 12.0), SOUTH, 24.0))


def test_a_threat_is_perceptible_from_three_seconds_before_the_contact() -> None:
    a, b = actor(EASTWARDS), actor(NORTHWARDS)
    touch = find_first_contact(a, b)
    assert touch is not None

    threat = find_threat(find_contact_nodes(EASTWARDS, NORTHWARDS), a, b, until=touch.time)

    assert threat is not None
    assert threat[0] == pytest.approx(touch.time - 3.0, abs=0.15)
    assert sees(a, b, threat[0])
    assert not sees(a, actor(candidate(straight((-120.0, 0.0), EAST, 60.0))), 2.0)


def test_who_slows_down_does_so_from_the_moment_on_and_keeps_the_speed() -> None:
    slowed = slow_down(actor(EASTWARDS), onset=4.0, braking=4.0, speed=5.0, kept=20.0)

    assert slowed is not None
    speed = slowed.motion.speed
    assert speed[: round(3.6 / STEP)].min() == pytest.approx(10.0, abs=0.1)
    assert speed[round(5.8 / STEP) : round(8.5 / STEP)] == pytest.approx(5.0, abs=0.1)
    assert -np.gradient(speed, STEP).min() == pytest.approx(4.0, abs=0.3)
    assert speed[-1] == pytest.approx(10.0, abs=0.5)


def test_who_runs_walks_before_and_after() -> None:
    usual = actor(ON_FOOT)
    runner = run_on(usual, onset=4.0, acceleration=1.5, until=16.0)

    assert runner is not None
    walks = float(usual.motion.speed[20])
    speed, s = runner.motion.speed, runner.motion.s
    assert speed[:34] == pytest.approx(usual.motion.speed[:34], abs=0.05)
    assert speed.max() > walks + 0.6
    assert speed[s > 19.0][:-5] == pytest.approx(walks, abs=0.15)


@pytest.mark.parametrize("seed", range(3))
def test_a_near_miss_is_missed_because_of_the_reaction(seed: int) -> None:
    clause = TimeGap(first=CAR, second=OTHER, low=0.3, high=1.2)
    people = {CAR: EASTWARDS, OTHER: NORTHWARDS}
    context = SolverContext(
        people, dict.fromkeys(people, BARE), np.random.default_rng(seed), lenient=False
    )

    staged = next(ForegroundSolver(context).schedule_all((clause,), PartialSchedule()))

    a, b = staged.actors[CAR], staged.actors[OTHER]
    delta = b.enters - a.enters
    nodes = find_contact_nodes(EASTWARDS, NORTHWARDS)
    unreacted = find_conflict_intervals(nodes, a.free, b.free, c=0.0, exact=True)
    reacted = find_conflict_intervals(nodes, a.motion, b.motion, c=0.0, exact=True)
    assert compute_gap(unreacted, delta) == 0.0
    assert 0.3 <= compute_gap(reacted, delta) <= 1.2


@pytest.mark.parametrize("clause", [
    TimeGap(first=CAR, second=OTHER, low=0.3, high=1.2),
    Contact(first=CAR, second=OTHER, kind="angle"),
])  # fmt: skip
def test_both_react_who_perceive_one_another(clause: TimeGap | Contact) -> None:
    people = {CAR: EASTWARDS, OTHER: NORTHWARDS}
    reacted = []
    for seed in range(4):
        context = SolverContext(
            people, dict.fromkeys(people, BARE), np.random.default_rng(seed), lenient=False
        )
        staged = next(ForegroundSolver(context).schedule_all((clause,), PartialSchedule()))
        reacted += [bool(staged.actors[name].slowings) for name in people]
    assert sum(reacted) >= 7


def test_who_does_not_react_keeps_its_motion() -> None:
    people = {CAR: EASTWARDS, OTHER: NORTHWARDS}
    context = SolverContext(
        people, dict.fromkeys(people, BARE), np.random.default_rng(1), lenient=False,
        reactions=ReactionRequests(frozenset({CAR}), {}),
    )  # fmt: skip

    staged = next(
        ForegroundSolver(context).schedule_all(
            (Contact(first=CAR, second=OTHER),), PartialSchedule()
        )
    )

    assert not staged.actors[CAR].slowings
    assert staged.actors[OTHER].slowings
