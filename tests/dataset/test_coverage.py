"""What scenes cover: counted in bins, gaps named, rows that ask for the rest, goals by line."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest

from inline_jobs import run_jobs_inline
from scenewright.cli.main import main
from scenewright.dataset.batch.audit import check_again
from scenewright.dataset.batch.fill import build_fill
from scenewright.dataset.batch.rows import read_source
from scenewright.dataset.batch.sweep import _measure_field
from scenewright.dataset.tables.coverage import (
    Encounter,
    build_bins,
    count_bins,
    list_encounters,
    measure_coverage,
    read_goals,
)
from scenewright.errors import InputError

GOALS = """\
dimensions:
  - {cover: event, values: [near_miss, yielding], least: 0}
  - {cover: hour, bins: [0, 12, 24], least: 0}
  - {cover: pet, bins: [1 s, 1.5 s, 2000 ms]}
crosses:
  - {cross: [event, hour], least: 1}
"""


def write_scene(folder: Path, *, x: float = 5.0, pet: float = 1.2) -> tuple[Any, Any]:
    """A car at 5 m/s that narrowly passes a pedestrian at 8 am, with its proof by hand."""
    agent = {"type": "pedestrian", "subtype": None, "entry": "east", "movement": "crossing",
             "crosswalk": "north", "spawn_time": 0.0,
             "trajectory": [[0.0, 0.1 * n] for n in range(40)]}  # fmt: skip
    car = {"type": "vehicle", "subtype": "car", "entry": "south", "movement": "straight",
           "crosswalk": None, "spawn_time": 1.0,
           "trajectory": [[x * n / 10, 0] for n in range(30)]}  # fmt: skip
    event = {"type": "near_miss", "from": 1, "to": 2, "time": 2.0, "kind": None,
             "cause": "red_light_run", "evidence": {"pet": pet, "cause_agent": 1}}  # fmt: skip
    scene = {
        "meta": {"intersection": "here", "timestamp": 28800.0, "density": None, "step": 0.1},
        "agents": [{"id": 1, **car}, {"id": 2, **agent}],
        "relations": [{"type": "near_miss", "from": 1, "to": 2, "target_pet": 1.2}],
    }
    could = [
        {"agent": n, "other": 3 - n, "event": "near_miss", "avoidable": n == 2} for n in (1, 2)
    ]
    figures = {"red_light_runs": [{"agent": 1}], "avoidability": could}
    proof = {"verified": True, "events": [event], "figures": figures}
    folder.mkdir(parents=True)
    (folder / "scene.json").write_text(json.dumps(scene))
    (folder / "proof.json").write_text(json.dumps(proof))
    return scene, proof


def test_an_encounter_has_what_was_asked_for_and_measured(tmp_path: Path) -> None:
    scene, proof = write_scene(tmp_path / "a")
    (found,) = list_encounters(scene, proof)
    said = {key: value for key, value in found.items() if value is not None}
    assert said.pop("speed_from") == pytest.approx(5.0)
    assert said.pop("speed_to") == pytest.approx(1.0)
    assert said == {
        "event": "near_miss", "asked": "asked", "cause": "red_light_run", "caused_by": "vehicle",
        "avoidable": "to", "ran_red": "from", "pet": 1.2, "asked_pet": 1.2,
        "type_from": "vehicle", "type_to": "pedestrian", "subtype_from": "car",
        "movement_from": "straight", "movement_to": "crossing", "entry_from": "south",
        "entry_to": "east", "crosswalk": "north", "junction": "here", "density": "as usual",
        "hour": 8.0, "agents": 2, "time": 2.0,
    }  # fmt: skip
    # Where the moment of the PET is known, speeds are those at its place, not at the event's time.
    moment = {"value": 1.2, "time": 2.6, "location": [5.0, 0.0]}
    scene["agents"][0]["trajectory"][8:12] = [[4.0, 0], [4.5, 0], [5.0, 0], [5.5, 0]]
    worst = {"path_ttc": {"value": 0.4, "time": 3.1, "location": [6.0, 0.0]}}
    (event,) = proof["events"]
    told = proof | {"events": [event | {"when": {"pet": moment}, "worst": worst}]}
    (found,) = list_encounters(scene, told)
    assert (found["time"], found["pet_time"], found["ttc_time"]) == (2.0, 2.6, None)
    assert (found["worst_ttc"], found["worst_ttc_time"]) == (0.4, 3.1)
    assert found["speed_from"] == pytest.approx(5.0)
    assert list_encounters(scene, proof | {"events": []})[0]["event"] == "normal"


def test_bins_take_in_their_lower_edges_and_the_last_its_upper_one() -> None:
    values: list[Encounter] = [{"pet": v} for v in (0.0, 0.99, 1.0, 2.0, 2.1, None)]
    found = count_bins(values, [build_bins("pet", (0, 1, 2))])
    assert found.counts == {("0 to 1 s",): 2, ("1 to 2 s",): 2}
    assert found.values == 5


def test_gaps_are_named_and_goals_are_test_cases(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    data, goals, junit = tmp_path / "data", tmp_path / "goals.yaml", tmp_path / "junit.xml"
    for n, pet in enumerate((1.2, 1.4)):
        write_scene(data / f"{n}", pet=pet)
    goals.write_text(GOALS)
    words = ["coverage", str(data), "--goal", str(goals), "--junit", str(junit)]
    assert main([*words, "--plot", str(tmp_path / "p.png")]) == 1
    told = capsys.readouterr().out.splitlines()
    assert " pet 1.5 to 2 s: none of 1 wanted" in told
    assert " event yielding and hour 0 to 12 h: none of 1 wanted" in told
    assert not [line for line in told if "near_miss and hour 0 to 12 h:" in line]
    cases = ElementTree.parse(junit).getroot().iter("testcase")
    assert [(c.get("name"), c.find("failure") is not None) for c in cases] == [
        ("pet", True), ("event x hour", True),
    ]  # fmt: skip
    assert (tmp_path / "p.png").read_bytes().startswith(b"\x89PNG")
    goals.write_text("dimensions: [{cover: event, values: [near_miss], least: 2}]\n")
    assert main(words) == 0
    assert ElementTree.parse(junit).find("testsuite").get("failures") == "0"
    assert main(["coverage", str(data), "--json"]) == 0
    assert main(["coverage", str(tmp_path / "none")]) == 2


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("cover: pet", "cover: pets", "line 4, dimensions[2].cover: must be 'event', "),
        ("1.5 s", "1.5 km", "line 4, dimensions[2].bins[1]: the unit is one of s, ms, min"),
        ("[1 s,", "[9 s,", "line 4, dimensions[2].bins: edges of bins rise"),
        ("[near_miss,", "[near,", "line 2, dimensions[0].values[0]: must be collision, "),
        ("values:", "bins:", "line 2, dimensions[0].bins"),
        ("[event, hour]", "[event, hours]", "line 6, crosses[0].cross[1]: must be 'event', "),
        ("least: 1", "leat: 1", "line 6, crosses[0].leat: there is no such field; is least"),
        ("bins: [0, 12, 24]", "values: [noon]", "line 3, dimensions[1].values: hour is a number"),
        (GOALS, "dimensions: []", "holds no goals"),
        (GOALS, "", "holds fields such as dimensions"),
    ],
)
def test_a_mistake_in_goals_is_named(tmp_path: Path, old: str, new: str, told: str) -> None:
    goals = tmp_path / "goals.yaml"
    goals.write_text(GOALS.replace(old, new))
    with pytest.raises(InputError) as fault:
        read_goals(goals)
    assert told in str(fault.value)


def test_rows_that_fill_ask_for_each_gap_once_and_can_be_read(tmp_path: Path) -> None:
    scene, proof = write_scene(tmp_path / "a")
    encounters = list_encounters(scene, proof)
    rows, left = build_fill(measure_coverage(encounters), encounters)
    file = tmp_path / "rows.jsonl"
    file.write_text("".join(json.dumps(row) + "\n" for row in rows))
    assert read_source(file).rows == len(rows) > 50
    assert {line.split()[0] for line in left} == {
        "asked", "caused_by", "avoidable", "agents",
    }  # fmt: skip
    asked = {json.dumps(row["plan"]["relations"][0]) for row in rows if "relations" in row["plan"]}
    assert any('"target_pet": 7.0' in each for each in asked)
    goals = tmp_path / "goals.yaml"
    goals.write_text(GOALS)
    rows, _ = build_fill(measure_coverage(encounters, read_goals(goals)), encounters)
    assert len(rows) == 4  # three combinations of event and hour, and a PET


def test_a_batch_of_the_fill_closes_the_gaps(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run_jobs_inline(monkeypatch)
    monkeypatch.chdir(tmp_path)
    text = "A car yields to a pedestrian at 8 am"
    Path("rows.jsonl").write_text(json.dumps({"id": "a", "text": text}) + "\n")
    Path("goals.yaml").write_text(GOALS.replace("[1 s, 1.5 s, 2000 ms]", "[1 s, 2 s]"))
    make = ["--refiner", "none", "-q", "--out"]
    assert main(["batch", "rows.jsonl", *make, "first"]) == 0
    card = Path("first/README.md").read_text("utf-8")
    assert "| `event` | 1 of 5 | yielding (1) | collision, near\\_miss, follow, normal |" in card
    cover = ["coverage", "first", "--goal", "goals.yaml"]
    assert main([*cover, "--fill", "fill.jsonl"]) == 1
    assert main(["batch", "fill.jsonl", *make, "second"]) == 0
    assert main([*cover, "second"]) == 0
    # The fill joins the dataset, which is one again: in order, complete, gone on with as before.
    before = {path.name: path.read_bytes() for path in Path("first/a").iterdir()}
    assert main(["dataset", "join", "first", "second"]) == 0
    assert main(cover) == 0
    assert main(["dataset", "check", "first"]) == 0
    assert main(["dataset", "check", "second"]) == 0
    assert {path.name: path.read_bytes() for path in Path("first/a").iterdir()} == before
    card = Path("first/README.md").read_bytes()
    assert b"| instructions given | 5 |" in card
    Path("first/a/scene.json").unlink()
    assert main(["batch", "rows.jsonl", *make, "first"]) == 0
    assert main(["dataset", "check", "first"]) == 0
    assert Path("first/README.md").read_bytes() == card
    # Nothing joins twice, no id is given twice, and what is damaged joins nothing.
    manifest = Path("first/manifest.json").read_bytes()
    assert main(["dataset", "join", "first", "second"]) == 2
    Path("goals.yaml").write_text("dimensions: [{cover: event, values: [yielding], least: 3}]\n")
    assert main([*cover, "--fill", "fill.jsonl"]) == 1
    assert main(["batch", "fill.jsonl", *make, "third"]) == 0
    (made,) = Path("third").glob("fill-*")
    assert not (Path("first") / made.name).exists()
    (made / "proof.json").write_bytes(b"{}")
    assert main(["dataset", "join", "first", "third"]) == 2
    assert Path("first/manifest.json").read_bytes() == manifest


def test_a_sweep_says_which_feasible_values_were_measured(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    run_jobs_inline(monkeypatch)
    monkeypatch.chdir(tmp_path)
    Path("plan.yaml").write_text(
        "agents: [{id: vehicle-1, subtype: [car, truck]}, {id: pedestrian-1}]\n"
        "relations:\n"
        "  - {type: near_miss, from: vehicle-1, to: pedestrian-1, target_pet: 0.8 .. 9 s}\n"
        "measures: [{kind: speed, agent: vehicle-1, value: 6 .. 7 m/s}]\n"
        "context: {density: low}\n"
    )
    words = ["sweep", "plan.yaml", "--n", "8", "--sampling", "boundary", "--out", "swept"]
    assert main([*words, "--refiner", "none", "-q"]) == 0
    capsys.readouterr()
    assert main(["coverage", "swept", "--json"]) == 0
    items = {each["name"]: each for each in json.loads(capsys.readouterr().out)["items"]}
    pet = items["relations[0].target_pet"]
    assert [each["count"] for each in pet["bins"]] == [4]  # of 0.8 s; the bin of 9 s is shut
    assert pet["infeasible"] == ["4.9 to 13.1"]
    assert [each["count"] for each in items["agents[0].subtype"]["bins"]] == [2, 2]
    assert items["measures[0].value"]["values"] == 4
    assert items["measures[0].value"]["gaps"] == []
    folder = Path("swept/scenes/point-00000")
    proof = json.loads((folder / "proof.json").read_text("utf-8"))
    assert len(proof["figures"]["measures"]) == 1
    assert check_again(str(folder)) is None
    del proof["figures"]["measures"]  # as earlier versions wrote it
    (folder / "proof.json").write_text(json.dumps(proof))
    assert check_again(str(folder)) is None
    proof["figures"]["agents"] = 99
    (folder / "proof.json").write_text(json.dumps(proof))
    assert check_again(str(folder)) is not None


@pytest.mark.parametrize(
    ("kind", "from_", "speed"),
    [("angle", 1, 6.0), ("angle", 2, 3.0), ("pedestrian_strike", 2, 6.0)],
)
def test_the_impact_speed_of_a_sweep_is_that_of_who_was_asked(
    kind: str, from_: int, speed: float
) -> None:
    found = re.fullmatch(r"(relations)\[(0)\]\.(impact_speed)", "relations[0].impact_speed")
    asked = {"from": from_, "to": 3 - from_, "type": "collision"}
    evidence = {"relative_speed": 8.0, "speed_from": 6.0, "speed_to": 3.0}
    event = {"from": 1, "to": 2, "type": "collision", "kind": kind, "evidence": evidence}
    assert found is not None
    assert _measure_field(found, {"relations": [asked]}, {"events": [event]}) == speed


def test_a_closing_speed_is_measured_and_cannot_be_asked_for() -> None:
    """No field of a plan asks for it: an impact speed is of one of the two."""
    rows, left = build_fill([count_bins([], [build_bins("closing_speed", (2, 4, 6))])], [])
    assert rows == []
    assert [line.split(" ", 1)[0] for line in left] == ["closing_speed"] * 2
