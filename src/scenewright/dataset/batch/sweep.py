"""Logical scenarios: a plan that leaves values open, as rows of a batch and a table of points."""

from __future__ import annotations

import csv
import io
import json
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import Any, Literal

import numpy as np
from scipy.stats import qmc

from scenewright.dataset.batch.carry_out import ProgressCallback
from scenewright.dataset.batch.journal import Journal
from scenewright.dataset.batch.rows import read_source
from scenewright.dataset.batch.run import (
    Request,
    Summary,
    build_batch_header,
    check_request,
    run_batch,
)
from scenewright.dataset.tables.coverage import Covered, build_bins, count_bins, list_encounters
from scenewright.errors import InputError
from scenewright.files import make_folder, write_atomically
from scenewright.graph.scene_files import read_proof
from scenewright.intersections import list_intersections, load_map
from scenewright.scene.base import FloatArray
from scenewright.scene.map import IntersectionMap
from scenewright.scene.plan_file import LogicalPlan, PlanFault, format_path
from scenewright.scene.rejection import SEARCHED
from scenewright.scene.spread import Spread

Sampling = Literal["grid", "lhs", "sobol", "boundary"]
SCENES, POINTS, TABLE = "scenes", "points.jsonl", "points.csv"
"""What a sweep's folder holds: the dataset, its rows, and the table of all points."""
MOST_POINTS = 100_000
MOST_TRIES = 64
"""Points drawn for each that is asked for, before few or none fulfil the constraints."""
BINS = 10
"""Into which the values of a number are divided, to see which of them were measured."""
_FIELD = re.compile(r"(agents|relations|measures|context)(?:\[(\d+)\])?\.(\w+)")
_TIME = re.compile(r"\d\d:\d\d")
MEASURED = (
    "event", "time", "speed_from", "speed_to", "closing_speed", "pet", "pet_time", "ttc",
    "ttc_time", "worst_ttc", "worst_ttc_time",
)  # fmt: skip
"""Columns of the table for what is measured of the first event that was asked for."""
_EVIDENCE = {"target_pet": "pet", "target_ttc": "path_ttc"}
"""Field of a relation -> what the checker measures of it."""


@dataclass(frozen=True)
class Point:
    """Values for what a plan leaves open, by path; `fault` says why they are no plan there."""

    name: str
    values: Mapping[tuple[str | int, ...], Any]
    fault: str | None = None
    place: str | None = None


def draw_shares(spreads: Sequence[Spread], n: int, *, sampling: Sampling, seed: int) -> FloatArray:
    """Points in the unit cube, [n, spreads]; a grid and the corners may be fewer.

    A grid has as many steps for each number as fit; lists are gone through as a whole.
    """
    count = len(spreads)
    if sampling == "lhs":
        return np.asarray(qmc.LatinHypercube(count, rng=seed).random(n))
    if sampling == "sobol":
        drawn = qmc.Sobol(count, rng=seed).random_base2(math.ceil(math.log2(n)) if n > 1 else 0)
        return np.asarray(drawn[:n])
    listed = [len(spread.values) for spread in spreads if spread.kind == "list"]
    free = count - len(listed)
    fits = (n / math.prod(listed)) ** (1 / free) + 1e-9 if free else 2
    steps = 2 if sampling == "boundary" else max(int(fits), 2)
    axes = [
        (np.arange(len(s.values)) + 0.5) / len(s.values)
        if s.kind == "list"
        else np.linspace(0, 1, steps)
        for s in spreads
    ]
    if (whole := math.prod(map(len, axes))) > MOST_POINTS:
        raise InputError(f"{whole:,} points are too many; leave less open, or sample by sobol")
    points = np.array(list(product(*axes)))
    if len(points) > n:  # evenly, as the first n would all have the same first value
        points = points[np.linspace(0, len(points) - 1, n).round().astype(int)]
    return points


def build_points(
    plan: LogicalPlan, n: int, *, sampling: Sampling, seed: int, place: str
) -> list[Point]:
    """The points of a sweep that fulfil its constraints; one that is no plan says why.

    Args:
        place: intersection of a plan that names none; of several, each gets an equal share of n.

    Raises:
        InputError: nothing is left open, no number of points, or none fulfils the constraints.
    """
    if not (plan.spreads or plan.legs):
        raise InputError(f"{plan.name} leaves nothing open; write a range such as 0.4 .. 1.2 s")
    if not 1 <= n <= MOST_POINTS:
        raise InputError(f"--n is a number from 1 to {MOST_POINTS:,}, got {n}")
    places = load_places(plan, place)
    found: list[Point] = []
    for k, (name, intersection) in enumerate(places.items()):
        share = n // len(places) + (k < n % len(places))
        own = name if plan.places else None
        try:
            placed = plan.place_at(intersection)
        except InputError as error:
            if len(places) == 1:
                raise
            found.append(Point(f"point-{len(found):05d}", {}, str(error), own))
            continue
        for values in _draw_values(placed, share, sampling=sampling, seed=seed):
            point = Point(f"point-{len(found):05d}", values, None, own)
            try:
                placed.settle(values)
            except InputError as error:
                point = replace(point, fault="; ".join(error.lines))
            found.append(point)
    return found


