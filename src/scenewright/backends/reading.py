"""The one JSON object in a reply, or what is wrong with the reply in a sentence."""

from __future__ import annotations

import json
import math
import re
import unicodedata
from collections.abc import Iterator
from typing import Any, NoReturn, cast

LONGEST = 100_000
"""Characters of a reply; the longest answer that fits a scene has a tenth of that."""

_FENCE = re.compile(r"```[A-Za-z]*\s*\n?(.*?)```", re.DOTALL)
_THOUGHT = "</think>"
_MOST_OBJECTS = 20


class Unreadable(ValueError):
    """The reply is no answer; the message says what to mend."""


def extract_object(text: str) -> dict[str, Any]:
    """The JSON object that a reply is, or the only one that it holds.

    Prose around it and a code fence are passed over. NaN, infinity, a key that stands twice and
    control characters are refused, as are two objects that differ.

    Raises:
        Unreadable: there is none, or it is broken; says what and where.
    """
    if len(text) > LONGEST:
        raise Unreadable(f"the reply has {len(text)} characters; at most {LONGEST} are read")
    plain = text.rpartition(_THOUGHT)[2].strip()
    if not plain:
        raise Unreadable("the reply is empty; answer with one JSON object")
    fenced = [each for each in _FENCE.findall(plain) if each.strip()]
    found = [_decode(each) for each in fenced] or list(_find_objects(plain))
    if any(each != found[0] for each in found[1:]):
        raise Unreadable(f"the reply holds {len(found)} JSON values; answer with one object")
    if not isinstance(found[0], dict):
        raise Unreadable(f"the reply is a JSON {_name_kind(found[0])}; answer with one JSON object")
    _refuse_control_characters(found[0])
    return cast("dict[str, Any]", found[0])


def _find_objects(text: str) -> Iterator[Any]:
    """The first JSON value in a text, and whatever whole objects follow it.

    The first must be whole: what stands inside a broken one is not what was meant.
    """
    at = 0 if text[0] in "[{" else text.find("{")
    if at < 0:
        raise Unreadable("the reply holds no JSON object; answer with one JSON object")
    value, end = _decode_at(text, at)
    yield value
    for _ in range(_MOST_OBJECTS):
        at = text.find("{", end)
        if at < 0:
            return
        try:
            value, end = _decode_at(text, at)
            yield value
        except Unreadable:
            end = at + 1


def _decode(text: str) -> Any:
    value, end = _decode_at(text.strip(), 0)
    if text.strip()[end:].strip():
        raise Unreadable(f"not JSON: something follows the value at character {end}")
    return value


def _decode_at(text: str, at: int) -> tuple[Any, int]:
    try:
        return _DECODER.raw_decode(text, at)
    except Unreadable:
        raise
    except json.JSONDecodeError as error:
        what, where = error.msg.removesuffix(" at"), f"line {error.lineno}, column {error.colno}"
        raise Unreadable(f"not JSON: {what} at {where}") from None
    except RecursionError:
        raise Unreadable("not JSON: nested too deeply") from None
    except ValueError as error:
        raise Unreadable(f"not JSON: {str(error)[:120]}") from None


def _check_unique_keys(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    if len(found) < len(pairs):
        keys = [key for key, _ in pairs]
        twice = next(key for key in keys if keys.count(key) > 1)
        raise Unreadable(f"the key {twice[:60]!r} stands twice in one object")
    return found


def _parse_finite(text: str) -> float:
    value = float(text)
    if not math.isfinite(value):
        _refuse_constant(text)
    return value


def _refuse_constant(text: str) -> NoReturn:
    raise Unreadable(f"{text[:40]} is no number here; numbers are finite")


_DECODER = json.JSONDecoder(
    object_pairs_hook=_check_unique_keys, parse_float=_parse_finite, parse_constant=_refuse_constant
)


def _refuse_control_characters(value: Any) -> None:
    match value:
        case str():
            found = next((c for c in value if _is_control_character(c)), None)
            if found is not None:
                raise Unreadable(f"a text holds the control character U+{ord(found):04X}")
        case dict():
            for key, each in value.items():
                _refuse_control_characters(key)
                _refuse_control_characters(each)
        case list():
            for each in value:
                _refuse_control_characters(each)


def _is_control_character(char: str) -> bool:
    """Whether a character has no place in a text, be it a program of several lines."""
    return unicodedata.category(char) in ("Cc", "Cs") and char not in "\n\r\t"


def _name_kind(value: Any) -> str:
    return {list: "list", str: "text", bool: "truth value", type(None): "null"}.get(
        type(value), "number"
    )
