"""How many requests of everyday validation work are made as said, by item.

`python benchmarks/everyday_requests.py --seeds 2` makes each row of everyday_requests.jsonl from so
many seeds. The rows were written together with the code, so they are no unseen test. A row is
satisfied where the scene is verified and shows exactly the events that the row names, those with
members of one group counted once. With `--keep FILE` each outcome is a line of that file, and what
it holds already is not made again.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections import Counter
from itertools import product
from math import sqrt
from pathlib import Path
from typing import Any

from scenewright import synthesize
from scenewright.errors import ScenewrightError

ROWS = Path(__file__).with_name("everyday_requests.jsonl")


def judge(text: str, wanted: list[str], seed: int) -> tuple[str, str]:
    """`satisfied`, `other` or `refused`, and why."""
    try:
        scene = synthesize(text, seed=seed, refiner="none", time_limit=60)
    except ScenewrightError as error:
        return "refused", str(error)
    seen = list_events(scene)
    same = scene.proof.verified and seen == sorted(wanted)
    return ("satisfied", "") if same else ("other", f"seen {seen}, asked for {wanted}")


def list_events(scene: Any) -> list[str]:
    """The types of the events, sorted; one with several of a group counts once (SEMANTICS 8)."""
    parties = {agent.id: agent.group or agent.id for agent in scene.record.agents}
    events = scene.proof.events
    return sorted(each for each, *_ in {(e.type, parties[e.from_], parties[e.to]) for e in events})


def compute_interval(hits: int, n: int) -> tuple[float, float]:
    """Wilson's, at 95 %."""
    z, p = 1.96, hits / n
    middle, half = p + z * z / (2 * n), z * sqrt(p * (1 - p) / n + z * z / (4 * n * n))
    return (middle - half) / (1 + z * z / n), (middle + half) / (1 + z * z / n)


def judge_rows(rows: list[dict[str, Any]], seeds: range, kept: Path | None) -> list[dict[str, Any]]:
    """One outcome of each row and seed; those in the file of earlier ones are taken from there."""
    lines = kept.read_text("utf-8").splitlines() if kept and kept.exists() else []
    found = {(each["text"], each["seed"]): each for each in map(json.loads, lines)}
    for seed, row in product(seeds, rows):
        key = row["text"], seed
        if key not in found:
            outcome, why = judge(row["text"], row["events"], seed)
            found[key] = {**row, "seed": seed, "outcome": outcome, "why": why}
            if kept is not None:
                with kept.open("a", encoding="utf-8") as file:
                    file.write(json.dumps(found[key], ensure_ascii=False) + "\n")
    return [found[row["text"], seed] for row, seed in product(rows, seeds)]


def main() -> None:
    """Print a table; what was not satisfied goes to stderr."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--keep", type=Path)
    given = parser.parse_args()
    rows = [json.loads(line) for line in ROWS.read_text("utf-8").splitlines()]
    found: dict[str, Counter[str]] = {}
    for each in judge_rows(rows, range(given.seeds), given.keep):
        found.setdefault(each["item"], Counter())[each["outcome"]] += 1
        if each["why"]:
            said = (each[key] for key in ("item", "seed", "outcome", "text", "why"))
            print(*said, sep=" | ", file=sys.stderr)
    print("| item | rows | satisfied | refused | other |\n|---|---|---|---|---|")
    for item, counts in found.items():
        n, hits = counts.total(), counts["satisfied"]
        low, high = compute_interval(hits, n)
        texts = sum(row["item"] == item for row in rows)
        share = f"{hits} of {n} ({100 * low:.0f} to {100 * high:.0f} %)"
        print(f"| {item} | {texts} | {share} | {counts['refused']} | {counts['other']} |")


if __name__ == "__main__":
    main()