def load_places(plan: LogicalPlan, place: str) -> dict[str, IntersectionMap]:
    """The maps of the intersections that a plan names, by name; else of `place`.

    Raises:
        InputError: there is no such intersection; names the line.
    """
    listed = "any" in plan.places
    names = list_intersections() if listed else list(plan.places) or [place]
    try:
        return {name: load_map(name) for name in names}
    except InputError as error:
        if not plan.places:
            raise
        raise PlanFault(plan.name, plan.lines, {("intersections",): str(error)}) from error


def _draw_values(
    plan: LogicalPlan, n: int, *, sampling: Sampling, seed: int
) -> list[dict[tuple[str | int, ...], Any]]:
    """Values of n points that fulfil the constraints; more are drawn where many do not."""
    spreads, broken = list(plan.spreads.values()), None
    drawn = n
    while 0 < drawn <= MOST_TRIES * n:
        found = []
        for shares in draw_shares(spreads, drawn, sampling=sampling, seed=seed):
            chosen = (s.compute_value(float(x)) for s, x in zip(spreads, shares, strict=True))
            values = dict(zip(plan.spreads, chosen, strict=True))
            own = plan.find_broken(values)
            if own is None:
                found.append(values)
            broken = broken or own
        if len(found) >= n or (found and sampling in ("grid", "boundary")):
            return found[:n]
        drawn *= 4
    if broken is not None and n and not found:
        raise InputError(f"{broken} in any of {drawn // 4:,} points drawn")
    return found if n else []


def run_sweep(
    plan: LogicalPlan,
    request: Request,
    *,
    n: int,
    sampling: Sampling,
    log: ProgressCallback = lambda _: None,
) -> Summary:
    """Make a scene of each point that is a plan, and write the table of all points.

    Args:
        request: how scenes are made; `out` is the folder of the sweep.

    Raises:
        InputError: the plan leaves nothing open, or the folder cannot be used.
    """
    out = request.out
    check_request(request)
    points = build_points(
        plan, n, sampling=sampling, seed=request.options.seed, place=request.options.intersection
    )
    sound = [point for point in points if point.fault is None]
    if not sound:
        raise InputError(f"no point is a plan; the first: {points[0].fault}")
    make_folder(out)
    rows = [
        {"id": each.name, "plan": plan.settle_data(each.values), "seed": request.options.seed}
        | ({"overrides": {"intersection": each.place}} if each.place else {})
        for each in sound
    ]
    lines = "".join(json.dumps(row, ensure_ascii=False) + "\n" for row in rows)
    if (out / POINTS).exists() and (out / POINTS).read_bytes() != lines.encode():
        raise InputError(f"{out} holds another sweep; choose another --out")
    write_atomically(out / POINTS, lines.encode())
    request = replace(request, source=out / POINTS, out=out / SCENES)
    summary = run_batch(request, log=log)
    write_atomically(out / TABLE, _format_table(plan, points, request).encode())
    return summary


def _format_table(plan: LogicalPlan, points: Sequence[Point], request: Request) -> str:
    """The table: each point's values, what became of it, and what was measured of its event.

    Beside each value that is asked for stands, as `... measured`, what the scene shows of it. A
    point is infeasible where its values are no plan, or no seed could make a scene of it; where
    seeds were tried in vain it is not found.
    """
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    paths = sorted({**plan.spreads, **plan.legs}, key=plan.get_line)
    place = ["intersection"] if plan.places else []
    names = [*map(format_path, paths)]
    shown = [*(f"{name} measured" for name in names), *MEASURED]
    ends = ["status", "code", "reason", "folder", "red_lights"]
    table.writerow(["point", *place, *names, *ends, *shown])
    header = build_batch_header(read_source(request.source), request.options)
    with Journal(request.out, name=None, header=header) as journal:
        number = 0
        for point in points:
            end = ["infeasible", "no_plan", point.fault, "", ""]
            found: list[Any] = [""] * len(shown)
            if point.fault is None:
                entry, number = journal.get_entry(number), number + 1
                end = ["left", "", "", "", ""]
                if entry is not None:
                    end[:3] = entry.status, entry.code, entry.reason
                    if entry.status == "refused":
                        end[0] = "not_found" if entry.code in SEARCHED else "infeasible"
                    elif entry.status == "made":
                        made = request.out / entry.folder
                        proof = read_proof(made / "proof.json")
                        end[3:] = f"{SCENES}/{entry.folder}", str(proof.unasked_red_lights)
                        found = _measure_point(made, names)
            values = [point.values.get(path, "") for path in paths]
            table.writerow([point.name, *([point.place] if place else []), *values, *end, *found])
    return text.getvalue()


