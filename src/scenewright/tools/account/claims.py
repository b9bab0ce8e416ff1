"""Claims that the words of a text make of a scene, each with the one test of its type."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from scenewright.scene.events import Event
from scenewright.tools.account.facts import OPPOSITE, SceneFacts, compute_side
from scenewright.tools.account.mentions import Mention
from scenewright.tools.account.vocabulary import Token

Bound = frozenset[int | str]
"""Numbers of agents or ids of objects that a mention stands for."""

Binding = Mapping[int, Bound]
"""By index of the mention."""


class Result(NamedTuple):
    """Outcome of a test: None where it could not be made; with the agents or event it saw."""

    holds: bool | None
    evidence: str = ""
    agents: tuple[int, ...] = ()
    event: Event | None = None


Test = Callable[[SceneFacts, Binding], Result]
UNTESTED = Result(None)
_PAST = frozenset(
    ["hit", "struck", "run", "cut", "let", "shut", "caught", "left", "put", "cast", "met"]
)
_BE = frozenset(
    [
        "is",
        "are",
        "was",
        "were",
        "be",
        "been",
        "being",
        "gets",
        "get",
        "got",
        "getting",
        "gotten",
        "'s",
    ]
)
_BREAKS = frozenset(
    [
        "and",
        "but",
        "while",
        "whilst",
        "when",
        "as",
        "then",
        "so",
        "because",
        "before",
        "after",
        "until",
        "where",
        "if",
        "or",
    ]
)
_RELATIVE = frozenset({"who", "which", "that"})
_STRIKES = frozenset(
    ["hit", "strik", "ram", "slam", "rear-end", "rear", "clip", "plow", "plough", "bump", "knock", "smash", "crash", "shunt", "sideswip", "flatten", "mow"]
)  # fmt: skip
_PREPOSITIONS = frozenset(
    ["behind", "by", "beside", "near", "with", "to", "for", "into", "of", "onto", "past"]
)
_POSSESSIVE = frozenset(["its", "his", "her", "their", "my", "our", "the", "your"])
_INTO = frozenset({"into", "over", "down"})
_UNITS = {
    "km/h": ("m/s", 1 / 3.6), "kmh": ("m/s", 1 / 3.6), "kph": ("m/s", 1 / 3.6), "kmph": ("m/s", 1 / 3.6),
    "mph": ("m/s", 0.44704), "m/s": ("m/s", 1.0), "mps": ("m/s", 1.0), "m/s2": ("m/s2", 1.0),
    "m/s²": ("m/s2", 1.0), "m/s^2": ("m/s2", 1.0), "g": ("m/s2", 9.81), "m": ("m", 1.0), "meter": ("m", 1.0),
    "meters": ("m", 1.0), "metre": ("m", 1.0), "metres": ("m", 1.0), "cm": ("m", 0.01),
    "feet": ("m", 0.3048), "foot": ("m", 0.3048), "ft": ("m", 0.3048), "s": ("s", 1.0), "sec": ("s", 1.0),
    "secs": ("s", 1.0), "second": ("s", 1.0), "seconds": ("s", 1.0), "min": ("s", 60.0),
    "minute": ("s", 60.0), "minutes": ("s", 60.0), "ms": ("s", 0.001), "%": ("%", 1.0), "percent": ("%", 1.0),
    "yards": ("m", 0.9144), "yard": ("m", 0.9144), "inches": ("m", 0.0254), "inch": ("m", 0.0254),
}  # fmt: skip


@dataclass(frozen=True)
class Claim:
    """What words say of a scene.

    Attributes:
        type: one of docs/checker.md; value: what exactly, for the account.
        tokens: indices of the words; mentions: those that the test may look at.
        test: says whether it holds of a scene under a binding.
    """

    type: str
    value: str
    tokens: tuple[int, ...]
    mentions: tuple[int, ...]
    test: Test


class ClaimReader:
    """Reads the claims of one text."""

    def __init__(self, tokens: Sequence[Token], mentions: Sequence[Mention]) -> None:
        self.tokens, self.mentions = tokens, mentions
        self._triggers = sorted(
            {
                span
                for each in tokens
                for sense, span in each.senses.items()
                if sense.startswith("event.")
            }
        )
        self._in_noun = {n for m in mentions for n in m.nouns}

    def read(self) -> list[Claim]:
        """All claims, those of one word beside one another."""
        found: list[Claim] = []
        for index, mention in enumerate(self.mentions):
            found += self._read_mention(index, mention)
        for span in self._triggers:
            found += self._read_event(span)
        for n, token in enumerate(self.tokens):
            found += self._read_token(n, token)
        found += self._read_phrases()
        return found

    def _read_phrases(self) -> Iterator[Claim]:
        """Words of relation files' phrases, for what none of them says by itself."""
        for kind, start, stop in dict.fromkeys(each.phrase for each in self.tokens if each.phrase):
            subjects, objects = self._find_parties(start, stop)
            yield Claim("phrase", kind, tuple(range(start, stop)), (*subjects, *objects),
                        _EventTest(kind, subjects, objects, False, False))  # fmt: skip

    # --- whom words are said of

    def find_subjects(self, n: int, kinds: str = "any") -> tuple[int, ...]:
        """Mentions that the word at n may be said of, the likeliest first.

        Args:
            kinds: `vehicle` or `foot` where only those can be meant.
        """
        for index, m in enumerate(self.mentions):
            if m.start <= n < m.head and not m.pronoun:
                return (index,)
        for k in range(n + 1, min(n + 4, len(self.tokens))):  # "the U-turn of a truck"
            if self.tokens[k].text == "of":
                of = [i for i, m in enumerate(self.mentions) if m.start == k + 1]
                if of and self._may_be(self.mentions[of[0]], kinds):
                    return (of[0],)
        before = [i for i, m in enumerate(self.mentions) if m.head < n and self._may_be(m, kinds)]
        after = [i for i, m in enumerate(self.mentions) if m.start > n and self._may_be(m, kinds)]
        here = [i for i in before if self._same_sentence(self.mentions[i].head, n)]
        if here and n and self.tokens[n - 1].text in ("without", "while", "not"):
            return (here[0],)
        if not here:
            ahead = [i for i in after if self._same_sentence(self.mentions[i].head, n)]
            return tuple((*ahead[:2], *before[-2:]))
        nearest = here[-1]
        stop = self.mentions[nearest].stop
        if any(each.text in _RELATIVE for each in self.tokens[stop : stop + 2]):
            stop = n
        if n == stop or (
            not self._has_break(self.mentions[nearest].stop, n)
            and (not self._is_object(nearest) or self._describes(nearest, n))
        ):
            return (nearest,)
        return tuple(dict.fromkeys((nearest, *reversed(here))))

    def _may_be(self, mention: Mention, kinds: str) -> bool:
        if mention.absent or mention.background:
            return False
        if kinds == "any" or mention.pronoun or "any" in mention.classes:
            return True
        foot = mention.classes <= {"pedestrian"}
        return foot == (kinds == "foot") or bool(mention.classes & {"cyclist", "scooter", "rider"})

    def _same_sentence(self, a: int, b: int) -> bool:
        return self.tokens[a].sentence == self.tokens[b].sentence

    def _has_break(self, start: int, stop: int) -> bool:
        return any(each.kind == "comma" or each.text in _BREAKS for each in self.tokens[start:stop])

    def _describes(self, index: int, n: int) -> bool:
        """Whether words follow their mention at once: "a man from the west", "a car turning left"."""
        between = self.tokens[self.mentions[index].stop : n]
        return not any(each.has("event") for each in between)

    def _is_object(self, index: int) -> bool:
        """Whether a mention is what something is done to."""
        start = self.mentions[index].start
        if start and self.tokens[start - 1].text in _PREPOSITIONS:
            return True
        return any(stop <= start and start - stop <= 2 and not self._has_break(stop, start)
                   for _, stop in self._triggers)  # fmt: skip

    # --- claims of mentions

    def _read_mention(self, index: int, mention: Mention) -> Iterator[Claim]:
        if mention.pronoun:
            return
        if mention.absent or mention.background:
            yield from self._read_background(index, mention)
            return
        classes = mention.classes
        value = "/".join(sorted(classes)) or "object"
        yield Claim("class", value, mention.nouns or (mention.head,), (index,),
                    lambda facts, b: _test_class(facts, b.get(index), classes))  # fmt: skip
        counted = tuple(
            n for n in range(mention.start, mention.stop)
            if (self.tokens[n].number is not None or self.tokens[n].has("group", "number_word"))
            and n not in mention.nouns
        )  # fmt: skip
        if counted:
            yield Claim("count", str(mention.count or "several"), counted, (index,),
                        lambda facts, b: _test_count(facts, b.get(index), mention.count, classes))  # fmt: skip
        sense = next(
            (s for n in range(mention.start, min(len(self.tokens), mention.stop + 1))
             for s in self.tokens[n].senses if s.startswith("object.")), None,
        )  # fmt: skip
        if sense is not None:
            span = tuple(n for n in range(mention.start, min(len(self.tokens), mention.stop + 1))
                         if sense in self.tokens[n].senses)  # fmt: skip
            kind = sense.partition(".")[2]
            yield Claim("object", kind, span, (index,),
                        lambda facts, b: _test_object(facts, b.get(index), kind))  # fmt: skip

    def _read_background(self, index: int, mention: Mention) -> Iterator[Claim]:
        span = tuple(range(mention.start, mention.stop))
        kind = "pedestrian" if mention.classes <= {"pedestrian"} else (
            None if "any" in mention.classes else "vehicle"
        )  # fmt: skip
        if (
            mention.absent
            and mention.start
            and self.tokens[mention.start].text not in ("no", "zero", "without")
        ):
            span = (mention.start - 1, *span)
        count = 0 if mention.absent else mention.count
        yield Claim("background", f"{'some' if count is None else count} {kind or 'others'}", span, (),
                    lambda facts, b: _test_background(facts, kind, count, mention))  # fmt: skip

    # --- events

    def _read_event(self, span: tuple[int, int]) -> Iterator[Claim]:
        start, stop = span
        if self.tokens[start].text in ("let", "have") and self._begins_sentence(start):
            return
        kinds = set()
        for sense in self.tokens[start].senses:
            if sense.startswith("event.") and self.tokens[start].senses[sense] == span:
                kinds.add(sense.partition(".")[2])
        tokens = tuple(range(start, stop))
        subjects, objects = self._find_parties(start, stop)
        passive = self._is_passive(start, stop)
        if passive:
            subjects, objects = objects, subjects
        used = tuple(dict.fromkeys((*subjects, *objects)))
        denied = self._is_denied(start)
        almost = any(each.has("almost") for each in self.tokens[max(0, start - 4) : start + 1])
        avoided = any(each.has("avoid") for each in self.tokens[max(0, start - 4) : start])
        if "cut_off" in kinds:
            kinds |= {"near_miss", "collision"}
        if "collision" in kinds and (almost or avoided):
            kinds.add("near_miss")
            if almost and not denied:
                kinds.discard("collision")
            denied = denied or avoided
        for kind in sorted(kinds - {"cut_off"}):
            directed = kind in ("yielding", "follow") or (
                kind == "collision" and self._says_striker(start, stop) and not almost
            )
            value = f"{'no ' if denied else ''}{kind}"
            yield Claim("event", value, tokens, used,
                        _EventTest(kind, subjects, objects, directed, denied))  # fmt: skip

    def _begins_sentence(self, n: int) -> bool:
        return n == 0 or not self._same_sentence(n - 1, n)

    def _says_striker(self, start: int, stop: int) -> bool:
        """Whether a verb says which agent strikes: "hits", "runs into"; not "collides with"."""
        word = self.tokens[start]
        if word.text.endswith("ing") and word.stem == "crash":
            return False
        follow = self.tokens[stop] if stop < len(self.tokens) else None
        into = any(self.tokens[n].text in _INTO for n in range(start, stop)) or (
            follow is not None and follow.text in _INTO
        )
        direct = word.stem in _STRIKES - {"crash"} and not (
            follow is not None and follow.text in ("with", "each", "one", "and")
        )
        return into or direct

    def _find_parties(self, start: int, stop: int) -> tuple[tuple[int, ...], tuple[int, ...]]:
        before = [
            i
            for i, m in enumerate(self.mentions)
            if m.head < start and not (m.absent or m.background)
        ]
        after = [i for i, m in enumerate(self.mentions)
                 if m.start >= stop and not (m.absent or m.background)
                 and self._same_sentence(m.head, start)]  # fmt: skip
        here = [i for i in before if self._same_sentence(self.mentions[i].head, start)]
        subjects = here or before
        if subjects:
            nearest = subjects[-1]
            if self._is_object(nearest) or self._has_break(self.mentions[nearest].stop, start):
                subjects = list(reversed(subjects))
            else:
                subjects = [nearest]
        objects = after[:1]
        if after and self._has_break(stop, self.mentions[after[0]].start):
            objects = after[:2]
        if not objects or (objects and self._is_clause_subject(objects[0], stop)):
            others = [i for i in reversed(before) if i not in subjects[:1]]
            objects = [*objects, *others[:3]]
        if not subjects:
            subjects = after[:2] if len(after) > 1 else []
        return tuple(subjects), tuple(objects)

    def _is_clause_subject(self, index: int, stop: int) -> bool:
        """Whether a mention after an event begins a clause of its own."""
        return self._has_break(stop, self.mentions[index].start)

    def _is_passive(self, start: int, stop: int) -> bool:
        word = self.tokens[start]
        participle = word.text.endswith(("ed", "en")) or word.text in _PAST
        if not participle:
            return False
        by = any(each.text == "by" for each in self.tokens[stop : stop + 3])
        be = any(each.text in _BE for each in self.tokens[max(0, start - 3) : start])
        return by or (be and word.text not in ("stopped", "yielded"))

    def _is_denied(self, start: int) -> bool:
        found = False
        for each in reversed(self.tokens[max(0, start - 5) : start]):
            if each.kind in ("end", "comma") or each.text in ("and", "but", "then"):
                break
            found |= each.negates
        return found

    # --- everything else

    def _read_token(self, n: int, token: Token) -> Iterator[Claim]:
        if token.kind == "clock" or token.has("time"):
            yield Claim("time", token.text, (n,), (), _TimeTest(self, n))
        if token.number is not None and n not in self._in_noun:
            yield from self._read_number(n, token)
        for sense in token.senses:
            family, _, value = sense.partition(".")
            after = self.tokens[token.senses[sense][1] :][:1]
            if family in ("from_left", "from_right") and after and after[0].has("turn"):
                family = family.removeprefix("from_")  # "on its left turn"
            if reader := _READERS.get(family):
                yield from reader(self, n, value)

    def _is_list_label(self, n: int) -> bool:
        """Whether a number only counts the items of a list: "1) ..." or "2. ..."."""
        begins = n == 0 or self.tokens[n - 1].kind in ("end", "comma")
        follow = self.tokens[n + 1] if n + 1 < len(self.tokens) else None
        counts = (
            follow is not None
            and follow.start == self.tokens[n].end
            and follow.text in (")", ".", ":")
        )
        return counts and (begins or (follow is not None and follow.text == ")"))

    def _read_number(self, n: int, token: Token) -> Iterator[Claim]:
        unit = token.unit or next(
            (each.text for each in self.tokens[n + 1 : n + 3] if each.text in _UNITS), None
        )
        if unit is not None and any(
            each.text in ("limit", "zone") for each in self.tokens[max(0, n - 5) : n + 4]
        ):
            return  # a posted limit is of the place
        if unit is not None:
            name, factor = _UNITS.get(unit, (unit, 1.0))
            value = (token.number or 0.0) * factor
            yield Claim("number", f"{value:.3g} {name}", (n,), (),
                        lambda facts, b: _test_number(facts, name, value))  # fmt: skip
        elif (span := next((s for s in self._triggers if 0 < s[0] - n <= 2), None)) is not None:
            kinds = self.tokens[span[0]].list_values("event")
            number = token.number or 0.0
            yield Claim("count", f"{number:g} {'/'.join(kinds)}", (n,), (),
                        lambda facts, b: _count_events(facts, kinds, number))  # fmt: skip
        elif not self._is_list_label(n) and not any(m.start <= n < m.stop for m in self.mentions):
            number = token.number or 0.0
            yield Claim("number", f"{number:g}", (n,), (),
                        lambda facts, b: _test_bare_number(facts, b, self.mentions, number))  # fmt: skip


