"""`scenewright verify`: what the checker says about scenes and tracks that lie about as files."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from scenewright.cli.console import Result, format_columns, format_one_line, paint, shorten
from scenewright.cli.errors import NOT_VERIFIED, UNUSABLE
from scenewright.cli.scene_summary import (
    choose_style,
    format_verdict,
    list_findings,
    list_unseen_words,
    name_agent,
)
from scenewright.cli.verify_tracks import CheckedTracks, check_tracks, format_tracks_report
from scenewright.dataset.batch.manifest import MANIFEST, list_scenes
from scenewright.errors import InputError
from scenewright.graph.scene_files import find_scene_file, load_scene, read_origin_digest
from scenewright.graph.verify import verify
from scenewright.scene.events import Event, Proof
from scenewright.scene.record import SceneRecord
from scenewright.tools.formats.registry import DATABASE_FILES, find_reader

TRACKS = (".ndjson", ".csv")
FOREIGN = (".txt", ".osi")
SHOWN = 12
"""Findings listed per scene; `--json` has them all."""


@dataclass(frozen=True, eq=False)
class Checked:
    """A file and what came of checking it: a scene with its proof, or why it is none."""

    path: Path
    scene: SceneRecord | None = None
    proof: Proof | None = None
    error: str | None = None
    unchecked: tuple[str, ...] = ()
    """Files beside it that no check has looked at, of `--strict`."""

    def to_json(self) -> dict[str, Any]:
        """One entry of `--json`."""
        if self.proof is None:
            return {"path": str(self.path), "verified": None, "error": self.error}
        proof = self.proof
        return {
            "path": str(self.path),
            **{"verified": proof.verified, "verdict": proof.verdict, "caveat": proof.caveat},
            "proof": proof.model_dump(mode="json", by_alias=True),
            **({"unchecked": list(self.unchecked)} if self.unchecked else {}),
        }


def check_paths(
    paths: list[str], *, intersection: str | None, strict: bool = False
) -> list[Checked | CheckedTracks]:
    """Every scene and file of tracks in every path, in order; what is unusable is an entry too."""
    checked: list[Checked | CheckedTracks] = []
    for path in paths:
        try:
            for file in list_scene_files(path):
                checked += _check(file, intersection, strict)
        except (InputError, OSError) as error:
            checked.append(Checked(Path(path), error=_describe_fault(error)))
    return checked


def list_scene_files(path: str) -> list[Path]:
    """The file itself; the scene of a folder; those of a dataset or of folders in it; its tracks.

    Raises:
        InputError: there is none, or the file is of another format.
    """
    if not path.strip():
        raise InputError("an empty path names no scene; give a scene.json, a folder or tracks")
    place = Path(path)
    if place.suffix.lower() in FOREIGN:
        raise InputError(
            f"{path}: tracks in {place.suffix} files cannot be checked yet; give a scene.json, "
            "tracks in one of the formats that docs/formats.md lists"
        )
    if not place.is_dir() or (place / "scene.json").exists():
        return [place]
    if (place / MANIFEST).is_file():
        return list_scenes(place)
    inside = [file.parent for file in sorted(place.glob("*/scene.json"))]
    for pattern in ("*", "*/*"):  # Argoverse 2 has a folder per scenario
        inside = inside or [each for each in sorted(place.glob(pattern)) if _has_tracks(each)]
    if not inside:
        raise InputError(
            f"{path}: no scene.json in this folder or in the folders in it, and no tracks"
        )
    return inside


def _check(path: Path, intersection: str | None, strict: bool) -> Sequence[Checked | CheckedTracks]:
    try:
        if _has_tracks(path) and not path.is_dir():
            return check_tracks(path, intersection=intersection)
        scene = load_scene(path)
        proof = verify(path, intersection=intersection, strict=strict)
        return [Checked(path, scene, proof, unchecked=_list_unchecked(path) if strict else ())]
    except (InputError, OSError) as error:
        return [Checked(path, error=_describe_fault(error))]


def _list_unchecked(path: Path) -> tuple[str, ...]:
    """What lies beside a scene and was not compared with it: pictures, recordings, other files."""
    folder = find_scene_file(path).parent
    if not (folder / "scene.json").exists():
        return ()
    named = read_origin_digest(folder / "provenance.json") is not None
    origin = "provenance.json but for the digest" if named else "provenance.json"
    names = sorted(each.name for each in folder.iterdir() if each.is_file())
    renamed = {"provenance.json": origin}
    return tuple(renamed.get(n, n) for n in names if n not in ("scene.json", "proof.json"))


def _has_tracks(path: Path) -> bool:
    """Whether a file of that name holds tracks."""
    named = path.suffix.lower() in TRACKS or find_reader(path.name) is not None
    return named and path.name not in DATABASE_FILES


def _describe_fault(error: Exception) -> str:
    return format_one_line(getattr(error, "strerror", None) or str(error))


def report(checked: list[Checked | CheckedTracks]) -> Result:
    """The scenes in one table, each file of tracks in one of its own; 1 or 2 if one is not good.

    Notes are what was assumed about tracks, what beside scenes was not looked at, and why files
    are unusable.
    """
    scenes = [each for each in checked if isinstance(each, Checked)]
    tracks = [each for each in checked if isinstance(each, CheckedTracks)]
    unusable = [scene.error for scene in scenes if scene.error is not None]
    good = all(scene.proof is not None and scene.proof.verified for scene in scenes)
    facts = {"ok": good, "scenes": [each.to_json() for each in checked]}
    if tracks and len(checked) == 1:
        facts = {"ok": good, **tracks[0].to_json()}
    notes = [f"{each.path}: {note}" for each in tracks for note in each.tracks.notes]
    notes += [
        f"{scene.path}: not looked at: {', '.join(scene.unchecked)}"
        for scene in scenes
        if scene.unchecked
    ]

    def format_all() -> str:
        listed = _format_scenes(scenes) if any(scene.proof for scene in scenes) else ""
        return listed + "".join(map(format_tracks_report, tracks))

    return Result(
        facts,
        format_all,
        notes=[*(f"note: {note}" for note in notes), *(f"scenewright: {e}" for e in unusable)],
        code=0 if good else UNUSABLE if unusable else NOT_VERIFIED,
    )


def _format_scenes(checked: list[Checked]) -> str:
    """A table of events and verdicts; below it what stands against a scene, and words not seen."""
    rows, styles = [], []
    for each in checked:
        if each.scene is None or each.proof is None:
            continue
        style = choose_style(verified=each.proof.verified, caveat=each.proof.caveat)
        head = format_one_line(str(each.path)), format_verdict(each.proof)
        events = [_list_cells(event, each.scene) for event in each.proof.events]
        for cells in events or [("normal", "", "", "", "")]:
            rows.append((*head, *cells))
            styles.append(style)
            head, style = ("", ""), ""
    titles = ("scene", "verdict", "event", "from", "to", "time", "place")
    lines = format_columns(titles, rows, right={"time", "place"}).split("\n")
    for k, style in enumerate(styles, start=3):
        lines[k] = paint(lines[k], style)
    below = (line + "\n" for each in checked for line in _list_findings(each))
    return "\n".join(lines) + "".join(below)


def _list_cells(event: Event, scene: SceneRecord) -> tuple[str, ...]:
    words = (event.type + (f", {event.kind}" if event.kind else "")).replace("_", " ")
    x, y = event.location
    agents = (name_agent(scene, each) for each in (event.from_, event.to))
    return words, *agents, f"{event.time:.1f} s", f"({x:.1f}, {y:.1f})"


def _list_findings(checked: Checked) -> list[str]:
    if checked.proof is None:
        return []
    found = [f"{finding.rule}: {finding.detail}" for finding in list_findings(checked.proof)]
    lines = [*shorten(found, SHOWN), *list_unseen_words(checked.proof)]
    return [format_one_line(f"{checked.path}: {line}") for line in lines]
