"""Questions in words: what they hold, how long they are, and what their schemas let through."""

from __future__ import annotations

import json
import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError

from benchmarks.inlined_schema import inline_references
from scenewright import synthesize
from scenewright.backends import TASKS, Prompt, Question, load_backend
from scenewright.backends.choosing import StagedBackend
from scenewright.backends.text_backend import TextBackend
from scenewright.errors import Rejected
from scenewright.intersections import load_map
from scenewright.nodes.event_reasoner.reply import StopsReply
from scenewright.nodes.prompts import (
    MOST_TOKENS,
    Example,
    count_tokens,
    format_examples,
    format_json,
)
from scenewright.nodes.scene_planner import FOUR_LEGS, describe_routes
from scenewright.nodes.scene_planner.prompts import (
    describe_objects,
    describe_times,
    render_plan_prompt,
)
from scenewright.nodes.scene_planner.reply import (
    ID,
    TIME,
    PlanReply,
    complete_plan,
    find_similar_patterns,
)
from scenewright.nodes.waypoint_filter.reply import ClausesReply
from scenewright.scene.social import MOST_AGENTS, Refusal, SocialGraph
from scenewright.tools.map_grounding.grounding import can_ground
from scripted import ScriptedModel

GOLDEN = Path(__file__).parents[1] / "golden"
NODES = Path(__file__).parents[2] / "src" / "scenewright" / "nodes"
CHAIN = (
    "At rush hour a bus follows a car from the south, the car yields to a pedestrian on the north "
    "crosswalk, and a truck from the west nearly hits another pedestrian, with six other cars."
)
YIELD = "A car from the south turning right yields to a pedestrian. Nobody else is around."


SPANS = (("nearby", "constraint"), ("gingerly", "behavior"), ("far", "constraint"))


class Listening:
    """The builtin backend, which leaves words to every stage and keeps what it is asked."""

    name, deterministic = "listening", False

    def __init__(self) -> None:
        self.words: dict[str, Prompt] = {}
        self.facts: dict[str, Any] = {}
        self._rule = load_backend("builtin")

    def answer(self, question: Question) -> dict[str, Any]:
        self.words[question.task] = question.prompt()
        self.facts[question.task] = question.facts
        reply = self._rule.answer(question)
        if question.task == "plan":
            left = [{"words": w, "became": b, "agents": ["vehicle-1"]} for w, b in SPANS]
            return {**reply, "said": left}
        return reply


@pytest.fixture(scope="module")
def heard() -> Listening:
    backend = Listening()
    text = f"{CHAIN.rstrip('.')}, {', '.join(words for words, _ in SPANS)}."
    scene = synthesize(text, backend=backend, seed=0, refiner="none", lenient=True)
    assert len(scene.record.agents) >= 10
    return backend


@pytest.mark.parametrize("task", TASKS)
def test_a_prompt_is_short(heard: Listening, task: str) -> None:
    """Its schema with it: some providers count that as input too."""
    words = heard.words[task]
    assert (
        count_tokens(words.system + words.user) + count_tokens(format_json(words.schema))
        <= MOST_TOKENS
    )


@pytest.mark.parametrize("name", ["plan", "constraints", "behavior", "edits"])
def test_so_it_is_after_a_refusal_and_with_an_example(name: str) -> None:
    system, user, schema = _kept(name)
    assert (
        count_tokens(system + user) + count_tokens(format_json(json.loads(schema))) <= MOST_TOKENS
    )


def _kept(name: str) -> list[str]:
    text = (GOLDEN / f"prompt_{name}.txt").read_text("utf-8")
    return re.split(r"\n=== (?:user|schema) ===\n", text)


@pytest.mark.parametrize(("text", "least"), [
    # As the encodings cl100k_base and o200k_base count, whichever makes more of it.
    ('{"type":"object","properties":{"low":{"type":"number","minimum":0,"maximum":20}}}', 22),
    ("A pedestrian waits for a car at 17:30 and then crosses on the east crosswalk.", 20),
])  # fmt: skip
def test_tokens_are_rather_counted_too_many(text: str, least: int) -> None:
    assert least <= count_tokens(text) <= 1.3 * least


