"""How agents stop: how long, how far from what they wait for, how hard before and after.

A *stop* is a standstill (at most 0.3 m/s for 0.5 s or longer, SEMANTICS section 4) of an agent that
had moved. A *yield's stop* is the one of a giver between its slowing and its entering the zone.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from scenewright.scene.base import FloatArray
from scenewright.scene.events import Event
from scenewright.scene.map import IntersectionMap
from scenewright.scene.track import STEP
from scenewright.tools.relation_checker import Trajectory

STANDING = 0.3
SHORTEST = 0.5
MOVED = {"vehicle": 2.0, "pedestrian": 0.5}
"""An agent that never was faster than this before did not stop [m/s] (SEMANTICS section 4)."""
RAMP = 6.0
"""Time before and after a standstill in which braking and starting are measured [s]."""
BEGUN = 0.95
"""Braking began when this share of the largest speed was last driven."""
WAY_AHEAD, OVER_IT, MOVES_ON = 18.0, 1.0, 1.0
"""An agent passes if it moves more than 1 m and comes within 1 m of the next 18 m of the path."""
LINE_REACH = 12.0
"""A stop further than this before a stop line is no stop at it [m]."""
INWARDS = 0.7
"""Cosine of the angle to a leg's axis within which a vehicle drives in on it, or crosses a line."""


@dataclass(frozen=True)
class ObservedStop:
    """One stop; what could not be measured is None.

    Attributes:
        alone: no other passed ahead of it while it stood, and it gave way to no other.
        duration: of the standstill [s]; None where the scene began or ended in it.
        gap: of a giver: from its front to what it stops for [m]: the stop line ahead or,
            along its own path, the conflict zone, whichever is nearer. None where it did not
            give way, where it stands behind another vehicle (or walker), and where it has no line
            ahead and never entered.
        line_gap: from its front bumper to the stop line ahead [m]; None where there is none near.
        braking: hardest in the 6 s before [m/s^2]; mean_braking: since its
            largest speed there.
        starting: strongest acceleration in the 6 s after; mean_starting: over the first 2 s.
    """

    alone: bool = False
    duration: float | None = None
    gap: float | None = None
    line_gap: float | None = None
    braking: float | None = None
    mean_braking: float | None = None
    starting: float | None = None
    mean_starting: float | None = None


def find_stop_of_yield(
    giver: Trajectory,
    event: Event,
    intersection_map: IntersectionMap,
    users: Sequence[Trajectory],
) -> ObservedStop | None:
    """Find the last standstill between the giver's slowing and its entering the zone."""
    begin = float(event.evidence["begins_to_slow"])
    entered = event.evidence.get("entered")
    until = giver.end if entered is None else float(entered)
    inside = [s for s in find_standstills(giver) if begin <= giver.times[s.start] <= until]
    if not inside:
        return None
    stand = inside[-1]
    stop = measure_stop(giver, stand, intersection_map)
    ahead = [] if stop.line_gap is None or stop.line_gap < 0 else [stop.line_gap]
    if entered is not None:
        zone = np.interp(float(entered), giver.times, giver.s) - giver.s[stand.stop - 1]
        ahead.append(max(float(zone), 0.0))
    gap = min(ahead, default=None)
    if gap is not None and _is_queueing(giver, stand.stop - 1, gap, users):
        gap = None
    alone = not _has_others_passing(giver, stand, event.to, users)
    return replace(stop, gap=gap, alone=alone)


def _has_others_passing(
    giver: Trajectory, stand: slice, to: int, users: Iterable[Trajectory]
) -> bool:
    """Return whether an agent other than `to` crosses the path ahead of a standing agent."""
    last = stand.stop - 1
    driven = giver.s - giver.s[last]
    way = giver.xy[(np.arange(len(driven)) > last) & (driven > 0.0) & (driven < WAY_AHEAD)][::3]
    for other in users:
        first = max(float(giver.times[stand.start]), other.start)
        until = min(float(giver.times[last]), other.end)
        if other.id in (giver.id, to) or until <= first or not len(way):
            continue
        seen = slice(other.index(first), other.index(until) + 1)
        if float(other.s[seen][-1] - other.s[seen][0]) < MOVES_ON:
            continue
        away = other.xy[seen][:, None] - way[None]
        if float(np.hypot(away[..., 0], away[..., 1]).min()) < OVER_IT:
            return True
    return False


