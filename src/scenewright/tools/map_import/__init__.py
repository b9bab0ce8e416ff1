"""Maps of real junctions from SUMO, OpenStreetMap, OpenDRIVE and Lanelet2 files (SEMANTICS 2).

`check_file` makes sure that a file is safe to read, `read_sumo` and `read_lanelet2` make a `survey`
of one junction of it, `legs` names its arms, `ground_areas` derives the ground, `signal_programs`
the signals, and `assemble` builds the map and reports what was assumed. `four_leg_map` builds the
shipped map from measures; `map_parts` is what both have in common.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

from scenewright.tools.map_import.assemble import ImportedMap, assemble_map
from scenewright.tools.map_import.check_file import MapFormat, detect_map_format
from scenewright.tools.map_import.junction_choice import JunctionOverview

__all__ = ["ImportedMap", "JunctionOverview", "MapFormat", "import_map", "list_junctions"]


def list_junctions(file: str | Path) -> JunctionOverview:
    """The junctions of a file that one can be chosen from, and its roads; a Lanelet2 file has none.

    Raises:
        InputError: the file cannot be read; one line says why.
    """
    path = Path(file)
    map_format = detect_map_format(path)
    if map_format == "lanelet2":
        return JunctionOverview((), ())
    from scenewright.tools.map_import.read_sumo import survey_junctions

    with tempfile.TemporaryDirectory() as scratch:
        return survey_junctions(path, map_format, Path(scratch))


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
) -> ImportedMap:
    """The map of one junction of a file.

    Args:
        center: latitude and longitude of the junction, or x and y where the file has no degrees.
        junction: its id in the file.
        left_hand: whether traffic drives on the left; None is as the file says.
        extent: half the side of the square that the map covers [m]; None takes what it needs.
        signals: `keep`, `assume` or `none`.

    Raises:
        InputError: the file cannot be read, or no junction is chosen; one line says why.
    """
    path = Path(file)
    map_format = detect_map_format(path)
    # Each reader is loaded on demand: they need libraries that the others do not.
    if map_format == "lanelet2":
        from scenewright.tools.map_import.read_lanelet2 import read_lanelet2

        survey = read_lanelet2(path, center=center, left_hand=bool(left_hand))
    else:
        from scenewright.tools.map_import.read_sumo import read_sumo

        with tempfile.TemporaryDirectory() as scratch:
            survey = read_sumo(
                path, map_format, Path(scratch), center=center, junction=junction,
                left_hand=left_hand,
            )  # fmt: skip
    return assemble_map(survey, map_format, name=name, extent=extent, title=title, signals=signals)
