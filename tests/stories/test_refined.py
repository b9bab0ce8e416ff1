"""Whole runs with the refiner that the shipped intersection brings along."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest

from scenewright import synthesize, verify
from scenewright.graph.scene_files import encode_scene
from scenewright.intersections import REFINER_WEIGHTS, find_bundle_folder

pytestmark = pytest.mark.skipif(
    not (find_bundle_folder("amsterdam_120") / REFINER_WEIGHTS).is_file(),
    reason="no weights shipped",
)
STORIES = {
    "yielding": "A car from the south yields to a pedestrian on the north crosswalk.",
    "collision": "A truck from the east runs a red light and hits a northbound sedan.",
    "near_miss": "A cab from the north narrowly misses a pedestrian on the south crosswalk.",
    "follow": "An SUV follows a bus from the south through the intersection at noon.",
}


@pytest.mark.parametrize(("event", "text"), STORIES.items(), ids=STORIES)
def test_refined_tracks_are_proved_and_move_otherwise_than_edited_ones(event, text):
    scene = synthesize(text, seed=1, refiner="trajnet")
    assert [each.type for each in scene.record.events] == [event]
    assert scene.proof == verify(scene)
    assert scene.proof.verified
    given = scene.provenance["refinement"]
    assert given["refiner"] == "trajnet"
    assert set(given["agents"]) == {agent.name for agent in scene.record.agents}
    edited, refined = scene.state["edited"], scene.state["refined"]
    assert any(
        len(edited[name].xy) != len(track.xy) or not np.array_equal(edited[name].xy, track.xy)
        for name, track in refined.items()
    )


def test_the_same_seed_gives_the_same_bytes_in_a_process_without_any_extra():
    text = STORIES["yielding"]
    program = (
        "import sys\n"
        "for name in ('torch', 'sklearn', 'rerun', 'pyarrow', 'starlette'):\n"
        "    sys.modules[name] = None\n"
        "from scenewright import synthesize, verify\n"
        "from scenewright.graph.scene_files import encode_scene\n"
        f"made = synthesize({text!r}, seed=4, refiner='trajnet')\n"
        "assert verify(made.record).verified\n"
        "sys.stdout.buffer.write(encode_scene(made.record))"
    )
    there = subprocess.run([sys.executable, "-c", program], capture_output=True, check=True)
    here = encode_scene(synthesize(text, seed=4, refiner="trajnet").record)
    assert there.stdout == here


def test_the_refiner_is_the_default_and_can_be_declined(monkeypatch):
    monkeypatch.delenv("SCENEWRIGHT_REFINER")
    text = STORIES["follow"]
    assert synthesize(text, seed=2).provenance["refiner"] == "trajnet"
    assert synthesize(text, seed=2, refiner="none").provenance["refinement"]["refiner"] == "none"
