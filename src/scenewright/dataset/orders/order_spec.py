"""What an order asks for: how many scenes of which kinds, at which hours, in how much traffic."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace

from scenewright.backends import Question, load_backend
from scenewright.errors import InputError
from scenewright.scene.base import AgentClass
from scenewright.scene.events import EVENT_OF_RELATION
from scenewright.scene.relations import Pattern, load_patterns
from scenewright.scene.social import SceneContext
from scenewright.tools.account import list_unknown_words

NORMAL = "normal"
MOST = 100_000
EXAMPLE = '"40 collisions and 50 yields at rush hour"'


def _list(words: str) -> list[str]:
    return words.split()


_UNITS = _list(
    "zero one two three four five six seven eight nine ten eleven twelve thirteen fourteen fifteen "
    "sixteen seventeen eighteen nineteen"
)
_TENS = _list("zero ten twenty thirty forty fifty sixty seventy eighty ninety")
_LARGE = {"hundred": 100, "thousand": 1000, "dozen": 12, "score": 20}
_NUMBER_WORDS = {
    **{word: value for value, word in enumerate(_UNITS)},
    **{word: 10 * value for value, word in enumerate(_TENS) if value > 1},
    "a": 1, "an": 1, "couple": 2,
}  # fmt: skip
_KINDS: Mapping[str, frozenset[str]] = {
    "collide_at": frozenset(
        _list("collision crash accident strike impact collide hit wreck tbone")
    ),
    "near_miss": frozenset(["near_miss", "miss", "call", "near"]),
    "yield_to": frozenset(_list("yield yielding giveway give way")),
    "follow": frozenset(_list("follow following platoon")),
    NORMAL: frozenset(_list("normal ordinary uneventful quiet plain regular routine")),
}
"""Words that name a relation."""
_MEANS: Mapping[str, tuple[str, ...]] = {
    "ped": ("pedestrian",), "walker": ("pedestrian",), "strike": ("pedestrian", "strike"),
    "car": ("vehicle",), "veh": ("vehicle",), "cars": ("vehicle",),
    "tbone": ("straight", "crossing"), "angle": ("straight", "crossing"),
    "jaywalking": ("mid", "block"), "jaywalker": ("mid", "block"), "midblock": ("mid", "block"),
    "turning": ("turn",), "oncoming": ("opposite",), "rearend": ("rear", "end"),
    "headon": ("head",), "swipe": ("sideswipe",), "on": (),
}  # fmt: skip
"""Synonyms of words of the taxonomy."""
_RIDERS: Mapping[str, AgentClass] = {
    "cyclist": "cyclist", "bicyclist": "cyclist", "bicycle": "cyclist", "bike": "cyclist",
    "scooter": "scooter", "escooter": "scooter",
}  # fmt: skip
"""Words that name a class of riders; the relations know riders alone."""
_EMPTY = frozenset(
    _list(
        "scene scenes event events of the a an with case cases example examples call calls close "
        "different varied various diverse some more kind kinds type types each every pattern "
        "patterns leaf leaves conflict conflicts traffic safety critical situation all any"
    )
)
_STOPS = frozenset(
    _list(
        "at in on during around about between before after by from for over under near as please "
        "where when while which that who"
    )
)
_WINDOWS: Mapping[str, tuple[tuple[int, int], ...]] = {
    "morning rush": ((390, 600),), "evening rush": ((930, 1170),), "afternoon rush": ((930, 1170),),
    "rush hour": ((390, 600), (930, 1170)), "rush": ((390, 600), (930, 1170)),
    "early morning": ((240, 510),), "dawn": ((270, 450),), "lunch": ((660, 870),),
    "noon": ((660, 780),), "morning": ((390, 720),), "afternoon": ((720, 1080),),
    "dusk": ((990, 1290),), "late night": ((1290, 1440), (0, 240)),
    "midnight": ((1410, 1440), (0, 30)),
    "evening": ((1020, 1320),), "night": ((1140, 1440), (0, 330)),
}  # fmt: skip
"""Words for times -> ranges [minutes of the day] (SEMANTICS section 3), the longest first."""
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
    """

    quotas: tuple[Quota, ...]
    windows: tuple[tuple[int, int], ...] = ()
    context: SceneContext = field(default_factory=SceneContext)

    @property
    def count(self) -> int:
        """Scenes in all."""
        return sum(quota.count for quota in self.quotas)

    def lines(self) -> list[str]:
        """What was understood, for people."""
        times = ", ".join(
            f"{_format_clock(start)}-{_format_clock(end)}" for start, end in self.windows
        )
        parts = [f"{q.count} x {q.name} ({len(q.leaves)} patterns)" for q in self.quotas]
        return [*parts, f"time of day: {times or 'any'}; density: {self.context.density or 'any'}"]


