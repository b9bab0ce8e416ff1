"""The digest by which a proof names the scene that it proves."""

from __future__ import annotations

import hashlib
import json
from typing import Any

from pydantic_core import PydanticSerializationError

from scenewright.scene.record import SceneRecord


def digest_scene(scene: SceneRecord) -> str:
    """The digest of the scene.json that holds a scene: without writing and reading it."""
    try:
        document = scene.model_dump(mode="json", by_alias=True)
    except PydanticSerializationError:  # text that no UTF-8 can hold
        document = scene.to_json()
    return _digest_canonical(_escape_all(document))


def digest_json(data: bytes) -> str:
    """`sha256:` and the SHA-256 of a JSON document in canonical form.

    Spaces, the order of keys and the way in which a number is written do not matter: the canonical
    form has sorted keys, no spaces, only ASCII, the shortest decimals, whole numbers without point,
    and `\\d` for the points of strings.

    Raises:
        ValueError: it is no JSON, has a key twice or a number that is not finite.
    """
    return _digest_canonical(
        json.loads(data, parse_constant=_refuse_constant, object_pairs_hook=_read_object)
    )


def _digest_canonical(document: Any) -> str:
    """The digest of a document whose strings are escaped already."""
    text = json.dumps(document, sort_keys=True, separators=(",", ":"), allow_nan=False)
    for end in (",", "]", "}"):
        text = text.replace(f".0{end}", end)  # of numbers alone: strings hold no point any more
    return "sha256:" + hashlib.sha256(text.encode()).hexdigest()


def _refuse_constant(text: str) -> float:
    raise ValueError(f"{text} is not a number")


def _read_object(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found = {key: _escape(value) for key, value in pairs}
    if len(found) < len(pairs):
        keys = [key for key, _ in pairs]
        twice = next(key for key in keys if keys.count(key) > 1)
        raise ValueError(f"the key {twice[:60]!r} stands there twice")
    return found


def _escape_all(value: Any) -> Any:
    """The document as `_read_object` would have read it."""
    if isinstance(value, dict):
        return {key: _escape(_escape_all(each)) for key, each in value.items()}
    if isinstance(value, list | tuple) and value and isinstance(value[0], dict | list | tuple):
        return [_escape_all(each) for each in value]
    return value


def _escape(value: Any) -> Any:
    """Strings with other signs for points, so that different ones stay different."""
    if isinstance(value, str):
        return value.replace("\\", "\\\\").replace(".", "\\d")
    if isinstance(value, list | tuple) and value and isinstance(value[0], str):
        return [_escape(each) for each in value]
    return value
