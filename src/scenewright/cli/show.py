"""`scenewright show`: a scene's recording in the rerun viewer, or its views as files to share."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from scenewright.errors import InputError

if TYPE_CHECKING:
    from scenewright.cli.views import ViewKind


def write_views(scenes: Sequence[str], files: Mapping[ViewKind, str], *, whole: bool) -> list[str]:
    """Writes the views that were asked for, kind -> file; of several scenes contact sheets.

    Returns the names of the files. The proof is computed anew, so that a page never shows that of
    another scene.

    Raises:
        InputError: there is no scene, or a file cannot be written.
    """
    from scenewright.cli.views import write_view
    from scenewright.dataset.batch.manifest import MANIFEST
    from scenewright.dataset.batch.scenes import list_scenes
    from scenewright.graph.run import load_scene, verify

    folders = [Path(each) for each in scenes]
    if (folders[0] / MANIFEST).is_file():
        folders = [scene for each in folders for scene in list_scenes(each)]
    elif len(folders) > 1:  # DIR/* names the dataset's tables and pictures as well
        folders = [each for each in folders if (each / "scene.json").is_file()]
    if folders != [Path(scenes[0])]:
        if [*files] != ["png"]:
            raise InputError("of several scenes there are contact sheets alone: --png F")
        from scenewright.viz.contact_sheet import draw_contact_sheets

        records = ((each.name, load_scene(each)) for each in folders)
        shown = ((name, scene, verify(scene)) for name, scene in records)
        return draw_contact_sheets(files["png"], shown)
    record = load_scene(scenes[0])
    proof = verify(record)
    for kind, name in files.items():
        write_view(kind, Path(name), record, proof, whole=whole)
    return [*files.values()]
