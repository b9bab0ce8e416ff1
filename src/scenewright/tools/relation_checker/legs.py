"""Which leg a track comes from, and how the entries of two tracks lie to one another.

The lane that a track begins or ends on determines its leg, however the legs bend. Beside the
lanes (a wrong-way driver, a map without lanes) it is the leg whose direction it has.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Literal

import numpy as np

from scenewright.compiled import compiled
from scenewright.scene.base import COMPASS_RING, FloatArray
from scenewright.scene.events import Finding
from scenewright.scene.map import IntersectionMap
from scenewright.scene.record import TieRecord
from scenewright.tools.relation_checker.ground_raster import get_ground_raster
from scenewright.tools.relation_checker.trajectory import Trajectory

ALONG = np.deg2rad(40.0)
"""How far a track may begin off the direction of the leg that it comes in by [rad]."""
BESIDE = 2.5
"""How far from the middle of a lane a vehicle's centre may be on it [m]."""
WELL_OUT = 8.0
"""How far out of the middle a track has chosen its exit [m]."""

_SEEN_AS = {"lateral": ("left", "right"), "other": ("left", "right", "opposite")}


@compiled
def _find_nearest_alike(
    points: FloatArray, headings: FloatArray, place: FloatArray, heading: float
) -> tuple[int, float]:
    """Of points that lead the way of a heading the nearest to a place [2], and how far it is."""
    nearest, least = 0, np.inf
    for k in range(len(points)):
        if abs((headings[k] - heading + np.pi) % (2.0 * np.pi) - np.pi) <= ALONG:
            away = np.hypot(points[k, 0] - place[0], points[k, 1] - place[1])
            if away < least:
                nearest, least = k, away
    return nearest, least


def find_entry_leg(track: Trajectory, intersection_map: IntersectionMap) -> str | None:
    """The leg along which a track comes in; None if it begins where that is unclear."""
    return _find_leg(track, intersection_map, "approach")


def find_exit_leg(track: Trajectory, intersection_map: IntersectionMap) -> str | None:
    """The leg along which a track goes out; None if it ends before that is clear."""
    return _find_leg(track, intersection_map, "exit")


def _find_leg(
    track: Trajectory, intersection_map: IntersectionMap, kind: Literal["approach", "exit"]
) -> str | None:
    """The leg of the lane at that end of a track; beside the lanes that with its direction."""
    k, turn, sign, least = (0, np.pi, -1.0, 0.0) if kind == "approach" else (-1, 0.0, 1.0, WELL_OUT)
    heading = float(track.heading[k])
    points, headings, legs = get_ground_raster(intersection_map).lanes[kind]
    beside, away = _find_nearest_alike(points, headings, track.xy[k], heading)
    if away <= BESIDE:
        return legs[beside]
    ways = {leg.name: leg.bearing + turn for leg in intersection_map.legs}
    off = {leg: abs((heading - way + np.pi) % (2.0 * np.pi) - np.pi) for leg, way in ways.items()}
    nearest = min(off, key=off.__getitem__, default=None)
    if nearest is None or off[nearest] > ALONG:
        return None
    way = ways[nearest]
    outward = float(track.xy[k] @ (sign * np.cos(way), sign * np.sin(way)))
    return nearest if outward > least else None


def find_relative_side(entry: str, *, seen_from: str) -> str:
    """How an entry lies to another one: same, opposite, left or right.

    >>> find_relative_side("east", seen_from="north")
    'left'
    >>> find_relative_side("south", seen_from="north")
    'opposite'
    """
    turn = (COMPASS_RING.index(entry) - COMPASS_RING.index(seen_from)) % len(COMPASS_RING)
    if turn % 4 == 0:
        return "opposite" if turn else "same"
    return "left" if turn < 4 else "right"


def check_ties(
    ties: Sequence[TieRecord], tracks: Mapping[int, Trajectory], intersection_map: IntersectionMap
) -> tuple[Finding, ...]:
    """Agents that do not come from where, seen by another one, they were to come from."""
    found: list[Finding] = []
    for tie in ties:
        entry, other = (find_entry_leg(tracks[n], intersection_map) for n in (tie.agent, tie.of))
        seen = find_relative_side(entry, seen_from=other) if entry and other else "none"
        if seen in _SEEN_AS.get(tie.side, (tie.side,)):
            continue
        found.append(Finding(
            rule="entry_elsewhere", agents=(tie.agent, tie.of),
            detail=f"agent {tie.agent} comes from the {entry or 'middle'}, agent {tie.of} from "
            f"the {other or 'middle'}: {seen} observed, {tie.side} asked for",
        ))  # fmt: skip
    return tuple(found)
