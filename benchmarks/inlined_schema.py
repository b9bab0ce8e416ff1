"""JSON schemas with all that is shared written out, as tests and benchmarks look into them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from scenewright.nodes.schema import Schema


def inline_references(schema: Schema) -> Schema:
    """The schema with everything that is shared written out where it is used."""
    defs: Mapping[str, Schema] = schema.get("$defs", {})

    def expand(value: Any) -> Any:
        if isinstance(value, dict):
            if "$ref" in value:
                return expand(defs[value["$ref"].removeprefix("#/$defs/")])
            return {key: expand(each) for key, each in value.items() if key != "$defs"}
        return [expand(each) for each in value] if isinstance(value, list) else value

    found: Schema = expand(schema)
    return found