def _each(facts: SceneFacts, b: Binding, mentions: Iterable[int]) -> Iterator[tuple[int, ...]]:
    """Agents that each mention stands for, if for any."""
    for index in mentions:
        bound = tuple(n for n in b.get(index, frozenset()) if isinstance(n, int))
        if bound:
            yield bound


def _test_all(
    facts: SceneFacts, b: Binding, mentions: Sequence[int], holds: Callable[[int], bool], what: str
) -> Result:
    """Whether something holds of all agents of any of the mentions."""
    looked = any(b.get(index) for index in mentions)
    for agents in _each(facts, b, mentions):
        if all(map(holds, agents)):
            return Result(True, f"{what} of agent {', '.join(map(str, agents))}", agents)
    return Result(False, what) if looked else UNTESTED


def _test_class(facts: SceneFacts, bound: Bound | None, classes: frozenset[str]) -> Result:
    if not bound:
        return Result(False, "no such agent")
    agents = [n for n in bound if isinstance(n, int)]
    if "background" in bound:
        kind = (
            "pedestrian" if classes <= {"pedestrian"} else None if "any" in classes else "vehicle"
        )
        seen = facts.count_background(kind)
        return Result(seen > 0, f"{seen} in the background")
    if all(facts.fits_class(n, classes) for n in agents):
        named = ", ".join(
            f"agent {n} ({facts.agents[n].subtype or facts.agents[n].type})" for n in agents
        )
        things = ", ".join(str(n) for n in bound if isinstance(n, str))
        return Result(True, named or things, tuple(agents))
    return Result(False, "another class")


