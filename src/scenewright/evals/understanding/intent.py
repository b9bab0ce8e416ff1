"""Exit prediction: the paper's nearest mean, and a posterior over the components of p_wp.

The posterior weighs every component of an agent's class by how often it is taken, by the likelihood
of the track so far (exact: a Gaussian in the waypoints, observed on a stretch of the curve) and by
that of its speeds: a turning vehicle slows down before the turn.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scenewright.evals.understanding.boosted_trees import IntArray
from scenewright.evals.understanding.cases import ObservedAgent, ObservedScene
from scenewright.evals.understanding.route_components import (
    RouteComponents,
    interpolate_rows,
    load_components,
)
from scenewright.geometry.map_areas import geos
from scenewright.geometry.polyline import interpolate_points
from scenewright.scene.base import FloatArray
from scenewright.scene.candidates import K

_SAMPLES = 6
"""At how many samples of the track the fit is measured."""
_NOISE, _TURN_NOISE = 0.06, 0.03
"""Error of the linear model of a curve, in position [m] and heading [rad]."""
_SPEED_NOISE = 0.3
"""Standard deviation of speeds about the driving profile [m/s]."""
_HELD = 0.25
"""Probability that an agent is held up by something else than its own route."""
_NEARBY = 6.0
"""Components that pass farther off [m] are left out."""
_UNEXPLAINED = -18.0
"""Log density of a track that fits no component, so that no agent has zero likelihood [nats]."""


@dataclass(frozen=True, eq=False)
class RoutePosterior:
    """How the track so far fits every component.

    Attributes:
        components: of the agent's class; kept: [M] those that pass nearby.
        log: [M] log posterior, normalised; share: [M] log of how often each is taken at that hour.
        nearest: [M] point of each mean curve that is nearest to the agent now.
        seen: [M, J, 20] what was measured, per unit of white noise; off: [M, J] its distance from
            the mean; noise: [J] its standard deviation.
    """

    components: RouteComponents
    kept: IntArray
    log: FloatArray
    share: FloatArray
    nearest: IntArray
    seen: FloatArray
    off: FloatArray
    noise: FloatArray

    @property
    def weights(self) -> FloatArray:
        """[M] posterior of the components kept."""
        return np.asarray(np.exp(self.log))


def infer_routes(observation: ObservedScene) -> dict[str, RoutePosterior]:
    """Compute the posterior of every observed agent."""
    place, hour = observation.intersection, observation.hour
    agents = ((agent, load_components(place, agent.type)) for agent in observation.agents)
    return {agent.id: _infer_route(agent, components, hour) for agent, components in agents}


def _infer_route(agent: ObservedAgent, components: RouteComponents, hour: int) -> RoutePosterior:
    # Components that pass the agent's position in its direction, or the nearest ones.
    facing = np.array([np.cos(agent.heading[-1]), np.sin(agent.heading[-1])])
    normal = components.normal
    along = np.stack([normal[..., 1], -normal[..., 0]], axis=-1) @ facing
    apart = np.square(components.curve - agent.xy[-1]).sum(axis=-1) + 400.0 * (along < 0.0)
    least = np.sqrt(apart.min(axis=1))
    kept = np.flatnonzero(least < max(_NEARBY, float(least.min()) + 1.0))
    samples = _pick_samples(agent)
    xy, heading = agent.xy[samples], agent.heading[samples]
    nearest, rows = _find_nearest(components, kept, xy, heading), kept[:, None]
    away, normal = xy - components.curve[rows, nearest], components.normal[rows, nearest]
    lateral = (away * normal).sum(axis=-1)
    past = away[..., 0] * normal[..., 1] - away[..., 1] * normal[..., 0]
    ends = nearest[:, [0, -1]]
    turned = heading[[0, -1]] - components.heading[rows, ends]
    turned = (turned + np.pi) % (2 * np.pi) - np.pi
    seen = np.concatenate([components.across[rows, nearest], components.turn[rows, ends]], axis=1)
    off = np.concatenate([lateral, turned], axis=1)
    noise = np.concatenate([np.full(len(samples), _NOISE), np.full(2, _TURN_NOISE)])
    share = components.share[hour][kept]
    # Exact: what was measured is Gaussian in the waypoints.
    chol = np.linalg.cholesky(np.einsum("cji,cki->cjk", seen, seen) + np.diag(noise**2))
    white = np.linalg.solve(chol, off[..., None])[..., 0]
    determinant = np.log(np.diagonal(chol, axis1=1, axis2=2)).sum(axis=1)
    evidence = -0.5 * np.square(white).sum(axis=1) - determinant
    # Samples before the beginning or behind the end of a curve speak against it.
    outside = -0.5 * np.square(np.maximum(np.abs(past) - 1.0, 0.0)).sum(axis=1)
    log = share + evidence + outside
    if agent.is_vehicle:
        log = log + _compute_speed_likelihood(agent, components, kept, nearest[:, -1])
    log = np.logaddexp(log, share + _UNEXPLAINED - 0.5 * np.abs(lateral).mean(axis=1))
    log = log - np.logaddexp.reduce(log)
    return RoutePosterior(components, kept, log, share, nearest[:, -1], seen, off, noise)


def _pick_samples(agent: ObservedAgent) -> IntArray:
    """Samples evenly spread over the track so far, the last one among them."""
    wanted = np.linspace(0.0, agent.moved[-1], _SAMPLES)
    return np.unique(np.append(np.searchsorted(agent.moved, wanted - 1e-9), len(agent.moved) - 1))


def _find_nearest(
    components: RouteComponents, kept: IntArray, xy: FloatArray, heading: FloatArray
) -> IntArray:
    """[M, J] the point of each mean curve nearest to each sample, in the same direction."""
    curve, normal = components.curve[kept][:, None], components.normal[kept][:, None]
    dx, dy = curve[..., 0] - xy[:, :1], curve[..., 1] - xy[:, 1:]
    facing = np.cos(heading)[:, None], np.sin(heading)[:, None]
    against = normal[..., 1] * facing[0] - normal[..., 0] * facing[1] < 0.0
    return np.asarray((dx * dx + dy * dy + 400.0 * against).argmin(axis=-1))


def _compute_speed_likelihood(
    agent: ObservedAgent, components: RouteComponents, kept: IntArray, at: IntArray
) -> FloatArray:
    """[M] log density of the speeds of the last two seconds, up to a constant.

    A free agent drives at its desired speed or what its curve allows; a held-up one below that.
    """
    back = np.arange(len(agent.speed) - 1, -1, -3)[:8]
    s = components.s[kept, at][:, None] - (agent.moved[-1] - agent.moved[back])
    bend = components.bend[kept]
    size, profiles, points = bend.shape
    rows = np.repeat(np.arange(size), profiles)
    limit = interpolate_rows(s[rows], components.s[kept][rows], bend.reshape(-1, points))
    free = np.minimum(max(float(agent.speed.max()), 2.0), limit).reshape(size, profiles, -1)
    gap = (agent.speed[back] - free) / _SPEED_NOISE
    fits = -0.5 * np.minimum(np.square(gap), 60.0).mean(axis=-1) * min(len(back), 4)
    fits = np.logaddexp.reduce(fits, axis=1) - np.log(profiles)
    held = np.where((gap < 1.0).all(axis=-1).any(axis=-1), 0.0, -8.0) - 5.0
    return np.asarray(np.logaddexp(np.log(1 - _HELD) + fits, np.log(_HELD) + held))


def find_nearest_mean(agent: ObservedAgent, *, intersection: str) -> str:
    """Name the exit of the component whose mean trajectory is nearest, the paper's baseline.

    Distances are from the samples to the mean trajectory, on average.
    """
    components = load_components(intersection, agent.type)
    samples = geos.points(agent.xy[_pick_samples(agent)])
    apart = geos.distance(geos.linestrings(components.curve)[:, None], samples)
    return components.routes[int(apart.mean(axis=1).argmin())].exit


def find_nearest_waypoints(agent: ObservedAgent, *, intersection: str) -> str:
    """The same by ten points at equal arc length against the ten mean waypoints."""
    components = load_components(intersection, agent.type)
    wanted = np.linspace(0.0, agent.moved[-1], K)
    xy = interpolate_points(wanted, agent.moved, agent.xy)
    marks = components.curve[:, :: (components.curve.shape[1] - 1) // (K - 1)]
    apart = np.sqrt(np.square(marks - xy).sum(axis=-1)).mean(axis=1)
    return components.routes[int(apart.argmin())].exit
