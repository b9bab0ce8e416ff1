"""Lanes become legs by direction and place; what no map can hold is refused with the reason."""

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenewright.errors import InputError
from scenewright.tools.map_import.junction_choice import describe_survey
from scenewright.tools.map_import.legs import (
    Arm,
    SurveyLeg,
    explain_count,
    explain_refusal,
    find_legs,
    group_arms,
    list_legs,
    measure_bearing,
    orient_outwards,
)
from scenewright.tools.map_import.survey import Survey, SurveyLane


def turn(points, degrees):
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    return np.asarray(points, float) @ np.array([[c, s], [-s, c]])


def make_lane(name, points, road=""):
    return SurveyLane(name, np.asarray(points, float), 3.0, 13.9, road)


def make_street(k, degrees, *, lanes=1, road="", gap=3.0, left_hand=False):
    """The lanes in and out of a straight street at a bearing, in right-hand traffic."""
    side = -1.0 if left_hand else 1.0
    approaches, exits = [], []
    for j in range(lanes):
        aside = side * gap * (j + 0.5)
        approaches.append(make_lane(f"in{k}.{j}", turn([(90, aside), (12, aside)], degrees), road))
        exits.append(make_lane(f"out{k}.{j}", turn([(12, -aside), (90, -aside)], degrees), road))
    return approaches, exits


def make_survey(streets, title="test"):
    approaches = [lane for own, _ in streets for lane in own]
    exits = [lane for _, own in streets for lane in own]
    return Survey(
        title, {lane.id: lane for lane in approaches}, {lane.id: lane for lane in exits}, ()
    )


def make_cross(*degrees, **options):
    return make_survey([make_street(k, a, **options) for k, a in enumerate(degrees)])


def group_names(survey):
    """The legs as sets of the names of their lanes."""
    return {frozenset(lane.id for lane in leg.lanes) for leg in list_legs(survey)}


@given(st.floats(-180.0, 180.0))
def test_a_bearing_is_the_direction_outwards(degrees):
    line = turn([(5, 2), (60, 2)], degrees)
    assert math.remainder(measure_bearing(line) - math.radians(degrees), math.tau) == pytest.approx(
        0.0, abs=1e-9
    )


def test_a_bearing_leaves_the_first_metres_out_and_what_lies_far():
    # Four metres to the north, then east; beyond thirty metres it turns away.
    line = np.array([(0, 0), (0, 4), (26, 4), (26, 90)], float)
    assert measure_bearing(line) == pytest.approx(0.0, abs=1e-9)


def test_the_bearing_of_a_short_stub_is_that_of_all_of_it():
    assert measure_bearing(np.array([(0, 0), (0, 3)], float)) == pytest.approx(math.pi / 2)


def test_an_approach_is_turned_outwards_and_an_exit_is_not():
    lane = make_lane("x", [(9, 0), (1, 0)])
    assert orient_outwards(lane, True).tolist() == [[1, 0], [9, 0]]
    assert orient_outwards(lane, False).tolist() == [[9, 0], [1, 0]]


@pytest.mark.parametrize("lanes", [1, 2, 4])
@pytest.mark.parametrize(
    "degrees", [(0, 90, 180), (0, 90, 180, -90), (-150, -90, -30, 30, 90, 150)]
)
def test_each_street_is_a_leg_with_all_its_lanes(degrees, lanes):
    legs = find_legs(make_cross(*degrees, lanes=lanes))
    assert sorted(round(math.degrees(leg.bearing)) % 360 for leg in legs) == sorted(
        each % 360 for each in degrees
    )
    for leg in legs:
        assert (len(leg.approaches), len(leg.exits)) == (lanes, lanes)
        assert {x.id.strip("inout").split(".")[0] for x in leg.lanes} == {
            leg.lanes[0].id.strip("inout").split(".")[0]
        }