def _test_count(
    facts: SceneFacts, bound: Bound | None, count: int | None, classes: frozenset[str]
) -> Result:
    if not bound:
        return Result(False, "no such agents")
    if "background" in bound:
        kind = (
            "pedestrian" if classes <= {"pedestrian"} else None if "any" in classes else "vehicle"
        )
        seen = facts.count_background(kind)
        return Result(seen == count if count is not None else seen > 1, f"{seen} in the background")
    number = sum(facts.count_members(n) if isinstance(n, int) else 1 for n in bound)
    fits = number >= 2 if count is None else number == count
    return Result(fits, f"{number} of them")


def _test_object(facts: SceneFacts, bound: Bound | None, kind: str) -> Result:
    ids = {o.id for o in facts.find_objects(kind)}
    named = {n for n in bound or () if isinstance(n, str)}
    if named:
        return Result(named <= ids, f"{kind} {', '.join(sorted(named))}")
    return (
        Result(bool(ids), f"{kind} {', '.join(sorted(ids))}")
        if ids
        else Result(False, f"no {kind}")
    )


def _test_background(
    facts: SceneFacts, kind: str | None, count: int | None, mention: Mention
) -> Result:
    seen = facts.count_background(kind)
    if count == 0 and not mention.background:
        absent = seen == 0 and not any(
            facts.fits_class(n, mention.classes or frozenset({"any"})) for n in facts.foreground
        )
        return Result(absent, f"{seen} of them")
    return Result(seen > 0 if count is None else seen == count, f"{seen} in the background")


