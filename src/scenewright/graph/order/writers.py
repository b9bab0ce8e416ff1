"""Who words a story: the builtin voices, or a language model."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any, Protocol

import numpy as np

from scenewright.backends import Backend, Question, Wording, load_backend
from scenewright.errors import BackendFault, Rejected
from scenewright.graph.batch.work import speaking
from scenewright.graph.order.story import Story
from scenewright.graph.order.voices import tell, voices_for
from scenewright.scene.events import EVENT_OF_RELATION
from scenewright.scene.map import IntersectionMap
from scenewright.scene.relations import pattern_named
from scenewright.scene.social import SocialGraph
from scenewright.tools.map_grounding import ground

TRIES = 6
"""Wordings of one story that are read back before another story is told."""


@dataclass(frozen=True)
class Told:
    """A wording: the text, whose voice it is, and how many were misread before it."""

    text: str
    voice: str
    misread: int = 0


class Writer(Protocol):
    """Words stories."""

    name: str

    def word(
        self, story: Story, *, turn: int, avoid: Sequence[str], rng: np.random.Generator
    ) -> Told | None:
        """A text for a story; None for a story that cannot be at the place.

        Args:
            turn: counts the stories, so that voices can take turns.
            avoid: texts of this story that were refused.
        """


class Builtin:
    """Voices in turn; each wording is read back by the grammar, and told anew if misread."""

    name = "builtin"

    def __init__(self, on: IntersectionMap) -> None:
        self._reader, self._on = load_backend("builtin"), on

    def word(
        self, story: Story, *, turn: int, avoid: Sequence[str], rng: np.random.Generator
    ) -> Told | None:
        """A text that the grammar reads as the story, and that the map has room for."""
        voices = voices_for(story)
        for k in range(TRIES):
            voice = voices[(turn + k) % len(voices)]
            text = tell(story, voice, rng)
            if text not in avoid and reads_as(self._reader, text, story, on=self._on):
                return Told(text, voice, k)
        return None


def reads_as(reader: Backend, text: str, story: Story, *, on: IntersectionMap) -> bool:
    """Whether a text is understood as the story it tells, and can be at the place."""
    graph = _read_back(reader, text, on)
    if graph is None:
        return False
    context = graph.context
    if (context.density, context.time_of_day) != (story.density, story.clock):
        return False
    if story.leaf is None:
        kinds = sorted(agent.type for agent in graph.agents)
        wanted = sorted(party.type for party in story.parties)
        return not graph.relations and kinds == wanted and context.background is None
    return context.background is None and _same_event(graph, story)


def _read_back(reader: Backend, text: str, on: IntersectionMap) -> SocialGraph | None:
    """The social graph of a text; None if it is refused or the map has no room for it."""
    legs = [leg.name for leg in on.legs]
    facts = {"instruction": text, "previous": None, "legs": legs}
    reply = reader.answer(Question(task="plan", facts=facts))
    if "agents" not in reply:
        return None
    graph = SocialGraph.model_validate(reply)
    try:
        ground(graph, on=on)
    except Rejected:
        return None
    return graph


def _same_event(graph: SocialGraph, story: Story) -> bool:
    if len(graph.relations) != 1 or len(graph.agents) != 2:
        return False
    edge = graph.relations[0]
    ends = [graph.agent(edge.from_), graph.agent(edge.to)]
    if EVENT_OF_RELATION[edge.type] != story.event:
        return False
    if edge.type in ("collide_at", "near_miss") and ends[0].type != story.parties[0].type:
        ends.reverse()
    wanted = pattern_named(story.leaf or "")
    if edge.pattern not in (None, wanted.id) or (edge.kind not in (None, wanted.kind)):
        return False
    return all(
        end.type == party.type
        and end.movement in (None, party.movement)
        and end.entry in (None, party.side, *([] if party.tie is None else [end.entry]))
        and (party.crosswalk is None or end.crosswalk == party.crosswalk)
        for end, party in zip(ends, story.parties, strict=True)
    )


_RULES = """You write instructions for a traffic simulator, as many different people would: short
or long, formal or casual, reports, requests, headlines, questions. Word the story you are given in
one or two sentences. Say everything in it and nothing that is not: no other agents, no other
events, no other place or time. Use the manner you are told. Answer with JSON: {"text": "..."}."""
_SCHEMA = {
    "type": "object",
    "properties": {"text": {"type": "string", "minLength": 8, "maxLength": 400}},
    "required": ["text"],
    "additionalProperties": False,
}
_MANNERS = (
    "a police report", "a headline", "a friend telling another", "a traffic engineer's shorthand",
    "a polite request", "a test engineer's specification", "a witness", "a question",
    "somebody typing in a hurry, without capitals", "one plain sentence",
)  # fmt: skip


class Spoken:
    """A language model, in a different manner each time; the builtin voices where it fails."""

    def __init__(self, backend: Backend, on: IntersectionMap) -> None:
        self.name = backend.name
        self._backend, self._else = backend, Builtin(on)

    def word(
        self, story: Story, *, turn: int, avoid: Sequence[str], rng: np.random.Generator
    ) -> Told | None:
        """What the model says, as it is: the scene will show whether it is the story."""
        manner = _MANNERS[turn % len(_MANNERS)]
        facts = {"story": facts_of(story), "manner": manner, "not again": list(avoid)}
        try:
            text = self._ask(facts, seed=int(rng.integers(2**31)))
        except (Rejected, BackendFault):
            return self._else.word(story, turn=turn, avoid=avoid, rng=rng)
        return Told(text, manner)

    def _ask(self, facts: dict[str, Any], *, seed: int) -> str:
        words = json.dumps(facts, ensure_ascii=False)
        wording = Wording(system=_RULES, user=words, schema=_SCHEMA)
        question = Question(task="plan", facts=facts, seed=seed, wording=lambda: wording)
        text = self._backend.answer(question).get("text")
        if not isinstance(text, str) or not 0 < len(text.strip()) <= 2000:
            raise BackendFault("the writer gave no text")
        return " ".join(text.split())


def facts_of(story: Story) -> dict[str, Any]:
    """A story as plain facts, without what is not told."""
    roles = ("who does it", "to whom")
    found: dict[str, Any] = {"event": story.event, "time": story.clock, "density": story.density}
    if story.leaf is not None:
        found["what exactly"] = pattern_named(story.leaf).subtype
    for role, party in zip(roles, story.parties, strict=False):
        found[role] = {key: value for key, value in asdict(party).items() if value is not None}
    return {key: value for key, value in found.items() if value is not None}


def load_writer(name: str, *, on: IntersectionMap, base_url: str | None = None) -> Writer:
    """The writer of that name for a place; InputError for a backend that does not exist."""
    if name == "builtin":
        return Builtin(on)
    return Spoken(speaking(name, base_url), on)
