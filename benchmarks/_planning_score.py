"""Planning accuracy: share of instructions with every field right, and each field by itself."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import permutations
from typing import Any

from scenewright.evals.bootstrap import Figure
from scenewright.evals.planning import Row, does_time_fit

_SYMMETRIC = frozenset({"collision", "near_miss"})
_AGENT_FIELDS = ("entry", "exit", "movement", "crosswalk")
_MOST_PERMUTED = 6


@dataclass(frozen=True)
class PlanningScore:
    """Planning accuracy of one set.

    Attributes:
        all_fields: rows with every field right.
        fields: per field, over the rows that are no refusals (`refused`: over all rows).
        wrong: id -> names of the fields that were wrong.
    """

    all_fields: Figure
    fields: Mapping[str, Figure]
    wrong: Mapping[str, tuple[str, ...]] = field(default_factory=dict)


def score(rows: Sequence[Row], predictions: Sequence[Row]) -> PlanningScore:
    """Compare plan rows with labelled rows, paired by id.

    Agents match up to renaming within their class; collisions and near misses have no direction;
    a label's time range (or list of ranges) accepts every time inside it.

    Raises:
        ValueError: if a labelled row has no prediction.
    """
    by_id = {row["id"]: row for row in predictions}
    missing = [row["id"] for row in rows if row["id"] not in by_id]
    if missing:
        raise ValueError(f"no prediction for {', '.join(missing[:5])}")
    verdicts = {row["id"]: compare(row["expected"], by_id[row["id"]]) for row in rows}
    names = dict.fromkeys(name for verdict in verdicts.values() for name in verdict)
    fields = {name: [v[name] for v in verdicts.values() if name in v] for name in names}
    return PlanningScore(
        all_fields=Figure.of_count(sum(all(v.values()) for v in verdicts.values()), len(verdicts)),
        fields={name: Figure.of_count(sum(known), len(known)) for name, known in fields.items()},
        wrong={
            key: tuple(name for name, right in verdict.items() if not right)
            for key, verdict in verdicts.items()
            if not all(verdict.values())
        },
    )


def compare(expected: Row, predicted: Row) -> dict[str, bool]:
    """Field name -> right or wrong, under the best renaming of agents."""
    refused = bool(expected["refused"])
    if refused or predicted["refused"]:
        return {"refused": refused == bool(predicted["refused"])}
    theirs, ours = expected["context"], predicted["context"]
    counts = [
        [(each["background"] or {}).get(kind) for kind in ("vehicles", "pedestrians")]
        for each in (theirs, ours)
    ]
    context = {
        "density": theirs["density"] == ours["density"],
        "time_of_day": does_time_fit(theirs["time_of_day"], ours["time_of_day"]),
        "background": counts[0] == counts[1],
    }
    known = {agent["id"]: agent for agent in expected["agents"]}
    edges = {_normalize_edge(each, {n: n for n in known}) for each in expected["relations"]}
    candidates = []
    for names in _list_renamings(expected, predicted):
        pairs = [(known[names[agent["id"]]], agent) for agent in predicted["agents"]]
        same = {key: all(a[key] == b[key] for a, b in pairs) for key in _AGENT_FIELDS}
        found = {_normalize_edge(each, names) for each in predicted["relations"]}
        candidates.append({"agents": True, **same, "relations": found == edges})
    fallback = {"agents": False, **dict.fromkeys(_AGENT_FIELDS, False), "relations": False}
    best = max(candidates, key=lambda fields: sum(fields.values()), default=fallback)
    return {"refused": True, **best, **context}


def _list_renamings(expected: Row, predicted: Row) -> list[dict[str, str]]:
    """Every map from predicted to expected ids that keeps the class; none if the counts differ.

    More agents of a class than `_MOST_PERMUTED` are taken in order of mention.
    """
    result: list[dict[str, str]] = [{}]
    for kind in sorted({agent["type"] for row in (expected, predicted) for agent in row["agents"]}):
        ours = [agent["id"] for agent in predicted["agents"] if agent["type"] == kind]
        theirs = [agent["id"] for agent in expected["agents"] if agent["type"] == kind]
        if len(ours) != len(theirs):
            return []
        result = [
            {**names, **dict(zip(ours, order, strict=True))}
            for names in result
            for order in (permutations(theirs) if len(theirs) <= _MOST_PERMUTED else [theirs])
        ]
    return result


def _normalize_edge(edge: Row, names: Mapping[str, str]) -> tuple[Any, ...]:
    if edge["type"] == "normal":
        return ("normal",)
    ends = (names[edge["from"]], names[edge["to"]])
    return (edge["type"], *(sorted(ends) if edge["type"] in _SYMMETRIC else ends))
