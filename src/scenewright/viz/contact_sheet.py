"""Many scenes on one picture, each with the name of its folder, to look through a dataset."""

from __future__ import annotations

from collections.abc import Iterable
from io import BytesIO
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


def draw_contact_sheet(path: str | Path, scenes: Iterable[tuple[str, SceneRecord, Proof]]) -> None:
    """Write a PNG of all scenes, each with its name, in rows of three.

    Raises:
        InputError: no scene or too many, or the file cannot be written.
    """
    pictures: list[tuple[str, Image.Image]] = []
    for name, scene, proof in scenes:
        if len(pictures) == MOST_SCENES:
            raise InputError(f"a contact sheet has at most {MOST_SCENES} scenes; name fewer")
        page = draw_page(scene, proof, load_map(scene.meta.intersection)).render(_DPI)
        pictures.append((f"{name}: {proof.verdict}", Image.open(BytesIO(page))))
    if not pictures:
        raise InputError("none of these folders holds a scene")
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
