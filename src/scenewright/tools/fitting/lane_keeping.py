"""How drivers keep to their lanes at a place of which there is no map, for the pool of p_wp.

Tracks alone tell it: those that run beside one another, closer than lanes are apart, share a lane,
and their mean is its middle. What each is beside that goes into the pool of its turn.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from scenewright.scene.base import FloatArray
from scenewright.scene.candidates import K
from scenewright.tools.fitting.path_frame import centreline
from scenewright.tools.fitting.route_matching import beside_of, distance_from, evenly

LEAST_WAY = 30.0
"""Tracks shorter than this [m] tell of no whole way."""
ONE_LANE = 1.3
"""Tracks closer than this on average [m] are on one lane."""
FEWEST = 3
"""Tracks of one lane, below which its middle is not known."""
_LANE = 3.25
"""Width of a lane in a town [m]; assumed, where pixels are to be metres."""
_NEXT = (0.75, 1.6)
"""A lane beside another is this many lane widths away, at the stated scale."""
_STRAIGHT, _TURN = math.radians(25.0), (math.radians(50.0), math.radians(130.0))
_ENDS = 6.0


def kept_lanes(tracks: Sequence[FloatArray]) -> dict[str, list[FloatArray]]:
    """By turn, for each lane [n, K] offsets to the left of its middle [m], NaN where unseen.

    Args:
        tracks: [T, 2] positions of vehicles in one frame [m].
    """
    found: dict[str, list[FloatArray]] = {}
    for turn, group in _by_turn(tracks).items():
        for lane in _groups(group):
            if len(lane) >= FEWEST:
                found.setdefault(turn, []).append(_centred(lane))
    return found


def _by_turn(tracks: Sequence[FloatArray]) -> dict[str, list[FloatArray]]:
    found: dict[str, list[FloatArray]] = {}
    for track in tracks:
        even = evenly(track)
        if 0.5 * len(even) >= LEAST_WAY:
            turn = _turn(even)
            if turn is not None:
                found.setdefault(turn, []).append(even)
    return found


def _turn(even: FloatArray) -> str | None:
    """The turn of a track [P, 2] of points half a metre apart; None for what is neither."""
    span = round(_ENDS / 0.5)
    first, last = even[span] - even[0], even[-1] - even[-1 - span]
    angle = math.atan2(first[0] * last[1] - first[1] * last[0], float(first @ last))
    if abs(angle) < _STRAIGHT:
        return "straight"
    if _TURN[0] < abs(angle) < _TURN[1]:
        return "left" if angle > 0 else "right"
    return None


def _centred(lane: Sequence[FloatArray]) -> FloatArray:
    """[n, K] offsets from the lane's own middle, as wide as if that had been known.

    Args:
        lane: its tracks; the first is the longest.
    """
    line = centreline(lane[0])
    beside = np.array([beside_of(track, line) for track in lane]).reshape(-1, K)
    seen = np.isfinite(beside)
    count = seen.sum(axis=0)
    middle = np.where(seen, beside, 0.0).sum(axis=0) / np.maximum(count, 1)
    wider = np.sqrt(count / np.maximum(count - 1, 1))
    return np.where(seen & (count >= FEWEST), (beside - middle) * wider, np.nan)


def lane_spacing(tracks: Sequence[FloatArray]) -> float | None:
    """How far lanes beside one another are apart [m], the median; None where there are none.

    Of tracks in pixels whose scale is only guessed it tells how far the guess is off.
    """
    gaps = []
    for group in _by_turn(tracks).values():
        middles = [m for m in map(_middle, _groups(group)) if m is not None]
        for i, one in enumerate(middles):
            away = [distance_from(one, centreline(other)) for other in middles[:i]]
            gaps += [gap for gap in away if _NEXT[0] * _LANE < gap < _NEXT[1] * _LANE]
    return float(np.median(gaps)) if gaps else None


def _groups(tracks: Sequence[FloatArray]) -> list[list[FloatArray]]:
    """The tracks of each lane, the longest first."""
    rest = sorted(tracks, key=len, reverse=True)
    groups = []
    while rest:
        line = centreline(rest[0])
        near = [k == 0 or distance_from(t, line) <= ONE_LANE for k, t in enumerate(rest)]
        groups.append([t for t, own in zip(rest, near, strict=True) if own])
        rest = [t for t, own in zip(rest, near, strict=True) if not own]
    return groups


def _middle(group: Sequence[FloatArray]) -> FloatArray | None:
    """The track in the middle of a lane's; None for a lane of few."""
    if len(group) < FEWEST:
        return None
    line = centreline(group[0])
    offsets = [float(np.nanmean(beside_of(each, line))) for each in group]
    return group[int(np.argsort(offsets)[len(offsets) // 2])]


def measured_scale(tracks: Sequence[FloatArray], guess: float) -> float | None:
    """Metres per pixel at which lanes would be as wide as in a town; None where none lie abreast.

    Args:
        tracks: at `guess` metres per pixel.
    """
    spacing = lane_spacing(tracks)
    return None if spacing is None else guess * _LANE / spacing
