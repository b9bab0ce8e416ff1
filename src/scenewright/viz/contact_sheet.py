"""Many scenes on one picture, each with the name of its folder, to look through a dataset."""

from __future__ import annotations

from collections.abc import Iterable
from io import BytesIO
from pathlib import Path

from PIL import Image, ImageDraw, ImageFont

from scenewright.errors import InputError
from scenewright.files import write_atomically
from scenewright.graph.run import load_scene, verify
from scenewright.intersections import load_map
from scenewright.viz.still import draw_page

_COLUMNS, _DPI, _CAPTION = 3, 90, 28
"""Pictures side by side, their resolution, and the height of the line above each [pixels]."""
MOST_SCENES = 60


def draw_contact_sheet(path: str | Path, folders: Iterable[Path]) -> int:
    """Write a PNG of all scenes in rows of three; how many there are.

    Raises:
        InputError: no folder or too many, one that holds no scene, or nothing can be written.
    """
    pictures = []
    for folder in folders:
        if len(pictures) == MOST_SCENES:
            raise InputError(f"a contact sheet has at most {MOST_SCENES} scenes; name fewer")
        scene = load_scene(folder)
        proof = verify(scene)
        page = draw_page(scene, proof, load_map(scene.meta.intersection)).render(_DPI)
        pictures.append((f"{folder.name}: {proof.verdict}", Image.open(BytesIO(page))))
    if not pictures:
        raise InputError("no folder of a scene is named")
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
    return len(pictures)
