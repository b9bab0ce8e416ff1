"""How near the iterated roll-out comes to tracks that nobody was trained on.

`python -m scenewright.evals.realism.rollouts --corpus FILE.npz [--taf-bw FOLDER]`. Scenes of up to
30 s are cut from the test hours, or from real recordings. Everybody's first 9 steps of 0.4 s are
given, then a goal on its way every 8 steps, the last at least so long before the track ends; the
end itself is never given. All agents of a scene are rolled out together to their ends. Beside the
network stand a cubic spline and even motion through the same places at the same times.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from scenewright.errors import InputError
from scenewright.scene.base import FloatArray
from scenewright.tools.recordings import Recording, cut_windows, load_recordings
from scenewright.tools.recordings.taf_bw import read_taf_bw
from scenewright.tools.recordings.windows import BoolArray

COLUMNS = 75
GIVEN, SPACING = 9, 8
FURTHER = 4
"""Steps that a track must at least go on for after what is given."""
LEAD = 1
"""Steps before a goal is due from which the next one counts; chosen on validation hours."""
BEFORE_END = (2, 4, 8)
"""Steps of 0.4 s from the last goal to the end that are tried."""
_DRAWS = 1000


class Task(NamedTuple):
    """One scene to roll out.

    Attributes:
        xy: [N, T, 2] true positions [m], NaN where not there; given, goals: [N, T] which are told.
        kinds: [N] classes.
    """

    xy: FloatArray
    given: BoolArray
    goals: BoolArray
    kinds: tuple[str, ...]


def tasks(recordings: Sequence[Recording], *, before_end: int, most: int) -> Iterator[Task]:
    """Scenes end to end, evenly chosen if there are more than `most`."""
    cuts = [
        (recording, window)
        for recording in recordings
        for window in cut_windows(recording, steps=COLUMNS, stride=4 * COLUMNS, least_whole=0)
    ]
    chosen = np.unique(np.linspace(0, len(cuts) - 1, min(most, len(cuts))).astype(int))
    for recording, window in (cuts[k] for k in chosen):
        agents = [recording.agents[k] for k in window.members]
        kept = [k for k, agent in enumerate(agents) if agent.subtype != "bicycle"]
        xy = np.where(window.present[kept][..., None], window.xy[kept], np.nan)
        marks = [_told(row, before_end) for row in window.present[kept]]
        if any(goals.any() for _, goals in marks):
            yield Task(
                xy,
                np.array([given for given, _ in marks]),
                np.array([goals for _, goals in marks]),
                tuple(agents[k].shape.type for k in kept),
            )


def _told(present: BoolArray, before_end: int) -> tuple[BoolArray, BoolArray]:
    """[T] what is given of a track, and its goals; a track that is too short is given whole."""
    given, goals = present.copy(), np.zeros_like(present)
    first, count = int(np.argmax(present)), int(present.sum())
    last_goal = first + count - 1 - before_end
    if count >= GIVEN + FURTHER + before_end:
        given[first + GIVEN :] = False
        at = np.append(np.arange(first + GIVEN - 1 + SPACING, last_goal, SPACING), last_goal)
        goals[at] = True
    return given, goals


def rolled(net: Any, task: Task, *, keep: int | None = None, lead: int = LEAD) -> FloatArray:
    """[N, T, 2] the mean motion that the network writes.

    Args:
        keep: steps after which what was written is observed; the network's horizon if None.
        lead: see `roll_out`.
    """
    import torch

    from scenewright.tools.trajnet_refiner.model import CLASSES
    from scenewright.tools.trajnet_refiner.rollout import Waypoints, roll_out

    most = max(1, int(task.goals.sum(axis=1).max()))
    places = np.full((len(task.xy), most, 2), np.nan)
    due = np.full((len(task.xy), most), np.nan)
    for n, row in enumerate(task.goals):
        at = np.flatnonzero(row)
        places[n, : len(at)], due[n, : len(at)] = task.xy[n, at], at
    there = np.asarray(np.isfinite(task.xy).all(-1))
    until = there.shape[1] - np.argmax(there[:, ::-1], axis=1)
    tell = [torch.from_numpy(a.astype(np.float32))[None] for a in (
        np.where(task.given[..., None], task.xy, np.nan), places, due)]  # fmt: skip
    with torch.no_grad():
        found = roll_out(
            net, tell[0], waypoints=Waypoints(tell[1], tell[2]), keep=keep,
            lead=lead,
            classes=torch.tensor([[CLASSES.index(kind) for kind in task.kinds]]),
            until=torch.from_numpy(until)[None],
        )  # fmt: skip
    return np.asarray(found[0].numpy(), dtype=np.float64)


def splined(task: Task) -> FloatArray:
    """[N, T, 2] a cubic spline through what is given and the goals, and beyond the last."""
    from scipy import interpolate

    make: Any = interpolate.CubicSpline
    return _through(task, lambda at, xy, when: make(at, xy)(when))


def even(task: Task) -> FloatArray:
    """[N, T, 2] even motion from place to place, and on beyond the last."""

    def straight(at: FloatArray, xy: FloatArray, when: FloatArray) -> FloatArray:
        k = np.clip(np.searchsorted(at, when) - 1, 0, len(at) - 2)
        share = ((when - at[k]) / (at[k + 1] - at[k]))[:, None]
        return np.asarray(xy[k] + share * (xy[k + 1] - xy[k]))

    return _through(task, straight)


def _through(task: Task, curve: Callable[..., FloatArray]) -> FloatArray:
    found = task.xy.copy()
    for n in np.flatnonzero(task.goals.any(axis=1)):
        at = np.flatnonzero(task.given[n] | task.goals[n])
        when = np.flatnonzero(np.isfinite(task.xy[n]).all(-1))
        found[n, when] = curve(at.astype(np.float64), task.xy[n, at], when.astype(np.float64))
    return found


def errors(task: Task, found: FloatArray) -> Iterator[tuple[str, float, float]]:
    """Class, mean and final distance [m] of everybody who was rolled out."""
    for n in np.flatnonzero(task.goals.any(axis=1)):
        told = np.isfinite(task.xy[n]).all(-1) & ~task.given[n]
        off = np.hypot(*(found[n, told] - task.xy[n, told]).T)
        yield task.kinds[n], float(off.mean()), float(off[-1])


def table(
    net: Any,
    recordings: Sequence[Recording],
    *,
    most: int,
    named: str,
    keep: int | None = None,
    lead: int = LEAD,
) -> Iterator[str]:
    """Lines of the table, by how long before the end the last goal lies."""
    for before_end in BEFORE_END:
        rows: dict[tuple[str, str], list[tuple[float, float]]] = {}
        for task in tasks(recordings, before_end=before_end, most=most):
            for how, found in (
                ("refiner", rolled(net, task, keep=keep, lead=lead)),
                ("spline", splined(task)),
                ("even", even(task)),
            ):
                for kind, ade, fde in errors(task, found):
                    for label in (kind, "all"):
                        rows.setdefault((label, how), []).append((ade, fde))
        for label in ("vehicle", "pedestrian", "all"):
            cells = [_cell(np.array(rows.get((label, how), [])).reshape(-1, 2))
                     for how in ("refiner", "spline", "even")]  # fmt: skip
            count = len(rows.get((label, "refiner"), []))
            yield (
                f"| {named} | {before_end * 0.4:.1f} s | {label} | {count} | "
                + " | ".join(cells)
                + " |"
            )


def _cell(values: FloatArray) -> str:
    if len(values) == 0:
        return "–"
    rng = np.random.default_rng(0)
    again = values[rng.integers(0, len(values), (_DRAWS, len(values))), 1].mean(axis=1)
    low, high = np.quantile(again, [0.025, 0.975])
    ade, fde = values.mean(axis=0)
    return f"{ade:.2f} / {fde:.2f} [{low:.2f}, {high:.2f}]"


def main(argv: Sequence[str] | None = None) -> int:
    """Print the table."""
    words = argparse.ArgumentParser(prog="python -m scenewright.evals.realism.rollouts",
                                    description=__doc__)  # fmt: skip
    words.add_argument("--intersection", default="amsterdam_120")
    words.add_argument("--weights", type=Path, help="the bundle's if none are named")
    words.add_argument("--corpus", type=Path, help="file of `intersections corpus`")
    words.add_argument("--taf-bw", type=Path, help="folder of real tracks")
    words.add_argument("--most", type=int, default=60, help="scenes of each source")
    words.add_argument("--keep", type=int, help="steps kept before everybody is observed anew")
    words.add_argument("--lead", type=int, default=LEAD,
                       help="steps before a goal is due at which the next one counts")  # fmt: skip
    words.add_argument("--split", choices=("fit", "validation", "test"), default="test")
    told = words.parse_args(argv)
    try:
        _print(told)
    except InputError as fault:
        print(fault, file=sys.stderr)
        return fault.exit_code
    return 0


def _print(told: argparse.Namespace) -> None:
    import torch

    from scenewright.tools.trajnet_refiner.bundled import bundled_refiner
    from scenewright.tools.trajnet_refiner.store import load_refiner

    shipped = None if told.weights else bundled_refiner(told.intersection)
    if told.weights is None and shipped is None:
        raise InputError(f"{told.intersection} ships no refiner; name --weights")
    net = load_refiner(told.weights) if shipped is None else shipped.net
    sources = []
    if told.corpus:
        hours = load_recordings(told.corpus, split=told.split)
        sources.append((f"corpus {told.split} hours", hours))
    if told.taf_bw:
        sources.append(("taf-bw", read_taf_bw(told.taf_bw).recordings))
    if not sources:
        raise InputError("name a --corpus or a folder of --taf-bw tracks")
    torch.set_num_threads(1)  # scenes are small: threads only wait for each other
    print("| tracks | end after last goal | class | n | refiner ADE / FDE | spline | even motion |")
    print("|---|---|---|---|---|---|---|")
    for named, recordings in sources:
        for line in table(
            net, recordings, most=told.most, named=named, keep=told.keep, lead=told.lead
        ):
            print(line, flush=True)


if __name__ == "__main__":
    raise SystemExit(main())
