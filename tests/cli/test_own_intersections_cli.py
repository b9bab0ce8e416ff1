"""The tutorial's way: a map file in, tracks or simulation in, verified scenes out."""

import importlib.util
import json
import os
import re
import shlex
import sys
from pathlib import Path

import numpy as np
import pytest
from rerun.chunk import RrdReader

sys.path.insert(0, str(Path(__file__).parents[1] / "tools"))
import map_files
from scenewright.cli.main import main
from scenewright.graph.run import ground_of
from scenewright.intersections import check_bundle, list_intersections, load_map
from scenewright.tools.track_io import load_recordings

TAF = os.environ.get("SCENEWRIGHT_TAF_BW")
"""A copy of the TAF-BW data set (docs/own-intersection.md); not part of the project."""


@pytest.fixture(autouse=True)
def own(tmp_path, monkeypatch):
    (tmp_path / "own").mkdir(exist_ok=True)
    monkeypatch.setenv("SCENEWRIGHT_INTERSECTIONS", str(tmp_path / "own"))
    monkeypatch.chdir(tmp_path)
    return tmp_path / "own"


def given(capsys):
    return json.loads(capsys.readouterr().out)


def make(name, text, capsys, seed=1):
    words = ["make", text, "--intersection", name, "--refiner", "none", "--seed", str(seed)]
    code = main([*words, "--no-picture", "--no-recording", "--json", "-q", "--out", f"s{seed}"])
    return code, given(capsys)


def test_a_map_alone_is_enough_for_a_verified_scene(tmp_path, capsys):
    file = map_files.lanelet2(tmp_path / "four.osm")
    assert main(["intersections", "import", str(file), "--name", "mine", "-q", "--json"]) == 0
    facts = given(capsys)
    assert facts["format"] == "Lanelet2"
    assert any("crosswalk derived on" in line for line in facts["notes"])
    report = json.loads((Path(facts["folder"]) / "report.json").read_text())
    assert {item["item"]: item["state"] for item in report["items"]}["crosswalks"] == "partly read"
    assert (Path(facts["folder"]) / "report.png").read_bytes()[:4] == b"\x89PNG"
    check_bundle(Path(facts["folder"]), "report.json")
    assert "mine" in list_intersections()
    code, made = make("mine", "A vehicle yields to a pedestrian at 8 am", capsys)
    assert (code, made["verified"]) == (0, True)
    assert main(["verify", "s1"]) == 0


def test_any_text_is_a_name_and_the_short_form_is_shown(tmp_path, own, capsys):
    file = map_files.lanelet2(tmp_path / "four.osm")
    for text, short in (("Müllerstraße / King's Cross", "mullerstrasse-king-s-cross"),
                        ("../x", "x"), ("交差点", "place-85f1b218")):  # fmt: skip
        assert main(["intersections", "import", str(file), "--name", text]) == 0
        printed = capsys.readouterr()
        assert printed.out.strip().endswith(f"/{short}")
        assert f"{text!r} is called {short} in commands" in printed.err
    assert sorted(each.name for each in own.iterdir()) == sorted(
        ["mullerstrasse-king-s-cross", "x", "place-85f1b218"]
    )
    assert "x" in list_intersections()


@pytest.mark.parametrize(("options", "drawn"), [([], False), (["--samples"], True)])
def test_the_picture_has_paths_of_the_priors_only_if_asked(tmp_path, monkeypatch, options, drawn):
    seen = []
    monkeypatch.setattr(
        "scenewright.viz.intersection_picture.draw_intersection",
        lambda _, **given: seen.append(len(given["samples"]) > 0),
    )
    assert main(["intersections", "show", "amsterdam_120", "--png", "x.png", *options]) == 0
    assert seen == [drawn]


def test_a_process_that_lives_on_uses_the_map_as_it_is_now(tmp_path):
    file = map_files.lanelet2(tmp_path / "four.osm")
    words = ["intersections", "import", str(file), "--name", "mine", "-q"]
    assert main(words) == 0
    before = ground_of("mine")
    assert before.intersection_map.signals is None
    assert ground_of("mine") is before
    assert main([*words, "--force", "--signals", "assume"]) == 0
    assert ground_of("mine").intersection_map is load_map("mine")
    assert ground_of("mine").intersection_map.signals is not None


def test_what_cannot_be_used_is_one_line_and_leaves_nothing(tmp_path, own, capsys):
    file = map_files.lanelet2(tmp_path / "four.osm")
    torn = tmp_path / "torn.osm"
    torn.write_bytes(file.read_bytes()[:2000])
    for words in (
        [str(torn), "--name", "x"],
        [str(file), "--name", "amsterdam_120"],
        [str(file), "--name", "x", "--center", "here"],
        [str(file), "--name", "x", "--extent", "5"],
        ["missing.osm", "--name", "x"],
    ):
        assert main(["intersections", "import", *words, "-q"]) == 2
        said = capsys.readouterr().err.strip()
        assert said.startswith("scenewright: ")
        assert "\n" not in said
    assert not own.exists() or list(own.iterdir()) == []
    assert main(["intersections", "fit", "amsterdam_120", str(file)]) == 2
    assert "import" in capsys.readouterr().err


