"""Errors of the iterated roll-out on held-out tracks.

`python -m lab.rollouts.rollouts --corpus FILE.npz [--taf-bw FOLDER] [--prior-goals]`.
Scenes of up to 30 s are cut from the test hours, or from real recordings. The first 9 steps of
0.4 s of each track are given, then a goal on the track every 8 steps, the last at least so long
before the track ends; the end itself is never given. With `--prior-goals` also goals on the prior's
path, due when the agent is nearest to them; and goals with the prior's times, too: then only the
route and the time of the end are given after the beginning. All agents of a scene are rolled out
together to their ends; short tracks, and with `--prior-goals` those without a route, are given
whole. The network is compared with a cubic spline and even motion through the same goals.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from lab.rollouts.left_out import fit_left_out_routes
from lab.rollouts.prior_goals import FindRoutePrior, load_bundle_routes
from lab.rollouts.rollout_tasks import (
    COLUMNS,
    RolloutTask,
    build_tasks,
    move_goals_to_prior,
    sample_prior_goals,
)
from scenewright.errors import InputError
from scenewright.evals.bootstrap import compute_interval
from scenewright.scene.base import FloatArray
from scenewright.scene.track import STEP
from scenewright.tools.track_io import Recording, load_recordings
from scenewright.tools.track_io.recording import TRAJNET_EVERY
from scenewright.tools.track_io.taf_bw import SMOOTHING, read_taf_bw

LEAD = 1
"""Steps before a goal is due from which the next one counts; chosen on validation hours."""
BEFORE_END = (2, 4, 8)
"""Steps of 0.4 s from the last goal to the end that are tried."""
DRAWN = 20
"""Draws of the prior."""
_DRAWS = 1000
UNIMPEDED = {"vehicle": 3.0, "pedestrian": 0.5}
"""An agent that is never slower than this [m/s] counts as unimpeded."""


def run_refiner(
    net: Any, task: RolloutTask, *, keep: int | None = None, lead: int = LEAD
) -> FloatArray:
    """Roll out the network: its mean motion [N, T, 2].

    Args:
        keep: steps after which what was written is observed; the network's horizon if None.
        lead: see `run_rollout`.
    """
    from scenewright.tools.trajnet_refiner.config import CLASSES
    from scenewright.tools.trajnet_refiner.rollout import Waypoints, run_rollout

    marked = np.asarray(np.isfinite(task.goals).all(-1))
    most = max(1, int(marked.sum(axis=1).max()))
    places = np.full((len(task.xy), most, 2), np.nan)
    due = np.full((len(task.xy), most), np.nan)
    for n in range(len(marked)):
        at = np.flatnonzero(marked[n])
        places[n, : len(at)], due[n, : len(at)] = task.goals[n, at], at
    until = COLUMNS - np.argmax(task.there[:, ::-1], axis=1)
    return run_rollout(
        net, np.where(task.given[..., None], task.xy, np.nan), waypoints=Waypoints(places, due),
        keep=keep, lead=lead, until=until,
        classes=np.array([CLASSES.index(kind) for kind in task.kinds]),
    )  # fmt: skip


def fit_splines(task: RolloutTask) -> FloatArray:
    """Fit cubic splines [N, T, 2] through the given part and the goals, and beyond the last."""
    from scipy import interpolate

    make: Any = interpolate.CubicSpline
    return _fill_sought(task, lambda at, xy, when: make(at, xy)(when))


def interpolate_evenly(task: RolloutTask) -> FloatArray:
    """Interpolate [N, T, 2] evenly from place to place, and on beyond the last."""

    def interpolate(at: FloatArray, xy: FloatArray, when: FloatArray) -> FloatArray:
        k = np.clip(np.searchsorted(at, when) - 1, 0, len(at) - 2)
        share = ((when - at[k]) / (at[k + 1] - at[k]))[:, None]
        return np.asarray(xy[k] + share * (xy[k + 1] - xy[k]))

    return _fill_sought(task, interpolate)


def _fill_sought(task: RolloutTask, curve: Callable[..., FloatArray]) -> FloatArray:
    found = task.xy.copy()
    places = np.where(task.given[..., None], task.xy, task.goals)
    for n in task.asked:
        at = np.flatnonzero(np.isfinite(places[n, :, 0]))
        when = np.flatnonzero(task.sought[n])
        found[n, when] = curve(at.astype(np.float64), places[n, at], when.astype(np.float64))
    return found


def compute_errors(task: RolloutTask, found: FloatArray) -> FloatArray:
    """Compute mean and final distance [A, 2] [m] of all agents that were rolled out."""
    rows = []
    for n in task.asked:
        off = np.hypot(*(found[n] - task.xy[n])[task.sought[n]].T)
        rows.append((float(off.mean()), float(off[-1])))
    return np.array(rows).reshape(-1, 2)


Method = Callable[[RolloutTask], FloatArray]
Methods = Mapping[str, Method]


def build_methods(net: Any, *, keep: int | None = None, lead: int = LEAD) -> Methods:
    """Build the compared methods by name: the network, splines and even motion."""
    return {
        "refiner": lambda task: run_refiner(net, task, keep=keep, lead=lead),
        "spline": fit_splines,
        "even": interpolate_evenly,
    }


class RolloutErrors(NamedTuple):
    """The errors of all rolled-out agents of some tasks.

    Attributes:
        goals: where they came from; before_end: steps from the last to the end.
        kinds: [A] classes; off: [A, 2] mean and final distance [m], by method.
    """

    goals: str
    before_end: int
    kinds: tuple[str, ...]
    off: Mapping[str, FloatArray]

    def format_lines(self, named: str) -> Iterator[str]:
        """Format the lines of the table, by class."""
        for label in ("vehicle", "pedestrian", "all"):
            mine = np.array([label in (kind, "all") for kind in self.kinds], dtype=bool)
            cells = [_format_errors(off[mine]) for off in self.off.values()]
            last = f"{self.before_end * 0.4:.1f} s"
            yield (
                " | ".join([f"| {named}", self.goals, last, label, str(mine.sum()), *cells]) + " |"
            )


def compare_methods(
    of: Methods, recordings: Sequence[Recording], *, most: int, way_of: FindRoutePrior | None = None
) -> Iterator[RolloutErrors]:
    """Compare the methods on a source: goals on the true tracks, with `way_of` also the priors'."""
    for before_end in BEFORE_END:
        scenes = list(build_tasks(recordings, before_end=before_end, most=most, way_of=way_of))
        yield _measure_errors("true way", before_end, of, scenes)
        if way_of is not None:
            yield _measure_errors(
                "prior's way", before_end, of, [move_goals_to_prior(t) for t in scenes]
            )
    if way_of is not None:
        yield from _compare_prior_draws(
            of, list(build_tasks(recordings, before_end=0, most=most, way_of=way_of))
        )


