"""Map files that were dropped on the page, and the intersections that become of them."""

from __future__ import annotations

import hashlib
import re
import threading
from pathlib import Path
from typing import Any

import numpy as np
from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.routing import Route

from scenewright.cli.page.answers import answer_safely, read_bytes, read_model
from scenewright.cli.page.schema import JunctionChoice
from scenewright.errors import InputError
from scenewright.files import write_atomically

MOST_MAP_BYTES = 100_000_000
_ENDING = re.compile(r"\.(osm|xodr|net\.xml|xml)$", re.IGNORECASE)


class OwnMaps:
    """Uploaded files, each kept under its SHA-256 until the page is served anew."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._lock = threading.Lock()

    def list_routes(self) -> list[Route]:
        """Every address of one's own maps."""
        post = ["POST"]
        return [
            Route("/api/maps", answer_safely(self.answer_file), methods=post),
            Route("/api/maps/{map}/import", answer_safely(self.answer_import), methods=post),
        ]

    async def answer_file(self, request: Request) -> Response:
        """Keeps the map file that is the request's body; its junctions and roads [m]."""
        body = await read_bytes(request, MOST_MAP_BYTES)
        name = request.query_params.get("name", "")
        return JSONResponse(await run_in_threadpool(self.keep, name, body))

    async def answer_import(self, request: Request) -> Response:
        """Makes an intersection of a junction: {"name", "junction"?, "side"?, "signals"?}."""
        asked = await read_model(request, JunctionChoice)
        name = request.path_params["map"]
        return JSONResponse(await run_in_threadpool(self.import_junction, name, asked))

    def keep(self, name: str, data: bytes) -> dict[str, Any]:
        """Keeps a file and lists what can be chosen from it.

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
                {"id": each.id, "xy": each.xy, "legs": each.legs, "name": each.name}
                for each in overview.junctions
            ],
            "roads": [np.round(road, 1).tolist() for road in overview.roads],
        }

    def import_junction(self, name_of_file: str, asked: JunctionChoice) -> dict[str, Any]:
        """Makes an intersection; what was made and assumed, in lines.

        Raises:
            InputError: the file, the junction or an option cannot be used.
        """
        from scenewright.cli.custom_intersections import import_file, import_text
        from scenewright.cli.options import ImportOptions

        path = self._folder / name_of_file
        if not re.fullmatch(r"[0-9a-f]{16}\.[a-z.]+", name_of_file) or not path.is_file():
            raise InputError("this file is not here any more; drop it again")
        options = ImportOptions(
            name=asked.name, junction=asked.junction or None, signals=asked.signals or "keep",
            left_hand=None if not asked.side else asked.side == "left",
        )  # fmt: skip
        with self._lock:
            facts = import_file(str(path), options, log=lambda _stage, _line: None)
        return {"name": facts["name"], "lines": import_text(facts)}
