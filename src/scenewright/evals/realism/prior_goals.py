"""Goals for tracks that nobody was fitted on: from p_wp and the time laws, not from the track.

Which route an agent takes is told, as a request tells it; of its track only the beginning. What the
priors then know of the rest is `given` the beginning: where its way runs, and how it may drive or
walk along it if nothing holds it up.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import Any, NamedTuple

import numpy as np

from scenewright.errors import InputError
from scenewright.geometry.along import sample_poses
from scenewright.geometry.driving_profile import compute_motion
from scenewright.geometry.spline import SPACING, build_even_path
from scenewright.intersections import load_map
from scenewright.scene.base import FloatArray
from scenewright.scene.candidates import Candidate, DrivingProfile, K, Path
from scenewright.scene.map import Route
from scenewright.scene.selection import Slowing
from scenewright.scene.track import PEDESTRIAN, STEP
from scenewright.tools.gmm_sampler import (
    Priors,
    WaypointPrior,
    load_priors,
    sample_driving_profiles,
    sample_waypoints,
)
from scenewright.tools.gmm_sampler.condition_prior import condition_prior
from scenewright.tools.gmm_sampler.sample import build_path, compute_nll_and_component
from scenewright.tools.track_io import RecordedAgent, Recording
from scenewright.tools.track_io.windows import TRAJNET_EVERY

geos: Any = import_module("shapely")

_ANYBODY = PEDESTRIAN
"""How large an agent is says nothing about how it moves along its way."""


class Way(NamedTuple):
    """What is known of an agent's way without its track.

    Attributes:
        route: which it takes; prior: p_wp of it, in the frame of the recording [m].
        priors: that it is one of, for the time laws.
    """

    route: Route
    prior: WaypointPrior
    priors: Priors


WayOf = Callable[[Recording, RecordedAgent], Way | None]
"""The way of an agent of a recording; None where nobody knows its route."""


def bundle_ways(intersection: str) -> WayOf:
    """Ways of a bundle's own corpus; its priors know nothing of the test hours.

    Raises:
        InputError: unknown bundle, or, when asked, a track on a route that it does not have.
    """
    priors = load_priors(intersection)
    routes = {route.id: route for route in load_map(intersection).routes}

    def way(_: Recording, agent: RecordedAgent) -> Way | None:
        if agent.route is None:
            return None
        if agent.route not in routes:
            raise InputError(f"the corpus is not of {intersection}: that has no {agent.route!r}")
        return Way(routes[agent.route], priors.waypoints[agent.route], priors)

    return way


def abreast(way: Way, seen: FloatArray, xy: FloatArray) -> FloatArray:
    """[n, 2] where the way that the prior expects comes nearest to places [n, 2].

    Args:
        seen: [m, 2] the beginning of the track [m].
    """
    rest = condition_prior(way.prior, seen)
    likeliest = int(rest.weights.argmax())
    path = build_path(rest, rest.means[likeliest].reshape(K, 2), likeliest)
    return sample_poses(path, _along(path, xy))[:, :2]


def driven(
    way: Way, seen: FloatArray, *, steps: int, size: int, rng: np.random.Generator
) -> FloatArray:
    """[size, steps, 2] draws of how it goes on, every 0.4 s; NaN once it has left the map.

    A way is drawn given the beginning, then a time law; from the last place seen it goes on unheld,
    as fast as there if the law and the way's curves allow.

    Args:
        seen: [m, 2] the beginning of the track, every 0.4 s [m].
    """
    rest = condition_prior(way.prior, seen)
    waypoints = sample_waypoints(rest, rng, size=size)
    _, component = compute_nll_and_component(rest, waypoints)
    laws = sample_driving_profiles(way.priors, way.route.id, rng, size=size)
    speed = float(np.hypot(*(seen[-1] - seen[-2]))) / (TRAJNET_EVERY * STEP)
    drawn = np.full((size, steps, 2), np.nan)
    for k in range(size):
        path = build_path(rest, waypoints[k], int(component[k]))
        s = _onward(way.route, path, laws[k], float(_along(path, seen[-1:])[0]), speed)
        places = sample_poses(path, s[:steps])[:, :2]
        drawn[k, : len(places)] = places
    return drawn


def _onward(
    route: Route, path: Path, law: DrivingProfile, begin: float, speed: float
) -> FloatArray:
    """Arc length [m] at the next steps of 0.4 s, from a place and speed on until the path ends."""
    if begin > path.length - 2 * SPACING:
        return np.zeros(0)
    rest = build_even_path(
        sample_poses(path, np.append(np.arange(begin, path.length, SPACING), path.length))[:, :2]
    )
    candidate = Candidate(route, np.zeros((K, 2)), rest, 0.0, law, 0.0, _ANYBODY, None)
    motion = compute_motion(candidate, slowings=(Slowing(0.0, speed, law.braking),))
    return begin + motion.s[TRAJNET_EVERY::TRAJNET_EVERY]


def _along(path: Path, xy: FloatArray) -> FloatArray:
    """[n] arc length [m] at which a path comes nearest to places [n, 2]."""
    located = geos.line_locate_point(geos.LineString(path.xy), geos.points(xy))
    return np.asarray(located, dtype=np.float64)
