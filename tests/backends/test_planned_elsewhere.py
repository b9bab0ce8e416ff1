"""What a text means where legs are no compass, or people drive on the left."""

import pytest

from scenewright.backends.builtin.draft import Site
from scenewright.backends.builtin.planner import plan
from scenewright.scene.social import SocialGraph

FIVE = Site(compass=False)
LEFT_HAND = Site(left_hand=True)


def planned(text, site=None):
    graph = plan(text, site=site)
    assert isinstance(graph, SocialGraph), graph
    return graph


def test_on_five_legs_the_map_says_where_a_turn_leads():
    text = "A car from the south turning left yields to a pedestrian on the northwest crosswalk"
    car = planned(text, FIVE).agents[0]
    assert (car.entry, car.movement, car.exit) == ("south", "left", None)
    assert planned("A car from the south turning left").agents[0].exit == "west"


def test_on_five_legs_an_oncoming_car_is_tied_and_not_guessed():
    graph = planned("A car from the northeast turning left yields to an oncoming car", FIVE)
    assert graph.agents[1].entry is None
    [tie] = graph.ties
    assert (tie.agent, tie.of, tie.side) == ("vehicle-2", "vehicle-1", "opposite")


@pytest.mark.parametrize(
    ("text", "site", "turn", "kind"),
    [
        ("A left turn collision", None, "left", "left_turn"),
        ("A left turn collision", LEFT_HAND, "left", None),
        ("A right turn across path collision", None, "right", None),
        ("A right turn across path collision", LEFT_HAND, "right", "left_turn"),
        ("A car turning right hits an oncoming car", LEFT_HAND, "right", "left_turn"),
        ("A car turning right hits an oncoming car", None, "right", None),
        ("A car turning left hits an oncoming car", LEFT_HAND, "left", None),
        ("A car swings left into the teeth of a bus", None, "left", "left_turn"),
        ("A car swings left into the teeth of a bus", LEFT_HAND, "left", None),
    ],
)
def test_the_turn_across_oncoming_traffic_is_the_left_one_or_its_mirror(text, site, turn, kind):
    graph = planned(text, site)
    assert graph.agents[0].movement == turn
    [edge] = graph.relations
    assert (edge.type, edge.kind) == ("collide_at", kind)


def test_a_phrase_that_names_a_turn_pins_a_pattern_only_where_it_is_played_so():
    text = "A car breaks off its left turn for a pedestrian"
    assert planned(text).relations[0].pattern == "vehicle_yields_to_pedestrian_left_turn"
    edge = planned(text, LEFT_HAND).relations[0]
    assert (edge.type, edge.pattern) == ("yield_to", None)