@pytest.mark.parametrize("degrees", [0.0, 17.0, 90.0, -133.0])
def test_the_throat_and_direction_of_a_leg_are_the_mean_of_its_lanes(degrees):
    legs = find_legs(make_cross(degrees, degrees + 90, degrees + 180, lanes=2))
    leg = min(legs, key=lambda x: abs(math.remainder(x.bearing - math.radians(degrees), math.tau)))
    assert leg.throat == pytest.approx(turn([(12, 0)], degrees)[0])
    assert leg.outwards == pytest.approx(turn([(1, 0)], degrees)[0])


@given(st.floats(0.0, 360.0), st.permutations(range(4)), st.booleans())
def test_legs_are_the_same_in_any_order_of_lanes_however_the_map_is_turned(degrees, order, left):
    bearings = (3.0, 80.0, 170.0, -95.0)
    streets = [make_street(k, bearings[k], lanes=2) for k in order]
    expected = group_names(make_cross(*bearings, lanes=2))
    assert group_names(make_survey(streets)) == expected
    turned = [make_street(k, degrees + bearings[k], lanes=2, left_hand=left) for k in range(4)]
    assert group_names(make_survey(turned)) == expected


@given(st.floats(-180.0, 180.0), st.integers(3, 8))
def test_legs_go_round_counter_clockwise_from_the_least_bearing(off, count):
    legs = find_legs(make_cross(*(off + 360.0 * k / count for k in range(count))))
    assert len(legs) == count
    bearings = [leg.bearing for leg in legs]
    assert bearings == sorted(bearings)
    for a, b in pairwise(bearings):
        assert b - a == pytest.approx(math.tau / count, abs=1e-6)


@pytest.mark.parametrize(("apart", "count"), [(10, 1), (20, 1), (28, 2), (45, 2)])
def test_lanes_of_no_name_are_one_leg_up_to_24_degrees(apart, count):
    arms = [Arm(turn([(12, 0), (90, 0)], a), "", "out") for a in (0, apart)]
    assert len(list(group_arms(arms))) == count


@pytest.mark.parametrize(("street", "count"), [("Main", 1), ("", 2)])
def test_lanes_of_one_street_may_spread_wider(street, count):
    arms = [Arm(turn([(12, 0), (90, 0)], a), street, "out") for a in (0, 30)]
    assert len(list(group_arms(arms))) == count


def test_a_fan_of_lanes_is_no_wider_than_a_leg():
    arms = [Arm(turn([(12, 0), (90, 0)], a), "", "out") for a in range(0, 80, 10)]
    groups = list(group_arms(arms))
    assert sorted(i for own in groups for i in own) == list(range(8))
    assert max(max(own) - min(own) for own in groups) * 10 < 36
    assert len(groups) > 1


@pytest.mark.parametrize(
    ("aside", "street", "count"),
    [(21.0, "", 1), (23.0, "", 2), (44.0, "Main", 1), (46.0, "Main", 2)],
)
def test_parallel_lanes_are_of_one_street_up_to_its_widest_median(aside, street, count):
    arms = [Arm(np.array([(12, y), (90, y)], float), street, "out") for y in (0.0, aside)]
    assert len(list(group_arms(arms))) == count


def test_parallel_lanes_of_different_streets_need_lie_closer():
    arms = [
        Arm(np.array([(12, y), (90, y)], float), street, "out")
        for y, street in ((0.0, "Main"), (30.0, "Mill"))
    ]
    assert list(map(sorted, group_arms(arms))) == [[0], [1]]


@pytest.mark.parametrize(("gap", "count"), [(7.0, 1), (9.0, 2)])
def test_two_two_way_streets_side_by_side_are_parted_by_an_island(gap, count):
    places = ("in", 6.0 + gap), ("out", 3.0 + gap), ("in", 3.0), ("out", 0.0)
    arms = [Arm(np.array([(12, y), (90, y)], float), "Main", leads) for leads, y in places]
    groups = sorted(map(sorted, group_arms(arms)))
    assert groups == ([[0, 1, 2, 3]] if count == 1 else [[0, 1], [2, 3]])


def test_no_arms_are_no_legs():
    assert list(group_arms([])) == []
    assert list_legs(make_survey([])) == ()


