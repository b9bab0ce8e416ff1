"""The components of p_wp as arrays: mean curve, covariance and driving profile of each.

All of it comes from the bundle. Deviations from a component's mean curve are linear in the
waypoints (Eq. 3), so that a stretch of observed track conditions their Gaussian exactly.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from scenewright.compiled import compiled
from scenewright.geometry.landmarks import find_landmarks
from scenewright.geometry.map_areas import MapAreas
from scenewright.geometry.spline import build_even_path, compute_spline_matrix
from scenewright.scene.base import RIDERS, AgentClass, FloatArray
from scenewright.scene.candidates import Candidate, DrivingProfile, K
from scenewright.scene.map import IntersectionMap
from scenewright.scene.map_elements import Route
from scenewright.scene.track import PEDESTRIAN, get_vehicle_shape
from scenewright.tools.gmm_sampler import Priors, load_priors
from scenewright.tools.gmm_sampler.assumed_priors import build_rider_priors
from scenewright.tools.gmm_sampler.priors import HOURS

_SPREAD = (-1.2, 0.0, 1.2)
"""Driving profiles tried lie so many standard deviations off the median."""
_ON_CROSSWALK = 0.05
"""Uses of a crosswalk by riders, per use by a pedestrian."""
_THIN = 4
"""Every fourth point of a base curve is kept: they lie one or two metres apart."""


@dataclass(frozen=True, eq=False)
class RouteComponents:
    """Components of all routes of one class, C in number, P points each.

    Attributes:
        routes: [C] route of each component.
        share: [24, C] log of how often it is taken, by hour of the day.
        curve: [C, P, 2] mean path [m]; s: [C, P] arc length [m]; heading: [C, P] [rad];
            curvature: [C, P] [1/m]; normal: [C, P, 2] to the left.
        knots: [P, K] the spline as a linear map from waypoints to points.
        across: [C, P, 20] deviation to the left per unit of white noise [m].
        turn: [C, P, 20] deviation in heading per unit of white noise [rad].
        cholesky: [C, 20, 20] of the waypoints [m].
        line: [C] arc length of stop line or kerb [m], a vehicle's front on it; inf for none.
        group: [C] signal group that controls it, or None.
        bend: [C, D, P] speed that the curves ahead allow [m/s] under D driving profiles.
        law: [C, 4] median driving profile and spread: [C, 4] of its logarithm; low, high: [C, 4]
            bounds.
    """

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

    def match_exits(self, sides: tuple[str, ...]) -> NDArray[np.bool_]:
        """[C, E] whether a component leaves towards a side."""
        return np.array([[route.exit == side for side in sides] for route in self.routes])


@lru_cache(maxsize=8)
def load_components(intersection: str, kind: AgentClass) -> RouteComponents:
    """Load the components of a class at an intersection, once per process.

    Raises:
        InputError: there is no such intersection, or it has no priors.
    """
    from scenewright.graph.run import ground_of

    ground, priors = ground_of(intersection), load_priors(intersection)
    known = [route for route in ground.intersection_map.routes if route.id in priors.waypoints]
    if kind not in RIDERS:
        return _build_components([each for each in known if each.type == kind], priors, ground)
    # Riders have priors on all these routes; few ride on crosswalks.
    routes = [r for r in known if r.type == "vehicle" or r.movement == "crossing"]
    place = ground.intersection_map
    each = [build_rider_priors(priors, kind, route, intersection_map=place) for route in routes]
    of_riders = replace(
        priors,
        waypoints={name: prior for own in each for name, prior in own.waypoints.items()},
        driving_profiles={name: law for own in each for name, law in own.driving_profiles.items()},
        frequency={
            route.id: (1.0 if route.type == "vehicle" else _ON_CROSSWALK)
            * np.asarray(priors.frequency.get(route.id, np.zeros(HOURS)))
            for route in routes
        },
    )
    return _build_components(routes, of_riders, ground)


def _build_components(routes: list[Route], priors: Priors, ground: MapAreas) -> RouteComponents:
    sets = [priors.waypoints[route.id] for route in routes]
    owners = [route for route, each in zip(routes, sets, strict=True) for _ in each.weights]
    curve = np.concatenate([each.base for each in sets])[:, ::_THIN]
    cholesky = np.concatenate([each.cholesky for each in sets])
    knots = compute_spline_matrix()[::_THIN]
    s, heading = measure_arc_length(curve), measure_headings(curve)
    paths = enumerate(map(build_even_path, curve))
    curvature = np.stack([np.interp(s[c], path.s, path.curvature) for c, path in paths])
    normal = np.stack([-np.sin(heading), np.cos(heading)], axis=-1)
    rows = np.einsum("pk,cpd->cpkd", knots, normal).reshape(*curve.shape[:2], 2 * K)
    across = np.einsum("cpi,cij->cpj", rows, cholesky)
    profiles = [priors.driving_profiles[route.id] for route in owners]
    law = {
        name: np.stack([getattr(profile, name) for profile in profiles])
        for name in ("median", "spread", "low", "high")
    }
    # Speed that the curves ahead allow, from cautious to bold in braking and in curves.
    off = np.array([(0.0, 0.0, x, y) for x in _SPREAD for y in _SPREAD])[None]
    tried = law["median"][:, None] * np.exp(off * law["spread"][:, None])
    tried = np.clip(tried, law["low"][:, None], law["high"][:, None])
    limit = tried[..., 3:4] / np.maximum(np.abs(curvature), 1e-3)[:, None]
    bend = np.sqrt(np.maximum(brake_backwards(s[:, None], limit, tried[..., 2:3]), 0.0))
    marks = [_find_stop(route, curve[c], ground) for c, route in enumerate(owners)]
    weights = np.concatenate([each.weights for each in sets])
    rates = [np.asarray(priors.frequency.get(r.id, np.zeros(HOURS))) for r in owners]
    return RouteComponents(
        tuple(owners), np.log((np.stack(rates, axis=1) + 1e-3) * weights), curve, s, heading,
        curvature, normal, knots, across,
        np.gradient(across, axis=1) / np.gradient(s, axis=1)[..., None], cholesky,
        np.array([line for line, _ in marks]), tuple(group for _, group in marks), bend,
        law["median"], law["spread"], law["low"], law["high"],
    )  # fmt: skip


def measure_arc_length(curve: FloatArray) -> FloatArray:
    """[C, P] arc length of curves [C, P, 2], in their unit."""
    step, s = np.diff(curve, axis=1), np.zeros(curve.shape[:2])
    np.cumsum(np.hypot(step[..., 0], step[..., 1]), axis=1, out=s[:, 1:])
    return s


def measure_headings(curve: FloatArray) -> FloatArray:
    """[C, P] heading of curves [C, P, 2] at their points [rad], continuous."""
    ahead = np.gradient(curve, axis=1)
    return np.unwrap(np.arctan2(ahead[..., 1], ahead[..., 0]), axis=1)


def interpolate_rows(at: FloatArray, s: FloatArray, values: FloatArray) -> FloatArray:
    """Interpolate row by row in one call.

    Args:
        at: [N, M] wanted; s: [N, P] ascending; values: [N, P].

    Returns:
        [N, M]; constant beyond the ends.
    """
    return _interpolate(*(np.ascontiguousarray(each) for each in (at, s, values)))


@compiled
def _interpolate(at: FloatArray, s: FloatArray, values: FloatArray) -> FloatArray:
    """[N, M] as `interpolate_rows`."""
    interpolated = np.empty(at.shape)
    for n in range(len(at)):
        interpolated[n] = np.interp(at[n], s[n], values[n])
    return interpolated


def interpolate_points(at: FloatArray, s: FloatArray, xy: FloatArray) -> FloatArray:
    """[N, M, 2] the same for points [N, P, 2]."""
    return np.stack([interpolate_rows(at, s, xy[..., d]) for d in (0, 1)], axis=-1)


def brake_backwards(s: FloatArray, squared: FloatArray, braking: FloatArray) -> FloatArray:
    """[..., P] squared speed from which every squared speed limit further on can be met."""
    reach = squared + 2.0 * braking * s
    least = np.minimum.accumulate(reach[..., ::-1], axis=-1)[..., ::-1]
    return np.asarray(least - 2.0 * braking * s)


def _find_stop(route: Route, curve: FloatArray, ground: MapAreas) -> tuple[float, str | None]:
    """Arc length of stop line or kerb [m] for a vehicle of length 0, and its signal group."""
    path = build_even_path(curve)
    shape = PEDESTRIAN if route.type == "pedestrian" else get_vehicle_shape()
    law = DrivingProfile(1.0, 1.0, 1.0, 1.0)
    probe = Candidate(route, path.xy[:K], path, 0.0, law, 0.0, shape, None)
    marks = find_landmarks(probe, map_areas=ground)
    if marks.line is None:
        return np.inf, None
    return marks.line + (shape.length / 2 if route.type == "vehicle" else 0.0), marks.group


def list_sides(intersection_map: IntersectionMap) -> tuple[str, ...]:
    """List the legs of the map by their compass names."""
    return tuple(leg.name for leg in intersection_map.legs)
