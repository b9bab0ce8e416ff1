"""A drive as a scene folder: scene.json, proof, report, picture, recording."""

from __future__ import annotations

from importlib.metadata import version
from pathlib import Path

from scenewright.driving.report import Report
from scenewright.errors import InputError
from scenewright.files import write_atomically
from scenewright.graph.run import encode_proof, encode_scene, format_json_line, make_folder
from scenewright.scene.events import Proof
from scenewright.scene.record import SceneRecord


def save_drive(
    report: Report, folder: str | Path, *, picture: bool = True, recording: bool = True
) -> Path:
    """Write what was driven as a scene folder that `verify`, `show` and `export` read.

    `drive.json` holds the report; `scene.png` the picture and `scene.rrd` the recording.

    Raises:
        InputError: the drive was one on tracks without a scene, or the folder cannot be written.
    """
    if report.scene is None:
        raise InputError("a drive on recorded tracks has no scene to save")
    target = make_folder(folder)
    scene, proof = report.scene.record, report.scene.proof
    write_atomically(target / "provenance.json", format_json_line(_describe_origin(report, proof)))
    write_atomically(target / "drive.json", format_json_line(report.to_json()))
    write_atomically(target / "proof.json", encode_proof(proof))
    write_atomically(target / "scene.json", encode_scene(scene))
    if picture:
        _draw(report, target / "scene.png")
    if recording:
        _record(report, target / "scene.rrd")
    return target


def _describe_origin(report: Report, proof: Proof) -> dict[str, object]:
    drive, record = report.drive, report.drive.scenario.record
    scene_id = record.meta.scene_id if isinstance(record, SceneRecord) else None
    return {
        "scenewright": version("scenewright"), "driven": scene_id, "policy": drive.policy,
        "others": drive.others, "seed": drive.seed, "scene_digest": proof.scene_digest,
    }  # fmt: skip


def _draw(report: Report, path: Path) -> None:
    from scenewright.viz.still import draw_scene

    scene, place = report.scene, report.drive.scenario.intersection_map
    if scene is not None and place is not None:
        draw_scene(path, scene=scene.record, proof=scene.proof, intersection=place)


def _record(report: Report, path: Path) -> None:
    from scenewright.viz.recording import record_scene

    scene, place = report.scene, report.drive.scenario.intersection_map
    if scene is not None and place is not None:
        lines = [("drive", f"{report.drive.policy}, others {report.drive.others}")]
        record_scene(
            path, scene=scene.record, proof=scene.proof, intersection=place, candidates=None,
            priors=None, messages=lines,
        )  # fmt: skip
