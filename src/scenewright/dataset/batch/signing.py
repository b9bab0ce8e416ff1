"""A dataset signed with its author's own key: `manifest.json.minisig`, as minisign writes it.

The manifest holds the hash of every file, so its signature covers the dataset. Keys and signatures
are those of minisign (Ed25519 over BLAKE2b): `minisign -V -m manifest.json` checks what is signed
here, and what `minisign -S -m manifest.json` signs is checked here. Needs the extra `sign`.
"""

from __future__ import annotations

import base64
import binascii
import hashlib
import os
import secrets
from pathlib import Path
from typing import TYPE_CHECKING, Any

from scenewright.dataset.batch.manifest import MANIFEST, read_manifest
from scenewright.errors import InputError
from scenewright.extras import require_extra
from scenewright.files import write_atomically

if TYPE_CHECKING:
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey

SIGNATURE = f"{MANIFEST}.minisig"
_LEGACY, _HASHED, _CHECKSUM = b"Ed", b"ED", b"B2"
_NO_PASSWORD = b"\0\0"
_SECRET_BYTES, _PUBLIC_BYTES, _SIGNATURE_BYTES = 158, 42, 74
_COMMENT, _TRUSTED = "untrusted comment: ", "trusted comment: "


def create_key(file: Path) -> Path:
    """Writes a new secret key, which only its owner may read, and FILE.pub; the latter's path.

    Raises:
        InputError: the file is there already, or cannot be written.
    """
    ed25519 = _load_library()
    private = ed25519.Ed25519PrivateKey.generate()
    seed, number = private.private_bytes_raw(), secrets.token_bytes(8)
    public = private.public_key().public_bytes_raw()
    # As minisign has it for keys without a password: no salt, no limits, no checksum.
    body = _LEGACY + _NO_PASSWORD + _CHECKSUM + bytes(48) + number + seed + public + bytes(32)
    try:
        handle = os.open(file, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    except OSError as error:
        raise InputError(f"cannot write {file}: {error.strerror or error}") from error
    with os.fdopen(handle, "wb") as stream:
        stream.write(_format_lines("scenewright secret key, keep it to yourself", body))
    public_file = file.with_name(f"{file.name}.pub")
    write_atomically(
        public_file, _format_lines("scenewright public key", _LEGACY + number + public)
    )
    return public_file


def sign_dataset(folder: Path, key: Path) -> Path:
    """Signs a dataset's manifest; the path of the signature.

    Raises:
        InputError: no dataset, or no secret key without a password.
    """
    read_manifest(folder)
    number, private = _read_secret(key)
    data = (folder / MANIFEST).read_bytes()
    signature = private.sign(hashlib.blake2b(data).digest())
    comment = f"file:{MANIFEST} sha256:{hashlib.sha256(data).hexdigest()}"
    whole = private.sign(signature + comment.encode())
    lines = _format_lines("signature of a scenewright dataset", _HASHED + number + signature)
    lines += f"{_TRUSTED}{comment}\n{base64.b64encode(whole).decode()}\n".encode()
    write_atomically(folder / SIGNATURE, lines)
    return folder / SIGNATURE


def find_signature_fault(folder: Path, public_key: str) -> str | None:
    """What is wrong with a dataset's signature; None if it is that of a public key.

    Args:
        public_key: a file of minisign, or the key itself (`RW...`).

    Raises:
        InputError: no public key.
    """
    number, public = _read_public(public_key)
    try:
        lines = (folder / SIGNATURE).read_text("utf-8").splitlines()
        body, comment = _decode(lines[1], _SIGNATURE_BYTES), lines[2].removeprefix(_TRUSTED)
        whole = _decode(lines[3], 64)
    except OSError:
        return "is missing: the dataset is not signed"
    except (ValueError, IndexError):
        return "is no signature of minisign"
    if body[2:10] != number:
        return "was made with another key"
    data = (folder / MANIFEST).read_bytes()
    signed = hashlib.blake2b(data).digest() if body[:2] == _HASHED else data
    right = _is_signed(public, body[10:], signed)
    right = right and _is_signed(public, whole, body[10:] + comment.encode())
    return None if right else "does not belong to this manifest"


def _is_signed(public: Any, signature: bytes, data: bytes) -> bool:
    from cryptography.exceptions import InvalidSignature

    try:
        public.verify(signature, data)
    except InvalidSignature:
        return False
    return True


def _read_secret(file: Path) -> tuple[bytes, Ed25519PrivateKey]:
    """The number of a key, and the key."""
    try:
        body = _decode(file.read_text("utf-8").splitlines()[1], _SECRET_BYTES)
    except OSError as error:
        raise InputError(f"cannot read {file}: {error.strerror or error}") from error
    except (ValueError, IndexError) as error:
        raise InputError(f"{file} is no secret key of minisign") from error
    if body[2:4] != _NO_PASSWORD:
        raise InputError(
            f"{file} has a password; sign with minisign itself: minisign -S -m DIR/{MANIFEST}"
        )
    number, seed, public = body[54:62], body[62:94], body[94:126]
    private: Ed25519PrivateKey = _load_library().Ed25519PrivateKey.from_private_bytes(seed)
    if private.public_key().public_bytes_raw() != public:
        raise InputError(f"{file} is a damaged key: its halves do not belong together")
    return number, private


def _read_public(key_or_file: str) -> tuple[bytes, Any]:
    """The number of a public key, and the key."""
    file = Path(key_or_file)
    try:
        text = file.read_text("utf-8").splitlines()[1] if file.is_file() else key_or_file
        body = _decode(text, _PUBLIC_BYTES)
    except (OSError, ValueError, IndexError) as error:
        reason = f"{key_or_file[:80]!r} is neither a public key of minisign nor a file of one"
        raise InputError(reason) from error
    return body[2:10], _load_library().Ed25519PublicKey.from_public_bytes(body[10:])


def _decode(text: str, length: int) -> bytes:
    """The bytes of a line of base64.

    Raises:
        ValueError: it is none, or of another length.
    """
    try:
        found = base64.b64decode(text.strip(), validate=True)
    except binascii.Error as error:
        raise ValueError(str(error)) from error
    if len(found) != length:
        raise ValueError(f"{len(found)} bytes instead of {length}")
    return found


def _format_lines(comment: str, body: bytes) -> bytes:
    return f"{_COMMENT}{comment}\n{base64.b64encode(body).decode()}\n".encode()


def _load_library() -> Any:
    require_extra("sign", "signing", "cryptography")
    from cryptography.hazmat.primitives.asymmetric import ed25519

    return ed25519
