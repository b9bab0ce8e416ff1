"""How likely real motion is under a data set, in the manner of the Waymo sim-agents challenge.

Each feature's histogram is taken from the data set, and what counts is the likelihood that it
gives to the reference, exp of the mean log probability of a cell, 0.1 added to every count as in
the challenge. Beside it stands the log-replay oracle: histograms of one half of the reference,
asked about the other. There is no log behind a scene, so unlike there histograms are of all agents
of a class, not of one agent's futures (Montali et al. 2023).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from scenewright.evals.realism.sources import Stretch
from scenewright.evals.realism.two_sample import SMOOTHING, TRIMMED
from scenewright.geometry.kinematics import smooth
from scenewright.geometry.map_areas import geos, merge_areas
from scenewright.geometry.polyline import interpolate_points
from scenewright.scene.base import AgentClass, FloatArray
from scenewright.scene.map import IntersectionMap
from scenewright.scene.track import STEP
from scenewright.tools.relation_checker import RoadUser

EVERY = 4
"""Samples from value to value: 0.4 s."""
CELLS = 20
"""Of each histogram; values beyond its range count in the outermost."""
FEATURES: Mapping[str, Mapping[str, tuple[float, float]]] = {
    "kinematic": {
        "speed": (0.0, 15.0), "acceleration": (-4.0, 4.0),
        "turning": (-1.0, 1.0), "change of turning": (-2.0, 2.0),
    },
    "interactive": {"distance": (0.0, 30.0), "time to contact": (0.0, 8.0), "contact": (0.0, 1.0)},
    "map": {"distance to the edge": (-6.0, 6.0), "off the road": (0.0, 1.0)},
}  # fmt: skip
"""By group the range of each feature: m/s, m/s^2, rad/s, rad/s^2, m, s; contact and off are 0/1."""
_FOR_PEDESTRIANS = {"speed": (0.0, 3.0), "acceleration": (-2.0, 2.0)}
_MOVES = 0.5
"""Below this speed [m/s] an agent has no course."""
_LATEST = 8.0
"""Times to contact beyond this [s] are all alike."""

Values = dict[str, FloatArray]


def measure_features(
    stretches: Sequence[Stretch], kind: AgentClass, *, ground: IntersectionMap | None = None
) -> list[Values]:
    """Measure every feature of a class in each stretch, agent after agent.

    Args:
        ground: the map in whose frame positions are; without one there are no features of it.
    """
    area = None
    if ground is not None:
        area = merge_areas(ground.road)
        if kind == "pedestrian":
            crossings = [geos.Polygon(crosswalk.polygon) for crosswalk in ground.crosswalks]
            area = geos.union_all([merge_areas(ground.walkable), *crossings])
    found: list[Values] = []
    for stretch in stretches:
        parts: dict[str, list[FloatArray]] = {}
        for user in stretch.users:
            if user.shape.type != kind or len(user.track.xy) < 2 * TRIMMED + 8:
                continue
            xy = smooth(user.track.xy, SMOOTHING)
            kept = slice(TRIMMED, len(xy) - TRIMMED, EVERY)
            velocity = np.asarray(np.gradient(xy, STEP, axis=0), dtype=np.float64)
            speed = np.hypot(velocity[:, 0], velocity[:, 1])
            course = np.unwrap(np.arctan2(velocity[:, 1], velocity[:, 0]))
            turning = np.where(speed > _MOVES, np.gradient(course, STEP), 0.0)
            bending = np.where(speed > _MOVES, np.gradient(turning, STEP), 0.0)
            motion = (speed, np.gradient(speed, STEP), turning, bending)
            names = FEATURES["kinematic"]
            rows = {name: values[kept] for name, values in zip(names, motion, strict=True)}
            rows |= _compute_interactive_features(
                stretch, user, user.track.times[kept], xy[kept], velocity[kept]
            )
            if area is not None:
                points = geos.points(xy[kept])
                away = geos.distance(geos.boundary(area), points)
                inside = np.where(geos.contains(area, points), away, -away)
                rows["distance to the edge"] = inside  # negative outside [m]
                rows["off the road"] = np.where(inside < 0.0, 1.0, 0.0)
            for name, values in rows.items():
                parts.setdefault(name, []).append(values)
        found.append({name: np.concatenate(own) for name, own in parts.items()})
    return found


def _compute_interactive_features(
    stretch: Stretch, own: RoadUser, times: FloatArray, xy: FloatArray, velocity: FloatArray
) -> dict[str, FloatArray]:
    """Compute nearest distance, time to contact and contact; agents are discs of their width.

    Args:
        times, xy, velocity: [T] [s], [T, 2] [m] and [T, 2] [m/s] of the agent `own`.
    """
    nearest, contact = np.full(len(xy), np.inf), np.full(len(xy), np.inf)
    for other in stretch.users:
        track = other.track
        k = np.flatnonzero((times >= track.start - 1e-6) & (times <= track.end + 1e-6))
        if other.id == own.id or not len(k):
            continue
        place, soon = (interpolate_points(times[k] + t, track.times, track.xy) for t in (0.0, STEP))
        off, closing = place - xy[k], velocity[k] - (soon - place) / STEP
        radius = (own.shape.width + other.shape.width) / 2.0
        nearest[k] = np.minimum(nearest[k], np.hypot(off[:, 0], off[:, 1]) - radius)
        # Two discs at constant velocity touch where |off - closing t| = radius, if they ever do.
        a = np.maximum((closing**2).sum(axis=1), 1e-9)
        b = (off * closing).sum(axis=1)
        root = b**2 - a * ((off**2).sum(axis=1) - radius**2)
        when = np.maximum((b - np.sqrt(np.maximum(root, 0.0))) / a, 0.0)
        contact[k] = np.minimum(contact[k], np.where((root > 0.0) & (b > 0.0), when, np.inf))
    return {
        "distance": nearest,
        "time to contact": np.minimum(contact, _LATEST),
        "contact": np.where(nearest <= 0.0, 1.0, 0.0),
    }


def score_likelihood(
    source: Sequence[Values], reference: Sequence[Values], kind: AgentClass
) -> dict[str, float]:
    """Score the reference's likelihood under the source (0 to 1) by feature, group and "all"."""
    scores: dict[str, float] = {}
    for group, ranges in FEATURES.items():
        own = []
        for name, span in ranges.items():
            low, high = _FOR_PEDESTRIANS.get(name, span) if kind == "pedestrian" else span
            cells = 2 if span == (0.0, 1.0) else CELLS
            sides = ([p[name] for p in side if name in p] for side in (source, reference))
            made, real = (
                np.histogram(
                    np.concatenate([np.zeros(0), *parts]).clip(low, high), cells, (low, high)
                )[0]
                for parts in sides
            )
            if made.any() and real.any():
                log = np.log((made + 0.1) / (made + 0.1).sum())
                scores[name] = float(np.exp(np.average(log, weights=real)))
                own.append(scores[name])
        if own:
            scores[group] = float(np.mean(own))
    groups = [scores[group] for group in FEATURES if group in scores]
    return scores | ({"all": float(np.mean(groups))} if groups else {})
