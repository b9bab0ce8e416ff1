"""Grounding of what binds agents beyond one relation: tied entries, red lights, ends of tracks."""

from __future__ import annotations

from itertools import islice

import numpy as np
import pytest

from scenewright.errors import Rejected
from scenewright.intersections import load_map
from scenewright.scene.candidates import AssignedPattern, RoleAssignment
from scenewright.scene.social import AgentNode, EntryTie, RelationEdge, SocialGraph
from scenewright.tools.map_grounding.grounding import ground_graph
from scenewright.tools.map_grounding.role_search import (
    count_signal_conflicts,
    find_assignments,
    is_on_side,
)
from scenewright.tools.map_grounding.route_meetings import share_green

ON = load_map("amsterdam_120")
ROUTES = {route.id: route for route in ON.routes}
CAR, OTHER, THIRD, WALKER, SECOND = (
    "vehicle-1", "vehicle-2", "vehicle-3", "pedestrian-1", "pedestrian-2",
)  # fmt: skip


def node(name, **known) -> AgentNode:
    return AgentNode(id=name, type=name.partition("-")[0], **known)


def edge(relation, first, second, **more) -> RelationEdge:
    return RelationEdge(type=relation, from_=first, to=second, **more)


def tie(side, agent=OTHER, of=CAR) -> EntryTie:
    return EntryTie(agent=agent, of=of, side=side)


def graph(*parts) -> SocialGraph:
    return SocialGraph(
        agents=tuple(each for each in parts if isinstance(each, AgentNode)),
        relations=tuple(each for each in parts if isinstance(each, RelationEdge)),
        ties=tuple(each for each in parts if isinstance(each, EntryTie)),
    )


def drawn(of: SocialGraph, count=40, seed=0):
    grounding = ground_graph(of, intersection_map=ON)
    found = find_assignments(of, grounding, intersection_map=ON, rng=np.random.default_rng(seed))
    return list(islice(found, count))


def refusal(of: SocialGraph) -> str:
    with pytest.raises(Rejected) as refused:
        ground_graph(of, intersection_map=ON)
    return refused.value.rejection.detail


@pytest.mark.parametrize(
    ("entry", "sides"),
    [
        ("north", {"same"}),
        ("east", {"other", "lateral", "left"}),
        ("south", {"other", "opposite"}),
        ("west", {"other", "lateral", "right"}),
    ],
)
def test_how_an_entry_lies_to_the_north(entry, sides):
    every = ("same", "other", "opposite", "lateral", "left", "right")
    assert {side for side in every if is_on_side(side, entry, of="north")} == sides | (
        {"other"} if entry != "north" else set()
    )


@pytest.mark.parametrize("side", ["other", "opposite", "lateral", "left", "right"])
def test_tied_entries_hold_in_every_cast(side):
    found = drawn(graph(node(CAR), node(OTHER), edge("near_miss", CAR, OTHER), tie(side)))
    assert len({cast.routes[CAR].entry for cast in found}) > 1
    for cast in found:
        assert is_on_side(side, cast.routes[OTHER].entry, of=cast.routes[CAR].entry)


def test_a_tie_holds_for_whom_no_relation_binds():
    free = graph(
        node(CAR), node(WALKER), node(OTHER), node(THIRD), edge("yield_to", CAR, WALKER),
        tie("left"), tie("opposite", THIRD, OTHER),
    )  # fmt: skip
    for cast in drawn(free):
        entries = {name: route.entry for name, route in cast.routes.items()}
        assert is_on_side("left", entries[OTHER], of=entries[CAR])
        assert is_on_side("opposite", entries[THIRD], of=entries[OTHER])


def test_a_tie_that_forbids_the_relation_is_named():
    hit = edge("collide_at", CAR, OTHER, kind="head_on")
    told = refusal(graph(node(CAR), node(OTHER), hit, tie("same")))
    assert told.endswith("cannot happen where vehicle-2 comes from the same leg as vehicle-1")


