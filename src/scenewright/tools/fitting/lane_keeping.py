"""How vehicles keep to their lanes at a place of which there is no map, for the pool of p_wp.

Tracks that run beside one another, closer than lanes are apart, share a lane, and their mean is
its middle. What each deviates from it goes into the pool of its turn.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from scenewright.scene.base import FloatArray
from scenewright.scene.candidates import K
from scenewright.tools.fitting.path_frame import build_centreline
from scenewright.tools.fitting.route_matching import (
    measure_mean_distance,
    measure_offsets,
    resample_track,
)

_SHORTEST = 30.0
"""Tracks shorter than this [m] show no whole path."""
_ONE_LANE = 1.3
"""Tracks closer than this on average [m] are on one lane."""
_MIN_TRACKS = 3
"""Of one lane, to know its middle."""
_LANE = 3.25
"""Width of a lane in a town [m]; assumed, where pixels are to be metres."""
_NEXT = (0.75, 1.6)
"""A lane beside another is this many lane widths away, at the stated scale."""
_STRAIGHT, _TURN = math.radians(25.0), (math.radians(50.0), math.radians(130.0))
_ENDS = 6.0


def find_lane_offsets(tracks: Sequence[FloatArray]) -> dict[str, list[FloatArray]]:
    """By turn, for each lane [n, K] offsets to the left of its middle [m], NaN where unseen.

    Args:
        tracks: [T, 2] positions of vehicles in one frame [m].
    """
    lane_offsets: dict[str, list[FloatArray]] = {}
    for turn, group in _group_by_turn(tracks).items():
        for lane in _group_by_lane(group):
            lane_offsets.setdefault(turn, []).append(_measure_from_middle(lane))
    return lane_offsets


def _group_by_turn(tracks: Sequence[FloatArray]) -> dict[str, list[FloatArray]]:
    found: dict[str, list[FloatArray]] = {}
    for track in map(resample_track, tracks):
        turn = _classify_turn(track) if 0.5 * len(track) >= _SHORTEST else None
        if turn is not None:
            found.setdefault(turn, []).append(track)
    return found


def _classify_turn(track: FloatArray) -> str | None:
    """The turn of a track [P, 2] of points half a metre apart; None if unclear."""
    span = round(_ENDS / 0.5)
    first, last = track[span] - track[0], track[-1] - track[-1 - span]
    angle = math.atan2(first[0] * last[1] - first[1] * last[0], float(first @ last))
    if abs(angle) < _STRAIGHT:
        return "straight"
    if _TURN[0] < abs(angle) < _TURN[1]:
        return "left" if angle > 0 else "right"
    return None


def _group_by_lane(tracks: Sequence[FloatArray]) -> list[list[FloatArray]]:
    """The tracks of each lane that has enough, the longest first."""
    rest = sorted(tracks, key=len, reverse=True)
    groups = []
    while rest:
        line = build_centreline(rest[0])
        near = [k == 0 or measure_mean_distance(t, line) <= _ONE_LANE for k, t in enumerate(rest)]
        groups.append([t for t, own in zip(rest, near, strict=True) if own])
        rest = [t for t, own in zip(rest, near, strict=True) if not own]
    return [group for group in groups if len(group) >= _MIN_TRACKS]


def _measure_from_middle(lane: Sequence[FloatArray]) -> FloatArray:
    """[n, K] offsets from the lane's own middle, as wide as if that had been known.

    Args:
        lane: its tracks; the first is the longest.
    """
    line = build_centreline(lane[0])
    offsets = np.array([measure_offsets(track, line) for track in lane]).reshape(-1, K)
    seen = np.isfinite(offsets)
    count = seen.sum(axis=0)
    middle = np.where(seen, offsets, 0.0).sum(axis=0) / np.maximum(count, 1)
    wider = np.sqrt(count / np.maximum(count - 1, 1))
    return np.where(seen & (count >= _MIN_TRACKS), (offsets - middle) * wider, np.nan)


def measure_scale(tracks: Sequence[FloatArray], guess: float) -> float | None:
    """Metres per pixel at which lanes would be as wide as in a town; None where none lie abreast.

    Args:
        tracks: at `guess` metres per pixel.
    """
    gaps = []
    for group in _group_by_turn(tracks).values():
        middles = []
        for lane in _group_by_lane(group):
            line = build_centreline(lane[0])
            offsets = [float(np.nanmean(measure_offsets(each, line))) for each in lane]
            middles.append(lane[int(np.argsort(offsets)[len(offsets) // 2])])
        for i, one in enumerate(middles):
            away = [measure_mean_distance(one, build_centreline(other)) for other in middles[:i]]
            gaps += [gap for gap in away if _NEXT[0] * _LANE < gap < _NEXT[1] * _LANE]
    return guess * _LANE / float(np.median(gaps)) if gaps else None
