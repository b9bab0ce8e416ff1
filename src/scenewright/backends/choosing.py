"""From the names that a user gives to the backends that answer, one for all stages or one each."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from scenewright.backends import BACKENDS, TASKS, Backend, Named, Question, Task, map_task
from scenewright.errors import InputError


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


STAGES: dict[str, tuple[Task, ...]] = {
    "planner": ("plan",),
    "filter": ("constraints",),
    "reasoner": ("behavior",),
}
DEFAULT = "builtin"


def choose_backend(
    name: Named,
    *,
    base_url: str | None = None,
    record: str | Path | None = None,
    timeout: float | None = None,
) -> Backend:
    """The backend, or one per stage (see `load_backend`)."""
    names = _parse_by_task(name)
    models = [each for each in names.values() if isinstance(each, str)]
    if base_url is not None and not any(model.startswith("openai:") for model in models):
        raise InputError(
            "--base-url is where an OpenAI-compatible model is reached; name one, as openai:MODEL"
        )
    made: dict[str, Mapping[Task, Backend]] = {}
    speakers: dict[Task, Backend] = {}
    for task, each in names.items():
        if not isinstance(each, str):
            speakers[task] = each
            continue
        if each not in made:
            made[each] = _make_backend(each, base_url=base_url, timeout=timeout)
        speakers[task] = made[each][task]
    if record is not None:
        from scenewright.backends.recorded import record_answers

        speakers = record_answers(speakers, record)
    only = set(map(id, speakers.values()))
    return speakers[TASKS[0]] if len(only) == 1 else StagedBackend(speakers)


def _parse_by_task(name: Named) -> dict[Task, str | Backend]:
    """Task -> its backend."""
    if isinstance(name, Mapping):
        pairs: list[tuple[str | None, str | Backend]] = [*name.items()]
    else:
        pairs = [_pair(each) for each in ([name] if isinstance(name, str) else name)]
    plain = [each for stage, each in pairs if stage is None]
    if len(plain) > 1:
        raise InputError(
            f"two backends for everything: {plain[0]} and {plain[1]}; name the stage of one, such "
            "as planner=NAME"
        )
    found: dict[Task, str | Backend] = dict.fromkeys(TASKS, plain[0] if plain else DEFAULT)
    seen: set[str] = set()
    for stage, each in pairs:
        if stage is None:
            continue
        if stage not in STAGES:
            raise InputError(f"there is no stage {stage!r} to ask; there are {', '.join(STAGES)}")
        if stage in seen:
            raise InputError(f"two backends for the stage {stage}; name one")
        seen.add(stage)
        found.update(dict.fromkeys(STAGES[stage], each))
    return found


def _pair(text: str) -> tuple[str | None, str]:
    """ "planner=openai:x" as stage and name; a name alone may hold "=", as files do."""
    stage, equals, name = text.partition("=")
    if equals and ":" not in stage:
        return stage.strip(), name.strip()
    return None, text.strip()


def _make_backend(
    name: str, *, base_url: str | None, timeout: float | None
) -> Mapping[Task, Backend]:
    """A backend by its name, for every task."""
    if name == DEFAULT:
        from scenewright.backends.builtin.backend import BuiltinBackend

        return dict.fromkeys(TASKS, BuiltinBackend())
    if name.startswith("recorded:"):
        from scenewright.backends.recorded import replay_answers

        return replay_answers(name.removeprefix("recorded:"))
    if name.startswith("vllm:"):
        from scenewright.backends.engine import Engine
        from scenewright.backends.text_backend import TextBackend

        return dict.fromkeys(TASKS, TextBackend(Engine(name.removeprefix("vllm:"))))
    if ":" not in name:
        known = ", ".join(BACKENDS)
        raise InputError(f"there is no backend {name!r}; choose one of: {known}")
    from scenewright.backends.chat.model import ChatModel, Limits
    from scenewright.backends.chat.naming import load_chat_model
    from scenewright.backends.text_backend import TextBackend

    if timeout is not None and not 0.1 <= timeout <= 3600.0:
        raise InputError(f"a timeout is 0.1 to 3600 seconds, got {timeout:g}")
    limits = Limits() if timeout is None else Limits(timeout=timeout)
    # An endpoint of the user's own serves the models named openai:...; others have their own.
    theirs = base_url if name.startswith("openai:") else None
    endpoint = load_chat_model(
        name, base_url=theirs, timeout=limits.timeout, max_tokens=limits.tokens
    )
    return dict.fromkeys(TASKS, TextBackend(ChatModel(endpoint, limits=limits)))
