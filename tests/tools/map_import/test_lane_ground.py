"""Lanes of a file and how they follow, the ground of roads, crosswalks on it, and their account."""

import math
from pathlib import Path

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from scenewright.errors import InputError
from scenewright.tools.map_import.ground_areas import (
    CrosswalkPlacement,
    build_road,
    build_sidewalks,
    build_square,
    list_polygons,
    place_crosswalk,
)
from scenewright.tools.map_import.lane_graph import FileLane, LaneGraph
from scenewright.tools.map_import.legs import SurveyLeg
from scenewright.tools.map_import.map_parts import (
    build_area,
    build_lanelet,
    build_pedestrian_routes,
    build_ring,
    list_lines,
    list_points,
    round_points,
)
from scenewright.tools.map_import.mapped_crosswalks import build_area_crossing
from scenewright.tools.map_import.quality_report import (
    CrosswalkFact,
    build_report,
    format_report,
    rate_crosswalks,
)
from scenewright.tools.map_import.rings import find_rings
from scenewright.tools.map_import.survey import ReportItem, SurveyLane


def turn(points, degrees):
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    return np.asarray(points, float) @ np.array([[c, s], [-s, c]])


def make_lane(name, first, last, *, width=3.5, degrees=0.0):
    """A straight lane along x."""
    sides = ([(first, y), (last, y)] for y in (width / 2, -width / 2))
    return FileLane(name, *(turn(side, degrees) for side in sides))


def make_graph(*lanes):
    return LaneGraph(Path("a.xml"), {lane.id: lane for lane in lanes})


@given(st.floats(2.0, 100.0), st.floats(1.0, 8.0), st.floats(0.0, 360.0))
def test_the_middle_and_width_of_a_lane_are_those_of_its_bounds(length, width, degrees):
    lane = make_lane("x", 0.0, length, width=width, degrees=degrees)
    assert lane.width == pytest.approx(width)
    assert lane.line[[0, -1]] == pytest.approx(turn([(0, 0), (length, 0)], degrees), abs=1e-9)
    assert shapely.Polygon(lane.outline).area == pytest.approx(length * width)


def test_a_lane_longer_than_any_is_refused():
    with pytest.raises(InputError, match=r"^lane x is 2\.5e\+04 m long; this cannot be$"):
        make_lane("x", 0.0, 25_000.0)


@pytest.mark.parametrize(("gap", "follows"), [(0.0, True), (0.5, True), (-0.5, True), (0.7, False)])
@pytest.mark.parametrize("degrees", [0.0, 111.0])
def test_a_lane_follows_where_its_bounds_begin_within_reach(gap, follows, degrees):
    graph = make_graph(
        make_lane("a", 0, 20, degrees=degrees), make_lane("b", 20 + gap, 50, degrees=degrees)
    )
    assert graph.follows == {"a": ["b"] if follows else [], "b": []}
    assert graph.leads_to == {"a": [], "b": ["a"] if follows else []}


def test_a_lane_that_becomes_wider_follows_by_one_bound():
    wide = FileLane("b", np.array([(20, 1.75), (50, 1.75)]), np.array([(20, -5.0), (50, -5.0)]))
    assert make_graph(make_lane("a", 0, 20), wide).follows["a"] == ["b"]
    # Not where both bounds of another lane meet, and of another one those of the wide lane.
    before = FileLane("d", np.array([(0, 1.75), (20, 1.75)]), np.array([(0, -5.0), (20, -5.0)]))
    graph = make_graph(make_lane("a", 0, 20), make_lane("c", 20, 50), wide, before)
    assert graph.follows == {"a": ["c"], "b": [], "c": [], "d": ["b"]}


def test_lanes_without_room_for_cars_are_dropped_and_counted():
    lanes = [make_lane("a", 0, 20), make_lane("b", 0, 20, width=1.9)]
    graph = LaneGraph.build(Path("a.xml"), lanes, 3, "more")
    assert list(graph.lanes) == ["a"]
    strips, others, more = graph.notes
    assert strips == "1 strips narrower than 2 m were dropped: no lanes for cars"
    assert others.startswith("3 lanes were dropped: car parks")
    assert more == "more"


