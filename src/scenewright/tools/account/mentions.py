"""Road users, objects and pronouns that a text mentions."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise

from scenewright.scene.track import VEHICLE_SIZES
from scenewright.tools.account.vocabulary import Token, is_label

_VEHICLES = frozenset({"vehicle", *VEHICLE_SIZES})
_RIDERS = frozenset({"cyclist", "scooter", "rider"})
_CYCLES = ("cycl", "pedal")
"""Verbs, as they are reduced, of who rides a bicycle."""
_NAMED = re.compile(r"([vpu])(\d\d?)")


@dataclass(frozen=True)
class Mention:
    """Words that stand for one or several road users or a standing object.

    Attributes:
        head: index of its noun or pronoun; start, stop: its words, from article to noun.
        classes: classes or subtypes that the noun allows; empty for a pronoun, unless it is one of
            persons ("she") where somebody on foot or riding is told of, and no driver.
        count: how many; None for a plural without a number.
        new: it is first told of here (a, another, a number); pronoun: it stands for others.
        first_person: the narrator; object: it stands, as a parked vehicle does.
        background: it is said of traffic around; label: a letter or number that names it.
        counted: a number says how many.
    """

    head: int
    start: int
    stop: int
    classes: frozenset[str]
    count: int | None = 1
    new: bool = False
    pronoun: bool = False
    first_person: bool = False
    object: bool = False
    background: bool = False
    absent: bool = False
    label: str | None = None
    other: bool = False
    definite: bool = False
    counted: bool = False
    nouns: tuple[int, ...] = field(default=())


def find_mentions(tokens: Sequence[Token]) -> tuple[Mention, ...]:
    """All mentions in order; "a boy on a bike" is one."""
    mentions: list[Mention] = []
    n = 0
    while n < len(tokens):
        mention = _read_noun(tokens, n) or _read_pronoun(tokens, n) or _read_bound(tokens, n)
        if mention is None:
            n += 1
            continue
        if mentions and mentions[-1].label and tokens[mention.start - 1].text == "(":
            mention = replace(mention, label=mentions[-1].label)  # "vehicle 1 (eastbound car)"
        cycles = mention.stop < len(tokens) and tokens[mention.stop].stem in _CYCLES
        if cycles and "pedestrian" in mention.classes:  # "a woman cycling to work"
            mention = replace(mention, classes=frozenset({"cyclist"}))
        stem = tokens[mention.head].stem
        for person in (m for m in mentions if mention.definite and m.nouns):
            if tokens[person.nouns[0]].stem == stem:  # "a man on a bike ... the man"
                mention = replace(mention, classes=mention.classes | person.classes)
        if tokens[mention.head].text == "bike" and any("motorcycle" in m.classes for m in mentions):
            mention = replace(mention, classes=mention.classes | {"motorcycle"})
        if mention.pronoun and tokens[n].is_in("of_persons"):
            persons = [m.classes for m in mentions if m.classes & (_RIDERS | {"pedestrian"})]
            if persons and not any(token.is_in("drivers") for token in tokens):
                mention = replace(mention, classes=frozenset().union(*persons))
        alone = mention.pronoun and tokens[n].text == "another"
        if mentions and alone and tokens[n - 1].text not in ("one", "after"):
            # "a car hits another"
            mention = replace(mention, classes=mentions[-1].classes, pronoun=False, nouns=(n,))
        joined = _join_mentions(tokens, mentions[-1], mention) if mentions else None
        if joined is not None:
            mentions[-1] = joined
        else:
            mentions.append(mention)
        n = mention.stop
    return tuple(mentions)


def _join_mentions(tokens: Sequence[Token], first: Mention, second: Mention) -> Mention | None:
    """One mention of two that name the same road users; None where they name others."""
    is_group = tokens[first.head].has("group") and tokens[first.stop].text == "of"
    if is_group and second.start == first.stop + 1:  # "a group of five pedestrians"
        walks = "pedestrian" in second.classes
        return replace(
            second, start=first.start, new=first.new, definite=first.definite,
            nouns=(*first.nouns, *second.nouns) if walks else second.nouns,
        )  # fmt: skip
    if _is_ridden(tokens, first, second):
        return replace(
            first, classes=second.classes, stop=second.stop, head=second.head,
            nouns=(*first.nouns, *second.nouns), label=second.label,
        )  # fmt: skip
    return None


def _read_noun(tokens: Sequence[Token], n: int) -> Mention | None:
    """The mention whose noun phrase ends at the noun that begins at token n."""
    token = tokens[n]
    if short := _NAMED.fullmatch(token.text):  # V1, ped2
        kind = {"v": "vehicle", "p": "pedestrian", "u": "any"}[short[1]]
        return Mention(n, n, n + 1, frozenset({kind}), label=token.text, nouns=(n,))
    classes = frozenset(token.list_values("noun"))
    things = token.has("object.thing")
    if token.text == "unit" and not (n + 1 < len(tokens) and tokens[n + 1].number):
        return None
    if not (classes or things) or token.text == "one" or _is_attribute(tokens, n):
        return None
    stop = max((span[1] for sense, span in token.senses.items() if sense.startswith("noun.")),
               default=n + 1)  # fmt: skip
    if stop < len(tokens) and tokens[stop - 1].kind == tokens[stop].kind == "word" and not things:
        more = frozenset(tokens[stop].list_values("noun"))
        named = not tokens[stop].is_in("indefinite", "definite", "pronouns") and not tokens[
            stop - 1
        ].text.endswith("'s")
        apart = (
            tokens[stop].start - tokens[stop - 1].end == 1
            and tokens[stop - 1].text != tokens[stop - 1].stem
        )
        ridden = more == {"pedestrian"} and classes & _RIDERS  # "the bicycle man"
        if more and named and (ridden or not apart) and tokens[stop].text != "one":  # "police van"
            if classes | more <= _VEHICLES:
                classes |= more
            elif not ridden:
                classes = more
            stop += 1
    head = stop - 1
    number = _read_number_after(tokens, stop)
    stop += 0 if number is None else 2
    if stop < len(tokens) and tokens[stop].text.startswith("x") and tokens[stop].number:
        number, stop = tokens[stop].number, stop + 1  # "ped x2"
    start = n
    while start > 0 and _belongs_before(tokens[start - 1]) and not _is_turn(tokens, start - 1):
        start -= 1
    before = tokens[start:n]
    words = [each.text for each in before]
    said = (k for k in range(start, n) if tokens[k].number and not is_label(tokens, k))
    number = number or next((tokens[k].number for k in said), None)
    plural = _is_plural(tokens[head]) or "several" in words or token.has("group")
    label = _read_label(tokens, stop)
    none = _find_none_after(tokens, stop)
    stop = none or stop
    count = int(number) if number and number >= 1 else None if plural else 1
    if number and classes == {"vehicle"} and stop < len(tokens) and tokens[stop].has("event"):
        classes = frozenset({"any"})  # a "two-vehicle accident" may be of a bicycle and a van
    return Mention(
        head=head,
        start=start,
        stop=stop + (label is not None),
        classes=classes,
        count=count,
        new=number is not None or (not before and plural)
        or any(each.is_in("indefinite", "ordinals") for each in before),
        object=things or any(each.has("object") for each in before)
        or ("pedestrian" not in classes and start > 0 and tokens[start - 1].has("sight"))
        or ("pedestrian" not in classes and _is_said_to_stand(tokens, stop)),
        background=any(each.is_in("around") for each in before) and (plural or number is not None),
        absent=none is not None
        or any(each.text in ("no", "without", "zero", "n't", "any") for each in before)
        or (start > 0 and tokens[start - 1].text in ("no", "without", "zero", "nor")),
        label=label,
        other="other" in words,
        definite=any(each.is_in("definite") for each in before),
        counted=number is not None,
        nouns=tuple(range(n, head + 1)),
    )  # fmt: skip


def _is_said_to_stand(tokens: Sequence[Token], stop: int) -> bool:
    """Whether words for what stands follow a noun: "a van parked", "a bus is broken down"."""
    be = stop < len(tokens) and tokens[stop].is_in("be")
    return any(token.has("object") for token in tokens[stop + be : stop + be + 1])


def _find_none_after(tokens: Sequence[Token], stop: int) -> int | None:
    """The end of "none" or 0 in "vehicles: none"; None where no such word follows a noun."""
    at = stop + (stop < len(tokens) and tokens[stop].text == ":")
    if at < len(tokens) and (tokens[at].text in ("none", "zero", "nil") or tokens[at].text == "0"):
        return at + 1
    return None


def _read_number_after(tokens: Sequence[Token], stop: int) -> float | None:
    """The number of "a class of six"; None where another noun follows it."""
    after = tokens[stop : stop + 3]
    if len(after) < 2 or after[0].text != "of" or (len(after) > 2 and after[2].has("noun")):
        return None
    return after[1].number


def _is_attribute(tokens: Sequence[Token], n: int) -> bool:
    """Whether a noun only describes the next one, as in "bus stop" or "police car"."""
    follow = tokens[n + 1] if n + 1 < len(tokens) else None
    if follow is None or follow.kind != "word" or tokens[n].text.endswith("'s"):
        return False
    if any(
        stop > n + 1 for sense, (_, stop) in tokens[n].senses.items() if sense.startswith("noun")
    ):
        return False
    if follow.has("crosswalk") and not follow.text.endswith("ing"):
        return True
    return follow.has("crosswalk") and n > 1 and tokens[n - 2].is_in("at")


def _is_turn(tokens: Sequence[Token], n: int) -> bool:
    """Whether left or right says how one turns, and nothing of the noun after it."""
    return n > 0 and tokens[n].has("left", "right") and tokens[n - 1].stem == "turn"


def _belongs_before(token: Token) -> bool:
    """Whether a word before a noun is of its phrase: an article, number, adjective."""
    if token.kind != "word":
        return token.kind == "ordinal" or (token.kind == "figure" and token.unit is None)
    if token.is_in("indefinite", "definite", "quantifiers"):
        return True
    if token.number is not None or token.text == "of":
        return token.text not in ("half", "of")
    in_phrase = any(stop - start > 1 for start, stop in token.senses.values())
    if in_phrase and token.has("left", "right"):
        return True
    return token.has(
        "manner", "pace", "bound", "object", "opposite", "order", "side", "background", "left",
        "right", "density", "straight", "motion", "jaywalking", "same", "lateral", "u turn",
        "uturn", "light",
    ) and not token.has("motion_verb", "event") and not token.is_in("not_attributes")  # fmt: skip


def _is_plural(token: Token) -> bool:
    if token.is_in("plurals"):
        return True
    return token.text.endswith("s") and not token.text.endswith(("ss", "us", "'s")) and (
        token.text != token.stem
    )  # fmt: skip


def _read_label(tokens: Sequence[Token], n: int) -> str | None:
    """A letter or number right after a noun that names it: "car A", "vehicle 2", "car-1"."""
    if n >= len(tokens):
        return None
    each = tokens[n]
    gap = each.start - tokens[n - 1].end
    single = each.kind == "word" and len(each.text) == 1 and each.text in "abcdxyz"
    numbered = each.kind == "figure" and each.unit is None and gap <= 1 and (each.number or 0) < 100
    return each.text if single or numbered else None


def _read_pronoun(tokens: Sequence[Token], n: int) -> Mention | None:
    token = tokens[n]
    plural = token.text in ("they", "them", "themselves", "both", "we", "us")
    if token.is_in("first_person") and not (
        token.text in ("my", "our")
        and n + 1 < len(tokens)
        and tokens[n + 1].has("noun", "left", "right", "from_left", "from_right")
    ):
        return Mention(n, n, n + 1, frozenset(), None if plural else 1, first_person=True,
                       pronoun=True)  # fmt: skip
    follows = tokens[n + 1] if n + 1 < len(tokens) else None
    if token.is_in("pronouns") and not (
        token.text == "her"
        and follows is not None
        and follows.kind == "word"
        and (follows.has("noun", "point", "place", "manner", "left", "right"))
    ):
        return Mention(n, n, n + 1, frozenset(), None if plural else 1, pronoun=True)
    if token.text in ("everyone", "everybody"):
        return Mention(n, n, n + 1, frozenset(), None, pronoun=True, other=True)
    in_phrase = any(start < n for start, _ in token.senses.values())  # "comes the other way"
    if token.is_in("stand_for_one", "stand_for_many") and not (
        in_phrase or (follows and follows.has("noun"))
    ):
        if n and tokens[n - 1].text == "no":
            return None
        count = 2 if token.text == "both" else None if token.is_in("stand_for_many") else 1
        return Mention(n, n, n + 1, frozenset(), count, pronoun=True,
                       other=token.text in ("other", "another", "others"))  # fmt: skip
    if token.kind == "word" and token.text in ("a", "b", "c") and _is_bare_label(tokens, n):
        return Mention(n, n, n + 1, frozenset(), 1, pronoun=True, label=token.text)
    return None


def _read_bound(tokens: Sequence[Token], n: int) -> Mention | None:
    """A road user that only its direction names: "eastbound through, westbound left"."""
    before = tokens[n - 1] if n else None
    begins = before is None or before.kind in ("comma", "end") or before.is_in("joining")
    if not (begins and tokens[n].has("bound")):
        return None
    stop = max(span[1] for sense, span in tokens[n].senses.items() if sense.startswith("bound"))
    follow = tokens[stop] if stop < len(tokens) else None
    if follow is not None and follow.kind == "word" and not follow.has("straight", "uturn"):
        return None
    return Mention(n, n, stop, frozenset({"any"}), 1, new=True)


def _is_bare_label(tokens: Sequence[Token], n: int) -> bool:
    """Whether a letter names a road user that was labelled before or is spoken of as A or B."""
    after = tokens[n + 1] if n + 1 < len(tokens) else None
    labelled = any(
        each.text == tokens[n].text and before.has("noun") for before, each in pairwise(tokens)
    )
    return labelled or (tokens[n].text != "a") or (
        after is not None and after.has("event", "motion_verb") and not after.has("noun")
        and any(token.text == "b" for token in tokens)
    )  # fmt: skip


def _is_ridden(tokens: Sequence[Token], person: Mention, ride: Mention) -> bool:
    """Whether a mention is what the person before it drives or rides: "a boy on a bike"."""
    if "pedestrian" not in person.classes and "any" not in person.classes:
        return False
    if ride.pronoun or not (ride.classes & (_VEHICLES | _RIDERS)):
        return False
    between = tokens[person.stop : ride.start]
    if not 1 <= len(between) <= 2 or not between[-1].is_in("rides"):
        return False
    return all(token.kind == "word" and not token.has("event") for token in between)
