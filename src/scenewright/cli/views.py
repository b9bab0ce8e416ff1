"""Views of a scene as files: picture, animation, page."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from scenewright.cli.console import format_one_line
from scenewright.cli.interrupts import stop_if_asked
from scenewright.errors import ScenewrightError
from scenewright.extras import MissingPackageError

if TYPE_CHECKING:
    from scenewright.scene.events import Proof
    from scenewright.scene.record import SceneRecord

ViewKind = Literal["png", "gif", "mp4", "html"]


def add_views(
    folder: Path,
    views: Mapping[str, Callable[[Path], None]],
    log: Callable[[str], None] = lambda _: None,
) -> list[str]:
    """Write views into a scene's folder and return what could not be added, and why.

    A fault of the disk is raised, as it concerns the scene as well.

    Args:
        views: file name -> writes it; log: called with each name before.
    """
    warnings = []
    for name, write in views.items():
        log(name)
        try:
            write(folder / name)
        except MissingPackageError as missing:
            warnings.append(f"no {name}: {missing}")
        except (ScenewrightError, MemoryError):
            raise
        except Exception as error:  # a library or its environment; the scene stands without it
            stop_if_asked()
            words = f"no {name}: {type(error).__name__}: {error}"
            warnings.append(format_one_line(words, limit=300))
    return warnings


def render(write: Callable[[Path], None]) -> bytes:
    """The bytes of a file that is written by calling `write` with its path."""
    with tempfile.TemporaryDirectory() as folder:
        write(path := Path(folder) / "view")
        return path.read_bytes()


def render_view(kind: ViewKind, scene: SceneRecord, proof: Proof | None) -> bytes:
    """The bytes of a view (see `write_view`)."""
    return render(lambda path: write_view(kind, path, scene, proof))


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
