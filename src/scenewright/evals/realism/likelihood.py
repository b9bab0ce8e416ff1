"""How likely real motion is under a data set, in the manner of the Waymo sim-agents challenge.

Each feature's histogram is taken from the data set, and what counts is the likelihood that it
gives to the reference, exp of the mean log probability of a cell, 0.1 added to every count as in
the challenge. Beside it stands the log-replay oracle: histograms of one half of the reference,
asked about the other. There is no log behind a scene, so unlike there histograms are of all agents
of a class, not of one agent's futures (Montali et al. 2023).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from scenewright.evals.realism.motion_windows import SMOOTHING, TRIMMED
from scenewright.evals.realism.sources import Stretch
from scenewright.geometry.kinematics import smooth
from scenewright.geometry.map_areas import geos
from scenewright.scene.base import AgentClass, FloatArray
from scenewright.scene.map import IntersectionMap
from scenewright.scene.track import STEP

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
    areas = None if ground is None else _GroundAreas(ground)
    return [_measure_stretch(stretch, kind, areas) for stretch in stretches]


class _GroundAreas:
    """The road, and the ground for pedestrians, as polygons."""

    def __init__(self, ground: IntersectionMap) -> None:
        crossings = [geos.Polygon(each.polygon) for each in ground.crosswalks]
        road, walkable = (
            [geos.Polygon(each.exterior, each.holes) for each in area]
            for area in (ground.road, ground.walkable)
        )
        self.of: dict[str, Any] = {
            "vehicle": geos.union_all(road),
            "pedestrian": geos.union_all([*walkable, *crossings]),
        }

    def measure_inside(self, kind: AgentClass, xy: FloatArray) -> FloatArray:
        """Return the [T] distances to the edge [m], negative outside."""
        area = self.of.get(kind, self.of["vehicle"])
        points = geos.points(xy)
        away = geos.distance(geos.boundary(area), points)
        return np.asarray(np.where(geos.contains(area, points), away, -away))


def _measure_stretch(stretch: Stretch, kind: AgentClass, areas: _GroundAreas | None) -> Values:
    found: dict[str, list[FloatArray]] = {}
    for user in stretch.users:
        if user.shape.type != kind or len(user.track.xy) < 2 * TRIMMED + 8:
            continue
        xy = smooth(user.track.xy, SMOOTHING)
        kept = slice(TRIMMED, len(xy) - TRIMMED, EVERY)
        velocity = np.asarray(np.gradient(xy, STEP, axis=0), dtype=np.float64)
        rows = {
            name: values[kept] for name, values in _compute_kinematic_features(velocity).items()
        }
        seen = _MotionSamples(
            user.id, user.shape.width, user.track.times[kept], xy[kept], velocity[kept]
        )
        rows |= _compute_interactive_features(stretch, seen)
        if areas is not None:
            inside = areas.measure_inside(kind, xy[kept])
            rows |= {
                "distance to the edge": inside,
                "off the road": np.where(inside < 0.0, 1.0, 0.0),
            }
        for name, values in rows.items():
            found.setdefault(name, []).append(values)
    return {name: np.concatenate(parts) for name, parts in found.items()}


class _MotionSamples(NamedTuple):
    """One agent at some times: [T] [s], [T, 2] [m] and [T, 2] [m/s]."""

    id: int
    width: float
    times: FloatArray
    xy: FloatArray
    velocity: FloatArray


def _compute_kinematic_features(velocity: FloatArray) -> dict[str, FloatArray]:
    speed = np.hypot(velocity[:, 0], velocity[:, 1])
    moving = speed > _MOVES
    course = np.unwrap(np.arctan2(velocity[:, 1], velocity[:, 0]))
    turning = np.where(moving, np.gradient(course, STEP), 0.0)
    return {
        "speed": speed,
        "acceleration": np.asarray(np.gradient(speed, STEP), dtype=np.float64),
        "turning": turning,
        "change of turning": np.where(moving, np.gradient(turning, STEP), 0.0),
    }


def _compute_interactive_features(stretch: Stretch, own: _MotionSamples) -> dict[str, FloatArray]:
    """Compute nearest distance, time to contact and contact; agents are discs of their width."""
    nearest, contact = np.full(len(own.xy), np.inf), np.full(len(own.xy), np.inf)
    for other in stretch.users:
        track = other.track
        k = np.flatnonzero((own.times >= track.start - 1e-6) & (own.times <= track.end + 1e-6))
        if other.id == own.id or not len(k):
            continue
        place, soon = (
            np.stack([np.interp(own.times[k] + t, track.times, track.xy[:, a]) for a in (0, 1)], 1)
            for t in (0.0, STEP)
        )
        off, closing = place - own.xy[k], own.velocity[k] - (soon - place) / STEP
        radius = (own.width + other.shape.width) / 2.0
        nearest[k] = np.minimum(nearest[k], np.hypot(off[:, 0], off[:, 1]) - radius)
        contact[k] = np.minimum(contact[k], _compute_time_to_contact(off, closing, radius))
    return {
        "distance": nearest,
        "time to contact": np.minimum(contact, _LATEST),
        "contact": np.where(nearest <= 0.0, 1.0, 0.0),
    }


def _compute_time_to_contact(off: FloatArray, closing: FloatArray, radius: float) -> FloatArray:
    """Return the [T] times until two discs touch at constant velocity [s]; inf if they never do."""
    a = np.maximum((closing**2).sum(axis=1), 1e-9)
    b = (off * closing).sum(axis=1)
    c = (off**2).sum(axis=1) - radius**2
    root = b**2 - a * c
    with np.errstate(invalid="ignore"):
        when = (b - np.sqrt(root)) / a
    return np.where((root > 0.0) & (b > 0.0), np.maximum(when, 0.0), np.inf)


def score_likelihood(
    source: Sequence[Values], reference: Sequence[Values], kind: AgentClass
) -> dict[str, float]:
    """Score the reference's likelihood under the source (0 to 1) by feature, group and "all"."""
    scores: dict[str, float] = {}
    for group, ranges in FEATURES.items():
        own = []
        for name, span in ranges.items():
            within = _FOR_PEDESTRIANS.get(name, span) if kind == "pedestrian" else span
            made, real = (_concatenate(side, name) for side in (source, reference))
            if len(made) and len(real):
                scores[name] = _compute_likelihood(made, real, within)
                own.append(scores[name])
        if own:
            scores[group] = float(np.mean(own))
    groups = [scores[group] for group in FEATURES if group in scores]
    return scores | ({"all": float(np.mean(groups))} if groups else {})


def _concatenate(parts: Sequence[Values], name: str) -> FloatArray:
    return np.concatenate([np.zeros(0), *(part[name] for part in parts if name in part)])


def _compute_likelihood(made: FloatArray, real: FloatArray, span: tuple[float, float]) -> float:
    low, high = span
    cells = 2 if span == (0.0, 1.0) else CELLS
    place = [
        np.clip(((np.minimum(v, high) - low) / (high - low) * cells).astype(int), 0, cells - 1)
        for v in (made, real)
    ]
    count = np.bincount(place[0], minlength=cells) + 0.1
    return float(np.exp(np.log(count / count.sum())[place[1]].mean()))
