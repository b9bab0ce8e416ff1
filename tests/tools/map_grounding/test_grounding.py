"""What words about agents leave open on the map, and which patterns the map can play."""

from __future__ import annotations

from collections import Counter
from itertools import islice, product

import numpy as np
import pytest

from scenewright.errors import Rejected
from scenewright.intersections import load_map
from scenewright.scene.map_elements import Route
from scenewright.scene.relations import load_patterns
from scenewright.scene.social import AgentNode, RelationEdge, SocialGraph
from scenewright.scene.uturns import make_route
from scenewright.tools.map_grounding.grounding import ground_graph
from scenewright.tools.map_grounding.role_search import (
    find_assignments,
    find_patterns,
    may_run_unasked,
)
from scenewright.tools.map_grounding.route_meetings import can_serve, have_conflict, share_green

ON = load_map("amsterdam_120")
ROUTES = {route.id: route for route in ON.routes}
CAR, OTHER, WALKER = "vehicle-1", "vehicle-2", "pedestrian-1"


def vehicle(name=CAR, **known) -> AgentNode:
    return AgentNode(id=name, type="vehicle", **known)


def pedestrian(name=WALKER, **known) -> AgentNode:
    return AgentNode(id=name, type="pedestrian", **known)


def edge(relation, first, second, **more) -> RelationEdge:
    return RelationEdge(type=relation, from_=first, to=second, **more)


def open_to(agent) -> set[str]:
    grounding = ground_graph(SocialGraph(agents=(agent,)), intersection_map=ON)
    return {route.id for route in grounding.routes[agent.id]}


def drawn(graph, count=40, seed=0):
    grounding = ground_graph(graph, intersection_map=ON)
    found = find_assignments(graph, grounding, intersection_map=ON, rng=np.random.default_rng(seed))
    return list(islice(found, count))


@pytest.mark.parametrize(
    ("agent", "expected"),
    [
        (vehicle(entry="north", movement="left"), {"vehicle:north>east:left"}),
        (vehicle(entry="north", exit="east"), {"vehicle:north>east:left"}),
        (vehicle(exit="west", movement="right"), {"vehicle:north>west:right"}),
        (
            vehicle(entry="south"),
            {"vehicle:south>north:straight", "vehicle:south>west:left", "vehicle:south>east:right"},
        ),
        (
            pedestrian(crosswalk="north", entry="west"),
            {f"pedestrian:north:west>east:{a}>{b}" for a, b in product(("along", "leg"), repeat=2)},
        ),
        (
            pedestrian(movement="jaywalking", crosswalk="east"),
            {"pedestrian:east:north>south:jaywalk", "pedestrian:east:south>north:jaywalk"},
        ),
    ],
)
def test_what_is_said_narrows_the_routes(agent, expected):
    assert open_to(agent) == expected


def test_what_is_not_said_stays_open():
    assert len(open_to(vehicle())) == 12
    assert all("jaywalk" not in route for route in open_to(pedestrian()))
    assert {ROUTES[r].crosswalk for r in open_to(pedestrian(entry="east"))} == {"north", "south"}


def test_no_such_way_is_told_in_words():
    with pytest.raises(Rejected) as refused:
        open_to(vehicle(entry="north", exit="north"))
    rejection = refused.value.rejection
    assert (rejection.code, rejection.agents) == ("ungroundable", (CAR,))
    assert "from the north" in rejection.detail
    assert "has no way through" in rejection.detail


@pytest.mark.parametrize(
    ("agents", "relation", "words"),
    [
        (
            (
                vehicle(entry="north", movement="right"),
                vehicle(OTHER, entry="south", movement="right"),
            ),
            edge("near_miss", CAR, OTHER),
            f"{CAR} near miss {OTHER}",
        ),
        (
            (vehicle(), pedestrian(movement="jaywalking"), pedestrian("pedestrian-2")),
            edge("yield_to", "pedestrian-2", WALKER),
            f"pedestrian-2 yield to {WALKER}",
        ),
        (
            (vehicle(entry="north"), vehicle(OTHER, entry="east")),
            edge("collide_at", CAR, OTHER, kind="rear_end"),
            "(rear end)",
        ),
    ],
)
def test_routes_that_cannot_meet_so_are_told(agents, relation, words):
    with pytest.raises(Rejected) as refused:
        ground_graph(SocialGraph(agents=agents, relations=(relation,)), intersection_map=ON)
    rejection = refused.value.rejection
    assert rejection.code == "ungroundable"
    assert rejection.agents == (relation.from_, relation.to)
    assert words in rejection.detail


