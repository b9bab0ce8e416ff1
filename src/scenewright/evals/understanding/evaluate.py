"""Scores methods and files of predictions on a folder of scenes, window by window."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import Any

from scenewright.backends import Backend
from scenewright.errors import InputError
from scenewright.evals.understanding.dataset import (
    EVENTS_AT,
    Case,
    Split,
    foreseeable,
    read_case,
    scene_ids,
)
from scenewright.evals.understanding.methods import Method, method_named
from scenewright.evals.understanding.observing import WINDOWS, ObservationRow, observe
from scenewright.evals.understanding.predictions import (
    Prediction,
    PredictionRow,
    read_predictions,
    row_of,
)
from scenewright.evals.understanding.scoring import Row, Tally, summarise, tally
from scenewright.evals.understanding.ways import sides_of
from scenewright.intersections import load_map

Tell = Callable[[str], None]


@dataclass(frozen=True, eq=False)
class Evaluated:
    """A method's figures.

    Attributes:
        method: its name, or the file's; predictor: whose tracks it has checked.
        rows: one per window; predictions: what it said, in the order of scenes and windows.
    """

    method: str
    predictor: str | None
    rows: tuple[Row, ...]
    predictions: tuple[PredictionRow, ...]

    def to_json(self) -> dict[str, Any]:
        """Plain JSON."""
        return {
            "method": self.method,
            "predictor": self.predictor,
            "windows": [row.to_json() for row in self.rows],
        }


def load(folder: Path, *, split: Split | None, tell: Tell = lambda _: None) -> list[Case]:
    """The scenes to be understood, all at one intersection.

    Scenes in which something that was asked for happens earlier or later are left out.

    Raises:
        InputError: no scenes, or scenes of two intersections.
    """
    cases = []
    names = scene_ids(folder, split=split)
    for n, name in enumerate(names, start=1):
        cases.append(read_case(folder / name))
        if n % 25 == 0:
            tell(f"scene {n} of {len(names)} read")
    read, cases = len(cases), [case for case in cases if foreseeable(case)]
    if len(cases) < read:
        first, last = EVENTS_AT
        early = f"{read - len(cases)} of {read} scenes left out"
        tell(f"{early}: something happens before {first:g} or after {last:g} s")
    if not cases:
        raise InputError(f"{folder} holds no scene in which all happens in time")
    places = sorted({case.record.meta.intersection for case in cases})
    if len(places) > 1:
        raise InputError(f"{folder} holds scenes of {' and '.join(places)}; score one at a time")
    return cases


def observations(
    cases: Iterable[Case], windows: Sequence[float] = WINDOWS
) -> Iterator[ObservationRow]:
    """What may be seen, scene by scene and window by window; in the order of the codes."""
    for case in sorted(cases, key=lambda each: each.code):
        for window in windows:
            yield observe(case.record, scene=case.id, window=window)


def evaluate(
    cases: Sequence[Case],
    method: str,
    *,
    windows: Sequence[float] = WINDOWS,
    backend: Backend | None = None,
    tell: Tell = lambda _: None,
) -> Evaluated:
    """Figures of a method, or of a file of predictions.

    Args:
        method: a name of `METHODS`, or a file that ends in .jsonl.

    Raises:
        InputError: no such method or file, or a file that does not fit the scenes.
        BackendFault: a language model failed for good.
    """
    intersection = cases[0].record.meta.intersection
    if method.endswith((".jsonl", ".json")) or "/" in method:
        return _from_file(cases, Path(method), windows)
    found = method_named(method, intersection=intersection, backend=backend)
    tallies: dict[float, list[Tally]] = {window: [] for window in windows}
    seconds: dict[float, list[float]] = {window: [] for window in windows}
    rows: list[PredictionRow] = []
    for n, case in enumerate(sorted(cases, key=lambda each: each.code), start=1):
        for window in windows:
            seen = observe(case.record, scene=case.id, window=window)
            if n == 1:
                found.predict(seen, case)  # what is read once is nobody's time
            said = found.predict(seen, case)
            tallies[window].append(tally(case.labels, said, window=window))
            seconds[window].append(said.seconds or 0.0)
            rows.append(row_of(seen, said))
        if n % 10 == 0:
            tell(f"{found.name}: scene {n} of {len(cases)}")
    return _evaluated(found, tallies, seconds, rows)


def _evaluated(
    method: Method,
    tallies: Mapping[float, list[Tally]],
    seconds: Mapping[float, list[float]],
    rows: list[PredictionRow],
) -> Evaluated:
    figures = tuple(
        summarise(found, window=window, seconds=median(seconds[window]))
        for window, found in tallies.items()
    )
    return Evaluated(method.name, method.predictor, figures, tuple(rows))


def _from_file(cases: Sequence[Case], file: Path, windows: Sequence[float]) -> Evaluated:
    seen = {(row.scene, row.window): row for row in observations(cases, windows)}
    sides = sides_of(load_map(cases[0].record.meta.intersection))
    found = read_predictions(file, seen, sides=sides)
    by_code = {case.code: case for case in cases}
    figures = []
    for window in sorted({window for _, window in found}):
        mine = [
            (code, said) for (code, at), said in sorted(found.items(), key=_key) if at == window
        ]
        tallies = [tally(by_code[code].labels, said, window=window) for code, said in mine]
        figures.append(summarise(tallies, window=window, seconds=None))
    return Evaluated(file.name, None, tuple(figures), ())


def _key(item: tuple[tuple[str, float], Prediction]) -> tuple[str, float]:
    return item[0]
