"""How well the builtin planner reads labelled instructions, how fast, and the same in threads.

    python benchmarks/planner.py [FILE.jsonl ...] [--show N]

Rows are {"id", "text", "previous"?, "expected"}; without files, evals/planning/voices.jsonl,
written after the weights were frozen. A refused row counts as right after one answer if one of the
sentences that the refusal offers means what the label says.
"""

from __future__ import annotations

import argparse
import json
import random
import string
import threading
import time
from collections import Counter
from importlib.resources import files
from pathlib import Path
from typing import Any

from scenewright.backends.builtin import planner
from scenewright.backends.builtin.draft import Site
from scenewright.evals.planning import Share, compare
from scenewright.scene.plan_row import plan_to_row
from scenewright.scene.social import Refusal

Row = dict[str, Any]


def load(path: Path) -> list[Row]:
    return [json.loads(line) for line in path.read_text("utf-8").splitlines() if line.strip()]


def is_right(expected: Row, plan: Any) -> bool:
    return all(compare(expected, plan_to_row("", plan)).values())


def verdict_of(row: Row) -> str:
    """What became of a row: right, right after one answer, refused, planned or misread."""
    plan = planner._plan(row["text"], row.get("previous"), Site())
    if is_right(row["expected"], plan):
        return "right"
    if isinstance(plan, Refusal) and not row["expected"]["refused"]:
        offers = (planner._plan(each, None, Site()) for each in plan.did_you_mean)
        if any(is_right(row["expected"], each) for each in offers):
            return "right after one answer"
        return "refused without a right offer"
    return "planned what should be refused" if row["expected"]["refused"] else "misread"


def report(name: str, rows: list[Row], show: int) -> None:
    before = time.perf_counter()
    verdicts = [verdict_of(row) for row in rows]
    spent = (time.perf_counter() - before) / len(rows)
    counts = Counter(verdicts)
    print(f"{name}: {len(rows)} rows, {1000 * spent:.0f} ms each with the sentences offered")
    asked = counts["right"] + counts["right after one answer"]
    for label, number in (
        *counts.most_common(),
        ("right at first sight or after one answer", asked),
    ):
        share = Share(number, len(rows))
        low, high = share.interval or (0.0, 1.0)
        rate = f"{100 * number / len(rows):.1f} %, {100 * low:.1f}-{100 * high:.1f}"
        print(f"  {label}: {number} ({rate})")
    for row, verdict in zip(rows, verdicts, strict=True):
        if verdict != "right" and show > 0:
            show -= 1
            print(f"  [{verdict}] {row['text']}")


def time_and_thread(rows: list[Row], *, threads: int = 8) -> None:
    """Milliseconds an instruction in one thread, and whether many threads read the same."""
    texts = [row["text"] for row in rows]
    before = time.perf_counter()
    alone = [planner._plan(text, None, Site()) for text in texts]
    print(f"{1000 * (time.perf_counter() - before) / len(texts):.1f} ms an instruction, one thread")
    differing: list[int] = []

    def work() -> None:
        found = [planner._plan(text, None, Site()) for text in texts]
        differing.append(sum(a != b for a, b in zip(alone, found, strict=True)))

    running = [threading.Thread(target=work) for _ in range(threads)]
    for each in running:
        each.start()
    for each in running:
        each.join()
    print(f"{threads} threads x {len(texts)} texts: {sum(differing)} plans differ")


def fuzz(rows: list[Row], number: int) -> None:
    """Texts cut, shuffled and mangled: none may raise, none may take a second."""
    rng, slowest = random.Random(0), 0.0
    alphabet = string.printable + "äß→🚗行人"
    for _ in range(number):
        words = rng.choice(rows)["text"].split() + rng.choice(rows)["text"].split()
        text = " ".join(rng.sample(words, rng.randint(1, min(len(words), 60))))
        letters = list(text)
        for _ in range(rng.randint(0, 8)):
            letters.insert(rng.randrange(len(letters) + 1), rng.choice(alphabet))
        before = time.perf_counter()
        planner._plan("".join(letters), None, Site())
        slowest = max(slowest, time.perf_counter() - before)
    print(f"{number} mangled texts: no exception, the slowest {slowest:.2f} s")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("files", nargs="*", type=Path)
    parser.add_argument("--show", type=int, default=0, help="failures to print for each file")
    parser.add_argument("--fuzz", type=int, default=0, help="mangled texts to try")
    parser.add_argument("--threads", type=int, default=0, help="threads to compare with one")
    given = parser.parse_args()
    voices = Path(str(files("scenewright.evals.planning"))) / "voices.jsonl"
    for path in given.files or [voices]:
        rows = load(path)
        report(path.name, rows, given.show)
    if given.threads:
        time_and_thread(rows, threads=given.threads)
    if given.fuzz:
        fuzz(rows, given.fuzz)


if __name__ == "__main__":
    main()
