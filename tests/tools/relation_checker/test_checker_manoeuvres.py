"""How a relation in one lane came about, on tracks worked out by hand."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from checker_tracks import CAR, EAST, NORTH, along, distance, line, plus_map
from scenewright.scene.events import Event
from scenewright.scene.kinds import get_kind
from scenewright.scene.record import AgentRecord, RelationRecord
from scenewright.scene.track import PEDESTRIAN, Track
from scenewright.tools.relation_checker import RoadUser
from scenewright.tools.relation_checker.conditions import find_missing_manoeuvre
from scenewright.tools.relation_checker.events import observe
from scenewright.tools.relation_checker.groups import check_groups
from scenewright.tools.relation_checker.motions import SeenMotion, describe_motion, describe_return

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


def test_tailgating_is_a_headway_of_a_second_or_less() -> None:
    s = distance(10.0, (0.0, 8.0))
    for gap, seen in ((12.0, True), (20.0, False)):  # 0.74 s and 1.54 s
        users = [line(1, (0.0, 0.0), EAST, s), line(2, (-gap, 0.0), EAST, s)]
        observed = observe(users)
        (event,) = [each for each in observed.events if each.type == "follow"]
        wanted = RelationRecord.model_validate(
            {"type": "follow", "from": 2, "to": 1, "manoeuvre": "tailgates"}
        )
        assert (find_missing_manoeuvre(wanted, event, observed) is None) == seen


@pytest.mark.parametrize(("aside", "seen"), [(3.3, True), (1.0, False)])
def test_who_cuts_in_comes_over_from_the_next_lane(aside: float, seen: bool) -> None:
    s = distance(10.0, (0.0, 8.0))
    x = s + 8.0
    y = aside * (1.0 - np.clip((s - 20.0) / 25.0, 0.0, 1.0))
    cutter = RoadUser(1, Track(np.column_stack([x, y]), np.zeros(len(s)), 0.0), CAR)
    users = [cutter, line(2, (0.0, 0.0), EAST, s)]
    observed = observe(users)
    event = Event.model_validate(
        {"type": "near_miss", "from": 1, "to": 2, "time": 4.0, "location": (40.0, 0.0)}
    )
    wanted = RelationRecord.model_validate(
        {"type": "near_miss", "from": 1, "to": 2, "manoeuvre": "cuts_in"}
    )
    assert (find_missing_manoeuvre(wanted, event, observed) is None) == seen


@pytest.mark.parametrize(
    ("motion", "phases", "seen"),
    [
        ("runs", (3.0, (0.0, 8.0)), True),
        ("runs", (1.4, (0.0, 16.0)), False),
        ("stops_midway", (1.4, (0.0, 9.0), (-1.4, 1.0), (0.0, 2.0), (1.4, 1.0), (0.0, 6.0)), True),
        ("stops_midway", (1.4, (0.0, 18.0)), False),
    ],
)
def test_how_a_pedestrian_crosses(motion: str, phases: tuple[Any, ...], seen: bool) -> None:
    s = distance(phases[0], *phases[1:])
    user = line(1, (14.0, -13.0), NORTH, s, shape=PEDESTRIAN)
    observed = observe([user])
    found = describe_motion(motion, observed.tracks[0], observed, plus_map())
    assert (found is not None) == seen


@pytest.mark.parametrize(
    ("out", "back", "struck", "seen"),
    [(5.0, 9.0, False, True), (5.0, 1.0, False, False), (5.0, 1.0, True, True),
     (5.0, 0.2, True, False), (1.5, 5.0, False, False), (14.0, 0.0, False, False)],
)  # fmt: skip
def test_who_turns_back_comes_well_onto_the_road_and_returns(
    out: float, back: float, struck: bool, seen: bool
) -> None:
    """From 3.5 m south of the kerb, `out` metres over the road and `back` metres back."""
    there = np.array([(14.0, -13.0), (14.0, -3.5 + out), (14.6, -3.5 + out)])
    points = np.vstack((there, (14.6, -3.5 + out - back)))
    long = float(np.hypot(*np.diff(points, axis=0).T).sum())
    user = along(1, points, distance(1.4, (0.0, long / 1.4)), shape=PEDESTRIAN)
    observed, kind = observe([user]), get_kind("motion", "turns_back")
    track = observed.tracks[0]
    found = describe_return(SeenMotion(kind, track, observed.lights, plus_map(), struck))
    assert (found is not None) == seen


def record(number: int, group: int | None) -> AgentRecord:
    return AgentRecord.model_validate(
        {
            "id": number, "type": "pedestrian", "spawn_time": 0.0, "goal": (0.0, 0.0),
            "trajectory": (), "role": "foreground", "name": f"pedestrian-{number}",
            "entry": "north", "exit": "south", "movement": "crossing", "route": "a",
            "heading": (), "length": 0.6, "width": 0.6, "group": group,
        }
    )  # fmt: skip


@pytest.mark.parametrize(("aside", "seen"), [(0.75, True), (2.0, False)])
def test_a_group_walks_within_a_step_and_a_half(aside: float, seen: bool) -> None:
    s = distance(1.4, (0.0, 6.0))
    places = [(0.0, 0.0), (aside, 0.0), (0.0, -0.8)]
    users = [line(n, each, NORTH, s, shape=PEDESTRIAN) for n, each in enumerate(places, start=1)]
    records = [record(1, None), record(2, 1), record(3, 1)]
    assert (not check_groups(records, observe(users))) == seen


def chain(speed: float, pushed: float, *, rolls: float = 0.0) -> list[RoadUser]:
    """A car strikes one that stands (or rolls) 1 m behind a third, and pushes it on from 3 s."""
    times = 0.1 * np.arange(38)
    since = np.clip(times - 3.0, 0.0, None)
    striker = line(1, (-4.6 - 3.0 * speed, 0.0), EAST, speed * times[:32])
    moved = pushed * since - 3.0 * since**2 + rolls * np.minimum(times - 3.0, 0.0)
    struck = line(2, (0.0, 0.0), EAST, moved[: int(np.argmax(moved > 1.0)) + 1])
    return [striker, struck, line(3, (4.6 + 1.0, 0.0), EAST, np.zeros(38))]


def describe_chain(users: list[RoadUser]) -> str | None:
    observed = observe(users)
    hits = [each for each in observed.events if each.type == "collision"]
    assert [(each.from_, each.to, each.kind) for each in hits] == [
        (1, 2, "rear_end"), (2, 3, "rear_end"),
    ]  # fmt: skip
    wanted = RelationRecord.model_validate(
        {"type": "collision", "from": 2, "to": 3, "manoeuvre": "pushed"}
    )
    return find_missing_manoeuvre(wanted, hits[1], observed)


@pytest.mark.parametrize(
    ("speed", "pushed", "rolls", "explained"),
    [
        (9.0, 5.0, 0.0, True),  # 4.5 m/s without restitution, 5.9 with 0.3
        (9.0, 9.0, 0.0, False),
        (16.0, 4.0, 0.0, False),
        (9.0, 5.0, 1.0, False),
    ],
)
def test_a_push_is_what_the_masses_explain(
    speed: float, pushed: float, rolls: float, explained: bool
) -> None:
    assert (describe_chain(chain(speed, pushed, rolls=rolls)) is None) == explained
