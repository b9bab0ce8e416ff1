"""Relations get both their agents: at the end of a sentence, or of the text."""

from __future__ import annotations

from itertools import pairwise

from scenewright.backends.builtin.attach import (
    PEDESTRIAN_ONLY,
)
from scenewright.backends.builtin.cursor import (
    NOUNS,
    SYMMETRIC,
    Cursor,
    Group,
    OpenRelation,
)
from scenewright.backends.builtin.draft import AgentDraft, Refused, RelationDraft
from scenewright.backends.builtin.grammar import Modifier
from scenewright.backends.builtin.lexicon import Chunk

_BETWEEN_VEHICLES = frozenset({"rear_end", "sideswipe", "head_on", "angle"})
_HALTS = frozenset({"wai", "sto", "bra", "slo", "pau", "hal", "dec"})


def _needs_pedestrian(hint: Modifier | Chunk) -> bool:
    if isinstance(hint, Modifier):
        return hint.means in PEDESTRIAN_ONLY or hint.means.startswith("cross")
    return hint.has("JAYWALK", "CROSS")


def _drop_duplicates(agents: object) -> Group:
    return list(dict.fromkeys(agents))  # type: ignore[call-overload]


class Settling(Cursor):
    """Closes relations into edges of the draft."""

    def _close(self, relation: OpenRelation) -> None:
        subject, object_ = relation.subject, relation.object
        unasked = relation.nominal and not (relation.explicit or relation.negated)
        if unasked and self._is_given_by_verb(relation):
            self._lend_kind(relation)
            return
        if relation.weak and object_ is None:
            self._close_weak(relation)
            return
        listed = self._list_pairs(relation) if relation.nominal else []
        if len(listed) > 1:
            for first, second in listed:
                self._settle(relation, *self._order_by_right_of_way(relation, (first, second)))
            return
        if relation.nominal or subject is None:
            pair = self._find_nominal_pair(relation)
            if pair is None:
                self._defer_relation(relation)
            else:
                self._settle(relation, *self._order_by_right_of_way(relation, pair))
            return
        if object_ is not None and relation.type in SYMMETRIC:
            object_ = [agent for agent in object_ if agent not in subject] or None
        if (
            object_ is None
            and relation.type in SYMMETRIC
            and len(subject) > 1
            and not relation.passive
        ):
            self._settle_group(relation, subject)
            return
        if object_ is None:
            object_ = self._find_missing_object(relation, subject)
        if object_ is None:
            self._defer_relation(relation)
        else:
            self._settle(relation, subject, object_)

    def _is_given_by_verb(self, relation: OpenRelation) -> bool:
        """ "a yielding scene: the car yields ..." asks for one yield."""
        return any(
            other.type == relation.type
            and not other.nominal
            and not other.negated
            and other.subject
            for other in self.open
        )

    def _lend_kind(self, relation: OpenRelation) -> None:
        for edge in self.draft.relations:
            if edge.type == relation.type:
                edge.kind = edge.kind or relation.kind

    def _order_by_right_of_way(
        self, relation: OpenRelation, pair: tuple[Group, Group]
    ) -> tuple[Group, Group]:
        """Where a noun names no direction, the vehicle yields, else the one named first."""
        first, second = pair
        after = self._get_item(relation.at + 1)
        if relation.type != "yield_to" or (isinstance(after, Chunk) and after.has("TO")):
            return pair
        order = self.draft.agents
        late = order.index(first[0]) > order.index(second[0])
        mixed = first[0].type != second[0].type
        if (mixed and first[0].type == "pedestrian") or (
            not mixed and late and not relation.passive
        ):
            return second, first
        return pair

    def _close_weak(self, relation: OpenRelation) -> None:
        halts = (
            isinstance(chunk := self._get_item(relation.at), Chunk) and chunk.words[0][:3] in _HALTS
        )
        if relation.subject and halts and not self.signal:
            relation.sentence = list(self.sentence)
            self.deferred.append(relation)

    def _defer_relation(self, relation: OpenRelation) -> None:
        if relation.negated:
            if relation.nominal or relation.type in SYMMETRIC:
                self.draft.denied.add(relation.type)
            return
        self.deferred.append(relation)

    def _list_pairs(self, relation: OpenRelation) -> list[tuple[Group, Group]]:
        """ "two near misses: a car with a pedestrian and a bus with another one"."""
        after = [(at, group) for at, group in self.sentence if at > relation.at]
        return [
            (first, second)
            for (start, first), (end, second) in pairwise(after)
            if any(
                isinstance(item, Chunk) and item.has("WITH") for item in self.items[start + 1 : end]
            )
        ]

    def _find_nominal_pair(self, relation: OpenRelation) -> tuple[Group, Group] | None:
        object_ = relation.object or []
        if relation.subject and object_:
            return relation.subject, object_
        if len(object_) >= 2:
            return object_[:1], object_[1:2]
        agents = [(at, agent) for at, group in self.sentence for agent in group]
        before = _drop_duplicates(
            agent for at, agent in agents if at < relation.at and agent not in object_
        )
        after = _drop_duplicates(
            agent for at, agent in agents if at > relation.at and agent not in object_
        )
        earlier = next(
            (
                r
                for r in reversed(self.open)
                if r is not relation and r.at < relation.at and r.subject and r.object
            ),
            None,
        )
        if not object_ and earlier is not None and earlier.subject and earlier.object:
            return (
                (earlier.object, earlier.subject)
                if earlier.passive
                else (earlier.subject, earlier.object)
            )
        if object_:
            other = before[-1:] or after[:1]
            return (other, object_) if other else None
        if len(before) >= 2:
            return before[-2:-1], before[-1:]
        if before and after:
            return before[:1], after[:1]
        return (after[:1], after[1:2]) if len(after) >= 2 else None

    def _find_missing_object(self, relation: OpenRelation, subject: Group) -> Group | None:
        if relation.causer:
            return relation.causer
        if relation.kind in _BETWEEN_VEHICLES and subject[0].type == "vehicle":
            return self._find_other_vehicle(relation, subject)
        agents = [(at, a) for at, group in self.sentence for a in group if a not in subject]
        after = _drop_duplicates(a for at, a in agents if at > relation.at)
        before = _drop_duplicates(a for at, a in agents if at < relation.at)
        if relation.type == "follow" and not after:
            before = [a for a in before if a.type == subject[0].type]
        found = (before[-1:] or after[:1]) if relation.passive else (after[:1] or before[-1:])
        if found:
            return found
        if (
            relation.type == "follow"
            and relation.tag == "FOLLOW"
            and not relation.negated
            and not found
        ):
            return None
        if relation.negated:
            return [a for a in self.draft.agents if a not in subject][-1:] or None
        return None

    def _find_other_vehicle(self, relation: OpenRelation, subject: Group) -> Group | None:
        """ "brakes for a jaywalker and nearly gets hit from behind": not by the jaywalker."""
        earlier = [(at, a) for at, group in self.sentence for a in group if a not in subject]
        vehicles = [(at, a) for at, a in earlier if a.type == "vehicle"]
        after = _drop_duplicates(a for at, a in vehicles if at > relation.at)
        before = _drop_duplicates(a for at, a in vehicles if at < relation.at)
        found = (before[-1:] or after[:1]) if relation.passive else (after[:1] or before[-1:])
        known = [a for a in self.draft.agents if a.type == "vehicle" and a not in subject]
        if found or known or not earlier:
            return found or None
        return [self.discourse.create("vehicle")]

    def _settle_group(self, relation: OpenRelation, group: Group) -> None:
        for first, second in pairwise(group):
            self._settle(relation, [first], [second])

    def _settle(self, relation: OpenRelation, subject: Group, object_: Group) -> None:
        swap = relation.passive != relation.reverse
        if relation.type == "follow" and relation.nominal:
            swap ^= any(a.role == "leader" for a in subject) or any(
                a.role == "follower" for a in object_
            )
        actors, targets = (object_, subject) if swap else (subject, object_)
        for actor in actors:
            for target in targets:
                if actor is target:
                    continue
                striker = (
                    self._find_driver_of(actor, target) if relation.type in SYMMETRIC else actor
                )
                edge = RelationDraft(relation.type, striker, target, relation.kind)
                edge.soft = relation.tag == "WAIT"
                edge.pattern = relation.pattern
                if relation.negated:
                    self.failed.append(edge)
                elif relation.avoided and any(
                    r.pair() == edge.pair() for r in self.draft.relations
                ):
                    continue
                else:
                    self._add_edge(edge)

    def _find_driver_of(self, actor: AgentDraft, target: AgentDraft) -> AgentDraft:
        """ "he struck the pedestrian": he is the driver, not a second pedestrian."""
        vehicles = [agent for agent in self.draft.agents if agent.type == "vehicle"]
        both = actor.type == target.type == "pedestrian"
        return vehicles[0] if both and len(vehicles) == 1 else actor

    def _add(self, type_: str, first: AgentDraft, second: AgentDraft | None) -> None:
        if second is not None and first is not second:
            self._add_edge(RelationDraft(type_, first, second))

    def _add_edge(self, edge: RelationDraft) -> None:
        for known in self.draft.relations:
            if known.type == edge.type and known.pair() == edge.pair():
                if edge.type in {"yield_to", "follow"} and known.from_ is not edge.from_:
                    if known.type == "follow" and known.soft:
                        self._turn_row()
                        return
                    raise Refused(
                        "contradictory",
                        "Two agents cannot each give way to, or follow, the other; "
                        "say which one does.",
                    )
                known.kind = known.kind or edge.kind
                known.pattern = known.pattern or edge.pattern
                return
        self.draft.relations.append(edge)

    def _turn_row(self) -> None:
        """ "three cars in a row, the last follows ...": the row is listed from behind."""
        for edge in self.draft.relations:
            if edge.type == "follow" and edge.soft:
                edge.from_, edge.to = edge.to, edge.from_

    def _settle_deferred(self) -> None:
        strong = [r for r in self.deferred if not r.weak]
        for relation in strong:
            known = [r for r in self.draft.relations if r.type == relation.type]
            if known:
                known[0].kind = known[0].kind or relation.kind
                continue
            self._check_about_traffic(relation)
            vehicles = [agent for agent in self.draft.agents if agent.type == "vehicle"]
            if relation.type == "follow" and relation.nominal and len(vehicles) > 2:
                self._settle_group(relation, vehicles)
                continue
            self._settle(relation, *self._find_text_pair(relation))
        if self.draft.relations or self.draft.normal:
            return
        self._settle_trailing()
        self._settle_weak([r for r in self.deferred if r.weak and r.subject])

    def _settle_weak(self, weak: list[OpenRelation]) -> None:
        """ "a car waits; a pedestrian crosses": the agent that stops does it for the others."""
        stopping = [agent for relation in weak for agent in relation.subject or []]
        others = [agent for agent in self.draft.agents if agent not in stopping]
        together = len(others) == 1 or {a.type for a in others} == {"pedestrian"}
        if not others or not together or any(agent.role == "leader" for agent in stopping):
            return
        for relation in weak:
            self._settle(relation, relation.subject or [], others)

    def _settle_trailing(self) -> None:
        """ "a taxi with a truck behind it", "the bus goes first": nothing else happens."""
        first = self.leading
        others = [agent for agent in self.draft.agents if agent not in first]
        if len(first) == len(others) == 1 and not self.deferred:
            self._add("yield_to", others[0], first[0])
            return
        for agent in self.trailing if "late_brake" not in self.said else []:
            ahead = [a for a in self.draft.agents if a.type == "vehicle" and a is not agent]
            if len(ahead) == 1 and not self.deferred:
                self._add("follow", agent, ahead[0])

    def _check_about_traffic(self, relation: OpenRelation) -> None:
        """ "two galaxies collide": the verb's subject is no agent."""
        chunk = self._get_item(relation.at)
        verb = (
            isinstance(chunk, Chunk)
            and chunk.words[-1] not in NOUNS
            and not chunk.has("YIELD", "FOLLOW")
        )
        if not self.draft.agents and relation.kind is None and verb:
            raise Refused(
                "out_of_scope", "The text names no vehicle and no pedestrian; name the agents."
            )

    def _find_text_pair(self, relation: OpenRelation) -> tuple[Group, Group]:
        agents = list(self.draft.agents)
        subject = (relation.subject or relation.object or [])[:1]
        others = [a for a in agents if a not in subject]
        if subject:
            first, second = (
                subject[0],
                (others[0] if others else self._find_partner_of(relation, subject[0])),
            )
        elif len(agents) >= 2:
            first, second = agents[0], agents[1]
        elif agents:
            first, second = agents[0], self._find_partner_of(relation, agents[0])
        else:
            first = self.discourse.create("vehicle")
            second = self._find_partner_of(relation, first)
        if (
            relation.type == "yield_to"
            and not subject
            and first.type != second.type
            and first.type == "pedestrian"
        ):
            first, second = second, first
        return [first], [second]

    def _find_partner_of(self, relation: OpenRelation, agent: AgentDraft) -> AgentDraft:
        pedestrian = agent.type == "vehicle" and (
            (relation.type == "yield_to" and not relation.passive)
            or any(_needs_pedestrian(h) for h in self.fronted + self.hints)
        )
        return self.discourse.create("pedestrian" if pedestrian else "vehicle")
