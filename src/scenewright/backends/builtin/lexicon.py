"""Words -> tagged chunks: the longest phrase of lexicon.toml at each place."""

from __future__ import annotations

import tomllib
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cache
from importlib.resources import files
from typing import Any

from scenewright.backends.builtin.normalise import Token, split_tokens, stem

_EXACT_TAGS = frozenset({"IGNORE", "CORRECTION", "NOBODY"})


@dataclass(frozen=True, slots=True)
class Chunk:
    """A phrase with its readings: tag -> value. No reading: a word of no meaning here."""

    words: tuple[str, ...]
    tags: dict[str, str]
    mark: str = ""

    @property
    def text(self) -> str:
        """The words, joined."""
        return " ".join(self.words)

    def has(self, *tags: str) -> bool:
        """True if the chunk can be read as one of the tags."""
        return not self.tags.keys().isdisjoint(tags)


@dataclass(slots=True)
class _Node:
    children: dict[str, _Node] = field(default_factory=dict)
    tags: dict[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Lexicon:
    """The phrase tree and the known words and stems."""

    root: _Node
    known: frozenset[str]

    def split_chunks(self, tokens: Sequence[Token]) -> list[Chunk]:
        """Split tokens into chunks, longest phrase first, left to right."""
        result: list[Chunk] = []
        at = 0
        while at < len(tokens):
            length, tags = self._find_longest(tokens, at)
            result.append(_build_chunk(tokens[at : at + length], tags))
            at += length
        return [
            part for at, chunk in enumerate(result) for part in _split_parts(result, at) or [chunk]
        ]

    def measure_familiar(self, tokens: Sequence[Token]) -> float:
        """Share of words that are English as far as the lexicon knows."""
        words = [token for token in tokens if token.text.isalpha()]
        hits = sum(token.text in self.known or token.stem in self.known for token in words)
        return hits / len(words) if words else 0.0

    def _find_longest(self, tokens: Sequence[Token], at: int) -> tuple[int, dict[str, str]]:
        best = 1
        tags: dict[str, str] = {}
        layer = [(self.root, at)]
        while layer:
            deeper: list[tuple[_Node, int]] = []
            for node, index in layer:
                if index >= len(tokens) or tokens[index].mark:
                    continue
                for key in {"=" + tokens[index].text, tokens[index].stem}:
                    child = node.children.get(key)
                    if child is None:
                        continue
                    deeper.append((child, index + 1))
                    if child.tags:
                        tags = (
                            child.tags if index + 1 - at > best or not tags else tags | child.tags
                        )
                        best = index + 1 - at
            layer = deeper
        return best, dict(tags)


def _build_chunk(tokens: Sequence[Token], tags: dict[str, str]) -> Chunk:
    words = tuple(token.text for token in tokens)
    first = tokens[0]
    if first.mark:
        return Chunk(words, {"COLON": ":"} if first.text == ":" else {"COMMA": ","}, first.text)
    if not tags and first.text.isdigit() and len(first.text) <= 3:
        return Chunk(words, {"NUMBER": first.text})
    return Chunk(words, tags)


def _split_parts(chunks: Sequence[Chunk], at: int) -> list[Chunk]:
    """Phrases that mean something else before a road user: "by the taxi", "no background cars"."""
    chunk = chunks[at]
    if chunk.text == "by the" and _has_agent(chunks[at + 1 : at + 5]):
        return [Chunk(("by",), {"BY": "by"}), Chunk(("the",), {"DET": "definite"})]
    if chunk.text in {"no background", "zero background"} and _has_agent(chunks[at + 1 : at + 2]):
        return [Chunk(("no",), {"DET": "no"}), Chunk(("background",), {"BACKGROUND": "background"})]
    return []


def _has_agent(chunks: Sequence[Chunk]) -> bool:
    for chunk in chunks:
        if chunk.has("AGENT"):
            return True
        if chunk.mark or chunk.has("XWALK", "ROAD", "CORNER", "DET"):
            return False
    return False


@cache
def load_lexicon() -> Lexicon:
    """The lexicon shipped with the package."""
    folder = files("scenewright.backends.builtin")
    table: dict[str, dict[str, Any]] = tomllib.loads(
        folder.joinpath("lexicon.toml").read_text("utf-8")
    )
    plain = folder.joinpath("english.txt").read_text("utf-8").split()
    root = _Node()
    known: set[str] = {*plain, *(stem(word) for word in plain)}
    for tag, values in table.items():
        for value, phrases in values.items():
            for phrase in phrases:
                words = _add(root, phrase, tag, value.rstrip("_"))
                known.update(words)
                known.update(stem(word) for word in words)
    return Lexicon(root, frozenset(known))


def _add(root: _Node, phrase: str, tag: str, value: str) -> list[str]:
    exact = phrase.startswith("=") or tag in _EXACT_TAGS
    tokens = split_tokens(phrase.lstrip("=").replace("'", " "))
    if tag == "BAD_AGENT":
        return _add_noun(root, [token.text for token in tokens], tag, value)
    node = root
    for token in tokens:
        key = "=" + token.text if exact else token.stem
        node = node.children.setdefault(key, _Node())
    node.tags[tag] = value
    return [token.text for token in tokens]


def _add_noun(root: _Node, words: list[str], tag: str, value: str) -> list[str]:
    """Singular and plural, and no verb of that stem: a train is one, training is not."""
    last = words[-1]
    plural = f"{last[:-1]}ies" if last.endswith("y") and last[-2] not in "aeiou" else f"{last}s"
    for ending in (last, plural):
        node = root
        for word in (*words[:-1], ending):
            node = node.children.setdefault(f"={word}", _Node())
        node.tags[tag] = value
    return [*words, plural]
