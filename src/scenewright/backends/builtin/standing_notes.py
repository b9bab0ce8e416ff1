"""Short texts all about a vehicle that stands and those who meet it, read word by word.

"Broken-down hatchback in the right lane; the following car goes around it" names the two in
fragments, which the readings of sentences miss. Here every word must be of a known kind, such as
who stands, who comes, what it does and where; a text with any other word is left to those readings.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Literal

from scenewright.backends.builtin.encounters import SPEED_TOLERANCE, TO_METRES, VERBS, find_kind
from scenewright.backends.builtin.reader.words import find_subtype
from scenewright.backends.builtin.standing import STATE, VEHICLE, allow, join_any
from scenewright.scene.account import Became, SaidSpan
from scenewright.scene.base import AgentClass, Compass, Movement
from scenewright.scene.social import (
    AgentNode,
    Encounter,
    Meeting,
    ObjectNode,
    SceneContext,
    SocialGraph,
)

_MAKES = join_any(
    "hatchbacks?", "sedans?", "saloons?", "estates?", "station wagons?", "volvos?", "toyotas?",
    "fords?", "bmws?", "golfs?", "hondas?", "audis?", "sports? cars?", "company cars?",
)  # fmt: skip
_VEHICLE = f"(?:school |delivery |city |old |rental |family )?(?:{VEHICLE}|{_MAKES})"
_DRIVER = join_any("guy", "man", "woman", "lady", "dude", "driver", "mum", "mom", "dad", "one")
_THE = allow(
    join_any("an?", "the", "one", "1", "some", "this", "that", "my", "his", "her", then=" ")
)
_STANDS = join_any(STATE, "stationary", "standing", "stopped", "halted", "immobile", "breakdown",
                 "broken down", "dead", "motionless", "unattended")  # fmt: skip
_BROKE = join_any(
    "broken[- ]down", "stalled(?: dead)?", "dead", "died", "stopped working", "conked out",
    "given up", "packed up", "(?:a )?flat ty?i?re", "run out of (?:fuel|petrol|gas)", "stopped",
    "parked", "double[- ]parked", "stationary", "stranded", "disabled", "unloading", "standing",
    "stuck", "abandoned", "not moving",
)  # fmt: skip
_HAS = join_any("(?:'s| is| was| has| had)(?: just| been| completely)*", "(?: just)?")
_REASON = join_any(
    ",? ?(?:and )?(?:it |he |she )?(?:has|with|having) (?:a flat ty?i?re|no fuel|engine trouble|"
    "its hazards? (?:lights )?on|hazards? (?:lights )?(?:on|flashing))",
    "(?:is )?not waiting (?:for|at) (?:a|the) (?:red )?light",
    "to (?:let|drop) (?:me|him|her|us|them|someone|somebody|a passenger) (?:out|off)",
    "waiting f(?:o)?r (?:someone|somebody|a passenger|a fare):?", "unlit",
)  # fmt: skip
_SIDE = join_any("north", "south", "east", "west", then="(?:ern)?") + r"\b"
_SHORT_SIDE = r"[nsew](?= (?:lane|approach|leg|exit|arm|side)\b)"
_LANE = r"(?P<lane>right|left|near(?:side)?|kerb|curb|inner|outer)?(?:[- ]?side)? ?lane(?: of)?"
_LEG = join_any("approach", "leg", "arm", "side", "street", "road", "entry", "lane", "exit")
_FROM = join_any("all from", "(?:coming |driving |arriving )?(?:out )?(?:from|of)", "both from")
_VERB_AFTER = r"(?: (?:it|him|her|us|them|that|the (?:obstacle|obstruction|wreck)))?\b"

_SECONDS = r"(?P<seconds>\d+(?:[.,]\d+)?) ?(?:s|secs?|seconds)\b"
_SPEED = r"(?P<speed>\d+(?:[.,]\d+)?) ?(?P<unit>km/h|kph|kmh|mph|m/s)"
_METRES = r"(?P<metres>\d+(?:[.,]\d+)?) ?(?:m|metres?|meters?)\b"

_HOW: dict[Encounter, str] = {
    "waits_then_passes": (
        "(?:waits?|stops?|pauses?)(?: (?:behind|there))?(?: it)?"
        f"(?: (?:for )?(?:about )?{_SECONDS}|(?: for)? a (?:bit|moment|while)| briefly)?"
        f"(?:,| and)?(?: and)? then (?:{VERBS['goes_round']}|overtakes){_VERB_AFTER}"
    ),
    "stops_short": join_any(
        "(?:brakes? hard(?:er)? and )?(?:stops?|stopping|halts?) (?:just |only just |right )"
        f"(?:short of|before|behind){_VERB_AFTER}",
        f"(?:almost|nearly|narrowly misses|just misses|barely misses) ?(?:{VERBS['hits']})?"
        f"{_VERB_AFTER}",
        f"(?:brakes?|braking) hard(?: (?:for|behind))?{_VERB_AFTER}",
    ),
    "queues": f"(?:queues?|lines? up|queue up)(?: (?:up )?behind)?{_VERB_AFTER}",
    "waits_behind": join_any(
        f"(?:{VERBS['waits_behind']}){_VERB_AFTER}", "stays? put", "waits?", "holds? back",
        f"(?:stays|remains) (?:behind|stopped)(?: behind)?{_VERB_AFTER}",
    ),
    "goes_round": join_any(
        "moves over(?: at the last moment)?(?:, revealing)?", "had to steer past" + _VERB_AFTER,
        f"(?:{VERBS['goes_round']}){_VERB_AFTER}", "goes a?round", "pulls round",
    ),
    "hits": join_any(
        f"(?:{VERBS['hits']}){_VERB_AFTER}", "can'?t avoid(?: it)?", "cannot avoid(?: it)?",
        "(?:does not|doesn'?t) (?:stop|brake)(?: in time)?(?: for it)?",
    ),
}  # fmt: skip

_KINDS: dict[str, str] = {
    "taken_back": r"^.{3,80}?(?:no,? (?:wait,? )?)?(?:scrap|scratch|strike|forget|ignore) that\.?",
    "clock": r"(?:at )?(?:about |around |approx\.? )?(?P<clock>(?:[01]?\d|2[0-3]):[0-5]\d)",
    "denied": join_any(
        "no (?:trouble|contact|collision|crash|accident|problem)", "nobody (?:crashes|is hurt)",
        "neither (?:of them )?passes", "(?:no ?one|nobody) (?:passes|crashes|gets hurt|hits .*)",
        "nothing (?:else )?happens", "without (?:contact|touching(?: it)?|incident)",
    ),
    **{f"do {how}": words for how, words in _HOW.items()},
    "object": join_any(
        f"{_THE}(?:[a-z]+ )?{_STANDS} {_VEHICLE}",
        f"{_THE}{_VEHICLE}{_HAS} {_BROKE}", f"{_THE}{_DRIVER}{_HAS} {_BROKE}",
        f"{_DRIVER} (?:stopped|parked) (?:the|her|his) {_VEHICLE}",
        f"{_THE}{_VEHICLE} stands", f"{_THE}{_VEHICLE} in front of me has {_BROKE}",
    ),
    "reason": _REASON,
    "exit": f"(?:at |on |in )?(?:the )?(?:mouth of )?(?:the )?(?P<leg>{_SIDE}|[nsew]) exit",
    "turn": f"turn(?:s|ing) (?P<turn>left|right)(?: out of the (?P<leg>{_SIDE}))?"
    "|(?:goes|going|carries on|continues) (?P<on>straight)(?: on| ahead| through)?",
    "heading": f"(?P<leg>{_SIDE[:-2]})bound",
    "from": f"{_FROM} (?:the )?(?P<leg>{_SIDE})",
    "place": (
        f"(?:(?:in|on|at|of|standing on) )?(?:the )?(?:{_LANE},? )?(?:(?:of|on|at) )?(?:the )?"
        f"(?P<leg>{_SIDE}|{_SHORT_SIDE}) {_LEG}"
    ),
    "lane": f"(?:in |on )?(?:the |its )?{_LANE}",
    "spot": join_any(
        "(?:just |right |directly )?(?:short of|before|by|at|near) the (?:line|stop line|junction|"
        "intersection|lights)", "in front of (?:me|us|it|them)", "ahead(?: of (?:me|it|us))?",
        "(?:standing |blocking )?(?:in )?(?:the|its|one|my) (?:lane|way)",
    ),
    "speed": (
        "(?:at |with |by )?(?:a tiny bit )?\\(?(?:at )?(?:approx\\.? |about |around |roughly )?"
        f"{_SPEED}\\)?"
    ),
    "gap": f"{_METRES} (?:short|behind(?: it)?|away)",
    "agent": join_any(
        r"(?P<many>two|2|both|three|3) (?P<noun>cars|vehicles|vans|trucks|taxis)(?: behind)?",
        "(?P<rider>(?:an? |the )?(?:e-?scooter(?: rider)?|cyclist|bicycle|bike|biker))",
        "(?:the |a |1 |my |our |another )?(?:first |second |next |following |other )?"
        f"(?P<vehicle>{_VEHICLE})(?: \\d)?"
        "(?: (?:coming |comes |arriving )?(?:from )?behind(?: it)?)?",
        r"(?P<me>i|we|(?:the )?ego|insured|(?:the )?lead(?: (?:car|vehicle))?|1 that)",
    ),
    "manner": join_any(
        "checks(?: and)?", "slowly", "carefully", "safely", "that'?s it", "please", "just",
        "i need", "in time", "calmly", "patiently", "cautiously", "to notice late", "comes up",
        "comes along",
    ),
    "filler": join_any(
        "and", "but", "then", "so", "the", "a", "there(?:'s| is)", "is", "it", "one", "who", "that",
        "which", "while", "behind", "from behind", "comes", "coming", "with", "standing",
    ),
}  # fmt: skip
_PATTERNS = {
    kind: re.compile(rf"(?:{words})(?![\w-])", re.IGNORECASE) for kind, words in _KINDS.items()
}
_BLANK = re.compile(r"[\s,;:.!()–—-]+")

_MOST_WORDS = 60
"""Longer texts are stories, and left to the readings."""


@dataclass(frozen=True)
class _Word:
    """Words of one kind, with where they are."""

    kind: str
    match: re.Match[str]

    @property
    def leg(self) -> Compass | None:
        """The leg that they name."""
        short = (self.match.groupdict().get("leg") or "").lower()
        return next((leg for leg in _LEGS if short and leg.startswith(short[:1])), None)

    def tell(
        self, became: Became, agents: Sequence[str] = (), value: str | None = None
    ) -> SaidSpan:
        """Their line of the account."""
        words = self.match[0].strip(" ,")
        start = self.match.start() + self.match[0].index(words)
        return SaidSpan.model_validate(
            {
                "start": start, "end": start + len(words), "words": words, "became": became,
                "agents": tuple(agents), "value": value,
            }
        )  # fmt: skip


_LEGS: tuple[Compass, ...] = ("north", "south", "east", "west")
_OPPOSITE: dict[Compass, Compass] = {
    "north": "south", "south": "north", "east": "west", "west": "east",
}  # fmt: skip


@dataclass
class _Actor:
    """Who meets what stands, as far as it is known; named once or more often."""

    names: list[_Word]
    type: AgentClass
    subtype: str | None
    entry: Compass | None = None
    movement: Movement | None = None
    how: Encounter | None = None
    did: _Word | None = None
    figure: tuple[float, float] | None = None
    said: list[tuple[_Word, Became, str | None]] = field(default_factory=list)

    @property
    def noun(self) -> str:
        """How it was named first, without the article."""
        return self.names[0].match[0].lower().removeprefix("the ").removeprefix("a ")


def read_notes(text: str) -> SocialGraph | None:
    """The graph of a text that is all about who meets what stands; None if it is not that."""
    words = _split(text)
    if words is None or len(words) > _MOST_WORDS:
        return None
    objects = [each for each in words if each.kind == "object"]
    if not objects or not any(each.kind.startswith("do ") for each in words):
        return None
    actors = _find_actors(words)
    if not actors or any(each.how is None for each in actors) or len(actors) > 4:
        return None
    try:
        return _build(words, objects[0], actors)
    except ValueError:
        return None


def _split(text: str) -> list[_Word] | None:
    """The text as words of known kinds; None if one is of none."""
    found, at = [], 0
    while at < len(text):
        blank = _BLANK.match(text, at)
        if blank:
            at = blank.end()
            continue
        word = max(_list_kinds(text, at), key=lambda each: each.match.end(), default=None)
        if word is None:
            return None
        found.append(word)
        at = word.match.end()
    return found


def _list_kinds(text: str, at: int) -> Iterator[_Word]:
    for kind, pattern in _PATTERNS.items():
        match = pattern.match(text, at)
        if match and match.end() > at:
            yield _Word(kind, match)


def _find_actors(words: Sequence[_Word]) -> list[_Actor]:
    """Who comes, each with what is said of it after it is named."""
    actors: list[_Actor] = []
    for word in words:
        if word.kind == "agent":
            _add_actors(actors, word)
        elif actors:
            _add_saying(actors, word)
    doing = [each for each in actors if each.how is not None]
    return sorted(doing, key=lambda each: each.did.match.start() if each.did else 0)


def _add_actors(actors: list[_Actor], word: _Word) -> None:
    """Those that the words name, unless they name who is there already: "i", "it", "car 1"."""
    said = word.match[0].lower()
    noun = said.removeprefix("the ").removeprefix("a ")
    known = [each for each in actors if each.noun == noun]
    for each in known:
        each.names.append(word)
        actors.remove(each)
    actors += known
    if known:
        return
    rides = word.match.groupdict().get("rider")
    type_: AgentClass = "vehicle"
    if rides:
        type_ = "scooter" if "scooter" in rides.lower() else "cyclist"
    many = {"two": 2, "2": 2, "both": 2, "three": 3, "3": 3}.get(
        (word.match.groupdict().get("many") or "").lower(), 1
    )
    subtype = None if rides else find_subtype(said)
    actors += [_Actor([word], type_, subtype) for _ in range(many)]


def _add_saying(actors: list[_Actor], word: _Word) -> None:
    """What is said of who was named last."""
    same = [each for each in actors if each.names[0] is actors[-1].names[0]]
    for each in same:
        match word.kind:
            case "turn":
                each.movement = "straight" if word.match["on"] else _read_turn(word)
                each.said.append((word, "movement", each.movement))
                each.entry = word.leg or each.entry
            case "heading" if word.leg is not None:
                each.entry = _OPPOSITE[word.leg]
                each.said.append((word, "entry", each.entry))
            case "from" if word.leg is not None and not word.match[0].lower().startswith("all"):
                each.entry = word.leg
                each.said.append((word, "entry", each.entry))
            case kind if kind.startswith("do ") and each.how is None:
                each.how, each.did = _HOW_OF[kind], word
                each.figure = _read_figure(word)
            case "speed" if each.how == "hits":
                each.figure = _read_figure(word)
                each.said.append((word, "encounter", None))
            case "gap" if each.how in ("waits_behind", "stops_short"):
                each.figure = _read_figure(word)
                each.said.append((word, "encounter", None))


_HOW_OF: dict[str, Encounter] = {f"do {how}": how for how in _HOW}
_TOLERANCE = {"speed": SPEED_TOLERANCE, "seconds": 0.15, "metres": 0.3}
"""Of plain numbers [m/s, s, m] (SEMANTICS 8)."""


def _read_turn(word: _Word) -> Movement:
    return "left" if word.match["turn"].lower() == "left" else "right"


def _read_figure(word: _Word) -> tuple[float, float] | None:
    """The number in the words with its tolerance on either side; None if there is none."""
    groups = word.match.groupdict()
    for name, tolerance in _TOLERANCE.items():
        if groups.get(name):
            value = float(groups[name].replace(",", "."))
            value *= TO_METRES[groups["unit"].lower()] if name == "speed" else 1.0
            return round(max(value - tolerance, 0.0), 3), round(value + tolerance, 3)
    return None


def _build(words: Sequence[_Word], standing: _Word, actors: Sequence[_Actor]) -> SocialGraph | None:
    """The graph; None where the words do not go together.

    Raises:
        ValueError: they ask for what no graph can hold.
    """
    places = [each for each in words if each.kind in ("place", "exit")]
    froms = [each for each in words if each.kind == "from" and each.leg]
    legs = dict.fromkeys(each.leg for each in places)
    shared = next((each.leg for each in froms if not _is_of_actor(each, actors)), None)
    leg = next(iter(legs), shared)
    if len(legs) > 1 or (leg is None and any(each.entry for each in actors)):
        leg = actors[0].entry if len(legs) <= 1 else None
        if leg is None:
            return None
    side = "exit" if any(each.kind == "exit" for each in places) else "entry"
    names = _name(actors)
    nodes = tuple(
        AgentNode.model_validate(
            {
                "id": name, "type": each.type, "subtype": each.subtype, "movement": each.movement,
                "entry": each.entry or (leg if side == "entry" else None),
                "exit": leg if side == "exit" and each.movement is None else None,
            }
        )
        for name, each in zip(names, actors, strict=True)
    )  # fmt: skip
    meetings: list[Meeting] = []
    for name, each in zip(names, actors, strict=True):
        meetings.append(_meet(name, each, meetings))
    thing = ObjectNode.model_validate(
        {
            "id": "object-1", "kind": find_kind(standing.match[0], meetings[0].encounter),
            "subtype": find_subtype(standing.match[0]), "leg": leg, "lane": _find_lane(words),
            "side": None if leg is None else side, "met_by": meetings[0].agent,
            "encounter": meetings[0].encounter, "figure": meetings[0].figure,
            "others": tuple(meetings[1:]),
        }
    )  # fmt: skip
    clock = next((each.match["clock"] for each in words if each.kind == "clock"), None)
    context = SceneContext(time_of_day=None if clock is None else clock.zfill(5))
    said = tuple(_tell(words, actors, names, thing, clock))
    return SocialGraph(agents=nodes, context=context, objects=(thing,), said=said)


def _is_of_actor(word: _Word, actors: Sequence[_Actor]) -> bool:
    return any(word is told for each in actors for told, _, _ in each.said)


def _name(actors: Sequence[_Actor]) -> list[str]:
    types = [each.type for each in actors]
    return [f"{type_}-{types[: n + 1].count(type_)}" for n, type_ in enumerate(types)]


def _meet(name: str, actor: _Actor, before: Sequence[Meeting]) -> Meeting:
    """Only the first that waits does so behind the object itself; the next stand behind that."""
    how = actor.how or "waits_behind"
    stands = any(each.encounter in ("waits_behind", "queues", "stops_short") for each in before)
    if how in ("queues", "waits_behind"):
        how = "queues" if stands else "waits_behind"
    return Meeting(agent=name, encounter=how, figure=actor.figure)


def _find_lane(words: Sequence[_Word]) -> Literal["left", "right"] | None:
    """The lane that the words name, if any; that at the kerb is the right one."""
    named = [each.match["lane"].lower() for each in words if each.match.groupdict().get("lane")]
    if not named:
        return None
    return "left" if named[0] in ("left", "inner") else "right"


def _tell(
    words: Sequence[_Word],
    actors: Sequence[_Actor],
    names: Sequence[str],
    thing: ObjectNode,
    clock: str | None,
) -> Iterator[SaidSpan]:
    """The account of the words, in their order."""
    what = thing.describe()
    plain: dict[str, tuple[Became, str | None]] = {
        **dict.fromkeys(("object", "reason", "spot", "place", "lane", "exit"), ("object", what)),
        "clock": ("time_of_day", str(clock).zfill(5)), "denied": ("normal", None),
        "taken_back": ("retracted", None), "manner": ("manner", None),
    }  # fmt: skip
    for word in words:
        own = [pair for pair in zip(names, actors, strict=True) if _is_said_of(word, pair[1])]
        if word.kind in plain:
            became, value = plain[word.kind]
            yield word.tell(became, (), value)
        elif word.kind == "from" and not own:
            yield word.tell("entry", names, word.leg)
        elif word.kind != "filler":
            yield from _tell_of_actors(word, own, thing)


def _is_said_of(word: _Word, actor: _Actor) -> bool:
    return any(word is each for each in (*actor.names, actor.did, *(w for w, _, _ in actor.said)))


def _tell_of_actors(
    word: _Word, own: Sequence[tuple[str, _Actor]], thing: ObjectNode
) -> Iterator[SaidSpan]:
    """The account of words about those who come.

    Raises:
        ValueError: they are said of no agent.
    """
    if not own:
        raise ValueError(f"'{word.match[0]}' is said of no agent")
    names = [name for name, _ in own]
    if word.kind == "agent":
        yield word.tell("agent", names, own[0][1].subtype)
        return
    meanings = [(became, value) for w, became, value in own[0][1].said if w is word]
    for became, value in meanings:
        if became != "encounter":
            yield word.tell(became, names, value)
    hows = {each.agent: each.encounter for each in thing.list_meetings()}
    if not meanings or meanings[0][0] == "encounter":
        for name in names:
            yield word.tell("encounter", (name,), f"{thing.id} {hows[name]}")
