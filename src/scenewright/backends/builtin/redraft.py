"""What words of a conversation change: the planner's reader on (what is there, what is said).

The scene is put into plain sentences, read alone and read with the change after them. What differs
between the two readings is the change; all else of the scene stays as it is.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import TypeVar

from pydantic import ValidationError

from scenewright.backends.builtin.draft import Refused, Site
from scenewright.backends.builtin.named import Named
from scenewright.backends.builtin.phrases import replace_phrases
from scenewright.backends.builtin.reader.annotation import PAIRS, SEPARATOR
from scenewright.backends.builtin.reader.learned_plan import (
    LearnedPlan,
    is_no_change,
    read_plan,
)
from scenewright.backends.builtin.references import ORDINALS, People
from scenewright.backends.builtin.scope import check_language, check_text
from scenewright.scene.base import Model
from scenewright.scene.edits import Edit, SetMeasure, Situation, diff_graphs
from scenewright.scene.phrasing import choose_names, describe_graph
from scenewright.scene.route_table import WAY_FIELDS, resolve_route
from scenewright.scene.social import (
    AgentNode,
    EntryTie,
    ObjectNode,
    Refusal,
    RelationEdge,
    SceneContext,
    SocialGraph,
)

_PartT = TypeVar("_PartT", bound=Model)
_ENDS = ("from_", "to", "braker", "first", "strikes")
"""Fields of a relation that name an agent."""


def read_change(
    text: str, every: Sequence[Named], situation: Situation, people: People, *, site: Site
) -> tuple[Edit, ...]:
    """The edits that words ask for, by two readings of the scene, without and with them.

    Args:
        every: the noun phrases among the words.

    Raises:
        Unclear: the words may mean several agents.
        Refused: they cannot be read, or do not fit what is there.
    """
    check_text(text)
    check_language(text)
    graph = situation.graph.model_copy(update={"objects": (), "measures": ()})
    phrased = replace_phrases(_name_people(text, every, situation, people))
    sentences = describe_graph(graph)
    before = read_plan(sentences, site=site)
    after = read_plan(
        phrased.text, previous=sentences, site=site, phrases=phrased.phrases, changes=True
    )
    if is_no_change(after.reading) and not after.objects:
        return ()
    return _Change(situation, before, after, site).list_edits()


def _name_people(text: str, every: Sequence[Named], situation: Situation, people: People) -> str:
    """The words with the names that the plain sentences have for the agents they mean."""
    names = choose_names(situation.graph)
    in_order = list(names.values())
    for ordinal, at in ORDINALS.items():
        if len(in_order) > at:
            text = re.sub(rf"\bthe {ordinal} one\b", in_order[at], text, flags=re.IGNORECASE)
    for named in every:
        agent = people.find_agent(named)
        if agent is None:
            continue
        if agent.id not in names:
            raise Refused(
                "impossible",
                f"{agent.id} is a background agent without a role; it can be "
                "removed, slowed down or moved in time, or an agent of its own can be added.",
            )
        words = rf"\b(?:(?:the|that|this) )?{re.escape(named.phrase)}\b"
        text = re.sub(words, names[agent.id], text, count=1, flags=re.IGNORECASE)
    return text


class _Change:
    """The difference of two readings, carried over to the scene's graph."""

    def __init__(
        self, situation: Situation, before: LearnedPlan, after: LearnedPlan, site: Site
    ) -> None:
        self._graph, self._site = situation.graph, site
        self._before, self._after = _get_graph(before), _get_graph(after)
        self._hidden = {node.hides for node in self._after.objects}
        cut, tells = after.reading.text.find(SEPARATOR), (*PAIRS, "swap", "first")
        self._tells_event = any(s.start > cut and s.tag in tells for s in after.reading.spans)
        # Each sentence of the scene brings one agent, in order.
        earlier = dict(zip(sorted(before.users), self._graph.agents, strict=False))
        types = [self._before.agent(name).type for _, name in sorted(before.users.items())]
        if types != [agent.type for agent in self._graph.agents]:
            raise Refused(
                "out_of_scope",
                "This scene cannot be put into plain words, so words cannot change it like that; "
                "change it by hand, or describe the whole scene anew.",
            )
        # By the names that the agents have in either reading, those that they have in the scene.
        self._was = {before.users[number]: agent.id for number, agent in earlier.items()}
        self._now: dict[str, str] = {}
        for number, name in sorted(after.users.items()):
            agent = earlier.get(number)
            # Who becomes of another class is another agent.
            if agent is not None and agent.type == self._after.agent(name).type:
                self._now[name] = agent.id
        free = {node.type: situation.generate_ids(node.type) for node in self._after.agents}
        for node in self._after.agents:
            if node.id not in self._now:
                self._now[node.id] = next(free[node.type])

    def list_edits(self) -> tuple[Edit, ...]:
        """The edits that lead from the scene's graph to the one that is asked for."""
        nodes = tuple(self._change_node(node) for node in self._after.agents)
        present = {node.id for node in nodes}
        try:
            graph = SocialGraph(
                agents=nodes,
                relations=self._change_relations(present),
                ties=self._change_ties(present),
                context=self._change_context(),
                objects=(*self._graph.objects, *self._list_new_objects()),
            )
        except ValidationError as error:
            fault = error.errors()[0]["msg"].removeprefix("Value error, ")
            raise Refused("contradictory", f"{fault}; change both, or say it anew.") from error
        figures = tuple(
            SetMeasure(measure=self._rename(measure, ("agent", "other")))
            for measure in self._after.measures
            if measure not in self._before.measures
        )
        return (*diff_graphs(self._graph, graph), *figures)

    def _rename(self, part: _PartT, fields: Sequence[str], **update: object) -> _PartT:
        """A part of the later reading, with the names that the scene has for its agents.

        Args:
            fields: those that name agents; update: other fields that change.
        """
        named = {field: getattr(part, field) for field in fields}
        update |= {field: self._now[name] for field, name in named.items() if name in self._now}
        return part.model_copy(update=update)

    def _change_node(self, node: AgentNode) -> AgentNode:
        """The scene's agent with what the words change of it, or a new one."""
        name = self._now[node.id]
        earlier_name = next((old for old, kept in self._was.items() if kept == name), None)
        if earlier_name is None:
            return node.model_copy(update={"id": name})
        known = self._graph.agent(name)
        changed = _list_changes(self._before.agent(earlier_name), node)
        update = {f: new for f, new in changed.items() if f not in ("id", "type", *WAY_FIELDS)}
        given = {f: changed[f] for f in WAY_FIELDS if changed.get(f) is not None}
        if given.get("movement") == "crossing" and node.id in self._hidden:
            del given["movement"]  # who comes out from behind something crosses anyway
        earlier = {f: getattr(known, f) for f in WAY_FIELDS}
        if given.get("movement") == "jaywalking":
            earlier["crosswalk"] = None
        found = resolve_route(known.type, earlier, given, self._site.ways) if given else earlier
        return known.model_copy(update={**update, **(found or {**earlier, **given})})

    def _change_relations(self, present: set[str]) -> tuple[RelationEdge, ...]:
        read = {
            frozenset(self._was.get(name, name) for name in edge.pair): edge
            for edge in self._before.relations
        }
        kept = []
        for edge in self._after.relations:
            now = self._rename(edge, _ENDS)
            known = next((e for e in self._graph.relations if e.pair == now.pair), None)
            was = read.get(now.pair)
            if known is None or was is None or (known.type, known.from_) != (now.type, now.from_):
                unsaid = known is not None and known.type == now.type and not self._tells_event
                kept.append(known if known is not None and unsaid else now)
                continue
            old = was.model_copy(update={f: self._was.get(getattr(was, f) or "") for f in _ENDS})
            kept.append(known.model_copy(update=_list_changes(old, now)))
        settled = {*read, *(edge.pair for edge in kept)}
        unread = (e for e in self._graph.relations if e.pair not in settled and e.pair <= present)
        return (*kept, *unread)

    def _change_ties(self, present: set[str]) -> tuple[EntryTie, ...]:
        was = {name: self._before.agent(old).entry for old, name in self._was.items()}
        now = {name: self._after.agent(new).entry for new, name in self._now.items()}
        moved = {name for name in was.keys() & now.keys() if was[name] != now[name]}
        fresh = [self._rename(tie, ("agent", "of")) for tie in self._after.ties]
        given = {tie.pair for tie in fresh}
        kept = [t for t in self._graph.ties if t.pair not in given and not t.pair & moved]
        return tuple(tie for tie in (*kept, *fresh) if tie.pair <= present)

    def _list_new_objects(self) -> list[ObjectNode]:
        """What is to stand in the scene beside what does already."""
        number = max((int(node.id.rpartition("-")[2]) for node in self._graph.objects), default=0)
        ids = {node.id: f"object-{number + n}" for n, node in enumerate(self._after.objects, 1)}
        return [
            self._rename(
                node,
                ("hides", "hidden_from", "met_by"),
                id=ids[node.id],
                beyond=ids.get(node.beyond or ""),
                others=tuple(self._rename(meeting, ("agent",)) for meeting in node.others),
            )
            for node in self._after.objects
        ]

    def _change_context(self) -> SceneContext:
        changed = _list_changes(self._before.context, self._after.context)
        return self._graph.context.model_copy(update=changed)


def _get_graph(learned: LearnedPlan) -> SocialGraph:
    """The graph that was read.

    Raises:
        Refused: the text was refused.
    """
    if isinstance(learned.plan, Refusal):
        raise Refused(learned.plan.code, learned.plan.reason)
    return learned.plan


def _list_changes(was: _PartT, now: _PartT) -> dict[str, object]:
    """The fields of a part that are other than before, as they are now."""
    both = {field: (getattr(was, field), getattr(now, field)) for field in type(now).model_fields}
    return {field: new for field, (old, new) in both.items() if new != old}
