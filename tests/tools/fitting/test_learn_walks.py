"""Where people walk: crosswalks and sidewalks move there, and it is said."""

import json

import numpy as np
import pytest

import map_files
from scenewright.cli.custom_intersections import fit_own, import_file
from scenewright.cli.options import FitOptions, ImportOptions
from scenewright.intersections import load_map
from scenewright.tools.fitting.learn_walks import learn_crossings, learn_sidewalks
from scenewright.tools.map_import import import_map
from scenewright.tools.map_import.survey_file import read_survey, write_survey


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    return map_files.lanelet2(tmp_path_factory.mktemp("map") / "four.osm")


@pytest.fixture(scope="module")
def place(file):
    return import_map(file, name="four").intersection_map


def walk_across(place, leg, outwards, count, spread=0.4, beyond=12.0):
    """[T, 2] of people who cross a leg so far outwards of its crosswalk [m]."""
    rng = np.random.default_rng(3)
    walk = next(each for each in place.crosswalks if each.leg == leg)
    ends, bearing = np.array(walk.centreline), next(x.bearing for x in place.legs if x.name == leg)
    out = np.array([np.cos(bearing), np.sin(bearing)])
    ahead = (ends[1] - ends[0]) / np.hypot(*(ends[1] - ends[0]))
    for _ in range(count):
        begin, end = ends + outwards * out + spread * rng.standard_normal() * out
        begin, end = begin - beyond * ahead, end + beyond * ahead
        length = float(np.hypot(*(end - begin)))
        yield begin + np.arange(0.0, length, 0.14)[:, None] * (end - begin) / length


def test_the_crosswalk_of_a_leg_is_where_enough_people_cross_it(place):
    tracks = [*walk_across(place, "east", 6.0, 9), *walk_across(place, "north", -2.0, 3)]
    (found,) = learn_crossings(place, tracks)
    assert (found.leg, found.walkers, found.others) == ("east", 9, 0)
    assert found.moved == pytest.approx(6.0, abs=0.4)
    assert abs(found.across @ (1.0, 0.0)) < 0.1


def test_people_who_cross_anywhere_or_walk_along_the_road_make_no_crosswalk(place):
    anywhere = [each for d in (-8, -4, 0, 6, 11, 16) for each in walk_across(place, "east", d, 1)]
    along = [np.column_stack([np.arange(10, 50, 0.14), np.full(286, 0.2)])] * 8
    assert learn_crossings(place, anywhere) == learn_crossings(place, along) == []


def test_ground_that_three_people_walk_on_is_sidewalk(place):
    road = max(x for area in place.road for x, y in area.exterior if abs(y) > place.extent - 1)
    x = road + 4.0  # beyond the derived three metres
    path = np.column_stack([np.full(160, x), np.linspace(20.0, 42.0, 160)])
    tracks = [path + np.array([0.15 * k, 0.0]) for k in range(3)]
    (outline,) = learn_sidewalks(place, tracks)
    assert outline[:, 0].min() > road + 2.5
    assert learn_sidewalks(place, tracks[:2]) == []


def test_a_survey_comes_back_as_it_was_written(file):
    survey = import_map(file, name="four").survey
    again, options = read_survey(write_survey(survey, extent=None, signals="keep"))
    assert options == {"extent": None, "signals": "keep"}
    assert again.approaches.keys() == survey.approaches.keys()
    assert write_survey(again) == write_survey(survey)


def test_fit_moves_a_derived_crosswalk_and_says_so(file, place, tmp_path, monkeypatch):
    (tmp_path / "own").mkdir(exist_ok=True)
    monkeypatch.setenv("SCENEWRIGHT_INTERSECTIONS", str(tmp_path / "own"))
    import_file(str(file), ImportOptions(name="four"), log=print)
    rows = ["t,id,class,x,y"]
    for n, xy in enumerate(walk_across(place, "east", 5.0, 8, beyond=4.0)):
        rows += [
            f"{9 * n + k / 10:.1f},{n},pedestrian,{x:.3f},{y:.3f}" for k, (x, y) in enumerate(xy)
        ]
    tracks = tmp_path / "walkers.csv"
    tracks.write_text("\n".join(rows) + "\n")
    facts = fit_own("four", [str(tracks)], FitOptions(), log=lambda *_: None)
    assert any("east: 8 people cross" in note for note in facts["notes"]), facts["notes"]
    moved = {each.leg: np.mean(each.centreline, axis=0) for each in load_map("four").crosswalks}
    old = {each.leg: np.mean(each.centreline, axis=0) for each in place.crosswalks}
    assert np.hypot(*(moved["east"] - old["east"])) == pytest.approx(5.0, abs=0.6)
    assert np.allclose(moved["west"], old["west"], atol=0.01)
    report = json.loads((tmp_path / "own" / "four" / "report.json").read_text())
    origins = {each["leg"]: each["origin"] for each in report["crosswalks"]}
    assert (origins["east"], origins["west"]) == ("learned", "derived")
    stop = next(each for each in load_map("four").stop_lines if each.leg == "east")
    assert np.mean(stop.line, axis=0)[0] > moved["east"][0]
