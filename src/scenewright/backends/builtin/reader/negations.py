"""The words that deny something, for the two places that look for them."""

from __future__ import annotations

import re

NEGATIONS = ("not", "never", "nobody", "neither", "without", "except")
"""Words that always deny; n't is looked for as well."""


def compile_negations(*more: str) -> re.Pattern[str]:
    """The pattern of these words and more of them, whole words in either case."""
    return re.compile(rf"\b(?:{'|'.join((*NEGATIONS, *more))})\b|n['’]t\b", re.IGNORECASE)
