"""Relations as data: one small TOML file per conflict pattern (paper 3.1, SEMANTICS section 4).

Adding a file adds a pattern; no code knows their names (docs/relations.md). A user's own files lie
in a folder that the environment variable SCENEWRIGHT_RELATIONS names; one with the id of a shipped
pattern replaces it.
"""

from __future__ import annotations

import os
from functools import cache
from importlib import resources
from pathlib import Path

from scenewright.scene.data_files import build_refusal, list_files, read_models
from scenewright.scene.relations.pattern import Geometry, Pattern, ProofCondition, Role, RoleName

__all__ = [
    "Geometry", "Pattern", "ProofCondition", "Role", "RoleName",
    "get_pattern", "get_pattern_file", "load_patterns",
]  # fmt: skip


def load_patterns() -> tuple[Pattern, ...]:
    """Every pattern, shipped or in the folder that SCENEWRIGHT_RELATIONS names, ordered by id.

    The files of a folder are read once, and the tuple is the same one from then on.

    Raises:
        InputError: a file of that folder is no pattern, or the folder cannot be read.
    """
    return _list_builtin(os.environ.get("SCENEWRIGHT_RELATIONS"))


@cache
def _list_builtin(own: str | None) -> tuple[Pattern, ...]:
    return tuple(pattern for _, pattern in _list_patterns(own))


def get_pattern(name: str) -> Pattern:
    """The pattern with this id; KeyError if there is none."""
    for pattern in load_patterns():
        if pattern.id == name:
            return pattern
    raise KeyError(name)


def get_pattern_file(pattern: Pattern) -> str:
    """The name of the file that holds a loaded pattern; KeyError if none does."""
    for name, each in _list_patterns(os.environ.get("SCENEWRIGHT_RELATIONS")):
        if each is pattern:
            return name
    raise KeyError(pattern.id)


@cache
def _list_patterns(own: str | None) -> tuple[tuple[str, Pattern], ...]:
    found = read_models(
        resources.files(__name__).iterdir(), Pattern, "relation", lambda each: each.id
    )
    if own is not None:
        found |= read_models(list_files(Path(own)), Pattern, "relation", lambda each: each.id)
    # Check that a phrase names one pattern. Shipped files come first, so a user's is refused.
    owners: dict[str, str] = {}
    for name, pattern in found.values():
        for words, _ in pattern.list_phrase_words():
            other = owners.setdefault(words, pattern.id)
            if other != pattern.id:
                raise build_refusal(
                    name, "relation", f"phrases: {words!r} asks for {other} already"
                )
    return tuple(found[key] for key in sorted(found))
