"""How far two distributions lie apart, and how sure that is."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from scenewright.evals.bootstrap import compute_interval
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
    again = resample_distances(sample, reference, draws=draws, rng=rng)
    low, high = compute_interval(again)
    return Distance(
        value, low, high, len(sample), len(reference),
        len(np.unique(sample.cluster)),
    )  # fmt: skip


def resample_distances(
    sample: ClusterSample, reference: ClusterSample, *, draws: int, rng: np.random.Generator
) -> FloatArray:
    """Compute [draws] distances of samples whose clusters are drawn with replacement."""
    edges = _compute_edges(sample.values, reference.values)
    one, two = (_resample_cumulated(each, edges, draws, rng) for each in (sample, reference))
    return np.asarray(np.abs(one - two).sum(axis=1) * (edges[1] - edges[0]))


def _compute_edges(*values: FloatArray) -> FloatArray:
    low = min(float(each.min()) for each in values)
    high = max(float(each.max()) for each in values)
    return np.linspace(low, max(high, low + 1e-9), CELLS + 1)


def _resample_cumulated(
    sample: ClusterSample, edges: FloatArray, draws: int, rng: np.random.Generator
) -> FloatArray:
    """Compute [draws, CELLS] distribution functions of resampled clusters."""
    table = _count_histograms(sample, edges)
    weights = rng.multinomial(len(table), np.full(len(table), 1 / len(table)), size=draws)
    return _compute_cumulated(weights @ table)


def _count_histograms(sample: ClusterSample, edges: FloatArray) -> FloatArray:
    """Count the values of each non-empty cluster in each cell: [C, CELLS]."""
    used, number = np.unique(sample.cluster, return_inverse=True)
    cell = np.clip(np.searchsorted(edges, sample.values, side="right") - 1, 0, CELLS - 1)
    flat = np.bincount(number * CELLS + cell, minlength=len(used) * CELLS)
    return flat.reshape(len(used), CELLS).astype(np.float64)


def _compute_cumulated(counts: FloatArray) -> FloatArray:
    """Compute [draws, CELLS] distribution functions of histograms."""
    return np.asarray(np.cumsum(counts, axis=1) / counts.sum(axis=1, keepdims=True))
