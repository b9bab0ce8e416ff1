"""A linear model over all pairs of a scene, on top of the probabilities of each pair by itself.

Little of what may happen in a scene does, and no agent has two events at once. So a pair next to a
likelier one is less likely to have a relation than it looks, and one that stands alone is likelier.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from scipy.special import softmax

from scenewright.scene.base import FloatArray

PAIR_CLASSES = ("none", "collision", "near_miss", "gives_a", "gives_b")
"""The relation of a pair: none, a collision, a near miss, or that a, or b, gives way."""
SWAPPED = np.array((0, 1, 2, 4, 3))
"""The classes with a and b swapped."""
SIZE = 20
"""Features of a pair: its own log odds, and log odds and probabilities of the others."""
_LEAST = 1e-4


def apply_scene_model(
    likely: FloatArray, pairs: Sequence[tuple[str, str]], weights: FloatArray
) -> FloatArray:
    """Compute [N, C] class probabilities given all pairs of the scene.

    Args:
        likely: [N, C] of each pair by itself; pairs: [N] the two agents.
        weights: [SIZE + 1, C], the constant last.
    """
    if not len(likely):
        return likely
    return average_mirrored(
        lambda values: np.asarray(softmax(values @ weights[:-1] + weights[-1], axis=1)),
        compute_scene_features(likely, pairs),
        mirror_scene_features,
    )


def average_mirrored(
    predict: Callable[[FloatArray], FloatArray],
    values: FloatArray,
    mirror: Callable[[FloatArray], FloatArray],
) -> FloatArray:
    """[N, C] mean over both orders of a and b, so that their order makes no difference."""
    return np.asarray((predict(values) + predict(mirror(values))[:, SWAPPED]) / 2)


def compute_scene_features(likely: FloatArray, pairs: Sequence[tuple[str, str]]) -> FloatArray:
    """[N, SIZE] features of the model.

    Of collisions, yields and near misses the likeliest among the pairs that share no agent with
    this one, and among those that do; and the expected collisions and yields of all others.
    """
    events = np.stack([likely[:, 1], likely[:, 3] + likely[:, 4], likely[:, 2]], axis=1)
    _, codes = np.unique(pairs, return_inverse=True)
    ends = codes.reshape(-1, 2)
    shares = (ends[:, None, :, None] == ends[None, :, None]).any(axis=(2, 3))
    others = shares & ~np.eye(len(pairs), dtype=np.bool_)
    most = [np.where(mask[..., None], events, 0.0).max(axis=1) for mask in (~shares, others)]
    rest = events[:, :2].sum(axis=0) - events[:, :2]
    around = np.concatenate([*most, rest], axis=1)
    return np.concatenate([_to_log_odds(likely[:, 1:]), _to_log_odds(around), around], axis=1)


def mirror_scene_features(values: FloatArray) -> FloatArray:
    """[N, SIZE] with a and b swapped."""
    return values[:, [0, 1, 3, 2, *range(4, SIZE)]]


def _to_log_odds(likely: FloatArray) -> FloatArray:
    kept = np.clip(likely, _LEAST, 1.0 - _LEAST)
    return np.asarray(np.log(kept / (1.0 - kept)))
