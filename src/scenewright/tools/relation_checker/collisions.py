"""What kind of collision a contact is, and what led to a collision or near miss."""

from __future__ import annotations

from dataclasses import dataclass
from operator import itemgetter
from typing import Literal, cast

import numpy as np

from scenewright.scene.social import CollisionKind, ImpactPoint
from scenewright.tools.relation_checker.contact import estimate_velocity_before, find_contact_point
from scenewright.tools.relation_checker.footprints import (
    compute_angle_between,
    compute_offsets,
)
from scenewright.tools.relation_checker.signals import SignalPlan
from scenewright.tools.relation_checker.trajectory import Trajectory

Side = Literal["front", "rear", "side"]

IMPACT_SPEED = 1.0
"""Least relative speed of a collision [m/s]."""
STRIKE_SPEED = 2.0
STANDING_SPEED = 0.3
"""An agent slower than this [m/s] strikes no moving agent."""
BUMPER = 0.3
"""Depth of front and rear in which a contact belongs to them [m]."""
CORNER = 0.5
"""Depth either way of a corner [m], where that is no more than a third of the vehicle."""
CURVE_BRAKING = 2.5
"""Braking with which one slows for a curve at the most [m/s^2]; harder is a reaction."""
LEFT_TURN = np.deg2rad(15.0)
LEFT_TURN_HEAD_ON = np.deg2rad(25.0)


@dataclass(frozen=True)
class Impact:
    """A contact, measured.

    Attributes:
        place: middle of the contact [m].
        speeds: of both just before [m/s]; relative_speed [m/s].
        sides: on which side of each it lies; None for pedestrians.
        points: the same more finely: a corner, front, rear, left or right.
        angle: between the headings [rad].
    """

    place: tuple[float, float]
    speeds: tuple[float, float]
    relative_speed: float
    sides: tuple[Side | None, Side | None]
    points: tuple[ImpactPoint | None, ImpactPoint | None]
    angle: float


def measure_impact(first: Trajectory, second: Trajectory, *, time: float) -> Impact:
    """Speeds, sides and angle of a contact at a time [s]."""
    place = find_contact_point(first, second, time=time)
    one, two = (estimate_velocity_before(m, time=time) for m in (first, second))
    poses = [m.at(np.array([time])) for m in (first, second)]
    where = [
        (float(along[0]), float(across[0]))
        for along, across in (compute_offsets(np.array(place), *pose) for pose in poses)
    ]
    return Impact(
        place=place,
        speeds=(float(np.hypot(*one)), float(np.hypot(*two))),
        relative_speed=float(np.hypot(*(one - two))),
        sides=(_find_contact_side(first, where[0][0]), _find_contact_side(second, where[1][0])),
        points=(_find_impact_point(first, *where[0]), _find_impact_point(second, *where[1])),
        angle=float(compute_angle_between(poses[0][1], poses[1][1])[0]),
    )


def _find_contact_side(track: Trajectory, along: float) -> Side | None:
    """The side of a vehicle at which a point of contact lies; None for a pedestrian.

    Front and rear are the outer 0.3 m of the length, corners included; the rest is side.
    """
    if not track.is_vehicle:
        return None
    if along >= track.half_length - BUMPER:
        return "front"
    return "rear" if along <= BUMPER - track.half_length else "side"


def _find_impact_point(track: Trajectory, along: float, across: float) -> ImpactPoint | None:
    """The corner, end or side of a vehicle that a point of contact is at; None for a pedestrian.

    A corner lies within 0.5 m of an end and of a side (a third of a small vehicle); front and rear
    are what is left within that depth of an end, left and right what is left of the outline.
    """
    if not track.is_vehicle:
        return None
    from_end = track.half_length - abs(along) - min(CORNER, track.length / 3)
    from_side = track.half_width - abs(across) - min(CORNER, track.width / 3)
    end: Literal["front", "rear"] = "front" if along > 0 else "rear"
    side: Literal["left", "right"] = "left" if across > 0 else "right"
    if from_end <= 0 and from_side <= 0:
        return cast(ImpactPoint, f"{end}_{side}")
    return end if from_end <= min(from_side, 0.0) or from_end < from_side else side


def is_impact_at(asked: ImpactPoint, seen: ImpactPoint | None) -> bool:
    """Whether a contact is where it was asked for; corners belong to front and rear, not to sides.

    >>> is_at("front", "front_left"), is_at("side", "right"), is_at("left", "rear_left")
    (True, True, False)
    """
    if seen is None:
        return False
    if asked in ("front", "rear"):
        return seen.startswith(asked)
    return seen in ("left", "right") if asked == "side" else seen == asked


