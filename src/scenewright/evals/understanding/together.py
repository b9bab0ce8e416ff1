"""What the other pairs of a scene make of one: a linear model over how likely each is.

Of all that may happen in a scene little does, and nobody has two things happen to them at once. So
a pair that somebody else would explain as well is less likely to have a relation than it looks,
and one that stands alone is likelier.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from scenewright.scene.base import FloatArray

CLASSES = ("none", "collision", "near_miss", "gives_a", "gives_b")
"""What a pair may have: nothing, a collision, a near miss, or that a, or b, gives way."""
SWAPPED = (0, 1, 2, 4, 3)
"""The classes with a and b the other way round."""
SIZE = 20
"""Numbers of a pair: log odds of its own relations, and of the others log odds and likelihoods."""
_LEAST = 1e-4


def weighed(
    likely: FloatArray, pairs: Sequence[tuple[str, str]], weights: FloatArray
) -> FloatArray:
    """[N, C] how likely each class is, all pairs of a scene taken together.

    Args:
        likely: [N, C] of each pair by itself; pairs: [N] the two agents.
        weights: [SIZE + 1, C], the constant last.
    """
    if not len(likely):
        return likely
    values = numbers_of(likely, pairs)
    there, back = (_softmax(v @ weights[:-1] + weights[-1]) for v in (values, swapped(values)))
    return np.asarray((there + back[:, SWAPPED]) / 2)


def numbers_of(likely: FloatArray, pairs: Sequence[tuple[str, str]]) -> FloatArray:
    """[N, SIZE] what the model looks at.

    Of collisions, yields and near misses the likeliest among the pairs that share nobody with this
    one, and among those that do; and how many collisions and yields the others have on average.
    """
    events = np.stack([likely[:, 1], likely[:, 3] + likely[:, 4], likely[:, 2]], axis=1)
    ids = {name: n for n, name in enumerate(dict.fromkeys(each for pair in pairs for each in pair))}
    a, b = (np.array([ids[pair[k]] for pair in pairs]) for k in (0, 1))
    shares = (a[:, None] == a) | (a[:, None] == b) | (b[:, None] == a) | (b[:, None] == b)
    others = shares & ~np.eye(len(pairs), dtype=np.bool_)
    most = [np.where(mask[..., None], events, 0.0).max(axis=1) for mask in (~shares, others)]
    rest = events[:, :2].sum(axis=0) - events[:, :2]
    around = np.concatenate([*most, rest], axis=1)
    return np.concatenate([_log_odds(likely[:, 1:]), _log_odds(around), around], axis=1)


def swapped(values: FloatArray) -> FloatArray:
    """[N, SIZE] with a and b the other way round."""
    return values[:, [0, 1, 3, 2, *range(4, SIZE)]]


def _log_odds(likely: FloatArray) -> FloatArray:
    kept = np.clip(likely, _LEAST, 1.0 - _LEAST)
    return np.asarray(np.log(kept / (1.0 - kept)))


def _softmax(raw: FloatArray) -> FloatArray:
    odds = np.exp(raw - raw.max(axis=1, keepdims=True))
    return np.asarray(odds / odds.sum(axis=1, keepdims=True))
