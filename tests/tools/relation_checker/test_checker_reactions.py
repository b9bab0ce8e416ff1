"""Who reacts, when, how strongly, or why not: on straight tracks with reactions known by hand."""

import pytest

from checker_tracks import EAST, NORTH, distance, line, scene
from scenewright.tools.relation_checker import check


def rows(*users, relation, **changes):
    made = scene(list(users), (relation, 1, 2))
    agents = tuple(
        each.model_copy(update={"reaction": changes.get(f"agent_{each.id}")})
        for each in made.agents
    )
    meta = made.meta.model_copy(update={"rules": 2})
    return check(made.model_copy(update={"agents": agents, "meta": meta}))


def test_who_brakes_too_late_has_reacted_and_the_other_has_not() -> None:
    # Both are 40 m off at 10 m/s, so that the fronts meet at about 4 s; one brakes from 3 s on.
    braking = line(1, (-40.0, 0.0), EAST, distance(10.0, (0.0, 2.6), (-4.0, 2.0)))
    other = line(2, (0.0, -41.0), NORTH, distance(10.0, (0.0, 5.0)))

    first, second = rows(braking, other, relation="collision").figures["reactions"]

    assert first["perceptible_from"] == pytest.approx(0.8, abs=0.3)
    assert first["reacted_at"] == pytest.approx(2.5, abs=0.15)
    assert (first["how"], first["strength"]) == ("brakes", pytest.approx(4.0, abs=0.1))
    assert second["perceptible_from"] == first["perceptible_from"]
    assert second["why_not"] == "none seen"


def test_who_passes_without_a_conflict_on_its_course_has_nothing_to_react_to() -> None:
    car = line(1, (-40.0, 0.0), EAST, distance(10.0, (0.0, 8.0)))
    other = line(2, (0.0, -50.0), NORTH, distance(10.0, (0.0, 8.0)))

    for row in rows(car, other, relation="near_miss").figures["reactions"]:
        assert row["why_not"] == "no conflict on present courses"


def test_who_is_not_to_react_and_does_is_found() -> None:
    braking = line(1, (-40.0, 0.0), EAST, distance(10.0, (0.0, 2.6), (-4.0, 2.0)))
    other = line(2, (0.0, -41.0), NORTH, distance(10.0, (0.0, 5.0)))

    brakes = rows(braking, other, relation="collision", agent_1="none")
    keeps_on = rows(braking, other, relation="collision", agent_2="none")

    assert "reaction_not_seen" in {each.rule for each in brakes.missing}
    assert "reaction_not_seen" not in {each.rule for each in keeps_on.missing}
    assert keeps_on.figures["reactions"][1]["why_not"] == "the text says that it does not"


def test_scenes_made_before_there_were_reactions_say_nothing_of_them() -> None:
    users = [line(k, *way, distance(10.0, (0.0, 5.0))) for k, way in
             ((1, ((-40.0, 0.0), EAST)), (2, ((0.0, -41.0), NORTH)))]  # fmt: skip

    assert "reactions" not in check(scene(users, ("collision", 1, 2))).figures
