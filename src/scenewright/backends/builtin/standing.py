"""Phrases about stationary objects, found by a small grammar and blanked out for the planner.

"A woman steps out from behind a parked truck and is hit by a car" is read as "A woman steps out
and is hit by a car"; the truck becomes an object of the plan that hides the woman from the car.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from scenewright.backends.builtin.draft import Refused
from scenewright.backends.builtin.reader.numbers import TO_TWENTY
from scenewright.backends.builtin.reader.words import find_subtype
from scenewright.scene.account import SaidSpan
from scenewright.scene.base import RIDERS
from scenewright.scene.social import (
    MOST_OBJECTS,
    AgentNode,
    ObjectKind,
    ObjectNode,
    SocialGraph,
)


def join_any(*words: str, then: str = "") -> str:
    """One of some words, each with the same to follow."""
    return f"(?:{'|'.join(words)}){then}"


def allow(pattern: str) -> str:
    """The pattern, or nothing."""
    return f"(?:{pattern})?"


STATE = allow(join_any("illegally", "legally", "badly", then=" ")) + join_any(
    r"double[- ]?parked", r"parked(?:[- ]up)?", "stalled", "stranded", "broken[- ]down",
    "disabled", "abandoned", "unloading",
)  # fmt: skip
AT_REST = join_any(STATE, "stationary", "standing", "stopped", "waiting", "halted")
_KIND_OF_VEHICLE = join_any(
    "delivery", "moving", "removal", "panel", "box", "dump", "tow", "garbage", "bin", "fire",
    "police", "school", "city", "tour", "courier", "white", "red", "blue", "big", "large", "tall",
    "small", "long", "heavy", "cargo", then=" ",
)  # fmt: skip
VEHICLE = f"(?:{_KIND_OF_VEHICLE})*" + join_any(
    "cars?", "vans?", "trucks?", "lorr(?:y|ies)", "bus(?:es)?", "coach(?:es)?", "taxis?", "cabs?",
    "suvs?", "pick-?ups?", "vehicles?", "minivans?", "minibus(?:es)?", "motorcycles?",
    "motorbikes?", "mopeds?", "ambulances?", "hgvs?", "tankers?", "campers?", "jeeps?", "sedans?",
)  # fmt: skip
_KIND_OF_THING = join_any(
    "large", "big", "tall", "metal", "litter", "rubbish", "trash", "garbage", "wheelie",
    "recycling", "shipping", "construction", "waste", "electrical", "utility", "switch", "control",
    "telephone", "phone", "news", "market", "wooden", "storage", then=" ",
)  # fmt: skip
THING = f"(?:{_KIND_OF_THING})*" + join_any(
    "bins?", "trash cans?", "dustbins?", "dumpsters?", "skips?", "containers?", "kiosks?",
    "cabinets?", "box(?:es)?", "booths?", "stalls?", "newsstands?",
)  # fmt: skip
THE = allow(join_any("an?", "the", "one", "another", "some", then=" "))
_ADJECTIVES = r"(?:(?!and\b|of\b|by\b|is\b|hits?\b)[\w-]+,? ){0,2}?"
_THAT_IS = allow(r" (?:that|which) (?:is|was|has)")
BUS_AT_STOP = (
    f"{THE}{_ADJECTIVES}(?:bus|coach){_THAT_IS}{allow(' (?:standing|stopped|waiting|stopping)')}"
    " (?:at|in) (?:a|the|its) (?:bus )?(?:stop|bay)"
)
STANDING_VEHICLE = join_any(
    f"{THE}{_ADJECTIVES}{STATE} {_ADJECTIVES}{VEHICLE}", f"{THE}{VEHICLE}{_THAT_IS} {STATE}"
)
_STANDS = join_any(BUS_AT_STOP, STANDING_VEHICLE, f"{THE}{THING}")
_RESTS = join_any(
    _STANDS, f"{THE}{_ADJECTIVES}{AT_REST} {VEHICLE}", f"{THE}{VEHICLE} {AT_REST}",
    f"{THE}{VEHICLE}",
)  # fmt: skip
"""What hides a road user stands, whether the text says so or not: "from behind a bus"."""

_COMPASS = r"(?:north|south|east|west)(?:ern)?(?:bound)?"
_ON = join_any(
    f"(?:on|at|in|along) the {_COMPASS}"
    + allow(" (?:leg|arm|approach|exit|side|street|road|entry|kerb|curb|sidewalk|pavement)")
    + "(?! ?(?:cross|zebra))",
    f"{join_any('before', 'by', 'at', 'near', 'beside', 'in front of', 'next to', 'ahead of')} the "
    f"{allow(_COMPASS + ' ')}"
    + join_any("crosswalk", "zebra crossing", "crossing", "corner", "kerb", "curb", "kerbside",
           "curbside", "bus stop", "stop line", "intersection", "junction"),
    "(?:on|by|at|along) the (?:sidewalk|pavement|roadside|kerb|curb|side|street|road)"
    + allow(" of the (?:road|street)"),
    "in (?:the|a|its) " + allow("(?:right|left|outer|inner|parking) ") + "(?:lane|bay)",
    "there",
)  # fmt: skip
PLACE = allow(
    f",? {allow(join_any('standing', 'parked', 'waiting', then=' '))}"
    f"{allow(join_any('right', 'just', 'directly', 'close', 'shortly', then=' '))}{_ON}"
)
_SECONDS = rf"(?P<seconds>\d+(?:[.,]\d+)?|{'|'.join(TO_TWENTY)}|half a)"
_EVENT = join_any(
    "impact", "collision", "crash", "contact", "conflict", "near[- ]miss", "event", "incident",
    "encounter", "meet", "hit",
)  # fmt: skip
_LEAD = allow(
    ",? "
    + f"(?:{join_any('and', 'but', 'is', 'was', 'only', 'just', 'first', 'becomes', then=' ')})*"
    + allow(join_any("until", "till", "up to", "visible", "seen", "in(?:to)? (?:view|sight)"))
    + f"(?: {join_any('only', 'just', 'about', 'for', 'from', 'at', 'some')})*"
    + rf" ?{_SECONDS}[ -]?(?:s|secs?|seconds?)\b"
    + allow(f" (?:before|prior to|ahead of) {allow('(?:the|they|it|an?) ')}{_EVENT}")
)
_DRIVER = r"(?:driver|car|van|truck|bus|vehicle|taxi|motorcycle|motorcyclist)"
_WALKER = r"(?:pedestrian|woman|man|child|boy|girl|walker|person|kid|jogger|runner)"
_VIEW = r"(?:view|sight|line of sight|sightline|vision)"
_HIDDEN = (
    join_any("hidden", "obscured", "occluded", "concealed", "masked", "screened", "blocked",
           "covered", "obstructed", "shielded", "invisible", "unseen", "not visible",
           "out of (?:sight|view)")
    + allow(f" (?:from|to|for) (?:{_VIEW}|the {_DRIVER}{allow(chr(39) + 's ' + _VIEW)})")
    + allow(" (?:at first|initially)")
    + " (?:by|behind|because of)"
)  # fmt: skip
_BLOCKED_VIEW = (
    allow(join_any("because", "as", "since", "while", "with", "and", then=" "))
    + rf"(?:the {_DRIVER}(?:'s)?|its|his|her|their|the) {allow('driver.s ')}{_VIEW}"
    + allow(r" of (?:the \w+|her|him|them|it)")
    + allow(" (?:is|was|being|gets|got)")
    + " (?:blocked|obstructed|obscured|hidden|restricted|occluded) by"
)
_CANNOT_SEE = (
    allow(join_any("and", "but", "who", "whose driver", "the driver", then=" "))
    + join_any(
        "cannot", "can't", "could not", "couldn't", "does not", "doesn't", "did not", "didn't"
    )
    + r" see (?:the \w+|her|him|them|it) (?:because of|due to|past|behind|for)"
)
_WHO = join_any(
    ",? ?(?:who|that|which) (?:(?:is|was|had been|has been|were) )?", ",? ?(?:is|was|being) ", ""
)
_OUT = r"(?P<out>(?:emerg(?:es?|ed|ing)|appear(?:s|ed|ing)?|(?:com(?:es?|ing)|came|pops?) out) )?"

_HIDING = re.compile(
    rf"(?:,? ?(?:{_BLOCKED_VIEW}|{_CANNOT_SEE})|"
    rf"{_WHO}(?:{_HIDDEN}|{_OUT}(?P<behind>(?:from )?behind))) "
    rf"(?P<object>{_RESTS}){PLACE}{_LEAD}",
    re.IGNORECASE,
)
"""A road user comes from behind an object, is hidden by it, or a view is blocked by it."""
_BETWEEN = re.compile(
    rf"{_WHO}{_OUT}(?:from )?(?:in )?between (?P<object>"
    rf"(?:(?:two|some|the|several|a row of|rows of) )?{_ADJECTIVES}parked {VEHICLE})"
    rf"{PLACE}{_LEAD}",
    re.IGNORECASE,
)
"""A pedestrian comes out between two vehicles at the kerb."""
_STANDS_FOR_SURE = re.compile(_STANDS, re.IGNORECASE)

_HIDES = re.compile(
    rf"(?P<object>{_STANDS}){PLACE},? (?:that |which )?"
    + join_any("hides?", "conceals?", "obscures?", "occludes?", "screens?", "masks?", "blocks?",
           "covers?", "obstructs?", "shields?")
    + rf" (?:(?P<walker>an? (?:\w+ )?{_WALKER})(?: (?:who|that)(?: then)?)?"
    + rf"|the {_WALKER}|her|him|them"
    + rf"|(?:the |his |her |its )?{allow(_DRIVER + '.s ')}{_VIEW})"
    + rf"(?: (?:of|to|from) (?:the (?:{_WALKER}|{_DRIVER})|her|him|{_VIEW})(?:'s {_VIEW})?)*"
    + _LEAD,
    re.IGNORECASE,
)  # fmt: skip
"""An object hides a road user or blocks a view."""

_SEEN = re.compile(
    r",? ?(?P<words>(?:and |but )?(?:(?:who|she|he|it|that) )?"
    r"(?:(?:is|was|becomes|became|only|first|just) )*"
    r"(?:seen|visible|in (?:view|sight)|(?:comes|came) into (?:view|sight))"
    rf"(?: (?:only|just|about|for|from|at))* {_SECONDS}[ -]?(?:s|secs?|seconds?)\b"
    rf" (?:before|prior to|ahead of) (?:(?:the|they|it|an?) )?{_EVENT})",
    re.IGNORECASE,
)
"""When a hidden pedestrian is first seen, said apart from what hides it."""

_THERE = re.compile(
    ",? ?"
    + allow(join_any("and", "while", "where", then=" "))
    + join_any("there(?:'s| is| are| stands?)", "with", "past", "next to", "beside", "near")
    + f" (?P<object>{_STANDS}){allow(' (?:standing|waiting|parked|stands)')}{PLACE}"
    + f"|(?P<subject>{_STANDS}) (?:is|stands|sits|waits|has (?:stalled|broken down))"
    + f"{allow(' (?:standing|parked|waiting|there)')}{PLACE}"
    + f"|(?P<parked>{THE}{VEHICLE} (?:is|was|has|stands|has been) {STATE}){PLACE}"
    + rf"|(?P<alone>^{THE}{VEHICLE} {STATE}){PLACE}(?=\s*[;:.])",
    re.IGNORECASE,
)
"""An object is there."""

_ADDED = re.compile(
    r"(?:please |now |then |also )*(?:add|put|place|park|include|insert|have|let) "
    rf"(?P<object>{_STANDS})(?: (?:stand|be|there))?{PLACE}"
    r"(?P<hides>,? (?:so )?(?:that |which |to )?(?:it )?"
    rf"(?:hid(?:es?|ing)|block(?:s|ing)?|conceals?|obscures?) [\w' ]+?{_LEAD})?[.!]?$",
    re.IGNORECASE,
)
"""A turn of a conversation adds an object."""

_EXIT = re.compile(r"\bexit\b|\b(?:after|past|beyond) the\b", re.IGNORECASE)
_LEG = re.compile(r"\b(north|south|east|west)(?!bound)", re.IGNORECASE)
_TOLERANCE = 0.15
"""Of a time that is asked for [s] (SEMANTICS 8)."""


@dataclass(frozen=True)
class StandingPhrase:
    """Words about something that stands.

    Attributes:
        start, end: characters of the text; object: the words that name it.
        hides: whether it hides a road user; lead: how long before the event it is seen [s];
            seen: characters that say that elsewhere; between: whether two of them stand there, and
            a pedestrian comes out between them.
    """

    start: int
    end: int
    words: str
    object: str
    hides: bool = False
    lead: tuple[float, float] | None = None
    seen: tuple[int, int] | None = None
    between: bool = False

    def make_node(self, number: int) -> ObjectNode:
        """The object as a part of the plan."""
        kind = _find_kind(self.words)
        leg = _LEG.search(self.words)
        vehicle = kind in ("parked", "double_parked", "stalled")
        return ObjectNode.model_validate(
            {
                "id": f"object-{number}",
                "kind": kind,
                "subtype": find_subtype(self.object) if vehicle else None,
                "leg": leg[1].lower() if leg else None,
                "side": "exit" if _EXIT.search(self.words) else None,
            }
        )


def take_out(text: str) -> tuple[str, tuple[StandingPhrase, ...]]:
    """A text without its words about what stands, as long as before, and those words."""
    found: list[StandingPhrase] = []
    for pattern in (_BETWEEN, _HIDES, _HIDING, _THERE):
        for match in pattern.finditer(text):
            phrase = _read(match, hides=pattern is not _THERE)
            if phrase is not None:
                phrase = replace(phrase, between=pattern is _BETWEEN)
                found.append(phrase)
                text = text[: match.start()] + _fill(match) + text[match.end() :]
    found.sort(key=lambda each: each.start)
    return _take_lead(text, found)


def _take_lead(text: str, found: list[StandingPhrase]) -> tuple[str, tuple[StandingPhrase, ...]]:
    """Said apart from the object: "..., seen only 1 s before the impact"."""
    match = _SEEN.search(text)
    hiding = [each for each in found if each.hides and each.lead is None]
    if match is None or len(hiding) != 1:
        return text, tuple(found)
    phrase = replace(hiding[0], lead=_read_seconds(match["seconds"]), seen=match.span("words"))
    text = text[: match.start()] + " " * len(match[0]) + text[match.end() :]
    return text, tuple(phrase if each is hiding[0] else each for each in found)


def _read(match: re.Match[str], *, hides: bool) -> StandingPhrase | None:
    groups = match.groupdict()
    if _is_only_follow(groups):
        return None
    named = next(filter(None, map(groups.get, ("object", "subject", "parked", "alone"))), None)
    lead = _read_seconds(groups.get("seconds"))
    words = match[0].strip(" ,")
    start = match.start() + match[0].index(words)
    return StandingPhrase(start, start + len(words), words, named or "", hides, lead)


def _is_only_follow(groups: Mapping[str, str | None]) -> bool:
    """Whether the words are "behind a bus" alone, which drives for all that is said."""
    bare = groups.get("behind") == "behind" and not groups.get("out")
    return bare and _STANDS_FOR_SURE.fullmatch(groups.get("object") or "") is None


def _fill(match: re.Match[str]) -> str:
    """What takes the place of the words: blanks, or a verb if they are all that an agent does."""
    verb = match.groupdict().get("out")
    whole = match[0]
    if match.groupdict().get("walker"):  # "hides a child who runs out": it is named only here
        before, after = match.start("walker") - match.start(), match.end() - match.end("walker")
        return " " * before + match["walker"] + " " * after
    if verb and not re.match(r",? ?(?:who|that|which)\b", whole, re.IGNORECASE):
        walks = "walking" if verb.strip().endswith("ing") else "walks"
        lead = whole.lower().index(verb.lower())
        return (" " * lead + walks).ljust(len(whole))[: len(whole)]
    return " " * len(whole)


def _find_kind(words: str) -> ObjectKind:
    low = words.lower()
    if re.search(r"double[- ]?parked|in the lane\b", low):
        return "double_parked"
    if re.search(r"stalled|stranded|broken|disabled|has stalled", low):
        return "stalled"
    if re.search(r"\b(?:bus|buses|coach|minibus)\b", low) and "parked" not in low:
        return "bus_stop"
    if re.search(rf"\b{VEHICLE}\b", low):
        return "parked"
    return find_thing(words)


def find_thing(words: str) -> ObjectKind:
    """The kind of something that is no vehicle."""
    low = words.lower()
    if re.search(r"container|skip|dumpster", low):
        return "container"
    return "bin" if re.search(r"\b(?:dust)?bins?\b|trash can", low) else "box"


def _read_seconds(words: str | None) -> tuple[float, float] | None:
    if not words:
        return None
    low = words.lower().replace(",", ".")
    spelt = {word: float(number) for number, word in enumerate(TO_TWENTY)} | {"half a": 0.5}
    value = spelt[low] if low in spelt else float(low)
    return round(max(value - _TOLERANCE, 0.0), 3), round(value + _TOLERANCE, 3)


def add_objects(graph: SocialGraph, phrases: Sequence[StandingPhrase], text: str) -> SocialGraph:
    """The graph with the objects that a text speaks of, and the account of their words.

    Raises:
        Refused: it is not clear which agents an object hides from which, or there are too many.
    """
    if len(phrases) > MOST_OBJECTS:
        raise Refused("out_of_scope", f"At most {MOST_OBJECTS} standing objects can be placed.")
    for phrase in phrases:
        graph = _read_as_time(graph, phrase)
    # Not the verbs that stand in for words about objects.
    said = [e for e in graph.said if not any(p.start <= e.start < p.end for p in phrases)]
    nodes = list(graph.objects)
    for phrase in phrases:
        node = phrase.make_node(len(nodes) + 1)
        became = SaidSpan(
            start=phrase.start, end=phrase.end, words=phrase.words, became="object",
            value=node.describe(),
        )  # fmt: skip
        said.append(became)
        if phrase.hides:
            driver, walker = find_pair(graph, phrase)
            hidden = {"hides": walker, "hidden_from": driver, "lead": phrase.lead}
            node = node.model_copy(update=hidden)
            sight = {"became": "sight", "agents": (driver, walker), "value": node.id}
            said.append(became.model_copy(update=sight))
            if phrase.seen is not None:
                start, end = phrase.seen
                words = text[start:end]
                said.append(
                    said[-1].model_copy(update={"start": start, "end": end, "words": words})
                )
            graph = _let_cross(graph, walker)
        nodes.append(node)
        if phrase.between:
            beyond = {"hides": None, "hidden_from": None, "lead": None, "beyond": node.id}
            nodes.append(node.model_copy(update={"id": f"object-{len(nodes) + 1}", **beyond}))
            said.append(became.model_copy(update={"value": nodes[-1].describe()}))
            graph = _let_jaywalk(graph, walker)
    said.sort(key=lambda each: each.start)
    made = graph.model_copy(update={"objects": tuple(nodes), "said": tuple(said)})
    return SocialGraph.model_validate(made.model_dump(by_alias=True))


def _read_as_time(graph: SocialGraph, phrase: StandingPhrase) -> SocialGraph:
    """The graph in which "until 1.5 s before a car hits her" says when, not who passes first."""
    begins = range(phrase.end, phrase.end + 2)
    orders = [e for e in graph.said if e.became == "order" and e.start in begins]
    if phrase.lead is None or not orders or orders[0].words.lower() != "before":
        return graph
    (order, *_), pair = orders, set(orders[0].agents)
    edges = tuple(
        e.model_copy(update={"first": None}) if {e.from_, e.to} == pair else e
        for e in graph.relations
    )
    sight = order.model_copy(update={"became": "sight"})
    said = tuple(sight if each is order else each for each in graph.said)
    return graph.model_copy(update={"relations": edges, "said": said})


def _let_jaywalk(graph: SocialGraph, walker: str) -> SocialGraph:
    agents = (let_jaywalk(each) if each.id == walker else each for each in graph.agents)
    return graph.model_copy(update={"agents": tuple(agents)})


def let_jaywalk(agent: AgentNode) -> AgentNode:
    """No vehicle parks on a crosswalk: pedestrians between two vehicles cross beside it."""
    free = agent.crosswalk is None and agent.type == "pedestrian"
    return agent.model_copy(update={"movement": "jaywalking"}) if free else agent


def _let_cross(graph: SocialGraph, name: str) -> SocialGraph:
    """The graph in which a rider of that name crosses; pedestrians have a verb in the text."""
    agents = (
        let_cross(each) if each.id == name and each.type in RIDERS else each
        for each in graph.agents
    )  # fmt: skip
    return graph.model_copy(update={"agents": tuple(agents)})


def let_cross(agent: AgentNode) -> AgentNode:
    """An agent that comes out from behind an object crosses the road, if nothing else is said."""
    return agent if agent.movement else agent.model_copy(update={"movement": "crossing"})


def find_addition(words: str) -> tuple[StandingPhrase, ...]:
    """What a turn of a conversation adds: "put a parked truck at the kerb so that it hides her"."""
    match = _ADDED.match(" ".join(words.split()))
    if match is None:
        return ()
    lead = _read_seconds(match["seconds"])
    return (
        StandingPhrase(0, len(words), words, match["object"], match["hides"] is not None, lead),
    )


def find_pair(graph: SocialGraph, phrase: StandingPhrase) -> tuple[str, str]:
    """The driver and the pedestrian of the event in which the phrase hides the pedestrian."""
    pairs = list(_list_pairs(graph))
    walkers = dict.fromkeys(walker for _, walker in pairs)
    if not walkers:
        raise Refused(
            "out_of_scope",
            f"'{phrase.words}' says that something is hidden, and only a pedestrian or rider that "
            "a vehicle hits, nearly hits or gives way to can be; say such an event.",
        )
    named = _find_nearest(graph, phrase)
    if named is not None and _is_one_of_several(graph, named):
        raise Refused(
            "out_of_scope",
            f"'{phrase.words}' seems to hide several, and one pedestrian can be hidden; say one of "
            "them.",
        )
    if named is not None and named.startswith("vehicle"):
        raise Refused(
            "out_of_scope",
            f"'{phrase.words}' seems to hide {named}, and no vehicle can be hidden; say "
            "the agent that comes out: 'a pedestrian steps out from behind a parked truck'.",
        )
    walker = named if named in walkers else next(iter(walkers))
    if named not in walkers and len(walkers) > 1:
        raise Refused(
            "out_of_scope", f"It is not clear which agent '{phrase.words}' hides; name it."
        )
    return next(pair for pair in pairs if pair[1] == walker)


def _is_one_of_several(graph: SocialGraph, name: str) -> bool:
    """Whether the words for the agent are those for others, too: "two children"."""
    said = [each for each in graph.said if each.became == "agent"]
    spans = {(each.start, each.end) for each in said if name in each.agents}
    return len({a for each in said if (each.start, each.end) in spans for a in each.agents}) > 1


def _list_pairs(graph: SocialGraph) -> Iterator[tuple[str, str]]:
    types = {agent.id: agent.type for agent in graph.agents}
    for edge in graph.relations:
        pair = sorted((edge.from_, edge.to), key=lambda name: types[name] != "vehicle")
        if [types[name] == "vehicle" for name in pair] == [True, False]:
            yield pair[0], pair[1]


def _find_nearest(graph: SocialGraph, phrase: StandingPhrase) -> str | None:
    """The agent mentioned last before the words, if they say that it comes out or is hidden.

    What blocks a view is said of no agent in particular.
    """
    if re.match(r".*\b(?:view|sight|sightline|see|vision)\b", phrase.words, re.IGNORECASE):
        return None
    before = [
        each
        for each in graph.said
        if each.became == "agent" and each.end <= phrase.start + 1 and len(each.agents) == 1
    ]
    return max(before, key=lambda each: each.end).agents[0] if before else None
