"""`scenewright planner`: annotated instructions checked, and the reader trained on them."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from scenewright.backends.builtin.reader.encoder import OWN_WEIGHTS, Encoder, load_encoder_weights
from scenewright.backends.builtin.reader.reading import read_text
from scenewright.backends.builtin.training import corpus
from scenewright.backends.builtin.training.corpus import list_package_files
from scenewright.cli.main import app

GOOD = "[veh:1 A milk float] from the [from:1 north] [yield:1>2 dawdles for] [ped:2 a hen party]\n"


def test_lines_that_cannot_be_used_are_named(tmp_path: Path) -> None:
    file = tmp_path / "mine.txt"
    file.write_text(GOOD + "[veh:1 a car] [hit hits] [ped:2 a man]\n")
    done = CliRunner().invoke(app, ["planner", "check", str(file), "--json"])
    assert done.exit_code == 2
    assert "line 2" in json.loads(done.stdout.splitlines()[0])["faults"][0]
    file.write_text(GOOD)
    assert CliRunner().invoke(app, ["planner", "check", str(file)]).exit_code == 0


def test_a_training_writes_weights_that_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file, out = tmp_path / "mine.txt", tmp_path / "mine.safetensors"
    file.write_text(GOOD)
    files = list_package_files()[:2]
    monkeypatch.setattr(corpus, "list_package_files", lambda: files)
    monkeypatch.setattr("scenewright.backends.builtin.training.fit.BATCH", 2)
    words = ["planner", "train", str(file), "--out", str(out), "--steps", "1"]
    done = CliRunner().invoke(app, words)
    assert done.exit_code == 0, done.output
    assert sorted(each.name for each in tmp_path.iterdir()) == ["mine.safetensors", "mine.txt"]
    monkeypatch.setenv(OWN_WEIGHTS, str(out))
    reading = read_text("A car hits a pedestrian", encoder=Encoder(load_encoder_weights()))
    assert [span.tag for span in reading.spans] == ["veh", "hit", "ped"]
