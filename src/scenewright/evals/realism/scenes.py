"""Scenes of any origin in one form, and how far two distributions of what they show lie apart.

A generated scene lasts up to 30 s and its agents may begin and end inside the map. The corpus is
cut the same way; else long waits would look rare in scenes only because they end.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from scenewright.evals.bootstrap import compute_interval, draw_resamples
from scenewright.scene.base import FloatArray
from scenewright.scene.map import IntersectionMap
from scenewright.scene.record import SceneRecord, SignalRecord
from scenewright.scene.track import STEP, Track
from scenewright.tools.map_grounding.signal_plan import SignalClock, build_signal_records
from scenewright.tools.relation_checker import RoadUser, read_users
from scenewright.tools.track_io import Recording, cut_windows

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


LENGTH = 30.0
"""Of the scenes cut from a corpus [s]: that of the longest scenes we make."""


@dataclass(frozen=True, eq=False)
class SceneTracks:
    """The motion of all agents in one scene.

    Attributes:
        users: all agents, in time of the scene; signals: its lights.
        asked: pairs of ids that a relation binds, `from` first.
    """

    users: tuple[RoadUser, ...]
    signals: tuple[SignalRecord, ...] = ()
    asked: tuple[tuple[int, int], ...] = ()


def convert_scene(scene: SceneRecord) -> SceneTracks:
    """Convert a generated scene."""
    asked = tuple((relation.from_, relation.to) for relation in scene.relations)
    return SceneTracks(read_users(scene), scene.signals, asked)


def cut_scenes(
    recordings: Iterable[Recording], *, intersection_map: IntersectionMap
) -> Iterator[tuple[str, SceneTracks]]:
    """Cut scenes of equal length, end to end, each with the name of its recording."""
    steps, program = round(LENGTH / STEP) + 1, intersection_map.signals
    for recording in recordings:
        for window in cut_windows(recording, steps=steps, every=1, stride=steps - 1, least_whole=0):
            users = []
            cut = zip(window.members, window.xy, window.heading, window.present, strict=True)
            for number, (member, xy, heading, present) in enumerate(cut):
                if present.sum() > 1:  # recorded tracks have no gaps
                    start = round(int(np.argmax(present)) * window.step, 1)
                    track = Track(xy[present], heading[present], start)
                    users.append(RoadUser(number, track, recording.agents[member].shape))
            signals: Sequence[SignalRecord] = ()
            if program is not None and recording.signal_time is not None:
                offset = (recording.signal_time + window.start) % program.cycle
                until = window.step * (window.present.shape[1] - 1)
                signals = build_signal_records(
                    SignalClock(program, offset), intersection_map=intersection_map, until=until
                )
            yield recording.name, SceneTracks(tuple(users), tuple(signals))
