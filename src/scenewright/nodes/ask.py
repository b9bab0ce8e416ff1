"""The only place where a backend is asked."""

from __future__ import annotations

from typing import TypeVar

from pydantic import BaseModel, ValidationError

from scenewright.backends import Backend, Question
from scenewright.errors import Rejected
from scenewright.scene.rejection import Rejection, Stage

ReplyT = TypeVar("ReplyT", bound=BaseModel)


def ask(backend: Backend, question: Question, reply: type[ReplyT], *, stage: Stage) -> ReplyT:
    """The backend's answer as a reply model.

    Raises:
        Rejected: `malformed_reply` with the first thing wrong, for the retry to repair.
        BackendFault: the backend cannot answer.
    """
    try:
        return reply.model_validate(backend.answer(question))
    except ValidationError as error:
        raise Rejected(_malformed(error, stage)) from error


def earlier(rejections: list[Rejection], stage: Stage) -> tuple[str, ...]:
    """What was wrong with this stage's answers so far."""
    return tuple(each.detail for each in rejections if each.stage == stage)


def _malformed(error: ValidationError, stage: Stage) -> Rejection:
    first = error.errors(include_url=False)[0]
    where = ".".join(str(part) for part in first["loc"]) or "reply"
    return Rejection(stage=stage, code="malformed_reply", detail=f"{where}: {first['msg']}")
