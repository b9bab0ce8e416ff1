"""Surveys as files, map files before they are read, and the side that lanes show."""

import gzip
import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenewright.errors import InputError
from scenewright.tools.map_import import check_file
from scenewright.tools.map_import.check_file import detect_map_format, is_pbf, unpack_map
from scenewright.tools.map_import.driving_side import (
    find_lane_side,
    find_opendrive_side,
    find_osm_side,
    find_side_of_place,
)
from scenewright.tools.map_import.opendrive_features import OpenDriveFile
from scenewright.tools.map_import.osm_file import OsmFile
from scenewright.tools.map_import.survey import (
    ASSUMED_SIDE,
    DrivingSide,
    Survey,
    SurveyConnection,
    SurveyCrossing,
    SurveyLane,
    SurveyLight,
    describe_strips,
    keep_near,
)
from scenewright.tools.map_import.survey_file import read_survey, write_survey

LINE = np.array([(50.0, 1.5), (12.0, 1.5)])
SURVEY = Survey(
    title="Kreuzung – Straße",
    approaches={"in": SurveyLane("in", LINE, 3.25, 13.9, "Main")},
    exits={"out": SurveyLane("out", LINE[::-1] * [1, -1], 3.0, 8.3, "")},
    connections=(SurveyConnection("in", "out", np.array([(12.0, 1.5), (12.0, -1.5)]), "a", True),),
    crossings=(
        SurveyCrossing(LINE, 4.0, source="way 7", is_bounded=False, limits=LINE + 1.0),
        SurveyCrossing(LINE, 3.0, light="w", is_signalised=True),
    ),
    areas=(np.array([(0.0, 0.0), (5.0, 0.0), (5.0, 5.0)]),),
    lights=(SurveyLight(np.array([12.0, 1.5]), "g"),),
    phases=((20.0, {"a": "green", "w": "red"}), (5.5, {"a": "yellow", "w": "red"})),
    side=DrivingSide(True, "said", against="two roads"),
    is_signalised=True,
    origin=(48.1, 9.2),
    offset=(3.5, -4.25),
    lost=2,
    notes=["a note"],
    drawn={"roads": (LINE,)},
)


def test_a_survey_is_read_as_it_was_written_without_its_pictures():
    survey, options = read_survey(write_survey(SURVEY, name="x", extent=60.0, left_hand=None))
    assert options == {"name": "x", "extent": 60.0, "left_hand": None}
    assert survey.drawn == {}
    for name in ("title", "phases", "side", "is_signalised", "origin", "offset", "file_origin"):
        assert getattr(survey, name) == getattr(SURVEY, name)
    assert (survey.lost, survey.notes, survey.is_roundabout) == (2, ["a note"], False)
    [lane], [held] = survey.approaches.values(), SURVEY.approaches.values()
    assert (lane.id, lane.width, lane.speed, lane.road) == ("in", 3.25, 13.9, "Main")
    assert lane.line == pytest.approx(held.line)
    [way] = survey.connections
    assert (way.approach, way.exit, way.light, way.is_added) == ("in", "out", "a", True)
    first, second = survey.crossings
    assert (first.source, first.is_bounded, first.is_signalised) == ("way 7", False, None)
    assert first.limits == pytest.approx(LINE + 1.0)
    assert (second.limits, second.light, second.is_signalised) == (None, "w", True)
    assert survey.areas[0].shape == (3, 2)
    assert survey.lights[0].place == pytest.approx((12.0, 1.5))
    assert survey.walks == ()


def test_what_was_read_is_written_as_the_same_bytes():
    content = write_survey(SURVEY, name="x")
    survey, options = read_survey(content)
    assert write_survey(survey, **options) == content


@given(st.lists(st.floats(-5e3, 5e3), min_size=4, max_size=4))
def test_places_are_kept_to_a_tenth_of_a_millimetre(numbers):
    line = np.array(numbers).reshape(2, 2)
    survey, _ = read_survey(write_survey(replace(SURVEY, walks=(line, np.empty((0, 2))))))
    assert np.abs(survey.walks[0] - line).max() <= 0.5001e-4
    assert survey.walks[1].shape == (0, 2)


@pytest.mark.parametrize(
    "content",
    [
        b"", b"[]", b"{}", b'{"format": 1, "options": {}, "survey": {}}', b"\xff\xfe",
        b'{"format": 2, "options": {}, "survey": {"title": "x"}}',
        b'{"format": 2, "options": {}, "survey": {"unknown": 1}}',
        write_survey(SURVEY)[:-20],
    ],
)  # fmt: skip
def test_a_damaged_survey_asks_for_the_import_again(content):
    with pytest.raises(InputError) as refused:
        read_survey(content)
    assert str(refused.value) == (
        "survey.json is damaged or of another version; import the map again"
    )


@given(st.floats(-500, 500), st.floats(-500, 500))
def test_a_crossing_moves_with_its_limits_and_nothing_else(east, north):
    crossing = SURVEY.crossings[0]
    moved = crossing.move(np.array([east, north]))
    assert moved.line - crossing.line == pytest.approx(np.tile([east, north], (2, 1)))
    assert moved.limits - crossing.limits == pytest.approx(np.tile([east, north], (2, 1)))
    assert (moved.width, moved.source) == (crossing.width, crossing.source)
    assert SURVEY.crossings[1].move(np.array([east, north])).limits is None


