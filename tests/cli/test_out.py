"""What --out names is tried before anything is computed, in every command that has it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import typer

from scenewright.cli.main import app, main
from scenewright.cli.output_folder import try_file, try_folder
from scenewright.errors import InputError


def list_commands(command: Any, words: tuple[str, ...] = ()) -> Iterator[tuple[str, ...]]:
    """The words of every command with an --out, with something for every argument it must have."""
    for name, each in getattr(command, "commands", {}).items():
        yield from list_commands(each, (*words, name))
    if any("--out" in each.opts for each in command.params):
        for each in command.params:
            if each.required and "--out" not in each.opts:
                words += ("x",) if each.param_type_name == "argument" else (each.opts[0], "x")
        yield words


COMMANDS = tuple(list_commands(typer.main.get_command(app)))


def test_every_command_is_there() -> None:
    names = {words[0] for words in COMMANDS}
    assert {"make", "author", "drive", "batch", "agent", "export", "plan", "chat"} <= names
    assert len(COMMANDS) > 15


@pytest.mark.parametrize("words", COMMANDS, ids=" ".join)
def test_a_file_in_the_way_is_said_at_once(
    words: tuple[str, ...],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "file").write_text("")
    assert main([*words, "--out", "file/inside"]) == 2
    line = capsys.readouterr().err.splitlines()[-1]
    assert "cannot write" in line
    assert "file" in line
    assert [each.name for each in tmp_path.iterdir()] == ["file"]


def test_the_folder_that_no_option_names_is_tried_as_well(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "scenes").write_text("")
    for command in ("make", "author"):
        assert main([command, "A car yields to a pedestrian"]) == 2
        assert "scenes is a file" in capsys.readouterr().err


def test_what_can_be_written_is_left_as_it_is(tmp_path: Path) -> None:
    assert try_folder(str(tmp_path / "new" / "inside")) == str(tmp_path / "new" / "inside")
    assert try_file(str(tmp_path / "new.json")) == str(tmp_path / "new.json")
    assert (try_file("-"), try_folder(None)) == ("-", None)
    assert list(tmp_path.iterdir()) == []


def test_no_name_of_a_file_or_a_folder_is_refused(tmp_path: Path) -> None:
    for attempt in (try_folder, try_file):
        for out in (" ", "a\0b"):
            with pytest.raises(InputError, match="--out must name a"):
                attempt(out)
    with pytest.raises(InputError, match="in a folder that exists"):
        try_file(str(tmp_path / "new" / "file"))
    with pytest.raises(InputError, match="in a folder that exists"):
        try_file(str(tmp_path))