@dataclass(frozen=True)
class _EventTest:
    """Whether two of the parties have an event of a kind, in their roles where these are said."""

    kind: str
    subjects: tuple[int, ...]
    objects: tuple[int, ...]
    directed: bool
    denied: bool

    def __call__(self, facts: SceneFacts, b: Binding) -> Result:
        pairs = [
            (first, second)
            for one in self.subjects for two in self.objects
            for first in b.get(one, ()) for second in b.get(two, ())
            if isinstance(first, int) and isinstance(second, int) and first != second
        ]  # fmt: skip
        together = [
            (first, second) for one in (*self.subjects, *self.objects)
            for first in b.get(one, ()) for second in b.get(one, ())
            if isinstance(first, int) and isinstance(second, int) and first < second
        ]  # fmt: skip
        met = self._find_encounter(facts, b)
        if met is not None and not self.denied:
            return met
        found = next(
            (e for pair in (*pairs, *together) for e in facts.list_between(*pair, (self.kind,))
             if not self.directed or pair in together or facts.has_role(e, pair[0])), None,
        )  # fmt: skip
        if found is None and not together and not (self.subjects and self.objects):
            anyone = [(x, y) for x in facts.foreground for y in facts.foreground if x != y]
            found = next(
                (e for pair in anyone for e in facts.list_between(*pair, (self.kind,))), None
            )
        if self.denied:
            if not (pairs or together):
                kinds = [e for e in facts.proof.events if e.type == self.kind]
                return Result(not kinds, f"no {self.kind}")
            return Result(found is None, f"no {self.kind}")
        if found is None and not self.objects:
            found = next(
                (e for one in self.subjects for n in b.get(one, ()) for e in facts.events
                 if e.type == self.kind and n in ((e.from_,) if self.directed else (e.from_, e.to))),
                None,
            )  # fmt: skip
        if found is None and not self.subjects and not self.objects:
            found = next((e for e in facts.proof.events if e.type == self.kind), None)
        if found is None:
            return Result(False, f"no {self.kind} of these agents")
        seen = f"{found.type} of {found.from_} and {found.to} at {found.time:.1f} s"
        return Result(True, seen, (found.from_, found.to), found)

    def _find_encounter(self, facts: SceneFacts, b: Binding) -> Result | None:
        """What an agent does about an object: hits it, waits behind it."""
        hows = {"collision": ("hits", "doored"), "near_miss": ("stops_short",),
                "yielding": ("waits_behind", "queues", "waits_then_passes", "stops_short"),
                "follow": ("queues", "waits_behind")}.get(self.kind, ())  # fmt: skip
        agents = {n for one in (*self.subjects, *self.objects) for n in b.get(one, ())}
        for each in facts.scene.encounters:
            if each.how in hows and (each.agent in agents or not agents):
                return Result(
                    True, f"agent {each.agent} {each.how.replace('_', ' ')} {each.object}"
                )
        return None


class _TimeTest:
    """Whether the scene's clock fits the words of a time of day around a token."""

    def __init__(self, reader: ClaimReader, n: int) -> None:
        self.tokens, self.n = reader.tokens, n

    def __call__(self, facts: SceneFacts, b: Binding) -> Result:
        own, token = facts.get_minutes(), self.tokens[self.n]
        spans = [s.partition("|")[0] for s in token.list_values("time")]
        evidence = f"the scene is at {facts.scene.meta.time_of_day}"
        if any(each.text in ("not", "never") for each in self.tokens[max(0, self.n - 3) : self.n]):
            spans = [span for span in spans if not _is_within(own, span.partition("+")[0])]
            return Result(bool(spans), evidence)
        if token.kind == "clock":
            return Result(any(abs(own - each) <= 20 for each in _read_clock(token.text)), evidence)
        return Result(
            any(_is_within(own, part) for span in spans for part in span.split("+")), evidence
        )


