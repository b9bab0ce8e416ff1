"""Tracks as the files of simulators and motion datasets hold them, before they are checked."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from scenewright.scene.base import FloatArray

_SUBTYPES = {
    "van": "car",
    "priorityvehicle": "car",
    "semitrailer": "truck",
    "construction_vehicle": "truck",
    "delivery_truck": "truck",
}
"""Words of these formats that the common table does not know."""


@dataclass(frozen=True, eq=False)
class AgentSamples:
    """One agent's samples as they stand in a file.

    Attributes:
        name: id in the file; subtype: as in `subtypes.SUBTYPES`.
        t: [T] time [s]; xy: [T, 2] centre [m]; heading: [T] [rad], NaN where not stated, or None.
        length, width: footprint [m], or None.
        lines: [T] of the file, where it has one for each sample.
    """

    name: str
    subtype: str
    t: FloatArray
    xy: FloatArray
    heading: FloatArray | None = None
    length: float | None = None
    width: float | None = None
    lines: NDArray[np.int64] | None = None


@dataclass(frozen=True, eq=False)
class SampledRecording:
    """One scenario of a file.

    Attributes:
        name: of the scenario; empty where the file holds only one.
        left_out: what is no road user, or of an unknown kind: word of the file -> how many.
        notes: what was assumed, one sentence each.
        clock, unit: what the file calls its time, and how long a unit of that is [s].
    """

    name: str
    agents: tuple[AgentSamples, ...]
    left_out: Counter[str] = field(default_factory=Counter)
    notes: tuple[str, ...] = ()
    clock: str = "t"
    unit: float = 1.0


def find_road_user(word: str) -> str | None:
    """The subtype that a format's word for a road user means; None for any other thing."""
    return _SUBTYPES.get(word.lower()) or find_subtype(word)


def sort_out(
    name: str, found: Iterable[tuple[str, AgentSamples | None]], notes: tuple[str, ...] = ()
) -> SampledRecording:
    """The recording of (word, samples) pairs; words without samples are counted as left out."""
    agents, left_out = [], Counter[str]()
    for word, agent in found:
        if agent is None:
            left_out[word] += 1
        elif len(agent.t):
            agents.append(agent)
    return SampledRecording(name, tuple(agents), left_out, notes)


def describe_rides(rides: Mapping[str, str]) -> tuple[str, ...]:
    """A note on passengers; none where there are none."""
    words = [f"{name} in {vehicle}" for name, vehicle in rides.items()]
    more = f" and {len(words) - 5} more" if len(words) > 5 else ""
    return (f"passengers, left out: {', '.join(words[:5])}{more}",) if words else ()


def resample_if_uneven(agent: AgentSamples, step: float) -> AgentSamples:
    """The agent at multiples of `step`, between samples on straight lines, if it is uneven [s].

    For formats that define a track as the lines between its vertices.
    """
    if len(agent.t) < 2 or np.abs(np.diff(agent.t) - step).max() < 1e-6:
        return agent
    first, last = np.ceil(agent.t[0] / step - 1e-6), np.floor(agent.t[-1] / step + 1e-6)
    t = np.arange(first, last + 1) * step
    xy = np.stack([np.interp(t, agent.t, agent.xy[:, axis]) for axis in (0, 1)], axis=1)
    heading = agent.heading
    if heading is not None:
        heading = np.interp(t, agent.t, np.unwrap(heading))
    return AgentSamples(agent.name, agent.subtype, t, xy, heading, agent.length, agent.width)


_SYNONYMS = {
    "car": "vehicle automobile passenger passenger_car passenger_vehicle van minivan suv taxi "
    "pickup cab agent av others regular_vehicle",
    "truck": "lorry heavy_vehicle truck_bus trailer semi hgv delivery",
    "bus": "coach minibus",
    "motorcycle": "motorbike motorcyclist moped scooter motor tricycle motorcycle_tricycle",
    "bicycle": "bike cyclist bicyclist biker e_scooter escooter electric_scooter kick_scooter",
    "pedestrian": "ped person people walker human pedestrian/bicycle",
}
SUBTYPE_OF_WORD = {
    word: subtype for subtype, words in _SYNONYMS.items() for word in (subtype, *words.split())
}
SUBTYPES = tuple(_SYNONYMS)


@lru_cache(maxsize=256)
def find_subtype(text: str) -> str | None:
    """The subtype that a word such as `Passenger car` means; None where it is unknown."""
    word = "_".join(text.lower().replace("-", " ").replace("_", " ").split())
    return SUBTYPE_OF_WORD.get(word)
