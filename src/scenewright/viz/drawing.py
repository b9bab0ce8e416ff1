"""Pictures as SVG documents: a page in inches and maps on it in metres, rendered as PNG."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from html import escape

import numpy as np

from scenewright.scene.base import FloatArray, Point
from scenewright.viz.appearance import View
from scenewright.viz.fonts import list_font_files, make_drawable, measure_text

INK = "#23272E"
SOFT_INK = "#6B7280"
_POINTS = 72.0
"""Typographic points per inch; lines and letters are measured in them."""
_ASCENT, _DESCENT = 0.76, 0.21
"""Of a line of text, in font sizes."""
_PAD = 0.35
"""Between text and the rounded box around it, in font sizes."""

_TURN = np.linspace(0, 2 * np.pi, 11)[:-1] - np.pi / 2
STAR = np.stack([np.cos(_TURN), np.sin(_TURN)], axis=1) * np.tile([1.0, 0.382], 5)[:, None]
OCTAGON = np.stack([np.cos(a := np.pi / 8 * np.arange(1, 16, 2)), np.sin(a)], axis=1)
"""Corners of marks of radius 1, y down."""

Points = FloatArray | Sequence[float] | Sequence[Point] | Sequence[FloatArray]
Style = str | float


class Drawing:
    """Shapes and words; those with a higher `order` lie above, others in the order of drawing.

    A `style` is an attribute of SVG, with underscores for hyphens and lengths in points.

    Attributes:
        view: west, east, south, north [m]; of a page 0, width, height, 0 [inches].
        scale: points per unit of the view.
    """

    def __init__(self, view: View, left: float, top: float, width: float, height: float) -> None:
        """An empty drawing of a view at a place of its page [inches]."""
        west, east, south, north = view
        self.view = view
        self._box = np.array([left, top, width, height]) * _POINTS
        self._steps = self._box[2:] / (east - west, south - north)
        self.scale = float(self._steps[0])
        self._parts: list[tuple[float, str]] = []
        self._maps: list[Drawing] = []

    def add_map(self, view: View, left: float, top: float, width: float, height: float) -> Drawing:
        """A framed map at a place of this page [inches], cut off at its frame."""
        self._maps.append(Drawing(view, left, top, width, height))
        return self._maps[-1]

    def locate(self, points: Points) -> FloatArray:
        """[N, 2] points on the page [points], y down."""
        spots = np.asarray(points, dtype=float).reshape(-1, 2)
        return np.asarray((spots - self.view[::3]) * self._steps + self._box[:2])

    def draw(
        self, lines: Iterable[Points], *, closed: bool = False, order: float = 3, **style: Style
    ) -> None:
        """Lines or, closed, areas with holes, of [N, 2] points each, as one shape."""
        shape = "".join(_trace(self.locate(line), closed) for line in lines)
        if shape:
            self._add(order, f'path d="{shape}"', None, style)

    def mark(
        self, points: Points, size: float, *, corners: FloatArray | None = None, order: float = 3,
        **style: Style,
    ) -> None:  # fmt: skip
        """Discs, or shapes of other unit corners [N, 2], of so many points across."""
        for x, y in self.locate(points).tolist():
            shape = f'circle cx="{x:.2f}" cy="{y:.2f}" r="{size / 2:.2f}"'
            if corners is not None:
                shape = f'path d="{_trace((x, y) + size / 2 * corners, closed=True)}"'
            self._add(order, shape, None, style)

    def write(
        self, text: str, at: Points, size: float, *, align: str = "start", above: float = 0.5,
        bold: bool = False, turn: float = 0.0, halo: str | None = None,
        box: tuple[str, str] | None = None, spacing: float = 1.3, order: float = 3, **style: Style,
    ) -> None:  # fmt: skip
        """Words in lines; nothing in them is markup.

        Args:
            align: start, middle or end of the lines is at the point.
            above: share of the text that stands above the point.
            turn: anticlockwise [degrees].
            halo: colour of an outline that keeps it readable on anything.
            box: colours of the ground and the rim of a rounded box around it.
        """
        lines = [make_drawable(line) for line in text.split("\n")]
        x, y = self.locate(at)[0]
        wide, high = measure_block(lines, size, bold=bold, spacing=spacing)
        top = y - above * high
        if box is not None:
            pad, left = _PAD * size, x - {"start": 0.0, "middle": 0.5, "end": 1.0}[align] * wide
            place = f'x="{left - pad:.2f}" y="{top - pad:.2f}" rx="{pad:.2f}"'
            room = {"width": wide + 2 * pad, "height": high + 2 * pad}
            self._add(order, f"rect {place}", None, room | {"fill": box[0], "stroke": box[1]})
        look: dict[str, Style] = {"fill": INK, "text_anchor": align, "font_size": size}
        look |= {"font_weight": "bold"} if bold else {}
        look |= {"transform": f"rotate({-turn:.2f} {x:.2f} {y:.2f})"} if turn else {}
        if halo:
            look |= {"stroke": halo, "stroke_width": 2.2, "paint_order": "stroke"}
        for number, line in enumerate(lines):
            base = top + size * (_ASCENT + number * (_ASCENT * spacing + _DESCENT))
            self._add(order, f'text x="{x:.2f}" y="{base:.2f}"', line, look | style)

    def build_svg(self, dpi: float = _POINTS, *, transparent: bool = False) -> str:
        """The page as a document; if transparent, what runs over the edge of a map stays."""
        _, _, wide, high = self._box
        page, drawn, frames = f"M0 0H{wide:.2f}V{high:.2f}H0Z", "", ""
        for each in self._maps:
            x, y, w, h = each._box
            drawn += each._join_parts()
            frames += f"M{x:.2f} {y:.2f}h{w:.2f}v{h:.2f}h{-w:.2f}Z"
        if frames and not transparent:
            # Far cheaper than to clip the maps: all of the page but their places lies above them.
            drawn += f'<path d="{page}{frames}" fill="white" fill-rule="evenodd"/>'
            drawn += f'<path d="{frames}" stroke="#C9CCD1" stroke-width="0.6"/>'
        return (
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {wide:.2f} {high:.2f}" '
            f'width="{wide / _POINTS * dpi:.0f}" height="{high / _POINTS * dpi:.0f}" '
            'preserveAspectRatio="none" fill="none" stroke-linejoin="round" '
            f'font-family="DejaVu Sans">{drawn}{self._join_parts()}</svg>'
        )

    def render(self, dpi: int, *, transparent: bool = False) -> bytes:
        """The page as a PNG file; the same page has the same bytes."""
        import resvg_py

        svg = self.build_svg(dpi, transparent=transparent)
        return resvg_py.svg_to_bytes(
            svg_string=svg, skip_system_fonts=True, font_files=list_font_files(svg),
            background=None if transparent else "white",
        )  # fmt: skip

    def _join_parts(self) -> str:
        return "".join(part for _, part in sorted(self._parts, key=lambda part: part[0]))

    def _add(self, order: float, tag: str, words: str | None, style: Mapping[str, Style]) -> None:
        """A part with an end of its own if it has words."""
        written = "".join(f' {k.replace("_", "-")}="{value}"' for k, value in style.items())
        end = "/>" if words is None else f">{escape(words)}</text>"
        self._parts.append((order, f"<{tag}{written}{end}"))


def create_page(width: float, height: float) -> Drawing:
    """An empty page [inches]; places on it are measured from its upper left corner."""
    return Drawing((0.0, width, height, 0.0), 0.0, 0.0, width, height)


def measure_block(
    lines: Sequence[str], size: float, *, bold: bool = False, spacing: float = 1.3
) -> tuple[float, float]:
    """Width and height of lines of text [points]."""
    high = _ASCENT + _DESCENT + (len(lines) - 1) * (_ASCENT * spacing + _DESCENT)
    return max(measure_text(line, size, bold=bold) for line in lines), high * size


def _trace(points: FloatArray, closed: bool) -> str:
    """[N, 2] points on the page as the commands of a path."""
    return "M" + "L".join(f"{x:.2f} {y:.2f}" for x, y in points.tolist()) + "Z" * closed
