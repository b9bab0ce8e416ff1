"""Priors of U-turns that no track was seen of: the map's line, and the ways of left turns."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from scenewright.geometry.polyline import resample_to_count
from scenewright.geometry.spline import DENSE, PER_INTERVAL
from scenewright.scene.map import IntersectionMap, Route
from scenewright.tools.gmm_sampler.priors import Priors, WaypointPrior

_WANDERS = 0.3
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
        cholesky=like.cholesky[[heaviest]] * _WANDERS, base=base, tracks=0,
    )  # fmt: skip
    return replace(
        priors,
        waypoints={route.id: waypoints},
        driving_profiles={route.id: priors.driving_profiles[left.id]},
        subtypes={route.id: {"car": 1.0}},
    )
