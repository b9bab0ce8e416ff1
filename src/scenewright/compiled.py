"""Loops over arrays as machine code: for many short arrays, whose calls into numpy cost most.

Compiled once and kept on disk, in a folder that belongs to the present state of the sources: the
compiler itself looks only at the file that a function stands in, not at those that it calls.
"""

from __future__ import annotations

import hashlib
import os
import shutil
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from typing import Any, TypeVar, cast

import numba

FunctionT = TypeVar("FunctionT", bound=Callable[..., Any])

_PACKAGE = Path(__file__).parent
_KEPT = "scenewright-"
_STALE = 86400.0
"""Age [s] from which machine code of other sources is removed."""
_config: Any = numba.config


def compiled(function: FunctionT) -> FunctionT:
    """The function compiled at its first call, and kept on disk for the next process.

    Rounding is that of the plain function: no operation is reordered or fused. Division by zero
    gives what IEEE 754 says instead of raising. Where nothing can be kept, every process compiles
    for itself.
    """
    folder = find_cache_folder()
    if folder is None:
        return cast(FunctionT, numba.njit(error_model="numpy")(function))
    with _keeping_at(folder):
        return cast(FunctionT, numba.njit(cache=True, error_model="numpy")(function))


@cache
def find_cache_folder() -> Path | None:
    """Where machine code of these sources is kept; None where nothing can be."""
    for root in _roots():
        folder = root / f"{_KEPT}{_state_of_sources()}"
        with suppress(OSError):
            if not folder.is_dir():
                root.mkdir(parents=True, exist_ok=True)
                _forget(root)
                folder.mkdir(exist_ok=True)
            if os.access(folder, os.W_OK | os.X_OK):
                return folder
    return None


def has_cache() -> bool:
    """Whether machine code of these sources is at hand, or all of it has to be compiled first."""
    folder = find_cache_folder()
    return folder is not None and any(folder.rglob("*.nbc"))


def _roots() -> Iterator[Path]:
    """Where to look for a place: where numba is told to keep things, else here, else at home."""
    if named := os.environ.get("NUMBA_CACHE_DIR"):
        yield Path(named)
        return
    yield _PACKAGE / "__pycache__"
    with suppress(RuntimeError):  # nobody's home
        yield Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "scenewright"


def _state_of_sources() -> str:
    """A name that changes when any source file does."""
    digest = hashlib.sha256()
    for file in sorted(_PACKAGE.rglob("*.py")):
        found = file.stat()
        digest.update(f"{file}:{found.st_mtime_ns}:{found.st_size}\n".encode())
    return digest.hexdigest()[:16]


def _forget(root: Path) -> None:
    """Removes what belongs to earlier sources; not today's, which a process may still write to."""
    for earlier in root.glob(f"{_KEPT}*"):
        with suppress(OSError):
            if time.time() - earlier.stat().st_mtime > _STALE:
                shutil.rmtree(earlier, ignore_errors=True)


@contextmanager
def _keeping_at(folder: Path) -> Iterator[None]:
    """Others in this process keep their own machine code where they always did."""
    before, _config.CACHE_DIR = _config.CACHE_DIR, str(folder)
    try:
        yield
    finally:
        _config.CACHE_DIR = before
