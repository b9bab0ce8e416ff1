"""`scenewright export`: scenes in the formats of other simulators and planners."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from scenewright.cli.batch import Out
from scenewright.cli.common_options import Json, argument, option
from scenewright.cli.console import count, format_one_line, log_line, write_result

To = Annotated[
    str, typer.Option("--to", metavar="FORMAT", help="Format; docs/exports.md lists them all.")
]
Form = Annotated[
    str | None,
    typer.Option(help="Form, of formats with several: replay, reactive; window, whole, example."),
]
Ego = Annotated[
    str | None, typer.Option(metavar="NAME", help="Agent that is left to you, such as vehicle-1.")
]


def export(
    *,
    scenes: list[str] = argument(..., "scene.json, or folders of scenes.", metavar="SCENE..."),
    to: To,
    out: Out,
    form: Form = None,
    ego: Ego = None,
    intersection: str | None = option(None, "Map to use, not the one the scene names."),
    plan: str | None = option(
        None, "Plan whose open speeds become OpenSCENARIO distributions.", metavar="F"
    ),
    as_json: Json = False,
) -> None:
    """Write scenes in another format; docs/exports.md describes each."""
    from scenewright.cli.verify import list_scene_files
    from scenewright.graph.export import export as write

    given = [each for path in scenes for each in list_scene_files(path)]
    log_files(
        write(given, to, Path(out), form=form, ego=ego, intersection=intersection, plan=plan),
        scenes=len(given), to=to, out=out, as_json=as_json,
    )  # fmt: skip


def log_files(files: list[Path], *, scenes: int, to: str, out: str, as_json: bool) -> None:
    """What was written: one object, or the folder on stdout and a line on stderr."""
    if not as_json:
        counts = f"{count(scenes, 'scene')} as {to}: {count(len(files), 'file')}"
        log_line(format_one_line(counts))
    facts = {"format": to, "scenes": scenes, "out": out, "files": [str(file) for file in files]}
    write_result(facts, f"{out}\n", as_json=as_json)
