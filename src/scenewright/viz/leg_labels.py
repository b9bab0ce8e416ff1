"""What stands beside the legs in pictures of an intersection, and where."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from scenewright.scene.base import FloatArray
from scenewright.scene.map import IntersectionMap, Leg
from scenewright.viz.fonts import find_unshown

_INSET = 0.86
"""Of the way from the middle of the picture to its edge, for the middle of a label."""


def place_leg_label(intersection: IntersectionMap, leg: Leg) -> tuple[FloatArray, float]:
    """Where a leg's label stands [2] [m], on its own lanes near the edge, and its turn [degrees].

    Labels of legs that run up or down the picture lie across them; others run along their leg.
    """
    points = [
        np.array(lane.centreline)
        for lane in intersection.lanelets
        if lane.leg == leg.name and lane.kind in ("approach", "exit")
    ]
    inside = [
        line[np.abs(line).max(axis=1) <= _INSET * intersection.extent + 1.0] for line in points
    ]
    far = [line[np.abs(line).max(axis=1).argmax()] for line in inside if len(line)]
    at = np.mean(far, axis=0) if far else np.zeros(2)
    turn = (np.rad2deg(leg.bearing) + 90.0) % 180.0 - 90.0
    return np.asarray(at), float(turn) if abs(turn) < _STEEP else 0.0


_STEEP = 50.0
"""Legs that lie steeper in the picture have their labels across them [degrees]."""


def name_leg(leg: Leg) -> str:
    """Its compass name, and its street where it has one that an installed font shows."""
    if find_unshown(leg.road) or leg.road in ("", f"{leg.name} road"):
        return leg.name
    return f"{leg.name} · {leg.road}"


def name_place(intersection: IntersectionMap) -> str:
    """The title; where no font has its letters, how many legs there are."""
    if find_unshown(intersection.title):
        return f"{len(intersection.legs)} legs"
    return intersection.title


def list_unshown_streets(intersection: IntersectionMap) -> Iterator[str]:
    """One line, where no installed font shows the letters of streets."""
    unshown = sorted({leg.road for leg in intersection.legs if find_unshown(leg.road)})
    if unshown:
        yield (
            f"no font on this machine shows the names of {len(unshown)} streets; legs bear their "
            "compass names alone (install one, such as Noto Sans CJK)"
        )
