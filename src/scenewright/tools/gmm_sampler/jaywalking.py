"""The assumed prior of crossing outside a crosswalk, which no simulated pedestrian does.

People cross a leg roughly straight, a little askew, 15 to 40 m from the middle, beginning and
ending about two metres inside the sidewalks. Start and end are Gaussian; the waypoints in between
lie evenly on the line between them, so the prior is a Gaussian mixture like any other.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from scenewright.errors import InputError
from scenewright.scene.base import FloatArray
from scenewright.scene.candidates import K
from scenewright.scene.map import IntersectionMap, Route
from scenewright.tools.gmm_sampler.priors import WaypointPrior
from scenewright.tools.gmm_sampler.spline import DENSE

_PLACES = (19.0, 23.5, 28.0, 32.5, 37.0)
_PLACE_SPREAD = 1.9
_SKEW_SPREAD = 1.2
_ONTO_SIDEWALK = 2.0
_SIDEWALK_SPREAD = 0.45
_WOBBLE = 0.08


def jaywalk_prior(place: IntersectionMap, route: Route) -> WaypointPrior:
    """p_wp of a jaywalking route: one component per stretch of the leg, all alike."""
    leg = next((leg for leg in place.legs if leg.name == route.crosswalk), None)
    if leg is None:
        raise InputError(f"route {route.id} names no leg of {place.name}")
    outwards = np.array([math.cos(leg.bearing), math.sin(leg.bearing)])
    across = _across(place, route)
    reach = _half_width(place, route, outwards) + _ONTO_SIDEWALK
    ends = [
        np.concatenate([at * outwards - reach * across, at * outwards + reach * across])
        for at in _PLACES
    ]
    return _mixture(route.id, ends, outwards, across)


def jaywalk_components(
    route: str, kerbs: Sequence[FloatArray], outwards: FloatArray
) -> WaypointPrior:
    """p_wp of jaywalking from kerb to kerb [2, 2] at places of one's own choice, all alike."""
    ends = []
    for first, last in kerbs:
        across = (last - first) / float(np.hypot(*(last - first)))
        ends.append(
            np.concatenate([first - _ONTO_SIDEWALK * across, last + _ONTO_SIDEWALK * across])
        )
    return _mixture(route, ends, outwards, across)


def _mixture(
    route: str, ends: Sequence[FloatArray], outwards: FloatArray, across: FloatArray
) -> WaypointPrior:
    means = np.array([_between(K) @ end for end in ends])
    factor = np.linalg.cholesky(_covariance(outwards, across))
    return WaypointPrior(
        route=route,
        weights=np.full(len(ends), 1.0 / len(ends)),
        means=means,
        cholesky=np.repeat(factor[None], len(ends), axis=0),
        base=np.array([(_between(DENSE) @ end).reshape(DENSE, 2) for end in ends]),
        tracks=0,
    )


def _across(place: IntersectionMap, route: Route) -> FloatArray:
    """Unit vector from the entry side to the exit side of the crossed leg."""
    crosswalk = next(c for c in place.crosswalks if c.leg == route.crosswalk)
    first, last = np.array(crosswalk.centreline)
    towards = (last - first) / np.linalg.norm(last - first)
    return np.asarray(towards if crosswalk.sides[0] == route.entry else -towards)


def _half_width(place: IntersectionMap, route: Route, outwards: FloatArray) -> float:
    """From the middle of the leg to its kerb [m]: the outer bound of its kerbside lanes."""
    aside = np.array([-outwards[1], outwards[0]])
    bounds = [
        np.array(lane.right) @ aside for lane in place.lanelets if lane.leg == route.crosswalk
    ]
    return float(np.abs(np.concatenate(bounds)).max())


def _between(count: int) -> FloatArray:
    """[2 count, 4] points evenly between a start and an end, as a linear map of both."""
    t = np.linspace(0.0, 1.0, count)
    return np.asarray(np.kron(np.stack([1 - t, t], axis=1), np.eye(2)), dtype=np.float64)


def _covariance(outwards: FloatArray, across: FloatArray) -> FloatArray:
    along = np.outer(outwards, outwards)
    aside = _SIDEWALK_SPREAD**2 * np.outer(across, across)
    shared, own = _PLACE_SPREAD**2 * along, (_SKEW_SPREAD**2 / 2) * along + aside
    ends = np.block([[shared + own, shared], [shared, shared + own]])
    line = _between(K)
    return np.asarray(line @ ends @ line.T + _WOBBLE**2 * np.eye(2 * K))
