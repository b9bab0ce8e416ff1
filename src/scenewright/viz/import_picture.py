"""An imported map over the geometry of the file that it was read from."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from scenewright.files import write_atomically
from scenewright.scene.base import FloatArray
from scenewright.scene.map import IntersectionMap
from scenewright.viz.basemap import draw_basemap, draw_north, draw_scale
from scenewright.viz.figure import (
    INK,
    SOFT_INK,
    add_halo,
    add_map_axes,
    create_figure,
    encode_png,
    make_drawable,
    use_plain_style,
)
from scenewright.viz.leg_labels import (
    list_unshown_streets,
    name_leg,
    name_place,
    place_leg_label,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.text import Text

_SIZE = 8.0
_MARGIN = 4.0
"""Of labels to the edge of the picture [pixels]."""
_LINES = {"roads": "#0077BB", "paths": "#CC9966", "crossings": "#D81B60"}
_PLACES = {"lights": ("#E69F00", "s"), "crossing_nodes": ("#D81B60", "o")}
_WORDS = {
    "roads": "the file's roads and lanes", "paths": "the file's footways",
    "crossings": "the file's crossings", "lights": "the file's lights",
    "crossing_nodes": "the file's crossing nodes",
}  # fmt: skip

Layers = Mapping[str, Sequence[FloatArray]]


def draw_import(
    path: str | Path,
    *,
    intersection: IntersectionMap,
    layers: Layers,
    lines: Sequence[str] = (),
    dpi: int = 130,
) -> None:
    """Draw an imported map with the file's own lines on it as one PNG.

    Args:
        layers: the file's lines [P, 2] and places [2] by kind, in the map's frame [m].
        lines: what is said below the picture.

    Raises:
        InputError: the file cannot be written; nothing is left behind.
    """
    with use_plain_style():
        write_atomically(path, encode_png(_draw_figure(intersection, layers, lines, dpi)))


def _draw_figure(
    intersection: IntersectionMap, layers: Layers, lines: Sequence[str], dpi: int
) -> Figure:
    unshown = list_unshown_streets(intersection)
    lines = [row for line in (*lines, *unshown) for row in textwrap.wrap(line, 150) or [""]]
    side, below = 0.94 * _SIZE, 0.65 + 0.17 * len(lines)
    tall = 0.5 + side + below
    figure = create_figure(_SIZE, tall, dpi=dpi)
    axes = add_map_axes(figure, (0.03, below / tall, 0.94, side / tall))
    half = intersection.extent
    draw_basemap(axes, intersection, (-half, half, -half, half))
    _draw_layers(axes, layers)
    _draw_ours(axes, intersection)
    draw_scale(axes)
    draw_north(axes)
    title = make_drawable(f"{intersection.name}: {name_place(intersection)}", limit=90)
    figure.text(0.03, 1 - 0.12 / tall, title, fontsize=12, color=INK, va="top")
    for n, line in enumerate(lines):
        figure.text(0.03, (0.12 + 0.17 * (len(lines) - 1 - n)) / tall,
                    make_drawable(line, limit=160), fontsize=7, color=SOFT_INK)  # fmt: skip
    _draw_legend(figure, layers, (below - 0.5) / tall)
    return figure


def _draw_layers(axes: Axes, layers: Layers) -> None:
    from matplotlib.collections import LineCollection

    for kind, colour in _LINES.items():
        wide = 1.6 if kind == "crossings" else 0.8
        axes.add_collection(
            LineCollection([np.asarray(x) for x in layers.get(kind, ())], colors=colour,
                           linewidths=wide, alpha=0.8, zorder=8), autolim=False,
        )  # fmt: skip
    for kind, (colour, mark) in _PLACES.items():
        if len(places := layers.get(kind, ())):
            x, y = np.array(places).T
            axes.plot(x, y, mark, color=colour, ms=4.0, mec="white", mew=0.5, ls="", zorder=9)


def _draw_ours(axes: Axes, intersection: IntersectionMap) -> None:
    """Our crosswalks, stop lines and the names of the legs."""
    for walk in intersection.crosswalks:
        ring = np.array([*walk.polygon, walk.polygon[0]])
        axes.plot(*ring.T, color=INK, lw=1.2, zorder=10)
        axes.plot(*np.mean(walk.centreline, axis=0), "+", color=INK, ms=7, zorder=11)
    for stop in intersection.stop_lines:
        axes.plot(*np.array(stop.line).T, color="#CC3311", lw=2.0, zorder=10)
    for leg in intersection.legs:
        at, turn = place_leg_label(intersection, leg)
        words = make_drawable(name_leg(leg), limit=60)
        label = axes.text(float(at[0]), float(at[1]), words, fontsize=8, ha="center", va="center",
                          rotation=turn, zorder=20)  # fmt: skip
        add_halo(label)
        _keep_inside(axes, label)


def _keep_inside(axes: Axes, label: Text) -> None:
    """Moves a label that runs over the edge of the picture back into it."""
    box, frame = label.get_window_extent(), axes.get_window_extent()
    x = max(frame.x0 + _MARGIN - box.x0, 0.0) - max(box.x1 - frame.x1 + _MARGIN, 0.0)
    y = max(frame.y0 + _MARGIN - box.y0, 0.0) - max(box.y1 - frame.y1 + _MARGIN, 0.0)
    at = axes.transData.transform(label.get_position()) + np.array([x, y])
    inside = axes.transData.inverted().transform(at)
    label.set_position((float(inside[0]), float(inside[1])))


def _draw_legend(figure: Figure, layers: Layers, height: float) -> None:
    from matplotlib.lines import Line2D

    handles = [
        Line2D([], [], color=colour, lw=2, label=_WORDS[kind])
        for kind, colour in _LINES.items()
        if len(layers.get(kind, ()))
    ]
    handles += [
        Line2D([], [], color=colour, marker=mark, ls="", label=_WORDS[kind])
        for kind, (colour, mark) in _PLACES.items()
        if len(layers.get(kind, ()))
    ]
    handles.append(Line2D([], [], color=INK, lw=1.2, label="our crosswalks"))
    handles.append(Line2D([], [], color="#CC3311", lw=2, label="our stop lines"))
    figure.legend(handles=handles, loc="lower left", bbox_to_anchor=(0.02, height), frameon=False,
                  ncols=4, fontsize=7.5, labelcolor=INK)  # fmt: skip
