"""A recording: whole tracks of all agents at one place over a stretch of time, on one clock."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Literal, cast

import numpy as np
from numpy.typing import NDArray

from scenewright.arrays import read_arrays
from scenewright.errors import InputError
from scenewright.scene.base import AgentClass, Compass, FloatArray
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


FORMAT = 1
XY_UNIT = 1e-4
HEADING_UNIT = 1e-4


def save_recordings(file: Path, recordings: Sequence[Recording]) -> None:
    """Keep recordings in one file, whole or not at all.

    Raises:
        InputError: the place cannot be written.
    """
    agents = [agent for each in recordings for agent in each.agents]
    partial = file.with_name(file.name + ".partial.npz")
    save: Any = np.savez_compressed
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        tracks = [agent.track for agent in agents]
        steps = [_encode_steps(t.xy, XY_UNIT) for t in tracks]
        turns = [_encode_steps(t.heading, HEADING_UNIT) for t in tracks]
        save(
            partial,
            format=np.array(FORMAT),
            name=_pack_text([recording.name for recording in recordings]),
            split=_pack_text([recording.split for recording in recordings]),
            span=np.array([(recording.begin, recording.end) for recording in recordings]).reshape(
                -1, 2
            ),
            unseen=np.array([recording.unseen for recording in recordings], dtype=np.int64),
            signal_time=_pack_text(
                [None if r.signal_time is None else repr(r.signal_time) for r in recordings]
            ),
            agents=np.array([len(recording.agents) for recording in recordings], dtype=np.int64),
            type=_pack_text([a.shape.type for a in agents]),
            size=np.array([(a.shape.length, a.shape.width) for a in agents]).reshape(-1, 2),
            complete=np.array([a.complete for a in agents], dtype=np.bool_),
            **{key: _pack_text([getattr(a, key) for a in agents]) for key in _OPTIONAL},
            first=np.array([round(t.start / STEP) for t in tracks], dtype=np.int64),
            length=np.array([len(t.xy) for t in tracks], dtype=np.int64),
            xy=np.concatenate([np.zeros((0, 2), dtype=np.int32), *steps]),
            heading=np.concatenate([np.zeros(0, dtype=np.int32), *turns]),
        )
        partial.replace(file)
    except OSError as fault:
        raise InputError(f"cannot write {file}: {fault.strerror or fault}") from None


_OPTIONAL = ("subtype", "entry", "exit", "crosswalk", "route")


def _pack_text(words: Sequence[str | None]) -> NDArray[np.str_]:
    """Words as an array; in the file, the empty word means None."""
    return np.array([word or "" for word in words], dtype=np.str_)


def _encode_steps(values: NDArray[np.float64], unit: float) -> NDArray[np.int32]:
    """The first value and the differences after it, in whole units."""
    whole = np.rint(values / unit).astype(np.int32)
    return np.diff(whole, axis=0, prepend=np.zeros_like(whole[:1]))


def load_recordings(file: Path, *, split: Split | None = None) -> tuple[Recording, ...]:
    """The recordings in a file, or those of one split.

    Raises:
        InputError: missing, or no file of recordings.
    """
    held = read_arrays(file, what=f"recordings from {file}")
    recordings = []
    try:
        if int(held["format"]) != FORMAT:
            raise InputError(f"{file} holds no recordings of format {FORMAT}")
        origin = np.cumsum(held["length"]) - held["length"]
        for k, end in enumerate(np.cumsum(held["agents"]).tolist()):
            name, own, signal_time = (str(held[key][k]) for key in ("name", "split", "signal_time"))
            if split is not None and own != split:
                continue
            members = range(end - int(held["agents"][k]), end)
            recordings.append(Recording(
                name=name, begin=float(held["span"][k, 0]), end=float(held["span"][k, 1]),
                agents=tuple(_unpack_agent(held, n, int(origin[n])) for n in members),
                split=cast(Split, own) if own else None, unseen=int(held["unseen"][k]),
                signal_time=float(signal_time) if signal_time else None,
            ))  # fmt: skip
    except (ValueError, KeyError, TypeError, IndexError, OverflowError) as fault:
        raise InputError(f"{file} holds no recordings of format {FORMAT}: {fault}") from None
    return tuple(recordings)


def _unpack_agent(held: dict[str, NDArray[Any]], n: int, origin: int) -> RecordedAgent:
    part = slice(origin, origin + int(held["length"][n]))
    labels: dict[str, Any] = {key: str(held[key][n]) or None for key in _OPTIONAL}
    length, width = (float(value) for value in held["size"][n])
    track = Track(
        np.cumsum(held["xy"][part], axis=0) * XY_UNIT,
        np.cumsum(held["heading"][part]) * HEADING_UNIT, round(int(held["first"][n]) * STEP, 1),
    )  # fmt: skip
    shape = Shape(cast(AgentClass, str(held["type"][n])), length, width)
    return RecordedAgent(track, shape, **labels, complete=bool(held["complete"][n]))


BoolArray = NDArray[np.bool_]
TRAJNET_EVERY = 4
"""Samples of 0.1 s from one step of the refiner to the next (SEMANTICS section 1)."""


@dataclass(frozen=True, eq=False)
class RecordingWindow:
    """A scene cut from a recording.

    Attributes:
        start: time of the first step in the recording [s]; step: between steps [s].
        members: [A] positions of its agents in the recording.
        xy: [A, T, 2] positions [m]; heading: [A, T] [rad]; both 0 where the agent was not seen.
        present: [A, T] whether the agent was there.
    """

    start: float
    step: float
    members: IntArray
    xy: FloatArray
    heading: FloatArray
    present: BoolArray

    @property
    def whole(self) -> BoolArray:
        """[A] whether an agent is present at every step."""
        return np.asarray(self.present.all(axis=1))


def cut_windows(
    recording: Recording,
    *,
    steps: int = 21,
    every: int = TRAJNET_EVERY,
    stride: int | None = None,
    least_whole: int = 1,
) -> Iterator[RecordingWindow]:
    """Scenes of `steps` steps, in order of time; the same arguments give the same scenes.

    Args:
        steps: T, the number of steps; 9 + 12 are TrajNet++'s.
        every: samples of 0.1 s from step to step: 4 for 0.4 s, 1 for 0.1 s.
        stride: samples from one scene's start to the next; None joins them end to end.

        least_whole: fewest agents that must be there at every step.
    """
    if min(steps, every) < 1 or (stride is not None and stride < 1):
        raise ValueError("steps, every and stride are counted from 1")
    samples = recording.samples
    begin = int(np.ceil(recording.begin / STEP - 1e-6))
    end = int(np.floor(recording.end / STEP + 1e-6)) - (steps - 1) * every
    for start in range(begin, end + 1, stride or steps * every):
        grid = start + every * np.arange(steps)
        near = np.flatnonzero((samples.first <= grid[-1]) & (samples.last >= grid[0]))
        present = (grid >= samples.first[near, None]) & (grid <= samples.last[near, None])
        members, present = near[present.any(axis=1)], present[present.any(axis=1)]
        if not len(members) or int(present.all(axis=1).sum()) < least_whole:
            continue
        index = samples.origin[members, None] + grid - samples.first[members, None]
        index = np.where(present, index, 0)
        yield RecordingWindow(
            round(start * STEP, 1), every * STEP, members,
            np.where(present[..., None], samples.xy[index], 0.0),
            np.where(present, samples.heading[index], 0.0), present,
        )  # fmt: skip
