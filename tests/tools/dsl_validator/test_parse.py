"""Text to typed tree and back; every fault is told with its place."""

from __future__ import annotations

from contextlib import suppress
from typing import Any, get_args

import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenewright.errors import Rejected
from scenewright.scene.constraints import (
    AgentFigure,
    AgentFigureName,
    Before,
    BrakesFor,
    Clause,
    ConstraintProgram,
    Contact,
    GivesWay,
    Headway,
    MinLength,
    Near,
    NoInteraction,
    OnRoad,
    OnWalkable,
    PairFigure,
    PairFigureName,
    PassesThrough,
    RunsRed,
    SameLane,
    SpeedBetween,
    TimeGap,
)
from scenewright.scene.rejection import Rejection
from scenewright.scene.relations import Pattern, load_patterns
from scenewright.tools.dsl_validator.parse import MAX_BYTES, MAX_CLAUSES, format_program, parse

EVERY_CLAUSE = """
# one of each
on_road(vehicle-1); on_walkable(pedestrian-1); min_length(vehicle-1) >= 30 m
passes_through(pedestrian-1, crosswalk north); passes_through(vehicle-1, junction)
speed(vehicle-1) in [6, 11] m/s   # free speed
near(vehicle-1, pedestrian-1) <= 1 m; same_lane(vehicle-1, vehicle-2) >= 20 m;
before(pedestrian-1, vehicle-1); time_gap(vehicle-1, pedestrian-1) in [0.7, 1.4] s

headway(vehicle-1, vehicle-2) in [1, 2.5] s; contact(vehicle-1, vehicle-2, angle, 7 m/s)
contact(vehicle-1, vehicle-2, 7 m/s); contact(vehicle-1, pedestrian-1, pedestrian_strike)
contact(vehicle-1, vehicle-2) with front on rear_left; contact(vehicle-1, vehicle-2, angle) on side
contact(vehicle-1, pedestrian-1, 7 m/s) with front_right
brakes_for(vehicle-1, pedestrian-1) in [0.9, 1.3] s
gives_way(vehicle-1, pedestrian-1); runs_red(vehicle-1)
no_interaction(vehicle-1); no_interaction(vehicle-1, vehicle-3)
"""


def agents(kind: str) -> st.SearchStrategy[str]:
    return st.integers(1, 10**15).map(lambda number: f"{kind}-{number}")


AGENT = agents("vehicle") | agents("pedestrian")
PAIR = st.lists(AGENT, min_size=2, max_size=2, unique=True)
COMPASS = st.sampled_from(
    ["north", "northeast", "east", "southeast", "south", "southwest", "west", "northwest"]
)
CROSSED = st.sampled_from(["crosswalk", "leg"])
KIND = st.sampled_from(
    ["pedestrian_strike", "rear_end", "sideswipe", "head_on", "left_turn", "angle"]
)


POINT = st.sampled_from(
    [
        "front",
        "rear",
        "side",
        "left",
        "right",
        "front_left",
        "front_right",
        "rear_left",
        "rear_right",
    ]
)


def positive(limit: float) -> st.SearchStrategy[float]:
    return st.floats(0, limit, exclude_min=True)


@st.composite
def pairs(draw: st.DrawFn, model: type[Clause], **fields: st.SearchStrategy[Any]) -> Clause:
    first, second = draw(PAIR)
    return model(first=first, second=second, **{name: draw(of) for name, of in fields.items()})


@st.composite
def ranges(draw: st.DrawFn, model: type[Clause], limit: float, **agent: Any) -> Clause:
    low, high = sorted(draw(st.tuples(positive(limit), positive(limit))))
    return model(low=low, high=high, **{name: draw(of) for name, of in agent.items()})


@st.composite
def struck(draw: st.DrawFn) -> Clause:
    first, second = draw(st.lists(agents("vehicle"), min_size=2, max_size=2, unique=True))
    values = {name: draw(POINT | st.none()) for name in ("point_first", "point_second")}
    cause = draw(st.none() | st.just("late_brake"))
    return Contact(first=first, second=second, kind=draw(KIND | st.none()), cause=cause, **values)


