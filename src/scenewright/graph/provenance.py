"""provenance.json: how a scene came about, and what models took for it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache
from importlib.metadata import version
from typing import Any

from scenewright.backends import Call
from scenewright.memory.state import SceneState
from scenewright.nodes.context import RunContext
from scenewright.scene.relations import get_pattern
from scenewright.tools.dsl_validator.parse import format_clause


def describe_provenance(
    context: RunContext, state: SceneState, seconds: Mapping[str, float], calls: Sequence[Call]
) -> dict[str, Any]:
    """The object of provenance.json.

    Args:
        state: of a run that made a scene; seconds: wall time by stage; calls: of its models.
    """
    models = sum_costs_by_task(calls)
    names = [pattern.pattern for pattern in state["candidates"].cast.patterns]
    patterns, selection = [get_pattern(name) for name in names], state["selection"]
    optimality: dict[str, Any] = {}
    if context.selection == "map":
        optimality = {"optimal": selection.optimal, "gap": round(selection.figures["gap"], 3)}
    return {
        "schema_version": 1,
        "seed": context.seed,
        "backend": context.backend.name,
        "selection": context.selection,
        **({} if context.max_agents is None else {"max_agents": context.max_agents}),
        **({"lenient": True} if context.lenient else {}),
        **({"lawful": True} if context.lawful else {}),
        **optimality,
        "refiner": context.refiner,
        "refinement": state["refinement"].model_dump(mode="json"),
        "intersection": context.intersection.name,
        "scene_digest": state["proof"].scene_digest,
        "versions": _list_versions(),
        "constraints": [format_clause(clause) for clause in state["constraints"].clauses],
        "patterns": names,
        "taxonomy": [f"{pattern.theme} / {pattern.subtype} / {pattern.id}" for pattern in patterns],
        "rejections": [each.model_dump(mode="json") for each in state.get("rejections", [])],
        "seconds": {stage: round(value, 4) for stage, value in seconds.items()},
        **({"models": models} if models else {}),
    }


def sum_costs_by_task(calls: Sequence[Call]) -> dict[str, Any]:
    """What models were asked and what that took, by task; nothing where none was."""
    tasks: dict[str, None] = dict.fromkeys(call.task for call in calls)
    return {task: _sum_costs([call for call in calls if call.task == task]) for task in tasks}


def _sum_costs(calls: Sequence[Call]) -> dict[str, Any]:
    """Answers and requests, tokens of answers (None: not counted), seconds, prompts."""
    answers = [call for call in calls if call.answered]
    counted = {
        "input_tokens": [call.input_tokens for call in answers] or [None],
        "output_tokens": [call.output_tokens for call in answers] or [None],
    }
    return {
        "model": calls[0].model,
        "answers": len(answers),
        "requests": sum(call.asked for call in calls),
        **{
            name: None if None in each else sum(n for n in each if n is not None)
            for name, each in counted.items()
        },
        "seconds": round(sum(call.seconds for call in calls), 3),
        "prompts": list(dict.fromkeys(call.prompt for call in calls)),
    }


@cache
def _list_versions() -> dict[str, str]:
    packages = ("scenewright", "langgraph", "numpy", "pydantic", "shapely")
    return {package: version(package) for package in packages}
