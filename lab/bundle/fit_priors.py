"""Priors fitted on a corpus: p_wp by route, p_tod by hour (paper 3.2). Needs scikit-learn.

Settings that touch a likelihood are fixed here and named in the docs: the covariance floor, the
shrinkage, the smallest component, the largest number of components.
"""

from __future__ import annotations

import math
import warnings
from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from lab.bundle.corpus_hours import CorpusHour
from scenewright.errors import InputError
from scenewright.geometry.polyline import rotate_left
from scenewright.geometry.spline import DENSE, PER_INTERVAL
from scenewright.scene.base import FloatArray
from scenewright.scene.candidates import K
from scenewright.scene.map import IntersectionMap
from scenewright.scene.map_elements import Route
from scenewright.tools.fitting.path_frame import FLOOR
from scenewright.tools.fitting.simulated_priors import fit_driving_profiles
from scenewright.tools.gmm_sampler.assumed_priors import build_jaywalking_mixture
from scenewright.tools.gmm_sampler.priors import (
    DIMENSIONS,
    HOURS,
    CountPrior,
    Priors,
    WaypointPrior,
)
from scenewright.tools.simulation.corpus import Trip, resample_path

SHRINKAGE = 10.0
"""How many tracks the smooth target covariance weighs as much as."""
SMOOTHNESS = 2.0
"""Correlation length of the target covariance [waypoints]."""
MOST_COMPONENTS = 8
MOST_DIRECTIONS = 6
"""In which components are distinguished at most."""
LEAST_TRACKS = 25
"""A component with fewer tracks is not trusted."""
WINDOW = 30.0
"""Length of a scene for p_tod [s]."""
JAYWALK_SHARE = 0.01
"""Jaywalkers per pedestrian on the crosswalk; assumed."""
NEIGHBOURS = 6
"""p_tod of an hour also sees every so many-th window of its neighbours (chosen on validation)."""
JAYWALKED = (19.0, 23.5, 28.0, 32.5, 37.0)
"""Of the middles of the crossed stretches of a leg from the middle of the map [m]."""
_COUNT_FLOOR = 0.15
_MOST_COUNT_COMPONENTS = 4


def fit_priors(intersection_map: IntersectionMap, corpus: Sequence[CorpusHour]) -> Priors:
    """All priors of an intersection, from the fit hours (p_tod: fit and validation hours)."""
    fit_hours = [hour for hour in corpus if hour.split == "fit"]
    trips = group_trips_by_route(fit_hours)
    known = [hour for hour in corpus if hour.split != "test"]
    return Priors(
        name=intersection_map.name,
        waypoints={
            route.id: _fit_route(intersection_map, route, trips)
            for route in intersection_map.routes
        },
        counts=tuple(_fit_hour(known, h, WINDOW) for h in range(HOURS)),
        driving_profiles=fit_driving_profiles(intersection_map, trips),
        frequency=_compute_frequency(intersection_map, corpus),
        subtypes={
            route.id: _compute_subtype_shares(trips[route.id])
            for route in intersection_map.routes
            if route.type == "vehicle"
        },
    )


def group_trips_by_route(hours: Iterable[CorpusHour]) -> Mapping[str, list[Trip]]:
    """Every trip of some hours by route id; an unseen route has none."""
    trips: dict[str, list[Trip]] = defaultdict(list)
    for hour in hours:
        for trip in hour.trips:
            trips[trip.route].append(trip)
    return trips


def _fit_route(
    intersection_map: IntersectionMap, route: Route, trips: Mapping[str, list[Trip]]
) -> WaypointPrior:
    if route.movement == "jaywalking":
        return _build_jaywalking_prior(intersection_map, route)
    if len(trips[route.id]) < LEAST_TRACKS:
        raise InputError(f"only {len(trips[route.id])} tracks on {route.id}: simulate more days")
    return fit_waypoints(route.id, [trip.path for trip in trips[route.id]])


def _build_jaywalking_prior(intersection_map: IntersectionMap, route: Route) -> WaypointPrior:
    """p_wp of a jaywalking route: one component per stretch of the leg, equally likely."""
    leg = next(leg for leg in intersection_map.legs if leg.name == route.crosswalk)
    outwards = np.array([math.cos(leg.bearing), math.sin(leg.bearing)])
    crosswalk = next(c for c in intersection_map.crosswalks if c.leg == route.crosswalk)
    first, last = np.array(crosswalk.centreline)
    across = (last - first) / np.linalg.norm(last - first)
    across = across if crosswalk.sides[0] == route.entry else -across
    own = [lane for lane in intersection_map.lanelets if lane.leg == route.crosswalk]
    bounds = [np.array(lane.right) @ rotate_left(outwards) for lane in own]
    kerb = float(np.abs(np.concatenate(bounds)).max()) * across
    kerbs = [np.stack([far * outwards - kerb, far * outwards + kerb]) for far in JAYWALKED]
    return build_jaywalking_mixture(route.id, kerbs, outwards)


def fit_waypoints(
    route: str, paths: Sequence[FloatArray], *, most: int = MOST_COMPONENTS
) -> WaypointPrior:
    """A mixture over the waypoints of paths [P, 2]; components by BIC, covariances shrunk."""
    data = np.array([resample_path(path).ravel() for path in paths])
    share = _fit_responsibilities(data, most)
    weights = share.mean(axis=0)
    means = (share.T @ data) / share.sum(axis=0)[:, None]
    factors = [
        np.linalg.cholesky(_compute_covariance(data, share[:, c], means[c]))
        for c in range(len(weights))
    ]
    dense = np.array([resample_path(path, DENSE) for path in paths])
    return WaypointPrior(
        route=route,
        weights=weights,
        means=means,
        cholesky=np.array(factors),
        base=_compute_bases(dense, share, means),
        tracks=len(paths),
    )


