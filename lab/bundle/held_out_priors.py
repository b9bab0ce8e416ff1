"""Held-out likelihood of the priors, on the test hours of a bundle's corpus.

`python -m lab.bundle.held_out_priors amsterdam_120` prints what docs/evaluation.md says of them.
The test waypoints and counts are part of the bundle, so that no simulator is needed.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from scenewright.errors import InputError
from scenewright.intersections import find_bundle_folder
from scenewright.scene.base import FloatArray
from scenewright.tools.gmm_sampler import Priors, WaypointPrior, compute_waypoint_nll, load_priors


@dataclass(frozen=True)
class WaypointRow:
    """p_wp on the test tracks of one group of routes.

    Attributes:
        group: class and movement, or class alone.
        tracks: how many test tracks.
        nll: mean -log p_wp of the mixture [nats per track of 20 coordinates], with the standard
            error of that mean.
        gaussian: the same of one Gaussian per route.
    """

    group: str
    tracks: int
    nll: float
    error: float
    gaussian: float


@dataclass(frozen=True)
class CountRow:
    """p_tod on the test windows of one part of the day.

    Attributes:
        hours: the part of the day; windows: how many test windows.
        nll: mean -log p_tod of (vehicles, pedestrians) [nats per window], and its standard error.
        poisson: the same of two independent Poisson counts with the mean of the hour.
        total: mean number of agents in those windows.
    """

    hours: str
    windows: int
    nll: float
    error: float
    poisson: float
    total: float


@dataclass(frozen=True)
class PriorReport:
    """Both tables of a bundle."""

    waypoints: tuple[WaypointRow, ...]
    counts: tuple[CountRow, ...]

    def format_markdown(self) -> str:
        """Both tables as Markdown."""
        first = [
            "| class, movement | test tracks | GMM [nats] | one Gaussian [nats] | gain |",
            "|---|---|---|---|---|",
        ]
        first += [
            f"| {r.group} | {r.tracks} | {r.nll:.2f} ± {r.error:.2f} | {r.gaussian:.2f} "
            f"| {r.gaussian - r.nll:.2f} |"
            for r in self.waypoints
        ]
        second = [
            "| hours | test windows | mean agents | GMM [nats] | Poisson [nats] | gain |",
            "|---|---|---|---|---|---|",
        ]
        second += [
            f"| {r.hours} | {r.windows} | {r.total:.1f} | {r.nll:.3f} ± {r.error:.3f} "
            f"| {r.poisson:.3f} | {r.poisson - r.nll:.3f} |"
            for r in self.counts
        ]
        return "\n".join([*first, "", *second])


def evaluate_priors(name: str | Path) -> PriorReport:
    """Held-out likelihoods of a bundle's priors (SEMANTICS section 6).

    Raises:
        InputError: unknown bundle, no priors, or no held-out part.
    """
    folder = name if isinstance(name, Path) else find_bundle_folder(name)
    priors = load_priors(folder)
    file = folder / "heldout.npz"
    if not file.is_file():
        raise InputError(f"intersection {folder.name!r} keeps no held-out tracks")
    with np.load(file, allow_pickle=False) as stored:
        held = {key: np.asarray(stored[key]) for key in stored.files}
    return PriorReport(tuple(_evaluate_waypoints(priors, held)), tuple(_count_rows(priors, held)))


_Held = dict[str, np.ndarray]
_Pair = tuple[FloatArray, FloatArray]


def _evaluate_waypoints(priors: Priors, held: _Held) -> Iterator[WaypointRow]:
    ends = np.cumsum(held["test_tracks"])[:-1]
    tracks = np.split(held["waypoints"].astype(np.float64), ends)
    groups: dict[str, list[_Pair]] = {}
    for i, route in enumerate(str(name) for name in held["routes"]):
        single = _build_single(route, held["gaussian_means"][i], held["gaussian_cholesky"][i])
        pair = (
            compute_waypoint_nll(priors.waypoints[route], tracks[i]),
            compute_waypoint_nll(single, tracks[i]),
        )
        for group in _get_groups(route):
            groups.setdefault(group, []).append(pair)
    for group in sorted(groups, key=lambda name: (name.count(","), name)):
        yield _build_waypoint_row(group, groups[group])


def _get_groups(route: str) -> tuple[str, str]:
    """A route counts for its class, and for its movement or (on foot) its pair of sidewalks."""
    parts = route.split(":")
    return parts[0], f"{parts[0]}, {parts[-1]}"


def _build_single(route: str, mean: FloatArray, cholesky: FloatArray) -> WaypointPrior:
    return WaypointPrior(route, np.ones(1), mean[None], cholesky[None], np.zeros((1, 1, 2)), 0)


def _build_waypoint_row(group: str, pairs: Sequence[_Pair]) -> WaypointRow:
    mixture = np.concatenate([pair[0] for pair in pairs])
    single = np.concatenate([pair[1] for pair in pairs])
    return WaypointRow(
        group, len(mixture), float(mixture.mean()), _compute_error(mixture), float(single.mean())
    )


def _compute_error(values: FloatArray) -> float:
    return float(values.std(ddof=1) / np.sqrt(len(values)))


_DAY = (("00-06", 0, 6), ("06-10", 6, 10), ("10-15", 10, 15), ("15-20", 15, 20), ("20-24", 20, 24))


def _count_rows(priors: Priors, held: _Held) -> Iterator[CountRow]:
    for label, first, last in (*_DAY, ("all", 0, 24)):
        hours = range(first, last)
        mixture = np.concatenate(
            [_compute_mixture_nll(priors, h, held["counts"][h]) for h in hours]
        )
        poisson = np.concatenate(
            [_compute_poisson_nll(held["poisson_rates"][h], held["counts"][h]) for h in hours]
        )
        total = held["counts"][first:last].sum(axis=2).mean()
        yield CountRow(
            label,
            len(mixture),
            float(mixture.mean()),
            _compute_error(mixture),
            float(poisson.mean()),
            float(total),
        )


_LEAST_MASS = 1e-6
"""Counts beyond the grid, or all but impossible, cost no more than this."""


def _compute_mixture_nll(priors: Priors, hour: int, counts: np.ndarray) -> FloatArray:
    mass = priors.counts[hour].mass
    inside = (counts < np.array(mass.shape)).all(axis=1)
    row, column = np.minimum(counts, np.array(mass.shape) - 1).T
    return -np.log(np.maximum(np.where(inside, mass[row, column], 0.0), _LEAST_MASS))


def _compute_poisson_nll(rates: FloatArray, counts: np.ndarray) -> FloatArray:
    most = int(counts.max()) + 1
    log_factorial = np.concatenate([[0.0], np.cumsum(np.log(np.arange(1, most + 1)))])
    safe = np.maximum(rates, 1e-3)
    return np.asarray((safe - counts * np.log(safe) + log_factorial[counts]).sum(axis=1))


def main() -> int:
    """Print the tables of the bundle named on the command line."""
    try:
        print(
            evaluate_priors(sys.argv[1] if len(sys.argv) > 1 else "amsterdam_120").format_markdown()
        )
    except InputError as fault:
        print(fault, file=sys.stderr)
        return fault.exit_code
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
