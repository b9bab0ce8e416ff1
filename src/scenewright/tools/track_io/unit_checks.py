"""What speaks against foreign tracks being metres, seconds and radians: notes, never refusals."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np

from scenewright.scene.base import FloatArray
from scenewright.tools.relation_checker.footprints import compute_angle_between
from scenewright.tools.relation_checker.trajectory import RoadUser

MOVES = 1.0
"""Slower than this [m/s] motion has no course to speak of."""
SLIP = np.deg2rad(20.0)
TINY = 0.01
"""Traffic that moves and all fits into this [m] is in degrees, not in metres."""
FAST = {"vehicle": 45.0, "pedestrian": 7.0, "cyclist": 20.0, "scooter": 15.0}
SLOW = 2.0
"""If no vehicle is faster than this [m/s] at a step of 0.5 s or more, times may be frames."""
LONG_STEP, DRIVEN = 0.5, 10.0
JERKY = 10.0
"""Positions that need this acceleration [m/s^2] most of the time are noise."""


def find_unit_doubts(users: Sequence[RoadUser], *, headed: Collection[int]) -> tuple[str, ...]:
    """One sentence for each thing that is odd about most of the tracks.

    Args:
        headed: ids of the users whose headings are the file's own.
    """
    moving = [user for user in users if len(user.track.xy) > 2]
    turned = shaken = 0
    for user in moving:
        velocity, second = _compute_velocity(user), np.diff(user.track.xy, n=2, axis=0)
        moves = np.hypot(velocity[:, 0], velocity[:, 1]) > MOVES
        if user.id in headed and user.shape.type == "vehicle" and moves.any():
            course = np.arctan2(velocity[moves, 1], velocity[moves, 0])
            off = compute_angle_between(course, user.track.heading[1:-1][moves]) > SLIP
            turned += bool(off.mean() > 0.5)
        needed = np.hypot(*(second / user.track.step**2).T)
        shaken += bool(user.track.step <= 0.25 and np.median(needed) > JERKY)
    notes = []
    if turned:
        notes.append(
            f"headings of {turned} vehicle{'s' * (turned > 1)} differ from their motion by more "
            "than 20 degrees most of the time; headings are radians from east, counter-clockwise"
        )
    notes += _check_scale(moving)
    if shaken and 2 * shaken >= len(moving):
        notes.append(
            f"positions of {shaken} of {len(moving)} agents are too uneven for speeds and braking; "
            "smooth them first"
        )
    return tuple(notes)


def _compute_velocity(user: RoadUser) -> FloatArray:
    """[T-2, 2] by central differences [m/s]."""
    xy, step = user.track.xy, user.track.step
    return np.asarray((xy[2:] - xy[:-2]) / (2 * step))


def _check_scale(users: Sequence[RoadUser]) -> list[str]:
    """Whether lengths or times have another unit."""
    xy = np.concatenate([np.zeros((0, 2)), *(user.track.xy for user in users)])
    extent = float(np.ptp(xy, axis=0).max()) if len(xy) else 0.0
    if 0.0 < extent < TINY:
        return [f"all tracks lie within {extent:.2g} m; positions are metres, not degrees"]
    notes = []
    tops = [float(np.percentile(np.hypot(*_compute_velocity(u).T), 95)) for u in users]
    for kind, limit in FAST.items():
        own = [top for user, top in zip(users, tops, strict=True) if user.shape.type == kind]
        if own and float(np.median(own)) > limit:
            notes.append(
                f"half of the {kind}s reach {np.median(own):.0f} m/s; positions are metres, "
                "times seconds"
            )
    driven = [
        (user.track.step, top)
        for user, top in zip(users, tops, strict=True)
        if user.shape.type == "vehicle"
        and np.hypot(*(user.track.xy[-1] - user.track.xy[0])) > DRIVEN
    ]
    if driven and driven[0][0] >= LONG_STEP and max(top for _, top in driven) < SLOW:
        notes.append(f"no vehicle is faster than {SLOW:.0f} m/s; times are seconds, not frames")
    return notes
