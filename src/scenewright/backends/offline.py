"""What the offline planner gives beside answers: turns of a conversation, plans of texts, words.

Rooms above load it from here, so that they need not know how the planner is built.
"""

from __future__ import annotations

from scenewright.backends.builtin.draft import build_site
from scenewright.backends.builtin.named import CLASSES, Named, find_named
from scenewright.backends.builtin.planner import plan
from scenewright.backends.builtin.reader.words import (
    VOCABULARY,
    WORDS,
    Patterns,
    fill_in,
    time_words_in,
)
from scenewright.backends.builtin.references import ORDINALS, build_clarification, read_choice
from scenewright.backends.builtin.revising import begins_anew, read
from scenewright.backends.builtin.turn_intent import rank_intents

__all__ = [
    "CLASSES",
    "ORDINALS",
    "VOCABULARY",
    "WORDS",
    "Named",
    "Patterns",
    "begins_anew",
    "build_clarification",
    "build_site",
    "fill_in",
    "find_named",
    "plan",
    "rank_intents",
    "read",
    "read_choice",
    "time_words_in",
]  # fmt: skip
