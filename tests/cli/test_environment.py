"""What the environment sets: a folder that is not there and a mistyped name are said."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import scenewright
from scenewright.cli import main as command_line
from scenewright.cli.main import main


@pytest.mark.parametrize("variable", ["DATA", "INTERSECTIONS", "RELATIONS"])
@pytest.mark.parametrize("is_file", [False, True])
def test_a_folder_that_is_not_there_is_one_line(
    variable: str,
    is_file: bool,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    if is_file:
        (tmp_path / "nowhere").write_text("")
    monkeypatch.setenv(f"SCENEWRIGHT_{variable}", str(tmp_path / "nowhere"))
    assert main(["make", "A car yields to a pedestrian", "--refiner", "none", "--quiet"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "nowhere" in line
    assert not (tmp_path / "scenes").exists()


def test_a_mistyped_name_is_said(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("SCENEWRIGHT_INTERSECTION", "there")
    monkeypatch.setenv("SCENEWRIGHT_OF_ANOTHER_PROGRAM", "1")
    monkeypatch.setenv("SCENEWRIGHT_REFINER", "none")
    assert main(["intersections", "list"]) == 0
    said = [line for line in capsys.readouterr().err.splitlines() if line.startswith("note")]
    assert said == [
        "note: SCENEWRIGHT_INTERSECTION is not used; is SCENEWRIGHT_INTERSECTIONS meant?"
    ]


def test_every_variable_that_is_read_is_known() -> None:
    package = Path(scenewright.__file__).parent
    text = "".join(each.read_text("utf-8") for each in package.rglob("*.py"))
    found = set(re.findall(r"SCENEWRIGHT_([A-Z]+(?:_[A-Z]+)*)", text))
    assert found == set(command_line._VARIABLES)
