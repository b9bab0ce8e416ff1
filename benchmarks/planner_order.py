"""Whether the builtin planner keeps the order in which an instruction lets road users pass.

    python benchmarks/planner_order.py [--show]

Rows of evals/planning/order.jsonl are {"id", "text", "first", "second"}: the agent that passes
first and the second, by class, subtype, entry, movement or crosswalk. `kept`: a yield, a follow, a
collision in one lane or `first` of another relation fixes that order in the plan; `inverted`: the
other one; `left open`: neither, and no words are said to be left out. Where words are left out,
`make` refuses the instruction.
"""

from __future__ import annotations

import argparse
import json
from collections import Counter
from importlib.resources import files
from itertools import permutations
from typing import Any

import scenewright
from scenewright.backends.builtin.reader.words import COARSE
from scenewright.evals.bootstrap import Figure

Row = dict[str, Any]


def count_fits(agent: Row, told: Row) -> int:
    """Count the labelled fields that an agent has; -9 where its class or subtype is another."""
    kinds = {key: agent[key] for key in ("type", "subtype")}
    kinds["subtype"] = COARSE.get(agent["subtype"] or "", agent["subtype"])
    if any(kind != told[key] for key, kind in kinds.items() if key in told):
        return -9
    return sum((agent | kinds)[key] == value for key, value in told.items())


def find_pair(plan: Row, row: Row) -> tuple[Row, Row] | None:
    """Find the agents that fit the first and second to pass best; None where none fit."""
    pairs = [
        (count_fits(one, row["first"]) + count_fits(two, row["second"]), one, two)
        for one, two in permutations(plan["agents"], 2)
    ]
    best = max(pairs, key=lambda each: each[0], default=None)
    return None if best is None or best[0] < 0 else best[1:]


def find_first(relation: Row, one: Row, two: Row) -> str | None:
    """Find the agent that passes first by the relation; None where that is left open."""
    in_one_lane = one["entry"] is not None and one["entry"] == two["entry"]
    if {relation["from"], relation["to"]} != {one["id"], two["id"]}:
        return None
    kind = relation["type"]
    ordered = kind in ("yielding", "follow") or (kind == "collision" and in_one_lane)
    return relation.get("first") or (relation["to"] if ordered else None)


def judge_row(row: Row) -> str:
    """What became of the order."""
    plan = scenewright.plan(row["text"])
    if plan["refused"]:
        return "asked back or refused"
    left_out = ", words left out" if plan["unrealised"] else ""
    pair = find_pair(plan, row)
    for relation in plan["relations"]:
        first = find_first(relation, *pair) if pair else None
        if pair and first is not None:
            return ("kept" if first == pair[0]["id"] else "inverted") + left_out
    return f"left open{left_out}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--show", action="store_true", help="print the rows that are not kept")
    given = parser.parse_args()
    source = files("scenewright.evals.planning").joinpath("order.jsonl").read_text("utf-8")
    rows = [json.loads(line) for line in source.splitlines()]
    verdicts = [judge_row(row) for row in rows]
    for label, number in Counter(verdicts).most_common():
        print(f"{label}: {number} of {len(rows)} ({Figure.of_count(number, len(rows)):.1%})")
    for row, verdict in zip(rows, verdicts, strict=True):
        if given.show and verdict != "kept":
            print(f"  [{verdict}] {row['text']}")


if __name__ == "__main__":
    main()