def test_lanes_on_a_place_are_those_whose_middle_meets_it():
    graph = make_graph(make_lane("b", 0, 20), make_lane("a", 20, 50))
    assert graph.list_on(shapely.box(15, -1, 25, 1)) == ["a", "b"]
    assert graph.list_on(shapely.box(30, 1, 40, 2)) == []


@pytest.mark.parametrize(("clockwise", "degrees"), [(False, 0.0), (True, 0.0), (True, 70.0)])
def test_a_ring_of_lanes_is_found_with_its_sense(clockwise, degrees):
    step = -1 if clockwise else 1
    lines = {}
    for k in range(4):
        t = step * np.linspace(k, k + 1, 20) * math.pi / 2
        lines[str(k)] = turn(18.0 * np.column_stack([np.cos(t), np.sin(t)]), degrees)
    [ring] = find_rings(lines, {str(k): [str((k + 1) % 4)] for k in range(4)})
    assert sorted(ring.lanes) == ["0", "1", "2", "3"]
    assert ring.is_left is not clockwise
    assert find_rings(lines, {"0": ["1"], "1": ["2"], "2": ["3"], "3": []}) == []


def test_gaps_between_lanes_and_small_islands_are_paved():
    lanes = [(np.array([(-40.0, y), (40.0, y)]), 3.0) for y in (0.0, 6.0)]
    assert build_road(lanes, []).area == pytest.approx(80 * 9.0, rel=0.02)
    ring = [shapely.box(0, 0, 30, 30).difference(shapely.box(9, 9, 21, 21 - cut)) for cut in (0, 3)]
    for shape, holes in zip(ring, (1, 0), strict=True):
        sides = [
            np.array(part.exterior.coords)
            for part in (shape.intersection(shapely.box(0, 0, 15, 30)),
                         shape.intersection(shapely.box(15, 0, 30, 30)))
        ]  # fmt: skip
        assert len(build_road([], sides).interiors) == holes


def test_of_roads_apart_the_larger_is_kept_and_sidewalks_lie_outside():
    lanes = [(np.array([(-40.0, 0.0), (40.0, 0.0)]), 6.0), (np.array([(0, 60.0), (9, 60)]), 3.0)]
    road = build_road(lanes, [])
    assert road.bounds == pytest.approx((-40, -3, 40, 3), abs=0.05)
    walks = build_sidewalks(road, 30.0)
    assert walks.intersection(road).area == pytest.approx(0.0, abs=1e-6)
    assert walks.area == pytest.approx(2 * 60 * 3.0, rel=0.01)
    assert build_square(30.0).contains(walks)


@pytest.mark.parametrize("degrees", [0.0, 45.0, 200.0])
def test_a_derived_crosswalk_lies_square_across_past_the_kerb(degrees):
    a = SurveyLane("in", turn([(80, 2), (10, 2)], degrees), 4.0, 13.9, "")
    b = SurveyLane("out", turn([(10, -2), (80, -2)], degrees), 4.0, 13.9, "")
    throat, outwards = turn([(10, 0), (1, 0)], degrees)
    leg = SurveyLeg(math.radians(degrees), (a,), (b,), throat, outwards)
    road = shapely.Polygon(turn([(-20, -4), (80, -4), (80, 4), (-20, 4)], degrees))
    placed, why = place_crosswalk(leg, road, None, room=40.0)
    assert why == ""
    assert placed.distance == pytest.approx(0.6 + 4.0 / 2)
    assert placed.ends == pytest.approx(turn([(12.6, 4), (12.6, -4)], degrees))
    assert placed.area.area == pytest.approx(8 * 4.0)
    assert place_crosswalk(leg, shapely.box(500, 500, 600, 600), None, room=40.0) == (None, "")


@given(st.floats(0.0, 180.0), st.floats(6.0, 20.0), st.floats(1.0, 5.0))
def test_a_drawn_area_is_a_crossing_along_its_longer_side(degrees, length, width):
    box = [(0, 0), (length, 0), (length, width), (0, width)]
    crossing = build_area_crossing(turn(box, degrees), "ours")
    ends = turn([(0, width / 2), (length, width / 2)], degrees)
    assert min(np.abs(crossing.line - x).max() for x in (ends, ends[::-1])) < 1e-6
    assert (crossing.width, crossing.source) == (pytest.approx(width), "ours")


