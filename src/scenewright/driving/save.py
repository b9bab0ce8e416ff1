"""A drive as a scene folder: scene.json, proof, report, picture, recording."""

from __future__ import annotations

from importlib.metadata import version
from pathlib import Path

from scenewright.driving.report import Report
from scenewright.errors import InputError
from scenewright.files import write_atomically
from scenewright.graph.run import encode_proof, encode_scene, format_json_line, make_folder
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
    scene, proof, drive = report.scene.record, report.scene.proof, report.drive
    recorded, place = drive.scenario.record, drive.scenario.intersection_map
    origin = {
        "scenewright": version("scenewright"),
        "driven": recorded.meta.scene_id if isinstance(recorded, SceneRecord) else None,
        "policy": drive.policy, "others": drive.others, "seed": drive.seed,
        "scene_digest": proof.scene_digest,
    }  # fmt: skip
    write_atomically(target / "provenance.json", format_json_line(origin))
    write_atomically(target / "drive.json", format_json_line(report.to_json()))
    write_atomically(target / "proof.json", encode_proof(proof))
    write_atomically(target / "scene.json", encode_scene(scene))
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
