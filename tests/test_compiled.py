"""Machine code is kept for the next process, for these sources only, where there is a place."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from numba.core.errors import TypingError

from scenewright import compiled as module

PROGRAM = """
from pathlib import Path
import numpy as np
from scenewright.compiled import has_cache, compiled, find_cache_folder

@compiled
def ratio(values):
    return values[0] / values[1]

file = Path(__file__)
before = has_cache(file)
print(ratio(np.array([5.0, 2.0])), ratio(np.array([1.0, 0.0])), find_cache_folder(file), before)
"""


def run(folder: Path) -> list[str]:
    program = folder / "program.py"
    program.write_text(PROGRAM)
    done = subprocess.run(
        [sys.executable, str(program)], capture_output=True, text=True, check=True,
        env=os.environ | {"NUMBA_CACHE_DIR": str(folder / "kept")},
    )  # fmt: skip
    return done.stdout.split()


def times(folder: Path) -> dict[Path, int]:
    return {each: each.stat().st_mtime_ns for each in folder.rglob("*.nbc")}


def test_it_is_compiled_once_and_kept(tmp_path: Path) -> None:
    half, endless, kept, before = run(tmp_path)
    assert (half, endless, before) == ("2.5", "inf", "False")
    first = times(Path(kept))
    assert len(first) == 1
    assert run(tmp_path)[-1] == "True"
    assert times(Path(kept)) == first


def test_the_compiler_is_not_loaded_before_a_loop_runs() -> None:
    script = (
        "import sys, scenewright.graph.run, scenewright.cli.plan; print('numba' in sys.modules)"
    )
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True
    )
    assert done.stdout == "False\n"


def test_what_belongs_to_earlier_sources_is_removed(tmp_path: Path) -> None:
    names = ("scenewright-0123", "scenewright-4567", "others")
    stale, todays, foreign = (tmp_path / "kept" / name for name in names)
    for each in (stale, todays, foreign):
        each.mkdir(parents=True)
    for each in (stale, foreign):
        os.utime(each, (0, 0))
    run(tmp_path)
    assert not stale.exists()
    assert todays.exists()
    assert foreign.exists()


def test_without_a_place_to_keep_it_it_still_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "file").write_text("in the way")
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "file"))
    monkeypatch.setattr(module, "find_cache_folder", module.find_cache_folder.__wrapped__)
    assert module.find_cache_folder(Path(__file__)) is None

    def double(values: np.ndarray) -> float:
        return float(values[0] * 2.0)

    assert module.compiled(double)(np.array([2.0])) == 4.0


def test_a_change_of_what_is_imported_changes_the_place_and_no_other(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    package = tmp_path / "scenewright"
    (package / "deep").mkdir(parents=True)
    loop, constant, far, other = (
        package / name for name in ("loop.py", "deep/constant.py", "far.py", "other.py")
    )
    monkeypatch.setattr(module, "_PACKAGE", package)
    loop.write_text("from scenewright.deep import (\n    constant,\n)\n")
    constant.write_text("    from scenewright.far import A\n")

    def name(number: int) -> str:
        far.write_text(f"A = {number}\n")
        module._read.cache_clear()
        return module._hash_sources(loop)

    before = name(1)
    other.write_text("A = 1\n")
    assert name(1) == before
    assert name(2) != before


def test_a_generator_is_refused_when_it_is_defined() -> None:
    def count():  # type: ignore[no-untyped-def]
        yield 1

    with pytest.raises(TypeError, match="count is a generator"):
        module.compiled(count)


@module.compiled
def add(values: np.ndarray, pair: tuple[np.ndarray, float], twice: bool) -> float:
    return float((values[0] + pair[0][0] + pair[1]) * (2.0 if twice else 1.0))


@module.compiled
def add_twice(values: np.ndarray) -> float:
    return add(values, (values, 1.0), True) + add(values, (values, 1.0), twice=False)


@module.compiled
def overwrite(values: np.ndarray) -> None:
    values[0] = 1.0


@module.compiled_to_write
def write(values: np.ndarray) -> None:
    values[0] = 1.0


def test_constants_and_frozen_arrays_share_one_code() -> None:
    free, frozen = np.array([2.0]), np.array([3.0])
    frozen.setflags(write=False)
    for first in (free, frozen):
        for second in (free, frozen):
            assert add(first, (second, 1.0), True) == 2.0 * (first[0] + second[0] + 1.0)
        assert add_twice(first) == 3.0 * (2.0 * first[0] + 1.0)
    assert (len(add._dispatcher.overloads), len(add_twice._dispatcher.overloads)) == (1, 1)


def test_only_what_is_said_to_write_writes() -> None:
    values = np.array([2.0])
    with pytest.raises(TypingError, match="readonly"):
        overwrite(values)
    assert values[0] == 2.0
    write(values)
    assert values[0] == 1.0
