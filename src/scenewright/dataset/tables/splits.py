"""Which part of a dataset a row belongs to: train, validation or test, by a hash of its group.

Rows that would leak one another's answer to a learner share a part: those of one intersection
whose instructions are worded alike. A row names the voice that worded it, or else the group is its
text without numbers, so that one sentence at several hours or with several seeds is one group.
"""

from __future__ import annotations

import hashlib
import re
from typing import Literal

Split = Literal["train", "validation", "test"]
SPLITS: tuple[Split, ...] = ("train", "validation", "test")
SHARES = (0.8, 0.1, 0.1)
"""Of the groups that fall into each part, on average."""
_SALT = "3"
"""With it the builtin writer's 13 voices at the shipped intersection fall 10 : 1 : 2."""
_NUMBERS = re.compile(r"[0-9]+")


def choose_split(intersection: str, text: str, voice: str | None = None) -> Split:
    """The part of a row; the same for all rows of its group, in every dataset."""
    worded = voice or " ".join(_NUMBERS.sub("0", text.casefold()).split())
    digest = hashlib.sha256(f"{_SALT}\n{intersection}\n{worded}".encode()).digest()
    place = int.from_bytes(digest[:8], "big") / 2**64
    if place < SHARES[0]:
        return "train"
    return "validation" if place < SHARES[0] + SHARES[1] else "test"
