"""`scenewright show`: a scene's recording in the rerun viewer, or its views as files to share."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from scenewright.cli.views import ViewKind


def write_views(scene: str, files: Mapping[ViewKind, str], *, whole: bool = False) -> None:
    """Writes the views that were asked for, kind -> file.

    The proof is computed anew, so that a page never shows the proof of another scene.

    Raises:
        InputError: there is no scene, or a file cannot be written.
    """
    from scenewright.cli.views import write_view
    from scenewright.graph.run import load_scene, verify

    record = load_scene(scene)
    proof = verify(record)
    for kind, name in files.items():
        write_view(kind, Path(name), record, proof, whole=whole)
