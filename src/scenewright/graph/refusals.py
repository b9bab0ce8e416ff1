"""Why a run ended without a scene, as the error that says so."""

from __future__ import annotations

from typing import cast

from scenewright.errors import (
    BackendFault,
    InputError,
    OutOfTime,
    ScenewrightError,
    Unsatisfiable,
)
from scenewright.memory.state import SceneState
from scenewright.scene.phrasing import choose_names
from scenewright.scene.rejection import Rejection, Stage
from scenewright.time_limit import TimeLimitReachedError
from scenewright.work_limit import WorkLimitReachedError


def build_refusal(state: SceneState, *, rule: bool) -> ScenewrightError:
    """The error that ends a run; what a rule wrote in vain is a request that cannot be met."""
    return _call_agents(_choose_error(tuple(state.get("rejections", [])), rule=rule), state)


def build_cut_off(
    state: SceneState, error: TimeLimitReachedError | WorkLimitReachedError
) -> ScenewrightError:
    """What a limit cut off, and the best reason so far."""
    rejections = tuple(state.get("rejections", []))
    reason = _choose_best_reason(rejections) if rejections else "the first attempt was not done"
    count = f"{len(rejections)} attempt{'' if len(rejections) == 1 else 's'}"
    cut_off = f"{count}: it cut off the {error.stage.replace('_', ' ')}; {reason}"
    if isinstance(error, TimeLimitReachedError):
        limit = f"{error.seconds:g} s, the time limit"
        message = f"no verified scene within {limit}, and {cut_off}"
        return _call_agents(OutOfTime(message, rejections), state)
    last = Rejection(stage=cast(Stage, error.stage), code="work_spent", detail=str(error))
    limit = f"{error.units:,} steps of the search, the limit of work"
    message = f"no verified scene within {limit}, and {cut_off}"
    return _call_agents(Unsatisfiable(message, (*rejections, last)), state)


def _choose_error(rejections: tuple[Rejection, ...], *, rule: bool) -> ScenewrightError:
    last = rejections[-1]
    if last.code == "out_of_scope":
        return InputError(last.detail)
    if last.code in ("malformed_reply", "malformed_program") and not rule:
        asked = f"{last.stage.replace('_', ' ')} got no usable answer; last: {last.detail}"
        return BackendFault(f"the {asked}", final=True, rejections=rejections)
    if last.stage == "scene_planner" or last.code in ("malformed_program", "unlawful"):
        return Unsatisfiable(last.detail, rejections)
    reason = _choose_best_reason(rejections)
    return Unsatisfiable(
        f"no verified scene within {len(rejections)} attempts; {reason}", rejections
    )


def _call_agents(error: ScenewrightError, state: SceneState) -> ScenewrightError:
    """The error with how people call the agents of the plan that came to nothing."""
    error.called = choose_names(state["social_graph"]) if "social_graph" in state else {}
    return error


def _choose_best_reason(rejections: tuple[Rejection, ...]) -> str:
    """The last refusal, or the one that came nearest."""
    # Where most attempts failed on a clause that never held, the nearest of them says most.
    unserved = [rejection for rejection in rejections if rejection.missed is not None]
    if 2 * len(unserved) > len(rejections):
        return f"nearest: {min(unserved, key=lambda each: each.missed or (0, 0.0)).detail}"
    return f"last: {rejections[-1].detail}"
