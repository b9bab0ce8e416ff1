"""The intersection under a picture: ground, road, sidewalks, markings, scale, north."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from scenewright.scene.base import FloatArray
from scenewright.scene.map import IntersectionMap, PolygonWithHoles
from scenewright.viz.appearance import View
from scenewright.viz.figure import INK, SOFT_INK, add_halo, find_unshown, make_drawable
from scenewright.viz.road_markings import build_crosswalk_bars, find_midpoint, find_painted_bounds

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.path import Path

GROUND = "#F5F3EE"
ASPHALT = "#D3D6DA"
SIDEWALK = "#E9E4DA"
KERB = "#AEB3BA"
PAINT = "#FFFFFF"
MEDIAN = "#E0B23C"


def draw_basemap(axes: Axes, intersection: IntersectionMap, view: View) -> None:
    """Draw the map; line widths follow the scale of the axes, so set those first."""
    west, east, south, north = view
    axes.set_xlim(west, east)
    axes.set_ylim(south, north)
    axes.set_facecolor(GROUND)
    _draw_areas(axes, intersection.walkable, SIDEWALK, order=1)
    _draw_areas(axes, intersection.road, ASPHALT, order=2)
    _draw_crosswalks(axes, intersection)
    _draw_lane_markings(axes, intersection)
    _draw_stop_lines(axes, intersection)


def compute_points_per_metre(axes: Axes) -> float:
    """Typographic points per metre of the map."""
    figure = axes.figure
    west, east = axes.get_xlim()
    return float(axes.get_position().width * figure.get_figwidth() * 72 / (east - west))  # type: ignore[union-attr]


def _draw_areas(
    axes: Axes, areas: tuple[PolygonWithHoles, ...], colour: str, *, order: int
) -> None:
    from matplotlib.collections import PathCollection

    paths = [_build_area_path(area) for area in areas]
    axes.add_collection(
        PathCollection(paths, facecolor=colour, edgecolor=KERB, linewidth=0.5, zorder=order),
        autolim=False,
    )


def _build_area_path(area: PolygonWithHoles) -> Path:
    from matplotlib.path import Path

    rings = [_orient_ring(np.array(area.exterior), positive=True)]
    rings += [_orient_ring(np.array(hole), positive=False) for hole in area.holes]
    return Path.make_compound_path(*(Path(np.vstack([r, r[:1]]), closed=True) for r in rings))


def _orient_ring(ring: FloatArray, *, positive: bool) -> FloatArray:
    nxt = np.roll(ring, -1, axis=0)
    area = float(np.sum(ring[:, 0] * nxt[:, 1] - nxt[:, 0] * ring[:, 1]))
    return ring if (area > 0) == positive else ring[::-1]


def _draw_crosswalks(axes: Axes, intersection: IntersectionMap) -> None:
    from matplotlib.collections import PolyCollection

    bars = [bar for walk in intersection.crosswalks for bar in build_crosswalk_bars(walk)]
    axes.add_collection(
        PolyCollection(bars, facecolor=PAINT, edgecolor="none", zorder=3), autolim=False
    )


def _draw_lane_markings(axes: Axes, intersection: IntersectionMap) -> None:
    thin = max(0.15 * compute_points_per_metre(axes), 0.5)
    dash = 2.0 * compute_points_per_metre(axes) / thin
    found = find_painted_bounds(intersection)
    _draw_lines(axes, found["divider"], colors=PAINT, linewidths=thin, linestyles=(0, (dash, dash)))
    _draw_lines(axes, found["edge"], colors=PAINT, linewidths=thin)
    _draw_lines(axes, found["median"], colors=MEDIAN, linewidths=1.4 * thin)


def _draw_lines(axes: Axes, lines: list[FloatArray], **style: Any) -> None:
    from matplotlib.collections import LineCollection

    axes.add_collection(LineCollection(lines, zorder=3, capstyle="butt", **style), autolim=False)


def _draw_stop_lines(axes: Axes, intersection: IntersectionMap) -> None:
    lines = [np.array(line.line, dtype=float) for line in intersection.stop_lines]
    _draw_lines(
        axes, lines, colors=PAINT, linewidths=max(0.5 * compute_points_per_metre(axes), 1.0)
    )


def draw_scale(axes: Axes) -> None:
    """A scale bar in the lower left corner of the axes."""
    west, east = axes.get_xlim()
    south, _ = axes.get_ylim()
    side = east - west
    length = next(n for n in (100, 50, 20, 10, 5, 2, 1) if n <= side / 4 or n == 1)
    x, y = west + 0.035 * side, south + 0.035 * side
    for colour, width in (("white", 4.6), (INK, 1.8)):
        axes.plot([x, x + length], [y, y], color=colour, lw=width, zorder=30, solid_capstyle="butt")
    label = axes.text(x + length / 2, y + 0.012 * side, f"{length} m", ha="center", va="bottom",
                      fontsize=7.5, color=INK, zorder=31)  # fmt: skip
    add_halo(label)


def draw_north(axes: Axes) -> None:
    """A north arrow in the upper right corner of the axes."""
    from matplotlib.patches import Polygon

    _, east = axes.get_xlim()
    _, north = axes.get_ylim()
    side = east - axes.get_xlim()[0]
    x, y = east - 0.05 * side, north - 0.115 * side
    size = 0.05 * side
    shape = np.array([(0, 1), (0.42, -0.15), (0, 0.12), (-0.42, -0.15)]) * size + (x, y)
    axes.add_patch(Polygon(shape, closed=True, facecolor=INK, edgecolor="white", lw=1.2, zorder=30))
    add_halo(
        axes.text(
            x,
            y + 1.12 * size,
            "N",
            ha="center",
            va="bottom",
            fontsize=9,
            fontweight="bold",
            color=INK,
            zorder=31,
        )
    )


def draw_road_names(axes: Axes, intersection: IntersectionMap, *, avoid: FloatArray) -> None:
    """Every road's name once, at the edge of the axes, on the lane farthest from [N, 2] points."""
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
    for road, spots in places.items():
        _, at, bearing = max(spots, key=lambda spot: spot[0])
        _write_road_name(axes, road, at, bearing)


def _find_edge_point(axes: Axes, lane: FloatArray, ahead: FloatArray) -> FloatArray:
    """[2] where a lane that leads along `ahead` meets the edge of the axes [m]."""
    left = np.array([-ahead[1], ahead[0]])
    across = float(find_midpoint(lane) @ left)
    bounds = ((0, axes.get_xlim()), (1, axes.get_ylim()))
    reaches = [
        (bound - across * left[i]) / ahead[i]
        for i, pair in bounds
        for bound in pair
        if abs(ahead[i]) > 0.05
    ]
    reach = min((r for r in reaches if r > 0), default=0.0)
    return np.asarray(across * left + 0.985 * reach * ahead)


def _write_road_name(axes: Axes, name: str, at: FloatArray, bearing: float) -> None:
    turn = (np.rad2deg(bearing) + 89.0) % 180.0 - 89.0
    outwards = np.cos(np.deg2rad(turn) - bearing) > 0
    text = axes.text(float(at[0]), float(at[1]), make_drawable(name, limit=60), rotation=turn,
                     rotation_mode="anchor", ha="right" if outwards else "left", va="center",
                     fontsize=8, color=SOFT_INK, zorder=4)  # fmt: skip
    add_halo(text, colour=ASPHALT)
