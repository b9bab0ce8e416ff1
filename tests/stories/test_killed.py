"""Killed at any moment of a turn, a thread goes on at its last verified version."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

SCRIPT = Path(__file__).with_name("killed.py")


@pytest.fixture(scope="module")
def given(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    if not hasattr(os, "fork"):
        pytest.skip("this system cannot fork")
    file = tmp_path_factory.mktemp("threads") / "threads.sqlite"
    done = subprocess.run(
        [sys.executable, str(SCRIPT), str(file)], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    found: dict[str, Any] = json.loads(done.stdout)
    return found


def test_killed_in_any_stage_the_last_version_stands(given: dict[str, Any]) -> None:
    before, rows = given["before"], given["rows"]
    assert before["verified"]
    second = [row for row in rows if row["version"] is not None]
    assert {row["point"] for row in second} >= {"scene_planner", "scene_verifier", "keep 1"}
    assert all(row["died"] for row in rows)
    for row in second:
        assert row["verified"], row["point"]
        assert (row["version"], row["scene"]) == (1, before["scene"]), row["point"]
        assert row["interrupted"] in ("make it a near miss", None), row["point"]


def test_killed_in_the_first_turn_nothing_is_there_and_nothing_is_broken(
    given: dict[str, Any],
) -> None:
    first = [row for row in given["rows"] if row["version"] is None]
    assert [row["point"] for row in first] == ["scene_verifier", "keep 3"]


def test_the_turn_can_be_said_again(given: dict[str, Any]) -> None:
    assert given["reply"]["kind"] == "made"
    assert given["after"]["version"] == 2
    assert given["after"]["verified"]
    assert given["after"]["interrupted"] is None