def _measure_point(made: Path, names: Sequence[str]) -> list[Any]:
    """What a scene shows of each field by name, then of `MEASURED`; empty where it shows none."""
    scene, proof = (json.loads((made / f"{name}.json").read_bytes()) for name in ("scene", "proof"))
    shown = list_encounters(scene, proof)
    event = next((each for each in shown if each.get("asked") == "asked"), shown[0])
    fields = (_measure_field(found, scene, proof) if (found := _FIELD.fullmatch(name)) else None
              for name in names)  # fmt: skip
    measured = [*fields, *(event.get(key) for key in MEASURED)]
    return [round(each, 3) if isinstance(each, float) else each for each in measured]


def measure_sweep(folder: Path) -> list[Covered]:
    """Which bins of the open fields were measured; nothing where the folder is no sweep's.

    The bins of a number hold as many points each; those of other fields are its values. A bin
    whose points are all infeasible is not wanted.
    """
    if not (folder / TABLE).is_file():
        return []
    table = (folder / TABLE).read_text("utf-8")
    rows: list[dict[str, Any]] = list(csv.DictReader(io.StringIO(table)))
    if MEASURED[-1] not in rows[0]:
        raise InputError(f"{folder / TABLE} has no measured columns; the same sweep writes them")
    fields = [name for name in rows[0] if _FIELD.fullmatch(name)]
    made = [row for row in rows if row["status"] == "made"]
    measured = [{n: _read_cell(row[f"{n} measured"]) for n in fields} for row in made]
    covered = []
    for name in fields:
        tried = [row for row in rows if row[name] != ""]  # a place without such a leg has none
        points: list[Any] = [row[name] for row in tried]
        if len(set(points)) > BINS and all(map(_TIME.fullmatch, points)):
            points = [f"{time[:2]}:00" for time in points]
            measured = [each | {name: f"{each[name]}"[:2] + ":00"} for each in measured]
        try:
            points = list(map(float, points))
        except ValueError:
            bins = build_bins(name, words=sorted(set(points)))
        else:
            bins = build_bins(name, _choose_edges(np.array(points)))
        counted = count_bins(measured, [bins])
        told = zip(points, tried, strict=True)
        may = {bins.find(p) for p, row in told if row["status"] != "infeasible"}
        counts = {bin_: n for bin_, n in counted.counts.items() if bin_[0] in may}
        shut = tuple(label for label in bins.labels if label not in may)
        covered.append(replace(counted, counts=counts, wanted=len(counts), shut=shut))
    return covered


def _read_cell(text: str) -> str | float | None:
    """What a cell of the table holds; None for nothing."""
    try:
        return float(text)
    except ValueError:
        return text or None


def _choose_edges(points: FloatArray) -> list[float]:
    """Edges of bins with as many points each, or around each of few values."""
    values = np.unique(points)
    if len(values) > BINS:
        return list(np.quantile(points, np.linspace(0, 1, BINS + 1)))
    half = np.diff(values) / 2 if len(values) > 1 else np.array([max(values[0] / 10, 0.1)])
    return [values[0] - half[0], *(values[:-1] + half)[: len(values) - 1], values[-1] + half[-1]]


def _measure_field(found: re.Match[str], scene: Mapping[str, Any], proof: Mapping[str, Any]) -> Any:
    """What the checker measured of a field, or the scene has; None where neither is."""
    section, n, key = found[1], int(found[2] or 0), found[3]
    if section == "context":
        return scene["meta"].get(key)
    if section == "agents":
        who = scene["meta"]["plan"]["agents"][n]["id"]
        return next(agent[key] for agent in scene["agents"] if agent["name"] == who)
    if section == "measures":
        values = proof["figures"].get("measures", [{}] * (n + 1))[n].get("values")
        return values[0] if values else None
    asked = scene["relations"][n]
    for event in proof["events"]:
        same = {event["from"], event["to"]} == {asked["from"], asked["to"]}
        if same and event["type"] == asked["type"]:
            # As the checker has it: of who strikes a pedestrian, else of the relation's `from`.
            own = event["kind"] == "pedestrian_strike" or asked["from"] == event["from"]
            impact = event["evidence"].get("speed_from" if own else "speed_to")
            measured = event | event["evidence"] | {"impact_speed": impact}
            return measured.get(_EVIDENCE.get(key, key))
    return None
