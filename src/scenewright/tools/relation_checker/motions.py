"""Whether agents move as they were asked to, seen on their tracks by the observer of each kind."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import cast

import numpy as np

from scenewright.scene.events import Finding
from scenewright.scene.kinds import Kind, get_kind, load_function
from scenewright.scene.map import IntersectionMap
from scenewright.scene.record import AgentRecord
from scenewright.tools.relation_checker.events import SceneObservation
from scenewright.tools.relation_checker.footprints import compute_angle_between
from scenewright.tools.relation_checker.ground_raster import get_ground_raster
from scenewright.tools.relation_checker.liveness import find_standstills
from scenewright.tools.relation_checker.planar import geos
from scenewright.tools.relation_checker.signals import SignalPlan
from scenewright.tools.relation_checker.trajectory import Trajectory
from scenewright.tools.relation_checker.yielding import STANDING


@dataclass(frozen=True)
class SeenMotion:
    """An agent's track, and what else shows how it moves; whether it ends in a collision."""

    kind: Kind
    track: Trajectory
    lights: SignalPlan
    intersection_map: IntersectionMap
    struck: bool = False


def check_motions(
    agents: Sequence[AgentRecord],
    observed: SceneObservation,
    intersection_map: IntersectionMap | None,
) -> tuple[Finding, ...]:
    """A finding for every agent that does not move as it was asked to."""
    if intersection_map is None:
        return ()
    return tuple(
        Finding(
            rule="motion_not_seen", agents=(agent.id,),
            detail=f"agent {agent.id} was to move so: {agent.motion}; its track does not show it",
        )
        for agent in agents
        if agent.motion is not None
        and describe_motion(agent.motion, observed.by_id[agent.id], observed, intersection_map)
        is None
    )  # fmt: skip


def describe_motion(
    motion: str, track: Trajectory, observed: SceneObservation, intersection_map: IntersectionMap
) -> str | None:
    """What a track shows of a motion; None if it does not."""
    kind = get_kind("motion", motion)
    if track.type not in kind.agents:
        return None
    struck = any(e.type == "collision" and track.id in (e.from_, e.to) for e in observed.events)
    seen = SeenMotion(kind, track, observed.lights, intersection_map, struck)
    return cast("str | None", load_function(str(kind.observe), __package__)(seen))


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


def describe_run(seen: SeenMotion) -> str | None:
    """It runs for a second on the road, or as long as it is there."""
    span = _find_road_span(seen)
    if span is None:
        return None
    speed = seen.track.speed[span[0] : span[1] + 1]
    seconds = np.lib.stride_tricks.sliding_window_view(speed, min(10, len(speed)))
    kept = float(seconds.min(axis=1).max())
    fast = kept >= seen.kind.figures["least_speed"]
    return f"agent {seen.track.id} runs at {kept:.1f} m/s" if fast else None


def describe_dart(seen: SeenMotion) -> str | None:
    """It runs, and has not stood still before the road."""
    span, speed = _find_road_span(seen), seen.track.speed
    if span is None or (speed[max(span[0] - round(AT_ONCE / 0.1), 0) : span[0]] <= STANDING).any():
        return None
    return describe_run(seen)


def _find_road_span(seen: SeenMotion) -> tuple[int, int] | None:
    """The first and the last sample on the road."""
    road = get_ground_raster(seen.intersection_map).road
    on_road = np.flatnonzero(road.contains(seen.track.xy))
    return (int(on_road[0]), int(on_road[-1])) if len(on_road) else None


def describe_stop(seen: SeenMotion) -> str | None:
    """It stands still between the kerbs."""
    span, track = _find_road_span(seen), seen.track
    if span is None:
        return None
    first, last = span
    for begins, ends in find_standstills(track):
        s = float(np.interp((begins + ends) / 2, track.times, track.s))
        if s - track.s[first] >= FROM_KERBS and track.s[last] - s >= FROM_KERBS:
            return f"agent {track.id} stands on the road {begins:.1f}-{ends:.1f} s"
    return None


def describe_return(seen: SeenMotion) -> str | None:
    """It comes well onto the road, and leaves it where it came, or has begun to."""
    span, track = _find_road_span(seen), seen.track
    if span is None:
        return None
    first, last = span
    away = np.hypot(*(track.xy[first : last + 1] - track.xy[first]).T)
    turn = int(away.argmax())
    returns = float(away[turn] - away[-1])
    enough = HIT_AFTER if seen.struck else min(RETURNS * away[turn], float(away[turn]) - 1.0)
    if away[turn] < FAR_OUT or returns < enough:
        return None
    time = float(track.times[first + turn])
    return f"agent {track.id} turns back at {time:.1f} s, {away[turn]:.1f} m from the kerb"


