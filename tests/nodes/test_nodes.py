"""Each stage by itself: what it asks, what it accepts, and how it says no."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from pydantic import BaseModel

from scenewright import synthesize
from scenewright.backends import Question, load_backend
from scenewright.errors import Rejected
from scenewright.geometry.map_areas import MapAreas
from scenewright.intersections import load_map
from scenewright.nodes.agent_generator import generate_agents
from scenewright.nodes.ask import ask, earlier, latest
from scenewright.nodes.context import RunContext
from scenewright.nodes.event_reasoner import reason_events
from scenewright.nodes.scene_planner import plan_scene
from scenewright.nodes.scene_verifier import verify_scene
from scenewright.nodes.scene_verifier.assemble import assemble, scene_id
from scenewright.nodes.trajectory_refiner import refine_trajectories
from scenewright.nodes.waypoint_filter import filter_waypoints
from scenewright.nodes.waypoint_filter.wording import worded_program
from scenewright.scene.behavior import BehaviorProgram, Segment
from scenewright.scene.rejection import Rejection
from scenewright.tools.gmm_sampler import load_priors

GROUND = MapAreas(load_map("amsterdam_120"))
PRIORS = load_priors("amsterdam_120")
TEXT = "A car from the north turning left yields to an oncoming car, nobody else around, at noon."
CAR, OTHER = "vehicle-1", "vehicle-2"


class Scripted:
    """Answers every question with one reply and remembers what was asked."""

    name = "scripted"
    deterministic = False

    def __init__(self, reply: Any) -> None:
        self.reply = reply
        self.asked: list[Question] = []

    def answer(self, question: Question) -> Any:
        if question.task == "summary":
            return load_backend("builtin").answer(question)
        self.asked.append(question)
        return self.reply


def runtime(backend=None, *, told=None, **more):
    context = RunContext(
        backend=backend or load_backend("builtin"),
        ground=GROUND,
        priors=PRIORS,
        seed=3,
        tell=(lambda stage, line: told.append((stage, line))) if told is not None else _nothing,
        **more,
    )
    return SimpleNamespace(context=context)


def _nothing(stage: str, line: str) -> None:
    pass


@pytest.fixture(scope="module")
def run() -> dict[str, Any]:
    """Every product of one run."""
    return dict(synthesize(TEXT, seed=3).state)


def refused(node, state, backend) -> Rejection:
    with pytest.raises(Rejected) as error:
        node(state, runtime=runtime(backend))
    return error.value.rejection


class Reply(BaseModel):
    number: int


def test_an_answer_becomes_the_reply_model():
    backend = Scripted({"number": 4})
    question = Question(task="plan", facts={})
    assert ask(backend, question, Reply, stage="scene_planner").number == 4
    assert backend.asked == [question]


def test_a_malformed_answer_is_refused_with_the_first_fault():
    with pytest.raises(Rejected) as error:
        ask(Scripted({"number": "x"}), Question("plan", {}), Reply, stage="event_reasoner")
    rejection = error.value.rejection
    assert (rejection.stage, rejection.code) == ("event_reasoner", "malformed_reply")
    assert rejection.detail.startswith("number: ")


def test_a_stage_is_told_its_own_faults_only():
    rejections = [
        Rejection(stage="scene_planner", code="malformed_reply", detail="one"),
        Rejection(stage="event_reasoner", code="malformed_reply", detail="two"),
    ]
    assert earlier(rejections, "scene_planner") == ("one",)


def test_what_was_said_of_another_layout_is_not_told_of_this_one():
    of_another = Rejection(
        stage="scene_verifier", code="relation_not_realised", detail="one", repairable=False
    )
    of_this = Rejection(stage="event_reasoner", code="unknown_anchor", detail="two")
    assert latest([of_another, of_this], "event_reasoner", "scene_verifier") == (of_this,)


def test_every_stage_and_attempt_has_randomness_of_its_own():
    context = runtime().context
    once = Rejection(stage="scene_verifier", code="implausible_motion", detail="x")

    def first(stage, rejections) -> float:
        return float(context.rng(stage, rejections).random())

    assert first("agent_generator", []) == first("agent_generator", [])
    drawn = {first("agent_generator", []), first("waypoint_filter", [])}
    drawn |= {first("agent_generator", [once]), first("agent_generator", [once, once])}
    assert len(drawn) == 4


def test_the_planner_asks_with_the_maps_legs_and_earlier_faults():
    plan = {"agents": [{"id": CAR, "type": "vehicle"}]}
    backend = Scripted(plan)
    fault = Rejection(stage="scene_planner", code="malformed_reply", detail="agents: missing")
    state = {"instruction": "a car", "previous": None, "rejections": [fault]}
    written = plan_scene(state, runtime=runtime(backend))
    [question] = backend.asked
    assert question.facts["legs"] == ["north", "east", "south", "west"]
    assert question.rejections == ("agents: missing",)
    assert [agent.id for agent in written["social_graph"].agents] == [CAR]
    assert len(written["grounding"].routes[CAR]) == 12


@pytest.mark.parametrize(
    ("reply", "code"),
    [
        ({"code": "out_of_scope", "reason": "no traffic"}, "out_of_scope"),
        ({"code": "contradictory", "reason": "left and right"}, "contradictory"),
        ({"code": "impossible", "reason": "no such leg"}, "impossible"),
        ({"agents": [{"id": "car", "type": "vehicle"}]}, "malformed_reply"),
        (
            {"agents": [{"id": CAR, "type": "vehicle", "entry": "north", "exit": "north"}]},
            "ungroundable",
        ),
    ],
)
def test_a_plan_that_cannot_be_is_refused(reply, code):
    state = {"instruction": "x", "previous": None, "rejections": []}
    rejection = refused(plan_scene, state, Scripted(reply))
    assert (rejection.stage, rejection.code) == ("scene_planner", code)


def test_a_program_that_is_none_is_refused(run):
    rejection = refused(filter_waypoints, run, Scripted({"program": "gives_way(vehicle-1)"}))
    assert rejection.code == "malformed_program"
    for reply in ({"clauses": {}}, {"clauses": [], "program": ""}, {}):
        rejection = refused(filter_waypoints, run, Scripted(reply))
        assert rejection.code == "malformed_reply"


def test_a_program_about_somebody_who_is_not_there_is_refused(run):
    for program in (f"contact({CAR}, vehicle-99)", "on_road(vehicle-99)"):
        rejection = refused(filter_waypoints, run, Scripted({"program": program}))
        assert rejection.code == "malformed_program"
        assert rejection.detail == f"{program}: there is no vehicle-99 in the scene"


def test_the_filter_names_agents_relations_and_patterns(run):
    backend = Scripted({"program": f"gives_way({CAR}, {OTHER})"})
    filter_waypoints(run, runtime=runtime(backend))
    [question] = backend.asked
    assert {"id": CAR, "type": "vehicle", "movement": "left"} in question.facts["agents"]
    [relation] = question.facts["relations"]
    assert (relation["from"], relation["to"], relation["type"]) == (CAR, OTHER, "yield_to")
    assert relation["pattern"] == "left_turn_yields_to_oncoming"


def segments_of(run, agent, *segments) -> dict[str, Any]:
    own = {name: list(each) for name, each in run["behavior"].segments.items()}
    own[agent] = [Segment(**dict(zip(FIELDS, each, strict=True))) for each in segments]
    return BehaviorProgram(segments=own).model_dump(mode="json")


FIELDS = ("start", "end", "anchor", "status")


@pytest.mark.parametrize(
    ("segments", "code", "detail"),
    [
        ([], "malformed_reply", "has no segments"),
        ([(0, 5, "moon", "keep")], "unknown_anchor", "no anchor 'moon'"),
        ([(0, 5, "contact", "stop")], "unknown_anchor", "no anchor 'contact'"),
        ([(5, 4, "goal", "keep")], "times_not_increasing", "ends before 5 s"),
        ([(0, 5, "goal", "keep"), (4, 9, "goal", "keep")], "times_not_increasing", "overlaps"),
        ([(0, 0, "contact", "terminate")], "times_not_increasing", "before it has been seen"),
    ],
)
def test_segments_that_cannot_be_edited_are_refused(run, segments, code, detail):
    reply = segments_of(run, CAR, *segments)
    rejection = refused(reason_events, run, Scripted(reply))
    assert (rejection.stage, rejection.code) == ("event_reasoner", code)
    assert rejection.agents == (CAR,)
    assert detail in rejection.detail


def test_the_reasoner_sees_anchors_and_stays(run):
    backend = Scripted(run["behavior"].model_dump(mode="json"))
    written = reason_events(run, runtime=runtime(backend))
    assert written["behavior"] == run["behavior"]
    [question] = backend.asked
    car = next(each for each in question.facts["agents"] if each["agent"] == CAR)
    assert car["stays"][0]["reason"] == "gives_way"
    assert {"goal"} <= {anchor["id"] for anchor in car["anchors"]}


def test_keep_stop_proceed_is_what_a_yield_becomes(run):
    assert [each.status for each in run["behavior"].segments[CAR]] == ["keep", "stop", "proceed"]
    assert [each.status for each in run["behavior"].segments[OTHER]] == ["keep"]


def test_without_a_refiner_the_edited_priors_are_final(run):
    assert run["refined"] is run["edited"]
    assert "no learned model ran" in run["refinement"].note
    for name, agent in run["selection"].agents.items():
        track = run["edited"][name]
        path = agent.candidate.path.xy
        off = np.hypot(*(track.xy[:, None] - path[None]).transpose(2, 0, 1)).min(axis=1)
        assert off.max() <= 0.3


def test_the_verifier_writes_the_events_that_it_found(run):
    [event] = run["scene"].events
    assert (event.type, event.from_, event.to) == ("yielding", 1, 2)
    assert run["proof"].verified
    assert event.time == run["proof"].events[0].time


def test_the_verifier_refuses_what_is_not_the_scene_asked_for(run):
    """Without the stop, nobody yields."""
    segments = dict(run["behavior"].segments)
    segments[CAR] = (Segment(start=0, end=run["selection"].duration, anchor="goal", status="keep"),)
    state = run | {"behavior": BehaviorProgram(segments=segments)}
    state |= refine_trajectories(state, runtime=runtime())
    rejection = refused(verify_scene, state, load_backend("builtin"))
    assert rejection.code == "relation_not_realised"
    assert set(rejection.agents) == {CAR, OTHER}
    assert rejection.detail.endswith(f"1 is {CAR}; 2 is {OTHER})")
    assert rejection.repairable


def test_what_the_solvers_own_segments_got_wrong_only_another_layout_mends(run):
    still = dict(run["refined"])
    still[OTHER] = replace(still[OTHER], xy=still[OTHER].xy[:1].repeat(len(still[OTHER].xy), 0))
    rejection = refused(verify_scene, run | {"refined": still}, load_backend("builtin"))
    assert set(rejection.agents) >= {CAR, OTHER}
    assert not rejection.repairable
    backend = Scripted({"anchors": {}})
    refused(reason_events, run | {"rejections": [rejection]}, backend)
    assert [question.rejections for question in backend.asked] == [()]


def test_a_record_holds_what_the_stages_made(run):
    scene = run["scene"]
    assert [agent.name for agent in scene.agents][:2] == [CAR, OTHER]
    assert [agent.id for agent in scene.agents] == list(range(1, len(scene.agents) + 1))
    assert scene.meta.user_prompt == TEXT
    assert scene.meta.time_of_day == "12:00"
    for agent in scene.agents:
        track = run["refined"][agent.name]
        assert agent.spawn_time == track.start
        assert np.array(agent.trajectory) == pytest.approx(track.xy, abs=1e-9)
        assert len(agent.heading) == len(agent.trajectory)
    lights = {each.stop_line or each.crosswalk for each in scene.signals}
    assert len(lights) == 8


def test_a_scene_without_events_says_normal_in_one_row(run):
    state = run | {
        "social_graph": run["social_graph"].model_copy(
            update={"relations": (), "ties": (), "said": ()}
        )
    }
    bare = assemble(
        TEXT,
        state["social_graph"],
        run["candidates"],
        run["selection"],
        run["behavior"],
        {},
        intersection_map=GROUND.intersection_map,
        seed=0,
    )
    assert bare.agents == ()
    assert bare.events == ()
    empty = state | {"refined": {}}
    written = verify_scene(empty, runtime=runtime())
    [row] = written["scene"].events
    assert (row.type, row.from_, row.to) == ("normal", None, None)


def test_a_scenes_name_depends_on_its_request_alone():
    assert scene_id("a", "m", 1) == scene_id("a", "m", 1)
    assert len({scene_id("a", "m", 1), scene_id("b", "m", 1), scene_id("a", "m", 2)}) == 3
    assert scene_id("\ud800", "m", 1)


def test_stages_say_what_they_did(run):
    told: list[tuple[str, str]] = []
    generate_agents(run, runtime=runtime(told=told))
    assert told == [("agent_generator", "2 + 0 agents at 12.00 h")]


def test_where_nobody_is_named_only_the_planner_is_asked():
    backend = Scripted({"agents": [], "relations": []})
    scene = synthesize("Light traffic at noon.", backend=backend, seed=1, refiner="none")
    assert scene.proof.verified
    assert [question.task for question in backend.asked] == ["plan"]


def test_an_agent_is_named_by_its_class():
    plan = {"agents": [{"id": "pedestrian-1", "type": "vehicle"}]}
    state = {"instruction": "x", "previous": None, "rejections": []}
    rejection = refused(plan_scene, state, Scripted(plan))
    assert "an id begins with its type" in rejection.detail


def test_the_verifiers_evidence_is_told_to_the_reasoner(run):
    own = load_backend("builtin")
    found = Rejection(stage="scene_verifier", code="relation_not_realised", detail="no yield seen")

    class Asked(Scripted):
        def answer(self, question: Question) -> Any:
            self.asked.append(question)
            return own.answer(question)

    for told, rejections in ((("no yield seen",), [found]), ((), [found] * 3)):
        backend = Asked(None)
        reason_events({**run, "rejections": rejections}, runtime=runtime(backend))
        assert [each.rejections for each in backend.asked] == [(), told]


def test_a_program_that_brings_a_relation_not_about_is_refused(run):
    rejection = refused(filter_waypoints, run, Scripted({"clauses": []}))
    assert rejection.code == "malformed_program"
    assert rejection.detail == f"yield_to of {CAR} and {OTHER} lacks gives_way({CAR}, {OTHER})"


def test_agents_of_whom_nothing_is_said_keep_to_what_the_solver_found(run):
    segments = {
        name: [each.model_dump(mode="json") for each in segments]
        for name, segments in run["behavior"].segments.items()
        if name in (CAR, OTHER)
    }
    written = reason_events(run, runtime=runtime(Scripted({"segments": segments})))
    assert written["behavior"] == run["behavior"]


def test_a_segment_without_a_start_begins_where_the_one_before_it_ended(run):
    segments = {
        name: [each.model_dump(mode="json", exclude={"start"}) for each in segments]
        for name, segments in run["behavior"].segments.items()
    }
    written = reason_events(run, runtime=runtime(Scripted({"segments": segments})))
    assert written["behavior"] == run["behavior"]


def test_segments_of_somebody_who_is_not_there_are_refused(run):
    reply = run["behavior"].model_dump(mode="json")
    reply["segments"]["vehicle-99"] = reply["segments"][CAR]
    rejection = refused(reason_events, run, Scripted(reply))
    assert rejection.detail == "vehicle-99 is not in the scene"


@pytest.mark.parametrize(
    ("places", "detail"),
    [
        ({CAR: []}, "has no anchors"),
        ({CAR: ["moon"]}, "has no anchor 'moon'"),
        ({CAR: ["goal"], "vehicle-99": ["goal"]}, "vehicle-99 is not asked about"),
        ({CAR: ["goal"]}, "which is left out"),
    ],
)
def test_a_summary_that_cannot_be_is_refused(run, places, detail):
    class Summary(Scripted):
        def answer(self, question: Question) -> Any:
            return self.reply if question.task == "summary" else {}

    reply = {"anchors": {OTHER: ["goal"], **places}}
    rejection = refused(reason_events, run, Summary(reply))
    assert rejection.stage == "event_reasoner"
    assert rejection.detail.startswith("summary: ")
    assert detail in rejection.detail


def test_places_are_taken_once_and_in_the_order_of_the_way(run):
    """The order is the map's: a model that mixes it up has still said which places matter."""

    class Summary(Scripted):
        def answer(self, question: Question) -> Any:
            self.asked.append(question)
            if question.task == "summary":
                return self.reply
            return load_backend("builtin").answer(question)

    car = next(each for each in run["summary"].agents if each.agent == CAR)
    order = [anchor.id for anchor in car.anchors]
    backend = Summary({"anchors": {CAR: [*reversed(order), order[0]], OTHER: ["goal"]}})
    reason_events(run, runtime=runtime(backend))
    seen = next(e for e in backend.asked[1].facts["agents"] if e["agent"] == CAR)
    assert [anchor["id"] for anchor in seen["anchors"]] == order


