"""Drawings painted straight onto pixels: coarser than rendered ones, but as fast as frames need."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from scenewright.scene.base import FloatArray
from scenewright.viz.drawing import Drawing, Part
from scenewright.viz.fonts import open_font

if TYPE_CHECKING:
    from PIL.Image import Image
    from PIL.ImageDraw import ImageDraw


def paint(drawing: Drawing, image: Image, zoom: float) -> None:
    """Paint all parts onto an RGB image of `zoom` pixels per point; nothing is smoothed.

    Texts are not turned, areas have no holes and open lines no fill.
    """
    from PIL import ImageDraw

    pen = ImageDraw.Draw(image, "RGBA")
    for part in drawing.list_parts():
        style: dict[str, Any] = {
            name: value * zoom if isinstance(value, float) and "opacity" not in name else value
            for name, value in part.style.items()
        }
        style.setdefault("stroke_width", zoom)
        fill, rim = (_mix(style.get(k), style.get(f"{k}_opacity", 1.0)) for k in ("fill", "stroke"))
        if part.tag == "path":
            for line in part.lines:
                _paint_line(pen, line * zoom, part, fill, rim, style["stroke_width"])
        elif part.tag == "circle":
            x, y, reach = style["cx"], style["cy"], style["r"] + style["stroke_width"] / 2
            box = (x - reach, y - reach, x + reach, y + reach)
            pen.ellipse(box, fill, rim, round(style["stroke_width"]))
        elif part.tag == "rect":
            x, y = style["x"], style["y"]
            box = (x, y, x + style["width"], y + style["height"])
            pen.rounded_rectangle(box, style["rx"], fill, rim, round(style["stroke_width"]))
        else:
            words, bold = part.words or "", "font_weight" in style
            font = open_font(words, round(style["font_size"]), bold=bold)
            anchor = {"start": "ls", "middle": "ms", "end": "rs"}[style["text_anchor"]]
            halo = round(style["stroke_width"] / 2) if rim else 0
            pen.text((style["x"], style["y"]), words, fill, font, anchor, stroke_width=halo,
                     stroke_fill=rim)  # fmt: skip


def _mix(colour: str | None, opacity: float) -> tuple[int, ...] | None:
    from PIL import ImageColor

    return (*ImageColor.getrgb(colour), round(255 * opacity)) if colour else None


def _paint_line(
    pen: ImageDraw, line: FloatArray, part: Part, fill: Any, rim: Any, width: float
) -> None:
    """An area and its rim, or an open line as one area, so that its joints are no darker."""
    if part.closed:
        if fill is not None:
            pen.polygon(line.ravel().tolist(), fill)
        if rim is not None:
            pen.line([*map(tuple, line), *map(tuple, line[:2])], rim, round(width), joint="curve")
    elif len(line) > 1:
        x, y = (np.concatenate([line[1:], line[-1:]]) - np.concatenate([line[:1], line[:-1]])).T
        aside = np.stack([y, -x], axis=1) * (width / 2 / np.maximum(np.hypot(x, y), 1e-9))[:, None]
        pen.polygon(np.concatenate([line + aside, (line - aside)[::-1]]).ravel().tolist(), rim)