def _read_clock(text: str) -> list[int]:
    if len(text) == 4 and text.isdecimal():
        return [60 * int(text[:2]) + int(text[2:])]
    digits = [int(part) for part in "".join(c if c.isdigit() else " " for c in text).split()]
    hours, minutes = digits[0], digits[1] if len(digits) > 1 else 0
    if "p" in text:
        return [60 * (hours % 12 + 12) + minutes]
    if "a" in text:
        return [60 * (hours % 12) + minutes]
    return [
        60 * hours + minutes,
        *([60 * (hours + 12) + minutes] if 0 < hours < 12 and not text.startswith("0") else []),
    ]


def _is_within(own: int, span: str) -> bool:
    first, _, last = span.partition("-")
    start, end = (60 * int(each[:2]) + int(each[3:5]) for each in (first, last))
    return (own - start) % 1440 <= (end - start) % 1440


def _test_number(facts: SceneFacts, unit: str, value: float) -> Result:
    known = [(low, high) for name, low, high in facts.list_figures() if name == unit]
    for low, high in known:
        if low - 1e-6 <= value <= high + 1e-6:
            return Result(True, f"asked for and measured: {low:.3g} to {high:.3g} {unit}")
    return Result(False, f"no figure of {value:.3g} {unit} was asked for") if known else UNTESTED


def _count_events(facts: SceneFacts, kinds: Sequence[str], number: float) -> Result:
    found = sum(e.type in kinds for e in facts.proof.events)
    return Result(found == number, f"{found} of them")


def _test_bare_number(
    facts: SceneFacts, b: Binding, mentions: Sequence[Mention], number: float
) -> Result:
    """A number without a unit: of the clock, of a background, of agents, or of a figure."""
    minutes = facts.get_minutes()
    if any(abs(minutes % 720 - 60 * (number % 12) - off) <= 20 for off in (0, 30)) and number <= 24:
        if facts.scene.meta.time_of_day:
            return Result(True, f"the scene is at {facts.scene.meta.time_of_day}")
    counts = {facts.count_background(k) for k in (None, "vehicle", "pedestrian")}
    if number in counts:
        return Result(True, f"{number:g} in the background")
    if any(
        low <= number * f <= high
        for _, low, high in facts.list_figures()
        for f in (1.0, 1 / 3.6, 0.447)
    ):
        return Result(True, "a figure that was asked for")
    if any(len(bound) == number for bound in b.values()):
        return Result(True, f"{number:g} agents")
    return Result(False, f"nothing is {number:g}")


# --- readers by sense

Reader = Callable[[ClaimReader, int, str], Iterable[Claim]]


_TO = frozenset(
    [
        "exit",
        "exits",
        "leaves",
        "exiting",
        "leaving",
        "destination",
        "to",
        "towards",
        "toward",
        "into",
        "onto",
        "for",
        "->",
        "→",
        ">",
    ]
)
_FROM = frozenset(
    ["entry", "enters", "entering", "origin", "from", "off", "of", "out", "via", "fr", "frm"]
)


def _follows_crosswalk(tokens: Sequence[Token], n: int) -> bool:
    """Whether a side says which crosswalk the words just before it mean."""
    k = n - 1
    while k > 0 and tokens[k].text in ("on", "of", "at", "the", "in", ":", "="):
        k -= 1
    return tokens[k].has("crosswalk") and not tokens[k].text.startswith("crossi")


def _read_side(reader: ClaimReader, n: int, side: str) -> Iterator[Claim]:
    tokens = reader.tokens
    subjects = reader.find_subjects(n)
    before = [each.text for each in tokens[max(0, n - 4) : n]]
    after = tokens[n + 1 : n + 3]
    crosswalk = any(each.has("crosswalk") for each in after) or (
        (n > 0 and _follows_crosswalk(tokens, n))
        or (any(each.stem == "cros" for each in tokens[max(0, n - 3) : n])
            and any(each.text in ("leg", "arm", "street", "road", "approach", "side") for each in after))
    )  # fmt: skip
    said = next((w for w in reversed(before) if w in _TO or w in _FROM), None)
    to, source = said in _TO, said in _FROM
    pair = [m for m in (n + 1, n + 2) if m < len(tokens) and tokens[m].has("side")]
    first_of_pair = any(
        tokens[k].text in ("to", "->", "→", ">", "=>")
        for k in range(n + 1, min(len(tokens), n + 3))
    ) or bool(pair and tokens[n].end + 1 >= tokens[n + 1].start)

    turned = any(
        each.has("left", "right", "turn") and each.sentence == tokens[n].sentence
        for each in tokens[:n]
    )
    heads = (n > 0 and tokens[n - 1].has("motion_verb")) or (
        n > 1 and tokens[n - 2].has("motion_verb")
    )

    def holds(facts: SceneFacts, number: int) -> bool:
        agent = facts.agents[number]
        if crosswalk:
            return agent.crosswalk == side
        if (first_of_pair or source) and not to:
            return agent.entry == side
        if to:
            return agent.exit == side or (
                agent.entry == OPPOSITE[side] and agent.type == "pedestrian"
            )
        if heads:
            return agent.entry == OPPOSITE[side] or (turned and agent.exit == side)
        if agent.type == "vehicle":
            return agent.entry == side or (turned and agent.exit == side)
        return side in (agent.entry, agent.exit, agent.crosswalk)

    yield Claim("side", side, (n,), subjects,
                lambda facts, b: _test_all(facts, b, subjects, lambda a: holds(facts, a), side))  # fmt: skip


