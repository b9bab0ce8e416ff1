"""Map files that were dropped on the page, and the intersections that become of them."""

from __future__ import annotations

import hashlib
import re
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from scenewright.cli.options import ImportOptions
from scenewright.cli.page.routes import Upload
from scenewright.errors import InputError
from scenewright.files import write_atomically

MOST_MAP_BYTES = 100_000_000
_ENDING = re.compile(r"\.(osm|xodr|net\.xml|xml)$", re.IGNORECASE)


class OwnMaps:
    """Uploaded files, each kept under its SHA-256 until the page is served anew."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._lock = threading.Lock()

    def list_answers(self) -> dict[str, Callable[..., Any]]:
        """Every address of one's own maps."""
        return {"POST /api/maps": self.keep, "POST /api/maps/{map}/import": self.import_junction}

    def keep(
        self,
        data: Annotated[bytes, Upload(MOST_MAP_BYTES, "application/octet-stream")],
        name: str = "",
    ) -> dict[str, Any]:
        """Keeps the map file that is the request's body; its junctions and roads [m].

        Raises:
            InputError: it is no map that can be read.
        """
        from scenewright.tools.map_import import list_junctions
        from scenewright.tools.map_import.check_file import detect_map_format, require_sumo

        found = _ENDING.search(name)
        if found is None:
            raise InputError("a map is OpenStreetMap or Lanelet2 .osm, OpenDRIVE .xodr or .net.xml")
        self._folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        digest = hashlib.sha256(data).hexdigest()[:16]
        path = self._folder / f"{digest}{found[0].lower()}"
        write_atomically(path, data)
        try:
            require_sumo(detect_map_format(path))  # not first when a junction is chosen and named
            with self._lock:  # one conversion at a time: each may take a minute
                overview = list_junctions(path)
        except InputError as error:
            path.unlink(missing_ok=True)
            raise InputError(str(error).replace(str(path), name[-80:])) from None
        return {
            "map": path.name,
            "suggested": _ENDING.sub("", name)[:40] or "mine",
            "junctions": [
                {"id": junction.id, "xy": junction.xy, "legs": junction.legs, "name": junction.name}
                for junction in overview.junctions
            ],
            "roads": [np.round(road, 1).tolist() for road in overview.roads],
        }

    def import_junction(self, map: str, asked: ImportOptions) -> dict[str, Any]:
        """Makes an intersection of a junction of a file; what was made and assumed, in lines.

        Raises:
            InputError: the file, the junction or an option cannot be used.
        """
        from scenewright.cli.custom_intersections import import_file, import_text

        path = self._folder / map
        if not re.fullmatch(r"[0-9a-f]{16}\.[a-z.]+", map) or not path.is_file():
            raise InputError("this file is not here any more; drop it again")
        with self._lock:
            facts = import_file(str(path), asked, log=lambda _stage, _line: None)
        return {"name": facts["name"], "lines": import_text(facts)}
