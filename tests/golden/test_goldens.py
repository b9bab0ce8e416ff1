"""What the pictures of the graph show has not changed unnoticed."""

from __future__ import annotations

import pytest
from goldens import FOLDER, GOLDENS


@pytest.mark.parametrize("name", GOLDENS)
def test_golden(name: str) -> None:
    kept = (FOLDER / name).read_text(encoding="utf-8")
    assert GOLDENS[name]() == kept, "meant? then run: python tests/golden/goldens.py"
