"""Small pieces of JSON schema, as constrained decoders take them: no tuples, `oneOf`, `allOf`.

Objects are closed, lists bounded, and whatever has a name in the scene is an enumeration. An
enumeration that is needed often stands once under `$defs`. Some providers count a schema as input,
so it says nothing twice.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from typing import Any

from scenewright.backends.offline import WORDS

Schema = dict[str, Any]


def speaks_of(what: str, words: str) -> bool:
    """Whether words may speak of something, by the vocabulary: a model fills in what is offered."""
    return re.search(WORDS["speaks_of"][what], words, re.IGNORECASE) is not None


PLAIN_TEXT = "^[A-Za-z0-9 ,.;:'()/-]{1,120}$"
"""Free text without quotes and control characters, which small models get wrong.

xgrammar, the decoder of vLLM, breaks on patterns that repeat more than 128 times; llama.cpp's on
classes such as \\d and \\w, where it does not pass over the pattern.
"""


def build_enum(values: Iterable[str]) -> Schema:
    """One of the texts."""
    return {"type": "string", "enum": list(dict.fromkeys(values))}


def build_number(low: float, high: float) -> Schema:
    """A number within bounds."""
    return {"type": "number", "minimum": low, "maximum": high}


def build_integer(low: int, high: int) -> Schema:
    """A whole number within bounds."""
    return {"type": "integer", "minimum": low, "maximum": high}


def build_text(pattern: str = PLAIN_TEXT) -> Schema:
    """A text of a pattern."""
    return {"type": "string", "pattern": pattern}


def build_reference(name: str) -> Schema:
    """What stands under that name in `$defs`."""
    return {"$ref": f"#/$defs/{name}"}


def build_array(items: Schema, *, most: int, least: int = 0) -> Schema:
    """A list of so many."""
    found: Schema = {"type": "array", "items": items, "maxItems": most}
    return found | {"minItems": least} if least else found


def build_object(
    properties: Mapping[str, Schema],
    *,
    required: Iterable[str] = (),
    defs: Mapping[str, Schema] | None = None,
) -> Schema:
    """An object with these keys and no others; the outermost one may hold `defs` for all."""
    found: Schema = {"type": "object", "properties": dict(properties)}
    needed = list(required)
    if needed:
        found["required"] = needed
    found["additionalProperties"] = False
    return found | {"$defs": dict(defs)} if defs else found
