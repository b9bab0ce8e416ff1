"""The benchmark for egos: 200 fixed scenes, made on the user's machine and compared by digest.

In every scene the ego is in danger, and a lawful careful ego gets through: so they were chosen
(`lab/driving/choose_benchmark.py`). Hence a contact is the ego's failure unless it stood or was hit
from behind, whoever had the right of way; UN R157 asks the same of a careful driver.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cache, partial
from importlib.resources import files
from pathlib import Path
from typing import Any, Literal

from scenewright.dataset.batch.pool import Died, Overdue, spread
from scenewright.driving.api import load_policy
from scenewright.driving.reactive import Temper
from scenewright.driving.report import Report, report_drive
from scenewright.driving.save import save_drive
from scenewright.driving.scenario import Scenario, build_scenario
from scenewright.driving.scores import OFF_ROAD
from scenewright.driving.single_drive import drive_once
from scenewright.driving.traffic import OthersMode
from scenewright.errors import InputError, ScenewrightError
from scenewright.files import write_files
from scenewright.graph.run import synthesize
from scenewright.graph.scene_files import encode_scene, load_scene
from scenewright.intersections import find_data_folder, load_map
from scenewright.scene.digest import digest_scene
from scenewright.scene.record import SceneRecord

LIST = "ego_benchmark.json"
Row = dict[str, Any]
Split = Literal["dev", "test", "all"]
MOST_AGENTS = 1000
"""Of a scene; none has as many."""
BLAMELESS = ("stopped_ego", "active_rear")
"""nuPlan's classes of contacts that no ego is failed for."""
KEPT = (
    "policy", "others", "temperament", "seed", "end", "time", "collision", "red_lights", "off_road",
    "progress", "exposed", "min_ttc", "min_pet", "policy_fault", "digest",
)  # fmt: skip
"""Of a report, in a row of results."""


@dataclass(frozen=True, kw_only=True)
class BenchmarkScene:
    """One scene of the benchmark.

    Attributes:
        kind: of conflict; text, seed, intersection: what it is made of, without a refiner.
        ego: agent to drive; others, temperament: how the others move.
        digest: that the scene must have.
    """

    id: str
    kind: str = ""
    text: str = ""
    seed: int
    intersection: str = ""
    ego: str = ""
    others: OthersMode
    temperament: Temper
    split: str = ""
    digest: str = ""


@cache
def read_list() -> tuple[str, tuple[BenchmarkScene, ...]]:
    """Version and scenes of the benchmark; kinds, temperaments and splits alternate."""
    held = json.loads(files("scenewright.driving").joinpath(LIST).read_bytes())
    return held["version"], tuple(BenchmarkScene(**row) for row in held["scenes"])


def choose_scenes(
    *, split: Split = "all", temperament: Temper | None = None, n: int | None = None
) -> list[BenchmarkScene]:
    """The first `n` scenes of a split and a temperament."""
    chosen = [each for each in read_list()[1] if split in ("all", each.split)]
    return [each for each in chosen if temperament in (None, each.temperament)][:n]


def load_listed(scene: BenchmarkScene) -> Scenario:
    """The scene, kept in the user's folder once it is made, ready to be driven.

    Raises:
        InputError: it is not the scene that the list names.
    """
    return build_scenario(_find_scene(scene), load_map(scene.intersection), ego=scene.ego)


def _find_scene(scene: BenchmarkScene) -> SceneRecord:
    file = find_data_folder() / "ego-benchmark" / f"{scene.digest.removeprefix('sha256:')}.json"
    with suppress(InputError):  # none is there yet, or it was damaged
        if digest_scene(kept := load_scene(file)) == scene.digest:
            return kept
    try:
        record = make_scene(scene)
    except ScenewrightError as error:
        raise InputError(f"scene {scene.id} cannot be made here: {error}") from error
    if (digest := digest_scene(record)) != scene.digest:
        raise InputError(
            f"scene {scene.id} is another one here ({digest[7:19]} instead of "
            f"{scene.digest[7:19]}): its results would not be comparable"
        )
    write_files(file.parent, {file.name: encode_scene(record)})
    return record


def make_scene(scene: BenchmarkScene) -> SceneRecord:
    """The scene made anew, whatever the environment says of refiners and numbers of agents."""
    return synthesize(
        scene.text, seed=scene.seed, intersection=scene.intersection, refiner="none",
        max_agents=MOST_AGENTS,
    ).record  # fmt: skip


def find_failure(report: Report) -> str | None:
    """Why an ego failed a scene, in a line; None: it passed."""
    said, impact = report.to_json(), report.impact
    if said["policy_fault"] is not None:
        return f"policy: {said['policy_fault']}"
    if impact is not None and impact.kind not in BLAMELESS:
        hit = f"collision with {impact.other} at {impact.time:.1f} s and {impact.speed:.1f} m/s"
        return f"{hit} ({impact.reason})"
    if said["red_lights"]:
        return "ran a red light"
    if said["off_road"] > OFF_ROAD:
        return f"{said['off_road']:.1f} m off the road"
    if not said["nuplan"]["ego_is_making_progress"]:
        return f"no progress: {said['progress']:.0f} m"
    return None


def build_row(report: Report, *, scene: str, kind: str = "", split: str = "") -> Row:
    """A drive as a row of results."""
    said, why = report.to_json(), find_failure(report)
    row = {"scene": scene, "kind": kind, "split": split, "failed": why is not None, "why": why}
    scores = {name: said[name]["score"] for name in ("nuplan", "epdms")}
    return row | {key: said[key] for key in KEPT} | scores


def drive_benchmark(
    scenes: Sequence[BenchmarkScene], policies: Sequence[str], *, workers: int, step_limit: float,
    out: Path | None = None, log: Callable[[str, str], None] = lambda *_: None,
) -> tuple[list[Row], dict[str, str]]:  # fmt: skip
    """Rows of every policy and scene, in order; by id of a scene that has none, why.

    Args:
        policies: names; without any the scenes are only made; step_limit: as of `drive_once`.
        out: folder for what is driven.
    """
    task = partial(_drive_scene, policies=tuple(policies), step_limit=step_limit, out=out)
    inline = ((scene, task(scene)) for scene in scenes)
    found: dict[str, list[Row] | str] = {}
    for scene, result in inline if workers == 1 else spread(scenes, task, workers=workers):
        found[scene.id] = str(result) if isinstance(result, Died | Overdue) else result
        log("driving" if policies else "making scenes", f"{len(found)} of {len(scenes)}")
    told = [found[scene.id] for scene in scenes]
    rows = [row for each in told if not isinstance(each, str) for row in each]
    lost = {name: why for name, why in found.items() if isinstance(why, str)}
    return sorted(rows, key=lambda row: policies.index(row["policy"])), lost


def _drive_scene(
    scene: BenchmarkScene, *, policies: Sequence[str], step_limit: float, out: Path | None
) -> list[Row] | str:
    try:
        scenario = load_listed(scene)
    except InputError as error:
        return str(error)
    rows = []
    for policy in policies:
        report = report_drive(drive_once(
            scenario, load_policy(policy), name=policy, others=scene.others,
            temperament=scene.temperament, seed=scene.seed, step_limit=step_limit,
        ))  # fmt: skip
        if out is not None:
            folder = out / policy.replace(":", "-") / scene.id
            save_drive(report, folder, picture=False, recording=False)
        rows.append(build_row(report, scene=scene.id, kind=scene.kind, split=scene.split))
    return rows
