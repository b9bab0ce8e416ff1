"""Parties to be seated, and the least of all arrangements by brute force."""

from __future__ import annotations

from hypothesis import strategies as st

from scenewright.scene.track import STEP
from scenewright.tools.solver.background_assignment import BackgroundAgent, PlacedAgent
from scenewright.tools.solver.reservation import find_blocked_offsets
from solver_agents import EAST, NORTH, SOUTH, WESTBOUND, actor, candidate, law, straight, walker

EASTWARDS = actor(candidate(straight((-40.0, 0.0), EAST, 80.0)))
SLOWLY = actor(candidate(straight((-40.0, 0.4), EAST, 80.0), time_law=law(6.0)))
NORTHWARDS = actor(candidate(straight((0.0, -40.0), NORTH, 80.0), route=WESTBOUND))
ON_FOOT = actor(walker(straight((6.0, 10.0), SOUTH, 20.0)))
AWAY = actor(candidate(straight((-40.0, 30.0), EAST, 80.0)))
ROADS = (EASTWARDS, SLOWLY, NORTHWARDS, ON_FOOT)


def agent(name, options, *, foreground=False) -> BackgroundAgent:
    """An agent that takes the first (road, index, entry times [steps]) with room."""

    def place(street):
        for of, index, starts in options:
            for start in starts:
                placed = of.shift(STEP * start - of.enters)
                if street.present.is_free(placed, foreground=foreground):
                    return PlacedAgent(placed, index)
        return None

    return BackgroundAgent(name, options[0][0].candidate.route.type, foreground, place)


def keeps_apart(a, b, strict) -> bool:
    delta = (b.enters - a.enters) / STEP
    return not any(low < delta < high for low, high in find_blocked_offsets(a, b, strict=strict))


OPTION = st.tuples(
    st.integers(0, len(ROADS) - 1),
    st.sets(st.integers(-60, 60), min_size=2, max_size=4),
)
GUEST = st.tuples(st.lists(OPTION, min_size=1, max_size=3), st.booleans())


@st.composite
def parties(draw):
    agents = []
    for n, (options, foreground) in enumerate(draw(st.lists(GUEST, min_size=2, max_size=4))):
        road = options[0][0]
        of_one_kind = [o for o in options if (o[0] == 3) == (road == 3)]
        built = [(ROADS[r], k, sorted(s)) for k, (r, s) in enumerate(of_one_kind)]
        agents.append(agent(f"guest-{n}", built, foreground=foreground and n == 0))
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
    placed = [(name, each.actor) for name, each in assignment.items()]
    for n, (name, each) in enumerate(placed):
        for f in fixed.values():
            assert keeps_apart(f, each, strict=True)
        for other, before in placed[:n]:
            strict = by_name[name].foreground or by_name[other].foreground
            assert keeps_apart(before, each, strict)


def crowded():
    """Five cars that come along one road, whenever they like; the last two are spares."""
    times = range(0, 120, 2)
    return [agent(f"vehicle-{n}", [(EASTWARDS, 0, times), (SLOWLY, 1, times)]) for n in range(5)]
