"""Predicates: voice, negation, nouns and verbs; waiting for and letting pass."""

from __future__ import annotations

from itertools import pairwise

from scenewright.backends.builtin.cursor import (
    NOUNS,
    Group,
    OpenRelation,
    get_words,
    is_pronoun,
)
from scenewright.backends.builtin.draft import RelationDraft
from scenewright.backends.builtin.grammar import Modifier
from scenewright.backends.builtin.lexicon import Chunk
from scenewright.backends.builtin.mentions import Mention
from scenewright.backends.builtin.modifying import Modifying
from scenewright.backends.builtin.phrases import read_pattern

_RELATION_TAGS = {
    "COLLIDE": "collide_at", "NEAR": "near_miss", "YIELD": "yield_to", "FOLLOW": "follow",
    "WAIT": "yield_to", "LET": "yield_to",
}  # fmt: skip

_WAIT_FOR = frozenset(
    {"for", "until", "till", "while", "as", "so", "when", "before", "because", "once"}
)

_CRASHES = frozenset({"collision", "crash", "accident", "wreck", "conflict"})

_PLAIN_NOUNS = frozenset(
    [
        "collision",
        "accident",
        "yielding",
        "miss",
        "call",
        "shave",
        "contact",
        "encounter",
        "bender",
        "run",
        "crash",
        "collisions",
        "accidents",
    ]
)
_EVASIONS = (
    "swerv",
    "brak",
    "evad",
    "evas",
    "dodg",
    "slam",
    "screech",
    "emergency",
    "hard",
    "panic",
)
"""Verbs whose denial may be the cause of a collision."""

_PRIORITY = frozenset(["way", "priority", "precedence", "room", "space", "ahead"])


