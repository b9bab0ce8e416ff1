"""What the refiner of an intersection knows of walkers: TrajNet++ recordings, without goals.

    python benchmarks/walkers.py FILE.ndjson... [--weights W.safetensors] [--intersection NAME]

Nothing shipped was trained on these files. Beside the network stands constant velocity, which it
should beat: pedestrians of scenes move as this network makes them. The second table is by how much
it does, file by file and over all, people drawn anew.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from scenewright.evals.bootstrap import draw_resamples
from scenewright.evals.markdown import format_table
from scenewright.evals.trajnet.predictors import Predictor, Refining, predict_constant_velocity
from scenewright.evals.trajnet.recording import read_recording
from scenewright.evals.trajnet.score import (
    MEASURES,
    SceneScore,
    build_table,
    compute_mean_with_interval,
    predict_scenes,
    score_scenes,
)
from scenewright.intersections import REFINER_WEIGHTS, find_bundle_folder
from scenewright.tools.trajnet_refiner.store import load_refiner


def main() -> None:
    """Print the scores of all files together, and the differences."""
    words = argparse.ArgumentParser(description=__doc__)
    words.add_argument("files", nargs="+", type=Path)
    words.add_argument("--intersection", default="amsterdam_120")
    words.add_argument("--weights", type=Path)
    told = words.parse_args()
    weights = told.weights or find_bundle_folder(told.intersection) / REFINER_WEIGHTS
    recordings = [read_recording(file) for file in told.files]
    predictors: dict[str, Predictor] = {
        "constant velocity": predict_constant_velocity,
        "refiner": Refining(load_refiner(weights)),
    }
    rows, scored = [], {}
    for name, predictor in predictors.items():
        scores = [s for r in recordings for s in score_scenes(r, predict_scenes(r, predictor))]
        scored[name] = scores
        for row in build_table(scores):
            if row.name in ("all", "3 interacting"):
                cells = [f"{row.values[m]:.3f} {row.intervals[m]}" for m in MEASURES]
                rows.append([name, row.name, row.scenes, *cells])
    print(format_table(("predictor", "scenes", "n", *MEASURES), rows))
    pairs = list(zip(*scored.values(), strict=True))
    parts = {r.name: [p for p in pairs if p[0].person[0] == r.name] for r in recordings}
    parts |= {"all": pairs, "interacting": [p for p in pairs if p[0].type == 3]}
    table = [[name, len(part), *compare(part)] for name, part in parts.items()]
    print(format_table(("refiner less constant velocity", "n", "ADE", "FDE"), table))


def compare(pairs: list[tuple[SceneScore, SceneScore]]) -> list[str]:
    """The mean differences of ADE and FDE [m] with 95 %, people drawn anew."""
    people = sorted({even.person for even, _ in pairs})
    place = {person: k for k, person in enumerate(people)}
    whose = np.array([place[even.person] for even, _ in pairs])
    draws = draw_resamples(len(people), draws=1000, seed=0)
    cells = []
    for measure in ("ade", "fde"):
        less = np.array([getattr(own, measure) - getattr(even, measure) for even, own in pairs])
        mean, interval = compute_mean_with_interval(less, whose, draws)
        assert mean is not None
        assert interval is not None
        cells.append(f"{mean:+.3f} ({interval[0]:+.3f}, {interval[1]:+.3f})")
    return cells


if __name__ == "__main__":
    main()
