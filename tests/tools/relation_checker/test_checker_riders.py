"""Cyclists and scooter riders as the checker sees them: limits, overtaking, strikes, lights."""

from __future__ import annotations

import numpy as np
import pytest

from checker_tracks import EAST, NORTH, along, bend, distance, light, line, plus_map, scene, walk
from scenewright.scene.events import Event
from scenewright.scene.track import get_rider_shape
from scenewright.tools.relation_checker import RoadUser, check, find_events

BICYCLE, SCOOTER = get_rider_shape("cyclist"), get_rider_shape("scooter")


def broken(user: RoadUser) -> set[str]:
    """Rules of motion that one agent breaks in a scene without a map."""
    proof = check(scene([user], duration=5.0))
    return {f.rule for f in proof.implausible}


@pytest.mark.parametrize(
    ("shape", "s", "rules"),
    [
        (BICYCLE, distance(8.9, (0.0, 4.0)), set()),
        (BICYCLE, distance(9.2, (0.0, 4.0)), {"speed"}),
        (SCOOTER, distance(6.9, (0.0, 4.0)), set()),
        (SCOOTER, distance(7.2, (0.0, 4.0)), {"speed"}),
        (BICYCLE, distance(3.0, (1.9, 2.0), (0.0, 2.0)), set()),
        (BICYCLE, distance(3.0, (2.3, 2.0), (0.0, 2.0)), {"acceleration"}),
        (BICYCLE, distance(7.5, (-3.4, 2.0), (0.0, 2.0)), set()),
        (BICYCLE, distance(7.9, (-3.8, 2.0), (0.0, 2.0)), {"braking"}),
    ],
)
def test_limits_of_speed_and_braking_are_those_of_the_class(shape, s, rules):
    assert broken(line(1, (0.0, 0.0), EAST, s, shape=shape)) == rules


@pytest.mark.parametrize(("radius", "rules"), [(3.3, set()), (2.6, {"curvature"})])
def test_a_rider_turns_no_tighter_than_it_can_lean(radius, rules):
    points = bend((0.0, 0.0), EAST, 4.0, radius, np.pi / 2, 9.0)
    assert broken(along(1, points, distance(2.5, (0.0, 5.0)), shape=BICYCLE)) == rules


def overtaken(
    aside: float, *, speed: float = 9.0, rider: float = 5.0, shape=BICYCLE
) -> list[Event]:
    """A car, its near side `aside` metres to the left of a rider's far side, drives past it."""
    beside = 0.925 + shape.width / 2 + aside
    users = [
        line(1, (0.0, beside), EAST, distance(speed, (0.0, 6.0))),
        line(2, (12.0, 0.0), EAST, distance(rider, (0.0, 6.0)), shape=shape),
    ]
    return [e for e in find_events(users) if e.type != "follow"]


def test_overtaking_closer_than_a_metre_and_a_half_is_a_near_miss():
    (event,) = overtaken(1.4)
    assert (event.type, event.from_, event.to) == ("near_miss", 1, 2)
    assert event.evidence["clearance"] == pytest.approx(1.4, abs=0.01)
    # Abreast where the car has made up 12 m at 4 m/s.
    assert event.time == pytest.approx(3.0, abs=0.8)


@pytest.mark.parametrize(
    "events",
    [
        overtaken(1.6),
        overtaken(-0.925 * 2 - BICYCLE.width - 1.0),
        overtaken(1.0, speed=4.0),
        overtaken(1.0, rider=0.5),
    ],
    ids=["with room", "on the right", "not at all", "of who hardly moves"],
)
def test_what_is_no_close_overtaking(events):
    assert events == []


def test_a_car_that_is_overtaken_by_a_car_is_no_rider():
    assert overtaken(1.0, shape=line(1, (0, 0), EAST, distance(1.0, (0.0, 1.0))).shape) == []


def test_a_cyclist_strikes_a_pedestrian():
    users = [
        line(1, (-20.0, 0.0), EAST, distance(5.0, (0.0, 5.0)), shape=BICYCLE),
        walk(2, (0.0, -5.0), NORTH, distance(1.4, (0.0, 5.0))),
    ]
    (event,) = find_events(users)
    assert (event.type, event.kind, event.from_, event.to) == (
        "collision", "pedestrian_strike", 1, 2,
    )  # fmt: skip


def test_who_rides_over_a_crosswalk_obeys_its_light():
    """The crosswalk of `plus_map` lies across x = -8; riding along it is subject to its light."""
    rider = line(1, (-8.0, -9.0), NORTH, distance(4.0, (0.0, 4.5)), shape=SCOOTER)
    car = line(2, (-30.0, -1.75), EAST, distance(9.0, (0.0, 5.0)))
    found = check(
        scene([rider, car], signals=[light("red", 0.0, 5.0, crosswalk=True)], duration=5.0),
        intersection_map=plus_map(),
    )
    assert ("red_crossing", (1,)) in {(f.rule, f.agents) for f in found.signal_violations}
