"""The measures of TrajNet++ (Kothari, Kreiss & Alahi 2021), for one predicted scene."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from scenewright.scene.base import FloatArray

TOUCHING = 0.2
"""Two pedestrians collide at this distance or less [m]: twice the benchmark's radius of 0.1 m."""
PARTS = 2
"""Sub-intervals of a step at whose ends distances are taken."""


def compute_displacement(predicted: FloatArray, truth: FloatArray) -> tuple[float, float]:
    """Mean (ADE) and last (FDE) distance between two paths [P, 2], in metres."""
    distance = np.linalg.norm(predicted - truth, axis=-1)
    return float(distance.mean()), float(distance[-1])


def find_collisions(primary: FloatArray, others: FloatArray) -> NDArray[np.bool_]:
    """Which of the others the primary collides with.

    Distances are taken at the steps and at the ends of `PARTS` equal parts between them, as if
    all agents moved straight and evenly within a step. What lies before the first predicted step
    is not looked at. As in the benchmark, steps at which the other is unseen are left out, its
    next one follows directly, and a single common step is no collision.

    Args:
        primary: [P, 2]; others: [M, P, 2], NaN where unseen [m].

    Returns:
        [M]
    """
    offset = others - primary
    seen: NDArray[np.bool_] = np.asarray(~np.isnan(offset).any(axis=-1))
    hit = _is_touching(offset)
    for m in np.flatnonzero(~seen.all(axis=1)):
        hit[m] = bool(_is_touching(offset[m : m + 1, seen[m]])[0])
    return hit


def _is_touching(offset: FloatArray) -> NDArray[np.bool_]:
    """[M] of offsets [M, P, 2] that are nowhere NaN; NaN counts as far away."""
    if offset.shape[1] < 2:
        return np.zeros(len(offset), dtype=np.bool_)
    share = np.linspace(0.0, 1.0, PARTS + 1)[:, None, None]
    between = offset[:, None, :-1] * (1 - share) + offset[:, None, 1:] * share
    distance = np.linalg.norm(between, axis=-1)
    return np.asarray((distance <= TOUCHING).any(axis=(1, 2)))
