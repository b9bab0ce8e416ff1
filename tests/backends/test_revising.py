"""What words mean where a scene is there: edits, questions back, refusals with a reason."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenewright.backends.builtin.draft import Site
from scenewright.backends.builtin.planner import plan
from scenewright.backends.builtin.references import read_choice
from scenewright.backends.builtin.revising import read
from scenewright.scene.edits import (
    AgentView,
    Clarification,
    DeclinedTurn,
    Edits,
    NewScene,
    RemoveAgent,
    Situation,
    apply_edits,
    diff_graphs,
)
from scenewright.scene.measures import format_measure
from scenewright.scene.route_table import RouteDescription
from scenewright.scene.social import SocialGraph


def there(name: str, **stated: Any) -> AgentView:
    kind = name.partition("-")[0]
    facts = {
        "id": name, "number": 1, "type": kind, "subtype": "car" if kind == "vehicle" else None,
        "entry": "north", "exit": "south",
        "movement": "straight" if kind == "vehicle" else "crossing",
        "role": "foreground", "speed": 10.0 if kind == "vehicle" else 1.4,
    }  # fmt: skip
    return AgentView.model_validate(facts | stated)


def situation(text: str, *present: AgentView) -> Situation:
    graph = plan(text)
    assert isinstance(graph, SocialGraph)
    return Situation(graph=graph, present=present)


ONE = situation(
    "A car from the north yields to a pedestrian on the east crosswalk at 8 am",
    there("vehicle-1", stops=True, movement="left", exit="east"),
    there("pedestrian-1", crosswalk="east"),
    there("vehicle-2", role="background", subtype="truck", entry="west", exit="east"),
    there("pedestrian-2", role="background", crosswalk="west"),
)
TWO = situation(
    "A car comes from the north. A pedestrian crosses on the south crosswalk. An SUV comes from "
    "the west and turns left. There is a bus. The car yields to the pedestrian. The SUV follows "
    "the bus.",
    there("vehicle-1", stops=True),
    there("pedestrian-1", crosswalk="south"),
    there("vehicle-2", entry="west", exit="north", movement="left"),
    there("vehicle-3", entry="west", exit="north", movement="left", subtype="bus"),
)


def stated(words: str, where: Situation = ONE, **chosen: str) -> list[dict[str, Any]]:
    reading = read(words, where, chosen=chosen)
    assert isinstance(reading, Edits), reading
    plain = [e.model_dump(mode="json", by_alias=True, exclude_defaults=True) for e in reading.edits]
    return [{"": type(e).__name__, **p} for e, p in zip(reading.edits, plain, strict=True)]


@pytest.mark.parametrize(
    ("words", "edit"),
    [
        ("add three cars", {"": "SetBackground", "vehicles": 4}),
        ("two more pedestrians please", {"": "SetBackground", "pedestrians": 3}),
        ("no background traffic", {"": "SetBackground", "vehicles": 0, "pedestrians": 0}),
        ("remove all pedestrians", {"": "SetBackground", "pedestrians": 0}),
        ("remove the pedestrian", {"": "RemoveAgent", "agent": "pedestrian-1"}),
        ("remove the truck", {"": "RemoveAgent", "agent": "vehicle-2"}),
        ("drop vehicle-2", {"": "RemoveAgent", "agent": "vehicle-2"}),
        ("stop one metre later", {"": "MoveStop", "agent": "vehicle-1", "metres": 1.0}),
        ("stop half a metre earlier", {"": "MoveStop", "agent": "vehicle-1", "metres": -0.5}),
        ("let the car stop 2 m before", {"": "MoveStop", "agent": "vehicle-1", "metres": -2.0}),
        ("wait two seconds longer", {"": "WaitLonger", "agent": "vehicle-1", "seconds": 2.0}),
        ("wait longer by three seconds", {"": "WaitLonger", "agent": "vehicle-1",
                                          "seconds": 3.0}),
        ("delay the car by 5 seconds", {"": "ComeLater", "agent": "vehicle-1", "seconds": 5.0}),
        ("slower on the way to the junction", {"": "SetPace", "agent": "vehicle-1",
                                               "factor": 0.8}),
        ("slow the car down", {"": "SetPace", "agent": "vehicle-1", "factor": 0.8}),
        ("a bit slower", {"": "SetPace", "agent": "vehicle-1", "factor": 0.9}),
        ("make the pedestrian walk faster", {"": "SetPace", "agent": "pedestrian-1",
                                             "factor": 1.25}),
        ("the car drives at 18 km/h", {"": "SetPace", "agent": "vehicle-1", "factor": 0.5}),
        ("the pedestrian comes 2 seconds later", {"": "ComeLater", "agent": "pedestrian-1",
                                                  "seconds": 2.0}),
        ("make it 5 pm", {"": "ChangeContext", "time_of_day": "17:00"}),
        ("try again", {"": "Redraw"}),
        ("another path for the car", {"": "Redraw", "agent": "vehicle-1"}),
        ("nothing happens", {"": "Unrelate", "first": "vehicle-1", "second": "pedestrian-1"}),
        ("drop the yielding", {"": "Unrelate", "first": "vehicle-1", "second": "pedestrian-1"}),
    ],
)  # fmt: skip
def test_an_edit_is_a_typed_value(words: str, edit: dict[str, Any]) -> None:
    assert stated(words) == [edit]


@pytest.mark.parametrize(
    ("words", "relation"),
    [
        ("now have it be a collision", ("collide_at", "vehicle-1", "pedestrian-1")),
        ("make it a near miss with a PET of 1 s", ("near_miss", "vehicle-1", "pedestrian-1")),
        ("let the pedestrian yield instead", ("yield_to", "pedestrian-1", "vehicle-1")),
        ("swap roles", ("yield_to", "pedestrian-1", "vehicle-1")),
    ],
)
def test_what_happens_becomes_something_else(words: str, relation: tuple[str, str, str]) -> None:
    (edit,) = stated(words)
    assert (edit["edge"]["type"], edit["edge"]["from"], edit["edge"]["to"]) == relation


def test_agents_change_where_the_words_say_so_and_nowhere_else() -> None:
    (edit,) = stated("make the pedestrian come from the east instead")
    assert edit["node"] == {
        "id": "pedestrian-1", "type": "pedestrian", "entry": "east", "exit": "west",
        "movement": "crossing",
    }  # fmt: skip
    (edit,) = stated("make the car a truck")
    assert edit["node"] == {
        "id": "vehicle-1", "type": "vehicle", "subtype": "truck", "entry": "north",
    }  # fmt: skip
    joined = stated("add a truck that follows the car")
    assert [each[""] for each in joined] == ["AddAgent", "Relate"]
    assert joined[0]["node"]["id"] == "vehicle-3"
    both = stated("make it night and add three cars")
    assert [each[""] for each in both] == ["ChangeContext", "SetBackground"]


WAYS_ON = [
    # told first, then; entry, exit and movement after that
    ("A car from the north turning right hits a bus", "make the car turn left",
     ("north", "east", "left")),
    ("A car from the north turning right hits a bus", "the car should come from the east",
     ("east", "north", "right")),
    ("A car from the north turning right hits a bus", "make the car leave to the south",
     ("north", "south", "straight")),
    ("A car turning right hits a bus", "make the car come from the south",
     ("south", "east", "right")),
]  # fmt: skip


@pytest.mark.parametrize(("first", "words", "way"), WAYS_ON)
def test_of_a_way_before_stays_what_goes_with_the_new_words(
    first: str, words: str, way: tuple[str, str, str]
) -> None:
    where = situation(first, there("vehicle-1"), there("vehicle-2", subtype="bus", entry="east"))
    (edit,) = stated(words, where)
    assert tuple(edit["node"].get(each) for each in ("entry", "exit", "movement")) == way


ARMS = ("south", "east", "northeast", "north", "west")
"""Legs of a junction of five, anticlockwise."""

FIVE = Site(
    compass=False,
    ways=(
        *(
            RouteDescription("vehicle", entry, ARMS[(at + turn) % 5], name)
            for at, entry in enumerate(ARMS)
            for turn, name in ((1, "right"), (2, "straight"), (3, "straight"), (4, "left"))
        ),
        RouteDescription("pedestrian", "northeast", "south", "crossing", "east"),
        RouteDescription("pedestrian", "south", "northeast", "crossing", "east"),
        RouteDescription("pedestrian", "north", "south", "crossing", "west"),
        RouteDescription("pedestrian", "north", "east", "crossing", "northeast"),
    ),
)


def on_five_legs(words: str) -> dict[str, Any]:
    graph = plan(
        "A car from the south turning left yields to a pedestrian on the west crosswalk", site=FIVE
    )
    assert isinstance(graph, SocialGraph)
    present = (there("vehicle-1", stops=True), there("pedestrian-1", crosswalk="west"))
    reading = read(words, Situation(graph=graph, present=present), site=FIVE)
    assert isinstance(reading, Edits), reading
    (edit,) = reading.edits
    node: dict[str, Any] = edit.model_dump(exclude_none=True)["node"]
    return {each: node[each] for each in ("entry", "exit", "movement", "crosswalk") if each in node}


@pytest.mark.parametrize(
    ("words", "way"),
    [
        ("the car should turn right", {"entry": "south", "movement": "right"}),
        ("make the car come from the northeast", {"entry": "northeast", "movement": "left"}),
        ("put the pedestrian on the northeast crosswalk",
         {"movement": "crossing", "crosswalk": "northeast"}),
        # The way over the west crosswalk begins in the north, the one over the east in the south.
        ("make the pedestrian come from the north",
         {"entry": "north", "movement": "crossing", "crosswalk": "west"}),
        ("make the pedestrian come from the south instead",
         {"entry": "south", "movement": "crossing"}),
    ],
)  # fmt: skip
def test_on_five_legs_the_map_says_what_goes_with_what(words: str, way: dict[str, str]) -> None:
    """A compass of four would have an exit for the turn, and refuse the crosswalk."""
    assert on_five_legs(words) == way


@pytest.mark.parametrize(
    ("words", "site", "turn", "kind"),
    [
        ("make it a right turn across path collision", Site(left_hand=True), "right", "left_turn"),
        ("make it a right turn across path collision", Site(), "right", None),
        ("make it a left turn collision", Site(left_hand=True), "left", None),
        ("make it a left turn collision", Site(), "left", "left_turn"),
    ],
)
def test_in_left_hand_traffic_an_edit_means_the_mirrored_turn(
    words: str, site: Site, turn: str, kind: str | None
) -> None:
    where = situation("A car nearly hits a bus", there("vehicle-1"), there("vehicle-2"))
    reading = read(words, where, site=site)
    assert isinstance(reading, Edits), reading
    graph = apply_edits(where.graph, reading.edits)
    assert (graph.agents[0].movement, graph.relations[0].kind) == (turn, kind)


def test_a_figure_of_before_stays_where_no_agent_speaks_of_it() -> None:
    (edit,) = stated("make it a near miss with a PET of 1 s")
    graph = apply_edits(ONE.graph, read("make it a near miss with a PET of 1 s", ONE).edits)  # type: ignore[union-attr]
    assert edit["edge"]["target_pet"] == 1.0
    later = ONE.model_copy(update={"graph": graph})
    assert stated("make it 5 pm", later) == [{"": "ChangeContext", "time_of_day": "17:00"}]
    (truck,) = stated("make the car a truck", later)
    assert truck[""] == "ChangeAgent"


@pytest.mark.parametrize(
    ("words", "among"),
    [
        ("make the car turn left", ["vehicle-1", "vehicle-2"]),
        ("slow the vehicle down", ["vehicle-1", "vehicle-2", "vehicle-3"]),
        ("have it turn right", ["vehicle-1", "vehicle-2", "vehicle-3"]),
        ("make it a collision", ["vehicle-1", "vehicle-2"]),
    ],
)
def test_what_may_mean_several_is_asked(words: str, among: list[str]) -> None:
    asked = read(words, TWO)
    assert isinstance(asked, Clarification)
    assert [each.answer for each in asked.choices] == among
    noun = asked.choices[0].means.partition("=")[0]
    for name in among:
        edits = stated(words, TWO, **{noun: name}) if "turn" not in words else None
        assert edits is None or name in str(edits)


@pytest.mark.parametrize(
    ("words", "agent"),
    [
        ("slow the bus down", "vehicle-3"),
        ("slow vehicle 2 down", "vehicle-2"),
        ("slow the car from the north down", "vehicle-1"),
        ("the second vehicle should be slower", "vehicle-2"),
    ],
)
def test_who_is_distinguished_is_not_asked_for(words: str, agent: str) -> None:
    assert stated(words, TWO)[0]["agent"] == agent


@pytest.mark.parametrize(
    ("answer", "name"),
    [
        ("vehicle-2", "vehicle-2"), ("2", "vehicle-2"), ("the first", "vehicle-1"),
        ("the one from the north", "vehicle-1"), ("the bus", "vehicle-3"),
        ("I mean the southbound one", "vehicle-1"), ("the car", None), ("9", None), ("", None),
        ("make it night", None),
    ],
)  # fmt: skip
def test_an_answer_is_taken_if_it_means_one(answer: str, name: str | None) -> None:
    asked = read("slow the vehicle down", TWO)
    assert isinstance(asked, Clarification)
    choice = read_choice(answer, asked)
    assert (None if choice is None else choice.answer) == name


@pytest.mark.parametrize(
    ("words", "code", "says"),
    [
        ("remove the bus", "impossible", "There is no bus"),
        ("slow vehicle-77 down", "impossible", "no vehicle-77"),
        ("stop 400 metres later", "impossible", "at most 15"),
        ("add 60 cars", "impossible", "at most 60"),
        ("make the car come from the west and turn right", "impossible", "east crosswalk"),
        ("make the truck turn left", "impossible", "a background agent"),
        ("make me a coffee", "no_change", "changes nothing"),
        ("asdf qwer zxcv", "out_of_scope", "English"),
    ],
)
def test_what_cannot_be_says_why(words: str, code: str, says: str) -> None:
    reading = read(words, ONE)
    assert isinstance(reading, DeclinedTurn), reading
    assert reading.code == code
    assert says in reading.reason


ROLLING = situation(
    "A left-turning car yields to an oncoming car",
    there("vehicle-1", movement="left", exit="east", slows_to=3.1),
    there("vehicle-2", entry="south", exit="north"),
)


@pytest.mark.parametrize(
    ("words", "edit"),
    [
        ("make it stop", {"": "WaitLonger", "agent": "vehicle-1", "seconds": 2.0}),
        ("have it come to a full stop", {"": "WaitLonger", "agent": "vehicle-1", "seconds": 2.0}),
        ("let vehicle-1 stop for 4 seconds",
         {"": "WaitLonger", "agent": "vehicle-1", "seconds": 4.0}),
        ("wait three seconds longer", {"": "WaitLonger", "agent": "vehicle-1", "seconds": 3.0}),
        ("stop one metre later", {"": "MoveStop", "agent": "vehicle-1", "metres": 1.0}),
    ],
)  # fmt: skip
def test_who_gives_way_without_standing_is_meant_where_an_agent_is_to_stop(
    words: str, edit: dict[str, Any]
) -> None:
    assert stated(words, ROLLING) == [edit]


@pytest.mark.parametrize(
    ("words", "where", "says"),
    [
        ("make it stop", ONE, "vehicle-1 stands already"),
        ("make vehicle-2 stop", ROLLING, "vehicle-2 gives way to no agent"),
    ],
)
def test_who_stands_or_has_no_reason_to_cannot_be_made_to(
    words: str, where: Situation, says: str
) -> None:
    reading = read(words, where)
    assert isinstance(reading, DeclinedTurn), reading
    assert says in reading.reason


def test_a_scene_of_its_own_is_distinguished() -> None:
    assert isinstance(read("A bus follows a car", ONE), NewScene)
    assert isinstance(read("new scene: a car hits a bus", ONE), NewScene)
    assert isinstance(read("add three cars", None), NewScene)


@given(st.text(max_size=80))
def test_any_text_is_read_as_something(words: str) -> None:
    read(words, ONE)


_TRADE = (
    "make the car pedestrian a an three collision yield remove add stop slow later earlier it "
    "night instead truck metre second turn left from north east crosswalk hits vehicle-1 with and"
)
WORDS = _TRADE.split()


@given(st.lists(st.sampled_from(WORDS), min_size=1, max_size=9))
def test_any_words_of_the_trade_are_read_as_something(words: list[str]) -> None:
    reading = read(" ".join(words), TWO)
    if isinstance(reading, Edits):
        graph = TWO.graph
        for edit in reading.edits:
            graph = apply_edits(graph, [edit])


def test_the_difference_of_two_graphs_leads_from_one_to_the_other() -> None:
    for before, after in ((ONE.graph, TWO.graph), (TWO.graph, ONE.graph), (ONE.graph, ONE.graph)):
        made = apply_edits(before, diff_graphs(before, after))
        assert {n.id: n for n in made.agents} == {n.id: n for n in after.agents}
        assert set(made.relations) == set(after.relations)


NEAR = situation(
    "A car from the north narrowly misses a truck from the east",
    there("vehicle-1"),
    there("vehicle-2", subtype="truck", entry="east", exit="west"),
)


@pytest.mark.parametrize(
    ("words", "first"),
    [
        ("the truck goes first instead", "vehicle-2"),
        ("make the car pass before the truck", "vehicle-1"),
        ("the truck should go second", "vehicle-1"),
        ("the car should only cross after the truck", "vehicle-2"),
    ],
)
def test_who_passes_first_can_be_changed(words: str, first: str) -> None:
    (edit,) = stated(words, NEAR)
    assert edit[""] == "Relate"
    assert edit["edge"]["first"] == first


def test_who_gives_way_is_turned_round_by_another_order() -> None:
    (edit,) = stated("the car goes first instead", ONE)
    assert (edit["edge"]["from"], edit["edge"]["to"]) == ("pedestrian-1", "vehicle-1")


@pytest.mark.parametrize(
    ("words", "measure"),
    [
        ("make it 10 m/s", "speed(vehicle-1) in [9.5, 10.5] m/s"),
        ("let it brake at 3 m/s2", "braking(vehicle-1) in [2.5, 3.5] m/s2"),
        (
            "let it happen 12 s into the scene",
            "time(vehicle-1, pedestrian-1) in [11.7, 12.3] s",
        ),
    ],
)
def test_a_number_becomes_a_figure_of_the_graph(words: str, measure: str) -> None:
    reading = read(words, ONE)
    assert isinstance(reading, Edits), reading
    changed = apply_edits(ONE.graph, reading.edits)
    assert [format_measure(each) for each in changed.measures] == [measure]
    again = apply_edits(changed, (RemoveAgent(agent="pedestrian-1"),))
    assert all(each.other is None for each in again.measures)


@pytest.mark.parametrize("words", ["Two cars crash at the lights", "A bus hits a cyclist"])
def test_words_with_parties_and_an_event_of_their_own_are_a_new_scene(words: str) -> None:
    assert isinstance(read(words, ONE), NewScene)


RIDES = situation(
    "A car from the west goes straight. A cyclist from the north yields to a pedestrian.",
    there("vehicle-1", entry="west", exit="east"),
    there("cyclist-1", movement="straight", speed=4.0, stops=True),
    there("pedestrian-1", crosswalk="east"),
)


def test_riders_are_added_and_changed_as_vehicles_are() -> None:
    two = stated("add two scooters", RIDES)
    assert [each["node"]["type"] for each in two] == ["scooter", "scooter"]
    (turned,) = stated("the cyclist turns left", RIDES)
    assert (turned["node"]["type"], turned["node"]["movement"]) == ("cyclist", "left")
    assert stated("the bike goes at 5 m/s", RIDES) == [
        {"": "SetPace", "agent": "cyclist-1", "factor": 1.25}
    ]


@pytest.mark.parametrize("words", ["add a dog", "remove the tram", "let there be a horse"])
def test_what_no_scene_has_is_refused(words: str) -> None:
    declined = read(words, ONE)
    assert isinstance(declined, DeclinedTurn)
    assert declined.code == "impossible"
    assert "none can be" in declined.reason


def test_a_parked_vehicle_is_no_agent() -> None:
    assert [each[""] for each in stated("put a parked truck there")] == ["AddObject"]
    assert isinstance(read("an e-scooter follows a bike through the junction", ONE), NewScene)
