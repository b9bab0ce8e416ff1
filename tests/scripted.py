"""Answers handed out in order: the whole machine runs on it without a model."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping
from typing import Any

from scenewright.backends import Prompt, Question, Task
from scenewright.backends.text_backend import Completion, TextBackend
from scenewright.errors import BackendFault

Script = (
    str | dict[str, Any] | Completion | Callable[[Question], "str | dict[str, Any] | Completion"]
)
"""A reply as text, as the object that it holds, or made for the question."""


class ScriptedModel:
    """Says what it was handed for a task, in order; the last is said for good if `forever`.

    Attributes:
        asked: every question so far, with its words.
    """

    def __init__(
        self,
        replies: Mapping[Task, Iterable[Script]],
        *,
        name: str = "scripted",
        forever: bool = False,
    ) -> None:
        self.name = name
        self.asked: list[tuple[Question, Prompt]] = []
        self._replies = {task: list(each) for task, each in replies.items()}
        self._forever = forever

    def complete(self, question: Question, prompt: Prompt) -> Completion:
        """The next reply (see `TextModel`)."""
        self.asked.append((question, prompt))
        left = self._replies.get(question.task, [])
        if not left:
            raise BackendFault(f"the script has no answer left for {question.task}", final=True)
        reply = left[0] if self._forever and len(left) == 1 else left.pop(0)
        made = reply(question) if callable(reply) else reply
        if isinstance(made, Completion):
            return made
        return Completion(made if isinstance(made, str) else json.dumps(made, ensure_ascii=False))


def build_scripted_backend(
    replies: Mapping[Task, Iterable[Script]], *, name: str = "scripted", forever: bool = False
) -> TextBackend:
    """A backend that gives the replies it is handed, read as those of a model are."""
    return TextBackend(ScriptedModel(replies, name=name, forever=forever))
