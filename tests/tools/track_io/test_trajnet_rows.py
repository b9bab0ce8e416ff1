"""One reader of TrajNet++ lines, and what becomes of predictions in them."""

from __future__ import annotations

import json
from typing import NoReturn

import pytest

from scenewright.tools.formats.trajnet import Predictions, iterate_trajnet_rows

SCENE = {"scene": {"id": 1}}
ROWS = [{"track": {"f": n} | ({} if n is None else {"prediction_number": n})} for n in (None, 0, 1)]


def refuse(line: int, reason: str) -> NoReturn:
    raise ValueError(f"{line}: {reason}")


@pytest.mark.parametrize(
    ("predictions", "kept"), [("leave out", [1, 3]), ("first as tracks", [1, 3, 4])]
)
def test_predictions_are_kept_as_the_reader_says(predictions: Predictions, kept: list[int]) -> None:
    lines = [json.dumps(SCENE), "", *map(json.dumps, ROWS)]
    found = list(iterate_trajnet_rows(lines, predictions=predictions, refuse=refuse))
    assert [line for line, _, _ in found] == kept
    assert [kind for _, kind, _ in found] == ["scene"] + ["track"] * (len(kept) - 1)


@pytest.mark.parametrize("line", ["{", "[]", "{}", '{"scene": 3}', json.dumps(ROWS[1])])
def test_what_is_no_row_is_refused_with_its_line(line: str) -> None:
    with pytest.raises(ValueError, match=r"^2: "):
        list(iterate_trajnet_rows(["", line], predictions="refuse", refuse=refuse))
