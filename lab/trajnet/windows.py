"""Training windows from recordings: every stretch of 21 steps, all pedestrians in it at once."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from scenewright.evals.trajnet.recording import (
    OBSERVED,
    PREDICTED,
    STEPS,
    BenchmarkRecording,
    compute_times_around_now,
    interpolate_at_times,
)
from scenewright.evals.trajnet.score import (
    INTERACTING,
    LINEAR,
    STANDING,
    STATIC,
    STRAIGHT,
    filter_path,
)
from scenewright.scene.base import FloatArray
from scenewright.tools.trajnet_refiner.windows import Window

PACE = 0.4
"""The network's step [s]."""


@dataclass(frozen=True)
class Weights:
    """How much the errors of an agent count in training.

    Attributes:
        by_type: if it is the primary of a scene that starts there, by that scene's type.
        untyped: if it is not.
        by_motion: whether an agent seen all along, but no primary, counts by its motion: as in a
            static or linear scene, else as in an interacting one.
    """

    by_type: Mapping[int, float] = field(default_factory=lambda: {1: 0.6, 2: 0.6, 3: 1.0, 4: 1.0})
    untyped: float = 0.6
    by_motion: bool = False


DEFAULT_WEIGHTS = Weights()
BENDING = Weights({1: 0.1, 2: 0.1, 3: 1.0, 4: 0.8}, untyped=0.4, by_motion=True)
"""Most for agents that do not simply keep going, as in the scenes that the benchmark uses."""


def cut_training_windows(
    recordings: Iterable[BenchmarkRecording],
    *,
    weights: Weights = DEFAULT_WEIGHTS,
    both_ways: bool = False,
) -> list[Window]:
    """Cut every stretch of the recordings in which an agent's future is known, by stride.

    Unlike the benchmark's scenes, which have one primary each, a window is learned from for all
    its agents; the scenes only say which of them count how much.

    Args:
        both_ways: every stretch backwards in time, too. People who walk backwards come from where
            they went and go to where they came from, and keep clear of each other as they did.
    """
    ways = (False, True) if both_ways else (False,)
    every = tuple(recordings)
    return [w for back in ways for each in every for w in _cut_windows(each, weights, back)]


def _cut_windows(recording: BenchmarkRecording, weights: Weights, back: bool) -> Iterable[Window]:
    kinds = {} if back else {(s.primary, s.start): s.type for s in recording.scenes}
    goals = recording.first if back else recording.last
    for start in sorted(recording.rows):
        xy = _resample_to_network(recording, recording.stretch(start))
        xy = xy[:, ::-1] if back else xy
        seen = ~np.isnan(xy[..., 0])
        now = seen[:, OBSERVED - 1]
        if not (now & seen[:, OBSERVED - 2] & seen[:, OBSERVED:].any(axis=1)).any():
            continue
        present = np.flatnonzero(now)
        types = np.array([kinds.get((int(p), start)) or 0 for p in recording.ids[present]])
        if weights.by_motion:
            types = np.where(types == 0, _classify_by_motion(xy[present]), types)
        weight = np.array([weights.by_type[t] if t else weights.untyped for t in types.tolist()])
        yield Window(xy[present], np.zeros(len(present), np.int64), goals[present], weight)


def _classify_by_motion(xy: FloatArray) -> NDArray[np.int64]:
    """[N] the type that each would have as a primary, were there others near; 0 if not all seen.

    Args:
        xy: [N, 21, 2] positions [m], NaN where unseen.
    """
    whole = ~np.isnan(xy).any(axis=(1, 2))
    side_by_side = xy[:, :OBSERVED].swapaxes(0, 1).reshape(OBSERVED, -1)
    last = filter_path(side_by_side, steps=PREDICTED)[-1].reshape(-1, 2)
    static = np.linalg.norm(xy[:, -1] - xy[:, 0], axis=-1) < STANDING
    linear = np.linalg.norm(xy[:, -1] - last, axis=-1) < STRAIGHT
    moving = np.where(linear, LINEAR, INTERACTING)
    return np.asarray(np.where(whole, np.where(static, STATIC, moving), 0))


def _resample_to_network(recording: BenchmarkRecording, xy: FloatArray) -> FloatArray:
    """[P, 21, 2] the same stretch at the network's step, around the same present.

    Longer steps are drawn in between; shorter ones would not reach far enough and are kept.
    """
    if recording.step < PACE + 1e-6:
        return xy
    given, wanted = (
        compute_times_around_now(STEPS, before=OBSERVED - 1, step=s) for s in (recording.step, PACE)
    )
    return interpolate_at_times(xy, given, wanted)
