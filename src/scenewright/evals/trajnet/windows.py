"""Training windows from recordings: every stretch of 21 steps, all pedestrians in it at once."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from scenewright.evals.trajnet.recording import OBSERVED, STEPS, Recording
from scenewright.evals.trajnet.timing import around_now, at_times
from scenewright.scene.base import FloatArray
from scenewright.tools.trajnet_refiner.windows import Window

TYPE_WEIGHTS = {1: 0.6, 2: 0.6, 3: 1.0, 4: 1.0}
"""Of an agent's errors in training, by the type of the scene of which it is the primary."""
PACE = 0.4
"""The network's step [s]."""
_UNTYPED = 0.6
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
        xy = _at_network_pace(recording, recording.stretch(start))
        seen = ~np.isnan(xy[..., 0])
        now = seen[:, OBSERVED - 1]
        if not (now & seen[:, OBSERVED - 2] & seen[:, OBSERVED:].any(axis=1)).any():
            continue
        who = np.flatnonzero(now)
        types = [kinds.get((int(p), start)) for p in recording.ids[who]]
        weight = np.array([_UNTYPED if t is None else by_type[t] for t in types])
        yield Window(xy[who], np.zeros(len(who), np.int64), recording.last[who], weight)


def _at_network_pace(recording: Recording, xy: FloatArray) -> FloatArray:
    """[P, 21, 2] the same stretch at the network's step, around the same present.

    Longer steps are drawn in between; shorter ones would not reach far enough and are kept.
    """
    if recording.step < PACE + 1e-6:
        return xy
    given, wanted = (around_now(STEPS, before=OBSERVED - 1, step=s) for s in (recording.step, PACE))
    return at_times(xy, given, wanted)
