"""Visibility between agents (SEMANTICS 8): lines of sight past high footprints."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from scenewright.compiled import compiled_to_write
from scenewright.scene.base import FloatArray
from scenewright.scene.objects import ObjectRecord
from scenewright.scene.track import STEP
from scenewright.tools.relation_checker.contact import find_common_times
from scenewright.tools.relation_checker.footprints import (
    BoolArray,
    compute_corners,
    make_pose,
    meets_box,
)
from scenewright.tools.relation_checker.trajectory import Trajectory, find_first_lasting

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
        vehicles: what blocks the view where it is, but for the two themselves.
        until: the event [s].
    """
    times = find_common_times(observer, subject)
    times = times[times <= until + 1e-7]
    if not len(times):
        return None
    free = ~find_blocked_views(
        observer, subject, times, objects=objects, vehicles=vehicles, left_hand=left_hand
    )
    first = find_first_lasting(free, least=STAYS_FREE)
    if first is None:
        return None
    before = np.flatnonzero(free[:first])
    blocked = first - int(before[-1]) - 1 if len(before) else first
    return Sighting(float(times[first]), round(STEP * blocked, 3))


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
    eyes, marks = locate_eyes(observer, times, left_hand=left_hand), locate_marks(subject, times)
    met = np.zeros(marks.shape[:2], dtype=np.bool_)
    for scene_object in objects:
        if scene_object.height == "high":
            place = np.array([(scene_object.x, scene_object.y)]), np.array([scene_object.heading])
            _mark_met(met, eyes, marks, *place, scene_object.length, scene_object.width)
    table = _tabulate_bounds(tuple(vehicles))
    # Vehicles that never come between the two are left out at once.
    views = np.concatenate((eyes, marks.reshape(-1, 2)))
    between = (table[:, :2] <= views.max(axis=0, initial=-np.inf)).all(axis=1)
    between &= (table[:, 2:] >= views.min(axis=0, initial=np.inf)).all(axis=1)
    for other in (vehicles[n] for n in np.flatnonzero(between).tolist()):
        if other not in (observer, subject):
            k = slice(*np.searchsorted(times, (other.start - 1e-6, other.end + 1e-6)))
            place = other.at(times[k])
            _mark_met(met[k], eyes[k], marks[k], *place, other.length, other.width)
    return np.asarray(met.all(axis=1))


@lru_cache(maxsize=4)
def _tabulate_bounds(vehicles: tuple[Trajectory, ...]) -> FloatArray:
    """[N, 4] west, south, east and north end of all footprints [m]; movers by identity."""
    reach = np.array([(-m.reach, -m.reach, m.reach, m.reach) for m in vehicles]).reshape(-1, 4)
    return np.asarray(np.array([m.bounds for m in vehicles]).reshape(-1, 4) + reach)


@compiled_to_write
def _mark_met(
    met: BoolArray,
    eyes: FloatArray,
    marks: FloatArray,
    xy: FloatArray,
    heading: FloatArray,
    length: float,
    width: float,
) -> None:
    """Writes which lines from an eye [T, 2] to marks [T, M, 2] meet a box, which moves or not."""
    for k in range(len(met)):
        n = min(k, len(heading) - 1)
        place = make_pose(xy[n, 0], xy[n, 1], heading[n])
        for i in range(met.shape[1]):
            met[k, i] |= meets_box(eyes[k], marks[k, i], place, length, width)


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
        corners = compute_corners(xy, heading, length=subject.length, width=subject.width)
    return np.concatenate((xy[:, None, :], corners), axis=1)
