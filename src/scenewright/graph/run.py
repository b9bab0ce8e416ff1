"""One run: an instruction in, a proven scene out, or the reason why not."""

from __future__ import annotations

import json
import os
import stat
import time
import zlib
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from importlib.metadata import version
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, Literal, cast

import numpy as np
from pydantic import ValidationError
from pydantic_core import PydanticSerializationError

from scenewright.backends import Backend, Call, Named, get_backend_of_task, load_backend
from scenewright.errors import (
    BackendFault,
    InputError,
    OutOfTime,
    Rejected,
    ScenewrightError,
    Unsatisfiable,
)
from scenewright.files import write_atomically
from scenewright.geometry.map_areas import MapAreas
from scenewright.graph.collector import collect_rarely
from scenewright.graph.written_proof import compare_origin, compare_proofs, read_proof
from scenewright.intersections import load_map, ships_refiner
from scenewright.memory.state import SceneState
from scenewright.nodes.context import Budgets, RefinerName, RunContext
from scenewright.nodes.prompts import LONGEST_REQUEST, ExampleRetriever, recall_nothing
from scenewright.nodes.scene_planner import PlannerReads, plan_scene
from scenewright.nodes.trajectory_refiner import NO_WEIGHTS
from scenewright.scene.bounds import find_excess
from scenewright.scene.digest import digest_json, digest_scene
from scenewright.scene.events import Event, Finding, Proof
from scenewright.scene.frozen_agents import FrozenAgents
from scenewright.scene.kinds import list_values
from scenewright.scene.map import IntersectionMap
from scenewright.scene.phrasing import choose_names
from scenewright.scene.plan_fields import word_plan
from scenewright.scene.plan_file import PlanFault, PlanFile
from scenewright.scene.record import SceneRecord
from scenewright.scene.rejection import Rejection, Stage
from scenewright.scene.relations import get_pattern
from scenewright.scene.social import AgentNode, SocialGraph
from scenewright.time_limit import (
    DEFAULT_LIMIT,
    TimeLimitReachedError,
    check_time_limit,
    limit_time,
)
from scenewright.tools.account import prove
from scenewright.tools.dsl_validator.parse import format_clause
from scenewright.tools.gmm_sampler import load_priors
from scenewright.tools.map_grounding.grounding import ground_graph
from scenewright.tools.solver.select import Mode
from scenewright.work_limit import MOST_WORK, WorkLimitReachedError, limit_work

if TYPE_CHECKING:
    from scenewright.tools.relation_checker.external_events import ExternalTracks, RecordedEvents
    from scenewright.tools.trajnet_refiner.bundled import BundledRefiner

DEFAULT_INTERSECTION = "amsterdam_120"
REFINERS = ("none", "trajnet")
DEFAULT_REFINER = "trajnet"
MAX_SEED = 2**63 - 1
_PAPER_LACKS = {"intersection", "step", "duration", "heading", "length", "width"}

_ASKED = 3
"""How often a model is asked for a plan that can be read."""
Profile = Literal["full", "paper"]
ProgressCallback = Callable[[str, str], None]


@dataclass(frozen=True, eq=False)
class Scene:
    """A verified scene and how it came about.

    Attributes:
        record: what scene.json holds; proof: what proof.json holds.
        provenance: seed, backend, versions, rejections and seconds per stage.
        state: every product of the run, for the recorder.
        messages: (stage, line) in order.
    """

    record: SceneRecord
    proof: Proof
    provenance: Mapping[str, Any]
    state: SceneState
    messages: tuple[tuple[str, str], ...]

    def list_files(self, *, profile: Profile = "full") -> dict[str, bytes]:
        """The contents of provenance.json, proof.json and scene.json, by name (see `save`)."""
        full = profile == "full"
        scene = encode_scene(self.record) if full else format_json_line(self.record.to_paper())
        provenance = format_json_line(self.provenance)
        proof = encode_proof(self.proof)
        return {"provenance.json": provenance, "proof.json": proof, "scene.json": scene}

    def save(self, folder: str | Path, *, profile: Profile = "full") -> Path:
        """Writes scene.json, proof.json and provenance.json, each whole or not at all.

        Args:
            profile: `paper` keeps to the keys of the paper's Listing 1 in scene.json, which then
                cannot be verified again.
        """
        target = make_folder(folder)
        for name, data in self.list_files(profile=profile).items():
            write_atomically(target / name, data)
        return target


