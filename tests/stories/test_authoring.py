"""Ten scenes made in conversation: every version verified, everybody else as before."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conversation import Conversation, agents, events, same

from scenewright.authoring.session import SessionVersion
from scenewright.backends import TASKS, Backend, Question, Task, load_backend
from scenewright.backends.choosing import StagedBackend
from scenewright.scene.behavior import Segment
from scenewright.scene.reaction_behavior import YieldingModel
from scenewright.tools.gmm_sampler import prior_files
from scenewright.tools.gmm_sampler.observed_behavior import load_yielding_model
from scripted import build_scripted_backend

YIELD = "A car from the north yields to a pedestrian on the east crosswalk at 5 am"


@pytest.fixture
def talk() -> Iterator[Conversation]:
    conversation = Conversation()
    yield conversation
    conversation.threads.close()


def lowest(shown: SessionVersion, name: str) -> tuple[float, float]:
    """Where the agent is slowest."""
    xy = np.array(agents(shown)[name].trajectory)
    at = int(np.argmin(np.convolve(np.hypot(*np.diff(xy, axis=0).T), np.ones(5), "same")[3:-3])) + 3
    return float(xy[at][0]), float(xy[at][1])


def slowest(shown: SessionVersion, name: str) -> float:
    xy = np.array(agents(shown)[name].trajectory)
    return float(np.hypot(*np.diff(xy, axis=0).T).min() / 0.1)


def fastest(shown: SessionVersion, name: str) -> float:
    xy = np.array(agents(shown)[name].trajectory)
    return float(np.hypot(*np.diff(xy, axis=0).T).max() / 0.1)


def test_a_stop_is_moved_and_lengthened() -> None:
    talk = Conversation(seed=12)  # drawn so that two seconds more are still a yield
    first = talk.made(YIELD)
    later = talk.made("stop one metre later")
    assert np.hypot(*np.subtract(lowest(first, "vehicle-1"), lowest(later, "vehicle-1"))) == (
        pytest.approx(1.0, abs=0.15)
    )
    sooner = talk.made("stop half a metre earlier")
    assert np.hypot(*np.subtract(lowest(sooner, "vehicle-1"), lowest(later, "vehicle-1"))) == (
        pytest.approx(0.5, abs=0.15)
    )
    longer = talk.made("wait two seconds longer")
    everybody = set(agents(first))
    for before, after in ((first, later), (later, sooner), (sooner, longer)):
        assert same(before, after) == everybody - {"vehicle-1"}
    assert longer.version["by_hand"] == ["vehicle-1"]
    slow = talk.made("slow the car down")
    assert (slow.version["by_hand"], slow.version["let_go"]) == ([], ["vehicle-1"])
    assert fastest(slow, "vehicle-1") < fastest(longer, "vehicle-1")
    assert events(slow) == ["yielding"]


def test_who_came_from_a_red_light_still_does() -> None:
    """And what is said of its stop means the one at which it gives way."""
    for seed in range(1, 12):
        talk = Conversation(seed=seed)
        before = stays(talk.made(YIELD))
        if len(before) == 2:
            break
    (light, gives_way), (still, longer) = before, stays(talk.made("wait one second longer"))
    assert (light.anchor, light) == ("north:stop", still)
    assert longer.start == gives_way.start
    assert longer.end == pytest.approx(gives_way.end + 1.0)


def test_who_came_from_a_red_light_can_come_at_another_time() -> None:
    """On green then, as its light is not its own; and to stand there is nothing to be moved."""
    talk = Conversation(seed=20)
    before = talk.made("A car turns left and yields to a pedestrian on the crosswalk.")
    assert len(stays(before)) == 2
    (gives_way,) = stays(talk.made("the car comes 1 second earlier"))
    assert gives_way.start == pytest.approx(stays(before)[1].start - 1.0, abs=0.2)
    other = Conversation(seed=1)
    other.made("A car turns left and yields to an oncoming car.")
    refused = other.say("vehicle-2 stops one metre later")
    assert "stands nowhere in this scene but at its light" in refused["reason"]


def stays(shown: SessionVersion) -> list[Segment]:
    return [each for each in agents(shown)["vehicle-1"].segments if each.status == "stop"]


@pytest.fixture
def rolling(monkeypatch: pytest.MonkeyPatch) -> None:
    """Everybody who gives way here slows down without standing."""

    def rolls(folder: Path) -> YieldingModel:
        return {
            pair: replace(each, rolls=1.0) for pair, each in load_yielding_model(folder).items()
        }

    monkeypatch.setattr(prior_files, "load_yielding_model", rolls)
    prior_files._load_bundle.cache_clear()
    monkeypatch.setattr(prior_files, "_load_bundle", prior_files._load_bundle.__wrapped__)


@pytest.mark.usefixtures("rolling")
def test_who_only_slows_down_is_made_to_stop_and_then_a_metre_later(talk: Conversation) -> None:
    first = talk.made(YIELD)
    assert slowest(first, "vehicle-1") > 0.05
    refused = talk.say("stop one metre later")
    assert refused["kind"] == "refused"
    why = "vehicle-1 gives way without standing: it slows to .* m/s, .* m before the other's way"
    assert re.match(why, refused["reason"])
    assert "'make it stop'" in refused["reason"]
    stands = talk.made("make it stop")
    assert slowest(stands, "vehicle-1") == 0.0
    assert (events(stands), stands.version["by_hand"]) == (["yielding"], ["vehicle-1"])
    later = talk.made("stop one metre later")
    assert np.hypot(*np.subtract(lowest(stands, "vehicle-1"), lowest(later, "vehicle-1"))) == (
        pytest.approx(1.0, abs=0.15)
    )


def test_a_yield_becomes_a_near_miss_and_a_collision(talk: Conversation) -> None:
    first = talk.made(YIELD)
    miss = talk.made("make it a near miss")
    assert events(miss) == ["near_miss"]
    gone = set(miss.version["gone"])  # background agents that the change left no room for
    assert same(first, miss) == set(agents(first)) - {"vehicle-1"} - gone
    hit = talk.made("now have it be a collision")
    assert events(hit) == ["collision"]
    again = talk.made("make it a yield again")
    assert events(again) == ["yielding"]
    other = talk.made("let the pedestrian yield instead")
    (seen,) = other.proof.events
    assert agents(other)["pedestrian-1"].id == seen.from_


def test_an_agent_comes_from_elsewhere(talk: Conversation) -> None:
    talk.made(YIELD)
    east = talk.made("make the pedestrian come from the east instead")
    assert agents(east)["pedestrian-1"].entry == "east"
    assert agents(east)["pedestrian-1"].id == 2
    south = talk.made("put the pedestrian on the south crosswalk")
    assert agents(south)["pedestrian-1"].crosswalk == "south"
    straight = talk.made("the car should go straight")
    assert agents(straight)["vehicle-1"].movement == "straight"
    back = talk.session.undo()
    assert back == {"kind": "moved_to", "version": south.version["number"]}
    truck = talk.made("make the car a truck")
    assert agents(truck)["vehicle-1"].length > 8.0
    assert events(truck) == ["yielding"]


def test_others_come_and_go(talk: Conversation) -> None:
    first = talk.made(YIELD)
    more = talk.made("add three cars")
    assert same(first, more) == set(agents(first))
    assert len(more.version["come"]) == 3
    walkers = talk.made("add two pedestrians")
    assert same(more, walkers) == set(agents(more))
    gone = talk.made(f"remove {walkers.version['come'][0]}")
    assert same(walkers, gone) == set(agents(walkers)) - {walkers.version["come"][0]}
    nobody = talk.made("no background traffic")
    assert set(agents(nobody)) == {"vehicle-1", "pedestrian-1"}
    assert same(gone, nobody) == {"vehicle-1", "pedestrian-1"}


def test_another_hour_draws_the_background_anew_and_moves_nobody_named(talk: Conversation) -> None:
    first = talk.made(YIELD)
    named = {"vehicle-1", "pedestrian-1"}
    evening = talk.made("make it 5 pm")
    assert evening.record.meta.time_of_day == "17:00"
    assert same(first, evening) == named
    rush = talk.made("make it rush hour")
    assert rush.record.meta.time_of_day == "08:00"
    assert same(evening, rush) == named
    assert set(rush.version["come"]) == set(agents(rush)) - named
    night = talk.made("at night instead")
    assert same(rush, night) == named
    assert len(agents(night)) < len(agents(rush))
    busy = talk.made("make it busier")
    assert same(night, busy) == named
    assert len(agents(busy)) > len(agents(night))
    quiet = talk.made("fewer people")
    assert len(agents(quiet)) < len(agents(busy))
    assert same(busy, quiet) == set(agents(quiet))
    reply = talk.session.undo()
    assert talk.now.record == busy.record, reply


def test_undo_gives_the_same_bytes_and_redo_as_well(talk: Conversation) -> None:
    made = [
        talk.made(words).scene_json
        for words in (YIELD, "make it a near miss", "slow the car down", "add a car")
    ]
    for before in reversed(made[:-1]):
        talk.session.undo()
        assert talk.now.scene_json == before
    assert talk.session.undo()["kind"] == "nothing"
    for after in made[1:]:
        talk.session.redo()
        assert talk.now.scene_json == after
    assert talk.session.redo()["kind"] == "nothing"


def test_branches_are_worked_on_apart(talk: Conversation) -> None:
    talk.made(YIELD)
    assert talk.session.branch("hit")["branch"] == "hit"
    hit = talk.made("now have it be a collision")
    assert talk.session.branch("main")["version"] == 1
    miss = talk.made("make it a near miss")
    assert events(miss) == ["near_miss"]
    talk.session.branch("hit")
    assert talk.now.scene_json == hit.scene_json
    late = talk.made("make it 5 pm")
    assert events(late) == ["collision"]
    assert late.version["parent"] == hit.version["number"]


def test_what_may_mean_two_is_asked_back_once(talk: Conversation) -> None:
    talk.made(
        "A car from the north yields to a pedestrian on the south crosswalk and a truck from the "
        "west follows a bus at 5 am"
    )
    assert talk.say("slow the vehicle down")["kind"] == "asked"
    # Other words end the question.
    talk.made("no background traffic")
    reply = talk.say("slow the vehicle down")
    assert reply["kind"] == "asked"
    assert reply["choices"] == ["vehicle-1", "vehicle-2", "vehicle-3"]
    slower = talk.made("the truck")
    assert [each["edit"] for each in slower.version["edits"]] == ["set_pace"]
    assert slower.version["edits"][0]["agent"] == "vehicle-2"
    assert talk.say("make it a collision")["kind"] == "asked"
    hit = talk.made("vehicle-1")
    assert sorted(events(hit)) == ["collision", "follow"]
    # "it" is the vehicle that was named last.
    assert "from the north to the west" in talk.say("have it turn right")["reason"]


def test_a_refusal_leaves_the_scene_and_says_why(talk: Conversation) -> None:
    first = talk.made(YIELD)
    refused = talk.say("make the car come from the west and turn right")
    assert refused["kind"] == "refused"
    assert "east crosswalk" in refused["reason"]
    assert talk.now.scene_json == first.scene_json
    assert talk.say("why did you refuse?") == {"kind": "wish", "wish": "why"}
    state = talk.session.state["refused"]
    assert state is not None
    assert state["reason"] == refused["reason"]
    assert "bus" in talk.say("remove the bus")["reason"]
    assert talk.say("make me a coffee")["kind"] == "refused"
    assert talk.say("asdf qwer zxcv")["kind"] == "refused"
    assert talk.say("stop 400 metres later")["kind"] == "refused"
    hit = talk.made("have the car hit the pedestrian")
    assert talk.say("have a truck hit the car")["code"] == "ungroundable"
    assert talk.now.scene_json == hit.scene_json


def test_words_that_the_grammar_does_not_know_go_to_the_planner_that_is_a_model() -> None:
    plan = {
        "agents": [{"id": "vehicle-1", "type": "vehicle", "entry": "north"},
                   {"id": "pedestrian-1", "type": "pedestrian", "crosswalk": "east"}],
        "relations": [{"type": "yield_to", "from": "vehicle-1", "to": "pedestrian-1"}],
        "context": {"time_of_day": "05:00"},
    }  # fmt: skip
    hit = {"edit": "relate", "from": "vehicle-1", "to": "pedestrian-1", "type": "collide_at"}
    strangers = {"edits": [{**hit, "to": "pedestrian-40"}]}
    more = {"edits": [{"edit": "change_context", "vehicles": 4}]}
    model = build_scripted_backend(
        {"plan": [plan], "edits": ["no JSON at all", strangers, {"edits": [hit]}, more]}
    )
    builtin = load_backend("builtin")
    others: dict[Task, Backend] = dict.fromkeys(TASKS, builtin)
    talk = Conversation(seed=5, backend=StagedBackend({**others, "plan": model}))
    first = talk.made("Someone lets someone walk")
    assert events(first) == ["yielding"]
    tragic = talk.made("let that end in a collision")
    assert events(tragic) == ["collision"]
    assert tragic.version["edits"][0]["edit"] == "relate"
    assert "there is no pedestrian-40 in the scene" in model.text_model.asked[-1][1].user
    assert tragic.provenance["models"]["edits"]["answers"] == 3
    assert same(first, tragic) >= set(agents(first)) - {"vehicle-1", "pedestrian-1"}
    assert events(talk.made("a few cars more")) == ["collision"]
    # The session's own words need no model; the script has no answer left for any others.
    assert talk.say("undo")["kind"] == "moved_to"
    reply = talk.say("give it a happy ending")
    assert (reply["kind"], reply["code"]) == ("refused", "backend_failed")
    assert events(talk.now) == ["collision"]
    talk.threads.close()


def test_a_model_asks_back_once() -> None:
    two = "A car from the north follows a car, and the first car yields to a pedestrian at 5 am"
    ask = {"edits": [], "ask": {"about": "car", "among": ["vehicle-1", "vehicle-2"]}}
    slower = {"edits": [{"edit": "set_pace", "agent": "vehicle-2", "factor": 0.8}]}
    model = build_scripted_backend({"edits": [ask, ask, slower]})
    builtin = load_backend("builtin")
    talk = Conversation(
        backend=StagedBackend({**dict.fromkeys(TASKS, builtin), "plan": _Reads(model)})
    )
    talk.made(two)
    reply = talk.say("it is too fast")
    assert reply["kind"] == "asked"
    assert reply["question"].startswith("Which car: the car from the north")
    assert reply["choices"] == ["vehicle-1", "vehicle-2"]
    slow = talk.made("vehicle-2")
    assert slow.version["edits"] == [{"edit": "set_pace", "agent": "vehicle-2", "factor": 0.8}]
    said = [words.user for _, words in model.text_model.asked]
    assert 'Answered already: {"car":"vehicle-2"}' in said[1]
    assert "it was answered already (car: vehicle-2); give the edits" in said[2]
    talk.threads.close()


class _Reads:
    """A model that reads edits, and plans as the grammar does."""

    name, deterministic = "reads", False

    def __init__(self, model: Backend) -> None:
        self._model, self._rule = model, load_backend("builtin")

    def answer(self, question: Question) -> dict[str, Any]:
        return (self._model if question.task == "edits" else self._rule).answer(question)


def test_a_new_agent_joins_and_leaves(talk: Conversation) -> None:
    first = talk.made("A car from the south turns left and yields to a pedestrian at 5 am")
    behind = talk.made("add a truck that follows the car")
    assert sorted(events(behind)) == ["follow", "yielding"]
    named = {name: each for name, each in agents(behind).items() if each.role == "foreground"}
    (new,) = named.keys() - agents(first).keys()
    assert named[new].subtype == "truck"
    alone = talk.made("remove the truck")
    assert new not in agents(alone)
    assert events(alone) == ["yielding"]
    calm = talk.made("remove the pedestrian")
    assert events(calm) == ["normal"]
    fresh = talk.made("A bus follows a taxi from the east at 5 am")
    assert events(fresh) == ["follow"]
    talk.session.undo()
    assert talk.now.scene_json == calm.scene_json


@pytest.mark.parametrize(
    "text", ["A car goes around a stalled van", "A cyclist is doored by a parked van"]
)
def test_who_meets_an_object_still_does_at_another_hour(text: str, talk: Conversation) -> None:
    first = talk.made(text)
    later = talk.made("make it 5 pm")
    assert later.record.meta.time_of_day == "17:00"
    assert later.record.objects == first.record.objects
    assert same(first, later) == {a.name for a in first.record.agents if a.role == "foreground"}


def test_a_group_stays_one_while_another_agent_changes() -> None:
    talk = Conversation(seed=2)
    first = talk.made("A truck turning left waits for a class of six on the west crosswalk.")
    later = talk.made("stop one metre later")
    groups = [[a.group for a in each.record.agents if a.group] for each in (first, later)]
    assert groups == [[agents(first)["pedestrian-1"].id] * 5] * 2


def test_a_pedestrian_that_becomes_a_vehicle_is_named_as_one(talk: Conversation) -> None:
    talk.made("An e-scooter on the east crosswalk collides with a pedestrian.")
    later = talk.made("make the second one a bus")
    parties = [each for each in later.record.agents if each.role == "foreground"]
    assert sorted(each.type for each in parties) == ["scooter", "vehicle"]
    assert all(each.name.startswith(each.type) for each in parties)


@pytest.mark.parametrize("words", ["remove vehicle-1", "swap the two"])
def test_what_would_leave_a_push_without_its_striker_is_refused(
    words: str, talk: Conversation
) -> None:
    talk.made("A truck rear-ends a car and pushes it into the van ahead.")
    reply = talk.say(words)
    assert reply["kind"] == "refused"
    assert "no agent strikes it" in reply["reason"]
    assert not reply["reason"].startswith("Value error")


def test_members_of_a_group_are_not_counted_as_background_when_a_stop_moves(
    talk: Conversation,
) -> None:
    def count_walkers(shown: SessionVersion) -> int:
        return sum(agent.type == "pedestrian" for agent in shown.record.agents)

    before = talk.made("A car yields to a group of five pedestrians on the crosswalk")
    after = talk.made("vehicle-1 stops one metre later")
    assert count_walkers(after) == count_walkers(before) > 5
