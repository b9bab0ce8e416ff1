"""Curves that cars can drive, legs that are one street each, and whose crosswalk a crossing is."""

import numpy as np
import pytest
import shapely

from scenewright.geometry.polyline import resample_by_spacing
from scenewright.tools.map_import.curves import (
    LEAST_RADIUS,
    measure_least_radius,
    round_curves,
)
from scenewright.tools.map_import.ground_areas import (
    CrosswalkPlacement,
    build_crossing_line,
    place_crosswalk,
)
from scenewright.tools.map_import.legs import SurveyLeg, find_legs, list_legs
from scenewright.tools.map_import.mapped_crosswalks import (
    LegCrossing,
    MappedCrosswalk,
    choose_crossings,
)
from scenewright.tools.map_import.read_lanelet2 import FileElements, _find_street
from scenewright.tools.map_import.survey import (
    Survey,
    SurveyConnection,
    SurveyCrossing,
    SurveyLane,
)


@pytest.mark.parametrize(
    "corners",
    [
        [(0, 0), (20, 0), (20, 20)],
        [(0, 0), (20, 0), (19, 1), (40, 1)],
        [(0, 0), (20, 0), (20.5, 2), (40, 2)],
    ],
    ids=["corner", "cusp", "step"],
)
def test_sharp_places_become_curves_that_cars_can_drive(corners):
    line = resample_by_spacing(np.array(corners, float), 0.5)
    assert measure_least_radius(line) < 1.0
    rounded = round_curves(line)
    assert measure_least_radius(rounded) >= LEAST_RADIUS
    assert rounded[[0, -1]] == pytest.approx(line[[0, -1]])
    away = np.hypot(*(rounded[:, None] - line[None]).transpose(2, 0, 1)).min(axis=1)
    assert away.max() < 3.5


def test_a_circle_has_its_own_radius_and_stays_as_it_is():
    t = np.linspace(0, np.pi / 2, 60)
    line = resample_by_spacing(12.0 * np.column_stack([np.cos(t), np.sin(t)]), 0.5)
    assert measure_least_radius(line) == pytest.approx(12.0, rel=0.02)
    assert round_curves(line) is line


def build_survey(approaches, exits, ways, crossings=()):
    """A junction of straight lanes: name -> (points, street)."""

    def lane(name, points, road):
        return SurveyLane(name, np.array(points, float), 3.0, 13.9, road)

    return Survey(
        title="test",
        approaches={n: lane(n, *each) for n, each in approaches.items()},
        exits={n: lane(n, *each) for n, each in exits.items()},
        connections=tuple(SurveyConnection(a, b, np.array(line, float)) for a, b, line in ways),
        crossings=tuple(crossings),
    )


def test_streets_side_by_side_are_two_legs_and_carriageways_of_one_street_are_one():
    far = {
        "n1": ([(-20, 80), (-20, 10)], "High Street"),
        "n2": ([(15, 80), (15, 10)], "Mill Lane"),
        "e": ([(80, 2), (20, 2)], "Church Road"),
        "w": ([(-80, -2), (-25, -2)], "Church Road"),
    }
    out = {
        "n3": ([(-15, 10), (-15, 80)], "High Street"),
        "n4": ([(20, 10), (20, 80)], "High Street"),
    }
    legs = find_legs(build_survey(far, out, []))
    # Mill Lane lies between two carriageways of the High Street, nearer to one than streets lie.
    assert sorted(leg.road for leg in legs) == [
        "Church Road",
        "Church Road",
        "High Street",
        "High Street",
    ]
    far["n2"] = [(40, 80), (40, 10)], "Mill Lane"
    out.pop("n4")
    legs = find_legs(build_survey(far, out, []))
    assert [leg.road for leg in legs].count("Mill Lane") == 1
    assert len(legs) == 4


def test_a_crossing_deep_inside_belongs_to_the_leg_all_of_whose_traffic_passes_it():
    approaches = {"south": ([(2, -90), (2, -38)], ""), "east": ([(90, 2), (20, 2)], "")}
    exits = {
        "north": ([(2, 20), (2, 90)], ""),
        "east out": ([(20, -2), (90, -2)], ""),
        "west": ([(-20, 2), (-90, 2)], ""),
    }
    ways = [
        ("south", "north", [(2, -38), (2, 20)]),
        ("south", "east out", [(2, -38), (2, -8), (8, -2), (20, -2)]),
        ("south", "west", [(2, -38), (2, -6), (-6, 2), (-20, 2)]),
        ("east", "west", [(20, 2), (-20, 2)]),
    ]
    # 26 m inside the mouth of the southern leg; the exits are nearer.
    crossing = SurveyCrossing(np.array([(-4.0, -12.0), (8.0, -12.0)]), 3.0, source="ours")
    survey = build_survey(approaches, exits, ways, [crossing])
    legs = find_legs(survey)
    (k,) = choose_crossings(survey, legs).by_leg
    assert legs[k].outwards == pytest.approx((0.0, -1.0))


