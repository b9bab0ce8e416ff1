"""Values of every compared measure from scenes and from recordings, in clusters."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from scenewright.evals.realism.distances import ClusterSample
from scenewright.evals.realism.scenes import SceneTracks
from scenewright.evals.realism.stops import MEASURES, STANDING, ObservedStop
from scenewright.geometry.kinematics import compute_kinematics
from scenewright.scene.base import AgentClass, FloatArray
from scenewright.scene.track import Shape, Track
from scenewright.tools.track_io import Recording

Part = Literal["all", "foreground", "background"]
UNITS: Mapping[str, str] = {
    "speed": "m/s",
    "speed, standing too": "m/s",
    "acceleration": "m/s²",
    "jerk": "m/s³",
    "spread of speed": "m/s",
    "duration": "s",
    "gap": "m",
    "line_gap": "m",
    "braking": "m/s²",
    "mean_braking": "m/s²",
    "starting": "m/s²",
    "mean_starting": "m/s²",
}
MOTION = ("speed", "speed, standing too", "acceleration", "jerk", "spread of speed")
UNIMPEDED = {"vehicle": 3.0, "pedestrian": 0.5}
"""An agent that is never slower than this [m/s] counts as unimpeded."""
_GOING = {"vehicle": 1.0, "pedestrian": 0.5}
"""An agent faster than this [m/s] is under way and does not just shift about."""
MotionKind = Literal[
    "is never slow", "slows down", "comes to stand", "sets off", "stops and sets off", "stands"
]
LONG_ENOUGH = 30
"""Samples that a spread of speed needs."""
STEADY = 0.05
"""Below this an acceleration is none [m/s^2]: real agents do not move that evenly for long."""


@dataclass(frozen=True)
class MotionFilter:
    """The samples of motion that count.

    Attributes:
        type: of the agents; within: half the side of the square around the middle of the map in
            which positions count [m], None for all; smoothing: goes over positions first [s].
        doing: only agents that do this while they are seen there: what is left does not depend on
            how many wait at the lights, or set off there.
    """

    type: AgentClass
    within: float | None = None
    smoothing: float = 0.0
    doing: MotionKind | None = None


@dataclass(frozen=True, eq=False)
class MeasuredSamples:
    """Every measure of one source.

    Attributes:
        samples: by measure; side: which half each cluster belongs to, by measure the same.
    """

    samples: Mapping[str, ClusterSample]
    side: NDArray[np.bool_]

    def split_halves(self, measure: str) -> tuple[ClusterSample, ClusterSample]:
        """Return the samples of the two halves of the source."""
        sample, number = self.samples[measure], np.arange(len(self.side))
        return sample.select(number[self.side]), sample.select(number[~self.side])


Agents = Sequence[tuple[Track, Shape]]


def list_scene_agents(scenes: Sequence[SceneTracks], *, part: Part = "all") -> list[Agents]:
    """List each scene's agents, or those of its foreground or background."""
    return [
        [
            (user.track, user.shape)
            for user in scene.users
            if part == "all" or (user.id in scene.foreground) == (part == "foreground")
        ]
        for scene in scenes
    ]


def list_recorded_agents(recordings: Iterable[Recording]) -> list[Agents]:
    """List each agent of real tracks as a cluster of its own, without bicycles."""
    return [
        [(agent.track, agent.shape)]
        for recording in recordings
        for agent in recording.agents
        if agent.subtype != "bicycle"
    ]


def measure_motion(
    clusters: Sequence[Agents], sieve: MotionFilter, *, side: Sequence[bool]
) -> MeasuredSamples:
    """Measure speed, acceleration and jerk of all agents of a class.

    Speeds of standing agents (0.3 m/s or less) count in `speed, standing too` alone: how long
    people stand is a matter of lights, and their accelerations are all 0. `spread of speed` is the
    standard deviation of the speed of one agent that is never slow, one value for each.
    """
    parts: dict[str, list[FloatArray]] = {name: [] for name in MOTION}
    for agents in clusters:
        values = [_measure_agent(t, sieve) for t, shape in agents if shape.type == sieve.type]
        for k, name in enumerate(MOTION):
            parts[name].append(np.concatenate([np.zeros(0), *(each[k] for each in values)]))
    samples = {name: ClusterSample.join_parts(each) for name, each in parts.items()}
    return MeasuredSamples(samples, np.asarray(side, dtype=np.bool_))


