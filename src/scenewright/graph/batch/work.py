"""One row's scene: what a worker does, wherever it runs. It writes nothing."""

from __future__ import annotations

import json
import os
import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from typing import Any, Literal

from scenewright.backends import Backend, Question, load_backend
from scenewright.errors import BackendFault, InputError, Unsatisfiable
from scenewright.graph.batch.rows import Named, seed_of

Status = Literal["made", "refused", "failed"]
FILES = ("provenance.json", "proof.json", "scene.json")
"""What a row's folder holds."""
_LONGEST_REASON = 600


@dataclass(frozen=True)
class Options:
    """What all rows of a run share: with the input, it decides every byte of the scenes.

    Attributes:
        base_url: of the endpoint that serves the backend's model, where it has one.
    """

    intersection: str
    backend: str = "builtin"
    refiner: str = "none"
    selection: Literal["draw", "map"] = "draw"
    seed: int = 0
    base_url: str | None = None


@dataclass(frozen=True)
class Job:
    """One row as a worker needs it.

    Attributes:
        number: of the row; key: a name for it that is its own: the row's id.
        context: the scene's context as far as the row sets it.
        asked: the event that an order wants; None where nobody said.
    """

    number: int
    key: str
    folder: str
    text: str
    seed: int
    intersection: str
    backend: str
    refiner: str
    selection: Literal["draw", "map"]
    context: Mapping[str, Any] = field(default_factory=dict)
    asked: str | None = None
    base_url: str | None = None


@dataclass(frozen=True)
class Outcome:
    """What became of a row.

    Attributes:
        status: `refused` will be so again; `failed` may not: the same command tries it again.
        code, reason: why there is no scene.
        files: name -> bytes of a scene's folder.
        attempts: how many times the pipeline began anew; seconds: it took.
    """

    status: Status
    code: str | None = None
    reason: str | None = None
    files: Mapping[str, bytes] = field(default_factory=dict)
    attempts: int = 1
    seconds: float = 0.0


def job_of(named: Named, options: Options) -> Job:
    """The job that a row amounts to."""
    row, own = named.row, named.row.overrides
    return Job(
        number=named.number,
        key=row.id,
        folder=named.folder,
        text=row.text,
        seed=seed_of(row, seed=options.seed),
        intersection=own.intersection or options.intersection,
        backend=options.backend,
        refiner=own.refiner or options.refiner,
        selection=own.selection or options.selection,
        context=own.context,
        base_url=options.base_url,
    )


def work(job: Job) -> Outcome:
    """The scene of a job, or why there is none; never an exception, for other rows wait."""
    start = time.perf_counter()
    outcome = _outcome(job)
    seconds = round(time.perf_counter() - start, 4)
    return Outcome(
        outcome.status, outcome.code, _short(outcome.reason), outcome.files, outcome.attempts,
        seconds,
    )  # fmt: skip


def _outcome(job: Job) -> Outcome:
    try:
        return _made(job)
    except InputError as error:
        return Outcome("refused", "unusable_input", str(error))
    except Unsatisfiable as error:
        codes = [each.code for each in error.rejections]
        code = codes[-1] if codes else "unsatisfiable"
        return Outcome("refused", code, str(error), attempts=max(len(codes), 1))
    except BackendFault as error:
        return Outcome("failed", "backend_failed", str(error))
    except MemoryError:
        return Outcome("failed", "out_of_memory", "there was not enough memory for this row")
    except Exception as error:
        # A bug that one text brings out must not cost the other rows.
        if os.environ.get("SCENEWRIGHT_TRACEBACK"):
            raise
        reason = f"this is a fault in scenewright: {type(error).__name__}: {error}"
        return Outcome("failed", "internal_error", reason)


def _made(job: Job) -> Outcome:
    from scenewright.graph.run import scene_bytes, synthesize

    backend = _backend(job.backend, job.base_url)
    scene = synthesize(
        job.text,
        intersection=job.intersection,
        backend=_Overriding(backend, job.context) if job.context else backend,
        seed=job.seed,
        refiner=job.refiner,
        selection=job.selection,
    )
    # Seconds differ from run to run and would make every file differ; the journal has them.
    about = timeless(scene.provenance)
    files = {
        "provenance.json": json_bytes({**about, "row": job.key, "overrides": dict(job.context)}),
        "proof.json": json_bytes(scene.proof.model_dump(mode="json", by_alias=True)),
        "scene.json": scene_bytes(scene.record),
    }
    return Outcome("made", files=files, attempts=1 + len(scene.provenance["rejections"]))


def timeless(value: Any) -> Any:
    """Plain JSON without anything called seconds, however deep."""
    if isinstance(value, Mapping):
        return {key: timeless(each) for key, each in value.items() if key != "seconds"}
    if isinstance(value, list | tuple):
        return [timeless(each) for each in value]
    return value


@cache
def _backend(name: str, base_url: str | None) -> Backend:
    """The backend of a worker, made once."""
    return speaking(name, base_url)


def speaking(name: str, base_url: str | None) -> Backend:
    """The backend of that name; InputError for one that does not exist."""
    return load_backend(name) if base_url is None else load_backend(name, base_url=base_url)


class _Overriding:
    """A backend whose plans have parts of their context replaced."""

    def __init__(self, backend: Backend, context: Mapping[str, Any]) -> None:
        self.name, self.deterministic = backend.name, backend.deterministic
        self._backend, self._context = backend, dict(context)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._backend, name)

    def answer(self, question: Question) -> dict[str, Any]:
        """The backend's reply; a plan's context as the row has it."""
        reply = self._backend.answer(question)
        if question.task != "plan" or not isinstance(reply, dict) or "agents" not in reply:
            return reply
        return {**reply, "context": {**(reply.get("context") or {}), **self._context}}


def json_bytes(value: Any) -> bytes:
    """A value as one line of JSON: the same value, the same bytes."""
    text = json.dumps(value, ensure_ascii=False, separators=(",", ":"), allow_nan=False)
    return (text + "\n").encode("utf-8", "backslashreplace")


def _short(reason: str | None) -> str | None:
    if reason is None:
        return None
    line = " ".join(reason.split())
    return line if len(line) <= _LONGEST_REASON else line[: _LONGEST_REASON - 1] + "…"
