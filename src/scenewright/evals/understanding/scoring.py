"""Predictions of any method, checked against what was observed, and their scores with intervals.

A relation counts for each of its two agents as one item (agent, relation, partner); it is right
if the relation and both agents are, and of a yielding which one gives way. `normal` has one item
per agent without any event. Agents that only have events with agents not observed yet are left out
of `normal`, and those events are listed as `later`; `strict` counts them as missed instead.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple, get_args

import numpy as np
from pydantic import Field, ValidationError

from scenewright.errors import InputError, describe_misfit
from scenewright.evals.bootstrap import Figure, compute_interval, draw_resamples
from scenewright.evals.understanding.cases import RELATIONS, Labels, ObservedScene, PairRelation
from scenewright.scene.base import AgentClass, FloatArray, Model

MOST_BYTES = 512_000_000
_LONGEST = 200
SceneWindow = tuple[str, float]
"""Hash of the scene, window [s]."""


class PredictionRow(Model):
    """The prediction for one scene after one window.

    Attributes:
        exits: side by agent; None where the method does not predict exits.
        relations: all that are expected; None where the method does not predict relations.
    """

    scene: str = Field(max_length=64)
    window: float
    exits: dict[str, str] | None = None
    relations: tuple[PairRelation, ...] | None = None


class ScenePrediction(NamedTuple):
    """A prediction for one scene: `exits` and `relations` of a `PredictionRow`."""

    exits: Mapping[str, str] | None
    relations: tuple[PairRelation, ...] | None


def read_predictions(
    file: Path, observations: Mapping[SceneWindow, ObservedScene], *, sides: tuple[str, ...]
) -> dict[SceneWindow, ScenePrediction]:
    """Read predictions by scene and window, complete for every window in the file.

    Raises:
        InputError: unreadable, unknown or missing scenes, agents or sides, or a row twice; names
            the line and what to mend.
    """
    try:
        if file.stat().st_size > MOST_BYTES:
            raise InputError(f"{file} is larger than {MOST_BYTES // 10**6} MB")
        lines = file.read_bytes().splitlines()
    except OSError as error:
        raise InputError(f"cannot read {file}: {error.strerror or error}") from error
    found: dict[SceneWindow, ScenePrediction] = {}
    for number, line in enumerate(lines, start=1):
        if not line.strip():
            continue
        where = f"{file}, line {number}"
        try:
            row = PredictionRow.model_validate_json(line)
        except ValidationError as error:
            raise InputError(f"{where}: {describe_misfit(error, 'row')[:_LONGEST]}") from error
        key = (row.scene, row.window)
        if key not in observations:
            known = any(scene == row.scene for scene, _ in observations)
            what = f"window {row.window:g}" if known else f"scene {_shorten(row.scene)}"
            raise InputError(f"{where}: there is no {what} in what is scored")
        if key in found:
            raise InputError(f"{where}: a second row for scene {row.scene} at {row.window:g} s")
        found[key] = _check_row(row, observations[key], sides, where)
    if not found:
        raise InputError(f"{file} holds no predictions")
    _check_complete(file, found, observations)
    return found


def _check_row(
    row: PredictionRow, observation: ObservedScene, sides: tuple[str, ...], where: str
) -> ScenePrediction:
    """The row's prediction, if it speaks of agents and sides that exist."""
    relations = row.relations or ()
    for agent in (*(row.exits or ()), *(a for r in relations for a in (r.from_, r.to))):
        if agent not in observation.ids:
            raise InputError(f"{where}: no agent {_shorten(agent)} was seen in that scene by then")
    for side in (row.exits or {}).values():
        if side not in sides:
            raise InputError(f"{where}: exit {_shorten(side)} is none of {', '.join(sides)}")
    for each in relations:
        if each.from_ == each.to:
            raise InputError(f"{where}: {each.type} of {each.from_} with itself")
    if len({r.key for r in relations}) < len(relations):
        raise InputError(f"{where}: one relation twice")
    return ScenePrediction(row.exits, row.relations)


def _shorten(text: str) -> str:
    return repr(text if len(text) <= 40 else text[:37] + "...")


def _check_complete(
    file: Path,
    found: Mapping[SceneWindow, ScenePrediction],
    observations: Mapping[SceneWindow, ObservedScene],
) -> None:
    windows = sorted({window for _, window in found})
    missing = [key for key in observations if key[1] in windows and key not in found]
    if missing:
        scene, window = missing[0]
        raise InputError(
            f"{file} has no row for scene {scene} at {window:g} s ({len(missing)} rows are "
            "missing); every scene needs one at each window that is predicted"
        )
    for part in ("exits", "relations"):
        for window in windows:
            if len({getattr(p, part) is None for (_, w), p in found.items() if w == window}) > 1:
                raise InputError(
                    f"{file} gives {part} for some scenes at {window:g} s and not for others; "
                    "give them for all, or leave them out"
                )


def format_predictions(predictions: Mapping[SceneWindow, ScenePrediction]) -> bytes:
    """Format predictions as lines of JSON, without the parts that they leave out."""
    rows = (
        PredictionRow(scene=scene, window=window, **said._asdict())
        for (scene, window), said in predictions.items()
    )
    return format_jsonl(
        row.model_dump(mode="json", by_alias=True, exclude_none=True) for row in rows
    )


def format_jsonl(rows: Iterable[Mapping[str, Any]]) -> bytes:
    """Format rows as lines of JSON."""
    lines = (json.dumps(row, ensure_ascii=False, separators=(",", ":")) + "\n" for row in rows)
    return "".join(lines).encode("utf-8", "backslashreplace")


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
