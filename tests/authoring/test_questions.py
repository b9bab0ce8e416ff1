"""Questions are answered with the proof's figures, and leave the conversation as it was."""

from __future__ import annotations

import pytest

from scenewright.authoring.scene_motion import Motion
from scenewright.authoring.session import Session
from scenewright.backends import load_backend
from scenewright.intersections import load_map
from scenewright.memory.threads import Threads


@pytest.fixture(scope="module")
def session() -> Session:
    setting = {"intersection": "amsterdam_120", "seed": 3, "refiner": "none"}
    made = Session(Threads(":memory:"), "t", backend=load_backend("builtin"), setting=setting)
    reply = made.say("Show me a car from the north turning left that narrowly misses a pedestrian")
    assert reply["kind"] == "made"
    return made


def ask(session: Session, words: str) -> str:
    before = session.state["versions"]
    reply = session.say(words)
    assert reply["kind"] == "answer", reply
    assert session.state["versions"] == before
    return "\n".join(reply["lines"])


def test_answers_hold_the_figures_of_the_proof(session: Session) -> None:
    shown = session.find_version()
    assert shown is not None
    (event,) = shown.proof.events
    assert f"{event.evidence['pet']:.1f} s between them" in ask(session, "How close do they get?")
    pet = ask(session, "what is the post-encroachment time?")
    assert f"{event.evidence['pet']:.1f} s between them" in pet
    assert f"At {event.time:.1f} s vehicle-1 (car)" in ask(session, "what happens?")
    assert "Yes: it is a near miss" in ask(session, "is it dangerous?")


def test_an_answer_is_about_those_whom_the_question_names(session: Session) -> None:
    answer = ask(session, "how fast is the car going?")
    assert answer.startswith("vehicle-1 (car) goes at ")
    assert "pedestrian" not in answer
    assert ask(session, "where does the car come from?").startswith(
        "vehicle-1 (car) comes from the north, goes to the east (left)"
    )
    shown = session.find_version()
    assert shown is not None
    assert f"{len(shown.record.agents)} in all" in ask(session, "how many cars are there?")


def test_the_light_is_the_one_of_the_record(session: Session) -> None:
    shown = session.find_version()
    assert shown is not None
    (event,) = shown.proof.events
    rows = [each for each in shown.record.signals if each.stop_line == "north:stop"]
    now = next(each.colour for each in rows if each.start <= event.time < each.end)
    assert f"is {now} at {event.time:.1f} s" in ask(session, "which light does the car have?")


def test_who_turned_across_the_way_had_to_give_way(session: Session) -> None:
    assert "vehicle-1 (car) turned across the other's way" in ask(session, "who is at fault?")


def test_a_question_about_nothing_in_the_scene_says_what_can_be_asked(session: Session) -> None:
    assert "I can answer:" in ask(session, "what is the capital of France?")


def test_steps_back_an_ordinary_morning_and_her(session: Session) -> None:
    assert session.say("make it a normal weekday morning")["kind"] == "made"
    shown = session.find_version()
    assert shown is not None
    assert [each.type for each in shown.proof.events] == ["near_miss"]
    assert session.say("make her slower")["kind"] == "made"
    assert session.state["versions"][-1]["edits"][0]["agent"] == "pedestrian-1"
    assert session.say("go back two steps")["version"] == 1
    assert session.say("start over")["kind"] == "nothing"
    unknown = session.say("what happens?")
    assert unknown["kind"] == "nothing"
    assert unknown["reason"].startswith("there is no scene yet")
    assert session.say("the second version")["version"] == 2


def test_a_doubtful_first_line_is_asked_back() -> None:
    setting = {"intersection": "amsterdam_120", "seed": 4, "refiner": "none"}
    session = Session(Threads(":memory:"), "t", backend=load_backend("builtin"), setting=setting)
    words = "Some idiot made a U-turn right in front of the 42 and I clipped his bumper."
    reply = session.say(words)
    assert reply["kind"] == "asked"
    assert "2:" in reply["question"]
    assert session.state["pending"] is not None


def test_answers_follow_the_tracks(session: Session) -> None:
    shown = session.find_version()
    assert shown is not None
    step, (car, walker) = shown.record.meta.step, shown.record.agents[:2]
    motions = [Motion(each, step) for each in (car, walker)]
    visits = [each.find_visit(load_map(shown.record.meta.intersection)) for each in motions]
    first = min(zip(visits, ("vehicle-1", "pedestrian-1"), strict=True))
    assert ask(session, "who enters the crossing first?").startswith(first[1])
    story = ask(session, "tell me the whole thing in order, as it happens").splitlines()
    times = [float(line.partition(" s:")[0]) for line in story]
    assert times == sorted(times)
    assert len(times) > 4
    peak = motions[0].speed.max() * 2.2369
    assert f"{peak:.0f} mph" in ask(session, "how fast is the car in mph?")
    assert ask(session, "how fast was the bus?").startswith("There is no bus in this scene.")
    assert "I cannot tell what would have been" in ask(
        session, "would it have been avoided had he driven 20?"
    )
