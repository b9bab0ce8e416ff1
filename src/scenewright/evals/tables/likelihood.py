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

from scenewright.evals.bootstrap import Figure, build_figure, resample_ratio
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
ROLES: tuple[Role, ...] = ("foreground", "background")
EVENTS = ("collision", "yielding", "near_miss", "follow")
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


@dataclass(frozen=True)
class LikelihoodCell:
    """One cell of Table 1, 4 or 5: agents of one class and role in scenes of one event.

    Attributes:
        backend, role: None of normal scenes, which are those of all backends and roles.
        nll: mean [nats per ten waypoints] of n agents; median: of them, which a few cut tracks do
            not rule.
        s2r: Eq. 8 as printed, with its sign; its size is what the paper's tables show.
        delta: NLL less that of normal scenes, / 10 [nats per waypoint], free of the unit of length.
    """

    backend: str | None
    event: str
    role: Role | None
    type: AgentClass
    reading: Reading
    scenes: int
    nll: Figure
    median: float | None
    s2r: Figure
    delta: Figure


def resample_nll(
    scores: Sequence[AgentScore], reading: Reading, *, draws: int, rng: np.random.Generator
) -> FloatArray:
    """[1 + draws] mean NLL of agents, then of those in each resample of their scenes."""
    nll = np.array([score.nll[reading] for score in scores], dtype=np.float64)
    scene = np.array([score.scene for score in scores], dtype=np.int64)
    return resample_ratio(nll, np.ones(len(nll)), scene, draws=draws, seed=rng)


def compute_cell(
    scores: Sequence[AgentScore],
    normal: FloatArray,
    rng: np.random.Generator,
    *,
    backend: str | None = None,
    event: str = "normal",
    role: Role | None = None,
    kind: AgentClass,
    reading: Reading,
) -> LikelihoodCell:
    """Compute the cell of some agents.

    Args:
        normal: [1 + draws] mean NLL of normal scenes (`resample_nll`), NaN if there are none.
    """
    means, n = resample_nll(scores, reading, draws=len(normal) - 1, rng=rng), len(scores)
    return LikelihoodCell(
        backend, event, role, kind, reading,
        scenes=len({score.scene for score in scores}),
        nll=build_figure(means, n),
        median=float(np.median([score.nll[reading] for score in scores])) if n else None,
        s2r=build_figure((normal - means) / normal, n),
        delta=build_figure((means - normal) / K, n),
    )  # fmt: skip


@dataclass(frozen=True)
class Fidelity:
    """All of it.

    Attributes:
        references: the cells of normal scenes, the first row of Table 1; cells: of events.
        left: agents without a score; mixed: scenes with several kinds of events, left out.
    """

    references: tuple[LikelihoodCell, ...]
    cells: tuple[LikelihoodCell, ...]
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
    references, means = [], {}
    for reading, kind in product(READINGS, CLASSES):
        own = [score for score in normals if score.type == kind]
        means[kind, reading] = resample_nll(own, reading, draws=draws, rng=rng)
        unknown = np.full(1 + draws, np.nan)
        references += [compute_cell(own, unknown, rng, kind=kind, reading=reading)] if own else []
    cells = []
    for backend, mine in scores.items():
        present = [event for event in EVENTS if any(score.group == event for score in mine)]
        for event, role, kind, reading in product(present, ROLES, CLASSES, READINGS):
            own = [s for s in mine if (s.group, s.role, s.type) == (event, role, kind)]
            cell = compute_cell(
                own, means[kind, reading], rng,
                backend=backend, event=event, role=role, kind=kind, reading=reading,
            )  # fmt: skip
            cells.append(cell)
    return Fidelity(tuple(references), tuple(cells), dict(left), mixed)
