"""Plain arrays from untrusted .npz files."""

from __future__ import annotations

import zipfile
import zlib
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenewright.errors import InputError

MOST_BYTES = 2_000_000_000
"""Largest unpacked size of a file: a few kilobytes can encode any number of zeros."""

_FAULTS = (
    OSError, ValueError, KeyError, TypeError, EOFError, MemoryError, NotImplementedError,
    RuntimeError, SyntaxError, zipfile.BadZipFile, zlib.error,
)  # fmt: skip
"""What zipfile and numpy raise for files that are cut off, encrypted or none at all."""


def read_arrays(file: Path, *, what: str, most_bytes: int = MOST_BYTES) -> dict[str, NDArray[Any]]:
    """All arrays in an .npz, by name; nothing is unpickled.

    Args:
        what: names the file in an error.

    Raises:
        InputError: it cannot be read, unpacks to too much or holds a number that is not finite.
    """
    try:
        with zipfile.ZipFile(file) as archive:
            size = sum(entry.file_size for entry in archive.infolist())
        if size > most_bytes:
            raise InputError(f"{what} would unpack to {size:,} bytes; at most {most_bytes:,}")
        with np.load(file, allow_pickle=False) as stored:
            held = {key: stored[key] for key in stored.files}
    except _FAULTS as fault:
        reason = " ".join(str(fault).split())[:200] or type(fault).__name__
        raise InputError(f"cannot read {what}: {reason}") from None
    for name, values in held.items():
        if values.dtype.kind == "f" and not np.isfinite(values).all():
            raise InputError(f"{what}: {name} holds NaN or infinity")
    return held
