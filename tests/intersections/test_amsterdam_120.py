"""The shipped map: what anybody who reads it relies on."""

import math
from itertools import combinations

import numpy as np
import pytest
import shapely

from scenewright.errors import InputError
from scenewright.intersections import find_bundle_folder, list_intersections, load_map

LEFT = {"north": "east", "east": "south", "south": "west", "west": "north"}
RIGHT = {"north": "west", "east": "north", "south": "east", "west": "south"}
OPPOSITE = {"north": "south", "south": "north", "east": "west", "west": "east"}


@pytest.fixture(scope="module")
def place():
    return load_map("amsterdam_120")


@pytest.fixture(scope="module")
def road(place):
    return shapely.unary_union([shapely.Polygon(a.exterior, a.holes) for a in place.road])


def movement(place, name):
    return next(m for m in place.movements if m.id == name)


def test_unknown_names_list_what_exists_and_never_leave_the_folder():
    for name in ("nowhere", "../amsterdam_120", "", "/etc", "amsterdam_120/.."):
        with pytest.raises(InputError, match="amsterdam_120"):
            load_map(name)


def test_a_users_folder_of_bundles_is_found(tmp_path, monkeypatch):
    own = tmp_path / "mine"
    own.mkdir()
    (own / "map.json").write_bytes((find_bundle_folder("amsterdam_120") / "map.json").read_bytes())
    monkeypatch.setenv("SCENEWRIGHT_INTERSECTIONS", str(tmp_path))
    assert list_intersections() == ["amsterdam_120", "mine"]
    assert load_map("mine").name == "amsterdam_120"


def test_a_broken_map_is_one_clear_line(tmp_path, monkeypatch):
    (tmp_path / "torn").mkdir()
    (tmp_path / "torn" / "map.json").write_text("{")
    monkeypatch.setenv("SCENEWRIGHT_INTERSECTIONS", str(tmp_path))
    with pytest.raises(InputError, match="torn") as caught:
        load_map("torn")
    assert "\n" not in str(caught.value)


def test_every_leg_has_its_three_turns_and_they_lead_where_semantics_says(place):
    found = {(m.entry, m.turn): m.exit for m in place.movements}
    for entry, ahead in OPPOSITE.items():
        assert found[entry, "left"] == LEFT[entry]
        assert found[entry, "right"] == RIGHT[entry]
        assert found[entry, "straight"] == ahead
    assert len(found) == len(place.movements) == 12


def test_turns_bend_the_way_they_are_named(place):
    for m in place.movements:
        line = np.array(m.centreline)
        first, last = line[1] - line[0], line[-1] - line[-2]
        bend = math.atan2(first[0] * last[1] - first[1] * last[0], first @ last)
        wanted = {"left": math.pi / 2, "right": -math.pi / 2, "straight": 0.0}[m.turn]
        assert bend == pytest.approx(wanted, abs=0.02)


def test_traffic_keeps_right_and_northbound_drives_east_of_the_middle(place):
    assert all(x > 0 for x, _ in movement(place, "south>north:straight").centreline)
    assert all(y < 0 for _, y in movement(place, "west>east:straight").centreline)


def test_centrelines_lie_on_the_road_from_edge_to_edge(place, road):
    for m in place.movements:
        assert road.buffer(1e-6).covers(shapely.LineString(m.centreline))
        for end in (m.centreline[0], m.centreline[-1]):
            assert max(abs(end[0]), abs(end[1])) == place.extent


def test_turns_are_drivable(place):
    for m in place.movements:
        line = shapely.LineString(m.centreline)
        s = np.arange(0.0, line.length, 0.5)
        xy = shapely.get_coordinates(shapely.line_interpolate_point(line, s))
        heading = np.unwrap(np.arctan2(*np.diff(xy, axis=0).T[::-1]))
        assert np.abs(np.diff(heading)).max() / 0.5 < 1 / 6


def test_lanelets_join_and_keep_their_width(place):
    lanelets = {lane.id: lane for lane in place.lanelets}
    for lane in place.lanelets:
        gap = np.linalg.norm(np.array(lane.left) - np.array(lane.right), axis=1)
        assert gap == pytest.approx(lane.width, abs=0.02)
        for name in lane.successors:
            assert lanelets[name].centreline[0] == lane.centreline[-1]
    for m in place.movements:
        assert set(m.lanelets) <= set(lanelets)


def test_left_and_right_bounds_are_on_their_sides(place):
    for lane in place.lanelets:
        ahead = np.subtract(lane.centreline[1], lane.centreline[0])
        to_left = np.subtract(lane.left[0], lane.centreline[0])
        assert ahead[0] * to_left[1] - ahead[1] * to_left[0] > 0


