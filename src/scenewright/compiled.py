"""Loops over many short arrays as machine code, where calls into numpy would cost most.

The code is compiled once and kept on disk, in a folder named after the sources that the function's
file imports, directly or not: numba itself looks only at the file, not at what is called or read
there. numba is imported at the first call, as it takes longer to load than many commands take to
run.
"""

from __future__ import annotations

import hashlib
import os
import re
import shutil
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import cache, cached_property, update_wrapper
from inspect import isgeneratorfunction
from pathlib import Path
from typing import Any, TypeVar, cast

from scenewright.time_limit import stop_clock

FunctionT = TypeVar("FunctionT", bound=Callable[..., Any])

_PACKAGE = Path(__file__).parent
_PREFIX = "scenewright-"
_SLOWEST = _PACKAGE / "tools" / "solver" / "reservation.py"
_IMPORT = re.compile(r"^ *from (scenewright[\w.]*) import (\([^)]*\)|.*)", re.MULTILINE)
_LOADING = threading.RLock()
_STALE = 86400.0
"""Age [s] from which machine code of other sources is removed."""


def compiled(function: FunctionT) -> FunctionT:
    """Compile a function at its first call, and keep the code on disk for the next process.

    It only reads the arrays that it is given, so that frozen ones and others share one code.
    Rounding is that of the plain function: no operation is reordered or fused. Division by zero
    gives what IEEE 754 says instead of raising. Where nothing can be kept, every process compiles
    for itself.

    Raises:
        TypeError: it is a generator, whose code on disk cannot be built into another function.
    """
    return cast(FunctionT, _CompiledFunction(function, writes=False))


def compiled_to_write(function: FunctionT) -> FunctionT:
    """Compile a function that writes into arrays that it is given, otherwise as `compiled` does."""
    return cast(FunctionT, _CompiledFunction(function, writes=True))


class _CompiledFunction:
    """A function that numba compiles when it is first called, or needed by another such one."""

    def __init__(self, function: Callable[..., Any], *, writes: bool) -> None:
        if isgeneratorfunction(function):
            raise TypeError(f"{function.__name__} is a generator: let it return a list")
        update_wrapper(self, function)
        self._ready, self._writes = False, writes

    def __call__(self, *arguments: Any) -> Any:
        if self._ready:
            return self._dispatcher(*arguments)
        with _LOADING, stop_clock():  # it compiles or loads, which threads must not do at once
            found = self._dispatcher(*arguments)
        self._ready = True
        return found

    @property
    def _numba_type_(self) -> Any:
        """The type by which numba knows the function in the code of its callers."""
        return self._dispatcher._numba_type_

    @cached_property
    def _dispatcher(self) -> Any:
        import numba

        function, config = vars(self)["__wrapped__"], cast(Any, numba.config)
        folder = find_cache_folder(Path(function.__code__.co_filename))
        before, config.CACHE_DIR = config.CACHE_DIR, str(folder)
        try:  # code of other packages stays where it was
            found = numba.njit(cache=folder is not None, error_model="numpy")(function)
        finally:
            config.CACHE_DIR = before
        _share_code(found, writes=self._writes)
        return found


def _share_code(dispatcher: Any, *, writes: bool) -> None:
    """Have numba compile nothing for a constant's sake, nor for that of a frozen array if read."""
    from numba import types

    compile_exactly, find_exactly = dispatcher.compile, dispatcher.get_call_template

    def simplify(given: Any) -> Any:
        plain: Any = types.unliteral(given)  # type: ignore[no-untyped-call]
        if type(plain) in (types.Tuple, types.UniTuple):  # of named ones numba casts no field
            return plain.from_types([simplify(each) for each in plain])
        return plain.copy(readonly=True) if isinstance(plain, types.Array) and not writes else plain

    def compile_simply(given: tuple[Any, ...]) -> Any:
        code = compile_exactly(simple := tuple(map(simplify, given)))
        if simple != given:  # or the next call with these types would ask here again
            dispatcher._insert([each._code for each in given], code, False)
        return code

    def find_simply(given: tuple[Any, ...], named: dict[str, Any]) -> Any:
        _, folded = dispatcher.fold_argument_types(given, named)
        return find_exactly(tuple(map(simplify, folded)), {})

    dispatcher.compile, dispatcher.get_call_template = compile_simply, find_simply


@cache
def find_cache_folder(file: Path) -> Path | None:
    """Find the folder for machine code of a source file; None where none can be written."""
    for root in _list_roots():
        folder = root / f"{_PREFIX}{_hash_sources(file)}"
        with suppress(OSError):
            if not folder.is_dir():
                root.mkdir(parents=True, exist_ok=True)
                for earlier in root.glob(f"{_PREFIX}*"):
                    with suppress(OSError):  # one of today another process may still write
                        if time.time() - earlier.stat().st_mtime > _STALE:
                            shutil.rmtree(earlier, ignore_errors=True)
                folder.mkdir(exist_ok=True)
            if os.access(folder, os.W_OK | os.X_OK):
                os.utime(folder)  # it is in use, so it is not stale
                return folder
    return None


def has_cache(file: Path = _SLOWEST) -> bool:
    """Whether there is machine code of a source file, or it has to be compiled first."""
    return any((find_cache_folder(file) or file).rglob("*.nbc"))


@contextmanager
def watch_compiling(log: Callable[[int], None]) -> Iterator[list[str]]:
    """Call `log` with how many functions are compiled after each; the names of those so far."""
    from numba.core import event

    names: list[str] = []

    class Listener(event.Listener):
        def on_start(self, event: Any) -> None:
            pass

        def on_end(self, event: Any) -> None:
            function = event.data["dispatcher"].py_func
            if not function.__module__.startswith("numba."):  # its own are many, and short
                names.append(function.__name__)
                log(len(names))

    with event.install_listener("numba:compile", Listener()):
        yield names


def _list_roots() -> Iterator[Path]:
    """List places for the folder: NUMBA_CACHE_DIR, else the package and the user's cache."""
    if named := os.environ.get("NUMBA_CACHE_DIR"):
        yield Path(named)
        return
    yield _PACKAGE / "__pycache__"
    with suppress(RuntimeError):  # the user has no home folder
        yield Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "scenewright"


def _hash_sources(file: Path) -> str:
    """Compute a name that changes when the file does, or any that it imports, directly or not."""
    found, open_ = {file}, [file]
    while open_:
        new = _read(open_.pop())[1] - found
        found |= new
        open_ += new
    text = "".join(f"{each}:{_read(each)[0]}\n" for each in sorted(found))
    return hashlib.sha256(text.encode()).hexdigest()[:16]


@cache
def _read(file: Path) -> tuple[str, frozenset[Path]]:
    """The hash of a file, and those of this package from which it imports a module or a name."""
    text, candidates = file.read_text("utf-8"), list[Path]()
    for module, names in _IMPORT.findall(text):
        place = _PACKAGE.joinpath(*module.split(".")[1:])
        candidates += [place.with_suffix(".py"), place / "__init__.py"]
        candidates += [place / f"{name}.py" for name in re.findall(r"\w+", names)]
    return hashlib.sha256(text.encode()).hexdigest(), frozenset(filter(Path.is_file, candidates))
