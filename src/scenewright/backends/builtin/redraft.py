"""The scene as a draft that the planner's own grammar changes, and back to a social graph.

An agent that the words name carries its id as a label, so that the grammar means the right one;
agents keep their ids, and relations that are not mentioned keep their figures.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from pydantic import ValidationError

from scenewright.backends.builtin import edits as grammar_of_edits
from scenewright.backends.builtin import grammar_plan, graph_making
from scenewright.backends.builtin.clauses import ClauseReader
from scenewright.backends.builtin.clock import Clock, read_clock
from scenewright.backends.builtin.context import read_context
from scenewright.backends.builtin.draft import (
    AgentDraft,
    ContextDraft,
    Draft,
    Refused,
    RelationDraft,
    Site,
)
from scenewright.backends.builtin.grammar import build_modifiers
from scenewright.backends.builtin.lexicon import Chunk, load_lexicon
from scenewright.backends.builtin.mentions import Item, Mention, build_noun_phrases
from scenewright.backends.builtin.normalise import clean, split_tokens
from scenewright.backends.builtin.reader.words import COARSE
from scenewright.backends.builtin.references import People
from scenewright.backends.builtin.scope import check_language, check_scope, check_text
from scenewright.backends.builtin.shorthand import expand
from scenewright.backends.builtin.ties import list_ties
from scenewright.scene.edits import Edit, Situation, diff_graphs
from scenewright.scene.route_table import WAY_FIELDS, resolve_route
from scenewright.scene.social import EntryTie, RelationEdge, SceneContext, SocialGraph


def get_next_item(items: Sequence[Item], at: int) -> Item | None:
    """What follows an item; None at the end."""
    return items[at + 1] if at + 1 < len(items) else None


def read_by_grammar(
    text: str, situation: Situation, people: People, *, site: Site
) -> tuple[Edit, ...]:
    """What the planner's grammar makes of it, as the difference of two graphs."""
    check_text(text)
    whole = expand(clean(text))
    check_language(text, split_tokens(whole))
    plain, clock = read_clock(whole)
    chunks = load_lexicon().split_chunks(split_tokens(plain))
    figures = (clock.time, clock.pet, clock.ttc, clock.speed)
    if not any(each is not None for each in figures) and not _has_time(chunks):
        check_scope(whole, chunks, editing=True)
    base = _Base(situation, site)
    base.change(plain, chunks, clock, people)
    before = situation.graph
    after = base.build_graph(clock).model_copy(update={"objects": before.objects})
    return diff_graphs(before, after)


def _has_time(chunks: Sequence[Chunk]) -> bool:
    return any(chunk.has("TIMEWORD") for chunk in chunks)


