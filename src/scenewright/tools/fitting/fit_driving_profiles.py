"""Time laws from freely flowing trips: red lights, queues and giving way are kept out.

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
"""Acceleration, braking and lateral acceleration of people; the stripe model has none."""
_ASSUMED_SPREAD = 0.2
_LEAST_SPREAD = 0.05
_FLOWING = {"vehicle": 2.5, "pedestrian": 0.4}
"""A trip that is ever slower than this does not flow freely [m/s]."""
_LOW, _HIGH = 1.0, 6.0
"""Speeds between which starting and braking are measured [m/s]."""
_CURVE = 0.05
_LEAST_FLOWING = 12
"""Freely flowing tracks of one class and turn below which a law is borrowed."""

_Samples = list[float]


def fit_time_laws(
    place: IntersectionMap,
    trips: Mapping[str, Sequence[Trip]],
    *,
    fallback: Mapping[str, DrivingProfilePrior] | None = None,
) -> dict[str, DrivingProfilePrior]:
    """The time law of every route; rare routes borrow from all of their class and turn.

    Args:
        fallback: laws by route, taken where a class and turn has too few freely flowing tracks.
    """
    pooled: dict[tuple[str, str], list[Trip]] = {}
    for route in place.routes:
        pooled.setdefault((route.type, _kind(route)), []).extend(trips[route.id])
    driving = [t for (kind, _), group in pooled.items() if kind == "vehicle" for t in group]
    brisk = [_lognormal(list(_changes(driving, sign))) for sign in (1, -1)]
    brisk.append(_lognormal(list(_laterals(driving))))
    if fallback is not None:
        return _where_known(place, pooled, brisk, fallback)
    by_kind = {key: _law(key, group, brisk) for key, group in pooled.items()}
    return {route.id: by_kind[(route.type, _kind(route))] for route in place.routes}


def _where_known(
    place: IntersectionMap,
    pooled: Mapping[tuple[str, str], list[Trip]],
    brisk: list[tuple[float, float]],
    fallback: Mapping[str, DrivingProfilePrior],
) -> dict[str, DrivingProfilePrior]:
    """Laws fitted where enough tracks flow freely; how briskly people drive is borrowed if not."""
    known = [pair if np.isfinite(pair).all() else None for pair in brisk]
    laws = {}
    for route in place.routes:
        borrowed = fallback[route.id]
        own = zip(borrowed.median[1:].tolist(), borrowed.spread[1:].tolist(), strict=True)
        rest = [pair or usual for pair, usual in zip(known, own, strict=True)]
        key = (route.type, _kind(route))
        flowing = [t for t in pooled[key] if _speeds(t).min() > _FLOWING[key[0]]]
        enough = len(flowing) >= _LEAST_FLOWING
        laws[route.id] = _law(key, flowing, rest) if enough else borrowed
    return laws


def _kind(route: Route) -> str:
    """Turns have laws of their own; walking is walking."""
    return route.movement if route.type == "vehicle" else "walking"


def _law(
    key: tuple[str, str], trips: list[Trip], driving: list[tuple[float, float]]
) -> DrivingProfilePrior:
    """One law; `driving` is what all vehicles share: acceleration, braking, lateral."""
    kind, turn = key
    flowing = [trip for trip in trips if _speeds(trip).min() > _FLOWING[kind]]
    speed = _lognormal([float(np.percentile(_speeds(trip), 90)) for trip in flowing])
    if kind == "vehicle":
        laterals = [] if turn == "straight" else list(_laterals(flowing))
        rest = [*driving[:2], _lognormal(laterals)] if laterals else driving
    else:
        rest = [(median, _ASSUMED_SPREAD) for median in _ASSUMED_WALK]
    low, high = _BOUNDS[kind]
    median, spread = np.array([speed, *rest]).T
    return DrivingProfilePrior(np.clip(median, low, high), spread, low, high, len(flowing))


def _speeds(trip: Trip) -> FloatArray:
    """[T] speed along the path, over half a second [m/s]."""
    window = min(5, max(len(trip.progress) - 1, 1))
    return (trip.progress[window:] - trip.progress[:-window]) / (window * STEP)


def _lognormal(values: _Samples) -> tuple[float, float]:
    if not values:
        return float("nan"), float("nan")
    logs = np.log(np.maximum(values, 1e-3))
    centre = float(np.median(logs))
    return float(np.exp(centre)), max(
        float(1.4826 * np.median(np.abs(logs - centre))), _LEAST_SPREAD
    )


def _changes(trips: Sequence[Trip], sign: int) -> Iterator[float]:
    """Mean acceleration (or braking) between a crawl and driving, for trips that stood."""
    for trip in trips:
        speed = _speeds(trip)[::sign]
        standing = np.flatnonzero(speed < _LOW)
        if not len(standing):
            continue
        rest = speed[standing[-1] :]
        fast = np.flatnonzero(rest > _HIGH)
        if len(fast):
            yield (_HIGH - _LOW) / (max(int(fast[0]), 1) * STEP)


def _laterals(trips: Sequence[Trip]) -> Iterator[float]:
    """The most lateral acceleration of each flowing trip that turns."""
    for trip in trips:
        path = build_even_path(trip.path)
        speed = _speeds(trip)
        if speed.min() <= _FLOWING["vehicle"]:
            continue
        at = trip.progress[: len(speed)] + speed * 0.25
        curvature = np.abs(np.interp(at, path.s, path.curvature))
        if curvature.max() > _CURVE:
            yield float(np.percentile(speed**2 * curvature, 97))
