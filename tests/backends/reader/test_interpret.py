"""From annotated words to a plan by rule: SEMANTICS sections 2 to 4 and 8."""

from __future__ import annotations

import pytest

from lab.planner.plain_sentences import build_reading
from scenewright.backends.builtin.draft import Site
from scenewright.backends.builtin.planner import plan
from scenewright.backends.builtin.reader.annotation import parse_annotation
from scenewright.backends.builtin.reader.learned_plan import plan_reading
from scenewright.backends.builtin.reader.measures import measure_in
from scenewright.backends.builtin.reader.numbers import count_in, number_in
from scenewright.backends.builtin.reader.words import find_subtype, time_words_in
from scenewright.scene.measures import format_measure
from scenewright.scene.social import Plan, Refusal, SocialGraph


def plan_of(line: str) -> Plan:
    row = parse_annotation(line)
    return plan_reading(build_reading(row), Site(), row.text).plan


def graph_of(line: str) -> SocialGraph:
    plan = plan_of(line)
    assert isinstance(plan, SocialGraph), plan
    return plan


def way(graph: SocialGraph, name: str) -> tuple[str | None, ...]:
    agent = graph.agent(name)
    return agent.entry, agent.exit, agent.movement, agent.crosswalk


def test_a_light_that_is_red_before_anybody_is_named_is_of_nobody() -> None:
    graph = graph_of("[light the light is red] although [veh:1 a car] [hit:1>2 hits] [ped:2 a man]")
    assert not any(each.runs_red for each in graph.agents)


def test_a_heading_fixes_the_entry_of_a_vehicle_and_the_exit_of_a_pedestrian() -> None:
    graph = graph_of(
        "[veh:1 A car] [heading:1 northbound] [hit:1>2 hits] [ped:2 a man] walking "
        "[heading:2 west] on the [cw:2 north crosswalk]"
    )
    assert way(graph, "vehicle-1") == ("south", None, None, None)
    assert way(graph, "pedestrian-1") == ("east", "west", "crossing", "north")


def test_a_heading_after_another_entry_is_the_exit() -> None:
    graph = graph_of("[veh:1 A car] from the [from:1 south] leaves [heading:1 westbound]")
    assert way(graph, "vehicle-1") == ("south", "west", "left", None)


def test_adjectives_within_a_mention_count() -> None:
    graph = graph_of("[veh:1 A left-turning northbound van] [hit:1>2 hits] [veh:2 an oncoming bus]")
    assert way(graph, "vehicle-1") == ("south", "west", "left", None)
    assert graph.agent("vehicle-2").entry == "north"


def test_a_place_on_the_front_of_the_striker_is_a_figure() -> None:
    graph = graph_of(
        "[veh:1 A car] [hit:1>2 collides with] [veh:2 a van], [point:1 50 % of its front]"
    )
    assert [(each.kind, each.agent) for each in graph.measures] == [("front_point", "vehicle-1")]


def test_pairs_named_in_turn_are_as_many_events() -> None:
    graph = graph_of(
        "[near:1,3>2,4 Two near misses]: [veh:1 a car] with [ped:2 a boy], [veh:3 a van] with "
        "[ped:4 a girl]"
    )
    pairs = [(each.from_, each.to) for each in graph.relations]
    assert pairs == [("vehicle-1", "pedestrian-1"), ("vehicle-2", "pedestrian-2")]
    graph = graph_of("[veh:1,2 Two cars] [near:1,2>3,4 narrowly miss] [ped:3,4 two boys]")
    assert len(graph.relations) == 4


@pytest.mark.parametrize(
    ("side", "entry"), [("opp", "south"), ("left", "east"), ("right", "west"), ("same", "north")]
)
def test_relative_entries_are_resolved_against_the_other_vehicle(side: str, entry: str) -> None:
    graph = graph_of(
        f"[veh:1 A car] from the [from:1 north] [near:1>2 misses] [veh:2 a van] [from={side}:2>1 x]"
    )
    assert graph.agent("vehicle-2").entry == entry


