"""Which events are found, worked out by hand; every false pass and false fail known to us."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from checker_tracks import (
    CAR,
    EAST,
    NORTH,
    SOUTH,
    WEST,
    along,
    bend,
    crossing_walker,
    distance,
    later,
    light,
    line,
    mirrored,
    moved,
    plus_map,
    resampled,
    walk,
    yielding_car,
)
from scenewright.scene.track import Shape
from scenewright.tools.relation_checker import RoadUser, find_events, observe


def summary(users: list[RoadUser], **more: object) -> list[tuple[str, int, int]]:
    events = find_events(users, **more)  # type: ignore[arg-type]
    return [(e.type, e.from_, e.to) for e in events]


def crossing(lag: float) -> list[RoadUser]:
    """Two cars at 10 m/s on crossing lines; centres pass the origin `lag` seconds apart."""
    s = distance(10.0, (0.0, 10.0))
    return [line(1, (-50.0, 0.0), EAST, s), line(2, (0.0, -50.0 - 10 * lag), NORTH, s)]


def test_a_right_angle_collision_is_found_at_the_moment_of_contact() -> None:
    (event,) = find_events(crossing(0.0))
    # corner to corner: the front of one, at x = -50 + 10 t + 2.3, reaches the side at x = -0.925
    assert (event.type, event.kind) == ("collision", "angle")
    assert event.time == pytest.approx(4.6775, abs=0.01)
    assert event.evidence["relative_speed"] == pytest.approx(10 * np.sqrt(2), abs=0.05)
    assert event.location == pytest.approx((-0.925, -0.925), abs=0.1)


def test_the_striking_agent_is_the_one_with_the_front() -> None:
    (event,) = find_events(crossing(0.2))
    assert (event.from_, event.to) == (2, 1)
    assert event.evidence["side_to"] == "side"


@pytest.mark.parametrize(("lag", "expected"), [(1.0, 0.355), (2.0, 1.355), (2.2, None)])
def test_near_miss_by_pet(lag: float, expected: float | None) -> None:
    # the lag less the time for length and width together
    events = find_events(crossing(lag))
    if expected is None:
        assert events == ()
    else:
        assert events[0].type == "near_miss"
        assert events[0].evidence["pet"] == pytest.approx(expected, abs=0.03)


def test_a_car_yields_to_a_pedestrian() -> None:
    (event,) = find_events([yielding_car(), crossing_walker()], intersection_map=plus_map())
    assert (event.type, event.from_, event.to) == ("yielding", 1, 2)
    # it stands (0.3 m/s) 0.1 s before 5.367 s, at x = -13
    assert event.time == pytest.approx(5.3, abs=0.11)
    assert event.location == pytest.approx((-13.0, -1.75), abs=0.05)
    # the walker leaves at y = -1.75 + 0.925 + 0.3, the front comes to x = -8.3
    assert event.evidence["other_cleared"] == pytest.approx(3.0 + 5.475 / 1.4, abs=0.03)
    assert event.evidence["entered"] == pytest.approx(5.367 + 3.6 + np.sqrt(2.4), abs=0.03)


@pytest.mark.parametrize("turn", [0.3, 2.0, 4.4])
def test_rotation_and_translation_change_nothing(turn: float) -> None:
    for users in ([yielding_car(), crossing_walker()], crossing(0.1), crossing(1.0)):
        there = [moved(u, turn=turn, shift=(7.0, -3.0)) for u in users]
        for one, two in zip(find_events(users), find_events(there), strict=True):
            assert (one.type, one.from_, one.to, one.kind) == (
                two.type,
                two.from_,
                two.to,
                two.kind,
            )
            assert one.time == pytest.approx(two.time, abs=0.03)


def test_mirroring_and_resampling_change_nothing() -> None:
    for users in ([yielding_car(), crossing_walker()], crossing(0.0), crossing(1.0)):
        plain = summary(users)
        assert summary([mirrored(u) for u in users]) == plain
        assert summary([resampled(u, 0.05) for u in users]) == plain
        assert summary([resampled(u, 0.2) for u in users]) == plain


def test_vacuity_delayed_or_rerouted_the_other_agent_leaves_no_event() -> None:
    car = yielding_car()
    assert summary([car, later(crossing_walker(), 14.0)]) == []
    assert summary([car, moved(crossing_walker(), shift=(-60.0, 0.0))]) == []
    one, two = crossing(0.0)
    assert summary([one, later(two, 4.0)]) == []
    assert summary([one, moved(two, shift=(60.0, 0.0))]) == []


class TestNotYielding:
    """SEMANTICS section 4: what only looks like yielding."""

    def test_spawned_at_rest(self) -> None:
        s = distance(0.0, (0.0, 9.0), (2.0, 4.0), (0.0, 4.0))
        assert summary([line(1, (-13.0, -1.75), EAST, s), crossing_walker()]) == []

    def test_slows_for_nobody(self) -> None:
        assert summary([yielding_car()]) == []
        assert summary([yielding_car(), crossing_walker(at=-6.0)]) == []

    def test_passes_first(self) -> None:
        assert summary([yielding_car(), crossing_walker(at=13.0)]) == []

    def test_slows_for_its_own_curve(self) -> None:
        # right turn of 8 m radius at 4.4 m/s; a walker crosses its exit 2.8 s before it comes
        path = bend((-50.0, -1.75), EAST, 42.0, 8.0, -np.pi / 2, 30.0)
        s = distance(10.0, (0.0, 2.5), (-2.0, 2.8), (0.0, 9.0))
        car = along(1, path, s)
        walker = walk(2, (-6.0, -22.0), EAST, distance(1.4, (0.0, 9.0)), at=1.5)
        assert summary([car, walker]) == []

    def test_waits_at_a_red_light(self) -> None:
        lights = [light("red", 0.0, 8.9), light("green", 8.9, 30.0)]
        users = [yielding_car(), crossing_walker()]
        # the stop line of the map is at x = -12; its front waits at x = -10.7, so shift it back
        users = [moved(u, shift=(-2.0, 0.0)) for u in users]
        assert summary(users, intersection_map=plus_map(), signals=lights) == []
        assert summary(users, intersection_map=plus_map())[0][0] == "yielding"

    def test_a_follower_that_queues_behind_the_yielding_car(self) -> None:
        s = distance(10.0, (0.0, 61 / 30), (-3.0, 10 / 3), (0.0, 4.6), (2.0, 4.0), (0.0, 5.0))
        users = [yielding_car(), line(3, (-57.0, -1.75), EAST, s), crossing_walker()]
        found = summary(users, intersection_map=plus_map())
        assert ("yielding", 1, 2) in found
        assert ("yielding", 3, 2) not in found

    def test_a_merge_behind_with_room(self) -> None:
        # turns right into the lane of a car that is ahead by 2.6 s
        straight = line(1, (0.0, 50.0), SOUTH, distance(8.0, (0.0, 12.0)))
        path = bend((-40.0, 8.0), EAST, 32.0, 8.0, -np.pi / 2, 60.0)
        turning = along(2, path, distance(8.0, (0.0, 1.0), (-2.0, 2.0), (0.0, 14.0)), at=1.7)
        assert [e for e in summary([straight, turning]) if e[0] != "follow"] == []


def test_a_leader_stops_at_red_and_a_follower_behind_it() -> None:
    s = distance(10.0, (0.0, 2.0), (-3.0, 10 / 3), (0.0, 5.0), (2.0, 4.0), (0.0, 3.0))
    behind = distance(10.0, (0.0, 2.5), (-2.8, 10 / 2.8), (0.0, 5.2), (2.0, 4.0), (0.0, 3.0))
    users = [line(1, (-40.0, -1.75), EAST, s), line(2, (-53.0, -1.75), EAST, behind)]
    assert summary(users) == [("follow", 2, 1)]


def test_a_left_turner_waits_for_oncoming_traffic() -> None:
    path = bend((-60.0, -1.75), EAST, 55.0, 6.75, np.pi / 2, 40.0)
    s = distance(10.0, (0.0, 3.8), (-3.0, 10 / 3), (0.0, 2.5), (2.0, 2.5), (0.0, 8.0))
    oncoming = line(2, (70.0, 1.75), WEST, distance(10.0, (0.0, 16.0)))
    assert summary([along(1, path, s), oncoming]) == [("yielding", 1, 2)]


def test_a_pedestrian_waits_at_the_kerb_for_a_car() -> None:
    s = distance(1.4, (0.0, 2.0), (-1.4, 1.0), (0.0, 3.0), (1.4, 1.0), (0.0, 6.0))
    walker = walk(1, (-8.0, -7.8), NORTH, s)
    car = line(2, (-60.0, -1.75), EAST, distance(10.0, (0.0, 12.0)))
    (event,) = find_events([walker, car])
    assert (event.type, event.from_, event.to) == ("yielding", 1, 2)
    assert event.location == pytest.approx((-8.0, -4.3), abs=0.1)


def test_two_pedestrians_abreast_are_nothing() -> None:
    s = distance(1.4, (0.0, 10.0))
    assert summary([walk(1, (0.0, 0.0), EAST, s), walk(2, (0.0, 0.65), EAST, s)]) == []


def test_a_queue_through_a_right_turn_is_following() -> None:
    path = bend((-40.0, 0.0), EAST, 30.0, 6.0, -np.pi / 2, 40.0)
    s = distance(4.0, (0.0, 16.0))
    users = [along(1, path, s), along(2, path, s, at=2.2)]
    assert {e[0] for e in summary(users)} == {"follow"}


def test_a_leader_that_turns_off_is_following_not_a_near_miss() -> None:
    turning = along(1, bend((-40.0, 0.0), EAST, 40.0, 6.0, -np.pi / 2, 30.0),
                    distance(8.0, (0.0, 3.0), (-2.0, 2.0), (0.0, 6.0)))  # fmt: skip
    straight = line(2, (-55.0, 0.0), EAST, distance(8.0, (0.0, 4.0), (-1.5, 2.0), (0.0, 9.0)))
    assert {e[0] for e in summary([turning, straight])} <= {"follow"}


class TestContact:
    def test_rear_end(self) -> None:
        slow = line(1, (0.0, 0.0), EAST, distance(3.0, (0.0, 6.0)))
        fast = line(2, (-20.0, 0.3), EAST, distance(10.0, (0.0, 4.0)))
        (event,) = [e for e in find_events([slow, fast]) if e.type == "collision"]
        assert (event.kind, event.from_, event.to) == ("rear_end", 2, 1)
        assert event.time == pytest.approx((20 - 4.6) / 7, abs=0.02)

    def test_head_on(self) -> None:
        s = distance(8.0, (0.0, 4.0))
        (event,) = find_events([line(1, (-30.0, 0.0), EAST, s), line(2, (30.0, 0.5), WEST, s)])
        assert event.kind == "head_on"
        assert event.time == pytest.approx((60 - 4.6) / 16, abs=0.02)

    def test_sideswipe(self) -> None:
        angle = np.deg2rad(12.0)
        one = line(1, (0.0, 0.0), EAST, distance(8.0, (0.0, 5.0)))
        two = line(2, (0.0, 4.0), -angle, distance(8.0, (0.0, 5.0)))
        (event,) = [e for e in find_events([one, two]) if e.type == "collision"]
        assert event.kind == "sideswipe"

    def test_left_turn(self) -> None:
        path = bend((-40.0, -1.75), EAST, 35.0, 6.75, np.pi / 2, 30.0)
        turning = along(1, path, distance(6.0, (0.0, 12.0)))
        oncoming = line(2, (60.0, 1.75), WEST, distance(8.5, (0.0, 12.0)))
        (event,) = find_events([turning, oncoming])
        assert event.kind == "left_turn"

    def test_pedestrian_strike(self) -> None:
        car = line(1, (-40.0, 0.0), EAST, distance(8.0, (0.0, 8.0)))
        walker = walk(2, (0.0, -1.4 * 4.9), NORTH, distance(1.4, (0.0, 8.0)))
        (event,) = find_events([car, walker])
        assert (event.kind, event.from_, event.evidence["side_from"]) == (
            "pedestrian_strike", 1, "front",
        )  # fmt: skip

    def test_passing_through_each_other_between_samples(self) -> None:
        # two thin boxes at 20 m/s head on: apart at every sample
        thin = Shape("vehicle", 0.5, 0.5)
        s = distance(20.0, (0.0, 4.0))
        one = line(1, (-40.9, 0.0), EAST, s, shape=thin)
        two = line(2, (40.9, 0.0), WEST, s, shape=thin)
        (event,) = find_events([one, two])
        assert event.type == "collision"
        assert event.time == pytest.approx((81.8 - 0.5) / 40, abs=0.01)

    def test_overlap_at_spawn_is_no_collision(self) -> None:
        one = line(1, (0.0, 0.0), EAST, distance(8.0, (0.0, 5.0)))
        two = line(2, (2.0, 0.5), EAST, distance(5.0, (0.0, 5.0)))
        assert [e for e in summary([one, two]) if e[0] == "collision"] == []


def test_an_abrupt_yield_is_a_near_miss() -> None:
    s = distance(10.0, (0.0, 2.7), (-6.5, 10 / 6.5), (0.0, 4.0), (2.0, 4.0), (0.0, 5.0))
    car = line(1, (-50.0, -1.75), EAST, s)
    (event,) = find_events([car, crossing_walker(at=1.5)])
    assert (event.type, event.cause) == ("near_miss", "late_brake")


@pytest.mark.parametrize(("braking", "cause"), [(2.0, "late_brake"), (3.0, None)])
def test_who_slows_as_for_a_curve_may_still_brake_late(braking: float, cause: str | None) -> None:
    before = 10.0 + 2.7 * braking
    s = distance(before, (-braking, 2.7), (-6.5, 10 / 6.5), (0.0, 4.0), (2.0, 4.0), (0.0, 5.0))
    car = line(1, (-23.0 - 2.7 * (10.0 + before) / 2, -1.75), EAST, s)
    (event,) = find_events([car, crossing_walker(at=1.5)])
    assert (event.type, event.cause) == ("near_miss", cause)
    assert event.evidence.get("late_brake") == (1 if cause else None)


def test_running_red_is_the_cause() -> None:
    car = line(1, (-50.0, -1.75), EAST, distance(10.0, (0.0, 8.0)), shape=CAR)
    walker = walk(2, (-8.0, -1.75 - 1.4 * 4.2), NORTH, distance(1.4, (0.0, 8.0)))
    events = find_events(
        [car, walker], intersection_map=plus_map(), signals=[light("red", 0.0, 30.0)]
    )
    assert (events[0].type, events[0].cause) == ("collision", "red_light_run")


def test_standing_agents_are_met_at_no_lag() -> None:
    # stands in the way for 10 s: contact whenever the other comes
    parked = line(1, (0.0, 0.0), EAST, np.zeros(150))
    other = line(2, (0.0, -40.0), NORTH, distance(8.0, (0.0, 8.0)))
    assert summary([parked, other]) == [("collision", 2, 1)]


def test_a_figure_says_when_and_where_it_was_measured() -> None:
    (event,) = find_events(crossing(1.5))
    arrival, closest = event.when["pet"], event.evidence["clearance"]
    assert arrival.value == event.evidence["pet"]
    # The second arrives after both were closest, at the place that the first had left by then.
    assert event.time + 0.3 < arrival.time < event.time + event.evidence["pet"] + 0.5
    assert np.hypot(*arrival.location) < 2.0 < np.hypot(*event.location) + closest
    assert event.worst == {}  # no relation binds the two


def test_what_is_worse_after_the_event_is_told_beside_it() -> None:
    # The first crosses before the second, comes round and meets it again head on, braking gently.
    corners = np.array([(-60, 0), (30, 0), (30, 70), (0, 70), (0, 0)], dtype=float)
    ways = [np.linspace(a, b, 2000)[:-1] for a, b in pairwise(corners)]
    way = float(np.hypot(*np.diff(corners[:-1], axis=0).T).sum()) + 16.0
    first = along(1, np.concatenate(ways), distance(6.0, (0.0, way / 6.0), (-2.0, 3.0)))
    second = line(2, (0.0, -60.0), NORTH, distance(6.0, (0.0, 15.0), (-1.8, 3.4), (0.0, 30.0)),
                  at=1.2)  # fmt: skip
    users = [first, second]
    events = observe(users, asked=[(1, 2)], detailed={1, 2}).events
    (event,) = (each for each in events if each.type == "near_miss")
    assert event.time < 15.0
    worse = event.list_worse()
    assert worse.keys() == {"path_ttc", "ttc_2d", "drac"}
    assert "path_ttc" not in event.evidence
    assert worse["path_ttc"].value < 2.0
    assert worse["path_ttc"].time > 30.0
    assert worse["path_ttc"].location[1] == pytest.approx(45.0, abs=6.0)
    assert event.worst["pet"].value <= event.evidence["pet"]
