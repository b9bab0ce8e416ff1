"""p_wp from tracks that show a part of their path: the rest is estimated with the pool.

One step of expectation maximisation with the pool as the model: each track's missing deviations
are what the pool expects given those that were observed, and their uncertainty counts as spread.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from scenewright.scene.base import FloatArray
from scenewright.scene.candidates import K
from scenewright.scene.map_elements import Route
from scenewright.tools.fitting.path_frame import (
    FLOOR,
    SPREAD_WEIGHT,
    Pool,
    build_centreline,
    build_prior,
    classify_route,
)
from scenewright.tools.gmm_sampler.priors import DIMENSIONS, WaypointPrior

_MAP_ERROR = 0.6
"""How far the middle of a mapped lane is from the middle of the traffic on it [m]; assumed."""
_SESSION_ERROR = 0.5
"""How far the tracks of one recording lie beside those of another of the same lane [m]; chosen on
one intersection (K733 of TAF-BW)."""
_MAX_OFFSET = 2.2
"""Farther from the usual offset of its line, a track changes lanes or is none of it [m]."""
_LEFT = np.arange(DIMENSIONS) % 2 == 1


def keep_on_line(offsets: FloatArray) -> FloatArray:
    """The tracks [n, K] that keep to their line."""
    if not len(offsets):
        return offsets
    seen = offsets[np.isfinite(offsets)]
    away = np.abs(offsets - (float(np.median(seen)) if len(seen) else 0.0))
    worst = np.where(np.isfinite(away), away, 0.0).max(axis=1)
    return np.asarray(offsets[(worst < _MAX_OFFSET) & np.isfinite(offsets).any(axis=1)])


def _summarize(offsets: FloatArray, pool: FloatArray) -> tuple[float, FloatArray, FloatArray]:
    """(n, mean [20], scatter [20, 20]) of deviations of tracks [n, K], parts of them unseen.

    Each track weighs as much as the share of its waypoints that were seen. The scatter is about
    the mean, the uncertainty of what was not seen included.
    """
    weight, total, second = 0.0, np.zeros(DIMENSIONS), np.zeros((DIMENSIONS, DIMENSIONS))
    for row in offsets:
        expected, uncertain = _complete(row, pool)
        share = float(np.isfinite(row).mean())
        weight += share
        total += share * expected
        second += share * (np.outer(expected, expected) + uncertain)
    if weight == 0.0:
        return 0.0, total, second
    mean = total / weight
    return weight, mean, np.asarray(second / weight - np.outer(mean, mean))


def _complete(row: FloatArray, pool: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Expected deviations [20] given the offsets that were observed, and their covariance."""
    seen = np.zeros(DIMENSIONS, dtype=bool)
    seen[_LEFT] = np.isfinite(row)
    values = row[np.isfinite(row)]
    shift = float(np.mean(values))  # a map that is off is off all along
    between = pool[np.ix_(seen, seen)] + FLOOR**2 * np.eye(int(seen.sum()))
    gain = np.linalg.solve(between, pool[seen]).T
    expected = gain @ (values - shift)
    expected[_LEFT] += shift
    return expected, np.asarray(pool - gain @ pool[seen])


def fit_partial_prior(
    route: Route,
    lines: Sequence[FloatArray],
    offsets: Sequence[FloatArray],
    *,
    pool: Pool,
    predictive: bool = False,
) -> WaypointPrior:
    """p_wp of a route from partial tracks, shrunk to the pool.

    Args:
        predictive: whether it is to predict tracks of another recording: then recordings differ,
            and a line without tracks is as uncertain as its map. For generation neither counts;
            agents are kept in the middle of their lane.
        lines: [P, 2] middles of the ways that it may take [m].
        offsets: for each line, [n, K] offsets of the tracks that keep to it [m], NaN where unseen.
    """
    own = np.asarray(pool[classify_route(route)])
    means, spreads = [], []
    for tracks in offsets:
        count, mean, spread = _summarize(tracks, own)
        pull = SPREAD_WEIGHT / (SPREAD_WEIGHT + count)
        within = (1 - pull) * spread + pull * own
        centre, doubt = _estimate_centre(mean, within, count)
        means.append(centre)
        spreads.append(within + doubt + _compute_session_error() if predictive else within)
    return _mix_lines(route, lines, offsets, means, spreads)


