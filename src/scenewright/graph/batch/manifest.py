"""manifest.json: what a dataset holds, with the hash of every file; written as a stream."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from scenewright.errors import InputError

MANIFEST = "manifest.json"


def write_manifest(
    folder: Path, about: Mapping[str, Any], files: Iterable[tuple[str, str]]
) -> None:
    """Writes the manifest, whole or not at all.

    Args:
        about: its other keys; files: (path below the folder, sha256).
    """
    part = folder / f".{MANIFEST}.part"
    with part.open("w", encoding="utf-8", newline="\n") as stream:
        head = json.dumps(dict(about), ensure_ascii=False, indent=1)
        stream.write(head.removesuffix("\n}") + ',\n "files": {')
        between = "\n"
        for name, sha256 in files:
            stream.write(f'{between}  {json.dumps(name)}: "{sha256}"')
            between = ",\n"
        stream.write("\n }\n}\n")
    os.replace(part, folder / MANIFEST)


def read_manifest(folder: Path) -> dict[str, Any]:
    """The manifest of a dataset.

    Raises:
        InputError: there is none, or it is none.
    """
    file = folder / MANIFEST
    try:
        found = json.loads(file.read_bytes())
        if not isinstance(found, dict) or not isinstance(found["files"], dict):
            raise TypeError("no table of files")
    except OSError as error:
        raise InputError(
            f"{folder} is no finished dataset: cannot read {MANIFEST}: {error.strerror or error}"
        ) from error
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        raise InputError(f"{file} is no manifest: {error}") from error
    return found


def hashed(folder: Path, names: Iterable[str]) -> Iterator[tuple[str, str]]:
    """(name, sha256) of files below a folder."""
    for name in names:
        with (folder / name).open("rb") as stream:
            yield name, hashlib.file_digest(stream, "sha256").hexdigest()
