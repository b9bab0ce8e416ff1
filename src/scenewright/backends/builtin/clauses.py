"""Sentences -> agents, relations and their attributes: subjects, objects, voice, negation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from scenewright.backends.builtin.attach import (
    IGNORED,
    PEDESTRIAN_ONLY,
    VEHICLE_ONLY,
    attach,
    cross,
    put,
)
from scenewright.backends.builtin.coreference import OPPOSITE, Discourse
from scenewright.backends.builtin.draft import AgentDraft, Draft, Refused, RelationDraft
from scenewright.backends.builtin.grammar import Modifier
from scenewright.backends.builtin.lexicon import Chunk
from scenewright.backends.builtin.mentions import Item, Mention

Group = list[AgentDraft]
_RELATION_TAGS = {
    "COLLIDE": "collide_at", "NEAR": "near_miss", "YIELD": "yield_to", "FOLLOW": "follow",
    "WAIT": "yield_to", "LET": "yield_to",
}  # fmt: skip
_SYMMETRIC = frozenset({"collide_at", "near_miss"})
_NOUNS = frozenset(
    [
        "collision",
        "crash",
        "accident",
        "wreck",
        "impact",
        "contact",
        "miss",
        "misses",
        "call",
        "shave",
        "escape",
        "encounter",
        "strike",
        "yield",
        "yielding",
        "ender",
        "bender",
        "crashes",
        "collisions",
        "accidents",
        "run",
        "pileup",
        "follow",
        "following",
    ]
)
_WAIT_FOR = frozenset(
    {"for", "until", "till", "while", "as", "so", "when", "before", "because", "once"}
)
_HALTS = frozenset({"wai", "sto", "bra", "slo", "pau", "hal", "dec"})
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
_PRIORITY = frozenset(["way", "priority", "precedence", "room", "space", "ahead"])


@dataclass(eq=False)
class _Open:
    """A relation whose arguments are still being read."""

    type: str
    kind: str | None
    at: int
    subject: Group | None
    object: Group | None = None
    passive: bool = False
    by: bool = False
    negated: bool = False
    nominal: bool = False
    weak: bool = False
    closed: bool = False
    reverse: bool = False
    between: bool = False
    avoided: bool = False
    tag: str = ""
    sentence: list[tuple[int, Group]] = field(default_factory=list)


class Reader:
    """Reads items from left to right into a Draft."""

    def __init__(self, draft: Draft, *, editing: bool = False) -> None:
        self.draft = draft
        self.discourse = Discourse(draft)
        self.editing = editing
        self.items: Sequence[Item] = ()
        self.subject: Group = []
        self.previous_subject: Group = []
        self.last: Group = []
        self.verb_seen = False
        self.boundary = True
        self.linked = False
        self.relative: list[tuple[Group, bool]] = []
        self.gap: Group | None = None
        self.fronted: list[Modifier | Chunk] = []
        self.awaiting: _Open | None = None
        self.sentence: list[tuple[int, Group]] = []
        self.open: list[_Open] = []
        self.deferred: list[_Open] = []
        self.failed: list[RelationDraft] = []
        self.counted: list[Group] = []
        self.signal = False
        self.crossing = False
        self.said: list[str] = []
        self.hints: list[Modifier | Chunk] = []
        self.modified: Group = []
        self.causer: Group = []
        self.caused = False

    # -- the walk ---------------------------------------------------------------------------

    def read(self, items: Sequence[Item]) -> None:
        """Read all items; relations that name nobody are settled at the end."""
        self.items = items
        for at, item in enumerate(items):
            if isinstance(item, Mention):
                self._mention(at, item)
            elif isinstance(item, Modifier):
                self._modifier(at, item)
            else:
                self._chunk(at, item)
        self._end_sentence()
        self._settle_deferred()
        self._spread_hints()

    def _chunk(self, at: int, chunk: Chunk) -> None:
        if chunk.has("CORRECTION"):
            self.editing = True
            self._comma(at)
        elif chunk.mark in {".", ";", "!", "?", "|"}:
            self._end_sentence()
        elif chunk.mark:
            self._comma(at)
        elif chunk.has("WHO") and self._relative_clause(at):
            return
        else:
            self._word(at, chunk)

    def _word(self, at: int, chunk: Chunk) -> None:
        if chunk.words[0] in _CAUSES and self.subject and isinstance(self._item(at + 1), Mention):
            self.causer, self.caused, self.awaiting = self.subject, True, None
            return
        tag = next((tag for tag in ("NEAR", "COLLIDE", "YIELD", "FOLLOW") if chunk.has(tag)), None)
        if tag == "FOLLOW" and chunk.text == "behind" and not self._mention_ahead(at):
            return
        if tag is not None and not chunk.has("SIGNAL"):
            self._relation(at, chunk, tag)
        elif chunk.has("LATE"):
            self.said.append("late_brake")
            self._wait_negated(at)
        elif chunk.has("PRONOUN"):
            self._pronoun(at, chunk)
        elif chunk.tags.get("ALMOST") == "avoid" and self._avoids(at):
            self._start(_Open("near_miss", None, at, self.subject or None, tag="NEAR"))
        elif chunk.has("LET") and self._lets(at, chunk):
            return
        elif chunk.has("WAIT"):
            self._wait(at, chunk)
        elif chunk.has("BY"):
            self._by()
        else:
            self._minor(at, chunk)

    def _minor(self, at: int, chunk: Chunk) -> None:
        if chunk.has("BOTH"):
            self._plural_subject()
        elif chunk.has("AND", "WHILE"):
            self._connect(chunk)
        elif chunk.has("BE"):
            self.verb_seen = True
        elif chunk.has("JAYWALK", "CROSS", "OPPOSITE", "OF_OTHER", "SAME", "REDRUN", "SIGNAL"):
            self._property(at, chunk)
        elif chunk.has("LEFT", "RIGHT", "THROUGH"):
            self._bare_turn(at, chunk)
        elif chunk.has("BACKGROUND") and self.counted and self.counted[-1] is self.last:
            self._to_background(self.last)
        elif not chunk.tags and isinstance(self._item(at - 1), Mention | Modifier):
            self.verb_seen |= chunk.words[0].endswith(("s", "ed")) or chunk.words[0] in _VERBS
        elif chunk.has("HEAD", "TURN", "EXIT") and not chunk.words[0].endswith("ing"):
            self.verb_seen = True

    # -- boundaries -------------------------------------------------------------------------

    def _end_sentence(self) -> None:
        for relation in self.open:
            self._close(relation)
        if self.subject:
            self.previous_subject = self.subject
        self.hints += self.fronted
        self.open, self.sentence, self.fronted = [], [], []
        self.subject, self.awaiting, self.gap = [], None, None
        self.relative, self.verb_seen, self.boundary, self.linked = [], False, True, False
        self.signal, self.crossing, self.causer, self.caused = False, False, [], False

    def _comma(self, at: int) -> None:
        if self.relative and self.verb_seen and not self._then_follows(at):
            self._leave_relative()
        self.boundary = True
        self.linked = True
        if self.awaiting and self.awaiting.object is not None:
            self.awaiting.closed = True

    def _then_follows(self, at: int) -> bool:
        after = self._item(at + 1)
        return isinstance(after, Chunk) and after.has("AND")

    def _connect(self, chunk: Chunk) -> None:
        self.boundary = True
        self.linked = chunk.has("AND")
        if self.awaiting and (self._complete(self.awaiting) or chunk.text in {"then", "but"}):
            self.awaiting.closed = self.awaiting.object is not None or chunk.text != "and"
            if self.awaiting.object is None:
                self.awaiting = None

    def _complete(self, relation: _Open) -> bool:
        pair = relation.subject is not None and len(relation.subject) > 1
        return relation.object is not None or (pair and relation.type in _SYMMETRIC)

    def _relative_clause(self, at: int) -> bool:
        before, after = self._item(at - 1), self._item(at + 1)
        if isinstance(before, Chunk) and before.mark == ",":
            before = self._item(at - 2)
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

    def _leave_relative(self) -> None:
        self.subject, self.verb_seen = self.relative.pop()
        self.gap = None

    # -- mentions ---------------------------------------------------------------------------

    def _mention(self, at: int, mention: Mention) -> None:
        if mention.det == "no":
            self._count_background(mention, 0)
            return
        if self._is_background(at, mention):
            self._count_background(mention, mention.count)
            return
        group = self._resolve(at, mention)
        if not group:
            return
        self._premodify(group, mention)
        self.last = group
        self.sentence.append((at, group))
        self._front(group)
        self._place(at, group[:1] if mention.of_group else group)
        if mention.counted and self._before_is(at, "WITH"):
            self.counted.append(group)
        self.boundary = self.linked = False

    def _resolve(self, at: int, mention: Mention) -> Group:
        avoid = self._actors()
        if isinstance(self._item(at - 1), Chunk) and self._apposition(at, mention):
            return self.last
        if self._ahead_of(at) and mention.type is None:
            led = next((r.to for r in reversed(self.draft.relations) if r.type == "follow"), None)
            if led is not None:
                return [led]
        if mention.type is not None and mention.det == "definite" and self._ahead_of(at):
            mention.det = "another"
        if mention.type is not None and mention.det == "definite" and self._behind(at):
            mention.det = "another"
        if mention.head in {"one", "car", "vehicle"} and self._of_group(at, mention):
            return []
        again = (
            mention.det == "bare"
            and not mention.counted
            and (
                (self._follows_comma(at) and self._verb_follows(at))
                or self._takes_object()
                or self._echoes(at, mention)
            )
        )
        same_clause = bool(self.sentence) and not again
        return self.discourse.resolve(mention, avoid=avoid, same_clause=same_clause)

    def _echoes(self, at: int, mention: Mention) -> bool:
        """ "..., truck at fault": a bare noun that names a known agent once more."""
        after = self._item(at + 1)
        told = any(r.object for r in self.open) and self._follows_comma(at)
        if told and not mention.premods and self._only_namesake(mention):
            return True
        plain = (
            isinstance(after, Chunk)
            and not after.mark
            and not after.has("AND", "TO", "BETWEEN", "WITH", "COLLIDE", "NEAR")
        )
        return (
            plain
            and not mention.premods
            and any(agent.head == mention.head for agent in self.draft.agents)
        )

    def _only_namesake(self, mention: Mention) -> bool:
        return sum(agent.head == mention.head for agent in self.draft.agents) == 1

    def _apposition(self, at: int, mention: Mention) -> bool:
        """ "Unit 1, a sedan heading east" is one agent."""
        comma, named = self._item(at - 1), self._item(at - 2)
        if not (
            isinstance(comma, Chunk) and comma.mark in {",", "("} and isinstance(named, Mention)
        ):
            return False
        after, verb = self._item(at + 1), self._item(at + 2)
        inserted = isinstance(after, Chunk) and after.mark == "," and _is_verb(verb)
        generic = inserted and named.head in {"vehicle", "motorist"}
        if not (named.label or generic) or mention.det != "indefinite" or mention.type is None:
            return False
        agent = self.last[0]
        agent.type, agent.subtype, agent.head = mention.type, mention.subtype, mention.head
        self._premodify([agent], mention)
        return True

    def _of_group(self, at: int, mention: Mention) -> bool:
        """ "one of two cars": the group comes next; the first of it is meant."""
        after, then = self._item(at + 1), self._item(at + 2)
        if mention.head != "one" or mention.det != "one":
            return False
        if not (isinstance(after, Chunk) and after.text == "of" and isinstance(then, Mention)):
            return False
        then.of_group = 1
        return then.type is not None

    def _premodify(self, group: Group, mention: Mention) -> None:
        for premod in mention.premods:
            if isinstance(premod, Modifier):
                for agent in group:
                    self._reopen(agent, premod)
                attach(premod, group, crossing=premod.means == "crosswalk")
            else:
                self._adjective(group, premod)

    def _adjective(self, group: Group, chunk: Chunk) -> None:
        for agent in group:
            if chunk.has("JAYWALK"):
                agent.movement = "jaywalking"
            elif chunk.has("CROSS", "XWALK"):
                cross(agent)
            elif chunk.has("OPPOSITE"):
                self._relate(agent, "opposite")
            elif chunk.has("THROUGH", "STRAIGHT") and agent.type == "vehicle":
                put(agent, "movement", "straight")
            elif chunk.has("UTURN") and agent.type == "vehicle":
                put(agent, "movement", "uturn")
            elif chunk.has("REDRUN"):
                agent.runs_red = True

    def _front(self, group: Group) -> None:
        kept: list[Modifier | Chunk] = []
        for waiting in self.fronted:
            fits = [agent for agent in group if _can_hold(agent, waiting)]
            if not fits:
                kept.append(waiting)
            elif isinstance(waiting, Modifier):
                attach(waiting, fits, crossing=self.crossing)
            else:
                self._mark(fits, waiting)
        self.fronted = kept

    def _place(self, at: int, group: Group) -> None:
        """Decide whether the mention is object, coordinated, or the subject of a new clause."""
        relation = self.awaiting
        if self.caused:
            self.subject, self.caused = group, False
            return
        if relation is not None and self._accepts(relation, at):
            self._give_object(relation, group)
            return
        if self.gap is not None and self.relative and self.boundary:
            self.subject, self.verb_seen = group, False
            return
        last = self.open[-1] if self.open else None
        coordinates = self.linked and self._joins(at)
        if coordinates and last is not None and self._joins_object(last, at):
            last.object = (last.object or []) + group
            return
        comma = isinstance(before := self._item(at - 1), Chunk) and before.mark == ","
        if (
            coordinates
            and self.subject
            and not self.verb_seen
            and not (comma and self._verb_follows(at))
        ):
            self.subject = self.subject + [a for a in group if a not in self.subject]
            return
        if not self.subject or (self.boundary and self._verb_follows(at)):
            self.subject, self.verb_seen = group, False

    def _accepts(self, relation: _Open, at: int) -> bool:
        if relation.closed:
            return False
        if relation.between:
            return len(relation.object or []) < 2
        if relation.object is not None:
            return False
        if relation.passive and not relation.by:
            return False
        if self.boundary and relation.tag != "WAIT" and self._complete(relation):
            return False
        return not (
            self.boundary
            and relation.tag not in {"WAIT", "LET"}
            and not relation.nominal
            and self._verb_follows(at)
        )

    def _give_object(self, relation: _Open, group: Group) -> None:
        if relation.between:
            relation.object = (relation.object or []) + group
            return
        if relation.nominal and relation.subject is None:
            relation.object = (relation.object or []) + group
            relation.between = True
            return
        relation.object = group

    def _joins(self, at: int) -> bool:
        before = self._item(at - 1)
        if not isinstance(before, Chunk):
            return False
        return before.mark == "," or (
            before.has("AND") and before.text in {"and", "plus", "n", "as well as", "or"}
        )

    def _joins_object(self, relation: _Open, at: int) -> bool:
        if relation.object is None or self._verb_follows(at) or relation.weak:
            return False
        before = self._item(at - 1)
        return isinstance(before, Chunk) and before.has("AND") and self.last is not None

    # -- pronouns ---------------------------------------------------------------------------

    def _pronoun(self, at: int, chunk: Chunk) -> None:
        value = chunk.tags["PRONOUN"]
        if value == "self":
            self._reflexive()
            return
        if value == "each":
            self._mutual()
            return
        group = self._antecedent(at, value, chunk.text)
        if not group:
            return
        before = self._item(at - 1)
        if (
            isinstance(before, Mention)
            and self.last
            and not self._takes_object()
            and not self.boundary
        ):
            self.gap = self.last
            self.relative.append((self.subject, self.verb_seen))
            self.subject, self.verb_seen = group, False
            return
        self.discourse.groups.append(group)
        self.last = group
        self.sentence.append((at, group))
        self._place_pronoun(at, group)
        self.boundary = self.linked = False

    def _place_pronoun(self, at: int, group: Group) -> None:
        relation = self.awaiting
        if relation is not None and self._accepts(relation, at):
            relation.object = group
        elif (
            (self.gap is not None and self.relative and self.boundary)
            or not self.subject
            or self.boundary
        ):
            self.subject, self.verb_seen = group, False

    def _antecedent(self, at: int, value: str, text: str) -> Group:
        avoid = self._actors()
        if value == "me":
            return self._speaker(at)
        if value == "it":
            return self._it(avoid)
        if value == "he":
            ped = self.discourse.recent("pedestrian", avoid=avoid)
            vehicle = self.discourse.recent("vehicle", avoid=avoid)
            found = ped or vehicle
            return [found] if found else []
        plural = next(
            (g for g in reversed(self.discourse.groups) if len(g) > 1 and g[0] not in avoid), None
        )
        if self._takes_object() or text == "them":
            ped = self.discourse.recent("pedestrian", avoid=avoid)
            if plural is not None and (ped is None or ped in plural):
                return plural
            return [ped] if ped else [a for a in self.draft.agents if a not in avoid][-1:]
        return plural or self.draft.agents[-2:]

    def _it(self, avoid: Group) -> Group:
        if not self._takes_object():
            for group in (self.subject, self.previous_subject):
                if len(group) == 1 and group[0].type == "vehicle" and group[0] not in avoid:
                    return group
        found = self.discourse.recent("vehicle", avoid=avoid)
        return [found] if found else []

    def _speaker(self, at: int) -> Group:
        known = [agent for agent in self.draft.agents if agent.label == "me"]
        after = [self._item(at + step) for step in (1, 2)]
        drives = any("driv" in _words(item) or "rid" in _words(item) for item in after if item)
        if not known and not (
            drives and self._item(at) is not None and "i" in _words(self.items[at]).split()
        ):
            return []
        if known:
            return known
        agent = self.discourse.create("vehicle", head="car")
        agent.label = "me"
        return [agent]

    def _reflexive(self) -> None:
        if self.awaiting is not None and self.awaiting.object is None and self.awaiting.subject:
            raise Refused("impossible", "An agent cannot do this to itself; name a second agent.")

    def _mutual(self) -> None:
        if self.awaiting is not None and self.awaiting.object is None:
            subject = self.awaiting.subject or []
            if len(subject) < 2:
                others = [a for _, g in self.sentence for a in g if a not in subject]
                self.awaiting.object = others[:1] or None
            self.awaiting.closed = True
            self.awaiting = None

    def _plural_subject(self) -> None:
        group = next(
            (g for g in reversed(self.discourse.groups) if len(g) > 1), self.draft.agents[-2:]
        )
        if len(group) > 1:
            relation = self.awaiting
            if (
                relation is not None
                and relation.object is None
                and relation.tag in {"WAIT", "YIELD", "LET"}
            ):
                relation.object = [a for a in group if a not in (relation.subject or [])]
            else:
                self.subject, self.verb_seen = list(group), False
            self.last = list(group)

    # -- modifiers --------------------------------------------------------------------------

    def _modifier(self, at: int, modifier: Modifier) -> None:
        if modifier.means in IGNORED:
            return
        if modifier.means.startswith("cross"):
            self.crossing = True
        if modifier.means == "side":
            self._sided(modifier)
            return
        finite = self._is_finite(modifier)
        if modifier.means in {"crosswalk", "on_crosswalk"} and self._kept_off(at):
            return
        targets = self._targets(at, modifier, finite=finite)
        if isinstance(self._item(at - 1), Modifier) and modifier.means in {
            "from",
            "to",
            "from_to",
            "leg",
        }:
            targets = [agent for agent in self.modified if _can_hold(agent, modifier)] or targets
        self.modified = targets
        if not targets:
            self._only_vehicles_turn(at, modifier)
            self.fronted.append(modifier)
            return
        if finite:
            self.verb_seen = True
        for agent in targets:
            self._reopen(agent, modifier)
        if modifier.means == "from_to" and self._along_with():
            targets = targets + [a for a in self.subject if a not in targets and a.entry is None]
        attach(modifier, targets, crossing=self.crossing)
        self._reconcile(targets)

    def _only_vehicles_turn(self, at: int, modifier: Modifier) -> None:
        turns = modifier.means in {"turn", "uturn"} and not modifier.first.startswith(
            ("left", "right", "a")
        )
        if (
            turns
            and isinstance(self._item(at - 1), Mention)
            and self.last
            and self.last[0].type == "pedestrian"
        ):
            raise Refused(
                "impossible",
                "Pedestrians cross or jaywalk here, only vehicles turn; give the turn to a vehicle.",
            )

    def _along_with(self) -> bool:
        """ "A follows B from south to north": both go that way."""
        relation = self.awaiting
        return relation is not None and relation.type == "follow" and relation.object is self.last

    def _sided(self, modifier: Modifier) -> None:
        for agent in self.last or self.subject:
            self._side(agent, "map_" + modifier.values[0])

    def _kept_off(self, at: int) -> bool:
        before = self._item(at - 1)
        return isinstance(before, Chunk) and before.has("NEARBY")

    def _is_finite(self, modifier: Modifier) -> bool:
        head = modifier.chunks[0]
        verb = head.has("TURN", "HEAD", "CROSS", "EXIT", "UTURN", "STRAIGHT") and not head.has(
            "LEFT", "RIGHT"
        )
        return (
            verb and not head.words[0].endswith("ing") and head.text not in {"across", "straight"}
        )

    def _targets(self, at: int, modifier: Modifier, *, finite: bool) -> Group:
        prefer = (
            self.subject
            if (finite and not self._made_way_for()) or self._after_while(at)
            else self.last
        )
        if modifier.means in {"turn", "straight", "uturn"} and self._nominal_turn(at):
            prefer = self.subject or self.last
        fits = [agent for agent in prefer if _can_hold(agent, modifier)]
        if fits:
            return fits
        for _, group in reversed(self.sentence):
            fits = [agent for agent in group if _can_hold(agent, modifier)]
            if fits:
                return fits
        if not self._mentions_follow(at, modifier):
            kinds = [a for a in self.draft.agents if _can_hold(a, modifier)]
            if len(kinds) == 1 and (
                modifier.means in VEHICLE_ONLY | PEDESTRIAN_ONLY or len(self.draft.agents) == 1
            ):
                return kinds
        return []

    def _made_way_for(self) -> bool:
        """ "lets B turn left": the verb belongs to B."""
        relation = self.awaiting
        return (
            relation is not None
            and relation.tag in {"LET", "WAIT"}
            and relation.object is self.last
            and not self.boundary
        )

    def _mentions_follow(self, at: int, modifier: Modifier) -> bool:
        for item in self.items[at + 1 :]:
            if isinstance(item, Chunk) and item.mark in {".", ";", "!", "?"}:
                return False
            if isinstance(item, Mention) and (
                item.type is None or _kind_can_hold(item.type, modifier)
            ):
                return True
        return False

    def _after_while(self, at: int) -> bool:
        for back in (1, 2):
            before = self._item(at - back)
            if isinstance(before, Chunk) and before.has("WHILE"):
                return True
            if not (isinstance(before, Chunk) and (before.has("BE") or not before.tags)):
                return False
        return False

    def _nominal_turn(self, at: int) -> bool:
        before = self._item(at - 1)
        return isinstance(before, Chunk) and before.has("WHILE", "BY")

    def _reopen(self, agent: AgentDraft, modifier: Modifier) -> None:
        if not self.editing:
            return
        touched = {
            "from": {"entry"}, "from_to": {"entry", "exit"}, "cross_from_to": {"entry", "exit"},
            "to": {"exit"}, "head_to": {"entry", "exit"}, "bound": {"entry"}, "cross_bound": {"entry"},
            "turn": {"movement"}, "uturn": {"movement"}, "straight": {"movement"},
            "crosswalk": {"crosswalk", "movement"}, "on_crosswalk": {"movement"}, "leg": {"entry", "crosswalk"},
        }.get(modifier.means, set())  # fmt: skip
        agent.edited |= touched

    def _reconcile(self, agents: Group) -> None:
        """A crosswalk named anew outlives the sides that do not go with it."""
        for agent in agents:
            along = (
                {"north", "south"} if agent.crosswalk in {"north", "south"} else {"east", "west"}
            )
            if self.editing and agent.crosswalk and agent.entry in along:
                agent.entry = agent.exit = None

    def _bare_turn(self, at: int, chunk: Chunk) -> None:
        before, after = self._item(at - 1), self._item(at + 1)
        closed = after is None or (isinstance(after, Chunk) and (after.mark or after.has("AND")))
        follows = isinstance(before, Chunk) and bool(before.mark)
        vehicles = [agent for agent in self.last if agent.type == "vehicle"]
        if chunk.has("THROUGH"):
            noun = isinstance(after, Chunk) and after.has("COLLIDE", "NEAR", "YIELD", "AND")
            bound = isinstance(before, Modifier) and before.means == "bound"
            vs = isinstance(before, Mention)
            if (closed or noun) and (bound or follows or vs):
                for agent in vehicles:
                    put(agent, "movement", "straight")
        elif closed and follows:
            for agent in vehicles:
                put(agent, "movement", "left" if chunk.has("LEFT") else "right")

    def _property(self, at: int, chunk: Chunk) -> None:
        if chunk.has("SIGNAL") and not chunk.has("REDRUN"):
            self.signal = True
            return
        if chunk.has("CROSS"):
            self.crossing = True
        finite = (
            chunk.has("CROSS", "REDRUN", "JAYWALK")
            and not chunk.words[0].endswith("ing")
            and chunk.words[0] not in {"across", "mid", "midblock", "outside"}
        )
        prefer = (
            self.subject
            if (finite and not self._made_way_for()) or self._after_while(at)
            else self.last
        )
        fits = [agent for agent in prefer if _can_hold(agent, chunk)]
        if not fits and finite and chunk.has("CROSS"):
            fits = [agent for agent in self.last if _can_hold(agent, chunk)]
        if not fits and not (finite and prefer and chunk.has("CROSS")):
            fits = next(
                (
                    [a for a in g if _can_hold(a, chunk)]
                    for _, g in reversed(self.sentence)
                    if any(_can_hold(a, chunk) for a in g)
                ),
                [],
            )
        if (
            not fits
            and chunk.has("JAYWALK", "CROSS")
            and (chunk.has("JAYWALK") or not finite)
            and not self._peds_follow(at)
        ):
            ped = self.discourse.recent("pedestrian")
            fits = [ped] if ped is not None and chunk.has("JAYWALK") else []
        if fits:
            self._mark(fits, chunk)
            if chunk.has("CROSS") and self._next_text(at) == "there":
                self._cross_there(fits)
        elif chunk.has("JAYWALK") and finite and self.subject and not self._peds_follow(at):
            raise Refused(
                "impossible", "Only pedestrians jaywalk; give the crossing to a pedestrian."
            )
        elif chunk.has("JAYWALK", "REDRUN", "OPPOSITE", "OF_OTHER") or (
            chunk.has("CROSS") and not self.sentence
        ):
            self.fronted.append(chunk)
        if finite:
            self.verb_seen = True

    def _cross_there(self, agents: Group) -> None:
        leg = next(
            (a.exit for a in reversed(self.draft.agents) if a.type == "vehicle" and a.exit), None
        )
        for agent in agents:
            agent.crosswalk = agent.crosswalk or leg

    def _peds_follow(self, at: int) -> bool:
        return any(isinstance(i, Mention) and i.type == "pedestrian" for i in self.items[at + 1 :])

    def _mark(self, agents: Group, chunk: Chunk) -> None:
        for agent in agents:
            if chunk.has("JAYWALK") and agent.type == "pedestrian":
                if self.editing:
                    agent.crosswalk = None
                agent.movement = "jaywalking"
            elif chunk.has("CROSS"):
                cross(agent)
            elif chunk.has("OPPOSITE"):
                if agent.type == "pedestrian" and chunk.tags["OPPOSITE"] == "mutual":
                    continue
                if self.editing and chunk.tags["OPPOSITE"] == "opposite" and agent.entry:
                    self._turn_round(agent)
                    continue
                self._relate(
                    agent, "opposite" if chunk.tags["OPPOSITE"] == "opposite" else "mutual"
                )
            elif chunk.has("OF_OTHER"):
                self._side(agent, chunk.tags["OF_OTHER"])
            elif chunk.has("SAME") and chunk.tags["SAME"] == "same":
                self._relate(agent, "same")
            elif chunk.has("REDRUN") and agent.type == "vehicle":
                agent.runs_red = True

    def _turn_round(self, agent: AgentDraft) -> None:
        agent.entry = OPPOSITE[agent.entry] if agent.entry else None
        agent.exit = OPPOSITE[agent.exit] if agent.exit else None

    def _side(self, agent: AgentDraft, side: str) -> None:
        others = [a for a in self.draft.agents if a is not agent and a.entry is not None]
        if side.startswith("map_") and not others:
            put(agent, "entry", {"map_left": "west", "map_right": "east"}[side])
            return
        self._relate(agent, "of_" + side.removeprefix("map_"))

    def _relate(self, agent: AgentDraft, word: str) -> None:
        other = next((a for a in self.subject if a is not agent and a.type == "vehicle"), None)
        if other is None:
            for _, group in reversed(self.sentence):
                other = next((a for a in group if a is not agent and a.type == "vehicle"), None)
                if other is not None:
                    break
        agent.relatives.append((word, other))

    # -- relations --------------------------------------------------------------------------

    def _relation(self, at: int, chunk: Chunk, tag: str) -> None:
        value = chunk.tags[tag]
        kind = value if tag == "COLLIDE" and value != "any" else None
        negated, almost = self._polarity(at)
        negated = negated and self._governs(at, chunk)
        type_ = _RELATION_TAGS[tag]
        if tag == "COLLIDE" and almost and not (negated and almost == "avoid"):
            type_, negated = "near_miss", False
            if almost == "avoid":
                almost = "avoided"
        elif tag == "COLLIDE" and negated and almost == "avoid":
            negated = False
        if tag == "FOLLOW" and value == "chain":
            self._chain()
            return
        relation = _Open(
            type_,
            kind,
            at,
            None,
            negated=negated,
            tag=tag,
            reverse=value == "reverse",
            avoided=almost == "avoided",
        )
        self._voice(relation, at, chunk)
        if relation.nominal:
            self._heading(at)
        if tag == "FOLLOW" and chunk.text == "behind":
            relation.subject = self._behind_subject(at)
        self._start(relation)

    def _heading(self, at: int) -> None:
        """ "Vehicle-pedestrian collision: a cab ..." announces agents that are named later."""
        before = self._item(at - 1)
        if not (isinstance(before, Mention) and before.det == "bare" and not before.counted):
            return
        self._announce(at - 1)
        for back in (2, 3):
            item = self._item(at - back)
            if isinstance(item, Mention) and item.det == "bare" and not item.counted:
                self._announce(at - back)
            elif not (
                isinstance(item, Chunk)
                and (item.has("TO") or item.text in {"on", "vs", "versus", "and"})
            ):
                return

    def _announce(self, at: int) -> None:
        for place, group in self.sentence:
            if place == at:
                for agent in group:
                    agent.announced = True

    def _start(self, relation: _Open) -> None:
        if (self.gap is not None and relation.subject and self.gap is not relation.subject) or (
            self.relative and self.gap is not None
        ):
            relation.object = self.gap
        relation.sentence = self.sentence
        self.open.append(relation)
        self.awaiting = relation
        self.verb_seen = True
        self.boundary = self.linked = False

    def _behind_subject(self, at: int) -> Group | None:
        return self.last if self.sentence else None

    def _voice(self, relation: _Open, at: int, chunk: Chunk) -> None:
        surface = chunk.words[0]
        be = self._be_before(at)
        by = self._by_ahead(at)
        participle = not surface.endswith(("ing", "s")) or surface in {"t", "rear"}
        relation.passive = participle and (be or by) and not (be and surface.endswith("ing"))
        reduced = relation.passive and not be
        if self._is_nominal(at, chunk) and not relation.passive:
            relation.nominal = True
            follows = self._item(at + 1)
            relation.between = (
                isinstance(follows, Chunk)
                and follows.has("BETWEEN")
                and follows.text not in {"for"}
            )
            relation.subject = (
                None if relation.between or not self._light_verb(at) else self.subject
            )
            return
        attributive = (
            surface.endswith("ing")
            and not be
            and not self._follows_comma(at)
            and not self._after_while(at)
            and not self._negated_near(at)
        )
        if (reduced or attributive) and self.last and self._touches_mention(at):
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
                and self._and_before(at)
            ):
                relation.subject = self.previous_subject

    def _and_before(self, at: int) -> bool:
        return any(
            isinstance(i, Chunk) and i.has("AND") for i in (self._item(at - 1), self._item(at - 2))
        )

    def _negated_near(self, at: int) -> bool:
        return self._polarity(at)[0]

    def _follows_comma(self, at: int) -> bool:
        for back in (1, 2, 3):
            before = self._item(at - back)
            if isinstance(before, Chunk) and (before.mark or before.has("AND", "WHILE", "BY")):
                return True
            if not isinstance(before, Chunk) or before.has("BE"):
                return False
        return False

    def _touches_mention(self, at: int) -> bool:
        for back in range(1, 6):
            before = self._item(at - back)
            if isinstance(before, Mention):
                return True
            if isinstance(before, Chunk) and (
                before.mark
                or before.has("AND", "COLLIDE", "YIELD", "WAIT", "FOLLOW", "NEAR", "BE", "WHO")
            ):
                return False
        return False

    def _is_nominal(self, at: int, chunk: Chunk) -> bool:
        before, after = self._item(at - 1), self._item(at + 1)
        if isinstance(after, Chunk) and after.text in {"between", "involving", "among"}:
            return True
        noun = chunk.words[-1] in _NOUNS
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
            before = self._item(at - back)
            determined = isinstance(before, Chunk) and before.has("DET")
            back += 1
        if determined and (noun or not chunk.has("COLLIDE")):
            return not (isinstance(after, Chunk) and after.text in {"into", "to"})
        finite_object = isinstance(after, Mention)
        return (
            noun
            and chunk.words[-1]
            in {
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
            }
            and not finite_object
            and not (isinstance(after, Chunk) and after.has("TO"))
        )

    def _light_verb(self, at: int) -> bool:
        """ "is involved in a collision with", "has a near miss with"."""
        after = self._item(at + 1)
        return bool(self.subject) and isinstance(after, Chunk) and after.has("WITH")

    def _polarity(self, at: int) -> tuple[bool, str]:
        negated, almost = False, ""
        for back in range(1, 7):
            item = self._item(at - back)
            if item is None:
                break
            if isinstance(item, Mention):
                if not self._without_before(at - back):
                    break
                return True, almost
            if isinstance(item, Modifier):
                continue
            if item.mark or item.has("WHO") or (item.has("AND") and item.text not in {"or"}):
                break
            if item.has("COLLIDE", "YIELD", "FOLLOW", "LATE") and not item.has("ALMOST"):
                break
            if (
                item.has("WAIT")
                and not item.has("ALMOST")
                and back > 1
                and not self._or_between(at - back, at)
            ):
                break
            if item.has("ALMOST"):
                almost = item.tags["ALMOST"]
            if item.has("NEGATION"):
                negated = True
                break
        return negated, almost

    def _governs(self, at: int, chunk: Chunk) -> bool:
        """ "without" and "no" deny a noun or an -ing form, not a finite verb further on."""
        if chunk.words[0].endswith("ing") or chunk.words[-1] in _NOUNS:
            return True
        for back in range(1, 7):
            item = self._item(at - back)
            if isinstance(item, Chunk) and item.has("NEGATION"):
                return item.words[0] not in {"without", "no", "free"}
            if isinstance(item, Modifier):
                return False
        return True

    def _or_between(self, start: int, end: int) -> bool:
        return any(isinstance(i, Chunk) and (i.text == "or") for i in self.items[start:end])

    def _without_before(self, at: int) -> bool:
        before = self._item(at - 1)
        return (
            isinstance(before, Chunk)
            and before.has("NEGATION")
            and before.words[0] in {"without", "instead"}
        )

    def _be_before(self, at: int) -> bool:
        for back in range(1, 5):
            item = self._item(at - back)
            if isinstance(item, Chunk) and item.has("BE"):
                return True
            if (
                not isinstance(item, Chunk)
                or item.mark
                or (item.tags and not item.has("ALMOST", "NEGATION", "AND", "IGNORE", "EDIT"))
            ):
                return False
        return False

    def _by_ahead(self, at: int) -> bool:
        for step in range(1, 7):
            item = self._item(at + step)
            if isinstance(item, Chunk) and item.has("BY"):
                return self._mention_ahead(at + step)
            if (
                item is None
                or isinstance(item, Mention)
                or (
                    isinstance(item, Chunk)
                    and (item.mark or item.has("AND", "TO", "WITH", "WHO", "PRONOUN"))
                )
            ):
                return False
        return False

    def _mention_ahead(self, at: int) -> bool:
        for step in range(1, 4):
            item = self._item(at + step)
            if isinstance(item, Mention):
                return item.det != "no"
            if isinstance(item, Chunk) and item.has("PRONOUN"):
                return True
            if item is None or (
                isinstance(item, Chunk)
                and (item.mark or item.has("AND", "COLLIDE", "YIELD", "NEAR", "FOLLOW", "BE"))
            ):
                return False
        return False

    def _avoids(self, at: int) -> bool:
        """ "barely avoids a jogger": an object, and no collision between."""
        after = self._item(at + 1)
        return self._mention_ahead(at) and (isinstance(after, Mention) or _is_pronoun(after))

    def _by(self) -> None:
        if self.awaiting is not None and self.awaiting.passive:
            self.awaiting.by = True
            self.boundary = False
        else:
            passive = next((r for r in reversed(self.open) if r.passive and r.object is None), None)
            if passive is not None:
                passive.by, self.awaiting = True, passive

    def _chain(self) -> None:
        group = next((g for g in (self.last, self.subject) if len(g) > 1), None)
        group = group or [a for _, g in self.sentence for a in g] or list(self.draft.agents)
        vehicles = [agent for agent in group if agent.type == "vehicle"]
        if len(vehicles) < 2:
            self.deferred.append(_Open("follow", None, 0, None, nominal=True))
            return
        for first, second in zip(vehicles, vehicles[1:], strict=False):
            self._add("follow", first, second)

    # -- waiting and letting ----------------------------------------------------------------

    def _wait(self, at: int, chunk: Chunk) -> None:
        before = self._item(at - 1)
        if isinstance(before, Chunk) and (before.has("DET") or before.has("FROM")):
            return
        if self._next_is(at, ("LET", "YIELD", "NEAR")) or self._stops_at_signal(at):
            self.verb_seen = True
            return
        negated, almost = self._polarity(at)
        if almost == "almost":
            return
        target = self._waits_for(at)
        relation = _Open(
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
            if self.gap is not None and self._next_text(at) == "for":
                relation.object, relation.weak = self.gap, False
            return
        self._start(relation)

    def _wait_subject(self, at: int, chunk: Chunk) -> Group | None:
        if (
            chunk.words[0].endswith("ing")
            and not self._be_before(at)
            and self._touches_mention(at)
            and not self._follows_comma(at)
        ):
            return self.last or None
        return self.subject or None

    def _wait_negated(self, at: int) -> None:
        self.verb_seen = True

    def _waits_for(self, at: int) -> int | None:
        """Index of the one waited for; None where the text names nobody."""
        marker = turning = False
        for step in range(1, 12):
            item = self._item(at + step)
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

    def _stops_at_signal(self, at: int) -> bool:
        for step in range(1, 5):
            item = self._item(at + step)
            if isinstance(item, Chunk) and item.has("SIGNAL"):
                self.signal = True
                return True
            if isinstance(item, Mention) or item is None or (isinstance(item, Chunk) and item.mark):
                return False
        return False

    def _lets(self, at: int, chunk: Chunk) -> bool:
        """ "lets B pass", "gives B the right of way", "is allowed to go first by"."""
        giving = chunk.words[0] in {
            "give",
            "gives",
            "gave",
            "given",
            "giving",
            "grant",
            "grants",
            "granted",
            "wave",
            "waves",
        }
        if (
            self._be_before(at)
            and chunk.words[0] in {"given", "granted", "let", "allowed", "permitted", "waved"}
            and self._goes_first(at, giving=giving)
        ):
            relation = _Open("yield_to", None, at, self.subject or None, passive=True, tag="LET")
            self._start(relation)
            return True
        fronting = chunk.words[0].endswith("ing")
        if not self.subject and not self.gap and not self._continues(at) and not fronting:
            return False
        target = next(
            (
                s
                for s in range(1, 4)
                if isinstance(self._item(at + s), Mention) or _is_pronoun(self._item(at + s))
            ),
            None,
        )
        if target is None or not self._goes_first(at + target, giving=giving):
            return False
        subject = self.subject or (None if fronting else self.previous_subject)
        negated, _ = self._polarity(at)
        self._start(_Open("yield_to", None, at, subject or None, negated=negated, tag="LET"))
        return True

    def _continues(self, at: int) -> bool:
        return bool(self.previous_subject) and self._and_before(at)

    def _goes_first(self, at: int, *, giving: bool) -> bool:
        for step in range(1, 10):
            item = self._item(at + step)
            if item is None or (isinstance(item, Chunk) and item.mark in {".", ";"}):
                return False
            words = set(_words(item).split())
            if giving:
                if words & _PRIORITY:
                    return True
            elif (
                isinstance(item, Chunk)
                and item.has("GO_FIRST", "CROSS", "TURN", "STRAIGHT", "HEAD")
            ) or (
                isinstance(item, Modifier)
                and not isinstance(item, Mention)
                and (words & {"cross", "crossing", "turn", "go", "pass", "through", "make", "walk"})
            ):
                return True
            if isinstance(item, Mention):
                return False
        return False

    # -- closing ----------------------------------------------------------------------------

    def _close(self, relation: _Open) -> None:
        subject, object_ = relation.subject, relation.object
        if relation.weak and object_ is None:
            self._close_weak(relation)
            return
        if relation.nominal or subject is None:
            pair = self._nominal_pair(relation)
            if pair is None:
                self._defer(relation)
            else:
                self._settle(relation, *self._by_right_of_way(relation, pair))
            return
        if (
            object_ is None
            and relation.type in _SYMMETRIC
            and len(subject) > 1
            and not relation.passive
        ):
            self._settle_group(relation, subject)
            return
        if object_ is None:
            object_ = self._missing_object(relation, subject)
        if object_ is None:
            self._defer(relation)
        else:
            self._settle(relation, subject, object_)

    def _by_right_of_way(self, relation: _Open, pair: tuple[Group, Group]) -> tuple[Group, Group]:
        """Where a noun names no direction, the vehicle yields, else the one named first."""
        first, second = pair
        after = self._item(relation.at + 1)
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

    def _close_weak(self, relation: _Open) -> None:
        halts = isinstance(chunk := self._item(relation.at), Chunk) and chunk.words[0][:3] in _HALTS
        if relation.subject and halts and not self.signal:
            relation.sentence = list(self.sentence)
            self.deferred.append(relation)

    def _defer(self, relation: _Open) -> None:
        if relation.negated:
            if relation.nominal or relation.type in _SYMMETRIC:
                self.draft.denied.add(relation.type)
            return
        self.deferred.append(relation)

    def _nominal_pair(self, relation: _Open) -> tuple[Group, Group] | None:
        object_ = relation.object or []
        if relation.subject and object_:
            return relation.subject, object_
        if len(object_) >= 2:
            return object_[:1], object_[1:2]
        agents = [(at, agent) for at, group in self.sentence for agent in group]
        before = _unique(agent for at, agent in agents if at < relation.at and agent not in object_)
        after = _unique(agent for at, agent in agents if at > relation.at and agent not in object_)
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

    def _missing_object(self, relation: _Open, subject: Group) -> Group | None:
        agents = [(at, a) for at, group in self.sentence for a in group if a not in subject]
        after = _unique(a for at, a in agents if at > relation.at)
        before = _unique(a for at, a in agents if at < relation.at)
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

    def _settle_group(self, relation: _Open, group: Group) -> None:
        for first, second in zip(group, group[1:], strict=False):
            self._settle(relation, [first], [second])

    def _settle(self, relation: _Open, subject: Group, object_: Group) -> None:
        swap = relation.passive != relation.reverse
        actors, targets = (object_, subject) if swap else (subject, object_)
        for actor in actors:
            for target in targets:
                if actor is target:
                    continue
                edge = RelationDraft(relation.type, actor, target, relation.kind)
                if relation.negated:
                    self.failed.append(edge)
                elif relation.avoided and any(
                    r.pair() == edge.pair() for r in self.draft.relations
                ):
                    continue
                else:
                    self._edge(edge)

    def _add(self, type_: str, first: AgentDraft, second: AgentDraft | None) -> None:
        if second is not None and first is not second:
            self._edge(RelationDraft(type_, first, second))

    def _edge(self, edge: RelationDraft) -> None:
        for known in self.draft.relations:
            if known.type == edge.type and known.pair() == edge.pair():
                if edge.type in {"yield_to", "follow"} and known.from_ is not edge.from_:
                    raise Refused(
                        "contradictory",
                        "Two agents cannot each give way to, or follow, the other; say who does.",
                    )
                known.kind = known.kind or edge.kind
                return
        self.draft.relations.append(edge)

    def _settle_deferred(self) -> None:
        strong = [r for r in self.deferred if not r.weak]
        for relation in strong:
            known = [r for r in self.draft.relations if r.type == relation.type]
            if known:
                known[0].kind = known[0].kind or relation.kind
                continue
            self._about_traffic(relation)
            self._settle(relation, *self._whole_text_pair(relation))
        if self.draft.relations or self.draft.normal:
            return
        for relation in self.deferred:
            others = [a for a in self.draft.agents if a not in (relation.subject or [])]
            if relation.weak and relation.subject and len(others) == 1:
                self._settle(relation, relation.subject, others)
                return

    def _about_traffic(self, relation: _Open) -> None:
        """ "two galaxies collide": the verb's subject is nobody we know."""
        chunk = self._item(relation.at)
        verb = (
            isinstance(chunk, Chunk)
            and chunk.words[-1] not in _NOUNS
            and not chunk.has("YIELD", "FOLLOW")
        )
        if not self.draft.agents and relation.kind is None and verb:
            raise Refused(
                "out_of_scope", "The text names no vehicle and no pedestrian; say who takes part."
            )

    def _whole_text_pair(self, relation: _Open) -> tuple[Group, Group]:
        agents = list(self.draft.agents)
        subject = (relation.subject or relation.object or [])[:1]
        others = [a for a in agents if a not in subject]
        if subject:
            first, second = (
                subject[0],
                (others[0] if others else self._partner(relation, subject[0])),
            )
        elif len(agents) >= 2:
            first, second = agents[0], agents[1]
        elif agents:
            first, second = agents[0], self._partner(relation, agents[0])
        else:
            first = self.discourse.create("vehicle")
            second = self._partner(relation, first)
        if (
            relation.type == "yield_to"
            and not subject
            and first.type != second.type
            and first.type == "pedestrian"
        ):
            first, second = second, first
        return [first], [second]

    def _partner(self, relation: _Open, agent: AgentDraft) -> AgentDraft:
        pedestrian = agent.type == "vehicle" and (
            (relation.type == "yield_to" and not relation.passive)
            or any(_needs_pedestrian(h) for h in self.fronted + self.hints)
        )
        partner = self.discourse.create("pedestrian" if pedestrian else "vehicle")
        return partner

    def _spread_hints(self) -> None:
        """Directions said of nobody in particular hold for everyone who can have them."""
        for hint in self.hints:
            fits = [a for a in self.draft.agents if _can_hold(a, hint)]
            if isinstance(hint, Modifier):
                open_ = [
                    a for a in fits if hint.means not in {"bound", "from", "leg"} or a.entry is None
                ]
                vehicles = [a for a in open_ if a.type == "vehicle"]
                single = hint.means in VEHICLE_ONLY
                attach(
                    hint,
                    (vehicles[:1] if single else vehicles) or open_[:1],
                    crossing=self.crossing,
                )
            else:
                self._mark(fits[:1], hint)

    # -- background -------------------------------------------------------------------------

    def _is_background(self, at: int, mention: Mention) -> bool:
        if mention.type is None or mention.of_group or mention.mass:
            return False
        marked = any(isinstance(p, Chunk) and p.has("BACKGROUND") for p in mention.premods)
        if marked and (mention.counted or mention.plural):
            return mention.counted
        if not mention.counted:
            return False
        if mention.count > 6 or self._background_follows(at):
            return True
        others = mention.det in {"other"} or (mention.first_word and self._says_other(mention))
        return bool(others) and not self._takes_object()

    def _says_other(self, mention: Mention) -> bool:
        return mention.det == "other"

    def _background_follows(self, at: int) -> bool:
        for step in range(1, 6):
            item = self._item(at + step)
            if isinstance(item, Chunk) and item.has("BACKGROUND"):
                return True
            if isinstance(item, Mention):
                if not item.counted:
                    return False
                continue
            if (
                item is None
                or isinstance(item, Modifier)
                or (item.tags and not item.has("AND", "WITH", "LEG") and not item.text == "in")
            ):
                return False
        return False

    def _count_background(self, mention: Mention, count: int) -> None:
        if mention.type is None:
            return
        context = self.draft.context
        if count > 20:
            raise Refused(
                "impossible", f"{count} background agents are too many; ask for at most 20."
            )
        if mention.type == "vehicle":
            context.vehicles = count
        else:
            context.pedestrians = count
        self.last = self.last or []

    def _to_background(self, group: Group) -> None:
        for agent in group:
            if agent in self.draft.agents:
                self.draft.agents.remove(agent)
        self.discourse.groups = [g for g in self.discourse.groups if g is not group]
        self.sentence = [(at, g) for at, g in self.sentence if g is not group]
        kind = group[0].type
        if kind == "vehicle":
            self.draft.context.vehicles = len(group)
        else:
            self.draft.context.pedestrians = len(group)
        self.counted.remove(group)
        self.last = self.sentence[-1][1] if self.sentence else []
        if self.subject is group:
            self.subject = []

    # -- looking around ---------------------------------------------------------------------

    def _item(self, at: int) -> Item | None:
        return self.items[at] if 0 <= at < len(self.items) else None

    def _before_is(self, at: int, tag: str) -> bool:
        before = self._item(at - 1)
        return isinstance(before, Chunk) and (before.has(tag) or before.text in {"and", ","})

    def _next_is(self, at: int, tags: tuple[str, ...]) -> bool:
        """One of the tags follows with at most `and`, `to` or a plain word between."""
        for step in range(1, 4):
            item = self._item(at + step)
            if not isinstance(item, Chunk) or item.mark:
                return False
            if item.has(*tags) and not item.has("AND"):
                return True
            if item.tags and not item.has("AND", "TO", "NEGATION", "IGNORE", "WAIT"):
                return False
        return False

    def _next_text(self, at: int) -> str:
        item = self._item(at + 1)
        return item.text if isinstance(item, Chunk) else ""

    def _takes_object(self) -> bool:
        relation = self.awaiting
        return (
            relation is not None
            and not relation.closed
            and (relation.object is None)
            and (not relation.passive or relation.by)
        )

    def _actors(self) -> Group:
        """Whoever acts in the relation that still wants its object."""
        if self.awaiting is None or not self._takes_object():
            return []
        return self.awaiting.subject or []

    def _ahead_of(self, at: int) -> bool:
        after = self._item(at + 1)
        return isinstance(after, Chunk) and after.tags.get("SAME") == "ahead"

    def _behind(self, at: int) -> bool:
        after = self._item(at + 1)
        return (
            isinstance(after, Chunk)
            and (after.text == "behind" or after.tags.get("SAME") == "behind")
            and not self._mention_ahead(at + 1)
        )

    def _verb_follows(self, at: int) -> bool:
        """A finite verb follows before the next mention or mark."""
        for step in range(1, 8):
            item = self._item(at + step)
            if item is None or isinstance(item, Mention):
                return False
            if isinstance(item, Modifier):
                if self._is_finite(item):
                    return True
                continue
            if item.has("WHO"):
                return True
            if item.mark or item.has("AND", "WHILE"):
                return False
            if (
                item.has(
                    "BE",
                    "COLLIDE",
                    "YIELD",
                    "NEAR",
                    "FOLLOW",
                    "WAIT",
                    "LET",
                    "HEAD",
                    "CROSS",
                    "TURN",
                    "EXIT",
                    "REDRUN",
                    "ALMOST",
                    "NEGATION",
                    "JAYWALK",
                    "LATE",
                )
                and not item.words[0].endswith("ing")
                and item.text not in {"behind", "across", "in front", "close to"}
            ):
                return True
        return False


