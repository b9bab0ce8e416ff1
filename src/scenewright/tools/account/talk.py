"""Words that say nothing of what moves: greetings, names of persons, why it is asked for.

A logistic regression over the word, its ending and the kinds of words around it, fitted on
annotated instructions (`lab/account/fit_talk.py`). It only ever speaks of words that the
vocabulary does not know.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cache
from importlib.resources import files
from zlib import crc32

import numpy as np

from scenewright.scene.base import FloatArray
from scenewright.tools.account.vocabulary import Token, load_vocabulary

WEIGHTS = "talk.npy"
BUCKETS = 16384
"""Weights; a feature is hashed to one of them. The last one is the intercept."""
LIKELY, LIKELY_NAME, LIKELY_THING = 0.11, 0.5, 0.05
"""Probability of content below which a word is taken for talk; that of one with a capital inside a
sentence; and of one after "a", which brings something new. Of unknown words without content four
fifths pass, of those with content three in ten (five folds of voices): these the reader has to
miss. Vectors of words, boosted trees and networks told the two apart no better."""
_TELLING = ("noun", "event", "motion_verb", "side", "stop", "crosswalk", "beyond", "request")


def is_talk(tokens: Sequence[Token], n: int) -> bool:
    """Whether an unknown word at a place most likely says nothing of the scene."""
    if tokens[n].is_in("never_talk") or tokens[n].number is not None:
        return False
    return compute_content_chance(_load_weights(), hash_features(tokens, n)) < get_limit(tokens, n)


def get_limit(tokens: Sequence[Token], n: int) -> float:
    """The probability of content below which a word at a place is taken for talk."""
    before = tokens[n - 1] if n else None
    if before is not None and before.text in ("a", "an"):
        return LIKELY_THING
    return LIKELY_NAME if tokens[n].capital and before and before.kind != "end" else LIKELY


def compute_content_chance(weights: FloatArray, buckets: Sequence[int]) -> float:
    """The probability that a word with these features says something that a scene has to show.

    Weights: [BUCKETS + 1], the last one the intercept.
    """
    return float(1.0 / (1.0 + np.exp(-weights[-1] - weights[list(buckets)].sum())))


def hash_features(tokens: Sequence[Token], n: int) -> list[int]:
    """The buckets of the features of a word, each once."""
    return sorted({crc32(feature.encode()) % BUCKETS for feature in _list_features(tokens, n)})


def _list_features(tokens: Sequence[Token], n: int) -> Iterator[str]:
    token = tokens[n]
    first = n == 0 or tokens[n - 1].kind == "end"
    shape = f"{token.capital}{first}"
    yield from (f"word {token.text}", f"stem {token.stem}", f"shape {shape}")
    yield from (f"head {token.text[:k]}" for k in range(3, 6))
    yield from (f"tail {token.text[-k:]}" for k in range(2, 6))
    yield f"length {min(len(token.text), 8)}"
    near = {d: _describe(tokens, n + d) for d in (-2, -1, 1, 2)}
    yield from (f"{d} {kind}" for d, kind in near.items())
    yield from (f"{d} stem {tokens[n + d].stem}" for d in near if 0 <= n + d < len(tokens))
    yield from (f"{d} {near[d]} {shape}" for d in (-1, 1))
    yield f"between {near[-1]} {near[1]}"
    told = {f for t in tokens if t.sentence == token.sentence for f in t.list_families()}
    yield from (f"sentence {family} {family in told}" for family in _TELLING)
    part = {family for each in _cut_part(tokens, n) for family in each.list_families()}
    yield from (f"part {family}" for family in part)
    yield f"part of {len(part)}"


def _describe(tokens: Sequence[Token], n: int) -> str:
    """What kind of word stands at a place."""
    if not 0 <= n < len(tokens):
        return "none"
    token = tokens[n]
    if token.kind != "word":
        return token.kind
    families = token.list_families()
    if families:
        return min(families)
    return token.text if token.text in load_vocabulary().function else "unknown"


def _cut_part(tokens: Sequence[Token], n: int) -> Sequence[Token]:
    """The tokens around a place up to the next stops."""
    stops = [k for k, each in enumerate(tokens) if each.kind in ("end", "comma", "arrow")]
    start = max((k + 1 for k in stops if k < n), default=0)
    return tokens[start : min((k for k in stops if k > n), default=len(tokens))]


@cache
def _load_weights() -> FloatArray:
    with files(__package__).joinpath(WEIGHTS).open("rb") as file:
        weights: FloatArray = np.load(file).astype(np.float32)
    return weights
