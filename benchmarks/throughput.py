"""Verified scenes a second on one core, warm, beside an earlier commit.

    python benchmarks/throughput.py COMMIT [--seeds 6] [--refiner none]

Four texts, many seeds each, at ten agents and at 8 am with all that p_tod counts there; then the
forty examples, no text twice. Both commits take turns, seed by seed. Processor time of the process
alone; scenes are written, without picture and recording.
"""

from __future__ import annotations

import argparse
import gc
import json
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

from _earlier import ROOT, check_out

TEXTS = (
    "A car hits a pedestrian",
    "A vehicle yields to a pedestrian",
    "A car narrowly misses a pedestrian",
    "Two cars collide at a right angle",
)
CASES = {
    "ten agents": " with five background cars and three other pedestrians",
    "8 am": " at 8 am",
}
EXAMPLES = ROOT / "examples" / "instructions.txt"


def list_texts(case: str) -> list[str]:
    if case in CASES:
        return [text + CASES[case] for text in TEXTS]
    lines = EXAMPLES.read_text("utf-8").splitlines()
    return [line for line in lines if line and not line.startswith("#")]


def run_here(case: str, seed: int, refiner: str) -> None:
    """Make the scenes of a case in this process and print what they took, as JSON."""
    from scenewright.errors import Unsatisfiable
    from scenewright.graph.run import synthesize

    found: Counter[str] = Counter()
    with tempfile.TemporaryDirectory() as folder:
        for text in TEXTS:  # loads all that the first scene of a process must load
            synthesize(text + CASES["8 am"], seed=99, refiner=refiner).save(Path(folder) / "warm")
        gc.freeze()  # as the workers of a batch do after their first row
        gc.set_threshold(100_000, 50, 50)
        for number, text in enumerate(list_texts(case)):
            begin = time.process_time()
            try:
                scene = synthesize(text, seed=seed, refiner=refiner)
                scene.save(Path(folder) / str(number))
            except Unsatisfiable:
                found["refused"] += 1
                continue
            found["seconds"] += time.process_time() - begin  # type: ignore[assignment]
            found["scenes"] += 1
            found["agents"] += len(scene.record.agents)
            found["attempts"] += 1 + len(scene.provenance["rejections"])
            found.update(scene.provenance["seconds"])
    print(json.dumps(found))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("commit")
    parser.add_argument("--seeds", type=int, default=6)
    parser.add_argument("--refiner", default="none")
    parser.add_argument("--case", help="Make one case here and print JSON; for this script alone.")
    asked = parser.parse_args()
    if asked.case:
        run_here(asked.case, asked.seeds, asked.refiner)
        return
    with check_out(asked.commit) as environments:
        for case in (*CASES, "examples"):
            sums: dict[str, Counter[str]] = {each: Counter() for each in environments}
            for seed in range(asked.seeds if case in CASES else 1):
                for each, environment in environments.items():
                    words = [asked.commit, "--case", case, "--seeds", str(seed)]
                    command = [sys.executable, __file__, *words, "--refiner", asked.refiner]
                    done = subprocess.run(
                        command, env=environment, capture_output=True, text=True, check=True
                    )
                    sums[each].update(json.loads(done.stdout))
            report(case, sums)


def report(case: str, sums: dict[str, Counter[str]]) -> None:
    rates = []
    for name, found in sums.items():
        n = found.pop("scenes")
        rates.append(n / found.pop("seconds"))
        facts = [f"{found.pop(each) / n:.1f} {each}" for each in ("agents", "attempts")]
        refused = found.pop("refused", 0)
        stages = ", ".join(f"{stage} {1e3 * s / n:.0f} ms" for stage, s in found.most_common(5))
        print(
            f"{case}, {name}: {rates[-1]:.1f} scenes/s, n = {n}, {refused} refused; a scene has "
            f"{', '.join(facts)}; {stages}"
        )
    print(f"{case}: {rates[1] / rates[0]:.2f} times as many")


if __name__ == "__main__":
    main()
