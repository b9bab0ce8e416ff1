"""What a policy sees: arrays of fixed shapes, in the frame of the ego, or a picture from above."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from scenewright.driving.scenario import COLOURS, MAP_POINTS, NO_LIGHT, Scenario
from scenewright.driving.world import World
from scenewright.scene.base import FloatArray

PIXELS, METRES_PER_PIXEL = 96, 0.75
RASTER_SHAPE = (3, PIXELS, PIXELS)
"""Lanes and crosswalks, route, road users; the ego in the middle, ahead is up (the first row)."""

_BODY = np.stack(np.meshgrid(np.linspace(-0.5, 0.5, 17), np.linspace(-0.5, 0.5, 7)), -1)
_BODY = _BODY.reshape(-1, 2)
"""Points of a body, as shares of its length and width."""


def draw_raster(seen: Mapping[str, NDArray[np.generic]]) -> NDArray[np.uint8]:
    """[3, 96, 96] lanes (128) and crosswalks (255); route; road users (128 at rest, 255 moving)."""
    picture = np.zeros(RASTER_SHAPE, dtype=np.uint8)
    kinds = np.asarray(seen["map_kinds"], dtype=np.float64)
    lines = _fill(np.asarray(seen["map"], dtype=np.float64))
    for kind, value in ((0, 128), (1, 255)):
        _mark(picture[0], lines[kinds == kind].reshape(-1, 2), value)
    route = np.asarray(seen["route"], dtype=np.float64)
    there = route[route[:, 4] > 0, :2]
    _mark(picture[1], _fill(there[None])[0] if len(there) > 1 else there, 255)
    ego = np.asarray(seen["ego"], dtype=np.float64)
    _mark(picture[2], _BODY * ego[3:5], 255)
    for row in np.asarray(seen["agents"], dtype=np.float64):
        if row[10] > 0:
            _mark(picture[2], _place(row), 255 if np.hypot(row[4], row[5]) > 0.3 else 128)
    return picture


def _fill(lines: FloatArray) -> FloatArray:
    """Lines [M, P, 2] with 15 points between every two."""
    part = np.linspace(0.0, 1.0, 16)[:, None]
    dense = lines[:, :-1, None] + part * (lines[:, 1:, None] - lines[:, :-1, None])
    return np.asarray(dense.reshape(len(lines), -1, 2))


def _place(row: FloatArray) -> FloatArray:
    c, s = row[2:4]
    return np.asarray(row[:2] + (_BODY * row[6:8]) @ np.array([[c, s], [-s, c]]))


def _mark(channel: NDArray[np.uint8], xy: FloatArray, value: int) -> None:
    row = np.floor(PIXELS / 2 - xy[:, 0] / METRES_PER_PIXEL).astype(int)
    column = np.floor(PIXELS / 2 - xy[:, 1] / METRES_PER_PIXEL).astype(int)
    inside = (row >= 0) & (row < PIXELS) & (column >= 0) & (column < PIXELS)
    channel[row[inside], column[inside]] = value


Observation = dict[str, NDArray[np.generic]]
"""By name of the array; `SHAPES` says which there are."""

AGENTS, ROUTE_POINTS, LIGHTS, MAP_LINES = 32, 24, 2, 64
ROUTE_SPACING = 3.0
"""Between the points of the route ahead [m]."""
FARTHEST = 1000.0
"""Distances beyond are cut off [m]."""

SHAPES: dict[str, tuple[int, ...]] = {
    "ego": (9,),
    "agents": (AGENTS, 11),
    "route": (ROUTE_POINTS, 5),
    "lights": (LIGHTS, 5),
    "map": (MAP_LINES, MAP_POINTS, 2),
    "map_kinds": (MAP_LINES,),
}
"""Of the arrays of float32, in the frame of the ego: x ahead, y to the left, origin its centre.

- `ego`: speed [m/s], acceleration [m/s^2], steering [rad], length, width [m], offset to the left
  of the route [m], direction off that of the route [rad], way left on the route [m], speed limit
  [m/s];
- `agents`, nearest first: x, y of the centre [m], cosine and sine of the direction, x, y of the
  velocity over ground [m/s], length, width [m], class (position in `KINDS`), whether it has the
  right of way over the ego, 1 (all 0 in rows without an agent);
- `route`, points every 3 m from the ego's place on: x, y [m], cosine and sine of the direction, 1
  (all 0 beyond its end);
- `lights` that hold for the ego: way left to where its centre waits [m], then 1 for green, yellow
  or red, 1 (all 0 in rows without a light);
