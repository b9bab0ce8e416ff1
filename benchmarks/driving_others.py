"""Others that react, and others that are re-timed: do the asked encounters come about?

python benchmarks/driving_others.py --scenes DIR --others resolve [--n 100] [--egos idm cautious]

DIR holds folders of scenes, such as `scenewright batch` writes. Each scene is driven by each ego,
with `resolve` each in which the ego is bound to another by a relation. Printed are the encounters
that came about, of all and of those that physics allowed (docs/driving.md), and collisions without
the ego; one line for each run with `--list`.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Literal

from scenewright.driving.api import load_policy, load_scenario
from scenewright.driving.rehearsal import rehearse_drive
from scenewright.driving.report import report_drive
from scenewright.driving.run_drive import run_drive
from scenewright.driving.scenario import Scenario
from scenewright.driving.summary import describe_rate
from scenewright.errors import InputError

EGOS = ("constant", "idm", "cautious", "aggressive")


def read_scenarios(files: Sequence[Path], count: int, *, bound: bool) -> list[Scenario]:
    """The first scenes of files, with `bound` those in which the ego takes part in a relation."""
    found: list[Scenario] = []
    for file in files:
        if len(found) == count:
            break
        try:
            scenario = load_scenario(file)
        except InputError:
            continue
        if scenario.partner or not bound:
            found.append(scenario)
    return found


def run(
    scenario: Scenario, ego: str, others: Literal["replay", "reactive", "resolve"], seed: int
) -> dict[str, Any]:
    """One drive: its report, without the events."""
    policy = load_policy(ego)
    if others == "resolve":
        rehearsed = rehearse_drive(scenario, policy, name=ego, seed=seed)
        drive, obstacles, tries = rehearsed.drive, rehearsed.obstacles, rehearsed.tries
    else:
        drive = run_drive(scenario, policy, name=ego, others=others, seed=seed)
        obstacles, tries = None, 1
    told = report_drive(drive, obstacles=obstacles).to_json()
    return {
        "scene": scenario.name, "ego": ego, "end": told["end"], "time": told["time"],
        "tries": tries, "asked": scenario.record and scenario.record.meta.user_prompt,
        "resolved": told.get("resolved", []), "background": told["background_collisions"],
        "hit": told["collision"], "red": told["red_lights"],
        "collisions": [
            [e["from"], e["to"], e["time"]] for e in told["events"] if e["type"] == "collision"
        ],
    }  # fmt: skip


def summarize(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """The encounters of runs, and the collisions that were not asked for."""
    return {
        "runs": len(rows),
        **summarize_encounters([each for row in rows for each in row["resolved"]]),
        "background_collisions": describe_rate(sum(r["background"] > 0 for r in rows), len(rows)),
    }


def summarize_encounters(meetings: list[dict[str, Any]]) -> dict[str, Any]:
    """How many asked encounters came about, of all and of those that physics allowed."""
    allowed = [each for each in meetings if each.get("allowed", True)]
    groups = {"came_about": meetings, "where_allowed": allowed}
    return {
        name: describe_rate(sum(each["came_about"] for each in group), len(group))
        for name, group in groups.items()
        if group
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenes", type=Path, required=True)
    parser.add_argument("--others", default="resolve")
    parser.add_argument("--n", type=int, default=100)
    parser.add_argument("--egos", nargs="+", default=list(EGOS))
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--list", action="store_true")
    given = parser.parse_args()
    began = time.process_time()
    rows = []
    files = sorted(given.scenes.glob("*/scene.json"))
    scenarios = read_scenarios(files, given.n, bound=given.others == "resolve")
    for scenario in scenarios:
        for ego in given.egos:
            rows.append(run(scenario, ego, given.others, given.seed))
            if given.list:
                print(json.dumps(rows[-1]), file=sys.stderr, flush=True)
    by_ego = {ego: summarize([r for r in rows if r["ego"] == ego]) for ego in given.egos}
    print(json.dumps({
        "others": given.others, "all": summarize(rows), "egos": by_ego,
        "processor_seconds": round(time.process_time() - began),
    }, indent=1))  # fmt: skip


if __name__ == "__main__":
    main()
