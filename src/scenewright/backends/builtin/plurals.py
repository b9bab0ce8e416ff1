"""Road users in the plural without a number: "cars give way" is read as two cars, and says so."""

from __future__ import annotations

import re
from dataclasses import dataclass

from scenewright.backends.builtin.reader.words import WORDS, compile_words, load_nouns
from scenewright.backends.builtin.rewritten import RewrittenText, replace_pieces
from scenewright.scene.account import SaidSpan

_NOUNS = "|".join(noun for noun, each in load_nouns().items() if each.plural) + "|riders"
_FEW = r"several|a few|a number of|various"
_DETERMINER = rf"(?:(?P<few>{_FEW})|some|many|all|all of|most)\s+"
_CROWD = r"everyone|everybody|(?:(?:all|the|other|cross|crossing|oncoming)\s+)*traffic"
_YIELDS: str = WORDS["plurals"]["yields"]
_COUNTED = re.compile(
    rf"\b(?P<plural>(?:{_DETERMINER})?(?:the\s+)?(?P<other>other\s+)?(?P<noun>{_NOUNS}))\b"
    rf"|\b(?P<crowd>(?:{_CROWD})(?:\s+else)?)(?=\s+(?:{_YIELDS})\b)",
    re.IGNORECASE,
)
_NUMBERED = compile_words("plurals.numbered")
_COUNTED_ELSEWHERE = compile_words("plurals.counted_elsewhere")
"""The number is said apart from the noun: "teenagers cross in a group of three"."""


@dataclass(frozen=True)
class CountedText(RewrittenText):
    """A text with a number before every plural that has none."""

    def restore_span(self, entry: SaidSpan) -> SaidSpan:
        """An entry of the account in the words of the original; an assumed number is noted."""
        own = super().restore_span(entry)
        if entry.became != "agent":
            return own
        for start, end, *_ in self.pieces:
            if start < entry.end and entry.start < end:
                number = self.text[start:end].split()[0]
                note = f"the words leave open how many; {number} are made"
                return own.model_copy(update={"note": note})
        return own


def count_plurals(text: str) -> CountedText | None:
    """The text with "two" (three for "several") before plurals without a number; None if none."""
    matches = [m for m in _COUNTED.finditer(text) if _NUMBERED.search(text[: m.start()]) is None]
    if not matches or _COUNTED_ELSEWHERE.search(text):
        return None
    worded, pieces = replace_pieces(text, ((m.start(), m.end(), _word(m)) for m in matches))
    return CountedText(worded, text, pieces)


def _word(match: re.Match[str]) -> str:
    if match["crowd"]:
        return "two cars"
    return f"{'three' if match['few'] else 'two'} {match['other'] or ''}{match['noun']}"
