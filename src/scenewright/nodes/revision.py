"""A turn of a conversation read by a backend's planner: its new plan, as edits of the old one."""

from __future__ import annotations

from scenewright.backends import Backend, Question
from scenewright.errors import Rejected
from scenewright.nodes.scene_planner import ask_for_plan, ways_of
from scenewright.nodes.scene_planner.wording import worded_plan
from scenewright.scene.edits import Decline, Edits, Reading, Situation, difference
from scenewright.scene.map import IntersectionMap
from scenewright.scene.social import Refusal

_ATTEMPTS = 3


def replan(
    words: str,
    situation: Situation,
    *,
    before: str,
    backend: Backend,
    on: IntersectionMap,
    seed: int,
) -> Reading | None:
    """The edits that lead to the plan that the backend makes of the words; None if none is usable.

    Raises:
        BackendFault: the backend cannot answer at all.
    """
    faults: tuple[str, ...] = ()
    for _ in range(_ATTEMPTS):
        try:
            plan = ask_for_plan(
                backend, _question(words, before, situation, on, faults, seed), ways_of(on)
            )
        except Rejected as error:
            faults = (*faults, error.rejection.detail)
            continue
        if isinstance(plan, Refusal):
            return Decline(code=plan.code, reason=plan.reason)
        edits = difference(situation.graph, plan)
        return Edits(edits=edits) if edits else None
    return None


def _question(
    words: str,
    before: str,
    situation: Situation,
    on: IntersectionMap,
    faults: tuple[str, ...],
    seed: int,
) -> Question:
    """The planner's own question, with all that was said as the earlier request."""
    return Question(
        task="plan",
        facts={
            "instruction": words,
            "previous": before,
            "legs": [leg.name for leg in on.legs],
            "graph": situation.graph.model_dump(mode="json", by_alias=True),
        },
        rejections=faults,
        seed=seed,
        wording=lambda: worded_plan(words, before, ways_of(on), rejections=faults),
    )
