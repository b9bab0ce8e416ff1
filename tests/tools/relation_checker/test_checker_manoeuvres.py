"""How a relation in one lane came about, on tracks worked out by hand."""

from __future__ import annotations

import pytest

from checker_tracks import EAST, distance, line
from scenewright.scene.record import RelationRecord
from scenewright.tools.relation_checker import RoadUser
from scenewright.tools.relation_checker.events import observe
from scenewright.tools.relation_checker.manoeuvres import find_missing_manoeuvre

GAP = 17.0
"""Between the centres of two cars at 10 m/s, which is a headway of 1.24 s [m]."""


def follow(braking: float, answer: float) -> list[RoadUser]:
    """Both drive at 10 m/s; after 4 s the leader brakes, 1 s later its follower."""
    lead = distance(10.0, (0.0, 4.0), (-braking, 10.0 / braking), (0.0, 4.0))
    behind = distance(10.0, (0.0, 5.0), (-answer, 10.0 / answer), (0.0, 2.0))
    return [line(1, (0.0, 0.0), EAST, lead), line(2, (-GAP, 0.0), EAST, behind)]


def fault(users: list[RoadUser], event: str, pair: tuple[int, int] = (2, 1)) -> str | None:
    observed = observe(users)
    found = [each for each in observed.events if each.type == event]
    assert found, [each.type for each in observed.events]
    wanted = RelationRecord.model_validate(
        {"type": event, "from": pair[0], "to": pair[1], "manoeuvre": "lead_brakes"}
    )
    return find_missing_manoeuvre(wanted, found[0], observed)


@pytest.mark.parametrize(("braking", "seen"), [(6.0, True), (3.0, False)])
def test_only_hard_braking_of_the_leader_counts(braking: float, seen: bool) -> None:
    assert (fault(follow(braking, 5.0), "follow") is None) == seen


def test_the_one_behind_is_not_the_leader() -> None:
    assert fault(follow(6.0, 5.0), "follow", (1, 2)) is not None


def test_a_rear_end_is_put_down_to_the_leader_that_braked_first() -> None:
    users = follow(6.0, 3.6)  # 13.9 m of braking where 12.4 m and 8.3 m less 10 m are left
    (hit,) = [each for each in observe(users).events if each.type == "collision"]
    assert (hit.kind, hit.cause, hit.evidence["cause_agent"]) == ("rear_end", "late_brake", 1)
    assert fault(users, "collision") is None