class _Base:
    """The scene as a draft that the planner's grammar can change."""

    def __init__(self, situation: Situation, site: Site) -> None:
        self._before = situation.graph
        self._taken = {each.id for each in situation.present}
        drawn = {each.id: each for each in situation.present}
        self._agents = {
            node.id: AgentDraft(
                node.type,
                subtype=COARSE.get(node.subtype or "", node.subtype),
                entry=node.entry,
                exit=node.exit,
                movement=node.movement,
                crosswalk=node.crosswalk,
                runs_red=node.runs_red,
                label=node.id,
                head=_choose_id_head(node.subtype or drawn[node.id].subtype, node.type)
                if node.id in drawn
                else node.type,
            )
            for node in self._before.agents
        }
        self._edges = [
            (
                RelationDraft(
                    edge.type,
                    self._agents[edge.from_],
                    self._agents[edge.to],
                    kind=edge.kind,
                    cause=edge.cause,
                    point_from=edge.point_from,
                    point_to=edge.point_to,
                    pattern=edge.pattern,
                    first=None if edge.first is None else self._agents[edge.first],
                    strikes=None if edge.strikes is None else self._agents[edge.strikes],
                ),
                edge,
            )
            for edge in self._before.relations
        ]
        context = self._before.context
        self._draft = Draft(
            agents=list(self._agents.values()),
            relations=[draft for draft, _ in self._edges],
            context=ContextDraft(density=context.density, time_of_day=context.time_of_day),
            site=site,
        )

    def change(self, plain: str, chunks: Sequence[Chunk], clock: Clock, people: People) -> None:
        """As the words say, in place."""
        draft = self._draft
        if any(chunk.tags.get("EDIT") == "swap" for chunk in chunks):
            for relation in draft.relations:
                relation.from_, relation.to = relation.to, relation.from_
                if relation.first is not None:
                    swapped = relation.first is relation.from_
                    relation.first = relation.to if swapped else relation.from_
                if relation.strikes is not None:
                    swapped = relation.strikes is relation.from_
                    relation.strikes = relation.to if swapped else relation.from_
        else:
            self._read(plain, chunks, people)
        read_context(draft, chunks, clock)
        grammar_of_edits._forget(draft)
        self._keep_fitting_fields()
        if not draft.agents and (draft.context.vehicles, draft.context.pedestrians) == (0, 0):
            raise Refused("impossible", "Then no agent would be left; add one first.")
        graph_making.finish_draft(draft)

    def _read(self, plain: str, chunks: Sequence[Chunk], people: People) -> None:
        draft = self._draft
        rest = list(chunks)
        if "instead" in plain:
            rest = [grammar_of_edits._make_definite(chunk) for chunk in rest]
        earlier, agents = list(draft.relations), list(draft.agents)
        draft.relations.clear()
        items = build_noun_phrases(build_modifiers(rest), text=plain)
        self._label(items, people)
        # A crosswalk given before does not bind a pedestrian that now comes from another side.
        for agent in self._agents.values():
            agent.crosswalk = None
        reader = ClauseReader(draft, editing=True)
        reader.read(items)
        grammar_plan.settle_failed_yields(draft, reader)
        if "late_brake" in reader.said:
            graph_making.set_cause(draft, "late_brake")
        grammar_of_edits._replace_relations(draft, earlier, rest, known=agents)

    def _label(self, items: Sequence[Item], people: People) -> None:
        """Mentions of agents that are there carry their names."""
        for at, item in enumerate(items):
            if not isinstance(item, Mention):
                continue
            agent = people.find_named(item, get_next_item(items, at))
            if agent is None:
                item.label = None
            elif agent.id in self._agents:
                item.label, item.type = agent.id, agent.type
            else:
                raise Refused(
                    "impossible",
                    f"{agent.id} is a background agent without a role; it can be "
                    "removed, slowed down or moved in time, or an agent of its own can be added.",
                )

    def _keep_fitting_fields(self) -> None:
        """An agent with a new route keeps the fields of the former one that fit it."""
        for name, agent in self._agents.items():
            now = {each: getattr(agent, each) for each in WAY_FIELDS}
            was = {each: getattr(self._before.agent(name), each) for each in WAY_FIELDS}
            given = {key: each for key, each in now.items() if each not in (None, was[key])}
            if given.get("movement") == "jaywalking":
                was["crosswalk"] = None
            found = resolve_route(agent.type, was, given, self._draft.site.ways)
            # Where no route fits what is given, the words are reported as they are.
            found = found or {**now, "crosswalk": now["crosswalk"] or was["crosswalk"]}
            for key, each in found.items():
                setattr(agent, key, each)

    def build_graph(self, clock: Clock) -> SocialGraph:
        """The draft as a social graph in which agents keep their ids.

        Raises:
            Refused: what changes does not fit what stays, such as a push without a collision.
        """
        ids = {
            id(agent): name
            for name, agent in self._agents.items()
            if agent.type == self._before.agent(name).type
        }
        taken = self._taken | set(self._agents)
        for agent in self._draft.agents:
            if id(agent) not in ids:
                ids[id(agent)] = free_name(agent.type, taken)
                taken.add(ids[id(agent)])
        nodes = [graph_making.make_node(agent, ids[id(agent)]) for agent in self._draft.agents]
        tied = [
            EntryTie(agent=ids[id(agent)], of=ids[id(other)], side=side)
            for agent, other, side in list_ties(self._draft)
        ]
        given = {frozenset((each.agent, each.of)) for each in tied}
        moved = {n.id for n in nodes if n.id in self._agents and n.entry != self._get_entry(n.id)}
        kept = [
            each
            for each in self._before.ties
            if frozenset((each.agent, each.of)) not in given and not {each.agent, each.of} & moved
        ]
        present = {node.id for node in nodes}
        edges = tuple(self._build_edge(each, ids, clock) for each in self._draft.relations[:6])
        ties = tuple(t for t in (*kept, *tied) if {t.agent, t.of} <= present)
        try:
            return SocialGraph(
                agents=tuple(nodes), relations=edges, ties=ties, context=self._build_context()
            )
        except ValidationError as error:
            fault = error.errors()[0]["msg"].removeprefix("Value error, ")
            raise Refused("contradictory", f"{fault}; change both, or say it anew.") from error

    def _get_entry(self, name: str) -> str | None:
        return self._before.agent(name).entry

    def _build_edge(
        self, relation: RelationDraft, ids: Mapping[int, str], clock: Clock
    ) -> RelationEdge:
        before = next((edge for draft, edge in self._edges if draft is relation), None)
        made = graph_making.make_edge(relation, dict(ids), self._draft)
        if before is None:
            return made
        update: dict[str, object] = {
            name: getattr(made, name)
            for name in ("from_", "to", "kind", "cause", "pattern", "first")
        }
        if relation.type == "follow" and (clock.pet, clock.ttc) != (None, None):
            raise Refused("impossible", "A follower keeps a headway; it has no PET and no TTC.")
        for name, figure in (
            ("target_pet", clock.pet), ("target_ttc", clock.ttc), ("impact_speed", clock.speed),
        ):  # fmt: skip
            if figure is not None:
                update[name] = getattr(made, name)
        return before.model_copy(update=update)

    def _build_context(self) -> SceneContext:
        context = self._draft.context
        update: dict[str, object] = {
            "density": context.density,
            "time_of_day": context.time_of_day,
        }
        if context.vehicles is not None or context.pedestrians is not None:
            update["background"] = graph_making.make_context(self._draft).background
        return self._before.context.model_copy(update=update)


def _choose_id_head(subtype: str | None, kind: str) -> str:
    return kind if subtype is None or kind == "pedestrian" else subtype.replace("_", " ")


def free_name(kind: str, taken: set[str]) -> str:
    """The first unused id of a class."""
    count = 1
    while f"{kind}-{count}" in taken:
        count += 1
    return f"{kind}-{count}"
