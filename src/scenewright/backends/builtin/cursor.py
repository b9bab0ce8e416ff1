"""The reader's place in the text: what it holds, and what it sees around it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from scenewright.backends.builtin.attach import PEDESTRIAN_ONLY, VEHICLE_ONLY
from scenewright.backends.builtin.coreference import Discourse
from scenewright.backends.builtin.draft import AgentDraft, Draft, RelationDraft
from scenewright.backends.builtin.grammar import Modifier
from scenewright.backends.builtin.lexicon import Chunk
from scenewright.backends.builtin.mentions import Item, Mention

Group = list[AgentDraft]

SYMMETRIC = frozenset({"collide_at", "near_miss"})

NOUNS = frozenset(
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
        "calls",
        "shave",
        "shaves",
        "escape",
        "encounter",
        "strike",
        "yield",
        "yielding",
        "ender",
        "bender",
        "blow",
        "crashes",
        "collisions",
        "accidents",
        "run",
        "pileup",
        "follow",
        "following",
    ]
)


PARTS = frozenset(
    [
        "front",
        "back",
        "rear",
        "side",
        "corner",
        "flank",
        "door",
        "doors",
        "bumper",
        "tail",
        "nose",
        "trunk",
        "boot",
        "wheel",
        "mirror",
        "wing",
        "fender",
        "bonnet",
        "hood",
        "grille",
        "plates",
        "quarter",
        "leg",
        "legs",
        "knee",
        "knees",
        "foot",
        "feet",
        "heel",
        "heels",
        "shin",
        "shins",
        "skirt",
        "skirts",
        "coat",
        "toes",
        "shoulder",
        "hip",
        "arm",
        "end",
        "taillights",
        "lights",
        "panel",
    ]
)
"""Nouns for parts of a road user, which mean the whole."""

_NO_VERBS = frozenset({"across", "straight", "thru"})


@dataclass(eq=False)
class OpenRelation:
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
    explicit: bool = False
    avoided: bool = False
    tag: str = ""
    pattern: str | None = None
    causer: Group = field(default_factory=list)
    sentence: list[tuple[int, Group]] = field(default_factory=list)


class Cursor:
    """State of the reader and looks at neighbouring items."""

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
        self.awaiting: OpenRelation | None = None
        self.sentence: list[tuple[int, Group]] = []
        self.named: dict[int, Group] = {}
        self.open: list[OpenRelation] = []
        self.deferred: list[OpenRelation] = []
        self.failed: list[RelationDraft] = []
        self.counted: list[Group] = []
        self.signal = False
        self.crossing = False
        self.said: list[str] = []
        self.hints: list[Modifier | Chunk] = []
        self.modified: Group = []
        self.causer: Group = []
        self.leading: Group = []
        self.trailing: list[AgentDraft] = []
        self.caused = False
        self.shared = False

    def _get_item(self, at: int) -> Item | None:
        return self.items[at] if 0 <= at < len(self.items) else None

    def _is_before(self, at: int, tag: str) -> bool:
        before = self._get_item(at - 1)
        return isinstance(before, Chunk) and (before.has(tag) or before.text in {"and", ","})

    def _is_next(self, at: int, tags: tuple[str, ...]) -> bool:
        """One of the tags follows with at most `and`, `to` or a plain word between."""
        for step in range(1, 4):
            item = self._get_item(at + step)
            if not isinstance(item, Chunk) or item.mark:
                return False
            if item.has(*tags) and not item.has("AND"):
                return True
            if item.tags and not item.has("AND", "TO", "NEGATION", "IGNORE", "WAIT"):
                return False
        return False

    def _get_next_text(self, at: int) -> str:
        item = self._get_item(at + 1)
        return item.text if isinstance(item, Chunk) else ""

    def _takes_object(self) -> bool:
        relation = self.awaiting
        return (
            relation is not None
            and not relation.closed
            and (relation.object is None)
            and (not relation.passive or relation.by)
        )

    def _find_actors(self) -> Group:
        """The actors of the relation that still lacks its object."""
        if self.awaiting is None or not self._takes_object() or self._is_said_of_both():
            return []
        return self.awaiting.subject or []

    def _is_said_of_both(self) -> bool:
        """ "an SUV and a taxi collide, the SUV turning left": no third agent."""
        relation = self.awaiting
        return relation is not None and self.boundary and self._is_complete(relation)

    def _is_ahead_of(self, at: int) -> bool:
        after = self._get_item(at + 1)
        return isinstance(after, Chunk) and after.tags.get("SAME") == "ahead"

    def _is_behind(self, at: int) -> bool:
        after = self._get_item(at + 1)
        return (
            isinstance(after, Chunk)
            and (after.text == "behind" or after.tags.get("SAME") == "behind")
            and not self._has_mention_ahead(at + 1)
        )

    def _has_verb_ahead(self, at: int) -> bool:
        """A finite verb follows before the next mention or mark."""
        at = self._skip_insertion(at)
        for step in range(1, 8):
            item = self._get_item(at + step)
            if item is None or isinstance(item, Mention):
                return False
            if isinstance(item, Modifier):
                if self._is_finite(item):
                    return True
                continue
            if item.has("WHO") or _is_plain_verb(item):
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
                    "DITTO",
                    "GO_FIRST",
                )
                and (item.text.endswith(" first") or not item.has("GO_FIRST"))
                and not item.words[0].endswith("ing")
                and item.text not in {"behind", "across", "in front", "close to"}
            ):
                return True
        return False

    def _skip_insertion(self, at: int) -> int:
        """Where "a car, on the other approach, ..." and "a car behind the bus ..." go on."""
        comma, named = self._get_item(at + 1), self._get_item(at + 2)
        if isinstance(comma, Chunk) and comma.text == "behind" and isinstance(named, Mention):
            return at + 2
        if isinstance(comma, Chunk) and comma.mark == "(":
            return self._skip_brackets(at)
        if not (isinstance(comma, Chunk) and comma.mark == ","):
            return at
        for step in range(2, 6):
            item = self._get_item(at + step)
            if not isinstance(item, Chunk | Modifier):
                return at
            if isinstance(item, Chunk) and item.mark == ",":
                return at + step if step > 2 else at
            if isinstance(item, Chunk) and not item.has("ACROSS", "OPPOSITE", "SAME", "OF_OTHER"):
                return at
        return at

    def _skip_brackets(self, at: int) -> int:
        """Where "a van (from the south, right) ..." goes on."""
        for step in range(2, 10):
            item = self._get_item(at + step)
            if isinstance(item, Chunk) and item.mark == ")":
                return at + step
            if item is None or isinstance(item, Mention):
                return at
        return at

    def _is_finite(self, modifier: Modifier) -> bool:
        head = modifier.chunks[0]
        verb = head.has("TURN", "HEAD", "CROSS", "EXIT", "UTURN", "STRAIGHT") and not head.has(
            "LEFT", "RIGHT"
        )
        return verb and not head.words[0].endswith("ing") and head.words[0] not in _NO_VERBS

    def _has_mention_ahead(self, at: int) -> bool:
        for step in range(1, 4):
            item = self._get_item(at + step)
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

    def _is_after_comma(self, at: int) -> bool:
        for back in (1, 2, 3):
            before = self._get_item(at - back)
            if isinstance(before, Chunk) and (before.mark or before.has("AND", "WHILE", "BY")):
                return True
            if not isinstance(before, Chunk) or before.has("BE"):
                return False
        return False

    def _is_after_while(self, at: int) -> bool:
        for back in (1, 2):
            before = self._get_item(at - back)
            if isinstance(before, Chunk) and before.has("WHILE"):
                return True
            if not (isinstance(before, Chunk) and (before.has("BE") or not before.tags)):
                return False
        return False

    def _is_touching_mention(self, at: int) -> bool:
        for back in range(1, 6):
            before = self._get_item(at - back)
            if isinstance(before, Mention):
                return True
            if isinstance(before, Chunk) and (
                before.mark
                or before.has("AND", "COLLIDE", "YIELD", "WAIT", "FOLLOW", "NEAR", "BE", "WHO")
            ):
                return False
        return False

    def _has_be_before(self, at: int) -> bool:
        for back in range(1, 5):
            item = self._get_item(at - back)
            if isinstance(item, Chunk) and item.has("BE"):
                return True
            if (
                not isinstance(item, Chunk)
                or item.mark
                or (item.tags and not item.has("ALMOST", "NEGATION", "AND", "IGNORE", "EDIT"))
            ):
                return False
        return False

    def _has_by_ahead(self, at: int) -> bool:
        for step in range(1, 7):
            item = self._get_item(at + step)
            if isinstance(item, Chunk) and item.has("BY"):
                return self._has_mention_ahead(at + step)
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

    def _has_and_before(self, at: int) -> bool:
        return any(
            isinstance(i, Chunk) and i.has("AND")
            for i in (self._get_item(at - 1), self._get_item(at - 2))
        )

    def _find_polarity(self, at: int) -> tuple[bool, str]:
        negated, almost = False, ""
        for back in range(1, 7):
            item = self._get_item(at - back)
            if item is None:
                break
            if isinstance(item, Mention):
                if item.det != "neither" and not self._has_without_before(at - back):
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
                and not self._has_or_between(at - back, at)
            ):
                break
            if item.has("ALMOST"):
                almost = item.tags["ALMOST"]
            if item.has("NEGATION"):
                negated = True
                break
        return negated, almost

    def _is_governing(self, at: int, chunk: Chunk) -> bool:
        """ "without" and "no" deny a noun or an -ing form, not a finite verb further on."""
        if chunk.words[0].endswith("ing") or chunk.words[-1] in NOUNS:
            return True
        for back in range(1, 7):
            item = self._get_item(at - back)
            if isinstance(item, Chunk) and item.has("NEGATION"):
                return item.text == "no one" or item.words[0] not in {"without", "no", "free"}
            if isinstance(item, Modifier):
                return False
        return True

    def _has_or_between(self, start: int, end: int) -> bool:
        return any(isinstance(i, Chunk) and (i.text == "or") for i in self.items[start:end])

    def _has_without_before(self, at: int) -> bool:
        before = self._get_item(at - 1)
        return (
            isinstance(before, Chunk)
            and before.has("NEGATION")
            and before.words[0] in {"without", "instead"}
        )

    def _is_negated_near(self, at: int) -> bool:
        return self._find_polarity(at)[0]

    def _is_complete(self, relation: OpenRelation) -> bool:
        pair = relation.subject is not None and len(relation.subject) > 1
        return relation.object is not None or (pair and relation.type in SYMMETRIC)

    def _leave_relative(self) -> None:
        self.subject, self.verb_seen = self.relative.pop()
        self.gap = None


def _is_plain_verb(chunk: Chunk) -> bool:
    word = chunk.words[0]
    return not chunk.tags and len(word) > 3 and (word.endswith("s") or word in {"comes", "has"})


def can_hold(agent: AgentDraft, what: Modifier | Chunk) -> bool:
    """True if what is said can be true of the agent's class."""
    return can_kind_hold(agent.type, what)


def can_kind_hold(kind: str, what: Modifier | Chunk) -> bool:
    """True if what is said can be true of the class."""
    if isinstance(what, Modifier):
        if what.means in VEHICLE_ONLY:
            return kind == "vehicle"
        return kind == "pedestrian" or what.means not in PEDESTRIAN_ONLY
    if what.has("CROSS", "JAYWALK", "XWALK", "EXITWALK"):
        return kind == "pedestrian"
    return kind == "vehicle" or not what.has("REDRUN")


def get_words(item: Item | None) -> str:
    """The words of an item, the noun of a mention, nothing for None."""
    if isinstance(item, Mention):
        return item.head
    return item.text if item is not None else ""


def is_pronoun(item: Item | None) -> bool:
    """True for a pronoun that can mean an agent."""
    return (
        isinstance(item, Chunk)
        and item.has("PRONOUN")
        and item.tags["PRONOUN"] not in {"self", "each"}
    )
