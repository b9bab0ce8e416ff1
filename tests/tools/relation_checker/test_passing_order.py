"""Who passes first: on hand-made tracks, beside a slow oracle, forged and mirrored."""

from __future__ import annotations

import numpy as np
import pytest
from shapely import Polygon, unary_union
from shapely.affinity import rotate, translate

from checker_tracks import (
    EAST,
    NORTH,
    along,
    bend,
    distance,
    later,
    line,
    mirrored,
    scene,
    walk,
)
from scenewright.tools.relation_checker import RoadUser, check
from scenewright.tools.relation_checker.conditions import find_passing_order
from scenewright.tools.relation_checker.events import observe

EASTWARD = line(1, (-40.0, 0.0), EAST, distance(8.0, (0.0, 10.0)))
NORTHWARD = line(2, (0.0, -40.0), NORTH, distance(8.0, (0.0, 10.0)))
LEFTWARD = along(
    2, bend((40.0, 3.0), np.pi, 36.0, 8.0, np.pi / 2, 30.0), distance(7.0, (0.0, 11.0))
)


def footprints(user: RoadUser) -> list[tuple[float, Polygon]]:
    """Times and outlines every 0.04 s."""
    track, shape = user.track, user.shape
    half = np.array([(1, 1), (1, -1), (-1, -1), (-1, 1)]) * (shape.length / 2, shape.width / 2)
    body = Polygon(half)
    found = []
    for time in np.arange(track.start, track.end, 0.04):
        x, y = (np.interp(time, track.times, track.xy[:, k]) for k in (0, 1))
        angle = float(np.interp(time, track.times, track.heading))
        outline = rotate(body, angle, origin=(0, 0), use_radians=True)
        found.append((float(time), translate(outline, x, y)))
    return found


def find_slowly(first: RoadUser, second: RoadUser) -> int:
    """Who is earlier on ground that the other one drives over at any time."""
    one, two = footprints(first), footprints(second)
    ground = [unary_union([area for _, area in each]) for each in (one, two)]
    times = [
        next(time for time, area in own if area.intersects(other))
        for own, other in ((one, ground[1]), (two, ground[0]))
    ]
    return (first if times[0] < times[1] else second).id


def find(first: RoadUser, second: RoadUser) -> int | None:
    seen = observe([first, second])
    (event,) = [each for each in seen.events if each.type != "follow"]
    order = find_passing_order(seen, event)
    return None if order is None else order.first


@pytest.mark.parametrize("delay", [-0.7, -0.4, -0.2, 0.2, 0.4, 0.7])
def test_of_two_who_collide_the_front_that_comes_first_is_first(delay: float) -> None:
    other = later(NORTHWARD, delay)
    assert find(EASTWARD, other) == (1 if delay > 0 else 2)


@pytest.mark.parametrize("delay", [-0.9, -0.3, 0.5])
@pytest.mark.parametrize("other", [NORTHWARD, LEFTWARD], ids=["crossing", "turning"])
def test_the_slow_oracle_says_the_same(other: RoadUser, delay: float) -> None:
    moved = later(other, delay + 0.15)
    events = observe([EASTWARD, moved]).events
    if not any(each.type in ("collision", "near_miss") for each in events):
        pytest.skip("the two have nothing to do with one another at this delay")
    found = find_slowly(EASTWARD, moved)
    assert find(EASTWARD, moved) == found
    assert find(mirrored(EASTWARD), mirrored(moved)) == found


def test_a_pedestrian_may_be_in_the_way_first_or_walk_into_a_side() -> None:
    early = walk(2, (0.0, -4.0), NORTH, distance(1.4, (0.0, 8.0)), at=2.5)
    assert find(EASTWARD, early) == 2
    assert find(EASTWARD, later(early, 0.8)) == 1


def test_who_shares_a_lane_has_no_order() -> None:
    leader = line(2, (-20.0, 0.0), EAST, distance(3.0, (0.0, 10.0)))
    assert find(EASTWARD, leader) is None


@pytest.mark.parametrize(("event", "delay"), [("near_miss", 1.6), ("collision", 0.3)])
def test_the_order_asked_for_is_proven_and_the_other_is_not(event: str, delay: float) -> None:
    users = [EASTWARD, later(NORTHWARD, delay)]
    for first in (1, 2):
        proof = check(scene(users, (event, 1, 2, {"first": first})))
        wrong = {each.rule for each in proof.missing}
        assert ("relation_not_realised" not in wrong) is (first == 1)
        (row,) = proof.figures["passing_orders"]
        assert (row["first"], row["second"]) == (1, 2)
        assert row["times"][0] < row["times"][1]
