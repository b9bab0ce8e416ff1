"""Pictures as SVG documents: a page in inches and maps on it in metres, rendered as PNG."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
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


@dataclass(frozen=True, slots=True)
class Part:
    """An element of SVG; a path has its lines, each of [N, 2] points on the page."""

    order: float
    tag: str
    style: Mapping[str, Style]
    lines: Sequence[FloatArray] = ()
    closed: bool = False
    words: str | None = None

    def write(self) -> str:
        """The element as SVG."""
        style = {k: f"{v:.3f}" if isinstance(v, float) else v for k, v in self.style.items()}
        if self.lines:
            rows = (
                "L".join(f"{x:.2f} {y:.2f}" for x, y in line.tolist()) + "Z" * self.closed
                for line in self.lines
            )
            style["d"] = "M" + "M".join(rows)
        start = "".join(f' {name.replace("_", "-")}="{value}"' for name, value in style.items())
        end = "/>" if self.words is None else f">{escape(self.words)}</{self.tag}>"
        return f"<{self.tag}{start}{end}"


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
        self._parts: list[Part] = []
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
        if places := [self.locate(line) for line in lines]:
            self._parts.append(Part(order, "path", style, places, closed))

    def mark(
        self, points: Points, size: float, *, corners: FloatArray | None = None, order: float = 3,
        **style: Style,
    ) -> None:  # fmt: skip
        """Discs, or shapes of other unit corners [N, 2], of so many points across."""
        for x, y in self.locate(points).tolist():
            if corners is None:
                disc = {"cx": x, "cy": y, "r": size / 2}
                self._parts.append(Part(order, "circle", disc | style))
            else:
                shape = [(x, y) + size / 2 * corners]
                self._parts.append(Part(order, "path", style, shape, closed=True))

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
            self._parts.append(Part(order, "rect", {
                "x": left - pad, "y": top - pad, "rx": pad, "width": wide + 2 * pad,
                "height": high + 2 * pad, "fill": box[0], "stroke": box[1],
            }))  # fmt: skip
        look: dict[str, Style] = {"fill": INK, "text_anchor": align, "font_size": float(size)}
        look |= {"font_weight": "bold"} if bold else {}
        look |= {"transform": f"rotate({-turn:.2f} {x:.2f} {y:.2f})"} if turn else {}
        if halo:
            look |= {"stroke": halo, "stroke_width": 2.2, "paint_order": "stroke"}
        for number, line in enumerate(lines):
            base = top + size * (_ASCENT + number * (_ASCENT * spacing + _DESCENT))
            place = {"x": float(x), "y": float(base)}
            self._parts.append(Part(order, "text", place | look | style, words=line))

    def list_parts(self) -> list[Part]:
        """The parts of this page or map, from the lowest to the uppermost."""
        return sorted(self._parts, key=lambda part: part.order)

    def build_svg(self, dpi: float = _POINTS) -> str:
        """The page as a document."""
        _, _, wide, high = self._box
        page, frames = f"M0 0H{wide:.2f}V{high:.2f}H0Z", ""
        drawn = [part for each in self._maps for part in each.list_parts()]
        for x, y, w, h in (each._box for each in self._maps):
            frames += f"M{x:.2f} {y:.2f}h{w:.2f}v{h:.2f}h{-w:.2f}Z"
        # Far cheaper than to clip the maps: all of the page but their places lies above them.
        cover = {"d": page + frames, "fill": "white", "fill_rule": "evenodd"}
        drawn += [Part(0, "path", cover)] if frames else []
        drawn += [Part(0, "path", {"d": frames, "stroke": "#C9CCD1", "stroke_width": 0.6})]
        content = "".join(part.write() for part in [*drawn, *self.list_parts()])
        return (
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {wide:.2f} {high:.2f}" '
            f'width="{wide / _POINTS * dpi:.0f}" height="{high / _POINTS * dpi:.0f}" '
            'preserveAspectRatio="none" fill="none" stroke-linejoin="round" '
            f'font-family="DejaVu Sans">{content}</svg>'
        )

    def render(self, dpi: int) -> bytes:
        """The page as a PNG file; the same page has the same bytes."""
        import resvg_py

        svg = self.build_svg(dpi)
        return resvg_py.svg_to_bytes(
            svg_string=svg, skip_system_fonts=True, font_files=list_font_files(svg),
            background="white",
        )  # fmt: skip


def create_page(width: float, height: float) -> Drawing:
    """An empty page [inches]; places on it are measured from its upper left corner."""
    return Drawing((0.0, width, height, 0.0), 0.0, 0.0, width, height)


def measure_block(
    lines: Sequence[str], size: float, *, bold: bool = False, spacing: float = 1.3
) -> tuple[float, float]:
    """Width and height of lines of text [points]."""
    high = _ASCENT + _DESCENT + (len(lines) - 1) * (_ASCENT * spacing + _DESCENT)
    return max(measure_text(line, size, bold=bold) for line in lines), high * size
