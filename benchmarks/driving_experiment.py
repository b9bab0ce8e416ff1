"""Is it worth it: one simple policy, tuned on our scenes, against the same policy without them.

python benchmarks/driving_experiment.py --train 60 --test 100 --taf-bw FOLDER [--scenes DIR]

The policy is the rule-based driver; tuned are eight of its parameters and whether it always gives
way, to the fewest collisions at no less than 95 % of the way that it made before. The search draws
candidates, tries all on a few scenes, the better ones on more and the best on all. Both are then
driven through scenes held out and through real near misses (TAF-BW, Karlsruhe), all others
replaying. Without `--scenes` the scenes are made here, one for every instruction and seed.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
from driving_others import read_scenarios

from scenewright.driving.api import load_scenario
from scenewright.driving.policies import NORMAL, DriverParameters, ReplayPolicy, RuleBasedPolicy
from scenewright.driving.run_drive import run_drive
from scenewright.driving.scenario import Scenario, build_scenario_from_tracks
from scenewright.driving.summary import describe_rate
from scenewright.errors import InputError, Unsatisfiable
from scenewright.scene.base import FloatArray
from scenewright.tools.relation_checker import RoadUser, find_events
from scenewright.tools.relation_checker.external_events import ExternalTracks
from scenewright.tools.relation_checker.footprints import BoolArray
from scenewright.tools.track_io.taf_bw import read_taf_bw

INSTRUCTIONS = (
    "A car from the north turning left narrowly misses a pedestrian on the east crosswalk at 8 am",
    "A car hits a pedestrian on the north crosswalk at noon",
    "A car turning left collides with an oncoming car at 5 pm",
    "A van from the south narrowly misses a cyclist in the evening",
    "A vehicle yields to a pedestrian at 8 am",
    "A car turning right hits a cyclist going straight at 9 am",
    "Two cars collide at 6 pm",
    "A car narrowly misses a pedestrian who runs across the east crosswalk at 3 pm",
)
BEFORE, AFTER = 8.0, 4.0
"""Stretch driven around a real near miss [s]."""
KEPT = 0.95
"""Of its way a tuned policy has to make this share."""
ROUNDS = ((16, 0.25), (4, 0.25))
"""Parts of the training scenes that all candidates are tried on (one in so many), and the share of
candidates that goes on."""


def make_scenarios(count: int, first_seed: int) -> list[Scenario]:
    """Scenes made here, until there are enough."""
    found: list[Scenario] = []
    seed = first_seed
    while len(found) < count:
        text = INSTRUCTIONS[seed % len(INSTRUCTIONS)]
        try:
            found.append(load_scenario(text, seed=seed))
        except (InputError, Unsatisfiable) as error:
            print(f"{text} ({seed}): {error}", file=sys.stderr)
        seed += 1
    return found


def find_real_near_misses(folder: Path) -> list[Scenario]:
    """Near misses and collisions of real vehicles, with the vehicle as ego."""
    found = []
    for recording in read_taf_bw(folder).recordings:
        users = tuple(RoadUser(k, a.track, a.shape) for k, a in enumerate(recording.agents))
        tracks = ExternalTracks(users, {u.id: str(u.id) for u in users}, {}, 0.1)
        for event in find_events(users):
            if event.type != "near_miss":
                continue
            for ego in (event.from_, event.to):
                scenario = _cut(tracks, ego, event.time, f"{recording.name} {event.time:.0f} s")
                if scenario is not None:
                    found.append(scenario)
                    break
    return found


def _cut(tracks: ExternalTracks, ego: int, time_of: float, name: str) -> Scenario | None:
    """The stretch around a near miss; None unless the vehicle moves and its replay is clear."""
    user = tracks.users[ego]
    if user.shape.type != "vehicle":
        return None
    start = max(time_of - BEFORE, user.track.start)
    span = (start, min(time_of + AFTER, user.track.end))
    try:
        scenario = build_scenario_from_tracks(tracks, ego=ego, span=span, name=name)
    except InputError:
        return None
    path = scenario.paths[scenario.ego]
    if path.length < 10.0 or run_drive(scenario, ReplayPolicy()).world.hit is not None:
        return None
    return scenario


def measure(
    parameters: DriverParameters, scenarios: Sequence[Scenario]
) -> tuple[BoolArray, FloatArray]:
    """Whether each drive ended in a collision, and the share of the recorded way that was made."""
    hits, shares = [], []
    for scenario in scenarios:
        world = run_drive(scenario, RuleBasedPolicy(parameters)).world
        recorded = scenario.paths[scenario.ego].progress
        way = recorded[min(world.step, len(recorded) - 1)] - recorded[scenario.start]
        made = world.ego.progress - world.history[0].progress
        hits.append(world.hit is not None)
        shares.append(min(made / max(way, 1.0), 1.0))
    return np.array(hits), np.array(shares)


def draw(rng: np.random.Generator, base: DriverParameters) -> DriverParameters:
    """Parameters near others."""
    names = ("speed", "acceleration", "braking", "headway", "gap", "margin", "horizon", "wider")
    factor = np.exp(rng.normal(0.0, 0.35, len(names)))
    values: dict[str, Any] = {
        n: float(getattr(base, n) * f) for n, f in zip(names, factor, strict=True)
    }
    values["speed"] = min(values["speed"], 1.0)
    values["horizon"] = min(values["horizon"], 7.0)
    return replace(base, **values, yields_always=bool(rng.random() < 0.5))


def tune(scenarios: Sequence[Scenario], candidates: int, seed: int) -> DriverParameters:
    """The best candidate: all are tried on few scenes, those that do well on more, then on all."""
    rng = np.random.default_rng(seed)
    field = [NORMAL, *(draw(rng, NORMAL) for _ in range(candidates - 1))]
    for one_in, share in ROUNDS:
        field = rank(field, scenarios[::one_in])[: max(round(share * len(field)), 2)]
    return rank(field, scenarios)[0]


def rank(field: list[DriverParameters], scenarios: Sequence[Scenario]) -> list[DriverParameters]:
    """Candidates by their collisions, those that make too little way last."""
    field = [NORMAL, *(each for each in field if each != NORMAL)]
    least, costs = None, []
    for tried in field:
        hits, shares = measure(tried, scenarios)
        least = KEPT * shares.mean() if least is None else least
        costs.append(hits.mean() + 10.0 * max(least - shares.mean(), 0.0))
        print(
            f"{len(scenarios)} scenes: {hits.mean():.3f} {shares.mean():.3f}, cost {costs[-1]:.3f}",
            file=sys.stderr, flush=True,
        )  # fmt: skip
    return [field[k] for k in np.argsort(costs, kind="stable")]


def compare(name: str, tuned: DriverParameters, scenarios: Sequence[Scenario]) -> dict[str, Any]:
    """Both policies on the same drives; the interval of the difference by resampling drives."""
    if not scenarios:
        return {"on": name, "n": 0}
    (before, way), (after, way_after) = (measure(p, scenarios) for p in (NORMAL, tuned))
    rng, n = np.random.default_rng(0), len(scenarios)
    picks = rng.integers(0, n, (2000, n))
    change = before[picks].mean(axis=1) - after[picks].mean(axis=1)
    return {
        "on": name, "n": n,
        "untuned": describe_rate(int(before.sum()), n), "untuned_way": round(float(way.mean()), 3),
        "tuned": describe_rate(int(after.sum()), n),
        "tuned_way": round(float(way_after.mean()), 3),
        "fewer": round(1 - float(after.sum()) / max(float(before.sum()), 1.0), 3),
        "difference_95": [round(float(q), 4) for q in np.quantile(change, (0.025, 0.975))],
    }  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--train", type=int, default=60)
    parser.add_argument("--test", type=int, default=100)
    parser.add_argument("--candidates", type=int, default=32)
    parser.add_argument("--taf-bw", type=Path)
    parser.add_argument("--scenes", type=Path)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    began = time.monotonic()
    if given.scenes is None:
        train, test = make_scenarios(given.train, 0), make_scenarios(given.test, 100_000)
    else:
        files = sorted(given.scenes.glob("*/scene.json"))
        test = read_scenarios(files[::4], given.test, bound=True)
        rest = [file for k, file in enumerate(files) if k % 4]
        train = read_scenarios(rest, given.train, bound=True)
    tuned = tune(train, given.candidates, given.seed)
    rows = [compare("held-out scenes", tuned, test)]
    if given.taf_bw is not None:
        rows.append(compare("real near misses", tuned, find_real_near_misses(given.taf_bw)))
    print(json.dumps({
        "train": len(train), "candidates": given.candidates, "tuned": asdict(tuned),
        "results": rows, "seconds": round(time.monotonic() - began),
    }, indent=1))  # fmt: skip


if __name__ == "__main__":
    main()
