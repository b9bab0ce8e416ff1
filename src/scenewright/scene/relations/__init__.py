"""Relations as data: one small TOML file per conflict pattern (paper 3.1, SEMANTICS section 4).

Adding a file adds a pattern; no code knows their names (docs/relations.md). A user's own files lie
in a folder that the environment variable SCENEWRIGHT_RELATIONS names; one with the id of a shipped
pattern replaces it.
"""

from __future__ import annotations

import os
import tomllib
from functools import cache
from importlib import resources
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import Any

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from scenewright.errors import InputError
from scenewright.scene.relations.pattern import Geometry, Pattern, ProofCondition, Role, RoleName

__all__ = [
    "Geometry", "Pattern", "ProofCondition", "Role", "RoleName",
    "get_pattern", "get_pattern_file", "load_patterns",
]  # fmt: skip

_MOST_BYTES = 32_000
_MOST_FILES = 500
_LONGEST_QUOTE = 60
_FIELDS: dict[str, frozenset[str]] = {
    "": frozenset(field.alias or name for name, field in Pattern.model_fields.items()),
    "from": frozenset(Role.model_fields),
    "to": frozenset(Role.model_fields),
    "proof": frozenset(ProofCondition.model_fields),
}


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
    found = _read(list(resources.files(__name__).iterdir()))
    if own is not None:
        found |= _read(_list_files(Path(own)))
    # Check that a phrase names one pattern. Shipped files come first, so a user's is refused.
    owners: dict[str, str] = {}
    for name, pattern in found.values():
        for words, _ in pattern.list_phrase_words():
            other = owners.setdefault(words, pattern.id)
            if other != pattern.id:
                raise _build_refusal(name, f"phrases: {words!r} asks for {other} already")
    return tuple(found[key] for key in sorted(found))


def _read(files: list[Traversable]) -> dict[str, tuple[str, Pattern]]:
    """By id: the name of the file, and the pattern."""
    found: dict[str, tuple[str, Pattern]] = {}
    for file in files:
        if not file.name.endswith(".toml"):
            continue
        pattern = _load(file)
        if pattern.id in found:
            other = found[pattern.id][0]
            raise _build_refusal(file.name, f"id: {other} has the id {pattern.id!r} as well")
        found[pattern.id] = (file.name, pattern)
    return found


def _list_files(folder: Path) -> list[Traversable]:
    try:
        files: list[Traversable] = [*sorted(folder.iterdir())]
    except OSError as error:
        raise InputError(f"cannot read relations in {folder}: {error.strerror}") from error
    if len(files) > _MOST_FILES:
        raise InputError(f"cannot read relations in {folder}: more than {_MOST_FILES} files")
    return files


def _load(file: Traversable) -> Pattern:
    if not file.is_file():
        raise _build_refusal(file.name, "not a file")
    try:
        with file.open("rb") as stream:
            data = stream.read(_MOST_BYTES + 1)
        if len(data) > _MOST_BYTES:
            raise _build_refusal(file.name, f"larger than {_MOST_BYTES} bytes")
        return Pattern.model_validate(tomllib.loads(data.decode("utf-8")))
    except ValidationError as error:
        raise _build_refusal(
            file.name, _describe_fault(error.errors(include_url=False)[0])
        ) from None
    except (ValueError, OSError) as error:
        raise _build_refusal(file.name, str(error)) from error
    except RecursionError:
        raise _build_refusal(file.name, "nested too deeply") from None


def _build_refusal(name: str, why: str) -> InputError:
    return InputError(f"{name} is not a relation: {why}")


def _describe_fault(error: ErrorDetails) -> str:
    """The field, what was expected there, and what stands there."""
    field = ".".join(str(part) for part in error["loc"])
    where = f"{field}: " if field else ""
    match error["type"]:
        case "missing":
            return f"{where}is missing"
        case "extra_forbidden":
            table = ".".join(str(part) for part in error["loc"][:-1])
            return f"{where}no such field; there are {', '.join(sorted(_FIELDS.get(table, ())))}"
        case "value_error":
            return f"{where}{error['ctx']['error']}"
        case _:
            return f"{where}{error['msg']}, got {_quote_value(error['input'])}"


def _quote_value(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= _LONGEST_QUOTE else f"{text[:_LONGEST_QUOTE]}..."
