"""Plans as files: what is written is read back, and a mistake is named by line and field."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from scenewright.backends import load_backend
from scenewright.cli.main import main
from scenewright.cli.plan import check_plan_file
from scenewright.errors import InputError
from scenewright.graph.run import plan_instruction
from scenewright.scene.plan_file import (
    build_plan_schema,
    format_plan,
    read_logical_plan,
    read_plan,
)
from scenewright.scene.social import SocialGraph

EXAMPLES = (
    (Path(__file__).parents[2] / "examples" / "instructions.txt").read_text("utf-8").splitlines()
)
GOOD = """\
agents:
  - id: vehicle-1
    subtype: car
    entry: south
  - id: pedestrian-1
relations:
  - type: collide_at
    from: vehicle-1
    to: pedestrian-1
    impact_speed: 30 km/h
context:
  time_of_day: "08:00"
"""


def write(folder: Path, text: str | bytes) -> Path:
    file = folder / "scene.yaml"
    file.write_bytes(text if isinstance(text, bytes) else text.encode())
    return file


@pytest.mark.parametrize("text", EXAMPLES[:24])
def test_plans_of_texts_are_read_back_as_they_were(tmp_path: Path, text: str) -> None:
    plan = plan_instruction(text)
    found = read_plan(write(tmp_path, format_plan(plan, text)))
    assert found.plan == plan
    assert found.as_read
    assert found.text == text


def test_any_characters_of_a_text_are_read_back(tmp_path: Path) -> None:
    plan = SocialGraph.model_validate({"agents": [{"id": "vehicle-1", "type": "vehicle"}]})
    text = 'a "quote", é, 🚗, a\\b\ttab\nline\u2028 end \x7f\ufeff # no: comment'
    assert read_plan(write(tmp_path, format_plan(plan, text))).text == text


def test_a_change_makes_the_fields_count(tmp_path: Path) -> None:
    text = "A car hits a pedestrian"
    written = format_plan(plan_instruction(text), text).replace("subtype: car", "subtype: bus")
    assert not read_plan(write(tmp_path, written)).as_read


def test_units_and_what_follows_from_names(tmp_path: Path) -> None:
    plan = read_plan(write(tmp_path, GOOD)).plan
    assert plan.relations[0].impact_speed == pytest.approx(30 / 3.6)
    assert [agent.type for agent in plan.agents] == ["vehicle", "pedestrian"]


MISTAKES = {
    "unknown field": ("entry: south", "entree: south", 4, "agents[0].entree", "is entry meant"),
    "wrong value": ("entry: south", "entry: up", 4, "agents[0].entry", "'north'"),
    "wrong type": ('time_of_day: "08:00"', "density: 3", 12, "context.density", "'low'"),
    "unknown agent": ("to: pedestrian-1", "to: pedestrian-7", 9, "relations[0].to", "vehicle-1"),
    "bad unit": ("30 km/h", "30 knots", 10, "relations[0].impact_speed", "km/h"),
    "no number": ("30 km/h", "fast", 10, "relations[0].impact_speed", "a number in m/s"),
    "out of bounds": ("30 km/h", "300 km/h", 10, "relations[0].impact_speed", "20"),
    "duplicated key": ("entry: south", "subtype: bus", 4, "agents[0].subtype", "line 3"),
    "tab": ("    entry: south", "\tentry: south", 4, "entry", "spaces"),
    "empty": (GOOD, "", 1, "", "is empty"),
    "list for mapping": (GOOD, "- id: vehicle-1\n", 1, "", "agents"),
    "mapping for list": ("agents:\n  - id: vehicle-1", "agents:\n    id: vehicle-1", None, "", ""),
    "agent twice": ("id: pedestrian-1", "id: vehicle-1", 5, "agents[1].id", "twice"),
    "impossible hour": ("08:00", "25:00", 12, "context.time_of_day", "07:00-09:30"),
    "itself": ("to: pedestrian-1", "to: vehicle-1", 9, "relations[0].to", "two different"),
    "bad name": ("id: pedestrian-1", "id: walker", 5, "agents[1].id", "vehicle-1"),
    "missing": ("    to: pedestrian-1\n", "", 7, "relations[0].to", "is missing"),
    "code": ("entry: south", "entry: !!python/name:os.system", 4, "agents[0].entry", "tag"),
    "alias": ("entry: south", "entry: *south", 4, "entry", "alias"),
    "unclosed": ('"08:00"', '"08:00', 12, "time_of_day", ""),
    "range": ("30 km/h", "20 .. 30 km/h", 10, "relations[0].impact_speed", "sweep"),
    "unknown place": ("entry: south", "entry: has a moat", 4, "agents[0].entry", "left-turn lane"),
    "any leg": ("entry: south", "entry: has no parking", 4, "agents[0].entry", "sweep"),
    "no comparison": ("agents:", "constraints: [1 + 1]\nagents:", 1, "constraints[0]", "!="),
    "call": ("agents:", "constraints: ['f(vehicle-1.entry) > 1']\nagents:", 1,
             "constraints[0]", "!="),
    "broken": ("agents:", "constraints: [vehicle-1.entry == north]\nagents:", 1, "constraints[0]",
               "does not hold"),
    "unset": ("agents:", "constraints: [vehicle-1.exit == north]\nagents:", 1, "constraints[0]",
              "vehicle-1.exit is not set"),
    "words less": ("agents:", "constraints: [vehicle-1.entry < 3]\nagents:", 1, "constraints[0]",
                   "cannot be computed"),
    "walker turns": ("id: pedestrian-1", "id: pedestrian-1\n    motion: blocks_junction", 6,
                     "agents[1].motion", "no vehicle"),
    "walker is a taxi": ("id: pedestrian-1", "id: pedestrian-1\n    subtype: taxi", 6,
                         "agents[1].subtype", "no vehicle"),
    "no colon": ("subtype: car", "subtype car", 3, "subtype", "`name: value`"),
    "not indented": ("    entry: south", "   entry: south", 4, "entry", "indented"),
    "line ends of other kinds": ("agents:", "# a \u2028 b \x85\r\nagents", 2, "agents", "colon"),
    "section without colon": ("agents:", "agents", 1, "agents", "colon is missing"),
    "second colon": ("entry: south", "entry: south: left", 4, "entry", "quotes"),
    "open list": ("subtype: car", "subtype: [car, bus", 3, "subtype", "not closed"),
    "listed id": ("id: pedestrian-1", "id: [pedestrian-1]", 5, "agents[1].id", "one word"),
    "listed typo": ("subtype: car", "subtype: [car, buss]", 3, "agents[0].subtype", "'buss'"),
    "listed stranger": ("from: vehicle-1", "from: [vehicle-1, vehicle-2]", 8,
                        "relations[0].from", "vehicle-2 is not among"),
    "truth for number": ("30 km/h", "true", 10, "relations[0].impact_speed", "a number"),
    "decimal comma": ("30 km/h", "8,3", 10, "relations[0].impact_speed", "a point"),
    "no impact": ("collide_at", "near_miss", 10, "relations[0].impact_speed", "collide_at"),
    "measure": ("agents:", "measures: [{kind: pace, agent: vehicle-1, value: 3 m/s}]\nagents:", 1,
                "measures[0].kind", "'speed'"),
    "figure": ("agents:", "measures: [{kind: speed, agent: vehicle-1, value: 300}]\nagents:", 1,
               "measures[0].value", "at most 100"),
    "field before constraint": (
        "agents:\n  - id: vehicle-1",
        "constraints: [vehicle-1.entry == south]\nagents:\n  - id: car-1",
        3, "agents[0].id", "vehicle-1"),
}  # fmt: skip


@pytest.mark.parametrize("name", MISTAKES)
def test_a_mistake_is_named_by_line_and_field(tmp_path: Path, name: str) -> None:
    good, bad, line, field, help_ = MISTAKES[name]
    assert good in GOOD
    with pytest.raises(InputError) as caught:
        read_plan(write(tmp_path, GOOD.replace(good, bad)))
    said = str(caught.value)
    assert said.startswith(str(tmp_path / "scene.yaml"))
    assert line is None or f"line {line}" in said
    assert f"{field}:" in said
    assert help_ in said


MANY = """\
constraints: [1 + 1, vehicle-9.entry]
agents:
  - {id: vehicle-1, subtyp: car, entry: up, movement: left}
  - {id: vehicle-2, subtype: [car, buss], entry: has a moat}
  - {id: pedestrian-1, subtype: taxi, members: 30}
