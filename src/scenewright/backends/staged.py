"""One backend per stage."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from scenewright.backends import TASKS, Backend, Question, Task, map_task


class StagedBackend:
    """Hands every question to the backend of its stage.

    Attributes:
        by_task: task -> its backend; every task has one.
    """

    def __init__(self, by_task: Mapping[Task, Backend]) -> None:
        self.by_task = dict(by_task)
        names = [self.by_task[task].name for task in TASKS]
        each = (f"{task}={name}" for task, name in zip(TASKS, names, strict=True))
        self.name = names[0] if len(set(names)) == 1 else ", ".join(each)
        self.deterministic = all(each.deterministic for each in self.by_task.values())

    def answer(self, question: Question) -> dict[str, Any]:
        """Return the reply of the task's backend (see `Backend`)."""
        return self.by_task[map_task(question.task)].answer(question)