def test_examples_fill_what_room_there_is() -> None:
    example = Example("A van waits.", {"agents": [], "relations": []})
    given = format_examples([example] * 5, room=count_tokens("Accepted before:") + 40)
    assert given.count("A van waits.") == 2
    assert format_examples([example], room=5) == ""


def test_even_a_planners_prompt_with_all_there_may_be_is_bounded() -> None:
    long = "breaks off its right turn and swings left " * 60
    examples = [Example("a car " * 100, {"agents": [{"id": "x" * 300}] * 3})] * 9
    words = render_plan_prompt(long, long, FOUR_LEGS, rejections=(long,) * 9, examples=examples)
    assert count_tokens(words.system + words.user) <= 2.5 * MOST_TOKENS


def schemas(value: Any) -> list[dict[str, Any]]:
    inner = value.values() if isinstance(value, dict) else value
    nested = [each for part in inner if isinstance(part, dict | list) for each in schemas(part)]
    return [value, *nested] if isinstance(value, dict) else nested


@pytest.mark.parametrize("task", TASKS)
def test_schemas_keep_to_what_constrained_decoders_take(heard: Listening, task: str) -> None:
    for part in schemas(heard.words[task].schema):
        assert not {"oneOf", "allOf", "prefixItems", "not", "if", "title"} & set(part)
        if "$ref" in part:  # nothing may stand beside it, and it leads to what all share
            assert list(part) == ["$ref"]
            assert part["$ref"].removeprefix("#/$defs/") in heard.words[task].schema["$defs"]
        if part.get("type") == "object":
            assert part["additionalProperties"] is False
            assert set(part.get("required", ())) <= set(part["properties"])
        if part.get("type") == "array":
            assert part["maxItems"] <= 40
        if "enum" in part:
            assert part["enum"]
            assert len(set(part["enum"])) == len(part["enum"])
        if part.get("type") == "string":
            assert "enum" in part or "pattern" in part
            repeated = re.findall(r"\{\d+,(\d+)\}", part.get("pattern", ""))
            assert all(int(most) <= 128 for most in repeated), "xgrammar cannot compile it"
            assert "\\" not in part.get("pattern", ""), "llama.cpp cannot compile it"


@pytest.mark.parametrize("name", ["plan", "constraints", "behavior", "edits"])
def test_anthropics_client_takes_the_schemas(name: str) -> None:
    """It turns bounds and patterns into words, and nothing else may be left that it refuses."""
    anthropic = pytest.importorskip("anthropic")
    *_, schema = _kept(name)
    sent = anthropic.transform_schema(json.loads(schema))
    known = {"type", "enum", "anyOf", "properties", "required", "additionalProperties", "items"}
    for part in schemas(sent):
        if "type" in part and isinstance(part["type"], str):
            assert set(part) <= known | {"description", "minItems", "$defs"}
            assert part.get("minItems", 0) <= 1
    assert sent.get("$defs", {}).keys() == json.loads(schema).get("$defs", {}).keys()


def fits(schema: dict[str, Any], value: Any) -> bool:
    if "anyOf" in schema:
        return any(fits(each, value) for each in schema["anyOf"])
    if "enum" in schema:
        return value in schema["enum"]
    match schema["type"]:
        case "object":
            known = schema["properties"]
            needed = set(schema.get("required", ()))
            whole = isinstance(value, dict) and needed <= set(value) <= set(known)
            return whole and all(fits(known[key], each) for key, each in value.items())
        case "array":
            most = isinstance(value, list) and schema.get("minItems", 0) <= len(value)
            return most and all(fits(schema["items"], each) for each in value)
        case "boolean":
            return isinstance(value, bool)
        case "string":
            return isinstance(value, str) and re.search(schema["pattern"], value) is not None
    return isinstance(value, int | float) and schema["minimum"] <= value <= schema["maximum"]


def test_a_plan_may_have_as_many_agents_as_a_scene() -> None:
    every = [f"vehicle-{n}" for n in range(1, 100)]
    assert [each for each in every if re.match(ID, each)] == every[:MOST_AGENTS]
    text = (NODES / "scene_planner" / "prompt.md").read_text("utf-8")
    assert f"at most {MOST_AGENTS}, not the traffic" in text


