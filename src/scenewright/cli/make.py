"""`scenewright make`: one instruction, one folder."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from scenewright.cli.console import Result, show_progress, tell
from scenewright.cli.options import (
    DrawOptions,
    LawOptions,
    ModelOptions,
    Quiet,
    argument,
    option,
)
from scenewright.cli.output_folder import plan_folder
from scenewright.cli.views import ViewKind, save_scene, write_view
from scenewright.errors import InputError
from scenewright.files import is_plan_file

if TYPE_CHECKING:
    from scenewright.graph.run import Scene
    from scenewright.scene.plan_file import PlanFile

MOST_TEXT = 1 << 20
OFFERED = 8
"""Candidates per agent that a recording shows."""


@dataclass(frozen=True, kw_only=True)
class MakeOptions(LawOptions):
    """How `make` makes a scene, and what it writes."""

    model: ModelOptions
    seed: int = option(0, "The same seed makes the same scene.")
    refiner: str = option(
        "trajnet", "Learned refinement of the tracks, or none.", envvar="SCENEWRIGHT_REFINER"
    )
    drawn: DrawOptions
    profile: Literal["full", "paper"] = option(
        "full", "Keys of scene.json: all, or those of the paper's Listing 1 alone."
    )
    out: str | None = option(None, "Folder to write; scenes/ID if none is named.")
    force: bool = option(False, "Write into a folder that holds other files, too.")
    gif: bool = option(False, "Add an animation, scene.gif.")
    html: bool = option(False, "Add a page that plays and explains it, scene.html.")
    no_picture: bool = option(False, "No scene.png.")
    no_recording: bool = option(False, "No scene.rrd.")


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


def make(
    *,
    text: str = argument(..., "What shall happen, or a plan as a .yaml file; `-` is stdin."),
    options: MakeOptions,
    quiet: Quiet = False,
) -> Result:
    """Make a verified scene from an instruction or a plan and write it to a folder."""
    from scenewright.cli.scene_summary import summarize_scene
    from scenewright.graph.plan_faults import check_plan
    from scenewright.graph.run import synthesize
    from scenewright.scene.plan_file import PlanFile

    asked, backend = read_request(text), options.model.load()

    def draw(kind: ViewKind) -> Callable[[Path], None]:
        return lambda path: write_view(kind, path, record, proof)

    with show_progress(quiet=quiet) as log:
        if isinstance(asked, PlanFile):
            check_plan(asked, intersection=options.intersection)
        choose = plan_folder(options.out, force=options.force)
        scene = synthesize(asked, backend=backend, log=log, **options.pass_on(synthesize))
        record, proof = scene.record, scene.proof
        target = choose(record.meta.scene_id)
        if not quiet:
            tell(summarize_scene(record, proof))
        views: dict[str, tuple[bool, Callable[[Path], None]]] = {
            "scene.png": (not options.no_picture, draw("png")),
            "scene.rrd": (not options.no_recording, partial(_record, scene)),
            "scene.gif": (options.gif, draw("gif")),
            "scene.html": (options.html, draw("html")),
        }
        folder, files, warnings = save_scene(
            target,
            scene.list_files(profile=options.profile),
            {name: view for name, (wanted, view) in views.items() if wanted},
            partial(log, "writing"),
        )
    ran = scene.provenance["refinement"]
    if scene.provenance["refiner"] == "trajnet" and ran["refiner"] == "none":
        warnings.insert(0, ran["note"])
    return Result(
        {
            "scene_id": record.meta.scene_id,
            "folder": str(folder),
            "files": files,
            **proof.build_verdict(),
            "events": record.to_json()["events"],
            "agents": len(record.agents),
            "seed": record.meta.seed,
            "intersection": record.meta.intersection,
            "warnings": warnings,
        },
        f"{folder}\n",
        summary=[f"  {folder}: {', '.join(files)}"],
        notes=[f"warning: {warning}" for warning in warnings],
    )


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
