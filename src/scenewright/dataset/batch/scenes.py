"""The scenes of a dataset, as its manifest lists them."""

from __future__ import annotations

from pathlib import Path

from scenewright.dataset.batch.manifest import read_manifest
from scenewright.errors import InputError

EXPORTS = "exports"
"""Folder in a dataset for its scenes in other formats; no part of the dataset."""


def list_scenes(folder: Path) -> list[Path]:
    """The folders of all scenes, in the manifest's order.

    Raises:
        InputError: there is no manifest, or no scene in it.
    """
    names = [name for name in read_manifest(folder)["files"] if name.endswith("/scene.json")]
    if not names:
        raise InputError(f"{folder} holds no scenes to export")
    root = folder.resolve()
    scenes = [(folder / name).parent for name in names]
    outside = [str(each) for each in scenes if not each.resolve().is_relative_to(root)]
    if outside:
        raise InputError(f"{outside[0][:200]} lies outside the dataset")
    return scenes
