"""Matplotlib figures without global state, drawable text, and PNG bytes."""

from __future__ import annotations

import logging
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
    # That a font of another script has no bold face is nothing that a user can mend.
    log = logging.getLogger("matplotlib.font_manager")
    level = log.level
    log.setLevel(logging.ERROR)
    try:
        with mpl.rc_context(style):
            yield
    finally:
        log.setLevel(level)


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
    """The font of all pictures, and those installed here that show other scripts.

    Well-known ones come first; of the others, those that add a script's worth of characters.
    """
    files = _find_font_files()
    fonts = [FONT, *(name for name in _OTHER_SCRIPTS if name in files)]
    known = frozenset[int]().union(*map(_list_characters, fonts))
    for name in sorted(files.keys() - set(fonts))[:_MOST_FONTS]:
        own = _list_characters(name)
        if len(own - known) >= _NEW_SCRIPT:
            fonts.append(name)
            known |= own
    return tuple(fonts)


_MOST_FONTS = 400
"""Of the installed ones, that are looked through."""
_NEW_SCRIPT = 40
"""A font that adds so many characters shows another script."""
_BOXES = "Last Resort"
"""Fonts of that name have a box for every character."""


@cache
def _find_font_files() -> dict[str, str]:
    """By name of each installed font: the file of its upright face that is nearest to regular."""
    from matplotlib.font_manager import fontManager, weight_dict

    found: dict[str, tuple[int, str]] = {}
    for entry in fontManager.ttflist:
        if entry.style == "normal" and not entry.name.startswith(_BOXES):
            weight = entry.weight if isinstance(entry.weight, int) else weight_dict[entry.weight]
            best = min((abs(int(weight) - 400), entry.fname), found.get(entry.name, (9999, "")))
            found[entry.name] = best
    return {name: file for name, (_, file) in found.items()}


@cache
def _list_characters(font: str) -> frozenset[int]:
    """The code points of an installed font; none of one that cannot be read."""
    from matplotlib.font_manager import get_font

    try:
        return frozenset(get_font(_find_font_files()[font]).get_charmap())
    except (KeyError, OSError, RuntimeError, ValueError):
        return frozenset()


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
    return both.union(*(_list_characters(name) for name in list_fonts()[1:]))


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
