"""Which agents the mentions of a text stand for: the binding under which most words hold."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import combinations, islice
from typing import NamedTuple

from scenewright.tools.account.claims import BACKGROUND, Binding, Bound, Claim, Result
from scenewright.tools.account.facts import SceneFacts
from scenewright.tools.account.mentions import Mention

BEAM = 40
"""Bindings that are kept while mentions are bound one after the other."""
MOST_CHOICES = 24
"""What a mention may stand for is tried up to so many choices."""
_WEIGHTS = {"event": 30, "class": 20, "side": 20, "moves": 1, "crosswalk": 2}
"""How much a claim counts, by its type; 10 for the others."""


class _Candidate(NamedTuple):
    """What mentions so far are bound to, and the best of the claims of each token."""

    binding: Binding
    scores: Mapping[int, int]
    total: int


def bind_mentions(
    mentions: Sequence[Mention], claims: Sequence[Claim], facts: SceneFacts
) -> tuple[Binding, list[Result]]:
    """The likeliest binding, and the result of each claim under it."""
    tester = _Tester(claims, facts)
    beam = [_Candidate({}, {}, 0)]
    for index, mention in enumerate(mentions):
        grown = [
            tester.extend(candidate, index, bound)
            for candidate in beam
            for bound in _list_choices(mention, mentions, candidate.binding, facts)
        ]
        beam = sorted(grown, key=lambda each: -each.total)[:BEAM]
    best = beam[0].binding
    return best, [tester.test(n, best) for n in range(len(claims))]


class _Tester:
    """Tests claims under bindings, each once for what its mentions stand for."""

    def __init__(self, claims: Sequence[Claim], facts: SceneFacts) -> None:
        self._claims, self._facts = claims, facts
        self._known: dict[tuple[int, tuple[Bound | None, ...]], Result] = {}
        self._by_last: dict[int, list[int]] = {}
        for n, claim in enumerate(claims):
            if claim.mentions:
                self._by_last.setdefault(max(claim.mentions), []).append(n)

    def test(self, n: int, binding: Binding) -> Result:
        claim = self._claims[n]
        key = n, tuple(binding.get(m) for m in claim.mentions)
        if key not in self._known:
            self._known[key] = claim.test(self._facts, binding)
        return self._known[key]

    def extend(self, candidate: _Candidate, mention: int, bound: Bound) -> _Candidate:
        """With one more mention bound: words that hold less those that do not."""
        binding = {**candidate.binding, mention: bound}
        scores = dict(candidate.scores)
        for n in self._by_last.get(mention, ()):
            holds = self.test(n, binding).holds
            weight = _WEIGHTS.get(self._claims[n].type, 10)
            value = weight if holds else -weight if holds is False else 0
            for token in self._claims[n].tokens:
                scores[token] = max(scores.get(token, -90), value)
        return _Candidate(binding, scores, sum(scores.values()))


def _list_choices(
    mention: Mention, mentions: Sequence[Mention], before: Binding, facts: SceneFacts
) -> Iterator[Bound]:
    """What a mention may stand for, with regard to those before it."""
    if mention.absent or mention.background:
        yield frozenset()
        return
    taken = [before[k] for k in before if mentions[k].new and not mentions[k].pronoun]
    same_name = [before[k] for k in before if mention.label and mentions[k].label == mention.label]
    if mention.first_person:
        same_name += [before[k] for k in before if mentions[k].first_person]
    if same_name and same_name[0]:
        yield same_name[0]
        return
    last = before.get(max(before, default=-1), frozenset()) if mention.other else frozenset()
    alone = {n for each in taken if len(each) == 1 for n in each} - {BACKGROUND}
    fitting = (
        bound
        for bound in _list_sets(mention, facts)
        if not (mention.new and bound & alone) and not (bound and bound == last)
    )
    choices = list(islice(fitting, MOST_CHOICES))
    yield from choices
    if not (mention.first_person and choices):  # the narrator is always there
        yield frozenset()


def _list_sets(mention: Mention, facts: SceneFacts) -> Iterator[Bound]:
    if mention.object:
        ids = [o.id for o in facts.scene.objects if o.kind != "door"]
        for size in (1,) if mention.count == 1 else (2, 3, 1):
            yield from (frozenset(each) for each in combinations(ids, size))
    agents = [
        n
        for n in facts.foreground
        if (mention.pronoun and not mention.classes) or facts.fits_class(n, mention.classes)
    ] or list(facts.foreground)  # of another class: what else is said of it can still be tested
    if mention.count == 1:
        yield from (frozenset({n}) for n in agents)
        if mention.counted:
            yield frozenset({BACKGROUND})
        return
    if not mention.pronoun:
        yield frozenset({BACKGROUND})
    yield from (frozenset({n}) for n in agents if facts.count_members(n) > 1)
    if mention.count is not None:
        yield from (frozenset(each) for each in combinations(agents, mention.count))
        return
    for size in range(min(len(agents), 4), 1, -1):
        yield from (frozenset(each) for each in combinations(agents, size))
    if mention.pronoun or not mention.new:
        yield from (frozenset({n}) for n in agents)
