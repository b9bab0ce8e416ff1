"""Driving profiles from freely flowing trips: red lights, queues and yielding are left out.

Free speed and lateral acceleration come from trips that never nearly stop; acceleration and
braking from how vehicles leave and reach standstill, which is the same for every route.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from scenewright.geometry.spline import build_even_path
from scenewright.scene.base import FloatArray
from scenewright.scene.map import IntersectionMap, Route
from scenewright.scene.track import STEP
from scenewright.tools.gmm_sampler.priors import DrivingProfilePrior
from scenewright.tools.simulation.corpus import Trip

_BOUNDS = {
    "vehicle": (np.array([4.0, 0.8, 1.0, 1.2]), np.array([14.0, 2.5, 3.0, 3.0])),
    "pedestrian": (np.array([0.7, 0.5, 0.5, 0.8]), np.array([2.2, 1.6, 1.6, 2.0])),
}
_ASSUMED_WALK = (1.0, 1.0, 1.3)
"""Acceleration, braking and lateral acceleration of pedestrians; the stripe model has none."""
_ASSUMED_SPREAD = 0.2
_LEAST_SPREAD = 0.05
_FLOWING = {"vehicle": 2.5, "pedestrian": 0.4}
"""A trip that is ever slower than this does not flow freely [m/s]."""
_LOW, _HIGH = 1.0, 6.0
"""Speeds between which starting and braking are measured [m/s]."""
_CURVE = 0.05
_LEAST_FLOWING = 12
"""Freely flowing tracks of one class and turn below which a profile is borrowed."""


def fit_driving_profiles(
    intersection_map: IntersectionMap,
    trips: Mapping[str, Sequence[Trip]],
    *,
    fallback: Mapping[str, DrivingProfilePrior] | None = None,
) -> dict[str, DrivingProfilePrior]:
    """The driving profile of every route; rare routes borrow from all of their class and turn.

    Args:
        fallback: by route, taken where a class and turn has too few freely flowing tracks; its
            accelerations also where no track shows them.
    """
    pooled: dict[tuple[str, str], list[Trip]] = {}
    for route in intersection_map.routes:
        pooled.setdefault(_classify(route), []).extend(trips[route.id])
    driving = [t for (kind, _), group in pooled.items() if kind == "vehicle" for t in group]
    accelerations = [_fit_lognormal(list(_measure_changes(driving, sign))) for sign in (1, -1)]
    accelerations.append(_fit_lognormal(list(_measure_laterals(driving))))
    if fallback is None:
        by_kind = {key: _fit_profile(key, group, accelerations) for key, group in pooled.items()}
        return {route.id: by_kind[_classify(route)] for route in intersection_map.routes}
    known = [pair if np.isfinite(pair).all() else None for pair in accelerations]
    found = dict(fallback)
    for route in intersection_map.routes:
        borrowed, key = fallback[route.id], _classify(route)
        usual = zip(borrowed.median[1:].tolist(), borrowed.spread[1:].tolist(), strict=True)
        rest = [pair or other for pair, other in zip(known, usual, strict=True)]
        if len(_select_flowing(pooled[key], key[0])) >= _LEAST_FLOWING:
            found[route.id] = _fit_profile(key, pooled[key], rest)
    return found


def _classify(route: Route) -> tuple[str, str]:
    """Class and turn: turns have profiles of their own; walking is walking."""
    return route.type, route.movement if route.type == "vehicle" else "walking"


def _select_flowing(trips: Sequence[Trip], kind: str) -> list[Trip]:
    return [trip for trip in trips if _measure_speeds(trip).min() > _FLOWING[kind]]


def _fit_profile(
    key: tuple[str, str], trips: Sequence[Trip], driving: list[tuple[float, float]]
) -> DrivingProfilePrior:
    """One profile; `driving` is what all vehicles share: acceleration, braking, lateral."""
    kind, turn = key
    flowing = _select_flowing(trips, kind)
    speed = _fit_lognormal([float(np.percentile(_measure_speeds(trip), 90)) for trip in flowing])
    if kind == "vehicle":
        laterals = [] if turn == "straight" else list(_measure_laterals(flowing))
        rest = [*driving[:2], _fit_lognormal(laterals)] if laterals else driving
    else:
        rest = [(median, _ASSUMED_SPREAD) for median in _ASSUMED_WALK]
    low, high = _BOUNDS[kind]
    median, spread = np.array([speed, *rest]).T
    return DrivingProfilePrior(np.clip(median, low, high), spread, low, high, len(flowing))


def _measure_speeds(trip: Trip) -> FloatArray:
    """[T] speed along the path, over half a second [m/s]."""
    window = min(5, max(len(trip.progress) - 1, 1))
    return (trip.progress[window:] - trip.progress[:-window]) / (window * STEP)


def _fit_lognormal(values: list[float]) -> tuple[float, float]:
    """Median, and standard deviation of the logarithm; NaN of nothing."""
    if not values:
        return float("nan"), float("nan")
    logs = np.log(np.maximum(values, 1e-3))
    centre = float(np.median(logs))
    spread = float(1.4826 * np.median(np.abs(logs - centre)))
    return float(np.exp(centre)), max(spread, _LEAST_SPREAD)


def _measure_changes(trips: Sequence[Trip], sign: int) -> Iterator[float]:
    """Mean acceleration (or braking) between a crawl and driving, for trips that stood."""
    for trip in trips:
        speed = _measure_speeds(trip)[::sign]
        standing = np.flatnonzero(speed < _LOW)
        if not len(standing):
            continue
        fast = np.flatnonzero(speed[standing[-1] :] > _HIGH)
        if len(fast):
            yield (_HIGH - _LOW) / (max(int(fast[0]), 1) * STEP)


def _measure_laterals(trips: Sequence[Trip]) -> Iterator[float]:
    """The most lateral acceleration of each flowing trip that turns."""
    for trip in _select_flowing(trips, "vehicle"):
        path, speed = build_even_path(trip.path), _measure_speeds(trip)
        at = trip.progress[: len(speed)] + speed * 0.25
        curvature = np.abs(np.interp(at, path.s, path.curvature))
        if curvature.max() > _CURVE:
            yield float(np.percentile(speed**2 * curvature, 97))
