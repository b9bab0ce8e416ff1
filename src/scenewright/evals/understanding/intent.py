"""Who leaves where: the paper's nearest mean, and a posterior over the components of p_wp.

The posterior of one agent weighs every component of its class by how often it is taken, by how
well the way seen so far fits it (exact: a Gaussian in the waypoints, seen on a stretch of the
curve) and by how well its speeds do: who is about to turn slows down, and not before.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scenewright.evals.understanding.observing import Observation, Seen
from scenewright.evals.understanding.ways import Ways, ways_of
from scenewright.scene.base import FloatArray
from scenewright.scene.candidates import K
from scenewright.scene.map import Route

IntArray = NDArray[np.intp]

_PLACES = {"vehicle": 6, "pedestrian": 6}
"""At how many places of the way so far the fit is measured."""
_NOISE, _TURN_NOISE = 0.06, 0.03
"""What the linear picture of a curve is off by, in place [m] and heading [rad]."""
_SPEED_NOISE = 0.3
"""By how much speeds are off the law's [m/s]."""
_HELD = 0.25
"""How often somebody is held up by something else than its own way."""
_NEARBY = 6.0
"""Components that pass farther off [m] are not looked at."""
_ODD = -18.0
"""Log density of a way that fits nothing, so that nobody falls out of the picture [nats]."""


@dataclass(frozen=True, eq=False)
class Fit:
    """How the way seen so far fits every component.

    Attributes:
        ways: of the agent's class; kept: [M] those components that pass nearby.
        log: [M] log posterior, normalised.
        seen: [M, J, 20] what was measured, per unit of white noise; off: [M, J] by how much it
            is off the mean; noise: [J] its standard deviation.
    """

    ways: Ways
    kept: IntArray
    log: FloatArray
    seen: FloatArray
    off: FloatArray
    noise: FloatArray

    @property
    def weights(self) -> FloatArray:
        """[M] posterior of the components kept."""
        return np.asarray(np.exp(self.log))

    def exits(self, sides: tuple[str, ...]) -> FloatArray:
        """[E] posterior of the exits."""
        return np.asarray(self.weights @ self.ways.exits_matrix(sides)[self.kept])

    @property
    def routes(self) -> tuple[Route, ...]:
        """[M] whose components were kept."""
        return tuple(self.ways.routes[c] for c in self.kept.tolist())


def fit(agent: Seen, *, intersection: str, hour: int) -> Fit:
    """The posterior of one agent over the components of its class."""
    ways = ways_of(intersection, agent.type)
    kept = _nearby(ways, agent)
    places = _places(agent)
    xy, heading = agent.xy[places], agent.heading[places]
    nearest = _nearest(ways, kept, xy, heading)
    rows = kept[:, None]
    away = xy - ways.curve[rows, nearest]
    normal = ways.normal[rows, nearest]
    beside = (away * normal).sum(axis=-1)
    past = away[..., 0] * normal[..., 1] - away[..., 1] * normal[..., 0]
    ends = nearest[:, [0, -1]]
    turned = _wrapped(heading[[0, -1]] - ways.heading[rows, ends])
    seen = np.concatenate([ways.across[rows, nearest], ways.turn[rows, ends]], axis=1)
    off = np.concatenate([beside, turned], axis=1)
    noise = np.concatenate([np.full(len(places), _NOISE), np.full(2, _TURN_NOISE)])
    share = ways.share[hour][kept]
    log = share + _evidence(seen, off, noise) + _beyond(past)
    if agent.vehicle:
        log = log + _pace(agent, ways, kept, nearest[:, -1])
    log = np.logaddexp(log, share + _ODD - 0.5 * np.abs(beside).mean(axis=1))
    return Fit(ways, kept, log - np.logaddexp.reduce(log), seen, off, noise)


def _nearby(ways: Ways, agent: Seen) -> IntArray:
    """Components that pass the agent's place going its way, or the nearest ones."""
    facing = np.array([np.cos(agent.heading[-1]), np.sin(agent.heading[-1])])
    along = np.stack([ways.normal[..., 1], -ways.normal[..., 0]], axis=-1) @ facing
    apart = np.square(ways.curve - agent.xy[-1]).sum(axis=-1) + 400.0 * (along < 0.0)
    least = np.sqrt(apart.min(axis=1))
    return np.flatnonzero(least < max(_NEARBY, float(least.min()) + 1.0))


def _places(agent: Seen) -> IntArray:
    """Samples evenly spread over the way so far, the last one among them."""
    wanted = np.linspace(0.0, agent.moved[-1], _PLACES[agent.type])
    return np.unique(np.append(np.searchsorted(agent.moved, wanted - 1e-9), len(agent.moved) - 1))


