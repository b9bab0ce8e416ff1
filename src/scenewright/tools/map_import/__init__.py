"""Maps of real junctions from SUMO, OpenStreetMap, OpenDRIVE and Lanelet2 files (SEMANTICS 2).

`check_file` makes sure that a file is safe to read, `read_sumo` and `read_lanelet2` make a `survey`
of one junction of it, `legs` names its arms, `ground_areas` derives the ground, `signal_programs`
the signals, and `assemble` builds the map and reports what was assumed.
"""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from scenewright.tools.map_import.assemble import ImportedMap, assemble_map
from scenewright.tools.map_import.check_file import (
    MapFormat,
    detect_map_format,
    require_sumo,
    unpack_map,
)
from scenewright.tools.map_import.junction_choice import Junction, JunctionOverview
from scenewright.tools.map_import.osm_streets import survey_osm_junctions

if TYPE_CHECKING:
    from scenewright.tools.map_import.read_lanelet2 import LaneletFile

__all__ = [
    "ImportedMap",
    "Junction",
    "JunctionOverview",
    "MapFormat",
    "import_map",
    "list_junctions",
]


def import_map(
    file: str | Path,
    *,
    name: str,
    center: tuple[float, float] | None = None,
    junction: str | None = None,
    left_hand: bool | None = None,
    extent: float | None = None,
    title: str | None = None,
    signals: str = "keep",
    streets: Sequence[str] = (),
) -> ImportedMap:
    """The map of one junction of a file.

    Args:
        center: latitude and longitude of the junction, or x and y where the file has no degrees.
        junction: its id in the file.
        left_hand: whether traffic drives on the left; None is as the file says.
        extent: half the side of the square that the map covers [m]; None takes what it needs.
        signals: `keep`, `assume` or `none`.
        streets: names that the junction's streets bear.

    Raises:
        InputError: the file cannot be read, or no junction is chosen; one line says why.
    """
    with tempfile.TemporaryDirectory() as scratch:
        path = unpack_map(Path(file), Path(scratch))
        map_format = detect_map_format(path)
        require_sumo(map_format)
        # Each reader is loaded on demand: they need libraries that the others do not.
        chosen: dict[str, Any] = {"center": center, "junction": junction, "streets": streets}
        if (held := _load_lanes(path, map_format, center)) is not None:
            from scenewright.tools.map_import.read_lanelet2 import survey_lanelets

            survey = survey_lanelets(held, **chosen, left_hand=left_hand)
        else:
            from scenewright.tools.map_import.read_sumo import read_sumo

            survey = read_sumo(path, map_format, Path(scratch), **chosen, left_hand=left_hand)
    return assemble_map(survey, map_format, name=name, extent=extent, title=title, signals=signals)


def list_junctions(file: str | Path) -> JunctionOverview:
    """The junctions of a file, with legs, streets and places, and its roads to draw them on.

    Raises:
        InputError: the file cannot be read; one line says why.
    """
    with tempfile.TemporaryDirectory() as scratch:
        path = unpack_map(Path(file), Path(scratch))
        map_format = detect_map_format(path)
        if map_format == "osm":
            return survey_osm_junctions(path)
        if (held := _load_lanes(path, map_format)) is not None:
            from scenewright.tools.map_import.read_lanelet2 import list_lanelet_junctions

            return list_lanelet_junctions(held)
        from scenewright.tools.map_import.read_sumo import survey_junctions

        return survey_junctions(path, map_format, Path(scratch))


def _load_lanes(
    path: Path, map_format: MapFormat, center: tuple[float, float] | None = None
) -> LaneletFile | None:
    """The lanes of a file that draws each by itself; None for files of streets."""
    if map_format == "lanelet2":
        from scenewright.tools.map_import.read_lanelet2 import load_lanelet2

        return load_lanelet2(path, center)
    if map_format in ("commonroad", "argoverse2", "womd"):
        from scenewright.tools.map_import.read_lane_maps import load_lane_map

        return load_lane_map(path, map_format)
    return None
