"""The tutorials' commands and code run, in order, in one folder each."""

from __future__ import annotations

import re
import shlex
import sys
from pathlib import Path
from typing import Any

import pytest

from inline_jobs import run_jobs_inline
from scenewright.cli.main import main

PAGES = sorted((Path(__file__).parents[2] / "docs" / "tutorials").glob("*.md"))
BLOCK = re.compile(r"^```(bash|python|yaml)\n(.*?)^```$", re.DOTALL | re.MULTILINE)
FOREIGN = "own environment"


def run_commands(block: str) -> None:
    for line in block.replace("\\\n", " ").splitlines():
        words = shlex.split(line, comments=True)
        if words:
            assert words[0] == "scenewright"
            code = main(words[1:])
            assert code in (0, 1) if words[1] == "verify" else code == 0, line


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_a_tutorial_does_what_it_says(
    page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [*sys.path])
    run_jobs_inline(monkeypatch)
    names: dict[str, Any] = {"__name__": "tutorial"}
    blocks = BLOCK.findall(page.read_text("utf-8"))
    assert blocks
    for language, block in blocks:
        if language == "bash":
            run_commands(block)
            continue
        if language == "yaml":
            if named := re.match(r"# (\S+\.yaml)\n", block):
                Path(named[1]).write_text(block)
            continue
        code = compile(block, page.name, "exec")
        if FOREIGN not in block.splitlines()[0]:
            exec(code, names)
            if "class Planner" in block:
                Path("planner.py").write_text(block)
