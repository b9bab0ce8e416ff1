"""Scenes to be understood, in two halves, and what may be seen of one up to a moment.

A folder has a sub-folder for each scene. Observations are motion, sizes and signals, and nothing of
the future: roles, names, entries, routes, goals, events and agents still to come are left out. Ids
and their order come from a hash, so that they neither count nor rank agents.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import ConfigDict, Field

from scenewright.errors import InputError
from scenewright.graph.scene_files import load_scene, read_proof
from scenewright.scene.base import AgentClass, Compass, FloatArray, frozen
from scenewright.scene.events import Proof
from scenewright.scene.record import SceneRecord, SignalRecord
from scenewright.scene.track import STEP

WINDOWS = (0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0, 4.5, 5.0)
"""Observation windows [s] of the benchmark."""
_SALT = "scenewright-understanding-1"


@dataclass(frozen=True, eq=False)
class ObservedAgent:
    """One agent as observed so far, every 0.1 s.

    Attributes:
        id: a hash; start: when it was first seen [s]; left: it is no longer there.
        xy: [T, 2] [m]; heading: [T] [rad]; speed: [T] mean of the steps on both sides [m/s];
            moved: [T] distance so far [m].
    """

    id: str
    type: AgentClass
    start: float
    xy: FloatArray
    heading: FloatArray
    speed: FloatArray
    moved: FloatArray
    length: float
    width: float
    left: bool

    @property
    def is_vehicle(self) -> bool:
        """Whether it is on wheels, so that its footprint is a rectangle."""
        return self.type != "pedestrian"

    @property
    def standstill(self) -> float:
        """For how long it has been stationary [s]."""
        moving = np.flatnonzero(self.speed > 0.3)
        return 0.1 * (len(self.speed) - 1 - (int(moving[-1]) if len(moving) else -1))

    def measure_acceleration(self, count: int) -> float:
        """Acceleration over the last samples [m/s^2]."""
        last = self.speed[-count:]
        return float(last[-1] - last[0]) / (0.1 * max(len(last) - 1, 1))


@dataclass(frozen=True, eq=False)
class ObservedScene:
    """A scene as observed so far.

    Attributes:
        scene: hash of the scene's id; now: end of the window [s]; hour: of the day.
        agents: in the order of their ids; lights: cut at the window's end.
    """

    scene: str
    intersection: str
    now: float
    hour: int
    agents: tuple[ObservedAgent, ...]
    lights: tuple[SignalRecord, ...]

    @property
    def ids(self) -> tuple[str, ...]:
        """Ids of the agents, in order."""
        return tuple(agent.id for agent in self.agents)

    def to_json(self) -> dict[str, Any]:
        """Convert to a row of a file, as docs/understanding.md has it."""
        agents = [
            {
                "id": agent.id, "type": agent.type, "start": agent.start,
                "trajectory": agent.xy.tolist(), "heading": agent.heading.tolist(),
                "length": agent.length, "width": agent.width, "left": agent.left,
            }
            for agent in self.agents
        ]  # fmt: skip
        lights = [light.model_dump(mode="json") for light in self.lights]
        return {
            "scene": self.scene, "window": self.now, "intersection": self.intersection,
            "hour": self.hour, "agents": agents, "lights": lights,
        }  # fmt: skip


def hash_scene(scene: str) -> str:
    """Hash the id of a scene, as names of folders may say what is in them."""
    return hashlib.sha256(f"{_SALT}:{scene}".encode("utf-8", "surrogatepass")).hexdigest()[:16]


def hash_agents(scene: str, ids: Iterable[int]) -> dict[int, str]:
    """Hash the id of every agent of a scene; the same in all windows.

    Raises:
        InputError: two agents share a hash.
    """
    codes = {
        each: hashlib.sha256(f"{_SALT}:{scene}:{each}".encode()).hexdigest()[:8] for each in ids
    }
    if len(set(codes.values())) < len(codes):
        raise InputError(f"two agents of scene {scene} have one id")
    return codes


def observe(record: SceneRecord, *, scene: str, window: float) -> ObservedScene:
    """Cut a scene to what is seen in its first `window` seconds.

    Args:
        scene: the scene's id, from which the hashes are made.

    Raises:
        InputError: the scene's step is not 0.1 s, or the window is shorter than that.
    """
    if abs(record.meta.step - STEP) > 1e-9:
        raise InputError(f"scene {scene} has a step of {record.meta.step} s, not {STEP} s")
    if not STEP <= window <= record.meta.duration:
        raise InputError(f"a window is from {STEP} s to the length of the scene, got {window} s")
    codes = hash_agents(scene, (agent.id for agent in record.agents))
    agents = []
    for agent in record.agents:
        count = int(np.floor((window - agent.spawn_time) / STEP + 1e-6)) + 1
        if count < 1:
            continue
        xy = frozen(np.array(agent.trajectory[:count], dtype=np.float64).reshape(-1, 2))
        steps = np.hypot(*np.diff(xy, axis=0).T)
        padded = np.concatenate([steps[:1], steps, steps[-1:]]) / STEP
        speed = (padded[1:] + padded[:-1]) / 2 if len(steps) else np.zeros(1)
        heading = frozen(np.unwrap(np.array(agent.heading[:count], dtype=np.float64)))
        agents.append(ObservedAgent(
            codes[agent.id], agent.type, agent.spawn_time, xy, heading, speed,
            np.concatenate([[0.0], np.cumsum(steps)]), agent.length, agent.width,
            left=count > len(agent.trajectory),
        ))  # fmt: skip
    lights = [
        signal.model_copy(update={"end": min(signal.end, window)})
        for signal in record.signals
        if signal.start < window
    ]
    return ObservedScene(
        hash_scene(scene),
        record.meta.intersection,
        float(window),
        int(record.meta.timestamp // 3600) % 24,
        tuple(sorted(agents, key=lambda agent: agent.id)),
        tuple(sorted(lights, key=lambda x: (x.stop_line or x.crosswalk or "", x.start))),
    )


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
    proof: Proof
    named: str | None = None

    @property
    def code(self) -> str:
        """Hash of the id."""
        return hash_scene(self.id)

    @cached_property
    def labels(self) -> Labels:
        """The truth; events between background agents count like any others."""
        agents = self.record.agents
        codes = hash_agents(self.id, (agent.id for agent in agents))
        found = [
            PairRelation(event.type, codes[event.from_], codes[event.to], event.time)
            for event in (*self.proof.events, *self.proof.incidental)
            if event.type in RELATIONS
        ]
        return Labels(
            exits={codes[agent.id]: agent.exit for agent in agents},
            types={codes[agent.id]: agent.type for agent in agents},
            starts={codes[agent.id]: agent.spawn_time for agent in agents},
            relations=tuple(sorted(found, key=lambda each: each.key)),
        )


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
    return SceneCase(folder.name, folder.name, record, proof, named)


def is_foreseeable(case: SceneCase) -> bool:
    """Whether every requested event happens within `EVENTS_AT`; following lasts and is exempt."""
    first, last = EVENTS_AT
    requested = {frozenset((relation.from_, relation.to)) for relation in case.record.relations}
    return all(
        event.time is None or first <= event.time <= last
        for event in case.record.events
        if event.type != "follow" and frozenset((event.from_, event.to)) in requested
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
