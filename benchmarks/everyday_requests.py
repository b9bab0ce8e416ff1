"""How many requests of everyday validation work are made as said, by item.

`python benchmarks/everyday_requests.py --seeds 2` makes each row of everyday_requests.jsonl from so
many seeds. The rows were written together with the code, so they are no unseen test. A row is
satisfied where the scene is verified and shows exactly the events that the row names.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections import Counter
from math import sqrt
from pathlib import Path

from scenewright import synthesize
from scenewright.errors import ScenewrightError

ROWS = Path(__file__).with_name("everyday_requests.jsonl")


def judge(text: str, wanted: list[str], seed: int) -> tuple[str, str]:
    """`satisfied`, `other` or `refused`, and why."""
    try:
        scene = synthesize(text, seed=seed, refiner="none", time_limit=60)
    except ScenewrightError as error:
        return "refused", str(error)
    seen = sorted(event.type for event in scene.proof.events)
    same = scene.proof.verified and seen == sorted(wanted)
    return ("satisfied", "") if same else ("other", f"seen {seen}, asked for {wanted}")


def compute_interval(hits: int, n: int) -> tuple[float, float]:
    """Wilson's, at 95 %."""
    z, p = 1.96, hits / n
    middle, half = p + z * z / (2 * n), z * sqrt(p * (1 - p) / n + z * z / (4 * n * n))
    return (middle - half) / (1 + z * z / n), (middle + half) / (1 + z * z / n)


def main() -> None:
    """Print a table; what was not satisfied goes to stderr."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=3)
    seeds = range(parser.parse_args().seeds)
    rows = [json.loads(line) for line in ROWS.read_text("utf-8").splitlines()]
    found: dict[str, Counter[str]] = {}
    for row in rows:
        for seed in seeds:
            outcome, why = judge(row["text"], row["events"], seed)
            found.setdefault(row["item"], Counter())[outcome] += 1
            if why:
                print(row["item"], seed, outcome, row["text"], why, sep=" | ", file=sys.stderr)
    print("| item | rows | satisfied | refused | other |\n|---|---|---|---|---|")
    for item, counts in found.items():
        n, hits = counts.total(), counts["satisfied"]
        low, high = compute_interval(hits, n)
        texts = sum(row["item"] == item for row in rows)
        share = f"{hits} of {n} ({100 * low:.0f} to {100 * high:.0f} %)"
        print(f"| {item} | {texts} | {share} | {counts['refused']} | {counts['other']} |")


if __name__ == "__main__":
    main()
