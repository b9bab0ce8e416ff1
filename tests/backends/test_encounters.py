"""Words about a vehicle in somebody's way become objects of the plan that an agent meets."""

from __future__ import annotations

import re

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
        (
            "A car waits behind a bus at its stop.",
            ("vehicle-1", "waits_behind", "double_parked", "bus"),
        ),
        ("A stalled car is hit by a motorcycle", ("vehicle-1", "hits", "stalled", "car")),
        ("A car hits a parked car", ("vehicle-1", "hits", "parked", "car")),
        ("A cyclist is doored by a parked van", ("cyclist-1", "doored", "parked", "van")),
        (
            "A cyclist rides into the opening door of a parked taxi on the south leg",
            ("cyclist-1", "doored", "parked", "taxi"),
        ),
        (
            "The driver of a parked car opens her door in front of an e-scooter rider, who hits it",
            ("scooter-1", "doored", "parked", "car"),
        ),
        ("A car nearly hits a stalled van", ("vehicle-1", "stops_short", "stalled", "van")),
        (
            "A van waits for 4 s behind a stalled car, then goes around it",
            ("vehicle-1", "waits_then_passes", "stalled", "car"),
        ),
        (
            "Broken-down hatchback on the east approach; the following car goes around it",
            ("vehicle-1", "goes_round", "stalled", "car"),
        ),
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


@pytest.mark.parametrize(
    ("text", "met"),
    [
        (
            "Lorry dead in S lane. 2 cars queue behind. Neither passes.",
            [("vehicle-1", "waits_behind"), ("vehicle-2", "queues")],
        ),
        (
            "A bus has broken down (north approach). Car 1 goes around, car 2 stays put.",
            [("vehicle-1", "goes_round"), ("vehicle-2", "waits_behind")],
        ),
        (
            "Lead moves over, revealing a stopped car; ego can't avoid it. All from the east.",
            [("vehicle-1", "goes_round"), ("vehicle-2", "hits")],
        ),
    ],
)
def test_several_meet_one_object_in_turn(text: str, met: list[tuple[str, str]]) -> None:
    graph = plan(text)
    assert isinstance(graph, SocialGraph)
    (node,) = graph.objects
    assert [(each.agent, each.encounter) for each in node.list_meetings()] == met
    covered = {k for each in graph.said for k in range(each.start, each.end)}
    left = "".join(" " if k in covered else letter for k, letter in enumerate(text))
    assert not re.search(r"[A-Za-z]{4,}", re.sub("behind|revealing|from", "", left)), left


def test_who_waits_in_traffic_is_no_object() -> None:
    graph = plan("A car rear-ends a van waiting at the red light")
    assert isinstance(graph, SocialGraph)
    assert not graph.objects
    assert [edge.kind for edge in graph.relations] == ["rear_end"]


@pytest.mark.parametrize(
    ("text", "words"),
    [
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
        ("A car hits a broken-down truck at 30 km/h", "speed"),
        ("A car nearly hits a stalled van", "path_ttc"),
        ("A van waits for 4 s behind a stalled car, then goes around it", "waits"),
    ],
)
def test_encounters_are_made_and_proven(text: str, figure: str) -> None:
    scene = synthesize(text, seed=0, refiner="none")
    assert scene.proof.verified
    (seen,) = scene.proof.figures["encounters"]
    asked = {"at 30 km/h": (7.83, 8.84), "for 4 s": (3.85, 4.15)}
    low, high = next((v for words, v in asked.items() if words in text), (1e-6, 100.0))
    assert low <= seen[figure] <= high


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
    (given,) = [each for each in scene.proof.account if each.words.startswith("turns back")]
    assert given.state == "seen"


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


def test_a_follower_that_cannot_stop_in_time_hits_the_leader() -> None:
    graph = plan("The lead car brakes and the follower fails to stop in time.")
    assert isinstance(graph, SocialGraph)
    (edge,) = graph.relations
    assert (edge.type, edge.kind, edge.manoeuvre) == ("collide_at", "rear_end", "lead_brakes")


def test_a_light_passed_on_yellow_is_no_red_light_run() -> None:
    graph = plan("A car from the east passes the light on yellow.")
    assert isinstance(graph, SocialGraph)
    assert [(each.motion, each.runs_red) for each in graph.agents] == [("passes_yellow", False)]


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
    assert scene.proof.verified


def test_two_queue_behind_what_stands_and_are_seen_there() -> None:
    scene = synthesize("Lorry dead in S lane. 2 cars queue behind.", seed=0, refiner="none")
    assert scene.proof.verified
    seen = {each["how"]: each for each in scene.proof.figures["encounters"]}
    assert seen["waits_behind"]["time"] < seen["queues"]["time"]


@pytest.mark.parametrize(
    ("text", "who", "leg"),
    [
        ("A wrong-way driver collides head-on with a taxi", "vehicle-1", None),
        ("A car hits a wrong-way driver head-on", "vehicle-2", None),
        ("A car drives the wrong way down the north leg", "vehicle-1", "north"),
        ("A van going against traffic from the south crashes head-on into a car", "vehicle-1",
         "south"),
    ],
)  # fmt: skip
def test_who_drives_the_wrong_way_is_read(text: str, who: str, leg: str | None) -> None:
    graph = plan(text)
    assert isinstance(graph, SocialGraph)
    assert [each.id for each in graph.agents if each.motion == "drives_wrong_way"] == [who]
    assert graph.agent(who).entry == leg
    (told,) = [each for each in graph.said if each.became == "motion"]
    assert told.words == text[told.start : told.end]


def test_a_wrong_way_driver_is_made_and_proven() -> None:
    scene = synthesize("A wrong-way driver collides head-on with a taxi", seed=0, refiner="none")
    assert scene.proof.verified
    assert [each.kind for each in scene.record.events] == ["head_on"]
    (entry,) = [each for each in scene.proof.account if each.words == "wrong-way"]
    assert (entry.state, entry.claim) == ("seen", "motion drives_wrong_way")


def test_a_door_opens_too_late_for_a_cyclist() -> None:
    scene = synthesize("A cyclist is doored by a parked van at 15 km/h", seed=1, refiner="none")
    (van, door) = scene.record.objects
    assert (van.kind, van.subtype, door.kind) == ("parked", "van", "door")
    (seen,) = scene.proof.figures["encounters"]
    assert seen["speed"] == pytest.approx(15 / 3.6, abs=0.5)
    assert door.since == pytest.approx(seen["time"] - seen["opened"], abs=0.01)
    assert {each.state for each in scene.proof.account} == {"seen"}


def test_a_cyclist_rides_the_wrong_way_and_is_hit() -> None:
    text = "A cyclist rides the wrong way and is hit by a car turning right"
    scene = synthesize(text, seed=3, refiner="none")
    (cyclist,) = (each for each in scene.record.agents if each.motion is not None)
    assert (cyclist.type, cyclist.motion) == ("cyclist", "drives_wrong_way")
    entry = next(each for each in scene.proof.account if "wrong way" in each.words)
    assert (entry.state, entry.claim) == ("seen", "motion drives_wrong_way")
