"""Words about a vehicle in an agent's way: read by a small grammar, before the readings.

"A car goes around a stalled van" is read as "A car drives"; the van becomes an object of the plan
that the car goes round.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace

from scenewright.backends.builtin.draft import Refused
from scenewright.backends.builtin.lazy_pattern import LazyPattern
from scenewright.backends.builtin.reader.words import find_subtype
from scenewright.backends.builtin.standing import (
    AT_REST,
    BUS_AT_STOP,
    PLACE,
    STANDING_VEHICLE,
    STATE,
    THE,
    VEHICLE,
    allow,
    join_any,
)
from scenewright.scene.account import SaidSpan
from scenewright.scene.base import Compass
from scenewright.scene.social import (
    MOST_OBJECTS,
    AgentNode,
    Encounter,
    ObjectKind,
    ObjectNode,
    SocialGraph,
)

_MOVES = join_any(
    "go(?:es|ing)?", "went", "driv(?:es?|ing)", "drove", "steer(?:s|ing|ed)?",
    "swerv(?:es?|ing|ed)",
    "pull(?:s|ing|ed)?",
    "mov(?:es?|ing|ed)", "man(?:oeu|eu)v(?:re|er)(?:s|ing|ed)?",
    "veer(?:s|ing|ed)?", "squeez(?:es?|ing|ed)", "gets?", "getting", "got", "edg(?:es?|ing|ed)",
    "rid(?:es?|ing)", "rode", "cycl(?:es?|ing|ed)", "weav(?:es?|ing)", "wove", "nos(?:es?|ing|ed)",
    "creep(?:s|ing)?", "crept", "swing(?:s|ing)?", "swung", "shift(?:s|ing|ed)?",
    "navigat(?:es?|ing|ed)", "detour(?:s|ing|ed)?", "work(?:s|ing|ed)? its way",
    "mak(?:es?|ing) its way", "chang(?:es?|ing|ed) lanes?",
    "cross(?:es|ing|ed)? (?:over )?the (?:cent(?:er|re) ?|lane ?)line", "slip(?:s|ping|ped)?",
)  # fmt: skip
_OVER = allow(
    " " + join_any("out", "over", "aside", "left", "right", "wide", "slightly", "carefully",
                 "slowly", "to the left", "to the right", "to (?:one|the|its) (?:other )?side")
)  # fmt: skip
VERBS: dict[Encounter, str] = {
    "stops_short": join_any(
        "(?:brakes? hard(?:er)? (?:for .{2,30} )?and )?(?:stop(?:s|ping|ped)?|halt(?:s|ing|ed)?) "
        "(?:just|only just|right|barely) (?:short of|before|behind)",
        "(?:almost|nearly|narrowly|barely|just|very nearly) (?:avoids? (?:hitting|running into)|"
        "(?:hit(?:s|ting)?|str(?:ikes?|iking|uck)|rear[- ]?end(?:s|ing|ed)?|rams?|"
        "(?:crash(?:es|ing|ed)?|runs?|running|ran|driv(?:es?|ing)|drove|slam(?:s|med)?|"
        "smash(?:es|ed)?|plough(?:s|ed)?|bump(?:s|ed)?) (?:straight |right )?into"
        "(?: the (?:back|rear) of)?|collid(?:es?|ing|ed) with))",
        "(?:narrowly|just|barely) miss(?:es|ing|ed)?", "has a near[- ]miss with",
        "(?:brakes?|braking|braked) (?:hard|sharply|late) (?:for|behind)",
    ),
    "goes_round": join_any(
        f"{_MOVES}{_OVER} (?:a?round|past|by|clear of)",
        f"{_MOVES}{_OVER} (?:and|to) "
        "(?:avoids?|pass(?:es)?|clears?|overtakes?|(?:gets?|goes?) (?:a?round|past))",
        "pass(?:es|ing|ed)?(?: by)?", "overtak(?:es?|ing)", "overtook", "avoid(?:s|ing|ed)?",
        "bypass(?:es|ing|ed)?",
    ),
    "waits_behind": allow("(?:slows?(?: down)?|brak(?:es?|ing)|slowing) and ")
    + join_any(
        "stop(?:s|ping|ped)?", "halt(?:s|ing|ed)?", "wait(?:s|ing|ed)?", "stand(?:s|ing)?",
        "queu(?:es?|ing|ed)", "(?:is|gets?|was|got|being) (?:stuck|held up|trapped|stopped)",
        "com(?:es?|ing) to (?:a )?(?:complete |full )?(?:stop|halt|standstill|rest)",
        "brak(?:es?|ing|ed) to (?:a )?(?:stop|halt|standstill)", "(?:pulls?|pulling) up",
    )
    + allow(" and (?:waits?|stays|stands|stops|queues)")
    + " (?:short of|behind|for|because of|due to|before)",
    "hits": join_any(
        "hit(?:s|ting)?", "str(?:ikes?|iking|uck)", "collid(?:es?|ing|ed) with",
        "(?:crash(?:es|ing|ed)?|runs?|running|ran|driv(?:es?|ing)|drove|slam(?:s|ming|med)?|"
        "ram(?:s|ming|med)?|smash(?:es|ing|ed)?|plough(?:s|ing|ed)?|plow(?:s|ing|ed)?|"
        "bump(?:s|ing|ed)?|bang(?:s|ing|ed)?|skid(?:s|ding|ded)?) (?:straight |right )?into"
        "(?: the (?:back|rear|side) of)?",
        "rear[- ]?end(?:s|ing|ed)?", "ram(?:s|ming|med)?", "side-?swip(?:es?|ing|ed)",
        "scrap(?:es?|ing|ed)", "clip(?:s|ping|ped)?",
        "(?:fails?|failing|failed) to (?:stop|brake)(?: in time)? (?:for|behind)(?: and hits)?",
    ),
}  # fmt: skip
_PASSIVE: dict[Encounter, str] = {
    "goes_round": "(?:passed|overtaken|avoided|bypassed|driven (?:a?round|past))",
    "waits_behind": "(?:waited for)",
    "hits": "(?:hit|struck|rear[- ]?ended|rammed|side-?swiped|scraped|clipped|crashed into|"
    "run into|driven into)",
    "stops_short": "(?:almost|nearly|narrowly) (?:hit|struck|rear[- ]?ended|missed|run into)",
}
_HAS_TO = allow(join_any("(?:has|had|have) to", "must", "manages to", "needs to", "is", "was",
                       "safely", "then", "slowly", "carefully", then=" "))  # fmt: skip
_BROKEN = f"{THE}{VEHICLE} (?:that |which )?(?:has|had) (?:broken down|stalled|stopped|died)"
_AT_LIGHT = (
    r"(?! (?:at|for|by|behind|before|in front of) (?:an?|the)?(?: \w+)? ?"
    "(?:red|amber|light|signal|stop line|cross|zebra|queue|pedestrian|junction|line))"
)
"""Objects that stand there take part in the traffic."""
_STOOD = join_any(STATE, "stationary", "standing", "stopped", "halted")
_THING = (
    join_any(
        BUS_AT_STOP, _BROKEN, STANDING_VEHICLE, f"{THE}(?:[\\w-]+ ){{0,2}}?{_STOOD} {VEHICLE}",
        f"{THE}{VEHICLE} (?:that (?:is|was) )?{_STOOD}",
    )
    + _AT_LIGHT
)  # fmt: skip
_TAIL = (
    allow(" (?:right |directly |straight )?ahead(?: of (?:it|him|her))?")
    + allow(" (?:standing |stopped |stuck )?(?:in|blocking|obstructing) "
            "(?:its|his|her|the|one|a) (?:\\w+ )?(?:lane|way|path|road)")
    + PLACE
)  # fmt: skip
_STOPS = allow(" and (?:just |then )?(?:waits?|stays|stops|stands)(?: there| behind it)?")
_HALTS = (
    "(?:stops|waits|halts|comes to a (?:stop|halt|standstill))"
    + allow(" and (?:waits|stays|stands)")
    + "(?! (?:for|behind|before|at))"
)
_NOT = re.compile(
    r"(?:\b(?:almost|nearly|narrowly|barely|not|never|without|instead of)|n't|\bfail\w* to)"
    r"(?: \w+)? $",
    re.IGNORECASE,
)
_MEETS = join_any(
    "com(?:es?|ing) (?:up )?(?:to|up(?: |)on|across|behind|towards?)", "approach(?:es|ing|ed)?",
    "encounter(?:s|ing|ed)?", "meet(?:s|ing)?", "finds", "reach(?:es|ing)?", "sees",
    "driv(?:es?|ing) (?:up to|towards?)",
)  # fmt: skip
_AND = ",? (?:and |but |then |so |and so |and then )?(?:it |he |she )?"
_IT = f"(?:it|the (?:obstacle|obstruction|{AT_REST} )?(?:{VEHICLE}|obstacle|obstruction)|them)"
_BLOCKS = allow(
    " "
    + join_any("(?:is|stands|sits|waits|lies)" + allow(f" {AT_REST}"),
             "(?:partly |partially )?(?:blocks|obstructs|is blocking|blocking)"
             " (?:the |a |one |its )?(?:\\w+ )?(?:lane|road|way|street|traffic)")
)  # fmt: skip

_ACTIVE = {
    how: LazyPattern(
        rf"(?:{_MEETS} )?{_HAS_TO}(?P<verb>{verb}) (?P<object>{_THING}){_TAIL}"
        + (_STOPS if how == "waits_behind" else ""),
    )
    for how, verb in VERBS.items()
}
_FOR_A_WHILE = allow(
    " (?:for )?(?:about )?"
    + join_any(r"(?P<seconds>\d+(?:\.\d+)?) ?(?:s|secs?|seconds?)\b", "a (?:bit|while|moment)")
)
_THEN_PASSES = rf"(?:,? and|,)? (?:then |after that )(?:{VERBS['goes_round']}) {_IT}"
_WAITING = join_any("waits?", "waiting", "stops?(?: and waits)?", "stands", "pauses", "queues")
_ACTIVE["waits_then_passes"] = LazyPattern(
    rf"{_HAS_TO}(?P<verb>{_WAITING}){_FOR_A_WHILE} behind (?P<object>{_THING}){_TAIL}"
    rf"{_THEN_PASSES}",
)
_MET_FIRST = {
    how: LazyPattern(
        rf"(?P<verb>{_MEETS}) (?P<object>{_THING}){_TAIL}{_AND}{_HAS_TO}"
        + (join_any(f"{verb} {_IT}{_STOPS}", _HALTS) if how == "waits_behind" else f"{verb} {_IT}"),
    )
    for how, verb in VERBS.items()
}
_MET_FIRST["waits_then_passes"] = LazyPattern(
    rf"(?P<verb>{_MEETS}) (?P<object>{_THING}){_TAIL}{_AND}{_WAITING}(?: behind {_IT})?"
    rf"{_FOR_A_WHILE}{_THEN_PASSES}",
)
_BY = {
    how: LazyPattern(
        rf"(?P<object>{_THING}){_TAIL} (?:is|gets|was|being) (?P<passive>{verb}) by(?= )",
    )
    for how, verb in _PASSIVE.items()
}
_THERE_FIRST = LazyPattern(
    rf"(?:there(?:'s| is) |with )?(?P<object>{_THING}){_BLOCKS}{_TAIL}[,;.:]?"
    "(?: (?:and|so|while))?",
)
_THEN = {
    how: LazyPattern(
        rf"{_HAS_TO}(?P<verb>{verb}) {_IT}" + (_STOPS if how == "waits_behind" else ""),
    )
    for how, verb in VERBS.items()
}
_DOOR = join_any("(?:driver|passenger|front|car|taxi|van)(?:'s)?(?:[- ]side)? ", "") + "door"
_PARKED = f"{THE}(?:parked |stationary )?{VEHICLE}"
_OPEN = join_any("suddenly ", "") + join_any("opened", "opening", "open", "flung open")
_OPENS = join_any("suddenly ", "") + join_any(
    "opens?", "opened", "is opened", "is flung open", "swings? open", "flies open", "throws? open",
    "flings? open",
)  # fmt: skip
_ITS = join_any("his", "her", "its", "their", "the", "a")
_SOMEONE = join_any(
    f"{THE}(?:driver|passenger|person|man|woman|occupant|someone|somebody)(?: (?:of|in|inside) "
    f"(?P<object>{_PARKED}))?",
    "someone", "somebody",
)  # fmt: skip
_INTO = join_any(
    "(?:right |directly |straight )?in front of", "(?:in)?to the (?:path|way) of", "into", "on",
    "(?:right )?ahead of",
)  # fmt: skip
_RUNS_INTO = (
    f"(?P<verb>(?:{VERBS['hits']})|(?:rid(?:es?|ing)|rode|cycl(?:es?|ing)) (?:straight )?into|"
    "(?:is|gets|was) (?:hit|struck) by)"
)
_DOORED = tuple(
    LazyPattern(_HAS_TO + words + PLACE)
    for words in (
        rf"(?P<verb>(?:(?:is|gets|was|being) )?doored)(?: by (?P<object>{_PARKED}))?",
        rf"{_RUNS_INTO} (?:{THE}|{_ITS} )(?:{_OPEN} )?{_DOOR}(?: {_OPEN})?"
        rf"(?: (?:of|on) (?P<object>{_PARKED}))?",
    )
)
"""Words of who rides into a door, after the agent."""
_OPENED_FOR = LazyPattern(
    rf"(?:{_SOMEONE}(?: (?:suddenly|carelessly))? (?:{_OPENS}) (?:{_ITS} )(?:{_DOOR})"
    rf"(?: of (?P<theirs>{_PARKED}))?"
    rf"|(?:{THE}|a )(?:{_DOOR}) of (?P<vehicle>{_PARKED}) (?:{_OPENS})"
    rf"|(?P<owner>{_PARKED}) (?:{_OPENS}) (?:{_ITS} )(?:{_DOOR})"
    rf"|(?P<whose>{_PARKED})'s (?:{_DOOR}) (?:{_OPENS}))"
    rf"{PLACE} (?:{_INTO})(?= )",
)
"""Words of a door that opens, before the agent."""
_WHO_HITS = LazyPattern(
    rf",? (?:and |who |which |so )*(?:(?:he|she|it|the \w+) )?(?:{VERBS['hits']}|is doored|is hit)"
    rf"(?: (?:by )?(?:it|the (?:opened |open |opening )?{_DOOR}))?(?=[ .,;]|$)",
)
_MAY_STAND = re.compile(
    "door|park|stall|strand|broke|disabled|abandoned|unloading|station|stand|stood|stop|halt|died|bay",
    re.IGNORECASE,
)
"""Without any of these a text says nothing of an object, nor of a door."""
_EXIT = re.compile(
    r"\bexit\b|\b(?:after|past|beyond) the (?:junction|intersection)\b", re.IGNORECASE
)
_LEG = re.compile(r"\b(north|south|east|west)(?!bound)", re.IGNORECASE)
_SPEED = re.compile(
    r"\s*(?:at|doing|with) (?:about |around |some |approximately |roughly )?"
    r"(?P<speed>\d+(?:\.\d+)?) ?(?P<unit>km ?/ ?h|kph|mph|m/s|kmh)\b",
    re.IGNORECASE,
)
TO_METRES = {"km/h": 1 / 3.6, "kph": 1 / 3.6, "kmh": 1 / 3.6, "mph": 0.44704, "m/s": 1.0}
"""Of units of speed [m/s]."""
SPEED_TOLERANCE, WAITING_TOLERANCE = 0.5, 0.15
"""Of plain numbers [m/s, s] (SEMANTICS 8)."""
_WAITED = re.compile(r"(\d+(?:\.\d+)?) ?s", re.IGNORECASE)


_RIDER = re.compile(r"(?:cyclist|bicycl\w+|bike|biker|scooter|e-scooter|rider)\b", re.IGNORECASE)


_ON_FOOT = re.compile(
    r"\b(?:pedestrians?|(?:wo)?m[ae]n|child(?:ren)?|boys?|girls?|kids?|people|person|someone|"
    r"somebody|walkers?|joggers?|runners?|passengers?|cyclists?|riders?)\b",
    re.IGNORECASE,
)
_COMES_FROM = re.compile(r"\b(?:between|behind|by) (?:[\w-]+ ){0,3}[\w-]+$", re.IGNORECASE)
_IN_TURN: tuple[Encounter, ...] = ("waits_then_passes", *VERBS)
"""Encounters, those first whose words hold those of others."""


@dataclass(frozen=True)
class EncounterPhrase:
    """Words that have an agent meet an object.

    Attributes:
        start, end: characters of the text; words: those; object: the words that name it.
        agent_follows: whether the agent that meets it is named after the words, not before.
        named: characters of the words that name the object elsewhere in the text.
        figure: bounds of the speed, where one is said [m/s].
        also: characters of words elsewhere that say the same once more.
    """

    start: int
    end: int
    words: str
    object: str
    how: Encounter
    agent_follows: bool = False
    named: tuple[int, int] | None = None
    figure: tuple[float, float] | None = None
    also: tuple[int, int] | None = None


_HIDES = re.compile(r"\s*(?:by|behind)\b", re.IGNORECASE)
"""At a thing that is not what is hit: "a child hidden by a parked bus is hit by a car"."""


def take_out_encounters(text: str) -> tuple[str, tuple[EncounterPhrase, ...]]:
    """A text with a plain verb in the place of its words about encounters, as long as before.

    Raises:
        Refused: the words ask for more than can be had.
    """
    found: list[EncounterPhrase] = []
    if not _MAY_STAND.search(text):
        return text, ()
    text = _take_doors(text, found)
    for how in _IN_TURN:
        for pattern in (_MET_FIRST[how], _ACTIVE[how]):
            for match in pattern.finditer(text):
                if not _NOT.search(text[: match.start("verb")]):
                    found.append(_read_figure(_read(match, how), text))
                    text = _put(text, match, _choose_verb(match))
                    text = _blank(text, match.end(), found[-1].end)
        for match in _BY[how].finditer(text) if how in _BY else ():
            hides = _HIDES.match(match[0])
            if not (hides or _NOT.search(text[: match.start("passive")])):
                found.append(_read(match, how, agent_follows=True))
                text = _put(text, match, "there is".rjust(len(match[0])))
    if not found:
        text = _take_later(text, found)
    return text, tuple(sorted(found, key=lambda each: each.start))


def _take_doors(text: str, found: list[EncounterPhrase]) -> str:
    """ "A cyclist is doored by a parked taxi", "a driver opens the door in front of a cyclist"."""
    for pattern in _DOORED:
        for match in pattern.finditer(text):
            if not _NOT.search(text[: match.start("verb")]):
                found.append(_read_figure(_read_door(match, agent_follows=False), text))
                text = _put(text, match, "rides" if len(match[0]) >= len("rides") else "")
                text = _blank(text, match.end(), found[-1].end)
    for match in _OPENED_FOR.finditer(text):
        after = _WHO_HITS.search(text, match.end())
        phrase = _read_door(match, agent_follows=True)
        text = _put(text, match, "there is".rjust(len(match[0])))
        if after is not None:
            phrase = replace(phrase, also=after.span())
            text = _blank(text, *after.span())
        found.append(phrase)
    return text


def _read_door(match: re.Match[str], *, agent_follows: bool) -> EncounterPhrase:
    groups = match.groupdict()
    named = (groups.get(each) for each in ("object", "vehicle", "owner", "whose", "theirs"))
    words = match[0].strip(" ,")
    start = match.start() + match[0].index(words)
    thing = next(filter(None, named), None) or "car"
    place = match[0][match[0].find(thing) + len(thing) :] if thing in match[0] else ""
    return EncounterPhrase(
        start, start + len(words), words, f"parked {thing}{place}", "doored", agent_follows
    )


def _take_later(text: str, found: list[EncounterPhrase]) -> str:
    """ "A stalled van blocks the lane and a car goes around it": the object is named before."""
    first = _THERE_FIRST.search(text)
    for how in VERBS:
        match = _THEN[how].search(text, first.end()) if first else None
        if first is None or match is None or _NOT.search(text[: match.start("verb")]):
            continue
        between = text[first.end() : match.start()]
        if match[0].lower().endswith("them") and _ON_FOOT.search(between):
            continue  # "a pedestrian walks out past it and a car hits them"
        if _COMES_FROM.search(text[: first.end("object")]):
            continue  # "a pedestrian walks out between stopped cars and a taxi hits them"
        named = first[0].removesuffix(" and").removesuffix(" so").strip(" ,;.:")
        start = first.start() + first[0].index(named)
        phrase = EncounterPhrase(
            match.start(), match.end(), match[0], named, how, named=(start, start + len(named)),
        )  # fmt: skip
        found.append(_read_figure(phrase, text))
        text = _blank(text, match.end(), found[-1].end)
        text = _put(_put(text, match, _choose_verb(match)), first, "")
        break
    return text


def _read(match: re.Match[str], how: Encounter, *, agent_follows: bool = False) -> EncounterPhrase:
    words = match[0].strip(" ,")
    start = match.start() + match[0].index(words)
    whole = match[0][match.start("object") - match.start() :]
    return EncounterPhrase(start, start + len(words), words, whole, how, agent_follows)


def _put(text: str, match: re.Match[str], words: str) -> str:
    return text[: match.start()] + words.ljust(len(match[0])) + text[match.end() :]


def _choose_verb(match: re.Match[str]) -> str:
    """A verb of the same form, of driving or riding."""
    before = match.string[: match.start()].split()[-4:]
    rides = any(_RIDER.match(word) for word in before)
    if re.match(r"\w+ing\b", match["verb"]):
        return "riding" if rides else "driving"
    return "rides" if rides else "drives"


def _read_figure(phrase: EncounterPhrase, text: str) -> EncounterPhrase:
    """The phrase with the speed of a hit or the seconds of a wait, where the words say them."""
    waits = _WAITED.search(phrase.words) if phrase.how == "waits_then_passes" else None
    if waits is not None:
        return replace(phrase, figure=_widen(float(waits[1]), WAITING_TOLERANCE))
    match = _SPEED.match(text, phrase.end) if phrase.how in ("hits", "doored") else None
    if match is None:
        return phrase
    value = float(match["speed"]) * TO_METRES[match["unit"].lower().replace(" ", "")]
    words = text[phrase.start : match.end()]
    return replace(phrase, end=match.end(), words=words, figure=_widen(value, SPEED_TOLERANCE))


def _widen(value: float, tolerance: float) -> tuple[float, float]:
    return round(max(value - tolerance, 0.0), 3), round(value + tolerance, 3)


def _blank(text: str, start: int, end: int) -> str:
    return text[:start] + " " * max(end - start, 0) + text[max(start, end) :]


def add_encounters(
    graph: SocialGraph, phrases: Sequence[EncounterPhrase], text: str
) -> SocialGraph:
    """The graph with the objects that agents meet, and the account of their words.

    Raises:
        Refused: it is not clear which agent meets an object, or it cannot.
    """
    if len(graph.objects) + len(phrases) > MOST_OBJECTS:
        raise Refused("out_of_scope", f"At most {MOST_OBJECTS} standing objects can be placed.")
    said = [each for each in graph.said if each.end <= len(text)]
    nodes, agents = list(graph.objects), list(graph.agents)
    for phrase in phrases:
        name = _find_agent(graph, phrase)
        node = _make_node(phrase, f"object-{len(nodes) + 1}", name)
        own = next(k for k, each in enumerate(agents) if each.id == name)
        agents[own] = reroute_agent(agents[own], node)
        node = node if node.leg is None else node.model_copy(update=find_side(agents[own], node))
        fields = {"start": phrase.start, "end": phrase.end, "words": phrase.words}
        said = [each for each in said if not phrase.start <= each.start < phrase.end]
        named = phrase.named or (phrase.start, phrase.end)
        thing = {"start": named[0], "end": named[1], "words": phrase.object}
        if phrase.named is None:
            thing = fields
        said.append(
            SaidSpan.model_validate({**thing, "became": "object", "value": node.describe()})
        )
        meets = {"became": "encounter", "agents": (name,), "value": f"{node.id} {phrase.how}"}
        said.append(SaidSpan.model_validate({**fields, **meets}))
        if phrase.also is not None:
            start, end = phrase.also
            again = {"start": start, "end": end, "words": text[start:end]}
            said.append(SaidSpan.model_validate({**again, **meets}))
        nodes.append(node)
    said.sort(key=lambda each: each.start)
    parts = {"agents": tuple(agents), "objects": tuple(nodes), "said": tuple(said)}
    return validate_objects(graph.model_copy(update=parts), phrases[0].words)


def validate_objects(graph: SocialGraph, words: str) -> SocialGraph:
    """The graph, once what stands in it is found to be consistent.

    Args:
        words: those that a refusal quotes.

    Raises:
        Refused: an object cannot be what the words say, such as one that two agents hit.
    """
    try:
        return SocialGraph.model_validate(graph.model_dump(by_alias=True))
    except ValueError as error:
        reason = str(error).split("Value error, ")[-1].split(" [type")[0]
        raise Refused("out_of_scope", f"'{words}': {reason}.") from error


def _find_agent(graph: SocialGraph, phrase: EncounterPhrase) -> str:
    """The vehicle or rider named last before the words, or first after them."""
    types = {agent.id: agent.type for agent in graph.agents}
    drivers = [
        each for each in graph.said
        if len(each.agents) == 1 and types.get(each.agents[0], "pedestrian") != "pedestrian"
    ]  # fmt: skip
    if phrase.agent_follows:
        after = [each for each in drivers if each.start >= phrase.end]
        found = min(after, key=lambda each: each.start, default=None)
    else:
        before = [each for each in drivers if each.start < phrase.start]
        agents = [each for each in before if each.became == "agent"] or before
        found = max(agents, key=lambda each: each.start, default=None)
    if found is None and sum(kind != "pedestrian" for kind in types.values()) == 1:
        return next(name for name, kind in types.items() if kind != "pedestrian")
    if found is None:
        raise Refused(
            "out_of_scope",
            f"It is not clear which agent '{phrase.words}' is said of; "
            "name the vehicle or rider first.",
        )
    return found.agents[0]


def _make_node(phrase: EncounterPhrase, name: str, agent: str) -> ObjectNode:
    leg = _LEG.search(phrase.object)
    return ObjectNode.model_validate(
        {
            "id": name,
            "kind": find_kind(phrase.object, phrase.how),
            "subtype": find_subtype(phrase.object),
            "leg": leg[1].lower() if leg else None,
            "side": "exit" if _EXIT.search(phrase.object) else None,
            "met_by": agent,
            "encounter": phrase.how,
            "figure": phrase.figure,
        }
    )


def find_kind(words: str, how: Encounter) -> ObjectKind:
    """What stands in the way is in a lane; what is hit may also stand at the kerb."""
    low = words.lower()
    in_lane = re.search(r"\b(?:lane|way|path|road)\b", low) is not None
    if how == "doored":
        return "parked"
    if re.search(rf"double[- ]?parked|unloading|{BUS_AT_STOP}", low):
        return "double_parked"
    if "parked" in low:
        return "double_parked" if in_lane or how != "hits" else "parked"
    return "stalled"


def find_side(agent: AgentNode, node: ObjectNode) -> dict[str, str]:
    """The side of its leg on which an object stands that an agent meets, as a field of it."""
    return {"side": "entry" if agent.entry == node.leg else "exit"}


def reroute_agent(agent: AgentNode, node: ObjectNode) -> AgentNode:
    """The agent with a route by the leg on which the object stands.

    Raises:
        Refused: it comes and leaves by other legs.
    """
    leg: Compass | None = node.leg
    if leg is None or leg in (agent.entry, agent.exit):
        return agent
    if agent.entry is None and node.side != "exit":
        return agent.model_copy(update={"entry": leg})
    if agent.exit is None:
        return agent.model_copy(update={"exit": leg})
    raise Refused(
        "out_of_scope", f"{agent.id} does not come by the {leg} leg, where {node.id} is to stand."
    )