@pytest.mark.parametrize(
    ("agents", "relations"),
    [
        (2, [{"type": "collide_at", "from": "pedestrian-1", "to": "pedestrian-2"}]),
        (2, [{"type": "near_miss", "from": "pedestrian-1", "to": "pedestrian-2"}]),
        (3, [{"type": "collide_at", "from": "vehicle-1", "to": "vehicle-2", "kind": "rear_end"},
             {"type": "collide_at", "from": "vehicle-2", "to": "vehicle-3", "kind": "rear_end",
              "manoeuvre": "pushed"}]),
    ],
)  # fmt: skip
def test_the_map_serves_what_the_prompt_says_can_be(
    agents: int, relations: list[dict[str, str]]
) -> None:
    kind = relations[0]["from"].partition("-")[0]
    ids = [{"id": f"{kind}-{n}"} for n in range(1, agents + 1)]
    plan = PlanReply.model_validate({"agents": ids, "relations": relations}).root
    assert isinstance(plan, SocialGraph)
    assert can_ground(plan, intersection_map=load_map("amsterdam_120"))


def test_what_a_plan_is_not_asked_for_cannot_be_filled_in() -> None:
    plain, given = (
        inline_references(render_plan_prompt(text, None, FOUR_LEGS).schema)["properties"][
            "relations"
        ]["items"]
        for text in ("A car hits a bus", "A car hits a bus at 5 m/s in its left flank")
    )
    more = {"target_pet", "target_ttc", "impact_speed", "point_from", "point_to"}
    assert given["properties"].keys() - plain["properties"].keys() == more


def test_the_class_of_an_agent_is_that_of_its_id() -> None:
    plan = PlanReply.model_validate({"agents": [{"id": "pedestrian-1"}], "relations": []}).root
    assert isinstance(plan, SocialGraph)
    assert plan.agents[0].type == "pedestrian"
    with pytest.raises(ValidationError, match="type"):
        PlanReply.model_validate({"agents": [{"id": "dog-1"}], "relations": []})


def test_clauses_about_two_are_about_the_two_of_a_relation() -> None:
    *_, text = _kept("constraints")
    forms = json.loads(text)["properties"]["clauses"]["items"]["anyOf"]
    ends = {
        form["properties"]["clause"]["enum"][0]: form["properties"]["first"]["enum"]
        for form in forms
        if "first" in form["properties"]
    }
    assert ends == {key: ["vehicle-1", "pedestrian-1"] for key in ("before", "time_gap", "near")}


def test_the_plans_that_the_prompt_shows_are_answers() -> None:
    schema = inline_references(render_plan_prompt("x", None, FOUR_LEGS).schema)
    text = (NODES / "scene_planner" / "prompt.md").read_text("utf-8")
    shown = [
        json.loads(found)
        for found in re.findall(
            r'\{"agents":\[\],"relations":\[\],"ref.*?\}|^\{"agents".*', text, re.M
        )
    ]
    assert len(shown) == 2
    assert all(fits(schema, each) for each in shown)
    no, *plans = [PlanReply.model_validate(each).root for each in shown]
    assert no == Refusal(code="out_of_scope", reason="A poem.")
    left = complete_plan(plans[0], FOUR_LEGS)
    assert isinstance(left, SocialGraph)
    assert left.agents[0].exit == "west"


@pytest.mark.parametrize(
    ("answer", "words"),
    [
        ({"refused": "impossible", "agents": [], "relations": []}, "needs its 'reason'"),
        ({"refused": "impossible", "reason": "no", "agents": [{}]}, "not both"),
        ({"refused": "perhaps", "reason": "no"}, "'out_of_scope'"),
        ({"code": "impossible", "reason": "no"}, None),
        ({"refused": {"code": "impossible", "reason": "no"}, "agents": []}, None),
        ({"refused": None, "reason": "as told", "agents": [], "relations": []}, None),
        ({"reason": "as told", "agents": [], "relations": []}, None),
    ],
)
def test_a_plan_or_a_refusal_in_any_of_their_forms(
    answer: dict[str, Any], words: str | None
) -> None:
    if words is None:
        assert PlanReply.model_validate(answer)
        return
    with pytest.raises(ValidationError, match=words):
        PlanReply.model_validate(answer)