def _nearest(ways: Ways, kept: IntArray, xy: FloatArray, heading: FloatArray) -> IntArray:
    """[M, J] the point of each mean curve nearest to each place, going the same way."""
    curve, normal = ways.curve[kept][:, None], ways.normal[kept][:, None]
    dx, dy = curve[..., 0] - xy[:, :1], curve[..., 1] - xy[:, 1:]
    facing = np.cos(heading)[:, None], np.sin(heading)[:, None]
    against = normal[..., 1] * facing[0] - normal[..., 0] * facing[1] < 0.0
    return np.asarray((dx * dx + dy * dy + 400.0 * against).argmin(axis=-1))


def _beyond(past: FloatArray) -> FloatArray:
    """[C] log factor of places that lie before the beginning or behind the end of a curve."""
    return np.asarray(-0.5 * np.square(np.maximum(np.abs(past) - 1.0, 0.0)).sum(axis=1))


def _evidence(seen: FloatArray, off: FloatArray, noise: FloatArray) -> FloatArray:
    """[C] log density of what was measured."""
    spread = np.einsum("cji,cki->cjk", seen, seen) + np.diag(noise**2)
    chol = np.linalg.cholesky(spread)
    white = np.linalg.solve(chol, off[..., None])[..., 0]
    return np.asarray(
        -0.5 * np.square(white).sum(axis=1)
        - np.log(np.diagonal(chol, axis1=1, axis2=2)).sum(axis=1)
    )


def _pace(agent: Seen, ways: Ways, kept: IntArray, at: IntArray) -> FloatArray:
    """[M] log density of the speeds of the last second or two, up to a constant.

    Free, an agent drives its own speed or what its curve allows; held up, anything below that.
    """
    back = np.arange(len(agent.speed) - 1, -1, -3)[:8]
    place = ways.s[kept, at][:, None] - (agent.moved[-1] - agent.moved[back])
    bend = ways.bend[kept]
    size, laws, points = bend.shape
    rows = np.repeat(np.arange(size), laws)
    limit = rows_interp(place[rows], ways.s[kept][rows], bend.reshape(-1, points))
    free = np.minimum(max(float(agent.speed.max()), 2.0), limit).reshape(size, laws, -1)
    gap = (agent.speed[back] - free) / _SPEED_NOISE
    fits = -0.5 * np.minimum(np.square(gap), 60.0).mean(axis=-1) * min(len(back), 4)
    fits = np.logaddexp.reduce(fits, axis=1) - np.log(laws)
    held = np.where((gap < 1.0).all(axis=-1).any(axis=-1), 0.0, -8.0) - 5.0
    return np.asarray(np.logaddexp(np.log(1 - _HELD) + fits, np.log(_HELD) + held))


def rows_interp(at: FloatArray, s: FloatArray, values: FloatArray) -> FloatArray:
    """Linear interpolation row by row, in one call: rows are laid end to end."""
    rows = np.arange(len(s))[:, None] * 1e4
    clipped = np.clip(at, s[:, :1], s[:, -1:])
    flat = np.interp((clipped + rows).ravel(), (s + rows).ravel(), values.ravel())
    return np.asarray(flat.reshape(at.shape))


def _wrapped(angle: FloatArray) -> FloatArray:
    return np.asarray((angle + np.pi) % (2 * np.pi) - np.pi)


def fits_of(observation: Observation) -> dict[str, Fit]:
    """The posterior of everybody seen."""
    place, hour = observation.intersection, observation.hour
    return {agent.id: fit(agent, intersection=place, hour=hour) for agent in observation.agents}


def nearest_mean(agent: Seen, *, intersection: str) -> str:
    """The paper's baseline: the exit of the component whose mean trajectory is nearest.

    The mean over the places seen of the distance to the nearest point of the mean trajectory.
    """
    ways = ways_of(intersection, agent.type)
    xy = agent.xy[_places(agent)][None, :, None]
    chord = np.diff(ways.curve, axis=1)[:, None]
    from_start = xy - ways.curve[:, None, :-1]
    along = (from_start * chord).sum(axis=-1) / np.maximum(np.square(chord).sum(axis=-1), 1e-9)
    away = from_start - np.clip(along, 0.0, 1.0)[..., None] * chord
    apart = np.sqrt(np.square(away).sum(axis=-1).min(axis=-1))
    return ways.routes[int(apart.mean(axis=1).argmin())].exit


def nearest_waypoints(agent: Seen, *, intersection: str) -> str:
    """The same, word for word: ten points at equal arc length against the ten mean waypoints."""
    ways = ways_of(intersection, agent.type)
    wanted = np.linspace(0.0, agent.moved[-1], K)
    xy = np.stack([np.interp(wanted, agent.moved, agent.xy[:, d]) for d in (0, 1)], axis=-1)
    marks = ways.curve[:, :: (ways.curve.shape[1] - 1) // (K - 1)]
    apart = np.sqrt(np.square(marks - xy).sum(axis=-1)).mean(axis=1)
    return ways.routes[int(apart.argmin())].exit
