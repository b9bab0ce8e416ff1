"""How likely tracks are under the priors, and the gap to normal traffic (paper 4.2, Eq. 8).

NLL is -log p_wp of ten waypoints of an agent, in metres and nats, given its route (class, entry,
exit, crosswalk). Two readings stand side by side, as no text says what to do with a track that does
not run from one end of its route to the other:

- `track`: ten waypoints at equal arc length of the final track as it is, cut short or not. A
  collision ends a track, and so does the end of a scene.
- `path`: the ten waypoints that were drawn for the agent, each replaced by where the final track
  passes it. What the agent never reached stays as drawn, so this is about *where* it went alone.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from scenewright.evals.bootstrap import (
    compute_interval,
    draw_resamples,
    resample_ratio,
)
from scenewright.evals.tables.reading import Dataset
from scenewright.geometry.map_areas import geos
from scenewright.geometry.polyline import measure_arc_lengths, resample_to_count
from scenewright.scene.base import AgentClass, FloatArray
from scenewright.scene.candidates import K
from scenewright.scene.record import AgentRecord, SceneRecord
from scenewright.tools.gmm_sampler import Priors, compute_waypoint_nll, load_priors

Reading = Literal["track", "path"]
READINGS: tuple[Reading, ...] = ("track", "path")
"""Those of the paper's tables."""
CLASSES: tuple[AgentClass, ...] = ("pedestrian", "vehicle")
"""Those that the corpus has, so that there is a prior of how they go."""
Role = Literal["foreground", "background"]
_AT_AN_END, _THE_SAME = 1e-3, 2e-3
"""Positions have millimetres [m]."""
_BESIDE = 2.5
"""Further from the track than this, a point was not passed [m]."""
_SHORTEST = 0.5
"""A track that covers less than this stands, and has no waypoints of its own [m]."""


@dataclass(frozen=True)
class AgentScore:
    """One agent's likelihood.

    Attributes:
        scene: number of its scene; group: event that the scene was made for, or `normal`.
        nll: by reading [nats per ten waypoints].
    """

    scene: int
    group: str
    role: Role
    type: AgentClass
    nll: Mapping[Reading, float]


Unscored = Literal["assumed", "standing", "riders"]
"""Why an agent has no score: on a route without tracks in the corpus; standing all along; on a
bicycle or an e-scooter, on routes whose prior is that of cars or pedestrians."""


@dataclass(frozen=True)
class Gap:
    """One cell of Table 1, 4 or 5: agents of one class and role in scenes of one event.

    Attributes:
        nll: mean [nats per ten waypoints]; normal: that of the reference; median: of the agents.
        s2r: Eq. 8 as printed, with its sign; its size is what the paper's tables show.
        delta: (nll - normal) / 10 [nats per waypoint], free of the unit of length.
        s2r_interval, delta_interval: 95 %, scenes drawn anew with replacement.
    """

    agents: int
    scenes: int
    nll: float
    normal: float
    median: float
    s2r: float
    delta: float
    s2r_interval: tuple[float, float]
    delta_interval: tuple[float, float]


def score_scene(
    scene: SceneRecord, priors: Priors, *, number: int, group: str
) -> tuple[list[AgentScore], Counter[Unscored]]:
    """The likelihood of every agent of a scene, and how many have none."""
    scores, left = [], Counter[Unscored]()
    for agent in scene.agents:
        prior = priors.waypoints.get(agent.route)
        driven = resample_waypoints(np.array(agent.trajectory))
        if agent.type not in CLASSES:
            left["riders"] += 1
        elif prior is None or prior.tracks == 0:
            left["assumed"] += 1
        elif driven is None:
            left["standing"] += 1
        else:
            both = np.stack([driven, find_passed_waypoints(agent)])
            values = compute_waypoint_nll(prior, both).tolist()
            nll: dict[Reading, float] = dict(zip(READINGS, values, strict=True))
            scores.append(AgentScore(number, group, agent.role, agent.type, nll))
    return scores, left


def resample_waypoints(xy: FloatArray) -> FloatArray | None:
    """[K, 2] points at equal arc length along a track [T, 2] [m]; None if it hardly moves."""
    return resample_to_count(xy, K) if measure_arc_lengths(xy)[-1] >= _SHORTEST else None


def find_passed_waypoints(agent: AgentRecord) -> FloatArray:
    """[K, 2] the agent's drawn waypoints, each where the final track passes it, if it does [m]."""
    drawn, xy = np.array(agent.waypoints), np.array(agent.trajectory)
    nearest, passed = find_nearest_on(xy, drawn)
    return np.where(passed[:, None], nearest, drawn)


