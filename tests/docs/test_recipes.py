"""The recipes of CONTRIBUTING.md run, and print what they say."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

PAGE = (Path(__file__).parents[2] / "CONTRIBUTING.md").read_text("utf-8")
RECIPES = re.findall(r"^```python\n(.*?)^```$", PAGE, re.DOTALL | re.MULTILINE)


def test_every_kind_of_extension_has_a_recipe() -> None:
    titles = re.findall(r"^### \.\.\. (.*)$", PAGE, re.MULTILINE)
    kind = "a kind of manoeuvre, motion, reaction or encounter"
    assert titles == ["a relation", kind, "a map format", "a backend", "an exporter"]


@pytest.mark.parametrize("code", RECIPES)
def test_a_recipe_prints_what_it_says(code: str, capsys: pytest.CaptureFixture[str]) -> None:
    exec(compile(code, "CONTRIBUTING.md", "exec"), {"__name__": "recipe"})
    printed = re.findall(r"^print\(.*\)  # (.*)$", code, re.MULTILINE)
    assert capsys.readouterr().out.splitlines() == printed
