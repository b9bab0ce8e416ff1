"""`scenewright export` and `dataset`: scenes in other formats, datasets checked and signed."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

import typer

from scenewright.cli.batch import Out, count_cores
from scenewright.cli.console import ProgressCallback, Result, count, shorten, write_stdout
from scenewright.cli.errors import NOT_VERIFIED
from scenewright.cli.interrupts import stop_if_asked
from scenewright.cli.options import Asked, Commands, argument, option


@dataclass(frozen=True, kw_only=True)
class ExportOptions(Asked):
    """In which format scenes are written, and where."""

    to: str = option(..., "Format; docs/exports.md lists them all.", metavar="FORMAT")
    out: Out
    form: str | None = option(
        None, "Form, of formats with several: replay, reactive; window, whole, example."
    )
    ego: str | None = option(None, "Agent that is left to you, such as vehicle-1.", metavar="NAME")
    intersection: str | None = option(None, "Map to use, not the one the scene names.")
    plan: str | None = option(
        None, "Plan whose open speeds become OpenSCENARIO distributions.", metavar="F"
    )


def export(
    *,
    scenes: list[str] = argument(..., "scene.json, or folders of scenes.", metavar="SCENE..."),
    options: ExportOptions,
) -> Result:
    """Write scenes in another format; docs/exports.md describes each."""
    from scenewright.cli.verify import list_scene_files
    from scenewright.graph.export import export as write

    given = [each for path in scenes for each in list_scene_files(path)]
    files = write(given, **options.pass_on(write))
    facts = {"format": options.to, "scenes": len(given), "out": options.out}
    counts = f"{count(len(given), 'scene')} as {options.to}: {count(len(files), 'file')}"
    return Result({**facts, "files": list(map(str, files))}, f"{options.out}\n", notes=[counts])


dataset = Commands(name="dataset", help="Datasets of scenes: check them, make the paper's.")

Folder = Annotated[str, typer.Argument(metavar="DIR", help="Folder of the dataset.")]
_SHOWN = 20


@dataset.command("check")
def check(
    *,
    folder: Folder,
    workers: int | None = option(None, "Processes; as many as there are cores if not said.", min=1),
    public_key: str | None = option(
        None, "Demand the signature of this key of minisign, or file.", metavar="KEY"
    ),
    log: ProgressCallback,
) -> Result:
    """Recompute every hash, compare tables with scenes, run the checker over every scene.

    Exit code 0 if all of it holds, 1 if something does not.
    """
    from scenewright.dataset.batch.audit import AuditFault, audit_dataset
    from scenewright.dataset.batch.signing import SIGNATURE, find_signature_fault

    unsigned = None if public_key is None else find_signature_fault(Path(folder), public_key)

    def tell(done: int, of: int) -> None:
        if done % 100 == 0 or done == of:
            log("checking", f"{done} of {of} scenes")
        stop_if_asked()

    found = audit_dataset(Path(folder), workers=workers or count_cores(), log=tell)
    if unsigned is not None:
        found = replace(found, faults=(AuditFault(SIGNATURE, unsigned), *found.faults))
    about = {key: each for key, each in vars(found).items() if key != "faults"}
    counts = f"{found.files} files, {found.verified} of {found.scenes} proofs confirmed"
    text = f"{folder}: {counts}, {'in order' if not found.faults else 'NOT in order'}\n"
    faults = [f"{fault.where}: {fault.what}" for fault in found.faults]
    unfinished = "note: the dataset is not complete; the command that made it goes on with it"
    return Result(
        {
            "ok": not found.faults,
            "folder": folder,
            **about,
            "faults": list(map(vars, found.faults)),
        },
        text,
        summary=[] if found.complete else [unfinished],
        notes=shorten(faults, _SHOWN),
        code=NOT_VERIFIED if found.faults else 0,
    )


@dataset.command("join")
def join(
    folder: Folder,
    other: str = argument(..., "Dataset whose rows join it, such as a fill's.", metavar="OTHER"),
) -> Result:
    """Add the scenes and refusals of another dataset to one; OTHER stays as it is."""
    from scenewright.dataset.batch.finish import join_dataset

    rows = join_dataset(Path(folder), Path(other))
    facts = {"folder": folder, "other": other, "rows": rows}
    return Result(facts, f"{folder}\n", [f"{count(rows, 'row')} of {other} joined {folder}"])


@dataset.command("key")
def make_key(
    file: str = argument(..., "Secret key to write.", metavar="FILE"),
) -> None:
    """Make a key to sign datasets with: FILE, to keep, and FILE.pub, to give away."""
    from scenewright.dataset.batch.signing import create_key

    write_stdout(f"{file} and {create_key(Path(file))}\n")


@dataset.command("sign")
def sign(
    folder: Folder,
    key: str = option(..., "Secret key, without a password.", metavar="FILE"),
) -> None:
    """Sign a dataset with a key of one's own, as minisign does; any change then shows."""
    from scenewright.dataset.batch.signing import sign_dataset

    write_stdout(f"{sign_dataset(Path(folder), Path(key))}\n")


@dataset.command("export")
def export_dataset(folder: Folder, options: ExportOptions) -> Result:
    """Write every scene of a dataset in another format; docs/exports.md describes each."""
    from scenewright.dataset.batch.manifest import read_manifest

    read_manifest(Path(folder))  # it is a finished dataset
    return export(scenes=[folder], options=options)