- `map`, lines of 16 points: x, y [m]; `map_kinds`: 0 lane, 1 crosswalk outline, -1 none.
"""


@dataclass(eq=False)
class Observer:
    """Makes the observations of one drive.

    Attributes:
        raster: whether the bird's-eye picture is among them.
    """

    scenario: Scenario
    raster: bool = False
    _lines: FloatArray = field(init=False)
    _kinds: FloatArray = field(init=False)

    def __post_init__(self) -> None:
        scenario = self.scenario
        route = scenario.paths[scenario.ego].xy
        near = [
            np.min(np.hypot(*(line[:, None] - route[None, ::8]).transpose(2, 0, 1)))
            for line in scenario.map_lines
        ]
        self._chosen = np.argsort(near, kind="stable")[:MAP_LINES]
        self._lines = scenario.map_lines[self._chosen].reshape(-1, 2)
        self._kinds = np.full(MAP_LINES, -1.0)
        self._kinds[: len(self._chosen)] = scenario.map_kinds[self._chosen]

    def observe(self, world: World) -> Observation:
        """All arrays, as `SHAPES` describes them."""
        seen: Observation = {
            "ego": self._observe_ego(world),
            "agents": self._observe_agents(world),
            "route": self._observe_route(world),
            "lights": self._observe_lights(world),
            "map": self._observe_map(world),
            "map_kinds": self._kinds.astype(np.float32),
        }
        if self.raster:
            seen["raster"] = draw_raster(seen)
        return seen

    def _observe_ego(self, world: World) -> NDArray[np.generic]:
        scenario, ego = self.scenario, world.ego
        route = scenario.paths[scenario.ego]
        off = ego.heading - np.interp(ego.progress, route.arc, route.heading)
        values = (
            ego.speed, ego.acceleration, ego.steering, *scenario.sizes[scenario.ego], ego.offset,
            np.arctan2(np.sin(off), np.cos(off)), route.length - ego.progress, scenario.speed_limit,
        )  # fmt: skip
        return np.clip(np.array(values, dtype=np.float32), -FARTHEST, FARTHEST)

    def _observe_agents(self, world: World) -> NDArray[np.generic]:
        scenario, others = self.scenario, world.others
        there = others.present.copy()
        there[scenario.ego] = False
        who = np.flatnonzero(there)
        apart = np.hypot(others.xy[who, 0] - world.ego.x, others.xy[who, 1] - world.ego.y)
        who = who[np.argsort(apart, kind="stable")[:AGENTS]]
        seen = np.zeros(SHAPES["agents"], dtype=np.float32)
        turn = others.heading[who] - world.ego.heading
        facing = np.stack([np.cos(turn), np.sin(turn)], axis=-1)
        rows = seen[: len(who)]
        rows[:, :2] = np.clip(_transform_to_ego(others.xy[who], world), -FARTHEST, FARTHEST)
        rows[:, 2:4] = facing
        rows[:, 4:6] = facing * others.speed[who, None]
        rows[:, 6:8] = scenario.sizes[who]
        rows[:, 8], rows[:, 9], rows[:, 10] = scenario.kinds[who], scenario.priority[who], 1.0
        return seen

    def _observe_route(self, world: World) -> NDArray[np.generic]:
        route = self.scenario.paths[self.scenario.ego]
        s = world.ego.progress + ROUTE_SPACING * np.arange(ROUTE_POINTS, dtype=np.float64)
        xy, heading = route.get_poses(s)
        turn = heading - world.ego.heading
        there = s <= route.length + 1e-6
        seen = np.column_stack([_transform_to_ego(xy, world), np.cos(turn), np.sin(turn), there])
        return np.where(there[:, None], np.clip(seen, -FARTHEST, FARTHEST), 0.0).astype(np.float32)

    def _observe_lights(self, world: World) -> NDArray[np.generic]:
        scenario = self.scenario
        seen = np.zeros(SHAPES["lights"], dtype=np.float32)
        for row, (light, s) in zip(seen, scenario.paths[scenario.ego].stops, strict=False):
            colour = scenario.get_colour(light, world.step)
            if colour == NO_LIGHT:
                continue
            row[0], row[-1] = s - world.ego.progress, 1.0
            row[1 : 1 + len(COLOURS)] = np.arange(len(COLOURS)) == colour
        return seen

    def _observe_map(self, world: World) -> NDArray[np.generic]:
        seen = np.zeros(SHAPES["map"], dtype=np.float32)
        lines = _transform_to_ego(self._lines, world).reshape(-1, MAP_POINTS, 2)
        seen[: len(lines)] = np.clip(lines, -FARTHEST, FARTHEST)
        return seen


def _transform_to_ego(xy: FloatArray, world: World) -> FloatArray:
    """Points of the map in the frame of the ego [m]."""
    c, s = np.cos(world.ego.heading), np.sin(world.ego.heading)
    return np.asarray((xy - (world.ego.x, world.ego.y)) @ np.array([[c, -s], [s, c]]))
