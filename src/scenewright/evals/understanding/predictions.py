"""Predictions of any method: one row per scene and window, checked against what was observed."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from pydantic import Field, ValidationError

from scenewright.errors import InputError, describe_misfit
from scenewright.evals.understanding.cases import PairRelation
from scenewright.evals.understanding.observation import ObservedScene
from scenewright.scene.base import Model

MOST_BYTES = 512_000_000
_LONGEST = 200
SceneWindow = tuple[str, float]
"""Hash of the scene, window [s]."""


class PredictionRow(Model):
    """The prediction for one scene after one window.

    Attributes:
        exits: side by agent; None where the method does not predict exits.
        relations: all that are expected; None where the method does not predict relations.
    """

    scene: str = Field(max_length=64)
    window: float
    exits: dict[str, str] | None = None
    relations: tuple[PairRelation, ...] | None = None


class ScenePrediction(NamedTuple):
    """A prediction for one scene: `exits` and `relations` of a `PredictionRow`."""

    exits: Mapping[str, str] | None
    relations: tuple[PairRelation, ...] | None


def read_predictions(
    file: Path, observations: Mapping[SceneWindow, ObservedScene], *, sides: tuple[str, ...]
) -> dict[SceneWindow, ScenePrediction]:
    """Read predictions by scene and window, complete for every window in the file.

    Raises:
        InputError: unreadable, unknown or missing scenes, agents or sides, or a row twice; names
            the line and what to mend.
    """
    try:
        if file.stat().st_size > MOST_BYTES:
            raise InputError(f"{file} is larger than {MOST_BYTES // 10**6} MB")
        lines = file.read_bytes().splitlines()
    except OSError as error:
        raise InputError(f"cannot read {file}: {error.strerror or error}") from error
    found: dict[SceneWindow, ScenePrediction] = {}
    for number, line in enumerate(lines, start=1):
        if not line.strip():
            continue
        where = f"{file}, line {number}"
        try:
            row = PredictionRow.model_validate_json(line)
        except ValidationError as error:
            raise InputError(f"{where}: {describe_misfit(error, 'row')[:_LONGEST]}") from error
        key = (row.scene, row.window)
        if key not in observations:
            known = any(scene == row.scene for scene, _ in observations)
            what = f"window {row.window:g}" if known else f"scene {_shorten(row.scene)}"
            raise InputError(f"{where}: there is no {what} in what is scored")
        if key in found:
            raise InputError(f"{where}: a second row for scene {row.scene} at {row.window:g} s")
        found[key] = _check_row(row, observations[key], sides, where)
    if not found:
        raise InputError(f"{file} holds no predictions")
    _check_complete(file, found, observations)
    return found


def _check_row(
    row: PredictionRow, observation: ObservedScene, sides: tuple[str, ...], where: str
) -> ScenePrediction:
    """The row's prediction, if it speaks of agents and sides that exist."""
    relations = row.relations or ()
    for agent in (*(row.exits or ()), *(a for r in relations for a in (r.from_, r.to))):
        if agent not in observation.ids:
            raise InputError(f"{where}: no agent {_shorten(agent)} was seen in that scene by then")
    for side in (row.exits or {}).values():
        if side not in sides:
            raise InputError(f"{where}: exit {_shorten(side)} is none of {', '.join(sides)}")
    for each in relations:
        if each.from_ == each.to:
            raise InputError(f"{where}: {each.type} of {each.from_} with itself")
    if len({r.key for r in relations}) < len(relations):
        raise InputError(f"{where}: one relation twice")
    return ScenePrediction(row.exits, row.relations)


def _shorten(text: str) -> str:
    return repr(text if len(text) <= 40 else text[:37] + "...")


def _check_complete(
    file: Path,
    found: Mapping[SceneWindow, ScenePrediction],
    observations: Mapping[SceneWindow, ObservedScene],
) -> None:
    windows = sorted({window for _, window in found})
    missing = [key for key in observations if key[1] in windows and key not in found]
    if missing:
        scene, window = missing[0]
        raise InputError(
            f"{file} has no row for scene {scene} at {window:g} s ({len(missing)} rows are "
            "missing); every scene needs one at each window that is predicted"
        )
    for part in ("exits", "relations"):
        for window in windows:
            if len({getattr(p, part) is None for (_, w), p in found.items() if w == window}) > 1:
                raise InputError(
                    f"{file} gives {part} for some scenes at {window:g} s and not for others; "
                    "give them for all, or leave them out"
                )


def format_predictions(predictions: Mapping[SceneWindow, ScenePrediction]) -> bytes:
    """Format predictions as lines of JSON, without the parts that they leave out."""
    rows = (
        PredictionRow(scene=scene, window=window, **said._asdict())
        for (scene, window), said in predictions.items()
    )
    return format_jsonl(
        row.model_dump(mode="json", by_alias=True, exclude_none=True) for row in rows
    )


def format_jsonl(rows: Iterable[Mapping[str, Any]]) -> bytes:
    """Format rows as lines of JSON."""
    lines = (json.dumps(row, ensure_ascii=False, separators=(",", ":")) + "\n" for row in rows)
    return "".join(lines).encode("utf-8", "backslashreplace")