@pytest.mark.parametrize(
    ("side", "line"),
    [
        (DrivingSide(True, "said"), "traffic drives on the left: said"),
        (DrivingSide(False, "said", against="some do not"),
         "traffic drives on the right: said, but some do not"),
        (ASSUMED_SIDE,
         "traffic drives on the right: assumed, the file does not say; --left-hand changes it"),
        (DrivingSide(True, "seen", is_known=False),
         "traffic drives on the left: seen; --right-hand changes it"),
    ],
)  # fmt: skip
def test_the_side_is_said_with_the_option_that_changes_it(side, line):
    assert side.describe() == line


def test_dropped_strips_are_counted():
    assert list(describe_strips([False, False])) == []
    assert list(describe_strips([True, False, True])) == [
        "2 strips narrower than 2 m were dropped: no lanes for cars"
    ]


def test_only_what_comes_near_is_kept_for_pictures_in_metres_from_the_middle():
    middle = np.array([1000.0, 500.0])
    through = np.array([(800.0, 500.0), (1010.0, 500.0)])
    far = np.array([(1131.0, 500.0), (1400.0, 500.0)])
    kept = keep_near({"roads": [through, far, np.empty((0, 2))], "lights": [middle + 5.0]}, middle)
    [road] = kept["roads"]
    assert road == pytest.approx(through - middle)
    assert kept["lights"][0] == pytest.approx((5.0, 5.0))


# Map files before any reader opens them.


@pytest.mark.parametrize(
    ("name", "text", "expected"),
    [
        ("a.osm", "<osm version='0.6'><node id='1'/></osm>", "osm"),
        ("a.osm", "<osm><relation id='1'><tag k='type' v='lanelet'/></relation></osm>", "lanelet2"),
        ("a.osm", "<osm><way id='1'><tag k='name' v='lanelet'/></way></osm>", "osm"),
        ("a.xodr", "<OpenDRIVE><header/></OpenDRIVE>", "opendrive"),
        ("a.net.xml", "<net version='1.0'/>", "sumo"),
        ("a.xml", "<commonRoad/>", "commonroad"),
        ("a.json", "{}", "argoverse2"),
        ("a.tfrecord-00000-of-00150", "", "womd"),
        ("a.pbf", "\0\0\0\x0e\n\tOSMHeader", "osm"),
    ],
)
def test_the_format_is_told_by_the_content(tmp_path, name, text, expected):
    file = tmp_path / name
    file.write_text(text)
    assert detect_map_format(file) == expected
    assert is_pbf(file) is (name == "a.pbf")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("<html><body/></html>", "begins with <html>, so it is none of OpenStreetMap .osm, Lan"),
        (f"<{'x' * 90}/>", f"begins with <{'x' * 40}>, so it is none of"),
        ('<!DOCTYPE osm [<!ENTITY a "b">]><osm/>', ""),
        ("<osm><node></osm>", ""),
        ("", ""),
        ("no map", ""),
    ],
)
def test_what_is_no_map_is_refused_by_its_beginning(tmp_path, text, words):
    file = tmp_path / "a.osm"
    file.write_text(text)
    with pytest.raises(InputError) as refused:
        detect_map_format(file)
    assert str(file) in str(refused.value)
    assert words in str(refused.value)


def test_a_missing_file_and_a_folder_are_refused(tmp_path):
    with pytest.raises(InputError, match=r"^cannot read .*none.osm: No such file"):
        detect_map_format(tmp_path / "none.osm")
    with pytest.raises(InputError, match=r"^cannot read .*: it is no file$"):
        detect_map_format(tmp_path)


@pytest.mark.parametrize(("name", "most"), [("a.xodr", 2), ("a.osm", 6), ("a.pbf", 6)])
def test_a_file_that_is_too_large_is_refused_with_both_sizes(tmp_path, monkeypatch, name, most):
    monkeypatch.setattr(check_file, "MAX_BYTES", 2_000_000)
    monkeypatch.setattr(check_file, "MAX_UNPACKED", 6_000_000)
    file = tmp_path / name
    file.write_bytes(b" " * (most * 1_000_000 + 1_000_000))
    advice = rf"has {most + 1} MB, a map may have {most}; cut out the surroundings of the junction"
    with pytest.raises(InputError, match=advice):
        detect_map_format(file)


def test_a_file_of_too_many_elements_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(check_file, "MAX_ELEMENTS", 3)
    file = tmp_path / "a.osm"
    file.write_text(f"<osm>{'<node/>' * 2}</osm>")
    assert detect_map_format(file) == "osm"
    file.write_text(f"<osm>{'<node/>' * 3}</osm>")
    with pytest.raises(InputError, match=r"has more elements than a map has$"):
        detect_map_format(file)


