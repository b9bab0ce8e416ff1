"""Priors of an intersection: what is likely, fitted on a corpus (paper 3.2, Eq. 1 to 3).

At run time only numpy is needed; fitting and the corpus load scikit-learn, shapely and SUMO.
"""

from scenewright.tools.gmm_sampler.driving_profile_prior import (
    compute_profile_nll,
    sample_driving_profiles,
)
from scenewright.tools.gmm_sampler.prior_files import load_priors
from scenewright.tools.gmm_sampler.priors import (
    CountPrior,
    DrivingProfilePrior,
    Priors,
    WaypointPrior,
)
from scenewright.tools.gmm_sampler.sample import (
    build_paths,
    compute_count_nll,
    compute_total_mass,
    compute_waypoint_nll,
    sample_count,
    sample_waypoints,
)

__all__ = [
    "CountPrior",
    "DrivingProfilePrior",
    "Priors",
    "WaypointPrior",
    "build_paths",
    "compute_count_nll",
    "compute_profile_nll",
    "compute_total_mass",
    "compute_waypoint_nll",
    "load_priors",
    "sample_count",
    "sample_driving_profiles",
    "sample_waypoints",
]
