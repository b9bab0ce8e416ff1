"""U-turns that a map leaves room for."""

from __future__ import annotations

import numpy as np

from scenewright.intersections import load_map
from scenewright.scene.uturns import make_route


def test_a_wide_avenue_leaves_room_for_u_turns_and_a_street_does_not() -> None:
    place = load_map("amsterdam_120")
    assert [each.entry for each in place.uturns] == ["north", "south"]
    assert not any(each.movement == "uturn" for each in place.routes)  # nobody is drawn on one


def test_a_u_turn_goes_past_its_crosswalk_and_back_on_the_outer_lane() -> None:
    (turn, _) = load_map("amsterdam_120").uturns
    line = np.array(turn.centreline)
    inner, outer = line[0], line[-1]
    assert inner[0] < 0 < outer[0]
    assert line[:, 1].min() > 0.0  # it does not reach the other half of the junction
    steps = np.diff(line, axis=0)
    angle = np.unwrap(np.arctan2(steps[:, 1], steps[:, 0]))
    np.testing.assert_allclose(np.degrees(angle[-1] - angle[0]), 180.0, atol=1.0)
    assert np.all(np.diff(angle) > -1e-6)  # always to the left


def test_a_u_turn_meets_oncoming_traffic_and_has_the_light_of_its_leg() -> None:
    place = load_map("amsterdam_120")
    turn = place.uturns[0]
    assert frozenset((turn.id, "south>north:straight")) in place.zone_pairs
    assert frozenset((turn.id, "south:crosswalk")) not in place.zone_pairs
    assert place.find_signal_group(make_route(turn)) == "avenue"
