"""Assumed priors, without tracks: riders, U-turns, walking outside a crosswalk (SEMANTICS 8).

No bundle has tracks of them. They ride where vehicles drive, but on the outer side of the
outermost lane that leads their way, and on a crosswalk where pedestrians walk, coming from and
leaving to the edge of the map along the sidewalks. Their speeds are
stated, not fitted: medians of 18 km/h for a bicycle in town, 16 km/h for an e-scooter and 13 km/h
on a crosswalk, chosen about SUMO's default bicycle (20 km/h, 1.2 m/s^2 up, 3 m/s^2 down), which
lies within the bounds, as these lie within the limits of SEMANTICS.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from scenewright.geometry.map_areas import MapAreas
from scenewright.geometry.polyline import (
    compute_normals,
    measure_arc_lengths,
    resample_to_count,
)
from scenewright.geometry.spline import DENSE, PER_INTERVAL
from scenewright.scene.base import AgentClass, FloatArray
from scenewright.scene.candidates import K
from scenewright.scene.map import IntersectionMap
from scenewright.scene.map_elements import Route
from scenewright.scene.track import RIDER_SIZES
from scenewright.tools.gmm_sampler.priors import DrivingProfilePrior, Priors, WaypointPrior

_FROM_EDGE = 0.35
"""Between the handlebar and the edge of the lane [m]."""

_WANDERS = 0.4
"""Share of the vehicles' deviations from their mean paths that riders have from theirs."""

_SAME_LANE = 1.5
"""Mean paths less than this apart [m] are of one lane."""

_COURSE = 3.0
"""Over which a path's direction at its beginning is measured [m]."""

_INSIDE = 0.1
"""How far within the edge of the map a path along a sidewalk begins [m]."""

_SPREAD = np.array([0.20, 0.15, 0.20, 0.12])
_LOW, _HIGH = np.array([2.4, 0.5, 0.9, 1.2]), np.array([7.5, 1.5, 2.5, 3.0])
_SCOOTER_SPEED = 6.0
_ON_CROSSWALK = 5.0
"""Highest free speeds [m/s] of a scooter, and of any rider on a crosswalk."""

_MEDIAN: dict[tuple[AgentClass, bool], tuple[float, float, float, float]] = {
    ("cyclist", False): (5.0, 0.9, 1.6, 2.0),
    ("scooter", False): (4.5, 0.9, 1.6, 1.8),
    ("cyclist", True): (3.6, 0.9, 1.6, 1.8),
    ("scooter", True): (3.4, 0.9, 1.6, 1.8),
}
"""Speed, acceleration, braking, lateral acceleration [SI] by class and whether on a crosswalk."""


def build_rider_priors(
    priors: Priors, kind: AgentClass, route: Route, *, intersection_map: IntersectionMap
) -> Priors:
    """The priors as a rider of a class has them on one route."""
    crosswalk, fastest = route.crosswalk is not None, _HIGH.copy()
    if crosswalk or kind == "scooter":
        fastest[0] = _ON_CROSSWALK if crosswalk else _SCOOTER_SPEED
    law = DrivingProfilePrior(np.array(_MEDIAN[kind, crosswalk]), _SPREAD, _LOW, fastest, 0)
    prior = priors.waypoints[route.id]
    weights, cholesky = prior.weights, prior.cholesky
    if crosswalk:  # from edge to edge of the map: riders are in view for long
        areas = MapAreas(intersection_map)
        lines = [
            _extend_to_edge(_extend_to_edge(line, areas)[::-1], areas)[::-1] for line in prior.base
        ]
    else:  # aside from the middle of the outermost lane
        aside = _find_lane_offset(kind, route, intersection_map)
        kept = _find_outermost(prior.base, outwards=float(np.sign(aside) or -1.0))
        lines = [line + aside * compute_normals(line) for line in prior.base[kept]]
        weights, cholesky = weights[kept] / weights[kept].sum(), cholesky[kept]
    base = np.stack([resample_to_count(line, DENSE) for line in lines])
    means = base[:, ::PER_INTERVAL].reshape(len(base), -1)
    waypoints = WaypointPrior(route.id, weights, means, cholesky * _WANDERS, base, tracks=0)
    return replace(
        priors, waypoints={route.id: waypoints}, driving_profiles={route.id: law}, subtypes={}
    )


def _find_lane_offset(kind: AgentClass, route: Route, intersection_map: IntersectionMap) -> float:
    """How far to the left of its lane's middle a rider keeps [m]; below 0 means to the right."""
    movement = intersection_map.find_movement(route)
    lanes = () if movement is None else movement.lanelets
    widths = [lane.width for lane in intersection_map.lanelets if lane.id in lanes]
    aside = max(min(widths, default=3.0) / 2 - RIDER_SIZES[kind][1] / 2 - _FROM_EDGE, 0.0)
    return aside if intersection_map.left_hand_traffic else -aside


