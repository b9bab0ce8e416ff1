"""Check of a map file from an unknown source before any reader opens it.

Refused are document type declarations (with them entity bombs and references to other files) and
files that are not well-formed, too large, too deep, or no map. A file that passes declares no
entity, so that a reader with its own parser (netconvert) cannot be misled.
"""

from __future__ import annotations

import gzip
import stat
import zlib
from pathlib import Path
from typing import Literal

from scenewright.errors import InputError
from scenewright.extras import require_extra
from scenewright.tools.formats.xml import walk_xml

MapFormat = Literal["osm", "lanelet2", "opendrive", "sumo", "commonroad", "argoverse2", "womd"]

SUMO = ("maps", "importing a map of OpenStreetMap, OpenDRIVE or SUMO", "sumo", "sumolib", "osmium")
"""The extra by which these formats are read, for what, and its modules."""

MAX_BYTES = 200_000_000
MAX_UNPACKED = 600_000_000
"""Of a file packed with gzip, once unpacked [bytes]."""
MAX_ELEMENTS = 8_000_000
_BLOCK = 1 << 20
_ROOTS: dict[str, MapFormat] = {
    "osm": "osm", "OpenDRIVE": "opendrive", "net": "sumo", "commonRoad": "commonroad",
}  # fmt: skip
_SUPPORTED = (
    "OpenStreetMap .osm, Lanelet2 .osm, OpenDRIVE .xodr, SUMO .net.xml, CommonRoad .xml, "
    "Argoverse 2 .json or Waymo .tfrecord"
)


def detect_map_format(file: Path) -> MapFormat:
    """The format of a map file that is safe to read.

    Raises:
        InputError: missing, too large, not well-formed, declaring entities, or no map.
    """
    _check_size(file)
    if is_pbf(file):
        return "osm"
    if ".tfrecord" in file.name:
        return "womd"
    if file.suffix == ".json":
        return "argoverse2"
    scan = _Scan(file)
    try:
        with file.open("rb") as stream:
            walk_xml(stream, scan.start, name=str(file))
    except OSError as fault:
        raise InputError(f"cannot read {file}: {fault.strerror or fault}") from None
    if scan.format is None:
        raise InputError(f"{file} is no map that can be read: {_SUPPORTED}")
    return "lanelet2" if scan.has_lanelets else scan.format


def is_pbf(file: Path) -> bool:
    """Whether a file begins like an OpenStreetMap file of protocol buffers."""
    with file.open("rb") as stream:
        return b"OSMHeader" in stream.read(64)


def require_sumo(map_format: MapFormat) -> None:
    """Raise unless SUMO is there, by whose converter and library some formats are read.

    Raises:
        InputError: it is not; the line holds the command that installs it.
    """
    if map_format in ("osm", "opendrive", "sumo"):
        require_extra(*SUMO)


def unpack_map(file: Path, scratch: Path) -> Path:
    """The file, or its unpacked copy in an empty folder where it is packed with gzip.

    Raises:
        InputError: missing, damaged, or too large once unpacked.
    """
    _check_size(file)
    with file.open("rb") as stream:
        if stream.read(2) != _GZIP:
            return file
    target = scratch / (file.stem or "map")
    total = 0
    try:
        with gzip.open(file) as packed, target.open("wb") as out:
            while block := packed.read(_BLOCK):
                total += len(block)
                if total > MAX_UNPACKED:
                    raise InputError(
                        f"{file} has more than {MAX_UNPACKED / 1e6:.0f} MB once unpacked; cut out "
                        "the surroundings of the junction first"
                    )
                out.write(block)
    except (EOFError, zlib.error, gzip.BadGzipFile):
        raise InputError(f"{file} is a damaged gzip file; is it cut off?") from None
    return target


_GZIP = b"\x1f\x8b"


def _check_size(file: Path) -> None:
    try:
        found = file.stat()
    except (OSError, ValueError) as fault:
        raise InputError(f"cannot read {file}: {getattr(fault, 'strerror', fault)}") from None
    if not stat.S_ISREG(found.st_mode):
        raise InputError(f"cannot read {file}: it is no file")
    most = MAX_UNPACKED if file.suffix in (".osm", ".pbf") else MAX_BYTES
    if found.st_size > most:
        raise InputError(
            f"{file} has {found.st_size / 1e6:.0f} MB, a map may have {most / 1e6:.0f}; "
            "cut out the surroundings of the junction first"
        )


class _Scan:
    """What is met of a document, of which nothing is kept."""

    def __init__(self, file: Path) -> None:
        self.file = file
        self.format: MapFormat | None = None
        self.has_lanelets = False
        self._elements = 0

    def start(self, name: str, attributes: dict[str, str]) -> None:
        """Takes an element; the first one says what the document is."""
        self._elements += 1
        self.format = self.format or _ROOTS.get(name)
        if self.format is None:
            raise InputError(
                f"{self.file} begins with <{name[:40]}>, so it is none of {_SUPPORTED}"
            )
        if self._elements > MAX_ELEMENTS:
            raise InputError(f"{self.file} has more elements than a map has")
        if name == "tag" and attributes.get("k") == "type" and attributes.get("v") == "lanelet":
            self.has_lanelets = True
