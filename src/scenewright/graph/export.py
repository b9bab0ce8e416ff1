"""Scenes written in the formats of other simulators and planners (docs/exports.md)."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from scenewright.errors import InputError
from scenewright.graph.run import Scene
from scenewright.graph.scene_files import load_scene
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
    prepared: list[ExportedScene] = []
    seen = Counter[str]()

    def list_files() -> Iterator[tuple[str, bytes]]:
        for each in given:
            whole = each.record if isinstance(each, Scene) else each
            record = whole if isinstance(whole, SceneRecord) else load_scene(whole)
            own = record.meta.scene_id
            seen[own] += 1  # a second scene of the same id gets a number behind its name
            name = f"{own}-{seen[own]}" if seen[own] > 1 else own
            place = load_map(intersection or record.meta.intersection)
            scene = prepare_scene(record, place, ego=ego, name=name)
            yield from write_scene(scene, to, form=form).items()
            if ranges is not None:
                yield from write_ranges(scene, ranges).items()
            prepared.append(scene)
        yield from write_index(prepared, to).items()

    return _publish(list_files(), Path(os.path.realpath(out)))


def _publish(files: Iterable[tuple[str, bytes]], out: Path) -> list[Path]:
    """Write files, by their paths below a folder, beside it, and move them there once all are.

    Raises:
        InputError: the folder cannot be written; nothing is left behind.
    """
    names: list[str] = []
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
        with TemporaryDirectory(".part", f".{out.name[:80]}.", out.parent) as part:
            for name, content in files:
                (Path(part) / name).parent.mkdir(parents=True, exist_ok=True)
                (Path(part) / name).write_bytes(content)
                names.append(name)
            for name in names:
                (out / name).parent.mkdir(parents=True, exist_ok=True)
                os.replace(Path(part) / name, out / name)
    except OSError as error:
        raise InputError(f"cannot write {out}: {error.strerror or error}") from error
    return [out / name for name in names]
