"""Training windows from recordings: every stretch of 21 steps, all pedestrians in it at once."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from scenewright.evals.trajnet.recording import OBSERVED, Recording
from scenewright.tools.trajnet_refiner.windows import Window

TYPE_WEIGHTS = {1: 0.3, 2: 0.3, 3: 1.0, 4: 0.8}
"""Of an agent's errors in training, by the type of the scene of which it is the primary."""
_UNTYPED = 0.3
"""Of agents that are the primary of no scene that starts there."""


def training_windows(
    recordings: Iterable[Recording], *, weights: dict[int, float] | None = None
) -> list[Window]:
    """Every stretch of the recordings in which somebody's future is known, stride by stride.

    Unlike the benchmark's scenes, which have one primary each, a window is learned from for all
    its agents; the scenes only say which of them count how much.
    """
    by_type = TYPE_WEIGHTS if weights is None else weights
    return [w for each in recordings for w in _windows(each, by_type)]


def _windows(recording: Recording, by_type: dict[int, float]) -> Iterable[Window]:
    kinds = {(s.primary, s.start): s.type for s in recording.scenes}
    for start in sorted(recording.rows):
        xy = recording.stretch(start)
        seen = ~np.isnan(xy[..., 0])
        now = seen[:, OBSERVED - 1]
        if not (now & seen[:, OBSERVED - 2] & seen[:, OBSERVED:].any(axis=1)).any():
            continue
        who = np.flatnonzero(now)
        types = [kinds.get((int(p), start)) for p in recording.ids[who]]
        weight = np.array([_UNTYPED if t is None else by_type[t] for t in types])
        yield Window(xy[who], np.zeros(len(who), np.int64), recording.last[who], weight)