def _fit_responsibilities(data: FloatArray, most: int) -> FloatArray:
    """[N, C] share of each component in each track, for the best number of components.

    Components are distinguished in the directions in which tracks really differ. In all twenty
    coordinates BIC would charge each component for 230 numbers, most of them the floor's, and
    blend two lanes into one path between them.
    """
    reduced = _reduce(data)
    models = [_fit_mixture(reduced, count, FLOOR**2) for count in range(1, most + 1)]
    usable = [m for m in models if m is models[0] or (m.weights_.min() * len(data) >= LEAST_TRACKS)]
    best = min(usable, key=lambda model: float(model.bic(reduced)))
    return np.asarray(best.predict_proba(reduced))


def _reduce(data: FloatArray) -> FloatArray:
    """[N, D] the tracks in the principal directions that vary by more than the floor."""
    away = data - data.mean(axis=0)
    variance, directions = np.linalg.eigh(away.T @ away / len(data))
    varying = max(int((variance > FLOOR**2).sum()), 1)
    return np.asarray(away @ directions[:, -min(varying, MOST_DIRECTIONS) :])


def _fit_mixture(data: FloatArray, count: int, floor: float) -> Any:
    from sklearn import mixture
    from sklearn.exceptions import ConvergenceWarning

    mixtures: Any = mixture
    model: Any = mixtures.GaussianMixture(
        count, covariance_type="full", reg_covar=floor, n_init=2, max_iter=200, random_state=0
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ConvergenceWarning)
        return model.fit(data)


def _compute_covariance(data: FloatArray, share: FloatArray, mean: FloatArray) -> FloatArray:
    """Sample covariance, pulled towards a smooth one where tracks are few, plus the floor."""
    away = data - mean
    count = share.sum()
    sample = (share[:, None] * away).T @ away / count
    pull = SHRINKAGE / (SHRINKAGE + count)
    floor = FLOOR**2 * np.eye(DIMENSIONS)
    return np.asarray((1 - pull) * sample + pull * _build_smooth_target(sample) + floor)


def _build_smooth_target(sample: FloatArray) -> FloatArray:
    """The same variances, x and y independent, neighbouring waypoints alike."""
    index, axis = np.divmod(np.arange(DIMENSIONS), 2)
    alike = np.exp(-0.5 * (np.subtract.outer(index, index) / SMOOTHNESS) ** 2)
    alike *= np.equal.outer(axis, axis)
    spread = np.sqrt(np.diag(sample))
    return np.asarray(alike * np.outer(spread, spread))


def _compute_bases(dense: FloatArray, share: FloatArray, means: FloatArray) -> FloatArray:
    """[C, DENSE, 2] mean dense path of each component, through its mean waypoints."""
    bases = np.einsum("nc,npd->cpd", share, dense) / share.sum(axis=0)[:, None, None]
    bases[:, ::PER_INTERVAL] = means.reshape(-1, K, 2)
    return np.asarray(bases)


def count_present(hour: CorpusHour, window: float) -> FloatArray:
    """[n, 2] vehicles and pedestrians present in successive windows of an hour."""
    begins = np.arange(0.0, 3600.0 - window, WINDOW)
    kind, first, last = hour.presence.T
    present = (first <= begins[:, None] + window) & (last >= begins[:, None])
    return np.stack([(present & (kind == c)).sum(axis=1) for c in (0, 1)], axis=1).astype(float)


def _fit_hour(hours: Sequence[CorpusHour], hour: int, window: float) -> CountPrior:
    """p_tod of an hour, from its windows and a few of the hours before and after.

    An hour of a few days shows too little of how days differ; its neighbours help.
    """
    every = {hour: 1, (hour - 1) % HOURS: NEIGHBOURS, (hour + 1) % HOURS: NEIGHBOURS}
    return fit_counts(
        np.concatenate(
            [count_present(h, window)[:: every[h.hour]] for h in hours if h.hour in every]
        )
    )


def fit_counts(counts: FloatArray) -> CountPrior:
    """A mixture over (vehicles, pedestrians) [n, 2]; components by BIC."""
    models = [_fit_mixture(counts, n, _COUNT_FLOOR) for n in range(1, _MOST_COUNT_COMPONENTS + 1)]
    best = min(models, key=lambda model: float(model.bic(counts)))
    return CountPrior(best.weights_, best.means_, best.covariances_)


def _compute_frequency(
    intersection_map: IntersectionMap, corpus: Sequence[CorpusHour]
) -> dict[str, FloatArray]:
    """Mean trips per hour of each route; of jaywalking an assumed share of its crosswalk's."""
    total = {route.id: np.zeros(HOURS) for route in intersection_map.routes}
    days = np.zeros(HOURS)
    for hour in corpus:
        days[hour.hour] += 1
        for name, count in Counter(trip.route for trip in hour.trips).items():
            total[name][hour.hour] += count
    rates = {route: counts / np.maximum(days, 1) for route, counts in total.items()}
    found = dict(rates)
    for route in intersection_map.routes:
        if route.movement == "jaywalking":
            crossing = route.id.rsplit(":", 1)[0] + ":"
            same = (rate for name, rate in rates.items() if name.startswith(crossing))
            found[route.id] = np.asarray(JAYWALK_SHARE * sum(same))
    return found


def _compute_subtype_shares(trips: Sequence[Trip]) -> dict[str, float]:
    seen = Counter(trip.subtype or "car" for trip in trips)
    return {name: round(seen[name] / sum(seen.values()), 4) for name in sorted(seen)}
