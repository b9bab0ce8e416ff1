"""Kinds as files: no code knows their names, all that needs them has them, users add their own."""

from __future__ import annotations

import re
from pathlib import Path
from typing import get_args

import pytest

import scenewright
from scenewright import export, synthesize
from scenewright.errors import InputError
from scenewright.nodes.scene_planner.prompts import describe_manoeuvres, describe_objects
from scenewright.nodes.scene_planner.reply import build_plan_schema
from scenewright.scene.kinds import Axis, Kind, Trait, list_kinds, list_shipped
from scenewright.scene.phrasing import describe_graph
from scenewright.scene.plan_file import format_plan, read_plan
from scenewright.scene.record import SceneRecord
from scenewright.scene.route_table import FOUR_LEGS
from scenewright.scene.social import SocialGraph
from scenewright.tools.dsl_validator.parse import format_program, parse

PACKAGE = Path(scenewright.__file__).parent
DOCS = Path(__file__).parents[2] / "docs"
AXES: tuple[Axis, ...] = ("manoeuvre", "motion", "reaction", "encounter", "cause")
KINDS = [kind for axis in AXES for kind in list_shipped(axis)]
IDS = [f"{kind.axis} {kind.id}" for kind in KINDS]
WORDS = (
    "A car brakes hard ahead, in the middle somebody runs or walks back at yellow, does not react, "
    "swerves; past a parked car."
)

STILL_NAMED = {
    # The checker's own vocabulary of what it sees: keys of evidence and rows of reactions.
    "late_brake": {
        "nodes/scene_verifier/__init__.py", "tools/account/claim_tests.py",
        "tools/account/field_claims.py", "tools/account/sense_readers.py",
        "tools/relation_checker/collisions.py", "tools/relation_checker/events.py",
        "tools/relation_checker/verdict.py",
    },
    "red_light_run": {"tools/relation_checker/collisions.py"},
    "swerves": {"tools/relation_checker/reactions.py"},
    "steps_back": {"tools/relation_checker/reactions.py"},
    "jumps_back": {"tools/relation_checker/reactions.py"},
}  # fmt: skip
"""Files that still write a kind's name; shorten it, never lengthen it."""
ANY_WORDS = ("none", "runs", "hits")
"""Ids that code writes as words of the language or of its own."""


def find_files_naming(name: str) -> set[str]:
    quoted = re.compile(rf"(?<![\w.])[\"']{name}[\"']")
    return {
        file.relative_to(PACKAGE).as_posix()
        for file in PACKAGE.rglob("*.py")
        if any(quoted.search(line) for line in file.read_text("utf-8").splitlines())
    }


@pytest.mark.parametrize("kind", [k for k in KINDS if k.id not in ANY_WORDS], ids=lambda k: k.id)
def test_no_code_names_a_kind(kind: Kind) -> None:
    rooms = (("solver", kind.template), ("relation_checker", kind.observe))
    own = {f"tools/{room}/{name.partition(':')[0]}.py" for room, name in rooms if name}
    assert find_files_naming(kind.id) - own == STILL_NAMED.get(kind.id, set()) - own


@pytest.mark.parametrize("kind", KINDS, ids=IDS)
def test_every_kind_is_in_schema_phrasing_and_docs(kind: Kind) -> None:
    assert f'"{kind.id}"' in str(build_plan_schema(FOUR_LEGS, (), WORDS)).replace("'", '"')
    assert kind.says or kind.axis == "cause"
    row = f"| `{kind.id}` | {', '.join(kind.agents)} | {kind.help} |"
    assert row in (DOCS / "kinds.md").read_text("utf-8")


def test_every_trait_is_explained() -> None:
    page = (DOCS / "kinds.md").read_text("utf-8").split("## Traits")[1]
    assert [trait for trait in get_args(Trait) if f"`{trait}`" not in page] == []


@pytest.mark.parametrize(
    "kind", [k for k in KINDS if k.prompt and k.axis != "cause"], ids=lambda k: k.id
)
def test_every_kind_that_a_model_is_told_of_is_in_the_prompt(kind: Kind) -> None:
    assert kind.prompt in describe_manoeuvres(WORDS) + describe_objects(WORDS)