def test_the_crosswalk_that_a_vehicle_turns_into() -> None:
    graph = graph_of(
        "[veh:1 A car] from the [from:1 east] [right:1 turning right] [yield:1>2 waits for] "
        "[ped:2 a boy] on [cw=exit:2>1 the crosswalk it turns into]"
    )
    assert way(graph, "pedestrian-1")[3] == "north"


def test_a_denied_yield_beside_a_collision_is_that_collision() -> None:
    graph = graph_of(
        "[veh:1 A car] [!yield:1>2 fails to yield to] [ped:2 a man] and [hit:1>2 hits him]"
    )
    assert [edge.type for edge in graph.relations] == ["collide_at"]


def test_a_denied_yield_alone_is_a_near_miss() -> None:
    graph = graph_of("[veh:1 A car] [!yield:1>2 does not stop for] [ped:2 a man]")
    assert [edge.type for edge in graph.relations] == ["near_miss"]


def test_a_denied_collision_is_no_collision() -> None:
    graph = graph_of("[veh:1 A car] [!hit:1 hits nobody]")
    assert graph.relations == ()
    assert [each.became for each in graph.said] == ["agent", "denied"]


def test_what_brakes_is_named() -> None:
    graph = graph_of(
        "[veh:1 A van] [near=cutoff:1>2 cuts off] [veh:2 a bus], which [brake:2 brakes hard]"
    )
    assert (graph.relations[0].cause, graph.relations[0].braker) == ("late_brake", "vehicle-2")


def test_retracted_words_say_nothing() -> None:
    graph = graph_of(
        "[veh:1 A car] from the [del north, no,] [from:1 south] [hit:1>2 hits] [ped:2 a man]"
    )
    assert graph.agent("vehicle-1").entry == "south"
    assert "retracted" in [each.became for each in graph.said]


def test_cyclists_and_scooters_are_classes_of_their_own() -> None:
    graph = graph_of(
        "[cyc:1 A cyclist] going [straight:1 straight] is [near=cutoff:2>1 cut off by] a "
        "[right:2 right-turning] [veh:2 van]; [scoot:3 an e-scooter] on the [cw:3 north crosswalk]"
    )
    assert [(agent.id, agent.type) for agent in graph.agents] == [
        ("cyclist-1", "cyclist"), ("vehicle-1", "vehicle"), ("scooter-1", "scooter"),
    ]  # fmt: skip
    assert way(graph, "cyclist-1") == (None, None, "straight", None)
    assert way(graph, "scooter-1") == (None, None, "crossing", "north")
    (edge,) = graph.relations
    assert (edge.type, edge.from_, edge.to) == ("near_miss", "vehicle-1", "cyclist-1")


def test_passing_a_cyclist_too_closely_is_a_near_miss() -> None:
    lines = (
        "[veh:1 A bus] passes [cyc:2 a cyclist] [manner:1 too closely]",
        "[veh:1 A bus] [act:1 overtakes] [cyc:2 a cyclist] [manner:1 much too closely]",
    )
    for line in lines:
        (edge,) = graph_of(line).relations
        assert (edge.type, edge.from_, edge.pattern) == (
            "near_miss", "vehicle-1", "rider_close_overtaking",
        )  # fmt: skip
    assert graph_of("[veh:1 A bus] passes [cyc:2 a cyclist]").relations == ()


def test_a_cyclist_comes_from_where_the_vehicle_does_not() -> None:
    graph = graph_of(
        "[veh:1 A car] from the [from:1 north] turns [left:1 left] and [hit:1>2 hits] "
        "[from=opp:2>1 an oncoming] [cyc:2 cyclist]"
    )
    assert way(graph, "cyclist-1")[0] == "south"
    assert graph.relations[0].kind == "left_turn"