def _extend_to_edge(line: FloatArray, map_areas: MapAreas) -> FloatArray:
    """The line with its beginning straight from the edge of the map, where that is walkable."""
    inner = line[int(np.searchsorted(measure_arc_lengths(line), _COURSE))]
    course = (line[0] - inner) / np.hypot(*(line[0] - inner))
    edge = map_areas.intersection_map.extent - _INSIDE
    with np.errstate(divide="ignore"):
        away = float(((edge - np.sign(course) * line[0]) / np.abs(course)).min())
    added = line[0] + course * np.linspace(max(away, 0.0), 0.0, DENSE)[:-1, None]
    free = away > 0.0 and map_areas.compute_walkable_share(added) == 1.0
    return np.concatenate([added, line]) if free else line


def _find_outermost(lines: FloatArray, *, outwards: float) -> list[int]:
    """Indices of the lines [C, P, 2] farthest to the left (1) or right (-1) at both ends."""
    ends = (0, -1)
    normals = np.array([compute_normals(lines[0])[end] for end in ends])
    away = np.array([[(line[e] - lines[0][e]) @ n for e, n in zip(ends, normals, strict=True)]
                     for line in lines]) * outwards  # fmt: skip
    beyond = away.min(axis=1)
    return np.flatnonzero(beyond >= beyond.max() - _SAME_LANE).tolist()


_WANDERS_LESS = 0.3
"""Share of a left turn's deviations from its mean path that U-turns have from theirs."""


def build_uturn_priors(
    priors: Priors, route: Route, *, intersection_map: IntersectionMap
) -> Priors:
    """The priors as one U-turn has them.

    Raises:
        KeyError: the map has no such U-turn, or no left turn from that leg or any other.
    """
    movement = intersection_map.find_movement(route)
    if movement is None:
        raise KeyError(route.id)
    lefts = [each for each in intersection_map.routes if each.movement == "left"]
    own = [each for each in lefts if each.entry == route.entry]
    left = (own or lefts)[0]
    like = priors.waypoints[left.id]
    heaviest = int(np.argmax(like.weights))
    base = resample_to_count(np.array(movement.centreline), DENSE)[None]
    waypoints = WaypointPrior(
        route=route.id, weights=np.ones(1), means=base[:, ::PER_INTERVAL].reshape(1, -1),
        cholesky=like.cholesky[[heaviest]] * _WANDERS_LESS, base=base, tracks=0,
    )  # fmt: skip
    return replace(
        priors,
        waypoints={route.id: waypoints},
        driving_profiles={route.id: priors.driving_profiles[left.id]},
        subtypes={route.id: {"car": 1.0}},
    )


_DISTANCE_SPREAD = 1.9
_SKEW_SPREAD = 1.2
_ONTO_SIDEWALK = 2.0
_SIDEWALK_SPREAD = 0.45
_WOBBLE = 0.08


def build_jaywalking_mixture(
    route: str, kerbs: Sequence[FloatArray], outwards: FloatArray
) -> WaypointPrior:
    """p_wp of jaywalking from kerb to kerb [2, 2] at given places of one leg, equally likely."""
    ways = [(last - first) / float(np.hypot(*(last - first))) for first, last in kerbs]
    ends = [
        np.concatenate([first - _ONTO_SIDEWALK * way, last + _ONTO_SIDEWALK * way])
        for (first, last), way in zip(kerbs, ways, strict=True)
    ]
    across = ways[-1]  # at one leg they are parallel, so that one covariance is that of all
    along, aside = np.outer(outwards, outwards), _SIDEWALK_SPREAD**2 * np.outer(across, across)
    shared, own = _DISTANCE_SPREAD**2 * along, (_SKEW_SPREAD**2 / 2) * along + aside
    of_ends = np.block([[shared + own, shared], [shared, shared + own]])
    line = _build_interpolation(K)
    factor = np.linalg.cholesky(line @ of_ends @ line.T + _WOBBLE**2 * np.eye(2 * K))
    return WaypointPrior(
        route=route,
        weights=np.full(len(ends), 1.0 / len(ends)),
        means=np.array([line @ end for end in ends]),
        cholesky=np.repeat(factor[None], len(ends), axis=0),
        base=np.array([(_build_interpolation(DENSE) @ end).reshape(DENSE, 2) for end in ends]),
        tracks=0,
    )


def _build_interpolation(count: int) -> FloatArray:
    """[2 count, 4] points evenly between a start and an end, as a linear map of both."""
    t = np.linspace(0.0, 1.0, count)
    return np.asarray(np.kron(np.stack([1 - t, t], axis=1), np.eye(2)), dtype=np.float64)
