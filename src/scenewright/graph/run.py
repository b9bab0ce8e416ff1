"""From words to proof: a request runs through the state machine and comes out as a scene.

`synthesize` makes the world of the run (`RunContext`) and its first state, and runs the stages of
`build.py`, of which `routes.py` decides what follows each. The last state holds scene and proof, or
`refusals.py` says why it does not. A verified scene and its provenance are a `Scene`.
"""

from __future__ import annotations

import time
import zlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, Literal, cast

import numpy as np

from scenewright.backends import Backend, Call, Named, get_backend_of_task, load_backend
from scenewright.errors import Rejected, ScenewrightError
from scenewright.files import format_json_line, write_files
from scenewright.geometry.map_areas import MapAreas
from scenewright.graph.arguments import (
    DEFAULT_INTERSECTION,
    check_arguments,
    check_length,
    choose_max_agents,
    choose_refiner,
    find_refiner_gap,
)
from scenewright.graph.collector import collect_rarely
from scenewright.graph.provenance import describe_provenance, sum_costs_by_task
from scenewright.graph.refusals import build_cut_off, build_refusal
from scenewright.graph.scene_files import encode_proof, encode_scene
from scenewright.intersections import load_map
from scenewright.memory.state import SceneState
from scenewright.nodes.context import Budgets, RefinerName, RunContext
from scenewright.nodes.prompts import ExampleRetriever, recall_nothing
from scenewright.nodes.scene_planner import PlannerReads, plan_scene
from scenewright.scene.events import Proof
from scenewright.scene.frozen_agents import FrozenAgents
from scenewright.scene.plan_fields import word_plan
from scenewright.scene.plan_file import PlanFile
from scenewright.scene.record import SceneRecord
from scenewright.scene.rejection import Rejection
from scenewright.scene.social import SocialGraph
from scenewright.time_limit import (
    DEFAULT_LIMIT,
    TimeLimitReachedError,
    check_time_limit,
    limit_time,
)
from scenewright.tools.gmm_sampler import load_priors
from scenewright.tools.solver.select import Mode
from scenewright.work_limit import MOST_WORK, WorkLimitReachedError, limit_work

if TYPE_CHECKING:
    from scenewright.tools.trajnet_refiner.bundled import BundledRefiner

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
        return write_files(folder, self.list_files(profile=profile))


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
            state, seconds = _run_stages(start, context)
    except ScenewrightError as error:
        error.models = sum_costs_by_task(calls)
        raise
    provenance = describe_provenance(context, state, seconds, calls)
    return Scene(state["scene"], state["proof"], provenance, state, tuple(messages))


def _run_stages(start: SceneState, context: RunContext) -> tuple[SceneState, dict[str, float]]:
    """The last state, which holds a verified scene, and wall seconds by stage.

    Raises:
        InputError, Unsatisfiable, BackendFault: there is no scene.
    """
    budgets = context.budgets
    limit = (8 + 2 * budgets.refiner) * (budgets.generator + budgets.planner + 4)
    seconds: dict[str, float] = {}
    state: SceneState = {}
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
        raise build_cut_off(state, error) from error
    if "scene" not in state or state.get("refused") is not None:
        rule = get_backend_of_task(context.backend, "constraints").deterministic
        raise build_refusal(state, rule=rule)
    return state, seconds


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
    raise build_refusal({"rejections": rejections}, rule=rule)


def _load_backend(backend: Named | Backend, base_url: str | None) -> Backend:
    if isinstance(backend, str | Sequence | Mapping):
        return load_backend(backend, base_url=base_url)
    return backend


def _load_refiner(name: str) -> BundledRefiner | None:
    """The network that serves an intersection; torch is loaded only where there is one."""
    if find_refiner_gap(name, "trajnet") is not None:
        return None
    from scenewright.tools.trajnet_refiner.bundled import find_refiner

    return find_refiner(name)


_grounds: dict[str, MapAreas] = {}


def ground_of(name: str) -> MapAreas:
    """Map and prepared areas of a bundle as it is now; InputError if there is none so named."""
    place, known = load_map(name), _grounds.get(name)
    if known is None or known.intersection_map is not place:
        known = _grounds[name] = MapAreas(place)
    return known
