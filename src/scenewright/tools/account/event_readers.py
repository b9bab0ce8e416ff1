"""Readers of events, and of what comes first, later or at the same time."""

from __future__ import annotations

from collections.abc import Iterator

from scenewright.tools.account.claim_tests import (
    LEAST_STANDSTILL,
    AllAgents,
    EventTest,
    OrderTest,
    OrdinalTest,
    RedRunOrderTest,
    SequenceTest,
)
from scenewright.tools.account.claims import Claim
from scenewright.tools.account.parties import PartyFinder, Span
from scenewright.tools.account.vocabulary import load_vocabulary


def read_event(finder: PartyFinder, span: Span) -> Iterator[Claim]:
    """The claims of the words of an event, one for each kind that they may mean."""
    start, stop = span
    word = finder.tokens[start]
    if word.text in ("let", "have") and finder.begins_sentence(start):
        return  # "let a car turn" asks for a car, not for a yield
    kinds = {
        sense.partition(".")[2]
        for sense, own in word.senses.items()
        if sense.startswith("event.") and own == span
    }
    subjects, objects = finder.find_parties(start, stop)
    leads = "follow" in kinds and any(t.is_in("leading") for t in finder.tokens[start:stop])
    if leads or finder.is_passive(start, stop):  # who is ahead is followed
        subjects, objects = objects, subjects
    before = finder.tokens[max(0, start - 4) : start]
    denied = finder.is_denied(start)
    if "yielding" in kinds and _is_for_a_light(finder, stop):
        test = AllAgents(subjects, "stands", lambda facts, n: facts.stands(n) >= LEAST_STANDSTILL)
        yield Claim("stop", "waits at a light", tuple(range(start, stop)), subjects, test)
        return
    stops = any(token.is_in("standstill") for token in finder.tokens[start:stop])
    almost = any(each.has("almost") for each in (*before, word))
    avoided = any(token.has("avoid") for token in before)
    if "cut_off" in kinds:
        kinds = kinds - {"cut_off"} | {"near_miss", "collision"}
    if "collision" in kinds and (almost or avoided):
        kinds.add("near_miss")
        if almost and not denied:
            kinds.discard("collision")
        denied = denied or avoided
    for kind in sorted(kinds):
        stands = stops and kind in ("yielding", "near_miss")
        strikes = kind == "collision" and not almost and _says_striker(finder, start, stop)
        directed = kind in ("yielding", "follow") or strikes
        yield Claim(
            "event",
            f"{'no ' if denied else ''}{kind}{' to a stop' if stands else ''}",
            tuple(range(start, stop)),
            tuple(dict.fromkeys((*subjects, *objects))),
            EventTest(kind, subjects, objects, directed, denied, stands),
        )


def _is_for_a_light(finder: PartyFinder, stop: int) -> bool:
    """Whether a light, and no road user, is what one waits for: "at red", "until it is green"."""
    rest = range(stop, len(finder.tokens))
    ends = (n for n in rest if finder.tokens[n].kind in ("comma", "end")
            or finder.tokens[n].text in ("while", "and", "then", "but"))  # fmt: skip
    last = next(ends, len(finder.tokens))
    users = any(stop <= m.head < last and not m.pronoun for m in finder.mentions)
    return not users and any(token.has("light") for token in finder.tokens[stop:last])


def _says_striker(finder: PartyFinder, start: int, stop: int) -> bool:
    """Whether a verb says which agent strikes: "hits", "runs into"; not "collides with"."""
    word = finder.tokens[start]
    if word.text.endswith("ing") and word.stem == "crash":
        return False
    if any(token.text in ("into", "over", "down") for token in finder.tokens[start : stop + 1]):
        return True
    direct = word.stem in load_vocabulary().lists["striking_stems"]
    follow = finder.tokens[stop].text if stop < len(finder.tokens) else None
    return direct and follow not in ("with", "each", "one", "and")


def read_sequence(finder: PartyFinder, n: int, value: str) -> Iterator[Claim]:
    """Two events in time: one after another, or at the same time."""
    before = [span for span in finder.events if span[0] < n]
    after = [span for span in finder.events if span[0] > n]
    red = next((k for k in range(n, len(finder.tokens)) if finder.tokens[k].has("red")), None)
    if before and not after and red is not None and value in ("then", "after"):
        claims = tuple(read_event(finder, before[-1]))
        subjects = finder.find_subjects(red)
        test = RedRunOrderTest(claims, subjects, value == "then")
        yield Claim("sequence", value, (n,), (*claims[0].mentions, *subjects), test)
        return
    if not after or (not before and len(after) < 2):
        return
    spans = (before[-1], after[0]) if before else (after[0], after[1])
    one, two = (
        tuple(c for c in read_event(finder, span) if not c.value.startswith("no "))
        for span in spans
    )
    used = tuple(dict.fromkeys(m for c in (*one, *two) for m in c.mentions))
    if (value == "after") == bool(before):  # "A after B"; "before A, B" and "while A, B"
        one, two = two, one
    loosely = finder.tokens[n].text in ("as", "when")
    yield Claim("sequence", value, (n,), used, SequenceTest(one, two, value == "while", loosely))


def read_order(finder: PartyFinder, n: int, _value: str) -> Iterator[Claim]:
    """Who passes first, or last."""
    token = finder.tokens[n]
    for index, m in enumerate(finder.mentions):
        if m.start <= n <= m.head or (m.head == n + 1 and finder.tokens[n + 1].text == "one"):
            # "the second car" and "the last one" are mentions of their own
            yield Claim("count", token.text, (n,), (index,), OrdinalTest(token.text, index))
            return
    starts = [start for start, _ in finder.events]
    if token.has("sequence") and any(s < n for s in starts) and any(s > n for s in starts):
        return
    if token.text in ("first", "last", "second") and (
        finder.begins_sentence(n) or finder.tokens[n - 1].kind == "comma"
    ):
        return
    subjects, objects = finder.find_parties(n, n + 1)
    verb = token.senses["order"][0]
    if verb < n or finder.tokens[verb].text in ("goes", "gets", "go", "passes"):
        subjects = finder.find_subjects(verb)[-1:]  # "follows a truck and goes first"
    if token.is_in("order_of_two") and not any(
        0 < finder.mentions[m].start - n <= 4 for m in objects
    ):
        return
    others = (*objects, *range(len(finder.mentions)))
    late = token.is_in("order_late")
    test = OrderTest(subjects, others, late)
    used = tuple(dict.fromkeys((*subjects, *others)))
    yield Claim("order", "second" if late else "first", (n,), used, test)
