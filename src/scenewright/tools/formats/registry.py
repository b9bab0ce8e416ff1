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
        module: below this room, with `write` (scene) -> file name -> bytes, perhaps in a `form`.
        files: how the names of files end that its `read` (bytes, name) -> scenarios reads, as a
            pattern; empty where it has none.
        forms: forms in which a scene can be written; the first is the usual one.
        packages: of the extra `exports`, needed by this format alone.
        index: whether its `write_index` writes what belongs to all scenes of a folder.
    """

    title: str
    module: str
    files: str = ""
    forms: tuple[str, ...] = ("replay",)
    packages: tuple[str, ...] = ()
    index: bool = False

    def load(self, function: str) -> Callable[..., Any]:
        """A function of the format's module."""
        return getattr(import_module(f"{__package__}.{self.module}"), function)  # type: ignore[no-any-return]


_PARTS = ("window", "whole")
FORMATS: dict[str, Format] = {
    "csv": Format("table of tracks, as `verify` reads it", "csv_tracks", r"\.csv"),
    "trajnet": Format("TrajNet++ ndjson, 2.5 Hz", "trajnet", r"\.ndjson"),
    "fcd": Format("SUMO floating car data", "fcd", r"\.xml"),
    "openscenario": Format(
        "OpenSCENARIO 1.2 with OpenDRIVE", "openscenario", r"\.xosc", ("replay", "reactive")
    ),
    "osc-dsl": Format("OpenSCENARIO DSL 2.1, what was asked for", "osc_dsl"),
    "scenarionet": Format(
        "ScenarioNet pickles, for MetaDrive", "scenarionet", r"\.pkl", index=True
    ),
    "commonroad": Format("CommonRoad XML 2020a", "commonroad", r"\.xml"),
    "womd": Format(
        "Waymo Motion records", "womd", r"\.tfrecord(-\d+-of-\d+)?", (*_PARTS, "example")
    ),
    "wosac": Format("Waymo Sim Agents rollouts", "wosac", index=True),
    "argoverse2": Format(
        "Argoverse 2 Parquet and map JSON", "argoverse2", r"\.parquet", _PARTS, ("pyarrow",)
    ),
    "osi": Format("ASAM OSI ground truth in MCAP", "osi", r"\.mcap", packages=("mcap",)),
    "foxglove": Format("Foxglove scene in MCAP, to look at", "foxglove", packages=("mcap",)),
}
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
    files: dict[str, bytes] = chosen.load("write")(scene, **more)
    return files


def write_index(scenes: Sequence[ExportedScene], name: str) -> dict[str, bytes]:
    """The files that belong to a folder of scenes in a format; most formats have none."""
    chosen = find_format(name)
    files: dict[str, bytes] = chosen.load("write_index")(scenes) if chosen.index else {}
    return files


def find_reader(name: str, data: bytes = b"") -> Format | None:
    """The format that reads a file of tracks; None where there is none.

    Args:
        data: the content, which tells formats apart whose names end alike.
    """
    file = PurePath(name).name.lower()
    readers = [
        reader
        for reader in FORMATS.values()
        if reader.files and re.search(f"{reader.files}$", file)
    ]
    if not readers:
        return None
    return readers[-1] if b"<commonRoad" in data[:100_000] else readers[0]


def read_scenarios(data: bytes, *, name: str, **options: Any) -> list[SampledRecording]:
    """The scenarios of a file, with options of its reader.

    Raises:
        InputError: no known kind of file, or nothing in it that can be read.
    """
    chosen = find_reader(name, data)
    if chosen is None:
        raise InputError(
            f"{name} is of no kind that can be read; tracks are read from .csv, .ndjson and the "
            "files of simulators and data sets (docs/formats.md)"
        )
    require_extra("exports", f"reading {name}", *chosen.packages)
    recordings: list[SampledRecording] = chosen.load("read")(data, name=name, **options)
    if not any(recording.agents for recording in recordings):
        raise InputError(f"{name} holds no tracks of road users")
    return recordings
