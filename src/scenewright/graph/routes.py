"""Every retry edge, as pure functions of the state; budgets come from the run context."""

from __future__ import annotations

from typing import Literal

from langgraph.runtime import Runtime

from scenewright.backends import get_backend_of_task
from scenewright.memory.state import SceneState
from scenewright.nodes.agent_generator import count_samples
from scenewright.nodes.context import RunContext
from scenewright.scene.rejection import MISPLANNED, Rejection, Stage
from scenewright.tools.map_grounding.role_search import list_unasked_runners, may_run_unasked

_FINAL = ("out_of_scope", "contradictory", "impossible", "ungroundable")


def route_after_planner(
    state: SceneState, runtime: Runtime[RunContext]
) -> Literal["agent_generator", "scene_planner", "give_up"]:
    """On to the generator; else repair the plan; a request that cannot be is not asked again."""
    refused = state.get("refused")
    if refused is None:
        return "agent_generator"
    final = refused.code in _FINAL and (
        get_backend_of_task(runtime.context.backend, "plan").deterministic
        or refused.code != "ungroundable"
    )
    if final or _count_attempts(state, "scene_planner") > runtime.context.budgets.planner:
        return "give_up"
    return "scene_planner"


def route_after_generator(
    state: SceneState, runtime: Runtime[RunContext]
) -> Literal["waypoint_filter", "give_up"]:
    """On to the filter; a request that only a red light run unasked could meet is refused."""
    del runtime
    return "waypoint_filter" if state.get("refused") is None else "give_up"


def route_after_filter(
    state: SceneState, runtime: Runtime[RunContext]
) -> Literal["event_reasoner", "waypoint_filter", "agent_generator", "give_up"]:
    """On to the reasoner; else repair the program; else sample afresh; else stop."""
    refused = state.get("refused")
    if refused is None:
        return "event_reasoner"
    budgets = runtime.context.budgets
    if refused.code in _FINAL:
        return "give_up"
    if refused.code in ("malformed_program", "malformed_reply"):
        malformed = _count_attempts(
            state, "waypoint_filter", "malformed_program", "malformed_reply"
        )
        rule = get_backend_of_task(runtime.context.backend, "constraints").deterministic
        idle = rule or malformed > budgets.filter
        return "give_up" if idle else "waypoint_filter"
    return _sample_afresh(state, runtime.context)


def route_after_reasoner(
    state: SceneState, runtime: Runtime[RunContext]
) -> Literal["trajectory_refiner", "event_reasoner", "agent_generator", "give_up"]:
    """On to the refiner; else ask again, where that may mend it; else sample afresh; else stop."""
    refused, context = state.get("refused"), runtime.context
    if refused is None:
        return "trajectory_refiner"
    if refused.code in _FINAL:
        return "give_up"
    idle = not refused.repairable or get_backend_of_task(context.backend, "behavior").deterministic
    if not idle and _count_attempts(state, "event_reasoner") <= context.budgets.reasoner:
        return "event_reasoner"
    return _sample_afresh(state, context)


def route_after_verifier(
    state: SceneState, runtime: Runtime[RunContext]
) -> Literal["end", "trajectory_refiner", "agent_generator", "scene_planner", "give_up"]:
    """Done if proven; else plan again where only that can mend it; else refine less, where the
    tracks are a scene unrefined; else sample afresh; else stop."""
    refused = state.get("refused")
    if refused is None:
        return "end"
    if refused.code in _FINAL:
        return "give_up"
    refinement, budgets = state.get("refinement"), runtime.context.budgets
    if _count_attempts(state, "scene_verifier", *MISPLANNED) > budgets.misplanned:
        return "give_up"
    # Only a planner that may give another plan is asked again.
    if (
        refused.code in MISPLANNED
        and state.get("planned") is None
        and not get_backend_of_task(runtime.context.backend, "plan").deterministic
    ):
        asked = _count_attempts(state, "scene_planner") + _count_attempts(
            state, "scene_verifier", *MISPLANNED
        )
        return "scene_planner" if asked <= budgets.planner else "give_up"
    mendable = refused.repairable and refinement is not None and refinement.may_retry
    if mendable and refinement is not None and refinement.attempt <= budgets.refiner:
        return "trajectory_refiner"
    return _sample_afresh(state, runtime.context)


def _sample_afresh(state: SceneState, context: RunContext) -> Literal["agent_generator", "give_up"]:
    """Lawful samples within the budget; then as many with a red light that is run unasked."""
    spent = count_samples(state.get("rejections", []), state.get("refinement"))
    first_and_retries = context.budgets.generator + 1
    if spent == first_and_retries:
        # The last sample was lawful and another need not be.
        more = (
            not context.lawful
            and not list_unasked_runners(state["social_graph"], state["candidates"].cast)
            and may_run_unasked(
                state["social_graph"], state["grounding"], intersection_map=context.intersection
            )
        )
    else:
        more = spent < 2 * first_and_retries
    return "agent_generator" if more else "give_up"


def _count_attempts(state: SceneState, stage: Stage, *codes: str) -> int:
    found: list[Rejection] = state.get("rejections", [])
    return sum(each.stage == stage and (not codes or each.code in codes) for each in found)
