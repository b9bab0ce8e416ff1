"""Every relation file: it loads, its clauses are meant for its roles, and adding one adds one."""

from __future__ import annotations

from importlib import resources
from pathlib import Path

import pytest

from scenewright.errors import InputError
from scenewright.scene.constraints import (
    Contact,
    GivesWay,
    Headway,
    OnRoad,
    OnWalkable,
    TimeGap,
    UnaryClause,
)
from scenewright.scene.relations import pattern_named, patterns
from scenewright.tools.dsl_validator.parse import parse

SERVED_BY = {
    "collide_at": Contact,
    "near_miss": TimeGap,
    "yield_to": GivesWay,
    "follow": Headway,
}


def names(pattern) -> dict[str, str]:
    return {"from": f"{pattern.from_.type}-1", "to": f"{pattern.to.type}-2"}


def clauses(pattern):
    return parse("\n".join(line.format(**names(pattern)) for line in pattern.constraints)).clauses


def test_every_file_is_a_pattern_named_like_its_file():
    folder = resources.files("scenewright.scene.relations")
    files = sorted(entry.name for entry in folder.iterdir() if entry.name.endswith(".toml"))
    assert [f"{pattern.id}.toml" for pattern in patterns()] == files
    assert all(pattern_named(pattern.id) is pattern for pattern in patterns())
    with pytest.raises(KeyError):
        pattern_named("no_such_pattern")


@pytest.mark.parametrize("pattern", patterns(), ids=lambda pattern: pattern.id)
def test_the_clauses_serve_the_relation_and_fit_the_roles(pattern):
    found = clauses(pattern)
    [event] = [c for c in found if isinstance(c, tuple(SERVED_BY.values()))]
    assert isinstance(event, SERVED_BY[pattern.relation])
    assert (event.first, event.second) == tuple(names(pattern).values())
    if isinstance(event, Contact):
        assert event.kind in (None, pattern.kind)
    for clause in found:
        if isinstance(clause, OnRoad | OnWalkable):
            jaywalks = {"vehicle-1": pattern.from_, "vehicle-2": pattern.to}.get(clause.agent)
            assert (jaywalks is not None) == isinstance(clause, OnRoad)
        if isinstance(clause, UnaryClause):
            assert clause.agent in names(pattern).values()


@pytest.mark.parametrize("pattern", patterns(), ids=lambda pattern: pattern.id)
def test_roles_movements_and_segments_go_together(pattern):
    for role in (pattern.from_, pattern.to):
        on_foot = set(role.movements) <= {"crossing", "jaywalking"}
        assert on_foot == (role.type == "pedestrian")
        assert role.segments[0] == "keep"
    ends = {"terminate" in role.segments for role in (pattern.from_, pattern.to)}
    assert ends == {pattern.relation == "collide_at"}
    assert ("stop" in pattern.from_.segments) == (pattern.relation == "yield_to")
    assert pattern.weight > 0


def test_every_relation_and_every_kind_of_collision_has_a_pattern():
    assert {pattern.relation for pattern in patterns()} == set(SERVED_BY)
    kinds = {"pedestrian_strike", "rear_end", "sideswipe", "head_on", "left_turn", "angle"}
    assert kinds <= {pattern.kind for pattern in patterns()}


def test_a_broken_file_is_told(tmp_path, monkeypatch):
    (tmp_path / "mine.toml").write_text('id = "mine"', "utf-8")
    monkeypatch.setenv("SCENEWRIGHT_RELATIONS", str(tmp_path))
    with pytest.raises(InputError, match=r"mine\.toml is not a relation: theme"):
        patterns()


def test_a_missing_folder_is_told(tmp_path, monkeypatch):
    monkeypatch.setenv("SCENEWRIGHT_RELATIONS", str(tmp_path / "nowhere"))
    with pytest.raises(InputError, match="nowhere"):
        patterns()


def test_the_documented_example_is_a_pattern(tmp_path, monkeypatch):
    page = Path(__file__).parents[2] / "docs" / "relations.md"
    example = page.read_text("utf-8").split("```toml\n")[1].split("```")[0]
    (tmp_path / "mine.toml").write_text(example, "utf-8")
    monkeypatch.setenv("SCENEWRIGHT_RELATIONS", str(tmp_path))
    assert pattern_named("right_turns_in_a_row").geometry == "same_way"