SINCE = 0.3
"""A light that has been yellow for less [s] turns as the vehicle passes: no choice was left."""
COMES = 2.0
"""How long before it brakes the light is still green [s]."""
LEAVES = 5.0
"""Who blocks the junction drives on by so much afterwards [m]."""
BRAKES = 3.0
"""Least braking of who brakes hard for a yellow light [m/s^2]."""
STANDS_AT_RED = 2.0
"""How long who blocks the junction stands there at red at least [s]."""
BEFORE_LINE = 3.0
"""Largest distance before its line of a vehicle that stops for its light [m]."""


WRONG_WAY = 12.0
"""Least way in lanes that lead the other way of who drives the wrong way [m]."""
AGAINST = math.radians(135.0)
"""Heading and direction of the lane are at least so far apart [rad]."""


def describe_yellow_passing(seen: SeenMotion) -> str | None:
    """It passes its line on yellow, not as the light turns."""
    track, lights = seen.track, seen.lights
    for met in lights.find_crossings(track):
        before = lights.get_colour(met.light, time=met.time - SINCE)
        if met.colour == before == "yellow":
            return f"agent {track.id} passes on yellow at {met.time:.1f} s"
    return None


def describe_wrong_way(seen: SeenMotion) -> str | None:
    """Its centre is in lanes that lead the other way, and in none that leads its own."""
    track, intersection_map = seen.track, seen.intersection_map
    against, along = np.zeros(len(track), bool), np.zeros(len(track), bool)
    legs: list[str] = []
    for lane in intersection_map.lanelets:
        if lane.kind not in ("approach", "exit"):
            continue
        inside = geos.contains_xy(geos.Polygon([*lane.left, *lane.right[::-1]]), *track.xy.T)
        middle = np.array(lane.centreline)
        ways = np.arctan2(*np.diff(middle, axis=0).T[::-1])
        away = track.xy[:, None] - (middle[:-1] + middle[1:]) / 2
        nearest = np.hypot(away[..., 0], away[..., 1]).argmin(axis=1)
        turn = compute_angle_between(track.heading, ways[nearest])
        contrary = inside & (turn >= AGAINST) & (track.speed > STANDING)
        against |= contrary
        along |= inside & (turn < AGAINST)
        legs += [str(lane.leg)] if contrary.any() else []
    wrong = against & ~along
    way = float(track.steps[wrong[1:]].sum())
    if way < WRONG_WAY:
        return None
    time = float(track.times[int(wrong.argmax())])
    return (
        f"agent {track.id} drives against the lanes of the {legs[0]} leg for {way:.0f} m, from "
        f"{time:.1f} s on"
    )


def describe_yellow_stop(seen: SeenMotion) -> str | None:
    """It comes on green, begins to brake hard while its light is yellow, and stands at its line."""
    track, lights = seen.track, seen.lights
    moving = np.flatnonzero(track.speed > STANDING)
    stands = int(moving[-1]) + 1 if len(moving) else 0
    if not 0 < stands < len(track):
        return None
    light, away = lights.find_light_after(track, track.end)
    change = np.diff(track.speed[: stands + 1]) / np.diff(track.times[: stands + 1])
    hard = np.flatnonzero(change <= -BRAKES)
    if light is None or away > BEFORE_LINE or not len(hard):
        return None
    time = float(track.times[int(hard[0])])
    came = lights.get_colour(light, time=max(time - COMES, track.start))
    if came != "green" or lights.get_colour(light, time=time) != "yellow":
        return None
    return (
        f"agent {track.id} brakes by {-change.min():.1f} m/s2 from {time:.1f} s on, at yellow, and "
        f"stands at its line at {track.times[stands]:.1f} s"
    )


def describe_blocking(seen: SeenMotion) -> str | None:
    """Beyond its line, passed on green, it stands while its light is red and another is green."""
    track, lights = seen.track, seen.lights
    for met in lights.find_crossings(track):
        if met.colour != "green":
            continue
        beyond = (track.times > met.time) & (track.speed <= STANDING)
        beyond &= np.hypot(*(track.xy - track.xy[-1]).T) > LEAVES
        times = [
            float(t)
            for t in track.times[beyond]
            if lights.get_colour(met.light, time=float(t)) == "red"
            and lights.is_any_line_green(time=float(t))
        ]
        if 0.1 * len(times) >= STANDS_AT_RED:
            return (
                f"agent {track.id} passes on green at {met.time:.1f} s and stands in the junction "
                f"at red for {0.1 * len(times):.1f} s"
            )
    return None
