"""Instruction success rate at intersections of one's own: varied requests that the map can serve.

    python benchmarks/own_intersections.py NAME... [--requests 200] [--show]

Half of the requests name no directions. The other half name legs and turns; they are drawn from
what the map says two road users can do to one another, so that each is in scope. A refusal counts
as a failure. Interference is what the certificate lists on the scenes handed out.
"""

from __future__ import annotations

import argparse
import time
from collections import Counter
from math import sqrt
from typing import Any

import numpy as np

from scenewright import synthesize
from scenewright.errors import InputError, ScenewrightError, Unsatisfiable
from scenewright.intersections import load_map
from scenewright.scene.map import IntersectionMap
from scenewright.scene.map_elements import Route
from scenewright.tools.map_grounding.relation_files import load_checked_patterns
from scenewright.tools.map_grounding.route_meetings import can_serve

WORDS = {
    "yield_to": ("yields to", "gives way to", "lets pass"),
    "collide_at": ("collides with", "crashes into", "hits"),
    "near_miss": ("nearly hits", "narrowly misses"),
    "follow": ("follows",),
}
LOOSE = (
    "A vehicle yields to a pedestrian",
    "A pedestrian waits for a vehicle",
    "A car follows another car",
    "Two cars collide",
    "A car nearly hits a pedestrian on the crosswalk",
    "A car hits a pedestrian",
    "Two vehicles narrowly miss each other",
    "A rear-end collision",
    "A vehicle turning left yields to another vehicle",
    "A truck follows a bus",
    "A turning car hits a pedestrian on the crosswalk",
    "A near miss between a jaywalking pedestrian and a car",
    "Normal traffic",
    "A car runs a red light and crashes into another car",
)
WHEN = ("", " at 8 am", " at noon", " in the evening", " at night", " in light traffic",
        " in moderate traffic", " in heavy traffic", " with nobody else around")  # fmt: skip


def write_requests(place: IntersectionMap, count: int, seed: int = 1) -> list[str]:
    """Requests that the map can serve."""
    rng = np.random.default_rng(seed)
    offers = [
        (pattern, a, b)
        for pattern in load_checked_patterns()
        for a in place.routes
        for b in place.routes
        if can_serve(pattern, a, b, intersection_map=place)
    ]
    by_pattern: dict[str, list[tuple[object, Route, Route]]] = {}
    for offer in offers:
        by_pattern.setdefault(offer[0].id, []).append(offer)
    names = sorted(by_pattern)
    loose = [w for w in LOOSE if place.signals is not None or "red light" not in w]
    made = []
    for i in range(count):
        when = str(rng.choice(WHEN))
        if i % 2 == 0:
            asked = loose[i // 2 % len(loose)]
            made.append(asked if asked == "Normal traffic" else f"{asked}{when}")
            continue
        pattern = names[i // 2 % len(names)]
        chosen = by_pattern[pattern][int(rng.integers(len(by_pattern[pattern])))]
        made.append(f"{_write_sentence(chosen, rng)}{when}")
    return made


def _write_sentence(chosen: tuple[Any, Route, Route], rng: np.random.Generator) -> str:
    pattern, a, b = chosen
    verb = str(rng.choice(WORDS[pattern.relation]))
    return f"{_describe_agent(a, 'A')} {verb} {_describe_agent(b, 'a')}"


def _describe_agent(route: Route, article: str) -> str:
    if route.type == "vehicle":
        turn = {"left": "turning left", "right": "turning right", "straight": "going straight",
                "uturn": "making a U-turn"}[route.movement]  # fmt: skip
        return f"{article} car from the {route.entry} {turn}"
    if route.movement == "jaywalking":
        return f"{article} pedestrian jaywalking across the {route.crosswalk} leg"
    return f"{article} pedestrian on the {route.crosswalk} crosswalk"


def compute_wilson(good: int, n: int) -> tuple[float, float]:
    """95 % interval of a share."""
    z, p = 1.96, good / n
    middle = (p + z * z / (2 * n)) / (1 + z * z / n)
    half = z * sqrt(p * (1 - p) / n + z * z / (4 * n * n)) / (1 + z * z / n)
    return middle - half, middle + half


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="+")
    parser.add_argument("--requests", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--show", action="store_true", help="print every refusal")
    options = parser.parse_args()
    for name in options.names:
        begin, good, interference = time.perf_counter(), 0, 0
        why: Counter[str] = Counter()
        texts = write_requests(load_map(name), options.requests, options.seed)
        for i, text in enumerate(texts):
            try:
                scene = synthesize(text, intersection=name, seed=i, refiner="none")
            except (Unsatisfiable, InputError, ScenewrightError) as fault:
                why[type(fault).__name__] += 1
                if options.show:
                    print(f"  {i:3d} {text!r}: {str(fault)[:230]}")
                continue
            good += scene.proof.verified
            interference += len(scene.proof.interference)
        low, high = compute_wilson(good, len(texts))
        print(
            f"{name}: {good}/{len(texts)} = {good / len(texts):.3f} [{low:.3f}, {high:.3f}], "
            f"interference {interference}, {time.perf_counter() - begin:.0f} s, {dict(why)}",
            flush=True,
        )


if __name__ == "__main__":
    main()
