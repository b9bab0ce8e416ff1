"""A text put in other words before it is read, and the way back to its author's words."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from scenewright.scene.account import SaidSpan
from scenewright.scene.social import Plan, Refusal


@dataclass(frozen=True)
class RewrittenText:
    """A text in which some words stand for others.

    Attributes:
        pieces: (start, end) in this text and (start, end) in the original, of what was replaced.
    """

    text: str
    original: str
    pieces: tuple[tuple[int, int, int, int], ...]

    def _shift(self, at: int, *, ends: bool) -> int:
        """The place in the original of one where a span of this text starts or ends."""
        moved = 0
        for new_start, new_end, old_start, old_end in self.pieces:
            if (
                new_start < at < new_end
                or (at == new_start and not ends)
                or (at == new_end and ends)
            ):
                return old_end if ends else old_start
            if at >= new_end:
                moved = old_end - new_end
        return at + moved

    def restore_span(self, entry: SaidSpan) -> SaidSpan:
        """An entry of the account in the words of the original."""
        start, end = self._shift(entry.start, ends=False), self._shift(entry.end, ends=True)
        words = self.original[start:end] or entry.words
        return entry.model_copy(update={"start": start, "end": end, "words": words})

    def restore_words(self, reason: str) -> str:
        """A reason that quotes this text, quoting the original."""
        for new_start, new_end, old_start, old_end in self.pieces:
            new = self.text[new_start:new_end].strip()
            old = self.original[old_start:old_end]
            reason = reason.replace(f"'{new}'", f"'{old}'") if new else reason
        return reason

    def restore_plan(self, plan: Plan) -> Plan:
        """A plan for this text whose account and reasons speak as the original does."""
        if isinstance(plan, Refusal):
            return plan.model_copy(update={"reason": self.restore_words(plan.reason)})
        return plan.model_copy(update={"said": tuple(map(self.restore_span, plan.said))})


def replace_pieces(
    text: str, replacements: Iterable[tuple[int, int, str]]
) -> tuple[str, tuple[tuple[int, int, int, int], ...]]:
    """The text with other words from start to end of each replacement, and its `pieces`."""
    out, pieces, at = "", [], 0
    for start, end, words in replacements:
        out += text[at:start]
        pieces.append((len(out), len(out) + len(words), start, end))
        out += words
        at = end
    return out + text[at:], tuple(pieces)
