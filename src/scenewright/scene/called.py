"""What people read of a scene: agents as the instruction calls them, and no words of programs."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping

from scenewright.scene.account import NAME
from scenewright.scene.phrasing import name_kind, number_nouns
from scenewright.scene.record import SceneRecord

_NOUN_PHRASE = re.compile(
    r"(?:(?:an?|the|my|our|one|some|this|that) )?([\w' -]{1,30})", re.IGNORECASE
)
PRONOUNS = "it they them he him she her who that which both one another someone somebody anyone"
"""Words that are never a name."""
_NUMBERS = re.compile(r"\bagents? (\d+(?:, \d+)*)\b|(?<=\bof )(\d+ and \d+)(?= at )")
_CODE = re.compile(r"\b([a-z_]+)\(([^()]*)\)|\b[a-z]+(?:_[a-z]+)+\b")
_RELATIONS = {"collide_at": "collision", "yield_to": "yielding"}


def call_agents(scene: SceneRecord) -> dict[int, str]:
    """By id: "Anna" or "the taxi" where the words say so, "car 1" and "car 2" for two of a noun.

    Those that it does not name keep the name that edits know, "vehicle-7".
    """
    named = [agent for agent in scene.agents if agent.role == "foreground"]
    nouns = {each.id: name_kind(each.subtype or each.type) for each in named}
    spans = Counter(each.start for each in scene.said if each.became == "agent")
    in_capitals = all(each.words.isupper() for each in scene.said if each.became == "agent")
    for each in reversed(scene.said):
        is_pronoun = each.words.lower() in PRONOUNS.split()
        phrase = None if is_pronoun else _NOUN_PHRASE.fullmatch(each.words)
        alone = each.became == "agent" and len(each.agents) == 1 and spans[each.start] == 1
        if phrase and alone and each.value and each.agents[0] in nouns:
            nouns[each.agents[0]] = phrase[1].lower() if in_capitals else phrase[1]
    own = {each.agents[0]: each.words for each in scene.said if each.note == NAME and each.agents}
    return {agent.id: agent.name for agent in scene.agents} | number_nouns(nouns) | own


def speak_plainly(
    text: str, scene: SceneRecord | None, planned: Mapping[str, str] | None = None
) -> str:
    """The text with agents, `planned` ones too, and objects as they are called, without code."""
    called, names = {} if scene is None else call_agents(scene), dict(planned or {})
    if scene is not None:
        things = {x.id: f"{x.kind} {x.subtype or ''}".strip() for x in scene.objects}
        things = {name: noun.replace("_", "-") for name, noun in things.items()}
        named = {x.name: called[x.id] for x in scene.agents if x.role == "foreground"}
        names = number_nouns(things) | named | names

    def spell(found: re.Match[str]) -> str:
        words = f"{found[1]} of {found[2]}" if found[1] else found[0]
        return " ".join(_RELATIONS.get(each, each.replace("_", " ")) for each in words.split())

    def name_numbers(found: re.Match[str]) -> str:
        numbers = found[1] or found[2]
        return re.sub(r"\d+", lambda each: called.get(int(each[0]), each[0]), numbers)

    text = re.sub(r" \(\d+ such(?:; \d+ is [\w-]+)*\)", "", text)  # a key to numbers
    text = _NUMBERS.sub(name_numbers, _CODE.sub(spell, text))
    for name, meant in names.items():  # what stands in brackets behind a name repeats its noun

        def rename(found: re.Match[str], meant: str = meant) -> str:
            return meant + " (" * (found[1] is not None)

        pattern = rf"\b(?:{re.escape(name)}|{re.escape(meant)})\b(?: \([\w' -]+(?:\)|(, )))?"
        text = re.sub(pattern, rename, text)
    return re.sub(r"\b(\w+) the \1\b", r"the \1", text)  # "parked the parked truck"
