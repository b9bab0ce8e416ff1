"""Fits the weights of `tools/account/talk.py`: `python -m lab.account.fit_talk [OUT]`.

With `--check` it fits on four fifths of the files of the corpus, five times, and says how many of
the other files' unknown words pass for talk.
"""

from __future__ import annotations

import random
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy import sparse
from sklearn import linear_model

import scenewright
from scenewright.backends.builtin.training.corpus import list_package_files, read_corpus
from scenewright.scene.base import FloatArray
from scenewright.tools.account.account import is_function
from scenewright.tools.account.talk import (
    BUCKETS,
    WEIGHTS,
    compute_content_chance,
    get_limit,
    hash_features,
)
from scenewright.tools.account.vocabulary import read_tokens

_SILENT = (None, "manner", "del", "normal", "veh", "ped", "cyc", "scoot", "ref")
"""Marks, or none, of words that claim nothing by themselves."""
_UNSHOWN = ("act", "thing", "place", "weather", "cond", "broken", "other", "obj", "sight", "speed")
_STRENGTH = 0.15


class Example(NamedTuple):
    """An unknown word: its file, features and limit, and whether it says something."""

    file: str
    features: list[int]
    limit: float
    tells: bool


def read_examples(paths: Sequence[Path]) -> list[Example]:
    """The words of annotated instructions that the vocabulary of the account does not know."""
    found = []
    for path in paths:
        for row in (each for each in read_corpus([path]) if each.kind in ("scene", "edit")):
            tokens = read_tokens(row.text)
            known = [bool(each.list_families()) for each in tokens]
            for n, token in enumerate(tokens):
                if token.kind != "word" or known[n] or token.phrase or is_function(token):
                    continue
                here = next(
                    (s for s in row.spans if s.start < token.end and token.start < s.end), None
                )
                tag = here.tag if here else None
                # What the other words of a mark say is claimed by them.
                others = here and any(
                    known[m] and here.start < each.end and each.start < here.end
                    for m, each in enumerate(tokens)
                )
                tells = tag in _UNSHOWN or (tag not in _SILENT and not others)
                found.append(
                    Example(path.stem, hash_features(tokens, n), get_limit(tokens, n), tells)
                )
    return found


def _build_matrix(examples: Sequence[Example]) -> Any:
    columns = [bucket for each in examples for bucket in each.features]
    ends = np.cumsum([0, *(len(each.features) for each in examples)])
    return sparse.csr_matrix((np.ones(len(columns)), columns, ends), shape=(len(examples), BUCKETS))


def fit_weights(examples: Sequence[Example]) -> FloatArray:
    """[BUCKETS + 1] log-odds of each feature, the intercept last."""
    model: Any = linear_model.LogisticRegression(C=_STRENGTH, max_iter=500)
    model.fit(_build_matrix(examples), [each.tells for each in examples])
    return np.append(model.coef_[0], model.intercept_).astype(np.float16)


def check(examples: Sequence[Example]) -> None:
    """Print the shares of words of files kept apart that pass for talk."""
    names = sorted({each.file for each in examples})
    random.Random(0).shuffle(names)
    passed: dict[bool, list[bool]] = {True: [], False: []}
    for fold in range(5):
        held = set(names[fold::5])
        weights = fit_weights([each for each in examples if each.file not in held])
        for each in (e for e in examples if e.file in held):
            chance = compute_content_chance(weights, each.features)
            passed[each.tells].append(chance < each.limit)
    for tells, found in passed.items():
        kind = "that say something" if tells else "without content"
        print(f"of {len(found)} unknown words {kind} {np.mean(found):.1%} pass for talk")


if __name__ == "__main__":
    arguments = sys.argv[1:]
    examples = read_examples(list_package_files())
    if "--check" in arguments:
        check(examples)
    else:
        package = Path(scenewright.__file__).parent / "tools" / "account"
        np.save(Path(arguments[0]) if arguments else package / WEIGHTS, fit_weights(examples))
