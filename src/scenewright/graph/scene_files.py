"""The files of a scene: written as bytes, found, and read with care."""

from __future__ import annotations

import json
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from pydantic import ValidationError
from pydantic_core import PydanticSerializationError

from scenewright.errors import InputError, describe_misfit
from scenewright.files import format_json_line
from scenewright.scene.bounds import find_excess
from scenewright.scene.digest import digest_json
from scenewright.scene.events import Proof
from scenewright.scene.record import SceneRecord

_PAPER_LACKS = {"intersection", "step", "duration", "heading", "length", "width"}


def encode_scene(record: SceneRecord) -> bytes:
    """scene.json: the same scene, the same bytes."""
    try:
        return record.model_dump_json(by_alias=True).encode() + b"\n"
    except PydanticSerializationError:  # text that no UTF-8 can hold
        return format_json_line(record.to_json())


def encode_proof(proof: Proof) -> bytes:
    """proof.json."""
    return format_json_line(proof.model_dump(mode="json", by_alias=True))


def find_scene_file(path: str | Path) -> Path:
    """The scene.json that a path names: the file, or that of a folder.

    Raises:
        InputError: the path is empty, which would name the folder that happens to be current.
    """
    if not str(path).strip():
        raise InputError("the path of the scene is empty; name a scene.json or its folder")
    return Path(path) / "scene.json" if Path(path).is_dir() else Path(path)


def load_scene(path: str | Path) -> SceneRecord:
    """The scene in a scene.json, or in a folder that holds one.

    Raises:
        InputError: missing, unreadable or not a scene; says where the first fault is.
    """
    return read_scene(find_scene_file(path))[0]


def read_scene(file: Path) -> tuple[SceneRecord, str]:
    """The scene in a file, and the digest of the file.

    Raises:
        InputError: as `load_scene`.
    """
    data = read_content(file)
    with _name_in_faults(file, "is not a scene"):
        try:
            record = SceneRecord.model_validate_json(data)
        except ValidationError as error:
            faults = error.errors(include_url=False)
            if {fault["loc"][-1] for fault in faults if fault["type"] == "missing"} >= _PAPER_LACKS:
                raise InputError(
                    f"{file} is a scene of the paper profile (Listing 1): without headings, sizes, "
                    "relations and signals nothing can be proven; verify the full scene.json"
                ) from error
            raise
        if "schema_version" not in record.meta.model_fields_set:
            raise ValueError("meta.schema_version is missing")
        if (excess := find_excess(record)) is not None:
            raise ValueError(excess)
        return record, digest_json(data)


def read_proof(file: Path) -> Proof:
    """The proof in a file.

    Raises:
        InputError: it cannot be read, or is no proof; says where the first fault is.
    """
    data = read_content(file)
    with _name_in_faults(file, "is not a proof"):
        proof = Proof.model_validate_json(data)
        digest_json(data)  # which refuses a key twice, of which readers see one or the other
        return proof


def read_origin_digest(file: Path) -> str | None:
    """The digest of the scene that a provenance.json is of; None if it names none, or is not there.

    Raises:
        InputError: it cannot be read, or is no JSON.
    """
    if not file.exists():
        return None
    data = read_content(file)
    with _name_in_faults(file, "is no provenance"):
        digest_json(data)  # which refuses a key twice
        about = json.loads(data)
        return about.get("scene_digest") if isinstance(about, dict) else None


@contextmanager
def _name_in_faults(file: Path, verdict: str) -> Iterator[None]:
    """What is wrong with a file, as an InputError that names it."""
    try:
        yield
    except ValidationError as error:
        raise InputError(f"{file} {verdict}: {describe_misfit(error, 'file')}") from error
    except (ValueError, RecursionError) as error:
        raise InputError(f"{file} {verdict}: {error}") from error


def read_content(file: Path) -> bytes:
    """The bytes of a file; devices and pipes, which may never end, are refused.

    Raises:
        InputError: missing, unreadable, too large or no file.
    """
    from scenewright.tools.formats.sample_table import MOST_BYTES, describe_too_large

    try:
        mode, size = file.stat().st_mode, file.stat().st_size
        if not (stat.S_ISREG(mode) or stat.S_ISDIR(mode)):
            raise InputError(f"cannot read {file}: it is a device or a pipe, not a file")
        with file.open("rb") as stream:
            data = stream.read(MOST_BYTES + 1)
    except OSError as error:
        raise InputError(f"cannot read {file}: {error.strerror or error}") from error
    if len(data) > MOST_BYTES:
        raise InputError(describe_too_large(str(file), max(size, len(data))))
    return data
