"""What may be seen of a scene up to a moment: motion, sizes and lights, and nothing else.

An observation must not tell what is to come. It holds neither roles, names, entries, routes, goals
nor events; who is still to come is not in it; ids and their order come from a hash, so that no
number counts agents or tells who was planned first; lights are cut at the moment of observation.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from typing import Any

import numpy as np
from pydantic import Field

from scenewright.errors import InputError
from scenewright.scene.base import AgentClass, Colour, FloatArray, Model, Point, frozen
from scenewright.scene.record import AgentRecord, SceneRecord, SignalRecord
from scenewright.scene.track import STEP

WINDOWS = (0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0, 4.5, 5.0)
"""How long is observed [s]: the curve."""
_SALT = "scenewright-understanding-1"


class SeenAgent(Model):
    """One agent as seen so far.

    Attributes:
        id: a code that means nothing.
        start: when it was first seen [s]; trajectory, heading: [m], [rad], every 0.1 s.
        left: it is no longer there.
    """

    id: str = Field(max_length=32)
    type: AgentClass
    start: float
    trajectory: tuple[Point, ...]
    heading: tuple[float, ...]
    length: float
    width: float
    left: bool


class SeenLight(Model):
    """A stretch [s] during which a light was seen in one colour."""

    stop_line: str | None = None
    crosswalk: str | None = None
    start: float
    end: float
    colour: Colour


class ObservationRow(Model):
    """An observation as a row of a file.

    Attributes:
        scene: a code of the scene; window: how long was observed [s].
        hour: of the day.
    """

    scene: str
    window: float
    intersection: str
    hour: int
    agents: tuple[SeenAgent, ...]
    lights: tuple[SeenLight, ...]


@dataclass(frozen=True, eq=False)
class Seen:
    """A `SeenAgent` as arrays.

    Attributes:
        xy: [T, 2] [m]; heading: [T] [rad]; speed: [T] [m/s]; moved: [T] way so far [m].
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
    def vehicle(self) -> bool:
        """Whether it drives."""
        return self.type == "vehicle"


@dataclass(frozen=True, eq=False)
class Observation:
    """What a method is given.

    Attributes:
        scene: a code; now: until when was observed [s]; agents: in the order of their ids.
    """

    scene: str
    intersection: str
    now: float
    hour: int
    agents: tuple[Seen, ...]
    lights: tuple[SeenLight, ...]

    @property
    def ids(self) -> tuple[str, ...]:
        """Of everybody seen."""
        return tuple(agent.id for agent in self.agents)


def code_of(scene: str) -> str:
    """The code by which a scene is known outside: names of folders may tell what is in them."""
    return hashlib.sha256(f"{_SALT}:{scene}".encode("utf-8", "surrogatepass")).hexdigest()[:16]


def agent_codes(scene: str, numbers: tuple[int, ...]) -> dict[int, str]:
    """The code of every agent of a scene; the same in all windows."""
    codes = {
        number: hashlib.sha256(f"{_SALT}:{scene}:{number}".encode()).hexdigest()[:8]
        for number in numbers
    }
    if len(set(codes.values())) < len(codes):
        raise InputError(f"two agents of scene {scene} have one id")
    return codes


def observe(record: SceneRecord, *, scene: str, window: float) -> ObservationRow:
    """What is seen of a scene in its first `window` seconds.

    Args:
        scene: the scene's id, from which codes are made.

    Raises:
        InputError: the scene's step is not 0.1 s, or the window is shorter than that.
    """
    if abs(record.meta.step - STEP) > 1e-9:
        raise InputError(f"scene {scene} has a step of {record.meta.step} s, not {STEP} s")
    if not STEP <= window <= record.meta.duration:
        raise InputError(f"a window is from {STEP} s to the length of the scene, got {window} s")
    codes = agent_codes(scene, tuple(agent.id for agent in record.agents))
    seen = (_seen(agent, codes[agent.id], window) for agent in record.agents)
    lights = (_light(each, window) for each in record.signals)
    return ObservationRow(
        scene=code_of(scene),
        window=window,
        intersection=record.meta.intersection,
        hour=int(record.meta.timestamp // 3600) % 24,
        agents=tuple(sorted((a for a in seen if a is not None), key=lambda a: a.id)),
        lights=tuple(sorted((x for x in lights if x is not None), key=_place_and_time)),
    )


def _seen(agent: AgentRecord, code: str, window: float) -> SeenAgent | None:
    count = int(np.floor((window - agent.spawn_time) / STEP + 1e-6)) + 1
    if count < 1:
        return None
    return SeenAgent(
        id=code,
        type=agent.type,
        start=agent.spawn_time,
        trajectory=agent.trajectory[:count],
        heading=agent.heading[:count],
        length=agent.length,
        width=agent.width,
        left=count > len(agent.trajectory),
    )


def _light(row: SignalRecord, window: float) -> SeenLight | None:
    if row.start >= window:
        return None
    return SeenLight(
        stop_line=row.stop_line,
        crosswalk=row.crosswalk,
        start=row.start,
        end=min(row.end, window),
        colour=row.colour,
    )


def _place_and_time(light: SeenLight) -> tuple[str, float]:
    return (light.stop_line or light.crosswalk or "", light.start)


def as_arrays(row: ObservationRow) -> Observation:
    """The row for those who compute."""
    return Observation(
        scene=row.scene,
        intersection=row.intersection,
        now=row.window,
        hour=row.hour,
        agents=tuple(_as_seen(agent) for agent in row.agents),
        lights=row.lights,
    )


def _as_seen(agent: SeenAgent) -> Seen:
    xy = frozen(np.array(agent.trajectory, dtype=np.float64).reshape(-1, 2))
    steps = np.hypot(*np.diff(xy, axis=0).T) if len(xy) > 1 else np.zeros(0)
    return Seen(
        id=agent.id,
        type=agent.type,
        start=agent.start,
        xy=xy,
        heading=frozen(np.unwrap(np.array(agent.heading, dtype=np.float64))),
        speed=_speed(steps),
        moved=np.concatenate([[0.0], np.cumsum(steps)]),
        length=agent.length,
        width=agent.width,
        left=agent.left,
    )


def _speed(steps: FloatArray) -> FloatArray:
    """[T] from T - 1 steps [m]: the mean of the steps on both sides; what is to come is unknown."""
    if not len(steps):
        return np.zeros(1)
    padded = np.concatenate([steps[:1], steps, steps[-1:]]) / STEP
    return np.asarray((padded[1:] + padded[:-1]) / 2)


def to_json(row: ObservationRow) -> dict[str, Any]:
    """Plain JSON, one object."""
    return row.model_dump(mode="json")
