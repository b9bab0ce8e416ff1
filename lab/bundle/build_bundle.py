"""Rebuild the shipped bundle: map, demand, corpus, priors, held-out part, description.

    python -m lab.bundle.build_bundle amsterdam_120 [--out DIR] [--counts DIR] [--seed 0]

Needs the extra `simulate`. The refiner and `manners.json` have commands of their own.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w

from lab.bundle.corpus_hours import DAYS, SPLITS, CorpusHour, build_corpus
from lab.bundle.derive_demand import derive_demand
from lab.bundle.fit_priors import (
    SHRINKAGE,
    WINDOW,
    count_present,
    fit_priors,
    fit_waypoints,
    group_trips_by_route,
)
from lab.bundle.four_leg_map import write_map
from lab.bundle.four_leg_plan import PLANS, FourLegPlan
from scenewright.errors import InputError
from scenewright.intersections import find_bundle_folder
from scenewright.tools.fitting.custom_bundle import find_version
from scenewright.tools.fitting.path_frame import FLOOR
from scenewright.tools.gmm_sampler.prior_files import compute_checksum, save_priors
from scenewright.tools.gmm_sampler.priors import HOURS
from scenewright.tools.simulation.corpus import Progress
from scenewright.tools.simulation.sumo_run import Demand, read_demand

_LICENCE = "Apache-2.0"
_LICENCE_NOTE = """\
The numbers in this folder (map, demand, priors, held-out part) are made by the scenewright
project and licensed under the Apache License 2.0, as the project is.

They derive from
- hourly means of NYC DOT Traffic Volume Counts, published by the City of New York as NYC Open
  Data and used under its terms of use; no raw counts are included;
- hourly means of pedestrian crossings in ped-signal-data, Utah State University, Apache-2.0;
- tracks simulated with Eclipse SUMO (EPL-2.0), which is not included.

The map is modelled on a street layout with typical widths. It is not a survey.
"""
_DESCRIBED = ("map.json", "demand.json", "priors.npz", "heldout.npz")


def build_bundle(
    name: str,
    *,
    out: Path,
    counts: Path | None = None,
    corpus: Path | None = None,
    seed: int = 0,
    days: int = DAYS,
    progress: Progress | None = None,
) -> Path:
    """Rebuild a bundle into the folder `out`: simulates its corpus and fits its priors.

    Args:
        counts: folder of raw counts to derive the demand from; None uses the bundle's own.
        corpus: where simulated hours are kept (and found again); None means `out/corpus`.
        days: how many days of 24 hours to simulate; three put each hour into every split.

    Raises:
        InputError: unknown name, unreadable counts, SUMO not installed, an unwritable folder.
    """
    if name not in PLANS:
        raise InputError(f"no plan to build {name!r} from; there are: {', '.join(sorted(PLANS))}")
    if days < len(SPLITS):
        raise InputError(f"{len(SPLITS)} days or more put every hour in every split, got {days}")
    plan = PLANS[name]
    demand = (
        derive_demand(counts) if counts else read_demand(find_bundle_folder(name) / "demand.json")
    )
    try:
        intersection_map = write_map(out, plan)
        (out / "demand.json").write_text(demand.model_dump_json(indent=1) + "\n", encoding="utf-8")
        hours = build_corpus(
            corpus or out / "corpus",
            plan=plan,
            intersection_map=intersection_map,
            demand=demand,
            seed=seed,
            days=days,
            progress=progress,
        )
        if progress is not None:
            progress("fitting the priors")
        save_priors(out / "priors.npz", fit_priors(intersection_map, hours))
        save_heldout(out / "heldout.npz", hours)
        _write_header(out, plan, demand, seed=seed, days=days, hours=hours)
    except OSError as fault:
        raise InputError(f"cannot write to {out}: {fault.strerror}") from None
    return out


def save_heldout(file: Path, corpus: Sequence[CorpusHour]) -> None:
    """The test hours' waypoints and counts, and the baselines fitted on the other hours.

    With it the held-out likelihoods can be recomputed without simulating.
    """
    fit = group_trips_by_route(hour for hour in corpus if hour.split == "fit")
    test = group_trips_by_route(hour for hour in corpus if hour.split == "test")
    routes = sorted(fit)
    single = [fit_waypoints(r, [t.path for t in fit[r]], most=1) for r in routes]
    waypoints = [np.array([t.waypoints for t in test[r]]).reshape(-1, 10, 2) for r in routes]
    save: Any = np.savez_compressed
    save(
        file,
        routes=np.array(routes),
        test_tracks=np.array([len(each) for each in waypoints]),
        waypoints=np.concatenate(waypoints).astype(np.float32),
        gaussian_means=np.array([g.means[0] for g in single]),
        gaussian_cholesky=np.array([g.cholesky[0] for g in single]),
        **_pack_heldout_counts(corpus),
    )


def _pack_heldout_counts(corpus: Sequence[CorpusHour]) -> dict[str, Any]:
    """Test windows [24, n, 2], and mean counts of the other hours [24, 2] for a Poisson."""
    test = {h.hour: count_present(h, WINDOW) for h in corpus if h.split == "test"}
    rates = [
        np.concatenate(
            [count_present(h, WINDOW) for h in corpus if h.hour == n and h.split != "test"]
        )
        for n in range(HOURS)
    ]
    return {
        "counts": np.array([test[n] for n in range(HOURS)]).astype(np.int16),
        "poisson_rates": np.array([rate.mean(axis=0) for rate in rates]),
    }


def _write_header(
    out: Path,
    plan: FourLegPlan,
    demand: Demand,
    *,
    seed: int,
    days: int,
    hours: Sequence[CorpusHour],
) -> None:
    """Write `bundle.toml`: what this is, what it was made from, under which licence."""
    trips = {s: sum(len(h.trips) for h in hours if h.split == s) for s in SPLITS}
    header = {
        "name": plan.name,
        "title": plan.title,
        "licence": _LICENCE,
        "format": 1,
        "provenance": {
            "sources": list(demand.sources),
            "simulator": f"Eclipse SUMO {find_version('eclipse-sumo')} (EPL-2.0)",
            "scenewright": find_version("scenewright"),
            "scikit_learn": find_version("scikit-learn"),
            "seed": seed,
            "days": days,
            **{f"{split}_trips": count for split, count in trips.items()},
            "covariance_floor": FLOOR,
            "shrinkage": SHRINKAGE,
            "count_window": WINDOW,
        },
        "sha256": {name: compute_checksum(out / name) for name in _DESCRIBED},
    }
    (out / "LICENSE").write_text(_LICENCE_NOTE, encoding="utf-8")
    (out / "bundle.toml").write_bytes(tomli_w.dumps(header).encode())


def main(argv: Sequence[str] | None = None) -> int:
    """Build the bundle that is named."""
    parser = argparse.ArgumentParser(prog="python -m lab.bundle.build_bundle")
    parser.add_argument("name")
    parser.add_argument("--out", type=Path, help="folder to write; intersections/NAME if left out")
    parser.add_argument("--counts", type=Path, help="folder of raw counts to derive demand from")
    parser.add_argument("--seed", type=int, default=0, help="of the simulation")
    given = parser.parse_args(argv)
    try:
        folder = build_bundle(
            given.name,
            out=given.out or Path("intersections") / given.name,
            counts=given.counts,
            seed=given.seed,
            progress=lambda line: print(line, file=sys.stderr),
        )
    except InputError as fault:
        print(fault, file=sys.stderr)
        return fault.exit_code
    print(folder)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
