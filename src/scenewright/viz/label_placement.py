"""Finding layout for words: labels avoid footprints, trails and one another."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from scenewright.scene.base import FloatArray
from scenewright.viz.appearance import make_printable
from scenewright.viz.drawing import INK, Drawing, measure_block

_ANGLES = np.deg2rad(np.arange(0, 360, 22.5))


@dataclass
class LabelLayout:
    """The places on the axes that are taken, and labels written where there is room.

    Attributes:
        points: taken points [m].
        boxes: taken rectangles (west, south, east, north) [m].
    """

    axes: Drawing
    points: list[FloatArray] = field(default_factory=list)
    boxes: list[tuple[float, float, float, float]] = field(default_factory=list)

    def avoid(self, points: FloatArray) -> None:
        """Keep labels off these [N, 2] points [m]."""
        self.points.append(np.asarray(points, dtype=float))

    def write(
        self, words: str, anchor: FloatArray, size: float, colour: str, *,
        distances: tuple[float, ...], order: float, bold: bool = False, leader: bool = False,
        box: tuple[str, str] | None = None,
    ) -> None:  # fmt: skip
        """Write `words` near `anchor` where least is covered; with `leader` a thin line to it."""
        words = make_printable(words, limit=80)
        place = self.reserve(words, anchor, size, distances, bold=bold, boxed=box is not None)
        if leader:
            self.axes.draw([[place, anchor]], order=21, stroke=INK, stroke_width=0.8)
        self.axes.write(
            words, place, size, align="middle", bold=bold, halo=None if box else "white", box=box,
            order=order, fill=colour,
        )  # fmt: skip

    def reserve(
        self, words: str, anchor: FloatArray, size: float, distances: tuple[float, ...], *,
        bold: bool, boxed: bool,
    ) -> FloatArray:  # fmt: skip
        """[2] where the middle of `words` covers least at these distances from `anchor` [m]."""
        around = (0.9 if boxed else 0.25) * size
        room = (np.array(measure_block([words], size, bold=bold)) + around) / self.axes.scale
        centres = np.array([
            anchor + np.array([np.cos(a), np.sin(a)]) * (d + _compute_reach(a, room))
            for d in distances
            for a in _ANGLES
        ])  # fmt: skip
        # [C] what boxes with these corners [C, 2] [m] cover.
        low, high = centres - room / 2, centres + room / 2
        x, y = np.vstack([np.empty((0, 2)), *self.points]).T
        inside = (x > low[:, :1]) & (x < high[:, :1]) & (y > low[:, 1:]) & (y < high[:, 1:])
        boxes = np.array(self.boxes).reshape(-1, 4)
        apart = (low[:, None] >= boxes[:, 2:]) | (high[:, None] <= boxes[:, :2])
        overlaps = (~apart.any(axis=2)).sum(axis=1)
        west, east, south, north = self.axes.view
        margin = 0.01 * (east - west)
        outside = (low < (west + margin, south + margin)) | (high > (east - margin, north - margin))
        costs = inside.sum(axis=1) + 40.0 * overlaps + 400.0 * outside.any(axis=1)
        best = int(np.argmin(costs + np.arange(len(centres)) // len(_ANGLES)))
        low, high = low[best], high[best]
        self.boxes.append((float(low[0]), float(low[1]), float(high[0]), float(high[1])))
        return np.asarray(centres[best])


def _compute_reach(angle: float, size: FloatArray) -> float:
    """From the middle of a box to its edge in a direction [m]."""
    half = size / 2
    c, s = max(abs(np.cos(angle)), 1e-9), max(abs(np.sin(angle)), 1e-9)
    return float(min(half[0] / c, half[1] / s))
