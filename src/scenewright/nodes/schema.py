"""Small pieces of JSON schema, as constrained decoders take them: no tuples, no `oneOf`, no `$ref`.

Objects are closed, lists bounded, and whatever has a name in the scene is an enumeration.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

Schema = dict[str, Any]

PLAIN_TEXT = r"^[A-Za-z0-9 ,.;:'()/-]{1,120}$"
"""Free text without quotes and control characters, which small models get wrong.

xgrammar, the decoder of vLLM, breaks on patterns that repeat more than 128 times.
"""


def one_of(values: Iterable[str]) -> Schema:
    """One of the texts."""
    return {"type": "string", "enum": list(dict.fromkeys(values))}


def number(low: float, high: float) -> Schema:
    """A number within bounds."""
    return {"type": "number", "minimum": low, "maximum": high}


def whole(low: int, high: int) -> Schema:
    """A whole number within bounds."""
    return {"type": "integer", "minimum": low, "maximum": high}


def text(pattern: str = PLAIN_TEXT) -> Schema:
    """A text of a pattern."""
    return {"type": "string", "pattern": pattern}


def listed(items: Schema, *, most: int, least: int = 0) -> Schema:
    """A list of so many."""
    return {"type": "array", "items": items, "minItems": least, "maxItems": most}


def closed(properties: Mapping[str, Schema], *, required: Iterable[str] = ()) -> Schema:
    """An object with these keys and no others."""
    return {
        "type": "object",
        "properties": dict(properties),
        "required": list(required),
        "additionalProperties": False,
    }
