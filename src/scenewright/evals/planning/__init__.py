"""Planning accuracy: share of instructions with every field right, and each field by itself."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from importlib.resources import files
from itertools import permutations
from typing import Any, Literal

Row = Mapping[str, Any]
_SYMMETRIC = frozenset({"collision", "near_miss"})
_AGENT_FIELDS = ("entry", "exit", "movement", "crosswalk")
_DAY = 24 * 60
_MOST_PERMUTED = 6


@dataclass(frozen=True)
class PlanningShare:
    """A rate with its count and 95 % Wilson interval; None where n is 0."""

    right: int
    n: int

    @property
    def rate(self) -> float | None:
        """right / n."""
        return self.right / self.n if self.n else None

    @property
    def interval(self) -> tuple[float, float] | None:
        """Wilson score interval (Wilson 1927)."""
        if not self.n:
            return None
        from scipy.stats import binomtest

        found = binomtest(self.right, self.n).proportion_ci(method="wilson")
        return float(found.low), float(found.high)


@dataclass(frozen=True)
class PlanningScore:
    """Planning accuracy of one set.

    Attributes:
        all_fields: rows with every field right.
        fields: per field, over the rows that are no refusals (`refused`: over all rows).
        wrong: id -> names of the fields that were wrong.
    """

    all_fields: PlanningShare
    fields: Mapping[str, PlanningShare]
    wrong: Mapping[str, tuple[str, ...]] = field(default_factory=dict)


def load(part: Literal["development", "test", "voices"]) -> list[dict[str, Any]]:
    """The labelled instructions of the package: {"id", "text", "previous"?, "expected"}."""
    source = files("scenewright.evals.planning").joinpath(f"{part}.jsonl").read_text("utf-8")
    return [json.loads(line) for line in source.splitlines()]


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
        all_fields=PlanningShare(sum(all(v.values()) for v in verdicts.values()), len(verdicts)),
        fields={name: PlanningShare(sum(known), len(known)) for name, known in fields.items()},
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
    context = {
        "density": theirs["density"] == ours["density"],
        "time_of_day": does_time_fit(theirs["time_of_day"], ours["time_of_day"]),
        "background": _get_counts(theirs["background"]) == _get_counts(ours["background"]),
    }
    candidates = [
        _compare_agents(expected, predicted, names)
        for names in _list_renamings(expected, predicted)
    ]
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


def _compare_agents(expected: Row, predicted: Row, names: Mapping[str, str]) -> dict[str, bool]:
    theirs = {agent["id"]: agent for agent in expected["agents"]}
    fields = {
        key: all(theirs[names[a["id"]]][key] == a[key] for a in predicted["agents"])
        for key in _AGENT_FIELDS
    }
    ours = {_normalize_edge(edge, names) for edge in predicted["relations"]}
    same = {name: name for name in theirs}
    return {
        "agents": True,
        **fields,
        "relations": ours == {_normalize_edge(edge, same) for edge in expected["relations"]},
    }


def _normalize_edge(edge: Row, names: Mapping[str, str]) -> tuple[Any, ...]:
    if edge["type"] == "normal":
        return ("normal",)
    ends = (names[edge["from"]], names[edge["to"]])
    return (edge["type"], *(sorted(ends) if edge["type"] in _SYMMETRIC else ends))


def _get_counts(background: Row | None) -> tuple[int | None, int | None]:
    known = background or {}
    return known.get("vehicles"), known.get("pedestrians")


def does_time_fit(label: str | list[str] | None, time: str | list[str] | None) -> bool:
    """Whether a time of day or range lies in a label's; HH:MM or HH:MM-HH:MM, None is no time."""
    if isinstance(time, list):
        time = "-".join(time)
    if label is None or time is None:
        return label is time
    if isinstance(label, list):
        return any(does_time_fit(one, time) for one in label)
    if label == time or "-" not in label:
        return label == time
    start, length = _parse_range(label)
    first, ours = _parse_range(time)
    return (first - start) % _DAY + ours <= length


def _parse_range(text: str) -> tuple[int, int]:
    """Start [min of day] and length [min] of HH:MM or HH:MM-HH:MM."""
    ends = [int(part[:2]) * 60 + int(part[3:5]) for part in text.split("-")]
    return ends[0], (ends[-1] - ends[0]) % _DAY
