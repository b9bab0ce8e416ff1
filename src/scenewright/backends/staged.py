"""One backend per stage."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from scenewright.backends import TASKS, Backend, Question, Task, map_task


class Staged:
    """Hands every question to the backend of its stage.

    Attributes:
        speakers: task -> who answers it; every task has one.
    """

    def __init__(self, speakers: Mapping[Task, Backend]) -> None:
        self.speakers = dict(speakers)
        self.name = _name(self.speakers)
        self.deterministic = all(each.deterministic for each in self.speakers.values())

    def answer(self, question: Question) -> dict[str, Any]:
        """Return the reply of the task's backend (see `Backend`)."""
        return self.speakers[map_task(question.task)].answer(question)


def _name(speakers: Mapping[Task, Backend]) -> str:
    """One name if there is but one, else each with its task."""
    names = [speakers[task].name for task in TASKS]
    if len(set(names)) == 1:
        return names[0]
    return ", ".join(f"{task}={name}" for task, name in zip(TASKS, names, strict=True))
