"""Sentences -> agents, relations and their attributes: the walk over the items."""

from __future__ import annotations

from collections.abc import Sequence

from scenewright.backends.builtin.cursor import (
    PARTS,
    OpenRelation,
    is_pronoun,
)
from scenewright.backends.builtin.grammar import Modifier
from scenewright.backends.builtin.lexicon import Chunk
from scenewright.backends.builtin.mentions import Item, Mention
from scenewright.backends.builtin.naming import Naming

_CAUSES = frozenset(
    [
        "make",
        "makes",
        "made",
        "making",
        "force",
        "forces",
        "forced",
        "forcing",
        "cause",
        "causes",
        "caused",
        "causing",
        "leave",
    ]
)

_VERBS = frozenset(
    [
        "has",
        "have",
        "had",
        "saw",
        "see",
        "wants",
        "went",
        "came",
        "began",
        "will",
        "does",
        "do",
        "did",
        "must",
        "can",
        "could",
        "should",
        "would",
    ]
)


_PROPERTIES = ("JAYWALK", "CROSS", "OPPOSITE", "OF_OTHER", "SAME", "REDRUN", "SIGNAL")
_OWNERS = {
    "its": Chunk(("it",), {"PRONOUN": "it"}),
    "his": Chunk(("him",), {"PRONOUN": "he"}),
    "her": Chunk(("her",), {"PRONOUN": "he"}),
    "their": Chunk(("them",), {"PRONOUN": "they"}),
}
_CHASES = ("chas", "pursu", "stalk")
_ALONG = (["on"], ["from"], ["along"])