def _read_bound(reader: ClaimReader, n: int, side: str) -> Iterator[Claim]:
    subjects = reader.find_subjects(n)
    turned = any(each.has("left", "right", "turn") and each.sentence == reader.tokens[n].sentence
                 for each in reader.tokens[:n])  # fmt: skip

    def holds(facts: SceneFacts, number: int) -> bool:
        agent = facts.agents[number]
        return agent.entry == OPPOSITE[side] or (turned and agent.exit == side)

    yield Claim("heading", side, (n,), subjects,
                lambda facts, b: _test_all(facts, b, subjects, lambda a: holds(facts, a), f"{side}bound"))  # fmt: skip


def _movement(*movements: str) -> Reader:
    def read(reader: ClaimReader, n: int, _value: str) -> Iterator[Claim]:
        before = [each.text for each in reader.tokens[max(0, n - 3) : n]]
        if (
            len(movements) == 1
            and before
            and (
                before[-1].endswith("'s")
                or (before[-1] in _POSSESSIVE and {"from", "on", "to", "at"} & set(before[:-1]))
            )
        ):
            yield from _relative(movements[0])(reader, n, "")
            return
        subjects = reader.find_subjects(n, "vehicle")
        yield Claim("movement", "/".join(movements), (n,), subjects, lambda facts, b: _test_all(
            facts, b, subjects, lambda a: facts.agents[a].movement in movements, "/".join(movements)))  # fmt: skip

    return read


def _read_cross(reader: ClaimReader, n: int, _value: str) -> Iterator[Claim]:
    subjects = reader.find_subjects(n)
    yield Claim("crossing", "crosses", (n,), subjects, lambda facts, b: _test_all(
        facts, b, subjects, lambda a: facts.agents[a].movement in ("crossing", "jaywalking", "straight", "left", "right"), "crosses"))  # fmt: skip


def _read_jaywalking(reader: ClaimReader, n: int, _value: str) -> Iterator[Claim]:
    subjects = reader.find_subjects(n, "foot")
    yield Claim("movement", "jaywalking", (n,), subjects, lambda facts, b: _test_all(
        facts, b, subjects, lambda a: facts.agents[a].movement == "jaywalking", "jaywalking"))  # fmt: skip


def _read_crosswalk(reader: ClaimReader, n: int, _value: str) -> Iterator[Claim]:
    used = tuple(range(len(reader.mentions)))

    def test(facts: SceneFacts, b: Binding) -> Result:
        for n in facts.foreground:
            if facts.agents[n].crosswalk is not None:
                return Result(True, f"agent {n} on the {facts.agents[n].crosswalk} crosswalk")
        walks = any(facts.agents[n].type == "pedestrian" for n in facts.foreground)
        return Result(False, "no agent is on a crosswalk") if walks else UNTESTED

    yield Claim("crosswalk", "a crosswalk", (n,), used, test)


def _turned_crosswalk(field: str) -> Reader:
    def read(reader: ClaimReader, n: int, _value: str) -> Iterator[Claim]:
        def test(facts: SceneFacts, b: Binding) -> Result:
            legs = {
                getattr(facts.agents[n], field)
                for n in facts.foreground
                if facts.agents[n].crosswalk is None
            }
            walked = {
                facts.agents[n].crosswalk for n in facts.foreground if facts.agents[n].crosswalk
            }
            return Result(bool(legs & walked), f"crosswalk on the {field} leg")

        yield Claim("crosswalk", f"on the {field} leg", (n,), (), test)

    return read


def _relative(*sides: str) -> Reader:
    def read(reader: ClaimReader, n: int, _value: str) -> Iterator[Claim]:
        subjects = reader.find_subjects(n)

        def test(facts: SceneFacts, b: Binding) -> Result:
            looked = False
            for agents in _each(facts, b, subjects):
                for agent in agents:
                    for other in facts.foreground:
                        if other == agent:
                            continue
                        looked = True
                        seen = compute_side(facts.agents[agent].entry, facts.agents[other].entry)
                        if seen in sides or (
                            "left" in sides and "right" in sides and seen in ("left", "right")
                        ):
                            return Result(
                                True, f"agent {agent} comes from the {seen} side of {other}"
                            )
            return Result(False, "/".join(sides)) if looked else UNTESTED

        yield Claim("tie", "/".join(sides), (n,), subjects, test)

    return read


def _read_red(reader: ClaimReader, n: int, _value: str) -> Iterator[Claim]:
    subjects = reader.find_subjects(n)
    denied = reader._is_denied(n)

    def test(facts: SceneFacts, b: Binding) -> Result:
        if denied:
            return _test_all(
                facts, b, subjects, lambda a: a not in facts.red_runners, "no red light run"
            )
        return _test_all(facts, b, subjects, lambda a: a in facts.red_runners, "a red light run")

    yield Claim("red_light", "no run" if denied else "run", (n,), subjects, test)


def _read_light(reader: ClaimReader, n: int, _value: str) -> Iterator[Claim]:
    yield Claim("light", "lights", (n,), (), lambda facts, b: Result(
        bool(facts.scene.signals), "the place has lights"))  # fmt: skip


def _read_stop(reader: ClaimReader, n: int, _value: str) -> Iterator[Claim]:
    subjects = reader.find_subjects(n)
    denied = reader._is_denied(n)

    def holds(facts: SceneFacts, number: int) -> bool:
        slows = facts.stands(number) >= 0.4 or any(
            e.type == "yielding" and facts.has_role(e, number) for e in facts.events
        )
        return slows != denied

    yield Claim("stop", "does not stop" if denied else "stops", (n,), subjects,
                lambda facts, b: _test_all(facts, b, subjects, lambda a: holds(facts, a), "stands"))  # fmt: skip