def _is_queueing(giver: Trajectory, k: int, gap: float, users: Iterable[Trajectory]) -> bool:
    """Return whether another of its class stands between it and what it waits for."""
    forward = np.array([np.cos(giver.heading[k]), np.sin(giver.heading[k])])
    for other in users:
        time = giver.times[k]
        if other.id == giver.id or other.type != giver.type:
            continue
        if (
            not other.start <= time <= other.end
            or other.speed[other.index(time)] > MOVED[other.type]
        ):
            continue
        away = other.xy[other.index(time)] - giver.xy[k]
        ahead = float(away @ forward)
        aside = abs(float(forward[0] * away[1] - forward[1] * away[0]))
        if 0 < ahead < gap + giver.nose + other.nose and aside < (giver.width + other.width) / 2:
            return True
    return False


def find_standstills(mover: Trajectory) -> list[slice]:
    """Find the samples of each standstill of 0.5 s or longer."""
    still = mover.speed <= STANDING
    edges = np.flatnonzero(np.diff(still.astype(np.int8), prepend=0, append=0)).reshape(-1, 2)
    least = round(SHORTEST / STEP)
    return [slice(int(a), int(b)) for a, b in edges if b - a >= least]


def measure_stop(
    mover: Trajectory, stand: slice, intersection_map: IntersectionMap
) -> ObservedStop:
    """Measure a standstill and what comes before and after it."""
    whole = stand.start > 0 and stand.stop < len(mover)
    before = slice(max(stand.start - round(RAMP / STEP), 0), stand.start + 1)
    after = slice(stand.stop - 1, stand.stop + round(RAMP / STEP))
    braking, mean_braking = _measure_braking(mover, before)
    starting, mean_starting = _measure_starting(mover, after)
    return ObservedStop(
        duration=(stand.stop - stand.start) * STEP if whole else None,
        line_gap=measure_line_gap(mover, stand.start, intersection_map),
        braking=braking,
        mean_braking=mean_braking,
        starting=starting,
        mean_starting=mean_starting,
    )


def _measure_braking(mover: Trajectory, span: slice) -> tuple[float | None, float | None]:
    """Measure the hardest braking before a standstill, and the mean from the largest speed on."""
    speed = mover.speed[span]
    top = int(np.flatnonzero(speed >= BEGUN * speed.max())[-1])
    taken = (len(speed) - 1 - top) * STEP
    if span.start == 0 and top == 0:
        return None, None  # it came into sight braking: how hard it began to is not seen
    if speed[top] < MOVED[mover.type] or taken <= 0:
        return None, None
    return float(-mover.acceleration[span].min()), float((speed[top] - speed[-1]) / taken)


def _measure_starting(mover: Trajectory, span: slice) -> tuple[float | None, float | None]:
    """Measure the strongest acceleration after a standstill, and the mean over its first 2 s."""
    speed = mover.speed[span]
    first = round(2.0 / STEP)
    if len(speed) <= first + 3:
        return None, None
    return float(mover.acceleration[span][:-3].max()), float((speed[first] - speed[0]) / 2.0)


def measure_line_gap(mover: Trajectory, k: int, intersection_map: IntersectionMap) -> float | None:
    """Measure the distance from a vehicle's front to the stop line straight ahead of it [m].

    None for pedestrians and where no line lies within 12 m ahead (or 1 m behind) of the front.
    """
    if not mover.is_vehicle:
        return None
    heading = np.array([np.cos(mover.heading[k]), np.sin(mover.heading[k])])
    front = mover.xy[k] + heading * mover.half_length
    bearing = {leg.name: leg.bearing for leg in intersection_map.legs}
    gaps = [
        _compute_distance_ahead(front, heading, np.array(line.line))
        for line in intersection_map.stop_lines
        if np.cos(mover.heading[k] - bearing[line.leg]) < -INWARDS
    ]
    near = (gap for gap in gaps if gap is not None and -1.0 <= gap <= LINE_REACH)
    return min(near, default=None, key=abs)


def _compute_distance_ahead(
    front: FloatArray, heading: FloatArray, line: FloatArray
) -> float | None:
    """Compute how far ahead of a point a line is crossed; None if it is not."""
    along = line[1] - line[0]
    across = float(heading[0] * along[1] - heading[1] * along[0])
    if abs(across) < INWARDS * float(np.hypot(*along)):
        return None
    away = line[0] - front
    ahead = float(away[0] * along[1] - away[1] * along[0]) / across
    share = float(away[0] * heading[1] - away[1] * heading[0]) / across
    return ahead if 0.0 <= share <= 1.0 else None