def synthesize(
    instruction: str | SocialGraph | PlanFile,
    *,
    intersection: str = DEFAULT_INTERSECTION,
    backend: Named | Backend = "builtin",
    base_url: str | None = None,
    seed: int = 0,
    refiner: str | None = None,
    selection: Mode = "draw",
    previous: str | None = None,
    planned: SocialGraph | None = None,
    pinned: FrozenAgents | None = None,
    budgets: Budgets | None = None,
    recall: ExampleRetriever | None = None,
    lenient: bool = False,
    max_agents: int | None = None,
    lawful: bool = False,
    time_limit: float | None = DEFAULT_LIMIT,
    log: ProgressCallback | None = None,
) -> Scene:
    """A verified scene for an instruction in plain language, or for a plan.

    Args:
        instruction: the words; or a plan, whose fields are then what must be seen.
        intersection: name of a bundle; see `scenewright intersections list`.
        backend: name of the backend that plans and reasons, or one already made; or one per stage,
            such as {"planner": "openai:MODEL"} (docs/backends.md).
        base_url: of the OpenAI-compatible endpoint of a model that is named.
        seed: the same seed gives the same bytes (builtin backend).
        refiner: `trajnet` refines the tracks with the network that the bundle ships, or if it
            ships none with that of the shipped intersection; `none` leaves them as edited. None
            is what the environment variable SCENEWRIGHT_REFINER says, else `trajnet`.
        selection: `draw` among the survivors, or `map`, the most probable one (Eq. 4).
        previous: an earlier turn that the instruction may refer to.
        planned: a social graph that is settled; the instruction is then but the scene's text.
        pinned: agents of an earlier version that stay as they are.
        budgets: how often each retry edge may be taken.
        recall: finds accepted answers to requests like this one, for prompts.
        lenient: leave out words that cannot be realised, and list them, instead of refusing.
        max_agents: most agents that the scene may hold; None is what the environment variable
            SCENEWRIGHT_MAX_AGENTS says, else as many as the time of day has.
        lawful: refuse a scene in which an agent runs a red light that no word asks for; else it is
            made where as many lawful samples have failed, or there can be none, and named in the
            proof (`figures.unasked_red_light_runs`).
        time_limit: the emergency brake: longest that the stages may compute [s], without what
            models take to answer; None for as long as counted attempts and work last, which decide
            alone what is made. A run that reaches it is refused (OutOfTime).
        log: called with (stage, line) as the run goes.

    Raises:
        InputError: the text is not a request for a scene, or an argument is unusable.
        Unsatisfiable: a sane request that cannot be met; carries every rejection.
        BackendFault: the backend failed for good.
    """
    messages: list[tuple[str, str]] = []
    calls: list[Call] = []

    def note(stage: str, line: str) -> None:
        messages.append((stage, line))
        if log is not None:
            log(stage, line)

    if isinstance(instruction, SocialGraph):
        instruction = PlanFile(instruction)
    # A plan with one field changed is drawn as its text was, so that little else changes.
    drawn = instruction.text if isinstance(instruction, PlanFile) else instruction
    check_length(drawn)
    if isinstance(instruction, PlanFile):
        instruction, planned = word_plan(instruction)
    refiner = choose_refiner(refiner)
    check_arguments(seed, refiner)
    check_time_limit(time_limit)
    context = RunContext(
        backend=_load_backend(backend, base_url),
        ground=ground_of(intersection),
        priors=load_priors(intersection),
        seed=seed,
        entropy=zlib.crc32((drawn or instruction).encode("utf-8", "surrogatepass")),
        refiner=cast(RefinerName, refiner),
        learned=_load_refiner(intersection) if refiner == "trajnet" else None,
        selection=selection,
        budgets=budgets or Budgets(),
        recall=recall or recall_nothing,
        lenient=lenient,
        max_agents=choose_max_agents(max_agents),
        lawful=lawful,
        log=note,
        account=calls.append,
    )
    start: SceneState = {
        "instruction": instruction,
        "previous": previous,
        "planned": planned,
        "pinned": pinned,
        "rejections": [],
    }
    _load_stages(refined=context.learned is not None)
    try:
        with collect_rarely(), limit_time(time_limit), limit_work(MOST_WORK):
            state, seconds = _run(start, context)
        if "scene" not in state or state.get("refused") is not None:
            rule = get_backend_of_task(context.backend, "constraints").deterministic
            raise _call_agents(_build_refusal(state, rule=rule), state)
    except ScenewrightError as error:
        error.models = sum_costs_by_task(calls)
        raise
    models = sum_costs_by_task(calls)
    provenance = _describe_provenance(context, state, seconds) | (
        {"models": models} if models else {}
    )
    return Scene(state["scene"], state["proof"], provenance, state, tuple(messages))


