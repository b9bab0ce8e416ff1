"""Plans in OpenSCENARIO DSL: valid, and read back as they were."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from scenewright.cli.main import main
from scenewright.errors import InputError
from scenewright.graph.run import plan_instruction, synthesize
from scenewright.scene.plan_file import LogicalPlan, read_logical_plan, read_plan
from scenewright.tools.formats import prepare_scene, write_scene

EXAMPLES = (
    (Path(__file__).parents[2] / "examples" / "instructions.txt").read_text("utf-8").splitlines()
)
LOGICAL = """\
intersections: [amsterdam_120, any]
constraints:
  - vehicle-1.entry != vehicle-2.entry
  - relations[0].target_pet * measures[0].value < 9
agents:
  - {id: vehicle-1, entry: has left-turn lane and crosswalk, movement: left, runs_red: true}
  - {id: vehicle-2, entry: has crosswalk, subtype: [car, truck]}
  - {id: vehicle-3}
  - {id: vehicle-4}
relations:
  - {type: near_miss, from: vehicle-1, to: vehicle-2, target_pet: 500 .. 2000 ms}
ties:
  - {agent: vehicle-1, of: vehicle-2, side: other}
objects:
  - {id: object-1, kind: stalled, met_by: vehicle-3, encounter: waits_behind, figure: [1 m, 4 m],
     others: [{agent: vehicle-4, encounter: queues}]}
measures:
  - {kind: speed, agent: vehicle-1, value: 3 .. 9 m/s}
  - {kind: wait, agent: vehicle-2, low: 1 s, high: 2 s}
context: {density: low, background: {vehicles: 2 .. 5}, time_of_day: "07:00-09:30"}
"""


def write(folder: Path, text: str) -> Path:
    file = folder / "plan.osc"
    file.write_text(text, encoding="utf-8")
    return file


@pytest.mark.parametrize("text", EXAMPLES[::3])
def test_plans_of_texts_are_read_back(tmp_path: Path, text: str) -> None:
    plan = plan_instruction(text)
    fields = plan.model_dump(mode="json", by_alias=True, exclude_defaults=True)
    file = write(tmp_path, LogicalPlan("p", {**fields, "text": text}).format_osc_dsl())
    assert read_plan(file).plan == plan.model_copy(update={"said": ()})
    check_syntax(file)


def test_what_is_left_open_is_read_back(tmp_path: Path) -> None:
    source = tmp_path / "plan.yaml"
    source.write_text(LOGICAL, encoding="utf-8")
    asked = read_logical_plan(source)
    file = write(tmp_path, asked.format_osc_dsl())
    found = read_logical_plan(file)
    assert (found.spreads, found.legs, found.places) == (asked.spreads, asked.legs, asked.places)
    assert [each.text for each in found.constraints] == [each.text for each in asked.constraints]
    assert found.settle_data({}) == {
        **asked.settle_data({}), "relations": found.data["relations"],
        "measures": found.data["measures"], "context": found.data["context"],
    }  # fmt: skip
    check_syntax(file)


def check_syntax(file: Path) -> None:
    """By another's parser of the language, where it is installed (py-osc2)."""
    try:
        from osc2parser import parse_file
    except ImportError:
        return
    assert parse_file(str(file))[1] == 0


def test_a_scene_is_exported_as_what_was_asked_for(tmp_path: Path) -> None:
    text = "A truck turning left yields to a pedestrian at 8 am"
    scene = synthesize(text, seed=1, refiner="none")
    from scenewright.intersections import load_map

    files = write_scene(prepare_scene(scene.record, load_map("amsterdam_120")), "osc-dsl")
    ((name, data),) = files.items()
    assert name.endswith(".osc")
    plan = read_logical_plan(write(tmp_path, data.decode())).settle({}).plan
    assert [each.id for each in plan.agents] == ["vehicle-1", "pedestrian-1"]
    assert (plan.agents[0].subtype, plan.agents[0].movement) == ("truck", "left")
    assert plan.relations[0].type == "yield_to"
    assert plan.context.time_of_day == "08:00"


@pytest.mark.parametrize(
    ("old", "new", "line", "what"),
    [("entry == south", "entry == up", 10, "agents[0].entry: must be"),
     ("entry == south", "entrance == south", 10, "there is no such field"),
     ("30.0mps", "30.0knots", 11, "constraints[0]"),
     ("    keep(relation_1.type_", "    set(relation_1.type_", 12, "keep(...)")],
    ids=range(4),
)  # fmt: skip
def test_a_mistake_is_named_by_its_line(
    tmp_path: Path, old: str, new: str, line: int, what: str
) -> None:
    good = """\
scenario s:
    vehicle_1: vehicle
    pedestrian_1: person
    relation_1: relation
    measure_1: measure_of_speed
    keep(measure_1.kind == speed)
    keep(measure_1.agent == vehicle_1)
    keep(relation_1.from == vehicle_1)
    keep(relation_1.to == pedestrian_1)
    keep(vehicle_1.entry == south)
    keep(measure_1.value == 30.0mps)
    keep(relation_1.type_ == collide_at)
    do parallel:
        vehicle_1.drive()
"""
    assert read_plan(write(tmp_path, good.replace("30.0", "10.0"))).plan.agents[0].entry == "south"
    file = write(tmp_path, good.replace(old, new))
    with pytest.raises(InputError, match=rf"plan\.osc, line {line}") as caught:
        read_plan(file)
    assert what in str(caught.value)
    with pytest.raises(InputError, match="holds no scenario"):
        read_plan(write(tmp_path, "import osc.standard.all\n"))


def test_the_command_writes_and_makes_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["plan", "A car yields to a pedestrian", "--osc-dsl", "--out", "p.osc"]) == 0
    assert main(["plan", "p.osc"]) == 0
    assert main(["make", "p.osc", "--out", "scene", "--no-picture", "--no-recording"]) == 0
    assert json.loads((tmp_path / "scene" / "proof.json").read_text("utf-8"))["verified"]
