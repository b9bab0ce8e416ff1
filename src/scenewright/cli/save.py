"""A version of a conversation, written as the folder that `make` would have written."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from scenewright.cli.console import format_one_line
from scenewright.cli.interrupts import stop_if_asked
from scenewright.cli.output_folder import target_folder, whole_folder
from scenewright.cli.views import ViewKind, write_view
from scenewright.errors import InputError, ScenewrightError

if TYPE_CHECKING:
    from scenewright.authoring.session import SessionVersion


def save_version(shown: SessionVersion, path: str) -> tuple[Path, list[str], list[str]]:
    """The folder, its files and what could not be added.

    Raises:
        InputError: the folder cannot be written.
    """
    from scenewright.files import write_atomically

    target = target_folder(path, force=False)
    with whole_folder(target) as part:
        write_atomically(part / "scene.json", shown.scene_json)
        write_atomically(part / "proof.json", shown.proof_json)
        write_atomically(part / "provenance.json", shown.provenance_json)
        warnings = _add_views(shown, part)
        files = sorted(entry.name for entry in part.iterdir())
    here = Path.cwd()
    shortest = target.relative_to(here) if target.is_relative_to(here) else target
    return shortest, files, warnings


def _add_views(shown: SessionVersion, folder: Path) -> list[str]:
    """Adds the picture and the recording; what could not be added is a warning."""
    views: dict[str, Callable[[SessionVersion, Path], None]] = {
        "scene.png": _draw,
        "scene.rrd": record_version,
    }
    warnings = []
    for name, write in views.items():
        try:
            write(shown, folder / name)
        except (ScenewrightError, MemoryError):
            raise
        except Exception as error:  # a library or its environment; the scene stands without it
            stop_if_asked()
            warnings.append(
                format_one_line(f"no {name}: {type(error).__name__}: {error}", limit=300)
            )
    return warnings


def save_view(shown: SessionVersion, kind: ViewKind, path: str) -> Path:
    """Writes a version as one file, a page (`html`) or an animation (`gif`).

    Raises:
        InputError: there is a file already, or it cannot be written.
    """
    target = Path(path)
    if target.exists():
        raise InputError(f"{target} is there already; name another file")
    write_view(kind, target, shown.record, shown.proof)
    return target


def _draw(shown: SessionVersion, path: Path) -> None:
    write_view("png", path, shown.record, shown.proof)


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
