"""Everyday phrasings: whom they mean, what they become, and what is rather asked or refused."""

from __future__ import annotations

from typing import Any

import pytest

from scenewright.authoring.second_opinion import choose_reading
from scenewright.authoring.talk import Talk
from scenewright.authoring.turn_kind import classify_turn
from scenewright.backends.offline import read
from scenewright.scene.edits import (
    AddAgent,
    AgentView,
    ChangeAgent,
    Clarification,
    DeclinedTurn,
    Edits,
    NewScene,
    Reading,
    Relate,
    RemoveAgent,
    SetBackground,
    SetPace,
    Situation,
)
from scenewright.scene.events import Event
from scenewright.scene.social import SocialGraph

CAR = {"id": "vehicle-1", "type": "vehicle", "subtype": "car", "entry": "north"}
BUS = {"id": "vehicle-2", "type": "vehicle", "subtype": "bus"}
WALKER = {"id": "pedestrian-1", "type": "pedestrian", "crosswalk": "east"}


def talk_of(*agents: dict[str, Any], touched: tuple[str, ...] = (), background: int = 0) -> Talk:
    """A near miss of the first two with a PET of 1 s, and some cars besides."""
    first, second = agents[0]["id"], agents[1]["id"]
    edge = {"type": "near_miss", "from": first, "to": second}
    graph = SocialGraph.model_validate({"agents": agents, "relations": [edge]})
    shown = [{key: each[key] for key in each if key != "reaction"} for each in agents]
    views = [{**each, "entry": "north", "role": "foreground"} for each in shown]
    others = [{"id": f"vehicle-{n}", "type": "vehicle", "entry": "west", "role": "background"}
              for n in range(10, 10 + background)]  # fmt: skip
    present = [
        AgentView.model_validate(
            {"number": n, "exit": "south", "speed": 5.0, **each,
             "movement": "crossing" if each["type"] == "pedestrian" else "straight"}
        )
        for n, each in enumerate([*views, *others], start=1)
    ]  # fmt: skip
    event = {"type": "near_miss", "from": 1, "to": 2, "time": 9.0, "location": (0, 0),
             "evidence": {"pet": 1.0}}  # fmt: skip
    situation = Situation(graph=graph, present=tuple(present))
    return Talk(situation, touched, [Event.model_validate(event)])


def read_in(words: str, talk: Talk) -> Reading:
    """As a session does it with the builtin planner."""

    def read_plain(plain: str) -> Reading:
        return read(plain, talk.situation)

    return choose_reading(words, read_plain(talk.name_spoken(words)), talk, read_plain)


def read_one(words: str, talk: Talk) -> Any:
    reading = read_in(words, talk)
    assert isinstance(reading, Edits), reading
    (edit,) = reading.edits
    return edit


@pytest.mark.parametrize(
    ("words", "agent"),
    [("make her walk slowly", "pedestrian-1"), ("no wait, she should walk slower", "pedestrian-1"),
     ("slower", "vehicle-1"), ("that's too fast", "vehicle-1"),
     ("let the car go much slower please", "vehicle-1")],
)  # fmt: skip
def test_who_is_slower(words: str, agent: str) -> None:
    edit = read_one(words, talk_of(CAR, WALKER))
    assert isinstance(edit, SetPace)
    assert (edit.agent, edit.factor < 1) == (agent, True)


def test_the_other_one_is_the_one_that_was_not_meant_last() -> None:
    edit = read_one("the other one should be a truck", talk_of(CAR, BUS, touched=("vehicle-2",)))
    assert isinstance(edit, ChangeAgent)
    assert (edit.node.id, edit.node.subtype) == ("vehicle-1", "truck")
    asked = read_in("the other one should be a truck", talk_of(CAR, BUS))
    assert isinstance(asked, Clarification)


def test_a_change_keeps_the_way_that_is_taken() -> None:
    edit = read_one("make vehicle-1 a truck", talk_of(CAR, WALKER))
    assert isinstance(edit, ChangeAgent)
    assert (edit.node.entry, edit.node.exit, edit.node.movement) == ("north", "south", "straight")


@pytest.mark.parametrize(
    ("words", "agent"),
    [
        ("make him not brake", "vehicle-1"),
        ("the car should not react", "vehicle-1"),
        ("she doesn't react", "pedestrian-1"),
        ("make the car never brake", "vehicle-1"),
    ],
)
def test_who_is_not_to_react(words: str, agent: str) -> None:
    edit = read_one(words, talk_of(CAR, WALKER))
    assert (edit.node.id, edit.node.reaction) == (agent, "none")
    asleep = {**CAR, "reaction": "none"}
    again = read_one("the car should react after all", talk_of(asleep, WALKER))
    assert again.node.reaction is None