def _measure_agent(track: Track, sieve: MotionFilter) -> tuple[FloatArray, ...]:
    """Measure the values of one agent, in the order of MOTION."""
    done = compute_kinematics(track.xy, smoothing=sieve.smoothing)
    least = float(done.speed.min(initial=np.inf))
    here = np.ones(len(done), dtype=np.bool_)
    if sieve.within is not None:
        place = track.xy[done.first : done.first + len(done)]
        here = np.abs(place).max(axis=1, initial=0.0) <= sieve.within
    if sieve.doing is not None and classify_motion(done.speed[here], sieve.type) != sieve.doing:
        return tuple(np.zeros(0) for _ in MOTION)
    moving = here & (done.speed > STANDING)
    free = least > UNIMPEDED[sieve.type] and int(here.sum()) >= LONG_ENOUGH
    spread = np.array([done.speed[here].std()]) if free else np.zeros(0)
    return (
        done.speed[moving], done.speed[here], done.acceleration[moving], done.jerk[moving], spread,
    )  # fmt: skip


def classify_motion(speed: FloatArray, kind: AgentClass) -> MotionKind:
    """Classify what an agent does while it is seen, by its speed [T] [m/s]."""
    if speed.min(initial=np.inf) > UNIMPEDED[kind]:
        return "is never slow"
    standing = np.flatnonzero(speed <= STANDING)
    if not len(standing):
        return "slows down"
    comes, goes = (
        bool((part > _GOING[kind]).any()) for part in (speed[: standing[0]], speed[standing[-1] :])
    )
    if comes:
        return "stops and sets off" if goes else "comes to stand"
    return "sets off" if goes else "stands"


def compute_moving_shares(
    clusters: Sequence[Agents], sieve: MotionFilter = MotionFilter("vehicle")
) -> dict[MotionKind, float | None]:
    """Compute the shares of moving vehicle samples by kind of motion; None where none moves."""
    counts: dict[MotionKind, int] = {
        each: len(measure_motion(clusters, replace(sieve, doing=each), side=()).samples["speed"])
        for each in get_args(MotionKind)
    }
    every = sum(counts.values())
    return {each: count / every if every else None for each, count in counts.items()}


def sample_in_shares(
    clusters: Sequence[Agents],
    shares: Mapping[MotionKind, float],
    sieve: MotionFilter,
    *,
    side: Sequence[bool],
    rng: np.random.Generator,
) -> MeasuredSamples:
    """Sample acceleration and jerk of vehicles so that the kinds of motion have these shares.

    How often vehicles stop depends on what they meet; this compares how they move apart from that.
    Samples of kinds that are too frequent are dropped at random, kinds without any left out.
    """
    kinds = [measure_motion(clusters, replace(sieve, doing=each), side=side) for each in shares]
    sizes = [len(each.samples["acceleration"]) for each in kinds]
    seen = [(n, share) for n, share in zip(sizes, shares.values(), strict=True) if n and share]
    most = min((n / share for n, share in seen), default=0.0)
    kept = [
        np.sort(rng.permutation(n)[: round(share * most)])
        for n, share in zip(sizes, shares.values(), strict=True)
    ]
    samples = {
        name: _select_values([m.samples[name] for m in kinds], kept)
        for name in ("acceleration", "jerk")
    }
    return MeasuredSamples(samples, np.asarray(side, dtype=np.bool_))


def _select_values(
    samples: Sequence[ClusterSample], kept: Sequence[NDArray[np.int64]]
) -> ClusterSample:
    """Select some values of samples of the same clusters."""
    parts = list(zip(samples, kept, strict=True))
    return ClusterSample(
        np.concatenate([each.values[k] for each, k in parts]),
        np.concatenate([each.cluster[k] for each, k in parts]),
        samples[0].clusters,
    )


def compute_steady_share(clusters: Sequence[Agents], sieve: MotionFilter) -> float | None:
    """Compute the share of moving samples without acceleration; None where no agent moves."""
    sample = measure_motion(clusters, sieve, side=()).samples["acceleration"].values
    return float((np.abs(sample) < STEADY).mean()) if len(sample) else None


def measure_stops(
    scenes: Sequence[Sequence[ObservedStop]], kind: AgentClass, *, side: Sequence[bool]
) -> MeasuredSamples:
    """Measure the stops of a class; a scene is a cluster."""
    samples = {
        name: ClusterSample.join_parts(list(_list_values(stops, kind, name)) for stops in scenes)
        for name in MEASURES
    }
    return MeasuredSamples(samples, np.asarray(side, dtype=np.bool_))


def _list_values(stops: Iterable[ObservedStop], kind: AgentClass, name: str) -> Iterator[float]:
    for stop in stops:
        value = getattr(stop, name)
        if stop.type == kind and value is not None:
            yield float(value)
