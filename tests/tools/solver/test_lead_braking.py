"""A leader that brakes hard, and what becomes of the vehicle behind it."""

from __future__ import annotations

from itertools import islice

import numpy as np
import pytest

from scenewright.scene.constraints import Contact, StopsBehind
from scenewright.tools.solver.context import SolverContext, find_contact_nodes
from scenewright.tools.solver.foreground import ForegroundSolver
from scenewright.tools.solver.hard_braking import compute_smooth_acceleration
from scenewright.tools.solver.impact import find_least_clearance
from scenewright.tools.solver.path_ttc import compute_path_ttc
from scenewright.tools.solver.scheduled_agent import PartialSchedule
from solver_agents import BARE, EAST, candidate, law, straight

AHEAD = candidate(straight((-60.0, 0.0), EAST, 120.0), time_law=law(10.0))
BEHIND = candidate(straight((-60.0, 0.2), EAST, 120.0), time_law=law(11.0))


def play(clause: StopsBehind | Contact, *, seed: int = 0) -> list[PartialSchedule]:
    both = {"vehicle-1": BEHIND, "vehicle-2": AHEAD}
    context = SolverContext(both, dict.fromkeys(both, BARE), np.random.default_rng(seed))
    return list(islice(ForegroundSolver(context).schedule_all((clause,), PartialSchedule()), 4))


@pytest.mark.parametrize(("low", "high"), [(0.8, 1.35), (1.3, 6.0)])
def test_the_follower_stops_behind_at_the_ttc_asked_for(low: float, high: float) -> None:
    clause = StopsBehind(first="vehicle-1", second="vehicle-2", low=low, high=high)
    found = play(clause)
    assert found
    pair = find_contact_nodes(BEHIND, AHEAD)
    for staged in found:
        a, b = staged.actors["vehicle-1"], staged.actors["vehicle-2"]
        assert low <= compute_path_ttc(pair, a, b, horizon=8.0).least <= high
        assert find_least_clearance(a, b)[0] >= 0.5
        assert -compute_smooth_acceleration(b)[1:-1].min() >= 5.2


def test_who_answers_too_late_hits_the_leader_from_behind() -> None:
    clause = Contact(first="vehicle-1", second="vehicle-2", kind="rear_end", cause="lead_brakes")
    found = play(clause)
    assert found
    for staged in found:
        times = {actor.contact for actor in staged.actors.values()}
        assert len(times) == 1
        assert None not in times
        leader = staged.actors["vehicle-2"]
        assert -compute_smooth_acceleration(leader)[1:-1].min() >= 5.2
