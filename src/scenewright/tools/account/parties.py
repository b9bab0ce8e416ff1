"""Whom the words of a text are said of."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

from scenewright.tools.account.mentions import Mention
from scenewright.tools.account.vocabulary import Token

Span = tuple[int, int]
"""First and last token (exclusive)."""


class PartyFinder:
    """Finds the mentions that words of one text may be said of.

    Attributes:
        events: the words of events, in order.
    """

    def __init__(self, tokens: Sequence[Token], mentions: Sequence[Mention]) -> None:
        self.tokens, self.mentions = tokens, mentions
        self.events: list[Span] = sorted(
            {
                span
                for each in tokens
                for sense, span in each.senses.items()
                if sense.startswith("event.")
            }
        )

    def find_subjects(self, n: int, kinds: str = "any") -> tuple[int, ...]:
        """Mentions that the word at n may be said of, the likeliest first.

        Args:
            kinds: `vehicle` or `foot` where only those can be meant.
        """
        for index, m in enumerate(self.mentions):
            if m.start <= n < m.head and not m.pronoun:
                return (index,)
        fitting = [i for i, m in enumerate(self.mentions) if _may_be(m, kinds)]
        for k in range(n + 1, min(n + 4, len(self.tokens))):  # "the U-turn of a truck"
            of = [i for i in fitting if self.mentions[i].start == k + 1]
            if of and self.tokens[k].text == "of" and not self.tokens[k].senses:
                return (of[0],)
        before = [i for i in fitting if self.mentions[i].head < n]
        here = [i for i in before if self._is_in_sentence(i, n)]
        if not here:
            ahead = [
                i for i in fitting if self.mentions[i].start > n and self._is_in_sentence(i, n)
            ]
            return (*ahead[:2], *before[-2:]) or tuple(fitting[:2])
        near = self.tokens[max(0, n - 3) : n + 1]
        participle = any(
            one.text in ("after", "before", "by", "when") and two.text.endswith("ing")
            for one, two in pairwise(near)
        )
        nearest = here[-1]
        stop = self.mentions[nearest].stop
        relative = any(token.is_in("relative") for token in self.tokens[stop : stop + 2])
        denied = n and self.tokens[n - 1].text in ("without", "while", "not")
        if participle or (denied and not relative):
            return (here[0],)  # what the first one does, or not: "hits a van without braking"
        done_to = self._is_object(nearest)
        hides = done_to and self.mentions[nearest].object  # "behind a parked truck enters"
        if not hides and (relative or n == stop or (
            not self._has_break(stop, n) and (not done_to or self._describes(nearest, n))
        )):  # fmt: skip
            return (nearest,)
        # "a bus from the west, from the south a car": another part of the sentence begins here
        ahead = [i for i in fitting if self._opens_part(i, n)] if self._has_break(stop, n) else []
        return tuple(dict.fromkeys((*ahead, nearest, *reversed(here))))

    def list_walkers_before(self, n: int) -> tuple[int, ...]:
        """Pedestrians and riders told of before a word in its sentence, the last one first."""
        before = (i for i, m in enumerate(self.mentions) if m.head < n and _may_be(m, "foot"))
        return tuple(i for i in before if self._is_in_sentence(i, n))[::-1]

    def find_parties(self, start: int, stop: int) -> tuple[tuple[int, ...], tuple[int, ...]]:
        """Mentions that may do what the words of an event say, and those that it may be done to."""
        told = [i for i, m in enumerate(self.mentions) if not (m.absent or m.background)]
        before = [i for i in told if self.mentions[i].head < start]
        after = [
            i for i in told if self.mentions[i].start >= stop and self._is_in_sentence(i, start)
        ]
        subjects = [i for i in before if self._is_in_sentence(i, start)] or before
        if subjects:
            nearest = subjects[-1]
            if self._is_object(nearest) or self._has_break(self.mentions[nearest].stop, start):
                subjects = subjects[::-1]
            else:
                subjects = [nearest]
        objects = after[:1]
        if not after or self._has_break(stop, self.mentions[after[0]].start):
            # what comes next begins a clause of its own: those told of before may be meant
            others = [i for i in reversed(before) if i not in subjects[:1]]
            objects = [*after[:2], *others[:3]]
        if not subjects and len(after) > 1:
            subjects = after[:2]
        return tuple(subjects), tuple(objects)

    def begins_sentence(self, n: int) -> bool:
        """Whether a token is the first of its sentence."""
        return n == 0 or self.tokens[n - 1].sentence != self.tokens[n].sentence

    def is_denied(self, start: int) -> bool:
        """Whether a negation stands before a word, in its part of the sentence.

        It belongs to the first verb after it: who "could not stop hits a van", and who "isn't in a
        hurry waits".
        """
        for n in range(start - 1, max(-1, start - 6), -1):
            each = self.tokens[n]
            if each.kind in ("end", "comma") or each.text in ("and", "but", "then"):
                return False
            if each.negates:
                return not each.is_in("be_not") or start - n <= 2
            if each.has("stop", "brake"):
                return False
        return False

    def is_passive(self, start: int, stop: int) -> bool:
        """Whether a verb says what is done to its subject: "is hit", "struck by"."""
        word = self.tokens[start]
        if stop - start > 1 and self.tokens[stop - 1].text.endswith("ed"):  # "rear-ended"
            word = self.tokens[stop - 1]
        if not (word.text.endswith(("ed", "en")) or word.is_in("past")):
            return False
        by = any(token.text == "by" for token in self.tokens[stop : stop + 3])
        be = any(token.is_in("be") for token in self.tokens[max(0, start - 3) : start])
        into = any(token.text == "into" for token in self.tokens[start : stop + 1])
        # who "is pushed into a van" strikes it
        return by or (be and not into and word.text not in ("stopped", "yielded"))

    def _is_in_sentence(self, index: int, n: int) -> bool:
        return self.tokens[self.mentions[index].head].sentence == self.tokens[n].sentence

    def _has_break(self, start: int, stop: int) -> bool:
        return any(
            token.kind == "comma" or token.is_in("breaks") for token in self.tokens[start:stop]
        )

    def _opens_part(self, index: int, n: int) -> bool:
        """Whether a mention follows a word in its own part of the sentence."""
        start = self.mentions[index].start
        return n < start and self._is_in_sentence(index, n) and not self._has_break(n, start)

    def _describes(self, index: int, n: int) -> bool:
        """Whether words follow their mention at once: "a man from the west", "a car turning"."""
        between = self.tokens[self.mentions[index].stop : n]
        return not any(token.has("event") for token in between)

    def _is_object(self, index: int) -> bool:
        """Whether a mention is what something is done to."""
        start = self.mentions[index].start
        if start and self.tokens[start - 1].is_in("prepositions"):
            return True
        return any(
            stop <= start and start - stop <= 2 and not self._has_break(stop, start)
            for _, stop in self.events
        )


def _may_be(mention: Mention, kinds: str) -> bool:
    if mention.absent or mention.background:
        return False
    if kinds == "any" or mention.pronoun or "any" in mention.classes:
        return True
    foot = mention.classes <= {"pedestrian"}
    return foot == (kinds == "foot") or bool(mention.classes & {"cyclist", "scooter", "rider"})
