"""Tables 1, 4 and 5: NLL and S2R by event, class and role, one table for each backend."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import product

import numpy as np

from scenewright.evals.tables.likelihood import (
    CLASSES,
    READINGS,
    AgentScore,
    Gap,
    Reading,
    Role,
    Unscored,
    compute_gap,
    compute_mean_nll,
    get_event_group,
    score_scene,
    select_scores,
)
from scenewright.evals.tables.reading import Dataset
from scenewright.scene.base import AgentClass
from scenewright.tools.gmm_sampler import load_priors

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
        group = get_event_group(scene)
        if group is None:
            mixed += 1
            continue
        priors = load_priors(scene.meta.intersection)
        found, without = score_scene(scene, priors, number=number, group=group)
        scores[dataset.rows[number].backend] += found
        left.update(without)
    scores_of_all = [score for each in scores.values() for score in each]
    rng = np.random.default_rng(seed)
    normal = {
        kind: list(select_scores(scores_of_all, group="normal", role=None, kind=kind))
        for kind in CLASSES
    }
    references = []
    for reading, kind in product(READINGS, CLASSES):
        mean = compute_mean_nll(normal[kind], reading, draws=draws, rng=rng)
        if mean.value is not None and mean.low is not None and mean.high is not None:
            scenes = len({each.scene for each in normal[kind]})
            median = float(np.median([each.nll[reading] for each in normal[kind]]))
            interval = (mean.low, mean.high)
            references.append(
                NormalScenes(kind, reading, scenes, mean.n, mean.value, interval, median)
            )
    cells = []
    for backend, mine in scores.items():
        present = {each.group for each in mine}
        for event, role, kind in product((e for e in EVENTS if e in present), ROLES, CLASSES):
            agents = list(select_scores(mine, group=event, role=role, kind=kind))
            for reading in READINGS:
                gap = compute_gap(agents, normal[kind], reading, draws=draws, rng=rng)
                cells.append(FidelityCell(backend, event, role, kind, reading, gap))
    return Fidelity(tuple(references), tuple(cells), left, mixed)
