"""Maps of real junctions from SUMO, OpenStreetMap, OpenDRIVE and Lanelet2 files (SEMANTICS 2).

`check_file` makes sure that a file is safe to read, `read_sumo` and `survey_lanes` list its
junctions and make a `survey` of the one that `junction_choice` chooses, `legs` names its arms,
`ground_areas` derives the ground, `signal_programs` the signals, and `assemble` builds the map and
reports what was assumed.
"""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from pathlib import Path

from scenewright.tools.map_import.assemble import ImportedMap, assemble_map
from scenewright.tools.map_import.check_file import (
    MapFormat,
    detect_map_format,
    require_sumo,
    unpack_map,
)
from scenewright.tools.map_import.junction_choice import (
    Junction,
    JunctionOverview,
    choose_junction,
)
from scenewright.tools.map_import.survey import DrivingSide

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
        held = _read_map(path, map_format, Path(scratch), center, left_hand)
        chosen = choose_junction(
            held.junctions, file=path, center=center, junction=junction, streets=streets
        )
        survey = held.survey(chosen)
    return assemble_map(survey, map_format, name=name, extent=extent, title=title, signals=signals)


def list_junctions(file: str | Path) -> JunctionOverview:
    """The junctions of a file, with legs, streets and places, and its roads to draw them on.

    Raises:
        InputError: the file cannot be read; one line says why.
    """
    with tempfile.TemporaryDirectory() as scratch:
        path = unpack_map(Path(file), Path(scratch))
        return _read_map(path, detect_map_format(path), Path(scratch))


def _read_map(
    path: Path,
    map_format: MapFormat,
    scratch: Path,
    center: tuple[float, float] | None = None,
    left_hand: bool | None = None,
) -> JunctionOverview:
    """The junctions of a file, each of which can be surveyed; scratch: a folder for copies."""
    side = None if left_hand is None else DrivingSide(left_hand, "as asked")
    # Each reader is loaded on demand: they need libraries that the others do not.
    if map_format in ("osm", "opendrive", "sumo"):
        from scenewright.tools.map_import.read_sumo import read_osm, read_streets

        if map_format == "osm":
            return read_osm(path, scratch, side)
        return read_streets(path, map_format, scratch, side)
    from scenewright.tools.map_import.read_lane_maps import load_lane_map
    from scenewright.tools.map_import.read_lanelet2 import load_lanelet2
    from scenewright.tools.map_import.survey_lanes import read_lanes

    is_lanelet2 = map_format == "lanelet2"
    held = load_lanelet2(path, center) if is_lanelet2 else load_lane_map(path, map_format)
    return read_lanes(held, side)