def test_words_that_nothing_can_stand_for_are_listed() -> None:
    graph = graph_of("[veh:1 A car] [hit:1>2 hits] [ped:2 a man] [weather in the rain]")
    assert [each.words for each in graph.said if each.became == "nothing"] == ["in the rain"]


def test_seven_cars_follow_a_bus() -> None:
    graph = graph_of("[veh:1,2,3,4,5,6,7 Seven cars] [follow:1,2,3,4,5,6,7>8 follow] [veh:8 a bus]")
    assert len(graph.agents) == 8
    row = ["vehicle-8", *(f"vehicle-{k}" for k in range(1, 8))]
    assert [(e.from_, e.to) for e in graph.relations] == list(zip(row[1:], row[:-1], strict=True))


@pytest.mark.parametrize(
    ("line", "code"),
    [
        ("[scoot:1 A skateboarder] [hit:1>2 hits] [veh:2 a car]", "out_of_scope"),
        ("[cyc:1 A rickshaw] [hit:1>2 hits] [veh:2 a car]", "out_of_scope"),
        ("[veh:1 A car] [hit:1>2 hits] [ped:2 a man] [!time not at night]", "out_of_scope"),
        ("[veh:1 A car] from the [from:1 south] [from:1 north] [hit:1>2 x] [veh:2 y]",
         "contradictory"),
        ("[veh:1 A car] [hit:1>2 hits] and [!hit:1>2 never touches] [ped:2 a man]",
         "contradictory"),
        ("[veh:1 A car] from the [from:1 north] [left:1 turns left] to the [to:1 west]",
         "impossible"),
        ("[ped:1 A man] [yield:1>2 yields to] [ped:2 a woman]", "impossible"),
        ("%off sing a song", "out_of_scope"),
        ("%foreign ein Auto", "out_of_scope"),
    ],
)  # fmt: skip
def test_what_cannot_be_is_refused(line: str, code: str) -> None:
    plan = plan_of(line)
    assert isinstance(plan, Refusal)
    assert plan.code == code


@pytest.mark.parametrize(
    ("change", "want"),
    [
        ("it comes from the [from:1 south]", ("south", "west", "left")),
        ("make it turn [right:1 right]", ("north", "west", "right")),
        ("let it leave to the [to:1 south]", ("north", "south", "straight")),
    ],
)
def test_a_change_leaves_open_what_does_not_go_with_it(change: str, want: tuple[str, ...]) -> None:
    before = (
        "[veh:1 A car] from the [from:1 north] [left:1 turns left] and [hit:1>2 hits] [veh:2 x]"
    )
    graph = graph_of(f"%edit {before} >>> {change}")
    agent = graph.agent("vehicle-1")
    assert (agent.entry, agent.exit, agent.movement) == want


def test_a_changed_relation_takes_the_place_of_the_old_one() -> None:
    graph = graph_of(
        "%edit [veh:1 A car] [yield:1>2 yields to] [ped:2 a man] >>> have it [near:1>2 nearly hit] "
        "[ref:2 him] at [time=21:00 9 pm]"
    )
    assert [edge.type for edge in graph.relations] == ["near_miss"]
    assert graph.context.time_of_day == "21:00"


@pytest.mark.parametrize(
    ("words", "value", "unit"),
    [
        ("at 50 km/h", 50 / 3.6, "m/s"), ("36mph", 36 * 0.44704, "m/s"), ("PET 1.1 s", 1.1, "s"),
        ("half a second", 0.5, "s"), ("3 m/s2", 3.0, "m/s2"), ("twenty-two metres", 22.0, "m"),
        ("0.8", 0.8, ""), ("20 cm", 0.2, "m"), ("0.6 g", 0.6 * 9.81, "m/s2"),
        ("one and a half seconds", 1.5, "s"),
    ],
)  # fmt: skip
def test_measures_are_in_si_units(words: str, value: float, unit: str) -> None:
    found = measure_in(words)
    assert found is not None
    assert found.value == pytest.approx(value)
    assert found.unit == unit


