"""ISR over every kind of relation: `python benchmarks/robustness.py [seeds]`.

Requests leave free what the relation does not need; two to four named agents and five to ten in
the background. ISR = verified scenes / requests (SEMANTICS: a refusal counts as a failure), with
a Wilson interval. Targets: how far the time gap asked for was met.
"""

from __future__ import annotations

import math
import platform
import sys
import time
from collections import Counter

from scenewright.errors import Unsatisfiable
from scenewright.graph.run import Scene, synthesize

REQUESTS = {
    "strike, through": "A car going straight hits a pedestrian on the crosswalk",
    "strike, left turn": "A left-turning car hits a pedestrian on the crosswalk",
    "strike, right turn": "A right-turning truck hits a pedestrian on the crosswalk",
    "strike, jaywalker": "A car hits a jaywalker",
    "angle": "A car T-bones another car",
    "left turn": "A car turning left collides with an oncoming car",
    "rear-end": "A car rear-ends another car",
    "head-on": "Two cars collide head-on",
    "sideswipe": "A car sideswipes another car",
    "near miss, pedestrian": "A car narrowly misses a pedestrian with a PET of 1.0 seconds",
    "near miss, vehicle": "Two cars narrowly miss each other with a PET of 1.2 seconds",
    "yield, vehicle to pedestrian": "A vehicle yields to a pedestrian",
    "yield, pedestrian to vehicle": "A pedestrian waits for a car and then crosses",
    "yield, left turn to oncoming": "A car turning left yields to an oncoming car",
    "yield, right turn": "A car turning right yields to a car on the cross street",
    "follow": "A car follows a bus",
    "normal": "Ordinary traffic, nothing happens",
    "chain, yield then rear-end": "A car yields to a pedestrian and is then rear-ended by a van",
    "chain, follow and yield": "A bus follows a car, and the car yields to a pedestrian",
    "two yields": "A car yields to two pedestrians",
}
DENSITY = " in medium traffic"


def wilson(right: int, n: int) -> tuple[float, float]:
    """95 % interval of a share."""
    z, rate = 1.96, right / n
    centre, spread = (
        rate + z * z / (2 * n),
        z * math.sqrt(rate * (1 - rate) / n + z * z / (4 * n * n)),
    )
    return (centre - spread) / (1 + z * z / n), (centre + spread) / (1 + z * z / n)


def missed_by(scene: Scene) -> list[float]:
    """|PET observed - PET asked for| of every relation with a target [s]."""
    wanted = [each.target_pet for each in scene.record.relations if each.target_pet is not None]
    seen = [each.evidence["pet"] for each in scene.proof.events if each.evidence.get("pet")]
    return [abs(a - b) for a, b in zip(wanted, seen, strict=False)]


def main() -> None:
    seeds = int(sys.argv[1]) if len(sys.argv) > 1 else 50
    start, verified, asked, off = time.perf_counter(), 0, 0, []
    attempts: Counter[int] = Counter()
    for name, text in REQUESTS.items():
        right = 0
        for seed in range(seeds):
            try:
                scene = synthesize(text + DENSITY, seed=seed)
            except Unsatisfiable:
                continue
            right += 1
            off += missed_by(scene)
            attempts[len(scene.provenance["rejections"])] += 1
        verified, asked = verified + right, asked + seeds
        print(f"{right:4d} / {seeds}  {name}", flush=True)
    low, high = wilson(verified, asked)
    print(
        f"ISR {verified / asked:.4f} [{low:.4f}, {high:.4f}], n = {asked}, "
        f"{(time.perf_counter() - start) / asked:.3f} s a request, {platform.machine()}, "
        f"Python {platform.python_version()}"
    )
    print(f"first attempt {attempts[0]}, after one retry {attempts[1]}, most {max(attempts)}")
    if off:
        met = sum(each <= 0.15 for each in off)
        print(f"PET asked for met within 0.15 s: {met} of {len(off)}, worst {max(off):.2f} s")


if __name__ == "__main__":
    main()
