"""How near the iterated roll-out comes to tracks that nobody was trained on.

`python -m scenewright.evals.realism.rollouts --corpus FILE.npz [--taf-bw FOLDER] [--prior-goals]`.
Scenes of up to 30 s are cut from the test hours, or from real recordings. Everybody's first 9 steps
of 0.4 s are given, then a goal on its way every 8 steps, the last at least so long before the track
ends; the end itself is never given. With `--prior-goals` also such goals that lie on the way that
the prior expects after the beginning, due when the agent is abreast of them; and goals whose times
are the prior's, too: then nothing but the route and the time of the end is told after the
beginning. All agents of a scene are rolled out together to their ends; who is there too shortly,
or has no route with `--prior-goals`, is seen all along. Beside the network stand a cubic spline and
even motion through the same places at the same times.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from scenewright.errors import InputError
from scenewright.evals.bootstrap import compute_interval
from scenewright.evals.realism.left_out import left_out_ways
from scenewright.evals.realism.prior_goals import WayOf, bundle_ways
from scenewright.evals.realism.rollout_tasks import (
    COLUMNS,
    Task,
    as_the_prior_goes,
    on_the_priors_way,
    tasks,
)
from scenewright.evals.realism.samples import UNIMPEDED
from scenewright.scene.base import FloatArray
from scenewright.scene.track import STEP
from scenewright.tools.track_io import Recording, load_recordings
from scenewright.tools.track_io.taf_bw import SMOOTHING, read_taf_bw
from scenewright.tools.track_io.windows import TRAJNET_EVERY

LEAD = 1
"""Steps before a goal is due from which the next one counts; chosen on validation hours."""
BEFORE_END = (2, 4, 8)
"""Steps of 0.4 s from the last goal to the end that are tried."""
DRAWN = 20
"""Draws of the prior."""
_DRAWS = 1000


def rolled(net: Any, task: Task, *, keep: int | None = None, lead: int = LEAD) -> FloatArray:
    """[N, T, 2] the mean motion that the network writes.

    Args:
        keep: steps after which what was written is observed; the network's horizon if None.
        lead: see `roll_out`.
    """
    import torch

    from scenewright.tools.trajnet_refiner.model import CLASSES
    from scenewright.tools.trajnet_refiner.rollout import Waypoints, roll_out

    marked = np.asarray(np.isfinite(task.goals).all(-1))
    most = max(1, int(marked.sum(axis=1).max()))
    places = np.full((len(task.xy), most, 2), np.nan)
    due = np.full((len(task.xy), most), np.nan)
    for n in range(len(marked)):
        at = np.flatnonzero(marked[n])
        places[n, : len(at)], due[n, : len(at)] = task.goals[n, at], at
    until = COLUMNS - np.argmax(task.there[:, ::-1], axis=1)
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
    places = np.where(task.given[..., None], task.xy, task.goals)
    for n in task.asked:
        at = np.flatnonzero(np.isfinite(places[n, :, 0]))
        when = np.flatnonzero(task.sought[n])
        found[n, when] = curve(at.astype(np.float64), places[n, at], when.astype(np.float64))
    return found


def errors(task: Task, found: FloatArray) -> FloatArray:
    """[A, 2] mean and final distance [m] of everybody who was rolled out."""
    rows = []
    for n in task.asked:
        off = np.hypot(*(found[n] - task.xy[n])[task.sought[n]].T)
        rows.append((float(off.mean()), float(off[-1])))
    return np.array(rows).reshape(-1, 2)


Method = Callable[[Task], FloatArray]
Methods = Mapping[str, Method]


def methods(net: Any, *, keep: int | None = None, lead: int = LEAD) -> Methods:
    """The network and its rivals, by name."""
    return {
        "refiner": lambda task: rolled(net, task, keep=keep, lead=lead),
        "spline": splined,
        "even": even,
    }


class Row(NamedTuple):
    """What everybody of some tasks was off by.

    Attributes:
        goals: where they came from; before_end: steps from the last to the end.
        kinds: [A] classes; off: [A, 2] mean and final distance [m], by method.
    """

    goals: str
    before_end: int
    kinds: tuple[str, ...]
    off: Mapping[str, FloatArray]

    def lines(self, named: str) -> Iterator[str]:
        """Lines of the table, by class."""
        for label in ("vehicle", "pedestrian", "all"):
            mine = np.array([label in (kind, "all") for kind in self.kinds], dtype=bool)
            cells = [_cell(off[mine]) for off in self.off.values()]
            last = f"{self.before_end * 0.4:.1f} s"
            yield (
                " | ".join([f"| {named}", self.goals, last, label, str(mine.sum()), *cells]) + " |"
            )


def table(
    of: Methods, recordings: Sequence[Recording], *, most: int, way_of: WayOf | None = None
) -> Iterator[Row]:
    """The rows of a source: goals on the true ways, and with `way_of` from the priors, too."""
    for before_end in BEFORE_END:
        scenes = list(tasks(recordings, before_end=before_end, most=most, way_of=way_of))
        yield _row("true way", before_end, of, scenes)
        if way_of is not None:
            yield _row("prior's way", before_end, of, [on_the_priors_way(t) for t in scenes])
    if way_of is not None:
        yield from _drawn(of, list(tasks(recordings, before_end=0, most=most, way_of=way_of)))


def _row(goals: str, before_end: int, of: Methods, scenes: Sequence[Task]) -> Row:
    off = {name: [errors(task, method(task)) for task in scenes] for name, method in of.items()}
    return Row(goals, before_end, _kinds(scenes), {k: _joined(v) for k, v in off.items()})


def _drawn(of: Methods, scenes: Sequence[Task]) -> Iterator[Row]:
    """What draws of the prior are off by on average and at best; of all, and of who is never slow.

    The prior's time law is that of people whom nothing holds up, and knows of no lights or queues.
    """
    rng = np.random.default_rng(0)
    found: dict[str, list[FloatArray]] = {name: [np.zeros((0, DRAWN, 2))] for name in of}
    for task in scenes:
        draws = list(as_the_prior_goes(task, size=DRAWN, rng=rng))
        for name, method in of.items():
            found[name].append(np.stack([errors(draw, method(draw)) for draw in draws], axis=1))
    every = {name: np.concatenate(parts) for name, parts in found.items()}
    kinds = np.array(_kinds(scenes))
    unheld = np.array([_never_slow(task, n) for task in scenes for n in task.asked], dtype=bool)
    for who, those in ((" of all", np.ones_like(unheld)), (" of who is never slow", unheld)):
        for how, of_draws in ((f"mean of {DRAWN} draws", np.mean), ("best of them", np.min)):
            off = {name: of_draws(values[those], axis=1) for name, values in every.items()}
            yield Row(f"prior, {how}{who}", 0, tuple(kinds[those]), off)


def _never_slow(task: Task, n: int) -> bool:
    xy = task.xy[n, task.there[n]]
    speed = np.hypot(*np.diff(xy, axis=0).T) / (TRAJNET_EVERY * STEP)
    return bool(speed.min() >= UNIMPEDED[task.kinds[n]])


def _kinds(scenes: Sequence[Task]) -> tuple[str, ...]:
    return tuple(task.kinds[n] for task in scenes for n in task.asked)


def _joined(parts: Sequence[FloatArray]) -> FloatArray:
    return np.concatenate([np.zeros((0, 2)), *parts])


def _cell(values: FloatArray) -> str:
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
    words = argparse.ArgumentParser(prog="python -m scenewright.evals.realism.rollouts",
                                    description=__doc__)  # fmt: skip
    words.add_argument("--intersection", default="amsterdam_120")
    words.add_argument("--weights", type=Path, help="the bundle's if none are named")
    words.add_argument("--corpus", type=Path, help="file of `intersections corpus`")
    words.add_argument("--taf-bw", type=Path, help="folder of real tracks")
    words.add_argument("--smoothing", type=float, default=SMOOTHING,
                       help="of real positions before anything else [s]")  # fmt: skip
    words.add_argument("--most", type=_count, default=60, help="scenes of each source")
    words.add_argument("--keep", type=_count, help="steps kept before everybody is observed anew")
    words.add_argument("--lead", type=int, choices=range(12), default=LEAD,
                       help="steps before a goal is due at which the next one counts")  # fmt: skip
    words.add_argument("--prior-goals", action="store_true",
                       help="goals from the priors, too; only who has a route counts")  # fmt: skip
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

    if told.prior_goals and told.split != "test":
        raise InputError("the corpus' priors know the hours of that split; leave out --split")
    shipped = None if told.weights else bundled_refiner(told.intersection)
    if told.weights is None and shipped is None:
        raise InputError(f"{told.intersection} ships no refiner; name --weights")
    net = _read(told.weights) if shipped is None else shipped.net
    torch.set_num_threads(1)  # scenes are small: threads only wait for each other
    sources = list(_sources(told))
    if not sources:
        raise InputError("name a --corpus or a folder of --taf-bw tracks")
    of = methods(net, keep=told.keep, lead=told.lead)
    print("| tracks | goals | end after last goal | class | n | ADE / FDE of the refiner | spline "
          "| even motion |\n" + "|---" * 8 + "|")  # fmt: skip
    for named, recordings, way_of in sources:
        for row in table(of, recordings, most=told.most, way_of=way_of):
            print(*row.lines(named), sep="\n", flush=True)


def _read(weights: Path) -> Any:
    from scenewright.tools.trajnet_refiner.store import load_refiner

    try:
        return load_refiner(weights)
    except OSError as fault:
        raise InputError(f"cannot read {weights}: {fault.strerror or fault}") from None


def _sources(told: argparse.Namespace) -> Iterator[tuple[str, Sequence[Recording], WayOf | None]]:
    """What is rolled out by name, and where the priors come from."""
    if told.corpus:
        hours = load_recordings(told.corpus, split=told.split)
        ways = bundle_ways(told.intersection) if told.prior_goals else None
        yield f"corpus {told.split} hours", hours, ways
    if told.taf_bw:
        real = read_taf_bw(told.taf_bw, smoothing=told.smoothing)
        ways = left_out_ways(told.taf_bw) if told.prior_goals else None
        for site, jitter in real.jitter.items():
            own = [each for each in real.recordings if each.name.split("/")[0] == site]
            yield f"taf-bw {site} (jitter {jitter:.3f} m)", own, ways


if __name__ == "__main__":
    raise SystemExit(main())