def _format_clock(minute: int) -> str:
    return f"{minute // 60 % 24:02d}:{minute % 60:02d}"


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
    _refuse_unread(" ".join(rest))
    wish = OrderSpec(tuple(_merge_quotas(quotas)), *_parse_setting(" ".join(rest)))
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
    return [replace(each, rider=min(riders) if len(riders) == 1 else None) for each in quotas]


def _build_quota(name: str, count: int, found: list[Pattern]) -> Quota:
    event = EVENT_OF_RELATION[found[0].relation]
    return Quota(name, count, event, tuple(pattern.id for pattern in found))


def _spread(found: list[Pattern], count: int) -> list[Quota]:
    """A count without a kind: even over the patterns, each named by its event."""
    share, more = divmod(count, len(found))
    quotas: dict[str, list[tuple[Pattern, int]]] = {}
    for number, pattern in enumerate(found):
        quotas.setdefault(EVENT_OF_RELATION[pattern.relation], []).append(
            (pattern, share + (number < more))
        )
    return [
        Quota(name, sum(n for _, n in each), name, tuple(p.id for p, n in each if n))
        for name, each in quotas.items()
        if sum(n for _, n in each)
    ]


def _get_meaning(word: str, kind_named: bool) -> tuple[str, ...]:
    """What a word asks of a pattern; words of the kind itself and empty ones ask nothing."""
    stem = _make_singular(word)
    if word in _EMPTY or word == "and":
        return ()
    if stem in _RIDERS:
        return ("rider",)
    if stem in _MEANS:
        return _MEANS[stem]
    return () if kind_named and _find_kind(word) else (stem,)


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
            f"an order has counts, no shares ({shares[0]!r}); say how many of each kind, and "
            "`coverage --fill` orders what a dataset lacks"
        )
    left, times = rest, list[str]()
    for pattern in (*(rf"\b{words}\b" for words in _WINDOWS), _CLOCK):
        times += re.findall(pattern, left)
        left = re.sub(pattern, " ", left)
    if len({*times}) > 1 and not re.search(r"\b(?:between|from|to|until)\b", rest):
        raise InputError(
            f"an order has one time of day, this one {' and '.join(times)}; make an order for each"
        )
    if unknown := list_unknown_words(rest, None):
        named = ", ".join(f"'{each.words}' ({each.evidence})" for each in unknown)
        raise InputError(f"the order says what no scene can have: {named}; {_KNOWN_KINDS}")


_SHARES = re.compile(r"\b(?:balanced?|evenly|equal(?:ly)?|spread|proportion\w*|percent|share\w*)\b")
_CLOCK = r"\b\d{1,2}(?:[:.]\d\d)? (?:am|pm)\b|\b\d{1,2}:\d\d\b"


def _parse_setting(rest: str) -> tuple[tuple[tuple[int, int], ...], SceneContext]:
    """Time and context in what is left of the order, read as an instruction is."""
    facts = {"instruction": f"Ordinary traffic {rest}", "previous": None, "legs": _LEGS}
    reply = load_backend().answer(Question(task="plan", facts=facts))
    context = SceneContext.model_validate(reply.get("context") or {})
    named = next((_WINDOWS[words] for words in _WINDOWS if re.search(rf"\b{words}\b", rest)), None)
    if named is None and context.time_of_day is not None:
        ends = [60 * int(part[:2]) + int(part[3:]) for part in context.time_of_day.split("-")]
        named = ((ends[0], ends[-1]),)
    return named or (), context.model_copy(update={"time_of_day": None})
