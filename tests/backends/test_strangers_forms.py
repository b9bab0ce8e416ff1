"""Forms in which strangers write: letters for road users, slips, numbers, swerves, denials."""

from __future__ import annotations

import pytest

from scenewright.backends.builtin.planner import plan
from scenewright.backends.builtin.reader.numbers import number_in
from scenewright.backends.builtin.reader.words import find_class
from scenewright.backends.builtin.spelling import mend_spelling
from scenewright.graph.arguments import DEFAULT_INTERSECTION
from scenewright.graph.run import synthesize
from scenewright.intersections import load_map
from scenewright.scene.phrasing import describe_graph
from scenewright.scene.social import Refusal, SocialGraph
from scenewright.tools.account import prove


@pytest.mark.parametrize(
    ("text", "meant"),
    [
        ("veh W->E, ped lets veh go", "The pedestrian yields to the vehicle."),
        ("Two cars crash in the middle of the junction", "Car 1 collides with car 2."),
        ("A bycicle and a buss colide", "The cyclist collides with the bus."),
        ("A pedestrian struck by Veh 2, a box truck", "The truck collides with the pedestrian."),
        ("Veh 1 w/b rear-ended veh 2 stopped at the light.", "Vehicle 1 rear-ends vehicle 2."),
        ("I was rear-ended at the light by a truck", "The truck rear-ends the vehicle."),
        ("vehical runs a red lihgt and hits a bycicle", "collides with the cyclist."),
        ("A pedestrian is hit by a vehicle on the minor road (east-west)",
         "A vehicle comes from the east and goes straight."),
        ("ped x2 crossing N leg, car W->N waits for both", "The car yields to pedestrian 2."),
        ("Show a car driving away after the light turns green while a pedestrian waits",
         "There is a car. There is a pedestrian."),
        ("A (northbound) collides with B (eastbound).", "Vehicle 1 collides with vehicle 2."),
        ("ego car must swerve, a child runs out from behind a parked truck",
         "The car narrowly misses the pedestrian."),
        ("Lorry dead in S lane. 2 cars queue behind. Neither passes.",
         "Car 2 waits behind a stalled truck on the south leg."),
        ("A car cuts in ahead of a bus and the bus swerves", "A bus swerves within its lane."),
        ("At 1130 pm a car hits a pedestrian", "It is 23:30."),
        ("A car narrowly misses a pedestrian, minimum TTC 1.2 s", "with a TTC of 1.2 s."),
        ("Two cars crash in the middle of the crossing", "There is car 1. There is car 2."),
        ("A van cuts in from the other lane in front of a car", "There is a van. There is a car."),
        ("A pupil crosses at the lights while it is red for her and a bus nearly hits her",
         "A pedestrian crosses and runs the red light."),
        ("A girl crosses the east crosswalk, she doesn't run, a car waits for her",
         "A pedestrian crosses on the east crosswalk."),
        ("An LTAP/OD near miss between a car and a van", "The van comes oncoming to the car."),
        ("LTAP-LD crash of a car and a motorcycle",
         "The car collides with the motorcycle. The motorcycle comes on the cross street of the"),
        ("scp near miss: car and truck", "A car goes straight. A truck goes straight. The car"),
        ("RTIP crash: a van and a car", "The car comes on the cross street of the van."),
        ("Left turn across path / opposite direction near miss of a taxi and a bus",
         "The taxi narrowly misses the bus. The bus comes oncoming to the taxi."),
    ],
)  # fmt: skip
def test_it_is_read_as_it_is_meant(text: str, meant: str) -> None:
    graph = plan(text)
    assert isinstance(graph, SocialGraph), graph
    assert meant in describe_graph(graph)


@pytest.mark.parametrize(
    ("text", "meant"),
    [
        ("A bus with fifty people on board hits a car", "The bus collides with the car."),
        ("A car stops 3 m from a cyclist", "The car yields to the cyclist."),
        ("A car does not yield to pedestrians and hits one",
         "There is pedestrian 2. The car collides with pedestrian 1."),
    ],
)  # fmt: skip
def test_nothing_is_planned_that_was_not_said(text: str, meant: str) -> None:
    graph = plan(text)
    assert isinstance(graph, SocialGraph), graph
    assert describe_graph(graph).endswith(meant)


