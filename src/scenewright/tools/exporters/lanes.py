"""The lanes of a map as formats number and link them."""

from __future__ import annotations

from typing import Literal

import numpy as np

from scenewright.scene.map import IntersectionMap

BESIDE = 0.3
"""How far apart the ends of the edges of two lanes beside one another may lie [m]."""
Side = Literal["left", "right"]
_SIDES: tuple[Side, Side] = ("left", "right")


def number_lanes(intersection: IntersectionMap) -> dict[str, int]:
    """Number of every lane that is driven on, by the lanelet's id."""
    lanes = [each.id for each in intersection.lanelets if each.kind != "parking"]
    return {name: number for number, name in enumerate(lanes, start=1)}


def list_predecessors(intersection: IntersectionMap) -> dict[str, list[str]]:
    """The lanes that lead to each lane."""
    before: dict[str, list[str]] = {each.id: [] for each in intersection.lanelets}
    for lanelet in intersection.lanelets:
        for name in lanelet.successors:
            before[name].append(lanelet.id)
    return before


def find_neighbours(intersection: IntersectionMap) -> dict[tuple[str, Side], tuple[str, bool]]:
    """The lane beside a lane, by its id and side, and whether it leads the same way."""
    edges = [(each.id, side) for each in intersection.lanelets for side in _SIDES]
    lines = [getattr(each, side) for each in intersection.lanelets for side in _SIDES]
    ends = np.array([(line[0], line[-1]) for line in lines])
    along, against = (
        np.abs(ends[:, None] - others[None]).max(axis=(2, 3)) < BESIDE
        for others in (ends, ends[:, ::-1])
    )
    found = {}
    for i, j in np.argwhere(along | against).tolist():
        (name, side), (other, facing) = edges[i], edges[j]
        same = side != facing
        if name != other and (along if same else against)[i, j]:
            found[name, side] = other, same
    return found
