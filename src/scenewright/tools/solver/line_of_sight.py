"""When a driver first sees a pedestrian or rider past standing objects (SEMANTICS 8)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from scenewright.scene.base import FloatArray
from scenewright.scene.objects import ObjectRecord
from scenewright.scene.track import STEP
from scenewright.tools.solver.scheduled_agent import ScheduledAgent, get_shared_times

EYE_BEHIND_FRONT, EYE_ASIDE = 0.4, 0.25
"""Where a driver's eye is: share of the length behind the front, of the width off the middle."""

STAYS_FREE = 0.3
"""How long [s] a line of sight must stay free to count."""


def find_lead(
    driver: ScheduledAgent,
    walker: ScheduledAgent,
    objects: Sequence[ObjectRecord],
    *,
    event: float,
    left_hand: bool,
) -> tuple[float, float] | None:
    """Find how long before an event [s] the line of sight is first free, and how long it was not.

    None where it never is before the event.
    """
    times = get_shared_times(driver, walker)
    if times is None:
        return None
    times = times[(times > -STEP / 2) & (times <= event)]
    free = ~find_blocked(
        compute_eyes(driver, times, left_hand=left_hand), compute_marks(walker, times), objects
    )
    steps = round(STAYS_FREE / STEP)
    lasting = np.convolve(free, np.ones(steps + 1))[steps:] > steps + 0.5
    if not lasting.any():
        return None
    first = int(np.argmax(lasting))
    return float(event - times[first]), STEP * first


def compute_eyes(driver: ScheduledAgent, times: FloatArray, *, left_hand: bool) -> FloatArray:
    """Compute the driver's eye [N, 2] at scene times [s]."""
    x, y, heading = driver.get_poses(times).T
    shape = driver.candidate.shape
    ahead = (0.5 - EYE_BEHIND_FRONT) * shape.length
    aside = EYE_ASIDE * shape.width * (-1 if left_hand else 1)
    cos, sin = np.cos(heading), np.sin(heading)
    return np.stack((x + ahead * cos - aside * sin, y + ahead * sin + aside * cos), axis=1)


def compute_marks(walker: ScheduledAgent, times: FloatArray) -> FloatArray:
    """Compute what is looked for [N, 5, 2]: the middle, and four points of the rim of a pedestrian
    or the corners of a rider."""
    x, y, heading = walker.get_poses(times).T
    shape = walker.candidate.shape
    if shape.type == "pedestrian":
        ends = shape.length / 2 * np.array([(0, 0), (1, 0), (-1, 0), (0, 1), (0, -1)])
        return np.asarray(np.stack((x, y), axis=1)[:, None, :] + ends)
    ends = np.array([(0, 0), (1, 1), (1, -1), (-1, -1), (-1, 1)]) / 2
    ahead, aside = (ends * (shape.length, shape.width)).T
    cos, sin = np.cos(heading)[:, None], np.sin(heading)[:, None]
    return np.stack(
        (x[:, None] + cos * ahead - sin * aside, y[:, None] + sin * ahead + cos * aside), axis=-1
    )


def find_blocked(
    eyes: FloatArray, targets: FloatArray, objects: Sequence[ObjectRecord]
) -> np.ndarray[tuple[int, ...], np.dtype[np.bool_]]:
    """Return [N] whether a high object blocks every line from the eye [N, 2] to the points looked
    for [N, M, 2]."""
    met = np.zeros(targets.shape[:2], dtype=np.bool_)
    start = eyes[:, None, :]
    for box in (each for each in objects if each.height == "high"):
        # A segment meets a rectangle where it is within both of its slabs at once.
        cos, sin = np.cos(box.heading), np.sin(box.heading)
        turn, half = np.array([(cos, -sin), (sin, cos)]), np.array([box.length, box.width]) / 2
        one, way = (start - np.array([box.x, box.y])) @ turn, (targets - start) @ turn
        way = np.where(np.abs(way) < 1e-9, 1e-9, way)
        enter, leave = np.sort(np.stack(((-half - one) / way, (half - one) / way)), axis=0)
        met |= np.maximum(enter.max(axis=-1), 0.0) <= np.minimum(leave.min(axis=-1), 1.0)
    return np.asarray(met.all(axis=1))