@pytest.mark.parametrize("kind", [k for k in KINDS if k.constraints], ids=lambda k: k.id)
def test_the_clauses_of_a_kind_are_read_back(kind: Kind) -> None:
    for line in kind.constraints:
        text = line.replace("{agent}", f"{kind.agents[0]}-1")
        assert format_program(parse(text)) == text


@pytest.mark.parametrize(
    "kind", [k for k in KINDS if k.axis in ("motion", "reaction")], ids=lambda k: k.id
)
def test_an_agent_of_another_class_is_asked_for_no_such_kind(kind: Kind, tmp_path: Path) -> None:
    for agent in ("vehicle", "pedestrian", "cyclist", "scooter"):
        node = {"id": f"{agent}-1", "type": agent, kind.axis: kind.id}
        if agent in kind.agents:
            graph = SocialGraph.model_validate({"agents": [node]})
            assert kind.say() in describe_graph(graph)
            (tmp_path / "plan.yaml").write_text(format_plan(graph), "utf-8")
            assert read_plan(tmp_path / "plan.yaml").plan == graph
        else:
            with pytest.raises(ValueError, match=f"cannot be {kind.id}"):
                SocialGraph.model_validate({"agents": [node]})


HURTLES = """
id = "hurtles"
axis = "motion"
help = "it runs as fast as it can"
agents = ["pedestrian"]
words = ["hurtles across", "hurtling across"]
prompt = "hurtles (runs as fast as it can)"
constraints = ["speed({agent}) in [3.3, 4.2] m/s"]
traits = ["running", "afoot"]
observe = "motions:describe_run"
figures = { least_speed = 3.0 }
ranges = { speed = [3.5, 4.1] }

[says]
any = "hurtles across"
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("SCENEWRIGHT_RELATIONS", str(tmp_path))
    return tmp_path


def test_a_kind_of_a_users_own_is_read_made_proven_said_and_exported(folder: Path) -> None:
    (folder / "hurtles.toml").write_text(HURTLES, "utf-8")
    text = "A pedestrian hurtles across the north crosswalk and a car nearly hits her."
    scene = synthesize(text, seed=1, refiner="none")
    graph = scene.state["social_graph"]
    assert graph.agent("pedestrian-1").motion == "hurtles"
    assert "hurtles across" in describe_graph(graph)
    assert "hurtles (runs as fast as it can)" in describe_manoeuvres("she runs across")
    assert "hurtles" in str(build_plan_schema(FOUR_LEGS, (), "she runs across"))
    (walker,) = (each for each in scene.record.agents if each.motion == "hurtles")
    assert "hurtles" in [each.value for each in scene.record.said if each.became == "motion"]
    (tracks,) = export(scene, "csv", folder / "out")
    assert f",{walker.id},pedestrian," in tracks.read_text("utf-8")
    slower = HURTLES.replace("least_speed = 3.0", "least_speed = 4.6")
    assert not proves_with(folder / "faster", slower, scene.record)
    assert proves_with(folder / "same", HURTLES, scene.record)


def proves_with(folder: Path, file: str, record: SceneRecord) -> bool:
    folder.mkdir()
    (folder / "hurtles.toml").write_text(file, "utf-8")
    with pytest.MonkeyPatch.context() as patched:
        patched.setenv("SCENEWRIGHT_RELATIONS", str(folder))
        return bool(scenewright.verify(record).verified)


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ('axis = "motion"', 'axis = "dance"', "axis: Input should be 'manoeuvre'"),
        ('agents = ["pedestrian"]', 'agents = ["dog"]', "agents.0: Input should be 'vehicle'"),
        ('"running"', '"flies"', "traits."),
        ("describe_run", "describe_flight", "observe: no shipped kind has 'motions:de"),
        ("describe_run", "__import__", "observe: String should match"),
        ("help =", "helps =", "help: is missing"),
        ("[says]\nany", "[says]\nfollow", "says: a motion needs 'any'"),
        ("words =", "reads = 'a'\nwords =", "reads, heard: only shipped kinds have these"),
    ],
)
def test_a_faulty_kind_is_told_with_its_field(folder: Path, old: str, new: str, told: str) -> None:
    assert old in HURTLES
    (folder / "hurtles.toml").write_text(HURTLES.replace(old, new), "utf-8")
    with pytest.raises(InputError) as caught:
        list_kinds("motion")
    assert str(caught.value).startswith(f"hurtles.toml is not a kind: {told}")
