"""`scenewright export`: scenes in the formats of other simulators and planners."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from scenewright.cli.batch import Out
from scenewright.cli.common_options import Json
from scenewright.cli.console import format_one_line, log_line, write_json, write_stdout

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
    scenes: Annotated[
        list[str], typer.Argument(metavar="SCENE...", help="scene.json, or folders of scenes.")
    ],
    to: To,
    out: Out,
    form: Form = None,
    ego: Ego = None,
    intersection: Annotated[
        str | None, typer.Option(help="Map to use, not the one the scene names.")
    ] = None,
    plan: Annotated[
        str | None,
        typer.Option(metavar="F", help="Plan whose open speeds become OpenSCENARIO distributions."),
    ] = None,
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
    if as_json:
        names = [str(file) for file in files]
        write_json({"ok": True, "format": to, "scenes": scenes, "out": out, "files": names})
        return
    counts = f"{_count(scenes, 'scene')} as {to}: {_count(len(files), 'file')}"
    log_line(format_one_line(counts))
    write_stdout(f"{out}\n")


def _count(number: int, word: str) -> str:
    return f"{number} {word}" if number == 1 else f"{number} {word}s"