@st.composite
def paired_ranges(draw: st.DrawFn, model: type[Clause], limit: float) -> Clause:
    first, second = draw(PAIR)
    return draw(ranges(model, limit, first=st.just(first), second=st.just(second)))


@st.composite
def figures_of_two(draw: st.DrawFn) -> Clause:
    first, second = draw(PAIR)
    name = st.sampled_from(get_args(PairFigureName))
    return draw(ranges(PairFigure, 100, first=st.just(first), second=st.just(second), clause=name))


CLAUSE = st.one_of(
    st.builds(OnRoad, agent=agents("vehicle")),
    st.builds(OnWalkable, agent=agents("pedestrian")),
    st.builds(MinLength, agent=AGENT, metres=positive(500)),
    st.builds(PassesThrough, agent=AGENT, region=CROSSED, leg=COMPASS),
    st.builds(PassesThrough, agent=AGENT, region=st.just("junction")),
    ranges(SpeedBetween, 20, agent=AGENT),
    st.builds(RunsRed, agent=AGENT),
    pairs(Near, metres=positive(200)),
    pairs(SameLane, metres=positive(200)),
    pairs(Before),
    paired_ranges(TimeGap, 30),
    paired_ranges(Headway, 10),
    pairs(Contact, kind=KIND | st.none(), speed=positive(20) | st.none()),
    struck(),
    ranges(AgentFigure, 100, agent=AGENT, clause=st.sampled_from(get_args(AgentFigureName))),
    figures_of_two(),
    ranges(BrakesFor, 8, first=agents("vehicle"), second=agents("pedestrian")),
    pairs(GivesWay),
    pairs(NoInteraction),
    st.builds(NoInteraction, first=AGENT),
)


def refusal(text: str) -> Rejection:
    with pytest.raises(Rejected) as caught:
        parse(text)
    rejection = caught.value.rejection
    assert (rejection.stage, rejection.code) == ("waypoint_filter", "malformed_program")
    return rejection


@given(clauses=st.lists(CLAUSE, max_size=6))
def test_text_and_tree_are_the_same_program(clauses: list[Clause]) -> None:
    program = ConstraintProgram(clauses=tuple(clauses))
    assert parse(format_program(program)) == program


@given(text=st.text(max_size=60) | st.text("on_rad(vehicle-1), \n;#[]>=.ms/", max_size=60))
def test_any_text_is_a_program_or_refused(text: str) -> None:
    with suppress(Rejected):
        assert isinstance(parse(text), ConstraintProgram)


def test_every_clause_is_read_with_its_values() -> None:
    assert parse(EVERY_CLAUSE).clauses == (
        OnRoad(agent="vehicle-1"),
        OnWalkable(agent="pedestrian-1"),
        MinLength(agent="vehicle-1", metres=30),
        PassesThrough(agent="pedestrian-1", region="crosswalk", leg="north"),
        PassesThrough(agent="vehicle-1", region="junction"),
        SpeedBetween(agent="vehicle-1", low=6, high=11),
        Near(first="vehicle-1", second="pedestrian-1", metres=1),
        SameLane(first="vehicle-1", second="vehicle-2", metres=20),
        Before(first="pedestrian-1", second="vehicle-1"),
        TimeGap(first="vehicle-1", second="pedestrian-1", low=0.7, high=1.4),
        Headway(first="vehicle-1", second="vehicle-2", low=1, high=2.5),
        Contact(first="vehicle-1", second="vehicle-2", kind="angle", speed=7),
        Contact(first="vehicle-1", second="vehicle-2", speed=7),
        Contact(first="vehicle-1", second="pedestrian-1", kind="pedestrian_strike"),
        Contact(
            first="vehicle-1", second="vehicle-2", point_first="front", point_second="rear_left"
        ),
        Contact(first="vehicle-1", second="vehicle-2", kind="angle", point_second="side"),
        Contact(first="vehicle-1", second="pedestrian-1", speed=7, point_first="front_right"),
        BrakesFor(first="vehicle-1", second="pedestrian-1", low=0.9, high=1.3),
        GivesWay(first="vehicle-1", second="pedestrian-1"),
        RunsRed(agent="vehicle-1"),
        NoInteraction(first="vehicle-1"),
        NoInteraction(first="vehicle-1", second="vehicle-3"),
    )


