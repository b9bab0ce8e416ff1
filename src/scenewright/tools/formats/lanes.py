"""The lanes of a map as formats number and link them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Literal

import numpy as np

from scenewright.scene.base import FloatArray
from scenewright.scene.map import IntersectionMap
from scenewright.scene.map_elements import Crosswalk

BESIDE = 0.3
"""How far apart the ends of the edges of two lanes beside one another may lie [m]."""
Side = Literal["left", "right"]
_SIDES: tuple[Side, Side] = ("left", "right")


def number_lanes(intersection: IntersectionMap) -> dict[str, int]:
    """Number of every lane that is driven on, by the lanelet's id."""
    lanes = [lanelet.id for lanelet in intersection.lanelets if lanelet.kind != "parking"]
    return {name: number for number, name in enumerate(lanes, start=1)}


def list_predecessors(intersection: IntersectionMap) -> dict[str, list[str]]:
    """The lanes that lead to each lane."""
    before: dict[str, list[str]] = {lanelet.id: [] for lanelet in intersection.lanelets}
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
    neighbours = {}
    for i, j in np.argwhere(along | against).tolist():
        (name, side), (other, facing) = edges[i], edges[j]
        same = side != facing
        if name != other and (along if same else against)[i, j]:
            neighbours[name, side] = other, same
    return neighbours


def find_crosswalk_edges(crosswalk: Crosswalk) -> FloatArray:
    """[2, 2, 2] the left and the right edge of a crosswalk, along its centreline [m]."""
    ends = np.array(crosswalk.centreline)
    ahead = ends[1] - ends[0]
    aside = np.array([-ahead[1], ahead[0]]) / max(float(np.hypot(*ahead)), 1e-9)
    return np.stack([ends + crosswalk.width / 2 * aside, ends - crosswalk.width / 2 * aside])


def list_points(points: Iterable[Sequence[float]]) -> list[dict[str, float]]:
    """Points in the plane [m] as records of motion datasets have them."""
    return [{"x": float(x), "y": float(y), "z": 0.0} for x, y in points]


def find_light_places(intersection: IntersectionMap) -> dict[str, FloatArray]:
    """[2] the middle of every stop line and crosswalk by its id [m]."""
    lines = {line.id: line.line for line in intersection.stop_lines}
    lines |= {crosswalk.id: crosswalk.centreline for crosswalk in intersection.crosswalks}
    return {name: np.asarray(np.mean(line, axis=0)) for name, line in lines.items()}