@pytest.mark.parametrize(
    ("words", "number"),
    [("six other cars", 6), ("no background traffic", 0), ("a dozen", 12), ("12 cars", 12),
     ("some cars", None), ("18-wheeler", 18)],
)  # fmt: skip
def test_numbers_in_words(words: str, number: int | None) -> None:
    assert number_in(words) == number


def test_a_number_that_names_counts_no_agent() -> None:
    assert count_in("vehicle 2") is None
    assert count_in("two cars") == 2


@pytest.mark.parametrize(
    ("words", "subtype"),
    [("a blue van", "van"), ("the yellow cab", "taxi"), ("a patrol car", "police_car"),
     ("the pickup truck", "car"), ("an articulated lorry", "truck"),
     ("a school bus", "bus"), ("a motorcyclist", "motorcycle"), ("the vehicle", None)],
)  # fmt: skip
def test_subtypes_by_noun(words: str, subtype: str | None) -> None:
    assert find_subtype(words) == subtype


def test_the_most_specific_time_of_day_comes_first() -> None:
    assert time_words_in("in the early morning")[0] == "early morning"
    assert time_words_in("the morning rush hour")[0] == "morning rush"


ROADS = (
    ("north", "Amsterdam Avenue"), ("south", "Amsterdam Avenue"), ("east", "West 120th Street"),
    ("west", "Marshalsea Road"),
)  # fmt: skip


def plan_at(line: str) -> Plan:
    row = parse_annotation(line)
    return plan_reading(build_reading(row), Site(roads=ROADS), row.text).plan


def test_a_street_that_is_not_there_is_refused_with_those_that_are() -> None:
    plan = plan_at("[veh:1 A car] from [from:1 Baker Street] [hit:1>2 hits] [veh:2 a bus]")
    assert isinstance(plan, Refusal)
    assert "Amsterdam Avenue, West 120th Street, Marshalsea Road" in plan.reason


@pytest.mark.parametrize(
    ("line", "measures"),
    [
        (
            "[veh:1 A car] [red:1 runs a red light] [speed:1 at 15 m/s] and [hit:1>2 hits] "
            "[ped:2 a man]",
            ["line_speed(vehicle-1) in [14.5, 15.5] m/s"],
        ),
        (
            "[veh:1 A car] [speed:1 doing 36 km/h] [hit:1>2 hits] [ped:2 a man] [speed:2 walking "
            "at 1.5 m/s]",
            ["speed(vehicle-1) in [9.5, 10.5] m/s", "speed(pedestrian-1) in [1, 2] m/s"],
        ),
        (
            "[veh:1 A car] [follow:1>2 follows] [veh:2 a bus] with [headway:1>2 0.8 s headway]",
            ["headway(vehicle-1, vehicle-2) in [0.65, 0.95] s"],
        ),
        (
            "[veh:1 A car] [follow:1>2 follows] [veh:2 a bus] [gap:1 at a distance of 40 ft]",
            ["gap(vehicle-1, vehicle-2) in [11.89, 12.49] m"],
        ),
        (
            "[veh:1 A car] [near:1>2 just misses] [ped:2 a man] with [pet:1>2 PET of at most 1 s]",
            ["pet(vehicle-1, pedestrian-1) in [0, 1] s"],
        ),
        (
            "[veh:1 A car] [speed:1 no faster than 18 km/h] [yield:1>2 yields to] [ped:2 a man]",
            ["speed(vehicle-1) in [0, 5] m/s"],
        ),
        (
            "[veh:1 A car] [speed:1 at between 8 and 10 m/s] [hit:1>2 hits] [ped:2 a man] "
            "[when between 10 and 12 s]",
            [
                "speed(vehicle-1) in [8, 10] m/s",
                "time(vehicle-1, pedestrian-1) in [10, 12] s",
            ],
        ),
        (
            "[veh:1 A car] [hit:1>2 hits] [ped:2 a man] at [point:1 25 % of its front] "
            "[speed:1 at least 10 m/s]",
            [
                "front_point(vehicle-1, pedestrian-1) in [20, 30] %",
                "contact_speed(vehicle-1, pedestrian-1) in [10, 20] m/s",
            ],
        ),
        (
            "[veh:1 A car] [wait:1 waits 4 seconds], [decel:1 braking at 0.3 g], [dist:1 2 m "
            "before the line], and [yield:1>2 lets] [ped:2 a man] cross",
            [
                "wait(vehicle-1) in [3.85, 4.15] s",
                "braking(vehicle-1) in [2.443, 3.443] m/s2",
                "line_distance(vehicle-1) in [1.7, 2.3] m",
            ],
        ),
    ],
)
def test_numbers_become_figures_with_their_tolerance(line: str, measures: list[str]) -> None:
    graph = graph_of(line)
    assert [format_measure(each) for each in graph.measures] == measures
    given = [each.value for each in graph.said if each.became == "measure"]
    assert sorted(filter(None, given)) == sorted(measures)


