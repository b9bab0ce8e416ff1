"""Names belong to agents, and a change is about what is there, standing objects included."""

from __future__ import annotations

from pathlib import Path

import pytest
from conversation import Conversation, agents, same

from scenewright.scene.phrasing import call_agents


def called(talk: Conversation) -> list[str]:
    record = talk.now.record
    names = call_agents(record)
    return [names[each.id] for each in record.agents if each.role == "foreground"]


def test_a_name_survives_versions_undo_branches_and_a_reload(tmp_path: Path) -> None:
    talk = Conversation(tmp_path / "talk.sqlite")
    first = talk.made("A bus turning right cuts off a cyclist")
    named = talk.made("call the cyclist Ben")
    assert same(first, named) == set(agents(first))
    assert called(talk) == ["the bus", "Ben"]
    talk.made("Ben is faster now")
    assert talk.now.version["edits"][0]["agent"] == "cyclist-1"
    talk.session.branch("other")
    talk.made("make it night")
    assert called(talk) == ["the bus", "Ben"]
    talk.session.undo()
    assert called(talk) == ["the bus", "Ben"]
    talk.threads.close()
    again = Conversation(tmp_path / "talk.sqlite")
    assert called(again) == ["the bus", "Ben"]
    again.made("make Ben an e-scooter")
    assert called(again) == ["the bus", "Ben"]


def test_names_of_the_first_words_are_known_later() -> None:
    talk = Conversation()
    talk.made("Tom drives a car and stops for Mia who walks over the crosswalk")
    assert called(talk) == ["Tom", "Mia"]
    talk.made("Mia should run")
    assert talk.now.version["edits"][0]["node"]["motion"] == "runs"
    assert called(talk) == ["Tom", "Mia"]


def test_the_car_is_the_agent_that_was_called_so_and_not_the_taxi() -> None:
    talk = Conversation(seed=4)
    first = talk.made("A taxi from the south turning left narrowly misses an oncoming car")
    slower = talk.made("make the car slower")
    assert slower.version["edits"] == [
        {"edit": "set_pace", "agent": "vehicle-2", "factor": pytest.approx(0.8)}
    ]
    assert same(first, slower) >= set(agents(first)) - {"vehicle-1", "vehicle-2"}
    first_of_two = talk.made("let the car go first")
    assert first_of_two.record.relations[0].first == 2


def test_one_of_several_is_one() -> None:
    talk = Conversation(seed=4)
    talk.made("Three kids cross the street and a bus waits for them")
    ran = talk.made("one of the kids runs")
    runs = [each.name for each in ran.record.agents if each.motion == "runs"]
    assert runs == ["pedestrian-1"]


def test_what_was_taken_away_comes_back() -> None:
    talk = Conversation(seed=4)
    first = talk.made("A van turning right nearly hits a cyclist at rush hour")
    talk.made("make the cyclist an e-scooter")
    assert talk.say("actually I want the cyclist back")["kind"] == "moved_to"
    assert talk.now.record == first.record
    talk.made("make the cyclist an e-scooter")
    talk.made("make it night")
    back = talk.made("actually I want the cyclist back")
    assert {"cyclist-1"} == agents(back).keys() & {"cyclist-1", "scooter-1"}
    assert back.record.meta.time_of_day == "22:00"
    reply = talk.say("go back to the rush hour")
    assert reply["kind"] == "moved_to"


def test_what_stands_changes_and_goes() -> None:
    talk = Conversation(seed=4)
    talk.made("A car yields to a pedestrian")
    talk.made("add a parked van on the north leg")
    talk.made("the parked van should be a parked truck")
    assert [each.subtype for each in talk.now.record.objects] == ["truck"]
    talk.made("take the parked truck away")
    assert not talk.now.record.objects
    talk.say("put it back")
    assert [each.subtype for each in talk.now.record.objects] == ["truck"]


def test_who_does_not_stop_may_mean_two_things() -> None:
    talk = Conversation()
    talk.made("A car yields to a pedestrian")
    reply = talk.say("the car doesn't stop")
    assert reply["kind"] == "asked"
    assert "near miss" in reply["question"]
    joined = talk.made("add a friend who walks with the pedestrian")
    assert joined.version["edits"][0]["node"]["members"] == 2
