"""Files that are either whole or absent, and folders that the environment names."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from scenewright.errors import InputError


def write_atomically(path: str | Path, data: bytes) -> None:
    """Write `data` to a file beside `path`, then move it into place.

    Raises:
        InputError: the folder is missing, not writable or full; nothing is left behind.
    """
    target = Path(path)
    part = target.with_name(f".{target.name}.{os.getpid()}.part")
    try:
        part.write_bytes(data)
        os.replace(part, target)
    except BaseException as error:
        _discard(part)
        if isinstance(error, OSError):
            raise InputError(f"cannot write {target}: {error.strerror or error}") from error
        raise


def make_folder(folder: str | Path) -> Path:
    """The folder, made if need be; InputError if it cannot be."""
    target = Path(folder)
    try:
        target.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"cannot make folder {target}: {error.strerror or error}") from error
    return target


def write_files(folder: str | Path, files: Mapping[str, bytes]) -> Path:
    """Write files into a folder, which is made if need be, each as `write_atomically`; the folder.

    Raises:
        InputError: the folder cannot be made, or a file not be written.
    """
    target = make_folder(folder)
    for name, data in files.items():
        write_atomically(target / name, data)
    return target


def format_json_line(value: Any) -> bytes:
    """A value as one line of JSON: the same value, the same bytes."""
    text = json.dumps(value, ensure_ascii=False, separators=(",", ":"), allow_nan=False)
    return (text + "\n").encode("utf-8", "backslashreplace")


def find_env_folder(variable: str) -> Path | None:
    """The folder that an environment variable names; None where it is not set.

    Raises:
        InputError: there is no such folder; a mistyped name must not look like an empty folder.
    """
    named = os.environ.get(variable)
    if not named:
        return None
    if not Path(named).is_dir():
        raise InputError(f"{variable} names {named}, which is no folder; make it or mend the name")
    return Path(named)


def _discard(part: Path) -> None:
    try:
        part.unlink(missing_ok=True)
    except OSError:
        return


def is_plan_file(text: str) -> bool:
    """Whether a word of the command line names a plan file; no instruction ends like that."""
    return text.lower().endswith((".yaml", ".yml", ".osc")) and "\n" not in text
