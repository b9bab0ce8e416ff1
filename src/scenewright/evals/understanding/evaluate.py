"""Evaluates methods and files of predictions on a folder of scenes, window by window."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from time import perf_counter
from typing import Any

from scenewright.backends import Backend
from scenewright.dataset.tables.markdown import format_table
from scenewright.errors import InputError
from scenewright.evals.understanding.cases import (
    EVENTS_AT,
    WINDOWS,
    ObservedScene,
    SceneCase,
    Split,
    is_foreseeable,
    list_scenes,
    observe,
    read_case,
)
from scenewright.evals.understanding.clips import cut_clips, read_source
from scenewright.evals.understanding.pipeline import find_method
from scenewright.evals.understanding.route_components import list_sides
from scenewright.evals.understanding.scoring import (
    AGENT_CLASSES,
    DEFINITION,
    KINDS,
    LEADS,
    ScenePrediction,
    SceneWindow,
    WindowScores,
    count_scene,
    read_predictions,
    summarise,
)
from scenewright.intersections import load_map

ProgressLog = Callable[[str], None]


@dataclass(frozen=True, eq=False)
class MethodScores:
    """A method's scores.

    Attributes:
        method: its name, or the file's; predictor: whose tracks the rule checker saw, if it did.
        rows: one per window; predictions: those that the method made; none of a file.
    """

    method: str
    predictor: str | None
    rows: tuple[WindowScores, ...]
    predictions: Mapping[SceneWindow, ScenePrediction]

    def to_json(self) -> dict[str, Any]:
        """Convert to plain JSON, without the predictions."""
        windows = [row.to_json() for row in self.rows]
        return {"method": self.method, "predictor": self.predictor, "windows": windows}


def load_cases(
    folder: Path, *, split: Split | None, whole: bool = False, log: ProgressLog = lambda _: None
) -> list[SceneCase]:
    """Load the clips to be understood, all at one intersection, in the order of their codes.

    Args:
        whole: load whole scenes instead, without those in which a requested event happens too
            early or too late.

    Raises:
        InputError: no scenes, none that a clip can be cut from, or scenes of two intersections.
    """
    names = list_scenes(folder, split=split)
    if whole:
        read = [read_case(folder / name) for name in names]
        cases = sorted(filter(is_foreseeable, read), key=lambda each: each.code)
        if len(cases) < len(read):
            first, last = EVENTS_AT
            early = f"{len(read) - len(cases)} of {len(read)} scenes left out"
            log(f"{early}: something happens before {first:g} or after {last:g} s")
        nothing = " holds no scene in which all happens in time"
    else:
        sources = []
        for n, name in enumerate(names, start=1):
            sources.append(read_source(folder / name))
            if n % 25 == 0:
                log(f"scene {n} of {len(names)} read")
        cases = cut_clips(sources)
        log(f"{len(cases)} clips of {len(names)} scenes, half of them with an event")
        nothing = (
            f": no clip can be cut from {len(names)} scenes; there must be scenes with an event "
            "and others like them without, or --whole to take scenes as they are"
        )
    if not cases:
        raise InputError(f"{folder}{nothing}")
    places = sorted({case.record.meta.intersection for case in cases})
    if len(places) > 1:
        raise InputError(f"{folder} holds scenes of {' and '.join(places)}; score one at a time")
    return cases


def observe_cases(
    cases: Sequence[SceneCase], windows: Sequence[float] = WINDOWS
) -> Iterator[ObservedScene]:
    """Observe scene by scene and window by window."""
    for case in cases:
        for window in windows:
            yield observe(case.record, scene=case.id, window=window)


def evaluate(
    cases: Sequence[SceneCase],
    method: str,
    *,
    windows: Sequence[float] = WINDOWS,
    backend: Backend | None = None,
    log: ProgressLog = lambda _: None,
) -> MethodScores:
    """Evaluate a method or a file of predictions.

    Args:
        cases: as from `load_cases`.
        method: a name of `METHODS`, or a file that ends in .jsonl.

    Raises:
        InputError: no such method or file, or a file that does not fit the scenes.
        BackendFault: a language model failed for good.
    """
    place = cases[0].record.meta.intersection
    if method.endswith((".jsonl", ".json")) or "/" in method:
        observed = {(seen.scene, seen.now): seen for seen in observe_cases(cases, windows)}
        read = read_predictions(Path(method), observed, sides=list_sides(load_map(place)))
        return MethodScores(Path(method).name, None, _score_windows(cases, read, {}), {})
    found = find_method(method, intersection=place, backend=backend)
    said: dict[SceneWindow, ScenePrediction] = {}
    seconds: dict[float, list[float]] = {window: [] for window in windows}
    for n, case in enumerate(cases, start=1):
        for seen in observe_cases([case], windows):
            if not said:
                found.predict(seen, case)  # loads what is loaded once, outside of the run time
            before = perf_counter()
            said[seen.scene, seen.now] = found.predict(seen, case)
            seconds[seen.now].append(perf_counter() - before)
        if n % 10 == 0:
            log(f"{found.name}: scene {n} of {len(cases)}")
    return MethodScores(found.name, found.predictor, _score_windows(cases, said, seconds), said)


def _score_windows(
    cases: Sequence[SceneCase],
    predictions: Mapping[SceneWindow, ScenePrediction],
    seconds: Mapping[float, Sequence[float]],
) -> tuple[WindowScores, ...]:
    """Score every window that is predicted; `seconds` by window if they were measured."""
    return tuple(
        summarise(
            [count_scene(c.labels, predictions[c.code, window], window=window) for c in cases],
            window=window,
            seconds=median(seconds[window]) if seconds else None,
        )
        for window in sorted({window for _, window in predictions})
    )


_PAPER = """The paper's Table 3 (its window is not stated, its scenes are others): exits, GMM 0.39
pedestrian, 30.72 vehicle, 12.76 overall; Qwen2.5-7B 6.64, 33.73, 21.94. Relations, TrajNet++ 98.49
normal, 9.84 collision, 6.49 yielding, 31.65 overall; Qwen2.5-7B 84.57, 20.00, 9.43, 48.20 in 3.54 s
a scene."""
_RELATIONS = (*KINDS, "macro", "macro 4", "micro")
_PARTS = (
    ("intent", (*AGENT_CLASSES, "overall"), "## Exits: accuracy [%]"),
    ("strict", _RELATIONS, f"## Relations: strict agent-level F1 [%]\n\n{DEFINITION}"),
    ("relations", _RELATIONS, "### Events count once both agents have been seen"),
)
"""Figures of `WindowScores`, their names, and the heading of their table."""


def format_report(found: Sequence[MethodScores], *, scenes: int, split: str, where: str) -> str:
    """Format the whole report."""
    parts = [
        f"# Understanding, {where}",
        f"{scenes} clips of the {split} half (or whole scenes). Intervals are 95 %, from a "
        "bootstrap over them.",
    ]
    scored = [
        (f"{each.method} ({each.predictor})" if each.predictor else each.method, row)
        for each in found
        for row in each.rows
    ]
    for part, names, title in _PARTS:
        rows = [
            (method, f"{row.window:g}", row.agents, *(
                getattr(row, part)[name].format("{0:.1f} [{1:.1f}, {2:.1f}]", "none")
                for name in names
            ), row.later, "" if row.seconds is None else f"{row.seconds:.3f}")
            for method, row in scored if getattr(row, part)
        ]  # fmt: skip
        if rows:
            heads = ("method", "window [s]", "agents", *names, "later", "s a scene")
            parts += [title, format_table(heads, rows)]
    spans = [f"{low:g} s and more" if high > 1e6 else f"{low:g} to {high:g} s"
             for low, high in LEADS]  # fmt: skip
    leads = [
        (method, f"{row.window:g}", kind, *(f"{k} of {n}" for k, n in own))
        for method, row in scored
        for kind, own in row.leads.items()
    ]
    if leads:
        table = format_table(("method", "window [s]", "relation", *spans), leads)
        parts += ["### Found by how long before the event", table]
    return "\n\n".join([*parts, _PAPER]) + "\n"
