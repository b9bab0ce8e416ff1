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
from scenewright.cli.output_folder import fill_folder, target_folder, try_folder
from scenewright.cli.views import ViewKind, add_views, write_view
from scenewright.errors import InputError
from scenewright.scene.plan_file import PlanFile, is_plan_file, read_plan
from scenewright.time_limit import DEFAULT_LIMIT

if TYPE_CHECKING:
    from scenewright.backends import Backend
    from scenewright.graph.run import ProgressCallback, Scene

SCENES = "scenes"
MOST_TEXT = 1 << 20
OFFERED = 8
"""Candidates per agent that a recording shows."""


@dataclass(frozen=True)
class MakeOptions:
    """What `make` was asked for; `text` is the instruction, or the plan of a file."""

    text: str | PlanFile
    intersection: str
    backend: str | Backend
    seed: int
    refiner: str
    selection: Literal["draw", "map"]
    profile: Literal["full", "paper"]
    out: str | None
    force: bool
    picture: bool
    recording: bool
    gif: bool
    html: bool = False
    lenient: bool = False
    max_agents: int | None = None
    lawful: bool = False
    time_limit: float = DEFAULT_LIMIT


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
    return read_plan(text) if is_plan_file(text) else read_instruction(text)


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
    request: MakeOptions, *, log: ProgressCallback, answer: Callable[[list[str]], None]
) -> MakeResult:
    """Synthesises a scene and writes its folder as a whole.

    A picture or a recording that cannot be drawn is a warning: the scene is worth more.

    Args:
        answer: called with what happens in the scene, a few lines, before views of it are drawn.

    Raises:
        InputError, Unsatisfiable, BackendFault: as `synthesize`; or the folder cannot be written.
    """
    target = None if request.out is None else target_folder(request.out, force=request.force)
    try_folder(request.out or SCENES)
    scene = _synthesize(request, log)
    if target is None:
        name = Path(SCENES) / choose_folder_name(scene.record.meta.scene_id)
        target = target_folder(str(name), force=request.force)
    with fill_folder(target) as part:
        scene.save(part, profile=request.profile)
        answer(_summarize(scene))
        warnings = (*_explain_unrefined(scene), *_add_views(scene, part, request, log))
        files = tuple(sorted(entry.name for entry in part.iterdir()))
        stop_if_asked()
    return MakeResult(scene, _shorten_path(target), files, warnings)


def _summarize(scene: Scene) -> list[str]:
    from scenewright.cli.scene_summary import summarize_scene
    from scenewright.intersections import load_map

    return summarize_scene(scene.record, scene.proof, load_map(scene.record.meta.intersection))


def choose_folder_name(scene_id: str) -> str:
    """A scene id as a plain file name: it derives from text of any origin."""
    slug = re.sub(r"[^a-z0-9_]+", "-", scene_id.lower()).strip("-")[:80].rstrip("-")
    return slug or "scene"


def _shorten_path(target: Path) -> Path:
    """Relative where that is shorter to read."""
    here = Path.cwd()
    return target.relative_to(here) if target.is_relative_to(here) else target


def _synthesize(request: MakeOptions, log: ProgressCallback) -> Scene:
    from scenewright.graph.run import synthesize

    return synthesize(
        request.text,
        intersection=request.intersection,
        backend=request.backend,
        seed=request.seed,
        refiner=request.refiner,
        selection=request.selection,
        lenient=request.lenient,
        max_agents=request.max_agents,
        lawful=request.lawful,
        time_limit=request.time_limit,
        log=log,
    )


def _explain_unrefined(scene: Scene) -> list[str]:
    """Why nothing was refined though it was asked for."""
    asked, ran = scene.provenance["refiner"], scene.provenance["refinement"]
    return [ran["note"]] if asked == "trajnet" and ran["refiner"] == "none" else []


def _add_views(
    scene: Scene, folder: Path, request: MakeOptions, log: ProgressCallback
) -> list[str]:
    views: dict[str, tuple[bool, Callable[[Path], None]]] = {
        "scene.png": (request.picture, partial(_write, "png", scene)),
        "scene.rrd": (request.recording, partial(_record, scene)),
        "scene.gif": (request.gif, partial(_write, "gif", scene)),
        "scene.html": (request.html, partial(_write, "html", scene)),
    }
    wanted = {name: write for name, (asked, write) in views.items() if asked}
    return add_views(folder, wanted, partial(log, "writing"))


def _write(kind: ViewKind, scene: Scene, path: Path) -> None:
    write_view(kind, path, scene.record, scene.proof)


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
