"""Signed datasets: one changed byte, another key or no signature is found."""

from __future__ import annotations

import base64
import stat
from pathlib import Path

import pytest

from scenewright.dataset.batch.manifest import MANIFEST, write_manifest
from scenewright.dataset.batch.signing import (
    SIGNATURE,
    create_key,
    find_signature_fault,
    sign_dataset,
)
from scenewright.errors import InputError


@pytest.fixture
def signed(tmp_path: Path) -> tuple[Path, Path]:
    folder = tmp_path / "data"
    folder.mkdir()
    write_manifest(folder, {"rows": {}, "tables": {}}, [("a", "0" * 64)])
    public = create_key(tmp_path / "mine.key")
    sign_dataset(folder, tmp_path / "mine.key")
    return folder, public


def test_a_signature_holds_by_file_and_by_key_alone(signed: tuple[Path, Path]) -> None:
    folder, public = signed
    assert find_signature_fault(folder, str(public)) is None
    assert find_signature_fault(folder, public.read_text().splitlines()[1]) is None
    secret = public.with_suffix("")
    assert stat.S_IMODE(secret.stat().st_mode) == 0o600


def test_every_change_shows(signed: tuple[Path, Path], tmp_path: Path) -> None:
    folder, public = signed
    whole = (folder / MANIFEST).read_bytes()
    (folder / MANIFEST).write_bytes(whole.replace(b"0", b"1", 1))
    assert "does not belong" in str(find_signature_fault(folder, str(public)))
    (folder / MANIFEST).write_bytes(whole)
    signature = (folder / SIGNATURE).read_text()
    (folder / SIGNATURE).write_text(signature.replace("sha256:", "sha256;"))
    assert "does not belong" in str(find_signature_fault(folder, str(public)))
    (folder / SIGNATURE).write_text(signature[:90])
    assert "no signature" in str(find_signature_fault(folder, str(public)))
    (folder / SIGNATURE).unlink()
    assert "not signed" in str(find_signature_fault(folder, str(public)))
    other = create_key(tmp_path / "other.key")
    sign_dataset(folder, tmp_path / "other.key")
    assert "another key" in str(find_signature_fault(folder, str(public)))
    assert find_signature_fault(folder, str(other)) is None


def test_keys_that_are_none_are_one_line(signed: tuple[Path, Path], tmp_path: Path) -> None:
    folder, public = signed
    with pytest.raises(InputError, match="cannot write"):
        create_key(tmp_path / "mine.key")
    with pytest.raises(InputError, match="neither a public key"):
        find_signature_fault(folder, "RWnonsense")
    with pytest.raises(InputError, match="no secret key"):
        sign_dataset(folder, public)
    comment, line = (tmp_path / "mine.key").read_text().splitlines()
    body = bytearray(base64.b64decode(line))
    for k, what in ((3, "has a password"), (70, "damaged")):
        changed = bytearray(body)
        changed[k] ^= 1
        file = tmp_path / f"changed-{k}"
        file.write_text(f"{comment}\n{base64.b64encode(changed).decode()}\n")
        with pytest.raises(InputError, match=what):
            sign_dataset(folder, file)
