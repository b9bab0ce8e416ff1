"""How far two distributions lie apart, and how sure that is."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from scenewright.evals.bootstrap import compute_interval, draw_resamples
from scenewright.scene.base import FloatArray

CELLS = 2048
"""Cells of the histograms from which intervals are drawn; distances themselves are exact."""


@dataclass(frozen=True, eq=False)
class ClusterSample:
    """Values of one measure, in clusters that were drawn together (scenes, agents).

    Attributes:
        values: [N]; cluster: [N] number of the cluster that each belongs to.
        clusters: how many clusters there are, those without a value among them.
    """

    values: FloatArray
    cluster: NDArray[np.int64]
    clusters: int

    @classmethod
    def join_parts(cls, parts: Iterable[Sequence[float] | FloatArray]) -> ClusterSample:
        """Build a sample with one cluster from each part."""
        arrays = [np.asarray(part, dtype=np.float64) for part in parts]
        sizes = [len(array) for array in arrays]
        return cls(
            np.concatenate([np.zeros(0), *arrays]),
            np.repeat(np.arange(len(arrays)), sizes),
            len(arrays),
        )

    def __len__(self) -> int:
        return len(self.values)

    def select(self, clusters: NDArray[np.int64]) -> ClusterSample:
        """Select some of the clusters, renumbered."""
        number = np.full(self.clusters, -1)
        number[clusters] = np.arange(len(clusters))
        kept = number[self.cluster] >= 0
        return ClusterSample(self.values[kept], number[self.cluster[kept]], len(clusters))


def compute_wasserstein(first: FloatArray, second: FloatArray) -> float | None:
    """Compute the first Wasserstein distance of two samples, in the unit of their values.

    How far on average a value has to move for the one to become the other. None where a sample is
    empty.
    """
    if len(first) == 0 or len(second) == 0:
        return None
    return float(stats.wasserstein_distance(first, second))


@dataclass(frozen=True)
class Distance:
    """A Wasserstein distance with its sizes and a bootstrap interval.

    Attributes:
        value: in the unit of the measure; low, high: 95 % of the distances of resampled clusters.
            Such distances come out a little larger than `value`: resampling adds its own noise.
        n, n_reference: how many values; clusters: how many clusters on the side of n.
    """

    value: float
    low: float
    high: float
    n: int
    n_reference: int
    clusters: int


def compute_distance(
    sample: ClusterSample, reference: ClusterSample, *, draws: int, rng: np.random.Generator
) -> Distance | None:
    """Compute the distance of two samples; clusters of both are resampled for the interval.

    None where a sample is empty.
    """
    value = compute_wasserstein(sample.values, reference.values)
    if value is None:
        return None
    interval = compute_interval(resample_distances(sample, reference, draws=draws, rng=rng))
    clusters = len(np.unique(sample.cluster))
    return Distance(value, *interval, len(sample), len(reference), clusters)


def resample_distances(
    sample: ClusterSample, reference: ClusterSample, *, draws: int, rng: np.random.Generator
) -> FloatArray:
    """Compute [draws] distances of samples whose clusters are drawn with replacement."""
    both = np.concatenate([sample.values, reference.values])
    low, high = both.min(), max(both.max(), both.min() + 1e-9)
    edges = np.linspace(low, high, CELLS + 1)
    cumulated = []
    for each in (sample, reference):
        used, number = np.unique(each.cluster, return_inverse=True)
        cell = np.clip(np.searchsorted(edges, each.values, side="right") - 1, 0, CELLS - 1)
        table = np.bincount(number * CELLS + cell, minlength=len(used) * CELLS)
        drawn = draw_resamples(len(used), draws=draws, seed=rng) @ table.reshape(len(used), CELLS)
        cumulated.append(np.cumsum(drawn, axis=1) / drawn.sum(axis=1, keepdims=True))
    return np.asarray(np.abs(cumulated[0] - cumulated[1]).sum(axis=1) * (edges[1] - edges[0]))