def test_relations_possible_alone_but_not_together_are_told():
    """One right turn cannot cross the ways of two who come from opposite sides and turn right."""
    agents = (
        pedestrian(movement="crossing"),
        vehicle(entry="north", movement="right"),
        vehicle(OTHER, entry="south", movement="right"),
    )
    both = (edge("yield_to", CAR, WALKER), edge("yield_to", OTHER, WALKER))
    with pytest.raises(Rejected, match="does not fit together with the other relations"):
        ground_graph(SocialGraph(agents=agents, relations=both), intersection_map=ON)


def test_one_unplayable_relation_among_many_is_found_at_once():
    cars = [vehicle(f"vehicle-{n}") for n in range(1, 7)]
    walkers = [pedestrian(f"pedestrian-{n}") for n in (1, 2)]
    relations = [edge("near_miss", f"vehicle-{n}", f"vehicle-{n + 1}") for n in (1, 3, 5)]
    relations.append(edge("yield_to", "pedestrian-1", "pedestrian-2"))
    with pytest.raises(Rejected, match="pedestrian-1 yield to pedestrian-2"):
        ground_graph(
            SocialGraph(agents=(*cars, *walkers), relations=tuple(relations)), intersection_map=ON
        )


def test_one_agents_relation_entails_the_others_routes():
    graph = SocialGraph(
        agents=(vehicle(entry="north", movement="left"), vehicle(OTHER, movement="straight")),
        relations=(edge("yield_to", CAR, OTHER),),
    )
    entries = {cast.routes[OTHER].entry for cast in drawn(graph)}
    assert "south" in entries
    assert "north" not in entries
    graph = SocialGraph(
        agents=(vehicle(entry="north", movement="right"), pedestrian()),
        relations=(edge("yield_to", CAR, WALKER),),
    )
    assert {cast.routes[WALKER].crosswalk for cast in drawn(graph)} <= {"north", "west"}


def test_every_cast_keeps_to_the_grounding_and_to_its_pattern():
    graph = SocialGraph(
        agents=(vehicle(), vehicle(OTHER, entry="east"), pedestrian()),
        relations=(edge("near_miss", CAR, OTHER), edge("yield_to", OTHER, WALKER)),
    )
    grounding = ground_graph(graph, intersection_map=ON)
    by_id = {pattern.id: pattern for pattern in load_patterns()}
    for cast in drawn(graph):
        assert all(route in grounding.routes[name] for name, route in cast.routes.items())
        for played, relation in zip(cast.patterns, graph.relations, strict=True):
            pattern = by_id[played.pattern]
            assert pattern.relation == relation.type
            a, b = cast.routes[played.from_], cast.routes[played.to]
            assert can_serve(pattern, a, b, intersection_map=ON)
            assert {played.from_, played.to} == {relation.from_, relation.to}
            if not share_green(a, b, intersection_map=ON) and pattern.violator:
                assert played.violator is not None


def test_roles_of_a_directed_relation_are_never_swapped():
    graph = SocialGraph(
        agents=(vehicle(), pedestrian()), relations=(edge("yield_to", WALKER, CAR),)
    )
    assert all(cast.patterns[0].from_ == WALKER for cast in drawn(graph))
    strike = SocialGraph(
        agents=(vehicle(), pedestrian()), relations=(edge("collide_at", WALKER, CAR),)
    )
    assert all(cast.patterns[0].from_ == CAR for cast in drawn(strike))


