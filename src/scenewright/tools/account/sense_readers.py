"""Readers of claims: of mentions, of numbers, and one for each family of senses."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import takewhile

from scenewright.scene.kinds import has_trait
from scenewright.tools.account import claim_tests as tests
from scenewright.tools.account.claims import Claim, ClaimType, Test
from scenewright.tools.account.event_readers import read_event, read_order, read_sequence
from scenewright.tools.account.facts import SceneFacts
from scenewright.tools.account.mentions import Mention
from scenewright.tools.account.parties import PartyFinder
from scenewright.tools.account.vocabulary import WORDS, Token, is_label
from scenewright.tools.relation_checker.legs import find_relative_side

Reader = Callable[[PartyFinder, int, str], Iterable[Claim]]
"""Claims of the word at a token; with the value of its sense, such as `north` of `side.north`."""

_SLOWING = ("brak", "slow")
"""How words begin that say whether an agent slows down."""
_BRAKING = 1.0
"""How hard who brakes brakes at least [m/s²]."""
_HARD_BRAKING = 3.0
"""How hard who brakes hard brakes at least [m/s²]."""
_NO_BRAKING = 1.0
"""How hard who does not brake may slow at most [m/s²]."""
_CROSSING = 2.0
"""Who crosses gets at least this far [m]."""
_TIMES = {"once": 1, "twice": 2, "thrice": 3, "two": 2, "three": 3, "four": 4}
_FACTORS = {
    word: (unit, factor) for unit, words in WORDS["units"].items() for word, factor in words.items()
}


def read_claims(tokens: Sequence[Token], mentions: Sequence[Mention]) -> list[Claim]:
    """All claims of a text; one word may have several."""
    finder = PartyFinder(tokens, mentions)
    claims: list[Claim] = []
    for index in range(len(mentions)):
        claims += _read_mention(finder, index)
    for span in finder.events:
        claims += read_event(finder, span)
    nouns = {n for m in mentions for n in m.nouns}
    for n, token in enumerate(tokens):
        claims += _read_time(tokens, n)
        if _read_minutes(tokens, n + 2) is not None:
            continue
        if token.number is not None and n not in nouns and _read_minutes(tokens, n) is None:
            claims += _read_number(finder, n, token.number)
        for sense in token.senses:
            family, _, value = sense.partition(".")
            stop = token.senses[sense][1]
            after = tokens[stop : stop + 1]
            if family in ("from_left", "from_right") and after and after[0].stem == "turn":
                claims += _read_movement(family.removeprefix("from_"))(finder, n, value)
                continue  # "on its left turn"
            if family.startswith("from_"):
                claims += _read_point(finder, n, value)  # "hits it on its left side"
            if reader := _READERS.get(family):
                claims += reader(finder, n, value)
    for kind, start, stop in dict.fromkeys(token.phrase for token in tokens if token.phrase):
        subjects, objects = finder.find_parties(start, stop)
        event = tests.EventTest(kind, subjects, objects, directed=False, denied=False)
        words = tuple(range(start, stop))
        claims.append(Claim("phrase", kind, words, (*subjects, *objects), event))
    return claims


def _read_time(tokens: Sequence[Token], n: int) -> Iterator[Claim]:
    """A clock time or a word of the time of day, with the minutes before it."""
    token, minutes = tokens[n], _read_minutes(tokens, n)
    if minutes is None and token.kind != "clock" and not token.has("time"):
        return
    if minutes is not None and token.kind != "clock":
        token = replace(token, kind="clock", text=f"{token.number:g}")
    denied = any(each.text in ("not", "never") for each in tokens[max(0, n - 3) : n])
    test = tests.TimeTest(token, denied, _find_range(tokens, n), minutes or 0.0)
    for k in (n,) if minutes is None else (n, n - 2):
        yield Claim("time", tokens[n].text, (k,), (), test)


def _find_range(tokens: Sequence[Token], n: int) -> Token | None:
    """The other end of a span of time: "between 5 and 7 pm", "5 pm to 7 pm"."""
    for other, link in ((n - 2, n - 1), (n + 2, n + 1)):
        if not 0 <= other < len(tokens) or tokens[link].text not in ("and", "to", "until", "till"):
            continue
        if tokens[other].kind == "clock" or tokens[other].text.isdecimal():
            return tokens[other]
    return None


def _read_minutes(tokens: Sequence[Token], n: int) -> float | None:
    """Minutes from an hour to the time said, "half past 11 pm", "ten to five"; None if no such."""
    if not 2 <= n < len(tokens) or tokens[n - 1].text not in ("past", "after", "to"):
        return None
    minutes = {"half": 30.0, "quarter": 15.0}.get(tokens[n - 2].text, tokens[n - 2].number or 0.0)
    hour = tokens[n]
    is_hour = hour.kind == "clock" or (hour.number in range(1, 13) and hour.unit is None)
    if minutes not in range(1, 60) or not is_hour or tokens[n - 2].unit is not None:
        return None
    counts = n + 1 < len(tokens) and tokens[n + 1].has("noun")  # "five to six cars"
    return None if counts else -minutes if tokens[n - 1].text == "to" else minutes


# --- mentions and numbers


def _read_mention(finder: PartyFinder, index: int) -> Iterator[Claim]:
    """Class, count and object of a mention."""
    mention, tokens = finder.mentions[index], finder.tokens
    if mention.pronoun:
        if number := tokens[mention.head].number:  # "the two of them", "both"
            many = tests.CountTest(index, mention.classes, int(number))
            yield Claim("count", f"{number:g}", (mention.head,), (index,), many)
        return
    if mention.absent or mention.background:
        yield _read_others(finder, mention)
        return
    value = "/".join(sorted(mention.classes)) or "object"
    nouns = mention.nouns or (mention.head,)
    together = any(tokens[n].has("group") and not tokens[n].text.endswith("s") for n in nouns)
    test = tests.ClassTest(index, mention.classes, together)
    yield Claim("class", value, nouns, (index,), test)
    counted = tuple(
        n
        for n in range(mention.start, mention.stop)
        if n not in mention.nouns
        and (tokens[n].number is not None or tokens[n].has("group", "number_word"))
    )
    if counted:
        count = tests.CountTest(index, mention.classes, mention.count)
        yield Claim("count", str(mention.count or "several"), counted, (index,), count)
    be = mention.stop < len(tokens) and tokens[mention.stop].is_in("be")  # "a van is parked"
    words = range(mention.start, min(len(tokens), mention.stop + 1 + be))
    kind = next((k for n in words for k in tokens[n].list_values("object")), None)
    if kind is not None:
        spans = [tokens[n].senses.get(f"object.{kind}", (0, 0)) for n in words]
        span = tuple(sorted({n for each in spans for n in range(*each)}))  # "at its stop"
        yield Claim(
            "object",
            kind,
            span,
            (index,),
            tests.ObjectTest(index, kind, mention.classes, several=mention.count is None),
        )


def _read_others(finder: PartyFinder, mention: Mention) -> Claim:
    """Those around that a mention counts, or says that there are none of."""
    start = mention.start
    if mention.absent and start and finder.tokens[start].text not in ("no", "zero", "without"):
        start -= 1
    count = 0 if mention.absent else mention.count
    kind = "/".join(sorted(mention.classes - {"any"})) or "others"
    return Claim(
        "background",
        f"{'some' if count is None else count} {kind}",
        tuple(range(start, mention.stop)),
        (),
        tests.BackgroundTest(
            mention.classes, count, mention.absent and not (mention.background or mention.other)
        ),
    )


def _read_number(finder: PartyFinder, n: int, number: float) -> Iterator[Claim]:
    tokens = finder.tokens
    said = tokens[n].unit or next(
        (token.text for token in tokens[n + 1 : n + 3] if token.text in _FACTORS), None
    )
    if said is not None:
        if any(token.text in ("limit", "zone") for token in tokens[max(0, n - 5) : n + 4]):
            return  # a posted limit is of the place
        unit, factor = _FACTORS.get(said, (said, 1.0))
        value = number * factor
        subjects = finder.find_subjects(n)
        stands = unit == "s" and any(token.has("stop") for token in tokens[max(0, n - 3) : n])
        test = tests.NumberTest(subjects, unit, value, stands, _find_bound(tokens, n))
        yield Claim("number", f"{value:.3g} {unit}", (n,), subjects, test)
    elif any(m.start <= n < m.stop for m in finder.mentions):
        return
    elif span := next((s for s in finder.events if 0 < s[0] - n <= 2), None):  # "two near misses"
        kinds = tokens[span[0]].list_values("event")
        yield Claim("count", f"{number:g} {'/'.join(kinds)}", (n,), (),
                    tests.EventCountTest(kinds, number))  # fmt: skip
    elif not is_label(tokens, n):
        yield Claim("number", f"{number:g}", (n,), (), tests.BareNumberTest(number))


def _find_bound(tokens: Sequence[Token], n: int) -> str | None:
    """Whether a number is the `least` or the `most` of a figure: "under 1 s", "no more than 1"."""
    for k in range(n - 1, max(-1, n - 4), -1):
        if tokens[k].kind in ("end", "comma") or tokens[k].number is not None:
            return None  # "between 1 and 2 s"
        most = tokens[k].is_in("bounds_most")
        if most or tokens[k].is_in("bounds_least"):
            denied = k > 0 and tokens[k - 1].is_in("negations")
            return "most" if most != denied else "least"
    return None


# --- what is said of all agents of a mention


def _claim_all(
    finder: PartyFinder,
    n: int,
    claim: tuple[ClaimType, str, str],
    holds: Callable[[SceneFacts, int], bool],
    kinds: str = "any",
) -> Iterator[Claim]:
    """A claim that something holds of all agents of the mention that a word is said of.

    Args:
        claim: its type, its value, and what the evidence calls it.
    """
    kind, value, what = claim
    subjects = finder.find_subjects(n, kinds)
    yield Claim(kind, value, (n,), subjects, tests.AllAgents(subjects, what, holds))


def _read_side(finder: PartyFinder, n: int, side: str) -> Iterator[Claim]:
    """A leg: of a crosswalk, to leave by, to come from, or either."""
    tokens = finder.tokens
    crosswalk = _is_of_crosswalk(tokens, n)
    marked = any(token.has("crosswalk") for token in tokens[n + 1 : n + 3])
    said = next(
        (t for t in reversed(tokens[max(0, n - 4) : n]) if t.has("noun") or t.is_in("to", "from")),
        None,
    )  # "waits for a car from the west": "for" is said of the car
    source = (said is not None and said.is_in("from")) or _begins_pair(tokens, n)
    ends_pair = n > 0 and tokens[n - 1].has("side") and tokens[n].start - tokens[n - 1].end == 1
    to = (ends_pair or (said is not None and said.is_in("to"))) and not source  # "S-N"
    turned = _is_turn_told(tokens, n)
    heads = any(token.has("motion_verb") for token in tokens[max(0, n - 2) : n])
    over = any(token.text in ("over", "across", "through") for token in tokens[max(0, n - 3) : n])

    def holds(facts: SceneFacts, number: int) -> bool:
        agent = facts.agents[number]
        if crosswalk and over and agent.type == "vehicle":
            return side in (agent.entry, agent.exit)
        if crosswalk:
            return agent.crosswalk == side and (not marked or agent.movement != "jaywalking")
        if to:
            walks_over = _is_opposite(agent.entry, side) and agent.type == "pedestrian"
            return agent.exit == side or walks_over
        if source:
            return agent.entry == side
        if heads:
            along = _is_opposite(agent.entry, side) or (turned and agent.exit == side)
            return along or agent.crosswalk == side  # "crosses north"
        if agent.type == "vehicle":
            return agent.entry == side or (turned and agent.exit == side)
        return side in (agent.entry, agent.exit, agent.crosswalk)

    subjects = finder.find_subjects(n)
    if crosswalk:  # "steps out in front of a car on the north crosswalk"
        subjects = tuple(dict.fromkeys((*subjects, *finder.list_walkers_before(n))))
    yield Claim("side", side, (n,), subjects, tests.AllAgents(subjects, side, holds, leg=side))


def _read_road(finder: PartyFinder, n: int, legs: str) -> Iterator[Claim]:
    """A street: to leave by, to come from or to be on; none at a corner or of another."""
    before = finder.tokens[max(0, n - 3) : n]
    said = next(
        (t for t in reversed(before) if t.has("noun", "cross") or t.is_in("to", "from", "along")),
        None,
    )
    corner = any(
        token.text in ("and", "with", "of", "at", "cross", "across") for token in before[-1:]
    )
    if said is None or corner or said.has("noun", "cross") or said.text in ("of", "for"):
        return
    to, source = (said.is_in(each) for each in ("to", "from"))

    def holds(facts: SceneFacts, number: int) -> bool:
        agent = facts.agents[number]
        ways = {agent.exit} if to else {agent.entry} if source else {agent.entry, agent.exit}
        return not ways.isdisjoint(legs.split("|")) or agent.crosswalk in legs.split("|")

    yield from _claim_all(finder, n, ("side", legs, finder.tokens[n].text), holds)


def _is_opposite(entry: str, side: str) -> bool:
    return find_relative_side(entry, seen_from=side) == "opposite"


def _is_of_crosswalk(tokens: Sequence[Token], n: int) -> bool:
    """Whether a side says which crosswalk: "the east crosswalk", "crosses the east leg"."""
    after = [*takewhile(lambda each: each.kind == "word", tokens[n + 1 : n + 3])]
    if any(token.has("crosswalk") for token in after):  # not "from the east, crossing"
        return True
    k = n - 1
    while k > 0 and tokens[k].text in ("on", "of", "at", "the", "in", ":", "="):
        k -= 1
    if n > 0 and tokens[k].has("crosswalk") and not tokens[k].text.startswith("crossi"):
        return True
    crosses = any(t.stem == "cros" or t.text == "across" for t in tokens[max(0, n - 3) : n])
    return crosses and any(token.is_in("legs") for token in tokens[n + 1 : n + 3])


def _begins_pair(tokens: Sequence[Token], n: int) -> bool:
    """Whether a side is the first of two: "north to south", "north-south"."""
    after = tokens[n + 1 : n + 3]
    if any(token.text in ("to", "->", "→", ">", "=>") for token in after):
        return True
    return any(token.has("side") for token in after) and tokens[n].end + 1 >= after[0].start


def _is_turn_told(tokens: Sequence[Token], n: int) -> bool:
    """Whether a turn is told of before a word, in its sentence."""
    return any(
        token.has("left", "right", "turn") and token.sentence == tokens[n].sentence
        for token in tokens[:n]
    )


def _read_bound(finder: PartyFinder, n: int, side: str) -> Iterator[Claim]:
    turned = _is_turn_told(finder.tokens, n)

    def holds(facts: SceneFacts, number: int) -> bool:
        agent = facts.agents[number]
        return _is_opposite(agent.entry, side) or (turned and agent.exit == side)

    yield from _claim_all(finder, n, ("heading", side, f"{side}bound"), holds)


def _read_movement(*movements: str, kinds: str = "vehicle") -> Reader:
    def read(finder: PartyFinder, n: int, _value: str) -> Iterator[Claim]:
        if n and finder.tokens[n - 1].has("light"):
            return  # "the light turns red"

        def holds(facts: SceneFacts, number: int) -> bool:
            own = facts.agents[number].movement
            turns = own in ("left", "right", "uturn")
            return own in movements and (
                not turns or abs(facts.compute_turn(number)) >= tests.LEAST_TURN
            )

        value = "/".join(movements)
        yield from _claim_all(finder, n, ("movement", value, value), holds, kinds)

    return read


def _read_hand(hand: str) -> Reader:
    """Left or right: of another road user ("on its left"), else a turn."""

    def read(finder: PartyFinder, n: int, value: str) -> Iterable[Claim]:
        after = finder.tokens[n + 1 : n + 3]
        if len(after) == 2 and after[0].is_in("body_parts") and after[1].text == "of":
            return ()  # "the right side of a van"
        before = finder.tokens[max(0, n - 3) : n]
        if any(token.has("reaction") for token in before):
            return ()  # "swerves left": nothing measures to which side
        whose = before and (
            before[-1].text.endswith("'s")
            or (
                before[-1].is_in("possessive")
                and any(token.text in ("from", "on", "to", "at") for token in before[:-1])
            )
        )
        if after and after[0].stem == "hook":  # "is right-hooked by a van"
            parties = finder.find_parties(n, n + 2)
            subjects = parties[finder.is_passive(n + 1, n + 2)]
            test = tests.AllAgents(subjects, hand, lambda f, a: f.agents[a].movement == hand)
            return (Claim("movement", hand, (n,), subjects, test),)
        turns = any(token.stem == "turn" for token in before)  # "turning to the right side"
        read_claims_of = _read_tie if whose and not turns else _read_movement
        return read_claims_of(hand)(finder, n, value)

    return read


def _read_cross(finder: PartyFinder, n: int, _value: str) -> Iterator[Claim]:
    ways = ("crossing", "jaywalking", "straight", "left", "right")

    def holds(facts: SceneFacts, number: int) -> bool:
        agent = facts.agents[number]
        way = math.dist(agent.trajectory[0], agent.trajectory[-1])
        return agent.movement in ways and way >= _CROSSING

    yield from _claim_all(finder, n, ("crossing", "crosses", "crosses"), holds)


def _read_red(finder: PartyFinder, n: int, _value: str) -> Iterator[Claim]:
    lights = any(token.has("light") for token in finder.tokens[:n])
    if finder.tokens[finder.tokens[n].senses["red"][1] - 1].text == "it" and not lights:
        return  # "a car runs it over"
    denied = finder.is_denied(n)
    value, what = ("no run", "no red light run") if denied else ("run", "a red light run")
    yield from _claim_all(
        finder, n, ("red_light", value, what),
        lambda facts, number: (number in facts.red_runners) != denied,
    )  # fmt: skip


def _read_light(finder: PartyFinder, n: int, _value: str) -> Iterator[Claim]:
    """Claim that the place has lights, that one waits at red, or passes on green."""
    start, stop = finder.tokens[n].senses["light"]
    if any(m.start <= n < m.head for m in finder.mentions):
        return  # "a green car"
    if any(token.text == "green" for token in finder.tokens[max(0, n - 1) : n + 1]):
        yield from _claim_all(
            finder, n, ("red_light", "no run", "a green light"),
            lambda facts, number: number not in facts.red_runners and bool(facts.scene.signals),
        )  # fmt: skip
    elif any(token.text == "red" for token in finder.tokens[start:stop]) and any(
        token.has("stop") for token in finder.tokens[max(0, start - 5) : start]
    ):  # "waiting at the red light"
        yield from _claim_all(
            finder, n, ("stop", "waits at a red light", "stands before a red light"),
            lambda facts, number: facts.waits_at_red(number),
        )  # fmt: skip
    else:
        yield Claim("light", "lights", (n,), (), tests.check_lights)


def _read_stop(finder: PartyFinder, n: int, _value: str) -> Iterator[Claim]:
    denied, stop = finder.is_denied(n), finder.tokens[n].is_in("standstill")
    hit = any(s < n and finder.tokens[s].has("event.collision") for s, _ in finder.events)

    def holds(facts: SceneFacts, number: int) -> bool:
        slows = any(e.type == "yielding" and facts.has_role(e, number) for e in facts.events)
        stands = facts.stands(number) >= tests.LEAST_STANDSTILL or (slows and not stop)
        # the motion of those who collide ends there, also of who could not stop
        ends = any(e.type == "collision" and number in (e.from_, e.to) for e in facts.events)
        ends |= any(
            encounter.agent == number and tests.makes_true("encounter", encounter.how, "collision")
            for encounter in facts.scene.encounters
        )
        return stands != denied or (ends and (hit or denied))

    value = "does not stop" if denied else "stops"
    yield from _claim_all(finder, n, ("stop", value, "stands"), holds)


def _read_times(finder: PartyFinder, n: int, _value: str) -> Iterator[Claim]:
    """Claim how often an agent stands: "stops twice"."""
    start, stop = finder.tokens[n].senses["times"]
    times = _TIMES.get(finder.tokens[start].text)
    if times and any(token.has("stop") for token in finder.tokens[max(0, start - 3) : start]):
        subjects = finder.find_subjects(start)
        test = tests.StandstillCountTest(subjects, times)
        yield Claim("count", f"{times} standstills", tuple(range(start, stop)), subjects, test)


def _read_brake(finder: PartyFinder, n: int, _value: str) -> Iterator[Claim]:
    if any(m.start <= n < m.head for m in finder.mentions):
        return  # "a slow van"
    denied = finder.is_denied(n)
    hard = any(token.is_in("hard") for token in finder.tokens[max(0, n - 2) : n + 3])

    def holds(facts: SceneFacts, number: int) -> bool:
        braking = facts.compute_braking(number)
        if denied:
            return facts.agents[number].reaction == "none" or braking < _NO_BRAKING
        return braking >= (_HARD_BRAKING if hard else _BRAKING)

    value, what = ("no braking", "no braking") if denied else ("brakes", "braking")
    yield from _claim_all(finder, n, ("braking", value, what), holds)


def _read_pace(finder: PartyFinder, n: int, value: str) -> Iterator[Claim]:
    """Fast or slow: of the road user that the word describes or is said of."""
    if finder.is_denied(n):
        return
    start, stop = finder.tokens[n].senses[f"pace.{value}"]
    subjects = finder.find_subjects(start)
    yield Claim("pace", value, tuple(range(start, stop)), subjects, tests.PaceTest(subjects, value))


def _read_motion_verb(finder: PartyFinder, n: int, _value: str) -> Iterator[Claim]:
    if finder.tokens[n].stem == "pas" and any(0 < m.start - n <= 1 for m in finder.mentions):
        return  # "passes the bus" says more than that it moves
    yield from _claim_all(finder, n, ("moves", "moves", "moves"), lambda *_: True)


# --- what is said of two, of the scene, or of whichever agent


def _read_tie(*sides: str) -> Reader:
    def read(finder: PartyFinder, n: int, _value: str) -> Iterator[Claim]:
        start = min(start for start, _ in finder.tokens[n].senses.values())
        while start and (
            finder.tokens[start - 1].is_in("possessive", "beside")
            or finder.tokens[start - 1].text.endswith("'s")
        ):
            start -= 1  # of "from my left", who comes from there is named before "from"
        subjects = finder.find_subjects(start)
        if all(finder.mentions[i].start > n for i in subjects):  # "from the left of a car"
            before = [i for i, m in enumerate(finder.mentions) if m.head < start]
            subjects = (*before[:-4:-1], *subjects)
        yield Claim("tie", "/".join(sides), (n,), subjects, tests.TieTest(subjects, sides))
        if finder.tokens[n].text == "side":  # "is hit from the side"
            yield Claim("point", "side", (n,), (), tests.PointTest("side", ()))

    return read


def _read_paths_cross(finder: PartyFinder, n: int, _value: str) -> Iterator[Claim]:
    """Claim that the tracks of two road users named before the words cross."""
    named = tuple(i for i, m in enumerate(finder.mentions) if m.head < n and not m.pronoun)
    yield Claim("tie", "paths cross", (n,), named, tests.PathsCrossTest(named))


def _read_crosswalk(finder: PartyFinder, n: int, _value: str) -> Iterator[Claim]:
    if finder.is_denied(n):

        def holds(facts: SceneFacts, number: int) -> bool:
            own = facts.agents[number]
            return own.crosswalk is None or own.movement == "jaywalking"

        yield from _claim_all(finder, n, ("crosswalk", "none", "no crosswalk"), holds, "foot")
        return
    mentions = tuple(range(len(finder.mentions)))
    yield Claim("crosswalk", "a crosswalk", (n,), mentions, tests.check_crosswalk)


def _read_background(finder: PartyFinder, n: int, _value: str) -> Iterator[Claim]:
    near, after = finder.tokens[max(0, n - 3) : n + 1], finder.tokens[n + 1 : n + 2]
    denied = finder.is_denied(n) or any(token.is_in("nobody") for token in near)
    if finder.tokens[n].text in ("everyone", "everybody") and after and after[0].text != "else":
        return  # "everyone stops" says more than that there are others
    yield Claim("background", "none" if denied else "some", (n,), (), tests.OthersTest(denied))


def _read_density(_finder: PartyFinder, n: int, value: str) -> Iterator[Claim]:
    yield Claim("density", value, (n,), (), tests.DensityTest(value))


def _read_kind(_finder: PartyFinder, n: int, value: str) -> Iterator[Claim]:
    yield Claim("kind", value, (n,), (), tests.KindTest(value))


def _read_point(finder: PartyFinder, n: int, _value: str) -> Iterator[Claim]:
    word, around = finder.tokens[n].text, finder.tokens[max(0, n - 1) : n + 2]
    if word in ("left", "right") and not any(token.is_in("body_parts") for token in around):
        return  # a turn, or the side from which somebody comes
    of = next((k for k in range(n, min(n + 3, len(finder.tokens) - 1))
               if finder.tokens[k + 1].text == "of"), None)  # fmt: skip
    whose = tuple(i for i, m in enumerate(finder.mentions) if of is not None and m.start == of + 2)
    yield Claim("point", word, (n,), whose, tests.PointTest(word, whose))


def _read_scene(kind: ClaimType, value: str, test: Test) -> Reader:
    """A claim of the whole scene, whatever else is said."""

    def read(_finder: PartyFinder, n: int, _value: str) -> Iterator[Claim]:
        yield Claim(kind, value, (n,), (), test)

    return read


def _read_any(kind: ClaimType, find: Callable[[SceneFacts, str], Iterable[int]]) -> Reader:
    """A claim that an agent has a property which the checker proves; none where it is denied."""

    def read(finder: PartyFinder, n: int, value: str) -> Iterator[Claim]:
        start = min(start for start, _ in finder.tokens[n].senses.values())
        if (kind, value) == ("reaction", "none") and finder.tokens[n].text.startswith(_SLOWING):
            yield from _claim_all(  # "does not brake", "without braking"
                finder, n, ("braking", "no braking", "no braking"),
                lambda facts, number: facts.compute_braking(number) < _NO_BRAKING,
            )  # fmt: skip
        on_foot = has_trait(kind, value, "afoot")
        subjects = finder.find_subjects(start, "foot" if on_foot else "any")
        noun = any(token.is_in("possessive") for token in finder.tokens[max(0, start - 2) : start])
        if finder.is_denied(start) or (on_foot and (noun or not subjects)):
            return  # not "its run"
        what = value or kind
        yield Claim(kind, what, (n,), subjects, tests.ProvenProperty(subjects, what, value, find))

    return read


_READERS: Mapping[str, Reader] = {
    "side": _read_side,
    "road": _read_road,
    "bound": _read_bound,
    "left": _read_hand("left"),
    "right": _read_hand("right"),
    "straight": _read_movement("straight"),
    "uturn": _read_movement("uturn"),
    "turn": _read_movement("left", "right", "uturn"),
    "jaywalking": _read_movement("jaywalking", kinds="foot"),
    "cross": _read_cross,
    "crosswalk": _read_crosswalk,
    "exit_crosswalk": _read_scene("crosswalk", "on the exit leg", tests.LegCrosswalkTest("exit")),
    "entry_crosswalk": _read_scene(
        "crosswalk", "on the entry leg", tests.LegCrosswalkTest("entry")
    ),
    "opposite": _read_tie("opposite"),
    "lateral": _read_tie("left", "right"),
    "same": _read_tie("same"),
    "paths_cross": _read_paths_cross,
    "from_left": _read_tie("left"),
    "from_right": _read_tie("right"),
    "red": _read_red,
    "light": _read_light,
    "stop": _read_stop,
    "times": _read_times,
    "brake": _read_brake,
    "late_brake": _read_any("cause", tests.find_late_braking),
    "normal": _read_scene("absence", "nothing else", tests.check_nothing_else),
    "density": _read_density,
    "background": _read_background,
    "order": read_order,
    "sequence": read_sequence,
    "motion": _read_any("motion", tests.find_motion),
    "reaction": _read_any("reaction", tests.find_reaction),
    "manoeuvre": _read_any("manoeuvre", tests.find_manoeuvre),
    "overtakes": _read_any("manoeuvre", tests.find_overtaking),
    "meets": _read_any("encounter", tests.find_meeting),
    "sight": _read_any("sight", lambda facts, _: [sight.subject for sight in facts.scene.sights]),
    "group": _read_any(
        "group", lambda facts, _: [n for n in facts.foreground if facts.count_members(n) > 1]
    ),
    "point": _read_point,
    "kind": _read_kind,
    "centre": _read_scene("side", "centre", tests.check_centre),
    "pace": _read_pace,
    "close": _read_any("manoeuvre", tests.find_close_following),
    "priority": _read_scene("order", "priority", tests.check_priority),
    "motion_verb": _read_motion_verb,
}
"""By family of senses; `account.py` says which others stand, are manner, or are not shown."""
