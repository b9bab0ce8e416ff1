"""Maps of real junctions in: SUMO, OpenStreetMap, OpenDRIVE and Lanelet2 files (SEMANTICS 2).

`vetting` reads a stranger's file once and harmlessly, `sumo_net` and `lanelet2` make a `survey` of
one junction of it, `legs` names its arms, `areas` derives the ground, `lights` the signals, and
`assemble` puts the map together and says what was assumed.
"""

from __future__ import annotations

import tempfile
from dataclasses import dataclass
from pathlib import Path

from scenewright.tools.map_import.assemble import Assembled, assemble
from scenewright.tools.map_import.survey import Survey
from scenewright.tools.map_import.vetting import MapFormat, vetted_format

__all__ = ["Assembled", "Imported", "MapFormat", "import_map"]


@dataclass(frozen=True, eq=False)
class Imported:
    """An imported map: what was assembled, from what kind of file, and where it lies.

    Attributes:
        origin: latitude and longitude of the map's origin [deg]; None where the file has none.
        offset: of the origin in the coordinates of the file [m].
    """

    assembled: Assembled
    kind: MapFormat
    origin: tuple[float, float] | None
    offset: tuple[float, float]


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
) -> Imported:
    """The map of one junction of a file.

    Args:
        center: latitude and longitude of the junction, or x and y where the file has no degrees.
        junction: its id in the file.
        left_hand: whether traffic drives on the left; None takes the file's word.
        signals: `keep`, `assume` or `none`.

    Raises:
        InputError: the file cannot be read, or no junction is chosen; one line says why.
    """
    path = Path(file)
    kind = vetted_format(path)
    with tempfile.TemporaryDirectory() as scratch:
        survey = _survey(
            path, kind, Path(scratch), center=center, junction=junction, left_hand=left_hand
        )
    assembled = assemble(survey, name=name, extent=extent, title=title, signals=signals)
    return Imported(assembled, kind, survey.origin, survey.offset)


def _survey(
    path: Path,
    kind: MapFormat,
    scratch: Path,
    *,
    center: tuple[float, float] | None,
    junction: str | None,
    left_hand: bool | None,
) -> Survey:
    if kind == "lanelet2":
        from scenewright.tools.map_import.lanelet2 import read_lanelet2

        return read_lanelet2(path, center=center, left_hand=bool(left_hand))
    from scenewright.tools.map_import.sumo_net import read_sumo

    return read_sumo(path, kind, scratch, center=center, junction=junction, left_hand=left_hand)
