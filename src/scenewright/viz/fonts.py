"""The fonts of all pictures, what they can show, and how wide it is."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

from scenewright.viz.appearance import make_printable

if TYPE_CHECKING:
    from PIL.ImageFont import FreeTypeFont

_FOLDERS = (
    "/usr/share/fonts", "/usr/local/share/fonts", "~/.fonts", "~/.local/share/fonts",
    "/System/Library/Fonts", "/Library/Fonts", "~/Library/Fonts",
    "C:/Windows/Fonts", "~/AppData/Local/Microsoft/Windows/Fonts",
)  # fmt: skip
_LAST_CHOICE = ("bold", "italic", "oblique", "light", "thin", "black", "serif", "mono")
"""Fonts with such a file name show another script only if no plain one does."""
_MOST_FONTS = 400
"""Of the installed ones, that are looked through."""
_MEASURED = 256
"""Size at which text is measured [pixels]."""


@cache
def find_faces() -> dict[str, str]:
    """The files of `regular` and `bold`: they come with matplotlib, which is not loaded."""
    home = find_spec("matplotlib")
    folder = Path(next(iter(home.submodule_search_locations or ()))) if home else Path()
    names = {"regular": "DejaVuSans", "bold": "DejaVuSans-Bold"}
    return {k: str(folder / "mpl-data/fonts/ttf" / f"{name}.ttf") for k, name in names.items()}


def make_drawable(text: str, *, limit: int = 400) -> str:
    """Printable text in which characters that no font holds become boxes."""
    return "".join("□" if find_font(c) is None else c for c in make_printable(text, limit=limit))


def find_unshown(text: str) -> str:
    """The characters of a text for which no font is installed, each once."""
    return "".join(dict.fromkeys(c for c in text if c.isprintable() and find_font(c) is None))


def list_font_files(text: str) -> list[str]:
    """The files that hold the characters of a text, and those of the usual faces."""
    return list(dict.fromkeys([*find_faces().values(), *filter(None, map(find_font, set(text)))]))


def measure_text(text: str, size: float, *, bold: bool = False) -> float:
    """Width of one line, without kerning, in units of `size`; other scripts count as squares."""
    own = find_faces()["regular"]
    usual = "".join(c for c in text if find_font(c) == own)
    font = _open_file(find_faces()["bold" if bold else "regular"], _MEASURED)
    return size * (font.getlength(usual) / _MEASURED + len(text) - len(usual))


@cache
def find_font(character: str) -> str | None:
    """The first file that has a character: the usual face, else one installed here."""
    files: Iterable[str] = (find_faces()["regular"], *_list_installed_fonts())
    return next((file for file in files if _has_character(file, character)), None)


def _has_character(file: str, character: str) -> bool:
    """Whether its glyph differs from that of a character which no font has."""
    try:
        font = _open_file(file, _MEASURED)
        glyph, missing = (font.getmask(each, mode="1") for each in (character, "\uffff"))
    except OSError:
        return False
    return glyph.size != missing.size or bytes(glyph) != bytes(missing)


def open_font(text: str, size: int, *, bold: bool) -> FreeTypeFont:
    """A font [pixels] for a text: one that has its first character that the usual face lacks."""
    faces = find_faces()
    other = (file for file in map(find_font, text) if file not in (None, faces["regular"]))
    return _open_file(next(other, None) or faces["bold" if bold else "regular"], size)


@cache
def _open_file(file: str, size: int) -> FreeTypeFont:
    from PIL import ImageFont

    return ImageFont.truetype(file, size, layout_engine=ImageFont.Layout.BASIC)


@cache
def _list_installed_fonts() -> tuple[str, ...]:
    """Files of fonts on this machine, plain ones first."""

    def list_files() -> Iterator[Path]:
        for folder in _FOLDERS:
            yield from Path(folder).expanduser().rglob("*.[to]t[fc]")

    def rank(file: Path) -> tuple[bool, str]:
        name = file.name.lower()
        return any(word in name for word in _LAST_CHOICE), name

    # The font of last resort has a box for every character.
    installed_fonts = (file for file in list_files() if not file.name.startswith("LastResort"))
    return tuple(map(str, sorted(installed_fonts, key=rank)[:_MOST_FONTS]))
