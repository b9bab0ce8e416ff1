"""Parties to be seated, and the least of all arrangements by brute force."""

from __future__ import annotations

from functools import cache
from itertools import product

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
SPARE_COST = 5.0


def option(of, index, starts, cost, drawn_time=0) -> Option:
    return Option(
        lambda: of, index, np.array(sorted(starts), dtype=np.int64), float(cost), drawn_time
    )


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


def least_cost(agents, fixed, wanted):
    """Of all arrangements that keep everybody apart; None if there is none."""
    best = None
    ways = []
    for each in agents:
        least = min(o.cost for o in each.options)
        own = [
            (each, o.actor, int(start), o.cost - least + SPARE_COST * each.reserve)
            for o in each.options
            for start in o.starts
        ]
        ways.append(own if each.foreground else [None, *own])
    for choice in product(*ways):
        taken = [each for each in choice if each]
        counts = dict.fromkeys(wanted, 0)
        for each, *_ in taken:
            if not each.foreground:
                counts[each.type] += 1
        cost = sum(each[3] for each in taken)
        if counts != wanted or (best is not None and cost >= best):
            continue
        placed = [(a, start, g.foreground) for g, a, start, _ in taken]
        apart = all(
            keeps_apart((f, round(f.enters / STEP)), (a, start), strict=True)
            for f in fixed.values()
            for a, start, _ in placed
        ) and all(
            keeps_apart(placed[m][:2], placed[n][:2], placed[n][2] or placed[m][2])
            for n in range(len(placed))
            for m in range(n)
        )
        best = cost if apart else best
    return best


OPTION = st.tuples(
    st.integers(0, len(ROADS) - 1),
    st.sets(st.integers(-60, 60), min_size=2, max_size=4),
    st.integers(0, 5),
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
        built = [option(ROADS[r], k, s, c) for k, (r, s, c) in enumerate(of_one_kind)]
        agents.append(agent(f"guest-{n}", built, foreground=foreground and n == 0, reserve=reserve))
    free = [each for each in agents if not each.foreground]
    wanted = {}
    for kind in ("vehicle", "pedestrian"):
        most = sum(each.type == kind for each in free)
        wanted[kind] = draw(st.integers((most + 1) // 2, most))
    fixed = {"fixed": NORTHWARDS} if draw(st.booleans()) else {}
    return agents, fixed, wanted


def is_a_seating(assignment, agents, fixed, wanted) -> float:
    """Asserts that it is one, and returns its cost."""
    by_name = {each.name: each for each in agents}
    cost = sum(
        o.cost - min(x.cost for x in by_name[name].options) + SPARE_COST * by_name[name].reserve
        for name, (o, _) in assignment.items()
    )
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
    return cost


def crowded():
    """Five cars that come along one road, whenever they like; the last two are spares."""
    return [
        agent(
            f"vehicle-{n}",
            [option(EASTWARDS, 0, range(0, 120, 2), 1.0), option(SLOWLY, 1, range(0, 120, 2), 0.5)],
            reserve=n >= 3,
        )
        for n in range(5)
    ]
