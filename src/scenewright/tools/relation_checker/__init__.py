"""Relation checker: what really happens in final tracks, proven without the generator's help.

`check` judges a scene, `find_events` reports every event in any tracks. The measures they stand on
are public too: contact and clearance, conflict zones and stays, PET, TTC, DRAC, free speed, gaps.
"""

from scenewright.tools.relation_checker.collisions import impact, kind_of
from scenewright.tools.relation_checker.contact import (
    Contact,
    Crowd,
    clearance,
    common_times,
    first_contact,
    gather,
    least_clearance,
)
from scenewright.tools.relation_checker.encroachment import (
    Encounter,
    encounters,
    post_encroachment_time,
)
from scenewright.tools.relation_checker.following import followings, lane_gaps
from scenewright.tools.relation_checker.motion import Mover, RoadUser, as_mover, as_movers
from scenewright.tools.relation_checker.observation import Observation, find_events, observe
from scenewright.tools.relation_checker.paths import (
    Stay,
    Zone,
    conflict_zones,
    path_of,
    swept_path,
    zone_stay,
)
from scenewright.tools.relation_checker.surrogates import drac, path_ttc, ttc_2d
from scenewright.tools.relation_checker.verdict import check, read_users
from scenewright.tools.relation_checker.yielding import approach_speed, free_drive

__all__ = [
    "Contact",
    "Crowd",
    "Encounter",
    "Mover",
    "Observation",
    "RoadUser",
    "Stay",
    "Zone",
    "approach_speed",
    "as_mover",
    "as_movers",
    "check",
    "clearance",
    "common_times",
    "conflict_zones",
    "drac",
    "encounters",
    "find_events",
    "first_contact",
    "followings",
    "free_drive",
    "gather",
    "impact",
    "kind_of",
    "lane_gaps",
    "least_clearance",
    "observe",
    "path_of",
    "path_ttc",
    "post_encroachment_time",
    "read_users",
    "swept_path",
    "ttc_2d",
    "zone_stay",
]
