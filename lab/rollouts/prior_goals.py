"""Goals for held-out tracks, from p_wp and the driving profiles and not from the track.

An agent's route is given, as by a request; of its track only the beginning. The rest comes from
the priors conditioned on the beginning: where its path runs, and how it may drive or walk along it
if unimpeded.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import Any, NamedTuple

import numpy as np

from lab.rollouts.condition_prior import condition_prior
from scenewright.errors import InputError
from scenewright.geometry.driving_profile import compute_motion
from scenewright.geometry.spline import SPACING, build_even_path, sample_poses
from scenewright.intersections import load_map
from scenewright.scene.base import FloatArray
from scenewright.scene.candidates import Candidate, DrivingProfile, K, Path
from scenewright.scene.map_elements import Route
from scenewright.scene.selection import Slowing
from scenewright.scene.track import PEDESTRIAN, STEP
from scenewright.tools.gmm_sampler import (
    Priors,
    WaypointPrior,
    load_priors,
    sample_driving_profiles,
    sample_waypoints,
)
from scenewright.tools.gmm_sampler.sample import build_path, score_waypoints
from scenewright.tools.track_io import RecordedAgent, Recording
from scenewright.tools.track_io.recording import TRAJNET_EVERY

geos: Any = import_module("shapely")

_ANY_SHAPE = PEDESTRIAN
"""The size of an agent does not affect its motion along the path."""


class RoutePrior(NamedTuple):
    """An agent's route and priors, known without its track.

    Attributes:
        route: the agent's; prior: p_wp of it, in the frame of the recording [m].
        priors: the bundle's, for the driving profiles.
    """

    route: Route
    prior: WaypointPrior
    priors: Priors


FindRoutePrior = Callable[[Recording, RecordedAgent], RoutePrior | None]
"""Finds the route prior of an agent of a recording; None where its route is unknown."""


def load_bundle_routes(intersection: str) -> FindRoutePrior:
    """Load the route priors of a bundle's own corpus; they were not fitted on its test hours.

    Raises:
        InputError: unknown bundle, or, when asked, a track on a route that it does not have.
    """
    priors = load_priors(intersection)
    routes = {route.id: route for route in load_map(intersection).routes}

    def find_route_prior(_: Recording, agent: RecordedAgent) -> RoutePrior | None:
        if agent.route is None:
            return None
        if agent.route not in routes:
            raise InputError(f"the corpus is not of {intersection}: that has no {agent.route!r}")
        return RoutePrior(routes[agent.route], priors.waypoints[agent.route], priors)

    return find_route_prior


def find_abreast(way: RoutePrior, seen: FloatArray, xy: FloatArray) -> FloatArray:
    """Find the points [n, 2] of the prior's likeliest path that are nearest to places [n, 2].

    Args:
        seen: [m, 2] the beginning of the track [m].
    """
    rest = condition_prior(way.prior, seen)
    likeliest = int(rest.weights.argmax())
    path = build_path(rest, rest.means[likeliest].reshape(K, 2), likeliest)
    return sample_poses(path, _locate_along(path, xy))[:, :2]


def sample_continuations(
    way: RoutePrior, seen: FloatArray, *, steps: int, size: int, rng: np.random.Generator
) -> FloatArray:
    """Sample continuations [size, steps, 2] every 0.4 s; NaN once the agent has left the map.

    A path is drawn given the beginning, then a driving profile; from the last place seen the agent
    goes on unimpeded, at its speed there if the profile and the path's curves allow.

    Args:
        seen: [m, 2] the beginning of the track, every 0.4 s [m].
    """
    rest = condition_prior(way.prior, seen)
    waypoints = sample_waypoints(rest, rng, size=size)
    _, component = score_waypoints(rest, waypoints)
    laws = sample_driving_profiles(way.priors, way.route.id, rng, size=size)
    speed = float(np.hypot(*(seen[-1] - seen[-2]))) / (TRAJNET_EVERY * STEP)
    drawn = np.full((size, steps, 2), np.nan)
    for k in range(size):
        path = build_path(rest, waypoints[k], int(component[k]))
        s = _compute_onward(
            way.route, path, laws[k], float(_locate_along(path, seen[-1:])[0]), speed
        )
        places = sample_poses(path, s[:steps])[:, :2]
        drawn[k, : len(places)] = places
    return drawn


def _compute_onward(
    route: Route, path: Path, law: DrivingProfile, begin: float, speed: float
) -> FloatArray:
    """Compute the arc length [m] every 0.4 s, from a place and speed on until the path ends."""
    if begin > path.length - 2 * SPACING:
        return np.zeros(0)
    rest = build_even_path(
        sample_poses(path, np.append(np.arange(begin, path.length, SPACING), path.length))[:, :2]
    )
    candidate = Candidate(route, np.zeros((K, 2)), rest, 0.0, law, 0.0, _ANY_SHAPE, None)
    motion = compute_motion(candidate, slowings=(Slowing(0.0, speed, law.braking),))
    return begin + motion.s[TRAJNET_EVERY::TRAJNET_EVERY]


def _locate_along(path: Path, xy: FloatArray) -> FloatArray:
    """Return the arc lengths [n] [m] at which a path is nearest to places [n, 2]."""
    located = geos.line_locate_point(geos.LineString(path.xy), geos.points(xy))
    return np.asarray(located, dtype=np.float64)