@pytest.mark.parametrize(
    ("first", "change", "meant"),
    [
        ("A car runs the red light at about 30 mph and hits a taxi",
         "let the car come at 25 mph instead of 30", "The car drives at 40.2 km/h."),
        ("A car goes at 30 km/h and hits a taxi", "have the car come 10 km/h slower",
         "The car drives at 30 km/h."),
        ("A lorry turning right hits a boy on a bike", "the cyclist should be a girl",
         "The truck collides with the cyclist."),
    ],
)  # fmt: skip
def test_a_change_is_read_as_it_is_meant(first: str, change: str, meant: str) -> None:
    graph = plan(change, previous=first)
    assert isinstance(graph, SocialGraph), graph
    assert describe_graph(graph).endswith(meant)


@pytest.mark.parametrize(
    ("words", "mended"),
    [
        ("a buss and a trcuk lfet", "a bus and a truck left"),
        ("a man from the esat", "a man from the east"),
        ("an ambulence at nite", "an ambulance at nite"), ("a tram", "a tram"), ("Sven", "Sven"),
        ("eighty frogs", "eighty frogs"),
    ],
)  # fmt: skip
def test_slips_of_the_finger_are_mended(words: str, mended: str) -> None:
    assert mend_spelling(words).text == mended


def test_a_conflict_by_its_abbreviation_is_seen_in_the_scene() -> None:
    found = synthesize("An LTAP/LD near miss between a car and a van", seed=0, refiner="none")
    said = {each.words: (each.state, each.claim) for each in found.proof.account}
    assert said["LTAP"] == ("seen", "movement left")
    assert said["LD"] == ("seen", "tie left/right")


def test_numbers_of_two_words_are_one() -> None:
    assert [number_in(words) for words in ("thirty-five cars", "twenty two", "six")] == [35, 22, 6]


def test_what_something_becomes_has_a_class() -> None:
    found = [find_class(words) for words in ("a cyclist", "a jogger", "a lorry", "an e-scooter")]
    assert found == ["cyclist", "pedestrian", "vehicle", "scooter"]


def test_who_passes_a_rider_too_closely_overtakes() -> None:
    for text in ("A driver passes a cyclist far too closely", "A car passes close by a cyclist"):
        graph = plan(text)
        assert isinstance(graph, SocialGraph), graph
        assert [edge.pattern for edge in graph.relations] == ["rider_close_overtaking"]
    through = plan("A car passing through narrowly misses a cyclist")
    assert isinstance(through, SocialGraph)
    assert [edge.pattern for edge in through.relations] == [None]


@pytest.mark.parametrize(
    "text",
    [
        "pedestrian waits for vehicle, veh N->S",
        "v1 n->s; v2 e->w; v1 hits v2",
        "cyclits gets hitt by a trukc turnig rigth",
        "a car waits until it is green",
        "a car stops",
        "A cyclist waits at the red light and a car runs it",
        "2 cars, 1 ped, no conflict",
        "A van is parked at the kerb; a child emerges from behind it and a car brakes hard",
        "A car passes a cyclist too closely",
        "A cyclist riding straight is right-hooked by a delivery van.",
        "While I was turning left someone on a motorbike crashed into my side.",
        "I had to brake hard because a kid ran into the road.",
        "ped x2 crossing N leg, car W->N waits for both",
    ],
)
def test_every_word_of_it_is_shown(text: str) -> None:
    scene = synthesize(text, seed=3, refiner="none")
    assert scene.proof.verified
    assert {each.state for each in scene.proof.account} <= {"seen", "stands_anyway", "manner"}


def test_green_is_contradicted_by_who_runs_red() -> None:
    scene = synthesize("A car runs the red light", seed=3, refiner="none")
    meta = scene.record.meta.model_copy(update={"user_prompt": "A car goes on green"})
    proof = prove(scene.record.model_copy(update={"meta": meta}), load_map(DEFAULT_INTERSECTION))
    assert [each.words for each in proof.account if each.state == "contradicted"] == ["green"]


@pytest.mark.parametrize("words", ["a car passes a van", "a cyclist waits for a van at the light"])
def test_words_for_what_a_scene_does_not_show_stay_claims(words: str) -> None:
    scene = synthesize("A cyclist and a car wait at the red light", seed=3, refiner="none")
    meta = scene.record.meta.model_copy(update={"user_prompt": words})
    proof = prove(scene.record.model_copy(update={"meta": meta}), load_map(DEFAULT_INTERSECTION))
    assert {each.state for each in proof.account} & {"contradicted", "not_shown"}


def test_nothing_happens_is_never_offered_for_a_crash() -> None:
    refused = plan("A car hits a wombat")
    assert isinstance(refused, Refusal)
    assert not any("Nothing happens" in each for each in refused.did_you_mean)
