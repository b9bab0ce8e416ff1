"""Unusual words: what they want, what they become, and when a question is put instead."""

from __future__ import annotations

from typing import Any

import pytest

from scenewright.authoring.intent_edits import guess_intent, spell_out
from scenewright.authoring.second_opinion import (
    check_first_words,
    choose_reading,
    correct,
    correct_within,
    weigh_kind,
)
from scenewright.authoring.talk import Talk
from scenewright.scene.edits import (
    AgentView,
    Clarification,
    DeclinedTurn,
    Edits,
    Reading,
    RemoveAgent,
    SetPace,
    Situation,
    Tie,
)
from scenewright.scene.social import EntryTie, SocialGraph

CAR = {"id": "vehicle-1", "type": "vehicle", "subtype": "car"}
WALKER = {"id": "pedestrian-1", "type": "pedestrian", "crosswalk": "east"}


def talk_of(*agents: dict[str, Any], others: int = 6) -> Talk:
    """A near miss of the first two, and some cars besides."""
    edge = {"type": "near_miss", "from": agents[0]["id"], "to": agents[1]["id"]}
    graph = SocialGraph.model_validate({"agents": agents, "relations": [edge]})
    more = [{"id": f"vehicle-{n}", "type": "vehicle", "subtype": "bus" if n == 20 else "car"}
            for n in range(20, 20 + others)]  # fmt: skip
    present = [
        AgentView.model_validate(
            {"number": n, "entry": "north", "exit": "south", "speed": 5.0, "movement": "straight",
             **each, "role": "foreground" if each in agents else "background"}
        )
        for n, each in enumerate([*agents, *more], start=1)
    ]  # fmt: skip
    return Talk(Situation(graph=graph, present=tuple(present)), (), [])


@pytest.mark.parametrize(
    ("words", "kind", "topic"),
    [
        ("is that even allowed what the driver did there", "question", "q_fault"),
        ("okay wow, that was tight, how many seconds between them?", "question", "q_close"),
        ("list everybody who is there", "question", "q_who"),
        ("nope, put it back the way it was", "undo", None),
        ("thx, bye for now", "quit", None),
        ("hiya", "talk", None),
        ("let the van go a bit quicker", "words", None),
    ],
)
def test_the_kind_of_unusual_words(words: str, kind: str, topic: str | None) -> None:
    turn = weigh_kind(words, scene=True)
    assert (turn.kind, turn.topic) == (kind, topic)


@pytest.mark.parametrize(
    ("words", "intent"),
    [
        ("even slower than that", "slower"),
        ("it drives too slow", "faster"),
        ("give them some more room", "less_close"),
        ("too many cars", "less_traffic"),
        ("a collision, not a near miss", "collide"),
    ],
)
def test_of_two_opposites_the_words_decide(words: str, intent: str) -> None:
    assert guess_intent(words).intent == intent


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        ("can the car chill out a bit", "make vehicle-1 slower"),
        ("send her over the northern crosswalk", "put pedestrian-1 on the north crosswalk"),
        ("make the car come from the other direction", "make vehicle-1 come from the south"),
    ],
)
def test_a_wish_becomes_a_plain_sentence(words: str, sentence: str) -> None:
    assert spell_out(guess_intent(words).intent, words, talk_of(CAR, WALKER)) == sentence


def test_who_is_not_there_is_not_another_agent() -> None:
    said = spell_out("come_from", "the bike comes from the south", talk_of(CAR, WALKER))
    assert isinstance(said, DeclinedTurn)
    assert "no bike" in said.reason


def test_all_buses_are_those_of_the_others() -> None:
    assert spell_out("no_traffic", "remove the buses", talk_of(CAR, WALKER)) == Edits(
        edits=(RemoveAgent(agent="vehicle-20"),)
    )


def read_nothing(_plain: str) -> Reading:
    return DeclinedTurn(code="no_change", reason="nothing")


def test_a_change_that_does_not_fit_the_wish_is_not_made() -> None:
    tie = EntryTie.model_validate({"agent": "vehicle-1", "of": "cyclist-1", "side": "same"})
    rider = {"id": "cyclist-1", "type": "cyclist"}
    made = Edits(edits=(Tie(ties=(tie,)),))
    words = "hide the cyclist behind a parked car"
    chosen = choose_reading(words, made, talk_of(CAR, rider), read_nothing)
    assert isinstance(chosen, DeclinedTurn)


def test_where_nothing_is_sure_nothing_is_changed() -> None:
    chosen = choose_reading(
        "perhaps more of the thing with the thing", read_nothing(""),
        talk_of(CAR, WALKER), read_nothing,
    )  # fmt: skip
    assert isinstance(chosen, DeclinedTurn | Clarification)


def test_both_are_both() -> None:
    def read(plain: str) -> Reading:
        names = [each for each in ("vehicle-1", "pedestrian-1") if each in plain]
        return Edits(edits=tuple(SetPace(agent=each, factor=0.8) for each in names))

    one = Edits(edits=(SetPace(agent="vehicle-1", factor=0.8),))
    chosen = choose_reading("both of them slower", one, talk_of(CAR, WALKER), read)
    assert isinstance(chosen, Edits)
    assert len(chosen.edits) == 2


@pytest.mark.parametrize(
    ("words", "before", "meant"),
    [
        ("sorry 12", "make the gap 8 meters", ("make the gap 12 meters", False)),
        ("from the north i mean", "a bus from the south", ("a bus from the north", False)),
        ("no, the van", "make the car slower", ("make the van slower", True)),
        ("no", "make the car slower", ("no", False)),
        ("make it night", "make the car slower", ("make it night", False)),
    ],
)  # fmt: skip
def test_a_correction_is_of_the_words_before(words: str, before: str, meant: Any) -> None:
    assert correct(words, before) == meant


def test_an_event_without_agents_is_asked_back_and_a_change_without_a_scene_refused() -> None:
    assert isinstance(check_first_words("make a crash!!!"), Clarification)
    assert isinstance(check_first_words("make it slower"), DeclinedTurn)
    assert check_first_words("a car yields to a pedestrian") is None


@pytest.mark.parametrize(
    ("words", "meant"),
    [
        ("make the first car slower, sorry, only the van", "make the van slower"),
        ("let the bus come from the north, sorry, the south", "let the bus come from the south"),
        ("make the gap 8 m, no wait, 12", "make the gap 12 m"),
        ("hello, sorry, i am late", "hello, sorry, i am late"),
    ],
)
def test_words_that_correct_themselves(words: str, meant: str) -> None:
    assert correct_within(words) == meant


def test_a_single_noun_is_asked_about() -> None:
    talk = talk_of(CAR, WALKER)
    reading = choose_reading("ped", DeclinedTurn(code="no_change", reason=""), talk, read_nothing)
    assert isinstance(reading, Clarification)


def test_contact_that_the_words_deny_is_not_made() -> None:
    talk = talk_of(CAR, WALKER)
    edge = {"type": "collide_at", "from": "vehicle-1", "to": "pedestrian-1"}
    crash = Edits.model_validate({"edits": [{"edit": "relate", "edge": edge}]})
    reading = choose_reading("make it more near, but no touch", crash, talk, read_nothing)
    assert not (isinstance(reading, Edits) and reading == crash)


def test_nobody_is_removed_whom_the_words_want_to_keep() -> None:
    talk = talk_of(CAR, WALKER)
    gone = Edits(edits=(RemoveAgent(agent="pedestrian-1"),))
    reading = choose_reading("the car at 50 km/h. do not touch the ped", gone, talk, read_nothing)
    assert not (isinstance(reading, Edits) and gone.edits[0] in reading.edits)
