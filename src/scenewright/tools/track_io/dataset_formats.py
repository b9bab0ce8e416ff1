"""Published data sets of recorded tracks whose files are CSV: their names and columns.

SinD and INTERACTION keep vehicles and pedestrians in files of their own, DUT as well; Argoverse 1
has one file for each sequence. Frames of DUT are 1/23.98 s apart.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from scenewright.errors import InputError

TIMED = {"t": "timestamp_ms/1000", "id": "track_id", "class": "agent_type", "x": "x", "y": "y"}
_DUT = {"t": "frame/23.98", "id": "id", "x": "x_est", "y": "y_est"}
_ARGOVERSE = {"t": "TIMESTAMP", "id": "TRACK_ID", "class": "OBJECT_TYPE", "x": "X", "y": "Y"}


@dataclass(frozen=True)
class DatasetFormat:
    """How the files of a data set are called, and their columns by our names.

    Attributes:
        files: (how a name ends or begins, columns), for every class.
        partners: parts of names of vehicles' files, and what pedestrians' have instead.
    """

    name: str
    files: tuple[tuple[str, Mapping[str, str]], ...]
    partners: tuple[str, str] | None = None

    def find_columns(self, file: Path) -> Mapping[str, str] | None:
        """The columns of a file of the set; None if it is called otherwise."""
        return next((columns for glob, columns in self.files if file.match(glob)), None)


FORMATS: Mapping[str, DatasetFormat] = {
    each.name: each
    for each in (
        DatasetFormat(
            "sind",
            (("Veh_smoothed_tracks*.csv", TIMED), ("Ped_smoothed_tracks*.csv", TIMED)),
            ("Veh_", "Ped_"),
        ),
        DatasetFormat(
            "interaction",
            (("vehicle_tracks_*.csv", TIMED), ("pedestrian_tracks_*.csv", TIMED)),
            ("vehicle_tracks_", "pedestrian_tracks_"),
        ),
        DatasetFormat(
            "dut",
            (
                ("*_traj_veh_filtered.csv", {**_DUT, "class": "=car"}),
                ("*_traj_ped_filtered.csv", {**_DUT, "class": "=pedestrian"}),
            ),
            ("_traj_veh_", "_traj_ped_"),
        ),
        DatasetFormat("argoverse1", (("*.csv", _ARGOVERSE),)),
    )
}
READ_ELSEWHERE = ("taf-bw", "ind", "argoverse2", "womd", "trajnet", "fcd", "commonroad")
"""Formats that are known by the names or the content of their files."""
PATTERNS = (
    "Veh_smoothed_tracks*.csv", "Ped_smoothed_tracks*.csv", "pedestrian_tracks_*.csv",
    "*_traj_veh_filtered.csv", "*_traj_ped_filtered.csv",
)  # fmt: skip
"""Names of files that no reader but this one knows."""


def get_format(name: str) -> DatasetFormat | None:
    """The format of a name; None for those that need no name.

    Raises:
        InputError: no format is called so.
    """
    key = name.lower().replace(" ", "").replace("-style", "")
    if key in READ_ELSEWHERE:
        return None
    if key not in FORMATS:
        known = ", ".join(sorted((*FORMATS, *READ_ELSEWHERE)))
        raise InputError(f"no format of tracks is called {name[:40]!r}; there are {known}")
    return FORMATS[key]


def find_columns(file: Path, named: DatasetFormat | None) -> Mapping[str, str] | None:
    """The columns of a file by the format that is named, else by the file's name."""
    if named is not None:
        columns = named.find_columns(file)
        if columns is None:
            wanted = ", ".join(glob for glob, _ in named.files)
            raise InputError(f"{file} is no file of {named.name}: they are called {wanted}")
        return columns
    own = (FORMATS[name].find_columns(file) for name in ("sind", "dut"))
    walked = TIMED if file.match("pedestrian_tracks_*.csv") else None
    return next((each for each in own if each is not None), walked)


def find_partner(file: Path) -> Path | None:
    """The file of the pedestrians beside one of vehicles, if there is one."""
    for each in FORMATS.values():
        if each.partners is not None and each.partners[0] in file.name:
            partner = file.with_name(file.name.replace(*each.partners))
            if partner.is_file():
                return partner
    return None