def test_likelier_routes_come_first_more_often():
    graph = SocialGraph(agents=(vehicle(),))
    grounding = ground_graph(graph, intersection_map=ON)

    def weight(route: Route) -> float:
        return 50.0 if route.movement == "straight" else 1.0

    first = Counter(
        next(
            find_assignments(
                graph,
                grounding,
                intersection_map=ON,
                rng=np.random.default_rng(seed),
                weight=weight,
            )
        )
        .routes[CAR]
        .movement
        for seed in range(100)
    )
    assert first["straight"] >= 85


def test_who_runs_the_red_light_as_said_is_the_violator():
    graph = SocialGraph(
        agents=(vehicle(entry="north"), vehicle(OTHER, entry="east", runs_red=True)),
        relations=(edge("collide_at", CAR, OTHER),),
    )
    assert {cast.patterns[0].violator for cast in drawn(graph)} == {OTHER}


def test_agents_that_no_relation_binds_do_not_multiply_the_search_for_red_lights():
    walkers = tuple(pedestrian(f"pedestrian-{n}", movement="crossing") for n in range(1, 9))
    agents = (vehicle(), vehicle(OTHER), *walkers)
    graph = SocialGraph(agents=agents, relations=(edge("follow", CAR, OTHER),))
    grounding = ground_graph(graph, intersection_map=ON)
    assert not may_run_unasked(graph, grounding, intersection_map=ON)


@pytest.mark.parametrize("kind", ["rear_end", "sideswipe", "head_on", "left_turn", "angle"])
def test_a_named_kind_of_collision_restricts_the_patterns(kind):
    graph = SocialGraph(
        agents=(vehicle(), vehicle(OTHER)), relations=(edge("collide_at", CAR, OTHER, kind=kind),)
    )
    found = find_patterns(graph.relations[0], graph)
    assert found
    assert {pattern.kind for pattern in found} == {kind}


def test_a_near_miss_in_one_lane_comes_about_in_some_way_that_no_word_names():
    ways = [vehicle(name, entry="north", movement="straight") for name in (CAR, OTHER)]
    graph = SocialGraph(agents=tuple(ways), relations=(edge("near_miss", CAR, OTHER),))
    found = {cast.patterns[0].pattern for cast in drawn(graph)}
    assert found <= {"near_miss_lead_brakes", "cut_in_near_miss"}
    elsewhere = SocialGraph(
        agents=(vehicle(), vehicle(OTHER)), relations=(edge("near_miss", CAR, OTHER),)
    )
    first = {drawn(elsewhere, 1, seed)[0].patterns[0].pattern for seed in range(12)}
    assert first.isdisjoint(found)


def test_patterns_fit_relation_and_classes():
    graph = SocialGraph(
        agents=(vehicle(), pedestrian()), relations=(edge("yield_to", WALKER, CAR),)
    )
    for pattern in find_patterns(graph.relations[0], graph):
        assert pattern.relation == "yield_to"
        assert {pattern.from_.type, pattern.to.type} == {"vehicle", "pedestrian"}


@pytest.mark.parametrize("pattern", load_patterns(), ids=lambda pattern: pattern.id)
def test_every_pattern_can_be_played_on_the_shipped_map(pattern):
    ways = (*ON.routes, *map(make_route, ON.uturns))
    assert any(can_serve(pattern, a, b, intersection_map=ON) for a, b in product(ways, repeat=2))


@pytest.mark.parametrize(
    ("a", "b", "together"),
    [
        ("vehicle:north>south:straight", "vehicle:south>north:straight", True),
        ("vehicle:north>east:left", "vehicle:south>north:straight", True),
        ("vehicle:north>south:straight", "vehicle:east>west:straight", False),
        ("vehicle:north>south:straight", "pedestrian:north:west>east:along>along", False),
        ("vehicle:north>west:right", "pedestrian:west:south>north:along>along", True),
        ("vehicle:east>west:straight", "pedestrian:north:west>east:jaywalk", True),
    ],
)
def test_green_together_is_read_off_the_programme(a, b, together):
    assert share_green(ROUTES[a], ROUTES[b], intersection_map=ON) is together
    assert share_green(ROUTES[b], ROUTES[a], intersection_map=ON) is together