def test_stop_lines_lie_upstream_of_the_crosswalk(place):
    for stop in place.stop_lines:
        crosswalk = next(c for c in place.crosswalks if c.leg == stop.leg)
        gap = shapely.LineString(stop.line).distance(shapely.Polygon(crosswalk.polygon))
        assert gap == pytest.approx(1.2, abs=1e-6)


def test_crosswalk_sides_are_where_their_ends_are(place):
    axis = {"north": (0, 1), "south": (0, -1), "east": (1, 0), "west": (-1, 0)}
    for c in place.crosswalks:
        for end, side in zip(c.centreline, c.sides, strict=True):
            assert np.dot(end, axis[side]) > 5.0
        assert np.dot(np.mean(c.polygon, axis=0), axis[c.leg]) > 5.0


def test_crosswalks_join_the_sidewalks(place):
    walkable = shapely.unary_union([shapely.Polygon(a.exterior) for a in place.walkable])
    for c in place.crosswalks:
        area = shapely.union_all([walkable.buffer(0.01), shapely.Polygon(c.polygon)])
        assert len(getattr(area, "geoms", [area])) == len(walkable.geoms) - 1


def test_sidewalk_and_road_do_not_overlap(place, road):
    for area in place.walkable:
        assert shapely.Polygon(area.exterior).intersection(road).area < 0.01


def test_rings_are_open_and_counter_clockwise(place):
    rings = [c.polygon for c in place.crosswalks] + [a.exterior for a in place.road]
    rings += [a.exterior for a in place.walkable] + [z.polygon for z in place.conflict_zones]
    for ring in rings:
        assert ring[0] != ring[-1]
        assert shapely.LinearRing(ring).is_ccw
        assert shapely.Polygon(ring).is_valid


def test_conflict_zones_hold_area_and_name_real_things(place):
    names = {m.id for m in place.movements} | {c.id for c in place.crosswalks}
    for zone in place.conflict_zones:
        assert {zone.first, zone.second} <= names
        assert shapely.Polygon(zone.polygon).area > 0.5


def test_crossing_movements_conflict_and_opposite_ones_do_not(place):
    pairs = {frozenset((z.first, z.second)) for z in place.conflict_zones}
    assert frozenset(("north>south:straight", "west>east:straight")) in pairs
    assert frozenset(("north>east:left", "south>north:straight")) in pairs
    assert frozenset(("north>west:right", "west:crosswalk")) in pairs
    assert frozenset(("north>south:straight", "south>north:straight")) not in pairs
    assert frozenset(("north>east:left", "south>west:left")) not in pairs


def test_no_two_conflicting_through_movements_are_ever_green_together(place):
    group = {name: g.id for g in place.signals.groups for name in (*g.movements, *g.crosswalks)}
    straight = [m.id for m in place.movements if m.turn == "straight"]
    fixed = {*straight, *(c.id for c in place.crosswalks)}
    conflicts = [z for z in place.conflict_zones if {z.first, z.second} <= fixed]
    assert conflicts
    for phase in place.signals.phases:
        for zone in conflicts:
            colours = [phase.colours[group[name]] for name in (zone.first, zone.second)]
            assert not all(colour in ("green", "yellow") for colour in colours)


def test_walkers_who_start_on_green_finish_before_crossing_traffic_starts(place):
    slow = 1.1
    for c in place.crosswalks:
        group = next(g.id for g in place.signals.groups if c.id in g.crosswalks)
        time_left = (
            sum(p.duration for p in place.signals.phases if p.colours[group] == "yellow") + 5.0
        )
        assert math.dist(*c.centreline) / slow <= time_left
    assert place.signals.cycle == 74.0


def test_every_route_is_there_once(place):
    ids = [route.id for route in place.routes]
    assert len(ids) == len(set(ids)) == 12 + 32 + 8
    assert "vehicle:north>south:straight" in ids
    assert "pedestrian:north:east>west:along>along" in ids
    assert "pedestrian:north:east>west:jaywalk" in ids
    for route in place.routes:
        if route.type == "pedestrian":
            sides = next(c.sides for c in place.crosswalks if c.leg == route.crosswalk)
            assert {route.entry, route.exit} == set(sides)


def test_ids_are_unique(place):
    for things in (place.lanelets, place.movements, place.conflict_zones, place.goal_regions):
        assert all(a.id != b.id for a, b in combinations(things, 2))
