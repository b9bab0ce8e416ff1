"""What somebody believes about scenes: one row per scene and window, anybody's, checked."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from pydantic import Field, ValidationError

from scenewright.errors import InputError
from scenewright.evals.understanding.labels import Relation
from scenewright.evals.understanding.observing import ObservationRow
from scenewright.scene.base import Model

MOST_BYTES = 512_000_000
_LONGEST = 200


class RelationRow(Model):
    """A relation somebody expects; of a yielding, `from` gives way."""

    type: Literal["collision", "yielding", "near_miss"]
    from_: str = Field(alias="from", max_length=64)
    to: str = Field(max_length=64)


class PredictionRow(Model):
    """What is expected of one scene after one window.

    Attributes:
        exits: side by agent; None where the method does not say where anybody leaves.
        relations: everything expected; None where the method does not speak of relations.
    """

    scene: str = Field(max_length=64)
    window: float
    exits: dict[str, str] | None = None
    relations: tuple[RelationRow, ...] | None = None


@dataclass(frozen=True)
class Prediction:
    """A checked prediction.

    Attributes:
        exits, relations: as in `PredictionRow`; seconds: what it took, None if nobody measured.
    """

    exits: Mapping[str, str] | None
    relations: tuple[Relation, ...] | None
    seconds: float | None = None


def row_of(observation: ObservationRow, prediction: Prediction) -> PredictionRow:
    """The prediction as a row."""
    relations = prediction.relations
    return PredictionRow(
        scene=observation.scene,
        window=observation.window,
        exits=None if prediction.exits is None else dict(prediction.exits),
        relations=None
        if relations is None
        else tuple(
            RelationRow.model_validate({"type": r.type, "from": r.from_, "to": r.to})
            for r in relations
        ),
    )


def read_rows(file: Path) -> Iterator[tuple[int, PredictionRow]]:
    """(line, row) of a file of predictions.

    Raises:
        InputError: unreadable; names the line and what to mend.
    """
    try:
        if file.stat().st_size > MOST_BYTES:
            raise InputError(f"{file} is larger than {MOST_BYTES // 10**6} MB")
        lines = file.read_bytes().splitlines()
    except OSError as error:
        raise InputError(f"cannot read {file}: {error.strerror or error}") from error
    for number, line in enumerate(lines, start=1):
        if line.strip():
            yield number, _row(line, f"{file}, line {number}")


def _row(line: bytes, where: str) -> PredictionRow:
    try:
        return PredictionRow.model_validate(json.loads(line.decode("utf-8")))
    except (UnicodeDecodeError, json.JSONDecodeError, RecursionError) as error:
        raise InputError(f"{where}: not a JSON object: {str(error)[:_LONGEST]}") from error
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        place = ".".join(str(part) for part in first["loc"]) or "row"
        raise InputError(f"{where}: {place[:_LONGEST]}: {first['msg']}") from error


def checked(
    row: PredictionRow, seen: ObservationRow, *, sides: tuple[str, ...], where: str
) -> Prediction:
    """The row's prediction, if it speaks of agents and sides that there are.

    Raises:
        InputError: says what to mend.
    """
    ids = {agent.id for agent in seen.agents}
    for agent, side in (row.exits or {}).items():
        _known(agent, ids, where)
        if side not in sides:
            raise InputError(f"{where}: exit {_shown(side)} is none of {', '.join(sides)}")
    for each in row.relations or ():
        _known(each.from_, ids, where)
        _known(each.to, ids, where)
        if each.from_ == each.to:
            raise InputError(f"{where}: {each.type} of {each.from_} with itself")
    relations = (
        None
        if row.relations is None
        else tuple(Relation(r.type, r.from_, r.to) for r in row.relations)
    )
    if relations is not None and len({r.key for r in relations}) < len(relations):
        raise InputError(f"{where}: one relation twice")
    return Prediction(row.exits, relations)


def _known(agent: str, ids: set[str], where: str) -> None:
    if agent not in ids:
        raise InputError(f"{where}: no agent {_shown(agent)} was seen in that scene by then")


def _shown(text: str) -> str:
    return repr(text if len(text) <= 40 else text[:37] + "...")


def read_predictions(
    file: Path, observations: Mapping[tuple[str, float], ObservationRow], *, sides: tuple[str, ...]
) -> dict[tuple[str, float], Prediction]:
    """Predictions by scene and window, complete for every window that the file speaks of.

    Raises:
        InputError: unknown or missing scenes, a row twice, or as `checked`.
    """
    found: dict[tuple[str, float], Prediction] = {}
    for number, row in read_rows(file):
        where, key = f"{file}, line {number}", (row.scene, row.window)
        if key not in observations:
            known = any(scene == row.scene for scene, _ in observations)
            what = f"window {row.window:g}" if known else f"scene {_shown(row.scene)}"
            raise InputError(f"{where}: there is no {what} in what is scored")
        if key in found:
            raise InputError(f"{where}: a second row for scene {row.scene} at {row.window:g} s")
        found[key] = checked(row, observations[key], sides=sides, where=where)
    if not found:
        raise InputError(f"{file} holds no predictions")
    _complete(file, found, observations)
    return found


def _complete(
    file: Path,
    found: Mapping[tuple[str, float], Prediction],
    observations: Mapping[tuple[str, float], ObservationRow],
) -> None:
    windows = {window for _, window in found}
    missing = [key for key in observations if key[1] in windows and key not in found]
    if missing:
        scene, window = missing[0]
        raise InputError(
            f"{file} has no row for scene {scene} at {window:g} s ({len(missing)} rows are "
            "missing); every scene needs one at each window that is predicted"
        )
    for part in ("exits", "relations"):
        for window in sorted(windows):
            said = {getattr(p, part) is None for (_, w), p in found.items() if w == window}
            if len(said) > 1:
                raise InputError(
                    f"{file} gives {part} for some scenes at {window:g} s and not for others; "
                    "give them for all, or leave them out"
                )


def jsonl(rows: Iterable[Model]) -> bytes:
    """Rows as lines of JSON."""
    return "".join(
        json.dumps(_plain(row), ensure_ascii=False, separators=(",", ":")) + "\n" for row in rows
    ).encode("utf-8", "backslashreplace")


def _plain(row: Model) -> dict[str, Any]:
    return row.model_dump(mode="json", by_alias=True, exclude_none=isinstance(row, PredictionRow))
