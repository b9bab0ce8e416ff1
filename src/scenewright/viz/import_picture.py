"""An imported map over the geometry of the file that it was read from."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from scenewright.files import write_atomically
from scenewright.scene.base import FloatArray
from scenewright.scene.map import IntersectionMap
from scenewright.viz.appearance import make_printable
from scenewright.viz.basemap import KeyEntry, draw_basemap, draw_key, draw_north, draw_scale
from scenewright.viz.drawing import INK, SOFT_INK, Drawing, create_page, measure_block
from scenewright.viz.intersection_picture import (
    list_unshown_streets,
    name_leg,
    name_place,
    place_leg_label,
)

_SIZE = 8.0
_MARGIN = 2.2
"""Of labels to the edge of the picture [points]."""
_STOP = "#CC3311"
_LINES = {"roads": "#0077BB", "paths": "#CC9966", "crossings": "#D81B60"}
_PLACES = {"lights": "#E69F00", "crossing_nodes": "#D81B60"}
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
    write_atomically(path, _draw_page(intersection, layers, lines).render(dpi))


def _draw_page(intersection: IntersectionMap, layers: Layers, lines: Sequence[str]) -> Drawing:
    unshown = list_unshown_streets(intersection)
    rows = [row for line in (*lines, *unshown) for row in textwrap.wrap(line, 150) or [""]]
    side, left, half = 0.94 * _SIZE, 0.03 * _SIZE, intersection.extent
    page = create_page(_SIZE, 0.5 + side + 0.65 + 0.17 * len(rows))
    axes = page.add_map((-half, half, -half, half), left, 0.5, side, side)
    draw_basemap(axes, intersection)
    for kind, colour in _LINES.items():
        for line in layers.get(kind, ()):
            axes.draw([line], order=8, stroke=colour, stroke_opacity=0.8,
                      stroke_width=1.6 if kind == "crossings" else 0.8)  # fmt: skip
    for kind, colour in _PLACES.items():
        axes.mark(layers.get(kind, ()), 4.0, order=9, fill=colour, stroke="white", stroke_width=0.5)
    _draw_ours(axes, intersection)
    draw_scale(axes)
    draw_north(axes)
    title = make_printable(f"{intersection.name}: {name_place(intersection)}", limit=90)
    page.write(title, (left, 0.12), 12, above=0.0)
    for n, row in enumerate(rows):
        at = left, 0.5 + side + 0.63 + 0.17 * n
        page.write(make_printable(row, limit=160), at, 7, above=1.0, fill=SOFT_INK)
    key = {kind: KeyEntry(_WORDS[kind], colour, 2) for kind, colour in _LINES.items()}
    key |= {kind: KeyEntry(_WORDS[kind], colour, 0) for kind, colour in _PLACES.items()}
    shown = [entry for kind, entry in key.items() if len(layers.get(kind, ()))]
    shown += [KeyEntry("our crosswalks", INK, 1.2), KeyEntry("our stop lines", _STOP, 2)]
    draw_key(page, shown, 0.5 + side + 0.28, columns=4)
    return page


def _draw_ours(axes: Drawing, intersection: IntersectionMap) -> None:
    """Our crosswalks, stop lines and the names of the legs."""
    for walk in intersection.crosswalks:
        axes.draw([walk.polygon], closed=True, order=10, stroke=INK, stroke_width=1.2)
        x, y = np.mean(walk.centreline, axis=0)
        arm = 3.5 / axes.scale
        cross = [[(x - arm, y), (x + arm, y)], [(x, y - arm), (x, y + arm)]]
        axes.draw(cross, order=11, stroke=INK, stroke_width=1.0)
    stops = [stop.line for stop in intersection.stop_lines]
    axes.draw(stops, order=10, stroke=_STOP, stroke_width=2.0)
    for leg in intersection.legs:
        at, turn = place_leg_label(intersection, leg)
        words = make_printable(name_leg(leg), limit=60)
        # Its middle stands where it does not run over the edge of the picture [m].
        half = np.array(measure_block([words], 8)) / axes.scale / 2
        c, s = abs(np.cos(np.deg2rad(turn))), abs(np.sin(np.deg2rad(turn)))
        reach = np.array([[c, s], [s, c]]) @ half + _MARGIN / axes.scale
        west, east, south, north = axes.view
        at = np.clip(at, np.add((west, south), reach), np.subtract((east, north), reach))
        axes.write(words, at, 8, align="middle", turn=turn, halo="white", order=20, fill="black")
