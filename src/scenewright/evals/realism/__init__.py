"""Realism of generated scenes: motion and stops compared with a corpus and real tracks.

`python -m scenewright.evals.realism --corpus FILE.npz --scenes edited=FOLDER` prints the tables,
`--make 120 --into FOLDER` makes the scenes first. Distances are first Wasserstein distances with
bootstrap intervals over scenes; beside them stands what two halves of the reference differ by.
"""

from scenewright.evals.realism.distances import (
    ClusterSample,
    Distance,
    DistanceGain,
    compute_distance,
    compute_wasserstein,
)
from scenewright.evals.realism.judge import judge
from scenewright.evals.realism.report import Comparison, ComparisonReport

__all__ = [
    "ClusterSample",
    "Comparison",
    "ComparisonReport",
    "Distance",
    "DistanceGain",
    "compute_distance",
    "compute_wasserstein",
    "judge",
]
