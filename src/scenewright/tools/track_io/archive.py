"""Recordings in one file: plain arrays in an .npz, no pickles.

Positions are whole tenths of a millimetre and headings whole ten-thousandths of a radian, kept as
differences from sample to sample: 0.2 mm/s of rounding in a speed, a fifth of the size of floats.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from scenewright.arrays import read_arrays
from scenewright.errors import InputError
from scenewright.scene.base import AgentClass
from scenewright.scene.track import STEP, Shape, Track
from scenewright.tools.track_io.recording import RecordedAgent, Recording, Split

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
            name=_pack_text([each.name for each in recordings]),
            split=_pack_text([each.split for each in recordings]),
            span=np.array([(each.begin, each.end) for each in recordings]).reshape(-1, 2),
            unseen=np.array([each.unseen for each in recordings], dtype=np.int64),
            signal_time=_pack_text(
                [None if r.signal_time is None else repr(r.signal_time) for r in recordings]
            ),
            agents=np.array([len(each.agents) for each in recordings], dtype=np.int64),
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
    found = []
    try:
        if int(held["format"]) != FORMAT:
            raise InputError(f"{file} holds no recordings of format {FORMAT}")
        origin = np.cumsum(held["length"]) - held["length"]
        for k, end in enumerate(np.cumsum(held["agents"]).tolist()):
            name, own, signal_time = (str(held[key][k]) for key in ("name", "split", "signal_time"))
            if split is not None and own != split:
                continue
            members = range(end - int(held["agents"][k]), end)
            found.append(Recording(
                name=name, begin=float(held["span"][k, 0]), end=float(held["span"][k, 1]),
                agents=tuple(_unpack_agent(held, n, int(origin[n])) for n in members),
                split=cast(Split, own) if own else None, unseen=int(held["unseen"][k]),
                signal_time=float(signal_time) if signal_time else None,
            ))  # fmt: skip
    except (ValueError, KeyError, TypeError, IndexError, OverflowError) as fault:
        raise InputError(f"{file} holds no recordings of format {FORMAT}: {fault}") from None
    return tuple(found)


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
