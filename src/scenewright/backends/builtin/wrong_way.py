"""Words that have a vehicle drive the wrong way: taken out of a text before the readings.

"A wrong-way driver collides head-on with a taxi" is read as "A driver collides head-on with a
taxi"; the driver then comes to the junction in a lane that leads out of it.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

from scenewright.backends.builtin.draft import Refused
from scenewright.scene.account import SaidSpan
from scenewright.scene.social import SocialGraph

_WAY = (
    r"(?:(?:on|in|down|along|up) )?(?:the )?wrong (?:way|side|direction|lane)(?: of the (?:road|"
    r"street|carriageway))?|against (?:the )?(?:oncoming |flow of |direction of )?traffic|"
    r"against the (?:flow|direction of (?:travel|the lane|its lane))|in (?:the |an )?oncoming lane"
)
_GOES = (
    r"(?:is |was )?(?:driv(?:es?|ing)|drove|travel(?:s|ling|ing|led)?|go(?:es|ing)?|went|"
    r"com(?:es?|ing)|came|head(?:s|ing|ed)?|mov(?:es?|ing)|enter(?:s|ing|ed)?|speed(?:s|ing)?|"
    r"rac(?:es|ing))"
)
_ON_LEG = r"(?P<on> (?:down|up|along|on|into|in|of|from) (?=the (?:north|east|south|west)))?"
_SAID = re.compile(
    r"(?P<adjective>\b(?:wrong[- ]way|wrong[- ]direction|ghost) (?=\w+))|"
    rf"\b(?P<goes>{_GOES} )?(?:{_WAY})\b{_ON_LEG}",
    re.IGNORECASE,
)


@dataclass(frozen=True)
class WrongWayPhrase:
    """Words that say it, and whether who does it is named after them."""

    start: int
    end: int
    words: str
    agent_follows: bool


def take_out_wrong_way(text: str) -> tuple[str, tuple[WrongWayPhrase, ...]]:
    """A text without such words, as long as before, and those words."""
    found: list[WrongWayPhrase] = []
    for match in _SAID.finditer(text):
        words = match[0].removesuffix(match["on"] or "").strip()
        end = match.start() + len(words)
        found.append(WrongWayPhrase(match.start(), end, words, match["adjective"] is not None))
        filled = (_choose_verb(match) + (" from " if match["on"] else "")).rjust(len(match[0]))
        text = text[: match.start()] + filled[: len(match[0])] + text[match.end() :]
    return text, tuple(found)


def _choose_verb(match: re.Match[str]) -> str:
    """A verb of the same form, where one was said."""
    if not match["goes"]:
        return ""
    return "driving" if re.search(r"ing\b", match["goes"], re.IGNORECASE) else "drives"


def add_wrong_way(graph: SocialGraph, phrases: Sequence[WrongWayPhrase], text: str) -> SocialGraph:
    """The graph with the vehicles that drive the wrong way, and the account of their words.

    Raises:
        Refused: it is not clear who does, or it is no vehicle.
    """
    agents = list(graph.agents)
    said = [_restore(each, text) for each in graph.said]
    for phrase in phrases:
        name = _find_driver(graph, phrase)
        own = next(k for k, each in enumerate(agents) if each.id == name)
        if agents[own].type != "vehicle":
            raise Refused("out_of_scope", f"'{phrase.words}': only vehicles drive the wrong way.")
        agents[own] = agents[own].model_copy(update={"motion": "drives_wrong_way"})
        said = [e for e in said if not phrase.start <= e.start < phrase.end or e.became == "agent"]
        span = {"start": phrase.start, "end": phrase.end, "words": phrase.words}
        value = {"became": "motion", "agents": (name,), "value": "drives_wrong_way"}
        said.append(SaidSpan.model_validate({**span, **value}))
    said.sort(key=lambda each: each.start)
    return graph.model_copy(update={"agents": tuple(agents), "said": tuple(said)})


def _restore(span: SaidSpan, text: str) -> SaidSpan:
    """Words of the account as the text has them."""
    return span.model_copy(update={"words": text[span.start : span.end]})


def _find_driver(graph: SocialGraph, phrase: WrongWayPhrase) -> str:
    """The agent named next to the words."""
    named = [each for each in graph.said if each.became == "agent" and len(each.agents) == 1]
    if phrase.agent_follows:
        near = sorted((e for e in named if e.end > phrase.start), key=lambda each: each.start)
    else:
        near = sorted((e for e in named if e.start < phrase.start), key=lambda each: -each.start)
    vehicles = [each.id for each in graph.agents if each.type == "vehicle"]
    if near:
        return near[0].agents[0]
    if len(vehicles) == 1:
        return vehicles[0]
    raise Refused("out_of_scope", f"It is not clear who drives '{phrase.words}'; say who.")
