"""How a relation in one lane came about, seen on the tracks: who braked, cut in, drove close up."""

from __future__ import annotations

import numpy as np

from scenewright.scene.events import Event
from scenewright.scene.kinds import get_kind, load_function
from scenewright.scene.record import RelationRecord
from scenewright.tools.relation_checker.events import SceneObservation
from scenewright.tools.relation_checker.following import CREEP, LOOK_AHEAD
from scenewright.tools.relation_checker.footprints import BoolArray
from scenewright.tools.relation_checker.planar import geos
from scenewright.tools.relation_checker.trajectory import Trajectory

HARD = 4.5
"""Braking that is hard [m/s^2]."""
MOVING = 4.0
"""Least speed before a hard braking [m/s]."""
SOON = {"collision": 5.0, "near_miss": 8.0}
"""How long before an event its leader may have braked [s]."""
CLOSE_UP = 1.05
"""Usual headway of who tailgates, at most [s]."""
CUT_IN = 1.6
"""Headway that who cuts in leaves, at most [s]."""
CHANGES, MERGES = 6.0, 3.0
"""A lane change may begin so long before an event, and end so long after it [s]."""
OTHER_LANE, LEAST_CHANGE = 2.2, 0.8
"""How far from the other's way one in the next lane drives, and how far it comes over [m]."""
GOES_ON = 5.0
"""How far a way is thought to go on straight beyond the ends of its track [m]."""
ANSWERS = 8.0
"""Within what time of it the follower must have come down to half its speed [s]."""


def find_missing_manoeuvre(
    relation: RelationRecord, event: Event, observed: SceneObservation
) -> str | None:
    """Why an event did not come about in the way asked for; None if it did, or any way will do."""
    if relation.manoeuvre is None:
        return None
    first, second = observed.by_id[relation.from_], observed.by_id[relation.to]
    observer = str(get_kind("manoeuvre", relation.manoeuvre).observe)
    describe = load_function(observer, __package__)
    if describe(first, second, event, observed) is not None:
        return None
    return f"it does not come about as {relation.manoeuvre}"


def describe_tailgating(
    follower: Trajectory, leader: Trajectory, event: Event, observed: SceneObservation
) -> str | None:
    """Half of the time that it follows, the headway is a second or less; only of a follow."""
    if event.type != "follow":
        return None
    ids = observed.ids
    for lane in observed.lanes:
        if ids[lane.follower] == follower.id:
            near = (lane.times >= event.time) & (lane.times <= float(event.evidence["until"]))
            near &= (lane.speed > CREEP) & (lane.leader == ids.index(leader.id))
            usual = float(np.median(lane.headway[near])) if near.any() else np.inf
            if usual <= CLOSE_UP:
                return f"agent {follower.id} drives {usual:.1f} s behind agent {leader.id}"
    return None


def describe_lane_change(
    first: Trajectory, second: Trajectory, event: Event, _observed: SceneObservation
) -> str | None:
    """It changes into the other's side."""
    changed = _measure_lane_change(first, second, event.time, 0.0)
    return None if changed is None else f"agent {first.id} moves {changed:.1f} m over"


def describe_cut_in(
    first: Trajectory, second: Trajectory, event: Event, observed: SceneObservation
) -> str | None:
    """It changes into the lane of the other, and is then next ahead of it, close."""
    changed = _measure_lane_change(first, second, event.time, MERGES)
    if changed is None:
        return None
    ids = observed.ids
    for lane in observed.lanes:
        if ids[lane.follower] == second.id:
            after = (np.abs(lane.times - event.time) <= MERGES) & (lane.headway <= CUT_IN)
            if (after & (lane.leader == ids.index(first.id))).any():
                return f"agent {first.id} moves {changed:.1f} m over, in ahead of agent {second.id}"
    return None


def _measure_lane_change(
    first: Trajectory, second: Trajectory, time: float, later: float
) -> float | None:
    """How far it comes over from its lane towards the way of the other [m]; None if it does not.

    Args:
        later: until how long after the event it may still be coming over [s].
    """
    # The way goes on a little straight at both ends; who is farther ahead or behind is in no lane
    # of it.
    ends = second.heading[[0, -1]]
    on = GOES_ON * np.stack((np.cos(ends), np.sin(ends)), axis=1)
    way = geos.LineString(np.vstack((second.xy[:1] - on[:1], second.xy, second.xy[-1:] + on[1:])))
    points = geos.points(first.xy)
    along, away = geos.line_locate_point(way, points), geos.distance(way, points)
    beside = (along > 1e-6) & (along < way.length - 1e-6)
    before = away[beside & (first.times >= time - CHANGES) & (first.times <= time)]
    after = away[beside & (np.abs(first.times - time) <= later + 0.15)]
    if not len(before) or not len(after) or before.max() < OTHER_LANE:
        return None
    changed = float(before.max() - after.min())
    return changed if changed >= LEAST_CHANGE else None


def describe_lead_braking(
    follower: Trajectory, leader: Trajectory, event: Event, observed: SceneObservation
) -> str | None:
    """The leader brakes hard from a drive, the follower next behind it in its lane."""
    since, until = event.time - SOON.get(event.type, 0.0), event.time
    if event.type == "follow":
        until = float(event.evidence["until"])
    hard = np.flatnonzero((leader.acceleration < -HARD) & _is_between(leader, since, until))
    ids = observed.ids
    lane = next((each for each in observed.lanes if ids[each.follower] == follower.id), None)
    if not len(hard) or lane is None:
        return None
    onset = float(leader.times[hard[0]])
    if leader.speed[_is_between(leader, onset - 1.5, onset)].max() < MOVING:
        return None
    # No other vehicle drives between the two in one lane as it begins to brake.
    k = int(np.argmin(np.abs(lane.times - onset)))
    if lane.leader[k] < 0 or ids[lane.leader[k]] != leader.id or lane.gap[k] > LOOK_AHEAD:
        return None
    if event.type == "follow":  # it comes down to half its speed, or less
        before = follower.speed[_is_between(follower, onset - 0.5, onset + 0.1)]
        after = follower.speed[_is_between(follower, onset, onset + ANSWERS)]
        if not (len(before) and len(after) and after.min() <= before.max() / 2):
            return None
    hardest = -float(leader.acceleration[_is_between(leader, onset, until)].min())
    what = f"agent {leader.id} brakes at {hardest:.1f} m/s² from {onset:.1f} s on"
    return f"{what}, ahead of agent {follower.id}"


def _is_between(track: Trajectory, since: float, until: float) -> BoolArray:
    """[T] the samples of a span [s]."""
    return np.asarray((track.times >= since - 1e-6) & (track.times <= until + 1e-6))
