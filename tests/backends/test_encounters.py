"""Words about a vehicle in somebody's way become objects of the plan that an agent meets."""

from __future__ import annotations

import pytest

from scenewright import synthesize
from scenewright.backends.builtin.planner import plan
from scenewright.scene.social import Refusal, SocialGraph


@pytest.mark.parametrize(
    ("text", "met"),
    [
        ("A car goes around a stalled van", ("vehicle-1", "goes_round", "stalled", "van")),
        (
            "There is a broken-down lorry on the east approach. A car passes it.",
            ("vehicle-1", "goes_round", "stalled", "truck"),
        ),
        (
            "A cyclist swerves around a double-parked car",
            ("cyclist-1", "goes_round", "double_parked", "car"),
        ),
        (
            "A bus waits behind a stalled car on the south leg",
            ("vehicle-1", "waits_behind", "stalled", "car"),
        ),
        (
            "A car comes up behind a stalled taxi and stops",
            ("vehicle-1", "waits_behind", "stalled", "taxi"),
        ),
        ("A stalled car is hit by a motorcycle", ("vehicle-1", "hits", "stalled", "car")),
        ("A car hits a parked car", ("vehicle-1", "hits", "parked", "car")),
    ],
)
def test_encounters_are_read(text: str, met: tuple[str, str, str, str]) -> None:
    graph = plan(text)
    assert isinstance(graph, SocialGraph)
    (node,) = graph.objects
    assert (node.met_by, node.encounter, node.kind, node.subtype) == met
    assert not graph.relations
    said = {each.became: each.words for each in graph.said}
    assert {"object", "encounter"} <= said.keys()
    assert all(each.words == text[each.start : each.end] for each in graph.said)
    leg = next((word for word in ("east", "south") if word in text), None)
    assert node.leg == leg == graph.agents[0].entry


def test_who_waits_in_traffic_is_no_object() -> None:
    graph = plan("A car rear-ends a van waiting at the red light")
    assert isinstance(graph, SocialGraph)
    assert not graph.objects
    assert [edge.kind for edge in graph.relations] == ["rear_end"]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("A car hits a parked truck at 30 km/h", "How fast"),
        ("A pedestrian goes around a stalled car", "not clear which"),
        ("A car waits behind a stalled van and hits a pedestrian", "no relation can bind it"),
    ],
)
def test_what_cannot_be_is_refused_by_name(text: str, words: str) -> None:
    found = plan(text)
    assert isinstance(found, Refusal)
    assert words in found.reason


@pytest.mark.parametrize(
    ("text", "figure"),
    [
        ("A car goes around a stalled van on the north approach", "clearance"),
        ("A car stops behind a broken-down truck and waits", "gap"),
        ("A taxi rear-ends a stalled car", "speed"),
    ],
)
def test_encounters_are_made_and_proven(text: str, figure: str) -> None:
    scene = synthesize(text, seed=0, refiner="none")
    assert scene.proof.verified
    (seen,) = scene.proof.figures["encounters"]
    assert seen[figure] > 0
    given = [each for each in scene.proof.said if each.became == "encounter"]
    assert [each.status for each in given] == ["realised"]


@pytest.mark.parametrize(
    "text",
    [
        "A pedestrian turns back halfway across the north crosswalk and is nearly hit by a car",
        "A jaywalker turns back halfway across the road and is struck by a car",
    ],
)
def test_who_turns_back_is_seen_doing_it(text: str) -> None:
    scene = synthesize(text, seed=0, refiner="none")
    assert scene.record.agents[0].motion == "turns_back"
    (given,) = [each for each in scene.proof.said if each.became == "motion"]
    assert given.status == "realised"
    assert "turns back" in str(given.evidence)


@pytest.mark.parametrize(
    "text",
    [
        "A car right-hooks a cyclist and nearly hits him",
        "A van right hooks a cyclist but just misses her",
    ],
)
def test_a_hook_that_nearly_hits_is_a_near_miss(text: str) -> None:
    graph = plan(text)
    assert isinstance(graph, SocialGraph)
    (edge,) = graph.relations
    assert (edge.type, edge.pattern) == ("near_miss", "rider_right_hook_near_miss")


@pytest.mark.parametrize(
    ("text", "motion"),
    [
        ("A car brakes hard for a yellow light", "stops_at_yellow"),
        ("A car blocks the box when the light turns green for cross traffic", "blocks_junction"),
    ],
)
def test_what_one_vehicle_does_at_its_light_is_seen(text: str, motion: str) -> None:
    scene = synthesize(text, seed=0, refiner="none")
    assert scene.record.agents[0].motion == motion
    (given,) = [each for each in scene.proof.said if each.became == "motion"]
    assert (given.value, given.status) == (motion, "realised")
