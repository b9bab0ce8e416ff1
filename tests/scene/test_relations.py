"""Every relation file: it loads, its clauses are meant for its roles, and adding one adds one."""

from __future__ import annotations

from importlib import resources

import pytest

from scenewright.errors import InputError
from scenewright.scene.constraints import (
    Contact,
    GivesWay,
    Headway,
    OnRoad,
    OnWalkable,
    PassesBeside,
    StopsBehind,
    TimeGap,
    UnaryClause,
)
from scenewright.scene.events import EVENT_OF_RELATION
from scenewright.scene.relations import get_pattern, load_patterns
from scenewright.tools.dsl_validator.parse import parse

SERVED_BY = {
    "collide_at": Contact,
    "near_miss": TimeGap | PassesBeside,
    "yield_to": GivesWay,
    "follow": Headway,
}


def names(pattern) -> dict[str, str]:
    classes = {"rider": "cyclist"}
    first, second = (classes.get(role.type, role.type) for role in (pattern.from_, pattern.to))
    return {"from": f"{first}-1", "to": f"{second}-2"}


def clauses(pattern):
    first, second = names(pattern).values()
    lines = [pattern.fill(line, from_=first, to=second) for line in pattern.clauses]
    return parse("\n".join(lines)).clauses


def test_every_file_is_a_pattern_named_like_its_file():
    folder = resources.files("scenewright.scene.relations")
    files = sorted(entry.name for entry in folder.iterdir() if entry.name.endswith(".toml"))
    assert [f"{pattern.id}.toml" for pattern in load_patterns()] == files
    assert all(get_pattern(pattern.id) is pattern for pattern in load_patterns())
    with pytest.raises(KeyError):
        get_pattern("no_such_pattern")


@pytest.mark.parametrize("pattern", load_patterns(), ids=lambda pattern: pattern.id)
def test_the_clauses_serve_the_relation_and_fit_the_roles(pattern):
    found = clauses(pattern)
    every = (*SERVED_BY.values(), StopsBehind)
    [event] = [c for c in found if any(isinstance(c, each) for each in every)]
    assert isinstance(event, SERVED_BY[pattern.relation] | StopsBehind)
    assert (event.first, event.second) == tuple(names(pattern).values())
    if isinstance(event, Contact):
        assert event.kind in (None, pattern.kind)
    for clause in found:
        if isinstance(clause, OnRoad | OnWalkable):
            role = pattern.from_ if clause.agent.endswith("-1") else pattern.to
            walks = set(role.movements) <= {"crossing", "jaywalking"}
            assert walks == isinstance(clause, OnWalkable)
        if isinstance(clause, UnaryClause):
            assert clause.agent in names(pattern).values()


@pytest.mark.parametrize("pattern", load_patterns(), ids=lambda pattern: pattern.id)
def test_roles_movements_and_segments_go_together(pattern):
    for role in (pattern.from_, pattern.to):
        on_foot = set(role.movements) <= {"crossing", "jaywalking"}
        assert on_foot == (role.type == "pedestrian") or role.type == "rider"
        assert role.segments[0] == "keep"
    ends = {"terminate" in role.segments for role in (pattern.from_, pattern.to)}
    assert ends == {pattern.relation == "collide_at"}
    stops = [isinstance(each, GivesWay | StopsBehind) for each in clauses(pattern)]
    assert ("stop" in pattern.from_.segments) == (any(stops) or pattern.manoeuvre == "pushed")
    assert pattern.weight > 0


@pytest.mark.parametrize("pattern", load_patterns(), ids=lambda pattern: pattern.id)
def test_what_the_solver_aims_at_is_what_the_proof_demands(pattern):
    """A figure that a file bounds is brought about by the clause with the same bounds."""
    aims = {
        TimeGap: "pet", Headway: "least_headway", StopsBehind: "path_ttc",
        PassesBeside: "clearance",
    }  # fmt: skip
    for clause in clauses(pattern):
        figure = aims.get(type(clause))
        if figure in pattern.compute_bounds():
            assert pattern.compute_bounds()[figure] == (clause.low, clause.high)
    usual = {"pet"} if pattern.relation == "near_miss" else set()
    assert set(pattern.compute_bounds()) == _BOUNDED.get(pattern.id, usual)
    assert pattern.proof.event == EVENT_OF_RELATION[pattern.relation]
    usual = "to" if pattern.relation == "yield_to" else None
    assert pattern.order == ("from" if pattern.manoeuvre == "cuts_in" else usual)


_BOUNDED = {
    "rider_close_overtaking": {"clearance"},
    "near_miss_lead_brakes": {"path_ttc"},
    "tailgating": {"least_headway"},
    "pedestrians_near_miss_at_corner": {"pet", "clearance"},
    "pedestrians_near_miss_on_crosswalk": {"pet", "clearance"},
}
"""Figures that files bound which are not the usual ones of their relation."""


def test_an_order_is_one_more_clause_of_a_near_miss():
    pattern = get_pattern("straight_crossing_near_miss")
    for order, line in (("from", "before({from}, {to})"), ("to", "before({to}, {from})")):
        assert pattern.model_copy(update={"order": order}).clauses[-1] == line
    assert pattern.clauses == pattern.constraints


def test_every_relation_and_every_kind_of_collision_has_a_pattern():
    assert {pattern.relation for pattern in load_patterns()} == set(SERVED_BY)
    kinds = {"pedestrian_strike", "rear_end", "sideswipe", "head_on", "left_turn", "angle"}
    assert kinds <= {pattern.kind for pattern in load_patterns()}


def test_a_missing_folder_is_told(tmp_path, monkeypatch):
    monkeypatch.setenv("SCENEWRIGHT_RELATIONS", str(tmp_path / "nowhere"))
    with pytest.raises(InputError, match="nowhere"):
        load_patterns()
