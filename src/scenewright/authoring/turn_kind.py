"""What kind of turn words are: a question, a step between versions, small talk, or words to act on.

The form of a sentence alone decides the kind, for every backend alike, so that a question never
changes a scene. What is left, requests and descriptions, is read by the planner.
"""

from __future__ import annotations

import re
from typing import Literal

from scenewright.backends.offline import WORDS, Patterns, fill_in
from scenewright.scene.base import Model

_PATTERNS = Patterns("turn_kind")

Kind = Literal[
    "question", "undo", "redo", "version", "restart", "show", "why", "help", "quit", "play", "gif",
    "mp4", "html", "save", "talk", "words",
]  # fmt: skip

_NUMBERS: dict[str, int] = WORDS["turn_kind"]["numbers"]
_SIMPLE: list[tuple[Kind, re.Pattern[str]]] = [
    (kind, re.compile(rf"^(?:{fill_in(pattern)})[ .!?]*$"))
    for kind, pattern in WORDS["turn_kind"]["simple"]
]


class TurnKind(Model):
    """The kind of a turn.

    Attributes:
        count: how many steps back; number: of the version that is asked for.
        words: what is left to be read, without the polite frame of a request.
        topic: what a question is about, as the model of turns names it; None where that is open.
        name: under which to save.
    """

    kind: Kind
    words: str
    count: int = 1
    number: int | None = None
    topic: str | None = None
    name: str | None = None


_SHORT: dict[str, str] = WORDS["turn_kind"]["short"]
_SHORT_WORD = re.compile(rf"(?<![\w'>=\[(-])(?:{'|'.join(_SHORT)})(?![\w'<=:>-])")


def spell_fully(words: str) -> str:
    """The words without the shorthand of short messages: "whats" is "what's", "u" is "you"."""
    return _SHORT_WORD.sub(lambda found: _SHORT[found[0]], words)


def read_name(words: str) -> str | None:
    """Under which name the words ask to save; None where they name none."""
    found = _PATTERNS.named.search(words)
    name = found and (found["quoted"] or found["bare"])
    return re.sub(r"[^\w.-]+", "_", name.strip()).strip("._") or None if name else None


def classify_turn(words: str) -> TurnKind:
    """The kind of the words, by their form."""
    whole = " ".join(words.lower().replace("’", "'").split())
    plain = whole
    while (
        bare := _PATTERNS.polite.sub("", _PATTERNS.after.sub("", plain), count=1)
    ) != plain and bare:
        plain = bare
    for candidate in (whole, plain):
        for kind, pattern in _SIMPLE:
            found = pattern.match(candidate)
            if found is not None:
                return _describe(kind, words, found)
    if _PATTERNS.asks_to_act.match(plain):
        return TurnKind(kind="words", words=_drop_frame(words))
    if _PATTERNS.question.match(plain) or re.match(r"the [a-z-]+ ?\?$", plain):
        return TurnKind(kind="question", words=words)
    return TurnKind(kind="words", words=_drop_frame(words))


def _describe(kind: Kind, words: str, found: re.Match[str]) -> TurnKind:
    groups = found.groupdict()
    digits = groups.get("nth") or groups.get("count")
    number = None if digits is None else int(_NUMBERS.get(digits, digits))
    if kind == "version":
        return TurnKind(kind=kind, words=words, number=number)
    name = read_name(words) if kind == "save" else None
    return TurnKind(kind=kind, words=words, count=number or 1, name=name)


_FRAME = re.compile(WORDS["turn_kind"]["frame"], re.IGNORECASE)


def _drop_frame(words: str) -> str:
    """ "Show me a car that yields" and "can you make the car faster?" without their frames."""
    bare = _FRAME.sub("", _PATTERNS.suppose.sub(r"make \1 ", words), count=1)
    return bare.rstrip(" ?") if bare != words else words
