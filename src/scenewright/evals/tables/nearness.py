"""How scenes move and keep apart, against a corpus and real tracks: Wasserstein distances.

Speed, acceleration and jerk are those of moving agents; headway is that of vehicles behind another
in one lane, faster than 1 m/s and at most 10 s; PET is that of every encounter, at most 8.5 s.
Values of one scene (of one window of a recording) are drawn together for the intervals.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from scenewright.evals.bootstrap import compute_interval, draw_resamples
from scenewright.evals.realism.sources import Stretch
from scenewright.geometry.kinematics import compute_kinematics
from scenewright.scene.base import AgentClass, FloatArray
from scenewright.scene.map import IntersectionMap
from scenewright.tools.relation_checker import RoadUser, SceneObservation, observe
from scenewright.tools.track_io import Recording

STANDING = 0.3
MOST_HEADWAY = 10.0
CREEP = 1.0
UNITS: Mapping[str, str] = {
    "speed": "m/s", "acceleration": "m/s²", "jerk": "m/s³", "headway": "s", "PET": "s",
}  # fmt: skip
_MOTION = ("speed", "acceleration", "jerk")
CLASSES: tuple[AgentClass, ...] = ("vehicle", "pedestrian")


@dataclass(frozen=True, eq=False)
class ObservedTracks:
    """A scene with all that the checker measures in it."""

    scene: Stretch
    seen: SceneObservation


CELLS = 2048
"""Cells of the histograms from which intervals are drawn; distances themselves are exact."""


@dataclass(frozen=True, eq=False)
class ClusterSample:
    """Values of one measure, in clusters that were drawn together (scenes, agents).

    Attributes:
        values: [N]; cluster: [N] number of the cluster that each belongs to.
    """

    values: FloatArray
    cluster: NDArray[np.int64]

    @classmethod
    def join_parts(cls, parts: Iterable[Sequence[float] | FloatArray]) -> ClusterSample:
        """Build a sample with one cluster from each part."""
        arrays = [np.asarray(part, dtype=np.float64) for part in parts]
        number = np.repeat(np.arange(len(arrays)), [len(array) for array in arrays])
        return cls(np.concatenate([np.zeros(0), *arrays]), number)


def compute_wasserstein(first: FloatArray, second: FloatArray) -> float | None:
    """Compute the first Wasserstein distance of two samples, in the unit of their values.

    How far on average a value has to move for the one to become the other. None where a sample is
    empty.
    """
    return float(stats.wasserstein_distance(first, second)) if len(first) and len(second) else None


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
    edges = np.histogram_bin_edges(np.concatenate([sample.values, reference.values]), CELLS)
    shares = []
    for each in (sample, reference):
        used, number = np.unique(each.cluster, return_inverse=True)
        table = np.histogram2d(number, each.values, (np.arange(len(used) + 1), edges))[0]
        drawn = draw_resamples(len(used), draws=draws, seed=rng) @ table
        shares.append(np.cumsum(drawn, axis=1) / drawn.sum(axis=1, keepdims=True))
    again = np.abs(shares[0] - shares[1]).sum(axis=1) * (edges[1] - edges[0])
    clusters, sizes = len(np.unique(sample.cluster)), (len(sample.values), len(reference.values))
    return Distance(value, *compute_interval(again), *sizes, clusters)


@dataclass(frozen=True)
class ReferenceDistance:
    """One measure of the dataset against one reference.

    Attributes:
        group: whose it is, such as `vehicle`; reference: `corpus` or the name of real tracks.
        distance: None where one of both has no value.
        halves: distance of two halves of the reference: what no set can be expected to go below.
        quantiles, reference_quantiles: 5, 50, 95 %.
    """

    measure: str
    group: str
    reference: str
    distance: Distance | None
    halves: float | None
    quantiles: tuple[float, ...] | None
    reference_quantiles: tuple[float, ...] | None


def observe_scenes(
    scenes: Iterable[Stretch], *, intersection_map: IntersectionMap | None
) -> Iterator[ObservedTracks]:
    """Scenes with what the checker measures."""
    for scene in scenes:
        seen = observe(
            scene.users,
            intersection_map=intersection_map,
            signals=scene.signals,
            asked=scene.asked,
            detailed=(),
        )
        yield ObservedTracks(scene, seen)


Values = Mapping[tuple[str, str], ClusterSample]
"""(measure, group) -> values."""


def measure_scenes(scenes: Sequence[ObservedTracks], *, smoothing: float = 0.0) -> Values:
    """All measures of a set of scenes.

    Args:
        smoothing: over positions before derivatives are taken [s].
    """
    found = measure_motion([each.scene for each in scenes], smoothing=smoothing)
    headways: list[FloatArray] = []
    pets: dict[str, list[list[float]]] = {"vehicle-vehicle": [], "vehicle-pedestrian": []}
    for seen in (each.seen for each in scenes):
        lanes = [lane for lane in seen.lanes if seen.tracks[lane.follower].is_vehicle]
        moving = [lane.headway[(lane.speed > CREEP) & (lane.leader >= 0)] for lane in lanes]
        headway = np.concatenate([np.zeros(0), *moving])
        headways.append(headway[headway <= MOST_HEADWAY])
        for walkers, own in enumerate(pets.values()):
            own.append([
                each.pet for each in seen.encounters
                if sum(not seen.tracks[k].is_vehicle for k in (each.first, each.second)) == walkers
            ])  # fmt: skip
    found["headway", "vehicle"] = ClusterSample.join_parts(headways)
    return found | {("PET", pair): ClusterSample.join_parts(own) for pair, own in pets.items()}


def measure_motion(
    scenes: Sequence[Stretch], *, smoothing: float = 0.0
) -> dict[tuple[str, str], ClusterSample]:
    """Speed, acceleration and jerk alone."""
    found = {}
    for kind in CLASSES:
        parts: dict[str, list[FloatArray]] = {measure: [] for measure in _MOTION}
        for scene in scenes:
            own = [user.track.xy for user in scene.users if user.shape.type == kind]
            done = [compute_kinematics(xy, smoothing=smoothing) for xy in own]
            for measure, values in parts.items():
                moving = (getattr(each, measure)[each.speed > STANDING] for each in done)
                values.append(np.concatenate([np.zeros(0), *moving]))
        for measure, values in parts.items():
            found[measure, str(kind)] = ClusterSample.join_parts(values)
    return found


def isolate_agents(recordings: Iterable[Recording]) -> list[Stretch]:
    """Every agent of real tracks by itself, as far as it was seen; bicycles left out."""
    return [
        Stretch((RoadUser(0, agent.track, agent.shape),))
        for recording in recordings
        for agent in recording.agents
        if agent.subtype != "bicycle" and len(agent.track.xy) > 1
    ]


def compare_with_reference(
    ours: Values, reference: Values, *, named: str, draws: int, seed: int
) -> Iterator[ReferenceDistance]:
    """Every measure against one reference."""
    for (measure, group), sample in ours.items():
        ref = reference[measure, group]
        even = ref.cluster % 2 == 0
        rng = np.random.default_rng(seed)
        yield ReferenceDistance(
            measure, group, named,
            distance=compute_distance(sample, ref, draws=draws, rng=rng),
            halves=compute_wasserstein(ref.values[even], ref.values[~even]),
            quantiles=_compute_quantiles(sample.values),
            reference_quantiles=_compute_quantiles(ref.values),
        )  # fmt: skip


def _compute_quantiles(values: FloatArray) -> tuple[float, ...] | None:
    if not len(values):
        return None
    return tuple(round(float(q), 3) for q in np.quantile(values, [0.05, 0.5, 0.95]))
