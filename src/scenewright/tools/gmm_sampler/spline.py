"""From waypoints to a smooth path (paper Eq. 3): a cubic spline that passes through them all.

Ten waypoints lie about 10 m apart, too far for a plain spline to hold a tight turn. Where a base
curve is given (the mean path of the mixture component that the waypoints come from), the spline
therefore runs through the *deviations* from it, which are small and slow. It still passes exactly
through the waypoints.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from scenewright.scene.base import FloatArray
from scenewright.scene.candidates import K, Path, evenly
from scenewright.tools.gmm_sampler.priors import WaypointPrior
from scenewright.tools.gmm_sampler.sample import component_log_densities

PER_INTERVAL = 24
"""Points of a base curve between two waypoints."""
DENSE = (K - 1) * PER_INTERVAL + 1
"""Points of a base curve."""
SPACING = 0.5
"""Between points of a path [m], to the nearest that divides its length."""
_CURVATURE_WINDOW = 2.0
"""Over which curvature is smoothed [m]."""


def spline_path(waypoints: FloatArray, *, base: FloatArray | None = None) -> Path:
    """The path through waypoints [K, 2], about a base curve [DENSE, 2] where one is given."""
    if base is None:
        return even_path(_spline_matrix() @ waypoints)
    return even_path(base + _spline_matrix() @ (waypoints - base[::PER_INTERVAL]))


def paths_of(prior: WaypointPrior, waypoints: FloatArray) -> list[Path]:
    """The paths through waypoints [m, K, 2], each about its likeliest component's base curve."""
    chosen = component_log_densities(prior, waypoints).argmax(axis=1)
    return [path_of(prior, each, int(c)) for each, c in zip(waypoints, chosen, strict=True)]


def path_of(prior: WaypointPrior, waypoints: FloatArray, component: int) -> Path:
    """The path through waypoints [K, 2] about the base curve of one component."""
    return spline_path(waypoints, base=prior.base[component])


def dense_curves(waypoints: FloatArray, bases: FloatArray | None) -> FloatArray:
    """[m, DENSE, 2] splines through waypoints [m, K, 2], about base curves or none."""
    if bases is None:
        return np.asarray(np.einsum("pk,mkd->mpd", _spline_matrix(), waypoints))
    deviation = waypoints - bases[:, ::PER_INTERVAL]
    return np.asarray(bases + np.einsum("pk,mkd->mpd", _spline_matrix(), deviation))


@lru_cache(maxsize=1)
def _spline_matrix() -> FloatArray:
    """[DENSE, K] natural cubic spline as a linear map: values at the knots to values between."""
    second = np.zeros((K, K))
    inner = np.arange(1, K - 1)
    system = np.eye(K) * 4.0 + np.eye(K, k=1) + np.eye(K, k=-1)
    system[0], system[-1] = np.eye(K)[0], np.eye(K)[-1]
    second[inner, inner - 1], second[inner, inner], second[inner, inner + 1] = 6.0, -12.0, 6.0
    bend = np.linalg.solve(system, second)
    at = np.linspace(0.0, K - 1.0, DENSE)
    knot = np.minimum(at.astype(int), K - 2)
    t = (at - knot)[:, None]
    straight = (1 - t) * np.eye(K)[knot] + t * np.eye(K)[knot + 1]
    bent = ((1 - t) ** 3 - (1 - t)) * bend[knot] + (t**3 - t) * bend[knot + 1]
    return np.asarray(straight + bent / 6.0)


def even_path(curve: FloatArray) -> Path:
    """A curve [P, 2] as a path with even spacing, heading and smoothed curvature."""
    step = curve[1:] - curve[:-1]
    length = np.zeros(len(curve))
    np.add.accumulate(np.hypot(step[:, 0], step[:, 1]), out=length[1:])
    count = max(round(float(length[-1]) / SPACING), 2) + 1
    s = evenly(float(length[-1]), count)
    xy = np.empty((count, 2))
    xy[:, 0], xy[:, 1] = (np.interp(s, length, curve[:, axis]) for axis in (0, 1))
    step = xy[1:] - xy[:-1]
    dx, dy = step[:, 0], step[:, 1]
    cross, dot = dx[:-1] * dy[1:] - dy[:-1] * dx[1:], dx[:-1] * dx[1:] + dy[:-1] * dy[1:]
    # Headings as the first one and the turns since: continuous by construction.
    turns = np.arctan2(cross, dot)
    between = np.zeros(count - 1)
    np.add.accumulate(turns, out=between[1:])
    between += np.arctan2(dy[0], dx[0])
    heading, turning = np.empty(count), np.zeros(count)
    heading[0], heading[-1] = between[0], between[-1]
    heading[1:-1] = (between[1:] + between[:-1]) / 2
    turning[1:-1] = turns / s[1]
    return Path(xy=xy, s=s, heading=heading, curvature=_smoothed(turning, s[1]))


def _smoothed(values: FloatArray, spacing: float) -> FloatArray:
    """A moving mean over the curvature window; the ends hold their value."""
    half = max(round(_CURVATURE_WINDOW / spacing / 2), 1)
    padded = np.empty(len(values) + 2 * half)
    padded[:half], padded[half:-half], padded[-half:] = values[0], values, values[-1]
    return np.convolve(padded, np.full(2 * half + 1, 1.0 / (2 * half + 1)), mode="valid")
