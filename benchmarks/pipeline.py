"""From text to scene.json and proof.json, warm: `python benchmarks/pipeline.py [none | trajnet]`.

Seven requests with eight seeds each, ten agents: two in the foreground, five background vehicles,
three background pedestrians; a text is read once for all its seeds. Then the forty examples, one
seed each, so that every text is new. No recording, no picture; without a refiner unless one is
named. Prints the median and where the time goes. Processor time is that of this process alone,
whatever else runs.
"""

from __future__ import annotations

import gc
import platform
import statistics
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from scenewright.errors import Unsatisfiable
from scenewright.graph.run import synthesize

CROWD = "with five background cars and three other pedestrians"
REQUESTS = (
    "A vehicle yields to a pedestrian",
    "A car turning left yields to an oncoming car",
    "A car hits a pedestrian on the north crosswalk",
    "Two cars collide at a right angle",
    "A van rear-ends a car waiting at the light",
    "A car narrowly misses a pedestrian",
    "A car follows a bus through the intersection",
)
SEEDS = range(8)
EXAMPLES = Path(__file__).parents[1] / "examples" / "instructions.txt"


def commit() -> str:
    done = subprocess.run(
        ["git", "rev-parse", "--short", "HEAD"], capture_output=True, text=True, check=False
    )
    return done.stdout.strip() or "unknown"


def main() -> None:
    refiner = sys.argv[1] if len(sys.argv) > 1 else "none"
    with tempfile.TemporaryDirectory() as folder:
        for request in REQUESTS:  # the first run of these sources compiles their loops, too
            scene = synthesize(f"{request} {CROWD}", seed=99, refiner=refiner)
            scene.save(Path(folder) / "warm")
        gc.freeze()  # as the workers of a batch do after their first row
        print(f"Seven requests, {len(SEEDS)} seeds each")
        named = {request: f"{request} {CROWD}" for request in REQUESTS}
        measure([(name, text, seed) for name, text in named.items() for seed in SEEDS],
                refiner, Path(folder) / "seven")  # fmt: skip
        print("\nThe forty examples, no text twice")
        every = ("any example", *EXAMPLES.read_text("utf-8").splitlines())
        measure([(every[0], text, 0) for text in every[1:] if text.strip()],
                refiner, Path(folder) / "forty")  # fmt: skip


def measure(asked: Sequence[tuple[str, str, int]], refiner: str, folder: Path) -> None:
    """Makes and saves every scene asked for, as (name, text, seed), and prints how long it took."""
    wall: dict[str, list[float]] = {}
    stages: Counter[str] = Counter()
    attempts = failed = 0
    began = time.process_time()
    for number, (name, text, seed) in enumerate(asked):
        start = time.perf_counter()
        try:
            scene = synthesize(text, seed=seed, refiner=refiner)
        except Unsatisfiable:
            failed += 1
            continue
        scene.save(folder / str(number))
        wall.setdefault(name, []).append(time.perf_counter() - start)
        stages.update(scene.provenance["seconds"])
        attempts += 1 + len(scene.provenance["rejections"])
    busy = (time.process_time() - began) / max(sum(map(len, wall.values())), 1)
    print(
        f"refiner {refiner}: {busy:.3f} s of processor time a scene, {1 / busy:.1f} scenes a second"
    )
    report(wall, stages, attempts, failed)


def report(wall: dict[str, list[float]], stages: Counter[str], attempts: int, failed: int) -> None:
    every = sorted(seconds for each in wall.values() for seconds in each)
    n = len(every)
    print(
        f"{platform.processor() or platform.machine()}, Python {platform.python_version()}, "
        f"commit {commit()}, n = {n}, not satisfied: {failed}"
    )
    print(f"{n / sum(every):.1f} verified scenes a second on one core")
    print(
        f"median {statistics.median(every):.3f} s, mean {statistics.fmean(every):.3f} s, "
        f"p90 {every[int(0.9 * n)]:.3f} s, attempts per scene {attempts / n:.2f}"
    )
    for stage, seconds in stages.most_common():
        print(f"  {1000 * seconds / n:7.1f} ms  {stage}")
    for request, each in wall.items():
        print(f"  {1000 * statistics.median(each):7.1f} ms  {request}")


if __name__ == "__main__":
    main()
