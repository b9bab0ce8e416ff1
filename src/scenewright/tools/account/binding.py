"""Which agents the mentions of a text stand for: the binding under which most words hold."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import combinations

from scenewright.tools.account.claims import BACKGROUND, Binding, Bound, Claim, Result
from scenewright.tools.account.facts import SceneFacts
from scenewright.tools.account.mentions import Mention

BEAM = 40
"""Bindings that are kept while mentions are bound one after the other."""
MOST_CHOICES = 24
"""What a mention may stand for is tried up to so many choices."""
_WEIGHTS = {"event": 3.0, "class": 2.0, "side": 2.0, "moves": 0.1, "crosswalk": 0.2}
"""How much a claim counts, by its type; 1 for the others."""


def bind_mentions(
    mentions: Sequence[Mention], claims: Sequence[Claim], facts: SceneFacts
) -> tuple[Binding, list[Result]]:
    """The likeliest binding, and the result of each claim under it."""
    tester = _Tester(claims, facts)
    beam: list[dict[int, Bound]] = [{}]
    for index, mention in enumerate(mentions):
        grown = [
            {**b, index: bound}
            for b in beam
            for bound in _list_choices(mention, mentions, b, facts)
        ]
        grown.sort(key=lambda b: -tester.score(b, index))
        beam = grown[:BEAM]
    best = max(beam, key=lambda b: tester.score(b, len(mentions)))
    return best, [tester.test(n, best) for n in range(len(claims))]


class _Tester:
    """Tests claims under bindings, each once for what its mentions stand for."""

    def __init__(self, claims: Sequence[Claim], facts: SceneFacts) -> None:
        self._claims, self._facts = claims, facts
        self._known: dict[tuple[int, tuple[Bound | None, ...]], Result] = {}

    def test(self, n: int, binding: Binding) -> Result:
        claim = self._claims[n]
        key = n, tuple(binding.get(m) for m in claim.mentions)
        if key not in self._known:
            self._known[key] = claim.test(self._facts, binding)
        return self._known[key]

    def score(self, binding: Binding, last: int) -> float:
        """Words that hold less those that do not; of claims whose mentions are all bound."""
        best: dict[int, float] = {}
        for n, claim in enumerate(self._claims):
            if claim.mentions and max(claim.mentions) <= last:
                holds = self.test(n, binding).holds
                weight = _WEIGHTS.get(claim.type, 1.0)
                value = weight if holds else -weight if holds is False else 0.0
                for token in claim.tokens:
                    best[token] = max(best.get(token, -9.0), value)
        return sum(best.values())


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
    last = before.get(max(before, default=-1), frozenset())
    count = 0
    for bound in _list_sets(mention, facts):
        repeated = mention.new and any(
            bound & each - {BACKGROUND} and len(each) == 1 for each in taken
        )
        if repeated or (mention.other and bound == last and bound):
            continue
        yield bound
        count += 1
        if count >= MOST_CHOICES:
            break
    yield frozenset()


def _list_sets(mention: Mention, facts: SceneFacts) -> Iterator[Bound]:
    if mention.object:
        ids = [o.id for o in facts.scene.objects if o.kind != "door"]
        for size in (1,) if mention.count == 1 else (2, 3, 1):
            yield from (frozenset(each) for each in combinations(ids, size))
    agents = [
        n for n in facts.foreground if mention.pronoun or facts.fits_class(n, mention.classes)
    ] or list(facts.foreground)  # of another class: what else is said of it can still be tested
    if mention.count == 1:
        yield from (frozenset({n}) for n in agents)
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
