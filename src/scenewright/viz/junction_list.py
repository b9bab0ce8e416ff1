"""A picture of the junctions of a map file, to choose one."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from scenewright.files import write_atomically
from scenewright.scene.base import FloatArray, Point
from scenewright.viz.figure import (
    INK,
    add_halo,
    create_figure,
    encode_png,
    find_unshown,
    make_drawable,
    use_plain_style,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes

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
    from matplotlib.collections import LineCollection

    with use_plain_style():
        figure = create_figure(_SIDE, _SIDE, dpi=110)
        axes = figure.add_axes((0.06, 0.05, 0.92, 0.9))
        axes.add_collection(LineCollection(list(roads), colors="#D9DCE1", linewidths=1.2, zorder=0))
        for mark in marks:
            _draw_mark(axes, mark, with_streets=len(marks) <= _LABELLED)
        axes.margins(0.12)
        axes.set_aspect("equal", adjustable="datalim")
        axes.tick_params(labelsize=7)
        axes.set_title(make_drawable(title, limit=110), fontsize=10)
        axes.set_xlabel("metres east", fontsize=8)
        write_atomically(png, encode_png(figure))


def _draw_mark(axes: Axes, mark: JunctionMark, *, with_streets: bool) -> None:
    x, y = mark.xy
    for bearing, street in mark.legs:
        ahead = math.cos(bearing), math.sin(bearing)
        axes.plot(
            [x, x + _ARM * ahead[0]], [y, y + _ARM * ahead[1]], color="#8A8F98", lw=2, zorder=1
        )
        if street and with_streets and not find_unshown(street):
            spot = x + 1.15 * _ARM * ahead[0], y + 1.15 * _ARM * ahead[1]
            add_halo(
                axes.text(*spot, make_drawable(street, limit=40), fontsize=5.5, color=INK,
                          ha="center", va="center", clip_on=True)
            )  # fmt: skip
    axes.plot(x, y, "o", color="#C43E3E", ms=5, zorder=2)
    label = axes.annotate(
        mark.id, mark.xy, (4, 4), textcoords="offset points", fontsize=7.5, weight="bold", zorder=5
    )
    add_halo(label)
