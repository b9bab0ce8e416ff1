"""p_wp in the frame that moves along a movement's centreline: what carries over between places.

How far agents keep from the middle of their path, and how that changes along it, differs little
from one movement to another. In the moving frame (ahead, to the left) it can therefore be pooled:
over the movements of one intersection, and from an intersection with many tracks to one with few
or none. A route's prior is then its own centreline, its own tracks as far as there are any, and
the pool for the rest.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np

from scenewright.geometry.polyline import compute_tangents, interpolate_points, resample_to_count
from scenewright.geometry.spline import DENSE, PER_INTERVAL
from scenewright.intersections import SHIPPED, load_map
from scenewright.scene.base import FloatArray
from scenewright.scene.candidates import K
from scenewright.scene.map import IntersectionMap
from scenewright.scene.map_elements import Route
from scenewright.tools.gmm_sampler.prior_files import load_priors
from scenewright.tools.gmm_sampler.priors import DIMENSIONS, WaypointPrior
from scenewright.tools.gmm_sampler.sample import sample_waypoints

MEAN_WEIGHT = 3.0
"""How many tracks the centreline weighs as much as, for the mean."""
SPREAD_WEIGHT = 12.0
"""How many tracks the pool weighs as much as, for the covariance."""
FLOOR = 0.10
"""Standard deviation that every waypoint coordinate has at least [m]."""
_MAX_OFFSETS = {"vehicle": 1.4, "pedestrian": 3.0}
"""A track farther from every centreline changes lanes [m]."""
_DRAWS = 300
_SEED = 20_260
_NARROWER = {"vehicle": 1.0, "pedestrian": 0.7}
"""Of the pool's spread to the side: derived sidewalks are narrower than those it comes from."""

Pool = Mapping[str, FloatArray]
"""[20, 20] covariance of deviations (ahead, left) at ten waypoints [m^2], by kind of route."""


@dataclass(frozen=True, eq=False)
class Centreline:
    """A reference line with its waypoints and frames.

    Attributes:
        dense: [DENSE, 2] points evenly along it; knots: [K, 2] its waypoints.
        turn: [20, 20] takes deviations (ahead, left) at the waypoints to the map's x and y.
    """

    dense: FloatArray
    knots: FloatArray
    turn: FloatArray


def build_centreline(line: FloatArray) -> Centreline:
    """A polyline [P, 2] as a reference line."""
    dense = resample_to_count(line, DENSE)
    knots = dense[::PER_INTERVAL]
    turn = np.zeros((DIMENSIONS, DIMENSIONS))
    for k, (c, s) in enumerate(compute_tangents(dense)[::PER_INTERVAL]):
        turn[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] = ((c, -s), (s, c))
    return Centreline(dense, knots, turn)


def classify_route(route: Route) -> str:
    """The part of the pool that a route belongs to: its turn, or walking."""
    if route.type == "vehicle" or route.movement == "jaywalking":
        return route.movement
    return "walking"


def compute_deviations(
    waypoints: FloatArray, lines: Sequence[Centreline]
) -> tuple[FloatArray, FloatArray]:
    """[n, 20] deviations (ahead, left) of waypoints [n, K, 2], and [n] which line is nearest."""
    flat = waypoints.reshape(-1, DIMENSIONS)
    own = np.stack([(flat - line.knots.ravel()) @ line.turn for line in lines])
    nearest = np.abs(own[:, :, 1::2]).mean(axis=2).argmin(axis=0)
    return own[nearest, np.arange(len(flat))], nearest


def pool_deviations(
    groups: Mapping[str, Sequence[FloatArray]], fallback: Pool
) -> dict[str, FloatArray]:
    """The pool of a place's own deviations, pulled towards another one where they are few.

    Args:
        groups: by kind of route, [n, 20] deviations of whole tracks, centred by route.
    """
    made = dict(fallback)
    for kind, parts in groups.items():
        data = np.concatenate([np.zeros((0, DIMENSIONS)), *parts])
        made[kind] = blend_covariance(data, fallback[kind])
    return made


def blend_covariance(centred: FloatArray, pool: FloatArray) -> FloatArray:
    """[20, 20] covariance of deviations [n, 20] about their mean, pulled towards the pool's."""
    pull = SPREAD_WEIGHT / (SPREAD_WEIGHT + len(centred))
    sample = centred.T @ centred / max(len(centred), 1)
    return np.asarray((1 - pull) * sample + pull * pool)


