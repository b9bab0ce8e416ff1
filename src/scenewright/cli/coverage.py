"""`scenewright coverage`: what the scenes of datasets cover, and what they lack."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from scenewright.cli.console import Result, format_columns
from scenewright.cli.errors import NOT_VERIFIED
from scenewright.cli.options import argument, option
from scenewright.cli.output_folder import try_file
from scenewright.dataset.tables.junit import Case, build_junit
from scenewright.errors import InputError
from scenewright.files import write_atomically

if TYPE_CHECKING:
    from scenewright.dataset.tables.coverage import Covered, Encounter

_BAR = 30
"""Longest bar of the table [characters]."""


def show_coverage(
    folders: list[str] = argument(..., "Datasets, sweeps, folders of scenes.", metavar="DIR..."),
    goal: str | None = option(None, "What is to be covered, how often.", metavar="GOALS.yaml"),
    fill: str | None = option(
        None, "Write rows for `batch` that ask for the rest.", metavar="ROWS.jsonl", check=try_file
    ),
    junit: str | None = option(
        None, "Write each goal as a test case.", metavar="F.xml", check=try_file
    ),
    plot: str | None = option(None, "Write a picture.", metavar="F.png", check=try_file),
) -> Result:
    """Count which bins of what was asked for and measured the scenes cover, and name the gaps.

    Exit code 0 if all goals are met, 1 if not.
    """
    from scenewright.dataset.batch.fill import build_fill
    from scenewright.dataset.batch.pictures import draw_coverage
    from scenewright.dataset.batch.sweep import measure_sweep
    from scenewright.dataset.tables.coverage import measure_coverage, read_goals

    goals = None if goal is None else read_goals(Path(goal))
    scenes, encounters = read_encounters(folders)
    covered = measure_coverage(encounters, goals)
    met = goals is None or not any(each.gaps for each in covered)
    shown = [*covered, *(each for name in folders for each in measure_sweep(Path(name)))]
    left: list[str] = []
    found: dict[str, Any] = {
        "scenes": scenes,
        "encounters": len(encounters),
        "items": list(map(to_json, shown)),
    }
    if fill is not None:
        taken = {each.name for name in folders for each in Path(name).rglob("fill-*")}
        rows, left = build_fill(covered, encounters, taken=taken)
        write_atomically(fill, "".join(json.dumps(row) + "\n" for row in rows).encode())
        found |= {"fill": len(rows), "not_askable": left}
    if junit is not None:
        write_atomically(junit, build_junit({"coverage": _list_test_cases(covered)}))
    if plot is not None:
        draw_coverage(Path(plot), shown)
    return Result(
        {"ok": met, **found},
        _format_table(shown, wanted=goals is not None),
        notes=[
            f"{scenes} verified scenes, {len(encounters)} encounters",
            *(f"not asked for: {line}" for line in left),
        ],
        code=0 if met else NOT_VERIFIED,
    )


def read_encounters(folders: Sequence[str]) -> tuple[int, list[Encounter]]:
    """How many verified scenes there are below the folders, and what they show.

    Raises:
        InputError: there is none, or a file cannot be read.
    """
    from scenewright.dataset.tables.coverage import list_encounters

    scenes, found = 0, []
    for path in (each for name in folders for each in sorted(Path(name).rglob("proof.json"))):
        try:
            proof = json.loads(path.read_bytes())
            if proof["verified"]:
                scene = json.loads(path.with_name("scene.json").read_bytes())
                found += list_encounters(scene, proof)
                scenes += 1
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise InputError(f"{path.parent} holds no scene with its proof: {error}") from error
    if not scenes:
        raise InputError(f"there is no verified scene in {', '.join(folders)}")
    return scenes, found


def to_json(covered: Covered) -> dict[str, Any]:
    """An item or a cross as `--json` has it."""
    bins = [{"bin": bin_, "count": n} for bin_, n in covered.counts.items()]
    return {"name": covered.name, "values": covered.values, "least": covered.least, "bins": bins,
            "gaps": list(map(covered.describe_gap, covered.gaps)),
            "infeasible": covered.shut}  # fmt: skip


def _format_table(covered: Sequence[Covered], *, wanted: bool) -> str:
    """The bins that are met, then the gaps in words."""
    rows, gaps = [], []
    for each in covered:
        head = (each.name, f"{each.wanted - len(each.gaps)} of {each.wanted}")
        most = max(each.counts.values(), default=0)
        for bin_, n in each.counts.items():
            if n:
                bar = "█" * round(_BAR * n / most)
                rows.append((*head, " and ".join(bin_), str(n), f"{n / each.values:.0%}", bar))
                head = ("", "")
        lacks = [each.describe_gap(bin_) if wanted else " and ".join(bin_) for bin_ in each.gaps]
        if lacks:
            gaps += lacks if wanted else [f"{each.name} has no {', '.join(lacks)}"]
        gaps += [f"{each.name} cannot be {', '.join(each.shut)}"] if each.shut else []
    titles = ("item", "bins", "bin", "n", "share", "")
    table = format_columns(titles, rows, right={"n", "share"})
    return table + "".join(f" {gap}\n" for gap in gaps)


def _list_test_cases(covered: Sequence[Covered]) -> list[Case]:
    """A test of each goal, which fails with its gaps."""
    return [
        Case(
            "coverage", each.name,
            "\n".join([f"{len(each.gaps)} of {each.wanted} bins lack encounters",
                       *map(each.describe_gap, each.gaps)]) if each.gaps else None,
        )
        for each in covered
    ]  # fmt: skip
