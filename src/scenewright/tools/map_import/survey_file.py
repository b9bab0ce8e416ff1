"""A survey as a file of a bundle: what an import read, so that a fit can derive the map anew."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import fields, is_dataclass, replace
from typing import Any, get_args, get_origin, get_type_hints

import numpy as np

from scenewright.errors import InputError
from scenewright.tools.map_import.survey import Survey

FORMAT = 2


def write_survey(survey: Survey, **options: Any) -> bytes:
    """The survey without what is drawn for pictures, and how the map was made of it, as JSON."""
    text = json.dumps(
        {"format": FORMAT, "options": options, "survey": _describe(replace(survey, drawn={}))},
        ensure_ascii=False, separators=(",", ":"),
    )  # fmt: skip
    return text.encode()


def _describe(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return np.round(value, 4).tolist()
    if is_dataclass(value):
        return {each.name: _describe(getattr(value, each.name)) for each in fields(value)}
    if isinstance(value, Mapping):
        return {key: _describe(each) for key, each in value.items()}
    return [_describe(each) for each in value] if isinstance(value, (list, tuple)) else value


def read_survey(content: bytes) -> tuple[Survey, dict[str, Any]]:
    """The survey and the options that were written.

    Raises:
        InputError: no survey of this version; the map has to be imported again.
    """
    try:
        held = json.loads(content)
        if held["format"] != FORMAT:
            raise ValueError(held["format"])
        return _build(Survey, held["survey"]), dict(held["options"])
    except (KeyError, TypeError, ValueError):
        raise InputError(
            "survey.json is damaged or of another version; import the map again"
        ) from None


def _build(kind: Any, raw: Any) -> Any:
    """A value of a type of the survey from what JSON holds of it."""
    args = [each for each in get_args(kind) if each is not type(None)]
    origin = get_origin(kind)
    if raw is None or not (args or is_dataclass(kind)):
        return raw
    if isinstance(kind, type) and is_dataclass(kind):
        hints = get_type_hints(kind)
        return kind(**{name: _build(hints[name], each) for name, each in raw.items()})
    if origin is np.ndarray:
        array = np.array(raw, dtype=float)
        return array if array.size else array.reshape(-1, 2)
    if origin is tuple:
        return tuple(_build(args[0] if args[-1] is ... else args[k], x) for k, x in enumerate(raw))
    if isinstance(raw, dict):
        return {key: _build(args[-1], each) for key, each in raw.items()}
    return [_build(args[0], x) for x in raw] if origin is list else _build(args[0], raw)
