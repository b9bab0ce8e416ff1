"""Machine code is kept for the next process, for these sources only, where there is a place."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from scenewright import compiled as module

PROGRAM = """
import numpy as np
from scenewright.compiled import has_cache, compiled, find_cache_folder

@compiled
def ratio(values):
    return values[0] / values[1]

before = has_cache()
print(ratio(np.array([5.0, 2.0])), ratio(np.array([1.0, 0.0])), find_cache_folder(), before)
"""


def run(folder: Path) -> list[str]:
    program = folder / "program.py"
    program.write_text(PROGRAM)
    done = subprocess.run(
        [sys.executable, str(program)], capture_output=True, text=True, check=True,
        env={"NUMBA_CACHE_DIR": str(folder / "kept")},
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
    assert module.find_cache_folder() is None

    def double(values: np.ndarray) -> float:
        return float(values[0] * 2.0)

    assert module.compiled(double)(np.array([2.0])) == 4.0


def test_any_change_of_the_sources_changes_the_place(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "_PACKAGE", tmp_path)
    (tmp_path / "one.py").write_text("a = 1\n")
    before = module._hash_sources()
    assert module._hash_sources() == before
    (tmp_path / "two.py").write_text("")
    assert module._hash_sources() != before