@cache
def load_shipped_pool() -> Pool:
    """The pool of the shipped intersection, from its priors about its lanes' middles."""
    shipped, priors = load_map(SHIPPED), load_priors(SHIPPED)
    rng = np.random.default_rng(_SEED)
    shipped_pool: dict[str, list[FloatArray]] = {}
    for route in shipped.routes:
        if route.movement == "jaywalking":
            continue
        drawn = sample_waypoints(priors.waypoints[route.id], rng, size=_DRAWS)
        lines = _build_reference(shipped, route, drawn)
        away, _ = compute_deviations(drawn, lines)
        kept = away[np.abs(away[:, 1::2]).max(axis=1) < _MAX_OFFSETS[route.type]]
        shipped_pool.setdefault(classify_route(route), []).append(kept - kept.mean(axis=0))
    joined = {kind: np.concatenate(parts) for kind, parts in shipped_pool.items()}
    pools = {kind: np.asarray(data.T @ data / len(data)) for kind, data in joined.items()}
    return pools | {"uturn": pools["left"]}


def _build_reference(
    intersection_map: IntersectionMap, route: Route, drawn: FloatArray
) -> list[Centreline]:
    """Lane middles of a vehicle's route on a built map; the mean path of a pedestrian's."""
    if route.type == "pedestrian":
        return [build_centreline(drawn.mean(axis=0))]
    lanelets = {lanelet.id: lanelet for lanelet in intersection_map.lanelets}
    movement = next(m for m in intersection_map.movements if m.id == route.movement_id)
    lines = []
    for first in range(0, len(movement.lanelets), 3):
        way = [lanelets[name].centreline for name in movement.lanelets[first : first + 3]]
        lines.append(build_centreline(np.array([point for part in way for point in part])))
    return lines


def build_pooled_prior(
    route: Route,
    lines: Sequence[FloatArray],
    tracks: FloatArray,
    *,
    pool: Pool,
) -> WaypointPrior:
    """p_wp of a route: a component for each of its lines, its own tracks shrunk to the pool.

    Args:
        lines: [P, 2] middles of the ways it may take [m].
        tracks: [n, K, 2] waypoints of whole tracks; n may be 0.
    """
    ready = [build_centreline(line) for line in lines]
    base = scale_pool(route, pool)
    away, nearest = (
        compute_deviations(tracks, ready) if len(tracks) else (np.zeros((0, DIMENSIONS)), None)
    )
    weights, means, spreads = [], [], []
    for c in range(len(ready)):
        own = away if nearest is None else away[nearest == c]
        weights.append((len(own) + 1.0) / (len(away) + len(ready)))
        if len(own) >= 4:  # without tracks that leave their line for another lane
            aside = np.abs((own - np.median(own, axis=0))[:, 1::2]).max(axis=1)
            own = own[aside < 1.5 * _MAX_OFFSETS[route.type]]
        means.append(own.sum(axis=0) / (len(own) + MEAN_WEIGHT))
        spreads.append(blend_covariance(own - own.mean(axis=0) if len(own) else own, base))
    return build_prior(route, ready, np.array(weights), means, spreads, tracks=len(tracks))


def scale_pool(route: Route, pool: Pool) -> FloatArray:
    """The pool's covariance for a route, on sidewalks as wide as derived ones."""
    narrow = np.where(np.arange(DIMENSIONS) % 2 == 1, _NARROWER[route.type], 1.0)
    return np.asarray(pool[classify_route(route)] * np.outer(narrow, narrow))


def build_prior(
    route: Route,
    lines: Sequence[Centreline],
    weights: FloatArray,
    means: Sequence[FloatArray],
    spreads: Sequence[FloatArray],
    *,
    tracks: int,
) -> WaypointPrior:
    """p_wp of Gaussians in the moving frames of lines: [20] means, [20, 20] covariances."""
    centres = [
        line.knots.ravel() + line.turn @ mean for line, mean in zip(lines, means, strict=True)
    ]
    floor = FLOOR**2 * np.eye(DIMENSIONS)
    factors = [
        np.linalg.cholesky(line.turn @ spread @ line.turn.T + floor)
        for line, spread in zip(lines, spreads, strict=True)
    ]
    at, known, base = np.linspace(0.0, K - 1.0, DENSE), np.arange(K, dtype=np.float64), []
    for line, mean in zip(lines, centres, strict=True):
        # The dense line shifted so that it passes through the waypoints.
        knots = mean.reshape(K, 2)
        bent = np.asarray(line.dense + interpolate_points(at, known, knots - line.knots))
        bent[::PER_INTERVAL] = knots
        base.append(bent)
    return WaypointPrior(
        route.id, weights, np.array(centres), np.array(factors), np.array(base), tracks
    )
