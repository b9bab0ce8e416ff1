"""TFRecord files: records with their lengths and masked CRC32C checksums."""

from __future__ import annotations

import struct
from collections.abc import Iterable, Iterator

import numpy as np
from numpy.typing import NDArray

from scenewright.compiled import compiled
from scenewright.errors import InputError

_POLYNOMIAL = 0x82F63B78
_MASK = 0xA282EAD8
_TABLE: NDArray[np.uint32] = np.arange(256, dtype=np.uint32)
"""[256] remainders by byte."""
for _ in range(8):
    _TABLE = np.where(_TABLE & 1, (_TABLE >> 1) ^ np.uint32(_POLYNOMIAL), _TABLE >> 1)


def write_records(records: Iterable[bytes]) -> bytes:
    """The records as the content of a TFRecord file."""
    parts: list[bytes] = []
    for record in records:
        for part in (struct.pack("<Q", len(record)), record):
            parts += [part, struct.pack("<I", compute_masked_crc(part))]
    return b"".join(parts)


def read_records(data: bytes, *, name: str) -> Iterator[bytes]:
    """The records of a TFRecord file.

    Raises:
        InputError: cut off, or a checksum does not hold.
    """
    at, number = 0, 0
    while at < len(data):
        head, at = data[at : at + 12], at + 12
        if len(head) < 12 or struct.unpack("<I", head[8:])[0] != compute_masked_crc(head[:8]):
            raise InputError(f"{name}, record {number}: no TFRecord, or damaged")
        (length,) = struct.unpack("<Q", head[:8])
        record, tail = data[at : at + length], data[at + length : at + length + 4]
        if len(record) < length or len(tail) < 4:
            raise InputError(f"{name}, record {number}: the file is cut off")
        if struct.unpack("<I", tail)[0] != compute_masked_crc(record):
            raise InputError(f"{name}, record {number}: its checksum does not hold")
        yield record
        at, number = at + length + 4, number + 1


def compute_masked_crc(data: bytes) -> int:
    """CRC32C of the bytes (Castagnoli), rotated and shifted as TFRecord has it."""
    crc = int(_compute_crc32c(_TABLE, np.frombuffer(data, np.uint8)))
    return ((crc >> 15 | crc << 17) + _MASK) & 0xFFFFFFFF


@compiled
def _compute_crc32c(table: NDArray[np.uint32], data: NDArray[np.uint8]) -> int:
    crc = 0xFFFFFFFF
    for byte in data:
        crc = table[(crc ^ byte) & 0xFF] ^ (crc >> 8)
    return crc ^ 0xFFFFFFFF
