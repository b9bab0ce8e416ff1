"""manifest.json: what a dataset holds, with the hash of every file; written as a stream.

Its last line is the hash of all lines above, so that a change of the manifest itself shows too.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterable, Iterator, Mapping
from itertools import chain
from pathlib import Path
from typing import Any

from scenewright.errors import InputError

MANIFEST = "manifest.json"
_ENDING = b'\n "manifest": "'


def write_manifest(
    folder: Path, about: Mapping[str, Any], files: Iterable[tuple[str, str]]
) -> None:
    """Writes the manifest, whole or not at all.

    Args:
        about: its other keys; files: (path below the folder, sha256).
    """
    part, above = folder / f".{MANIFEST}.part", hashlib.sha256()
    head = json.dumps(dict(about), ensure_ascii=False, indent=1).removesuffix("\n}")
    lines = (
        f'{"," if n else ""}\n  {json.dumps(name)}: "{sha256}"'
        for n, (name, sha256) in enumerate(files)
    )
    with part.open("wb") as stream:
        for text in chain([head + ',\n "files": {'], lines, ["\n },"]):
            data = text.encode("utf-8", "backslashreplace")
            above.update(data)
            stream.write(data)
        stream.write(_ENDING + above.hexdigest().encode() + b'"\n}\n')
    os.replace(part, folder / MANIFEST)


def is_as_written(folder: Path) -> bool:
    """Whether the manifest is the one that was written, to the byte.

    Raises:
        OSError: it cannot be read.
    """
    data = (folder / MANIFEST).read_bytes()
    above, ending, rest = data.rpartition(_ENDING)
    return bool(ending) and rest == hashlib.sha256(above).hexdigest().encode() + b'"\n}\n'


def read_manifest(folder: Path) -> dict[str, Any]:
    """The manifest of a dataset.

    Raises:
        InputError: there is none, or it is none.
    """
    file = folder / MANIFEST
    try:
        found: dict[str, Any] = json.loads(file.read_bytes())
        for key in ("files", "rows", "tables"):
            if not isinstance(found, dict) or not isinstance(found[key], dict):
                raise TypeError(f"no table of {key}")
    except OSError as error:
        raise InputError(
            f"{folder} is no finished dataset: cannot read {MANIFEST}: {error.strerror or error}"
        ) from error
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        raise InputError(f"{file} is no manifest: {error}") from error
    return found


def hash_files(folder: Path, names: Iterable[str]) -> Iterator[tuple[str, str]]:
    """(name, sha256) of files below a folder.

    Raises:
        OSError: one cannot be read, or is a device or a pipe, which may never end.
        ValueError: no file can have such a name.
    """
    for name in names:
        if not (folder / name).is_file() and (folder / name).exists():
            raise OSError("no plain file")
        with (folder / name).open("rb") as stream:
            yield name, hashlib.file_digest(stream, "sha256").hexdigest()


EXPORTS = "exports"
"""Folder in a dataset for its scenes in other formats; no part of the dataset."""


def list_scenes(folder: Path) -> list[Path]:
    """The folders of all scenes, in the manifest's order.

    Raises:
        InputError: there is no manifest, or no scene in it.
    """
    names = [name for name in read_manifest(folder)["files"] if name.endswith("/scene.json")]
    if not names:
        raise InputError(f"{folder} holds no scenes to export")
    root = folder.resolve()
    scenes = [(folder / name).parent for name in names]
    outside = [str(scene) for scene in scenes if not scene.resolve().is_relative_to(root)]
    if outside:
        raise InputError(f"{outside[0][:200]} lies outside the dataset")
    return scenes
