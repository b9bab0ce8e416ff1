"""Finding layout for words: labels avoid footprints, trails and one another."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from scenewright.scene.base import FloatArray
from scenewright.viz.figure import add_halo, make_drawable

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.text import Text

_ANGLES = np.deg2rad(np.arange(0, 360, 22.5))


@dataclass
class LabelLayout:
    """The places on the axes that are taken, and labels written where there is room.

    Attributes:
        points: taken points [m].
        boxes: taken rectangles (west, south, east, north) [m].
    """

    axes: Axes
    points: list[FloatArray] = field(default_factory=list)
    boxes: list[tuple[float, float, float, float]] = field(default_factory=list)

    def avoid(self, points: FloatArray) -> None:
        """Keep labels off these [N, 2] points [m]."""
        self.points.append(np.asarray(points, dtype=float))

    def write(
        self, words: str, anchor: FloatArray, *, distances: tuple[float, ...], leader: bool = False,
        halo: bool = True, **style: Any,
    ) -> Text:  # fmt: skip
        """Write `words` near `anchor` where least is covered; with `leader` a thin line to it."""
        text = self.axes.text(float(anchor[0]), float(anchor[1]), make_drawable(words, limit=80),
                              ha="center", va="center", **style)  # fmt: skip
        size = self._measure(text)
        centres = [
            anchor + np.array([np.cos(a), np.sin(a)]) * (d + _compute_reach(a, size))
            for d in distances
            for a in _ANGLES
        ]
        costs = [self._compute_cost(c, size) + i // len(_ANGLES) for i, c in enumerate(centres)]
        best = centres[int(np.argmin(costs))]
        text.set_position((float(best[0]), float(best[1])))
        self.boxes.append(_compute_box(best, size))
        if leader:
            self._draw_leader(best, anchor)
        return add_halo(text) if halo else text

    def _measure(self, text: Text) -> FloatArray:
        """[2] width and height of a text and its box [m]."""
        extent = text.get_window_extent()
        around = 0.9 if text.get_bbox_patch() else 0.25
        pad = around * float(text.get_fontsize()) / 72 * self.axes.figure.dpi
        pixels = np.array([extent.width + pad, extent.height + pad])
        scale = self.axes.transData.transform([(0, 0), (1, 1)])
        return np.asarray(pixels / (scale[1] - scale[0]))

    def _compute_cost(self, centre: FloatArray, size: FloatArray) -> float:
        west, south, east, north = _compute_box(centre, size)
        covered = sum(
            int(((p[:, 0] > west) & (p[:, 0] < east) & (p[:, 1] > south) & (p[:, 1] < north)).sum())
            for p in self.points
        )
        overlaps = sum(
            west < box[2] and east > box[0] and south < box[3] and north > box[1]
            for box in self.boxes
        )
        x, y = self.axes.get_xlim(), self.axes.get_ylim()
        margin = 0.01 * (x[1] - x[0])
        outside = west < x[0] + margin or east > x[1] - margin
        outside = outside or south < y[0] + margin or north > y[1] - margin
        return covered + 40.0 * overlaps + 400.0 * outside

    def _draw_leader(self, centre: FloatArray, anchor: FloatArray) -> None:
        self.axes.plot(
            [centre[0], anchor[0]], [centre[1], anchor[1]], color="#23272E", lw=0.8, zorder=21
        )


def _compute_reach(angle: float, size: FloatArray) -> float:
    """From the middle of a box to its edge in a direction [m]."""
    half = size / 2
    c, s = max(abs(np.cos(angle)), 1e-9), max(abs(np.sin(angle)), 1e-9)
    return float(min(half[0] / c, half[1] / s))


def _compute_box(centre: FloatArray, size: FloatArray) -> tuple[float, float, float, float]:
    low, high = centre - size / 2, centre + size / 2
    return float(low[0]), float(low[1]), float(high[0]), float(high[1])
