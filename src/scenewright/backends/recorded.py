"""Answers kept in a file, and answers given from it: a run is replayed bit for bit.

The file is JSON lines: a head that names the model of each task, then one line per answer with the
key of its question (model, prompt, schema and seed). Each line is appended whole, under a lock, so
that several runs may share a file and one that is killed costs at most its own last line.
"""

from __future__ import annotations

import json
import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any, Literal

from pydantic import BaseModel, ConfigDict, ValidationError

from scenewright.backends import TASKS, Backend, Prompt, Question, Task
from scenewright.backends.text_backend import Completion, TextBackend, TextModel, compute_key
from scenewright.errors import BackendFault, InputError

FORMAT: Literal["scenewright answers"] = "scenewright answers"
_MOST_BYTES = 512_000_000


class ModelIdentity(BaseModel):
    """The model that answers a task."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    name: str
    deterministic: bool


class AnswersHead(BaseModel):
    """The first line of a file of answers."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    format: Literal["scenewright answers"] = FORMAT
    version: Literal[1] = 1
    speakers: dict[Task, ModelIdentity]


class Answer(BaseModel):
    """One line: a question and what was said to it.

    Attributes:
        reply: as it came; fault: why it is none whatever it says.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    key: str
    task: Task
    model: str
    seed: int
    system: str
    user: str
    schema_: dict[str, Any] = {}
    reply: str
    fault: str | None = None
    input_tokens: int | None = None
    output_tokens: int | None = None

    def to_completion(self) -> Completion:
        """What was said."""
        return Completion(
            self.reply,
            fault=self.fault,
            asked=0,
            input_tokens=self.input_tokens,
            output_tokens=self.output_tokens,
        )


class Answers:
    """A file of answers, read once and appended to."""

    def __init__(self, path: str | Path, head: AnswersHead) -> None:
        self.path, self.head = Path(path), head
        self._known: dict[str, Answer] = {}
        self._lock = threading.Lock()

    @classmethod
    def read(cls, path: str | Path) -> Answers:
        """The answers in a file.

        Raises:
            InputError: it is missing, unreadable or no file of answers; says which line.
        """
        head, answers = _parse_answers(Path(path))
        if head is None:
            raise InputError(f"{path} holds no recorded answers")
        found = cls(path, head)
        found._known = {answer.key: answer for answer in answers}
        return found

    @classmethod
    def open_or_create(cls, path: str | Path, head: AnswersHead) -> Answers:
        """The answers in a file, which is made if it is not there.

        Raises:
            InputError: it cannot be written, or holds the answers of another model.
        """
        target = Path(path)
        try:
            if not target.exists():
                _append(target, head, only_if_empty=True)
        except OSError as error:
            raise InputError(f"cannot write {path}: {error.strerror or error}") from error
        found = cls.read(path)
        if _list_asked_tasks(found.head) != _list_asked_tasks(head):
            raise InputError(
                f"{path} holds the answers of {_format_names(found.head)}, "
                f"not of {_format_names(head)}; "
                "name another file"
            )
        return found

    def get(self, key: str) -> Answer | None:
        """The answer to the question with this key."""
        with self._lock:
            return self._known.get(key)

    def add(self, answer: Answer) -> None:
        """Keeps an answer, at once and whole.

        Raises:
            InputError: the file cannot be written.
        """
        with self._lock:
            if answer.key in self._known:
                return
            try:
                _append(self.path, answer)
            except OSError as error:
                raise InputError(f"cannot write {self.path}: {error.strerror or error}") from error
            self._known[answer.key] = answer


class AnswerRecorder:
    """A model whose answers are recorded; answers already in the file are reused."""

    def __init__(self, text_model: TextModel, answers: Answers, *, by_facts: bool = False) -> None:
        self.name = text_model.name
        self._text_model, self._answers, self._by_facts = text_model, answers, by_facts

    def complete(self, question: Question, prompt: Prompt) -> Completion:
        """The reply (see `TextModel`)."""
        key = compute_key(self.name, question, prompt, by_facts=self._by_facts)
        known = self._answers.get(key)
        if known is not None:
            return known.to_completion()
        said = self._text_model.complete(question, prompt)
        self._answers.add(
            Answer(
                key=key, task=question.task, model=self.name, seed=question.seed,
                system=prompt.system, user=prompt.user, schema_=prompt.schema,
                reply=said.text, fault=said.fault,
                input_tokens=said.input_tokens, output_tokens=said.output_tokens,
            )
        )  # fmt: skip
        return said


class ReplaySource:
    """Says what a file holds, and nothing else."""

    def __init__(self, name: str, answers: Answers, *, by_facts: bool = False) -> None:
        self.name = name
        self._answers, self._by_facts = answers, by_facts

    def complete(self, question: Question, prompt: Prompt) -> Completion:
        """The recorded reply (see `TextModel`)."""
        key = compute_key(self.name, question, prompt, by_facts=self._by_facts)
        known = self._answers.get(key)
        if known is None:
            raise BackendFault(
                f"{self._answers.path} holds no answer to this {question.task} question of seed "
                f"{question.seed}; record it with the same request, seed, intersection and version",
                final=True,
            )
        return known.to_completion()


class _BackendAsModel:
    """A backend of rules as a text_model: its answers as text, exact to the bit."""

    def __init__(self, backend: Backend) -> None:
        self.name = backend.name
        self._backend = backend

    def complete(self, question: Question, prompt: Prompt) -> Completion:
        """The reply (see `TextModel`)."""
        del prompt
        return Completion(json.dumps(self._backend.answer(question), ensure_ascii=False))


class _ReplayBackend(TextBackend):
    """A model that replays the recorded answers of another."""

    def __init__(self, text_model: TextModel, *, deterministic: bool) -> None:
        super().__init__(text_model)
        self.deterministic = deterministic


def record_answers(speakers: Mapping[Task, Backend], path: str | Path) -> dict[Task, Backend]:
    """The backends, by task, with every answer kept in the file.

    Raises:
        InputError: the file cannot be used.
    """
    identities = {
        task: ModelIdentity(name=each.name, deterministic=each.deterministic)
        for task, each in speakers.items()
    }
    answers = Answers.open_or_create(path, AnswersHead(speakers=identities))
    found: dict[Task, Backend] = {}
    for task, each in speakers.items():
        rule = each.deterministic
        model: TextModel
        model = each.text_model if isinstance(each, TextBackend) else _BackendAsModel(each)
        kept = AnswerRecorder(model, answers, by_facts=rule)
        found[task] = _ReplayBackend(kept, deterministic=rule)
    return found


def replay_answers(path: str | Path) -> dict[Task, Backend]:
    """Backends, by task, that answer as those did whose answers the file holds.

    Raises:
        InputError: there is no such file, or it is none of answers.
    """
    answers = Answers.read(path)
    found: dict[Task, Backend] = {}
    for task, identity in answers.head.speakers.items():
        replay = ReplaySource(identity.name, answers, by_facts=identity.deterministic)
        found[task] = _ReplayBackend(replay, deterministic=identity.deterministic)
    return found


def _parse_answers(path: Path) -> tuple[AnswersHead | None, list[Answer]]:
    try:
        if path.stat().st_size > _MOST_BYTES or not path.is_file():
            raise InputError(f"cannot read {path}: no file of answers, or a larger one than 512 MB")
        text = path.read_bytes().decode("utf-8")
    except OSError as error:
        raise InputError(f"cannot read {path}: {error.strerror or error}") from error
    except UnicodeDecodeError as error:
        raise InputError(f"{path} holds no recorded answers: not UTF-8") from error
    # What follows the last end of line was cut off while it was written.
    lines = text.split("\n")[:-1]
    head, answers = None, []
    for number, line in enumerate(lines, start=1):
        try:
            if number == 1:
                head = AnswersHead.model_validate_json(line)
            elif line.strip():
                answers.append(Answer.model_validate_json(line))
        except ValidationError as error:
            first = error.errors(include_url=False)[0]
            raise InputError(
                f"{path}, line {number}: no recorded answer: {first['msg'][:120]}"
            ) from None
    if head is not None and not set(TASKS) <= set(head.speakers):
        raise InputError(f"{path}, line 1: does not say who answers {', '.join(TASKS)}")
    return head, answers


def _append(path: Path, value: BaseModel, *, only_if_empty: bool = False) -> None:
    """Adds a whole line, after cutting off one that was never finished."""
    data = json.dumps(value.model_dump(mode="json"), ensure_ascii=False) + "\n"
    with path.open("a+b") as file, _lock(file):
        end = file.seek(0, 2)
        if only_if_empty and end:
            return
        file.seek(max(end - 1, 0))
        if end and file.read(1) != b"\n":
            file.seek(0)
            file.truncate(file.read().rfind(b"\n") + 1)
        file.write(data.encode("utf-8", "backslashreplace"))
        file.flush()


@contextmanager
def _lock(file: IO[bytes]) -> Iterator[None]:
    """Alone with the file, on systems that know such locks."""
    try:
        import fcntl
    except ImportError:
        yield
        return
    fcntl.flock(file, fcntl.LOCK_EX)
    try:
        yield
    finally:
        fcntl.flock(file, fcntl.LOCK_UN)


def _list_asked_tasks(head: AnswersHead) -> dict[Task, ModelIdentity]:
    """Models of the tasks that are still asked: files of earlier versions name one more."""
    return {task: head.speakers[task] for task in TASKS}


def _format_names(head: AnswersHead) -> str:
    return ", ".join(dict.fromkeys(speaker.name for speaker in head.speakers.values()))
