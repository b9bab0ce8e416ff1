"""The agents that words of a conversation mean: one agent of the scene, several, or none."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

from scenewright.backends.builtin.draft import Refused
from scenewright.backends.builtin.named import Named, Way
from scenewright.backends.builtin.reader.words import COARSE, WORDS
from scenewright.scene.base import OPPOSITE
from scenewright.scene.edits import AgentView, Choice, Clarification, Situation
from scenewright.scene.track import VEHICLE_SIZES

ORDINALS = {"first": 0, "second": 1, "third": 2, "last": -1}
_NEW = frozenset({"indefinite", "another", "no"})
_PLAIN_WORDS = frozenset(WORDS["references"]["plain_words"])
_RESTRICTS = frozenset({"from", "leg", "crosswalk"})
"""What may follow a noun to say which one; turns are movements asked for."""

_SIDE_OF = {"northbound": "south", "southbound": "north", "eastbound": "west", "westbound": "east"}


class Unclear(Exception):
    """The words may mean several agents; carries the question."""

    def __init__(self, ask: Clarification) -> None:
        super().__init__(ask.question)
        self.ask = ask


class People:
    """The agents of a scene, to be found by what is said of them.

    Args:
        chosen: answers to earlier questions: phrase -> id.
    """

    def __init__(self, situation: Situation, chosen: Mapping[str, str]) -> None:
        self._present = {each.id: each for each in situation.present}
        self._chosen = chosen

    def find_agent(self, named: Named) -> AgentView | None:
        """The agent that a noun phrase means; None where it introduces one or means a group.

        Raises:
            Unclear: it may be any of several.
            Refused: no agent of the scene is like that.
        """
        if named.type in (None, "none") or named.det in _NEW:
            return None
        if (named.plural and named.label is None) or named.count not in (None, 1):
            return None
        if named.phrase in self._chosen:
            return self._present.get(self._chosen[named.phrase])
        found = self._list_fitting(named)
        if len(found) > 1:
            raise Unclear(build_clarification(found, named.phrase))
        if found or named.det == "bare":
            return found[0] if found else None
        here = ", ".join(map(describe_agent, self.list_foreground())) or "no foreground agent"
        raise Refused("impossible", f"There is no {named.phrase} in this scene; there is {here}.")

    def find_by_id(self, text: str) -> AgentView | None:
        """The agent whose id stands in the text, such as vehicle-12.

        Raises:
            Refused: there is an id in it, but no agent has it.
        """
        found = re.search(
            r"\b(vehicle|pedestrian)([ -])(\d+)\b(?! (?:m|s|metre|meter|sec))", text.lower()
        )
        if found is None:
            return None
        agent = self._present.get(f"{found[1]}-{found[3]}")
        if agent is None and found[2] == "-":
            raise Refused("impossible", f"There is no {found[0]} in this scene; /show lists all.")
        return agent

    def list_foreground(self) -> list[AgentView]:
        """Those of the social graph."""
        return [agent for agent in self._present.values() if agent.role == "foreground"]

    def pick(self, among: Sequence[AgentView], noun: str) -> AgentView:
        """The only one of them, or the one that was answered; Unclear if there are several."""
        if noun in self._chosen and self._chosen[noun] in self._present:
            return self._present[self._chosen[noun]]
        if len(among) == 1:
            return among[0]
        raise Unclear(build_clarification(among, noun))

    def _list_fitting(self, named: Named) -> list[AgentView]:
        if named.label is not None:
            numbered = f"{named.type}-{named.label}"
            return [self._present[numbered]] if numbered in self._present else []
        alike = [each for each in self._present.values() if _is_alike(each, named)]
        front = [each for each in alike if each.role == "foreground"]
        own = [each for each in front if each.called == f"the {named.phrase}"]
        front = own or [e for e in front if named.head in e.called.split()] or front
        if not front and named.type == "vehicle":
            # A user that said "a vehicle" calls it a car, whatever was drawn for it.
            only = [each for each in self.list_foreground() if each.type == "vehicle"]
            if named.head in {"car", "vehicle"} and len(only) == 1:
                front = only
        found = front or alike
        if named.det in ORDINALS:
            return found[ORDINALS[named.det] :][:1] if found else []
        narrowed = [e for e in found if all(_is_as_described(e, way) for way in named.given)]
        after = named.after
        if len(narrowed) > 1 and after is not None and after.means in _RESTRICTS:
            narrowed = [each for each in narrowed if _is_as_described(each, after)] or narrowed
        return narrowed


def build_clarification(found: Sequence[AgentView], noun: str) -> Clarification:
    """The question which of several is meant."""
    shown = found[:6]
    given = [describe_agent(each) for each in shown]
    options = f"{', '.join(given[:-1])} or {given[-1]}"
    return Clarification(
        question=f"Which {noun}: {options}?",
        choices=tuple(
            Choice(answer=each.id, means=f"{noun}={each.id}: {describe_agent(each)}")
            for each in found[:24]
        ),
    )


def describe_agent(agent: AgentView) -> str:
    """An agent with what distinguishes it, and its id."""
    if agent.type == "pedestrian":
        where = "jaywalking" if agent.crosswalk is None else f"on the {agent.crosswalk} crosswalk"
        return f"the pedestrian {where}, from the {agent.entry} ({agent.id})"
    way = agent.movement if agent.movement in ("left", "right") else "straight on"
    turn = f"turning {way}" if way != "straight on" else "going straight on"
    return f"the {agent.subtype or 'vehicle'} from the {agent.entry}, {turn} ({agent.id})"


def read_choice(words: str, ask: Clarification) -> Choice | None:
    """The choice that an answer means; None if it is none of them, or several."""
    said = words.lower().strip(" .!")
    exact = [choice for choice in ask.choices if choice.answer in said.split()]
    if len(exact) == 1:
        return exact[0]
    index = {"1": 0, "2": 1, "3": 2, **ORDINALS}
    only = set(re.findall(r"[a-z0-9-]+", said)) - _PLAIN_WORDS
    if len(only) == 1 and (only & index.keys()):
        at = index[only.pop()]
        return ask.choices[at] if at < len(ask.choices) else None
    only = {_SIDE_OF.get(word, word) for word in only}
    meanings = [choice.means.partition(":")[2].lower() for choice in ask.choices]
    fits = [
        each
        for each, meaning in zip(ask.choices, meanings, strict=True)
        if only and only <= set(re.findall(r"[a-z0-9-]+", meaning))
    ]
    return fits[0] if len(fits) == 1 else None


def _is_alike(agent: AgentView, named: Named) -> bool:
    if agent.type != named.type:
        return False
    kinds = (agent.subtype, COARSE.get(agent.subtype or ""))
    return named.subtype not in VEHICLE_SIZES or named.subtype in kinds


def _is_as_described(agent: AgentView, way: Way) -> bool:
    match way.means:
        case "from":
            return agent.entry == way.value
        case "leg" if agent.type == "vehicle":
            return agent.entry == way.value
        case "bound":
            return agent.entry == OPPOSITE[way.value or ""]
        case "crosswalk" | "leg":
            return agent.crosswalk == way.value
        case "turn":
            return agent.movement == way.value
        case "straight":
            return agent.movement == "straight"
    return True
