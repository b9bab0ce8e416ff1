"""The recording, read back: who is where, which way is north, and how it is shown."""

from __future__ import annotations

import subprocess
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
from rerun.chunk import RrdReader

from scenewright.errors import InputError
from scenewright.scene.events import Finding, Proof
from scenewright.scene.map import IntersectionMap
from scenewright.scene.record import SceneRecord
from scenewright.viz import recording as recording_module
from scenewright.viz.recording import open_recording, record_scene

Chunks = dict[str, list[pa.RecordBatch]]


@pytest.fixture
def recording(
    tmp_path: Path, scene: SceneRecord, proof: Proof, intersection: IntersectionMap
) -> Path:
    paths = {agent.name: np.array(agent.trajectory)[::10] for agent in scene.agents}
    path = tmp_path / "scene.rrd"
    record_scene(
        path,
        scene=scene,
        proof=proof,
        intersection=intersection,
        candidates={name: [xy, xy + 0.5] for name, xy in paths.items()},
        priors=paths,
        messages=[("scene_planner", "one\nrelation"), ("agent_generator", "seven agents")],
    )
    return path


def chunks_of(path: Path) -> Chunks:
    found: Chunks = {}
    for chunk in RrdReader(path).stream():
        found.setdefault(str(chunk.entity_path), []).append(chunk.to_record_batch())
    return found


def column(batches: list[pa.RecordBatch], name: str) -> np.ndarray:
    """All values of the first column whose name holds `name`, rows first."""
    for batch in batches:
        for field in batch.schema:
            if name in field.name:
                values = batch.column(field.name).to_pylist()
                return np.array([row[0] if isinstance(row, list) else row for row in values])
    raise AssertionError(f"no column {name} in {[b.schema.names for b in batches]}")


def test_everything_of_a_run_is_there(recording: Path, scene: SceneRecord) -> None:
    found = chunks_of(recording)
    for path in ("/map/road", "/map/walkable", "/map/crosswalks", "/map/stop_lines", "/report"):
        assert path in found
    for agent in scene.agents:
        for root in ("agents", "speed", "trails", "candidates", "priors"):
            assert f"/{root}/{agent.name}" in found
    assert "/states/vehicle-1" in found
    assert "/signals/stop-south" in found
    assert "/signal_states/crosswalk-north" in found
    assert "/events/1" in found
    assert "/log/run" in found


def test_x_is_east_and_y_is_north(recording: Path) -> None:
    found = chunks_of(recording)
    east = column(found["/agents/vehicle-7"], "translation")
    assert (np.diff(east[:, 0]) > 0).all()
    assert east[:, 1] == pytest.approx(-1.65)
    north = column(found["/agents/vehicle-1"], "translation")
    assert north[0, 1] == pytest.approx(-60.0)
    assert north[-1, 1] > 50


def test_a_vehicle_faces_where_it_drives(recording: Path) -> None:
    """Heading north is a quarter turn about z: quaternion (0, 0, sin 45°, cos 45°)."""
    turns = column(chunks_of(recording)["/agents/vehicle-1"], "quaternion")
    assert turns[0] == pytest.approx([0, 0, 0.5**0.5, 0.5**0.5], abs=1e-6)


def test_segments_are_states(recording: Path) -> None:
    states = column(chunks_of(recording)["/states/vehicle-1"], "StateChange:state")
    assert states.tolist() == ["keep", "stop", "proceed", ""]


def test_recording_is_named_after_the_scene_and_has_a_view(
    recording: Path, scene: SceneRecord
) -> None:
    reader = RrdReader(recording)
    assert [entry.recording_id for entry in reader.recordings()] == [scene.meta.scene_id]
    assert [entry.application_id for entry in reader.recordings()] == ["scenewright"]
    assert len(reader.blueprints()) == 1


def test_report_holds_the_findings_as_plain_words(
    tmp_path: Path, scene: SceneRecord, intersection: IntersectionMap
) -> None:
    finding = Finding(rule="yield_to", agents=(1, 2), detail="**never** slowed\n# down")
    failed = Proof(verified=False, events=(), missing=(finding,))
    record_scene(
        tmp_path / "a.rrd",
        scene=scene,
        proof=failed,
        intersection=intersection,
        candidates=None,
        priors=None,
        messages=[],
    )
    page = str(column(chunks_of(tmp_path / "a.rrd")["/report"], "TextDocument:text")[0])
    assert "Not verified" in page
    assert r"\*\*never\*\* slowed \# down" in page


def test_the_report_has_the_verdict_and_a_row_for_every_word(
    tmp_path: Path, scene: SceneRecord, partly: Proof, intersection: IntersectionMap
) -> None:
    record_scene(tmp_path / "a.rrd", scene=scene, proof=partly, intersection=intersection,
                 candidates=None, priors=None, messages=[])  # fmt: skip
    page = str(column(chunks_of(tmp_path / "a.rrd")["/report"], "TextDocument:text")[0])
    assert "**Partly: 'coming', 'light' not shown.**" in page
    assert "| car | seen | class car |  |" in page
    assert "| light | not shown |  |  |" in page


def test_nothing_is_left_where_a_recording_cannot_be_written(
    tmp_path: Path, scene: SceneRecord, intersection: IntersectionMap
) -> None:
    with pytest.raises(InputError, match="cannot write"):
        record_scene(
            tmp_path / "missing" / "a.rrd",
            scene=scene,
            proof=None,
            intersection=intersection,
            candidates=None,
            priors=None,
            messages=[],
        )
    assert list(tmp_path.iterdir()) == []


def test_open_refuses_what_is_no_recording(tmp_path: Path) -> None:
    (tmp_path / "a.rrd").write_text("hello")
    for path, words in (
        (tmp_path / "none.rrd", "cannot read"),
        (tmp_path, "cannot read"),
        (tmp_path / "a.rrd", "not a rerun recording"),
    ):
        with pytest.raises(InputError, match=words):
            open_recording(path)


def test_open_starts_the_viewer_on_this_machine_only(
    recording: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls: list[list[str]] = []

    def run(command: list[str], **_: object) -> subprocess.CompletedProcess[str]:
        calls.append(command)
        return subprocess.CompletedProcess(command, returncode=len(calls) - 1)

    monkeypatch.setattr(recording_module.subprocess, "run", run)
    open_recording(recording.parent)
    assert calls[0][1:] == ["--bind", "127.0.0.1", str(recording)]
    with pytest.raises(InputError, match="code 1"):
        open_recording(recording)