@pytest.mark.parametrize(
    ("words", "most"),
    [
        ("[speed:1 at 100 km/h]", "at most 20 m/s"),
        ("[decel:1 braking at 9.8 m/s2]", "at most 8 m/s2"),
    ],
)
def test_a_number_that_no_scene_can_have_is_refused_with_the_most(words: str, most: str) -> None:
    plan = plan_of(f"[veh:1 A car] {words} [hit:1>2 hits] [ped:2 a man]")
    assert isinstance(plan, Refusal)
    assert most in plan.reason


@pytest.mark.parametrize(
    ("event", "relation"),
    [
        ("[hit=rear:2>1 rear-ends it]", "collide_at"),
        ("[near:2>1 nearly runs into it]", "near_miss"),
    ],
)
def test_who_brakes_ahead_of_another_does_so_as_a_manoeuvre(event: str, relation: str) -> None:
    graph = graph_of(f"[veh:1 The lead car] [brake:1 brakes hard] and [veh:2 the follower] {event}")
    (edge,) = graph.relations
    assert (edge.type, edge.from_, edge.to) == (relation, "vehicle-2", "vehicle-1")
    assert (edge.manoeuvre, edge.cause) == ("lead_brakes", None)
    said = {each.words: each.became for each in graph.said}
    assert said["brakes hard"] == "manoeuvre"


@pytest.mark.parametrize(
    ("line", "relation", "manoeuvre"),
    [
        ("[veh:1 A car] [follow:1>2 tailgates] [veh:2 a truck]", "follow", "tailgates"),
        ("[veh:1 A car] [follow:1>2 follows] [veh:2 a truck]", "follow", None),
    ],
)
def test_lanes_are_changed_and_followed_closely_as_words_say(
    line: str, relation: str, manoeuvre: str | None
) -> None:
    (edge,) = graph_of(line).relations
    assert (edge.type, edge.manoeuvre) == (relation, manoeuvre)


@pytest.mark.parametrize(
    ("line", "motion"),
    [
        ("[ped:1 A boy] [near=cutoff:1>2 darts out in front of] [veh:2 a car]", "darts_out"),
        (
            "[ped:1 A man] [jay:1 stops in the middle of the crosswalk], "
            "[veh:2 a car] [yield:2>1 yields to] [ref:1 him]",
            "stops_midway",
        ),
        ("[veh:1 A car] [hit:1>2 runs over] [ped:2 a man]", None),
    ],
)
def test_how_a_pedestrian_crosses_is_read_from_words_of_an_event(
    line: str, motion: str | None
) -> None:
    assert graph_of(line).agent("pedestrian-1").motion == motion


def test_right_on_red_is_a_turn_and_a_red_light() -> None:
    agent = graph_of("[veh:1 A car] [right:1 turns right on red]").agent("vehicle-1")
    assert (agent.movement, agent.runs_red) == ("right", True)


