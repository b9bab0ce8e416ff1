"""A version of a conversation, written as the folder that `make` would have written."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from scenewright.cli.make import shorten_path
from scenewright.cli.output_folder import fill_folder, target_folder
from scenewright.cli.views import add_views, write_view

if TYPE_CHECKING:
    from scenewright.authoring.session import SessionVersion


def save_version(shown: SessionVersion, path: str) -> tuple[Path, list[str], list[str]]:
    """The folder, its files and what could not be added.

    Raises:
        InputError: the folder cannot be written.
    """
    from scenewright.files import write_atomically

    target = target_folder(path, force=None)
    with fill_folder(target) as part:
        write_atomically(part / "scene.json", shown.scene_json)
        write_atomically(part / "proof.json", shown.proof_json)
        write_atomically(part / "provenance.json", shown.provenance_json)
        draw = partial(write_view, "png", scene=shown.record, proof=shown.proof)
        views = {"scene.png": draw, "scene.rrd": partial(record_version, shown)}
        warnings = add_views(part, views)
        files = sorted(entry.name for entry in part.iterdir())
    return shorten_path(target), files, warnings


def record_version(shown: SessionVersion, path: Path) -> None:
    """The tracks and what was said; candidates and paths are not kept with a version."""
    from scenewright.intersections import load_map
    from scenewright.viz.recording import record_scene

    record_scene(
        path,
        scene=shown.record,
        proof=shown.proof,
        intersection=load_map(shown.record.meta.intersection),
        candidates=None,
        priors=None,
        messages=[("chat", words) for words in shown.version["text"].split("; then: ")],
    )
