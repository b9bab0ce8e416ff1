"""What words of a conversation change: the planner's reader on (what is there, what is said).

The scene is put into plain sentences, read alone and read with the change after them. What differs
between the two readings is the change; all else of the scene stays as it is.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

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
    for each in (before, after):
        if isinstance(each.plan, Refusal):
            raise Refused(each.plan.code, each.plan.reason)
    return _Change(situation, before, after, site).list_edits()


def _name_people(text: str, every: Sequence[Named], situation: Situation, people: People) -> str:
    """The words with the names that the plain sentences have for the agents they mean."""
    names = choose_names(situation.graph)
    in_order = list(names.values())
    for ordinal, at in ORDINALS.items():
        if len(in_order) > at:
            text = re.sub(rf"\bthe {ordinal} one\b", in_order[at], text, flags=re.IGNORECASE)
    for each in every:
        agent = people.find_agent(each)
        if agent is None:
            continue
        if agent.id not in names:
            raise Refused(
                "impossible",
                f"{agent.id} is a background agent without a role; it can be "
                "removed, slowed down or moved in time, or an agent of its own can be added.",
            )
        words = rf"\b(?:(?:the|that|this) )?{re.escape(each.phrase)}\b"
        text = re.sub(words, names[agent.id], text, count=1, flags=re.IGNORECASE)
    return text


class _Change:
    """The difference of two readings, carried over to the scene's graph."""

    def __init__(
        self, situation: Situation, before: LearnedPlan, after: LearnedPlan, site: Site
    ) -> None:
        if isinstance(before.plan, Refusal) or isinstance(after.plan, Refusal):
            raise TypeError("two plans are needed")
        self._graph, self._site = situation.graph, site
        self._before, self._after = before.plan, after.plan
        self._hidden = {each.hides for each in after.plan.objects}
        said, cut = after.reading.spans, after.reading.text.find(SEPARATOR)
        tells = (*PAIRS, "swap", "first")
        self._tells_event = any(each.start > cut and each.tag in tells for each in said)
        known = [each.id for each in self._graph.agents]
        # Each sentence of the scene brings one agent, in order.
        types = [self._before.agent(before.users[n]).type for n in sorted(before.users)]
        if types != [each.type for each in self._graph.agents]:
            raise Refused(
                "out_of_scope",
                "This scene cannot be put into plain words, so words cannot change it like that; "
                "change it by hand, or describe the whole scene anew.",
            )
        earlier = dict(zip(sorted(before.users), known, strict=False))
        self._was = {before.users[n]: name for n, name in earlier.items()}
        taken = {each.id for each in situation.present} | set(known)
        self._now: dict[str, str] = {}
        for number, theirs in sorted(after.users.items()):
            if number not in earlier:
                continue
            # Who becomes of another class is another agent.
            if self._after.agent(theirs).type == self._before.agent(before.users[number]).type:
                self._now[theirs] = earlier[number]
        for node in self._after.agents:
            if node.id not in self._now:
                self._now[node.id] = free_name(node.type, taken)
                taken.add(self._now[node.id])

    def list_edits(self) -> tuple[Edit, ...]:
        """The edits that lead from the scene's graph to the one that is asked for."""
        nodes = tuple(self._change_node(node) for node in self._after.agents)
        present = {each.id for each in nodes}
        gone = {each.id for each in self._graph.agents} - set(self._was.values())
        nodes += tuple(each for each in self._graph.agents if each.id in gone)
        present |= gone
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
            SetMeasure(measure=each.model_copy(update=self._rename(each, ("agent", "other"))))
            for each in self._after.measures
            if each not in self._before.measures
        )
        return (*diff_graphs(self._graph, graph), *figures)

    def _rename(self, each: object, fields: Sequence[str]) -> dict[str, str]:
        """The fields that name agents, with the names that the scene has for them."""
        named = {field: getattr(each, field) for field in fields}
        return {field: self._now[name] for field, name in named.items() if name in self._now}

    def _change_node(self, node: AgentNode) -> AgentNode:
        """The scene's agent with what the words change of it, or a new one."""
        name = self._now[node.id]
        read = next((o for o, own in self._was.items() if own == name), None)
        if read is None:
            return node.model_copy(update={"id": name})
        was, known = self._before.agent(read), self._graph.agent(name)
        fields = [f for f in AgentNode.model_fields if f not in ("id", "type", *WAY_FIELDS)]
        update = {f: getattr(node, f) for f in fields if getattr(node, f) != getattr(was, f)}
        given = {
            f: getattr(node, f)
            for f in WAY_FIELDS
            if getattr(node, f) not in (None, getattr(was, f))
        }
        if given.get("movement") == "crossing" and node.id in self._hidden:
            del given["movement"]  # who comes out from behind something crosses anyway
        earlier = {f: getattr(known, f) for f in WAY_FIELDS}
        if given.get("movement") == "jaywalking":
            earlier["crosswalk"] = None
        found = resolve_route(known.type, earlier, given, self._site.ways) if given else earlier
        return known.model_copy(update={**update, **(found or {**earlier, **given})})

    def _change_relations(self, present: set[str]) -> tuple[RelationEdge, ...]:
        read = {
            frozenset(self._was.get(each, each) for each in (e.from_, e.to)): e
            for e in self._before.relations
        }
        kept = []
        for edge in self._after.relations:
            now = edge.model_copy(update=self._rename(edge, _ENDS))
            pair = frozenset((now.from_, now.to))
            own = next((e for e in self._graph.relations if {e.from_, e.to} == pair), None)
            was = read.get(pair)
            if own is None or was is None or (own.type, own.from_) != (now.type, now.from_):
                unsaid = own is not None and own.type == now.type and not self._tells_event
                kept.append(own if own is not None and unsaid else now)
                continue
            old = was.model_copy(update={f: self._was.get(getattr(was, f) or "") for f in _ENDS})
            changed = {
                f: getattr(now, f)
                for f in RelationEdge.model_fields
                if getattr(now, f) != getattr(old, f)
            }
            kept.append(own.model_copy(update=changed))
        unread = [
            edge
            for edge in self._graph.relations
            if frozenset((edge.from_, edge.to)) not in read and {edge.from_, edge.to} <= present
        ]
        known = {frozenset((each.from_, each.to)) for each in kept}
        return (*kept, *(e for e in unread if frozenset((e.from_, e.to)) not in known))

    def _change_ties(self, present: set[str]) -> tuple[EntryTie, ...]:
        now = {own: theirs for theirs, own in self._now.items()}
        moved = {
            own
            for read, own in self._was.items()
            if own in now and self._after.agent(now[own]).entry != self._before.agent(read).entry
        }
        fresh = [
            tie.model_copy(update=self._rename(tie, ("agent", "of"))) for tie in self._after.ties
        ]
        given = {frozenset((tie.agent, tie.of)) for tie in fresh}
        old = [
            tie
            for tie in self._graph.ties
            if frozenset((tie.agent, tie.of)) not in given and not {tie.agent, tie.of} & moved
        ]
        return tuple(tie for tie in (*old, *fresh) if {tie.agent, tie.of} <= present)

    def _list_new_objects(self) -> list[ObjectNode]:
        """What is to stand in the scene beside what does already."""
        known = self._graph.objects
        number = max((int(each.id.rpartition("-")[2]) for each in known), default=0)
        ids = {each.id: f"object-{number + n}" for n, each in enumerate(self._after.objects, 1)}
        return [
            each.model_copy(
                update={
                    "id": ids[each.id],
                    "beyond": ids.get(each.beyond or ""),
                    **self._rename(each, ("hides", "hidden_from", "met_by")),
                    "others": tuple(
                        m.model_copy(update=self._rename(m, ("agent",))) for m in each.others
                    ),
                }
            )
            for each in self._after.objects
        ]

    def _change_context(self) -> SceneContext:
        was, now = self._before.context, self._after.context
        fields = ("density", "time_of_day", "background")
        update = {f: getattr(now, f) for f in fields if getattr(now, f) != getattr(was, f)}
        return self._graph.context.model_copy(update=update)


def free_name(kind: str, taken: set[str]) -> str:
    """The first unused id of a class."""
    count = 1
    while f"{kind}-{count}" in taken:
        count += 1
    return f"{kind}-{count}"