@pytest.mark.parametrize(
    ("line", "motion"),
    [
        ("[veh:1 A car] [red:1 runs a yellow light]", "passes_yellow"),
        ("[veh:1 A car] [red:1 blows through a yellow light]", "passes_yellow"),
        ("[veh:1 A yellow cab] [near:1>2 just misses] [veh:2 a bus]", None),
    ],
)  # fmt: skip
def test_a_yellow_light_is_no_red_one(line: str, motion: str | None) -> None:
    agent = graph_of(line).agent("vehicle-1")
    assert (agent.motion, agent.runs_red) == (motion, False)


@pytest.mark.parametrize(
    ("mention", "members"),
    [
        ("[ped:1,2 A couple]", 2),
        ("[ped:1 A mother with a child]", 2),
        ("[ped:1,2,3,4 A group of four pedestrians]", 4),
        ("[ped=many:1 A class of pupils]", 6),
        ("[ped:1 A woman]", None),
    ],
)
def test_who_walks_together_is_one_party(mention: str, members: int | None) -> None:
    graph = graph_of(f"[veh:9 A car] [yield:9>1 yields to] {mention}")
    assert [(e.type, e.to) for e in graph.relations] == [("yield_to", "pedestrian-1")]
    assert graph.agent("pedestrian-1").members == members


@pytest.mark.parametrize(
    ("where", "leg"),
    [
        ("the crosswalk it comes in by", "south"),
        ("the crosswalk ahead of its stop line", "south"),
        ("the crosswalk of that arm", "south"),
        ("the crosswalk of the street it turns into", "west"),
        ("the far crosswalk of its own turn", "west"),
    ],
)
def test_the_crosswalk_of_the_way_in_is_not_that_of_the_way_out(where: str, leg: str) -> None:
    graph = graph_of(
        "[veh:1 A car] from the [from:1 south] [left:1 turning left] [near:1>2 nearly hits] "
        f"[ped:2 a man] on [cw=exit:2>1 {where}]"
    )
    assert way(graph, "pedestrian-1")[3] == leg


def test_a_later_mention_says_what_vehicle_it_is() -> None:
    graph = graph_of("[veh:1 V1] [hit:1>2 hit] [veh:2 a bus]; [ref:1 the motorbike] was speeding")
    assert graph.agent("vehicle-1").subtype == "motorcycle"


def test_who_rides_a_vehicle_is_one_road_user_with_it() -> None:
    graph = plan("The rider of a motorbike nearly hits a boy")
    assert isinstance(graph, SocialGraph)
    assert [agent.subtype or agent.type for agent in graph.agents] == ["motorcycle", "pedestrian"]


@pytest.mark.parametrize("words", ["a two-door car", "a 12-seat minibus", "a two-year-old"])
def test_numbers_of_what_one_is_count_no_agent(words: str) -> None:
    assert count_in(words) == 1


@pytest.mark.parametrize(
    ("text", "time"),
    [
        ("[time Thurs 1625]. [veh:1 A car] [hit:1>2 hits] [veh:2 a van].", "16:25"),
        ("[time 3 May], [time 1625]. [veh:1 A car] [hit:1>2 hits] [veh:2 a van].", "16:25"),
        ("Unit 1412: [veh:1 a car] [hit:1>2 hits] [veh:2 a van].", None),
    ],
)
def test_four_figures_that_are_read_as_a_time_are_a_clock(text: str, time: str | None) -> None:
    assert graph_of(text).context.time_of_day == time


def test_a_reaction_that_a_class_does_not_have_is_left_out() -> None:
    graph = graph_of(
        "[veh:1 The bus] has stopped for [ped:2 the boy]; [yield:1>2 it waits]. [veh:3 The car "
        "behind the bus] [act:3 overtakes]. [near:3>2 The boy steps back just in time]."
    )
    assert [each.reaction for each in graph.agents if each.type == "vehicle"] == [None, None]
