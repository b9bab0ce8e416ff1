"""Scores of predictions: accuracy of exits, agent-level F1 of relations, with intervals.

A relation counts for each of its two agents as one item (agent, relation, partner); it is right
if the relation and both agents are, and of a yielding which one gives way. `normal` has one item
per agent without any event. Agents that only have events with agents not observed yet are left out
of `normal`, and those events are listed as `later`; `strict` counts them as missed instead.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, get_args

import numpy as np

from scenewright.evals.bootstrap import Figure, compute_interval, draw_resamples
from scenewright.evals.understanding.cases import RELATIONS, Labels
from scenewright.evals.understanding.predictions import ScenePrediction
from scenewright.scene.base import AgentClass, FloatArray

KINDS = ("normal", *RELATIONS)
PAPER = ("normal", "collision", "yielding")
"""The kinds of the paper, of which `macro` is the mean."""
_MEANS = {"macro": PAPER, "macro 4": KINDS}
AGENT_CLASSES: tuple[AgentClass, ...] = get_args(AgentClass)
LEADS = ((0.0, 2.0), (2.0, 4.0), (4.0, 6.0), (6.0, 10.0), (10.0, np.inf))
"""How long before an event the window ends [s]."""
DRAWS = 1000
DEFINITION = (
    "Agent-level F1 = 2 TP / (2 TP + FP + FN) over items (agent, relation, partner), two per "
    "event; an item is right if the relation and both agents are, and of a yielding who gives "
    "way. normal: agents in no collision, near miss or yielding. Strict: every event counts; one "
    "whose parties have not both been seen is missed. macro: mean of normal, collision and "
    "yielding; macro 4: with near miss; micro: all items of the four pooled. Intervals: 95 %, "
    "bootstrap over clips."
)

Key = tuple[str, str, str]


@dataclass(frozen=True, eq=False)
class SceneCounts:
    """Counts of one scene after one window.

    Attributes:
        exits: [C, 3] per class: right, wrong, wrong again, so that F1 is the share of the right;
            None without exits.
        items: [4, 3] per kind: true and false positives, false negatives; strict: the same with
            events that cannot be seen yet; None without relations.
        leads: [3, L, 2] per relation and lead: found, all.
        later: events with an agent not observed yet; agents: observed; unseen: still to come.
    """

    exits: FloatArray | None
    items: FloatArray | None
    strict: FloatArray | None
    leads: FloatArray
    later: int
    agents: int
    unseen: int


@dataclass(frozen=True, eq=False)
class WindowScores:
    """All figures of one method at one window [s].

    Attributes:
        intent: by class and `overall`; relations: by kind, `macro`, `macro 4`, `micro`;
        strict: the same with events that cannot be seen yet.
        leads: relation -> of each lead how many were found, of how many.
        seconds: median per scene.
    """

    window: float
    scenes: int
    agents: int
    unseen: int
    later: int
    seconds: float | None
    intent: Mapping[str, Figure] = field(default_factory=dict)
    relations: Mapping[str, Figure] = field(default_factory=dict)
    strict: Mapping[str, Figure] = field(default_factory=dict)
    leads: Mapping[str, Sequence[tuple[int, int]]] = field(default_factory=dict)

    def to_json(self) -> dict[str, Any]:
        """Convert to plain JSON."""
        counts = ("window", "scenes", "agents", "unseen", "later")
        return {
            **{name: getattr(self, name) for name in counts},
            "seconds_per_scene": self.seconds,
            **{
                name: {key: vars(figure) for key, figure in getattr(self, name).items()}
                for name in ("intent", "relations", "strict")
            },
            "found_by_lead": {
                name: [
                    {"from": low, "to": None if np.isinf(high) else high, "found": k, "of": n}
                    for (low, high), (k, n) in zip(LEADS, found, strict=True)
                ]
                for name, found in self.leads.items()
            },
        }


def count_scene(labels: Labels, prediction: ScenePrediction, *, window: float) -> SceneCounts:
    """Count what is right in one scene after a window [s]."""
    seen = {agent for agent, start in labels.starts.items() if start <= window + 1e-6}
    truth = {r.key for r in labels.relations if {r.from_, r.to} <= seen}
    exits, relations = prediction.exits, prediction.relations
    found = {r.key for r in relations or ()}
    counts = np.zeros((len(AGENT_CLASSES), 3))
    for agent in seen if exits is not None else ():
        right = exits.get(agent) == labels.exits[agent] if exits else False
        counts[AGENT_CLASSES.index(labels.types[agent])] += (right, not right, not right)
    items, strict = (
        count_items(labels, truth, found, seen, strict=strict) for strict in (False, True)
    )
    leads = np.zeros((len(RELATIONS), len(LEADS), 2))
    for each in labels.relations:
        if {each.from_, each.to} <= seen and each.time is not None:
            lead = max(each.time - window, 0.0)
            at = next(n for n, (low, high) in enumerate(LEADS) if low <= lead < high)
            leads[RELATIONS.index(each.type), at] += (each.key in found, 1)
    return SceneCounts(
        exits=None if exits is None else counts,
        items=None if relations is None else items,
        strict=None if relations is None else strict,
        leads=leads,
        later=sum(not {r.from_, r.to} <= seen for r in labels.relations),
        agents=len(seen),
        unseen=len(labels.starts) - len(seen),
    )


def count_items(
    labels: Labels, truth: set[Key], found: set[Key], seen: set[str], *, strict: bool
) -> FloatArray:
    """Count [4, 3] true and false positives and false negatives per kind.

    Args:
        truth: keys of events among observed agents; found: of those predicted.
        seen: the observed agents; strict: count events that cannot be seen yet.
    """
    counts = np.zeros((len(KINDS), 3))
    wanted = {r.key for r in labels.relations} if strict else truth
    for k, kind in enumerate(RELATIONS, start=1):
        true, said = ({key for key in keys if key[0] == kind} for keys in (wanted, found))
        counts[k] = (2 * len(true & said), 2 * len(said - true), 2 * len(true - said))
    busy = {agent for r in labels.relations for agent in (r.from_, r.to)}
    visible, said_busy = ({agent for key in keys for agent in key[1:]} for keys in (truth, found))
    for agent in seen if strict else seen - (busy - visible):
        normal, said_normal = agent not in busy, agent not in said_busy
        counts[0] += (normal and said_normal, said_normal > normal, normal > said_normal)
    return counts


def summarise(
    counts: Sequence[SceneCounts], *, window: float, seconds: float | None
) -> WindowScores:
    """Summarise the counts of all scenes after one window [s]."""
    draws = draw_resamples(len(counts), draws=DRAWS).astype(np.float64)
    leads = np.sum([each.leads for each in counts], axis=0).astype(int).tolist()
    found = {name: [(k, n) for k, n in own] for name, own in zip(RELATIONS, leads, strict=True)}
    exits, items, strict = (
        [getattr(each, name) for each in counts] for name in ("exits", "items", "strict")
    )
    sums = {
        name: sum(getattr(each, name) for each in counts) for name in ("agents", "unseen", "later")
    }
    return WindowScores(
        window=window,
        scenes=len(counts),
        **sums,
        seconds=seconds,
        intent=_summarise_kinds(exits, draws, AGENT_CLASSES, {}, pooled="overall"),
        relations=_summarise_kinds(items, draws, KINDS, _MEANS, pooled="micro"),
        strict=_summarise_kinds(strict, draws, KINDS, _MEANS, pooled="micro"),
        leads=found if items[0] is not None else {},
    )


def _summarise_kinds(
    counts: Sequence[FloatArray | None],
    draws: FloatArray,
    kinds: Sequence[str],
    means: Mapping[str, Sequence[str]],
    *,
    pooled: str,
) -> dict[str, Figure]:
    """F1 by kind, its mean over some kinds, and that of all items together."""
    if any(each is None for each in counts):
        return {}
    table = np.array(counts)
    total, drawn = table.sum(axis=0), np.einsum("bs,skx->bkx", draws, table)
    f1, drawn_f1, n = compute_f1(total), compute_f1(drawn), total[:, 0] + total[:, 2]
    found = {name: _to_figure(f1[k], drawn_f1[:, k], n[k]) for k, name in enumerate(kinds)}
    for name, of in means.items():
        which = [kinds.index(kind) for kind in of]
        found[name] = _to_figure(f1[which].mean(), drawn_f1[:, which].mean(axis=1), n[which].sum())
    together = compute_f1(total.sum(axis=0)), compute_f1(drawn.sum(axis=1))
    return {**found, pooled: _to_figure(*together, n.sum())}


def compute_f1(counts: FloatArray) -> FloatArray:
    """Compute F1 of counts [..., 3]; NaN where there is nothing to find and nothing was found."""
    hits = 2 * counts[..., 0]
    with np.errstate(invalid="ignore"):
        return np.asarray(hits / (hits + counts[..., 1] + counts[..., 2]))


def _to_figure(value: FloatArray, drawn: FloatArray, n: float) -> Figure:
    if np.isnan(value):
        return Figure(None, None, None, int(n))
    low, high = compute_interval(drawn)
    share, low, high = (round(100 * each, 2) for each in (float(value), low, high))
    return Figure(share, low, high, int(n))
