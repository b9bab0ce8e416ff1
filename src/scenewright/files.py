"""Files that are either whole or absent."""

from __future__ import annotations

import os
from pathlib import Path

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


def _discard(part: Path) -> None:
    try:
        part.unlink(missing_ok=True)
    except OSError:
        return
