"""How agents move where that was asked for, seen on their tracks; pedestrians run or stand."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from scenewright.scene.events import Finding
from scenewright.scene.map import IntersectionMap
from scenewright.scene.record import AgentRecord
from scenewright.tools.relation_checker.events import SceneObservation
from scenewright.tools.relation_checker.ground_raster import get_ground_raster
from scenewright.tools.relation_checker.standstills import find_standstills
from scenewright.tools.relation_checker.trajectory import Trajectory
from scenewright.tools.relation_checker.vehicle_motions import describe_vehicle_motion
from scenewright.tools.relation_checker.yielding import STANDING

RUNNING = ("runs", "darts_out")
RUN = 2.4
"""Speed from which a pedestrian runs [m/s], kept for a second on the road."""
AT_ONCE = 1.0
"""Who darts out has not stood still for so long before the road [s]."""
FROM_KERBS = 1.0
"""Least distance of a stop midway from either end of the crossing [m]."""

FAR_OUT = 2.0
"""Least distance over the road before turning back [m]."""
RETURNS = 0.6
"""Share of that way by which it has come nearer to its kerb again, as far as it is seen."""
HIT_AFTER = 0.5
"""By how much it has come nearer if it is hit on its way back [m]."""


def check_pedestrian_motions(
    agents: Sequence[AgentRecord],
    observed: SceneObservation,
    intersection_map: IntersectionMap | None,
) -> tuple[Finding, ...]:
    """A finding for every agent that does not move as it was asked to."""
    if intersection_map is None:
        return ()
    tracks = {track.id: track for track in observed.tracks}
    struck = {n for e in observed.events if e.type == "collision" for n in (e.from_, e.to)}
    found = []
    for agent in agents:
        motion, track = agent.motion, tracks[agent.id]
        if motion is None:
            continue
        if track.type != "pedestrian":
            shown = describe_vehicle_motion(motion, track, observed.lights, intersection_map)
        else:
            shown = describe_pedestrian_motion(
                motion, track, intersection_map, struck=track.id in struck
            )
        if shown is None:
            detail = f"agent {agent.id} was to move so: {motion}; its track does not show it"
            found.append(Finding(rule="motion_not_seen", agents=(agent.id,), detail=detail))
    return tuple(found)


def describe_pedestrian_motion(
    motion: str | None,
    track: Trajectory,
    intersection_map: IntersectionMap,
    *,
    struck: bool = False,
) -> str | None:
    """What a track shows of a pedestrian's motion; None if it does not.

    Args:
        struck: its track ends in a collision.
    """
    on_road = np.flatnonzero(get_ground_raster(intersection_map).road.contains(track.xy))
    if track.is_vehicle or len(on_road) == 0:
        return None
    first, last = int(on_road[0]), int(on_road[-1])
    if motion == "stops_midway":
        return _describe_stop(track, first, last)
    if motion == "turns_back":
        return _describe_return(track, first, last, struck)
    if motion not in RUNNING:
        return None
    speed = track.speed[first : last + 1]
    # Kept for a second, or as long as it is there.
    seconds = np.lib.stride_tricks.sliding_window_view(speed, min(10, len(speed)))
    kept = float(seconds.min(axis=1).max())
    before = track.speed[max(first - round(AT_ONCE / 0.1), 0) : first]
    if kept < RUN or (motion == "darts_out" and (before <= STANDING).any()):
        return None
    return f"agent {track.id} runs at {kept:.1f} m/s"


def _describe_stop(track: Trajectory, first: int, last: int) -> str | None:
    for begins, ends in find_standstills(track):
        s = float(np.interp((begins + ends) / 2, track.times, track.s))
        if s - track.s[first] >= FROM_KERBS and track.s[last] - s >= FROM_KERBS:
            return f"agent {track.id} stands on the road {begins:.1f}-{ends:.1f} s"
    return None


def _describe_return(track: Trajectory, first: int, last: int, struck: bool) -> str | None:
    """It comes well onto the road, and leaves it where it came, or has begun to."""
    away = np.hypot(*(track.xy[first : last + 1] - track.xy[first]).T)
    turn = int(away.argmax())
    returns = float(away[turn] - away[-1])
    enough = HIT_AFTER if struck else min(RETURNS * away[turn], float(away[turn]) - 1.0)
    if away[turn] < FAR_OUT or returns < enough:
        return None
    time = float(track.times[first + turn])
    return f"agent {track.id} turns back at {time:.1f} s, {away[turn]:.1f} m from the kerb"
