"""A recording: whole tracks of all agents at one place over a stretch of time, on one clock."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from scenewright.scene.base import Compass, FloatArray
from scenewright.scene.track import STEP, Shape, Track

IntArray = NDArray[np.int64]
Split = Literal["fit", "validation", "test"]


@dataclass(frozen=True, eq=False)
class RecordedAgent:
    """One agent of a recording.

    Attributes:
        track: centre positions every 0.1 s; its start is a time of the recording.
        shape: class and size.
        subtype: of vehicles; also `bicycle`, which our scenes do not know.
        entry, exit, crosswalk, route: as in the map; None if unknown.
        complete: seen from one edge of the map to the other; else the track begins or ends
            inside, or the cleaning of complete tracks refused it.
    """

    track: Track
    shape: Shape
    subtype: str | None = None
    entry: Compass | None = None
    exit: Compass | None = None
    crosswalk: Compass | None = None
    route: str | None = None
    complete: bool = True

    def __post_init__(self) -> None:
        first = self.track.start / STEP
        if abs(self.track.step - STEP) > 1e-9 or abs(first - round(first)) > 1e-6:
            raise ValueError("a recorded track has samples at multiples of 0.1 s")


@dataclass(frozen=True, eq=False)
class Recording:
    """All tracks at one place from `begin` to `end` [s].

    Attributes:
        name: which recording this is, such as `amsterdam_120 day 0 hour 08`.
        begin, end: all agents present in between are recorded, whole or in part.
        agents: in order of their first sample.
        split: the part of a corpus it belongs to; None for what is no corpus.
        unseen: agents that were there and are not among `agents` (collided in the simulation).
        signal_time: time into the signal programme at time 0 of the recording [s]; None where
            there is no programme, or it is not known.
    """

    name: str
    begin: float
    end: float
    agents: tuple[RecordedAgent, ...]
    split: Split | None = None
    unseen: int = 0
    signal_time: float | None = None

    @cached_property
    def samples(self) -> Samples:
        """All agents' samples, one after the other."""
        tracks = [agent.track for agent in self.agents]
        first = np.array([round(track.start / STEP) for track in tracks], dtype=np.int64)
        count = np.array([len(track.xy) for track in tracks], dtype=np.int64)
        return Samples(
            first, first + count - 1, np.cumsum(count) - count,
            np.concatenate([np.zeros((0, 2)), *(track.xy for track in tracks)]),
            np.concatenate([np.zeros(0), *(track.heading for track in tracks)]),
        )  # fmt: skip


@dataclass(frozen=True, eq=False)
class Samples:
    """The samples of many agents in flat arrays, for cutting.

    Attributes:
        first, last: [A] first and last sample of each agent [0.1 s since time 0].
        origin: [A] where its samples begin in the arrays below.
        xy: [S, 2] positions [m]; heading: [S] [rad].
    """

    first: IntArray
    last: IntArray
    origin: IntArray
    xy: FloatArray
    heading: FloatArray