@given(st.floats(-180.0, 180.0))
def test_directions_on_both_sides_of_the_west_are_one_leg(degrees):
    arms = [
        Arm(turn([(12, 0), (90, 0)], degrees + a), "", "out") for a in (-5.0, 5.0, 120.0, 240.0)
    ]
    assert sorted(map(sorted, group_arms(arms))) == [[0, 1], [2], [3]]


def test_a_leg_is_called_as_most_of_its_lanes():
    lanes = [make_lane(str(k), [(0, 0), (9, 0)], road) for k, road in enumerate("BAAB")]
    place = np.zeros(2)
    leg = SurveyLeg(0.0, tuple(lanes[:2]), tuple(lanes[2:]), place, place)
    assert leg.road == "A"  # of equals the first in the alphabet
    leg = SurveyLeg(0.0, tuple(lanes), (make_lane("5", [(0, 0), (9, 0)], "B"),), place, place)
    assert leg.road == "B"
    nameless = [make_lane(str(k), [(0, 0), (9, 0)]) for k in range(3)]
    assert SurveyLeg(0.0, (*nameless, lanes[0]), (), place, place).road == "B"
    assert SurveyLeg(0.0, tuple(nameless), (), place, place).road == ""


def test_the_lanes_of_a_leg_are_said_to_lead_in_or_out():
    lanes = [make_lane(name, [(0, 0), (9, 0)]) for name in "abc"]
    leg = SurveyLeg(0.0, tuple(lanes[:1]), tuple(lanes[1:]), np.zeros(2), np.zeros(2))
    assert [(lane.id, way_in) for lane, way_in in leg.directed_lanes] == [
        ("a", True), ("b", False), ("c", False),
    ]  # fmt: skip
    assert [lane.id for lane in leg.lanes] == ["a", "b", "c"]


@pytest.mark.parametrize("count", [0, 1, 2, 9, 12])
def test_the_count_of_legs_is_named_where_no_map_can_be_made(count):
    assert explain_count(count) == f"it has {count} legs; an intersection has 3 to 8"


@pytest.mark.parametrize("count", range(3, 9))
def test_three_to_eight_legs_are_an_intersection(count):
    assert explain_count(count) == ""


def test_two_legs_are_refused_with_the_name_of_the_place():
    with pytest.raises(InputError, match=r"^test cannot be imported: it has 2 legs; an inters"):
        find_legs(make_cross(0, 180))


@pytest.mark.parametrize(("lanes", "refused"), [(16, False), (17, True)])
def test_a_leg_of_more_lanes_than_a_street_has_asks_for_the_tag(lanes, refused):
    legs = list_legs(make_cross(0, 120, 240, lanes=lanes, gap=0.4))
    reason = explain_refusal(legs)
    assert (
        reason
        == (
            "it has a leg of 17 lanes in one direction; a street has at most 16, is the tag lanes "
            "right?"
        )
        * refused
    )


def test_a_survey_is_described_by_its_legs():
    survey = make_survey([make_street(k, 90 * k, road=f"Street {k}") for k in range(4)])
    junction = describe_survey(survey, id="7", nodes=frozenset("ab"))
    assert junction is not None
    by_street = dict(zip(junction.streets, junction.bearings, strict=True))
    for k in range(4):
        off = math.remainder(by_street[f"Street {k}"] - k * math.pi / 2, math.tau)
        assert off == pytest.approx(0.0, abs=1e-6)
    assert (junction.id, junction.legs, junction.refusal) == ("7", 4, "")
    assert junction.nodes == {"a", "b"}
    assert describe_survey(make_cross(0, 180), id="7") is None


def test_a_reason_that_is_known_comes_before_that_of_the_legs():
    wide = make_cross(0, 120, 240, lanes=17, gap=0.4)
    for given_reason, expected in (("known", "known"), ("", "it has a leg of 17 lanes")):
        junction = describe_survey(wide, id="7", refusal=given_reason)
        assert junction is not None
        assert junction.refusal.startswith(expected)
