"""How pedestrians move where that was asked for, seen on their tracks: they run, stand, return."""

from __future__ import annotations

import numpy as np

from scenewright.tools.relation_checker.ground_raster import get_ground_raster
from scenewright.tools.relation_checker.motions import SeenMotion
from scenewright.tools.relation_checker.standstills import find_standstills
from scenewright.tools.relation_checker.yielding import STANDING

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
