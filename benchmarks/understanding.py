"""Section 5 from nothing to its tables, on scenes made for it.

    python benchmarks/understanding.py all DIR      the four steps below, one after the other
    python benchmarks/understanding.py dev DIR      scenes of development in DIR/dev
    python benchmarks/understanding.py tune DIR     exits, both calibrations, from DIR/dev
    python benchmarks/understanding.py test DIR     scenes of the test half in DIR/test
    python benchmarks/understanding.py score DIR    methods without a language model on DIR/test
    python benchmarks/understanding.py ask DIR      the questions of the language-model agent
    python benchmarks/understanding.py agent DIR    scores what was answered, beside the reasoner

Scenes are of many wordings, kinds and hours, with and without a word for the traffic; clips are cut
from them, as many without an event as with one. Both halves come from seeds of their own. What is
there already is not made again. The report is printed and lies in DIR/report. CPU seconds a scene
are measured apart, as wall time depends on what else the machine does.

A language model is asked by file, as in `model_planning.py`: `ask` writes the open questions about
100 clips of the first 160 test scenes to DIR/agent/questions.jsonl; the answers go, one line
per question, {"key": ..., "reply": "..."}, to DIR/agent/answers.jsonl; then `ask` again, as an
answer that does not fit is asked about once more, until no question is open; then `agent`.
"""

from __future__ import annotations

import argparse
import json
import random
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager, suppress
from functools import partial
from itertools import count
from multiprocessing import get_context
from pathlib import Path
from statistics import mean

import numpy as np
from model_planning import ByFile, OpenError

from scenewright.backends.text_backend import TextBackend
from scenewright.errors import ScenewrightError
from scenewright.evals.understanding import cases as cases_module
from scenewright.evals.understanding.cases import SceneCase, Split, assign_split, observe
from scenewright.evals.understanding.clips import cut_clips, read_source
from scenewright.evals.understanding.evaluate import (
    MethodScores,
    evaluate,
    format_report,
    load_cases,
)
from scenewright.evals.understanding.pipeline import find_method
from scenewright.evals.understanding.scoring import AGENT_CLASSES
from scenewright.files import write_atomically
from scenewright.graph.run import synthesize
from scenewright.intersections import ships_refiner

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
    "A right-turning car hits a cyclist going straight",
    "A car hits a cyclist",
    "A left-turning van hits an oncoming cyclist",
    "A car hits an e-scooter rider",
    "A cyclist hits a pedestrian",
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
    "A right-turning car yields to a cyclist going straight",
    "A left-turning car yields to an oncoming cyclist",
    "A cyclist yields to a pedestrian",
    "A car yields to an e-scooter rider",
)
NEAR_MISSES = (
    "A car nearly hits a pedestrian",
    "A left-turning car narrowly misses an oncoming car",
    "Two cars nearly collide",
    "A right-turning van narrowly misses a cyclist",
    "A car narrowly misses a jaywalker",
    "A truck nearly hits a car from the cross street",
    "A car nearly hits a cyclist",
    "A left-turning car nearly hits a pedestrian on the crosswalk",
    "An e-scooter rider is nearly hit by a right-turning car",
    "A cyclist nearly hits a pedestrian",
)
NORMAL = (
    "Ordinary traffic, nothing happens",
    "Normal traffic",
    "A normal scene",
    "Ordinary traffic with two cars",
    "Normal traffic with a pedestrian and a car",
    "Ordinary traffic with a cyclist and a car",
)
TRAFFIC = ("in light traffic", "in medium traffic", "in medium traffic", "")
"""Without a word for it streets are as full as at that hour."""
HOURS = ("at 8 am", "at noon", "at 5 pm", "at 10 pm", "at 6:30 am", "at 3 pm",
         "in the evening rush", "")  # fmt: skip
MIX = ((NORMAL, 20), (COLLISIONS, 40), (YIELDS, 50), (NEAR_MISSES, 30))
"""Scenes of each kind in 140: the paper's 40 collisions and 50 yields, and near misses.

Normal clips are cut from all of them, where nothing happens."""
SEEDS = {"dev": 43, "test": 13}
WINDOWS = (0.5, 1.0, 2.0, 3.0, 4.0, 5.0)
METHODS = ("reasoner", "constant_velocity", "gmm", "gmm_waypoints", "oracle_seen")
FEW = 100
"""Scenes on which the refiner is looked at: it takes seconds for each."""
SOME = (2.0, 4.0)
"""Windows of those methods that are only there to compare with."""

