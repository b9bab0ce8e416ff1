"""Which formats there are, the module of each, and what it writes and reads."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib import import_module
from pathlib import PurePath
from typing import Any

from scenewright.errors import InputError
from scenewright.extras import require_extra
from scenewright.tools.formats.exported_scene import ExportedScene
from scenewright.tools.formats.sampled_recording import SampledRecording

DATABASE_FILES = ("dataset_summary.pkl", "dataset_mapping.pkl")
"""What lists the scenarios of a ScenarioNet database and holds no tracks."""


@dataclass(frozen=True)
class Format:
    """One format.

    Attributes:
        title: what it is, in a few words.
        module: below this room; writer: its function (scene) -> file name -> bytes.
        index: its function that writes what belongs to all scenes of a folder, if any.
        forms: forms in which a scene can be written; the first is the usual one.
        packages: of the extra `exports`, needed by this format alone.
        reader: its function (bytes, name) -> scenarios; None where tracks are not read.
        files: how the names of files end that it reads, as a pattern.
    """

    title: str
    module: str
    writer: str
    index: str | None = None
    forms: tuple[str, ...] = ("replay",)
    packages: tuple[str, ...] = ()
    reader: str | None = None
    files: str = ""

    def load(self, function: str) -> Callable[..., Any]:
        """A function of the format's module."""
        return getattr(import_module(f"{__package__}.{self.module}"), function)  # type: ignore[no-any-return]


FORMATS: dict[str, Format] = {
    "csv": Format(
        "table of tracks, as `verify` reads it", "csv_tracks", "write_csv",
        reader="read_csv", files=r"\.csv",
    ),
    "trajnet": Format(
        "TrajNet++ ndjson, 2.5 Hz", "trajnet", "write_trajnet", reader="read_trajnet",
        files=r"\.ndjson",
    ),
    "fcd": Format(
        "SUMO floating car data", "fcd", "write_fcd", reader="read_fcd", files=r"\.xml"
    ),
    "openscenario": Format(
        "OpenSCENARIO 1.2 with OpenDRIVE", "openscenario", "write_openscenario",
        forms=("replay", "reactive"), reader="read_openscenario", files=r"\.xosc",
    ),
    "osc-dsl": Format("OpenSCENARIO DSL 2.1, what was asked for", "osc_dsl", "write_constraints"),
    "scenarionet": Format(
        "ScenarioNet pickles, for MetaDrive", "scenarionet", "write_scenarionet",
        "write_summaries", reader="read_scenarionet", files=r"\.pkl",
    ),
    "commonroad": Format(
        "CommonRoad XML 2020a", "commonroad", "write_commonroad", reader="read_commonroad",
        files=r"\.xml",
    ),
    "womd": Format(
        "Waymo Motion records", "womd", "write_womd", forms=("window", "whole", "example"),
        reader="read_womd", files=r"\.tfrecord(-\d+-of-\d+)?",
    ),
    "wosac": Format("Waymo Sim Agents rollouts", "wosac", "write_joint_scene", "write_submission"),
    "argoverse2": Format(
        "Argoverse 2 Parquet and map JSON", "argoverse2", "write_argoverse2",
        forms=("window", "whole"), packages=("pyarrow",), reader="read_argoverse2",
        files=r"\.parquet",
    ),
    "osi": Format(
        "ASAM OSI ground truth in MCAP", "osi", "write_osi", packages=("mcap",),
        reader="read_osi", files=r"\.mcap",
    ),
    "foxglove": Format(
        "Foxglove scene in MCAP, to look at", "foxglove", "write_foxglove", packages=("mcap",)
    ),
}  # fmt: skip
"""By the name that `--to` takes."""


def find_format(name: str) -> Format:
    """The format of that name; InputError, listing all, where there is none."""
    if name not in FORMATS:
        raise InputError(f"no format {name[:40]!r}; there are: {', '.join(FORMATS)}")
    return FORMATS[name]


def write_scene(scene: ExportedScene, name: str, *, form: str | None = None) -> dict[str, bytes]:
    """The files of a scene in a format: path below the output folder -> content.

    Raises:
        InputError: no such format or form, or a package of the extra is missing.
    """
    chosen = find_format(name)
    form = form or chosen.forms[0]
    if form not in chosen.forms:
        raise InputError(f"{name} has no form {form[:40]!r}; it has: {', '.join(chosen.forms)}")
    require_extra("exports", name, *chosen.packages)
    more = {"form": form} if len(chosen.forms) > 1 else {}
    files: dict[str, bytes] = chosen.load(chosen.writer)(scene, **more)
    return files


def write_index(scenes: Sequence[ExportedScene], name: str) -> dict[str, bytes]:
    """The files that belong to a folder of scenes in a format; most formats have none."""
    chosen = find_format(name)
    if chosen.index is None:
        return {}
    files: dict[str, bytes] = chosen.load(chosen.index)(scenes)
    return files


def find_reader(name: str, data: bytes = b"") -> Format | None:
    """The format that reads a file of tracks; None where there is none.

    Args:
        data: the content, which tells formats apart whose names end alike.
    """
    file = PurePath(name).name.lower()
    found = [each for each in FORMATS.values() if each.reader and re.search(f"{each.files}$", file)]
    return found[-1] if b"<commonRoad" in data[:100_000] else next(iter(found), None)


def read_scenarios(data: bytes, *, name: str, **options: Any) -> list[SampledRecording]:
    """The scenarios of a file, with options of its reader.

    Raises:
        InputError: no known kind of file, or nothing in it that can be read.
    """
    chosen = find_reader(name, data)
    if chosen is None or chosen.reader is None:
        raise InputError(
            f"{name} is of no kind that can be read; tracks are read from .csv, .ndjson and the "
            "files of simulators and data sets (docs/formats.md)"
        )
    require_extra("exports", f"reading {name}", *chosen.packages)
    recordings: list[SampledRecording] = chosen.load(chosen.reader)(data, name=name, **options)
    if not any(each.agents for each in recordings):
        raise InputError(f"{name} holds no tracks of road users")
    return recordings
