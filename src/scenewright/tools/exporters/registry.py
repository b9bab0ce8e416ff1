"""Which formats there are, and the module that writes each."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import Any

from scenewright.errors import InputError
from scenewright.extras import require_extra
from scenewright.tools.exporters.exported_scene import ExportedScene

_HERE = "scenewright.tools.exporters"


@dataclass(frozen=True)
class Format:
    """One format.

    Attributes:
        title: what it is, in a few words.
        module, function: where its exporter is: (scene) -> file name -> bytes.
        index: function of that module that writes what belongs to all scenes of a folder, if any.
        forms: forms in which a scene can be written; the first is the usual one.
        packages: of the extra `exports`, needed by this format alone.
    """

    title: str
    module: str
    function: str
    index: str | None = None
    forms: tuple[str, ...] = ("replay",)
    packages: tuple[str, ...] = ()

    def load(self, function: str) -> Callable[..., Any]:
        """A function of the format's module."""
        return getattr(import_module(f"{_HERE}.{self.module}"), function)  # type: ignore[no-any-return]


FORMATS: dict[str, Format] = {
    "csv": Format("table of tracks, as `verify` reads it", "csv_tracks", "write_csv"),
    "trajnet": Format("TrajNet++ ndjson, 2.5 Hz", "trajnet", "write_trajnet"),
    "fcd": Format("SUMO floating car data", "fcd", "write_fcd"),
    "openscenario": Format(
        "OpenSCENARIO 1.2 with OpenDRIVE",
        "openscenario",
        "write_openscenario",
        forms=("replay", "reactive"),
    ),
    "osc-dsl": Format("OpenSCENARIO DSL 2.1, what was asked for", "osc_dsl", "write_constraints"),
    "scenarionet": Format(
        "ScenarioNet pickles, for MetaDrive", "scenarionet", "write_scenarionet", "write_summaries"
    ),
    "commonroad": Format("CommonRoad XML 2020a", "commonroad", "write_commonroad"),
    "womd": Format(
        "Waymo Motion records", "womd", "write_womd", forms=("window", "whole", "example")
    ),
    "wosac": Format("Waymo Sim Agents rollouts", "wosac", "write_joint_scene", "write_submission"),
    "argoverse2": Format(
        "Argoverse 2 Parquet and map JSON",
        "argoverse2",
        "write_argoverse2",
        forms=("window", "whole"),
        packages=("pyarrow",),
    ),
    "osi": Format("ASAM OSI ground truth in MCAP", "osi", "write_osi", packages=("mcap",)),
    "foxglove": Format(
        "Foxglove scene in MCAP, to look at", "foxglove", "write_foxglove", packages=("mcap",)
    ),
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
    files: dict[str, bytes] = chosen.load(chosen.function)(scene, **more)
    return files


def write_index(scenes: Sequence[ExportedScene], name: str) -> dict[str, bytes]:
    """The files that belong to a folder of scenes in a format; most formats have none."""
    chosen = find_format(name)
    if chosen.index is None:
        return {}
    files: dict[str, bytes] = chosen.load(chosen.index)(scenes)
    return files