relations:
  - {type: colide_at, from: vehicle-1, to: vehicle-2, impact_speed: 30 knots}
  - {type: near_miss, from: vehicle-1, too: pedestrian-1, target_pet: 3 .. 1 s}
  - {type: near_miss, from: vehicle-1, to: pedestrian-7, impact_speed: 3}
  - {type: near_miss, from: vehicle-1, to: vehicle-1}
  - {type: near_miss, to: pedestrian-8, from: vehicle-1}
measures:
  - {kind: pace, agent: vehicle-1, value: 3 m/s}
  - {kind: speed, agent: vehicle-4, value: fast}
  - {kind: gap, agent: vehicle-1, value: 3 m}
objects:
  - {id: object-1, kind: parked, hides: pedestrian-1, hidden_from: vehicle-1}
context: {time_of_day: "25:00", density: 3, background: {vehicles: -1}}
extra: 3
"""
ALL = """\
1 constraints[0], 1 constraints[1], 3 agents[0].entry, 3 agents[0].subtyp, 4 agents[1].subtype,
4 agents[1].entry, 5 agents[2].members, 5 agents[2].subtype, 7 relations[0].type,
7 relations[0].impact_speed, 8 relations[1].too, 8 relations[1].target_pet,
9 relations[2].impact_speed, 9 relations[2].to, 10 relations[3].to, 11 relations[4].to,
13 measures[0].kind, 14 measures[1].value, 14 measures[1].agent, 15 measures[2].other,
18 context.density, 18 context.time_of_day, 18 context.background.vehicles, 19 extra"""


def test_all_mistakes_come_at_once(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = write(tmp_path, MANY)
    assert main(["plan", str(file)]) == 2
    said = capsys.readouterr().err.splitlines()
    # That an object's hiding needs a relation is not said, as one that is wrong may be that.
    found = [re.fullmatch(rf"scenewright: {file}, line (\d+), (\S+): (.+)", line) for line in said]
    assert sorted(f"{each[1]} {each[2]}" for each in found if each) == sorted(re.split(r",\s", ALL))
    assert len(found) == len(said)


def test_mistakes_of_yaml_come_at_once(tmp_path: Path) -> None:
    text = GOOD.replace("entry: south", "subtype: bus").replace("from:", "from: a\n    from:")
    with pytest.raises(InputError) as caught:
        read_plan(write(tmp_path, text.replace("pedestrian-1", "!!set pedestrian-1")))
    assert [re.search(r"line (\d+)", line)[1] for line in caught.value.lines] == [  # type: ignore[index]
        "4", "5", "9", "10"]  # fmt: skip


def test_agents_without_a_way_are_named_at_once(tmp_path: Path) -> None:
    text = GOOD.replace("entry: south", "movement: crossing").replace(
        "pedestrian-1\nrel", "pedestrian-1\n    movement: left\nrel"
    )
    with pytest.raises(InputError) as caught:
        check_plan_file(str(write(tmp_path, text)), None)
    assert [f"{each}:" in line for each, line in zip(
        ("agents[0].movement", "agents[1].movement"), caught.value.lines, strict=True)] == [
            True, True]  # fmt: skip


FIGURES = """\
agents:
  - {id: vehicle-1}
  - {id: vehicle-2}
  - {id: cyclist-1}
  - {id: pedestrian-1}
