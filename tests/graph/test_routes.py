"""Every retry edge: where a refusal leads, and when it is given up."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from scenewright.errors import Unsatisfiable
from scenewright.graph import routes
from scenewright.graph.run import synthesize
from scenewright.memory.state import SceneState
from scenewright.nodes.context import Budgets
from scenewright.scene.refinement import AgentRefinement, Refinement
from scenewright.scene.rejection import Rejection, RejectionCode, Stage
from scenewright.scene.social import SocialGraph

BUDGETS = Budgets(planner=2, filter=2, reasoner=2, generator=4)
AFTER: dict[Stage, Any] = {
    "scene_planner": routes.route_after_planner,
    "waypoint_filter": routes.route_after_filter,
    "event_reasoner": routes.route_after_reasoner,
    "scene_verifier": routes.route_after_verifier,
}


def led(stage: Stage, refusals: list[tuple[Stage, RejectionCode]], *, model: bool) -> str:
    """Where the run goes on after the last of the refusals, or after success if there is none."""
    found = [Rejection(stage=who, code=code, detail="so") for who, code in refusals]
    last = found[-1] if found and found[-1].stage == stage else None
    state: SceneState = {"refused": last, "rejections": found}
    context = SimpleNamespace(
        backend=SimpleNamespace(deterministic=not model), budgets=BUDGETS, lawful=True
    )
    return str(AFTER[stage](state, SimpleNamespace(context=context)))


@pytest.mark.parametrize(
    ("stage", "onwards"),
    [
        ("scene_planner", "agent_generator"),
        ("waypoint_filter", "event_reasoner"),
        ("event_reasoner", "trajectory_refiner"),
        ("scene_verifier", "end"),
    ],
)
@pytest.mark.parametrize("model", [False, True])
def test_what_is_not_refused_goes_on(stage: Stage, onwards: str, *, model: bool) -> None:
    assert led(stage, [], model=model) == onwards
    other: Stage = "agent_generator"
    assert led(stage, [(other, "no_surviving_combination")], model=model) == onwards


@pytest.mark.parametrize("code", ["out_of_scope", "contradictory", "impossible"])
@pytest.mark.parametrize("stage", ["scene_planner", "waypoint_filter", "event_reasoner"])
@pytest.mark.parametrize("model", [False, True])
def test_what_cannot_be_meant_is_not_asked_again(
    stage: Stage, code: RejectionCode, *, model: bool
) -> None:
    assert led(stage, [(stage, code)], model=model) == "give_up"


def test_a_model_may_mend_a_plan_and_a_rule_may_not() -> None:
    once: list[tuple[Stage, RejectionCode]] = [("scene_planner", "ungroundable")]
    assert led("scene_planner", once, model=True) == "scene_planner"
    assert led("scene_planner", once, model=False) == "give_up"


STAGES: list[tuple[Stage, RejectionCode, int]] = [
    ("scene_planner", "malformed_reply", 2),
    ("waypoint_filter", "malformed_program", 2),
    ("waypoint_filter", "malformed_reply", 2),
]


@pytest.mark.parametrize(("stage", "code", "budget"), STAGES)
def test_a_malformed_reply_is_repaired_within_the_budget(
    stage: Stage, code: RejectionCode, budget: int
) -> None:
    for count in range(1, budget + 1):
        assert led(stage, [(stage, code)] * count, model=True) == stage
    assert led(stage, [(stage, code)] * (budget + 1), model=True) == "give_up"


def test_a_rule_that_writes_a_malformed_program_is_not_asked_again() -> None:
    refused: list[tuple[Stage, RejectionCode]] = [("waypoint_filter", "malformed_program")]
    assert led("waypoint_filter", refused, model=False) == "give_up"


def test_what_no_rule_can_write_is_a_request_that_cannot_be_met() -> None:
    """A group that does nothing with another agent is no fault of a backend."""
    with pytest.raises(Unsatisfiable, match="in a group, so it must also do something"):
        synthesize("Four children cross on the west crosswalk together", refiner="none")


@pytest.mark.parametrize("model", [False, True])
def test_what_finds_no_room_is_sampled_afresh_until_the_budget_is_spent(*, model: bool) -> None:
    none: tuple[Stage, RejectionCode] = ("waypoint_filter", "no_surviving_combination")
    for count in range(1, BUDGETS.generator + 1):
        assert led("waypoint_filter", [none] * count, model=model) == "agent_generator"
    assert led("waypoint_filter", [none] * (BUDGETS.generator + 1), model=model) == "give_up"


def test_a_model_reasons_again_before_all_is_sampled_afresh() -> None:
    stage: Stage = "event_reasoner"
    wrong: tuple[Stage, RejectionCode] = (stage, "unknown_anchor")
    tries = [led(stage, [wrong] * count, model=True) for count in range(1, 6)]
    assert tries == ["event_reasoner"] * 2 + ["agent_generator"] * 2 + ["give_up"]
    assert led(stage, [wrong], model=False) == "agent_generator"


@pytest.mark.parametrize("model", [False, True])
def test_what_the_verifier_refuses_is_sampled_afresh(*, model: bool) -> None:
    wrong: tuple[Stage, RejectionCode] = ("scene_verifier", "implausible_motion")
    tries = [led("scene_verifier", [wrong] * count, model=model) for count in range(1, 6)]
    assert tries == ["agent_generator"] * 4 + ["give_up"]


def test_a_model_is_not_asked_to_mend_what_no_answer_could() -> None:
    code: RejectionCode = "segment_off_track"
    context = SimpleNamespace(backend=SimpleNamespace(deterministic=False), budgets=BUDGETS)
    onwards = []
    for repairable in (True, False):
        refused = Rejection(stage="event_reasoner", code=code, detail="so", repairable=repairable)
        state: SceneState = {"refused": refused, "rejections": [refused]}
        onwards.append(routes.route_after_reasoner(state, SimpleNamespace(context=context)))  # type: ignore[arg-type]
    assert onwards == ["event_reasoner", "agent_generator"]


WRONG: tuple[Stage, RejectionCode] = ("scene_verifier", "wrong_braker")


def test_a_model_that_names_the_wrong_braker_plans_anew_within_the_planners_budget() -> None:
    for count in range(1, BUDGETS.planner + 1):
        assert led("scene_verifier", [WRONG] * count, model=True) == "scene_planner"
    assert led("scene_verifier", [WRONG] * (BUDGETS.planner + 1), model=True) == "give_up"
    malformed: list[tuple[Stage, RejectionCode]] = [("scene_planner", "malformed_reply")] * 2
    assert led("scene_verifier", [*malformed, WRONG], model=True) == "give_up"
    other: list[tuple[Stage, RejectionCode]] = [("scene_verifier", "relation_not_realised")] * 2
    assert led("scene_verifier", [*other, WRONG], model=True) == "scene_planner"


def test_a_plan_that_the_tracks_contradict_again_and_again_is_given_up() -> None:
    most = BUDGETS.misplanned
    found = [Rejection(stage="scene_verifier", code="wrong_braker", detail="so")] * most
    context = SimpleNamespace(
        backend=SimpleNamespace(deterministic=True), budgets=Budgets(generator=100)
    )
    for refusals, onwards in ((found, "agent_generator"), ([*found, found[0]], "give_up")):
        state: SceneState = {"refused": found[0], "rejections": refusals}
        given: Any = SimpleNamespace(context=context)
        assert routes.route_after_verifier(state, given) == onwards


def test_a_rule_that_names_the_wrong_braker_is_not_asked_for_another_plan() -> None:
    assert led("scene_verifier", [WRONG], model=False) == "agent_generator"


def test_a_settled_plan_is_not_made_anew() -> None:
    """Nor is the reasoner asked, whose segments cannot mend it."""
    found = Rejection(stage="scene_verifier", code="wrong_braker", detail="so", repairable=False)
    settled = SocialGraph(agents=())
    state: SceneState = {"refused": found, "rejections": [found], "planned": settled}
    context = SimpleNamespace(backend=SimpleNamespace(deterministic=False), budgets=BUDGETS)
    assert routes.route_after_verifier(state, SimpleNamespace(context=context)) == "agent_generator"  # type: ignore[arg-type]


def test_the_planners_refusals_cost_no_sample() -> None:
    refused: list[tuple[Stage, RejectionCode]] = [("scene_planner", "malformed_reply")] * 9
    refused += [("scene_verifier", "background_interferes")]
    assert led("scene_verifier", refused, model=False) == "agent_generator"


def refused_after(
    refinement: Refinement, refusals: int, *, model: bool, repairable: bool = True
) -> str:
    """Where the run goes on after the verifier has refused refined tracks."""
    code: RejectionCode = "background_interferes"
    fault = Rejection(stage="scene_verifier", code=code, detail="so", repairable=repairable)
    found = [fault] * refusals
    state: SceneState = {"refused": found[-1], "rejections": found, "refinement": refinement}
    context = SimpleNamespace(
        backend=SimpleNamespace(deterministic=not model), budgets=BUDGETS, lawful=True
    )
    return str(routes.route_after_verifier(state, SimpleNamespace(context=context)))  # type: ignore[arg-type]


def refinement(share: float, *, attempt: int, retries: int = 0) -> Refinement:
    agents = {"vehicle-1": AgentRefinement(share=share)}
    return Refinement(refiner="trajnet", note="so", attempt=attempt, retries=retries, agents=agents)


@pytest.mark.parametrize("model", [False, True])
def test_refined_tracks_that_are_refused_are_refined_less_within_the_budget(*, model: bool) -> None:
    for attempt in range(1, BUDGETS.refiner + 1):
        tried = refinement(0.5, attempt=attempt, retries=attempt - 1)
        assert refused_after(tried, attempt, model=model) == "trajectory_refiner"
    spent = refinement(0.5, attempt=BUDGETS.refiner + 1, retries=BUDGETS.refiner)
    onwards = refused_after(spent, BUDGETS.refiner + 1, model=model)
    assert onwards == "agent_generator"


def test_where_nothing_was_refined_there_is_nothing_to_refine_less() -> None:
    assert refused_after(refinement(0.0, attempt=1), 1, model=False) == "agent_generator"


def test_tracks_that_are_no_scene_unrefined_are_sampled_afresh_at_once() -> None:
    tried = refinement(0.5, attempt=1)
    assert refused_after(tried, 1, model=False) == "trajectory_refiner"
    assert refused_after(tried, 1, model=False, repairable=False) == "agent_generator"


def test_refining_less_costs_no_sample() -> None:
    spent = BUDGETS.generator
    tried = refinement(0.0, attempt=6, retries=5)
    assert refused_after(tried, spent + 5, model=False) == "agent_generator"
    assert refused_after(tried, spent + 6, model=False) == "give_up"
