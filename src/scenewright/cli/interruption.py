"""What a command that is interrupted has to say: not always that nothing was written."""

from __future__ import annotations

_words: list[str] = []


def keep(word: str) -> None:
    """Notes what is kept if the command is interrupted from now on; the last word counts."""
    _words[:] = [word]


def forget() -> None:
    """Nothing is kept."""
    _words.clear()


def get_note() -> str | None:
    """What was noted last."""
    return _words[0] if _words else None