def test_a_named_runner_meets_the_other_at_green_where_it_can():
    runs = node(CAR, entry="east", runs_red=True)
    for relation in ("collide_at", "near_miss"):
        hit = edge(relation, CAR, OTHER, cause="red_light_run")
        for seed in range(20):
            (cast,) = drawn(graph(runs, node(OTHER), hit), count=1, seed=seed)
            (played,) = cast.patterns
            assert played.violator == CAR
            assert not share_green(cast.routes[CAR], cast.routes[OTHER], intersection_map=ON)
            assert count_signal_conflicts(cast, intersection_map=ON) == 0


def test_running_red_rear_ends_nobody_unless_the_text_says_so():
    runs, hit = node(CAR, runs_red=True), edge("collide_at", CAR, OTHER, cause="red_light_run")
    assert all(
        cast.routes[CAR].entry != cast.routes[OTHER].entry
        for cast in drawn(graph(runs, node(OTHER), hit))
    )
    rear = hit.model_copy(update={"kind": "rear_end"})
    assert drawn(graph(runs, node(OTHER), rear), count=1)


def test_who_gives_way_elsewhere_does_not_run_red():
    chain = graph(
        node(CAR, entry="west", movement="straight"), node(OTHER, entry="south"),
        node(WALKER, crosswalk="east"),
        edge("yield_to", CAR, OTHER), edge("collide_at", CAR, WALKER),
    )  # fmt: skip
    for cast in drawn(chain):
        assert CAR not in {played.violator for played in cast.patterns}


def test_lights_are_at_odds_where_one_who_obeys_cannot_meet_another():
    """East and south never have green together, whoever of the two is said to run red."""
    crossing = (node(CAR, entry="east"), node(OTHER, entry="south"))
    (cast,) = drawn(graph(*crossing, edge("near_miss", CAR, OTHER)), count=1)
    assert count_signal_conflicts(cast, intersection_map=ON) == 0
    lawful = cast.patterns[0].model_copy(update={"violator": None})
    assert (
        count_signal_conflicts(cast.model_copy(update={"patterns": (lawful,)}), intersection_map=ON)
        == 1
    )


@pytest.mark.parametrize(
    "hits",
    [
        (edge("collide_at", CAR, WALKER), edge("collide_at", CAR, SECOND)),
        (edge("collide_at", CAR, OTHER), edge("collide_at", OTHER, THIRD)),
    ],
)
def test_no_agent_collides_twice_unless_it_is_pushed(hits):
    everybody = (node(each) for each in (CAR, OTHER, THIRD, WALKER, SECOND))
    told = refusal(graph(*everybody, *hits))
    assert "would be in 2 collisions, but its track ends at the first" in told


def test_nobody_waits_for_a_wreck_to_pass():
    def chain(first, second):
        return graph(
            node(CAR, entry="south"), node(WALKER, crosswalk=first),
            node(SECOND, crosswalk=second),
            edge("yield_to", WALKER, CAR), edge("collide_at", CAR, SECOND),
        )  # fmt: skip

    assert "never passes pedestrian-1" in refusal(chain("north", "north"))
    for cast in drawn(chain(None, None)):
        assert cast.routes[WALKER].crosswalk == "south"
        assert cast.routes[SECOND].crosswalk == cast.routes[CAR].exit


def test_a_pedestrian_gives_way_from_the_kerb_next_to_the_lane():
    def odd(entry, exit_):
        routes = {
            "pedestrian-1": ROUTES[f"pedestrian:north:{entry}>{exit_}:along>along"],
            "vehicle-1": ROUTES["vehicle:south>north:straight"],
        }
        yields = AssignedPattern(
            edge=0,
            pattern="pedestrian_yields_to_vehicle_through",
            from_="pedestrian-1",
            to="vehicle-1",
            violator="vehicle-1",
        )
        return count_signal_conflicts(
            RoleAssignment(routes=routes, patterns=(yields,)), intersection_map=ON
        )

    # Northbound traffic keeps to the east side of the avenue.
    assert odd("east", "west") == 0
    assert odd("west", "east") == 1
