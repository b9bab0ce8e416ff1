"""The shipped plans of consumer tests and regulations: sources, ranges, and that each is a plan."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import pytest

from inline_jobs import run_jobs_inline
from scenewright.cli.catalogue import read_catalogue
from scenewright.cli.main import main
from scenewright.dataset.batch.sweep import build_points
from scenewright.scene.plan_file import read_logical_plan

FOLDER, SOURCES = read_catalogue()
PLANS = sorted(SOURCES["plans"])


def test_every_file_has_a_source_and_every_source_a_file() -> None:
    files = [file.name.removesuffix(".yaml") for file in FOLDER.iterdir() if "yaml" in file.name]
    assert sorted(files) == PLANS
    assert 15 <= len(PLANS) <= 30
    for each in SOURCES["plans"].values():
        assert list(each) == ["title", "document", "section", "gives", "lacks"]
        assert len(each["document"]) > 20
    assert SOURCES["absent"]


@pytest.mark.parametrize("name", PLANS)
def test_a_shipped_plan_is_one_at_all_its_corners(name: str) -> None:
    with (FOLDER / f"{name}.yaml").open("rb") as file:
        logical = read_logical_plan(Path(file.name))
    points = build_points(logical, 1000, sampling="boundary", seed=0, place="amsterdam_120")
    assert [each.fault for each in points if each.fault is not None] == []
    assert [edge["type"] for edge in logical.data["relations"]] in (["collide_at"], ["near_miss"])


def test_values_of_un_r171_are_those_of_its_annex() -> None:
    asked = {}
    for name in (each for each in PLANS if each.startswith("unr171")):
        with (FOLDER / f"{name}.yaml").open("rb") as file:
            logical = read_logical_plan(Path(file.name))
        # In a file of 3.6 km/h to the m/s: the other road user's speed, and where it is struck.
        speed, *points = logical.data["measures"][1:]
        spread = logical.spreads.get(("measures", 1, "value"))
        top = spread.compute_value(1.0) if spread else speed["value"]
        asked[name] = [round(3.6 * top), *(each["value"] for each in points)]
    middle = ["50 %"]
    assert asked == {
        "unr171-pedestrian": [5, middle], "unr171-bicycle": [15, middle],
        "unr171-pedestrian-turn": [5, middle], "unr171-bicycle-turn": [15, middle],
        "unr171-oncoming": [60], "unr171-crossing": [60, middle, ["25 %"]],
    }  # fmt: skip


@pytest.mark.parametrize("name", ["cbna"])
def test_a_plan_of_the_catalogue_is_made_as_a_sweep(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run_jobs_inline(monkeypatch)
    words = ["catalogue", "make", name, "--n", "2", "--refiner", "none", "-q"]
    assert main([*words, "--out", str(tmp_path)]) == 0
    table = (tmp_path / name / "points.csv").read_text("utf-8").splitlines()
    rows = list(csv.DictReader(table))
    assert rows[0]["status"] == "made"
    proof = json.loads((tmp_path / name / rows[0]["folder"] / "proof.json").read_text("utf-8"))
    (event,) = proof["events"]
    assert event["type"] == "collision"
    speed = next(each for each in proof["figures"]["measures"] if each["kind"] == "speed")
    asked = float(rows[0]["measures[0].value"])
    assert speed["values"] == [pytest.approx(asked, abs=0.5)]


def test_a_plan_is_shown_with_its_source_and_can_be_swept(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    assert main(["catalogue", "show", "cpna"]) == 0
    shown = capsys.readouterr().out
    assert shown.startswith(
        "# title: Car to adult crossing from the nearside\n# document: Euro NCAP"
    )
    (tmp_path / "cpna.yaml").write_text(shown)
    assert len(read_logical_plan(tmp_path / "cpna.yaml").spreads) == 3
    assert main(["catalogue", "list"]) == 0
    listed = capsys.readouterr().out
    assert all(f" {name} " in listed for name in PLANS)
    assert "none of UN R171, Annex 4, 4.2.5.2.1 to 4.2.5.2.8: " in listed
    assert main(["catalogue", "show", "nothing"]) == 2
    assert main(["catalogue", "make"]) == 2
    assert main(["catalogue", "make", "cpna", "--all"]) == 2