def test_who_has_nothing_to_react_to_is_shown_so() -> None:
    reading = read_in("the bus should not react", talk_of(CAR, WALKER, BUS))
    assert isinstance(reading, DeclinedTurn)
    assert "nothing to react to" in reading.reason


def test_closer_is_a_smaller_gap_of_the_same_event() -> None:
    for words in ("closer", "even closer please", "make the gap smaller"):
        edit = read_one(words, talk_of(CAR, WALKER))
        assert isinstance(edit, Relate)
        assert (edit.edge.type, edit.edge.target_pet) == ("near_miss", 0.6)


def test_half_of_the_others() -> None:
    edit = read_one("too many cars, half of them", talk_of(CAR, WALKER, background=8))
    assert edit == SetBackground(vehicles=4)


def test_several_changes_in_one_line_are_all_read_or_none() -> None:
    both = read_in("delete her. and make it a bus", talk_of(CAR, WALKER))
    assert isinstance(both, Edits)
    assert both.edits[0] == RemoveAgent(agent="pedestrian-1")
    assert isinstance(both.edits[1], ChangeAgent)
    neither = read_in("delete her and paint it green", talk_of(CAR, WALKER))
    assert isinstance(neither, DeclinedTurn)


@pytest.mark.parametrize("words", ["make it rain", "ok fine without rain", "in the snow"])
def test_weather_is_explained_with_what_can_be_had(words: str) -> None:
    def read_nothing(_words: str) -> Reading:
        return DeclinedTurn(code="no_change", reason="unread")

    talk = talk_of(CAR, WALKER)
    reading = choose_reading(words, read_nothing(words), talk, read_nothing)
    assert isinstance(reading, DeclinedTurn)
    assert "make it night" in reading.reason


def test_a_rider_is_added_as_one() -> None:
    situation = talk_of(CAR, WALKER).situation
    reading = read("add a cyclist from the north that follows the car", situation)
    assert isinstance(reading, Edits)
    added, related = reading.edits
    assert isinstance(added, AddAgent)
    assert isinstance(related, Relate)
    assert (added.node.type, added.node.entry, related.edge.to) == ("cyclist", "north", "vehicle-1")


def test_a_reading_that_passes_over_what_the_words_say_is_refused() -> None:
    talk = talk_of(CAR, BUS)
    lost = Edits(edits=(Relate(edge=talk.situation.graph.relations[0]),))
    for words, reading in (
        ("make vehicle-1 something else", NewScene()),
        ("add a queue behind the bus", lost),
        ("the cyclist turns left", Edits(edits=(SetPace(agent="vehicle-1", factor=0.8),))),
    ):
        found = choose_reading(words, reading, talk, lambda _plain: NewScene())
        assert isinstance(found, DeclinedTurn | Clarification), words
    hits = "a truck hits a bus"
    assert choose_reading(hits, NewScene(), talk, lambda _plain: NewScene()) == NewScene()


@pytest.mark.parametrize(
    ("words", "kind"),
    [("woah. go back one step", "undo"), ("nah undo that", "undo"), ("too close, back one", "undo"),
     ("the second version please", "version"), ("as it was two versions ago", "undo"),
     ("could it have stopped?", "question"), ("by how much does he miss it", "question"),
     ("can i see it from above?", "play"), ("save that as a gif", "gif"), ("play it", "play"),
     ("thanks thats great", "talk"), ("i dont like it", "talk"), ("delete everything", "restart"),
     ("could the car stop a bit later?", "words"), ("ok good. how long is the scene", "question")],
)  # fmt: skip
def test_the_kind_of_messy_words(words: str, kind: str) -> None:
    assert classify_turn(words).kind == kind


def test_a_vehicle_becomes_a_rider_on_its_way_and_in_its_relations() -> None:
    reading = read_in("make the car a cyclist", talk_of(CAR, WALKER))
    assert isinstance(reading, Edits)
    gone, added, related = reading.edits
    assert isinstance(gone, RemoveAgent)
    assert isinstance(added, AddAgent)
    assert isinstance(related, Relate)
    assert gone.agent == "vehicle-1"
    assert (added.node.id, added.node.entry, added.node.movement) == (
        "cyclist-1", "north", "straight",
    )  # fmt: skip
    assert (related.edge.from_, related.edge.to) == ("cyclist-1", "pedestrian-1")