def classify_collision(
    first: Trajectory, second: Trajectory, hit: Impact, *, time: float, left_hand: bool = False
) -> CollisionKind | None:
    """Kind of a collision (SEMANTICS section 4); None for pedestrians hit below 2 m/s or on foot.

    Same direction first, then head-on against left turn: where the fronts meet, an agent that has
    turned left by 25 degrees makes it a left turn; elsewhere 15 degrees do. In left-hand traffic
    the turn to the right leads across the others' path, and that is what the kind means.
    """
    if not (first.is_vehicle and second.is_vehicle):
        driven = [s for m, s in zip((first, second), hit.speeds, strict=True) if m.is_vehicle]
        return "pedestrian_strike" if driven and driven[0] >= STRIKE_SPEED else None
    if hit.angle <= np.deg2rad(30.0):
        return "rear_end" if set(hit.sides) == {"front", "rear"} else "sideswipe"
    # How far each has turned across the others' path in its last 30 m.
    turned = 0.0
    for track in (first, second):
        k = track.index(time)
        recent = track.s[: k + 1] >= track.s[k] - 30.0
        heading = track.heading[: k + 1][recent] * (-1.0 if left_hand else 1.0)
        turned = max(turned, float(heading[-1] - heading.min()))
    fronts = hit.sides == ("front", "front")
    if hit.angle >= np.deg2rad(135.0) and fronts:
        return "left_turn" if turned >= LEFT_TURN_HEAD_ON else "head_on"
    return "left_turn" if turned >= LEFT_TURN else "angle"


def find_striker(first: Trajectory, second: Trajectory, hit: Impact) -> int:
    """Index of the striking agent: the vehicle; the moving one; hit at its front; the faster."""
    if first.is_vehicle != second.is_vehicle:
        return 0 if first.is_vehicle else 1
    still = [speed <= STANDING_SPEED for speed in hit.speeds]
    if still[0] != still[1]:
        return 1 if still[0] else 0
    front = [side == "front" for side in hit.sides]
    if front[0] != front[1]:
        return 0 if front[0] else 1
    return 0 if hit.speeds[0] >= hit.speeds[1] - 0.1 else 1


def find_causes(
    first: Trajectory, second: Trajectory, *, time: float, lights: SignalPlan
) -> tuple[tuple[str, int] | None, int | None]:
    """What led to a collision or near miss and the id of who did it; the id of who braked late.

    `red_light_run`: it crossed its stop line, or stepped into the crosswalk, on red before the
    event. `late_brake`: a vehicle brakes harder than 3.4 m/s^2 in the last 3 s, and half a second
    before it began to, it had for a second not braked harder than for a curve.
    """
    late = _find_late_braker(first, second, time)
    red = find_red_run(first, second, time=time, lights=lights)
    return red or (None if late is None else ("late_brake", late)), late


def find_red_run(
    first: Trajectory, second: Trajectory, *, time: float, lights: SignalPlan
) -> tuple[str, int] | None:
    """`red_light_run` and the id of the first of the two that ran its light before a time [s]."""
    for track in (first, second):
        if any(c.time <= time for c in lights.find_red_crossings(track)):
            return "red_light_run", track.id
    return None


def _find_late_braker(first: Trajectory, second: Trajectory, time: float) -> int | None:
    """The id of the first of the two that brakes late before a time [s]; None if neither does.

    Of two that drive one way it is the one that began: the other brakes because of it.
    """
    late: list[tuple[float, Trajectory]] = []
    for track in (m for m in (first, second) if m.is_vehicle):
        times = track.times
        hard = (track.acceleration < -3.4) & (times >= time - 3.0) & (times <= time + 1e-6)
        onset = float(times[int(np.argmax(hard))]) if hard.any() else np.inf
        before = track.acceleration[(times >= onset - 1.5) & (times <= onset - 0.5)]
        if np.isfinite(onset) and len(before) and not (before < -CURVE_BRAKING).any():
            late.append((onset, track))
    if len(late) == 2:
        headings = (track.at(np.array([time]))[1] for _, track in late)
        if float(compute_angle_between(*headings)[0]) <= np.deg2rad(30.0):
            late.sort(key=itemgetter(0))
    return late[0][1].id if late else None
