"""What a version is built on, as bytes: arrays exactly, everything else as plain JSON.

Nothing is pickled and no class is named in the bytes: a forged file can hold values, and
values alone. Fields are written and read by their names and types, so that none is forgotten.
"""

from __future__ import annotations

import base64
import json
import zlib
from dataclasses import fields, is_dataclass
from functools import cache
from types import UnionType
from typing import Any, Literal, Union, get_args, get_origin, get_type_hints

import numpy as np
from pydantic import BaseModel

from scenewright.errors import InputError
from scenewright.scene.base import FloatArray
from scenewright.scene.candidates import Path
from scenewright.scene.frozen_agents import PreviousAgent, PreviousVersion
from scenewright.scene.selection import SelectedAgent

_VERSION = 1


def serialize_version(earlier: PreviousVersion) -> bytes:
    """The products, so that `deserialize_version` gives the same to the last bit."""
    value = {"version": _VERSION, **_list_fields(earlier), "agents": [*earlier.agents.values()]}
    text = json.dumps(value, default=_make_plain, allow_nan=False, separators=(",", ":"))
    return zlib.compress(text.encode(), level=1)


def deserialize_version(data: bytes) -> PreviousVersion:
    """The products that were written.

    Raises:
        InputError: these are no such bytes.
    """
    try:
        value = json.loads(zlib.decompress(data))
        if (version := value.pop("version")) != _VERSION:
            raise InputError(f"a version of format {version}, not {_VERSION}, is kept here")
        agents = [_read(PreviousAgent, each) for each in value.pop("agents")]
        return PreviousVersion(
            agents={agent.agent.name: agent for agent in agents},
            **_read_fields(PreviousVersion, value),
        )
    except (zlib.error, ValueError, KeyError, TypeError, IndexError, AttributeError) as error:
        raise InputError(f"a kept version cannot be read: {error}") from error


def _make_plain(value: Any) -> Any:
    """A part of the products as JSON; an agent has the fields of its selection beside its own."""
    if isinstance(value, np.ndarray):
        exact = np.ascontiguousarray(value, dtype="<f8")
        return {"shape": list(exact.shape), "f8": base64.b64encode(exact.tobytes()).decode()}
    if isinstance(value, BaseModel):
        return value.model_dump(mode="json")
    if isinstance(value, Path):
        return [value.xy, value.s, value.heading, value.curvature]
    own = _list_fields(value)
    return _list_fields(own.pop("agent")) | own if isinstance(value, PreviousAgent) else own


def _list_fields(value: Any) -> dict[str, Any]:
    return {each.name: getattr(value, each.name) for each in fields(value)}


def _read(hint: Any, value: Any) -> Any:
    """The value of a type that `_make_plain` wrote."""
    origin, inner = get_origin(hint), get_args(hint)
    if hint == FloatArray:
        flat = np.frombuffer(base64.b64decode(value["f8"], validate=True), dtype="<f8")
        return np.array(flat.reshape(value["shape"]), dtype=np.float64)
    if origin in (Union, UnionType):  # all of them are of something or None
        return None if value is None else _read(inner[0], value)
    if origin is tuple:
        kinds = [inner[0]] * len(value) if inner[1:] == (...,) else inner
        return tuple(_read(kind, each) for kind, each in zip(kinds, value, strict=True))
    if origin is Literal:
        if value not in inner:
            raise ValueError(f"{value!r} is none of {inner}")
        return value
    if hint is Path:
        return Path(*(_read(FloatArray, each) for each in value))
    if hint is PreviousAgent:
        own = {name: value.pop(name) for name in ("number", "segments", "track")}
        return PreviousAgent(agent=_read(SelectedAgent, value), **_read_fields(hint, own))
    if isinstance(hint, type) and is_dataclass(hint):
        return hint(**_read_fields(hint, value))
    return hint.model_validate(value) if issubclass(hint, BaseModel) else hint(value)


def _read_fields(kind: type, value: dict[str, Any]) -> dict[str, Any]:
    hints = _get_hints(kind)
    return {name: _read(hints[name], each) for name, each in value.items()}


@cache
def _get_hints(kind: type) -> dict[str, Any]:
    return get_type_hints(kind)
