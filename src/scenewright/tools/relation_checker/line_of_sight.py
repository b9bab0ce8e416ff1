"""Visibility between agents (SEMANTICS 8): lines of sight past high footprints."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from scenewright.scene.base import FloatArray
from scenewright.scene.objects import ObjectRecord
from scenewright.scene.track import STEP
from scenewright.tools.relation_checker.footprints import BoolArray
from scenewright.tools.relation_checker.trajectory import Trajectory

EYE_BEHIND_FRONT = 0.4
"""How far behind its front a vehicle's driver sits, as a share of its length."""
EYE_ASIDE = 0.25
"""How far off the middle the driver sits, as a share of the width: left in right-hand traffic."""
STAYS_FREE = 0.3
"""How long a line of sight must stay free to count [s]."""


@dataclass(frozen=True)
class Sighting:
    """When one road user first sees another before an event.

    Attributes:
        time: first moment [s] from which the line of sight stays free.
        hidden_for: how long before that it was blocked without a break [s].
    """

    time: float
    hidden_for: float


def find_first_visible(
    observer: Trajectory,
    subject: Trajectory,
    *,
    objects: Sequence[ObjectRecord] = (),
    vehicles: Sequence[Trajectory] = (),
    until: float,
    left_hand: bool = False,
) -> Sighting | None:
    """The first sighting before a time, None where there is none.

    Looked for at every 0.1 s since both are there, backwards from `until`.

    Args:
        objects: standing ones; those that are low are seen over.
        vehicles: others that block the view where they are.
        until: the event [s].
    """
    begin = max(observer.start, subject.start)
    end = min(observer.end, subject.end, until)
    steps = int((end - begin) / STEP + 1e-6)
    if steps < 0:
        return None
    times = np.asarray(begin + STEP * np.arange(steps + 1), dtype=np.float64)
    free = ~find_blocked_views(
        observer, subject, times, objects=objects, vehicles=vehicles, left_hand=left_hand
    )
    need = round(STAYS_FREE / STEP)
    starts = [k for k in range(len(free) - need) if free[k : k + need + 1].all()]
    if not starts:
        return None
    blocked = 0
    while blocked < starts[0] and not free[starts[0] - blocked - 1]:
        blocked += 1
    return Sighting(float(times[starts[0]]), round(STEP * blocked, 3))


def find_blocked_views(
    observer: Trajectory,
    subject: Trajectory,
    times: FloatArray,
    *,
    objects: Sequence[ObjectRecord] = (),
    vehicles: Sequence[Trajectory] = (),
    left_hand: bool = False,
) -> BoolArray:
    """[T] whether nothing of the subject can be seen: every line to it meets a high footprint."""
    eyes = locate_eyes(observer, times, left_hand=left_hand)[:, None, :]
    marks = locate_marks(subject, times)
    met = np.zeros(marks.shape[:2], dtype=np.bool_)
    for each in objects:
        if each.height == "high":
            place = np.array([[each.x, each.y]]), np.array([each.heading])
            met |= meets_box(eyes, marks, *place, length=each.length, width=each.width)
    for other in vehicles:
        there = (times >= other.start - 1e-6) & (times <= other.end + 1e-6)
        met |= there[:, None] & meets_box(
            eyes, marks, *other.at(times), length=other.length, width=other.width
        )
    return np.asarray(met.all(axis=1))


def locate_eyes(observer: Trajectory, times: FloatArray, *, left_hand: bool = False) -> FloatArray:
    """[T, 2] where an observer's eyes are [m]: a driver's seat, else the middle."""
    xy, heading = observer.at(times)
    if observer.type != "vehicle":
        return xy
    forward = np.stack((np.cos(heading), np.sin(heading)), axis=1)
    leftward = np.stack((-forward[:, 1], forward[:, 0]), axis=1)
    seat = observer.length / 2 - EYE_BEHIND_FRONT * observer.length
    aside = EYE_ASIDE * observer.width * (-1.0 if left_hand else 1.0)
    return np.asarray(xy + seat * forward + aside * leftward)


def locate_marks(subject: Trajectory, times: FloatArray) -> FloatArray:
    """[T, 5, 2] the points of a road user that are looked for [m].

    Its middle and its corners; of a disc the points of its rim to the east, north, west and south.
    """
    xy, heading = subject.at(times)
    if subject.radius > 0.0:
        rim = np.array([(1, 0), (0, 1), (-1, 0), (0, -1)]) * subject.radius
        corners = xy[:, None, :] + rim
    else:
        along = np.stack((np.cos(heading), np.sin(heading)), axis=1) * subject.half_length
        across = np.stack((-np.sin(heading), np.cos(heading)), axis=1) * subject.half_width
        ways = (along + across, along - across, -along - across, across - along)
        corners = np.stack([xy + way for way in ways], axis=1)
    return np.concatenate((xy[:, None, :], corners), axis=1)


def meets_box(
    start: FloatArray,
    end: FloatArray,
    middle: FloatArray,
    heading: FloatArray,
    *,
    length: float,
    width: float,
) -> BoolArray:
    """[T, M] whether segments touch a rectangle: none of three directions separates the two.

    Args:
        start, end: [T, 1 or M, 2] of the segments [m].
        middle, heading: [T or 1, 2] and [T or 1] of the rectangle [m, rad].
    """
    cos, sin = np.cos(heading)[:, None], np.sin(heading)[:, None]
    half, centre = (end - start) / 2, (start + end) / 2 - middle[:, None, :]
    run, rise = (cos * v[..., 0] + sin * v[..., 1] for v in (half, centre))
    side, drift = (cos * v[..., 1] - sin * v[..., 0] for v in (half, centre))
    return np.asarray(
        (np.abs(rise) <= length / 2 + np.abs(run))
        & (np.abs(drift) <= width / 2 + np.abs(side))
        & (np.abs(run * drift - side * rise)
           <= length / 2 * np.abs(side) + width / 2 * np.abs(run) + 1e-12)
    )  # fmt: skip
