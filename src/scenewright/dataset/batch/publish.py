"""A row's folder, whole or absent."""

from __future__ import annotations

import hashlib
import os
import secrets
import shutil
from collections.abc import Mapping
from pathlib import Path

from scenewright.dataset.batch.worker import FILES
from scenewright.errors import InputError


def publish(files: Mapping[str, bytes], folder: Path, *, parts: Path) -> dict[str, str]:
    """Writes a row's files into `parts` and moves them to `folder` at once; name -> sha256.

    Raises:
        InputError: it cannot be written, or something else stands there.
    """
    part = parts / secrets.token_hex(8)
    try:
        part.mkdir(parents=True)
        for name, data in files.items():
            (part / name).write_bytes(data)
        if folder.exists():
            _discard(folder)
        os.rename(part, folder)
    except OSError as error:
        shutil.rmtree(part, ignore_errors=True)
        raise InputError(f"cannot write {folder}: {error.strerror or error}") from error
    return {name: hashlib.sha256(data).hexdigest() for name, data in files.items()}


def is_whole(folder: Path, sha256: Mapping[str, str]) -> bool:
    """Whether a folder's files are there, as they were written."""
    try:
        return all(
            hashlib.sha256((folder / name).read_bytes()).hexdigest() == wanted
            for name, wanted in sha256.items()
        )
    except OSError:
        return False


def discard_leftovers(folder: Path, name: str) -> None:
    """Removes what a killed run of the journal of that name had not finished."""
    shutil.rmtree(folder / f".{name}.parts", ignore_errors=True)


def _discard(folder: Path) -> None:
    """Removes a row's folder that no journal knows; never anything that is no scene's."""
    names = {entry.name for entry in folder.iterdir()} if folder.is_dir() else {""}
    if not names <= set(FILES):
        raise InputError(f"{folder} is in the way: it holds other things than a scene")
    shutil.rmtree(folder)
