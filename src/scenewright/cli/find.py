"""`scenewright find`: what a text or a plan asks for, looked for in recordings."""

from __future__ import annotations

import glob
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from scenewright.cli.console import Result, count, format_columns, format_one_line
from scenewright.cli.errors import UNUSABLE
from scenewright.cli.options import Asked, argument, option
from scenewright.cli.output_folder import try_file, try_folder
from scenewright.errors import InputError, Unsatisfiable
from scenewright.files import write_atomically

if TYPE_CHECKING:
    from scenewright.graph.find import Hit


@dataclass(frozen=True)
class Search(Asked):
    """In which recordings something is looked for."""

    paths: list[str] = argument(
        ..., "What `verify` reads: files, folders, patterns.", metavar="TRACKS..."
    )
    intersection: str | None = option(
        None, "The map of the tracks, in their frame.", "--intersection", "--map"
    )
    limit: int = option(100, "Most hits.", min=1)
    lenient: bool = option(False, "Count hits of which something cannot be tested.")


def find(
    *,
    query: str = argument(..., "What happens, or a plan as a .yaml file."),
    asked: Search,
    out: str | None = option(
        None, "Folder for a clip of every hit; needs a map.", check=try_folder
    ),
    vary: str | None = option(
        None, "Write the best hit as a plan to vary.", metavar="F", check=try_file
    ),
) -> Result:
    """Find what a text or a plan asks for in recordings: who, when, and what was measured."""
    from scenewright.graph.find import format_variation, save_clip

    found = search(query, asked)
    clips = []
    if out is not None:
        for n, hit in enumerate(found.hits, start=1):
            clips.append(str(save_clip(hit, Path(out) / f"{n:03}")))
    if vary is not None and found.hits:
        best = min(found.hits, key=lambda hit: len(hit.untested))
        write_atomically(Path(vary), format_variation(best).encode())
    notes = [f"note: {note}" for note in found.notes]
    if found.doubtful:
        more = f"{len(found.doubtful)} more in part not tested"
        notes += [f"{more}, which --lenient lists: {'; '.join(found.doubtful[0].untested)}"]
    notes += [f"scenewright: {each}" for each in found.unusable]
    facts, code = found.to_json() | {"clips": clips}, UNUSABLE if found.unusable else 0
    return Result(facts, _format_hits(found.hits), notes=notes, code=code)


@dataclass(frozen=True, eq=False)
class Found:
    """What a search brought.

    Attributes:
        doubtful: hits of which something could not be tested, where those do not count.
        unusable: why files could not be used; notes: of the reader, and where the limit was met.
    """

    hits: list[Hit] = field(default_factory=list)
    doubtful: list[Hit] = field(default_factory=list)
    unusable: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    def to_json(self) -> dict[str, Any]:
        """The object that `--json` prints, and an agent's tool answers."""
        rows = [hit.to_json() for hit in self.hits]
        own = {"hits": rows, "doubtful": len(self.doubtful), "unusable": self.unusable}
        return {"ok": not self.unusable, **own}


def search(query: str | Mapping[str, Any], asked: Search) -> Found:
    """The hits of a text, a plan file or the fields of a plan in all files, at most so many.

    Raises:
        InputError, Unsatisfiable, BackendFault: as `synthesize`; some of it cannot be tested there.
    """
    from scenewright.cli.verify import list_scene_files
    from scenewright.graph.find import find_hits, list_untestable, load_sources, read_query

    place, limit, lenient = asked.intersection, asked.limit, asked.lenient
    wanted, found = read_query(query, intersection=place), Found()
    for path in (own for each in asked.paths for own in sorted(glob.glob(each)) or [each]):
        try:
            for source in (
                own for file in list_scene_files(path) for own in load_sources(file, place)
            ):
                for note in source.tracks.notes:
                    found.notes.append(format_one_line(f"{source.path}: {note}"))
                if not lenient and (missing := "; ".join(list_untestable(wanted, source))):
                    say = f"{source.path}: not to be tested there: {missing}"
                    raise Unsatisfiable(f"{say}; --lenient looks for the rest")
                for hit in find_hits(wanted, source):
                    (found.doubtful if hit.untested and not lenient else found.hits).append(hit)
                    if len(found.hits) == limit:
                        found.notes.append(f"these are the first {limit}; --limit N finds more")
                        return found
        except (InputError, OSError) as error:
            found.unusable.append(format_one_line(str(error)))
    return found


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
    return f"{count(len(hits), 'hit')}\n{table}{''.join(below)}"