class Relating(Modifying):
    """Opens relations where a predicate stands."""

    def _read_relation(self, at: int, chunk: Chunk, tag: str) -> None:
        value = chunk.tags[tag]
        kind = value if tag == "COLLIDE" and value != "any" else None
        negated, almost = self._find_polarity(at)
        negated = negated and self._is_governing(at, chunk)
        if negated and tag == "NEAR" and chunk.words[0].startswith(_EVASIONS):
            return
        if tag == "NEAR" and "brake" in chunk.text:
            self._mark_as_driver(finite=True)
        type_ = _RELATION_TAGS[tag]
        if tag == "COLLIDE" and almost and not (negated and almost == "avoid"):
            type_, negated = "near_miss", False
            if almost == "avoid":
                almost = "avoided"
        elif tag == "COLLIDE" and negated and almost == "avoid":
            negated = False
        if tag == "COLLIDE" and self._is_averted(at):
            type_, negated, kind = "near_miss", False, None
        if tag == "FOLLOW" and value == "chain":
            self._chain()
            return
        pattern, turned = read_pattern(chunk.tags.get("PATTERN"))
        relation = OpenRelation(
            type_,
            kind,
            at,
            None,
            negated=negated,
            tag=tag,
            reverse=turned or value == "reverse",
            avoided=almost == "avoided",
            pattern=pattern if type_ == _RELATION_TAGS[tag] else None,
        )
        self._set_voice(relation, at, chunk)
        self._set_listed_actor(relation, at)
        if relation.nominal:
            self._read_heading(at)
        if tag == "FOLLOW" and chunk.text == "behind":
            relation.subject = self.last if self.sentence else None
        self._start(relation)

    def _is_averted(self, at: int) -> bool:
        """ "collision averted": it came close to one."""
        after = self._get_item(at + 1)
        return isinstance(after, Chunk) and after.text in {"averted", "avoided", "prevented"}

    def _set_listed_actor(self, relation: OpenRelation, at: int) -> None:
        """ "pedestrian on the west crosswalk, truck turning right, yields": the truck does."""
        before, after = self._get_item(at - 1), self._get_item(at + 1)
        bare = after is None or (isinstance(after, Chunk) and bool(after.mark))
        comma = isinstance(before, Chunk) and before.mark == ","
        groups = [group for _, group in self.sentence]
        listed = relation.type == "yield_to" and bare and comma and len(groups) > 1
        if not listed or relation.nominal or self.verb_seen or self.relative:
            return
        vehicles = [group for group in groups if group[0].type == "vehicle"]
        if len(vehicles) == 1:
            relation.subject = vehicles[0]

    def _read_heading(self, at: int) -> None:
        """ "Vehicle-pedestrian collision: a cab ..." announces agents that are named later."""
        before = self._get_item(at - 1)
        chunk = self._get_item(at)
        noun = isinstance(chunk, Chunk) and chunk.words[-1] in _CRASHES
        heads = isinstance(before, Mention) and (
            before.det == "bare" or (noun and before.det == "indefinite")
        )
        if not heads:
            return
        self._announce_agents(at - 1)
        for back in (2, 3):
            item = self._get_item(at - back)
            if isinstance(item, Mention) and item.det == "bare" and not item.counted:
                self._announce_agents(at - back)
            elif not (
                isinstance(item, Chunk)
                and (item.has("TO") or item.text in {"on", "vs", "versus", "and"})
            ):
                return

    def _announce_agents(self, at: int) -> None:
        for place, group in self.sentence:
            if place == at:
                for agent in group:
                    agent.announced = True

    def _start(self, relation: OpenRelation) -> None:
        if (self.gap is not None and relation.subject and self.gap is not relation.subject) or (
            self.relative and self.gap is not None
        ):
            relation.object = self.gap
        relation.sentence = self.sentence
        if relation.subject is not None and relation.subject is self.subject:
            relation.causer = [agent for agent in self.causer if agent not in relation.subject]
        self.open.append(relation)
        self.awaiting = relation
        self.verb_seen = True
        self.boundary = self.linked = False

    def _set_voice(self, relation: OpenRelation, at: int, chunk: Chunk) -> None:
        surface = chunk.words[0]
        be = self._has_be_before(at)
        by = self._has_by_ahead(at)
        participle = not surface.endswith(("ing", "s")) or surface in {"t", "rear"}
        relation.passive = participle and (be or by) and not (be and surface.endswith("ing"))
        reduced = relation.passive and not be
        if self._is_nominal(at, chunk) and not relation.passive:
            relation.nominal = True
            follows = self._get_item(at + 1)
            relation.between = (
                isinstance(follows, Chunk)
                and follows.has("BETWEEN")
                and follows.text not in {"for"}
            )
            relation.explicit = relation.between
            relation.subject = (
                None if relation.between or not self._is_light_verb(at) else self.subject
            )
            return
        attributive = (
            surface.endswith("ing")
            and not be
            and not self._is_after_comma(at)
            and not self._is_after_while(at)
            and not self._is_negated_near(at)
        )
        if (reduced or attributive) and self.last and self._is_touching_mention(at):
            relation.subject = self.last
        else:
            if (
                self.relative
                and self.awaiting is not None
                and self.awaiting.object is not None
                and not self.boundary
                and self.gap is None
            ):
                self._leave_relative()
            relation.subject = self.subject or None
            if (
                relation.subject is None
                and not self.sentence
                and not surface.endswith("ing")
                and self.previous_subject
                and self._has_and_before(at)
            ):
                relation.subject = self.previous_subject

    def _is_nominal(self, at: int, chunk: Chunk) -> bool:
        before, after = self._get_item(at - 1), self._get_item(at + 1)
        if isinstance(after, Chunk) and after.text in {"between", "involving", "among"}:
            return True
        heading = isinstance(after, Chunk) and after.mark == ":"
        if heading or chunk.text in {"car following", "vehicle following", "following scenario"}:
            return True
        noun = chunk.words[-1] in NOUNS
        determined = isinstance(before, Chunk) and (
            before.has("DET") or before.text in {"a", "the"}
        )
        if isinstance(before, Modifier) and noun and before.chunks[0].text in {"a", "the", "an"}:
            determined = True
        back = 2
        while (
            not determined
            and noun
            and isinstance(before, Chunk)
            and not before.has("BE", "AGENT", "NEGATION")
            and not before.mark
            and back < 5
        ):
            before = self._get_item(at - back)
            determined = isinstance(before, Chunk) and before.has("DET")
            back += 1
        if determined and (noun or not chunk.has("COLLIDE")):
            return not (isinstance(after, Chunk) and after.text in {"into", "to"})
        finite_object = isinstance(after, Mention)
        crashes = chunk.text == "crash" and len(self.subject) > 1 and not self.verb_seen
        return (
            noun
            and not crashes
            and (
                chunk.words[-1] in _PLAIN_NOUNS
                or (len(chunk.words) > 1 and chunk.words[-1] in {"misses", "calls", "shaves"})
            )
            and not finite_object
            and not (isinstance(after, Chunk) and after.has("TO"))
        )

    def _is_light_verb(self, at: int) -> bool:
        """ "is involved in a collision with", "has a near miss with"."""
        after = self._get_item(at + 1)
        return bool(self.subject) and isinstance(after, Chunk) and after.has("WITH")

    def _is_avoiding(self, at: int) -> bool:
        """ "barely avoids a jogger": an object, and no collision between."""
        after, chunk = self._get_item(at + 1), self._get_item(at)
        if get_words(chunk).startswith("prevent"):
            return False
        if isinstance(after, Chunk) and after.tags.get("PRONOUN") == "each":
            return True
        return self._has_mention_ahead(at) and (isinstance(after, Mention) or is_pronoun(after))

    def _read_by(self) -> None:
        if self.awaiting is not None and self.awaiting.passive:
            self.awaiting.by = True
            self.boundary = False
        else:
            passive = next((r for r in reversed(self.open) if r.passive and r.object is None), None)
            if passive is not None:
                passive.by, self.awaiting = True, passive

    def _chain(self) -> None:
        if self._chain_behind() or {agent.type for agent in self.last} == {"pedestrian"}:
            return
        wider = len(self.subject) > len(self.last) and set(map(id, self.last)) <= set(
            map(id, self.subject)
        )
        groups = (self.subject, self.last) if wider else (self.last, self.subject)
        group = next((g for g in groups if len(g) > 1), None)
        group = group or [a for _, g in self.sentence for a in g] or list(self.draft.agents)
        vehicles = [agent for agent in group if agent.type == "vehicle"]
        if len(vehicles) < 2:
            self.deferred.append(OpenRelation("follow", None, 0, None, nominal=True))
            return
        for first, second in pairwise(vehicles):
            self._add_edge(RelationDraft("follow", first, second, soft=True))

    def _chain_behind(self) -> bool:
        """ "Two cars follow a truck in a chain": the second follows the first."""
        relation = self.awaiting
        if relation is None or relation.type != "follow" or relation.negated:
            return False
        followers, leaders = relation.subject or [], relation.object or []
        if relation.passive != relation.reverse:
            followers, leaders = leaders, followers
        if len(followers) + len(leaders) < 3 or not (followers and leaders):
            return False
        self.open.remove(relation)
        self.awaiting = None
        for first, second in pairwise([*leaders, *followers]):
            self._add("follow", second, first)
        return True

    def _wait(self, at: int, chunk: Chunk) -> None:
        before = self._get_item(at - 1)
        if isinstance(before, Chunk) and (before.has("DET") or before.has("FROM")):
            return
        if self._is_next(at, ("LET", "YIELD", "NEAR")) or self._is_stopping_at_signal(at):
            self.verb_seen = True
            return
        negated, almost = self._find_polarity(at)
        negated = negated and self._is_governing(at, chunk)
        if almost == "almost":
            return
        target = self._find_waited_for(at)
        relation = OpenRelation(
            "yield_to",
            None,
            at,
            self._wait_subject(at, chunk),
            negated=negated,
            tag="WAIT",
            weak=target is None,
        )
        if target is None:
            relation.closed = True
            relation.sentence = self.sentence
            if self.causer and self.subject and self.causer is not self.subject and not self.signal:
                relation.object, relation.weak = self.causer, False
            self.open.append(relation)
            self.verb_seen = True
            if self.gap is not None and self._get_next_text(at) == "for":
                relation.object, relation.weak = self.gap, False
            return
        self._start(relation)

    def _wait_subject(self, at: int, chunk: Chunk) -> Group | None:
        if (
            chunk.words[0].endswith("ing")
            and not self._has_be_before(at)
            and self._is_touching_mention(at)
            and not self._is_after_comma(at)
        ):
            return self.last or None
        return self.subject or None

    def _find_waited_for(self, at: int) -> int | None:
        """Index of the one waited for; None where the text names no agent."""
        marker = turning = False
        for step in range(1, 12):
            item = self._get_item(at + step)
            if item is None:
                return None
            if isinstance(item, Mention):
                return at + step if marker and item.det != "no" else None
            if isinstance(item, Modifier):
                turning = True
                continue
            if item.has("PRONOUN") and marker and item.tags["PRONOUN"] not in {"self", "each"}:
                return at + step
            if item.has("BOTH") and marker:
                return at + step
            if item.mark or item.has("SIGNAL", "COLLIDE", "NEAR", "ALMOST"):
                return None
            if item.has("LET", "FOLLOW"):
                return None
            if item.words[0] in _WAIT_FOR:
                marker = not (turning and item.words[0] == "when")
            elif item.has("AND") and item.text not in {"so", "before"}:
                return None
        return None

    def _is_stopping_at_signal(self, at: int) -> bool:
        for step in range(1, 5):
            item = self._get_item(at + step)
            if isinstance(item, Chunk) and item.has("SIGNAL"):
                self.signal = True
                return True
            if isinstance(item, Mention) or item is None or (isinstance(item, Chunk) and item.mark):
                return False
        return False

    def _is_letting_pass(self, at: int, chunk: Chunk) -> bool:
        """ "lets B pass", "gives B the right of way", "is allowed to go first by"."""
        giving = chunk.words[0].startswith(("giv", "gave", "grant"))
        if (
            self._has_be_before(at)
            and chunk.words[0] in {"given", "granted", "let", "allowed", "permitted", "waved"}
            and self._goes_first(at, giving=giving)
        ):
            relation = OpenRelation(
                "yield_to", None, at, self.subject or None, passive=True, tag="LET"
            )
            self._start(relation)
            return True
        fronting = chunk.words[0].endswith("ing")
        if not self.subject and not self.gap and not self._is_continuing(at) and not fronting:
            return False
        target = next(
            (
                s
                for s in range(1, 4)
                if isinstance(self._get_item(at + s), Mention) or is_pronoun(self._get_item(at + s))
            ),
            None,
        )
        if target is None or not self._goes_first(at + target, giving=giving):
            return False
        subject = self.subject or (None if fronting else self.previous_subject)
        negated, _ = self._find_polarity(at)
        self._start(OpenRelation("yield_to", None, at, subject or None, negated=negated, tag="LET"))
        return True

    def _is_continuing(self, at: int) -> bool:
        return bool(self.previous_subject) and self._has_and_before(at)

    def _goes_first(self, at: int, *, giving: bool) -> bool:
        for step in range(1, 10):
            item = self._get_item(at + step)
            if item is None or (isinstance(item, Chunk) and item.mark in {".", ";"}):
                return False
            words = set(get_words(item).split())
            if giving:
                if words & _PRIORITY:
                    return True
            elif (
                (
                    isinstance(item, Chunk)
                    and item.has("GO_FIRST", "CROSS", "TURN", "STRAIGHT", "HEAD")
                )
                or (
                    isinstance(item, Modifier)
                    and item.first in {"clear", "leave", "finish", "reach"}
                )
                or (
                    isinstance(item, Modifier)
                    and not isinstance(item, Mention)
                    and (
                        words
                        & {
                            "cross",
                            "across",
                            "crossing",
                            "turn",
                            "go",
                            "pass",
                            "through",
                            "make",
                            "walk",
                        }
                    )
                )
            ):
                return True
            if isinstance(item, Mention):
                return False
        return False
