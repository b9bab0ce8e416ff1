"""Forms in which strangers write: letters for road users, slips, numbers, swerves, denials."""

from __future__ import annotations

import pytest

from scenewright.backends.builtin.planner import plan
from scenewright.backends.builtin.reader.numbers import number_in
from scenewright.backends.builtin.reader.words import find_class, find_subtype
from scenewright.scene.phrasing import describe_graph
from scenewright.scene.social import Refusal, SocialGraph


@pytest.mark.parametrize(
    ("text", "meant"),
    [
        ("veh W->E, ped lets veh go", "The pedestrian yields to the vehicle."),
        ("Two cars crash in the middle of the junction", "Car 1 collides with car 2."),
        ("A bycicle and a buss colide", "The cyclist collides with the bus."),
        ("A (northbound) collides with B (eastbound).", "Vehicle 1 collides with vehicle 2."),
        ("ego car must swerve, a child runs out from behind a parked truck",
         "The car narrowly misses the pedestrian."),
        ("Lorry dead in S lane. 2 cars queue behind. Neither passes.",
         "Car 2 waits behind a stalled truck on the south leg."),
        ("A car cuts in ahead of a bus and the bus swerves", "A bus swerves within its lane."),
        ("A girl crosses the east crosswalk, she doesn't run, a car waits for her",
         "A pedestrian crosses on the east crosswalk."),
    ],
)  # fmt: skip
def test_it_is_read_as_it_is_meant(text: str, meant: str) -> None:
    graph = plan(text)
    assert isinstance(graph, SocialGraph), graph
    assert meant in describe_graph(graph)


@pytest.mark.parametrize(
    ("words", "subtype"),
    [("a buss", "bus"), ("taxsi", "taxi"), ("a trcuk", "truck"), ("a man", None), ("a tram", None)],
)
def test_a_slip_of_the_finger_leaves_a_class_what_it_is(words: str, subtype: str | None) -> None:
    assert find_subtype(words) == subtype


def test_numbers_of_two_words_are_one() -> None:
    assert [number_in(words) for words in ("thirty-five cars", "twenty two", "six")] == [35, 22, 6]


def test_what_something_becomes_has_a_class() -> None:
    found = [find_class(words) for words in ("a cyclist", "a jogger", "a lorry", "an e-scooter")]
    assert found == ["cyclist", "pedestrian", "vehicle", "scooter"]


def test_nothing_happens_is_never_offered_for_a_crash() -> None:
    refused = plan("A car hits a wombat")
    assert isinstance(refused, Refusal)
    assert not any("Nothing happens" in each for each in refused.did_you_mean)