AGENT_SCENES, AGENT_CLIPS, AGENT_WINDOW = 160, 100, 4.0
"""Of the first test scenes so many clips are asked about, after so much of them [s]."""

Row = tuple[str, str, int]


def list_rows(number: int, seed: int, half: Split) -> list[Row]:
    """(id, text, seed) of every scene of a half; ids say nothing of their content."""
    rng, found = random.Random(f"understanding {seed}"), list[Row]()
    kinds = [texts for texts, share in MIX for _ in range(share)]
    for n in count():
        if len(found) == number:
            break
        name = f"s{seed}{n:05d}"
        if assign_split(name) == half:
            texts = rng.choice(kinds)
            text = f"{rng.choice(texts)} {rng.choice(TRAFFIC)} {rng.choice(HOURS)}"
            found.append((name, " ".join(text.split()), 1_000_000 * seed + n))
    return found


def make(folder: Path, listed: Sequence[Row], *, workers: int) -> int:
    """Makes what is missing; how many were refused."""
    folder.mkdir(parents=True, exist_ok=True)
    missing = [row for row in listed if not (folder / row[0] / "scene.json").is_file()]
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
        return sum(pool.map(partial(_make_scene, folder), missing, chunksize=8))


def _make_scene(folder: Path, row: Row) -> int:
    name, text, seed = row
    try:
        synthesize(text, seed=seed, refiner="none").save(folder / name)
    except ScenewrightError:
        return 1
    return 0


def measure_cpu_seconds(cases: list[SceneCase], name: str, *, window: float = 4.0) -> float:
    """CPU seconds a scene."""
    method = find_method(name, intersection=cases[0].record.meta.intersection)
    taken = []
    for case in cases[:200]:
        seen = observe(case.record, scene=case.id, window=window)
        before = time.process_time()
        method.predict(seen, case)
        taken.append(time.process_time() - before)
    return mean(taken[1:])


def evaluate_method(folder: Path, name: str) -> MethodScores:
    """A method's figures on the test half of a folder."""
    cases = sorted(load_cases(folder, split="test"), key=lambda each: each.code)
    if name == "trajnet":
        return evaluate(cases[:FEW], name, windows=(4.0,))
    return evaluate(cases, name, windows=WINDOWS if name in ("reasoner", "oracle_seen") else SOME)


def list_agent_cases(folder: Path) -> list[SceneCase]:
    """The clips about which a language model is asked."""
    names = [name for name, _, _ in list_rows(AGENT_SCENES, SEEDS["test"], "test")]
    made = [folder / "test" / name for name in names if (folder / "test" / name).is_dir()]
    return cut_clips(map(read_source, made))[:AGENT_CLIPS]


def ask(folder: Path) -> int:
    """Writes the questions that are open; how many they are."""
    place = folder / "agent"
    place.mkdir(exist_ok=True)
    by_file, cases = ByFile(place), list_agent_cases(folder)
    method = find_method(
        "agent", intersection=cases[0].record.meta.intersection, backend=TextBackend(by_file)
    )
    for case in cases:
        with suppress(OpenError):
            method.predict(observe(case.record, scene=case.id, window=AGENT_WINDOW), case)
    lines = [json.dumps(each, ensure_ascii=False) + "\n" for each in by_file.open.values()]
    write_atomically(place / "questions.jsonl", "".join(lines).encode())
    print(f"{len(cases)} clips, {len(lines)} questions open: {place / 'questions.jsonl'}")
    return len(lines)


def score_agent(folder: Path) -> None:
    """Scores the agent by its answers, beside the methods that need none, on the same clips."""
    cases, by_file = list_agent_cases(folder), TextBackend(ByFile(folder / "agent"))
    found = [
        evaluate(cases, name, windows=(AGENT_WINDOW,), backend=by_file)
        for name in ("agent", "reasoner", "constant_velocity", "oracle_seen")
    ]
    text = format_report(found, scenes=len(cases), split="test", where="the agent's clips")
    write_atomically(folder / "agent" / "report.md", text.encode())
    print(text)


