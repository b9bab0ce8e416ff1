"""A picture of the junctions of a map file, to choose one."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from scenewright.files import write_atomically
from scenewright.scene.base import FloatArray, Point
from scenewright.viz.appearance import make_printable
from scenewright.viz.basemap import draw_north, draw_scale
from scenewright.viz.drawing import Drawing, create_page
from scenewright.viz.fonts import find_unshown

_SIDE = 11.0
"""Of the picture [inches]."""
_ARM = 30.0
"""Length of a leg in the picture [m]."""
_LABELLED = 60
"""Above so many junctions, streets are left out."""


@dataclass(frozen=True)
class JunctionMark:
    """A junction in the picture: its id, place [m] and legs, as (bearing [rad], street)."""

    id: str
    xy: Point
    legs: tuple[tuple[float, str], ...]


def draw_junctions(
    png: str, *, title: str, marks: Sequence[JunctionMark], roads: Sequence[FloatArray] = ()
) -> None:
    """Draws junctions as stars of their legs, with ids and street names, north up.

    Args:
        roads: [P, 2] lines of the streets beneath [m].

    Raises:
        InputError: the file cannot be written; nothing is left behind.
    """
    points = np.vstack([np.zeros((0, 2)), [mark.xy for mark in marks], *roads])
    middle = (points.min(axis=0) + points.max(axis=0)) / 2
    half = 0.56 * max(float(np.ptp(points, axis=0).max()), 4 * _ARM)
    (west, south), (east, north) = middle - half, middle + half
    page = create_page(_SIDE, _SIDE + 0.25)
    axes = page.add_map((west, east, south, north), 0.25, 0.5, _SIDE - 0.5, _SIDE - 0.5)
    axes.draw(roads, order=0, stroke="#D9DCE1", stroke_width=1.2)
    for mark in marks:
        _draw_mark(axes, mark, with_streets=len(marks) <= _LABELLED)
    draw_scale(axes)
    draw_north(axes)
    page.write(make_printable(title, limit=110), (0.25, 0.3), 10)
    write_atomically(png, page.render(110))


def _draw_mark(axes: Drawing, mark: JunctionMark, *, with_streets: bool) -> None:
    spot = np.array(mark.xy)
    for bearing, street in mark.legs:
        arm = _ARM * np.array([math.cos(bearing), math.sin(bearing)])
        axes.draw([[spot, spot + arm]], order=1, stroke="#8A8F98", stroke_width=2)
        if street and with_streets and not find_unshown(street):
            axes.write(make_printable(street, limit=40), spot + 1.15 * arm, 5.5, align="middle",
                       halo="white")  # fmt: skip
    axes.mark(spot, 5, order=2, fill="#C43E3E")
    corner = spot + 4 / axes.scale
    axes.write(mark.id, corner, 7.5, above=1.0, bold=True, halo="white", order=5, fill="black")