def _read_brake(reader: ClaimReader, n: int, _value: str) -> Iterator[Claim]:
    subjects = reader.find_subjects(n)
    denied = reader._is_denied(n)

    def holds(facts: SceneFacts, number: int) -> bool:
        if denied:
            return facts.agents[number].reaction == "none" or facts.compute_braking(number) < 1.0
        return facts.compute_braking(number) >= 1.0

    yield Claim("braking", "no braking" if denied else "brakes", (n,), subjects,
                lambda facts, b: _test_all(facts, b, subjects, lambda a: holds(facts, a), "no braking" if denied else "braking"))  # fmt: skip


def _read_late(reader: ClaimReader, n: int, _value: str) -> Iterator[Claim]:
    def test(facts: SceneFacts, b: Binding) -> Result:
        late = [
            e for e in facts.proof.events if e.cause == "late_brake" or "late_brake" in e.evidence
        ]
        none = [r for r in facts.reactions if r.get("why_not")]
        return Result(bool(late or none), "braking too late")

    yield Claim("cause", "late braking", (n,), (), test)


def _read_normal(reader: ClaimReader, n: int, _value: str) -> Iterator[Claim]:
    def test(facts: SceneFacts, b: Binding) -> Result:
        """What is not asked for does not happen: the certificate of every verified scene."""
        return Result(facts.proof.verified, "nothing else happens")

    yield Claim("absence", "nothing else", (n,), (), test)


def _read_density(reader: ClaimReader, n: int, value: str) -> Iterator[Claim]:
    def test(facts: SceneFacts, b: Binding) -> Result:
        own = facts.scene.meta.density
        if own is None:
            return UNTESTED
        return Result(own == value, f"density {own}")

    yield Claim("density", value, (n,), (), test)


def _read_background_word(reader: ClaimReader, n: int, _value: str) -> Iterator[Claim]:
    token = reader.tokens[n]
    denied = reader._is_denied(n) or token.text in ("nobody", "alone", "no")
    denied |= any(
        each.text in ("no", "nobody", "none", "nothing", "noone", "empty", "alone")
        for each in reader.tokens[max(0, n - 3) : n + 1]
    )

    def test(facts: SceneFacts, b: Binding) -> Result:
        seen = facts.count_background()
        if denied:
            return Result(seen == 0, f"{seen} in the background") if seen == 0 else UNTESTED
        return Result(True, f"{seen} in the background") if seen else UNTESTED

    yield Claim("background", "none" if denied else "some", (n,), (), test)


def _read_order(reader: ClaimReader, n: int, _value: str) -> Iterator[Claim]:
    token = reader.tokens[n]
    for index, m in enumerate(reader.mentions):
        if m.start <= n <= m.head:  # "the second car" is a mention of its own
            yield Claim("count", token.text, (n,), (index,), _OrdinalTest(token.text, index))
            return
    if token.has("sequence") and _is_between_events(reader, n):
        return
    if token.text in ("first", "last", "second") and (
        reader._begins_sentence(n) or reader.tokens[n - 1].kind == "comma"
    ):
        return
    subjects, objects = reader._find_parties(n, n + 1)
    joins = token.text in ("before", "after", "behind", "prior", "ahead")
    if joins and not any(0 < reader.mentions[m].start - n <= 4 for m in objects):
        return
    late = token.text in ("after", "second", "last", "behind", "next", "finally", "later", "third")

    def test(facts: SceneFacts, b: Binding) -> Result:
        said = [
            (first, second) for one in subjects for two in (*objects, *range(len(reader.mentions)))
            for first in b.get(one, ()) for second in b.get(two, ())
            if isinstance(first, int) and isinstance(second, int) and first != second
        ]  # fmt: skip
        known = [(pair, facts.find_order(*pair)) for pair in said]
        if any(order is not None and order != late for _, order in known):
            return Result(True, "the order in which they pass")
        if any(order is not None for _, order in known):
            return Result(False, "they pass in the other order")
        return UNTESTED

    yield Claim("order", "second" if late else "first", (n,), subjects, test)


@dataclass(frozen=True)
class _OrdinalTest:
    """Whether "the last one" is last, and "the first" first, where agents follow one another."""

    word: str
    index: int

    def __call__(self, facts: SceneFacts, b: Binding) -> Result:
        own = {n for n in b.get(self.index, ()) if isinstance(n, int)}
        row = [e for e in facts.events if e.type == "follow"]
        if self.word in ("last", "final") and own & {e.to for e in row}:
            return Result(False, "another one follows it")
        if self.word in ("lead", "leading") and own & {e.from_ for e in row}:
            return Result(False, "it follows another one")
        return Result(bool(own) or None, "a road user of its own")


def _is_between_events(reader: ClaimReader, n: int) -> bool:
    return any(s < n for s, _ in reader._triggers) and any(s > n for s, _ in reader._triggers)


def _read_sequence(reader: ClaimReader, n: int, value: str) -> Iterator[Claim]:
    """Two events in time: one after another, or at the same time."""
    before = [s for s in reader._triggers if s[0] < n]
    after = [s for s in reader._triggers if s[0] > n]
    text = reader.tokens[n].text
    if not after or (not before and len(after) < 2):
        return
    first, second = (before[-1], after[0]) if before else (after[0], after[1])
    one = [c for c in reader._read_event(first) if not c.value.startswith("no ")]
    two = [c for c in reader._read_event(second) if not c.value.startswith("no ")]
    used = tuple(dict.fromkeys(m for c in (*one, *two) for m in c.mentions))

    def test(facts: SceneFacts, b: Binding) -> Result:
        earlier, later = (
            {e.time: e for c in claims if (e := c.test(facts, b).event) is not None}
            for claims in (one, two)
        )
        if not earlier or not later or earlier.keys() & later.keys():
            return UNTESTED
        early, late = earlier[min(earlier)], later[min(later)]
        if (value == "after") == bool(before):
            early, late = late, early
        seen = f"at {early.time:.1f} s and {late.time:.1f} s"
        if value == "while":
            apart = max(early.time, late.time) - min(_get_end(early), _get_end(late))
            return Result(apart <= TOGETHER or text in ("as", "when"), seen)
        return Result(early.time <= _get_end(late) + 0.05, seen)

    yield Claim("sequence", value, (n,), used, test)


