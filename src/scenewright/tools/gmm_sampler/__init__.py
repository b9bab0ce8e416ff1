"""Priors of an intersection: what is likely, fitted on a corpus (paper 3.2, Eq. 1 to 3).

At run time only numpy is needed; fitting and the corpus load scikit-learn, shapely and SUMO.
"""

from scenewright.tools.gmm_sampler.priors import (
    CountPrior,
    DrivingProfilePrior,
    Priors,
    WaypointPrior,
    load_priors,
)
from scenewright.tools.gmm_sampler.sample import (
    count_nll,
    sample_count,
    sample_waypoints,
    total_mass,
    waypoint_nll,
)
from scenewright.tools.gmm_sampler.spline import paths_of, spline_path
from scenewright.tools.gmm_sampler.time_law_prior import (
    compute_profile_nll,
    sample_driving_profiles,
)

__all__ = [
    "CountPrior",
    "DrivingProfilePrior",
    "Priors",
    "WaypointPrior",
    "compute_profile_nll",
    "count_nll",
    "load_priors",
    "paths_of",
    "sample_count",
    "sample_driving_profiles",
    "sample_waypoints",
    "spline_path",
    "total_mass",
    "waypoint_nll",
]
