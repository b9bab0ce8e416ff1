"""Who answers the four questions of the pipeline: a grammar, or any language model."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Literal, Protocol

from scenewright.errors import InputError

Task = Literal["plan", "constraints", "behavior"]
BACKENDS = ("builtin",)


@dataclass(frozen=True)
class Question:
    """What a stage asks.

    Attributes:
        task: which reply is wanted.
        facts: everything the answer may build on, as plain JSON values.
        rejections: why earlier answers to the same question were refused, oldest first.
    """

    task: Task
    facts: dict[str, Any]
    rejections: tuple[str, ...] = field(default=())


class Backend(Protocol):
    """Answers questions with plain JSON values; never with coordinates.

    Attributes:
        name: for provenance.
        deterministic: the same question always gets the same answer, so asking again is idle.
    """

    name: str
    deterministic: bool

    def answer(self, question: Question) -> dict[str, Any]:
        """The reply to a question, to be validated by whoever asked.

        Raises:
            BackendFault: the backend cannot answer at all.
        """


def load_backend(name: str = "builtin") -> Backend:
    """The backend of that name; InputError for a name that does not exist."""
    if name != "builtin":
        raise InputError(f"there is no backend {name!r}; choose one of: {', '.join(BACKENDS)}")
    from scenewright.backends.builtin.backend import BuiltinBackend

    return BuiltinBackend()