def plan_instruction(
    instruction: str,
    *,
    intersection: str = DEFAULT_INTERSECTION,
    backend: Named | Backend = "builtin",
) -> SocialGraph:
    """The plan that `synthesize` begins with, which its scene need not show in the end.

    Raises:
        InputError, Unsatisfiable, BackendFault: as `synthesize`.
    """
    check_length(instruction)
    context = RunContext(
        backend=_load_backend(backend, None),
        ground=ground_of(intersection),
        priors=load_priors(intersection),
        seed=0,
    )
    rule = get_backend_of_task(context.backend, "plan").deterministic
    rejections: list[Rejection] = []
    for _ in range(1 if rule else _ASKED):
        state: PlannerReads = {
            "instruction": instruction, "previous": None, "planned": None, "pinned": None,
            "rejections": rejections,
        }  # fmt: skip
        try:
            return plan_scene(state, runtime=SimpleNamespace(context=context))["social_graph"]
        except Rejected as error:
            rejections = [*rejections, error.rejection]
    raise _build_refusal({"rejections": rejections}, rule=rule)


def check_plan(given: PlanFile, *, intersection: str = DEFAULT_INTERSECTION) -> None:
    """Bind a plan to a map.

    Raises:
        InputError: no such map; or it has no way for an agent, which names line and field.
    """
    place = load_map(intersection)
    try:
        ground_graph(given.plan, intersection_map=place)
    except Rejected as error:
        agents, what = error.rejection.agents, error.rejection.detail
        faults: dict[tuple[str | int, ...], str] = {}
        for n, node in enumerate(given.plan.agents):
            own = what if agents == (node.id,) else None
            try:
                ground_graph(SocialGraph(agents=(node,)), intersection_map=place)
            except Rejected as alone:
                own = alone.rejection.detail
            if own is not None:
                name, advice = _find_blocking_field(node, place)
                faults["agents", n, *name] = own + advice
        entries = [
            *(("objects", n) for n, each in enumerate(given.plan.objects)
              if what.startswith(f"{each.id}:")),
            *(("relations", n) for n, edge in enumerate(given.plan.relations)
              if set(agents) == {edge.from_, edge.to}),
        ]  # fmt: skip
        raise PlanFault(given.name, given.lines, faults or {(*entries, ())[0]: what}) from error


def _find_blocking_field(node: AgentNode, place: IntersectionMap) -> tuple[tuple[str, ...], str]:
    """The field without which an agent has a way, and what would do; both empty if none has."""

    def has_way(name: str, value: object) -> bool:
        with suppress(Rejected):
            alone = SocialGraph(agents=(node.model_copy(update={name: value}),))
            return bool(ground_graph(alone, intersection_map=place))
        return False

    for name in ("movement", "crosswalk", "exit", "entry"):
        if getattr(node, name) is not None and has_way(name, None):
            known = list_values([AgentNode.model_fields[name].annotation])
            fitting = ", ".join(each for each in known if has_way(name, each))
            return (name,), f"; {f'there is one with {fitting}' if fitting else 'leave it out'}"
    return (), ""


