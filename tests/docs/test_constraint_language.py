"""The page about the constraint language says only what the parser accepts."""

from __future__ import annotations

import re
from pathlib import Path
from typing import get_args

import pytest

from scenewright.scene.constraints import PairClause, UnaryClause
from scenewright.tools.dsl_validator.parse import parse

PAGE = (Path(__file__).parents[2] / "docs" / "constraint-language.md").read_text("utf-8")
EXAMPLES = re.findall(r"^```constraints\n(.*?)^```$", PAGE, flags=re.DOTALL | re.MULTILINE)
TABLE_ROWS = re.findall(r"^\| `([a-z_]+\(.*?)` \|", PAGE, flags=re.MULTILINE)


@pytest.mark.parametrize("example", EXAMPLES)
def test_examples_are_programs(example: str) -> None:
    assert parse(example).clauses


@pytest.mark.parametrize("row", TABLE_ROWS)
def test_documented_forms_are_clauses(row: str) -> None:
    assert len(parse(row).clauses) == 1


def test_every_clause_is_documented() -> None:
    documented = {row.split("(")[0] for row in TABLE_ROWS}
    models = get_args(UnaryClause | PairClause)
    names = [get_args(model.model_fields["clause"].annotation) for model in models]
    assert documented == {name for each in names for name in each}


def test_the_python_block_prints_what_it_says(capsys: pytest.CaptureFixture[str]) -> None:
    (block,) = re.findall(r"^```python\n(.*?)^```$", PAGE, flags=re.DOTALL | re.MULTILINE)
    exec(block, {})
    promised = re.findall(r"# (.*)$", block, flags=re.MULTILINE)
    assert capsys.readouterr().out.splitlines() == promised
