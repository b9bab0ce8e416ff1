"""Whole runs, offline: from a sentence to a proven scene, or to the reason why not."""

from __future__ import annotations

import multiprocessing
import re
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from leaving import YIELD as LEAVES
from leaving import Leaving
from scenewright import synthesize, verify
from scenewright.backends import Question, Task
from scenewright.errors import BackendFault, InputError, Unsatisfiable
from scenewright.graph import run
from scenewright.graph.run import Scene
from scenewright.graph.scene_files import encode_scene
from scenewright.scene.record import SignalRecord

EXAMPLES = (Path(__file__).parents[2] / "examples" / "instructions.txt").read_text("utf-8")
YIELD = "A vehicle yields to a pedestrian on the north crosswalk at 5 am"

STORIES = {
    "yielding": "A car from the south yields to a pedestrian on the north crosswalk.",
    "collision": "A truck from the east runs a red light and hits a northbound sedan.",
    "near_miss": "A cab from the north narrowly misses a pedestrian on the south crosswalk.",
    "follow": "An SUV follows a bus from the south through the intersection at noon.",
}


@pytest.mark.parametrize(("event", "text"), STORIES.items(), ids=STORIES)
def test_what_was_asked_for_happens_and_nothing_else(event: str, text: str) -> None:
    scene = synthesize(text, seed=1)
    agents = {agent.id: agent for agent in scene.record.agents}
    assert [each.type for each in scene.record.events] == [event]
    (seen,) = scene.proof.events
    assert {agents[seen.from_].role, agents[seen.to].role} == {"foreground"}
    assert agents[seen.from_].name == "vehicle-1"
    assert scene.proof == verify(scene)
    assert scene.proof.verified


def test_who_gives_way_may_come_from_a_red_light() -> None:
    """Some do, some do not; it is red while they wait and green when they start."""
    came = []
    for seed in range(10):
        record = synthesize("A vehicle yields to a pedestrian at 9 am.", seed=seed).record
        giver = next(each for each in record.agents if each.name == "vehicle-1")
        lines = {each.stop_line for each in record.signals}
        waits = [s for s in giver.segments if s.status == "stop" and s.anchor in lines]
        came += [(record, wait) for wait in waits if record.events[0].time > wait.end + 1.0]
    assert 1 <= len(came) <= 8
    for record, wait in came:
        shown = [each for each in record.signals if each.stop_line == wait.anchor]

        def colour(time: float, shown: list[SignalRecord] = shown) -> str:
            return next(each.colour for each in shown if each.start <= time < each.end)

        assert wait.end < 1.6 or colour(wait.start) == "red"
        assert wait.end < 0.7 or colour(wait.end - 0.7) == "green"


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("text", ["A car narrowly misses a pedestrian", "Two cars nearly collide"])
def test_a_ttc_asked_for_is_that_of_a_vehicle_braking_hard(text: str, seed: int) -> None:
    scene = synthesize(f"{text} with a TTC of 1.2 seconds.", seed=seed)
    (seen,) = scene.proof.events
    assert seen.type == "near_miss"
    assert seen.evidence["path_ttc"] == pytest.approx(1.2, abs=0.3)
    assert hardest_braking(scene, (seen.from_, seen.to)) > 5.0


@pytest.mark.parametrize("seed", range(2))
def test_who_is_said_to_brake_hard_does(seed: int) -> None:
    scene = synthesize("A car slams on the brakes and just misses a pedestrian.", seed=seed)
    (seen,) = scene.proof.events
    assert seen.type == "near_miss"
    assert hardest_braking(scene, (seen.from_,)) > 5.0


def hardest_braking(scene: Scene, ids: tuple[int, ...]) -> float:
    """Of these agents, from positions every 0.1 s [m/s^2]."""
    found = []
    for agent in scene.record.agents:
        if agent.id in ids:
            steps = np.hypot(*np.diff(np.array(agent.trajectory), axis=0).T) / 0.1
            found.append(-np.min(np.convolve(np.diff(steps) / 0.1, np.full(3, 1 / 3), "valid")))
    return float(max(found))


