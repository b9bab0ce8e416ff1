"""A dataset as the tables need it, and Table 2: how often an instruction becomes a scene."""

from __future__ import annotations

import subprocess
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import Any

from scenewright.dataset.batch.manifest import read_manifest
from scenewright.dataset.tables.parquet import read_table
from scenewright.errors import InputError
from scenewright.evals.bootstrap import Figure
from scenewright.graph.scene_files import load_scene
from scenewright.scene.record import SceneRecord

_COLUMNS = ("folder", "code", "asked", "backend", "verified", "relations")


@dataclass(frozen=True)
class InstructionRow:
    """One row of the dataset: an instruction and what became of it.

    Attributes:
        event: that it asks for, `normal` for none; None if unknown.
        verified: whether there is a scene that the checker confirms.
        scope: False where it was refused as no request for a scene.
    """

    folder: str | None
    backend: str
    event: str | None
    verified: bool
    scope: bool


@dataclass(frozen=True)
class Dataset:
    """A dataset on disk."""

    folder: Path
    manifest: Mapping[str, Any]
    rows: tuple[InstructionRow, ...]

    def read_scenes(self, rows: tuple[InstructionRow, ...]) -> Iterator[tuple[int, SceneRecord]]:
        """The scenes of some rows, numbered."""
        for number, row in enumerate(rows):
            if row.folder is not None:
                yield number, load_scene(self.folder / row.folder)

    @property
    def backends(self) -> tuple[str, ...]:
        """Those that planned, in order of their first row."""
        return tuple(dict.fromkeys(row.backend for row in self.rows))


def read_dataset(folder: Path) -> Dataset:
    """A dataset that `batch`, `agent` or `dataset paper` wrote.

    Raises:
        InputError: it is none, or damaged.
    """
    manifest = read_manifest(folder)
    try:
        tables = [read_table(folder / "tables", name, _COLUMNS) for name in ("scenes", "refused")]
        rows = []
        for row in chain.from_iterable(tables):
            made = "folder" in row
            kinds = set(row["relations"]) if made else set()
            seen = None if not made or len(kinds) > 1 else next(iter(kinds), "normal")
            event, asked = row["asked"] or seen, row["asked"] is not None
            # A scene that shows something else than was asked for does not satisfy it.
            right = made and bool(row["verified"]) and seen in (event, None)
            scope = asked or row.get("code") not in ("unusable_input", "out_of_scope")
            rows.append(InstructionRow(row.get("folder"), row["backend"], event, right, scope))
    except (OSError, ValueError, KeyError) as error:
        raise InputError(f"cannot read the tables of {folder}: {error}") from error
    return Dataset(folder, manifest, tuple(rows))


def find_commit() -> str | None:
    """The commit of the code, where it runs from a checkout."""
    try:
        done = subprocess.run(
            ["git", "rev-parse", "--short", "HEAD"],
            cwd=Path(__file__).parent, capture_output=True, text=True, check=False, timeout=10,
        )  # fmt: skip
    except (OSError, subprocess.SubprocessError):
        return None
    return done.stdout.strip() or None


RARE = ("collision", "yielding")
"""What the paper's overall rate is over."""


@dataclass(frozen=True)
class RobustnessRate:
    """ISR of one backend: verified scenes / instructions given (SEMANTICS section 6).

    Attributes:
        event: `overall` is collisions and yields, `all` every instruction in scope, `given` those
            out of scope, or not understood, as well.
    """

    backend: str
    event: str
    share: Figure


def compute_robustness(dataset: Dataset) -> tuple[RobustnessRate, ...]:
    """A rate for each backend and event; retries of an order count too."""
    found = []
    for backend in dataset.backends:
        given = [row for row in dataset.rows if row.backend == backend]
        mine = [row for row in given if row.scope]
        groups = {
            event: [row for row in mine if (row.event or "unknown") == event]
            for event in dict.fromkeys(row.event or "unknown" for row in mine)
        }
        groups["overall"] = [row for row in mine if row.event in RARE]
        groups["all"] = mine
        groups["given"] = given if len(given) > len(mine) else []
        found += [
            RobustnessRate(
                backend, event, Figure.of_count(sum(r.verified for r in rows), len(rows))
            )
            for event, rows in groups.items()
            if rows
        ]
    return tuple(found)
