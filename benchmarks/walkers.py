"""What the refiner of an intersection knows of walkers: TrajNet++ recordings, without goals.

    python benchmarks/walkers.py FILE.ndjson... [--weights W.safetensors] [--intersection NAME]

Nothing shipped was trained on these files. Beside the network stands constant velocity, which it
should beat: pedestrians of scenes move as this network makes them.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from scenewright.evals.markdown import format_table
from scenewright.evals.trajnet.predictors import Predictor, Refining, predict_constant_velocity
from scenewright.evals.trajnet.recording import read_recording
from scenewright.evals.trajnet.score import MEASURES, build_table, predict_scenes, score_scenes
from scenewright.intersections import REFINER_WEIGHTS, find_bundle_folder
from scenewright.tools.trajnet_refiner.store import load_refiner


def main() -> None:
    """Print the scores of all files together."""
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
    rows = []
    for name, predictor in predictors.items():
        scores = [s for r in recordings for s in score_scenes(r, predict_scenes(r, predictor))]
        for row in build_table(scores):
            if row.name in ("all", "3 interacting"):
                cells = [f"{row.values[m]:.3f} {row.intervals[m]}" for m in MEASURES]
                rows.append([name, row.name, row.scenes, *cells])
    print(format_table(("predictor", "scenes", "n", *MEASURES), rows))


if __name__ == "__main__":
    main()
