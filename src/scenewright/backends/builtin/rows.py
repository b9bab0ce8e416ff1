"""Rows of `scenewright plan`: text in, plan row out, by the builtin planner."""

from __future__ import annotations

from typing import Any

from scenewright.backends.builtin.planner import plan
from scenewright.errors import InputError
from scenewright.scene.plan_row import plan_to_row


def plan_row(row: dict[str, Any]) -> dict[str, Any]:
    """The output row for {"id", "text", "previous"?}.

    Raises:
        InputError: if `id` or `text` is missing or not a string.
    """
    for key in ("id", "text"):
        if not isinstance(row.get(key), str):
            raise InputError(f"a row needs {key!r} as a string")
    previous = row.get("previous")
    if previous is not None and not isinstance(previous, str):
        raise InputError("'previous' must be a string, the text of the earlier turn")
    return plan_to_row(row["id"], plan(row["text"], previous=previous))
