"""A drive as a scene folder: scene.json, proof, report, picture, recording."""

from __future__ import annotations

from importlib.metadata import version
from pathlib import Path

from scenewright.driving.report import Report
from scenewright.errors import InputError
from scenewright.files import format_json_line, write_files
from scenewright.graph.scene_files import encode_proof, encode_scene
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
    scene, proof, drive = report.scene.record, report.scene.proof, report.drive
    recorded, place = drive.scenario.record, drive.scenario.intersection_map
    origin = {
        "scenewright": version("scenewright"),
        "driven": recorded.meta.scene_id if isinstance(recorded, SceneRecord) else None,
        "policy": drive.policy, "others": drive.others, "seed": drive.seed,
        "scene_digest": proof.scene_digest,
    }  # fmt: skip
    files = {
        "provenance.json": format_json_line(origin),
        "drive.json": format_json_line(report.to_json()),
        "proof.json": encode_proof(proof), "scene.json": encode_scene(scene),
    }  # fmt: skip
    target = write_files(folder, files)
    if picture and place is not None:
        from scenewright.viz.still import draw_scene

        draw_scene(target / "scene.png", scene=scene, proof=proof, intersection=place)
    if recording and place is not None:
        from scenewright.viz.recording import record_scene

        record_scene(
            target / "scene.rrd", scene=scene, proof=proof, intersection=place, candidates=None,
            priors=None, messages=[("drive", f"{drive.policy}, others {drive.others}")],
        )  # fmt: skip
    return target
