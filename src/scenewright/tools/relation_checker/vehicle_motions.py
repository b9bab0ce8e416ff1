"""How vehicles drive where that was asked for, seen on their tracks: over the line on yellow."""

from __future__ import annotations

from scenewright.tools.relation_checker.signals import SignalPlan
from scenewright.tools.relation_checker.trajectory import Trajectory

SINCE = 0.3
"""A light that has been yellow for less [s] turns as the vehicle passes: no choice was left."""


def describe_vehicle_motion(
    motion: str | None, track: Trajectory, lights: SignalPlan
) -> str | None:
    """What a track shows of a vehicle's motion; None if it does not."""
    if motion != "passes_yellow" or track.type == "pedestrian":
        return None
    for met in lights.find_crossings(track):
        before = lights.get_colour(met.light, time=met.time - SINCE)
        if met.colour == before == "yellow":
            return f"agent {track.id} passes on yellow at {met.time:.1f} s"
    return None