@pytest.mark.parametrize(
    ("stage", "name", "start", "reply"),
    [
        ("waypoint_filter", "prompt.md", '{"clauses":[{', ClausesReply),
        ("event_reasoner", "prompt.md", '{"stops":[{', StopsReply),
    ],
)
def test_the_answers_that_the_other_prompts_show_are_read(
    stage: str, name: str, start: str, reply: Any
) -> None:
    lines = (NODES / stage / name).read_text("utf-8").splitlines()
    [shown] = [line for line in lines if line.startswith(start)]
    assert reply.model_validate(json.loads(shown))


def drawn(schema: dict[str, Any], rng: np.random.Generator) -> Any:
    if "anyOf" in schema:
        return drawn(schema["anyOf"][int(rng.integers(len(schema["anyOf"])))], rng)
    if "enum" in schema:
        return schema["enum"][int(rng.integers(len(schema["enum"])))]
    match schema["type"]:
        case "object":
            needed = schema.get("required", ())
            keys = {
                k: s for k, s in schema["properties"].items() if k in needed or rng.random() < 0.5
            }
            return {key: drawn(each, rng) for key, each in keys.items()}
        case "array":
            least = schema.get("minItems", 0)
            size = int(rng.integers(least, least + 4))
            return [drawn(schema["items"], rng) for _ in range(size)]
        case "boolean":
            return bool(rng.random() < 0.5)
        case "string":
            spoken = {TIME: "08:30", ID: f"vehicle-{rng.integers(1, 4)}"}
            return spoken.get(schema["pattern"], "so it is")
    return float(rng.integers(math.ceil(schema["minimum"]), int(schema["maximum"]) + 1))


@pytest.mark.parametrize("task", TASKS)
def test_whatever_fits_the_schema_is_read_or_refused_with_a_reason(
    heard: Listening, task: str
) -> None:
    """By the whole stage: nothing but a rejection may come of it."""
    rng = np.random.default_rng(5)
    rule = load_backend("builtin")
    for _ in range(12):
        reply = drawn(inline_references(heard.words[task].schema), rng)
        text_model = ScriptedModel({task: [reply]}, forever=True)
        speakers = {each: TextBackend(text_model) if each == task else rule for each in TASKS}
        answer = speakers[task].answer(_asked(task, heard))
        given = _fault_of(task, answer)
        assert given is None or given
        assert StagedBackend(speakers).deterministic is False


def _fault_of(task: str, answer: dict[str, Any]) -> str | None:
    """Why an answer is refused; anything else that is raised is a bug."""
    try:
        _read(task, answer)
    except Rejected as error:
        return error.rejection.detail
    except ValidationError as error:
        return error.errors()[0]["msg"]
    return None


def _asked(task: str, heard: Listening) -> Question:
    return Question(task, {}, prompt=lambda: heard.words[task])  # type: ignore[arg-type]


def _read(task: str, answer: dict[str, Any]) -> None:
    match task:
        case "plan":
            plan = PlanReply.model_validate(answer).root
            if isinstance(plan, SocialGraph):
                complete_plan(plan, FOUR_LEGS)
        case "constraints":
            ClausesReply.model_validate(answer).read([3, 5], [], [])
        case _:
            StopsReply.model_validate(answer).read([4], [])


@pytest.mark.parametrize(
    ("text", "agent", "exit_"),
    [
        ({"entry": "south", "movement": "left"}, "movement", "west"),
        ({"entry": "north", "exit": "south"}, "straight", "south"),
        ({"exit": "east", "movement": "right"}, "south", "east"),
        ({"entry": "west"}, None, None),
    ],
)
def test_what_entry_exit_and_turn_entail_is_filled_in(
    text: dict[str, str], agent: str | None, exit_: str | None
) -> None:
    graph = SocialGraph.model_validate({"agents": [{"id": "vehicle-1", "type": "vehicle", **text}]})
    for ways in (FOUR_LEGS, describe_routes(load_map("amsterdam_120"))):
        [found] = complete_plan(graph, ways).agents
        assert found.exit == exit_
        assert agent in (found.entry, found.movement, "movement", None)


