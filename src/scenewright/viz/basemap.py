"""The intersection under a picture: ground, road, sidewalks, markings, scale, north."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from scenewright.scene.base import FloatArray
from scenewright.scene.map import IntersectionMap
from scenewright.scene.map_elements import PolygonWithHoles
from scenewright.viz.appearance import make_printable
from scenewright.viz.drawing import INK, SOFT_INK, Drawing, measure_block
from scenewright.viz.fonts import find_unshown
from scenewright.viz.road_markings import build_crosswalk_bars, find_midpoint, find_painted_bounds

GROUND = "#F5F3EE"
ASPHALT = "#D3D6DA"
SIDEWALK = "#E9E4DA"
KERB = "#AEB3BA"
PAINT = "#FFFFFF"
MEDIAN = "#E0B23C"


class KeyEntry(NamedTuple):
    """Words of a key, beside a stroke of a width and dashes [points] or, of width 0, a disc."""

    words: str
    colour: str
    width: float
    dashes: str = "none"


def draw_basemap(axes: Drawing, intersection: IntersectionMap, *, night: bool = False) -> None:
    """Draw the map, dark at night; line widths follow its scale."""
    west, east, south, north = axes.view
    corners = [(west, south), (east, south), (east, north), (west, north)]
    axes.draw([corners], closed=True, order=0, fill=GROUND)
    _draw_areas(axes, intersection.walkable, SIDEWALK, order=1)
    _draw_areas(axes, intersection.road, ASPHALT, order=2)
    bars = [bar for walk in intersection.crosswalks for bar in build_crosswalk_bars(walk)]
    axes.draw(bars, closed=True, fill=PAINT)
    thin, dash = max(0.15 * axes.scale, 0.5), 2.0 * axes.scale
    bounds = find_painted_bounds(intersection)
    axes.draw(bounds["divider"], stroke=PAINT, stroke_width=thin, stroke_dasharray=dash)
    axes.draw(bounds["edge"], stroke=PAINT, stroke_width=thin)
    axes.draw(bounds["median"], stroke=MEDIAN, stroke_width=1.4 * thin)
    stops = [line.line for line in intersection.stop_lines]
    axes.draw(stops, stroke=PAINT, stroke_width=max(0.5 * axes.scale, 1.0))
    if night:
        axes.draw([corners], closed=True, order=3.5, fill="#0B1020", fill_opacity=0.62)


def _draw_areas(
    axes: Drawing, areas: tuple[PolygonWithHoles, ...], colour: str, *, order: int
) -> None:
    for area in areas:
        rings = [area.exterior, *area.holes]
        axes.draw(
            rings, closed=True, order=order, fill=colour, fill_rule="evenodd", stroke=KERB,
            stroke_width=0.5,
        )  # fmt: skip


def draw_scale(axes: Drawing) -> None:
    """A scale bar in the lower left corner of the axes."""
    west, east, south, _ = axes.view
    side = east - west
    lengths = (size * 10**power for power in (3, 2, 1, 0) for size in (5, 2, 1))
    length = next(n for n in lengths if n <= side / 4 or n == 1)
    x, y = west + 0.035 * side, south + 0.035 * side
    for colour, width in (("white", 4.6), (INK, 1.8)):
        bar = [(x, y), (x + length, y)]
        axes.draw([bar], order=30, stroke=colour, stroke_width=width)
    at = x + length / 2, y + 0.012 * side
    axes.write(f"{length} m", at, 7.5, align="middle", above=1.0, halo="white", order=31)


def draw_north(axes: Drawing) -> None:
    """A north arrow in the upper right corner of the axes."""
    west, east, _, north = axes.view
    side = east - west
    x, y = east - 0.05 * side, north - 0.115 * side
    size = 0.05 * side
    shape = np.array([(0, 1), (0.42, -0.15), (0, 0.12), (-0.42, -0.15)]) * size + (x, y)
    axes.draw([shape], closed=True, order=30, fill=INK, stroke="white", stroke_width=1.2)
    at = x, y + 1.12 * size
    axes.write("N", at, 9, align="middle", above=1.0, bold=True, halo="white", order=31)


def draw_road_names(
    axes: Drawing, intersection: IntersectionMap, *, avoid: FloatArray
) -> FloatArray:
    """Every road's name once, at the edge of the axes, on the lane farthest from [N, 2] points.

    Returns:
        [M, 2] points under the names, where nothing else is to be written.
    """
    places: dict[str, list[tuple[float, FloatArray, float]]] = {}
    for leg in intersection.legs:
        ahead = np.array([np.cos(leg.bearing), np.sin(leg.bearing)])
        for lane in intersection.lanelets:
            if lane.leg == leg.name and lane.kind in ("approach", "exit"):
                at = _find_edge_point(axes, np.array(lane.centreline, dtype=float), ahead)
                near = at - 3.0 * ahead
                free = float(np.min(np.linalg.norm(avoid - near, axis=1), initial=12.0))
                name = leg.name if find_unshown(leg.road) else leg.road
                places.setdefault(name, []).append((free, at, leg.bearing))
    covered = [np.empty((0, 2))]
    for road, spots in places.items():
        _, at, bearing = max(spots, key=lambda spot: spot[0])
        _write_road_name(axes, road, at, bearing)
        inwards = -np.array([np.cos(bearing), np.sin(bearing)])
        length = measure_block([road], 8)[0] / axes.scale
        middle = at + np.linspace(0.0, length, 20)[:, None] * inwards
        aside = np.array([-inwards[1], inwards[0]]) * 4.0 / axes.scale
        covered += [middle - aside, middle, middle + aside]
    return np.vstack(covered)


def _find_edge_point(axes: Drawing, lane: FloatArray, ahead: FloatArray) -> FloatArray:
    """[2] where a lane that leads along `ahead` meets the edge of the axes [m]."""
    left = np.array([-ahead[1], ahead[0]])
    across = float(find_midpoint(lane) @ left)
    bounds = ((0, axes.view[:2]), (1, axes.view[2:]))
    reaches = [
        (bound - across * left[i]) / ahead[i]
        for i, pair in bounds
        for bound in pair
        if abs(ahead[i]) > 0.05
    ]
    reach = min((r for r in reaches if r > 0), default=0.0)
    return np.asarray(across * left + 0.985 * reach * ahead)


def _write_road_name(axes: Drawing, name: str, at: FloatArray, bearing: float) -> None:
    turn = (np.rad2deg(bearing) + 89.0) % 180.0 - 89.0
    outwards = np.cos(np.deg2rad(turn) - bearing) > 0
    axes.write(
        make_printable(name, limit=60), at, 8, align="end" if outwards else "start", turn=turn,
        halo=ASPHALT, order=4, fill=SOFT_INK,
    )  # fmt: skip


def draw_key(page: Drawing, entries: Sequence[KeyEntry], top: float, *, columns: int) -> None:
    """Words in rows from a height on [inches], each beside its stroke."""
    widths = [
        max(measure_block([entry.words], 8)[0] for entry in entries[column::columns]) / page.scale
        for column in range(min(columns, len(entries)))
    ]
    for number, entry in enumerate(entries):
        column, y = number % columns, top + 0.2 * (number // columns)
        x = 0.24 + sum(widths[:column]) + 0.46 * column
        if entry.width:
            page.draw([[(x, y), (x + 0.18, y)]], stroke=entry.colour, stroke_width=entry.width,
                      stroke_dasharray=entry.dashes)  # fmt: skip
        else:
            page.mark([(x + 0.09, y)], 5.0, fill=entry.colour)
        page.write(entry.words, (x + 0.26, y), 8)