def test_points_rings_and_areas_are_rounded_open_and_counter_clockwise():
    assert str(round_points([(-0.0001, 1.23456)])) == "((0.0, 1.235),)"
    hole = [(2, 2), (2, 4), (4, 4), (4, 2)]
    area = build_area(shapely.Polygon([(0, 0), (0, 9), (9, 9), (9, 0)], [hole]))
    for ring, expected in ((area.exterior, 81.0), (area.holes[0], 4.0)):
        assert len(ring) == 4
        x, y = np.array(ring).T
        assert (x * np.roll(y, -1) - y * np.roll(x, -1)).sum() / 2 == pytest.approx(expected)
    doubled = shapely.Polygon([(0, 0), (0.0001, 0), (5, 0), (5, 5)])
    assert len(build_ring(doubled)) == 3


def test_parts_of_geometries_are_listed_by_kind():
    line, point, empty = shapely.LineString([(0, 0), (2, 0)]), shapely.Point(5, 5), shapely.Point()
    mixed = shapely.GeometryCollection([line, point, shapely.box(0, 0, 2, 2), empty])
    assert list_lines(mixed) == [line]
    assert [p.area for p in list_polygons(mixed)] == [4.0]
    assert [(p.x, p.y) for p in list_points(mixed)] == [(1, 0), (5, 5), (1, 1)]


def test_the_left_bound_of_a_lanelet_lies_on_the_left():
    lanelet = build_lanelet(
        np.array([(0.0, 0.0), (9.0, 0.0)]), width=3.0, speed_limit=13.88889,
        id="x", kind="approach", leg="west",
    )  # fmt: skip
    assert lanelet.left == ((0.0, 1.5), (9.0, 1.5))
    assert lanelet.right == ((0.0, -1.5), (9.0, -1.5))
    assert lanelet.speed_limit == 13.889


def test_every_crosswalk_has_its_routes_both_ways_and_jaywalking():
    routes = list(build_pedestrian_routes(["north", "east"]))
    assert len(routes) == len({route.id for route in routes}) == 2 * 2 * (4 + 1)
    assert sum(route.movement == "jaywalking" for route in routes) == 4
    assert {(r.entry, r.exit) for r in routes if r.crosswalk == "north"} == {
        ("west", "east"), ("east", "west"),
    }  # fmt: skip


def make_fact(origin, offset=None, left_out=()):
    return CrosswalkFact("north", origin, offset, offset, ("way 1",), None, (), None, left_out)


@pytest.mark.parametrize(
    ("facts", "state", "score"),
    [
        ([make_fact("derived")], "derived", None),
        ([make_fact("file", 1.5)], "read", 1.0),
        ([make_fact("file", 1.6)], "read", 0.5),
        ([make_fact("file", 0.1, ("x is drawn twice",))], "read", 1.0),
        ([make_fact("file", 0.1, ("x is off",))], "read", 0.5),
        ([make_fact("file", 0.1), make_fact("derived", None, ("x is off",))], "partly read", 0.5),
        ([make_fact("none", None, ("x is off",))], "derived", 0.0),
    ],
)
def test_crosswalks_count_by_how_near_they_lie_to_the_files(facts, state, score):
    item = rate_crosswalks(facts)
    assert (item.state, item.score) == (state, score)


def test_the_score_of_a_report_is_the_mean_of_what_is_known():
    items = [ReportItem("a", "read", 1.0, ""), ReportItem("b", "none", None, "")]
    items.append(ReportItem("c", "assumed", 0.5, ""))
    report = build_report(items, [make_fact("file", 1.0)], ["note"])
    assert (report["score"], report["notes"]) == (0.75, ["note"])
    assert format_report(report) == (
        "as in the file: a read (1.00); b none; c assumed (0.50), 0.75 of what the file says"
    )
    unknown = build_report(items[1:2], [], [])
    assert unknown["score"] is None
    assert format_report(unknown) == "as in the file: b none"


@given(st.floats(0.0, 360.0), st.floats(-8.0, 8.0))
def test_crosswalks_that_cross_do_so_in_any_order_and_turned(degrees, shift):
    first, second = (
        CrosswalkPlacement(0.0, turn(ends, degrees), 3.0)
        for ends in ([(-20, 0), (20, 0)], [(shift, -20), (shift, 20)])
    )
    assert first.crosses(second)
    assert second.crosses(first)