def verify(
    scene: SceneRecord | Scene | str | Path,
    *,
    intersection: str | None = None,
    strict: bool = False,
) -> Proof:
    """The checker's verdict on a scene, a scene.json or a folder that holds one.

    A proof.json beside a file must name the digest of this very scene.

    Args:
        strict: demand a proof, of the file or the `Scene`, that names the digest and is the
            checker's own to the last figure; a provenance.json may name no other digest.

    Raises:
        InputError: there is no scene there, or it is none; the proof beside it cannot be read.
    """
    written: Proof | None = None
    if isinstance(scene, str | Path):
        file = find_scene_file(scene)
        record, digest = _read_scene(file)
        # Beside a file of another name may lie the proof of something else.
        beside = file.with_name("proof.json")
        written = read_proof(beside) if file.name == "scene.json" and beside.exists() else None
    else:
        record, written = (scene.record, scene.proof) if isinstance(scene, Scene) else (scene, None)
        if (excess := find_excess(record)) is not None:
            raise InputError(f"this is no scene: {excess}")
        digest = digest_scene(record)
    name = intersection or record.meta.intersection
    proof = prove(record, load_map(name), labelled=True)
    proof = proof.model_copy(update={"scene_digest": digest})
    other_map = name != record.meta.intersection
    proof = compare_proofs(proof, written, strict=strict, other_map=other_map)
    if strict and isinstance(scene, str | Path):
        proof = compare_origin(proof, file.with_name("provenance.json"))
    return proof


def verify_tracks(
    path: str | Path | ExternalTracks, *, intersection: str | None = None
) -> tuple[Event, ...]:
    """Every event in tracks that scenewright never made, in order of time (SEMANTICS section 4).

    Args:
        path: a CSV of tracks or a TrajNet++ ndjson file, or what `load_tracks` made of it; agents
            are numbered as there.
        intersection: the map of the tracks, in its frame; its crosswalks count as such.

    Raises:
        InputError: unreadable (the line is named), or no such intersection.
    """
    tracks = load_tracks(path) if isinstance(path, str | Path) else path
    return examine_tracks(tracks, intersection=intersection).events


def examine_tracks(tracks: ExternalTracks, *, intersection: str | None = None) -> RecordedEvents:
    """Events as of `verify_tracks`, contacts that are none, and what would have avoided them.

    Raises:
        InputError: no such intersection, or too many agents at once.
    """
    ground = None if intersection is None else load_map(intersection)
    from scenewright.tools.relation_checker.external_events import examine_recording

    return examine_recording(tracks, intersection_map=ground)


def find_off_ground(tracks: ExternalTracks, *, intersection: str) -> tuple[Finding, ...]:
    """Agents of foreign tracks that leave the ground of their class on a map.

    Raises:
        InputError: no such intersection.
    """
    from scenewright.tools.relation_checker.external_events import find_off_map

    return find_off_map(tracks, load_map(intersection))


def load_tracks(path: str | Path) -> ExternalTracks:
    """The tracks in a file of one scenario; see docs/formats.md and docs/exports.md.

    Raises:
        InputError: missing or unreadable, names the place and what to mend; or several scenarios.
    """
    recordings = load_recordings(path)
    if len(recordings) > 1:
        raise InputError(f"{path} holds {len(recordings)} scenarios; use load_recordings")
    return next(iter(recordings.values()))


def load_recordings(path: str | Path) -> dict[str, ExternalTracks]:
    """The tracks of every scenario in a file, by its name; "" where there is but one.

    Raises:
        InputError: missing or unreadable; names the place and what to mend.
    """
    from scenewright.tools.track_io.external_tracks import read_external_recordings

    return read_external_recordings(_read_content(Path(path)), name=str(path))


def _read_content(file: Path) -> bytes:
    """The bytes of a file; devices and pipes, which may never end, are refused.

    Raises:
        InputError: missing, unreadable, too large or no file.
    """
    from scenewright.tools.formats.sample_table import MOST_BYTES, describe_too_large

    try:
        mode, size = file.stat().st_mode, file.stat().st_size
        if not (stat.S_ISREG(mode) or stat.S_ISDIR(mode)):
            raise InputError(f"cannot read {file}: it is a device or a pipe, not a file")
        with file.open("rb") as stream:
            data = stream.read(MOST_BYTES + 1)
    except OSError as error:
        raise InputError(f"cannot read {file}: {error.strerror or error}") from error
    if len(data) > MOST_BYTES:
        raise InputError(describe_too_large(str(file), max(size, len(data))))
    return data