def test_a_packed_map_is_unpacked_and_a_plain_one_is_itself(tmp_path):
    plain, packed = tmp_path / "a.osm", tmp_path / "a.osm.gz"
    scratch = tmp_path / "scratch"
    scratch.mkdir()
    plain.write_bytes(b"<osm/>")
    packed.write_bytes(gzip.compress(b"<osm/>"))
    assert unpack_map(plain, scratch) == plain
    found = unpack_map(packed, scratch)
    assert (found.parent, found.name, found.read_bytes()) == (scratch, "a.osm", b"<osm/>")


def test_a_bomb_and_a_cut_file_are_refused_on_unpacking(tmp_path, monkeypatch):
    monkeypatch.setattr(check_file, "MAX_UNPACKED", 2_000_000)
    file = tmp_path / "a.osm.gz"
    file.write_bytes(gzip.compress(b" " * 5_000_000))
    with pytest.raises(InputError, match="more than 2 MB once unpacked; cut out the surroundings"):
        unpack_map(file, tmp_path)
    file.write_bytes(gzip.compress(bytes(range(256)) * 50)[:100])
    with pytest.raises(InputError, match=r"is a damaged gzip file; is it cut off\?$"):
        unpack_map(file, tmp_path)


# The side of the road.


def turn(points, degrees):
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    return np.asarray(points, float) @ np.array([[c, s], [-s, c]])


@given(st.floats(0.0, 360.0), st.floats(2.5, 39.0), st.booleans(), st.booleans())
def test_oncoming_lanes_show_the_side_wherever_they_lie(degrees, gap, left, swapped):
    """In right-hand traffic the lane to the east lies to the south of that to the west."""
    aside = gap / 2 if left else -gap / 2
    pair = [[(0, aside), (60, aside)], [(60, -aside), (0, -aside)]]
    lines = [turn(line, degrees) for line in (pair[::-1] if swapped else pair)]
    side = find_lane_side(lines)
    assert side.left_hand is left
    assert side.reason == "1 pairs of opposite lanes indicate it"


@pytest.mark.parametrize(
    "pair",
    [
        [[(0, -2), (60, -2)], [(0, 2), (60, 2)]],
        [[(0, -25), (60, -25)], [(60, 25), (0, 25)]],
        [[(0, -0.5), (60, -0.5)], [(60, 0.5), (0, 0.5)]],
        [[(0, -2), (4, -2)], [(60, 2), (0, 2)]],
        [[(0, -2), (60, -2)], [(200, 2), (140, 2)]],
        [[(0, -2), (60, -2)], [(30, 60), (30, 0)]],
    ],
    ids=["same way", "far", "on each other", "short", "one after the other", "across"],
)
def test_lanes_that_are_no_pair_show_nothing(pair):
    assert find_lane_side([np.array(line, float) for line in pair]) is ASSUMED_SIDE


@pytest.mark.parametrize(
    ("rules", "left", "known", "against"),
    [
        ({}, False, True, None), ({"LHT": 3}, True, True, None), ({"RHT": 3}, False, True, None),
        ({"LHT": 3, "RHT": 1}, True, True, '1 have rule="RHT"'),
        ({"LHT": 2, "RHT": 2}, False, False, '2 have rule="LHT"'),
    ],
)  # fmt: skip
def test_most_roads_of_opendrive_have_the_side(rules, left, known, against):
    drive = object.__new__(OpenDriveFile)
    object.__setattr__(drive, "rules", rules)
    side = find_opendrive_side(drive)
    assert (side.left_hand, side.is_known, side.against) == (left, known, against)


def write_carriageways(count, *, left, **tags):
    """A file of streets, each of two one-way carriageways 12 m apart."""
    nodes, ways = {}, {}
    for k in range(count):
        y = 100.0 * k
        aside = 6.0 if left else -6.0
        for name, ends in (("there", [(0, y + aside), (80, y + aside)]),
                           ("back", [(80, y - aside), (0, y - aside)])):  # fmt: skip
            ids = tuple(f"{k}{name}{j}" for j in (0, 1))
            nodes |= {i: np.array(xy, float) for i, xy in zip(ids, ends, strict=True)}
            road = {"highway": "primary", "oneway": "yes", "name": f"Street {k}"}
            ways[f"{k}{name}"] = road, ids
    return OsmFile(nodes, {"tagged": tags} if tags else {}, ways)


@pytest.mark.parametrize("left", [False, True])
def test_carriageways_of_one_street_show_the_side_where_no_tag_does(left):
    side = find_osm_side(write_carriageways(2, left=left), (0.0, 0.0))
    assert (side.left_hand, side.is_known) == (left, False)
    assert side.reason.startswith("2 roundabouts and pairs of carriageways are drawn for the ")


@pytest.mark.parametrize(("count", "speaks"), [(1, False), (2, True)])
def test_tags_decide_and_what_is_clearly_drawn_else_speaks_against(count, speaks):
    osm = write_carriageways(count, left=True, driving_side="right")
    side = find_osm_side(osm, (0.0, 0.0))
    assert (side.left_hand, side.is_known) == (False, True)
    assert (side.against is not None) == speaks


def test_coordinates_at_zero_are_no_place():
    assert find_side_of_place((0.01, -0.02)) is None
