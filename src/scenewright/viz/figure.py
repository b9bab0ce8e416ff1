"""Matplotlib figures without global state, drawable text, and PNG bytes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import cache
from io import BytesIO
from typing import TYPE_CHECKING, Any

import numpy as np

from scenewright.scene.base import FloatArray, Point
from scenewright.viz.appearance import make_printable

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.collections import PathCollection
    from matplotlib.figure import Figure
    from matplotlib.text import Text

INK = "#23272E"
SOFT_INK = "#6B7280"
FONT = "DejaVu Sans"
_OTHER_SCRIPTS = (
    *("Noto Sans CJK TC", "Noto Sans CJK SC", "Noto Sans CJK JP", "Noto Sans CJK KR"),
    *("Noto Sans TC", "Noto Sans SC", "Noto Sans JP", "Noto Sans KR", "Source Han Sans"),
    *("WenQuanYi Zen Hei", "WenQuanYi Micro Hei", "Droid Sans Fallback", "IPAexGothic"),
    *("PingFang TC", "PingFang SC", "Hiragino Sans", "Apple SD Gothic Neo", "Arial Unicode MS"),
    *("Microsoft JhengHei", "Microsoft YaHei", "Yu Gothic", "Malgun Gothic", "Nirmala UI"),
    *("Noto Sans Devanagari", "Noto Sans Thai", "Noto Sans Bengali", "Noto Sans Tamil"),
    *("Noto Naskh Arabic", "Noto Sans Arabic", "Noto Sans Hebrew", "Leelawadee UI", "Unifont"),
)
"""Fonts that show what the first lacks, where they are installed."""
_STYLE: dict[str, Any] = {
    "text.usetex": False,
    "text.parse_math": False,
    "axes.unicode_minus": False,
    "savefig.bbox": None,
}


@contextmanager
def use_plain_style() -> Iterator[None]:
    """Settings that a user's own matplotlib configuration must not change."""
    import matplotlib as mpl

    style: Any = {**_STYLE, "font.family": list(list_fonts())}
    with mpl.rc_context(style):
        yield


def create_figure(width: float, height: float, *, dpi: int) -> Figure:
    """An empty white figure [inches] with its own Agg canvas."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), dpi=dpi, facecolor="white")
    FigureCanvasAgg(figure)
    return figure


def add_map_axes(figure: Figure, rect: tuple[float, float, float, float]) -> Axes:
    """Axes in metres, equal in both directions, without ticks."""
    axes = figure.add_axes(rect)
    axes.set_aspect("equal", adjustable="box")
    axes.set_xticks([])
    axes.set_yticks([])
    for spine in axes.spines.values():
        spine.set_color("#C9CCD1")
        spine.set_linewidth(0.6)
    return axes


def encode_png(figure: Figure) -> bytes:
    """The figure as a PNG file without a date, so that the same picture has the same bytes."""
    buffer = BytesIO()
    figure.savefig(buffer, format="png", metadata={"Software": "scenewright"})
    return buffer.getvalue()


def make_drawable(text: str, *, limit: int = 400) -> str:
    """Printable text in which characters that the font lacks become boxes."""
    known = _list_known_characters()
    return "".join(c if ord(c) in known else "□" for c in make_printable(text, limit=limit))


@cache
def list_fonts() -> tuple[str, ...]:
    """The font of all pictures, and those installed here that show other scripts."""
    from matplotlib.font_manager import fontManager

    installed = {entry.name for entry in fontManager.ttflist}
    return (FONT, *(name for name in _OTHER_SCRIPTS if name in installed))


def find_unshown(text: str) -> str:
    """The characters of a text for which no font is installed, each once."""
    known = _list_known_characters()
    return "".join(dict.fromkeys(c for c in text if c.isprintable() and ord(c) not in known))


@cache
def _list_known_characters() -> frozenset[int]:
    """Code points that the regular and the bold face, or another script's font, can show."""
    from matplotlib.font_manager import FontProperties, findfont, get_font

    faces = [FontProperties(family=[FONT], weight=weight) for weight in ("normal", "bold")]
    both = frozenset.intersection(*(frozenset(get_font(findfont(f)).get_charmap()) for f in faces))
    others = [findfont(FontProperties(family=[name])) for name in list_fonts()[1:]]
    return both.union(*(get_font(each).get_charmap() for each in others))


def add_halo(text: Text, *, width: float = 2.2, colour: str = "white") -> Text:
    """The text with an outline that keeps it readable on anything."""
    from matplotlib.patheffects import withStroke

    text.set_path_effects([withStroke(linewidth=width, foreground=colour)])
    return text


def draw_points(axes: Axes, points: FloatArray | Sequence[Point], **style: Any) -> PathCollection:
    """Markers at [N, 2] points [m]."""
    spots = np.asarray(points, dtype=float).reshape(-1, 2)
    return axes.scatter(spots[:, 0], spots[:, 1], **style)


def draw_curve(axes: Axes, points: FloatArray, **style: Any) -> None:
    """A line through [N, 2] points [m]."""
    spots = np.asarray(points, dtype=float).reshape(-1, 2)
    axes.plot(spots[:, 0], spots[:, 1], **style)
