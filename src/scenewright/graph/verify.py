"""The checker's verdict on scenes, and on tracks that scenewright never made."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from scenewright.errors import InputError
from scenewright.graph.run import Scene
from scenewright.graph.scene_files import find_scene_file, read_content, read_proof, read_scene
from scenewright.graph.written_proof import find_contradiction, find_other_origin
from scenewright.intersections import load_map
from scenewright.scene.bounds import find_excess
from scenewright.scene.digest import digest_scene
from scenewright.scene.events import Event, Proof
from scenewright.scene.record import SceneRecord
from scenewright.tools.account import prove

if TYPE_CHECKING:
    from scenewright.tools.relation_checker.external_events import ExternalTracks, RecordedEvents


def verify(
    scene: SceneRecord | Scene | str | Path,
    *,
    intersection: str | None = None,
    strict: bool = False,
) -> Proof:
    """The checker's verdict on a scene, a scene.json or a folder that holds one.

    A proof.json beside a file must name the digest of this very scene.

    Args:
        strict: demand a proof, of the file or the `Scene`, that names the digest and is the
            checker's own to the last figure; a provenance.json may name no other digest.

    Raises:
        InputError: there is no scene there, or it is none; the proof beside it cannot be read.
    """
    written: Proof | None = None
    if isinstance(scene, str | Path):
        file = find_scene_file(scene)
        record, digest = read_scene(file)
        # Beside a file of another name may lie the proof of something else.
        beside = file.with_name("proof.json")
        written = read_proof(beside) if file.name == "scene.json" and beside.exists() else None
    else:
        record, written = (scene.record, scene.proof) if isinstance(scene, Scene) else (scene, None)
        if (excess := find_excess(record)) is not None:
            raise InputError(f"this is no scene: {excess}")
        digest = digest_scene(record)
    name = intersection or record.meta.intersection
    proof = prove(record, load_map(name), labelled=True)
    proof = proof.model_copy(update={"scene_digest": digest})
    other_map = name != record.meta.intersection
    against = [find_contradiction(proof, written, strict=strict, other_map=other_map)]
    if strict and isinstance(scene, str | Path):
        against.append(find_other_origin(proof, file.with_name("provenance.json")))
    if not any(against):
        return proof
    missing = (*proof.missing, *filter(None, against))
    return proof.model_copy(update={"verified": False, "missing": missing})


def verify_tracks(
    path: str | Path | ExternalTracks, *, intersection: str | None = None
) -> tuple[Event, ...]:
    """Every event in tracks that scenewright never made, in order of time (SEMANTICS section 4).

    Args:
        path: a CSV of tracks or a TrajNet++ ndjson file, or what `load_tracks` made of it; agents
            are numbered as there.
        intersection: the map of the tracks, in its frame; its crosswalks count as such.

    Raises:
        InputError: unreadable (the line is named), or no such intersection.
    """
    tracks = load_tracks(path) if isinstance(path, str | Path) else path
    return examine_tracks(tracks, intersection=intersection).events


def examine_tracks(tracks: ExternalTracks, *, intersection: str | None = None) -> RecordedEvents:
    """Events as of `verify_tracks`, contacts that are none, and what would have avoided them.

    Raises:
        InputError: no such intersection, or too many agents at once.
    """
    ground = None if intersection is None else load_map(intersection)
    from scenewright.tools.relation_checker.external_events import examine_recording

    return examine_recording(tracks, intersection_map=ground)


def load_tracks(path: str | Path) -> ExternalTracks:
    """The tracks in a file of one scenario; see docs/formats.md and docs/exports.md.

    Raises:
        InputError: missing or unreadable, names the place and what to mend; or several scenarios.
    """
    recordings = load_recordings(path)
    if len(recordings) > 1:
        raise InputError(f"{path} holds {len(recordings)} scenarios; use load_recordings")
    return next(iter(recordings.values()))


def load_recordings(path: str | Path) -> dict[str, ExternalTracks]:
    """The tracks of every scenario in a file, by its name; "" where there is but one.

    Raises:
        InputError: missing or unreadable; names the place and what to mend.
    """
    from scenewright.tools.track_io.external_tracks import read_external_recordings

    return read_external_recordings(read_content(Path(path)), name=str(path))