@pytest.mark.parametrize(
    ("a", "b", "expected"),
    [
        ("vehicle:north>south:straight", "vehicle:east>west:straight", True),
        ("vehicle:north>south:straight", "vehicle:south>north:straight", False),
        ("vehicle:north>west:right", "pedestrian:west:south>north:along>along", True),
        ("vehicle:north>west:right", "pedestrian:east:south>north:along>along", False),
        ("vehicle:east>west:straight", "pedestrian:west:south>north:jaywalk", True),
        ("vehicle:east>west:straight", "pedestrian:north:west>east:jaywalk", False),
    ],
)
def test_meets_is_whether_the_ways_cross(a, b, expected):
    assert have_conflict(ROUTES[a], ROUTES[b], intersection_map=ON) is expected
    assert have_conflict(ROUTES[b], ROUTES[a], intersection_map=ON) is expected


def test_signals_and_movements_of_routes():
    left = ROUTES["vehicle:north>east:left"]
    assert ON.find_signal_group(left) == "avenue"
    assert ON.find_movement(left).stop_line == "north:stop"
    walk = ROUTES["pedestrian:east:north>south:along>along"]
    assert ON.find_signal_group(walk) == "walk_across_street"
    assert ON.find_movement(walk) is None
    unsignalised = ON.model_copy(update={"signals": None})
    assert unsignalised.find_signal_group(left) is None
    assert share_green(left, ROUTES["vehicle:east>west:straight"], intersection_map=unsignalised)


MINE = """
id = "two_right_turns_follow"
theme = "vehicle-vehicle, same direction"
subtype = "following"
relation = "follow"
geometry = "same_way"
entries = "same"
zone = "lane"
weight = 1000.0
phrases = ["{from} rounds the corner after {to}"]
constraints = ["headway({from}, {to}) in [1.0, 2.0] s"]
[proof]
event = "follow"
[from]
type = "vehicle"
movements = ["right"]
segments = ["keep"]
[to]
type = "vehicle"
movements = ["right"]
segments = ["keep"]
"""


def test_a_file_more_is_a_pattern_more(tmp_path, monkeypatch):
    """Data alone: the file is loaded, matched, cast and drawn as often as its weight says."""
    (tmp_path / "mine.toml").write_text(MINE, "utf-8")
    monkeypatch.setenv("SCENEWRIGHT_RELATIONS", str(tmp_path))
    graph = SocialGraph(agents=(vehicle(), vehicle(OTHER)), relations=(edge("follow", CAR, OTHER),))
    assert "two_right_turns_follow" in {
        pattern.id for pattern in find_patterns(graph.relations[0], graph)
    }
    casting = [drawn(graph, 1, seed)[0] for seed in range(20)]
    mine = [cast for cast in casting if cast.patterns[0].pattern == "two_right_turns_follow"]
    assert len(mine) >= 18
    assert {cast.routes[CAR].movement for cast in mine} == {"right"}


def test_a_pattern_that_the_edge_names_is_the_only_one_and_keeps_its_roles():
    named = edge("collide_at", CAR, OTHER, pattern="straight_crossing_collision")
    graph = SocialGraph(agents=(vehicle(), vehicle(OTHER)), relations=(named,))
    casting = [cast for seed in range(5) for cast in drawn(graph, 20, seed)]
    played = {(each.patterns[0].pattern, each.patterns[0].from_) for each in casting}
    assert played == {("straight_crossing_collision", CAR)}


def test_who_is_on_foot_cannot_brake() -> None:
    late = edge("near_miss", CAR, WALKER, cause="late_brake", braker=WALKER)
    with pytest.raises(Rejected, match=f"{WALKER} has no brakes; as braker write the vehicle"):
        ground_graph(
            SocialGraph(agents=(vehicle(), pedestrian()), relations=(late,)), intersection_map=ON
        )


def test_late_braking_needs_a_collision_or_a_near_miss() -> None:
    late = edge("yield_to", CAR, WALKER, cause="late_brake")
    with pytest.raises(Rejected, match="late_brake goes with collide_at or near_miss"):
        ground_graph(
            SocialGraph(agents=(vehicle(), pedestrian()), relations=(late,)), intersection_map=ON
        )
