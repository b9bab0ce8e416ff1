"""`scenewright make`: one instruction, one folder."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from scenewright.cli.interrupts import stop_if_asked
from scenewright.cli.options import Lawful, MaxAgents, ModelOptions, TimeLimit, option
from scenewright.cli.output_folder import fill_folder, shorten_path, target_folder, try_folder
from scenewright.cli.views import ViewKind, add_views, write_view
from scenewright.errors import InputError
from scenewright.files import is_plan_file
from scenewright.time_limit import DEFAULT_LIMIT

if TYPE_CHECKING:
    from scenewright.backends import Backend
    from scenewright.graph.run import ProgressCallback, Scene
    from scenewright.scene.plan_file import PlanFile

SCENES = "scenes"
MOST_TEXT = 1 << 20
OFFERED = 8
"""Candidates per agent that a recording shows."""


@dataclass(frozen=True, kw_only=True)
class MakeOptions:
    """How `make` makes a scene, and what it writes."""

    intersection: str = option("amsterdam_120", "Where it happens.")
    model: ModelOptions
    time_limit: TimeLimit = DEFAULT_LIMIT
    seed: int = option(0, "The same seed makes the same scene.")
    refiner: str = option(
        "trajnet", "Learned refinement of the tracks, or none.", envvar="SCENEWRIGHT_REFINER"
    )
    selection: Literal["draw", "map"] = option(
        "draw", "Draw among the combinations that fit, or take the likeliest."
    )
    profile: Literal["full", "paper"] = option(
        "full", "Keys of scene.json: all, or those of the paper's Listing 1 alone."
    )
    out: str | None = option(None, "Folder to write; scenes/ID if none is named.")
    force: bool = option(False, "Write into a folder that holds other files, too.")
    lenient: bool = option(False, "Leave out words that cannot be realised, and list them.")
    max_agents: MaxAgents = None
    lawful: Lawful = False
    gif: bool = option(False, "Add an animation, scene.gif.")
    html: bool = option(False, "Add a page that plays and explains it, scene.html.")
    no_picture: bool = option(False, "No scene.png.")
    no_recording: bool = option(False, "No scene.rrd.")


@dataclass(frozen=True, eq=False)
class MakeResult:
    """A scene that was written, where, and what could not be added to it."""

    scene: Scene
    folder: Path
    files: tuple[str, ...]
    warnings: tuple[str, ...]

    def to_json(self) -> dict[str, Any]:
        """The object that `--json` prints."""
        record, proof = self.scene.record, self.scene.proof
        return {
            "ok": True,
            "scene_id": record.meta.scene_id,
            "folder": str(self.folder),
            "files": list(self.files),
            **proof.build_verdict(),
            "events": record.to_json()["events"],
            "agents": len(record.agents),
            "seed": record.meta.seed,
            "intersection": record.meta.intersection,
            "warnings": list(self.warnings),
        }


def read_request(text: str) -> str | PlanFile:
    """The plan where the text names a plan file, else the instruction.

    Raises:
        InputError: it is not UTF-8, or no plan.
    """
    if is_plan_file(text):
        from scenewright.scene.plan_file import read_plan

        return read_plan(text)
    return read_instruction(text)


def read_instruction(text: str) -> str:
    """The instruction, from stdin where the text is `-`.

    Raises:
        InputError: it is not UTF-8.
    """
    if text == "-":
        data = sys.stdin.buffer.read(MOST_TEXT) if sys.stdin is not None else b""
        text = data.decode("utf-8", "surrogateescape")
    if any("\ud800" <= char <= "\udfff" for char in text):
        raise InputError("the instruction is not valid UTF-8 text")
    return text


def make_scene(
    asked: str | PlanFile,
    options: MakeOptions,
    backend: Backend,
    *,
    log: ProgressCallback,
    answer: Callable[[list[str]], None],
) -> MakeResult:
    """Synthesises a scene and writes its folder as a whole.

    A picture or a recording that cannot be drawn is a warning: the scene is worth more.

    Args:
        asked: the instruction, or the plan of a file.
        answer: called with what happens in the scene, a few lines, before views of it are drawn.

    Raises:
        InputError, Unsatisfiable, BackendFault: as `synthesize`; or the folder cannot be written.
    """
    from scenewright.cli.scene_summary import summarize_scene
    from scenewright.graph.run import check_plan, synthesize
    from scenewright.intersections import load_map
    from scenewright.scene.plan_file import PlanFile

    if isinstance(asked, PlanFile):
        check_plan(asked, intersection=options.intersection)
    target = None if options.out is None else target_folder(options.out, force=options.force)
    try_folder(options.out or SCENES)
    scene = synthesize(
        asked, intersection=options.intersection, backend=backend, seed=options.seed,
        refiner=options.refiner, selection=options.selection, lenient=options.lenient,
        max_agents=options.max_agents, lawful=options.lawful, time_limit=options.time_limit,
        log=log,
    )  # fmt: skip
    if target is None:
        name = Path(SCENES) / choose_folder_name(scene.record.meta.scene_id)
        target = target_folder(str(name), force=options.force)
    with fill_folder(target) as part:
        scene.save(part, profile=options.profile)
        place = load_map(scene.record.meta.intersection)
        answer(summarize_scene(scene.record, scene.proof, place))
        warnings = _add_views(scene, part, options, log)
        ran = scene.provenance["refinement"]
        if scene.provenance["refiner"] == "trajnet" and ran["refiner"] == "none":
            warnings.insert(0, ran["note"])
        files = tuple(sorted(entry.name for entry in part.iterdir()))
        stop_if_asked()
    return MakeResult(scene, shorten_path(target), files, tuple(warnings))


def choose_folder_name(scene_id: str) -> str:
    """A scene id as a plain file name: it derives from text of any origin."""
    slug = re.sub(r"[^a-z0-9_]+", "-", scene_id.lower()).strip("-")[:80].rstrip("-")
    return slug or "scene"


def _add_views(
    scene: Scene, folder: Path, options: MakeOptions, log: ProgressCallback
) -> list[str]:
    def write(kind: ViewKind) -> Callable[[Path], None]:
        return partial(write_view, kind, scene=scene.record, proof=scene.proof)

    views: dict[str, tuple[bool, Callable[[Path], None]]] = {
        "scene.png": (not options.no_picture, write("png")),
        "scene.rrd": (not options.no_recording, partial(_record, scene)),
        "scene.gif": (options.gif, write("gif")),
        "scene.html": (options.html, write("html")),
    }
    wanted = {name: view for name, (asked, view) in views.items() if asked}
    return add_views(folder, wanted, partial(log, "writing"))


def _record(scene: Scene, path: Path) -> None:
    from scenewright.intersections import load_map
    from scenewright.viz.recording import record_scene

    offered, chosen = scene.state["candidates"].agents, scene.state["selection"].agents
    record_scene(
        path,
        scene=scene.record,
        proof=scene.proof,
        intersection=load_map(scene.record.meta.intersection),
        candidates={
            name: [offered[name].build(m).path.xy for m in range(len(offered[name].nll[:OFFERED]))]
            for name in chosen
        },
        priors={name: agent.candidate.path.xy for name, agent in chosen.items()},
        messages=scene.messages,
    )
