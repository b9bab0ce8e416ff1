"""Files of a user's own: what is wrong with one is told in one line, with file and field."""

from __future__ import annotations

import os
import re
from pathlib import Path

import pytest

from scenewright.backends.builtin.planner import plan
from scenewright.errors import InputError
from scenewright.scene.relations import Pattern, get_pattern, load_patterns
from scenewright.scene.social import SocialGraph
from scenewright.tools.map_grounding.relation_files import load_checked_patterns

PAGE = Path(__file__).parents[2] / "docs" / "relations.md"
EXAMPLE = PAGE.read_text("utf-8").split("```toml\n")[1].split("```")[0]


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("SCENEWRIGHT_RELATIONS", str(tmp_path))
    return tmp_path


def refusal(folder: Path, text: str | bytes, name: str = "mine.toml") -> str:
    data = text.encode("utf-8") if isinstance(text, str) else text
    (folder / name).write_bytes(data)
    with pytest.raises(InputError) as caught:
        load_checked_patterns()
    (line,) = str(caught.value).splitlines()
    return line


def edited(old: str, new: str) -> str:
    assert old in EXAMPLE
    return EXAMPLE.replace(old, new, 1)


PEDESTRIAN = 'type = "pedestrian"\nmovements = ["crossing"]'
VEHICLE = 'type = "vehicle"\nmovements = ["straight"]'


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ('id = "noses_out"', "", "id: is missing"),
        ('id = "noses_out"', 'id = "Noses out"', "id: String should match"),
        ("[thresholds]", 'colour = "red"\n[thresholds]', "colour: no such field; there are "),
        ("[proof]", '[proof]\nplace = "x"', "proof.place: no such field; there are cause, event"),
        ('event = "near_miss"', 'event = "miss"', "proof.event: Input should be 'collision'"),
        (
            'event = "near_miss"',
            'event = "collision"',
            "proof: within: a collision is measured by relative_speed, not 'pet'",
        ),
        ('event = "near_miss"', 'event = "yielding"', "proof.event: near_miss is proven by"),
        ("[proof]", '[proof]\nkind = "angle"', "proof: kind: only a collision has one"),
        ("[proof]", '[proof]\ncause = "fog"', "proof.cause: Input should be 'red_light_run'"),
        ('{ pet = "gap" }', '{ speed = "gap" }', "proof: within: a near_miss is measured by"),
        ('{ pet = "gap" }', '{ pet = "way" }', "proof.within.pet: expected a threshold [low,"),
        ('relation = "near_miss"', 'relation = "kiss"', "relation: Input should be 'collide_at'"),
        ('zone = "conflict"', 'zone = "sky"', "zone: Input should be 'crosswalk'"),
        ('zone = "conflict"', 'zone = "crosswalk"', "zone: 'crosswalk' needs a role with"),
        ('zone = "conflict"', 'zone = "lane"', "zone: 'lane' needs a geometry of cutting_in"),
        ('violator = "from"', "weight = 0", "weight: Input should be greater than 0, got 0"),
        ('violator = "from"', "weight = -1", "weight: Input should be greater than 0, got -1"),
        ('violator = "from"', "weight = nan", "weight: Input should be"),
        ('violator = "from"', "weight = 1e300", "weight: Input should be less than"),
        (
            VEHICLE,
            'type = "pedestrian"\nmovements = ["right"]',
            "from: movements: a pedestrian has crossing, jaywalking, not 'right'",
        ),
        ('movements = ["straight"]', "movements = []", "from.movements: Tuple should have at l"),
        ('movements = ["straight"]', 'movements = ["fly"]', "from.movements.0: Input should be"),
        ('segments = ["keep"]', "segments = []", "from.segments: Tuple should have at least"),
        ('segments = ["keep"]', 'segments = ["keep", "keep"]', "from: segments: names one twice"),
        ("{way} m", "{foo} m", "constraints.1: {foo} is neither a role nor a threshold"),
        ("{way} m", "{way m", "constraints.1: a brace without its partner"),
        ("{way} m", "{from.__class__} m", "constraints.1: {from.__class__} is neither"),
        ("gap = [0.7, 1.1]", "gap = [1.1, 0.7]", "thresholds.gap: [low, high] with low above"),
        ("gap = [0.7, 1.1]", "gap = [0.7, 1.1]\nx = 1", "thresholds.x: neither a clause nor"),
        ("way = 30", 'way = "far"', "thresholds.way"),
        ("way = 30", "way = -3", "thresholds.way"),
        ("way = 30", "way = 900", "constraints.1: line 1, column 1: min_length: metres must be "),
        (
            '"on_road({from})",',
            '"on_road({from}) please",',
            "constraints.0: line 1, column 17: expected a new line or ';', found 'please'",
        ),
        (
            '"on_road({from})",',
            '"on_walkable({from})",',
            "constraints.0: line 1, column 13: expected a pedestrian such as pedestrian-1 "
            "or a rider such as cyclist-1, "
            "found '{from}'",
        ),
        (
            "time_gap({from}, {to}) in {gap} s",
            "near({from}, {to}) <= 3 m",
            "constraints: a near_miss needs a clause time_gap or brakes_for or stops_behind or "
            "passes_beside(...)",
        ),
        ('"{from} noses out in front of {to}"', '""', "phrases.0: String should have at least"),
        ('"{from} noses out in front of {to}"', '"{from} {to}"', "phrases: expected plain words"),
        ('"{from} noses out in front of {to}"', '"{from} hits {from}"', "phrases: expected plain"),
        (
            '"{from} noses out in front of {to}"',
            '"{from} runs up the back of {to}"',
            "phrases: 'runs up the back of' asks for rear_end_collision already",
        ),
    ],
)
def test_a_faulty_file_is_told_with_its_field(folder: Path, old: str, new: str, told: str) -> None:
    assert refusal(folder, edited(old, new)).startswith(f"mine.toml is not a relation: {told}")