TOGETHER = 5.0
"""Events that begin within so many seconds of one another happen at the same time [s]."""


def _get_end(event: Event) -> float:
    return float(event.evidence.get("until", event.time))


def _typed(kind: str, find: Callable[[SceneFacts, str], Iterable[int]]) -> Reader:
    """A claim that an agent of the sentence has a property which the checker proves."""

    def read(reader: ClaimReader, n: int, value: str) -> Iterator[Claim]:
        def test(facts: SceneFacts, b: Binding) -> Result:
            having = set(find(facts, value))
            if having:
                return Result(
                    True, f"{value or kind} of agent {', '.join(map(str, sorted(having)))}"
                )
            return UNTESTED

        yield Claim(kind, value or kind, (n,), (), test)

    return read


def _find_motion(facts: SceneFacts, value: str) -> list[int]:
    names = {"yellow": ("passes_yellow", "stops_at_yellow"), "runs": ("runs", "darts_out")}
    wanted = names.get(value, (value,))
    return [n for n in facts.foreground if facts.agents[n].motion in wanted]


def _find_reaction(facts: SceneFacts, value: str) -> list[int]:
    asked = [n for n in facts.foreground if facts.agents[n].reaction == value]
    hows = {"swerves": ("swerves",), "steps_back": ("steps_back", "jumps_back"), "runs": ("runs",)}
    seen = [r["agent"] for r in facts.reactions if r.get("how") in hows.get(value, ())]
    return [*asked, *seen]


def _find_manoeuvre(facts: SceneFacts, value: str) -> list[int]:
    return [
        r.from_
        for r in facts.scene.relations
        if r.manoeuvre == value or (not value and r.manoeuvre)
    ]


def _find_meeting(facts: SceneFacts, _value: str) -> list[int]:
    return [each.agent for each in facts.scene.encounters]


def _find_sight(facts: SceneFacts, _value: str) -> list[int]:
    return [each.subject for each in facts.scene.sights]


def _find_group(facts: SceneFacts, _value: str) -> list[int]:
    return [n for n in facts.foreground if facts.count_members(n) > 1]


_KIND_POINTS = {"rear_end": ("rear", "back", "front", "tail", "behind", "bumper", "boot", "trunk"),
                "sideswipe": ("side", "flank", "mirror"), "head_on": ("front", "head", "frontal"),
                "angle": ("side", "flank", "door", "front")}  # fmt: skip


def _read_point(reader: ClaimReader, n: int, _value: str) -> Iterator[Claim]:
    """Where a collision strikes a vehicle."""
    text = reader.tokens[n].text

    def test(facts: SceneFacts, b: Binding) -> Result:
        asked = [p for r in facts.scene.relations for p in (r.point_from, r.point_to) if p]
        named = {part for each in asked for part in each.split("_")}
        sides = {w for e in facts.proof.events for w in _KIND_POINTS.get(e.kind or "", ())}
        measured = any(m.kind.endswith("point") or "point_" in m.kind for m in facts.scene.measures)
        if text in named | sides or (measured and text not in ("left", "right")):
            return Result(True, f"the point of impact ({', '.join(asked) or text})")
        return UNTESTED

    yield Claim("point", text, (n,), (), test)


def _find_kind(facts: SceneFacts, value: str) -> list[int]:
    return [e.from_ for e in facts.proof.events if e.kind == value]


def _read_priority(reader: ClaimReader, n: int, _value: str) -> Iterator[Claim]:
    def test(facts: SceneFacts, b: Binding) -> Result:
        found = [e for e in facts.proof.events if e.type == "yielding"]
        return Result(bool(found), "one gives way") if found else UNTESTED

    yield Claim("order", "priority", (n,), (), test)


def _read_motion_verb(reader: ClaimReader, n: int, _value: str) -> Iterator[Claim]:
    subjects = reader.find_subjects(n)
    yield Claim("moves", "moves", (n,), subjects,
                lambda facts, b: _test_all(facts, b, subjects, lambda a: True, "moves"))  # fmt: skip


_READERS: Mapping[str, Reader] = {
    "side": _read_side,
    "bound": _read_bound,
    "left": _movement("left"),
    "right": _movement("right"),
    "straight": _movement("straight"),
    "uturn": _movement("uturn"),
    "turn": _movement("left", "right", "uturn"),
    "cross": _read_cross,
    "jaywalking": _read_jaywalking,
    "crosswalk": _read_crosswalk,
    "exit_crosswalk": _turned_crosswalk("exit"),
    "entry_crosswalk": _turned_crosswalk("entry"),
    "opposite": _relative("opposite"),
    "lateral": _relative("left", "right"),
    "same": _relative("same"),
    "from_left": _relative("left"),
    "from_right": _relative("right"),
    "red": _read_red,
    "light": _read_light,
    "stop": _read_stop,
    "brake": _read_brake,
    "late_brake": _read_late,
    "normal": _read_normal,
    "density": _read_density,
    "background": _read_background_word,
    "order": _read_order,
    "sequence": _read_sequence,
    "motion": _typed("motion", _find_motion),
    "reaction": _typed("reaction", _find_reaction),
    "manoeuvre": _typed("manoeuvre", _find_manoeuvre),
    "meets": _typed("encounter", _find_meeting),
    "sight": _typed("sight", _find_sight),
    "group": _typed("group", _find_group),
    "point": _read_point,
    "kind": _typed("kind", _find_kind),
    "priority": _read_priority,
    "motion_verb": _read_motion_verb,
}
"""By family of senses; others are said in `account.py` to stand, to be manner or not shown."""