def _measure_errors(
    goals: str, before_end: int, of: Methods, scenes: Sequence[RolloutTask]
) -> RolloutErrors:
    off = {
        name: [compute_errors(task, method(task)) for task in scenes] for name, method in of.items()
    }
    return RolloutErrors(
        goals, before_end, _list_kinds(scenes), {k: _concatenate(v) for k, v in off.items()}
    )


def _compare_prior_draws(of: Methods, scenes: Sequence[RolloutTask]) -> Iterator[RolloutErrors]:
    """Compare draws of the prior on average and at best, for all and for unimpeded agents.

    The prior's driving profile is that of unimpeded agents, without lights or queues.
    """
    rng = np.random.default_rng(0)
    found: dict[str, list[FloatArray]] = {name: [np.zeros((0, DRAWN, 2))] for name in of}
    for task in scenes:
        draws = list(sample_prior_goals(task, size=DRAWN, rng=rng))
        for name, method in of.items():
            found[name].append(
                np.stack([compute_errors(draw, method(draw)) for draw in draws], axis=1)
            )
    every = {name: np.concatenate(parts) for name, parts in found.items()}
    kinds = np.array(_list_kinds(scenes))
    unheld = np.array([_is_never_slow(task, n) for task in scenes for n in task.asked], dtype=bool)
    for which, those in ((" of all", np.ones_like(unheld)), (" of who is never slow", unheld)):
        for how, of_draws in ((f"mean of {DRAWN} draws", np.mean), ("best of them", np.min)):
            off = {name: of_draws(values[those], axis=1) for name, values in every.items()}
            yield RolloutErrors(f"prior, {how}{which}", 0, tuple(kinds[those]), off)


def _is_never_slow(task: RolloutTask, n: int) -> bool:
    xy = task.xy[n, task.there[n]]
    speed = np.hypot(*np.diff(xy, axis=0).T) / (TRAJNET_EVERY * STEP)
    return bool(speed.min() >= UNIMPEDED[task.kinds[n]])


