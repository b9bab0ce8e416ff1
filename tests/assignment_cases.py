"""Parties to be seated, and the least of all arrangements by brute force."""

from __future__ import annotations

from functools import cache

import numpy as np
from hypothesis import strategies as st

from scenewright.scene.track import STEP
from scenewright.tools.solver.background_assignment import BackgroundAgent, Option
from scenewright.tools.solver.reservation import find_blocked_offsets
from solver_agents import EAST, NORTH, SOUTH, WESTBOUND, actor, candidate, law, straight, walker

EASTWARDS = actor(candidate(straight((-40.0, 0.0), EAST, 80.0)))
SLOWLY = actor(candidate(straight((-40.0, 0.4), EAST, 80.0), time_law=law(6.0)))
NORTHWARDS = actor(candidate(straight((0.0, -40.0), NORTH, 80.0), route=WESTBOUND))
ON_FOOT = actor(walker(straight((6.0, 10.0), SOUTH, 20.0)))
AWAY = actor(candidate(straight((-40.0, 30.0), EAST, 80.0)))
ROADS = (EASTWARDS, SLOWLY, NORTHWARDS, ON_FOOT)


def option(of, index, starts, drawn_time=0) -> Option:
    return Option(lambda: of, index, np.array(sorted(starts), dtype=np.int64), drawn_time)


def agent(name, options, *, foreground=False, reserve=False) -> BackgroundAgent:
    kind = options[0].actor.candidate.route.type
    return BackgroundAgent(
        name, kind, foreground, lambda _standing: tuple(options), reserve=reserve
    )


def keeps_apart(one, other, strict) -> bool:
    (a, start_a), (b, start_b) = one, other
    return not any(low < start_b - start_a < high for low, high in _forbidden(a, b, strict))


@cache
def _forbidden(a, b, strict):
    return find_blocked_offsets(a, b, strict=strict)


OPTION = st.tuples(
    st.integers(0, len(ROADS) - 1),
    st.sets(st.integers(-60, 60), min_size=2, max_size=4),
)
GUEST = st.tuples(st.lists(OPTION, min_size=1, max_size=3), st.booleans(), st.booleans())


@st.composite
def parties(draw):
    agents = []
    for n, (options, foreground, reserve) in enumerate(
        draw(st.lists(GUEST, min_size=2, max_size=4))
    ):
        road = options[0][0]
        of_one_kind = [o for o in options if (o[0] == 3) == (road == 3)]
        built = [option(ROADS[r], k, s) for k, (r, s) in enumerate(of_one_kind)]
        agents.append(agent(f"guest-{n}", built, foreground=foreground and n == 0, reserve=reserve))
    free = [each for each in agents if not each.foreground]
    wanted = {}
    for kind in ("vehicle", "pedestrian"):
        most = sum(each.type == kind for each in free)
        wanted[kind] = draw(st.integers((most + 1) // 2, most))
    fixed = {"fixed": NORTHWARDS} if draw(st.booleans()) else {}
    return agents, fixed, wanted


def assert_is_seating(assignment, agents, fixed, wanted) -> None:
    by_name = {each.name: each for each in agents}
    for kind, count in wanted.items():
        crowd = [n for n in assignment if not by_name[n].foreground and by_name[n].type == kind]
        assert len(crowd) == count
    assert all(start in o.starts for o, start in assignment.values())
    placed = list(assignment.items())
    for n, (name, (o, start)) in enumerate(placed):
        for f in fixed.values():
            assert keeps_apart((f, round(f.enters / STEP)), (o.actor, start), strict=True)
        for other, (p, begins) in placed[:n]:
            strict = by_name[name].foreground or by_name[other].foreground
            assert keeps_apart((p.actor, begins), (o.actor, start), strict)


def crowded():
    """Five cars that come along one road, whenever they like; the last two are spares."""
    return [
        agent(
            f"vehicle-{n}",
            [option(EASTWARDS, 0, range(0, 120, 2)), option(SLOWLY, 1, range(0, 120, 2))],
            reserve=n >= 3,
        )
        for n in range(5)
    ]
