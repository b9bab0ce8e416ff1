"""A relation of a user's own, as docs/relations.md tells it: from the file to a verified scene."""

from __future__ import annotations

import json
import shlex
from functools import cache
from pathlib import Path

import pytest

from scenewright import synthesize
from scenewright.cli.main import main
from scenewright.graph.run import Scene
from scenewright.intersections import load_map
from scenewright.scene.record import RelationRecord, SceneRecord
from scenewright.tools.relation_checker import check

PAGE = (Path(__file__).parents[2] / "docs" / "relations.md").read_text("utf-8")
EXAMPLE = PAGE.split("```toml\n")[1].split("```")[0]
COMMANDS = PAGE.split("```sh\n")[1].split("```")[0].strip().splitlines()
ANSWER = PAGE.split("```text\n")[1].split("```")[0].strip()
MAP = load_map("amsterdam_120")


def run(command: str, folder: Path, monkeypatch: pytest.MonkeyPatch) -> int:
    """A line of the page, with its variables, in a folder; the exit code."""
    monkeypatch.chdir(folder)
    words = shlex.split(command)
    while "=" in words[0]:
        monkeypatch.setenv(*words.pop(0).split("=", 1))
    assert words[0] == "scenewright"
    return main(words[1:])


def test_the_page_leads_from_a_file_to_a_verified_scene(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "my_relations").mkdir()
    (tmp_path / "my_relations" / "noses_out.toml").write_text(EXAMPLE, "utf-8")
    for command in COMMANDS:
        code = run(command, tmp_path, monkeypatch)
        printed = capsys.readouterr()
        assert code == 0, f"{command}\n{printed.out}{printed.err}"
    assert "verified" in printed.out
    provenance = json.loads((tmp_path / "scene" / "provenance.json").read_text("utf-8"))
    assert provenance["patterns"] == ["noses_out"]
    scene = json.loads((tmp_path / "scene" / "scene.json").read_text("utf-8"))
    (relation,) = scene["relations"]
    assert (relation["zone"], relation["first"]) == ("conflict", relation["from"])
    assert relation["within"] == {"pet": [0.7, 1.1]}
    kinds = {agent["id"]: agent["subtype"] for agent in scene["agents"]}
    assert (kinds[relation["from"]], kinds[relation["to"]]) == ("car", "bus")


def test_the_page_shows_what_a_faulty_file_is_answered(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "faulty").mkdir()  # files of a folder that was read stay as they were read
    faulty = EXAMPLE.replace("in {gap} s", "in 0.7 s")
    (tmp_path / "faulty" / "noses_out.toml").write_text(faulty, "utf-8")
    assert run(COMMANDS[0].replace("my_relations", "faulty"), tmp_path, monkeypatch) == 2
    assert capsys.readouterr().err.strip() == ANSWER.replace("my_relations", "faulty")


@pytest.fixture
def noses_out(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "mine.toml").write_text(EXAMPLE, "utf-8")
    monkeypatch.setenv("SCENEWRIGHT_RELATIONS", str(tmp_path))


@pytest.mark.usefixtures("noses_out")
@pytest.mark.parametrize("seed", range(3))
def test_the_one_named_first_passes_first(seed: int) -> None:
    scene = synthesize("A truck noses out in front of a car. Nobody else is around.", seed=seed)
    (seen,) = scene.proof.events
    assert 0.7 - 0.15 <= seen.evidence["pet"] <= 1.1 + 0.15
    (asked,) = scene.record.relations
    agents = {agent.id: agent for agent in scene.record.agents}
    assert agents[asked.from_].subtype == "truck"
    assert asked.first == asked.from_


@pytest.mark.usefixtures("noses_out")
@pytest.mark.parametrize(
    ("change", "why"),
    [
        ({"zone": "crosswalk"}, "not in the zone demanded (crosswalk)"),
        ({"zone": "lane"}, "not in the zone demanded (lane)"),
        ({"first": 2}, "1 passes first, 2 was to"),
        ({"within": {"pet": (2.0, 3.0)}}, "observed, [2, 3] demanded"),
        ({"within": {"path_ttc": (0.0, 0.01)}}, "demanded"),
        ({"within": {"nonsense": (0.0, 9.0)}}, "no nonsense observed"),
        ({"cause": "late_brake"}, "late_brake"),
    ],
)
def test_the_gate_looks_for_all_that_the_file_demands(change: dict[str, object], why: str) -> None:
    scene = make_once()
    assert [a.reaction for a in scene.state["social_graph"].agents] == [None, "none"]
    assert check(scene.record, MAP).verified
    proof = check(demanding(scene.record, change), MAP)
    assert not proof.verified
    assert why in proof.missing[0].detail


@cache
def make_once() -> Scene:
    text = "A car noses out in front of a bus, which does not react. Nobody else is around."
    return synthesize(text, seed=1)


def demanding(record: SceneRecord, change: dict[str, object]) -> SceneRecord:
    (relation,) = record.relations
    other = RelationRecord.model_validate(relation.model_dump(by_alias=True) | change)
    return record.model_copy(update={"relations": (other,)})


@pytest.mark.usefixtures("noses_out")
def test_a_severity_in_the_request_replaces_that_of_the_file() -> None:
    text = "A car noses out in front of a bus with a PET of 1.4 seconds. Nobody else is around."
    scene = synthesize(text, seed=0)
    (seen,) = scene.proof.events
    assert seen.evidence["pet"] == pytest.approx(1.4, abs=0.15)
    assert scene.record.relations[0].within == {}
