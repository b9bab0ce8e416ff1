"""`scenewright warm` says how far the compiler is, and what it has done."""

from __future__ import annotations

import json
import re
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from scenewright.cli import warm as command
from scenewright.cli.main import main
from scenewright.compiled import compiled
from scenewright.graph import run
from scenewright.graph.verify import examine_tracks
from scenewright.tools.trajnet_refiner import rollout
from scenewright.tools.trajnet_refiner.rollout import run_rollout


@compiled
def count(numbers: tuple[int, ...]) -> int:
    return len(numbers)


def compile_elsewhere(compiled: Any) -> None:
    compiled.value = 3


def fail(_: Any) -> None:
    sys.exit(9)


def test_warm_tells_what_both_processes_compile(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))  # nothing is compiled there yet

    def compile_loops(*_: object, **__: object) -> None:
        for length in range(1, 21):  # for numba each is a function of its own
            assert count((7,) * length) == length

    monkeypatch.setattr(run, "synthesize", compile_loops)
    monkeypatch.setattr(command, "compile_last_stages", compile_elsewhere)
    monkeypatch.setattr(command, "LOOPS", 23)
    assert main(["warm"]) == 0
    printed = capsys.readouterr()
    assert re.search("compiling: 1[03] of about 23 loops, about ", printed.err)
    assert re.search("compiling: 2[03] of about 23 loops, about ", printed.err)
    assert printed.out.startswith("23 loops compiled in ")
    monkeypatch.setattr(run, "synthesize", lambda *_, **__: None)
    assert main(["warm", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["compiled"] == 3
    monkeypatch.setattr(command, "compile_last_stages", fail)
    assert main(["warm"]) == 70


def test_the_second_process_runs_what_comes_last_in_a_scene(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    rolled, seen = list[Any](), list[str]()

    def roll(*given: Any, **named: Any) -> Any:
        rolled.append(run_rollout(*given, **named))
        return rolled[-1]

    def examine(*given: Any, **named: Any) -> Any:
        found = examine_tracks(*given, **named)
        seen.extend(event.type for event in found.events)
        return found

    monkeypatch.setattr(command.signal, "signal", lambda *_: None)
    monkeypatch.setattr(rollout, "run_rollout", roll)
    monkeypatch.setattr("scenewright.graph.verify.examine_tracks", examine)
    command.compile_last_stages(SimpleNamespace(value=0))
    assert np.isfinite(rolled[0]).all()
    assert {"collision", "near_miss", "follow"} <= set(seen)
