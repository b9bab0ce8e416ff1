"""Lanes of other formats, and maps written for other tools, are the junction they came from."""

import json

import numpy as np
import pytest

import map_files
from scenewright.cli.import_commands import export_map
from scenewright.errors import InputError
from scenewright.tools.formats.lanelet2 import write_lanelet2
from scenewright.tools.formats.womd import load_scenario_class, write_records
from scenewright.tools.map_import import import_map, list_junctions
from scenewright.tools.map_import.lane_graph import FileLane, LaneGraph
from scenewright.tools.map_import.read_lanelet2 import load_lanelet2


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    return map_files.lanelet2(tmp_path_factory.mktemp("lanes") / "four.osm")


@pytest.fixture(scope="module")
def direct(file):
    return import_map(file, name="x").intersection_map


def commonroad(held, target):
    def bound(side, line):
        points = "".join(f"<point><x>{x:.4f}</x><y>{y:.4f}</y></point>" for x, y in line)
        return f"<{side}>{points}</{side}>"

    sides = [
        bound("leftBound", each.left) + bound("rightBound", each.right)
        for each in held.lanes.values()
    ]
    lanes = "".join(f'<lanelet id="{k}">{each}</lanelet>' for k, each in enumerate(sides, start=1))
    target.write_text(f'<commonRoad commonRoadVersion="2020a">{lanes}</commonRoad>')
    return target


def argoverse(held, target):
    def bound(line):
        return [{"x": float(x), "y": float(y), "z": 0.0} for x, y in line]

    lanes = {
        name: {
            "id": int(name), "lane_type": "VEHICLE",
            "left_lane_boundary": bound(each.left), "right_lane_boundary": bound(each.right),
        }
        for name, each in held.lanes.items()
    }  # fmt: skip
    target.write_text(json.dumps({"lane_segments": lanes, "pedestrian_crossings": {}}))
    return target


def waymo(held, target):
    scenario = load_scenario_class()()
    for name, each in held.lanes.items():
        feature = scenario.map_features.add(id=int(name))
        feature.lane.type = 2
        for x, y in each.line:
            feature.lane.polyline.add(x=x, y=y)
    target.write_bytes(write_records([scenario.SerializeToString()]))
    return target


@pytest.mark.parametrize(
    ("write", "name"),
    [(commonroad, "four.xml"), (argoverse, "four.json"), (waymo, "four.tfrecord")],
)
def test_lanes_of_other_formats_are_the_same_junction(file, direct, tmp_path, write, name):
    target = write(load_lanelet2(file), tmp_path / name)
    made = import_map(target, name="x").intersection_map
    assert {each.id for each in made.movements} == {each.id for each in direct.movements}
    assert [each.legs for each in list_junctions(target).junctions] == [4]


def test_bends_of_the_next_junction_are_not_this_ones(file, tmp_path):
    lanes = load_lanelet2(file).lanes.values()
    pair = {
        f"{k}": FileLane(f"{k}", *(np.clip(x, -30, 30) + np.array([east, 0]) for x in sides))
        for k, (east, sides) in enumerate(
            (east, (each.left, each.right)) for east in (0, 60) for each in lanes
        )
    }
    target = commonroad(LaneGraph(file, pair), tmp_path / "two.xml")
    found = list_junctions(target).junctions
    assert [each.legs for each in found] == [4, 4]
    assert len({each.id for each in found}) == 2
    made = import_map(target, name="x", junction=found[1].id).intersection_map
    assert len(made.legs) == 4


def test_a_map_written_as_lanelet2_is_read_back(direct, tmp_path):
    target = tmp_path / "again.osm"
    target.write_bytes(write_lanelet2(direct, map_files.ORIGIN))
    again = import_map(target, name="x").intersection_map
    assert {each.id for each in again.movements} == {each.id for each in direct.movements}
    assert len(again.crosswalks) == len(direct.crosswalks)


def test_a_map_is_written_by_the_ending_of_the_file(tmp_path):
    export_map("amsterdam_120", str(tmp_path / "a.xodr"))
    assert b"<OpenDRIVE>" in (tmp_path / "a.xodr").read_bytes()
    with pytest.raises(InputError, match=r"as \.xodr or \.osm"):
        export_map("amsterdam_120", str(tmp_path / "a.png"))


@pytest.mark.parametrize("name", ["a.json", "a.tfrecord", "a.xml"])
def test_broken_files_end_in_one_line(tmp_path, name):
    (tmp_path / name).write_text("{}" if name.endswith("json") else "<commonRoad/>")
    with pytest.raises(InputError):
        import_map(tmp_path / name, name="x")


@pytest.mark.parametrize("place", ["1e308", "9e9", "inf"])
def test_a_lane_as_long_as_a_continent_is_refused(tmp_path, place):
    bounds = "".join(
        f"<{side}><point><x>0</x><y>{y}</y></point><point><x>{place}</x><y>{y}</y></point></{side}>"
        for side, y in (("leftBound", 3), ("rightBound", 0))
    )
    file = tmp_path / "far.xml"
    file.write_text(f'<commonRoad><lanelet id="7">{bounds}</lanelet></commonRoad>')
    with pytest.raises(InputError, match=r"lane 7 is .* m long|cannot be read"):
        import_map(file, name="x")
