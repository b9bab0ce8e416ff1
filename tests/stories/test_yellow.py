"""Passing on yellow: who meets whom, and that an edit keeps it."""

from __future__ import annotations

from pathlib import Path

import pytest

from scenewright import synthesize
from scenewright.authoring.session import Session
from scenewright.backends import load_backend
from scenewright.memory.threads import Threads


@pytest.mark.parametrize(
    "text",
    ["A car from the south runs a yellow light and narrowly misses a car from the east",
     "A van running a yellow light almost hits a cyclist"],
)  # fmt: skip
def test_who_passes_on_yellow_meets_whom_the_lights_let_go(text: str) -> None:
    scene = synthesize(text, seed=1, refiner="none")
    assert scene.proof.build_verdict()["caveat"] == ""
    assert {each.state for each in scene.proof.account} == {"seen"}
    assert not any(agent.violates_signal for agent in scene.record.agents)


def test_a_change_leaves_the_light_yellow(tmp_path: Path) -> None:
    threads = Threads(tmp_path / "threads.sqlite")
    threads.hold("yellow")
    session = Session(
        threads, "yellow", backend=load_backend("builtin"),
        setting={"intersection": "amsterdam_120", "seed": 1, "refiner": "none"},
    )  # fmt: skip
    assert (
        session.say("A car runs a yellow light and collides with a car from the east")["kind"]
        == "made"
    )
    moved = {"edit": "set_pace", "agent": "vehicle-2", "factor": 0.9}
    assert session.edit([moved])["kind"] == "made"
    shown = session.find_version()
    assert shown is not None
    assert shown.proof.verified
