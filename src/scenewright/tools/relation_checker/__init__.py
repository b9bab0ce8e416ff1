"""Relation checker: what really happens in final tracks, proven without the generator's help.

`check` judges a scene, `find_events` reports every event in any tracks. The measures they stand on
are public too: contact and clearance, conflict zones and stays, PET, TTC, DRAC, free speed, gaps.
"""

from scenewright.tools.relation_checker.collisions import measure_impact
from scenewright.tools.relation_checker.conflict_zones import (
    find_conflict_zones,
    find_zone_occupancy,
)
from scenewright.tools.relation_checker.contact import (
    build_pair_grid,
    compute_clearance,
    find_common_times,
    find_first_contact,
    find_least_clearance,
)
from scenewright.tools.relation_checker.encroachment import compute_pet, find_encounters
from scenewright.tools.relation_checker.events import SceneObservation, find_events, observe
from scenewright.tools.relation_checker.following import find_followings, measure_lane_gaps
from scenewright.tools.relation_checker.surrogates import (
    compute_drac,
    compute_path_ttc,
    compute_ttc_2d,
)
from scenewright.tools.relation_checker.trajectory import (
    RoadUser,
    Trajectory,
    build_trajectories,
    build_trajectory,
)
from scenewright.tools.relation_checker.verdict import check, read_users
from scenewright.tools.relation_checker.yielding import (
    compute_approach_speed,
    compute_free_speed_profile,
)

__all__ = [
    "RoadUser",
    "SceneObservation",
    "Trajectory",
    "build_pair_grid",
    "build_trajectories",
    "build_trajectory",
    "check",
    "compute_approach_speed",
    "compute_clearance",
    "compute_drac",
    "compute_free_speed_profile",
    "compute_path_ttc",
    "compute_pet",
    "compute_ttc_2d",
    "find_common_times",
    "find_conflict_zones",
    "find_encounters",
    "find_events",
    "find_first_contact",
    "find_followings",
    "find_least_clearance",
    "find_zone_occupancy",
    "measure_impact",
    "measure_lane_gaps",
    "observe",
    "read_users",
]
