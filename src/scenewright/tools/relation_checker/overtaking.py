"""Close overtaking: a vehicle that passes a rider in its lane too near (SEMANTICS section 8)."""

from __future__ import annotations

import numpy as np

from scenewright.tools.relation_checker.contact import find_common_times, find_least_clearance
from scenewright.tools.relation_checker.footprints import compute_angle_between
from scenewright.tools.relation_checker.trajectory import Trajectory

CLOSE = 1.5
"""Least clearance with which a vehicle may overtake a rider [m]."""
SAME_WAY = np.deg2rad(30.0)
MOVING = 1.0
"""A vehicle slower than this [m/s] is passed, not overtaken."""
BESIDE = 4.0
"""Farthest to the side [m] that the vehicle's centre is still in the rider's company."""
AROUND = 2.0
"""How long before and after it is abreast the clearance counts [s]."""


def find_close_overtaking(
    first: Trajectory, second: Trajectory, *, left_hand: bool = False
) -> tuple[float, float] | None:
    """Time [s] and clearance [m] of a vehicle's close overtaking of a rider; None without one.

    It comes from behind, goes ahead on the side away from the kerb, and both are moving.

    Args:
        left_hand: people drive on the left, and overtake on the right.
    """
    if first.is_rider == second.is_rider or "pedestrian" in (first.type, second.type):
        return None
    rider, vehicle = (first, second) if first.is_rider else (second, first)
    times = find_common_times(vehicle, rider)
    if len(times) < 2:
        return None
    i, j = vehicle.find_indices(times), rider.find_indices(times)
    away = vehicle.xy[i] - rider.xy[j]
    cos, sin = np.cos(rider.heading[j]), np.sin(rider.heading[j])
    along = away[:, 0] * cos + away[:, 1] * sin
    aside = (away[:, 1] * cos - away[:, 0] * sin) * (-1.0 if left_hand else 1.0)
    passes = np.flatnonzero((along[:-1] < 0.0) & (along[1:] >= 0.0)) + 1
    for k in passes.tolist():
        alike = compute_angle_between(vehicle.heading[i[k : k + 1]], rider.heading[j[k : k + 1]])
        slower = min(float(vehicle.speed[i[k]]), float(rider.speed[j[k]]))
        if alike[0] > SAME_WAY or slower < MOVING or not 0.0 < aside[k] <= BESIDE:
            continue
        time = float(times[k])
        nearest = find_least_clearance(first, second, within=(time - AROUND, time + AROUND))
        if nearest is not None and nearest[1] < CLOSE:
            return nearest
    return None
