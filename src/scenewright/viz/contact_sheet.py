"""Many scenes on one picture, each with the name of its folder, to look through a dataset."""

from __future__ import annotations

from collections.abc import Iterable
from io import BytesIO
from itertools import islice
from pathlib import Path

from PIL import Image, ImageDraw, ImageFont

from scenewright.errors import InputError
from scenewright.files import write_atomically
from scenewright.intersections import load_map
from scenewright.scene.events import Proof
from scenewright.scene.record import SceneRecord
from scenewright.viz.still import draw_page

_COLUMNS, _DPI, _CAPTION = 3, 90, 28
"""Pictures side by side, their resolution, and the height of the line above each [pixels]."""
MOST_SCENES = 60


def draw_contact_sheets(
    path: str | Path, scenes: Iterable[tuple[str, SceneRecord, Proof]]
) -> list[str]:
    """Write PNGs of all scenes, each with its name, in rows of three, `MOST_SCENES` on a sheet.

    Their names are returned: those after the first have their number behind its name.

    Raises:
        InputError: no scene, or a file cannot be written.
    """
    first, rest, written = Path(path), iter(scenes), list[str]()
    while shown := [*islice(rest, MOST_SCENES)]:
        number = f"-{len(written) + 1}" if written else ""
        written.append(str(first.with_stem(first.stem + number)))
        _write_sheet(written[-1], shown)
    if not written:
        raise InputError("none of these folders holds a scene")
    return written


def _write_sheet(path: str, scenes: Iterable[tuple[str, SceneRecord, Proof]]) -> None:
    pictures = []
    for name, scene, proof in scenes:
        page = draw_page(scene, proof, load_map(scene.meta.intersection)).render(_DPI)
        pictures.append((f"{name}: {proof.verdict}", Image.open(BytesIO(page))))
    width = max(picture.width for _, picture in pictures)
    height = max(picture.height for _, picture in pictures) + _CAPTION
    columns = min(_COLUMNS, len(pictures))
    sheet = Image.new("RGB", (columns * width, -(-len(pictures) // columns) * height), "white")
    pen, font = ImageDraw.Draw(sheet), ImageFont.load_default(16)
    for k, (caption, picture) in enumerate(pictures):
        x, y = k % columns * width, k // columns * height
        pen.text((x + 8, y + 6), caption, fill="black", font=font)
        sheet.paste(picture, (x, y + _CAPTION))
    data = BytesIO()
    sheet.save(data, "PNG")
    write_atomically(path, data.getvalue())
