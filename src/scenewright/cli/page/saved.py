"""A version as files to keep: pictures, animations, and the formats of other programs."""

from __future__ import annotations

import tempfile
import zipfile
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING

from scenewright.cli.views import render_view
from scenewright.graph.export import export

if TYPE_CHECKING:
    from scenewright.authoring.session import SessionVersion

SAVED = {
    "scene.png": "image/png", "scene.gif": "image/gif", "scene.mp4": "video/mp4",
    "export.zip": "application/zip",
}  # fmt: skip
"""Name of a file -> its media type."""


def write_saved(shown: SessionVersion, name: str, format_: str) -> bytes:
    """The bytes of a file in `SAVED`; `export.zip` holds all files of an export format.

    Raises:
        InputError: there is no such format, or a package that it needs is missing.
    """
    if name != "export.zip":
        kind = name.removeprefix("scene.")
        return render_view(kind, shown.record, shown.proof)  # type: ignore[arg-type]
    with tempfile.TemporaryDirectory() as folder:
        packed = BytesIO()
        with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
            for file in export(shown.record, format_, folder):
                archive.write(file, file.relative_to(Path(folder).resolve()))
        return packed.getvalue()