def find_scene_file(path: str | Path) -> Path:
    """The scene.json that a path names: the file, or that of a folder.

    Raises:
        InputError: the path is empty, which would name the folder that happens to be current.
    """
    if not str(path).strip():
        raise InputError("the path of the scene is empty; name a scene.json or its folder")
    return Path(path) / "scene.json" if Path(path).is_dir() else Path(path)


def load_scene(path: str | Path) -> SceneRecord:
    """The scene in a scene.json, or in a folder that holds one.

    Raises:
        InputError: missing, unreadable or not a scene; says where the first fault is.
    """
    return _read_scene(find_scene_file(path))[0]


def _read_scene(file: Path) -> tuple[SceneRecord, str]:
    """The scene in a file, and the digest of the file."""
    data = _read_content(file)
    record = _parse_scene(file, data)
    if "schema_version" not in record.meta.model_fields_set:
        raise InputError(f"{file} is not a scene: meta.schema_version is missing")
    if (excess := find_excess(record)) is not None:
        raise InputError(f"{file} is not a scene: {excess}")
    try:
        return record, digest_json(data)
    except ValueError as error:
        raise InputError(f"{file} is not a scene: {error}") from error


def _parse_scene(file: Path, data: bytes) -> SceneRecord:
    try:
        return SceneRecord.model_validate_json(data)
    except ValidationError as error:
        faults = error.errors(include_url=False)
        if {each["loc"][-1] for each in faults if each["type"] == "missing"} >= _PAPER_LACKS:
            raise InputError(
                f"{file} is a scene of the paper profile (Listing 1): without headings, sizes, "
                "relations and signals nothing can be proven; verify the full scene.json"
            ) from error
        first = faults[0]
        where = ".".join(str(part) for part in first["loc"]) or "file"
        raise InputError(f"{file} is not a scene: {where}: {first['msg']}") from error


def make_folder(folder: str | Path) -> Path:
    """The folder, made if need be; InputError if it cannot be."""
    target = Path(folder)
    try:
        target.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"cannot make folder {target}: {error.strerror or error}") from error
    return target


def encode_scene(record: SceneRecord) -> bytes:
    """scene.json: the same scene, the same bytes."""
    try:
        return record.model_dump_json(by_alias=True).encode() + b"\n"
    except PydanticSerializationError:  # text that no UTF-8 can hold
        return format_json_line(record.to_json())


def encode_proof(proof: Proof) -> bytes:
    """proof.json."""
    return format_json_line(proof.model_dump(mode="json", by_alias=True))


_grounds: dict[str, MapAreas] = {}


def ground_of(name: str) -> MapAreas:
    """Map and prepared areas of a bundle as it is now; InputError if there is none so named."""
    place, known = load_map(name), _grounds.get(name)
    if known is None or known.intersection_map is not place:
        known = _grounds[name] = MapAreas(place)
    return known


@cache
def _load_stages(*, refined: bool) -> None:
    """Load before the clock runs what stages need once a process: a busy machine takes long."""
    _compile_graph()
    if refined:
        import_module("scenewright.tools.trajnet_refiner.guided")


@cache
def _compile_graph() -> Any:
    from scenewright.graph.build import build_graph

    return build_graph().compile()


