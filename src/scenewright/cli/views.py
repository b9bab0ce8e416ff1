"""Views of a scene as files: picture, animation, page."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    from scenewright.scene.events import Proof
    from scenewright.scene.record import SceneRecord

ViewKind = Literal["png", "gif", "mp4", "html"]


def write_view(
    kind: ViewKind, path: Path, scene: SceneRecord, proof: Proof | None, *, whole: bool = False
) -> None:
    """Write one view; only the libraries that it needs are loaded.

    Args:
        whole: an animation shows the scene to its end, not to soon after the last event.

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

        animate_scene(path, scene=scene, proof=proof, intersection=intersection_map, whole=whole)
    elif kind == "mp4":
        from scenewright.viz.video import film_scene

        film_scene(path, scene=scene, proof=proof, intersection=intersection_map, whole=whole)
    else:
        from scenewright.viz.html_player import write_player

        write_player(path, scene=scene, proof=proof, intersection=intersection_map)
