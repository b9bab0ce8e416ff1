"""The digest by which a proof names the scene that it proves."""

from __future__ import annotations

import hashlib
import json
import math
from typing import Any

from pydantic_core import PydanticSerializationError

from scenewright.scene.record import SceneRecord


def digest_scene(scene: SceneRecord) -> str:
    """The digest of the scene.json that holds a scene."""
    try:
        return digest_json(scene.model_dump_json(by_alias=True).encode())
    except PydanticSerializationError:  # text that no UTF-8 can hold
        return digest_json(json.dumps(scene.to_json()).encode())


def digest_json(data: bytes) -> str:
    """`sha256:` and the SHA-256 of a JSON document in canonical form.

    Spaces, the order of keys and the way in which a number is written do not matter: the canonical
    form has sorted keys, no spaces, only ASCII, the shortest decimals and whole numbers without a
    point.

    Raises:
        ValueError: it is no JSON, has a key twice or a number that is not finite.
    """
    document = json.loads(
        data,
        parse_float=_read_number,
        parse_constant=_refuse_constant,
        object_pairs_hook=_read_object,
    )
    canonical = json.dumps(document, sort_keys=True, separators=(",", ":"))
    return "sha256:" + hashlib.sha256(canonical.encode()).hexdigest()


def _read_number(text: str) -> float | int:
    number = float(text)
    if not math.isfinite(number):
        raise ValueError(f"the number {text[:30]} is too large")
    return int(number) if number.is_integer() else number


def _refuse_constant(text: str) -> float:
    raise ValueError(f"{text} is not a number")


def _read_object(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    if len(found) < len(pairs):
        keys = [key for key, _ in pairs]
        twice = next(key for key in keys if keys.count(key) > 1)
        raise ValueError(f"the key {twice[:60]!r} stands there twice")
    return found
