"""One row's scene: what a worker does, wherever it runs. It writes nothing."""

from __future__ import annotations

import os
import time
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from functools import cache
from typing import Any, Literal

from scenewright.backends import Backend, Question
from scenewright.dataset.batch.answering import (
    BUILTIN,
    PLAINLY,
    Asking,
    Names,
    WrappedBackend,
    load_speaking_backend,
)
from scenewright.dataset.batch.rows import Named, choose_seed
from scenewright.dataset.tables.splits import Split
from scenewright.errors import BackendFault, InputError, OutOfTime, Unsatisfiable
from scenewright.files import format_json_line
from scenewright.graph.arguments import choose_max_agents
from scenewright.scene.plan_fields import word_plan
from scenewright.scene.plan_file import PlanFile
from scenewright.scene.rejection import SEARCHED
from scenewright.time_limit import DEFAULT_LIMIT

Status = Literal["made", "refused", "failed"]
FILES = ("provenance.json", "proof.json", "scene.json")
"""What a row's folder holds."""
PAID = ("requests", "input_tokens", "output_tokens")
"""What is counted of models, over the questions of a row."""
_LONGEST_REASON = 600


@dataclass(frozen=True)
class Options:
    """What all rows of a run share: with the input, it decides every byte of the scenes.

    Attributes:
        backend: the backend or backends, as the command line names them.
        base_url: of the endpoint that serves the backend's model, where it has one.
        lenient: words that cannot be realised are left out and listed, not refused.
        max_agents: most agents of a scene; what the environment says where none is named, so that
            the dataset's own files say; None for as many as the time of day has.
        lawful: a scene in which an agent runs a red light unasked is refused.
        draws: seeds that a row is tried with, one after the other, as long as none finds a scene.
        time_limit: the emergency brake: longest that a scene may be computed [s]; it may change
            from run to run, as it never changes a scene.
    """

    intersection: str
    backend: Names = BUILTIN
    refiner: str = "none"
    selection: Literal["draw", "map"] = "draw"
    seed: int = 0
    base_url: str | None = None
    lenient: bool = False
    max_agents: int | None = None
    lawful: bool = False
    draws: int = 1
    time_limit: float = DEFAULT_LIMIT

    def __post_init__(self) -> None:
        object.__setattr__(self, "max_agents", choose_max_agents(self.max_agents))

    def list_settings(self) -> dict[str, Any]:
        """As plain JSON."""
        found = {**asdict(self), "backend": ", ".join(self.backend)}
        # A dataset begun before these were there must go on.
        unset = {name for name in ("lenient", "lawful", "max_agents") if not found[name]}
        unset |= {"draws"} if self.draws == 1 else set()
        return {name: each for name, each in found.items() if name not in {*unset, "time_limit"}}


@dataclass(frozen=True)
class Job:
    """One row as a worker needs it.

    Attributes:
        number: of the row; key: a name for it that is its own: the row's id.
        seed: of the scene; options: the run's, with what the row has in their place.
        context: the scene's context as far as the row sets it.
        asked: the event that an order wants; None if not given.
        voice: the template or model that worded the text, if known.
        wanted: patterns that may play the event asked for, none for normal scenes; a scene of
            another event or pattern is refused. None where anything goes.
        split: of the dataset, where it does not follow from the text.
        plan: what the scene is made from in place of the text.
        asking: how questions are put, which changes no scene.
    """

    number: int
    key: str
    folder: str
    text: str
    seed: int
    options: Options
    context: Mapping[str, Any] = field(default_factory=dict)
    asked: str | None = None
    voice: str | None = None
    wanted: tuple[str, ...] | None = None
    split: Split | None = None
    asking: Asking = PLAINLY
    plan: PlanFile | None = None


@dataclass(frozen=True)
class Outcome:
    """What became of a row.

    Attributes:
        status: `refused` will be so again; `failed` may not: the same command tries it again.
        code, reason: why there is no scene.
        files: name -> bytes of a scene's folder.
        attempts: how many times the pipeline began anew; seconds: it took.
        paid: requests to models and their tokens, as far as they were counted.
    """

    status: Status
    code: str | None = None
    reason: str | None = None
    files: Mapping[str, bytes] = field(default_factory=dict)
    attempts: int = 1
    seconds: float = 0.0
    paid: Mapping[str, int] = field(default_factory=dict)


def build_job(named: Named, options: Options, asking: Asking) -> Job:
    """The job that a row amounts to."""
    row, own = named.row, named.row.overrides
    places = {name: getattr(own, name) for name in ("intersection", "refiner", "selection")}
    return Job(
        number=named.number, key=row.id, folder=named.folder,
        text=row.text if named.plan is None else word_plan(named.plan)[0],
        seed=choose_seed(row, seed=options.seed), voice=row.voice, plan=named.plan,
        options=replace(options, **{name: each for name, each in places.items() if each}),
        context=own.context, asking=asking,
    )  # fmt: skip


