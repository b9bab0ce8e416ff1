"""A folder of scenes, one sub-folder each, and its two halves."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from pydantic import ValidationError

from scenewright.errors import InputError
from scenewright.evals.understanding.labels import RELATIONS, Labels, labels_of
from scenewright.evals.understanding.observing import code_of
from scenewright.graph.run import load_scene
from scenewright.scene.events import Proof
from scenewright.scene.record import SceneRecord

Split = Literal["dev", "test"]
SPLITS: tuple[Split, ...] = ("dev", "test")
EVENTS_AT = (6.0, 20.0)
"""When what is to be understood happens [s] (SEMANTICS section 6): not while it is observed."""


@dataclass(frozen=True, eq=False)
class Case:
    """One scene to be understood.

    Attributes:
        id: name of its folder; code: what it is called outside.
        named: the gravest event that it was made for; None if for none.
    """

    id: str
    record: SceneRecord
    labels: Labels
    named: str | None = None

    @property
    def code(self) -> str:
        """The code of the scene."""
        return code_of(self.id)


def split_of(scene: str) -> Split:
    """The half a scene belongs to, by the hash of its id: the same whatever else is there."""
    return SPLITS[int(code_of(scene)[-1], 16) % 2]


def scene_ids(folder: Path, *, split: Split | None) -> list[str]:
    """Ids of the scenes in a folder, sorted.

    Raises:
        InputError: no such folder, or no scene of this half in it.
    """
    if not folder.is_dir():
        raise InputError(f"{folder} is no folder of scenes")
    try:
        found = sorted(each.name for each in folder.iterdir() if (each / "scene.json").is_file())
    except OSError as error:
        raise InputError(f"cannot read {folder}: {error.strerror or error}") from error
    chosen = [each for each in found if split is None or split_of(each) == split]
    if not chosen:
        half = "" if split is None else f" of the {split} half"
        raise InputError(
            f"{folder} holds no scene{half}: it must have one sub-folder per scene, "
            "each with a scene.json and a proof.json"
        )
    return chosen


def read_cases(folder: Path, *, split: Split | None = None) -> Iterator[Case]:
    """The scenes of a folder, in the order of their ids.

    Raises:
        InputError: as `scene_ids`; or a file is missing or is not what it should be.
    """
    for name in scene_ids(folder, split=split):
        yield read_case(folder / name)


def read_case(folder: Path) -> Case:
    """The scene in a folder."""
    record = load_scene(folder)
    proof = _proof(folder / "proof.json")
    there = {event.type for event in proof.events}
    named = next((kind for kind in RELATIONS if kind in there), None)
    return Case(folder.name, record, labels_of(record, proof, scene=folder.name), named)


def foreseeable(case: Case) -> bool:
    """Whether every event that was asked for happens when it can be foreseen; following lasts."""
    first, last = EVENTS_AT
    asked = {frozenset((each.from_, each.to)) for each in case.record.relations}
    times = [
        each.time
        for each in case.record.events
        if each.type != "follow" and frozenset((each.from_, each.to)) in asked
    ]
    return all(time is None or first <= time <= last for time in times)


def _proof(file: Path) -> Proof:
    try:
        return Proof.model_validate_json(file.read_bytes())
    except OSError as error:
        raise InputError(f"cannot read {file}: {error.strerror or error}") from error
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        where = ".".join(str(part) for part in first["loc"]) or "file"
        raise InputError(f"{file} is not a proof: {where}: {first['msg']}") from error
