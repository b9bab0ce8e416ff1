"""How far two distributions lie apart, and how sure that is."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scenewright.evals.bootstrap import compute_interval
from scenewright.scene.base import FloatArray

_NOTHING = 1e-9
"""No share can be taken of a distance below this."""
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

    W1 = integral of |F - G|, F and G their empirical distribution functions: how far on average a
    value has to move for the one to become the other. None where a sample is empty.
    """
    if len(first) == 0 or len(second) == 0:
        return None
    at = np.sort(np.concatenate([first, second]))
    one = np.searchsorted(np.sort(first), at[:-1], side="right") / len(first)
    two = np.searchsorted(np.sort(second), at[:-1], side="right") / len(second)
    return float(np.sum(np.abs(one - two) * np.diff(at)))


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


def compute_chance(
    sample: ClusterSample, reference: ClusterSample, *, draws: int, rng: np.random.Generator
) -> tuple[float, float] | None:
    """Compute mean and 95 % quantile of the distance by chance, between parts of the reference.

    Clusters are drawn from the reference without replacement until they hold as many values as
    `sample` (at most half of the reference's), and compared with the rest. None where there are
    fewer than two clusters.
    """
    if len(np.unique(reference.cluster)) < 2:
        return None
    edges = _compute_edges(reference.values)
    table = _count_histograms(reference, edges)
    sizes, wanted = table.sum(axis=1), min(len(sample), len(reference) // 2)
    drawn = np.zeros((draws, len(table)))
    for row in drawn:
        order = rng.permutation(len(table))
        count = 1 + int(np.searchsorted(np.cumsum(sizes[order])[:-1], wanted))
        row[order[: min(count, len(table) - 1)]] = 1.0
    gaps = np.abs(_compute_cumulated(drawn @ table) - _compute_cumulated((1.0 - drawn) @ table))
    found = gaps.sum(axis=1) * (edges[1] - edges[0])
    return float(found.mean()), float(np.quantile(found, 0.95))


@dataclass(frozen=True)
class DistanceGain:
    """Share of the first sample's distance that the second has less; negative if it has more."""

    value: float
    low: float
    high: float


def compute_gain(
    first: ClusterSample,
    second: ClusterSample,
    reference: ClusterSample,
    *,
    draws: int,
    rng: np.random.Generator,
) -> DistanceGain | None:
    """Compute how much nearer to the reference the second sample is than the first.

    The reference is resampled once for both, the samples each for itself. None where a sample is
    empty or the first has no distance.
    """
    before = compute_wasserstein(first.values, reference.values)
    after = compute_wasserstein(second.values, reference.values)
    if before is None or after is None or before < _NOTHING:
        return None
    edges = _compute_edges(first.values, second.values, reference.values)
    one, two, ref = (_resample_cumulated(s, edges, draws, rng) for s in (first, second, reference))
    whole, left = np.abs(one - ref).sum(axis=1), np.abs(two - ref).sum(axis=1)
    drawn = 1 - left[whole > _NOTHING] / whole[whole > _NOTHING]
    if len(drawn) == 0:
        return None
    return DistanceGain(1 - after / before, *compute_interval(drawn))
