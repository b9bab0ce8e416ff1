"""An intersection alone: its map, legs, movements and lights, and what was recorded or sampled."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np

from scenewright.files import write_atomically
from scenewright.geometry.polyline import interpolate_points
from scenewright.scene.base import FloatArray
from scenewright.scene.map import IntersectionMap, Leg, VehicleMovement
from scenewright.viz.appearance import FOREGROUND
from scenewright.viz.basemap import draw_basemap, draw_north, draw_scale
from scenewright.viz.figure import (
    INK,
    SOFT_INK,
    add_halo,
    add_map_axes,
    create_figure,
    draw_curve,
    encode_png,
    make_drawable,
    use_plain_style,
)
from scenewright.viz.leg_labels import name_leg, name_place

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SIZE = 8.0
KEY_COLUMNS = 6
TRACK = "#5B6573"
SAMPLE = "#AA3377"
Align = Literal["left", "right", "bottom", "top"]


def draw_intersection(
    path: str | Path,
    *,
    intersection: IntersectionMap,
    tracks: Sequence[FloatArray] | None = None,
    samples: Sequence[FloatArray] | None = None,
    dpi: int = 150,
) -> None:
    """Draw an intersection as one PNG: legs, movements coloured by signal group, lights.

    Args:
        tracks: [T, 2] recorded positions each [m], drawn thin and grey.
        samples: [N, 2] sampled paths each [m], drawn thin and purple.

    Raises:
        InputError: the file cannot be written; nothing is left behind.
    """
    with use_plain_style():
        write_atomically(
            path, encode_png(_draw_figure(intersection, tracks or (), samples or (), dpi))
        )


def _draw_figure(
    intersection: IntersectionMap,
    tracks: Sequence[FloatArray],
    samples: Sequence[FloatArray],
    dpi: int,
) -> Figure:
    side = 0.94 * SIZE
    entries = len(choose_group_colours(intersection)) + 1 + (len(tracks) > 0) + (len(samples) > 0)
    key = 0.3 if entries <= KEY_COLUMNS else 0.5
    tall = 0.58 + side + key
    figure = create_figure(SIZE, tall, dpi=dpi)
    axes = add_map_axes(figure, (0.03, key / tall, 0.94, side / tall))
    half = intersection.extent
    draw_basemap(axes, intersection, (-half, half, -half, half))
    dense = len(tracks) + len(samples) > 0
    _draw_curves(axes, tracks, TRACK, order=4)
    _draw_curves(axes, samples, SAMPLE, order=5)
    shades = choose_group_colours(intersection)
    _draw_movements(axes, intersection, shades, faint=dense)
    _draw_goal_regions(axes, intersection)
    _write_leg_names(axes, intersection)
    draw_scale(axes)
    draw_north(axes)
    _draw_header(figure, intersection)
    _draw_legend(figure, shades, tracks, samples)
    return figure


def choose_group_colours(intersection: IntersectionMap) -> dict[str, str]:
    """`#RRGGBB` by signal group, with `unsignalised` for movements that have none."""
    groups = intersection.signals.groups if intersection.signals else ()
    shades = {group.id: FOREGROUND[i % len(FOREGROUND)] for i, group in enumerate(groups)}
    free = any(movement.signal_group is None for movement in intersection.movements)
    return shades | ({"unsignalised": INK} if free else {})


def _draw_curves(axes: Axes, curves: Sequence[FloatArray], colour: str, *, order: int) -> None:
    from matplotlib.collections import LineCollection

    strength = float(np.clip(24.0 / max(len(curves), 1), 0.16, 0.6))
    axes.add_collection(
        LineCollection([np.asarray(c) for c in curves], colors=colour, linewidths=0.6,
                       alpha=strength, zorder=order),
        autolim=False,
    )  # fmt: skip


def _draw_movements(
    axes: Axes, intersection: IntersectionMap, shades: dict[str, str], *, faint: bool
) -> None:
    lights = {
        walk: g.id
        for g in (intersection.signals.groups if intersection.signals else ())
        for walk in g.crosswalks
    }
    for movement in intersection.movements:
        colour = shades[movement.signal_group or "unsignalised"]
        _draw_movement(axes, movement, colour, strength=0.45 if faint else 0.9)
    for walk in intersection.crosswalks:
        colour = shades.get(lights.get(walk.id, ""), SOFT_INK)
        draw_curve(
            axes, np.array(walk.centreline), color=colour, lw=1.4, ls=(0, (1.5, 1.2)), zorder=6
        )


def _draw_movement(axes: Axes, movement: VehicleMovement, colour: str, *, strength: float) -> None:
    line = np.array(movement.centreline, dtype=float)
    draw_curve(axes, line, color=colour, lw=1.1, alpha=strength, zorder=6)
    s = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
    for place in (min(12.0, s[-1] / 3), s[-1] - min(12.0, s[-1] / 3)):
        tail, tip = interpolate_points(np.array([place - 1.0, place + 1.0]), s, line).tolist()
        axes.annotate(
            "",
            xy=tip,
            xytext=tail,
            zorder=7,
            arrowprops={
                "arrowstyle": "-|>",
                "color": colour,
                "alpha": strength,
                "lw": 0,
                "mutation_scale": 9,
            },
        )


def _draw_goal_regions(axes: Axes, intersection: IntersectionMap) -> None:
    from matplotlib.collections import PolyCollection

    outlines = [np.array(goal.polygon) for goal in intersection.goal_regions]
    axes.add_collection(
        PolyCollection(outlines, facecolor=(0.1, 0.5, 0.35, 0.1), edgecolor="#15803D",
                       linewidth=0.7, linestyle=(0, (2, 1.5)), zorder=5),
        autolim=False,
    )  # fmt: skip


def _write_leg_names(axes: Axes, intersection: IntersectionMap) -> None:
    """Compass name and road of every leg, on the ground beside its sidewalk."""
    half = intersection.extent
    kerb = np.vstack(
        [np.array(area.exterior) for area in intersection.walkable + intersection.road]
    )
    for leg in intersection.legs:
        angle = _find_label_angle(leg, intersection)
        ahead = np.array([np.cos(angle), np.sin(angle)])
        left = np.array([-ahead[1], ahead[0]])
        aside = left if left[0] + 0.9 * left[1] > 0 else -left
        own = np.abs(kerb @ aside)[(kerb @ ahead > 0.6 * half) & (np.abs(kerb @ aside) < half / 2)]
        at = 0.97 * half * ahead + (float(own.max(initial=4.0)) + 1.0) * aside
        at = np.clip(at, -0.97 * half, 0.95 * half)
        across = _choose_alignment(aside[0] - ahead[0], "left", "right")
        if abs(at[0]) > 0.5 * half:
            across = "right" if at[0] > 0 else "left"
        words = make_drawable(name_leg(leg), limit=70)
        text = axes.text(float(at[0]), float(at[1]), words, fontsize=8.5, ha=across,
                         va=_choose_alignment(aside[1] - ahead[1], "bottom", "top"), color=INK,
                         fontweight="bold", zorder=20)  # fmt: skip
        add_halo(text)


def _find_label_angle(leg: Leg, intersection: IntersectionMap) -> float:
    """Where a leg's name stands [rad]: in its direction, or where it leaves the map if it bends."""
    ends = [
        lane.centreline[0 if lane.kind == "approach" else -1]
        for lane in intersection.lanelets
        if lane.leg == leg.name and lane.kind in ("approach", "exit")
    ]
    if not ends:
        return leg.bearing
    x, y = np.mean(ends, axis=0)
    leaves = float(np.arctan2(y, x))
    return leaves if abs(math.remainder(leaves - leg.bearing, math.tau)) > _BENT else leg.bearing


