"""Writers of instructions: the builtin templates, or a language model."""

from __future__ import annotations

import json
from collections.abc import Collection, Sequence
from dataclasses import asdict, dataclass
from typing import Any, Protocol

import numpy as np

from scenewright.backends import STAGE_OF, Backend, Prompt, Question, load_backend
from scenewright.dataset.batch.answering import PLAINLY, Asking, find_url, load_speaking_backend
from scenewright.dataset.orders.order_spec import WORDS
from scenewright.dataset.orders.scenario_spec import Story
from scenewright.dataset.orders.templates import list_voices, render_text
from scenewright.errors import BackendFault, Rejected
from scenewright.scene.events import EVENT_OF_RELATION
from scenewright.scene.map import IntersectionMap
from scenewright.scene.rejection import Rejection
from scenewright.scene.relations import get_pattern
from scenewright.scene.social import SocialGraph
from scenewright.tools.map_grounding.grounding import ground_graph
from scenewright.tools.map_grounding.role_search import find_asked_runners, find_assignments

TRIES = 6
"""Texts of one story that are read back before another story is drawn."""
_CASTS = 6
"""Ways of playing a text that are looked at."""
ASKED = 3
"""Texts that a model may give for one story before a builtin template is used."""
LENGTH = (8, 400)
"""Characters of an instruction that a model words."""


@dataclass(frozen=True)
class WrittenText:
    """A text, the name of its template or manner, and how many texts were misread before it."""

    text: str
    voice: str
    misread: int = 0


@dataclass(frozen=True)
class StoryRequest:
    """What a text must mind beside its story.

    Attributes:
        turn: counts the stories, so that voices can take turns.
        avoid: texts of this slot that were refused; taken: texts of the whole order.
        grammar: whether the builtin planner will plan it, so that it had better understand it.
    """

    turn: int = 0
    avoid: Sequence[str] = ()
    taken: Collection[str] = ()
    grammar: bool = True


class Writer(Protocol):
    """Words stories."""

    name: str

    def write_text(
        self, story: Story, asked: StoryRequest, *, rng: np.random.Generator
    ) -> WrittenText | None:
        """A text for a story; None for a story that cannot be at the place."""


class BuiltinWriter:
    """Templates in turn; the planner reads each text back, and a misread one is written anew."""

    name = "builtin"

    def __init__(self, intersection_map: IntersectionMap, *, lawful: bool = False) -> None:
        self._reader = TextReader(intersection_map, lawful=lawful)

    def write_text(
        self, story: Story, asked: StoryRequest, *, rng: np.random.Generator
    ) -> WrittenText | None:
        """A text that the planner reads as the story, and that the map has room for."""
        voices = list_voices(story)
        for k in range(TRIES):
            voice = voices[(asked.turn + k) % len(voices)]
            text = render_text(story, voice, rng)
            if text not in asked.avoid and self._reader.is_read_as(text, story):
                return WrittenText(text, voice, k)
        return None


class TextReader:
    """Reads texts as the builtin planner does, at one place.

    Args:
        lawful: there must be room for a text without a red light that is run unasked.
    """

    def __init__(self, intersection_map: IntersectionMap, *, lawful: bool = False) -> None:
        self._backend, self._on, self._lawful = load_backend("builtin"), intersection_map, lawful

    def _read(self, text: str) -> dict[str, Any]:
        legs = [leg.name for leg in self._on.legs]
        facts = {"instruction": text, "previous": None, "legs": legs}
        return self._backend.answer(Question(task="plan", facts=facts))

    def is_read_as(self, text: str, story: Story) -> bool:
        """Whether a text is understood as its story, and whether the map has room for it."""
        reply = self._read(text)
        if "agents" not in reply:
            return False
        graph = SocialGraph.model_validate(reply)
        context = graph.context
        if (context.density, context.time_of_day) != (story.density, story.clock):
            return False
        try:
            grounding = ground_graph(graph, intersection_map=self._on)
        except Rejected:
            return False
        if story.leaf is None:
            kinds = sorted(agent.type for agent in graph.agents)
            wanted = sorted(party.type for party in story.parties)
            return not graph.relations and kinds == wanted and context.background is None
        if context.background is not None or not _has_same_event(graph, story):
            return False
        if self._lawful and (story.runner is None) != (not find_asked_runners(graph)):
            return False
        # No other pattern is left to be drawn, so that patterns come out even.
        draws = (
            next(find_assignments(graph, grounding, intersection_map=self._on,
                                  rng=np.random.default_rng(k), lawful=self._lawful), None)
            for k in range(_CASTS)
        )  # fmt: skip
        return all(draw is not None and draw.patterns[0].pattern == story.leaf for draw in draws)

    def describe_misreading(self, text: str, story: Story, *, strict: bool) -> str | None:
        """What a text says that its story does not, as feedback for the writer; None if nothing.

        Args:
            strict: whether it must be understood; else only a contradiction counts, as a text may
                be clear to others that cannot be read here.
        """
        if strict and self.is_read_as(text, story):
            return None
        reply = self._read(text)
        if "agents" not in reply:
            return f"it is refused: {reply.get('reason')}" if strict else None
        graph = SocialGraph.model_validate(reply)
        events: set[str] = {EVENT_OF_RELATION[relation.type] for relation in graph.relations} or {
            "normal"
        }
        if events != {story.event}:
            return f"it describes {' and '.join(sorted(events))}, the story is of {story.event}"
        for name, found, wanted in (
            ("density of traffic", graph.context.density, story.density),
            ("time", graph.context.time_of_day, story.clock),
        ):
            if found != wanted and (strict or found is not None):
                is_, was = (each or "not given" for each in (found, wanted))
                return f"its {name} is {is_}, the story's is {was}"
        if graph.context.background is not None:
            return "it names agents that the story does not have; leave them out"
        what = "the agents, their approaches or their movements are not as in the story"
        return f"{what}, or not all given" if strict else None


