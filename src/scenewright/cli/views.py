"""Views of a scene as files: picture, animation, page."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    from scenewright.scene.events import Proof
    from scenewright.scene.record import SceneRecord

ViewKind = Literal["png", "gif", "html"]


def write_view(kind: ViewKind, path: Path, scene: SceneRecord, proof: Proof | None) -> None:
    """Write one view; only the libraries that it needs are loaded.

    Raises:
        InputError: the file cannot be written; nothing is left behind.
    """
    from scenewright.intersections import load_map

    intersection_map = load_map(scene.meta.intersection)
    if kind == "png":
        from scenewright.viz.still import draw_scene

        draw_scene(path, scene=scene, proof=proof, intersection=intersection_map)
    elif kind == "gif":
        from scenewright.viz.animation import animate_scene

        animate_scene(path, scene=scene, proof=proof, intersection=intersection_map)
    else:
        from scenewright.viz.html_player import write_player

        write_player(path, scene=scene, proof=proof, intersection=intersection_map)