def find_nearest_on(xy: FloatArray, points: FloatArray) -> tuple[FloatArray, NDArray[np.bool_]]:
    """The nearest place on a track [T, 2] to each point [P, 2], and whether it was passed.

    A point before the track's beginning or beyond its end is not passed, nor one further away than
    a lane is wide: where a track turns a corner, what it never reached may lie beside it.
    """
    length = measure_arc_lengths(xy)[-1]
    if length == 0.0:
        off = np.hypot(*(points - xy[0]).T)
        return np.broadcast_to(xy[0], points.shape).copy(), off < _THE_SAME
    line = geos.LineString(xy)
    at = geos.line_locate_point(line, geos.points(points))
    places = geos.get_coordinates(geos.line_interpolate_point(line, at))
    off = np.hypot(*(points - places).T)
    within = (at > _AT_AN_END) & (at < length - _AT_AN_END)
    return places, (within & (off < _BESIDE)) | (off < _THE_SAME)


def compute_gap(
    scores: Sequence[AgentScore],
    normal: Sequence[AgentScore],
    reading: Reading,
    *,
    draws: int,
    rng: np.random.Generator,
) -> Gap | None:
    """The gap of some agents to the normal ones; None where either is empty."""
    if not scores or not normal:
        return None
    nll, again, scenes = _resample_mean(scores, reading, draws=draws, rng=rng)
    base, against, _ = _resample_mean(normal, reading, draws=draws, rng=rng)
    return Gap(
        agents=len(scores), scenes=scenes, nll=nll, normal=base,
        median=float(np.median([each.nll[reading] for each in scores])),
        s2r=(base - nll) / base, delta=(nll - base) / K,
        s2r_interval=compute_interval((against - again) / against),
        delta_interval=compute_interval((again - against) / K),
    )  # fmt: skip


def _resample_mean(
    scores: Sequence[AgentScore], reading: Reading, *, draws: int, rng: np.random.Generator
) -> tuple[float, FloatArray, int]:
    """Mean NLL, that of [draws] resamples of the scenes, and how many scenes there are."""
    nll = np.array([each.nll[reading] for each in scores])
    scene = np.unique([each.scene for each in scores], return_inverse=True)[1]
    count = np.bincount(scene)
    drawn = draw_resamples(len(count), draws=draws, seed=rng)
    return float(nll.mean()), resample_ratio(np.bincount(scene, nll), count, drawn), len(count)


ROLES: tuple[Role, ...] = ("foreground", "background")
EVENTS = ("collision", "yielding", "near_miss", "follow")


@dataclass(frozen=True)
class NormalScenes:
    """NLL of normal scenes: the first row of Table 1.

    Attributes:
        nll: mean, as in the paper; median: of the agents, which a few cut tracks do not rule.
    """

    type: AgentClass
    reading: Reading
    scenes: int
    agents: int
    nll: float
    interval: tuple[float, float]
    median: float


@dataclass(frozen=True)
class FidelityCell:
    """One cell; None where no such agent is in the dataset."""

    backend: str
    event: str
    role: Role
    type: AgentClass
    reading: Reading
    gap: Gap | None


@dataclass(frozen=True)
class Fidelity:
    """All of it.

    Attributes:
        left: agents without a score; mixed: scenes with several kinds of events, left out.
    """

    references: tuple[NormalScenes, ...]
    cells: tuple[FidelityCell, ...]
    left: Mapping[Unscored, int]
    mixed: int


def compute_fidelity(dataset: Dataset, *, draws: int, seed: int) -> Fidelity:
    """Scores every agent and compares events with normal scenes, of whichever backend those are."""
    scores: dict[str, list[AgentScore]] = {name: [] for name in dataset.backends}
    left: Counter[Unscored] = Counter({"assumed": 0, "standing": 0, "riders": 0})
    mixed = 0
    for number, scene in dataset.read_scenes(dataset.rows):
        kinds = {relation.type for relation in scene.relations}
        if len(kinds) > 1:
            mixed += 1
            continue
        group = next(iter(kinds), "normal")
        priors = load_priors(scene.meta.intersection)
        found, without = score_scene(scene, priors, number=number, group=group)
        scores[dataset.rows[number].backend] += found
        left.update(without)
    normals = [score for own in scores.values() for score in own if score.group == "normal"]
    rng = np.random.default_rng(seed)
    normal = {kind: [each for each in normals if each.type == kind] for kind in CLASSES}
    references = []
    for reading, kind in product(READINGS, CLASSES):
        if own := normal[kind]:
            mean, again, scenes = _resample_mean(own, reading, draws=draws, rng=rng)
            median = float(np.median([each.nll[reading] for each in own]))
            interval = compute_interval(again)
            references.append(NormalScenes(kind, reading, scenes, len(own), mean, interval, median))
    cells = []
    for backend, mine in scores.items():
        present = {each.group for each in mine}
        for event, role, kind in product((e for e in EVENTS if e in present), ROLES, CLASSES):
            cell = (event, role, kind)
            agents = [each for each in mine if (each.group, each.role, each.type) == cell]
            for reading in READINGS:
                gap = compute_gap(agents, normal[kind], reading, draws=draws, rng=rng)
                cells.append(FidelityCell(backend, event, role, kind, reading, gap))
    return Fidelity(tuple(references), tuple(cells), left, mixed)
