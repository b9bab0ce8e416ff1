"""`scenewright find`: what a text or a plan asks for, looked for in recordings."""

from __future__ import annotations

import glob
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from scenewright.cli.common_options import Json
from scenewright.cli.console import (
    format_columns,
    format_one_line,
    log_line,
    write_json,
    write_stdout,
)
from scenewright.cli.errors import UNUSABLE
from scenewright.cli.output_folder import try_file, try_folder
from scenewright.errors import InputError, Unsatisfiable
from scenewright.files import write_atomically

if TYPE_CHECKING:
    from scenewright.graph.find import Hit, Query


def find(
    query: Annotated[str, typer.Argument(help="What happens, or a plan as a .yaml file.")],
    paths: Annotated[
        list[str],
        typer.Argument(metavar="TRACKS...", help="What `verify` reads: files, folders, patterns."),
    ],
    intersection: Annotated[
        str | None,
        typer.Option("--intersection", "--map", help="The map of the tracks, in their frame."),
    ] = None,
    out: Annotated[
        str | None,
        typer.Option(help="Folder for a clip of every hit; needs a map.", callback=try_folder),
    ] = None,
    vary: Annotated[
        str | None,
        typer.Option(metavar="F", help="Write the best hit as a plan to vary.", callback=try_file),
    ] = None,
    limit: Annotated[int, typer.Option(help="Most hits.", min=1)] = 100,
    lenient: Annotated[
        bool, typer.Option("--lenient", help="Count hits of which something cannot be tested.")
    ] = False,
    as_json: Json = False,
) -> None:
    """Find what a text or a plan asks for in recordings: who, when, and what was measured."""
    from scenewright.graph.find import format_variation, read_query, save_clip

    asked = read_query(query, intersection=intersection)
    unusable: list[str] = []
    clips: list[str] = []
    hits: list[Hit] = []
    doubtful: list[Hit] = []
    for hit in _search(asked, paths, intersection, unusable, lenient=lenient):
        if hit.untested and not lenient:
            doubtful.append(hit)
            continue
        hits.append(hit)
        if out is not None:
            clips.append(str(save_clip(hit, Path(out) / f"{len(hits):03}")))
        if len(hits) == limit:
            log_line(f"note: these are the first {limit}; --limit N finds more")
            break
    if vary is not None and hits:
        best = min(hits, key=lambda hit: len(hit.untested))
        write_atomically(Path(vary), format_variation(best).encode())
    if as_json:
        rows = [hit.to_json() for hit in hits]
        found = {"hits": rows, "clips": clips, "doubtful": len(doubtful), "unusable": unusable}
        write_json({"ok": not unusable, **found})
    else:
        write_stdout(_format_hits(hits))
    if doubtful:
        reasons = format_one_line("; ".join(doubtful[0].untested))
        log_line(f"{len(doubtful)} more in part not tested, which --lenient lists: {reasons}")
    for each in unusable:
        log_line(f"scenewright: {each}")
    if unusable:
        raise typer.Exit(UNUSABLE)


def _search(
    query: Query, paths: list[str], place: str | None, unusable: list[str], *, lenient: bool
) -> Iterator[Hit]:
    """The hits in all files; why one cannot be used goes to `unusable`."""
    from scenewright.cli.verify import list_scene_files
    from scenewright.graph.find import find_hits, list_untestable, load_sources

    for path in (own for each in paths for own in sorted(glob.glob(each)) or [each]):
        try:
            for source in (
                own for file in list_scene_files(path) for own in load_sources(file, place)
            ):
                for note in source.tracks.notes:
                    log_line(f"note: {format_one_line(f'{source.path}: {note}')}")
                if not lenient and (missing := "; ".join(list_untestable(query, source))):
                    say = f"{source.path}: not to be tested there: {missing}"
                    raise Unsatisfiable(f"{say}; --lenient looks for the rest")
                yield from find_hits(query, source)
        except (InputError, OSError) as error:
            unusable.append(format_one_line(str(error)))


def _format_hits(hits: list[Hit]) -> str:
    """A row for every hit, and below what of it is not tested."""
    from scenewright.cli.verify_tracks import format_evidence

    titles, rows, below = ("", "file", "time", "agents", "evidence"), [], []
    for n, hit in enumerate(hits, start=1):
        names = (f"{name} is {hit.source.tracks.names[k]}" for name, k in hit.agents.items())
        seen = (f"{e.type.replace('_', ' ')} {format_evidence(e)}" for e in hit.events)
        cells = (hit.source.path, f"{hit.time:.1f} s", ", ".join(names), "; ".join(seen))
        rows.append((str(n), *map(format_one_line, cells)))
        if hit.untested:
            below.append(f"{n}, not tested: {format_one_line('; '.join(hit.untested))}\n")
    table = format_columns(titles, rows, right={"time"}) if rows else ""
    return f"{len(hits)} hit{'' if len(hits) == 1 else 's'}\n{table}{''.join(below)}"
