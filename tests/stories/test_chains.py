"""Requests of more than one clause: every relation happens, from where and by whom it was said."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache

import numpy as np
import pytest

from checker_tracks import list_rules
from scenewright import synthesize
from scenewright.backends.builtin.planner import plan
from scenewright.errors import Unsatisfiable
from scenewright.graph import run
from scenewright.graph.run import Scene
from scenewright.intersections import load_map
from scenewright.scene.record import AgentRecord
from scenewright.scene.social import SocialGraph
from scenewright.tools.relation_checker import check

OPPOSITE = {"north": "south", "south": "north", "east": "west", "west": "east"}
LEFT = {"north": "east", "east": "south", "south": "west", "west": "north"}

CHAINS = {
    "A car from the west yields to a car from the south and then hits a pedestrian on the east "
    "crosswalk.": {
        ("yielding", "vehicle-1", "vehicle-2"), ("collision", "vehicle-1", "pedestrian-1"),
    },
    "A taxi from the east yields to a pedestrian on the east crosswalk, then nearly hits a "
    "pedestrian on the west crosswalk.": {
        ("yielding", "vehicle-1", "pedestrian-1"), ("near_miss", "vehicle-1", "pedestrian-2"),
    },
    "A truck follows a car from the south, and the car hits a pedestrian on the north crosswalk.": {
        ("follow", "vehicle-1", "vehicle-2"), ("collision", "vehicle-2", "pedestrian-1"),
    },
    "A car rear-ends a car that yields to a pedestrian on the north crosswalk.": {
        ("collision", "vehicle-1", "vehicle-2"), ("yielding", "vehicle-2", "pedestrian-1"),
    },
    "A pedestrian waits for a car, and that car then hits a second pedestrian.": {
        ("yielding", "pedestrian-1", "vehicle-1"), ("collision", "vehicle-1", "pedestrian-2"),
    },
    "A car yields to a pedestrian and a second car, on the other approach, yields to another "
    "pedestrian.": {
        ("yielding", "vehicle-1", "pedestrian-1"), ("yielding", "vehicle-2", "pedestrian-2"),
    },
    "Two separate near misses: a car from the north with a pedestrian and a car from the west with "
    "another pedestrian.": {
        ("near_miss", "vehicle-1", "pedestrian-1"), ("near_miss", "vehicle-2", "pedestrian-2"),
    },
    "A car yields to a pedestrian, gets followed by a second car and a third car collides with the "
    "second.": {
        ("yielding", "vehicle-1", "pedestrian-1"), ("follow", "vehicle-2", "vehicle-1"),
        ("collision", "vehicle-3", "vehicle-2"),
    },
    "Three cars in a row southbound, the last follows the middle one which follows the first.": {
        ("follow", "vehicle-3", "vehicle-2"), ("follow", "vehicle-2", "vehicle-1"),
    },
    "A bus yields to a pedestrian while a car behind the bus follows it.": {
        ("yielding", "vehicle-1", "pedestrian-1"), ("follow", "vehicle-2", "vehicle-1"),
    },
}  # fmt: skip


def agent(scene: Scene, name: str) -> AgentRecord:
    return next(each for each in scene.record.agents if each.name == name)


def happened(scene: Scene) -> Iterator[tuple[str, str, str]]:
    names = {each.id: each.name for each in scene.record.agents}
    for event in scene.record.events:
        yield event.type, names[event.from_ or 0], names[event.to or 0]


@pytest.mark.parametrize("text", CHAINS)
@pytest.mark.parametrize("seed", [0])
def test_every_link_of_a_chain_happens(text: str, seed: int) -> None:
    planned = plan(text)  # how it is read is not at stake here
    assert isinstance(planned, SocialGraph)
    scene = synthesize(text, seed=seed, planned=planned)
    assert scene.proof.verified
    # An event without direction may name its two the other way round.
    seen = {(type_, *sorted(pair)) for type_, *pair in happened(scene)}
    assert {(type_, *sorted(pair)) for type_, *pair in CHAINS[text]} <= seen
    directed = {each for each in CHAINS[text] if each[0] in ("yielding", "follow")}
    assert directed <= set(happened(scene))


@pytest.mark.parametrize(
    ("text", "lies"),
    [
        ("A car turning left collides with an oncoming car in medium traffic", OPPOSITE.get),
        ("Two cars nearly collide head-on.", OPPOSITE.get),
        ("A car nearly hits a car from its left.", LEFT.get),
    ],
)
@pytest.mark.parametrize("seed", range(4))
def test_they_come_from_where_the_text_has_them_come(text: str, lies, seed: int) -> None:  # type: ignore[no-untyped-def]
    scene = synthesize(text, seed=seed)
    one, two = agent(scene, "vehicle-1"), agent(scene, "vehicle-2")
    assert two.entry == lies(one.entry)
    # As the tracks have it, too: it begins on the leg that it is said to come from.
    bearing = {leg.name: leg.bearing for leg in load_map(scene.record.meta.intersection).legs}
    for each in (one, two):
        away = np.array(each.trajectory[0]) @ (
            np.cos(bearing[each.entry]), np.sin(bearing[each.entry]),
        )  # fmt: skip
        assert away > 10.0


def test_a_left_turn_across_an_oncoming_car_is_one() -> None:
    scene = synthesize("A car turning left hits an oncoming car.", seed=2)
    (hit,) = scene.proof.events
    assert hit.kind == "left_turn"


@pytest.mark.parametrize(
    ("text", "who"),
    [
        ("A truck from the east runs a red light and hits a car.", "vehicle-1"),
        ("A car turning left runs the red light and hits an oncoming car.", "vehicle-1"),
        ("A pedestrian ignores the red light and a car yields.", "pedestrian-1"),
        ("A pedestrian walks on red and is hit by a northbound car.", "pedestrian-1"),
        ("A car runs a red light and nobody is hit.", "vehicle-1"),
    ],
)
@pytest.mark.parametrize("seed", [0, 4])
def test_who_is_said_to_run_red_does_and_no_other_agent(text: str, who: str, seed: int) -> None:
    scene = synthesize(text, seed=seed)
    runner = agent(scene, who)
    assert {run["agent"] for run in scene.proof.figures["red_light_runs"]} == {runner.id}
    assert [each.name for each in scene.record.agents if each.violates_signal] == [who]
    for event in scene.proof.events:
        assert (event.cause, event.evidence["cause_agent"]) == ("red_light_run", runner.id)


@pytest.mark.parametrize(
    ("text", "given"),
    [
        ("Two pedestrians are hit by one car on the north crosswalk.", "2 collisions"),
        ("A car hits a truck head-on and the truck hits a bus head-on.", "2 collisions"),
        (
            "A pedestrian on the north crosswalk waits for a car from the south, and that car then "
            "hits a second pedestrian on the north crosswalk.",
            "never passes pedestrian-1",
        ),
        ("A car hits a car head-on that comes from the same approach.", "the same leg as vehicle"),
    ],
)
def test_what_cannot_be_is_refused_at_once_and_says_why(text: str, given: str) -> None:
    with pytest.raises(Unsatisfiable, match=given) as refused:
        synthesize(text, seed=0)
    assert [each.stage for each in refused.value.rejections] == ["scene_planner"]


@pytest.mark.parametrize(
    "text",
    [
        "A car brakes too late and hits a pedestrian on the north crosswalk.",
        "A car brakes too late and crashes into the side of another car.",
        "A taxi fails to stop in time and rear-ends a bus.",
    ],
)
@pytest.mark.parametrize("seed", [1, 5])
def test_who_brakes_too_late_is_seen_braking(text: str, seed: int) -> None:
    scene = synthesize(text, seed=seed)
    (hit,) = scene.proof.events
    (asked,) = scene.record.relations
    driver = agent(scene, "vehicle-1").id
    assert (asked.cause, asked.cause_agent) == ("late_brake", driver)
    assert hit.evidence["late_brake"] == driver


@cache
def make_chain(seed: int) -> Scene:
    return synthesize("A truck rear-ends a car and pushes it into the van ahead", seed=seed)


@pytest.mark.parametrize("seed", [0, 3])
def test_a_struck_car_is_pushed_into_the_one_ahead(seed: int) -> None:
    scene = make_chain(seed)
    truck, car, van = (agent(scene, f"vehicle-{n}").id for n in (1, 2, 3))
    first, second = (each for each in scene.proof.events if each.type == "collision")
    assert [(each.kind, each.from_, each.to) for each in (first, second)] == [
        ("rear_end", truck, car), ("rear_end", car, van),
    ]  # fmt: skip
    assert 0.0 < second.time - first.time < 1.0
    (pushes,) = [each for each in scene.proof.account if each.words.startswith("pushes")]
    assert pushes.state == "seen"
    track = agent(scene, "vehicle-2")
    assert second.time <= track.spawn_time + 0.1 * (len(track.trajectory) - 1) <= second.time + 0.2


def test_a_chain_without_its_push_is_none() -> None:
    record = make_chain(2).record
    push = record.relations[1]
    plain = (record.relations[0], push.model_copy(update={"manoeuvre": None}))
    forged = record.model_copy(update={"relations": plain})
    assert "wreck_drives_on" in list_rules(check(forged, load_map("amsterdam_120")))


@pytest.mark.parametrize(
    "text",
    [
        "A car rear-ends a truck which rear-ends a bus.",
        "A car collided with a second car, causing the latter to strike the rear of a taxi.",
    ],
)
def test_who_is_struck_and_strikes_is_pushed(text: str) -> None:
    graph = plan(text)
    assert isinstance(graph, SocialGraph)
    first, second = graph.relations
    assert (first.to, second.manoeuvre, second.kind) == (second.from_, "pushed", "rear_end")


def test_a_motorcycle_pushes_no_truck_into_another(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(run, "MOST_WORK", 2000)
    with pytest.raises(Unsatisfiable, match="pushed on at"):
        synthesize("A motorcycle rear-ends a truck and pushes it into the car ahead", seed=0)
