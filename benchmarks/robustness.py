"""ISR over every kind of relation: `python benchmarks/robustness.py [seeds]`.

Requests leave free what the relation does not need; two to four named agents and five to ten in the
background. ISR = verified scenes that are what the words say (`_request_labels.py`: events and
their roles, kind, cause, entries, movements, red-light runners) / requests, with a Wilson interval;
a refusal counts as a failure (SEMANTICS), and so does a scene that is verified but is not it.
Targets: how often PET, path TTC, speed and point of impact were as asked for, of all requests that
asked; a refusal counts as a failure here too.
"""

from __future__ import annotations

import math
import platform
import sys
import time
from collections import Counter, defaultdict
from collections.abc import Mapping

from _request_labels import LABELS, find_faults

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
    "near miss, pedestrian, TTC": "A car narrowly misses a pedestrian with a TTC of 1.2 seconds",
    "near miss, vehicle, TTC": "Two cars narrowly miss each other with a TTC of 1.0 seconds",
    "near miss, hard braking": "A car slams on the brakes and just misses a pedestrian",
    "strike, impact speed": "A car hits a pedestrian on the crosswalk at 6 m/s",
    "angle, impact speed": "A car T-bones another car at 8 m/s",
    "rear-end, impact speed": "A car rear-ends another car at 5 m/s",
    "angle, point of impact": "A car hits the side of a bus",
    "strike, point of impact": "A car hits a pedestrian with its front left corner",
    "yield, PET": "A car yields to a pedestrian with a PET of 2.0 seconds",
    "yield, vehicle to pedestrian": "A vehicle yields to a pedestrian",
    "yield, pedestrian to vehicle": "A pedestrian waits for a car and then crosses",
    "yield, left turn to oncoming": "A car turning left yields to an oncoming car",
    "yield, right turn": "A car turning right yields to a car on the cross street",
    "follow": "A car follows a bus",
    "normal": "Ordinary traffic, nothing happens",
    "chain, yield then rear-end": "A car yields to a pedestrian and is then rear-ended by a van",
    "chain, follow and yield": "A bus follows a car, and the car yields to a pedestrian",
    "two yields": "A car yields to two pedestrians",
    "near miss, head-on": "Two cars nearly collide head-on",
    "near miss, from its left": "A car nearly hits a car from its left",
    "collision, cross street": "A car collides with a car from the cross street",
    "red light, vehicle": "A truck from the east runs a red light and hits a car",
    "red light, left turn": "A car turning left runs the red light and hits an oncoming car",
    "red light, pedestrian": "A pedestrian walks on red and is hit by a northbound car",
    "red light, yield": "A pedestrian ignores the red light and a car yields",
    "red light, nobody hit": "A car runs a red light and nobody is hit",
    "chain, yield then strike": "A car from the west yields to a car from the south and then hits "
    "a pedestrian on the east crosswalk",
    "chain, yield then near miss": "A taxi from the east yields to a pedestrian on the east "
    "crosswalk, then nearly hits a pedestrian on the west crosswalk",
    "chain, follow a striker": "A truck follows a car from the south, and the car hits a "
    "pedestrian on the north crosswalk",
    "chain, rear-end of a yielder": "A car rear-ends a car that yields to a pedestrian on the "
    "north crosswalk",
    "chain, wait then strike": "A pedestrian waits for a car, and that car then hits a second "
    "pedestrian",
    "two near misses": "Two separate near misses: a car from the north with a pedestrian and a car "
    "from the west with another pedestrian",
    "three in a row": "Three cars in a row southbound, the last follows the middle one which "
    "follows the first",
}
DENSITY = " in medium traffic"


def compute_wilson(right: int, n: int) -> tuple[float, float]:
    """95 % interval of a share."""
    z, rate = 1.96, right / n
    centre, spread = (
        rate + z * z / (2 * n),
        z * math.sqrt(rate * (1 - rate) / n + z * z / (4 * n * n)),
    )
    return (centre - spread) / (1 + z * z / n), (centre + spread) / (1 + z * z / n)


def compute_miss(scene: Scene, figure: str) -> float:
    """How far the first relation's event is from the figure that it asks for."""
    asked, event = scene.record.relations[0], scene.proof.events[0]
    seen, whose = event.evidence, "from" if asked.from_ == event.from_ else "to"
    target, found = {
        "PET": (asked.target_pet, seen.get("pet")),
        "TTC": (asked.target_ttc, seen.get("path_ttc")),
        "speed": (asked.impact_speed, seen.get(f"speed_{whose}")),
        # A point has a name, so it is met or the scene is not verified.
        "point": (0.0, 0.0),
    }[figure]
    return math.inf if target is None or found is None else abs(target - found)


TOLERANCES = {"PET": (0.15, "s"), "TTC": (0.3, "s"), "speed": (1.0, "m/s"), "point": (0.0, "")}
"""Within what a figure asked for is met, as the checker's gate has it."""

ASKS = {
    "near miss, pedestrian": "PET",
    "near miss, vehicle": "PET",
    "yield, PET": "PET",
    "near miss, pedestrian, TTC": "TTC",
    "near miss, vehicle, TTC": "TTC",
    "strike, impact speed": "speed",
    "angle, impact speed": "speed",
    "rear-end, impact speed": "speed",
    "angle, point of impact": "point",
    "strike, point of impact": "point",
}
"""The requests above that ask for a figure, and for which."""


def report(missed: Mapping[str, list[float]], asked: Counter[str]) -> None:
    """One line per figure: how often it was met, of all requests that asked for it."""
    for name, (tolerance, unit) in TOLERANCES.items():
        met, n = sum(each <= tolerance + 1e-6 for each in missed[name]), asked[name]
        if not n:
            continue
        within = f" within {tolerance:g} {unit}" if unit else ""
        worst = f", worst {max(missed[name], default=math.nan):.2f} {unit}" if unit else ""
        low, high = compute_wilson(met, n)
        print(f"{name} asked for met{within}: {met} of {n} [{low:.3f}, {high:.3f}]{worst}")


def main() -> None:
    seeds = int(sys.argv[1]) if len(sys.argv) > 1 else 50
    start, verified, asked = time.perf_counter(), 0, 0
    missed: defaultdict[str, list[float]] = defaultdict(list)
    attempts: Counter[int] = Counter()
    figures: Counter[str] = Counter()
    for name, text in REQUESTS.items():
        right, wrong = 0, Counter[str]()
        figures[ASKS.get(name, "none")] += seeds
        for seed in range(seeds):
            try:
                scene = synthesize(text + DENSITY, seed=seed)
            except Unsatisfiable:
                continue
            wrong.update(find_faults(scene, LABELS[name]))
            right += not find_faults(scene, LABELS[name])
            if name in ASKS:
                missed[ASKS[name]].append(compute_miss(scene, ASKS[name]))
            attempts[len(scene.provenance["rejections"])] += 1
        verified, asked = verified + right, asked + seeds
        note = ", ".join(f"{fault} {count}x" for fault, count in wrong.items())
        note = f"  (not as labelled: {note})" if note else ""
        print(f"{right:4d} / {seeds}  {name}{note}", flush=True)
    low, high = compute_wilson(verified, asked)
    print(
        f"ISR {verified / asked:.4f} [{low:.4f}, {high:.4f}], n = {asked}, "
        f"{(time.perf_counter() - start) / asked:.3f} s a request, {platform.machine()}, "
        f"Python {platform.python_version()}"
    )
    print(f"first attempt {attempts[0]}, after one retry {attempts[1]}, most {max(attempts)}")
    report(missed, figures)


if __name__ == "__main__":
    main()
