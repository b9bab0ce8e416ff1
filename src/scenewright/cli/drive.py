"""`scenewright drive`: an ego in a scene, driven by a policy, with a report."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from scenewright.cli.batch import Workers, count_cores
from scenewright.cli.console import (
    ProgressCallback,
    Result,
    format_columns,
    format_one_line,
    log_line,
    show_progress,
    tell,
)
from scenewright.cli.errors import NOT_VERIFIED, UNUSABLE
from scenewright.cli.options import PlaceOptions, Quiet, argument, option
from scenewright.cli.output_folder import fill_folder, target_folder, try_file
from scenewright.errors import InputError, Unsatisfiable
from scenewright.extras import describe_missing, require_extra
from scenewright.files import write_atomically
from scenewright.intersections import SHIPPED

if TYPE_CHECKING:
    from scenewright.driving.benchmark import BenchmarkScene, Row
    from scenewright.driving.report import Report
    from scenewright.driving.scenario import Scenario

Others = Literal["replay", "reactive", "resolve"]
Temperament = Literal["obedient", "hasty", "careless"]
FailOn = Literal["collision", "at-fault"]


@dataclass(frozen=True)
class DriveOptions(PlaceOptions):
    """A drive: the scene, the policy that drives its ego, and the reports that are written."""

    text_or_scene: str = argument(
        "", "What shall happen, or a scene folder.", metavar="TEXT_OR_SCENE"
    )
    benchmark: bool = option(False, "Drive the 200 scenes of the benchmark instead.")
    split: Literal["dev", "test", "all"] = option("all", "Scenes of the benchmark.")
    policy: str = option(
        "idm",
        "replay, constant, lane-follower, idm, cautious, aggressive, learned or module:Class; "
        "with --benchmark also all.",
    )
    others: Others = option("replay", "Replay; react to the ego; or are re-timed for it.")
    temperament: Temperament | None = option(
        None, "Of others that react; with --benchmark only scenes with it."
    )
    ego: str | None = option(None, "Agent to drive, such as vehicle-1.", metavar="NAME")
    n: int | None = option(None, "Drives, each of a seed.", "--n", min=1)
    seed: int = option(0, "Seed of the first drive.", min=0)
    intersection: str = option(SHIPPED, "Where a text happens.")
    step_limit: float = option(5.0, "Longest a policy may take for an answer [s].", min=0.01)
    fail_on: FailOn | None = option(
        None, "End in 1 after a collision of the ego, or after one that is its fault."
    )
    serve: str | None = option(None, "Where the ego's program connects.", metavar="HOST:PORT")
    workers: Workers = None
    out: str | None = option(None, "Folder for what was driven, as scenes.", metavar="DIR")
    junit: str | None = option(None, "JUnit for CI.", metavar="F.xml", check=try_file)
    html: str | None = option(None, "Report as a page.", metavar="F.html", check=try_file)

    def refuse_clashes(self) -> None:
        """InputError where options do not go together."""
        if self.benchmark == bool(self.text_or_scene) or (self.serve and self.out is not None):
            raise InputError(
                "name a text, a scene folder or --benchmark; --serve goes without --out"
            )
        fixed = ("others", "ego", "seed", "intersection", "time_limit")
        usual = DriveOptions()
        wrong = [name for name in fixed if getattr(self, name) != getattr(usual, name)]
        if self.benchmark and wrong:
            names = " and ".join(f"--{name.replace('_', '-')}" for name in wrong)
            raise InputError(f"the scenes of the benchmark are fixed, without {names}")


def drive(*, asked: DriveOptions, quiet: Quiet = False) -> Result:
    """Drive the ego of a scene with a policy; docs/driving.md says what is measured."""
    from scenewright.driving.api import load_policy, load_scenario
    from scenewright.driving.benchmark import (
        BenchmarkScene,
        build_row,
        choose_scenes,
        load_listed,
        read_list,
    )
    from scenewright.driving.benchmark_report import (
        summarise,
        summarise_policies,
        summarise_rows,
        tabulate,
    )
    from scenewright.driving.report import report_drive
    from scenewright.driving.run_drive import run_drive

    target = None if asked.out is None else target_folder(asked.out, force=None)
    asked.refuse_clashes()
    sys.path.insert(0, "")  # a policy may lie in the folder in which the command is typed
    setting = asked.pass_on(load_scenario)
    how = asked.pass_on(run_drive) | {"temperament": asked.temperament or "obedient"}
    lost: dict[str, str] = {}
    if asked.benchmark:
        scenes = choose_scenes(**asked.pass_on(choose_scenes))
        rows, lost = _drive_scenes(scenes, asked, target, quiet=quiet)
        if asked.serve is not None:
            scenes = [scene for scene in scenes if scene.id not in lost]
            rows = _serve_scenes(asked.serve, scenes, load_listed, most=len(scenes), again=False)
    elif asked.serve is not None:
        scenario = load_scenario(**setting)
        one = BenchmarkScene(
            id="scene", seed=asked.seed, others=asked.others, temperament=how["temperament"]
        )
        rows = _serve_scenes(asked.serve, [one], lambda _: scenario, most=asked.n, again=True)
    if asked.benchmark or asked.serve is not None:
        _write_results(rows, asked)
        code = UNUSABLE if lost else _choose_exit_code(summarise_rows(rows), asked.fail_on)
        return Result(
            {"ok": code == 0, "not_comparable": lost, "out": asked.out, "version": read_list()[0],
             "summary": summarise_policies(rows), "drives": rows},
            lambda: format_columns(*tabulate(rows), right=set()),
            code=code,
        )  # fmt: skip

    def drive_with(seed: int) -> Report:
        own = {"policy": driver, "name": asked.policy, "seed": seed}
        return report_drive(run_drive(load_scenario(**setting | {"seed": seed}), **how | own))

    driver = load_policy(asked.policy)
    with show_progress(quiet=quiet) as log:
        seeds = range(asked.seed, asked.seed + (asked.n or 1))
        reports, failed = _drive_seeds(drive_with, seeds, log)
        runs = len(reports)
        if runs > 1 and len({report.drive.digest for report in reports}) == 1:
            log_line(f"all {runs} drives are the same, whatever the seed: counted as one")
            reports = reports[:1]
        if target is not None:
            _save(reports, target)
    _write_results(
        [build_row(report, scene=f"seed {report.drive.seed}") for report in reports], asked
    )
    summary = summarise(reports)
    code = _choose_exit_code(summary, asked.fail_on)
    return Result(
        {"ok": code == 0, "n": len(reports), "runs": runs, "summary": summary, "out": asked.out,
         "not_made": failed, "drives": [report.to_json() for report in reports]},
        "".join(f"{key.replace('_', ' ')}: {_format(value)}\n" for key, value in summary.items()),
        notes=map(_describe, reports),
        code=code,
    )  # fmt: skip


def _choose_exit_code(summary: dict[str, Any], fail_on: FailOn | None) -> int:
    """2 if a policy failed, 1 for a collision that shall fail the command, else 0."""
    if summary["policy_faults"]:
        return UNUSABLE
    hits = {"collision": "collisions", "at-fault": "collisions_at_fault"}
    return NOT_VERIFIED if fail_on is not None and summary[hits[fail_on]]["count"] else 0


def _format(value: Any) -> str:
    """A figure of the summary: a rate with its interval, numbers by name, or a number."""
    if not isinstance(value, dict):
        return str(value)
    if "rate" not in value:
        return ", ".join(f"{count} {name}" for name, count in value.items())
    line = f"{value['count']} of {value['of']}"
    if "low" in value:
        line += f" (95 % interval {100 * value['low']:.0f} to {100 * value['high']:.0f} %)"
    return line


def _drive_seeds(
    drive_with: Callable[[int], Report], seeds: range, log: ProgressCallback
) -> tuple[list[Report], list[dict[str, Any]]]:
    """Reports of drives, and the seeds with which no scene could be made."""
    reports, failed = [], []
    for k, seed in enumerate(seeds):
        log("driving", f"{k + 1} of {len(seeds)}")
        try:
            reports.append(drive_with(seed))
        except Unsatisfiable as error:
            if len(seeds) == 1:
                raise
            failed.append({"seed": seed, "reason": format_one_line(str(error))})
    if not reports:
        raise InputError(f"none of {len(seeds)} scenes could be made: {failed[0]['reason']}")
    return reports, failed


def _save(reports: list[Report], target: Path) -> None:
    """One drive as the folder itself, several as folders in it."""
    from scenewright.driving.save import save_drive

    missing = describe_missing("recording", "a recording", "rerun")
    if missing is not None:
        log_line(f"warning: no scene.rrd: {missing}")
    with fill_folder(target) as part:
        for report in reports:
            folder = part if len(reports) == 1 else part / f"drive-{report.drive.seed}"
            save_drive(report, folder, recording=missing is None)


def _drive_scenes(
    scenes: Sequence[BenchmarkScene], asked: DriveOptions, out: Path | None, *, quiet: bool
) -> tuple[list[Row], dict[str, str]]:
    """As `drive_benchmark`, with one policy or `all` built-in ones; to be served only made."""
    from scenewright.driving.api import load_policy
    from scenewright.driving.benchmark import drive_benchmark
    from scenewright.driving.policies import BUILT_IN

    names = [*BUILT_IN] if asked.policy == "all" else [asked.policy]
    names = [] if asked.serve else names
    for name in names:
        load_policy(name)  # what cannot be loaded is said before anything is driven
    with show_progress(quiet=quiet) as log, fill_folder(out) if out else nullcontext() as part:
        rows, lost = drive_benchmark(
            scenes, names, workers=asked.workers or count_cores(), step_limit=asked.step_limit,
            out=part, log=log,
        )  # fmt: skip
    tell(lost.values())
    if len(lost) == len(scenes):
        raise InputError("none of the scenes can be used")
    return rows, lost


def _serve_scenes(
    address: str, scenes: Sequence[BenchmarkScene], load: Callable[[BenchmarkScene], Scenario],
    **options: Any,
) -> list[Row]:  # fmt: skip
    """Rows of what egos at a socket drove, when the server ends (see `EgoServer`).

    Raises:
        InputError: no such address, or none can listen there.
    """
    require_extra("drive", "serving an ego", "gymnasium")
    from scenewright.driving.socket_server import EgoServer

    host, _, port = address.rpartition(":")
    try:
        server = EgoServer((host or "127.0.0.1", int(port)), scenes, load, **options)
    except (OSError, ValueError, OverflowError) as error:
        raise InputError(f"cannot listen at {address[:60]!r}, a HOST:PORT: {error}") from error
    with server:
        log_line("serving at {}:{}; Ctrl-C ends it".format(*server.server_address[:2]))
        server.serve_forever()
    return server.rows


def _write_results(rows: Sequence[Row], asked: DriveOptions) -> None:
    """Write the files that the options name."""
    from scenewright.dataset.tables.junit import build_junit
    from scenewright.driving.benchmark_report import build_page, list_test_cases

    if asked.junit is not None:
        write_atomically(asked.junit, build_junit(list_test_cases(rows)))
    if asked.html is not None:
        write_atomically(asked.html, build_page(rows))


def _describe(report: Report) -> str:
    """A drive in a line."""
    said, impact = report.to_json(), report.impact
    line = f"seed {said['seed']}: {said['end']} at {said['time']:.1f} s"
    if impact is not None:
        line += f", {impact.other} hit at {impact.speed:.1f} m/s, at fault: {impact.at_fault}"
    if said["policy_fault"]:
        line += f", policy: {said['policy_fault']}"
    for each in said.get("resolved", []):
        if "stand_in" in each:
            line += f", {each['stand_in']} in place of {each['with']}"
        if not each["came_about"]:
            why = each.get("obstacle") or each["reason"]
            line += f", no encounter with {each['with']}: {why}"
    if said.get("not_verified_for"):
        line += f", as a scene not verified for {' and '.join(said['not_verified_for'])}"
    return line + f", nuPlan {said['nuplan']['score']:.2f}, EPDMS {said['epdms']['score']:.2f}"
