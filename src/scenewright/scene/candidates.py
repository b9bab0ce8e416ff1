"""The routes of each agent (paper 3.1), and what the agent generator offers on them: waypoints,
path, time law, likelihoods."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from scenewright.scene.base import AgentClass, FloatArray, Model, frozen
from scenewright.scene.map_elements import Route
from scenewright.scene.reaction_behavior import YieldingModel
from scenewright.scene.track import Shape


class AssignedPattern(Model):
    """How one relation is realised: its pattern, the roles, the red-light runner."""

    edge: int
    pattern: str
    from_: str
    to: str
    violator: str | None


class RoleAssignment(Model):
    """One consistent choice of routes for all agents of the social graph."""

    routes: dict[str, Route]
    patterns: tuple[AssignedPattern, ...]


class Grounding(Model):
    """Routes that each agent may travel; at least one `RoleAssignment` over them exists."""

    routes: dict[str, tuple[Route, ...]]


K = 10
"""Waypoints per candidate, at equal arc length (SEMANTICS section 6)."""


PACE_STEP = 1.0
"""Distance between the places at which `DrivingProfile.pace` says how fast an agent goes [m]."""


FORESIGHT = 6.0
"""How far ahead a bend is slowed down for, usually [m]."""


@dataclass(frozen=True)
class DrivingProfile:
    """How an agent drives or walks its path when nothing holds it.

    Attributes:
        speed: free speed on a straight [m/s].
        acceleration, braking: comfortable, along the path [m/s^2, both positive].
        lateral: comfortable lateral acceleration in curves [m/s^2].
        pace: share of the free speed at every `PACE_STEP` of the way; the last for what is beyond,
            and none where the speed does not wander.
        foresight: how far ahead a bend is slowed down for [m].
    """

    speed: float
    acceleration: float
    braking: float
    lateral: float
    pace: tuple[float, ...] = ()
    foresight: float = FORESIGHT


@dataclass(frozen=True, eq=False)
class Path:
    """A smooth curve (paper Eq. 3), finely sampled.

    Attributes:
        xy: [P, 2] points [m].
        s: [P] arc length of the points [m], from 0, increasing, evenly spaced.
        heading: [P] tangent direction [rad], continuous (unwrapped).
        curvature: [P] signed curvature [1/m], smoothed over about 2 m.
    """

    xy: FloatArray
    s: FloatArray
    heading: FloatArray
    curvature: FloatArray

    def __post_init__(self) -> None:
        for name in ("xy", "s", "heading", "curvature"):
            object.__setattr__(self, name, frozen(getattr(self, name)))

    @property
    def length(self) -> float:
        """Total arc length [m]."""
        return float(self.s[-1])


def sample_evenly(length: float, count: int) -> FloatArray:
    """[count] arc lengths [m] from 0 to the very end; what `linspace` gives, in a third of it."""
    s = np.arange(count) * (length / (count - 1))
    s[-1] = length
    return np.asarray(s)


@dataclass(frozen=True, eq=False)
class Candidate:
    """One sampled way to travel a route (paper Eq. 2).

    Attributes:
        waypoints: [K, 2] at equal arc length [m].
        nll: -log p_wp of the waypoints [nats].
        time_law: how it moves; time_nll: -log p_time of it [nats].
        unevaded: its path if it did not evade a threat; None where `path` is that.
    """

    route: Route
    waypoints: FloatArray
    path: Path
    nll: float
    time_law: DrivingProfile
    time_nll: float
    shape: Shape
    subtype: str | None
    unevaded: Path | None = None


@dataclass(frozen=True, eq=False)
class DrawnWaypoints:
    """M draws from the priors of one agent, as arrays, in the order drawn.

    Attributes:
        waypoints: [M, K, 2] at equal arc length [m]; nll: [M] -log p_wp [nats].
        component: [M] the component of p_wp that each fits best.
        time_laws, time_nll: M time laws and their -log density [nats].
        pace: gives the pace of the m-th time law; None where the laws have it.
        aside: gives the m-th course of how far to the left of the path it walks between its
            waypoints [m]; None where it does not wander.
    """

    waypoints: FloatArray
    nll: FloatArray
    component: NDArray[np.intp]
    time_laws: tuple[DrivingProfile, ...]
    time_nll: FloatArray
    pace: Callable[[int], tuple[float, ...]] | None = None
    aside: Callable[[int], FloatArray] | None = None


@dataclass(frozen=True, eq=False)
class AgentCandidates:
    """What is offered for one agent: M candidates.

    Attributes:
        draw: draws them when first called, and gives the same ever after.
        build: makes the m-th `Candidate`, its path splined on demand (Eq. 3).
        arrival: when it would reach the middle of its way [s], from exponential intervals;
            None for agents that a relation places.
        chance: which of all moments at which it would be seen it comes at, 0 to 1; None where
            `arrival` alone says when.
        reserve: drawn beyond the number wanted, for when another agent finds no room.
        beside: the pedestrian it walks with, in the background.
    """

    name: str
    role: Literal["foreground", "background"]
    route: Route
    shape: Shape
    subtype: str | None
    draw: Callable[[], DrawnWaypoints]
    build: Callable[[int], Candidate]
    arrival: float | None = None
    chance: float | None = None
    reserve: bool = False
    beside: str | None = None

    @property
    def drawn(self) -> DrawnWaypoints:
        """The draws themselves."""
        return self.draw()

    @property
    def nll(self) -> FloatArray:
        """[M] -log p_wp [nats]."""
        return self.drawn.nll

    @property
    def time_nll(self) -> FloatArray:
        """[M] -log density of the time laws [nats]."""
        return self.drawn.time_nll


@dataclass(frozen=True, eq=False)
class CandidateSet:
    """The product of the agent generator: draws for every agent of the amplified scene (Eq. 1).

    Attributes:
        cast: routes and patterns of the foreground.
        hour: time of day [h] that the numbers were drawn for.
        background: how many background agents of each class the scene shall have.
        least: how many of each suffice where the rest finds no room: fewer only where the time of
            day, and no words, set the number.
        yielding_model: how agents yield at this intersection.
        groups: members that walk with a pedestrian of the social graph, by its name.
    """

    agents: Mapping[str, AgentCandidates]
    cast: RoleAssignment
    hour: float
    background: Mapping[AgentClass, int]
    yielding_model: YieldingModel = field(default_factory=dict)
    groups: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    least: Mapping[AgentClass, int] = field(default_factory=dict)