def _mix_lines(
    route: Route,
    lines: Sequence[FloatArray],
    offsets: Sequence[FloatArray],
    means: Sequence[FloatArray],
    spreads: Sequence[FloatArray],
) -> WaypointPrior:
    """A component for each line, as heavy as its tracks are many."""
    weights = [len(tracks) + 1.0 for tracks in offsets]
    ready = [build_centreline(line) for line in lines]
    count = sum(map(len, offsets))
    return build_prior(route, ready, np.array(weights) / sum(weights), means, spreads, tracks=count)


def _estimate_centre(
    mean: FloatArray, within: FloatArray, count: float
) -> tuple[FloatArray, FloatArray]:
    """The mean offset from the map's middle given that of so many tracks, and its covariance.

    The map's middle may be off (_MAP_ERROR); so is the mean of few tracks, and a recording's
    (_SESSION_ERROR). All are Gaussian.
    """
    prior = _compute_map_error()
    if count <= 0.0:
        return np.zeros(DIMENSIONS), prior
    noise = (within + FLOOR**2 * np.eye(DIMENSIONS)) / count + _compute_session_error()
    gain = np.linalg.solve(prior + noise, prior).T
    return np.asarray(gain @ mean), np.asarray(prior - gain @ prior)


def _compute_session_error() -> FloatArray:
    """[20, 20] covariance of how far all tracks of one recording lie beside the truth [m^2]."""
    return np.asarray((_SESSION_ERROR / _MAP_ERROR) ** 2 * _compute_map_error())


def _compute_map_error() -> FloatArray:
    """[20, 20] covariance of how far the map's middle is from where traffic drives [m^2].

    Half of it is the same all along a way (a shift of the map), half of it comes and goes along it
    (a curve drawn differently).
    """
    index = np.arange(K)
    near = np.exp(-0.5 * (np.subtract.outer(index, index) / 1.5) ** 2)
    result = np.zeros((DIMENSIONS, DIMENSIONS))
    result[np.ix_(_LEFT, _LEFT)] = _MAP_ERROR**2 * (0.5 + 0.5 * near)
    return result


def pool_partial_tracks(groups: Sequence[FloatArray], pool: FloatArray) -> FloatArray:
    """[20, 20] pool of one kind from the tracks of several lines, leaning on another pool."""
    count, scatter = 0.0, np.zeros_like(pool)
    for tracks in groups:
        n, _, spread = _summarize(tracks, pool)
        count, scatter = count + n, scatter + n * spread
    return np.asarray((scatter + SPREAD_WEIGHT * pool) / (count + SPREAD_WEIGHT))


def compute_offset_nll(prior: WaypointPrior, line: FloatArray, offsets: FloatArray) -> FloatArray:
    """[n] -log density of the offsets that were seen of tracks [n, K], per waypoint seen [nats]."""
    ready = build_centreline(line)
    result = []
    for row in offsets:
        seen = np.zeros(DIMENSIONS, dtype=bool)
        seen[_LEFT] = np.isfinite(row)
        logs = []
        for weight, mean, factor in zip(prior.weights, prior.means, prior.cholesky, strict=True):
            own = ready.turn.T @ (mean - ready.knots.ravel())
            spread = ready.turn.T @ (factor @ factor.T) @ ready.turn
            part = spread[np.ix_(seen, seen)]
            away = row[np.isfinite(row)] - own[seen]
            _, size = np.linalg.slogdet(part)
            square = float(away @ np.linalg.solve(part, away))
            logs.append(np.log(weight) - 0.5 * (square + size + len(away) * np.log(2 * np.pi)))
        result.append(-float(np.logaddexp.reduce(logs)) / max(int(seen.sum()), 1))
    return np.array(result)


def fit_unpooled_prior(
    route: Route, lines: Sequence[FloatArray], offsets: Sequence[FloatArray]
) -> WaypointPrior:
    """For comparison: a Gaussian of the route's own tracks alone, 0.5 m wide without any."""
    means, spreads = [], []
    for tracks in offsets:
        mean, variance = np.zeros(DIMENSIONS), np.full(DIMENSIONS, 0.25)
        for k, column in enumerate(tracks.T):
            values = column[np.isfinite(column)]
            if len(values):
                mean[2 * k + 1] = float(np.mean(values))
            if len(values) >= 2:
                variance[2 * k + 1] = float(np.var(values, ddof=1)) + FLOOR**2
        means.append(mean)
        spreads.append(np.diag(variance))
    return _mix_lines(route, lines, offsets, means, spreads)