def _run(start: SceneState, context: RunContext) -> tuple[SceneState, dict[str, float]]:
    """The final state, and wall seconds by stage."""
    budgets = context.budgets
    limit = (8 + 2 * budgets.refiner) * (budgets.generator + budgets.planner + 4)
    seconds: dict[str, float] = {}
    state: dict[str, Any] = {}
    before = time.perf_counter()
    stream = _compile_graph().stream(
        start,
        context=context,
        config={"recursion_limit": limit},
        stream_mode=["updates", "values"],
    )
    # As it is; but numpy finds it sooner where it is set than where it is left to default.
    try:
        with np.errstate():
            for mode, chunk in stream:
                if mode == "values":
                    state = chunk
                    continue
                now = time.perf_counter()
                for stage in chunk:
                    seconds[stage] = seconds.get(stage, 0.0) + now - before
                before = now
    except (TimeLimitReachedError, WorkLimitReachedError) as error:
        raise _call_agents(_build_cut_off(cast(SceneState, state), error), state) from error
    return cast(SceneState, state), seconds


def _load_refiner(name: str) -> BundledRefiner | None:
    """The network that serves an intersection; torch is loaded only where there is one."""
    if find_refiner_gap(name, "trajnet") is not None:
        return None
    from scenewright.tools.trajnet_refiner.bundled import find_refiner

    return find_refiner(name)


def find_refiner_gap(intersection: str, refiner: str) -> str | None:
    """Why nothing would be refined though it is asked for; None where a network serves."""
    served = ships_refiner(intersection) or ships_refiner(DEFAULT_INTERSECTION)
    return NO_WEIGHTS if refiner == "trajnet" and not served else None


def choose_refiner(name: str | None) -> str:
    """The refiner that is named, else what SCENEWRIGHT_REFINER says, else `trajnet`."""
    return name or os.environ.get("SCENEWRIGHT_REFINER") or DEFAULT_REFINER


def choose_max_agents(most: int | None) -> int | None:
    """The most agents of a scene that are named, else what SCENEWRIGHT_MAX_AGENTS says, else None.

    Raises:
        InputError: it is no whole number from 1.
    """
    limit = os.environ.get("SCENEWRIGHT_MAX_AGENTS") if most is None else str(most)
    if not limit:
        return None
    if not limit.isdecimal() or int(limit) < 1:
        raise InputError(f"the most agents of a scene is a whole number from 1, got {limit}")
    return int(limit)


def check_arguments(seed: int, refiner: str) -> None:
    """Raises InputError for a seed or a refiner that there is not."""
    if not 0 <= seed <= MAX_SEED:
        raise InputError(f"a seed is a whole number from 0 to 2^63 - 1, got {seed}")
    if refiner not in REFINERS:
        raise InputError(f"there is no refiner {refiner!r}; choose one of: {', '.join(REFINERS)}")


def check_length(instruction: str) -> None:
    """Raises InputError for an instruction that is too long to be one."""
    if len(instruction) > LONGEST_REQUEST:
        raise InputError(
            f"the instruction has {len(instruction):,} characters; at most {LONGEST_REQUEST:,} "
            "are read"
        )


def _build_refusal(state: SceneState, *, rule: bool) -> InputError | Unsatisfiable | BackendFault:
    """The error that ends a run; what a rule wrote in vain is a request that cannot be met."""
    rejections: tuple[Rejection, ...] = tuple(state.get("rejections", []))
    last = rejections[-1]
    if last.code == "out_of_scope":
        return InputError(last.detail)
    if last.code in ("malformed_reply", "malformed_program") and not rule:
        asked = f"{last.stage.replace('_', ' ')} got no usable answer; last: {last.detail}"
        return BackendFault(f"the {asked}", final=True, rejections=rejections)
    if last.stage == "scene_planner" or last.code in ("malformed_program", "unlawful"):
        return Unsatisfiable(last.detail, rejections)
    told = f"no verified scene within {len(rejections)} attempts; {_choose_best_reason(rejections)}"
    return Unsatisfiable(told, rejections)


def _call_agents(error: ScenewrightError, state: Mapping[str, Any]) -> ScenewrightError:
    error.called = choose_names(state["social_graph"]) if "social_graph" in state else {}
    return error


