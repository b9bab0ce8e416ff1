"""The ways of an intersection as arrays: every component of p_wp with its curve, and its law.

All of it comes from the bundle. Deviations from a component's mean curve are linear in the
waypoints (Eq. 3), so that having been seen on a stretch of it narrows a Gaussian down, exactly.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from scenewright.geometry.landmarks import find_landmarks
from scenewright.geometry.map_areas import MapAreas
from scenewright.scene.base import AgentClass, FloatArray
from scenewright.scene.candidates import Candidate, DrivingProfile, K
from scenewright.scene.map import IntersectionMap, Route
from scenewright.scene.track import PEDESTRIAN, vehicle_shape
from scenewright.tools.gmm_sampler import Priors, load_priors
from scenewright.tools.gmm_sampler.priors import HOURS, DrivingProfilePrior
from scenewright.tools.gmm_sampler.spline import PER_INTERVAL, even_path, spline_matrix

_SPREAD = (-1.2, 0.0, 1.2)
"""Laws that are looked at lie so many standard deviations off the median."""
_BOUNDS = ("low", "high")
_THIN = 4
"""Every fourth point of a base curve is kept: they lie one or two metres apart."""
POINTS = (K - 1) * PER_INTERVAL // _THIN + 1


@dataclass(frozen=True, eq=False)
class Ways:
    """Components of all routes of one class, C in number, P points each.

    Attributes:
        kind: the class.
        routes: [C] whose component it is; exits: [C] their exits.
        share: [24, C] log of how often it is taken, by hour of the day.
        curve: [C, P, 2] mean path [m]; s: [C, P] arc length [m]; heading: [C, P] [rad];
            curvature: [C, P] [1/m]; normal: [C, P, 2] to the left.
        knots: [P, K] the spline as a linear map from waypoints to points.
        across: [C, P, 20] deviation to the left per unit of white noise [m].
        turn: [C, P, 20] deviation in heading per unit of white noise [rad].
        cholesky: [C, 20, 20] of the waypoints [m].
        line: [C] arc length of stop line or kerb [m], a vehicle's front on it; inf for none.
        group: [C] signal group that rules it, or None.
        bend: [C, D, P] speed that the curves ahead allow [m/s], by D laws as drivers have them.
        law: [C, 4] medians and spread: [C, 4] of the logarithm; low, high: [C, 4] bounds.
    """

    kind: AgentClass
    routes: tuple[Route, ...]
    share: FloatArray
    curve: FloatArray
    s: FloatArray
    heading: FloatArray
    curvature: FloatArray
    normal: FloatArray
    knots: FloatArray
    across: FloatArray
    turn: FloatArray
    cholesky: FloatArray
    line: FloatArray
    group: tuple[str | None, ...]
    bend: FloatArray
    law: FloatArray
    spread: FloatArray
    low: FloatArray
    high: FloatArray

    def exits_matrix(self, sides: tuple[str, ...]) -> NDArray[np.bool_]:
        """[C, E] whether a component leaves towards a side."""
        return np.array([[route.exit == side for side in sides] for route in self.routes])


@lru_cache(maxsize=8)
def ways_of(intersection: str, kind: AgentClass) -> Ways:
    """The ways of a class at an intersection, made once per process.

    Raises:
        InputError: there is no such intersection, or it has no priors.
    """
    from scenewright.graph.run import ground_of

    ground, priors = ground_of(intersection), load_priors(intersection)
    routes = [
        r for r in ground.intersection_map.routes if r.type == kind and r.id in priors.waypoints
    ]
    return _ways(kind, routes, priors, ground)


def _ways(kind: AgentClass, routes: list[Route], priors: Priors, ground: MapAreas) -> Ways:
    sets = [priors.waypoints[route.id] for route in routes]
    of = [r for r, way in enumerate(sets) for _ in way.weights]
    curve = np.concatenate([way.base for way in sets])[:, ::_THIN]
    cholesky = np.concatenate([way.cholesky for way in sets])
    knots = spline_matrix()[::_THIN]
    s, heading, curvature = _shape_of(curve)
    normal = np.stack([-np.sin(heading), np.cos(heading)], axis=-1)
    rows = np.einsum("pk,cpd->cpkd", knots, normal).reshape(*curve.shape[:2], 2 * K)
    across = np.einsum("cpi,cij->cpj", rows, cholesky)
    turn = np.gradient(across, axis=1) / np.gradient(s, axis=1)[..., None]
    laws = [priors.time_laws[routes[r].id] for r in of]
    marks = [_mark(routes[r], curve[c], ground) for c, r in enumerate(of)]
    weights = np.concatenate([way.weights for way in sets])
    rates = np.stack([_rate(priors, routes[r].id) for r in of], axis=1)
    return Ways(
        kind, tuple(routes[r] for r in of), np.log((rates + 1e-3) * weights), curve, s, heading,
        curvature, normal, knots, across, turn, cholesky,
        np.array([line for line, _ in marks]), tuple(group for _, group in marks),
        _bends(s, curvature, laws),
        *(np.stack([getattr(law, name) for law in laws])
          for name in ("median", "spread", "low", "high")),
    )  # fmt: skip


def _rate(priors: Priors, route: str) -> FloatArray:
    found = priors.frequency.get(route)
    return np.zeros(HOURS) if found is None else np.asarray(found)


def _shape_of(curve: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Arc length, heading and smoothed curvature of curves [C, P, 2]."""
    step = np.diff(curve, axis=1)
    s = np.concatenate(
        [np.zeros((len(curve), 1)), np.cumsum(np.hypot(step[..., 0], step[..., 1]), axis=1)], axis=1
    )
    middle = np.gradient(curve, axis=1)
    heading = np.unwrap(np.arctan2(middle[..., 1], middle[..., 0]), axis=1)
    curvature = np.stack(
        [np.interp(s[c], path.s, path.curvature) for c, path in enumerate(map(even_path, curve))]
    )
    return s, heading, curvature