class ClauseReader(Naming):
    """Reads items from left to right into a Draft."""

    def read(self, items: Sequence[Item]) -> None:
        """Read all items; relations that name no agent are settled at the end."""
        self.items = items
        for at, item in enumerate(items):
            if isinstance(item, Mention):
                self._read_mention(at, item)
            elif isinstance(item, Modifier):
                self._apply_modifier(at, item)
            else:
                self._read_chunk(at, item)
        self._end_sentence()
        self._settle_deferred()
        self._spread_hints()
        present = self.draft.agents
        self.draft.relations[:] = [
            edge for edge in self.draft.relations if edge.from_ in present and edge.to in present
        ]

    def _read_chunk(self, at: int, chunk: Chunk) -> None:
        if chunk.has("CORRECTION"):
            self.editing = True
            self._read_comma(at)
        elif chunk.mark in {".", ";", "!", "?", "|"}:
            self._end_sentence()
        elif chunk.mark:
            self._read_comma(at)
        elif chunk.has("WHO") and self._is_relative_clause(at):
            return
        else:
            self._read_word(at, chunk)

    def _read_word(self, at: int, chunk: Chunk) -> None:
        self._read_main_verb(chunk)
        causes = chunk.words[0] in _CAUSES and not chunk.has("YIELD")
        if causes and self.subject and isinstance(self._get_item(at + 1), Mention):
            self.causer, self.caused, self.awaiting = self.subject, True, None
            return
        tag = next((tag for tag in ("NEAR", "COLLIDE", "YIELD", "FOLLOW") if chunk.has(tag)), None)
        if tag == "FOLLOW" and self._is_mere_place(at, chunk):
            return
        if tag is not None and not chunk.has("SIGNAL"):
            self._read_relation(at, chunk, tag)
        elif chunk.text == "into" and self._is_turned_into(at):
            self._start(OpenRelation("collide_at", None, at, self.subject or None, tag="COLLIDE"))
        elif chunk.has("LATE"):
            self._read_late_brake(at)
        elif (pronoun := self._stands_for(at, chunk)) is not None:
            self._read_pronoun(at, pronoun)
        elif chunk.tags.get("ALMOST") == "avoid" and self._is_avoiding(at):
            self._start(OpenRelation("near_miss", None, at, self.subject or None, tag="NEAR"))
        elif chunk.has("LET") and self._is_letting_pass(at, chunk):
            return
        elif chunk.has("WAIT"):
            self._wait(at, chunk)
        elif chunk.has("BY"):
            self._read_by()
        elif chunk.text == "between" and self._is_repeated_between(at):
            return
        else:
            self._read_minor(at, chunk)

    def _stands_for(self, at: int, chunk: Chunk) -> Chunk | None:
        """The pronoun, or that of "hits its bumper"."""
        if chunk.has("PRONOUN"):
            return chunk
        owns = chunk.text in _OWNERS and self._takes_object() and self._is_part_after(at)
        return _OWNERS[chunk.text] if owns else None

    def _is_part_after(self, at: int) -> bool:
        """ "hits its bumper": a part means the whole."""
        words: list[str] = []
        for item in self.items[at + 1 : at + 4]:
            if not isinstance(item, Chunk) or item.mark:
                break
            words += item.words
        return not PARTS.isdisjoint(words)

    def _is_repeated_between(self, at: int) -> bool:
        """ "two near misses, one between ... and one between ...": a second one of the kind."""
        before = self._get_item(at - 1)
        relation = self.open[-1] if self.open else None
        one = isinstance(before, Mention) and before.type is None
        if relation is None or not (relation.nominal and one):
            return False
        if not relation.between:
            relation.between = relation.explicit = True
            relation.object, relation.closed, self.awaiting = None, False, relation
            return True
        relation.object = (relation.object or [])[:2]
        again = OpenRelation(relation.type, relation.kind, at, None, nominal=True, tag=relation.tag)
        again.between = again.explicit = True
        self._start(again)
        return True

    def _has_priority(self, at: int, chunk: Chunk) -> bool:
        """ "the bus goes first", "the bus has the right of way"."""
        if chunk.words[-1] == "first" and len(chunk.words) > 1:
            return True
        before = self._get_item(at - 1)
        owns = isinstance(before, Chunk) and before.text in {"has", "have", "had", "gets", "takes"}
        return owns and chunk.words[-1] in {"way", "priority", "precedence"}

    def _read_main_verb(self, chunk: Chunk) -> None:
        """ "the car that hit the pedestrian came from the west": the car came."""
        finite = chunk.has("BE") or (chunk.has("HEAD") and not chunk.words[0].endswith("ing"))
        relation = self.awaiting
        closed = relation is not None and relation.object is not None
        closed = closed and relation is not None and relation.tag not in {"LET", "WAIT"}
        inside = self.relative and self.verb_seen and not self.boundary and self.gap is None
        if finite and closed and inside:
            self._leave_relative()
            self.last = self.subject or self.last

    def _is_mere_place(self, at: int, chunk: Chunk) -> bool:
        """ "the car behind", "stops ahead of the pedestrian": no agent follows another."""
        if chunk.text == "behind":
            verb = self._get_item(at + 1)
            acts = isinstance(verb, Chunk) and verb.has("LATE", "NEGATION", "BE")
            return acts or not self._has_mention_ahead(at) or self._is_walking_behind(at)
        if chunk.words[0].startswith(_CHASES):
            return not any(agent.type == "vehicle" for agent in self.subject)
        after = self._get_item(at + 1)
        walks = isinstance(after, Mention) and after.type == "pedestrian"
        return chunk.text == "ahead of" and walks

    def _is_walking_behind(self, at: int) -> bool:
        """ "crosses behind a bus"."""
        after = self._get_item(at + 1)
        on_foot = {agent.type for agent in self.subject} == {"pedestrian"}
        return on_foot and isinstance(after, Mention) and after.type == "vehicle"

    def _read_late_brake(self, at: int) -> None:
        """ "does not brake in time for the bus": it is the bus that is hit."""
        self.said.append("late_brake")
        self.verb_seen = True
        for_whom = self._get_next_text(at) in {"for", "behind"}
        if for_whom and isinstance(self._get_item(at + 2), Mention):
            self._start(OpenRelation("collide_at", None, at, self.subject or None, tag="COLLIDE"))

    def _is_turned_into(self, at: int) -> bool:
        """ "turned left into a bus", not "into the path of a bus" or "into the avenue"."""
        before, after = self._get_item(at - 1), self._get_item(at + 1)
        if isinstance(before, Modifier):
            moved = before.means in {"turn", "straight", "uturn"}
        else:
            moved = isinstance(before, Chunk) and before.has("HEAD")
        path = self._get_item(at + 2)
        way = isinstance(path, Chunk) and path.words[0] in {"path", "way", "lane"}
        is_agent = isinstance(after, Mention) and after.type is not None and not after.mass
        return moved and not way and (is_agent or is_pronoun(after))

    def _read_minor(self, at: int, chunk: Chunk) -> None:
        if chunk.has("GO_FIRST") and self._has_priority(at, chunk):
            self.leading = self.leading or self.subject
        if chunk.has("BOTH"):
            self._set_plural_subject(everyone=chunk.text == "all of them")
        elif chunk.has("DITTO"):
            self._repeat_movement()
        elif chunk.has("EXITWALK") or chunk.text == "there":
            self._read_place(at, chunk)
        elif chunk.has("AND", "WHILE"):
            self._connect(at, chunk)
        elif chunk.has("BE"):
            self.verb_seen = True
        elif chunk.has(*_PROPERTIES) or self._comes_across(at, chunk):
            self._read_property(at, chunk)
        elif chunk.has("LEFT", "RIGHT", "THROUGH"):
            self._read_bare_turn(at, chunk)
        elif chunk.has("BACKGROUND") and self.counted and self.counted[-1] is self.last:
            self.move_to_background(self.last)
        elif chunk.tags.keys() <= {"EDIT"} and isinstance(
            self._get_item(at - 1), Mention | Modifier
        ):
            self.verb_seen |= chunk.words[0].endswith(("s", "ed")) or chunk.words[0] in _VERBS
        elif chunk.has("HEAD", "TURN", "EXIT") and not chunk.words[0].endswith("ing"):
            self.verb_seen = True

    def _comes_across(self, at: int, chunk: Chunk) -> bool:
        """ "on the cross street", not "turns onto the side street"."""
        before = [self._get_item(at - 1), self._get_item(at - 2)]
        links = [item.text for item in before if isinstance(item, Chunk) and not item.has("DET")]
        return chunk.has("ACROSS") and (chunk.words[0] in {"from", "on"} or links[:1] in _ALONG)

    def _end_sentence(self) -> None:
        for relation in sorted(self.open, key=lambda each: each.nominal and not each.explicit):
            self._close(relation)
        if self.subject:
            self.previous_subject = self.subject
        self.hints += [] if self.shared and self.sentence else self.fronted
        self.open, self.sentence, self.fronted = [], [], []
        self.subject, self.awaiting, self.gap = [], None, None
        self.relative, self.verb_seen, self.boundary, self.linked = [], False, True, False
        self.signal, self.crossing, self.causer, self.caused = False, False, [], False
        self.shared = False

    def _read_comma(self, at: int) -> None:
        if self.relative and self.verb_seen and not self._is_then_after(at):
            self._leave_relative()
        self.boundary = True
        self.linked = True
        self._read_elaboration(at)
        if self.awaiting and self.awaiting.object is not None:
            self.awaiting.closed = True

    def _read_elaboration(self, at: int) -> None:
        """ "two vehicles: a bus and a taxi" names two agents, not four."""
        group, then = self._get_item(at - 1), self._get_item(at + 1)
        mark = self._get_item(at)
        if not (
            isinstance(group, Mention) and isinstance(then, Mention) and isinstance(mark, Chunk)
        ):
            return
        general = mark.mark in {":", "("} or group.head == "vehicles"
        if (
            group.counted
            and group.count > 1
            and general
            and self.last
            and (then.det == "indefinite" or then.label)
        ):
            for agent in self.last:
                agent.announced = True

    def _is_then_after(self, at: int) -> bool:
        after = self._get_item(at + 1)
        return isinstance(after, Chunk) and after.has("AND")

    def _connect(self, at: int, chunk: Chunk) -> None:
        self.boundary = True
        self.linked = chunk.has("AND")
        if chunk.text == "and then" and self._is_bare_sequel(at):
            return
        if self._is_holding_until(at, chunk):
            return
        if self.awaiting and (self._is_complete(self.awaiting) or chunk.text in {"then", "but"}):
            self.awaiting.closed = self.awaiting.object is not None or chunk.text != "and"
            if self.awaiting.object is None:
                self.awaiting = None

    def _is_bare_sequel(self, at: int) -> bool:
        """ "hits a man and then a bus": the verb holds for both."""
        after = self._get_item(at + 1)
        if isinstance(after, Chunk) and after.has("BY"):
            after = self._get_item(at + 2)
            return isinstance(after, Mention)
        return isinstance(after, Mention) and not self._has_verb_ahead(at + 1)

    def _is_holding_until(self, at: int, chunk: Chunk) -> bool:
        """ "does not turn until a bus has passed", "goes only after she has crossed"."""
        if not self.subject or self.awaiting is not None or not self._has_mention_ahead(at):
            return False
        before = self._get_item(at - 1)
        only = isinstance(before, Chunk) and "only" in before.words
        late = chunk.text in {"after", "once", "when", "as soon as"} and only
        until = chunk.text in {"until", "till", "before"} and self._is_verb_denied(at)
        if not (late or until):
            return False
        self._start(OpenRelation("yield_to", None, at, self.subject, tag="WAIT"))
        return True

    def _is_verb_denied(self, at: int) -> bool:
        """The verb of the subject is denied."""
        for back in range(1, 7):
            item = self._get_item(at - back)
            if isinstance(item, Chunk) and item.has("NEGATION"):
                return item.words[0] not in {"without", "no", "instead", "free"}
            if item is None or isinstance(item, Mention) or (isinstance(item, Chunk) and item.mark):
                return False
            if isinstance(item, Chunk) and item.has("COLLIDE", "NEAR", "YIELD", "WAIT", "LET"):
                return False
        return False

    def _is_relative_clause(self, at: int) -> bool:
        before, after = self._get_item(at - 1), self._get_item(at + 1)
        if isinstance(before, Chunk) and before.mark == ",":
            before = self._get_item(at - 2)
        attached = isinstance(before, Mention | Modifier) or (
            isinstance(before, Chunk)
            and before.has(
                "JAYWALK",
                "OPPOSITE",
                "SAME",
                "CROSS",
                "OF_OTHER",
                "ROAD",
                "PRONOUN",
                "STREET",
                "NUMBER",
            )
        )
        if not (attached and self.last):
            return False
        if isinstance(after, Mention) or (isinstance(after, Chunk) and after.has("PRONOUN")):
            self.gap = self.last
            self.relative.append((self.subject, self.verb_seen))
            self.boundary = True
            return True
        self.relative.append((self.subject, self.verb_seen))
        self.subject, self.verb_seen, self.awaiting = self.last, False, None
        return True
