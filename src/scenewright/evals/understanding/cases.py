"""Scenes to be understood: a folder with one sub-folder per scene, in two halves."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from pydantic import ConfigDict, Field

from scenewright.errors import InputError
from scenewright.evals.understanding.observation import hash_agents, hash_scene
from scenewright.graph.run import load_scene
from scenewright.graph.written_proof import read_proof
from scenewright.scene.base import AgentClass, Compass
from scenewright.scene.events import Proof
from scenewright.scene.record import SceneRecord

Split = Literal["dev", "test"]
EVENTS_AT = (6.0, 20.0)
"""Requested events lie between these times [s] (SEMANTICS section 6): after the observation."""


@dataclass(frozen=True, eq=False)
class SceneCase:
    """One scene or clip to be understood.

    Attributes:
        scene: name of the scene's folder; id: the same, or of the clip cut from it.
        named: the gravest event it was made for; None if for none.
    """

    scene: str
    id: str
    record: SceneRecord
    labels: Labels
    named: str | None = None

    @property
    def code(self) -> str:
        """Hash of the id."""
        return hash_scene(self.id)


def assign_split(scene: str) -> Split:
    """Assign a scene to a half by the hash of its id, whatever other scenes there are."""
    return "test" if int(hash_scene(scene)[-1], 16) % 2 else "dev"


def list_scenes(folder: Path, *, split: Split | None) -> list[str]:
    """List the ids of the scenes in a folder, sorted.

    Raises:
        InputError: no such folder, or no scene of this half in it.
    """
    if not folder.is_dir():
        raise InputError(f"{folder} is no folder of scenes")
    try:
        found = sorted(each.name for each in folder.iterdir() if (each / "scene.json").is_file())
    except OSError as error:
        raise InputError(f"cannot read {folder}: {error.strerror or error}") from error
    kept = [each for each in found if split is None or assign_split(each) == split]
    if not kept:
        half = "" if split is None else f" of the {split} half"
        raise InputError(
            f"{folder} holds no scene{half}: it must have one sub-folder per scene, "
            "each with a scene.json and a proof.json"
        )
    return kept


def read_case(folder: Path) -> SceneCase:
    """Read the scene in a folder.

    Raises:
        InputError: a file is missing or is not what it should be.
    """
    record, proof = load_scene(folder), read_proof(folder / "proof.json")
    types = {event.type for event in proof.events}
    named = next((kind for kind in RELATIONS if kind in types), None)
    return SceneCase(
        folder.name, folder.name, record, extract_labels(record, proof, scene=folder.name), named
    )  # fmt: skip


def is_foreseeable(case: SceneCase) -> bool:
    """Whether every requested event happens within `EVENTS_AT`; following lasts and is exempt."""
    first, last = EVENTS_AT
    requested = {frozenset((each.from_, each.to)) for each in case.record.relations}
    return all(
        each.time is None or first <= each.time <= last
        for each in case.record.events
        if each.type != "follow" and frozenset((each.from_, each.to)) in requested
    )


RELATIONS = ("collision", "yielding", "near_miss")
"""Events that relate two agents, gravest first; following is none (SEMANTICS section 4)."""


@dataclass(frozen=True)
class PairRelation:
    """An event between two agents, by hashed id; of a yielding, `from_` gives way.

    Attributes:
        time: of the event [s]; None in predictions, where it is not scored.
    """

    type: Annotated[str, Field(pattern=f"^({'|'.join(RELATIONS)})$")]
    from_: Annotated[str, Field(alias="from", max_length=64)]
    to: Annotated[str, Field(max_length=64)]
    time: Annotated[float | None, Field(exclude=True)] = None
    __pydantic_config__ = ConfigDict(extra="forbid")

    @property
    def key(self) -> tuple[str, str, str]:
        """What a prediction must get right; the order of agents matters for yielding only."""
        one, two = self.from_, self.to
        if self.type != "yielding":
            one, two = sorted((one, two))
        return (self.type, one, two)


@dataclass(frozen=True)
class Labels:
    """The truth about one scene.

    Attributes:
        exits: side by agent; types, starts: class and first moment [s] by agent.
        relations: every collision, yielding and near miss.
    """

    exits: Mapping[str, Compass]
    types: Mapping[str, AgentClass]
    starts: Mapping[str, float]
    relations: tuple[PairRelation, ...]


def extract_labels(record: SceneRecord, proof: Proof, *, scene: str) -> Labels:
    """Extract the labels of a scene; events between background agents count like any others."""
    codes = hash_agents(scene, (agent.id for agent in record.agents))
    found = [
        PairRelation(event.type, codes[event.from_], codes[event.to], event.time)
        for event in (*proof.events, *proof.incidental)
        if event.type in RELATIONS
    ]
    return Labels(
        exits={codes[agent.id]: agent.exit for agent in record.agents},
        types={codes[agent.id]: agent.type for agent in record.agents},
        starts={codes[agent.id]: agent.spawn_time for agent in record.agents},
        relations=tuple(sorted(found, key=lambda each: each.key)),
    )