def _list_kinds(scenes: Sequence[RolloutTask]) -> tuple[str, ...]:
    return tuple(task.kinds[n] for task in scenes for n in task.asked)


def _concatenate(parts: Sequence[FloatArray]) -> FloatArray:
    return np.concatenate([np.zeros((0, 2)), *parts])


def _format_errors(values: FloatArray) -> str:
    if len(values) == 0:
        return "–"
    rng = np.random.default_rng(0)
    again = values[rng.integers(0, len(values), (_DRAWS, len(values))), 1].mean(axis=1)
    low, high = compute_interval(again)
    ade, fde = values.mean(axis=0)
    return f"{ade:.2f} / {fde:.2f} [{low:.2f}, {high:.2f}]"


def _count(text: str) -> int:
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"a whole number from 1, not {text!r}")
    return int(text)


def main(argv: Sequence[str] | None = None) -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(prog="python -m lab.rollouts.rollouts",
                                    description=__doc__)  # fmt: skip
    parser.add_argument("--intersection", default="amsterdam_120")
    parser.add_argument("--weights", type=Path, help="the bundle's if none are named")
    parser.add_argument("--corpus", type=Path, help="file of `lab.bundle.record_corpus`")
    parser.add_argument("--taf-bw", type=Path, help="folder of real tracks")
    parser.add_argument("--smoothing", type=float, default=SMOOTHING,
                       help="of real positions before anything else [s]")  # fmt: skip
    parser.add_argument("--most", type=_count, default=60, help="scenes of each source")
    parser.add_argument(
        "--keep", type=_count, help="steps kept before all agents are observed anew"
    )
    parser.add_argument("--lead", type=int, choices=range(12), default=LEAD,
                       help="steps before a goal is due at which the next one counts")  # fmt: skip
    parser.add_argument("--prior-goals", action="store_true",
                       help="goals from the priors, too; agents need a route")  # fmt: skip
    parser.add_argument("--split", choices=("fit", "validation", "test"), default="test")
    arguments = parser.parse_args(argv)
    try:
        _print(arguments)
    except InputError as fault:
        print(fault, file=sys.stderr)
        return fault.exit_code
    return 0


def _print(arguments: argparse.Namespace) -> None:
    from scenewright.tools.trajnet_refiner.bundled import load_bundled_refiner

    if arguments.prior_goals and arguments.split != "test":
        raise InputError("the corpus' priors know the hours of that split; leave out --split")
    shipped = None if arguments.weights else load_bundled_refiner(arguments.intersection)
    if arguments.weights is None and shipped is None:
        raise InputError(f"{arguments.intersection} ships no refiner; name --weights")
    net = _read(arguments.weights) if shipped is None else shipped.net
    sources = list(_read_sources(arguments))
    if not sources:
        raise InputError("name a --corpus or a folder of --taf-bw tracks")
    of = build_methods(net, keep=arguments.keep, lead=arguments.lead)
    print("| tracks | goals | end after last goal | class | n | ADE / FDE of the refiner | spline "
          "| even motion |\n" + "|---" * 8 + "|")  # fmt: skip
    for named, recordings, way_of in sources:
        for row in compare_methods(of, recordings, most=arguments.most, way_of=way_of):
            print(*row.format_lines(named), sep="\n", flush=True)


def _read(weights: Path) -> Any:
    from scenewright.tools.trajnet_refiner.store import load_refiner

    try:
        return load_refiner(weights)
    except OSError as fault:
        raise InputError(f"cannot read {weights}: {fault.strerror or fault}") from None


def _read_sources(
    arguments: argparse.Namespace,
) -> Iterator[tuple[str, Sequence[Recording], FindRoutePrior | None]]:
    """Read the recordings to roll out, by name, and the source of their priors."""
    if arguments.corpus:
        hours = load_recordings(arguments.corpus, split=arguments.split)
        ways = load_bundle_routes(arguments.intersection) if arguments.prior_goals else None
        yield f"corpus {arguments.split} hours", hours, ways
    if arguments.taf_bw:
        real = read_taf_bw(arguments.taf_bw, smoothing=arguments.smoothing)
        ways = fit_left_out_routes(arguments.taf_bw) if arguments.prior_goals else None
        for site in real.removed:
            own = [each for each in real.recordings if each.name.split("/")[0] == site]
            if any(each.agents for each in own):
                yield f"taf-bw {site}", own, ways


if __name__ == "__main__":
    raise SystemExit(main())