def work(job: Job) -> Outcome:
    """The scene of a job, or why there is none; never an exception, for other rows wait."""
    start = time.perf_counter()
    outcome = _run_job(job)
    for n in range(1, job.options.draws):
        if outcome.code not in SEARCHED:
            break
        outcome = _run_job(replace(job, seed=job.seed ^ n))
    seconds = round(time.perf_counter() - start, 4)
    reason = None if outcome.reason is None else " ".join(outcome.reason.split())
    if reason is not None and len(reason) > _LONGEST_REASON:
        reason = reason[: _LONGEST_REASON - 1] + "…"
    return replace(outcome, reason=reason, seconds=seconds)


def _run_job(job: Job) -> Outcome:
    try:
        return _make_scene(job)
    except InputError as error:
        return Outcome("refused", error.code, str(error), paid=_sum_paid(error.models))
    except OutOfTime as error:
        attempts = max(len(error.rejections), 1)
        paid = _sum_paid(error.models)
        return Outcome("failed", "time_limit", str(error), attempts=attempts, paid=paid)
    except Unsatisfiable as error:
        codes = [rejection.code for rejection in error.rejections]
        code = codes[-1] if codes else error.code
        attempts = max(len(codes), 1)
        return Outcome("refused", code, str(error), attempts=attempts, paid=_sum_paid(error.models))
    except BackendFault as error:
        return Outcome("failed", error.code, str(error), paid=_sum_paid(error.models))
    except MemoryError:
        return Outcome("failed", "out_of_memory", "there was not enough memory for this row")
    except Exception as error:
        # A bug that one text brings out must not cost the other rows.
        if os.environ.get("SCENEWRIGHT_TRACEBACK"):
            raise
        reason = f"this is a fault in scenewright: {type(error).__name__}: {error}"
        return Outcome("failed", "internal_error", reason)


def _make_scene(job: Job) -> Outcome:
    from scenewright.graph.run import synthesize
    from scenewright.graph.scene_files import encode_proof, encode_scene

    shared = {name: each for name, each in vars(job.options).items() if name != "draws"}
    backend = _load_backend(shared.pop("backend"), shared.pop("base_url"), job.asking)
    scene = synthesize(
        job.text if job.plan is None else job.plan,
        backend=_Overriding(backend, job.context) if job.context else backend,
        **shared | {"seed": job.seed},
    )
    attempts = 1 + len(scene.provenance["rejections"])
    paid = _sum_paid(scene.provenance.get("models", {}))
    shown = [relation.type for relation in scene.record.relations]
    leaves = set(scene.provenance["patterns"])
    if job.wanted is not None and (
        shown != ([] if job.asked == "normal" else [job.asked]) or not leaves <= set(job.wanted)
    ):
        reason = f"the scene shows {', '.join(map(str, shown)) or 'no event'}: {sorted(leaves)}"
        return Outcome("refused", "another_event", reason, attempts=attempts, paid=paid)
    # What differs from run to run would make every file differ; the journal has it.
    about = drop_times(scene.provenance)
    files = {
        "provenance.json": format_json_line(
            {**about, "row": job.key, "overrides": dict(job.context)}
        ),
        "proof.json": encode_proof(scene.proof),
        "scene.json": encode_scene(scene.record),
    }
    return Outcome("made", files=files, attempts=attempts, paid=paid)


_FLEETING = ("seconds", *PAID)
"""What a second run of a row need not show: an answer may come from memory."""


def drop_times(value: Any) -> Any:
    """Plain JSON without seconds and without what models were paid, however deep."""
    if isinstance(value, Mapping):
        return {key: drop_times(each) for key, each in value.items() if key not in _FLEETING}
    if isinstance(value, list | tuple):
        return [drop_times(each) for each in value]
    return value


def _sum_paid(models: Mapping[str, Any]) -> dict[str, int]:
    """Requests and tokens over all of a row's questions."""
    return {name: sum(model[name] or 0 for model in models.values()) for name in PAID if models}


@cache
def _load_backend(names: Names, base_url: str | None, asking: Asking) -> Backend:
    """The backend of a worker, made once."""
    return load_speaking_backend(names, base_url, asking)


class _Overriding(WrappedBackend):
    """A backend whose plans have parts of their context replaced."""

    def __init__(self, backend: Backend, context: Mapping[str, Any]) -> None:
        super().__init__(backend)
        self._context = dict(context)

    def answer(self, question: Question) -> dict[str, Any]:
        """The backend's reply; a plan's context as the row has it."""
        reply = self._backend.answer(question)
        if question.task != "plan" or not isinstance(reply, dict) or "agents" not in reply:
            return reply
        # What the words say of a replaced part of the context is no longer so.
        said = [
            each for each in reply.get("said") or ()
            if not (isinstance(each, Mapping) and each.get("became") in self._context)
        ]  # fmt: skip
        context = {**(reply.get("context") or {}), **self._context}
        return {**reply, "context": context, "said": said}
