"""Every retry edge, as pure functions of the state; budgets come from the run context."""

from __future__ import annotations

from typing import Literal

from langgraph.runtime import Runtime

from scenewright.memory.state import SceneState
from scenewright.nodes.context import RunContext
from scenewright.scene.rejection import Rejection, Stage

_FINAL = ("out_of_scope", "contradictory", "ungroundable")


def after_scene_planner(
    state: SceneState, runtime: Runtime[RunContext]
) -> Literal["agent_generator", "scene_planner", "give_up"]:
    """On to the generator; else repair the plan; a request that cannot be is not asked again."""
    refused = state.get("refused")
    if refused is None:
        return "agent_generator"
    final = refused.code in _FINAL and (
        runtime.context.backend.deterministic or refused.code != "ungroundable"
    )
    if final or _spent(state, "scene_planner") > runtime.context.budgets.planner:
        return "give_up"
    return "scene_planner"


def after_waypoint_filter(
    state: SceneState, runtime: Runtime[RunContext]
) -> Literal["event_reasoner", "waypoint_filter", "agent_generator", "give_up"]:
    """On to the reasoner; else repair the program; else sample afresh; else stop."""
    refused = state.get("refused")
    if refused is None:
        return "event_reasoner"
    budgets = runtime.context.budgets
    if refused.code in ("malformed_program", "malformed_reply"):
        malformed = _spent(state, "waypoint_filter", "malformed_program", "malformed_reply")
        idle = runtime.context.backend.deterministic or malformed > budgets.filter
        return "give_up" if idle else "waypoint_filter"
    return _sample_afresh(state, budgets.generator)


def after_event_reasoner(
    state: SceneState, runtime: Runtime[RunContext]
) -> Literal["trajectory_refiner", "event_reasoner", "agent_generator", "give_up"]:
    """On to the refiner; else reason again; else sample afresh; else stop."""
    if state.get("refused") is None:
        return "trajectory_refiner"
    return _reason_again(state, runtime.context, "event_reasoner")


def after_scene_verifier(
    state: SceneState, runtime: Runtime[RunContext]
) -> Literal["end", "event_reasoner", "agent_generator", "give_up"]:
    """Done if proven; else reason again with the evidence; else sample afresh; else stop."""
    if state.get("refused") is None:
        return "end"
    return _reason_again(state, runtime.context, "scene_verifier")


def _reason_again(
    state: SceneState, context: RunContext, stage: Stage
) -> Literal["event_reasoner", "agent_generator", "give_up"]:
    """A backend that may answer otherwise is asked again within its budget; else sample afresh."""
    idle = context.backend.deterministic
    if not idle and _spent(state, stage) <= context.budgets.reasoner:
        return "event_reasoner"
    return _sample_afresh(state, context.budgets.generator)


def _sample_afresh(state: SceneState, budget: int) -> Literal["agent_generator", "give_up"]:
    """Every refusal after the planner costs one fresh sample."""
    spent = sum(each.stage != "scene_planner" for each in state.get("rejections", []))
    return "agent_generator" if spent <= budget else "give_up"


def _spent(state: SceneState, stage: Stage, *codes: str) -> int:
    found: list[Rejection] = state.get("rejections", [])
    return sum(each.stage == stage and (not codes or each.code in codes) for each in found)