relations:
  - {type: collide_at, from: vehicle-1, to: vehicle-2, impact_speed: 12 m/s}
  - {type: near_miss, from: vehicle-1, to: cyclist-1}
  - {type: near_miss, manoeuvre: lead_brakes, from: cyclist-1, to: vehicle-2}
measures:
  - {kind: speed, agent: vehicle-1, value: 3 m/s}
  - {kind: speed, agent: cyclist-1, value: 14 m/s}
  - {kind: speed, agent: pedestrian-1, value: 4.4 m/s}
  - {kind: gap, agent: vehicle-1, other: vehicle-2, value: 59 m}
  - {kind: headway, agent: vehicle-1, other: vehicle-2, value: 0.6 s}
  - {kind: braking, agent: vehicle-2, value: 1 m/s2}
"""


def test_figures_that_exclude_one_another_are_named(tmp_path: Path) -> None:
    with pytest.raises(InputError) as caught:
        read_plan(write(tmp_path, FIGURES))
    said = [line.removeprefix(f"{tmp_path / 'scene.yaml'}, line ") for line in caught.value.lines]
    assert said == [
        # 3.5 m/s kept at most, and 4 m/s2 for less than the second that would keep it
        "7, relations[0].impact_speed: vehicle-1 keeps 3.5 m/s at most and gains 5 m/s in the "
        "last second, so it cannot strike at 12 m/s",
        "12, measures[1].value: speed of a cyclist is 0.3 to 9 m/s",
        # 20 m/s times 0.75 s
        "14, measures[3].value: a headway of 0.45 to 0.75 s is a gap of 0.45 to 15 m, "
        "not of 58.7 to 59.3 m",
        "16, measures[5].value: who lead_brakes brakes at 4.5 m/s2 or more",
    ]
    near = FIGURES.replace("12 m/s}", "8 m/s}").replace("14 m/s", "9.4 m/s")
    near = near.replace("59 m", "15 m").replace("1 m/s2", "4 m/s2")
    assert len(read_plan(write(tmp_path, near)).plan.measures) == 6
    # The speed of an impact with a pedestrian is the vehicle's, whoever runs into the other.
    walks = "{kind: speed, agent: pedestrian-1, value: 1 m/s}"
    good = GOOD.replace(
        "from: vehicle-1\n    to: pedestrian-1", "from: pedestrian-1\n    to: vehicle-1"
    )
    assert good != GOOD
    assert read_plan(write(tmp_path, f"measures: [{walks}]\n{good}")).plan.measures
    with pytest.raises(InputError, match=r"vehicle-1 keeps 1\.5 m/s at most"):
        read_plan(write(tmp_path, f"measures: [{walks.replace('pedestrian', 'vehicle')}]\n{good}"))


def test_a_plan_shows_what_it_leaves_open(tmp_path: Path) -> None:
    open_ = GOOD.replace("30 km/h", "18 .. 36 km/h").replace("subtype: car", "subtype: [car, bus]")
    open_ = open_.replace("entry: south", "entry: has parking").replace("08:00", "16:30-18:30")
    shown = check_plan_file(str(write(tmp_path, open_)), None)
    assert shown["summary"].startswith("For example: ")
    assert shown["summary"].endswith(
        " Left open: agents[0].subtype: car or bus; agents[0].entry: has parking; "
        "relations[0].impact_speed: 18 .. 36 km/h; context.time_of_day: 16:30-18:30."
    )
    fixed = check_plan_file(str(write(tmp_path, GOOD)), None)["summary"]
    assert "Left open" not in fixed
    assert "For example" not in fixed


def test_a_span_of_time_is_one_plan_and_many_points(tmp_path: Path) -> None:
    file = write(tmp_path, GOOD.replace("08:00", "22:00-02:00"))
    assert read_plan(file).plan.context.time_of_day == "22:00-02:00"
    spread = read_logical_plan(file).spreads["context", "time_of_day"]
    drawn = [spread.compute_value(share) for share in (0.0, 0.25, 0.5, 0.75, 1.0)]
    assert drawn == ["22:00", "23:00", "00:00", "01:00", "02:00"]


NO_WAY = {
    "movement": ("entry: south", "movement: crossing", 4, "agents[0].movement", "with straight"),
    "crosswalk": ("entry: south", "crosswalk: south", 4, "agents[0].crosswalk", "leave it out"),
    "place": ("context:", "intersections: [moon]\ncontext:", 11, "intersections", "'moon'"),
}


@pytest.mark.parametrize("name", NO_WAY)
def test_what_no_map_has_is_named_by_line_and_field(tmp_path: Path, name: str) -> None:
    good, bad, line, field, help_ = NO_WAY[name]
    file = write(tmp_path, GOOD.replace(good, bad))
    with pytest.raises(InputError) as caught:
        check_plan_file(str(file), None)
    said = str(caught.value)
    assert said.startswith(f"{file}, line {line}, {field}:")
    assert help_ in said


@pytest.mark.parametrize(
    "data",
    [b"\xff\xfe\x00", b"a: \x00", b"[" * 60_000, b"{a: 1" * 9_000, b"a: " + b"9" * 20_000,
     b"? [1, 2]\n: 3", b"--- 1\n--- 2", b"agents: 3", b"agents: [[1], null, vehicle-1]",
     b"agents: [{id: 3}]", b"relations: [{from: [a]}]\nagents: []", b"measures: [{value: [1, {}]}]",
     b"agents: []\nsaid: [3]", b"context: []", b"text: [a]\nagents: []", b"objects: {a: {b: c}}",
     b"x" * 300_000, b"agents: &a [*a]", b"measures: [{kind: [1], low: a}]"],
    ids=range(19),
)  # fmt: skip
def test_no_bytes_bring_out_a_bug(tmp_path: Path, data: bytes) -> None:
    with pytest.raises(InputError):
        read_plan(write(tmp_path, data))


def test_what_is_no_file_is_refused(tmp_path: Path) -> None:
    for path in (tmp_path, tmp_path / "none.yaml"):
        with pytest.raises(InputError, match="cannot read"):
            read_plan(path)


def test_values_are_left_open(tmp_path: Path) -> None:
    open_ = GOOD.replace("30 km/h", "18 .. 36 km/h").replace("car", "[car, bus]")
    logical = read_logical_plan(write(tmp_path, open_))
    kinds = {path[-1]: (each.kind, each.values) for path, each in logical.spreads.items()}
    assert kinds == {"impact_speed": ("range", (5.0, 10.0)), "subtype": ("list", ("car", "bus"))}
    middle = {path: each.compute_value(0.5) for path, each in logical.spreads.items()}
    plan = logical.settle(middle).plan
    assert plan.relations[0].impact_speed == 7.5
    assert plan.agents[0].subtype == "bus"


def test_the_schema_is_one_and_names_units() -> None:
    schema = json.loads(json.dumps(build_plan_schema()))
    speed = schema["$defs"]["RelationEdge"]["properties"]["impact_speed"]
    assert speed["unit"] == "m/s"
    assert {"agents", "relations", "context", "text", "read_as"} <= schema["properties"].keys()
    jsonschema = pytest.importorskip("jsonschema")
    jsonschema.Draft202012Validator.check_schema(schema)
    good = {"agents": [{"id": "vehicle-1", "entry": "south"}, {"id": "vehicle-2"}],
            "relations": [{"type": "near_miss", "from": "vehicle-1", "to": "vehicle-2",
                           "target_pet": "0.4 .. 1.2 s"}]}  # fmt: skip
    jsonschema.validate(good, schema)
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate({**good, "agent": 1}, schema)


def test_the_builtin_planner_is_asked_as_make_asks_it() -> None:
    text = EXAMPLES[0]
    assert plan_instruction(text, backend=load_backend("builtin")) == plan_instruction(text)
