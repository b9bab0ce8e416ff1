"""How well the builtin planner reads labelled instructions, how fast, and the same in threads.

    python benchmarks/planner.py [FILE.jsonl ...] [--show N]
    python benchmarks/planner.py --threads 8 --texts 2000 --fuzz 20000

Rows are {"id", "text", "previous"?, "expected"}; without files, evals/planning/voices.jsonl,
written after the weights were frozen. A refused row counts as right after one answer if one of the
sentences that the refusal offers means what the label says.
"""

from __future__ import annotations

import argparse
import json
import random
import string
import time
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from importlib.resources import files
from itertools import cycle
from pathlib import Path
from typing import Any

from _planning_score import compare

from scenewright.backends.builtin import planner
from scenewright.backends.builtin.draft import Site
from scenewright.evals.bootstrap import Figure
from scenewright.scene.plan_row import plan_to_row
from scenewright.scene.social import Refusal

Row = dict[str, Any]


def load(path: Path) -> list[Row]:
    return [json.loads(line) for line in path.read_text("utf-8").splitlines() if line.strip()]


def is_right(expected: Row, plan: Any) -> bool:
    return all(compare(expected, plan_to_row("", plan)).values())


def judge_row(row: Row) -> str:
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


def print_report(name: str, rows: list[Row], show: int) -> None:
    before = time.perf_counter()
    verdicts = [judge_row(row) for row in rows]
    spent = (time.perf_counter() - before) / len(rows)
    counts = Counter(verdicts)
    print(f"{name}: {len(rows)} rows, {1000 * spent:.0f} ms each with the sentences offered")
    asked = counts["right"] + counts["right after one answer"]
    for label, number in (
        *counts.most_common(),
        ("right at first sight or after one answer", asked),
    ):
        print(f"  {label}: {number} ({Figure.of_count(number, len(rows)):.1%})")
    for row, verdict in zip(rows, verdicts, strict=True):
        if verdict != "right" and show > 0:
            show -= 1
            print(f"  [{verdict}] {row['text']}")


def compare_threads(rows: list[Row], *, threads: int, number: int) -> None:
    """Milliseconds an instruction in one thread, and whether many threads plan the same bytes."""
    texts = [row["text"] for row, _ in zip(cycle(rows), range(number), strict=False)]
    before = time.perf_counter()
    alone = [plan_as_json(text) for text in texts]
    print(f"{1000 * (time.perf_counter() - before) / number:.1f} ms an instruction, one thread")
    with ThreadPoolExecutor(threads) as pool:
        found = list(pool.map(lambda _: [plan_as_json(text) for text in texts], range(threads)))
    differing = sum(a != b for each in found for a, b in zip(alone, each, strict=True))
    print(f"{threads} threads x {number} texts: {differing} plans differ")


def plan_as_json(text: str) -> str:
    """The plan of a text without what was kept of earlier ones."""
    return planner._plan(text, None, Site()).model_dump_json(by_alias=True)


def test_mangled(rows: list[Row], number: int) -> None:
    """Mangled texts: counts exceptions, prints the first of them and the slowest text."""
    rng, slowest, failed = random.Random(0), (0.0, ""), list[tuple[str, str]]()
    texts = [row["text"] for row in rows]
    for _ in range(number):
        text = mangle(rng, rng.choice(texts), rng.choice(texts))
        before = time.perf_counter()
        try:
            planner._plan(text, None, Site())
        except Exception as error:  # every kind is a fault here, and is counted
            failed.append((repr(error), text))
        slowest = max(slowest, (time.perf_counter() - before, text))
    print(f"{number} mangled texts: {len(failed)} exceptions, the slowest {slowest[0]:.2f} s")
    print(f"  slowest: {slowest[1]!r}")
    for fault, text in failed[:10]:
        print(f"  {fault}: {text!r}")


def mangle(rng: random.Random, text: str, other: str) -> str:
    """A text spliced with another, or its words or characters dropped, swapped or doubled."""
    if rng.random() < 0.3:
        text = text[: rng.randrange(len(text) + 1)] + other[rng.randrange(len(other) + 1) :]
    words = text.split()
    for _ in range(rng.randint(0, 4)):
        _mangle_once(rng, words, rng.choice(other.split() or [""]))
    letters = list(" ".join(words))
    for _ in range(rng.randint(0, 6)):
        _mangle_once(rng, letters, rng.choice(_NOISE))
    return "".join(letters)


_NOISE = string.printable + "äßéİıﬁ→–’“”🚗行人\u0301\u200b\u200d\u202e\u2028\ufeff\ud800\x00"


def _mangle_once(rng: random.Random, parts: list[str], noise: str) -> None:
    """Drops, swaps, doubles or inserts one part, in place."""
    how, at = rng.choice(("drop", "swap", "double", "insert")), rng.randrange(len(parts) + 1)
    if how == "insert" or at == len(parts):
        parts.insert(at, noise)
    elif how == "drop":
        del parts[at]
    elif how == "double":
        parts.insert(at, parts[at])
    else:
        other = rng.randrange(len(parts))
        parts[at], parts[other] = parts[other], parts[at]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("files", nargs="*", type=Path)
    parser.add_argument("--show", type=int, default=0, help="failures to print for each file")
    parser.add_argument("--fuzz", type=int, default=0, help="mangled texts to try")
    parser.add_argument("--threads", type=int, default=0, help="threads to compare with one")
    parser.add_argument("--texts", type=int, help="of each thread; if not said, each row once")
    given = parser.parse_args()
    voices = Path(str(files("scenewright.evals.planning"))) / "voices.jsonl"
    for path in given.files or [voices]:
        rows = load(path)
        print_report(path.name, rows, given.show)
    if given.threads:
        compare_threads(rows, threads=given.threads, number=given.texts or len(rows))
    if given.fuzz:
        test_mangled(rows, given.fuzz)


if __name__ == "__main__":
    main()
