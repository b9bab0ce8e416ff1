"""A scene that tells another story than its own parts is no verified scene."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from scenewright import synthesize, verify

Json = dict[str, Any]
TEXTS = {
    "hidden": "A child runs out from behind a parked van and is hit by a car",
    "couple": "A couple crosses the north crosswalk and a car turning right yields to them",
    "distracted": "A distracted driver rear-ends a car",
}


@pytest.fixture(scope="module")
def scenes(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Json]:
    found = {}
    for name, text in TEXTS.items():
        scene = synthesize(text, seed=3, refiner="none", max_agents=8)
        folder = scene.save(tmp_path_factory.mktemp("made") / name)
        found[name] = json.loads((folder / "scene.json").read_bytes())
    return found


def lead_each_other(scene: Json) -> None:
    scene["agents"][0]["group"] = 3


def forget_reaction(scene: Json) -> None:
    del scene["agents"][0]["reaction"]


def follow_closely(scene: Json) -> None:
    scene["relations"][0]["manoeuvre"] = "tailgates"


@pytest.mark.parametrize(
    ("name", "forge", "rule"),
    [
        ("couple", lead_each_other, "group_apart"),
        ("distracted", follow_closely, "relation_not_realised"),
        ("hidden", lambda s: s["objects"][0].update(subtype="motorcycle"),
         "metadata_contradicted"),
        ("hidden", lambda s: s["objects"][0].update(length=9.0), "metadata_contradicted"),
    ],
)  # fmt: skip
def test_parts_that_contradict_one_another_are_found_without_a_proof(
    scenes: dict[str, Json], tmp_path: Path, name: str, forge: Callable[[Json], object], rule: str
) -> None:
    forged = json.loads(json.dumps(scenes[name]))
    (tmp_path / "scene.json").write_text(json.dumps(forged))
    assert verify(tmp_path).verified
    forge(forged)
    (tmp_path / "scene.json").write_text(json.dumps(forged))
    proof = verify(tmp_path)
    rules = {each.rule for each in (*proof.missing, *proof.interference, *proof.implausible)}
    assert rule in rules


def test_a_reaction_that_the_file_forgets_is_no_longer_seen(
    scenes: dict[str, Json], tmp_path: Path
) -> None:
    forged = json.loads(json.dumps(scenes["distracted"]))
    forget_reaction(forged)
    (tmp_path / "scene.json").write_text(json.dumps(forged))
    assert verify(tmp_path).verdict == "partly"
