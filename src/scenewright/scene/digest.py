"""The digest by which a proof names the scene that it proves."""

from __future__ import annotations

import hashlib
import json
import re
from typing import Any

from scenewright.scene.record import SceneRecord


def digest_scene(scene: SceneRecord) -> str:
    """The digest of the scene.json that holds a scene: without writing and reading it."""
    # Nearly all of a scene are points, whose digits machine code writes as Python does, but for
    # those of very small and very large numbers.
    _, *rest = _POINTS.split(scene.model_dump_json(by_alias=True))
    lists = [each[: each.index('"') - 1] for each in rest]  # up to the next key
    if any(sign in each for each in lists for sign in ("e", "null", "0.0000")):
        return _digest_text(_write_canonical(_escape_all(scene.to_json())))
    document = _escape_all(scene.model_dump(mode="json", by_alias=True, exclude=_LEFT_OUT))
    for agent in document["agents"]:
        agent.update(dict.fromkeys(_KEYS, "."))  # no other string holds a point
    first, *parts = _write_canonical(document).split(':"."')
    # Sorted keys have the headings before the trajectory.
    lists[::3], lists[1::3] = lists[1::3], lists[::3]
    pieces = (f":{each}{part}" for each, part in zip(lists, parts, strict=True))
    return _digest_text(first + "".join(pieces))


_KEYS = ("trajectory", "heading", "waypoints")
_LEFT_OUT: Any = {"agents": {"__all__": set(_KEYS)}}
_POINTS = re.compile(rf'"(?:{"|".join(_KEYS)})":(?=\[)')
_WHOLE = re.compile(r"\.0(?=[,\]}])")


def digest_json(data: bytes) -> str:
    """`sha256:` and the SHA-256 of a JSON document in canonical form.

    Spaces, the order of keys and the way in which a number is written do not matter: the canonical
    form has sorted keys, no spaces, only ASCII, the shortest decimals, whole numbers without point,
    and `\\d` for the points of strings.

    Raises:
        ValueError: it is no JSON, has a key twice or a number that is not finite.
    """
    document = json.loads(data, parse_constant=_refuse_constant, object_pairs_hook=_read_object)
    return _digest_text(_write_canonical(document))


def _write_canonical(document: Any) -> str:
    """A document whose strings are escaped already, but for the points of whole numbers."""
    return json.dumps(document, sort_keys=True, separators=(",", ":"), allow_nan=False)


def _digest_text(text: str) -> str:
    text = _WHOLE.sub("", text)  # of numbers alone: strings hold no point any more
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
        return {
            key: each if isinstance(each, float | int) else _escape(_escape_all(each))
            for key, each in value.items()
        }
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
