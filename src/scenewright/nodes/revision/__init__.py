"""A turn of a conversation read by a language model: what the words change in the scene as it is.

The model is shown the agents and answers with edits, a question back or a refusal. What it says
becomes the same typed values that the builtin planner makes of words, and passes the same checks.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from scenewright.backends import Account, Backend, Question, ignore_account
from scenewright.errors import Rejected
from scenewright.nodes.ask import ask
from scenewright.nodes.revision.prompts import render_edits_prompt
from scenewright.nodes.revision.reply import EditsReply, to_reading
from scenewright.scene.edits import Reading, Situation
from scenewright.scene.route_table import RouteDescription

_ATTEMPTS = 3


@dataclass(frozen=True)
class Turn:
    """Words, and what they are read against.

    Attributes:
        before: what was said so far; chosen: answers to questions about the words.
        ways: of the map; left_hand: people drive on the left there.
    """

    words: str
    situation: Situation
    before: str
    ways: Sequence[RouteDescription]
    chosen: Mapping[str, str] = field(default_factory=dict)
    left_hand: bool = False


def read_by_model(
    turn: Turn, *, backend: Backend, seed: int, account: Account = ignore_account
) -> Reading | None:
    """What the backend takes the words for; None if nothing that it says can be used.

    Raises:
        BackendFault: the backend cannot answer at all.
    """
    faults: tuple[str, ...] = ()
    for _ in range(_ATTEMPTS):
        question = _build_question(turn, faults, seed, account)
        try:
            reply = ask(backend, question, EditsReply, stage="scene_planner")
            return to_reading(reply, turn.situation, ways=turn.ways, chosen=turn.chosen)
        except Rejected as error:
            faults = (*faults, error.rejection.detail)
    return None


def _build_question(turn: Turn, faults: tuple[str, ...], seed: int, account: Account) -> Question:
    return Question(
        task="edits",
        facts={
            "words": turn.words,
            "before": turn.before,
            "chosen": dict(turn.chosen),
            **turn.situation.model_dump(mode="json", by_alias=True),
        },
        rejections=faults,
        seed=seed,
        prompt=lambda: render_edits_prompt(
            turn.words,
            turn.situation,
            before=turn.before,
            ways=turn.ways,
            left_hand=turn.left_hand,
            chosen=turn.chosen,
            rejections=faults,
        ),
        account=account,
    )
