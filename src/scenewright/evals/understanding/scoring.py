"""How right predictions are: accuracy of exits, agent-level F1 of relations, with intervals.

A relation counts for each of its two agents as one item (agent, relation, partner); it is right
if the relation and both agents are, and of a yielding who gives way. `normal` has one item per
agent that is in no event. Who has only events with agents not seen yet is left out of `normal`,
and those events are listed as `later`; `strict` counts them as missed instead.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from scenewright.evals.understanding.labels import RELATIONS, Labels
from scenewright.evals.understanding.predictions import Prediction
from scenewright.scene.base import FloatArray

KINDS = ("normal", *RELATIONS)
PAPER = ("normal", "collision", "yielding")
"""What the paper tells apart, and what `macro` is the mean of."""
CLASSES = ("vehicle", "pedestrian")
LEADS = ((0.0, 2.0), (2.0, 4.0), (4.0, 6.0), (6.0, 10.0), (10.0, np.inf))
"""How long before an event the window ends [s]."""
DRAWS = 1000
DEFINITION = (
    "Agent-level F1 = 2 TP / (2 TP + FP + FN) over items (agent, relation, partner), two per "
    "event; an item is right if the relation and both agents are, and of a yielding who gives "
    "way. normal: agents in no collision, near miss or yielding. Events count once both agents "
    "have been seen; `strict` counts all. macro: mean of normal, collision and yielding; "
    "macro 4: with near miss; micro: all items of the four pooled. Intervals: 95 %, bootstrap "
    "over scenes."
)


@dataclass(frozen=True, eq=False)
class Tally:
    """Counts of one scene after one window.

    Attributes:
        exits: [2, 2] per class: right, all; None without exits.
        items: [4, 3] per kind: true and false positives, false negatives; strict: the same with
            events that cannot be seen yet; None without relations.
        leads: [3, L, 2] per relation and lead: found, all.
        later: events with somebody not seen yet; agents: seen; unseen: agents still to come.
    """

    exits: FloatArray | None
    items: FloatArray | None
    strict: FloatArray | None
    leads: FloatArray
    later: int
    agents: int
    unseen: int


@dataclass(frozen=True)
class Figure:
    """A share in percent, its 95 % interval, and of how many."""

    value: float | None
    low: float | None
    high: float | None
    n: int

    def to_json(self) -> dict[str, Any]:
        """Plain JSON."""
        return {"value": self.value, "low": self.low, "high": self.high, "n": self.n}


@dataclass(frozen=True, eq=False)
class Row:
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
        """Plain JSON."""
        parts = {
            name: {key: figure.to_json() for key, figure in getattr(self, name).items()}
            for name in ("intent", "relations", "strict")
        }
        return {
            "window": self.window,
            "scenes": self.scenes,
            "agents": self.agents,
            "unseen": self.unseen,
            "later": self.later,
            "seconds_per_scene": self.seconds,
            **parts,
            "found_by_lead": {
                name: [
                    {"from": low, "to": None if np.isinf(high) else high, "found": k, "of": n}
                    for (low, high), (k, n) in zip(LEADS, found, strict=True)
                ]
                for name, found in self.leads.items()
            },
        }


def tally(labels: Labels, prediction: Prediction, *, window: float) -> Tally:
    """Counts of one scene."""
    seen = {agent for agent, start in labels.starts.items() if start <= window + 1e-6}
    truth = {r.key for r in labels.relations if {r.from_, r.to} <= seen}
    later = [r for r in labels.relations if not {r.from_, r.to} <= seen]
    found = None if prediction.relations is None else {r.key for r in prediction.relations}
    return Tally(
        exits=_exits(labels, prediction, seen),
        items=None if found is None else _items(labels, truth, found, seen, strict=False),
        strict=None if found is None else _items(labels, truth, found, seen, strict=True),
        leads=_leads(labels, found or set(), seen, window),
        later=len(later),
        agents=len(seen),
        unseen=len(labels.starts) - len(seen),
    )


def _exits(labels: Labels, prediction: Prediction, seen: set[str]) -> FloatArray | None:
    if prediction.exits is None:
        return None
    counts = np.zeros((len(CLASSES), 2))
    for agent in seen:
        right = prediction.exits.get(agent) == labels.exits[agent]
        counts[CLASSES.index(labels.types[agent])] += (right, 1)
    return counts


def _items(
    labels: Labels,
    truth: set[tuple[str, str, str]],
    found: set[tuple[str, str, str]],
    seen: set[str],
    *,
    strict: bool,
) -> FloatArray:
    counts = np.zeros((len(KINDS), 3))
    wanted = {r.key for r in labels.relations} if strict else truth
    for k, kind in enumerate(RELATIONS, start=1):
        asked = {key for key in wanted if key[0] == kind}
        told = {key for key in found if key[0] == kind}
        counts[k] = (2 * len(asked & told), 2 * len(told - asked), 2 * len(asked - told))
    busy = {agent for r in labels.relations for agent in (r.from_, r.to)}
    visible = {agent for key in truth for agent in key[1:]}
    told_busy = {agent for key in found for agent in key[1:]}
    for agent in seen:
        if not strict and agent in busy - visible:
            continue
        is_normal, told_normal = agent not in busy, agent not in told_busy
        counts[0] += (
            is_normal and told_normal,
            told_normal and not is_normal,
            is_normal and not told_normal,
        )
    return counts


def _leads(
    labels: Labels, found: set[tuple[str, str, str]], seen: set[str], window: float
) -> FloatArray:
    counts = np.zeros((len(RELATIONS), len(LEADS), 2))
    for each in labels.relations:
        if {each.from_, each.to} <= seen and each.time is not None:
            lead = max(each.time - window, 0.0)
            at = next(n for n, (low, high) in enumerate(LEADS) if low <= lead < high)
            counts[RELATIONS.index(each.type), at] += (each.key in found, 1)
    return counts


def summarise(
    tallies: Sequence[Tally], *, window: float, seconds: float | None, seed: int = 0
) -> Row:
    """All figures of one window."""
    draws = np.random.default_rng(seed).multinomial(
        len(tallies), np.full(len(tallies), 1 / len(tallies)), size=DRAWS
    )
    weights = draws.astype(np.float64)
    leads = np.sum([each.leads for each in tallies], axis=0)
    speaks = tallies[0].items is not None
    return Row(
        window=window,
        scenes=len(tallies),
        agents=sum(each.agents for each in tallies),
        unseen=sum(each.unseen for each in tallies),
        later=sum(each.later for each in tallies),
        seconds=seconds,
        intent=_intent([each.exits for each in tallies], weights),
        relations=_f1s([each.items for each in tallies], weights),
        strict=_f1s([each.strict for each in tallies], weights),
        leads={
            name: [(int(k), int(n)) for k, n in leads[r].tolist()]
            for r, name in enumerate(RELATIONS)
        }
        if speaks
        else {},
    )


def _intent(counts: Sequence[FloatArray | None], draws: FloatArray) -> dict[str, Figure]:
    if any(each is None for each in counts):
        return {}
    table = np.array(counts)
    pooled = np.concatenate([table, table.sum(axis=1, keepdims=True)], axis=1)
    total, drawn = pooled.sum(axis=0), np.einsum("bs,scx->bcx", draws, pooled)
    return {
        name: _figure(_ratio(total[c, 0], total[c, 1]), _ratio(drawn[:, c, 0], drawn[:, c, 1]),
                      int(total[c, 1]))
        for c, name in enumerate((*CLASSES, "overall"))
    }  # fmt: skip


def _f1s(counts: Sequence[FloatArray | None], draws: FloatArray) -> dict[str, Figure]:
    if any(each is None for each in counts):
        return {}
    table = np.array(counts)
    total, drawn = table.sum(axis=0), np.einsum("bs,skx->bkx", draws, table)
    found = {
        name: _figure(_f1(total[k]), _f1(drawn[:, k]), int(total[k, 0] + total[k, 2]))
        for k, name in enumerate(KINDS)
    }
    means = {"macro": PAPER, "macro 4": KINDS}
    for name, kinds in means.items():
        which = [KINDS.index(kind) for kind in kinds]
        found[name] = _figure(
            _f1(total[which]).mean(), _f1(drawn[:, which]).mean(axis=1),
            int(total[which][:, [0, 2]].sum()),
        )  # fmt: skip
    found["micro"] = _figure(
        _f1(total.sum(axis=0)), _f1(drawn.sum(axis=1)), int(total[:, [0, 2]].sum())
    )
    return found


def _f1(counts: FloatArray) -> FloatArray:
    """F1 of [..., 3]; NaN where there is nothing to find and nothing was told."""
    hits = 2 * counts[..., 0]
    return _ratio(hits, hits + counts[..., 1] + counts[..., 2])


def _ratio(part: FloatArray, whole: FloatArray) -> FloatArray:
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(np.asarray(part, dtype=np.float64) / np.asarray(whole))


def _figure(value: FloatArray, drawn: FloatArray, n: int) -> Figure:
    if np.isnan(value):
        return Figure(None, None, None, n)
    kept = drawn[~np.isnan(drawn)]
    low, high = np.percentile(kept, (2.5, 97.5))
    shown = [round(100 * float(x), 2) for x in (value, low, high)]
    return Figure(shown[0], shown[1], shown[2], n)
