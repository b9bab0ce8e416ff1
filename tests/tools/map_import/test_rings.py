"""Roundabouts in maps of lanes: found by their shape, imported with ring and legs, or refused."""

import math

import numpy as np
import pytest

from scenewright.errors import InputError
from scenewright.tools.map_import import import_map, list_junctions
from scenewright.tools.map_import.rings import find_roundabouts

RADIUS = 18.0


def arc(radius, first, last):
    t = np.radians(np.linspace(first, last, 30))
    return radius * np.column_stack([np.cos(t), np.sin(t)])


def turn(line, degrees):
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    return np.asarray(line) @ np.array([[c, s], [-s, c]])


def bend(*points):
    """A curve between the first and the last of three points."""
    a, b, c = map(np.array, points)
    t = np.linspace(0, 1, 12)[:, None]
    return (1 - t) ** 2 * a + 2 * t * (1 - t) * b + t**2 * c


def list_lanes(*, both_ways=False):
    """Middles of the lanes of a roundabout of four legs, driven counter-clockwise."""
    east_in, east_out = arc(RADIUS, -20, 20)[[-1, 0]]
    across = arc(RADIUS, -20, 20), arc(RADIUS, 20, 70)
    onto = bend((34, 3), (18.06, 3), east_in)
    off = bend(east_out, (18.06, -3), (34, -3))
    leg = np.array([(90, 3), (34, 3)]), onto, off, np.array([(34, -3), (90, -3)])
    found = [turn(line, quarter) for quarter in range(0, 360, 90) for line in (*across, *leg)]
    back = [turn(line, quarter)[::-1] for quarter in range(0, 360, 90) for line in across]
    return found + back * both_ways


def commonroad(file, lanes):
    def bound(side, line):
        points = "".join(f"<point><x>{x:.4f}</x><y>{y:.4f}</y></point>" for x, y in line)
        return f"<{side}>{points}</{side}>"

    def lanelet(k, line):
        step = np.gradient(np.asarray(line, float), axis=0)
        aside = 1.75 * np.column_stack([-step[:, 1], step[:, 0]]) / np.hypot(*step.T)[:, None]
        sides = bound("leftBound", line + aside) + bound("rightBound", line - aside)
        return f'<lanelet id="{k}">{sides}<laneletType>urban</laneletType></lanelet>'

    body = "".join(lanelet(k, line) for k, line in enumerate(lanes, start=1))
    file.write_text(f'<commonRoad commonRoadVersion="2020a">{body}</commonRoad>')
    return file


@pytest.mark.parametrize(
    ("corners", "count"),
    [([arc(20, a, a + 90) for a in (0, 90, 180, 270)], 1),
     ([[(0, 0), (60, 0)], [(60, 0), (60, 60)], [(60, 60), (0, 60)], [(0, 60), (0, 0)]], 0),
     ([[(0, 0), (80, 0)], [(80, 0), (80, 25)], [(80, 25), (0, 25)], [(0, 25), (0, 0)]], 0)],
    ids=["circle", "block", "aisle"],
)  # fmt: skip
def test_a_ring_is_round(corners, count):
    lines = {str(k): np.array(line, float) for k, line in enumerate(corners)}
    follows = {str(k): [str((k + 1) % 4)] for k in range(4)}
    found = find_roundabouts(lines, follows)
    assert len(found) == count
    assert all(ring.is_left for each in found for ring in each.rings)


def test_a_roundabout_of_lanes_is_one_intersection_with_its_ring(tmp_path):
    file = commonroad(tmp_path / "ring.xml", list_lanes())
    [found] = list_junctions(file).junctions
    assert (found.is_roundabout, found.legs, found.refusal) == (True, 4, "")
    assert found.xy == pytest.approx((0, 0), abs=0.5)
    made = import_map(file, name="x")
    assert len(made.intersection_map.movements) == 12
    for line in (np.array(each.centreline) for each in made.intersection_map.movements):
        inner = line[np.hypot(*line.T) < RADIUS + 3]
        angle = np.unwrap(np.arctan2(inner[:, 1], inner[:, 0]))
        assert np.hypot(*line.T).min() > RADIUS - 2.5
        assert angle[-1] > angle[0]


def test_a_ring_that_is_driven_both_ways_is_refused_in_list_and_import(tmp_path):
    file = commonroad(tmp_path / "both.xml", list_lanes(both_ways=True))
    [found] = list_junctions(file).junctions
    assert "both ways" in found.refusal
    with pytest.raises(InputError, match=r"roundabout .* both ways .* OpenStreetMap can be"):
        import_map(file, name="x")


def test_lanes_of_car_parks_and_buses_are_dropped_and_counted(tmp_path):
    file = commonroad(tmp_path / "ring.xml", list_lanes())
    kinds = iter(("parking", "busLane", "sidewalk"))
    text = "".join(
        part + (f"<laneletType>{next(kinds, 'urban')}</laneletType>" if k < 24 else "")
        for k, part in enumerate(file.read_text().split("<laneletType>urban</laneletType>"))
    )
    file.write_text(text)
    from scenewright.tools.map_import.read_lane_maps import load_lane_map

    held = load_lane_map(file, "commonroad")
    assert len(held.lanes) == 21
    assert held.notes[0].startswith("3 lanes were dropped")