def _can_hold(agent: AgentDraft, what: Modifier | Chunk) -> bool:
    return _kind_can_hold(agent.type, what)


def _kind_can_hold(kind: str, what: Modifier | Chunk) -> bool:
    if isinstance(what, Modifier):
        if what.means in VEHICLE_ONLY:
            return kind == "vehicle"
        return kind == "pedestrian" or what.means not in PEDESTRIAN_ONLY
    if what.has("CROSS", "JAYWALK", "XWALK"):
        return kind == "pedestrian"
    return kind == "vehicle" or not what.has("REDRUN")


def _needs_pedestrian(hint: Modifier | Chunk) -> bool:
    if isinstance(hint, Modifier):
        return hint.means in PEDESTRIAN_ONLY or hint.means.startswith("cross")
    return hint.has("JAYWALK", "CROSS")


def _is_verb(item: Item | None) -> bool:
    return isinstance(item, Modifier) or (isinstance(item, Chunk) and item.has("BE", "WAIT"))


def _unique(agents: object) -> Group:
    return list(dict.fromkeys(agents))  # type: ignore[call-overload]


def _words(item: Item | None) -> str:
    if isinstance(item, Mention):
        return item.head
    return item.text if item is not None else ""


def _is_pronoun(item: Item | None) -> bool:
    return (
        isinstance(item, Chunk)
        and item.has("PRONOUN")
        and item.tags["PRONOUN"] not in {"self", "each"}
    )