def guess_blindly(cases: Sequence[SceneCase]) -> tuple[float, float, float]:
    """AUC of boosted trees that see lengths and numbers of agents alone, with 95 % bounds.

    They separate clips with an event from those without, five folds by scene.
    """
    from sklearn.ensemble import HistGradientBoostingClassifier
    from sklearn.metrics import roc_auc_score
    from sklearn.model_selection import GroupKFold, cross_val_predict

    values = np.array([
        [case.record.meta.duration, *(
            sum(a.type == kind and a.spawn_time <= by for a in case.record.agents)
            for by in (0.0, *WINDOWS) for kind in AGENT_CLASSES
        )]
        for case in cases
    ])  # fmt: skip
    truth = np.array([case.named is not None for case in cases])
    groups = [case.scene for case in cases]
    trees = HistGradientBoostingClassifier(max_iter=60, random_state=0)
    said = cross_val_predict(
        trees, values, truth, groups=groups, cv=GroupKFold(5), method="predict_proba"
    )[:, 1]
    rng = np.random.default_rng(0)
    drawn = [rng.integers(len(cases), size=len(cases)) for _ in range(500)]
    low, high = np.quantile([roc_auc_score(truth[n], said[n]) for n in drawn], (0.025, 0.975))
    return float(roc_auc_score(truth, said)), float(low), float(high)


def score(folder: Path, *, workers: int) -> None:
    """Scores every method, each in a process of its own, and writes the report."""
    cases = load_cases(folder / "test", split="test")
    place = cases[0].record.meta.intersection
    names = [*METHODS, *(["trajnet"] if ships_refiner(place) else [])]
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
        found = list(pool.map(partial(evaluate_method, folder / "test"), names))
    text = format_report(found, scenes=len(cases), split="test", where=place)
    if "trajnet" in names:
        text += f"\ntrajnet: the first {min(FEW, len(cases))} of the scenes.\n"
    slow = [name for name in names if name != "trajnet"]
    text += "\nCPU seconds a scene at 4 s: " + ", ".join(
        f"{name} {measure_cpu_seconds(cases, name):.4f}" for name in slow
    )
    auc, low, high = guess_blindly(cases)
    text += f"\nlengths and counts alone: AUC {auc:.2f} [{low:.2f}, {high:.2f}]"
    report = folder / "report"
    report.mkdir(exist_ok=True)
    figures = {"scenes": len(cases), "methods": [each.to_json() for each in found]}
    write_atomically(report / "report.json", json.dumps(figures, indent=1).encode())
    write_atomically(report / "report.md", (text + "\n").encode())
    print(text)


def tune(folder: Path, *, workers: int) -> None:
    """Fits the exit model and the calibration, and puts them where they ship."""
    place, dev = Path(cases_module.__file__).parent, str((folder / "dev").resolve())
    for module, file in (("exit_tuning", "exits.npz"), ("tuning", "calibration.npz")):
        words = [dev, "--workers", str(workers), "--out", str(place / file)]
        command = [sys.executable, "-m", f"lab.understanding.{module}", *words]
        subprocess.run(command, cwd=Path(__file__).parents[1], check=True)


@contextmanager
def time_step(step: str) -> Iterator[None]:
    """Print how long a step took."""
    before = time.perf_counter()
    yield
    print(f"{step}: {time.perf_counter() - before:.0f} s", file=sys.stderr, flush=True)


def main() -> None:
    """One step, or all."""
    words = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    words.add_argument("step", choices=("all", "dev", "tune", "test", "score", "ask", "agent"))
    words.add_argument("folder", type=Path)
    words.add_argument("--dev", type=int, default=1_600, help="scenes of development")
    words.add_argument("--test", type=int, default=640, help="test scenes")
    words.add_argument("--workers", type=int, default=2)
    given = words.parse_args()
    steps = ("dev", "tune", "test", "score") if given.step == "all" else (given.step,)
    for step in steps:
        with time_step(step):
            if step == "tune":
                tune(given.folder, workers=given.workers)
            elif step == "ask":
                ask(given.folder)
            elif step == "agent":
                score_agent(given.folder)
            elif step == "score":
                score(given.folder, workers=given.workers)
            else:
                half: Split = "dev" if step == "dev" else "test"
                listed = list_rows(getattr(given, step), SEEDS[step], half)
                refused = make(given.folder / step, listed, workers=given.workers)
                print(f"{len(listed)} rows, {refused} refused", file=sys.stderr, flush=True)


if __name__ == "__main__":
    main()
