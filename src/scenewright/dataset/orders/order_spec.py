"""What an order asks for: how many scenes of which kinds, at which hours, in how much traffic."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from importlib import resources
from typing import Any

from scenewright.backends import Question, load_backend
from scenewright.backends.offline import VOCABULARY, time_words_in
from scenewright.dataset.orders.scenario_spec import format_clock
from scenewright.errors import InputError
from scenewright.scene.base import AgentClass
from scenewright.scene.events import EVENT_OF_RELATION
from scenewright.scene.relations import Pattern, load_patterns
from scenewright.scene.social import SceneContext
from scenewright.tools.account import list_unknown_words

NORMAL = "normal"
MOST = 100_000
EXAMPLE = '"40 collisions and 50 yields at rush hour"'


WORDS: Mapping[str, Any] = tomllib.loads(
    resources.files("scenewright.dataset.orders").joinpath("words.toml").read_text("utf-8")
)
_KINDS: Mapping[str, list[str]] = WORDS["kinds"]
_MEANS: Mapping[str, list[str]] = WORDS["means"]
_RIDERS: Mapping[str, AgentClass] = WORDS["riders"]
_EMPTY, _STOPS = (frozenset(WORDS["lists"][name]) for name in ("empty", "stops"))
_LARGE = {"hundred": 100, "thousand": 1000, "dozen": 12, "score": 20}
_NUMBERS = VOCABULARY["words"]["numbers"]
_NUMBER_WORDS = {
    **{word: value for value, word in enumerate(_NUMBERS["to_twenty"])},
    **{word: value for word, value in _NUMBERS["others"].items() if 20 < value < 100},
    "a": 1, "an": 1, "couple": 2,
}  # fmt: skip
_KNOWN_KINDS = (
    "there are collisions, near misses, yields, follows and normal scenes, by pattern such as "
    "rear-end, head-on, sideswipe, left-turn, pedestrian, mid-block"
)
_LEGS = ["north", "east", "south", "west"]


@dataclass(frozen=True)
class Quota:
    """So many scenes of one kind.

    Attributes:
        name: of the kind, for ids; event: as the checker calls it, or `normal`.
        leaves: ids of the patterns that serve it; none for normal scenes.
        backend: the planner and reasoner, if not the run's; place: which of the order's backends
            that is, from 0 on. Draws depend on the place alone, so that recorded answers of a model
            can replace the model.
        foreground: whether the texts of normal scenes name two agents that do not interact.
        rider: the class of its riders, where the order names it.
    """

    name: str
    count: int
    event: str
    leaves: tuple[str, ...] = ()
    backend: str | None = None
    foreground: bool = False
    place: int | None = None
    rider: AgentClass | None = None


@dataclass(frozen=True)
class OrderSpec:
    """An order as it was understood.

    Attributes:
        windows: ranges of the day [min]; none: all day.
        context: density and background numbers that every scene shall have.
        even: whether times of day have equal shares of it, else those of traffic.
    """

    quotas: tuple[Quota, ...]
    windows: tuple[tuple[int, int], ...] = ()
    context: SceneContext = field(default_factory=SceneContext)
    even: bool = True

    @property
    def count(self) -> int:
        """Scenes in all."""
        return sum(quota.count for quota in self.quotas)

    def lines(self) -> list[str]:
        """What was understood, for people."""
        times = ", ".join(
            f"{format_clock(start)}-{format_clock(end)}" for start, end in self.windows
        )
        parts = [f"{q.count} x {q.name} ({len(q.leaves)} patterns)" for q in self.quotas]
        hours = "evenly" if self.even else "as in traffic"
        return [
            *parts,
            f"time of day: {times or 'any'}; density: {self.context.density or 'any'}",
            f"shares: patterns and places evenly, times of day {hours}",
        ]


def read_order(text: str) -> OrderSpec:
    """The wish that an order in plain language amounts to.

    Raises:
        InputError: it names no counts, a kind that no relation file serves, shares or several times
            of day, or what no scene can have.
    """
    words = _split_words(text)
    quotas: list[Quota] = []
    rest: list[str] = []
    at = 0
    while at < len(words):
        counted = _parse_count(words, at)
        if counted is None:
            rest.append(words[at])
            at += 1
            continue
        count, begin = counted
        end = _end_of(words, begin)
        quotas += _parse_quotas(words[begin:end], count)
        at = end
    if not quotas or not all(quota.count for quota in quotas):
        raise InputError(
            f"the order names no count of scenes of a known kind; say, for instance, {EXAMPLE}; "
            f"{_KNOWN_KINDS}"
        )
    said = " ".join(rest)
    even = not _AS_IN_TRAFFIC.search(said)
    said = _AS_IN_TRAFFIC.sub(" ", said)
    named = " ".join(found["what"] for found in _EVENLY.finditer(said) if found["what"])
    others = {*named.replace(",", " ").split()} - {"and", "all", "of", "day"} - {*_SHARED}
    if others:
        known = ", ".join(_SHARED)
        raise InputError(f"an order cannot balance {sorted(others)[0]!r}; it balances {known}")
    said = _EVENLY.sub(" ", said)
    _refuse_unread(said)
    wish = OrderSpec(tuple(_merge_quotas(quotas)), *_parse_setting(said), even)
    if wish.count > MOST:
        raise InputError(f"an order is of at most {MOST} scenes, this one of {wish.count}")
    return wish


def _split_words(text: str) -> list[str]:
    """Words and numbers in lower case; a full stop or comma stays a word of its own."""
    plain = text.lower().replace("t-bone", "tbone").replace("e-scooter", "escooter")
    plain = plain.replace("near-miss", "near miss")
    plain = plain.replace("near misses", "near_misses").replace("near miss", "near_miss")
    plain = re.sub(r"(?<=[a-z])-(?=[a-z])", " ", plain)
    return re.findall(r"-?\d+(?:[:.]\d+)?|[a-z_]+(?:'[a-z]+)?|[,.;]", plain)


def _parse_count(words: list[str], at: int) -> tuple[int, int] | None:
    """A count that begins here and is one of events: (count, where what is counted begins)."""
    found = _number(words, at)
    if found is None:
        return None
    count, begin = found
    # What follows a count of events are words of the taxonomy; "8 am" and "2 lanes" are none.
    if begin < len(words) and words[begin] in ("am", "pm", "o'clock"):
        return None
    span = words[begin : _end_of(words, begin)]
    if {"background", "other"} & set(span):
        return None
    stems = [_make_singular(word) for word in span if word not in _EMPTY]
    known = {part for pattern in load_patterns() for part in _list_vocabulary(pattern)}
    named = any(_find_kind(word) for word in span) or any(
        stem in known or stem in _RIDERS or _MEANS.get(stem) for stem in stems
    )
    each = bool({"each", "every", "scene", "scenes", "event", "events"} & set(span))
    return (count, begin) if named or each else None


def _number(words: list[str], at: int) -> tuple[int, int] | None:
    if words[at].isdigit():
        return int(words[at]), at + 1
    total = current = 0
    begin = at
    while at < len(words):
        word = words[at]
        if word in _NUMBER_WORDS:
            current += _NUMBER_WORDS[word]
        elif word in _LARGE and (at > begin):
            current = max(current, 1) * _LARGE[word]
            if word == "thousand":
                total, current = total + current, 0
        elif not (word in ("and", "of") and at > begin and words[at - 1] in ("hundred", "couple")):
            break
        at += 1
    return (total + current, at) if at > begin and total + current else None


def _end_of(words: list[str], begin: int) -> int:
    """Where what is counted ends: a preposition, a comma, or the next count."""
    for at in range(begin, len(words)):
        word = words[at]
        head_on = word == "on" and at > begin and words[at - 1] == "head"
        if (word in _STOPS and not head_on) or word in (",", ".", ";"):
            return at
        if word in ("and", "with") and at + 1 < len(words) and _number(words, at + 1) is not None:
            return at
    return len(words)


def _find_kind(word: str) -> str | None:
    stem = _make_singular(word)
    return next((kind for kind, names in _KINDS.items() if stem in names), None)


def _make_singular(word: str) -> str:
    for end, without in (("sses", "ss"), ("shes", "sh"), ("misses", "miss"), ("s", "")):
        if word.endswith(end) and not word.endswith("ss"):
            return word.removesuffix(end) + without
    return word


def _parse_quotas(span: list[str], count: int) -> list[Quota]:
    """The quota that a counted phrase asks for; `of each` makes one for every pattern."""
    kinds = dict.fromkeys(kind for word in span if (kind := _find_kind(word)))
    if NORMAL in kinds:
        return [Quota(NORMAL, count, NORMAL)]
    wanted = [part for word in span for part in _get_meaning(word, bool(kinds))]
    found = [
        pattern
        for pattern in load_patterns()
        if (not kinds or pattern.relation in kinds)
        and all(
            any(
                known == part or (len(part) > 3 and known.startswith(part))
                for known in _list_vocabulary(pattern)
            )
            for part in wanted
        )
    ]
    if not found:
        raise InputError(f"no relation is a {' '.join(span)[:60]!r}; {_KNOWN_KINDS}")
    if {"each", "every"} & set(span):
        return [_build_quota(pattern.id.replace("_", "-"), count, [pattern]) for pattern in found]
    found = [each for each in found if each.is_common] or found
    if len(kinds) == 1:
        quotas = [_build_quota(_name(span, next(iter(kinds))), count, found)]
    else:
        quotas = _spread(found, count)
    riders = {_RIDERS[stem] for word in span if (stem := _make_singular(word)) in _RIDERS}
    return [replace(quota, rider=min(riders) if len(riders) == 1 else None) for quota in quotas]


def _build_quota(name: str, count: int, found: list[Pattern]) -> Quota:
    event = EVENT_OF_RELATION[found[0].relation]
    return Quota(name, count, event, tuple(pattern.id for pattern in found))


def _spread(found: list[Pattern], count: int) -> list[Quota]:
    """A count without a kind: even over the kinds of events, each named by its own."""
    kinds: dict[str, list[Pattern]] = {}
    for pattern in found:
        kinds.setdefault(EVENT_OF_RELATION[pattern.relation], []).append(pattern)
    share, more = divmod(count, len(kinds))
    return [
        _build_quota(name, share + (number < more), patterns)
        for number, (name, patterns) in enumerate(kinds.items())
        if share + (number < more)
    ]


def _get_meaning(word: str, kind_named: bool) -> list[str]:
    """What a word asks of a pattern; words of the kind itself and empty ones ask nothing."""
    stem = _make_singular(word)
    if word in _EMPTY or word == "and":
        return []
    if stem in _RIDERS:
        return ["rider"]
    if stem in _MEANS:
        return _MEANS[stem]
    return [] if kind_named and _find_kind(word) else [stem]


def _list_vocabulary(pattern: Pattern) -> frozenset[str]:
    text = f"{pattern.id} {pattern.theme} {pattern.subtype}".lower().replace("_", " ")
    return frozenset(_make_singular(word) for word in re.findall(r"[a-z]+", text))


def _name(span: list[str], kind: str) -> str:
    """`rear-end-collision`: what was said, without empty words."""
    said = [_make_singular(w) for w in span if w not in _EMPTY and not _find_kind(w) and w != "and"]
    return "-".join([*said, EVENT_OF_RELATION[kind].replace("_", "-")])[:40]


def _merge_quotas(quotas: list[Quota]) -> Iterator[Quota]:
    """One quota for each kind, in the order in which they were named first."""
    names = dict.fromkeys((quota.name, quota.event, quota.rider) for quota in quotas)
    for name, event, rider in names:
        same = [q for q in quotas if (q.name, q.event, q.rider) == (name, event, rider)]
        leaves = dict.fromkeys(leaf for quota in same for leaf in quota.leaves)
        yield Quota(name, sum(quota.count for quota in same), event, tuple(leaves), rider=rider)


def _refuse_unread(rest: str) -> None:
    """Refuse what an order says besides counts, one time of day and the traffic."""
    if shares := _SHARES.search(rest):
        raise InputError(
            f"an order has counts, no shares ({shares[0]!r}): what it leaves open it shares out "
            "evenly; say how many of each kind, or `times as in traffic`"
        )
    times = [*time_words_in(rest), *re.findall(_CLOCK, rest)]
    if len({*times}) > 1 and not re.search(r"\b(?:between|from|to|until)\b", rest):
        raise InputError(
            f"an order has one time of day, this one {' and '.join(times)}; make an order for each"
        )
    if unknown := list_unknown_words(rest, None):
        named = ", ".join(f"'{each.words}' ({each.evidence})" for each in unknown)
        raise InputError(f"the order says what no scene can have: {named}; {_KNOWN_KINDS}")


_SHARES = re.compile(r"\b(?:proportion\w*|percent|share\w*)\b")
_SHARED: list[str] = WORDS["lists"]["shared"]
_ANY_SHARED = "|".join(_SHARED)
_AS_IN_TRAFFIC = re.compile(rf"\b(?:{_ANY_SHARED})(?: of (?:the )?day)? as in (?:real )?traffic\b")
_EVENLY = re.compile(
    rf"\b(?:evenly|equally)(?: (?:spread|over|across|and|,|the|all|of day|{_ANY_SHARED})\b)*|"
    r"\b(?P<what>(?:[a-z]+ (?:, )?(?:and |, ))*[a-z]+) balanced\b"
)
_CLOCK = r"\b\d{1,2}(?:[:.]\d\d)? (?:am|pm)\b|\b\d{1,2}:\d\d\b"


def _parse_setting(rest: str) -> tuple[tuple[tuple[int, int], ...], SceneContext]:
    """Time and context in what is left of the order, read as an instruction is."""
    facts = {"instruction": f"Ordinary traffic {rest}", "previous": None, "legs": _LEGS}
    reply = load_backend().answer(Question(task="plan", facts=facts))
    context = SceneContext.model_validate(reply.get("context") or {})
    named = time_words_in(rest)[:1]
    spans = VOCABULARY["times_of_day"][named[0]]["ranges"] if named else []
    if not named and context.time_of_day is not None:
        spans = [context.time_of_day]
    windows: list[tuple[int, int]] = []
    for span in spans:
        ends = [60 * int(part[:2]) + int(part[3:]) for part in span.split("-")]
        begin, end = ends[0], ends[-1]
        windows += [(begin, end)] if begin <= end else [(begin, 24 * 60), (0, end)]
    return tuple(windows), context.model_copy(update={"time_of_day": None})
