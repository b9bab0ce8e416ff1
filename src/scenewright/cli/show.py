"""`scenewright show`: a scene's recording in the rerun viewer, or its views as files to share."""

from __future__ import annotations

from pathlib import Path


def write_views(scene: str, *, html: str | None, gif: str | None) -> list[str]:
    """Writes the views that were asked for and returns the names of their files.

    The proof is computed anew, so that a page never shows the proof of another scene.

    Raises:
        InputError: there is no scene, or a file cannot be written.
    """
    from scenewright.cli.views import write_view
    from scenewright.graph.run import load_scene, verify

    record = load_scene(scene)
    proof = verify(record)
    if html is not None:
        write_view("html", Path(html), record, proof)
    if gif is not None:
        write_view("gif", Path(gif), record, proof)
    return [each for each in (html, gif) if each is not None]