@pytest.mark.parametrize(
    ("name", "street"),
    [
        ("N_en_1", ""),
        ("R2In1_to_R1Out1", ""),
        ("12", ""),
        ("Kaiserstraße", "Kaiserstraße"),
        ("Avenue 7", "Avenue 7"),
        ("Rua XV de Novembro", "Rua XV de Novembro"),
    ],
)
def test_names_of_lanelets_are_no_streets(name, street):
    assert _find_street({"name": name}) == street


def test_a_light_of_a_stop_line_counts_without_a_lanelet_that_names_it():
    from scenewright.tools.map_import.read_lanelet2 import _list_lights

    rule = {"type": "regulatory_element", "subtype": "traffic_light"}
    elements = FileElements(
        origin=(0.0, 0.0),
        nodes={"1": np.array((0.0, 0.0)), "2": np.array((2.22, 0.0))},
        ways={"9": ({}, ["1", "2"])},
        relations={"5": (rule, [("ref_line", "9"), ("refers", "8")])},
    )
    (place,) = _list_lights(elements, {})
    assert place == pytest.approx((1.11, 0.0), abs=0.01)


def survey_divided_street(*crossings):
    """A street with a 12 m wide median, met by another from the south."""
    approaches = {
        "east in": ([(90, 8), (15, 8)], "Main Street"),
        "west in": ([(-90, -8), (-15, -8)], "Main Street"),
        "south in": ([(2, -90), (2, -20)], "Mill Lane"),
    }
    exits = {
        "east out": ([(15, -8), (90, -8)], "Main Street"),
        "west out": ([(-15, 8), (-90, 8)], "Main Street"),
    }
    ways = [
        ("east in", "west out", [(15, 8), (-15, 8)]),
        ("west in", "east out", [(-15, -8), (15, -8)]),
        ("south in", "east out", [(2, -20), (5, -11), (15, -8)]),
        ("south in", "west out", [(2, -20), (0, 0), (-8, 8), (-15, 8)]),
    ]
    stages = [
        SurveyCrossing(np.array([(x, y - 2.5), (x, y + 2.5)]), 3.0, source=f"stage at {x}, {y}")
        for x, y in crossings
    ]
    return build_survey(approaches, exits, ways, stages)


def test_the_two_stages_over_a_divided_street_are_one_crosswalk():
    survey = survey_divided_street((25.0, 8.0), (25.0, -8.0))
    legs = find_legs(survey)
    found = choose_crossings(survey, legs)
    ((k, mapped),) = found.by_leg.items()
    assert legs[k].bearing == pytest.approx(0.0, abs=0.1)
    assert len(mapped.stages) == 2
    assert mapped.middle == pytest.approx((25.0, 0.0))
    assert not found.left_out


def test_of_staggered_stages_one_is_taken_and_the_other_is_named():
    survey = survey_divided_street((25.0, 8.0), (45.0, -8.0))
    found = choose_crossings(survey, find_legs(survey))
    ((_, mapped),) = found.by_leg.items()
    assert [stage.crossing.source for stage in mapped.stages] == ["stage at 25.0, 8.0"]
    ((left, _, why),) = found.left_out
    assert left.source == "stage at 45.0, -8.0"
    assert "one crosswalk" in why


def test_of_two_legs_equally_likely_a_stage_goes_to_that_of_its_other_stage():
    # Between the mouths of Mill Lane's ways: the traffic over the southern carriageway is all
    # through traffic, so that stage alone could be the west's or the east's.
    survey = survey_divided_street((-12.0, 8.0), (-12.0, -8.0))
    legs = find_legs(survey)
    ((k, mapped),) = choose_crossings(survey, legs).by_leg.items()
    assert abs(legs[k].bearing) == pytest.approx(np.pi, abs=0.1)
    assert len(mapped.stages) == 2


