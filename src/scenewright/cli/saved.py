"""A version as a file: its pictures, its page, what it is kept as, other programs' formats."""

from __future__ import annotations

import tempfile
import zipfile
from io import BytesIO
from pathlib import Path

from scenewright.authoring.session import SessionVersion
from scenewright.cli.views import render_view
from scenewright.graph.export import export
from scenewright.intersections import load_map
from scenewright.viz.html_player import build_player

SAVED = {
    "scene.json": "application/json", "proof.json": "application/json", "page.html": "text/html",
    "scene.png": "image/png", "scene.gif": "image/gif", "scene.mp4": "video/mp4",
    "export.zip": "application/zip",
}  # fmt: skip
"""Name of a file -> its media type."""


def write_saved(
    shown: SessionVersion, name: str, *, form: str = "", over: SessionVersion | None = None
) -> bytes:
    """The bytes of a file in `SAVED`.

    Args:
        form: the export format of which `export.zip` holds all files.
        over: a version that the page lays over it.

    Raises:
        InputError: there is no such format, or a package that it needs is missing.
    """
    if name in ("scene.json", "proof.json"):
        return shown.scene_json if name == "scene.json" else shown.proof_json
    if name == "page.html":
        return build_player(
            scene=shown.record, proof=shown.proof,
            intersection=load_map(shown.record.meta.intersection),
            over=None if over is None else over.record,
        ).encode()  # fmt: skip
    if name != "export.zip":
        kind = name.removeprefix("scene.")
        return render_view(kind, shown.record, shown.proof)  # type: ignore[arg-type]
    with tempfile.TemporaryDirectory() as folder:
        packed = BytesIO()
        with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
            for file in export(shown.record, form, folder):
                archive.write(file, file.relative_to(Path(folder).resolve()))
        return packed.getvalue()
