"""How scenes move and keep apart, against a corpus and real tracks: Wasserstein distances.

Speed, acceleration and jerk are those of moving agents; headway is that of vehicles behind another
in one lane, faster than 1 m/s and at most 10 s; PET is that of every encounter, at most 8.5 s.
Values of one scene (of one window of a recording) are drawn together for the intervals.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import stats

from scenewright.evals.bootstrap import Figure, compute_interval, draw_resamples
from scenewright.evals.realism.sources import Stretch, list_users
from scenewright.geometry.kinematics import compute_kinematics
from scenewright.scene.base import AgentClass, FloatArray
from scenewright.scene.map import IntersectionMap
from scenewright.tools.relation_checker import SceneObservation, observe
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


Parts = Sequence[FloatArray]
"""Values of one measure, an array for each scene; those of a scene are drawn together."""


def compute_distance(
    ours: Parts, reference: Parts, *, draws: int, rng: np.random.Generator
) -> Figure:
    """Compute the first Wasserstein distance of two samples, in the unit of their values.

    How far on average a value has to move for the one to become the other; of `ours` in n. Scenes
    of both are resampled for the interval, whose distances come out a little larger: resampling
    adds its own noise. No figure where a sample is empty.
    """
    sides = [[part for part in side if len(part)] for side in (ours, reference)]
    if not all(sides):
        return Figure(None, None, None, 0)
    values = [np.concatenate(side) for side in sides]
    edges = np.histogram_bin_edges(np.concatenate(values), CELLS)
    shares = []
    for side in sides:
        table = np.array([np.histogram(part, edges)[0] for part in side])
        drawn = draw_resamples(len(side), draws=draws, seed=rng) @ table
        shares.append(np.cumsum(drawn, axis=1) / drawn.sum(axis=1, keepdims=True))
    again = np.abs(shares[0] - shares[1]).sum(axis=1) * (edges[1] - edges[0])
    value = float(stats.wasserstein_distance(*values))
    return Figure(value, *compute_interval(again), len(values[0]))


@dataclass(frozen=True)
class ReferenceDistance:
    """One measure of the dataset against one reference.

    Attributes:
        group: whose it is, such as `vehicle`; reference: `corpus` or the name of real tracks.
        distance: Wasserstein distance of n values in as many scenes; n_reference: values there.
        halves: distance of two halves of the reference: what no set can be expected to go below.
        quantiles, reference_quantiles: 5, 50, 95 %.
    """

    measure: str
    group: str
    reference: str
    unit: str
    distance: Figure
    scenes: int
    n_reference: int
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


Values = Mapping[tuple[str, str], Parts]
"""(measure, group) -> values."""


def measure_scenes(scenes: Sequence[ObservedTracks], *, smoothing: float = 0.0) -> Values:
    """All measures of a set of scenes.

    Args:
        smoothing: over positions before derivatives are taken [s].
    """
    found: dict[tuple[str, str], Parts] = {
        **measure_motion([scene.scene for scene in scenes], smoothing=smoothing)
    }
    headways: list[FloatArray] = []
    pets: dict[str, list[FloatArray]] = {"vehicle-vehicle": [], "vehicle-pedestrian": []}
    for seen in (scene.seen for scene in scenes):
        lanes = [lane for lane in seen.lanes if seen.tracks[lane.follower].is_vehicle]
        moving = [lane.headway[(lane.speed > CREEP) & (lane.leader >= 0)] for lane in lanes]
        headway = np.concatenate([np.zeros(0), *moving])
        headways.append(headway[headway <= MOST_HEADWAY])
        for walkers, own in enumerate(pets.values()):
            own.append(np.array([
                encounter.pet for encounter in seen.encounters
                if walkers
                == sum(not seen.tracks[k].is_vehicle for k in (encounter.first, encounter.second))
            ]))  # fmt: skip
    found["headway", "vehicle"] = headways
    return found | {("PET", pair): own for pair, own in pets.items()}


def measure_motion(scenes: Sequence[Stretch], *, smoothing: float = 0.0) -> Values:
    """Speed, acceleration and jerk alone."""
    found: dict[tuple[str, str], Parts] = {}
    for kind in CLASSES:
        tracks = [[u.track.xy for u in scene.users if u.shape.type == kind] for scene in scenes]
        done = [[compute_kinematics(xy, smoothing=smoothing) for xy in own] for own in tracks]
        for measure in _MOTION:
            moving = (
                [getattr(each, measure)[each.speed > STANDING] for each in own] for own in done
            )
            found[measure, kind] = [np.concatenate([np.zeros(0), *parts]) for parts in moving]
    return found


def isolate_agents(recordings: Iterable[Recording]) -> list[Stretch]:
    """Every agent of real tracks by itself, as far as it was seen; bicycles left out."""
    return [
        Stretch((user,))
        for recording in recordings
        for user in list_users(recording, riders=False)
        if len(user.track.xy) > 1
    ]


def compare_with_reference(
    ours: Values, reference: Values, *, named: str, draws: int, seed: int
) -> Iterator[ReferenceDistance]:
    """Every measure against one reference."""
    for (measure, group), parts in ours.items():
        ref = reference[measure, group]
        rng = np.random.default_rng(seed)
        values, known = (np.concatenate([np.zeros(0), *side]) for side in (parts, ref))
        halves = [np.concatenate([np.zeros(0), *ref[half::2]]) for half in (0, 1)]
        yield ReferenceDistance(
            measure, group, named, UNITS[measure],
            distance=compute_distance(parts, ref, draws=draws, rng=rng),
            scenes=sum(len(part) > 0 for part in parts), n_reference=len(known),
            halves=float(stats.wasserstein_distance(*halves)) if all(map(len, halves)) else None,
            quantiles=_compute_quantiles(values), reference_quantiles=_compute_quantiles(known),
        )  # fmt: skip


def _compute_quantiles(values: FloatArray) -> tuple[float, ...] | None:
    if not len(values):
        return None
    return tuple(round(float(q), 3) for q in np.quantile(values, [0.05, 0.5, 0.95]))
