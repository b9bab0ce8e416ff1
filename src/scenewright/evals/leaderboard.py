"""A leaderboard: a JSON file of figures of any program, and a page drawn from it."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from scenewright.dataset.tables.card import escape_markdown
from scenewright.errors import InputError
from scenewright.evals.markdown import format_table
from scenewright.evals.satisfaction.report import RATES, format_share
from scenewright.files import write_atomically

SectionKey = Literal["entries", "predictions"]


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
SECTIONS: Mapping[SectionKey, Section] = {
    "entries": Section("Instructions satisfied", RATES, "satisfied"),
    "predictions": Section("Events foreseen", FORESEEN, "macro"),
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
    content = _read_board(board)
    content[section][name] = dict(figures)
    filled = {key: entries for key, entries in content.items() if entries}
    data = json.dumps({"schema_version": 1, **filled}, ensure_ascii=False, indent=1)
    write_atomically(board, (data + "\n").encode("utf-8"))
    page = board.with_suffix(".md")
    write_atomically(page, _draw_page(content).encode("utf-8"))
    return page


def _read_board(board: Path) -> dict[SectionKey, dict[str, Any]]:
    """The submissions of each section."""
    if not board.exists():
        return {key: {} for key in SECTIONS}
    try:
        found = json.loads(board.read_bytes())
        if not SECTIONS.keys() & found.keys():
            raise KeyError("entries")
        content = {key: dict(found.get(key, {})) for key in SECTIONS}
        for key, section in SECTIONS.items():
            for each in content[key].values():
                _ = [each[column]["rate"] for column in section.columns]
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise InputError(f"{board} is no leaderboard; name another file for --board") from error
    return content


def _draw_page(content: Mapping[SectionKey, Mapping[str, Any]]) -> str:
    parts = ["# Leaderboard"]
    for key, section in SECTIONS.items():
        if content[key]:
            parts += [f"## {section.title}", _draw_table(section, content[key])]
            parts.append("\n".join(f"- *{name}*: {what}" for name, what in section.columns.items()))
    return "\n\n".join(parts) + "\n"


def _draw_table(section: Section, entries: Mapping[str, Any]) -> str:
    ordered = sorted(entries.items(), key=lambda each: -(each[1][section.best]["rate"] or 0.0))
    rows = [
        [escape_markdown(name, longest=80), *(format_share(each[key]) for key in section.columns)]
        for name, each in ordered
    ]
    return format_table(["submission", *section.columns], rows)
