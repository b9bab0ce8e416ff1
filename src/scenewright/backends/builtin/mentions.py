"""Noun phrases: tagged nodes -> mentions of agents with determiner, count and premodifiers."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field

from scenewright.backends.builtin.grammar import Modifier, Node
from scenewright.backends.builtin.lexicon import Chunk
from scenewright.scene.base import AgentClass

_PREMODIFIER_RULES = frozenset(
    {"bound", "from_to", "uturn", "straight", "from", "leg", "crosswalk"}
)
_ADJECTIVE_TAGS = [
    "YIELD", "OPPOSITE", "JAYWALK", "TURN", "WAIT", "CROSS", "FOLLOW", "BACKGROUND", "ACROSS",
    "THROUGH", "STRAIGHT", "REDRUN", "HEAD", "UTURN", "LEVEL", "DENSITY", "XWALK", "SAME", "EXIT",
    "NEAR", "FROM",
]  # fmt: skip
_PARTICIPLES = frozenset(
    {"lead", "following", "leading", "trailing", "stopped", "waiting", "turning", "yielding"}
)
_DRIVERS = frozenset({"driver", "drivers", "motorist", "rider", "operator"})
_RIDERS = frozenset({"biker", "motorcyclist"})
_LABELLED = re.compile(r"\b(?:car|vehicle|truck|bus|cab|taxi|driver|unit|agent|pedestrian)\s+b\b")


@dataclass(slots=True)
class Mention:
    """A noun phrase that means agents.

    Attributes:
        type: None for "one", "the other", "the first".
        count: as said; 1 for a singular.
        det: indefinite, definite, another, other, first, second, third, no, both, bare.
        premods: modifiers and adjectives before the noun.
        words: plain words before the noun, such as colours.
    """

    type: AgentClass | None
    subtype: str | None
    det: str
    count: int
    head: str
    premods: list[Node] = field(default_factory=list)
    label: str | None = None
    counted: bool = False
    plural: bool = False
    possessive: bool = False
    words: tuple[str, ...] = ()


Item = Chunk | Modifier | Mention


def build_noun_phrases(nodes: Sequence[Node], *, text: str) -> list[Item]:
    """Replace every stretch of nodes that names agents by one Mention."""
    parser = _NounPhrases(nodes, lettered=bool(_LABELLED.search(text)))
    result: list[Item] = []
    at = 0
    while at < len(nodes):
        found = parser.parse(at)
        if found is None:
            result.append(nodes[at])
            at += 1
        else:
            mention, at = found
            result.append(mention)
    return _merge_drivers(result)


class _NounPhrases:
    def __init__(self, nodes: Sequence[Node], *, lettered: bool) -> None:
        self.nodes = nodes
        self.lettered = lettered

    def parse(self, start: int) -> tuple[Mention, int] | None:
        mention = Mention(None, None, "bare", 1, "")
        at = start
        while at < len(self.nodes):
            node = self.nodes[at]
            if isinstance(node, Chunk) and node.has("AGENT") and not self._is_verbal(node, at):
                return self._read_head(mention, node, at)
            if not self._read_premodifier(mention, node, start, at):
                break
            at += 1
        return self._read_described(mention, at) or self._read_pronominal(start)

    def _read_described(self, mention: Mention, at: int) -> tuple[Mention, int] | None:
        """ "the northbound one": no noun, but a direction."""
        before = self.nodes[at - 1] if at else None
        one = isinstance(before, Chunk) and before.text in {"one", "ones"}
        if not (
            one
            and (mention.premods or mention.words)
            and mention.det in {"definite", "indefinite", "other", "another"}
        ):
            return None
        mention.head, mention.count, mention.counted = "one", 1, False
        return mention, at

    def _is_verbal(self, node: Chunk, at: int) -> bool:
        """ "unit" needs a label; "pedestrian density" is no pedestrian."""
        value = node.tags["AGENT"]
        if value == "unit":
            return self._label(at + 1) is None
        after = self.nodes[at + 1] if at + 1 < len(self.nodes) else None
        return isinstance(after, Chunk) and (
            after.has("TRAFFIC_NOUN") or after.tags.get("AGENT") == "traffic"
        )

    def _read_premodifier(self, mention: Mention, node: Node, start: int, at: int) -> bool:
        if isinstance(node, Modifier):
            return self._read_modifier(mention, node, start, at)
        opened = mention.det != "bare" or mention.counted or bool(mention.premods)
        if node.has("DET", "BOTH"):
            return self._read_determiner(mention, node, at == start)
        if node.has("NUMBER") and not mention.counted:
            mention.count, mention.counted = int(node.tags["NUMBER"]), True
            return True
        if node.has("COMMA"):
            return (
                node.mark == "," and bool(mention.premods) and self._has_more_premodifiers(at + 1)
            )
        if node.has(*_ADJECTIVE_TAGS):
            if not self._is_adjectival(node, at, opened):
                return False
            mention.premods.append(node)
            return True
        if not opened or not _is_plain_adjective(node):
            return False
        if node.text in {"in", "of", "on"} or self._count_plain_run(at) > 3:
            return False
        mention.words += node.words
        return True

    def _read_modifier(self, mention: Mention, node: Modifier, start: int, at: int) -> bool:
        turning = node.means == "turn" and node.first in {"left", "right", "a", "the", "an"}
        fine = node.means in _PREMODIFIER_RULES or turning
        opener = node.first in {"a", "an", "the", "another"}
        if node.means == "straight" and node.first not in {"straight", "through", "thru"}:
            return False
        if node.means == "from_to" and (opener or node.chunks[0].has("HEAD", "FROM")):
            return False
        if not fine or node.first in {"from", "off", "entering", "to"}:
            return False
        if node.means in {"leg", "crosswalk", "from"} and not (opener or mention.det != "bare"):
            return False
        if opener and at == start:
            mention.det = "definite" if node.first == "the" else "indefinite"
        mention.premods.append(node)
        return True

    def _read_determiner(self, mention: Mention, node: Chunk, first: bool) -> bool:
        value = node.tags.get("DET") or "both"
        if not first and mention.det not in {"bare", "indefinite"} and value == "indefinite":
            return False
        mention.possessive = node.text in {"his", "her", "their"}
        if (
            not first
            and mention.det in {"bare", "indefinite"}
            and value in {"indefinite", "definite"}
        ):
            return False
        if mention.premods or (mention.det == "definite" and value == "indefinite"):
            return False
        if mention.det == "indefinite" and value in {"second", "third", "other", "another"}:
            value = "another"
        if mention.det == "no" and value == "other":
            value = "no"
        mention.det = value
        if node.text.startswith("the two"):
            mention.counted, mention.count = True, 2
        return True

    def _is_adjectival(self, node: Chunk, at: int, opened: bool) -> bool:
        after = self.nodes[at + 1] if at + 1 < len(self.nodes) else None
        last = node.words[-1]
        place = node.words[0] in {"in", "from", "around", "nearby", "besides", "elsewhere"}
        if node.has("OPPOSITE", "BACKGROUND", "ACROSS", "THROUGH") and not place:
            return True
        if node.text in _PARTICIPLES and isinstance(after, Chunk) and after.has("AGENT"):
            return opened or not self._is_after_be(at)
        if node.has("WAIT", "FOLLOW", "HEAD", "EXIT", "NEAR", "FROM", "SAME"):
            return opened and last.endswith(("ing", "ed")) and len(last) > 4
        if node.has("JAYWALK", "CROSS", "TURN"):
            return last.endswith("ing") and (opened or node.has("JAYWALK", "CROSS"))
        return opened

    def _is_after_be(self, at: int) -> bool:
        """ "was following vehicle 1" says what an agent does."""
        before = self.nodes[at - 1] if at else None
        return isinstance(before, Chunk) and before.has("BE")

    def _has_more_premodifiers(self, at: int) -> bool:
        if at >= len(self.nodes):
            return False
        node = self.nodes[at]
        if isinstance(node, Modifier):
            first = {"left", "right", "straight", node.chunks[-1].words[0]}
            return node.means in {"bound", "turn", "straight"} and node.first in first
        return not node.tags and self._count_plain_run(at) <= 2

    def _count_plain_run(self, at: int) -> int:
        run = 0
        while at + run < len(self.nodes):
            node = self.nodes[at + run]
            if isinstance(node, Modifier) or node.has("AGENT") or node.text in {"one", "ones"}:
                break
            run += 1
            if node.tags and not node.has(
                "IGNORE", "EDIT", "NORMAL", "DRIVING", "LEG", "ROAD", "LEVEL", "DENSITY"
            ):
                return 99
        else:
            return 99
        return run

    def _read_head(self, mention: Mention, node: Chunk, at: int) -> tuple[Mention, int] | None:
        if node.tags["AGENT"] == "traffic":
            return None
        self._name(mention, node)
        at = self._count_compound(mention, at + 1)
        label = self._label(at)
        if label is not None and (mention.det in {"bare", "definite"} and not mention.counted):
            mention.label, at = label, at + 1
        self._set_number(mention, node)
        return mention, at

    def _name(self, mention: Mention, node: Chunk) -> None:
        kind, _, extra = node.tags["AGENT"].partition(".")
        mention.type = "pedestrian" if kind == "pedestrian" else "vehicle"
        if kind == "unit":
            mention.subtype = None
        elif mention.type == "vehicle":
            mention.subtype = extra or None
        if mention.possessive and mention.type == "pedestrian":
            mention.det = "another"
        mention.head = node.text

    def _count_compound(self, mention: Mention, at: int) -> int:
        """ "truck driver" is one agent, "truck pedestrian" and "car car" are two."""
        while at < len(self.nodes):
            node = self.nodes[at]
            if not isinstance(node, Chunk) or not node.has("AGENT"):
                return at
            same = node.tags["AGENT"].startswith("pedestrian") == (mention.type == "pedestrian")
            driver = node.words[-1] in _DRIVERS and mention.type == "vehicle"
            if driver or (same and mention.type == "pedestrian" and node.text != mention.head):
                at += 1
                continue
            return at
        return at

    def _set_number(self, mention: Mention, node: Chunk) -> None:
        word = node.words[-1]
        irregular = {
            "people", "children", "men", "women", "ladies", "lorries", "gentlemen", "folks",
            "passersby", "schoolchildren", "buses", "busses", "persons",
        }  # fmt: skip
        mention.plural = word in irregular or (
            word.endswith("s")
            and word not in {"bus", "minibus", "mercedes", "prius"}
            and not word.endswith("ss")
        )
        if mention.det == "both" and not mention.counted:
            mention.count, mention.counted = 2, True

    def _label(self, at: int) -> str | None:
        if at >= len(self.nodes):
            return None
        node = self.nodes[at]
        if not isinstance(node, Chunk) or self._has_agent_ahead(at + 1):
            return None
        word = node.text
        if node.has("NUMBER") and int(node.tags["NUMBER"]) <= 8:
            return node.tags["NUMBER"]
        if len(word) == 1 and word in "abcdx" and (word != "a" or self.lettered):
            return word
        return None

    def _has_agent_ahead(self, at: int) -> bool:
        node = self.nodes[at] if at < len(self.nodes) else None
        return isinstance(node, Chunk) and node.has("AGENT")

    def _read_pronominal(self, start: int) -> tuple[Mention, int] | None:
        """ "one", "the other one", "the first" without a noun."""
        node = self.nodes[start]
        if not isinstance(node, Chunk):
            return None
        det = node.tags.get("DET", "")
        after = self.nodes[start + 1] if start + 1 < len(self.nodes) else None
        one = isinstance(after, Chunk) and after.text in {"one", "ones"}
        if node.text == "one" or (
            det
            in {"other", "another", "first", "second", "third", "last", "middle"}
            | {"definite", "indefinite"}
            and one
        ):
            det = "one" if node.text == "one" else det
            return Mention(None, None, det, 1, "one"), start + (
                2 if one and node.text != "one" else 1
            )
        gapped = det in {"other", "first", "second", "third"} and node.words[0] == "the"
        if gapped and _is_phrase_start(after):
            return Mention(None, None, det, 1, "one"), start + 1
        ordinal = det in {"first", "second", "third"} and self._is_predicated(after)
        if ordinal or (
            det in {"other", "another"} and node.text != "other" and self._is_predicated(after)
        ):
            return Mention(None, None, det, 1, "one"), start + 1
        return None

    def _is_predicated(self, after: Node | None) -> bool:
        if after is None or isinstance(after, Modifier):
            return after is None or after.first not in {"a", "an", "the"}
        return not after.has(
            "DET", "AGENT", "NUMBER", "PRONOUN", "TIMEWORD", "XWALK", "LEG", "ROAD", "BACKGROUND"
        ) and bool(after.tags)


def _is_phrase_start(node: Node | None) -> bool:
    """ "the other a taxi"."""
    if isinstance(node, Modifier):
        return node.first in {"a", "an"}
    return node is not None and node.tags.get("DET") == "indefinite"


def _is_plain_adjective(node: Chunk) -> bool:
    if node.has("NORMAL"):
        return len(node.words) == 1
    return not node.tags or node.has("IGNORE", "EDIT", "DRIVING", "LEG", "ROAD")


def _merge_drivers(items: list[Item]) -> list[Item]:
    """ "a woman driving an SUV" and "the driver of a truck" are one vehicle."""
    result: list[Item] = []
    for item in items:
        if isinstance(item, Mention) and item.type == "vehicle" and item.det != "no":
            owner = _find_person_before(result)
            if owner is not None:
                del result[-2:]
                item.det, item.premods = owner.det, owner.premods + item.premods
                item.count, item.counted, item.plural = owner.count, owner.counted, owner.plural
        result.append(item)
    return result


def _find_person_before(items: list[Item]) -> Mention | None:
    if len(items) < 2:
        return None
    owner, link = items[-2:]
    if not (isinstance(link, Chunk) and link.has("DRIVING") and isinstance(owner, Mention)):
        return None
    driver = owner.head in _DRIVERS | _RIDERS or owner.type == "pedestrian"
    loose = owner.type == "pedestrian" and link.text == "of"
    return owner if driver and not loose and owner.det != "no" else None
