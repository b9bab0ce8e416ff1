"""Programmes of lights: as in the file, assumed in stages that never clash, or none and why."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenewright.scene.map_elements import Crosswalk, VehicleMovement
from scenewright.tools.map_import.compass import find_sides
from scenewright.tools.map_import.legs import SurveyLeg
from scenewright.tools.map_import.mapped_crosswalks import CrossingChoice
from scenewright.tools.map_import.signal_programs import (
    SignalInput,
    build_signal_program,
    find_lit_legs,
)
from scenewright.tools.map_import.survey import Survey, SurveyConnection, SurveyLane, SurveyLight

LEGS = ("north", "east", "south", "west")
STRAIGHT = {("north", "south"), ("south", "north"), ("east", "west"), ("west", "east")}
CLASHES = {(a, b) for a in ("north", "south") for b in ("east", "west")}
CLASHES |= {(b, a) for a, b in CLASHES}
CROSS = SignalInput(STRAIGHT, CLASHES, {}, {}, {})
EMPTY = Survey("test", {}, {}, ())


def make_movement(entry, exit_):
    return VehicleMovement(
        id=f"{entry}>{exit_}", entry=entry, exit=exit_, turn="straight", lanelets=(),
        stop_line="", centreline=((0.0, 0.0), (1.0, 0.0)), signal_group=None,
    )  # fmt: skip


def make_crosswalk(leg):
    return Crosswalk(
        id=f"cross_{leg}", leg=leg, polygon=((0.0, 0.0), (1.0, 0.0), (1.0, 1.0)),
        centreline=((0.0, 0.0), (1.0, 0.0)), sides=find_sides(leg), width=4.0,
    )  # fmt: skip


def build(survey=EMPTY, given_=CROSS, *, legs=LEGS, mode="keep", walks=LEGS):
    notes = []
    program, item = build_signal_program(
        survey,
        given_,
        movements=[make_movement(a, b) for a in legs for b in legs if a != b],
        crosswalks=[make_crosswalk(leg) for leg in walks],
        mode=mode,
        add_note=notes.append,
    )
    return program, item, notes


def list_stages(program):
    """The legs that have green together, in turn."""
    found = []
    for phase in program.phases:
        green = {x for x, c in phase.colours.items() if c == "green" and not x.startswith("walk")}
        if green and (not found or found[-1] != green):
            found.append(green)
    return found


def test_opposite_legs_have_green_together_in_an_assumed_programme():
    program, item, notes = build(mode="assume")
    assert list_stages(program) == [{"north", "south"}, {"east", "west"}]
    assert program.cycle == pytest.approx(2 * (22.0 + 3.0 + 2.0))
    assert (item.state, item.score) == ("assumed", 0.0)
    assert notes == [f"signals: {item.detail}"]


@given(st.permutations(LEGS))
def test_in_any_order_of_legs_none_that_clash_have_green_and_all_have_it_once(order):
    program, _, _ = build(legs=order, mode="assume")
    for phase in program.phases:
        shown = [leg for leg in LEGS if phase.colours[leg] != "red"]
        assert not any((a, b) in CLASHES for a in shown for b in shown)
    for leg in LEGS:
        green = sum(p.duration for p in program.phases if p.colours[leg] == "green")
        yellow = sum(p.duration for p in program.phases if p.colours[leg] == "yellow")
        assert (green, yellow) == (22.0, 3.0)


@given(st.permutations(LEGS))
def test_after_green_comes_yellow_and_after_it_red(order):
    program, _, _ = build(legs=order, mode="assume")
    following = {"green": {"green", "yellow"}, "yellow": {"red"}, "red": {"red", "green"}}
    phases = program.phases
    for before, after in zip(phases, (*phases[1:], phases[0]), strict=True):
        assert all(after.colours[leg] in following[before.colours[leg]] for leg in LEGS)


def test_people_walk_beside_traffic_and_begin_no_more_before_it_ends():
    program, _, _ = build(mode="assume")
    for phase in program.phases:
        for leg in LEGS:
            walk = phase.colours[f"walk_{leg}"]
            if walk != "red":
                # No traffic from the leg, nor straight over its crosswalk.
                assert phase.colours[leg] == "red"
                opposite = {a for a, b in STRAIGHT if b == leg}
                assert all(phase.colours[each] == "red" for each in opposite)
    begin = [p.duration for p in program.phases if p.colours["walk_east"] == "green"]
    clear = [p.duration for p in program.phases if p.colours["walk_east"] == "yellow"]
    assert (begin, clear) == ([14.0], [8.0])


def test_groups_hold_the_movements_of_their_leg_and_one_crosswalk():
    program, _, _ = build(mode="assume", walks=("north", "west"))
    by_id = {group.id: group for group in program.groups}
    assert set(by_id) == {*LEGS, "walk_north", "walk_west"}
    for leg in LEGS:
        assert all(name.startswith(f"{leg}>") for name in by_id[leg].movements)
        assert len(by_id[leg].movements) == 3
    assert by_id["walk_north"].crosswalks == ("cross_north",)
    assert all(set(phase.colours) == set(by_id) for phase in program.phases)


def test_opposite_legs_that_clash_have_green_one_after_the_other():
    crossing = replace(CROSS, clashes={("north", "south")})
    program, _, _ = build(given_=crossing, mode="assume")
    assert list_stages(program) == [{"north"}, {"south"}, {"east", "west"}]


def test_the_groups_of_the_file_are_the_stages():
    groups = {"north": "1", "east": "1", "south": "2", "west": "2"}
    program, item, _ = build(given_=replace(CROSS, clashes=set(), groups=groups))
    assert list_stages(program) == [{"north", "east"}, {"south", "west"}]
    assert "is assumed by its controllers" in item.detail
    assert (item.state, item.score) == ("partly read", 0.5)


def test_one_controller_for_all_says_nothing_of_stages():
    program, item, _ = build(given_=replace(CROSS, groups=dict.fromkeys(LEGS, "1")))
    assert list_stages(program) == [{"north", "south"}, {"east", "west"}]
    assert "controllers" not in item.detail


@pytest.mark.parametrize(
    ("lit", "also"),
    [
        (("north", "south"), "the file has lights on north, south; east, west get some as well"),
        (("north", "east", "south"), "lights on north, east, south; west get some as well"),
        (LEGS, "the file has lights on north, east, south, west, its programme is assumed"),
    ],
)
def test_two_lit_legs_make_a_signalised_junction(lit, also):
    program, item, _ = build(given_=replace(CROSS, groups=dict.fromkeys(lit, "")))
    assert program is not None
    assert also in item.detail


def test_a_single_lit_leg_of_four_is_no_signalised_junction():
    program, item, notes = build(given_=replace(CROSS, groups={"east": ""}))
    assert program is None
    assert (item.state, item.score) == ("none", 0.5)
    assert notes == ["signals: none; the file has a light on east only"]


@pytest.mark.parametrize(
    ("survey", "state", "score", "words"),
    [
        (EMPTY, "none", None, "(--signals assume gives it a programme)"),
        (replace(EMPTY, is_signalised=False), "read", 1.0, "the file has none here"),
        (replace(EMPTY, lights=(SurveyLight(np.zeros(2)),)), "none", 0.5, "at no stop line of"),
    ],
)
def test_without_lights_the_reason_is_said(survey, state, score, words):
    program, item, _ = build(survey)
    assert program is None
    assert (item.state, item.score) == (state, score)
    assert words in item.detail


def test_a_signalised_junction_without_places_of_lights_is_lit_whole():
    program, item, _ = build(replace(EMPTY, is_signalised=True))
    assert list_stages(program) == [{"north", "south"}, {"east", "west"}]
    assert item.detail.startswith("the file has lights here, its programme is assumed; 22 s")


def test_no_lights_as_asked_whatever_the_file_has():
    program, item, _ = build(replace(EMPTY, is_signalised=True), mode="none")
    assert program is None
    assert (item.state, item.detail) == ("none", "none, as asked")


def lit_survey(*phases):
    """A programme of lights a (north and south) and b (east and west)."""
    return replace(EMPTY, phases=tuple((t, {"a": a, "b": b}) for t, a, b in phases))


LIGHTS = {"north": ("a",), "south": ("a",), "east": ("b",), "west": ("b",)}
KEPT = replace(CROSS, lights=LIGHTS)
PLAN = (
    (30.0, "green", "red"),
    (4.0, "yellow", "red"),
    (10.0, "red", "green"),
    (3.0, "red", "yellow"),
)


def test_the_programme_of_the_file_is_kept():
    program, item, _ = build(lit_survey(*PLAN), KEPT)
    assert (item.state, item.score) == ("read", 1.0)
    # A long green is parted, so that nobody begins to walk before its end; a short one is not.
    assert [(p.duration, p.colours["north"], p.colours["east"]) for p in program.phases] == [
        (22.0, "green", "red"), (8.0, "green", "red"), (4.0, "yellow", "red"),
        (10.0, "red", "green"), (3.0, "red", "yellow"),
    ]  # fmt: skip
    assert program.cycle == pytest.approx(47.0)


def test_a_crosswalk_that_never_has_time_to_begin_has_no_light():
    program, _, _ = build(lit_survey(*PLAN), KEPT)
    walks = {group.id for group in program.groups if group.crosswalks}
    # Only the 30 s of north and south are long enough: east and west are crossed then.
    assert walks == {"walk_east", "walk_west"}


def test_a_leg_of_several_lights_shows_the_freest():
    lights = LIGHTS | {"north": ("a", "b")}
    program, _, _ = build(lit_survey(*PLAN), replace(CROSS, lights=lights))
    shown = [phase.colours["north"] for phase in program.phases]
    assert shown == ["green", "green", "yellow", "green", "yellow"]


@pytest.mark.parametrize("lost", [{"north": ()}, {"east": ("c",)}, {"west": None}])
def test_a_programme_that_leaves_a_leg_without_green_is_not_kept(lost):
    survey = lit_survey(*PLAN)
    phases = tuple((t, {**colours, "c": "red"}) for t, colours in survey.phases)
    lights = {k: x for k, x in (LIGHTS | lost).items() if x is not None}
    _, item, _ = build(replace(survey, phases=phases), replace(CROSS, lights=lights))
    assert item.state != "read"


def test_legs_that_cross_and_have_green_together_in_the_file_are_named():
    together = [(20.0, "green", "green"), (20.0, "red", "red")]
    _, item, notes = build(lit_survey(*together), KEPT)
    assert item.state == "read"
    assert (
        "signals: east and north have green together although their ways straight on cross" in notes
    )


def test_people_walk_by_the_lights_that_the_file_has_for_them():
    phases = tuple(
        (t, {"a": a, "b": b, "w": "green" if b == "green" else "red"})
        for t, a, b in ((20.0, "green", "red"), (20.0, "red", "green"))
    )
    given_ = replace(KEPT, walks={"cross_north": ("w",), "cross_east": ("w",)})
    program, _, _ = build(replace(EMPTY, phases=phases), given_)
    for phase in program.phases:
        walks = phase.colours["east"] == "green"
        # So does the east, though its own traffic has green: the file says so.
        assert (phase.colours["walk_north"] != "red") == walks
        assert (phase.colours["walk_east"] != "red") == walks


def lit_place(*places, group="g"):
    approach = SurveyLane("in", np.array([(90.0, 2.0), (12.0, 2.0)]), 3.0, 13.9, "")
    other = SurveyLane("up", np.array([(2.0, -90.0), (2.0, -12.0)]), 3.0, 13.9, "")
    legs = [
        SurveyLeg(0.0, (approach,), (), np.array([12.0, 2.0]), np.array([1.0, 0.0])),
        SurveyLeg(-1.57, (other,), (), np.array([2.0, -12.0]), np.array([0.0, -1.0])),
    ]
    way = SurveyConnection("in", "out", np.array([(12.0, 2.0), (-12.0, 2.0)]))
    lights = tuple(SurveyLight(np.array(xy, float), group) for xy in places)
    survey = Survey("test", {"in": approach, "up": other}, {}, (way,), lights=lights)
    return find_lit_legs(survey, legs, CrossingChoice({}, ()))


@pytest.mark.parametrize(
    ("place", "lit"),
    [
        ((12, 2), {0: "g"}),
        ((14, 7.5), {0: "g"}), ((14, 8.5), {}),
        ((50, 2), {0: "g"}), ((60, 2), {}),
        ((4, 2), {0: "g"}), ((-11, 2), {}),
        ((2, -14), {1: "g"}),
    ],
)  # fmt: skip
def test_a_light_counts_beside_the_end_of_a_lane_and_the_first_half_of_its_way(place, lit):
    assert lit_place(place) == lit


def test_lights_without_a_group_count_and_every_leg_has_its_own():
    assert lit_place((12, 2), (13, 2), group="") == {0: ""}
    assert lit_place((12, 2), (2, -14), group="7") == {0: "7", 1: "7"}
