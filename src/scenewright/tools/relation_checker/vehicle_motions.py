"""How vehicles drive where that was asked for, seen on their tracks: over the line on yellow."""

from __future__ import annotations

import math
from importlib import import_module
from typing import Any

import numpy as np

from scenewright.tools.relation_checker.motions import SeenMotion
from scenewright.tools.relation_checker.yielding import STANDING

geos: Any = import_module("shapely")

SINCE = 0.3
"""A light that has been yellow for less [s] turns as the vehicle passes: no choice was left."""
COMES = 2.0
"""How long before it brakes the light is still green [s]."""
LEAVES = 5.0
"""Who blocks the junction drives on by so much afterwards [m]."""
BRAKES = 3.0
"""Least braking of who brakes hard for a yellow light [m/s^2]."""
STANDS = 2.0
"""How long who blocks the junction stands there at red at least [s]."""
BEFORE_LINE = 3.0
"""Largest distance before its line of a vehicle that stops for its light [m]."""


WRONG_WAY = 12.0
"""Least way in lanes that lead the other way of who drives the wrong way [m]."""
AGAINST = math.radians(135.0)
"""Heading and direction of the lane are at least so far apart [rad]."""


def describe_passing(seen: SeenMotion) -> str | None:
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
        turn = np.abs(np.angle(np.exp(1j * (track.heading - ways[nearest]))))
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


def describe_stop(seen: SeenMotion) -> str | None:
    """It comes on green, begins to brake hard while its light is yellow, and stands at its line."""
    track, lights = seen.track, seen.lights
    moving = np.flatnonzero(track.speed > STANDING)
    stands = int(moving[-1]) + 1 if len(moving) else 0
    if not 0 < stands < len(track):
        return None
    light = lights.find_light_ahead(track, within=BEFORE_LINE)
    change = np.diff(track.speed[: stands + 1]) / np.diff(track.times[: stands + 1])
    hard = np.flatnonzero(change <= -BRAKES)
    if light is None or not len(hard):
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
        if 0.1 * len(times) >= STANDS:
            return (
                f"agent {track.id} passes on green at {met.time:.1f} s and stands in the junction "
                f"at red for {0.1 * len(times):.1f} s"
            )
    return None