def test_ways_that_only_vehicles_have_are_told(folder: Path) -> None:
    text = EXAMPLE.replace(VEHICLE, PEDESTRIAN, 1)
    text = text.replace('geometry = "crossing"', 'geometry = "merging"')
    assert "geometry: with a pedestrian it must be 'crossing'" in refusal(folder, text)


def test_a_pedestrian_who_follows_a_vehicle_is_told(folder: Path) -> None:
    text = EXAMPLE.replace(VEHICLE, PEDESTRIAN, 1).replace('"near_miss"', '"follow"')
    text = text.replace('within = { pet = "gap" }', "")
    assert "relation: a pedestrian neither follows" in refusal(folder, text)


def test_two_pedestrians_have_no_right_of_way(folder: Path) -> None:
    text = EXAMPLE.replace(VEHICLE, PEDESTRIAN)
    text = text.replace('relation = "near_miss"', 'relation = "yield_to"')
    assert "relation: two pedestrians have no right of way" in refusal(folder, text)


@pytest.mark.parametrize(
    ("data", "told"),
    [
        (b"id = ", "Invalid value"),
        (b"\xff\xfe", "codec can't decode"),
        (b"x = " + b"[" * 30_000, "nested too deeply"),
        (b"#" * 32_001, "larger than 32000 bytes"),
        (b"", "id: is missing"),
    ],
)
def test_what_is_no_toml_is_told(folder: Path, data: bytes, told: str) -> None:
    assert told in refusal(folder, data)


def test_long_values_are_cut_short(folder: Path) -> None:
    line = refusal(folder, edited('theme = "', 'theme = "' + "x" * 20_000))
    assert line.startswith("mine.toml is not a relation: theme: ")
    assert len(line) < 300


def test_one_id_in_two_files_is_told(folder: Path) -> None:
    (folder / "a.toml").write_text(EXAMPLE, "utf-8")
    line = refusal(folder, EXAMPLE, "b.toml")
    assert line == "b.toml is not a relation: id: a.toml has the id 'noses_out' as well"


def test_what_is_no_file_is_told(folder: Path) -> None:
    os.mkfifo(folder / "pipe.toml")
    with pytest.raises(InputError, match=r"pipe\.toml is not a relation: not a file"):
        load_patterns()


def test_a_missing_folder_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SCENEWRIGHT_RELATIONS", str(tmp_path / "nowhere"))
    with pytest.raises(InputError, match="nowhere"):
        load_patterns()


def test_other_files_of_the_folder_are_left_alone(folder: Path) -> None:
    (folder / "README.md").write_text("not a relation", "utf-8")
    (folder / "mine.toml").write_text(EXAMPLE, "utf-8")
    assert get_pattern("noses_out").compute_bounds() == {"pet": (0.7, 1.1)}


def test_a_file_with_a_shipped_id_replaces_it(folder: Path) -> None:
    (folder / "mine.toml").write_text(edited("noses_out", "straight_crossing_near_miss"), "utf-8")
    assert get_pattern("straight_crossing_near_miss").order == "from"
    assert len({pattern.id for pattern in load_patterns()}) == len(load_patterns())


