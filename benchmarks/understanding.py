"""Section 5 on scenes made for it: `python benchmarks/understanding.py DIR [rows] [seed]`.

Makes rows of the paper's composition (per 190: 100 normal, 40 collisions, 50 yields; two named
agents, medium traffic, many wordings, kinds and hours) in DIR, those that are not there yet, and
scores every method without a language model on the test half, window by window. The report is
printed and lies beside DIR's scenes in the folder DIR.report. CPU seconds a scene are measured
apart, as wall time depends on what else the machine does.
"""

from __future__ import annotations

import random
import sys
import time
from pathlib import Path
from statistics import mean

from scenewright.errors import ScenewrightError
from scenewright.evals.understanding.dataset import Case
from scenewright.evals.understanding.evaluate import evaluate, load
from scenewright.evals.understanding.methods import method_named
from scenewright.evals.understanding.observing import observe
from scenewright.evals.understanding.report import markdown
from scenewright.evals.understanding.rules import ships_refiner
from scenewright.graph.atomic import write_atomically
from scenewright.graph.run import synthesize

COLLISIONS = (
    "A car going straight hits a pedestrian on the crosswalk",
    "A left-turning car hits a pedestrian on the crosswalk",
    "A right-turning truck hits a pedestrian on the crosswalk",
    "A car hits a jaywalker",
    "A car T-bones another car",
    "A car turning left collides with an oncoming car",
    "A car rear-ends another car",
    "Two cars collide head-on",
    "A car sideswipes another car",
    "A truck from the east runs a red light and hits a car",
    "A pedestrian walks on red and is hit by a northbound car",
    "A car collides with a car from the cross street",
    "A bus hits a pedestrian",
    "A vehicle collides with a pedestrian",
    "Two vehicles collide",
    "A car collides with a bus",
    "A right-turning car collides with a car from the cross street",
)
YIELDS = (
    "A vehicle yields to a pedestrian",
    "A pedestrian waits for a car and then crosses",
    "A car turning left yields to an oncoming car",
    "A car turning right yields to a car on the cross street",
    "A right-turning car yields to a pedestrian on the crosswalk",
    "A left-turning car yields to a pedestrian on the crosswalk",
    "A truck yields to a pedestrian",
    "A car yields to a jaywalker",
    "A bus yields to a pedestrian",
    "A pedestrian yields to a right-turning car",
    "A car going straight yields to a car from the cross street",
    "A vehicle gives way to another vehicle",
    "A pedestrian yields to a left-turning car",
    "A car yields to a car",
)
NORMAL = (
    "Ordinary traffic, nothing happens",
    "Normal traffic",
    "A normal scene",
    "Ordinary traffic with two cars",
    "Normal traffic with a pedestrian and a car",
)
HOURS = ("at 8 am", "at noon", "at 5 pm", "at 10 pm", "at 6:30 am", "at 3 pm",
         "in the evening rush", "")  # fmt: skip
WINDOWS = (0.5, 1.0, 2.0, 3.0, 4.0, 5.0)


def rows(count: int, seed: int) -> list[tuple[str, str, int]]:
    """(id, text, seed) of every scene; ids tell nothing of what is in them."""
    rng = random.Random(seed)
    found = []
    for n in range(count):
        at = n % 190
        texts = NORMAL if at < 100 else COLLISIONS if at < 140 else YIELDS
        text = f"{rng.choice(texts)} in medium traffic {rng.choice(HOURS)}".strip()
        found.append((f"s{seed}{n:05d}", text, n))
    return found


def make(folder: Path, count: int, seed: int) -> int:
    """Makes what is missing; how many were refused."""
    refused = 0
    for name, text, number in rows(count, seed):
        if (folder / name / "scene.json").is_file():
            continue
        try:
            synthesize(text, seed=number, refiner="none").save(folder / name)
        except ScenewrightError:
            refused += 1
    return refused


def cpu_seconds(cases: list[Case], name: str, *, window: float = 4.0) -> float:
    """CPU seconds a scene."""
    method = method_named(name, intersection=cases[0].record.meta.intersection)
    taken = []
    for case in cases[:200]:
        seen = observe(case.record, scene=case.id, window=window)
        before = time.process_time()
        method.predict(seen, case)
        taken.append(time.process_time() - before)
    return mean(taken[1:])


def main() -> None:
    """Makes, scores, reports."""
    folder = Path(sys.argv[1])
    count = int(sys.argv[2]) if len(sys.argv) > 2 else 1140
    seed = int(sys.argv[3]) if len(sys.argv) > 3 else 2
    refused = make(folder, count, seed)
    cases = load(folder, split="test")
    place = cases[0].record.meta.intersection
    checked = ["trajnet"] if ships_refiner(place) else []
    names = ["gmm", "gmm_waypoints", "constant_velocity", *checked, "reasoner", "oracle",
             "oracle_seen"]  # fmt: skip
    found = []
    for name in names:
        before = time.perf_counter()
        found.append(evaluate(cases, name, windows=WINDOWS))
        print(f"{name}: {time.perf_counter() - before:.0f} s", file=sys.stderr, flush=True)
    text = markdown(found, scenes=len(cases), split="test", where=place)
    text += f"\n{refused} rows refused. CPU seconds a scene at 4 s: " + ", ".join(
        f"{name} {cpu_seconds(cases, name):.4f}" for name in names
    )
    report = folder.with_name(folder.name + ".report")
    report.mkdir(exist_ok=True)
    write_atomically(report / "report.md", (text + "\n").encode())
    print(text)


if __name__ == "__main__":
    main()
