"""`scenewright show`: a scene's recording in the rerun viewer, or its views as files to share."""

from __future__ import annotations

from pathlib import Path


def write_views(scene: str, *, html: str | None, gif: str | None) -> list[str]:
    """Writes the views that were asked for and returns the names of their files.

    The proof is computed anew, so that a page never shows the proof of another scene.

    Raises:
        InputError: there is no scene, or a file cannot be written.
    """
    from scenewright.graph.run import load_scene, verify
    from scenewright.intersections import load_map

    record = load_scene(scene)
    intersection_map = load_map(record.meta.intersection)
    proof = verify(record)
    if html is not None:
        from scenewright.viz.html_player import write_player

        write_player(Path(html), scene=record, proof=proof, intersection=intersection_map)
    if gif is not None:
        from scenewright.viz.animation import animate_scene

        animate_scene(Path(gif), scene=record, proof=proof, intersection=intersection_map)
    return [each for each in (html, gif) if each is not None]
