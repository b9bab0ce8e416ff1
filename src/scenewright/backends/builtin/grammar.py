"""The modifier grammar: directions, turns and crosswalks out of tagged chunks (grammar.toml)."""

from __future__ import annotations

import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from importlib.resources import files

from scenewright.backends.builtin.lexicon import Chunk

_DIRECTION_WORDS = frozenset({"direction", "heading", "travel"})
_APPROACH_WORDS = frozenset({"approach", "side", "arm", "leg"})


@dataclass(frozen=True, slots=True)
class Modifier:
    """What a phrase says of an agent.

    Attributes:
        means: rule name, e.g. `from`, `bound`, `turn`, `crosswalk`.
        values: compass names or turns, in order.
        chunks: the chunks the phrase was built from.
    """

    means: str
    values: tuple[str, ...]
    chunks: tuple[Chunk, ...]

    @property
    def text(self) -> str:
        """The words, joined."""
        return " ".join(chunk.text for chunk in self.chunks)

    @property
    def first(self) -> str:
        """The first word."""
        return self.chunks[0].words[0]


@dataclass(frozen=True, slots=True)
class _Item:
    tags: frozenset[str]
    value: str | None = None
    optional: bool = False
    keep: bool = False
    never: bool = False


Node = Chunk | Modifier


def build_modifiers(chunks: Sequence[Chunk]) -> list[Node]:
    """Replace every stretch of chunks that a rule matches by one Modifier."""
    result: list[Node] = []
    at = 0
    while at < len(chunks):
        best = _find_best_rule(chunks, at)
        if best is None:
            result.append(chunks[at])
            at += 1
            continue
        means, end, values = best
        result.append(Modifier(means, values, tuple(chunks[at:end])))
        at = end
    return result


def _find_best_rule(chunks: Sequence[Chunk], at: int) -> tuple[str, int, tuple[str, ...]] | None:
    best: tuple[str, int, tuple[str, ...]] | None = None
    for means, pattern in _load_rules():
        if not _can_start(pattern, chunks[at]):
            continue
        match = _match(pattern, chunks, at)
        if match is not None and (best is None or match[0] > best[1]):
            best = (means, *match)
    return best


def _can_start(pattern: tuple[_Item, ...], chunk: Chunk) -> bool:
    for item in pattern:
        if _fits(item, chunk):
            return True
        if not item.optional:
            return False
    return False


def _match(
    pattern: tuple[_Item, ...], chunks: Sequence[Chunk], at: int
) -> tuple[int, tuple[str, ...]] | None:
    if not pattern:
        return at, ()
    item, rest = pattern[0], pattern[1:]
    here = at < len(chunks) and _fits(item, chunks[at])
    if item.never:
        return None if here else _match(rest, chunks, at)
    if here:
        tail = _match(rest, chunks, at + 1)
        if tail is not None:
            tags = chunks[at].tags
            kept = (tags[tag] for tag in sorted(item.tags) if tag in tags)
            return (tail[0], (next(kept), *tail[1])) if item.keep else tail
    return _match(rest, chunks, at) if item.optional else None


def _fits(item: _Item, chunk: Chunk) -> bool:
    for tag in item.tags:
        if tag == "ANY":
            if _is_plain(chunk) and (item.value is None or chunk.text == item.value):
                return True
        elif tag == "DIRECTION":
            if chunk.words[0] in _DIRECTION_WORDS:
                return True
        elif tag == "APPROACH":
            if chunk.words[0] in _APPROACH_WORDS:
                return True
        elif tag in chunk.tags and (item.value is None or chunk.tags[tag] == item.value):
            return True
    return False


_MEANINGFUL = {
    "AGENT", "COLLIDE", "YIELD", "NEAR", "FOLLOW", "WAIT", "LET", "COMMA", "COLON", "NEGATION",
    "DET", "PRONOUN", "WHO", "BE", "AND", "BAD_AGENT", "LETTER", "COMPASS", "BOUND", "LEFT",
    "RIGHT", "STRAIGHT", "XWALK", "CROSS", "FROM", "TO", "EXIT", "NUMBER", "BY",
}  # fmt: skip


def _is_plain(chunk: Chunk) -> bool:
    return _MEANINGFUL.isdisjoint(chunk.tags)


@lru_cache(maxsize=1)
def _load_rules() -> tuple[tuple[str, tuple[_Item, ...]], ...]:
    source = files("scenewright.backends.builtin").joinpath("grammar.toml").read_text("utf-8")
    return tuple(
        (rule["means"], tuple(_parse_item(word) for word in pattern.split()))
        for rule in tomllib.loads(source)["rule"]
        for pattern in rule["patterns"]
    )


def _parse_item(word: str) -> _Item:
    optional, keep, never = word.endswith("?"), "@" in word, word.startswith("!")
    name, _, value = word.strip("?@!").partition("=")
    tags = frozenset(
        tag
        for part in name.split("|")
        for tag in (("COMPASS", "LETTER") if part == "C" else (part,))
    )
    return _Item(tags, value or None, optional, keep, never)