_BENT = 0.26
"""Legs that leave the map so far off their direction at the junction are bent [rad]."""


def _choose_alignment(outwards: float, positive: Align, negative: Align) -> Align:
    return positive if outwards > 0 else negative


def _draw_header(figure: Figure, intersection: IntersectionMap) -> None:
    counts = (
        f"{intersection.name}   ·   {len(intersection.legs)} legs, "
        f"{len(intersection.movements)} movements, {len(intersection.crosswalks)} crosswalks"
    )
    signals = intersection.signals
    counts += f", signals with a cycle of {signals.cycle:.0f} s" if signals else ", no signals"
    tall = figure.get_figheight()
    title = make_drawable(name_place(intersection), limit=90)
    figure.text(0.03, 1 - 0.1 / tall, title, fontsize=12, color=INK, va="top")
    figure.text(0.03, 1 - 0.34 / tall, make_drawable(counts, limit=140), fontsize=8.5,
                color=SOFT_INK, va="top")  # fmt: skip


def _draw_legend(
    figure: Figure,
    shades: dict[str, str],
    tracks: Sequence[FloatArray],
    samples: Sequence[FloatArray],
) -> None:
    from matplotlib.lines import Line2D

    handles = [
        Line2D([], [], color=c, lw=2, label=make_drawable(n, limit=40)) for n, c in shades.items()
    ]
    handles += [Line2D([], [], color=SOFT_INK, lw=1.4, ls=(0, (1.5, 1.2)), label="crosswalk")]
    if len(tracks):
        handles.append(Line2D([], [], color=TRACK, lw=1, label=f"{len(tracks)} recorded tracks"))
    if len(samples):
        handles.append(Line2D([], [], color=SAMPLE, lw=1, label=f"{len(samples)} samples"))
    figure.legend(handles=handles, loc="lower left", bbox_to_anchor=(0.02, 0.0), frameon=False,
                  ncols=min(len(handles), KEY_COLUMNS), fontsize=8, labelcolor=INK, borderpad=0.2,
                  handlelength=1.6, columnspacing=1.4)  # fmt: skip
