"""Tokens of a text as MiniLM's uncased WordPiece makes them."""

from __future__ import annotations

from functools import lru_cache
from importlib.resources import files
from typing import Any

from scenewright.time_limit import stop_clock

MOST_TOKENS = 500
"""The encoder has 512 positions."""


@lru_cache(maxsize=1)
def load_tokenizer() -> Any:
    """The tokenizer of the package; threads may share it."""
    from tokenizers import Tokenizer

    text = (
        files("scenewright.backends.builtin.reader").joinpath("tokenizer.json").read_text("utf-8")
    )
    with stop_clock():  # once a process, whatever the request
        tokenizer = Tokenizer.from_str(text)
    tokenizer.no_padding()
    tokenizer.no_truncation()
    return tokenizer


def bucket_distance(distance: int) -> int:
    """Bucket of a signed distance in tokens; 0 to 7 before the mention, 8 to 15 after it."""
    size = abs(distance)
    steps = next((k for k, most in enumerate((2, 4, 7, 11, 17, 26, 45)) if size <= most), 7)
    return steps + (8 if distance >= 0 else 0)
