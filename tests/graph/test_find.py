"""Encounters asked for in words or as a plan, found again in tracks that say nothing of them."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from scenewright import synthesize, verify
from scenewright.cli.main import main
from scenewright.errors import InputError
from scenewright.graph.export import export
from scenewright.graph.find import (
    Hit,
    find_hits,
    list_untestable,
    load_sources,
    read_query,
    save_clip,
)
from scenewright.graph.scene_files import load_scene

TEXTS = (
    "A car yields to a pedestrian and a cyclist follows",
    "A car turning left yields to an oncoming bus",
    "A car hits a pedestrian",
    "A car nearly hits a cyclist",
    "A truck rear-ends a car at 8 m/s",
    "A car tailgates a car",
)
PLACE = "amsterdam_120"


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> dict[str, tuple[Path, Path]]:
    """By text the folder of its scene, and its tracks as a table without a word on what happens."""
    root = tmp_path_factory.mktemp("made")
    found = {}
    for k, text in enumerate(TEXTS):
        folder = synthesize(text, seed=1, refiner="none").save(root / f"scene{k}")
        (table,) = export(folder, "csv", root / f"tracks{k}")
        found[text] = folder, table
    return found


def look(asked: str, path: Path, place: str | None = PLACE) -> list[Hit]:
    query = read_query(asked, intersection=place)
    return [hit for source in load_sources(path, place) for hit in find_hits(query, source)]


@pytest.mark.parametrize("asked", TEXTS)
def test_a_made_scene_is_found_by_its_text_and_by_no_other(
    made: dict[str, tuple[Path, Path]], asked: str
) -> None:
    for text, (folder, table) in made.items():
        hits = look(asked, table)
        assert len(hits) == (text == asked), text
        assert [hit.untested for hit in hits] == [()] * len(hits)
        if hits:
            record = load_scene(folder)
            names = {agent.name: agent.id for agent in record.agents}
            assert hits[0].agents == {name: names[name] for name in hits[0].agents}
            events = {(e.type, frozenset((e.from_, e.to))) for e in hits[0].events}
            assert events == {(r.type, frozenset((r.from_, r.to))) for r in record.relations}


def test_scenes_are_searched_with_their_own_map_and_lights(tmp_path: Path) -> None:
    text = "A car runs a red light and hits a van"
    scene = synthesize(text, seed=1, refiner="none").save(tmp_path / "scene")
    (table,) = export(scene, "csv", tmp_path)
    (hit,) = look(text, scene, None)
    assert hit.events[0].cause == "red_light_run"
    query = read_query(text)
    (tracks,) = load_sources(table)
    lacks = list_untestable(query, tracks)
    assert [lack.partition(":")[0] for lack in lacks] == ["runs_red True", "cause red_light_run"]
    (doubted,) = find_hits(query, tracks)
    assert {*lacks} < {*doubted.untested}
    assert "may be a van" in "".join(doubted.untested)


def test_values_that_a_plan_leaves_open_are_bounds(
    made: dict[str, tuple[Path, Path]], tmp_path: Path
) -> None:
    _, table = made["A car nearly hits a cyclist"]
    (hit,) = look("A car nearly hits a cyclist", table)
    pet = float(hit.events[0].evidence["pet"])
    for low, high, classes, found in (
        (pet - 0.1, pet + 0.1, "[truck, car]", 1),
        (pet - 0.1, pet + 0.1, "[truck, bus]", 0),
        (pet + 0.3, pet + 0.9, "[truck, car]", 0),
    ):
        plan = tmp_path / "plan.yaml"
        plan.write_text(
            f"agents:\n  - {{id: vehicle-1, subtype: {classes}}}\n  - id: cyclist-1\n"
            "relations:\n  - {type: near_miss, from: vehicle-1, to: cyclist-1, "
            f"target_pet: {max(low, 0):.2f} .. {high:.2f} s}}\n"
        )
        assert len(look(str(plan), table)) == found


@pytest.mark.parametrize(
    ("first", "beside", "doubt"),
    [(0.0, 0.0, None), (4.4, 0.0, "no approach"), (0.0, 5.5, "apart")],
)
def test_a_near_miss_of_tracks_is_one_if_they_show_how_near_and_whence(
    tmp_path: Path, first: float, beside: float, doubt: str | None
) -> None:
    table = tmp_path / "tracks.csv"
    rows = ["t,id,class,x,y"]
    for k in range(81):
        t = k / 10
        rows.append(f"{t},4,car,{6 * t - 24},0")
        if t >= first:  # behind the car, or on a way that ends before it
            rows.append(f"{t},5,bicycle,{-1.0 - beside},{4 * t - 21}")
    table.write_text("\n".join(rows))
    (hit,) = look("A car nearly hits a cyclist", table, None)
    assert hit.events[0].type == "near_miss"
    assert doubt in hit.untested[0] if doubt else hit.untested == ()


def test_what_cannot_be_tested_is_named_and_no_hit(
    made: dict[str, tuple[Path, Path]], capsys: pytest.CaptureFixture[str]
) -> None:
    _, table = made["A car turning left yields to an oncoming bus"]
    asked = ["find", "A car turning left yields to an oncoming bus at 8 am", str(table)]
    assert main(asked) == 3
    told = capsys.readouterr().err
    for lack in ("movement left: no map was given", "time_of_day 08:00: the tracks have no time"):
        assert lack in told
    assert main([*asked, "--lenient", "--json"]) == 0
    (hit,) = json.loads(capsys.readouterr().out)["hits"]
    assert len(hit["untested"]) == 3
    assert main(["find", "A taxi turning left yields to a bus", str(table), "--map", PLACE]) == 0
    told = capsys.readouterr()
    assert told.out == "0 hits\n"
    assert "the file says car, which may be a taxi" in told.err
    assert main(["find", "A car brakes hard behind a bus", str(table)]) == 3
    assert "'brakes hard': no field of a plan holds it" in capsys.readouterr().err


def test_a_hit_is_cut_out_and_varied(
    made: dict[str, tuple[Path, Path]],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    _, table = made["A car nearly hits a cyclist"]
    asked = ["find", "A car nearly hits a cyclist", str(table.parent / "*.csv")]
    assert main([*asked, "--map", PLACE, "--out", "clips", "--vary", "like.yaml"]) == 0
    assert "near miss PET" in capsys.readouterr().out
    record, proof = load_scene("clips/001"), verify("clips/001")
    assert [row.type for row in record.events] == ["near_miss"]
    assert [each.state for each in proof.account] == ["seen"] * 4
    assert {each.rule for each in proof.missing} <= {"journey_contradicted"}
    assert main(["show", "clips/001", "--png", "clip.png"]) == 0
    assert main(["export", "clips/001", "--to", "csv", "--out", "again"]) == 0
    (again,) = Path("again").glob("*.csv")
    assert len(look(asked[1], again)) == 1
    assert main(["plan", "like.yaml"]) == 0
    assert main(["find", "like.yaml", str(table)]) == 0
    assert "1 hit\n" in capsys.readouterr().out
    assert main(["sweep", "like.yaml", "--n", "1", "--refiner", "none", "--out", "swept"]) == 0
    assert ",made," in Path("swept/points.csv").read_text()
    (without_map,) = look(asked[1], table, None)
    with pytest.raises(InputError, match="needs a map"):
        save_clip(without_map, tmp_path / "no")


def test_files_that_cannot_be_read_are_named(
    made: dict[str, tuple[Path, Path]], capsys: pytest.CaptureFixture[str]
) -> None:
    _, table = made["A car hits a pedestrian"]
    assert main(["find", "A car hits a pedestrian", "nowhere.csv", str(table), "--json"]) == 2
    told = capsys.readouterr()
    found = json.loads(told.out)
    assert len(found["hits"]) == 1
    assert "nowhere.csv" in found["unusable"][0]
    assert "nowhere.csv" in told.err


def test_agents_that_no_relation_binds_are_found_too(tmp_path: Path) -> None:
    rows = ["t,id,class,x,y"]
    for k in range(60):
        t = k / 10
        rows.append(f"{t},7,truck,{8 * t:.2f},0")
        rows.append(f"{t + 20},8,truck,{8 * t:.2f},0")
        rows.append(f"{t},9,pedestrian,{t:.2f},30")
    table = tmp_path / "two.csv"
    table.write_text("\n".join(rows))
    plan = tmp_path / "plan.yaml"
    plan.write_text("agents:\n  - {id: vehicle-1, subtype: truck}\n  - id: pedestrian-1\n")
    assert [hit.agents for hit in look(str(plan), table, None)] == [
        {"vehicle-1": 7, "pedestrian-1": 9}
    ]