def driven(line=((-2.0, 80.0), (-2.0, -73.0))):
    """A CSV of eight cars along a line at 9 m/s; else from the north to the south."""
    line = np.asarray(line)
    s = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(line, axis=0).T))])
    way = np.arange(0.0, s[-1], 0.9)
    x, y = (np.interp(way, s, line[:, axis]) for axis in (0, 1))
    rows = [
        f"{20 * n + k / 10},{n},{x[k] + 0.1 * (n % 3):.3f},{y[k]:.3f}"
        for n in range(8)
        for k in range(len(way))
    ]
    return "time,who,east,north\n" + "\n".join(rows) + "\n"


def test_tracks_are_fitted_and_drawn(tmp_path, own, capsys):
    file = map_files.lanelet2(tmp_path / "four.osm")
    main(["intersections", "import", str(file), "--name", "mine", "-q"])
    Path("tracks.csv").write_text(driven())
    capsys.readouterr()
    columns = "t=time,id=who,class==car,x=east,y=north"
    words = ["intersections", "fit", "mine", "tracks.csv", "--columns", columns, "--start", "8:30"]
    assert main([*words, "-q", "--json"]) == 0
    assert given(capsys)["matched"] == {"vehicle:north>south:straight": 8}
    assert main(["intersections", "show", "mine", "--png", "mine.png"]) == 0
    assert Path("mine.png").read_bytes().startswith(b"\x89PNG")
    assert main(["intersections", "show", "mine", "--rrd", "mine.rrd"]) == 0
    shown = {chunk.entity_path for chunk in RrdReader("mine.rrd").stream()}
    for each in ("/map/road", "/map/legs", "/movements", "/tracks", "/priors/vehicle", "/about"):
        assert any(path.startswith(each) for path in shown), each
    capsys.readouterr()
    assert make("mine", "A car from the north follows another car", capsys)[0] == 0
    assert not any(each.name.startswith(".") for each in own.iterdir())


@pytest.mark.skipif(importlib.util.find_spec("sumo") is None, reason="SUMO is not installed")
def test_traffic_is_simulated_on_a_map_without_data(tmp_path, own, capsys):
    net = map_files.sumo_net(tmp_path / "t.net.xml", (0, 90, 180))
    main(["intersections", "import", str(net), "--name", "tee", "-q"])
    capsys.readouterr()
    words = ["--minutes", "10", "--corpus", "tee.npz", "-q", "--json"]
    assert main(["intersections", "simulate", "tee", *words]) == 0
    facts = given(capsys)
    assert [each.name for each in load_recordings(Path("tee.npz"))] == ["tee piece 0 hour 08"]
    assert facts["trips"] > 50
    assert facts["walks"] > 3
    check_bundle(own / "tee")
    weights = (own / "tee" / "refiner.safetensors").read_bytes()
    assert "scenewright intersections simulate tee" in (own / "tee" / "refiner.md").read_text()
    line = next(m for m in load_map("tee").movements if m.turn == "straight").centreline
    Path("tracks.csv").write_text(driven(np.array(line)))
    columns = "t=time,id=who,class==car,x=east,y=north"
    assert main(["intersections", "fit", "tee", "tracks.csv", "--columns", columns, "-q"]) == 0
    assert (own / "tee" / "refiner.safetensors").read_bytes() == weights
    capsys.readouterr()
    code, made = make("tee", "A vehicle turning left yields to another vehicle", capsys)
    assert (code, made["verified"]) == (0, True)


@pytest.mark.skipif(TAF is None, reason="SCENEWRIGHT_TAF_BW names no copy of the data set")
def test_the_tutorial_runs_as_it_is_written(capsys):
    page = (Path(__file__).parents[2] / "docs" / "own-intersection.md").read_text("utf-8")
    [block] = re.findall(r"^```sh\n(.*?)^```$", page, re.DOTALL | re.MULTILINE)
    commands = [line for line in block.splitlines() if line.startswith("scenewright ")]
    assert len(commands) > 5
    for command in commands:
        words = shlex.split(command.replace("$TAF", str(TAF)))
        assert main(words[1:]) == 0, f"{command}\n{capsys.readouterr().err}"


@pytest.mark.skipif(TAF is None, reason="SCENEWRIGHT_TAF_BW names no copy of the data set")
def test_pooling_foretells_real_tracks_of_another_recording_better(capsys):
    folder = Path(str(TAF)) / "datasets"
    words = ["intersections", "import", str(folder / "maps" / "k729_2022-03-16.osm")]
    assert main([*words, "--name", "k729", "-q"]) == 0
    tracks = str(folder / "recorded_trackfiles" / "k729_2022-03-16")
    capsys.readouterr()
    assert main(["intersections", "fit", "k729", tracks, "-q", "--json"]) == 0
    fitted = given(capsys)
    assert sum(fitted["matched"].values()) > 50
    for row in fitted["heldout"]:
        assert row["pooled_nll"] < row["unpooled_nll"]
