"""Record hours of the shipped intersection's corpus with all agents in them.

    python -m lab.bundle.record_corpus amsterdam_120 --out F.npz [--hours 15] [--seed 0]

Needs the extra `simulate`. The priors need trips one by one; a refiner needs scenes, and an
evaluation of realism needs stops with their cause: which agents were there together, and when. The
hours are those of the corpus, with the same seeds and in the same splits, and every trip of the
corpus is here with its times. Agents without a trip are here too, marked as not complete.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from lab.bundle.corpus_hours import (
    DAYS,
    SPLITS,
    assign_split,
    simulate_raw_hour,
    spawn_hour_seeds,
)
from lab.bundle.four_leg_plan import PLANS, FourLegPlan
from scenewright.errors import InputError
from scenewright.intersections import find_bundle_folder, load_map
from scenewright.scene.map import IntersectionMap
from scenewright.tools.simulation.corpus import Progress, build_agents, find_jam_time
from scenewright.tools.simulation.sumo_run import HOURS, WARM_UP, Demand, read_demand
from scenewright.tools.track_io import Recording, Split, save_recordings

_MIN_HOURS, _MAX_HOURS = len(SPLITS), HOURS * DAYS


def record_traffic(
    name: str, *, out: Path, hours: int = 15, seed: int = 0, progress: Progress | None = None
) -> tuple[Recording, ...]:
    """Simulate hours of an intersection's corpus and write the tracks of all agents to `out`.

    Args:
        hours: how many, spread over the day; about half of them for fitting, a quarter each for
            validation (a little less) and test (a little more).
        seed: of the simulation; the bundle's own corpus has the one its `bundle.toml` names.

    Raises:
        InputError: unknown name, a number of hours that cannot be, SUMO not installed, or a place
            that cannot be written.
    """
    if name not in PLANS:
        raise InputError(f"no plan to build {name!r} from; there are: {', '.join(sorted(PLANS))}")
    plan, intersection_map = PLANS[name], load_map(name)
    demand = read_demand(find_bundle_folder(name) / "demand.json")
    seeds = spawn_hour_seeds(seed)
    recordings = []
    for day, hour in spread_hours(hours):
        rng = np.random.default_rng(seeds[day, hour])
        made = record_hour(
            day, hour, plan=plan, intersection_map=intersection_map, demand=demand, rng=rng
        )
        recordings.append(made)
        if progress is not None:
            progress(f"{made.name}: {len(made.agents)} agents, {made.split}")
    save_recordings(out, recordings)
    return tuple(recordings)


def spread_hours(count: int) -> list[tuple[int, int]]:
    """Days and hours of a corpus of `count` hours: each split's spread evenly over the day.

    Raises:
        InputError: fewer hours than splits, or more than there are.
    """
    if not _MIN_HOURS <= count <= _MAX_HOURS:
        raise InputError(f"a corpus has {_MIN_HOURS} to {_MAX_HOURS} hours, got {count}")
    chosen = [
        (_find_day(split, hour), hour)
        for split, share in _share_hours(count).items()
        for hour in _spread_evenly(share)
    ]
    return sorted(chosen)


def _share_hours(count: int) -> Mapping[Split, int]:
    """Hours of each split; none has more than the day has."""
    test = max(1, round(0.27 * count))
    validation = max(1, round(0.2 * count))
    fit = min(count - test - validation, HOURS)
    test = min(max(test, (count - fit + 1) // 2), HOURS)
    return {"fit": fit, "validation": count - fit - test, "test": test}


def _spread_evenly(count: int) -> list[int]:
    return [int((k + 0.5) * HOURS / count) for k in range(count)]


def _find_day(split: Split, hour: int) -> int:
    """The day on which an hour belongs to a split."""
    return next(day for day in range(DAYS) if assign_split(day, hour) == split)


def record_hour(
    day: int,
    hour: int,
    *,
    plan: FourLegPlan,
    intersection_map: IntersectionMap,
    demand: Demand,
    rng: np.random.Generator,
) -> Recording:
    """One hour of the corpus with all agents inside the map."""
    raw, unseen = simulate_raw_hour(
        hour, plan=plan, intersection_map=intersection_map, demand=demand, rng=rng
    )
    half = {"vehicle": plan.extent, "pedestrian": plan.pedestrian_extent}
    agents = build_agents(intersection_map, raw, half=half, rng=rng)
    end = find_jam_time(agents)
    before = [agent for agent in agents if agent.track.start <= end]
    return Recording(
        name=f"{plan.name} day {day} hour {hour:02d}",
        begin=0.0,
        end=end,
        agents=tuple(sorted(before, key=lambda agent: agent.track.start)),
        split=assign_split(day, hour),
        unseen=unseen,
        signal_time=None
        if intersection_map.signals is None
        else WARM_UP % intersection_map.signals.cycle,
    )


def main(argv: Sequence[str] | None = None) -> int:
    """Record the hours asked for."""
    parser = argparse.ArgumentParser(prog="python -m lab.bundle.record_corpus")
    parser.add_argument("name")
    parser.add_argument("--out", type=Path, required=True, help="file to write, an .npz")
    parser.add_argument("--hours", type=int, default=15, help="how many, spread over the day")
    parser.add_argument("--seed", type=int, default=0, help="of the simulation")
    given = parser.parse_args(argv)
    try:
        record_traffic(
            given.name, out=given.out, hours=given.hours, seed=given.seed,
            progress=lambda line: print(line, file=sys.stderr),
        )  # fmt: skip
    except InputError as fault:
        print(fault, file=sys.stderr)
        return fault.exit_code
    print(given.out)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
