"""Words of the request that a scene does not show, as a reason to plan anew or to refuse."""

from __future__ import annotations

from typing import Any

from scenewright.backends import get_backend_of_task
from scenewright.nodes.context import RunContext
from scenewright.nodes.remaining import quote_words, refuse_words
from scenewright.scene.account import AccountEntry
from scenewright.scene.events import Proof
from scenewright.scene.phrasing import describe_graph
from scenewright.scene.record import SceneRecord
from scenewright.scene.rejection import Rejection

REDRAWN = ("sequence", "stop", "braking", "order", "cause", "crossing", "side centre")
"""Types of claims that hold of some samples of a plan and not of others."""
SERVED = ("constraint", "behavior", "measure")
"""What the stages after the planner serve words as; a sample may miss it by a little."""


def find_unshown_words(
    proof: Proof, scene: SceneRecord, state: Any, context: RunContext
) -> Rejection | None:
    """The rejection for words that are not shown or contradicted; None where there is none.

    A model is shown the words once and may plan again. What another sample may show is sampled
    again; all else is refused.
    """
    others = [each for each in proof.missing if each.rule != "word_contradicted"]
    if others or proof.interference or proof.implausible or proof.signal_violations:
        return None
    false = proof.list_words("contradicted")
    unshown = () if context.lenient else proof.list_words("not_shown")
    if not (false or unshown):
        return None
    detail = f"the scene shows nothing of {quote_words((*false, *unshown))}"
    if all(_may_be_redrawn(each, scene) for each in (*false, *unshown)):
        return Rejection(stage="scene_verifier", code="relation_not_realised", detail=detail,
                         repairable=False)  # fmt: skip
    asked = any(each.code == "words_not_shown" for each in state.get("rejections", ()))
    planned = state.get("planned") is not None
    if not (asked or planned or get_backend_of_task(context.backend, "plan").deterministic):
        ask = f"{detail}; plan what they say, or note them in said as constraint or behavior, or "
        ask += "answer refused: out_of_scope"
        return Rejection(stage="scene_verifier", code="words_not_shown", detail=ask)
    if false:
        graph = describe_graph(state["social_graph"])
        return Rejection(
            stage="scene_verifier",
            code="out_of_scope",
            detail="The scene would show something else than "
            f"{quote_words((*false, *unshown))}: the text was read as '{graph}' Say it in other "
            "words, or with more of who does what to whom.",
        )
    return refuse_words(unshown, state["social_graph"], "scene_verifier")


def _may_be_redrawn(word: AccountEntry, scene: SceneRecord) -> bool:
    """Whether another sample of the same plan may show a word."""
    served = any(
        each.became in SERVED and each.start < word.end and word.start < each.end
        for each in scene.said
    )
    if word.state == "not_shown":
        return served
    claim = word.claim or ""
    if claim.startswith("movement"):  # one that turns may turn earlier
        ways = claim.removeprefix("movement ").split("/")
        return any(each.movement in ways for each in scene.agents if each.role == "foreground")
    walks = any(each.type == "pedestrian" for each in scene.agents if each.role == "foreground")
    if walks and claim in ("tie left", "tie right"):  # no plan ties where walkers come from
        return True
    return served or claim.startswith(REDRAWN) or claim.endswith("to a stop")