def _bends(s: FloatArray, curvature: FloatArray, laws: list[DrivingProfilePrior]) -> FloatArray:
    """[C, D, P] from curvature [C, P]: laws cautious and bold, in braking and in curves."""
    off = np.array([(0.0, 0.0, x, y) for x in _SPREAD for y in _SPREAD])[None]
    law = np.stack([each.median for each in laws])[:, None]
    law = law * np.exp(off * np.stack([each.spread for each in laws])[:, None])
    low, high = (np.stack([getattr(each, name) for each in laws])[:, None] for name in _BOUNDS)
    law = np.clip(law, low, high)
    lateral, braking = law[..., 3:4], law[..., 2:3]
    reach = lateral / np.maximum(np.abs(curvature), 1e-3)[:, None] + 2.0 * braking * s[:, None]
    back = np.minimum.accumulate(reach[..., ::-1], axis=-1)[..., ::-1]
    return np.asarray(np.sqrt(np.maximum(back - 2.0 * braking * s[:, None], 0.0)))


def _mark(route: Route, curve: FloatArray, ground: MapAreas) -> tuple[float, str | None]:
    """Where its stop line or kerb lies [m], for a vehicle of length 0; and who rules it."""
    path = even_path(curve)
    shape = PEDESTRIAN if route.type == "pedestrian" else vehicle_shape()
    law = DrivingProfile(1.0, 1.0, 1.0, 1.0)
    probe = Candidate(route, path.xy[:K], path, 0.0, law, 0.0, shape, None)
    marks = find_landmarks(probe, map_areas=ground)
    if marks.line is None:
        return np.inf, None
    front = shape.length / 2 if route.type == "vehicle" else 0.0
    return marks.line + front, marks.group


def sides_of(intersection_map: IntersectionMap) -> tuple[str, ...]:
    """The legs of the map, by their compass names."""
    return tuple(leg.name for leg in intersection_map.legs)
