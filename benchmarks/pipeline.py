"""From text to scene.json and proof.json, warm: `python benchmarks/pipeline.py [none | trajnet]`.

Ten agents: two in the foreground, five background vehicles, three background pedestrians. No
recording, no picture; without a refiner unless one is named. Prints the median and where the time
goes. Processor time is that of this process alone, whatever else runs.
"""

from __future__ import annotations

import platform
import statistics
import subprocess
import sys
import tempfile
import time
from collections import Counter
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


def commit() -> str:
    done = subprocess.run(
        ["git", "rev-parse", "--short", "HEAD"], capture_output=True, text=True, check=False
    )
    return done.stdout.strip() or "unknown"


def main() -> None:
    wall: dict[str, list[float]] = {}
    refiner = sys.argv[1] if len(sys.argv) > 1 else "none"
    stages: Counter[str] = Counter()
    attempts = failed = 0
    with tempfile.TemporaryDirectory() as folder:
        synthesize(f"{REQUESTS[0]} {CROWD}", seed=99, refiner=refiner).save(Path(folder) / "warm")
        began = time.process_time()
        for number, request in enumerate(REQUESTS):
            for seed in SEEDS:
                start = time.perf_counter()
                try:
                    scene = synthesize(f"{request} {CROWD}", seed=seed, refiner=refiner)
                except Unsatisfiable:
                    failed += 1
                    continue
                scene.save(Path(folder) / f"{number}-{seed}")
                wall.setdefault(request, []).append(time.perf_counter() - start)
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