def _has_same_event(graph: SocialGraph, story: Story) -> bool:
    if len(graph.relations) != 1 or len(graph.agents) != 2:
        return False
    edge = graph.relations[0]
    ends = [graph.agent(edge.from_), graph.agent(edge.to)]
    if EVENT_OF_RELATION[edge.type] != story.event:
        return False
    if edge.type in ("collide_at", "near_miss") and ends[0].type != story.parties[0].type:
        ends.reverse()
    wanted = get_pattern(story.leaf or "")
    if edge.pattern not in (None, wanted.id) or (edge.kind not in (None, wanted.kind)):
        return False
    return all(
        end.type == party.type
        and end.movement in (None, party.movement)
        and end.entry in (None, party.side, *([] if party.tie is None else [end.entry]))
        and (party.crosswalk is None or end.crosswalk == party.crosswalk)
        for end, party in zip(ends, story.parties, strict=True)
    )


_SCHEMA = {
    "type": "object",
    "properties": {"text": {"type": "string", "minLength": LENGTH[0], "maxLength": LENGTH[1]}},
    "required": ["text"],
    "additionalProperties": False,
}
_RULES, _MANNERS = (WORDS["model"][name] for name in ("rules", "manners"))


class ModelWriter:
    """A language model, in a different manner each time.

    Every text is read back. One of another story goes back with what is wrong with it, at
    most ASKED times; then a builtin template is used.
    """

    def __init__(
        self, backend: Backend, intersection_map: IntersectionMap, *, lawful: bool = False
    ) -> None:
        self.name, self._backend = backend.name, backend
        self._else = BuiltinWriter(intersection_map, lawful=lawful)
        self._reader = TextReader(intersection_map, lawful=lawful)

    def write_text(
        self, story: Story, asked: StoryRequest, *, rng: np.random.Generator
    ) -> WrittenText | None:
        """What the model says, once nothing is found wrong with it.

        Raises:
            BackendFault: the model cannot be reached at all, as without its key.
        """
        manner, seed = _MANNERS[asked.turn % len(_MANNERS)], int(rng.integers(2**31))
        facts = {"story": build_facts(story), "manner": manner, "not again": list(asked.avoid)}
        faults: list[str] = []
        while len(faults) < ASKED:
            try:
                text = self._ask(facts, faults, seed=seed)
            except Rejected as refusal:
                faults.append(refusal.rejection.detail)
                continue
            except BackendFault as fault:
                if fault.final:
                    raise
                break
            wrong = self._find_fault(text, story, asked)
            if wrong is None:
                return WrittenText(text, manner, len(faults))
            faults.append(wrong)
        return self._else.write_text(story, asked, rng=rng)

    def _ask(self, facts: dict[str, Any], faults: Sequence[str], *, seed: int) -> str:
        """A text, in one line."""
        given = {**facts, "wrong with your last texts": list(faults)} if faults else facts
        words = json.dumps(given, ensure_ascii=False)
        prompt = Prompt(system=_RULES, user=words, schema=_SCHEMA)
        question = Question(
            task="plan", facts=given, rejections=tuple(faults), seed=seed, prompt=lambda: prompt
        )
        text = self._backend.answer(question).get("text")
        if not isinstance(text, str):
            detail = 'the reply has no text; answer with {"text": "..."}'
            raise Rejected(Rejection(stage=STAGE_OF["plan"], code="malformed_reply", detail=detail))
        return " ".join(text.split())

    def _find_fault(self, text: str, story: Story, asked: StoryRequest) -> str | None:
        if not LENGTH[0] <= len(text) <= LENGTH[1] or not text.isprintable():
            return f"a text has {LENGTH[0]} to {LENGTH[1]} printable characters"
        if text in asked.avoid or text in asked.taken:
            return "this very text was written before; word it differently"
        return self._reader.describe_misreading(text, story, strict=asked.grammar)


def build_facts(story: Story) -> dict[str, Any]:
    """A story as plain facts, without what it leaves open."""
    roles = ("who does it", "to whom")
    found: dict[str, Any] = {"event": story.event, "time": story.clock, "density": story.density}
    if story.leaf is not None:
        found["what exactly"] = get_pattern(story.leaf).subtype
    for role, party in zip(roles, story.parties, strict=False):
        found[role] = {key: value for key, value in asdict(party).items() if value is not None}
    if story.runner is not None:
        found[roles[story.runner]]["runs a red light"] = True
    return {key: value for key, value in found.items() if value is not None}


def load_writer(
    name: str,
    *,
    intersection_map: IntersectionMap,
    base_url: str | None = None,
    asking: Asking = PLAINLY,
    lawful: bool = False,
) -> Writer:
    """The writer of that name for a place; InputError for a backend that does not exist."""
    if name == "builtin":
        return BuiltinWriter(intersection_map, lawful=lawful)
    backend = load_speaking_backend((name,), find_url((name,), base_url), asking)
    return ModelWriter(backend, intersection_map, lawful=lawful)