def test_ties_and_lanes_fix_entries() -> None:
    two = [{"id": f"vehicle-{n}", "type": "vehicle"} for n in (1, 2)]
    two[0]["entry"] = "north"
    tie = {"agent": "vehicle-2", "of": "vehicle-1", "side": "opposite"}
    graph = SocialGraph.model_validate({"agents": two, "ties": [tie]})
    assert complete_plan(graph, FOUR_LEGS).agents[1].entry == "south"
    lateral = SocialGraph.model_validate({"agents": two, "ties": [{**tie, "side": "lateral"}]})
    assert complete_plan(lateral, FOUR_LEGS).agents[1].entry is None
    follow = {"type": "follow", "from": "vehicle-2", "to": "vehicle-1"}
    lane = SocialGraph.model_validate({"agents": two, "relations": [follow]})
    assert complete_plan(lane, FOUR_LEGS).agents[1].entry == "north"


def test_the_planner_is_shown_the_phrases_of_a_users_relation_files(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    own = Path(__file__).parents[2] / "docs" / "relations.md"
    example = re.search(r"```toml\n(id = \"noses_out\".*?)```", own.read_text("utf-8"), re.DOTALL)
    assert example is not None
    (tmp_path / "noses_out.toml").write_text(example[1])
    monkeypatch.setenv("SCENEWRIGHT_RELATIONS", str(tmp_path))
    words = render_plan_prompt("A car is nosing out in front of a bus", None, FOUR_LEGS)
    assert "noses_out (near_miss): FROM noses out in front of TO" in words.user
    relation = words.schema["properties"]["relations"]["items"]["properties"]
    assert "noses_out" in relation["pattern"]["enum"]
    assert [each.id for each in find_similar_patterns("A car hits a bus")] == []


def test_in_left_hand_traffic_no_pattern_is_reported_that_names_the_other_turn() -> None:
    text = "A car breaks off its left turn for a pedestrian"
    assert any(each.names_a_turn for each in find_similar_patterns(text))
    assert not any(each.names_a_turn for each in find_similar_patterns(text, left_hand=True))
    assert "left_turn_yields" not in render_plan_prompt(text, None, FOUR_LEGS, left_hand=True).user


def test_what_is_recalled_stands_in_the_prompt() -> None:
    example = Example("A van waits for a woman.", {"agents": [], "relations": []})
    words = render_plan_prompt("x", None, FOUR_LEGS, examples=(example,))
    given = 'Accepted before:\nRequest: "A van waits for a woman."\n{"agents":[],"relations":[]}\n'
    assert given in words.user
    assert "Accepted before" not in render_plan_prompt("x", None, FOUR_LEGS).user


@pytest.mark.parametrize(
    ("request_", "names"),
    [
        ("A car nearly hits a bus while yielding", []),
        ("busy morning rush", ["morning rush"]),
        ("Late at night", ["late night"]),
        ("in the evening peak", ["evening rush"]),
        ("at sunset", ["dusk"]),
        ("around midnight", ["midnight"]),
    ],
)
def test_times_of_day_are_reported_where_a_request_speaks_of_them(
    request_: str, names: list[str]
) -> None:
    said = describe_times(request_).removeprefix("Times: ").removesuffix(".\n").split(", ")
    assert [each.rpartition(" ")[0] for each in said if each] == names


def test_a_model_is_shown_what_stands_only_where_words_may_speak_of_it() -> None:
    asked = render_plan_prompt(
        "A car hits a girl who comes from behind a parked bus", None, FOUR_LEGS
    )
    plain = render_plan_prompt("A car hits a girl", None, FOUR_LEGS)
    assert "objects" in asked.schema["properties"]
    assert "objects" not in plain.schema["properties"]
    assert count_tokens(describe_objects("behind a parked bus")) <= 60
    assert describe_objects("behind a parked bus") in asked.user


def test_a_models_plan_may_hold_what_stands() -> None:
    node = {"id": "object-1", "kind": "parked", "subtype": "bus", "hides": "pedestrian-1",
            "hidden_from": "vehicle-1", "lead": [0.65, 0.95]}  # fmt: skip
    agents = [{"id": "vehicle-1"}, {"id": "pedestrian-1"}]
    edge = {"type": "collide_at", "from": "vehicle-1", "to": "pedestrian-1"}
    value = {"agents": agents, "relations": [edge], "objects": [node]}
    plan = PlanReply.model_validate(value).root
    assert isinstance(plan, SocialGraph)
    assert plan.objects[0].lead == (0.65, 0.95)
    with pytest.raises(ValidationError):
        PlanReply.model_validate({**value, "relations": []})
