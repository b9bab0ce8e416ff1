"""Observations: motion, sizes and signals up to a moment, and nothing of the future.

Roles, names, entries, routes, goals, events and agents still to come are left out. Ids and their
order come from a hash, so that they neither count nor rank agents; signals are cut at the moment.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from scenewright.errors import InputError
from scenewright.scene.base import AgentClass, FloatArray, frozen
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
                "id": each.id, "type": each.type, "start": each.start,
                "trajectory": each.xy.tolist(), "heading": each.heading.tolist(),
                "length": each.length, "width": each.width, "left": each.left,
            }
            for each in self.agents
        ]  # fmt: skip
        lights = [each.model_dump(mode="json") for each in self.lights]
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
        each.model_copy(update={"end": min(each.end, window)})
        for each in record.signals
        if each.start < window
    ]
    return ObservedScene(
        hash_scene(scene),
        record.meta.intersection,
        float(window),
        int(record.meta.timestamp // 3600) % 24,
        tuple(sorted(agents, key=lambda agent: agent.id)),
        tuple(sorted(lights, key=lambda x: (x.stop_line or x.crosswalk or "", x.start))),
    )
