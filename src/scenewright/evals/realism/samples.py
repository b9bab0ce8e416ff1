"""What is compared: values of every measure from scenes and from recordings, in clusters."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from scenewright.evals.realism.distances import Sample
from scenewright.evals.realism.scenes import Played
from scenewright.evals.realism.stops import MEASURES, STANDING, Stop
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
"""Who is never slower than this [m/s] is held up by nobody."""
_GOING = {"vehicle": 1.0, "pedestrian": 0.5}
"""Who is faster than this [m/s] does not just shift about."""
Doing = Literal[
    "is never slow", "slows down", "comes to stand", "sets off", "stops and sets off", "stands"
]
LONG_ENOUGH = 30
"""Samples that a spread of speed needs."""
STEADY = 0.05
"""Below this an acceleration is none [m/s^2]: nobody drives or walks that evenly for long."""


@dataclass(frozen=True)
class Sieve:
    """Which samples of motion count.

    Attributes:
        type: of the agents; within: half the side of the square around the middle of the map in
            which positions count [m], None for all; smoothing: goes over positions first [s].
        doing: only agents that do this while they are seen there: what is left does not depend on
            how many wait at the lights, or set off there.
    """

    type: AgentClass
    within: float | None = None
    smoothing: float = 0.0
    doing: Doing | None = None


@dataclass(frozen=True, eq=False)
class Measured:
    """Every measure of one source.

    Attributes:
        samples: by measure; side: which half each cluster belongs to, by measure the same.
    """

    samples: Mapping[str, Sample]
    side: NDArray[np.bool_]

    def halves(self, measure: str) -> tuple[Sample, Sample]:
        """The two halves of the source."""
        sample, number = self.samples[measure], np.arange(len(self.side))
        return sample.only(number[self.side]), sample.only(number[~self.side])


Agents = Sequence[tuple[Track, Shape]]


def of_scenes(scenes: Sequence[Played], *, part: Part = "all") -> list[Agents]:
    """Each scene's agents, or those of its foreground or background."""
    return [
        [
            (user.track, user.shape)
            for user in scene.users
            if part == "all" or (user.id in scene.foreground) == (part == "foreground")
        ]
        for scene in scenes
    ]


def of_recordings(recordings: Iterable[Recording]) -> list[Agents]:
    """Each agent of real tracks as a cluster of its own, bicycles left out."""
    return [
        [(agent.track, agent.shape)]
        for recording in recordings
        for agent in recording.agents
        if agent.subtype != "bicycle"
    ]


def motion(clusters: Sequence[Agents], sieve: Sieve, *, side: Sequence[bool]) -> Measured:
    """Speed, acceleration and jerk of all agents of a class.

    Speeds of standing agents (0.3 m/s or less) count in `speed, standing too` alone: how long
    people stand is a matter of lights, and their accelerations are all 0. `spread of speed` is the
    standard deviation of the speed of one agent that is never slow, one value for each.
    """
    parts: dict[str, list[FloatArray]] = {name: [] for name in MOTION}
    for agents in clusters:
        values = [_motion(t, sieve) for t, shape in agents if shape.type == sieve.type]
        for k, name in enumerate(MOTION):
            parts[name].append(np.concatenate([np.zeros(0), *(each[k] for each in values)]))
    samples = {name: Sample.of(each) for name, each in parts.items()}
    return Measured(samples, np.asarray(side, dtype=np.bool_))


def _motion(track: Track, sieve: Sieve) -> tuple[FloatArray, ...]:
    """The values of one agent, in the order of MOTION."""
    done = compute_kinematics(track.xy, smoothing=sieve.smoothing)
    least = float(done.speed.min(initial=np.inf))
    here = np.ones(len(done), dtype=np.bool_)
    if sieve.within is not None:
        place = track.xy[done.first : done.first + len(done)]
        here = np.abs(place).max(axis=1, initial=0.0) <= sieve.within
    if sieve.doing is not None and doing(done.speed[here], sieve.type) != sieve.doing:
        return tuple(np.zeros(0) for _ in MOTION)
    moving = here & (done.speed > STANDING)
    free = least > UNIMPEDED[sieve.type] and int(here.sum()) >= LONG_ENOUGH
    spread = np.array([done.speed[here].std()]) if free else np.zeros(0)
    return (
        done.speed[moving], done.speed[here], done.acceleration[moving], done.jerk[moving], spread,
    )  # fmt: skip


def doing(speed: FloatArray, kind: AgentClass) -> Doing:
    """What an agent does while it is seen, by its speed [T] [m/s]."""
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


def moving_shares(
    clusters: Sequence[Agents], sieve: Sieve = Sieve("vehicle")
) -> dict[Doing, float | None]:
    """Shares of moving samples of vehicles by what these do; None where none moves."""
    counts: dict[Doing, int] = {
        each: len(motion(clusters, replace(sieve, doing=each), side=()).samples["speed"])
        for each in get_args(Doing)
    }
    every = sum(counts.values())
    return {each: count / every if every else None for each, count in counts.items()}


def in_shares(
    clusters: Sequence[Agents],
    shares: Mapping[Doing, float],
    sieve: Sieve,
    *,
    side: Sequence[bool],
    rng: np.random.Generator,
) -> Measured:
    """Acceleration and jerk of vehicles, as many of each kind as make these shares.

    What people meet with decides how often they stop; this compares how they move, whatever that
    is. Samples of who is seen too often are left out at random; who is never seen counts nowhere.
    """
    kinds = [motion(clusters, replace(sieve, doing=each), side=side) for each in shares]
    sizes = [len(each.samples["acceleration"]) for each in kinds]
    seen = [(n, share) for n, share in zip(sizes, shares.values(), strict=True) if n and share]
    most = min((n / share for n, share in seen), default=0.0)
    kept = [
        np.sort(rng.permutation(n)[: round(share * most)])
        for n, share in zip(sizes, shares.values(), strict=True)
    ]
    samples = {
        name: _joined([m.samples[name] for m in kinds], kept) for name in ("acceleration", "jerk")
    }
    return Measured(samples, np.asarray(side, dtype=np.bool_))


def _joined(samples: Sequence[Sample], kept: Sequence[NDArray[np.int64]]) -> Sample:
    """Some values of samples of the same clusters."""
    parts = list(zip(samples, kept, strict=True))
    return Sample(
        np.concatenate([each.values[k] for each, k in parts]),
        np.concatenate([each.cluster[k] for each, k in parts]),
        samples[0].clusters,
    )


def steady(clusters: Sequence[Agents], sieve: Sieve) -> float | None:
    """Share of moving samples without any acceleration; None where nobody moves."""
    sample = motion(clusters, sieve, side=()).samples["acceleration"].values
    return float((np.abs(sample) < STEADY).mean()) if len(sample) else None


def stopping(
    scenes: Sequence[Sequence[Stop]], kind: AgentClass, *, side: Sequence[bool]
) -> Measured:
    """Every measure of the stops of a class; a scene is a cluster."""
    samples = {
        name: Sample.of(list(_values(stops, kind, name)) for stops in scenes) for name in MEASURES
    }
    return Measured(samples, np.asarray(side, dtype=np.bool_))


def _values(stops: Iterable[Stop], kind: AgentClass, name: str) -> Iterator[float]:
    for stop in stops:
        value = getattr(stop, name)
        if stop.type == kind and value is not None:
            yield float(value)
