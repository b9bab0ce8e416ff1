"""Predictions of any method, checked against what was observed, and their scores with intervals.

A relation counts for each of its two agents as one item (agent, relation, partner); it is right
if the relation and both agents are, and of a yielding which one gives way. `normal` has one item
per agent without any event. Agents that only have events with agents not observed yet are left out
of `normal`, and those events are listed as `later`; `strict` counts them as missed instead.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import product
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
        for fault in _list_faults(row, observations, sides):
            raise InputError(f"{where}: {fault}")
        if key in found:
            raise InputError(f"{where}: a second row for scene {row.scene} at {row.window:g} s")
        found[key] = ScenePrediction(row.exits, row.relations)
    if not found:
        raise InputError(f"{file} holds no predictions")
    windows = sorted({window for _, window in found})
    missing = [key for key in observations if key[1] in windows and key not in found]
    if missing:
        raise InputError(
            f"{file} has no row for scene {missing[0][0]} at {missing[0][1]:g} s ({len(missing)} "
            "rows are missing); every scene needs one at each window that is predicted"
        )
    for part, window in product(ScenePrediction._fields, windows):
        if len({getattr(p, part) is None for (_, w), p in found.items() if w == window}) > 1:
            raise InputError(
                f"{file} gives {part} for some scenes at {window:g} s and not for others; "
                "give them for all, or leave them out"
            )
    return found


def _list_faults(
    row: PredictionRow, observations: Mapping[SceneWindow, ObservedScene], sides: tuple[str, ...]
) -> Iterator[str]:
    """Scenes, agents and sides that do not exist, and relations that cannot be."""

    def shorten(text: str) -> str:
        return repr(text if len(text) <= 40 else text[:37] + "...")

    seen, relations = observations.get((row.scene, row.window)), row.relations or ()
    if seen is None:
        known = any(scene == row.scene for scene, _ in observations)
        what = f"window {row.window:g}" if known else f"scene {shorten(row.scene)}"
        yield f"there is no {what} in what is scored"
        return
    for agent in (*(row.exits or ()), *(a for r in relations for a in (r.from_, r.to))):
        if agent not in seen.ids:
            yield f"no agent {shorten(agent)} was seen in that scene by then"
    for side in (row.exits or {}).values():
        if side not in sides:
            yield f"exit {shorten(side)} is none of {', '.join(sides)}"
    yield from (f"{r.type} of {r.from_} with itself" for r in relations if r.from_ == r.to)
    if len({r.key for r in relations}) < len(relations):
        yield "one relation twice"


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
_MEANS = {"macro": [0, 1, 2], "macro 4": [0, 1, 2, 3]}
"""Which of `KINDS` are averaged."""
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
    exits, relations = prediction
    classes = np.zeros((len(AGENT_CLASSES), 3))
    for agent in seen if exits is not None else ():
        right = exits.get(agent) == labels.exits[agent] if exits else False
        classes[AGENT_CLASSES.index(labels.types[agent])] += (right, not right, not right)
    said, every = {r.key for r in relations or ()}, {r.key for r in labels.relations}
    truth = {r.key for r in labels.relations if {r.from_, r.to} <= seen}
    named, busy, told = ({agent for k in keys for agent in k[1:]} for keys in (truth, every, said))
    parts = []
    for wanted, agents in ((truth, seen - (busy - named)), (every, seen)):
        items = np.zeros((len(KINDS), 3))
        for n, kind in enumerate(RELATIONS, start=1):
            true, found = ({key for key in keys if key[0] == kind} for keys in (wanted, said))
            items[n] = (2 * len(true & found), 2 * len(found - true), 2 * len(true - found))
        for agent in agents:
            normal, quiet = agent not in busy, agent not in told
            items[0] += (normal and quiet, quiet > normal, normal > quiet)
        parts.append(items)
    leads = np.zeros((len(RELATIONS), len(LEADS), 2))
    for relation in labels.relations:
        if relation.key in truth and relation.time is not None:
            lead = max(relation.time - window, 0.0)
            at = next(n for n, (low, high) in enumerate(LEADS) if low <= lead < high)
            leads[RELATIONS.index(relation.type), at] += (relation.key in said, 1)
    return SceneCounts(
        exits=None if exits is None else classes,
        items=None if relations is None else parts[0],
        strict=None if relations is None else parts[1],
        leads=leads,
        later=sum(not {r.from_, r.to} <= seen for r in labels.relations),
        agents=len(seen),
        unseen=len(labels.starts) - len(seen),
    )


def summarise(
    counts: Sequence[SceneCounts], *, window: float, seconds: float | None
) -> WindowScores:
    """Summarise the counts of all scenes after one window [s]."""
    draws = draw_resamples(len(counts), draws=DRAWS).astype(np.float64)
    leads = np.sum([count.leads for count in counts], axis=0).astype(int).tolist()
    found = {name: [(k, n) for k, n in own] for name, own in zip(RELATIONS, leads, strict=True)}
    exits, items, strict = (
        [getattr(count, name) for count in counts] for name in ("exits", "items", "strict")
    )
    sums = {
        name: sum(getattr(count, name) for count in counts)
        for name in ("agents", "unseen", "later")
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
    means: Mapping[str, Sequence[int]],
    *,
    pooled: str,
) -> dict[str, Figure]:
    """F1 by kind, its mean over some kinds, and that of all items together."""
    if any(count is None for count in counts):
        return {}
    table = np.array(counts)
    # The counts of all scenes, then of each resample.
    total = np.concatenate([table.sum(axis=0)[None], np.einsum("bs,skx->bkx", draws, table)])
    f1, n = compute_f1(total), total[0, :, 0] + total[0, :, 2]
    columns = {name: (f1[:, k], n[k]) for k, name in enumerate(kinds)}
    for name, which in means.items():
        columns[name] = f1[:, which].mean(axis=1), n[which].sum()
    columns[pooled] = compute_f1(total.sum(axis=1)), n.sum()
    found = {}
    for name, (values, count) in columns.items():
        if np.isnan(values[0]):
            found[name] = Figure(None, None, None, int(count))
            continue
        bounds = float(values[0]), *compute_interval(values[1:])
        value, low, high = (round(100 * each, 2) for each in bounds)
        found[name] = Figure(value, low, high, int(count))
    return found


def compute_f1(counts: FloatArray) -> FloatArray:
    """Compute F1 of counts [..., 3]; NaN where there is nothing to find and nothing was found."""
    hits = 2 * counts[..., 0]
    with np.errstate(invalid="ignore"):
        return np.asarray(hits / (hits + counts[..., 1] + counts[..., 2]))
