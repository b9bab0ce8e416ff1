"""`scenewright intersections export`: the map of an intersection for other tools."""

from __future__ import annotations

from pathlib import Path

from scenewright.errors import InputError
from scenewright.files import write_atomically
from scenewright.intersections import find_bundle_folder, load_map, read_bundle_header


def write_map(name: str, out: str) -> None:
    """Writes the map as OpenDRIVE (.xodr) or Lanelet2 (.osm).

    Raises:
        InputError: no such intersection, another ending, or a file that cannot be written.
    """
    from scenewright.tools.exporters.lanelet2 import write_lanelet2
    from scenewright.tools.exporters.opendrive import write_opendrive

    place = load_map(name)
    match Path(out).suffix.lower():
        case ".xodr":
            data = write_opendrive(place)
        case ".osm":
            origin = read_bundle_header(find_bundle_folder(name)).get("frame", {}).get("origin")
            data = write_lanelet2(place, tuple(origin) if origin else None)
        case other:
            raise InputError(f"a map is written as .xodr or .osm, not {other or out!r}")
    write_atomically(out, data)