@pytest.mark.parametrize("text", ["", "\n", " ; ;\r\n", "# nothing here"])
def test_a_program_may_be_empty(text: str) -> None:
    assert parse(text) == ConstraintProgram()


@pytest.mark.parametrize(
    ("text", "detail"),
    [
        (
            "runs_red(vehicle-1)\n# why\nnear(vehicle-1, vehicle-2) <= ) m",
            "line 3, column 31: expected a number, found ')'",
        ),
        ("near(vehicle-1, vehicle-2) < 3 m", "line 1, column 28: expected '<=', found '<'"),
        (
            "speed(vehicle-1) in [1, 2] m",
            "line 1, column 28: expected the unit 'm/s', found 'm'",
        ),
        (
            "on_road(pedestrian-1)",
            "line 1, column 9: expected a vehicle such as vehicle-1 or a rider such as cyclist-1, "
            "found 'pedestrian-1'",
        ),
        (
            "near(vehicle-1,",
            "line 1, column 16: expected an agent such as vehicle-1 or pedestrian-1, "
            "found the end of the text",
        ),
        (
            "passes_through(vehicle-1,\njunction)",
            "line 1, column 26: expected 'crosswalk' or 'leg' or 'junction', "
            "found the end of the line",
        ),
        (
            "contact(vehicle-1, vehicle-2) on top",
            "line 1, column 34: expected a point of impact such as front_left, found 'top'",
        ),
        (
            "runs_red(vehicle-1) runs_red(vehicle-2)",
            "line 1, column 21: expected a new line or ';', found 'runs_red'",
        ),
    ],
)
def test_a_misspelt_program_is_refused_with_its_place(text: str, detail: str) -> None:
    assert refusal(text).detail == detail


def test_an_unknown_clause_is_answered_with_those_that_exist() -> None:
    detail = refusal("\nteleports(vehicle-1)").detail
    assert detail.startswith("line 2, column 1: expected a clause (on_road, on_walkable,")
    assert detail.endswith("found 'teleports'")


@pytest.mark.parametrize(
    ("text", "detail"),
    [
        ("speed(vehicle-1) in [9, 3] m/s", "speed: range [9, 3] is empty"),
        ("min_length(vehicle-1) >= -3 m", "min_length: metres must be more than 0, got -3"),
        ("near(vehicle-1, vehicle-2) <= 1e999 m", "near: metres must be at most 200, got 1e999"),
        (
            "contact(vehicle-1, pedestrian-1) on rear",
            "contact: pedestrian-1 is a pedestrian, which has no rear",
        ),
        ("brakes_for(vehicle-1, vehicle-2) in [3, 2] s", "brakes_for: range [3, 2] is empty"),
        ("before(vehicle-1, vehicle-1)", "before: needs two different agents, got vehicle-1 twice"),
    ],
)
def test_an_impossible_value_is_refused_with_its_place(text: str, detail: str) -> None:
    rejection = refusal(f"\n  {text}")
    assert rejection.detail == f"line 2, column 3: {detail}"
    assert rejection.agents[0] == "vehicle-1"


def test_size_is_limited() -> None:
    assert str(MAX_BYTES) in refusal("#" * (MAX_BYTES + 1)).detail
    assert str(MAX_CLAUSES) in refusal("runs_red(vehicle-1);" * (MAX_CLAUSES + 1)).detail
    assert len(parse("runs_red(vehicle-1);" * MAX_CLAUSES).clauses) == MAX_CLAUSES


@pytest.mark.parametrize("pattern", load_patterns(), ids=lambda pattern: pattern.id)
def test_the_clauses_of_every_relation_are_programs(pattern: Pattern) -> None:
    names = [role.type.replace("rider", "cyclist") for role in (pattern.from_, pattern.to)]
    first, second = f"{names[0]}-1", f"{names[1]}-2"
    lines = [pattern.fill(line, from_=first, to=second) for line in pattern.clauses]
    assert len(parse("\n".join(lines)).clauses) == len(lines)
