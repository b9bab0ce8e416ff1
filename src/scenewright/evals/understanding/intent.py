"""Which route each agent will take: a posterior over the components of p_wp.

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
_OPPOSITE = 400.0
"""Added to the squared distance [m^2] of points of a curve that leads the other way."""
_UNEXPLAINED = -18.0
"""Log density of a track that fits no component, so that no agent has zero likelihood [nats]."""


@dataclass(frozen=True, eq=False)
class RoutePosterior:
    """How the track so far fits every component; J numbers of it are measured.

    Attributes:
        components: of the agent's class; kept: [M] those that pass nearby.
        log_weight: [M] log posterior, normalised; log_share: [M] of how often each is taken then.
        nearest: [M] point of each mean curve that is nearest to the agent now.
        residual: [M, J] the track less the mean curve: lateral offset at samples [m], and heading
            at the first and the last [rad].
        sensitivity: [M, J, 20] of the residuals to the white noise of the waypoints.
        noise: [J] standard deviation of the residuals for a known curve.
    """

    components: RouteComponents
    kept: IntArray
    log_weight: FloatArray
    log_share: FloatArray
    nearest: IntArray
    residual: FloatArray
    sensitivity: FloatArray
    noise: FloatArray

    @property
    def weights(self) -> FloatArray:
        """[M] posterior of the components kept."""
        return np.asarray(np.exp(self.log_weight))


def infer_routes(observation: ObservedScene) -> dict[str, RoutePosterior]:
    """Compute the posterior of every observed agent."""
    place, hour = observation.intersection, observation.hour
    agents = ((agent, load_components(place, agent.type)) for agent in observation.agents)
    return {agent.id: _infer_route(agent, components, hour) for agent, components in agents}


def _infer_route(agent: ObservedAgent, components: RouteComponents, hour: int) -> RoutePosterior:
    # Components that pass the agent's position in its direction, or the nearest ones.
    every, last = np.arange(len(components.routes)), np.array([-1])
    least = np.sqrt(_measure_squared_distances(agent, last, components, every).min(axis=1))[:, 0]
    kept = np.flatnonzero(least < max(_NEARBY, float(least.min()) + 1.0))
    samples = _pick_samples(agent)
    nearest = _measure_squared_distances(agent, samples, components, kept).argmin(axis=1)
    rows, ends = kept[:, None], nearest[:, [0, -1]]
    away = agent.xy[samples] - components.curve[rows, nearest]
    normal = components.normal[rows, nearest]
    lateral = (away * normal).sum(axis=-1)
    turned = agent.heading[samples[[0, -1]]] - components.heading[rows, ends]
    residual = np.concatenate([lateral, (turned + np.pi) % (2 * np.pi) - np.pi], axis=1)
    sensitivity = np.concatenate(
        [components.across[rows, nearest], components.turn[rows, ends]], axis=1
    )
    noise = np.concatenate([np.full(len(samples), _NOISE), np.full(2, _TURN_NOISE)])
    log_share = components.share[hour][kept]
    log = log_share + _compute_track_likelihood(residual, sensitivity, noise)
    # Samples before the beginning or behind the end of a curve speak against it.
    past = away[..., 0] * normal[..., 1] - away[..., 1] * normal[..., 0]
    log = log - 0.5 * np.square(np.maximum(np.abs(past) - 1.0, 0.0)).sum(axis=1)
    if agent.is_vehicle:
        log = log + _compute_speed_likelihood(agent, components, kept, nearest[:, -1])
    unexplained = log_share + _UNEXPLAINED - 0.5 * np.abs(lateral).mean(axis=1)
    log = np.logaddexp(log, unexplained)
    log = log - np.logaddexp.reduce(log)
    return RoutePosterior(
        components, kept, log, log_share, nearest[:, -1], residual, sensitivity, noise
    )


def _pick_samples(agent: ObservedAgent) -> IntArray:
    """Samples evenly spread over the track so far, the last one among them."""
    wanted = np.linspace(0.0, agent.moved[-1], _SAMPLES)
    return np.unique(np.append(np.searchsorted(agent.moved, wanted - 1e-9), len(agent.moved) - 1))


def _measure_squared_distances(
    agent: ObservedAgent, samples: IntArray, components: RouteComponents, kept: IntArray
) -> FloatArray:
    """[M, P, J] from points of mean curves to samples [m^2], more where a curve leads back."""
    curve, normal = components.curve[kept][:, :, None], components.normal[kept][:, :, None]
    xy, heading = agent.xy[samples], agent.heading[samples]
    along = normal[..., 1] * np.cos(heading) - normal[..., 0] * np.sin(heading)
    return np.asarray(np.square(curve - xy).sum(axis=-1) + _OPPOSITE * (along < 0.0))


def _compute_track_likelihood(
    residual: FloatArray, sensitivity: FloatArray, noise: FloatArray
) -> FloatArray:
    """[M] log density of the residuals up to a constant: they are Gaussian as the waypoints are."""
    covariance = np.einsum("cji,cki->cjk", sensitivity, sensitivity) + np.diag(noise**2)
    cholesky = np.linalg.cholesky(covariance)
    white = np.linalg.solve(cholesky, residual[..., None])[..., 0]
    log_determinant = np.log(np.diagonal(cholesky, axis1=1, axis2=2)).sum(axis=1)
    return np.asarray(-0.5 * np.square(white).sum(axis=1) - log_determinant)


def _compute_speed_likelihood(
    agent: ObservedAgent, components: RouteComponents, kept: IntArray, nearest: IntArray
) -> FloatArray:
    """[M] log density of the speeds of the last two seconds, up to a constant.

    A free agent drives at its desired speed or what its curve allows; a held-up one below that.
    """
    back = np.arange(len(agent.speed) - 1, -1, -3)[:8]
    s = components.s[kept, nearest][:, None] - (agent.moved[-1] - agent.moved[back])
    bend = components.bend[kept]
    size, profiles, points = bend.shape
    rows = np.repeat(np.arange(size), profiles)
    limit = interpolate_rows(s[rows], components.s[kept][rows], bend.reshape(-1, points))
    free = np.minimum(max(float(agent.speed.max()), 2.0), limit).reshape(size, profiles, -1)
    deviation = (agent.speed[back] - free) / _SPEED_NOISE
    fits = -0.5 * np.minimum(np.square(deviation), 60.0).mean(axis=-1) * min(len(back), 4)
    fits = np.logaddexp.reduce(fits, axis=1) - np.log(profiles)
    held = np.where((deviation < 1.0).all(axis=-1).any(axis=-1), 0.0, -8.0) - 5.0
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
    waypoints = components.curve[:, :: (components.curve.shape[1] - 1) // (K - 1)]
    apart = np.sqrt(np.square(waypoints - xy).sum(axis=-1)).mean(axis=1)
    return components.routes[int(apart.argmin())].exit
