"""What --out names: tried before any work is done; a folder appears whole or not at all."""

from __future__ import annotations

import json
import os
import re
import secrets
import shutil
import tempfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, TypeVar

from scenewright.errors import InputError
from scenewright.files import write_files

OutT = TypeVar("OutT", bound="str | Path | None")

SCENES = "scenes"
SCENE_FILES = (
    "provenance.json",
    "drive.json",
    "proof.json",
    "scene.png",
    "scene.gif",
    "scene.rrd",
    "scene.json",
)
"""What a run may write, scene.json last: where it is, the rest is."""


def try_folder(out: OutT) -> OutT:
    """The value of an option that names a folder to write, once it is clear that it can be.

    Raises:
        InputError: no usable path, a file is in the way, or nothing can be written there.
    """
    if out is not None:
        target = _resolve(out, "folder")
        if target.exists() and not target.is_dir():
            raise InputError(f"{out} is a file; --out must name a folder")
        _try_to_write(next(each for each in (target, *target.parents) if each.exists()))
    return out


def try_file(out: OutT) -> OutT:
    """The value of an option that names a file to write, `-` for stdout (see `try_folder`)."""
    if out is not None and str(out) != "-":
        target = _resolve(out, "file")
        if target.is_dir() or not target.parent.is_dir():
            raise InputError(
                f"cannot write {str(out)!r}: it must name a file in a folder that exists"
            )
        _try_to_write(target.parent)
    return out


def _resolve(out: str | Path, kind: str) -> Path:
    if not str(out).strip() or "\0" in str(out):
        raise InputError(f"--out must name a {kind}")
    return Path(os.path.realpath(out))


def _try_to_write(folder: Path) -> None:
    try:
        with tempfile.TemporaryFile(dir=folder):  # permissions alone do not tell it everywhere
            pass
    except OSError as error:
        raise InputError(f"cannot write in {folder}: {error.strerror or error}") from error


def target_folder(path: str, *, force: bool | None) -> Path:
    """The folder to write, checked before any work is done.

    Args:
        force: whether a folder that holds other things may be written; None: the command has no
            such option.

    Raises:
        InputError: no usable path, a file is in the way, or the folder holds other things.
    """
    target = _resolve(path, "folder")
    try:
        try_folder(path)
        if target.is_dir() and not force and not _is_replaceable(target):
            beside = ", or add --force to keep them and write the scene beside them"
            more = "" if force is None else beside
            raise InputError(f"{target} holds other files; choose another --out{more}")
    except OSError as error:
        raise InputError(f"cannot use {target}: {error.strerror or error}") from error
    return target


def plan_folder(out: str | None, *, force: bool | None) -> Callable[[str], Path]:
    """The folder to write by the id of its scene: scenes/ID where none is named (`target_folder`).

    What can be checked before the id is known is checked at once.
    """
    if out is not None:
        target = target_folder(out, force=force)
        return lambda _: target
    try_folder(SCENES)
    return lambda name: target_folder(
        str(Path(SCENES) / choose_folder_name(name)), force=bool(force)
    )


def choose_folder_name(scene_id: str) -> str:
    """A scene id as a plain file name: it derives from text of any origin."""
    slug = re.sub(r"[^a-z0-9_]+", "-", scene_id.lower()).strip("-")[:80].rstrip("-")
    return slug or "scene"


def write_report(folder: str | Path, name: str, page: str, values: Mapping[str, Any]) -> Path:
    """Writes a report as NAME.json and NAME.md into a folder, which it returns.

    Raises:
        InputError: the folder cannot be made, or a file not be written.
    """
    data = json.dumps(values, ensure_ascii=False, indent=1, allow_nan=False) + "\n"
    texts = {f"{name}.json": data, f"{name}.md": page}
    return write_files(
        folder, {file: text.encode("utf-8", "backslashreplace") for file, text in texts.items()}
    )


def shorten_path(target: Path) -> Path:
    """Relative where that is shorter to read."""
    here = Path.cwd()
    return target.relative_to(here) if target.is_relative_to(here) else target


def _is_replaceable(target: Path) -> bool:
    """Empty, or nothing but an earlier scene."""
    found = {entry.name for entry in target.iterdir()}
    return not found or ("scene.json" in found and found <= set(SCENE_FILES))


@contextmanager
def fill_folder(target: Path) -> Iterator[Path]:
    """A folder to fill, moved to `target` once the block is through, else removed.

    A folder that holds an earlier scene is replaced; other files in it are kept.

    Raises:
        InputError: `target` cannot be written; nothing is left behind.
    """
    made: list[Path] = []
    part: Path | None = None
    try:
        made = [parent for parent in target.parents if not parent.exists()]
        target.parent.mkdir(parents=True, exist_ok=True)
        part = _make_staging(target)
        yield part
        _publish(part, target)
        made = []
    except (OSError, InputError) as error:
        fault = error if isinstance(error, OSError) else error.__cause__
        if not isinstance(fault, OSError):
            raise
        raise InputError(f"cannot write {target}: {fault.strerror or fault}") from error
    finally:
        if part is not None:
            shutil.rmtree(part, ignore_errors=True)
        for folder in made:
            with suppress(OSError):
                folder.rmdir()


def _make_staging(target: Path) -> Path:
    """A new folder beside the target, or inside it where its parent cannot be written."""
    name = f".{target.name[:80]}.{secrets.token_hex(4)}.part"
    beside = target.parent / name
    try:
        beside.mkdir()
    except OSError:
        if not target.is_dir():
            raise
        beside = target / name
        beside.mkdir()
    return beside


def _publish(part: Path, target: Path) -> None:
    """Moves a folder to its place; the files of one that must stay are replaced, each whole."""
    if not target.exists():
        part.rename(target)
    elif part.parent == target or target == Path.cwd() or not _is_replaceable(target):
        for name in SCENE_FILES:
            if (part / name).exists():
                os.replace(part / name, target / name)
            else:
                (target / name).unlink(missing_ok=True)
    else:
        old = part.with_suffix(".old")  # gone only after the new one is in its place
        target.rename(old)
        try:
            part.rename(target)
        except BaseException:
            old.rename(target)
            raise
        shutil.rmtree(old, ignore_errors=True)