@pytest.mark.parametrize(
    ("text", "agent", "points"),
    [
        ("A car hits the side of a bus.", "to", {"left", "right"}),
        ("A pedestrian is hit by the front left corner of a car.", "from", {"front_left"}),
        ("A car T-bones a truck on its left side at 7 m/s.", "to", {"left"}),
    ],
)
def test_vehicles_are_struck_where_the_text_says(text: str, agent: str, points: set[str]) -> None:
    scene = synthesize(text, seed=1)
    (seen,) = scene.proof.events
    (asked,) = scene.record.relations
    assert (asked.from_, asked.to) == (seen.from_, seen.to)
    assert seen.evidence[f"point_{agent}"] in points


def test_a_refusal_names_the_figure_at_fault_and_what_is_possible(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(run, "MOST_WORK", 1000)
    with pytest.raises(Unsatisfiable) as caught:
        synthesize("A left-turning car hits a pedestrian at 19 m/s.", seed=1)
    found = re.search(
        r"contact\(vehicle-1, pedestrian-1, pedestrian_strike, 19 m/s\): a target impact speed of "
        r"19 m/s: the fastest car on this movement strikes at (\d+\.\d) m/s",
        str(caught.value),
    )
    assert found is not None
    given = [each.missed[1] for each in caught.value.rejections if each.missed]
    assert float(found[1]) == pytest.approx(19.0 - min(given), abs=0.06)
    assert float(found[1]) < 15.0


def test_nothing_happens_where_nothing_shall() -> None:
    scene = synthesize("Ordinary traffic during the morning rush, nothing happens.", seed=1)
    (row,) = scene.record.events
    assert (row.type, row.from_, row.to, row.time) == ("normal", None, None, None)
    assert scene.proof.verified
    assert len(scene.record.agents) >= 5


def test_a_saved_scene_is_the_scene(tmp_path: Path) -> None:
    scene = synthesize(YIELD, seed=1)
    folder = scene.save(tmp_path / "scene")
    assert (folder / "scene.json").read_bytes() == encode_scene(scene.record)
    assert verify(folder) == scene.proof
    assert verify(folder / "scene.json") == scene.proof


@pytest.mark.parametrize("text", EXAMPLES.splitlines())
def test_every_example_ends_verified(text: str) -> None:
    scene = synthesize(text, seed=0)
    assert scene.proof.verified


def bytes_of(request: tuple[str, int]) -> bytes:
    text, seed = request
    return encode_scene(synthesize(text, seed=seed).record)


def test_same_seed_same_bytes_in_any_order_and_process() -> None:
    requests = [(STORIES["collision"], 2), (YIELD, 5), (STORIES["follow"], 3)]
    here = [bytes_of(request) for request in requests]
    assert [bytes_of(request) for request in reversed(requests)] == here[::-1]
    with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn")) as pool:
        assert list(pool.map(bytes_of, requests)) == here


def test_another_seed_is_another_scene() -> None:
    assert bytes_of((YIELD, 1)) != bytes_of((YIELD, 2))


@pytest.mark.parametrize("text", ["", "Write me a poem.", "asdf qwer"])
def test_what_is_no_request_is_refused_as_input(text: str) -> None:
    with pytest.raises(InputError):
        synthesize(text)


def test_a_contradiction_is_named() -> None:
    with pytest.raises(Unsatisfiable, match="north") as caught:
        synthesize("A car turns left from the north and leaves to the north.")
    assert [each.stage for each in caught.value.rejections] == ["scene_planner"]


Answer = Callable[[Question], dict[str, Any]]


class Scripted:
    """A backend that gives the answers it is handed for a task, then right ones.

    The last answer is repeated if `forever`.
    """

    name = "scripted"
    deterministic = False

    def __init__(self, task: Task, *answers: Answer, forever: bool = False) -> None:
        self._task, self._answers, self._forever = task, list(answers), forever
        self._right = Leaving()
        self.asked: list[Question] = []

    def answer(self, question: Question) -> dict[str, Any]:
        if question.task == self._task:
            self.asked.append(question)
            if self._answers:
                last = self._forever and len(self._answers) == 1
                answer = self._answers[0] if last else self._answers.pop(0)
                return answer(question)
        return self._right.answer(question)


def nonsense(_: Question) -> dict[str, Any]:
    return {"agents": [{"id": "the blue one", "type": "vehicle"}]}


def bad_clause(_: Question) -> dict[str, Any]:
    return {"clauses": [{"words": 1, "clause": "runs_red", "agent": "vehicle-1"}], "cannot": []}


def bad_stop(_: Question) -> dict[str, Any]:
    stop = {"words": 1, "agent": "pedestrian-1", "place": "the_moon", "lasts": 1.0}
    return {"stops": [stop], "cannot": []}


def unreachable(_: Question) -> dict[str, Any]:
    raise BackendFault("the model cannot be reached")


@pytest.fixture
def impatient(monkeypatch: pytest.MonkeyPatch) -> None:
    """No waiting between attempts."""
    monkeypatch.setattr(time, "sleep", lambda _: None)


@pytest.mark.parametrize(
    ("task", "wrong", "stage", "code"),
    [
        ("plan", nonsense, "scene_planner", "malformed_reply"),
        ("constraints", nonsense, "waypoint_filter", "malformed_reply"),
        ("constraints", bad_clause, "waypoint_filter", "malformed_program"),
        ("behavior", nonsense, "event_reasoner", "malformed_reply"),
        ("behavior", bad_stop, "event_reasoner", "unknown_anchor"),
    ],
)
def test_a_model_that_errs_once_is_shown_it_and_mends_it(
    task: Task, wrong: Answer, stage: str, code: str
) -> None:
    backend = Scripted(task, wrong)
    scene = synthesize(LEAVES, backend=backend, seed=1)
    first = scene.provenance["rejections"][0]
    assert (first["stage"], first["code"]) == (stage, code)
    assert backend.asked[0].rejections == ()
    assert backend.asked[1].rejections == (first["detail"],)
    assert scene.proof.verified


def test_a_model_that_never_mends_its_plan_is_given_up() -> None:
    backend = Scripted("plan", nonsense, forever=True)
    with pytest.raises(BackendFault, match="no usable answer") as caught:
        synthesize(LEAVES, backend=backend, seed=1)
    assert len(backend.asked) == 3
    assert [each.stage for each in caught.value.rejections] == ["scene_planner"] * 3


@pytest.mark.parametrize(
    ("task", "wrong", "words"),
    [("constraints", bad_clause, "A car"), ("behavior", bad_stop, "pedestrian")],
)
def test_a_model_that_never_serves_the_words_leaves_them_refused(
    task: Task, wrong: Answer, words: str
) -> None:
    backend = Scripted(task, wrong, forever=True)
    with pytest.raises(InputError, match=f"cannot be part of a scene: '{words}'"):
        synthesize(LEAVES, backend=backend, seed=1)
    assert len(backend.asked) == 3


CUT_OFF = "A van cuts off the oncoming car, which has to brake hard"


def cut_off(braker: str | None = None, event: str = "near_miss") -> Answer:
    """A plan of CUT_OFF whose account has the car brake, whatever its relation has."""
    relation = {"type": event, "from": "vehicle-1", "to": "vehicle-2", "cause": "late_brake"}
    plan = {
        "agents": [
            {"id": "vehicle-1", "subtype": "van", "movement": "left"},
            {"id": "vehicle-2", "subtype": "car"},
        ],
        "relations": [relation | ({} if braker is None else {"braker": braker})],
        "ties": [{"agent": "vehicle-2", "of": "vehicle-1", "side": "opposite"}],
        "said": [
            {"words": "cuts off", "became": "relation", "agents": ["vehicle-1", "vehicle-2"]},
            {"words": "has to brake hard", "became": "cause", "agents": ["vehicle-2"]},
        ],
    }
    return lambda _: plan


def test_a_speed_asked_of_an_agent_without_a_relation_is_driven() -> None:
    """It is seated with the background, and the checker measures its speed there."""
    text = "A van from the south at 30 km/h turns right, nothing happens."
    scene = synthesize(text, seed=1, refiner="none")
    assert scene.proof.verified
    (entry,) = [each for each in scene.proof.account if each.words == "30 km/h"]
    assert (entry.state, entry.claim) == ("seen", "number 8.33 m/s")


def test_words_for_the_same_approach_stay_in_the_plan_and_the_account() -> None:
    text = (
        "I'd like to see a right-hook crash, where a box truck turning right from the north leg "
        "hits a cyclist riding straight on beside it."
    )
    scene = synthesize(text, seed=1, refiner="none")
    assert {each.entry for each in scene.record.agents if each.role == "foreground"} == {"north"}
    (entry,) = [each for each in scene.record.said if each.became == "tie"]
    assert entry.words == "beside it"


def test_a_model_that_leaves_out_who_brakes_is_asked_to_name_it() -> None:
    backend = Scripted("plan", cut_off(), cut_off("vehicle-2"))
    scene = synthesize(CUT_OFF, backend=backend, seed=1, refiner="none")
    (refused,) = scene.provenance["rejections"]
    assert (refused["stage"], refused["code"]) == ("scene_verifier", "wrong_braker")
    assert backend.asked[1].rejections == (refused["detail"],)
    assert "the plan has vehicle-2 do so; write cause late_brake" in refused["detail"]
    (event,) = scene.proof.events
    assert event.evidence["late_brake"] == scene.record.relations[0].cause_agent == 2


def test_a_model_that_has_the_struck_vehicle_brake_is_given_up_with_the_planners_budget() -> None:
    """Drawn so that who strikes is the one of the two that reacts: either may."""
    backend = Scripted("plan", cut_off("vehicle-2", "collide_at"), forever=True)
    with pytest.raises(Unsatisfiable) as caught:
        synthesize(CUT_OFF, backend=backend, seed=14, refiner="none")
    assert len(backend.asked) == 3
    last = caught.value.rejections[-1]
    assert last.code == "wrong_braker"
    assert "vehicle-1 brakes in the scene, the plan has vehicle-2 do so" in last.detail
    assert "in a collision the one that strikes (from)" in backend.asked[1].rejections[0]


@pytest.mark.parametrize("seed", range(5))
def test_the_oncoming_car_that_is_cut_off_brakes(seed: int) -> None:
    scene = synthesize(CUT_OFF, seed=seed, refiner="none")
    van, car = (each for each in scene.record.agents if each.role == "foreground")
    (event,) = scene.proof.events
    assert (event.type, event.from_, event.to) == ("near_miss", van.id, car.id)
    assert event.evidence["late_brake"] == scene.record.relations[0].cause_agent == car.id


@pytest.mark.usefixtures("impatient")
def test_a_backend_that_fails_once_is_asked_again() -> None:
    backend = Scripted("plan", unreachable)
    assert synthesize(LEAVES, backend=backend, seed=1).proof.verified
    assert len(backend.asked) == 2


@pytest.mark.usefixtures("impatient")
def test_a_backend_that_keeps_failing_is_a_fault() -> None:
    backend = Scripted("plan", unreachable, forever=True)
    with pytest.raises(BackendFault, match="cannot be reached"):
        synthesize(LEAVES, backend=backend)
    assert len(backend.asked) == 3


def test_a_bug_in_a_backend_is_not_hidden() -> None:
    def broken(_: Question) -> dict[str, Any]:
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        synthesize(LEAVES, backend=Scripted("plan", broken))


def test_a_pedestrian_from_behind_a_parked_truck_is_seen_late() -> None:
    text = "A woman steps out from behind a parked truck and is nearly hit by a car"
    scene = synthesize(text, seed=2)
    (figure,) = scene.proof.figures["first_visible"]
    assert 1.0 <= figure["before_event"] <= 3.0
    assert {each.state for each in scene.proof.account} <= {"seen", "stands_anyway"}
    assert verify(scene.record) == scene.proof


def test_a_strike_at_nearly_the_highest_speed_is_made() -> None:
    text = "A car hits a van at 71.9 km/h at the point of impact"
    scene = synthesize(text, seed=1, refiner="none")
    (asked,) = scene.record.relations
    assert asked.impact_speed == pytest.approx(71.9 / 3.6, abs=0.01)
    assert scene.proof.verified
