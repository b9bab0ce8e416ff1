"""What words of a conversation are read against, and which agents they mean."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

from scenewright.backends.offline import (
    ORDINALS,
    WORDS,
    Named,
    Patterns,
    fill_in,
    find_named,
)
from scenewright.scene.edits import AgentView, CallAgent, Situation
from scenewright.scene.events import Event
from scenewright.scene.phrasing import name_kind
from scenewright.scene.route_table import WAY_FIELDS
from scenewright.scene.social import AgentNode, RelationEdge

_PATTERNS = Patterns("talk")

_NAMED_ONE = re.compile(WORDS["talk"]["named_one"])
_NAMES = re.compile(fill_in(WORDS["talk"]["names"]), re.IGNORECASE)


def simplify(words: str) -> str:
    """The words in lower case, without fillers before and after them."""
    plain = " ".join(words.lower().replace("’", "'").split()).rstrip(" .!?")
    while (bare := _PATTERNS.filler.sub("", plain).strip(" ,.!")) != plain and bare:
        plain = bare
    return plain


@dataclass(frozen=True)
class Talk:
    """A scene that is spoken of.

    Attributes:
        touched: agents that were spoken of, the last first; events: of the current version.
        narrator: the noun of what the one who writes drives or is, such as "taxi".
    """

    situation: Situation
    touched: Sequence[str]
    events: Sequence[Event]
    narrator: str | None = None

    def list_agents(self) -> list[AgentNode]:
        """The agents of the instruction, those spoken of last first."""
        place = {name: n for n, name in enumerate(self.touched)}
        return sorted(self.situation.graph.agents, key=lambda a: place.get(a.id, len(place)))

    def list_edges(self, *kinds: str) -> list[RelationEdge]:
        """The relations of these kinds; of all kinds if none is named."""
        return [e for e in self.situation.graph.relations if not kinds or e.type in kinds]

    def view(self, node: AgentNode) -> AgentView | None:
        """The agent as it is in the scene."""
        return next((each for each in self.situation.present if each.id == node.id), None)

    def keep_way(self, node: AgentNode) -> AgentNode:
        """The node with the way that its agent takes now, where the graph leaves that open."""
        view = self.view(node)
        if view is None:
            return node
        left_open = [field for field in WAY_FIELDS if getattr(node, field) is None]
        return node.model_copy(update={each: getattr(view, each) for each in left_open})

    def find_agents(self, plain: str) -> list[AgentNode]:
        """The agents of the instruction that words in lower case name, in their order."""
        if _PATTERNS.everybody.search(plain):
            return list(self.situation.graph.agents)
        spoken = [
            (found.start(), self._find_word(found[0])) for found in _PATTERNS.word.finditer(plain)
        ]
        spoken += [(each.start, self.find_noun(each)) for each in find_named(plain)]
        nodes = [node for _, node in sorted(spoken, key=lambda each: each[0]) if node is not None]
        return list({node.id: node for node in nodes}.values())

    def find_noun(self, named: Named) -> AgentNode | None:
        """The agent that a noun phrase means; None where that is no agent, or any of several."""
        if named.det in ("indefinite", "another", "no", "both") or named.count not in (None, 1):
            return None
        if named.type is None:
            return self._find_other() if named.det == "other" else None
        alike = self._list_alike(named)
        if named.det in ORDINALS:
            alike = [agent for agent in self.situation.graph.agents if agent in alike]
            alike = alike[ORDINALS[named.det] :][:1]
        if named.det == "other":
            alike = [each for each in alike if each.id not in self.touched[:1]]
        return alike[0] if len(alike) == 1 else None

    def find_stranger(self, plain: str, *, new: bool = False) -> str | None:
        """A noun of a road user of a class that no agent of the instruction has.

        Args:
            new: look at "a truck" and "another truck" instead of "the truck".
        """
        for each in find_named(plain):
            introduced = each.det in ("indefinite", "another") or each.count is not None
            if each.type not in (None, "none") and introduced is new and not self._list_alike(each):
                return each.head
        return None

    def read_name(self, words: str) -> CallAgent | None:
        """The name that the words give to an agent; None where they give none."""
        found = _NAMES.search(words.strip(" .!"))
        if found is None or find_named(found["name"].lower()):
            return None
        who = (found["who"] or found["is"] or found["of"]).lower()
        nodes = self.find_agents({"his": "him", "its": "it"}.get(who, who))
        name = found["name"]
        name = name.capitalize() if name.islower() else name
        return CallAgent(agent=nodes[0].id, name=name) if len(nodes) == 1 else None

    def name_plainly(self, words: str) -> str:
        """The words with nouns, or ids, in place of "Anna", "the old man" and "one of the kids"."""
        front = self.situation.foreground
        for each in front:
            own = each.called.removeprefix("the ")
            if own == each.called and not own[:1].isupper():
                continue  # "car 2"
            if own == each.called or " " in own:
                alike = [e for e in front if (e.type, e.subtype) == (each.type, each.subtype)]
                noun = f"the {name_kind(each.subtype or each.type)}"
                plain = noun if len(alike) == 1 else each.id
                words = re.sub(rf"\b(?:the )?{re.escape(own)}\b", plain, words, flags=re.IGNORECASE)
        for named in find_named(words.lower()):
            there = [each for each in front if each.type == named.type]
            some = rf"\bone of the {re.escape(named.phrase)}\b"
            if named.plural and len(there) > 1:
                words = re.sub(some, there[0].id, words, flags=re.IGNORECASE)
        return words

    def find_unknown_name(self, words: str) -> str | None:
        """A name that no agent has, after its known ones were replaced: "let Otto walk faster"."""
        found = _NAMED_ONE.search(words)
        known = (
            found is None or find_named(found[1].lower()) or _PATTERNS.word.search(found[1].lower())
        )
        return None if found is None or known else found[1]

    def name_spoken(self, words: str) -> str:
        """Replace each pronoun by the id of the agent that it means, where that is known."""

        def name(found: re.Match[str]) -> str:
            node = self._find_word(found["who"].lower())
            known = node is not None and (found["who"].lower() != "it" or node.id in self.touched)
            return f"{found['verb']}{node.id}" if node is not None and known else found[0]

        return _PATTERNS.pronoun.sub(name, words)

    def _list_alike(self, named: Named) -> list[AgentNode]:
        """The agents that a noun may mean: "the car" is any vehicle where none is called so."""
        found = [agent for agent in self.list_agents() if agent.type == named.type]
        called = {each.id: each.called for each in self.situation.present}
        if own := [each for each in found if called.get(each.id) == f"the {named.phrase}"]:
            return own
        found = [e for e in found if named.head in called.get(e.id, "").split()] or found
        exact = [e for e in found if named.subtype is None or e.subtype in (named.subtype, None)]
        return exact or (found if named.subtype in (None, "car") else [])

    def _find_word(self, word: str) -> AgentNode | None:
        """The agent of an id or a pronoun."""
        agents = self.list_agents()
        if word in {agent.id for agent in agents}:
            return self.situation.graph.agent(word)
        if word == "me":
            mine = find_named(f"the {self.narrator}") if self.narrator else []
            return self.find_noun(mine[0]) if mine else None
        if word == "that one":
            return agents[0] if agents else None
        vehicles = [agent for agent in agents if agent.type == "vehicle"]
        if word == "ego":
            return vehicles[0] if len(vehicles) == 1 else None
        found = [agent for agent in agents if agent.type != "vehicle"] or agents
        if word in ("it", "that"):
            last = [e for e in agents if e.type != "pedestrian" and e.id in self.touched]
            found = last or vehicles or agents
        elif word not in ("him", "her", "he", "she"):
            return None  # an id that no agent of the instruction has
        return found[0] if len(found) == 1 or (found and found[0].id in self.touched) else None

    def _find_other(self) -> AgentNode | None:
        """Of two that were spoken of, the one that was not meant last."""
        agents = self.list_agents()
        last = next((agent for agent in agents if agent.id in self.touched), None)
        if last is None:
            return None
        rest = [agent for agent in agents if agent.id != last.id]
        alike = [each for each in rest if each.type == last.type]
        return rest[0] if len(rest) == 1 else alike[0] if len(alike) == 1 else None
