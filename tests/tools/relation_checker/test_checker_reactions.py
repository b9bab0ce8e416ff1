"""Who reacts, when, how strongly, or why not: on straight tracks with reactions known by hand."""

import numpy as np
import pytest

from checker_tracks import EAST, NORTH, along, distance, line, scene, walk
from scenewright.scene.base import FloatArray
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


def _walk_back(back: float) -> FloatArray:
    """Ways gone every 0.1 s: 1.4 m/s, braking from 1.8 s on, so much backwards in 1 s, standing."""
    ahead = distance(1.4, (0.0, 1.8), (-2.0, 0.7))
    backwards = distance(0.0, (4.0 * back, 0.5), (-4.0 * back, 0.5))
    return np.concatenate((ahead, ahead[-1] - backwards[1:], np.full(14, ahead[-1] - back)))


@pytest.mark.parametrize(("back", "how"), [(0.4, "steps_back"), (0.7, "jumps_back")])
def test_who_goes_backwards_steps_or_jumps_back(back: float, how: str) -> None:
    car = line(1, (-36.0, 0.0), EAST, distance(10.0, (0.0, 4.2)))
    on_foot = walk(2, (0.0, -2.2), NORTH, _walk_back(back))

    as_asked = rows(car, on_foot, relation="collision", agent_2=how)
    otherwise = rows(car, on_foot, relation="collision", agent_2="runs")

    assert as_asked.figures["reactions"][1]["how"] == how
    assert "reaction_not_seen" not in {each.rule for each in as_asked.missing}
    assert "reaction_not_seen" in {each.rule for each in otherwise.missing}


def test_who_brakes_and_swerves_has_swerved() -> None:
    x = np.linspace(-40.0, 20.0, 601)
    y = 0.4 * (0.5 - 0.5 * np.cos(np.pi * np.clip((x + 20.0) / 11.0, 0.0, 1.0)))
    driven = distance(10.0, (0.0, 2.0), (-2.0, 2.8))
    swerving = along(1, np.stack((x, y), axis=1), driven)
    other = line(2, (0.0, -41.0), NORTH, distance(10.0, (0.0, 5.0)))

    first, _ = rows(swerving, other, relation="collision", agent_1="swerves").figures["reactions"]

    assert first["how"] == "swerves"
