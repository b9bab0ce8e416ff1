"""Scenes written in the formats of other simulators and planners (docs/exports.md)."""

from __future__ import annotations

import os
import secrets
import shutil
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from scenewright.errors import InputError
from scenewright.graph.run import Scene, load_scene
from scenewright.intersections import load_map
from scenewright.scene.plan_file import read_logical_plan
from scenewright.scene.record import SceneRecord
from scenewright.tools.formats import (
    ExportedScene,
    find_format,
    prepare_scene,
    write_index,
    write_scene,
)
from scenewright.tools.formats.openscenario_ranges import write_ranges

Exportable = Scene | SceneRecord | str | Path


def export(
    scenes: Exportable | Sequence[Exportable],
    to: str,
    out: str | Path,
    *,
    form: str | None = None,
    ego: str | None = None,
    intersection: str | None = None,
    plan: str | Path | Mapping[str, Any] | None = None,
) -> list[Path]:
    """Write one scene or several in a format; either all files appear or none.

    Args:
        scenes: a scene, a record, a scene.json or a folder that holds one; or a sequence of these.
        to: name of the format, a key of `scenewright.tools.formats.FORMATS`.
        out: folder to write into; files of the same names in it are replaced.
        form: of the formats with several forms; None is the usual one.
        ego: agent that a format is centred on, such as `vehicle-1`; formats in which agents have
            controllers leave it to the user. None: the first vehicle of the foreground.
        intersection: map to use instead of the one that the scene names.
        plan: what the scenes were made of; what it leaves open of the parameters that the form
            `reactive` of `openscenario` declares is written as distributions beside each scene.

    Returns:
        The files, in order.

    Raises:
        InputError: unreadable scene, unknown format, form or ego, a missing extra, a plan without
            such ranges, or a folder that cannot be written.
    """
    find_format(to)
    ranges = None if plan is None else read_logical_plan(plan)
    if ranges is not None and (to, form) != ("openscenario", "reactive"):
        raise InputError("a plan's ranges go with `--to openscenario --form reactive` alone")
    given = [scenes] if isinstance(scenes, str | Path | Scene | SceneRecord) else list(scenes)
    with _Staging(Path(out)) as staging:
        prepared: list[ExportedScene] = []
        seen = Counter[str]()
        for each in given:
            whole = each.record if isinstance(each, Scene) else each
            record = whole if isinstance(whole, SceneRecord) else load_scene(whole)
            own = record.meta.scene_id
            seen[own] += 1  # a second scene of the same id gets a number behind its name
            name = f"{own}-{seen[own]}" if seen[own] > 1 else own
            place = load_map(intersection or record.meta.intersection)
            scene = prepare_scene(record, place, ego=ego, name=name)
            staging.add(write_scene(scene, to, form=form))
            if ranges is not None:
                staging.add(write_ranges(scene, ranges))
            prepared.append(scene)
        staging.add(write_index(prepared, to))
        return staging.publish()


class _Staging:
    """A folder beside the output, whose files move there once all are written."""

    def __init__(self, out: Path) -> None:
        self._out = Path(os.path.realpath(out))
        self._part = self._out.parent / f".{self._out.name[:80]}.{secrets.token_hex(4)}.part"
        self._names: list[str] = []

    def __enter__(self) -> _Staging:
        try:
            self._part.mkdir(parents=True)
        except OSError as error:
            raise self._build_write_error(error) from error
        return self

    def __exit__(self, *_: object) -> None:
        shutil.rmtree(self._part, ignore_errors=True)

    def add(self, files: dict[str, bytes]) -> None:
        """Write files, by their paths below the output folder."""
        try:
            for name, content in files.items():
                (self._part / name).parent.mkdir(parents=True, exist_ok=True)
                (self._part / name).write_bytes(content)
                self._names.append(name)
        except OSError as error:
            raise self._build_write_error(error) from error

    def publish(self) -> list[Path]:
        """Move all files into the output folder."""
        try:
            for name in self._names:
                (self._out / name).parent.mkdir(parents=True, exist_ok=True)
                os.replace(self._part / name, self._out / name)
        except OSError as error:
            raise self._build_write_error(error) from error
        return [self._out / name for name in self._names]

    def _build_write_error(self, error: OSError) -> InputError:
        return InputError(f"cannot write {self._out}: {error.strerror or error}")
