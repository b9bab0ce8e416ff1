"""Small TOML files that hold one model each, shipped or in a folder of the user's own."""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Iterable
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import Any, TypeVar

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from scenewright.errors import InputError
from scenewright.scene.base import Model, describe_fault, find_model_at, list_fields

_ModelT = TypeVar("_ModelT", bound=Model)
_MOST_BYTES = 32_000
_MOST_FILES = 500


def list_files(folder: Path) -> list[Traversable]:
    """The files of a user's folder; InputError where it cannot be read."""
    try:
        files: list[Traversable] = [*sorted(folder.iterdir())]
    except OSError as error:
        raise InputError(f"cannot read relations in {folder}: {error.strerror}") from error
    if len(files) > _MOST_FILES:
        raise InputError(f"cannot read relations in {folder}: more than {_MOST_FILES} files")
    return files


def read_models(
    files: Iterable[Traversable], model: type[_ModelT], noun: str, name: Callable[[_ModelT], str]
) -> dict[str, tuple[str, _ModelT]]:
    """By name: the name of the file, and what it holds; of the files of this noun alone.

    Args:
        noun: `relation`, or `kind`, whose files alone have an axis.
        name: what two files may not share.

    Raises:
        InputError: a file is not one; the text names file, field and what was expected.
    """
    found: dict[str, tuple[str, _ModelT]] = {}
    for file in files:
        data = _load(file) if file.name.endswith(".toml") else None
        if data is None or ("axis" in data) != (noun == "kind"):
            continue
        try:
            value = model.model_validate(data)
        except ValidationError as error:
            why = _describe_fault(error.errors(include_url=False)[0], model)
            raise build_refusal(file.name, noun, why) from None
        if name(value) in found:
            why = f"id: {found[name(value)][0]} has the id {name(value).split()[-1]!r} as well"
            raise build_refusal(file.name, noun, why)
        found[name(value)] = (file.name, value)
    return found


def _load(file: Traversable) -> dict[str, Any]:
    if not file.is_file():
        raise build_refusal(file.name, "relation", "not a file")
    try:
        with file.open("rb") as stream:
            data = stream.read(_MOST_BYTES + 1)
        if len(data) > _MOST_BYTES:
            raise build_refusal(file.name, "relation", f"larger than {_MOST_BYTES} bytes")
        return tomllib.loads(data.decode("utf-8"))
    except (ValueError, OSError) as error:
        raise build_refusal(file.name, "relation", str(error)) from error
    except RecursionError:
        raise build_refusal(file.name, "relation", "nested too deeply") from None


def build_refusal(file: str, noun: str, why: str) -> InputError:
    """The one line that says why a file is not what it should be."""
    return InputError(f"{file} is not a {noun}: {why}")


def _describe_fault(error: ErrorDetails, model: type[Model]) -> str:
    """The field, what was expected there, and what stands there."""
    field = ".".join(str(part) for part in error["loc"])
    what = describe_fault(error)
    if error["type"] == "extra_forbidden":
        known = sorted(list_fields(find_model_at(error["loc"][:-1], model)))
        what = f"no such field; there are {', '.join(known)}"
    return f"{field}: {what}" if field else what
