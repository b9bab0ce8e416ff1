"""Map files are strangers' XML: they are read once, harmlessly, before any reader sees them.

Refused: document type declarations (with them entity bombs and references to other files), files
that are not well-formed, that are too large or too deep, or that are no map at all. What passes
declares no entity, so that a reader with a parser of its own (netconvert) cannot be led astray.
"""

from __future__ import annotations

import stat
from pathlib import Path
from typing import Any, Literal
from xml.parsers import expat

from scenewright.errors import InputError

MapFormat = Literal["osm", "lanelet2", "opendrive", "sumo"]

MOST_BYTES = 100_000_000
MOST_ELEMENTS = 3_000_000
DEEPEST = 64
_CHUNK = 1 << 20
_ROOTS: dict[str, MapFormat] = {"osm": "osm", "OpenDRIVE": "opendrive", "net": "sumo"}
_WANTED = "OpenStreetMap .osm, Lanelet2 .osm, OpenDRIVE .xodr or SUMO .net.xml"


def vetted_format(file: Path) -> MapFormat:
    """Which kind of map a file holds.

    Raises:
        InputError: missing, too large, not well-formed, declaring entities, or no map.
    """
    size = _size(file)
    if size > MOST_BYTES:
        raise InputError(
            f"{file} has {size / 1e6:.0f} MB, a map may have {MOST_BYTES / 1e6:.0f}; "
            "cut out the surroundings of the junction first"
        )
    watcher = _Watcher(file)
    parser = watcher.parser()
    try:
        with file.open("rb") as stream:
            while block := stream.read(_CHUNK):
                parser.Parse(block, False)
        parser.Parse(b"", True)
    except expat.ExpatError as fault:
        raise InputError(
            f"{file} is not well-formed XML ({expat.ErrorString(fault.code)}, line {fault.lineno});"
            " is it cut off?"
        ) from None
    except OSError as fault:
        raise InputError(f"cannot read {file}: {fault.strerror or fault}") from None
    if watcher.format is None:
        raise InputError(f"{file} is no map that can be read: {_WANTED}")
    return "lanelet2" if watcher.lanelets else watcher.format


def _size(file: Path) -> int:
    try:
        found = file.stat()
    except (OSError, ValueError) as fault:
        raise InputError(f"cannot read {file}: {getattr(fault, 'strerror', fault)}") from None
    if not stat.S_ISREG(found.st_mode):
        raise InputError(f"cannot read {file}: it is no file")
    return found.st_size


class _Watcher:
    """What is seen of a document while it goes by."""

    def __init__(self, file: Path) -> None:
        self.file = file
        self.format: MapFormat | None = None
        self.lanelets = False
        self._elements = self._depth = 0

    def parser(self) -> Any:
        made: Any = expat.ParserCreate()
        made.StartElementHandler = self._start
        made.EndElementHandler = self._end
        made.StartDoctypeDeclHandler = self._refuse
        made.EntityDeclHandler = self._refuse
        made.ExternalEntityRefHandler = self._refuse
        return made

    def _start(self, name: str, attributes: dict[str, str]) -> None:
        self._elements += 1
        self._depth += 1
        if self._depth == 1:
            self.format = _ROOTS.get(name)
            if self.format is None:
                raise InputError(
                    f"{self.file} begins with <{name[:40]}>, so it is none of {_WANTED}"
                )
        if self._elements > MOST_ELEMENTS or self._depth > DEEPEST:
            raise InputError(f"{self.file} has more elements, or deeper ones, than a map has")
        if name == "tag" and attributes.get("k") == "type" and attributes.get("v") == "lanelet":
            self.lanelets = True

    def _end(self, _name: str) -> None:
        self._depth -= 1

    def _refuse(self, *_: object) -> None:
        raise InputError(
            f"{self.file} declares a document type or entities, which no map needs; "
            "remove the <!DOCTYPE ...> if you trust the file"
        )
