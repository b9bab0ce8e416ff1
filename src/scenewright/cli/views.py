"""Views of a scene as files: picture, animation, page; and a version as a folder of files."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from scenewright.cli.console import format_one_line, write_stdout
from scenewright.cli.interrupts import stop_if_asked
from scenewright.cli.options import argument, option
from scenewright.cli.output_folder import fill_folder, shorten_path, target_folder
from scenewright.errors import InputError, ScenewrightError
from scenewright.extras import MissingPackageError
from scenewright.files import write_atomically

if TYPE_CHECKING:
    from scenewright.authoring.session import SessionVersion
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


def save_scene(
    target: Path,
    files: Mapping[str, bytes],
    views: Mapping[str, Callable[[Path], None]],
    log: Callable[[str], None] = lambda _: None,
) -> tuple[Path, list[str], list[str]]:
    """Writes a scene's folder as a whole: it, its files, and what could not be added (`add_views`).

    Raises:
        InputError: the folder cannot be written.
    """
    with fill_folder(target) as part:
        for name, data in files.items():
            write_atomically(part / name, data)
        warnings = add_views(part, views, log)
        names = sorted(entry.name for entry in part.iterdir())
        stop_if_asked()
    return shorten_path(target), names, warnings


def save_version(shown: SessionVersion, path: str) -> tuple[Path, list[str], list[str]]:
    """A version as a folder (see `save_scene`)."""
    files = {
        "scene.json": shown.scene_json,
        "proof.json": shown.proof_json,
        "provenance.json": shown.provenance_json,
    }
    draw = partial(write_view, "png", scene=shown.record, proof=shown.proof)
    views = {"scene.png": draw, "scene.rrd": partial(record_version, shown)}
    return save_scene(target_folder(path, force=None), files, views)


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


def show(
    scenes: list[str] = argument(
        ...,
        "A scene's folder, or its scene.rrd; several, or a dataset's folder, with --png.",
        metavar="SCENE...",
    ),
    png: str | None = option(
        None, "Write a picture; of several scenes contact sheets.", metavar="F"
    ),
    html: str | None = option(
        None, "Write a page that plays and explains it, to share.", metavar="F"
    ),
    gif: str | None = option(None, "Write an animation.", metavar="F"),
    mp4: str | None = option(None, "Write a video (extra `video`, or ffmpeg).", metavar="F"),
    whole: bool = option(False, "Animations go on to the end of the scene."),
) -> None:
    """Open a scene's recording in the rerun viewer, or write its views to files."""
    asked: dict[ViewKind, str | None] = {"png": png, "html": html, "gif": gif, "mp4": mp4}
    files = {kind: name for kind, name in asked.items() if name is not None}
    if not files:
        from scenewright.viz.recording import open_recording

        if len(scenes) > 1:
            raise InputError("one recording is opened at a time; --png F draws several scenes")
        open_recording(scenes[0])
        return
    from scenewright.cli.verify import list_scene_files
    from scenewright.dataset.batch.manifest import MANIFEST
    from scenewright.graph.scene_files import load_scene
    from scenewright.graph.verify import verify

    if len(scenes) > 1:  # DIR/* names the dataset's tables and pictures as well
        known = ("scene.json", MANIFEST)
        scenes = [each for each in scenes if any((Path(each) / name).is_file() for name in known)]
    folders = [folder for each in scenes for folder in list_scene_files(each)]
    # The proof is computed anew, so that a page never shows that of another scene.
    shown = ((each.name, scene, verify(scene)) for each in folders for scene in [load_scene(each)])
    written = list(files.values())
    if len(folders) == 1 and folders == [Path(scenes[0])]:
        ((_, scene, proof),) = shown
        for kind, name in files.items():
            write_view(kind, Path(name), scene, proof, whole=whole)
    else:
        if png is None or len(files) > 1:
            raise InputError("of several scenes there are contact sheets alone: --png F")
        from scenewright.viz.contact_sheet import draw_contact_sheets

        written = draw_contact_sheets(png, shown)
    write_stdout("".join(f"{name}\n" for name in written))
