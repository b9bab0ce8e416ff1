"""A leaderboard: a JSON file of figures of any program, and a page drawn from it."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from scenewright.dataset.tables.markdown import escape_markdown, format_table
from scenewright.errors import InputError
from scenewright.evals.bootstrap import Figure
from scenewright.evals.satisfaction.judge import RATES
from scenewright.files import write_atomically

SectionKey = Literal["entries", "predictions", "egos"]


@dataclass(frozen=True)
class Section:
    """A table of the board.

    Attributes:
        title: heading; columns: figure -> what it is; best: the figure that orders the rows.
    """

    title: str
    columns: Mapping[str, str]
    best: str


FORESEEN = {
    "macro": "mean F1 of normal, collision and yielding by agent; every event counts",
    "collision": "F1 of collisions",
    "yielding": "F1 of yields and who gives way",
    "near_miss": "F1 of near misses",
    "exits": "agents whose exit is predicted",
}
"""Figure of predictions -> what it is; all after 4 s of a clip."""
DRIVEN = {
    "failed": "scenes that an ego failed (docs/driving.md says what that is)",
    "collisions": "drives that ended in a contact",
    "collisions_at_fault": "contacts that were its fault, by right of way and side",
    "red_lights": "drives in which it ran a red light",
    "nuplan": "mean closed-loop score",
    "epdms": "mean EPDMS without EC",
}
"""Figure of egos in the scenes of `drive --benchmark` -> what it is."""
SECTIONS: Mapping[SectionKey, Section] = {
    "entries": Section("Instructions satisfied", RATES, "satisfied"),
    "predictions": Section("Events foreseen", FORESEEN, "macro"),
    "egos": Section("Egos in 200 scenes", DRIVEN, "nuplan"),
}


def enter_leaderboard(
    board: Path, name: str, figures: Mapping[str, Any], *, section: SectionKey = "entries"
) -> Path:
    """Enter a submission into a board (a JSON file) and draw the page beside it anew; the page.

    Args:
        figures: of every column, `rate` (0 to 1 or None) and `interval` beside whatever else.

    Raises:
        InputError: the file is no board.
    """
    content: dict[SectionKey, dict[str, Any]] = {key: {} for key in SECTIONS}
    try:
        found = json.loads(board.read_bytes()) if board.exists() else content
        if not SECTIONS.keys() & found.keys():
            raise KeyError("entries")
        for key, each in SECTIONS.items():
            content[key] = dict(found.get(key, {}))
            _ = [
                entry[column]["rate"] for entry in content[key].values() for column in each.columns
            ]
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise InputError(f"{board} is no leaderboard; name another file for --board") from error
    content[section][name] = dict(figures)
    filled = {key: entries for key, entries in content.items() if entries}
    data = json.dumps({"schema_version": 1, **filled}, ensure_ascii=False, indent=1)
    write_atomically(board, (data + "\n").encode("utf-8"))
    parts = ["# Leaderboard"]
    for key, entries in filled.items():
        each = SECTIONS[key]
        best = sorted(entries.items(), key=lambda entry: -(entry[1][each.best]["rate"] or 0.0))
        rows = [
            [
                escape_markdown(who, longest=80),
                *(f"{Figure.of_share(figures[column]):.1%}" for column in each.columns),
            ]
            for who, figures in best
        ]
        parts += [f"## {each.title}", format_table(["submission", *each.columns], rows)]
        parts.append("\n".join(f"- *{title}*: {what}" for title, what in each.columns.items()))
    page = board.with_suffix(".md")
    write_atomically(page, ("\n\n".join(parts) + "\n").encode("utf-8"))
    return page