def test_text_is_data(folder: Path) -> None:
    text = edited('theme = "vehicle', 'theme = "{from} {0.__class__} $(id) vehicle')
    (folder / "mine.toml").write_text(text, "utf-8")
    assert get_pattern("noses_out").theme.startswith("{from} {0.__class__} $(id)")


def planned(text: str) -> SocialGraph:
    found = plan(text)
    assert isinstance(found, SocialGraph), found
    return found


def told_of(pattern: Pattern, phrase: str) -> str:
    types = {"{from}": pattern.from_.type, "{to}": pattern.to.type}
    vehicles = {"{from}": "a car", "{to}": "a bus"}
    others = {"pedestrian": "a pedestrian", "rider": "a cyclist"}
    for role, type_ in types.items():
        phrase = phrase.replace(role, others.get(type_, vehicles[role]))
    return f"{phrase[0].upper()}{phrase[1:]}."


SHIPPED = [(pattern.id, phrase) for pattern in load_patterns() for phrase in pattern.phrases]


def test_no_phrase_gives_a_rider_a_vehicle_that_an_e_scooter_is_not() -> None:
    assert [p for _, p in SHIPPED if re.search(r"pedal|bicycle|bike", p)] == []


@pytest.mark.parametrize(("name", "phrase"), SHIPPED, ids=[phrase for _, phrase in SHIPPED])
def test_every_phrase_asks_for_its_pattern_and_roles(name: str, phrase: str) -> None:
    pattern = get_pattern(name)
    text = told_of(pattern, phrase)
    # Riders' phrases are read by the grammar alone, as `plan` would do, in a tenth of the time.
    graph = planned(text)
    assert isinstance(graph, SocialGraph)
    (edge,) = graph.relations
    assert (edge.type, edge.pattern) == (pattern.relation, name)
    for agent_id, role, subtype in (
        (edge.from_, pattern.from_, "car"), (edge.to, pattern.to, "bus"),
    ):  # fmt: skip
        agent = graph.agent(agent_id)
        assert role.admits(agent.type)
        assert agent.subtype == (subtype if role.type == "vehicle" else None)
        assert agent.movement == (role.movements[0] if len(role.movements) == 1 else None)
    assert len(graph.agents) == 2


@pytest.mark.parametrize(
    "text",
    [
        "A car swings round into the way of a bus and nearly hits it.",
        "A car nearly swings round into the way of a bus.",
        "A cyclist is right-hooked by a car and nearly hit.",
    ],
)
def test_a_phrase_of_a_collision_that_nearly_happens_is_a_near_miss(text: str) -> None:
    (edge,) = planned(text).relations
    assert edge.type == "near_miss"


@pytest.mark.parametrize(
    ("text", "pair"),
    [
        ("A car is nosing out in front of a bus.", ("car", "bus")),
        ("A northbound truck nosed out in front of a taxi at noon.", ("truck", "taxi")),
        ("A bus has the door closed on it by a car.", ("car", "bus")),
        ("There is a bus from the north. A car noses out in front of it.", ("car", "bus")),
    ],
)
def test_a_phrase_is_understood_like_any_verb(
    folder: Path, text: str, pair: tuple[str, str]
) -> None:
    (folder / "mine.toml").write_text(EXAMPLE, "utf-8")
    graph = planned(text)
    (edge,) = graph.relations
    assert (edge.type, edge.pattern) == ("near_miss", "noses_out")
    assert (graph.agent(edge.from_).subtype, graph.agent(edge.to).subtype) == pair


def test_a_phrase_denied_asks_for_nothing(folder: Path) -> None:
    (folder / "mine.toml").write_text(EXAMPLE, "utf-8")
    assert planned("A car from the north does not nose out in front of a bus.").relations == ()


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("A pedestrian noses out in front of a bus.", "is said of two vehicles"),
        ("A left-turning car noses out in front of a bus.", "is for straight, not left"),
    ],
)
def test_a_phrase_said_of_others_is_refused(folder: Path, text: str, reason: str) -> None:
    (folder / "mine.toml").write_text(EXAMPLE, "utf-8")
    assert reason in plan(text).reason  # type: ignore[union-attr]


def test_without_the_file_the_phrase_asks_for_no_pattern() -> None:
    found = plan("A car noses out in front of a bus.")
    edges = found.relations if isinstance(found, SocialGraph) else ()
    assert all(edge.pattern is None for edge in edges)
