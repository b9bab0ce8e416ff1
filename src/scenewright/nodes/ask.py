"""The only place where a backend is asked."""

from __future__ import annotations

from contextlib import nullcontext
from typing import TypeVar

from pydantic import BaseModel, ValidationError

from scenewright.backends import Backend, Question, get_backend_of_task
from scenewright.errors import Rejected
from scenewright.scene.base import describe_fault
from scenewright.scene.rejection import MISPLANNED, Rejection, Stage
from scenewright.time_limit import stop_clock

ReplyT = TypeVar("ReplyT", bound=BaseModel)


def ask(
    backend: Backend, question: Question, reply: type[ReplyT], *, stage: Stage, of: str = ""
) -> ReplyT:
    """The backend's answer as a reply model.

    Args:
        of: how a refusal begins, where a stage asks for more than one thing.

    Raises:
        Rejected: `malformed_reply` with the first thing wrong, for the retry to repair.
        BackendFault: the backend cannot answer.
    """
    rule = get_backend_of_task(backend, question.task).deterministic
    try:
        # How long a model takes does not count against the time limit.
        with nullcontext() if rule else stop_clock():
            answer = backend.answer(question)
        return reply.model_validate(answer)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        where = ".".join(str(part) for part in first["loc"]) or "reply"
        detail = f"{where}: {describe_fault(first)}"
        rejection = Rejection(stage=stage, code="malformed_reply", detail=detail)
        raise Rejected(_prefix_detail(rejection, of)) from error
    except Rejected as error:
        raise Rejected(_prefix_detail(error.rejection, of)) from error


def _prefix_detail(rejection: Rejection, of: str) -> Rejection:
    return rejection.model_copy(update={"detail": of + rejection.detail})


def list_stage_faults(rejections: list[Rejection], stage: Stage) -> tuple[str, ...]:
    """What was wrong with this stage's answers so far, wherever it was found."""
    codes = MISPLANNED if stage == "scene_planner" else ()
    return tuple(
        rejection.detail
        for rejection in rejections
        if rejection.stage == stage or rejection.code in codes
    )


def list_latest_rejections(rejections: list[Rejection], *stages: Stage) -> tuple[Rejection, ...]:
    """The last refusals in a row that are of these stages, oldest first.

    One that no answer could have mended ends the row: what was asked about is no longer there.
    """
    found: list[Rejection] = []
    for rejection in reversed(rejections):
        if rejection.stage not in stages or not rejection.repairable:
            break
        found.insert(0, rejection)
    return tuple(found)