LEFT_HAND = "Traffic drives on the left"


@pytest.mark.parametrize("left_hand", [False, True])
def test_a_model_is_told_where_people_drive_on_the_left(
    run: dict[str, Any], left_hand: bool
) -> None:
    """Which turn leads across oncoming traffic is asked of it by two stages."""
    here = MapAreas(GROUND.intersection_map.model_copy(update={"left_hand_traffic": left_hand}))
    backend = Scripted({"note": "no answer"})
    runs_at = runtime(backend)
    runs_at.context = replace(runs_at.context, ground=here)
    for node in (plan_scene, filter_waypoints):
        with pytest.raises(Rejected):
            node({**run, "rejections": []}, runtime=runs_at)
    plan, constraints = (question.wording().user for question in backend.asked)
    assert (LEFT_HAND in plan) == left_hand
    assert LEFT_HAND not in constraints  # nothing here speaks of turns
    hits = worded_program(COLLIDES, ["north"], left_hand=left_hand).user
    assert (LEFT_HAND in hits) == left_hand


COLLIDES: dict[str, Any] = {
    "instruction": "A car turning right hits an oncoming car",
    "told": [{"id": CAR, "movement": "right"}, {"id": OTHER, "movement": "straight"}],
    "relations": [
        {"type": "collide_at", "from": CAR, "to": OTHER, "striker": CAR, "struck": OTHER,
         "kind": "left_turn", "pattern": "left_turn_opposite_collision", "cause": None,
         "target_pet": None, "target_ttc": None, "impact_speed": None,
         "point_from": None, "point_to": None}
    ],
    "violators": [],
}  # fmt: skip
