"""Backends that answer the pipeline's questions: a trained reader, a model, a file of answers.

`builtin` is the reader, `chat` any chat model that LangChain reaches, `engine` a model that vLLM
runs in this process, `recorded` answers from a file, `scripted` says what it is handed. `spoken`
turns a text model into a backend, `staged` has one backend per stage.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal, Protocol

from scenewright.scene.rejection import Stage
from scenewright.scene.social import SocialGraph

Task = Literal["plan", "constraints", "summary", "behavior", "edits"]
TASKS: tuple[Task, ...] = ("plan", "constraints", "behavior")
"""What a scene is asked for. `edits`, a turn of a conversation, goes to the backend that plans;
`summary` was asked by earlier versions, and stands in their recorded answers."""

STAGE_OF: dict[Task, Stage] = {
    "plan": "scene_planner",
    "constraints": "waypoint_filter",
    "summary": "event_reasoner",
    "behavior": "event_reasoner",
    "edits": "scene_planner",
}
BACKENDS = ("builtin", "anthropic:MODEL", "openai:MODEL", "vllm:MODEL", "recorded:FILE")


@dataclass(frozen=True)
class Prompt:
    """A question in words, as a language model is sent it.

    Attributes:
        system: the task and its rules; user: the facts, and why earlier answers were refused.
        schema: JSON schema of the reply, made for this scene.
    """

    system: str
    user: str
    schema: dict[str, Any]


@dataclass(frozen=True)
class Call:
    """One answer of a model, or a question that it left open, for the provenance.

    Attributes:
        asked: how often the request was sent until it was answered; 0: answered from memory.
        seconds: wall time of all of that; tokens are None if not counted.
        prompt: fingerprint of what was asked.
        answered: whether there was a reply, be it of use or not.
    """

    task: Task
    model: str
    asked: int
    seconds: float
    input_tokens: int | None
    output_tokens: int | None
    prompt: str
    answered: bool = True


def _raise_no_prompt() -> Prompt:
    raise TypeError("this question has no words; only the builtin planner can answer it")


Account = Callable[[Call], None]


def ignore_account(_: Call) -> None:
    """Ignore what an answer has cost."""


@dataclass(frozen=True)
class Question:
    """What a stage asks.

    Attributes:
        task: which reply is wanted.
        facts: everything the answer may build on, as plain JSON values.
        rejections: why earlier answers to the same question were refused, oldest first.
        seed: of the run, for models that can be given one.
        prompt: renders the prompt, for text models.
        account: called with the cost of an answer.
        can_serve: whether the map has ways for a graph; it decides between readings of a text.
    """

    task: Task
    facts: dict[str, Any]
    rejections: tuple[str, ...] = field(default=())
    seed: int = 0
    prompt: Callable[[], Prompt] = field(default=_raise_no_prompt, compare=False, repr=False)
    account: Account = field(default=ignore_account, compare=False, repr=False)
    can_serve: Callable[[SocialGraph], bool] | None = field(default=None, compare=False, repr=False)


class Backend(Protocol):
    """Answers questions with plain JSON values; never with coordinates.

    Attributes:
        name: for provenance.
        deterministic: the same question always gets the same answer, so asking again is idle.
    """

    name: str
    deterministic: bool

    def answer(self, question: Question) -> dict[str, Any]:
        """Return the reply to a question, to be validated by the caller.

        Raises:
            Rejected: the text is no answer; the retry's prompt says why.
            BackendFault: the backend cannot answer at all.
        """


Named = str | Sequence[str] | Mapping[str, "str | Backend"]


def load_backend(
    name: Named = "builtin",
    *,
    base_url: str | None = None,
    record: str | Path | None = None,
    timeout: float | None = None,
) -> Backend:
    """The backend of that name.

    Args:
        name: one of BACKENDS (docs/backends.md); or one per stage, as a
            mapping {"planner": ...} or as texts "planner=...". The stages are planner, filter
            and reasoner; stages not named are `builtin`, or the one text without a stage.
        base_url: of an OpenAI-compatible endpoint, such as a server of one's own.
        record: file to keep every answer in; what it holds already is not asked again.
        timeout: longest wait for one reply [s].

    Raises:
        InputError: no such backend, or one that lacks its package, its key or its file.
    """
    if name == "builtin" and record is None and base_url is None:
        from scenewright.backends.builtin.backend import BuiltinBackend

        return BuiltinBackend()
    from scenewright.backends.choosing import choose_backend

    return choose_backend(name, base_url=base_url, record=record, timeout=timeout)


def get_backend_of_task(backend: Backend, task: Task) -> Backend:
    """The backend for questions of a task: a backend may combine several, one per stage."""
    speakers: Mapping[Task, Backend] | None = getattr(backend, "by_task", None)
    return backend if speakers is None else speakers[map_task(task)]


def map_task(task: Task) -> Task:
    """The task by which the backend is chosen: edits are planning."""
    return "plan" if task == "edits" else task