def _build_cut_off(
    state: SceneState, error: TimeLimitReachedError | WorkLimitReachedError
) -> Unsatisfiable:
    """What a limit cut off, and the best reason so far."""
    rejections = tuple(state.get("rejections", []))
    reason = _choose_best_reason(rejections) if rejections else "the first attempt was not done"
    count = f"{len(rejections)} attempt{'' if len(rejections) == 1 else 's'}"
    cut = f"{count}: it cut off the {error.stage.replace('_', ' ')}; {reason}"
    if isinstance(error, TimeLimitReachedError):
        return OutOfTime(
            f"no verified scene within {error.seconds:g} s, the time limit, and {cut}", rejections
        )
    last = Rejection(stage=cast(Stage, error.stage), code="work_spent", detail=str(error))
    return Unsatisfiable(
        f"no verified scene within {error.units:,} steps of the search, the limit of work, and "
        f"{cut}",
        (*rejections, last),
    )


def _choose_best_reason(rejections: tuple[Rejection, ...]) -> str:
    """The last refusal, or the one that came nearest."""
    # Where most attempts failed on a clause that never held, the nearest of them says most.
    unserved = [each for each in rejections if each.missed is not None]
    if 2 * len(unserved) > len(rejections):
        return f"nearest: {min(unserved, key=lambda each: each.missed or (0, 0.0)).detail}"
    return f"last: {rejections[-1].detail}"


def _describe_provenance(
    context: RunContext, state: SceneState, seconds: dict[str, float]
) -> dict[str, Any]:
    names = [each.pattern for each in state["candidates"].cast.patterns]
    patterns, selection = [get_pattern(name) for name in names], state["selection"]
    optimality: dict[str, Any] = {}
    if context.selection == "map":
        optimality = {"optimal": selection.optimal, "gap": round(selection.figures["gap"], 3)}
    return {
        "schema_version": 1,
        "seed": context.seed,
        "backend": context.backend.name,
        "selection": context.selection,
        **({} if context.max_agents is None else {"max_agents": context.max_agents}),
        **({"lenient": True} if context.lenient else {}),
        **({"lawful": True} if context.lawful else {}),
        **optimality,
        "refiner": context.refiner,
        "refinement": state["refinement"].model_dump(mode="json"),
        "intersection": context.intersection.name,
        "scene_digest": state["proof"].scene_digest,
        "versions": _list_versions(),
        "constraints": [format_clause(each) for each in state["constraints"].clauses],
        "patterns": names,
        "taxonomy": [f"{each.theme} / {each.subtype} / {each.id}" for each in patterns],
        "rejections": [each.model_dump(mode="json") for each in state.get("rejections", [])],
        "seconds": {stage: round(value, 4) for stage, value in seconds.items()},
    }


def _load_backend(backend: Named | Backend, base_url: str | None) -> Backend:
    if isinstance(backend, str | Sequence | Mapping):
        return load_backend(backend, base_url=base_url)
    return backend


def sum_costs_by_task(calls: Sequence[Call]) -> dict[str, Any]:
    """What models were asked and what that took, by task; nothing where none was."""
    tasks: dict[str, None] = dict.fromkeys(call.task for call in calls)
    return {task: _sum_costs([call for call in calls if call.task == task]) for task in tasks}


def _sum_costs(calls: Sequence[Call]) -> dict[str, Any]:
    """Answers and requests, tokens of answers (None: not counted), seconds, prompts."""
    answers = [call for call in calls if call.answered]
    counted = {
        "input_tokens": [call.input_tokens for call in answers] or [None],
        "output_tokens": [call.output_tokens for call in answers] or [None],
    }
    return {
        "model": calls[0].model,
        "answers": len(answers),
        "requests": sum(call.asked for call in calls),
        **{
            name: None if None in each else sum(n for n in each if n is not None)
            for name, each in counted.items()
        },
        "seconds": round(sum(call.seconds for call in calls), 3),
        "prompts": list(dict.fromkeys(call.prompt for call in calls)),
    }


@cache
def _list_versions() -> dict[str, str]:
    packages = ("scenewright", "langgraph", "numpy", "pydantic", "shapely")
    return {package: version(package) for package in packages}


def format_json_line(value: Any) -> bytes:
    """A value as one line of JSON, every file's form."""
    text = json.dumps(value, ensure_ascii=False, separators=(",", ":"), allow_nan=False)
    return (text + "\n").encode("utf-8", "backslashreplace")
