"""Choose the scenes of `drive --benchmark`, or make their digests anew.

    python -m lab.driving.choose_benchmark try FILE [--seeds N]    # drive candidates, one line each
    python -m lab.driving.choose_benchmark choose FILE             # 200 of them as the list
    python -m lab.driving.choose_benchmark digests --version 2     # same scenes, new digests
    scenewright drive --benchmark --policy all --json > FILE
    python -m lab.driving.choose_benchmark board FILE              # docs/leaderboard.md

A candidate is taken where an ego that gives way to nobody fails or must react, and at least one
lawful careful ego gets through. After a release that changes scenes, `digests` keeps identities,
texts and seeds; a scene that can no longer be made or avoided is named and must be replaced.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections import Counter, defaultdict
from dataclasses import asdict, fields, replace
from itertools import count
from pathlib import Path
from typing import Any

from scenewright.driving.benchmark import LIST, BenchmarkScene, find_failure, make_scene, read_list
from scenewright.driving.policies import (
    CAUTIOUS,
    LANE_FOLLOWER,
    NORMAL,
    DriverParameters,
    RuleBasedPolicy,
)
from scenewright.driving.reactive import TEMPERAMENTS, Temper
from scenewright.driving.report import Report, report_drive
from scenewright.driving.scenario import build_scenario
from scenewright.driving.single_drive import drive_once
from scenewright.driving.traffic import OthersMode
from scenewright.errors import ScenewrightError
from scenewright.evals.leaderboard import DRIVEN, enter_leaderboard
from scenewright.intersections import load_map
from scenewright.scene.digest import digest_scene
from scenewright.scene.record import SceneRecord

LIST_FILE = Path("src/scenewright/driving") / LIST
VERSION = "1"
PLACE = "amsterdam_120"
CAREFUL = (
    CAUTIOUS,
    NORMAL,
    replace(NORMAL, speed=0.6, yields_always=True, margin=1.5),
    replace(CAUTIOUS, speed=0.5, horizon=6.0, margin=2.5),
    replace(NORMAL, wider=1.0, yields_always=True, horizon=5.0),
)
"""Lawful careful egos: a scene that none of them gets through is left out."""

TEXTS: dict[str, tuple[str, ...]] = {
    "collision": (
        "A car T-bones another car",
        "A northbound car and a truck from the west collide at a right angle",
        "A car turning left collides with an oncoming car",
        "A left-turning van cuts off an oncoming taxi and they crash",
        "A car turning right runs into the path of a car on the cross street and is hit",
        "A car sideswipes another car in heavy traffic",
        "Two cars collide at the junction, one of them turning left from the south",
        "A car hits the side of a bus",
    ),
    "near miss": (
        "A car narrowly misses a car from the cross street with a PET of 0.9 seconds",
        "A car turning left nearly hits an oncoming motorcycle",
        "A right-turning truck nearly hits a car going straight from the cross street",
        "A taxi from the north cuts off a bus from the east",
        "Two cars narrowly miss each other with a TTC of 1.0 seconds",
        "A truck from the south is nearly hit by a car from the east",
        "A car making a U-turn narrowly misses an oncoming car",
    ),
    "yield": (
        "A car turning left yields to an oncoming car",
        "A car turning right yields to a car on the cross street",
        "A car lets a pedestrian cross first on the north crosswalk",
        "A bus turning left from the south stops for a woman on the west crosswalk",
        "A car yields to two pedestrians",
        "A car turning left from the west waits for an oncoming truck going straight",
        "A cyclist yields to a car",
    ),
    "hidden": (
        "A woman steps out from behind a parked truck and is nearly hit by a car",
        "A child steps out from between two parked cars and is hit by a car",
        "A man hidden by a parked van steps onto the road and a car brakes hard for him",
        "A pedestrian steps out from behind a parked truck and is struck by a car",
        "A pedestrian steps out from behind a parked van and a car yields",
    ),
    "red light": (
        "A truck from the east runs a red light and T-bones a northbound sedan",
        "A car runs a red light and narrowly misses a southbound bus",
        "A pedestrian walks on red and is hit by a northbound car",
        "A pedestrian ignores the red light and a car yields",
        "A red-light runner from the north broadsides an eastbound cab",
        "A car turning left runs the red light and hits an oncoming car",
        "A car from the west runs a red light and nearly hits a car from the south",
    ),
    "cyclist": (
        "A cyclist is hit by a right-turning car",
        "A car turning left nearly hits an oncoming cyclist",
        "A car turning left hits a cyclist coming the other way",
        "A cyclist nearly collides with a car from the cross street",
        "A car yields to a cyclist on the crosswalk",
        "A right-turning van narrowly misses a cyclist going straight",
        "An e-scooter crosses the east crosswalk and is nearly hit by a turning car",
    ),
    "pedestrian": (
        "A car going straight hits a pedestrian on the crosswalk",
        "A car narrowly misses a pedestrian with a PET of 1.0 seconds",
        "A jogger crosses the east crosswalk just ahead of a car, which narrowly misses him",
        "A taxi hits a jaywalker",
        "A man steps out mid-block and an eastbound car brakes hard and misses him",
        "A car narrowly misses a jaywalker",
        "A pedestrian waits for a car and then crosses",
    ),
    "turning": (
        "A left-turning car hits a pedestrian on the crosswalk",
        "A right-turning truck hits a pedestrian on the crosswalk",
        "A car turning right narrowly misses a pedestrian on the south crosswalk",
        "A car turning left from the east nearly hits a pedestrian and a second car follows it",
        "A taxi turning right from the north yields to a pedestrian on the west crosswalk",
        "A left-turning car yields to an oncoming car and then hits a pedestrian on the crosswalk",
    ),
}
"""Kind of conflict -> what is asked; hours and densities are put behind in turn."""
HOURS = ("at 8 am", "at noon", "at 5 pm", "at 11 pm", "at 3 pm", "at 6 am")
DENSITIES = ("", " in light traffic", " in medium traffic", " in heavy traffic")
COUNT = 200


def list_candidates(seeds: int) -> list[dict[str, Any]]:
    """Text, seed and temperament of every candidate, kinds in turn."""
    tempers: list[Temper] = list(TEMPERAMENTS)
    found = []
    for seed in range(seeds):
        for kind, texts in TEXTS.items():
            for k, text in enumerate(texts):
                n = k + seed
                density = "" if "traffic" in text else DENSITIES[n % 4]
                found.append({
                    "kind": kind, "text": f"{text} {HOURS[(n + seed) % 6]}{density}",
                    "seed": seed, "intersection": PLACE, "temperament": tempers[(n + k) % 3],
                })  # fmt: skip
    return sorted(found, key=lambda row: row["seed"])


def list_egos(record: SceneRecord) -> list[int]:
    """Vehicles that take part, no red-light runners."""
    return [
        agent.id for agent in record.agents
        if agent.role == "foreground" and agent.type == "vehicle" and not agent.violates_signal
    ]  # fmt: skip


def try_candidate(row: dict[str, Any], *, turn: int) -> dict[str, Any]:
    """The row with its digest and how the lane follower and careful egos did; `turn`: which ego."""
    record = make_scene(BenchmarkScene(id="", others="resolve", **row))
    egos = list_egos(record)
    if not egos:
        return row | {"refused": "no lawful vehicle"}
    ego = egos[turn % len(egos)]
    scenario = build_scenario(record, load_map(PLACE), ego=str(ego))
    row |= {"ego": scenario.names[scenario.ego], "digest": digest_scene(record)}

    def drive(parameters: DriverParameters, others: OthersMode) -> Report:
        return report_drive(drive_once(
            scenario, RuleBasedPolicy(parameters), others=others,
            temperament=row["temperament"], seed=row["seed"],
        ))  # fmt: skip

    found = []
    for others in ("resolve", "reactive"):
        report = drive(LANE_FOLLOWER, others)
        failure, exposed = find_failure(report), bool(report.figures["exposed"])
        if failure is not None or exposed:
            found.append((failure is None, others, failure))
        if failure is not None:
            break
    if not found:
        return row | {"refused": "no danger"}
    _, row["others"], row["failure"] = min(found, key=lambda each: each[0])
    through = (
        k for k, each in enumerate(CAREFUL) if find_failure(drive(each, row["others"])) is None
    )
    row["careful"] = next(through, None)
    return row


def try_candidates(file: Path, seeds: int) -> None:
    """Add a line to a file for every candidate that it does not hold yet."""
    done = {(row["text"], row["seed"]) for row in read_lines(file)}
    for turn, row in enumerate(list_candidates(seeds)):
        if (row["text"], row["seed"]) in done:
            continue
        try:
            found = try_candidate(row, turn=turn)
        except ScenewrightError as error:
            found = row | {"refused": str(error)[:200]}
        with file.open("a", encoding="utf-8") as stream:
            stream.write(json.dumps(found) + "\n")


def read_lines(file: Path) -> list[dict[str, Any]]:
    """Rows of a file that may not exist."""
    return [json.loads(line) for line in file.read_text().splitlines()] if file.exists() else []


def choose(file: Path) -> list[dict[str, Any]]:
    """Rows of the list: as many of each kind, kinds and temperaments in turn, texts not yet in.

    Of a kind two in three are scenes that the lane follower fails, as far as there are as many.
    """
    pools: dict[tuple[str, str, bool], list[dict[str, Any]]] = defaultdict(list)
    for row in read_lines(file):
        if row.get("careful") is not None:
            pools[row["kind"], row["temperament"], row["failure"] is not None].append(row)
    rows: list[dict[str, Any]] = []
    sorts: Counter[Any] = Counter()
    used: Counter[str] = Counter()
    for n in range(100 * COUNT):
        kind, temper = list(TEXTS)[n % 8], list(TEMPERAMENTS)[n // 8 % 3]
        failed = n // 24 % 3 < 2
        pool = pools[kind, temper, failed]
        if not pool or sorts[kind] == COUNT // len(TEXTS):
            continue
        row = min(pool, key=lambda row: used[row["text"].rsplit(" at ", 1)[0]])
        pool.remove(row)
        split = min(("dev", "test"), key=lambda each: (
            sorts[each] == COUNT // 2, sorts[kind, failed, each], sorts[each],
        ))  # fmt: skip
        sorts.update([kind, split, (kind, failed, split)])
        used[row["text"].rsplit(" at ", 1)[0]] += 1
        rows.append(row | {"id": f"{kind.replace(' ', '-')}-{sorts[kind]:02d}", "split": split})
    # Those of a sort stand at even distances, so that the first few are like all.
    size = Counter((row["kind"], row["failure"] is None) for row in rows)
    rank = {sort: count(0.5) for sort in size}
    sort_of = [(row["kind"], row["failure"] is None) for row in rows]
    place = [next(rank[sort]) / size[sort] for sort in sort_of]
    rows = [rows[k] for k in sorted(range(len(rows)), key=place.__getitem__)]
    keys = [each.name for each in fields(BenchmarkScene)]
    return [{key: row[key] for key in keys} for row in rows]


def write_list(rows: list[dict[str, Any]], version: str) -> None:
    """The list as the package ships it, one scene a line."""
    lines = ",\n".join(json.dumps(row, ensure_ascii=False) for row in rows)
    LIST_FILE.write_text(f'{{"version": "{version}", "scenes": [\n{lines}\n]}}\n', encoding="utf-8")


def remake_digests() -> list[dict[str, Any]]:
    """Rows of the list with the digests of today's scenes; those that cannot be made are named."""
    rows = []
    for scene in read_list()[1]:
        try:
            rows.append(asdict(scene) | {"digest": digest_scene(make_scene(scene))})
        except ScenewrightError as error:
            print(f"{scene.id}: {error}", file=sys.stderr)
    return rows


def enter_board(file: Path, board: Path) -> None:
    """Enter what `drive --benchmark --policy all --json` printed into the leaderboard."""
    for policy, said in json.loads(file.read_text())["summary"].items():
        figures = {
            key: {"rate": said[key]["rate"], "interval": [said[key]["low"], said[key]["high"]]}
            for key in DRIVEN
        }
        enter_leaderboard(board, policy, figures, section="egos")


def main() -> None:
    """Try, choose, make digests anew, or enter results."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("what", choices=("try", "choose", "digests", "board"))
    parser.add_argument("file", type=Path, nargs="?")
    parser.add_argument("--seeds", type=int, default=12)
    parser.add_argument("--version", default=VERSION)
    given = parser.parse_args()
    if given.what == "try":
        try_candidates(given.file, given.seeds)
    elif given.what == "choose":
        write_list(choose(given.file), given.version)
    elif given.what == "digests":
        write_list(remake_digests(), given.version)
    else:
        enter_board(given.file, Path("docs/leaderboard.json"))


if __name__ == "__main__":
    main()
