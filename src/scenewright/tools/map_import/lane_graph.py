"""The lane graph of a file that draws each lane by itself: lanes, and which one leads to which."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from scenewright.errors import InputError
from scenewright.geometry.geographic import LatLon
from scenewright.geometry.polyline import measure_length, measure_turn, resample_to_count
from scenewright.scene.base import FloatArray
from scenewright.tools.map_import.map_parts import geos
from scenewright.tools.map_import.survey import NARROWEST, SurveyCrossing, describe_strips

_TOUCHING = 0.6
"""Ends of lanes that lie closer are joined [m]; drawn maps share no nodes there."""
_LONGEST_LANE = 20_000.0
"""A longer one has a place that is wrong [m]."""
_SAME_COURSE = math.radians(40.0)
USUAL_LIMIT = 50.0 / 3.6
"""Speed limit of a lane that has none in the file [m/s]."""


@dataclass(frozen=True, eq=False)
class FileLane:
    """A whole lane of a file.

    Attributes:
        left, right: [P, 2] its bounds in driving direction [m].
        road: name of its street; speed: limit [m/s].
        line: [P, 2] its middle, about half a metre from point to point [m].
        width: the median over its length [m].
    """

    id: str
    left: FloatArray
    right: FloatArray
    road: str = ""
    speed: float = USUAL_LIMIT
    line: FloatArray = field(init=False)
    width: float = field(init=False)

    def __post_init__(self) -> None:
        longest = max(measure_length(self.left), measure_length(self.right))
        if not longest < _LONGEST_LANE:
            raise InputError(f"lane {self.id[:40]} is {longest:.3g} m long; this cannot be")
        count = max(round(longest / 0.5), 4)
        left, right = (resample_to_count(side, count) for side in (self.left, self.right))
        object.__setattr__(self, "line", (left + right) / 2)
        object.__setattr__(self, "width", float(np.median(np.hypot(*(left - right).T))))

    @property
    def outline(self) -> FloatArray:
        """[P, 2] round its ground [m]."""
        return np.concatenate([self.left, self.right[::-1]])


@dataclass(frozen=True, eq=False)
class LaneGraph:
    """What a file of lanes holds, in metres from an origin.

    Attributes:
        lanes: for vehicles, by id; foot: for pedestrians.
        origin: latitude and longitude of x = y = 0; None where the file has no degrees.
        crossings: for pedestrians, as drawn; lights: [2] where lanes end that obey one.
        notes: what was dropped.
    """

    file: Path
    lanes: Mapping[str, FileLane]
    foot: tuple[FileLane, ...] = ()
    origin: LatLon | None = None
    crossings: tuple[SurveyCrossing, ...] = ()
    lights: tuple[FloatArray, ...] = ()
    notes: tuple[str, ...] = ()

    @classmethod
    def build(
        cls, file: Path, lanes: Iterable[FileLane], others: int, *notes: str, **parts: Any
    ) -> LaneGraph:
        """The graph of the lanes that cars fit on.

        Args:
            others: how many lanes the file has for others than cars.
            notes: what was dropped or assumed besides.
            parts: see the attributes.
        """
        own = {lane.id: lane for lane in lanes}
        told = [*describe_strips(lane.width < NARROWEST for lane in own.values())]
        if others:
            told.append(
                f"{others} lanes were dropped: car parks, driveways, tracks, and lanes for buses, "
                "bicycles or people on foot alone"
            )
        wide = {name: lane for name, lane in own.items() if lane.width >= NARROWEST}
        return cls(file, wide, notes=(*told, *notes), **parts)

    @cached_property
    def follows(self) -> Mapping[str, list[str]]:
        """Which lanes begin where one ends, both bounds within reach.

        Where nothing else follows, or leads there, one bound and the direction will do: the lane
        becomes wider there, or narrower.
        """
        names = sorted(self.lanes)
        lanes = [self.lanes[name] for name in names]
        met: list[set[tuple[int, int]]] = []
        for side in ("left", "right"):
            starts, ends = (geos.points([getattr(x, side)[k] for x in lanes]) for k in (0, -1))
            i, j = geos.STRtree(starts).query(ends, "dwithin", _TOUCHING).tolist()
            met.append({(a, b) for a, b in zip(i, j, strict=True) if a != b})
        both = met[0] & met[1]
        ended, begun = {a for a, _ in both}, {b for _, b in both}
        for a, b in sorted(met[0] ^ met[1]):
            before, after = lanes[a].line, lanes[b].line
            turn = measure_turn(before[-1] - before[-2], after[1] - after[0])
            if (a not in ended or b not in begun) and abs(turn) < _SAME_COURSE:
                both.add((a, b))
        found: dict[str, list[str]] = {name: [] for name in names}
        for a, b in sorted(both):
            found[names[a]].append(names[b])
        return found

    @cached_property
    def leads_to(self) -> Mapping[str, list[str]]:
        """Which lanes end where one begins."""
        found: dict[str, list[str]] = {name: [] for name in self.lanes}
        for name, following in self.follows.items():
            for after in following:
                found[after].append(name)
        return found

    @cached_property
    def _tree(self) -> Any:
        return geos.STRtree([geos.LineString(lane.line) for lane in self.lanes.values()])

    def list_on(self, place: Any) -> list[str]:
        """The lanes with a middle that meets a geometry."""
        names = list(self.lanes)
        return sorted(names[i] for i in self._tree.query(place, predicate="intersects"))