@pytest.mark.parametrize(
    ("ends", "crosses"),
    [
        ([(0, -8), (0, 8)], True),
        ([(-9, 8), (-9, -8)], False),
        ([(-12, 1), (12, -1)], True),
        ([(0, 30), (9, 30)], False),
    ],
    ids=["through the middle", "at the corner", "on the other", "apart"],
)
def test_crosswalks_that_meet_at_a_corner_do_not_cross(ends, crosses):
    one, other = (
        CrosswalkPlacement(0.0, np.array(each, float), 3.0) for each in ([(-10, 0), (10, 0)], ends)
    )
    assert one.crosses(other) is other.crosses(one) is crosses


def test_a_crosswalk_that_is_left_out_is_named_with_the_reason():
    survey = survey_divided_street((25.0, 8.0), (25.0, -8.0))
    choice = choose_crossings(survey, find_legs(survey))
    (k,) = choice.by_leg
    left = choice.leave_out({k: "would cross another"})
    assert not left.by_leg
    assert [(leg, why) for _, leg, why in left.left_out] == [(k, "would cross another")] * 2


def test_people_enter_and_end_at_an_island_where_a_crosswalk_ends_there():
    placed = CrosswalkPlacement(0.0, np.array([(-5.0, 0.0), (5.0, 0.0)]), 3.0)
    road = shapely.box(-5, -40, 5, 40)
    beside = np.column_stack([np.full(161, -6.5), np.linspace(-40, 40, 161)])
    corners = beside, beside + np.array([23.0, 0.0])  # beyond a slip lane east of the island
    for before, after in (("leg", "along"), ("along", "leg")):
        line = build_crossing_line(placed, corners, before=before, after=after)
        assert abs(line[0][1]) == pytest.approx(15.0, abs=0.5)
        assert line[-1] == pytest.approx((6.2, 0.0))
    refuge = placed.find_refuge(road, corners)
    assert shapely.contains_xy(refuge, [6.2, 4.0, -6.5], [0.0, 0.0, 0.0]).tolist() == [
        True, False, False,
    ]  # fmt: skip


@pytest.mark.parametrize(("drawn", "taken"), [(24.0, True), (None, False)])
def test_a_long_crosswalk_is_the_files_only_where_the_file_draws_it_as_long(drawn, taken):
    lanes = [
        SurveyLane(name, np.array(line, float), 3.5, 13.9, "")
        for name, line in (("in", [(60, 2), (4, 2)]), ("out", [(4, -2), (60, -2)]))
    ]
    leg = SurveyLeg(0.0, (lanes[0],), (lanes[1],), np.array([4.0, 0.0]), np.array([1.0, 0.0]))
    road = shapely.union_all([shapely.box(-15, -12, 6, 12), shapely.box(0, -4, 60, 4)])
    limits = None if drawn is None else np.array([(5, drawn / 2), (5, -drawn / 2)])
    node = SurveyCrossing(
        np.array([(5, 4), (5, -4)], float), 4.0, source="node 1", is_bounded=False, limits=limits
    )
    mapped = MappedCrosswalk((LegCrossing(node, 0, frozenset(("in", "out")), 1.0),))
    placed, why = place_crosswalk(leg, road, mapped, room=40.0)
    assert (placed.mapped is mapped, why == "") == (taken, taken)
    assert taken or "24 m long, the leg 8 m wide" in why


def test_the_crosswalk_of_a_leg_that_turns_back_crosses_it_once():
    line = np.array([(0, 4), (0, 20), (-30, 20), (-30, -20)], float)
    leg = SurveyLeg(
        0.0, (), (SurveyLane("out", line, 3.5, 13.9, ""),), line[0], np.array([0.0, 1.0])
    )
    placed, _ = place_crosswalk(leg, shapely.LineString(line).buffer(2), None, room=40.0)
    assert placed is not None
    assert np.hypot(*np.diff(placed.ends, axis=0)[0]) == pytest.approx(4.0, abs=0.1)


@pytest.mark.parametrize(
    ("far", "out", "count"),
    [((-14, 4), (-10, 8), 2), ((-14, -10), (4, 8), 1), ((-5, 2), (-2, 5), 1)],
)
def test_streets_that_are_both_driven_both_ways_are_two_legs(far, out, count):
    approaches = {f"in {x}": ([(x, 80), (x, 10)], "High Street") for x in far}
    exits = {f"out {x}": ([(x, 10), (x, 80)], "High Street") for x in out}
    assert len(list_legs(build_survey(approaches, exits, []))) == count
