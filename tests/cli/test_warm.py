"""`scenewright warm` says how far the compiler is, and what it has done."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from scenewright.cli import main as command
from scenewright.compiled import compiled
from scenewright.graph import run


@compiled
def count(numbers: tuple[int, ...]) -> int:
    return len(numbers)


def test_warm_tells_what_it_compiles(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))  # nothing is compiled there yet

    def compile_loops(*_: object, **__: object) -> None:
        for length in range(1, 21):  # for numba each is a function of its own
            assert count((7,) * length) == length

    monkeypatch.setattr(run, "synthesize", compile_loops)
    monkeypatch.setattr(command, "LOOPS", 20)
    assert command.main(["warm"]) == 0
    printed = capsys.readouterr()
    assert "compiling: 10 of about 20 loops, about " in printed.err
    assert "compiling: 20 of about 20 loops, about 0 s left" in printed.err
    assert printed.out.startswith("20 loops compiled in ")
    monkeypatch.setattr(run, "synthesize", lambda *_, **__: None)
    assert command.main(["warm", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["compiled"] == 0
