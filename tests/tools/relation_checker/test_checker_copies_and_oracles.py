"""Lane changes, riders, two on foot, chains, groups, orders and doors: copies, forgeries, oracles.

A mirrored, turned or resampled copy of a scene shows the same; a scene that only looks like the
relation is refused; and a slow, obvious computation says the same as the checker.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pytest

from checker_tracks import (
    CAR,
    EAST,
    NORTH,
    WEST,
    distance,
    later,
    line,
    mirrored,
    moved,
    resampled,
    scene,
    walk,
)
from scenewright.scene.base import FloatArray
from scenewright.scene.events import Event
from scenewright.scene.objects import ObjectRecord
from scenewright.scene.record import AgentRecord, EncounterRecord, RelationRecord
from scenewright.scene.track import PEDESTRIAN, Track, get_rider_shape
from scenewright.tools.relation_checker import RoadUser, check, find_events
from scenewright.tools.relation_checker.conditions import find_missing_manoeuvre, find_passing_order
from scenewright.tools.relation_checker.events import observe
from scenewright.tools.relation_checker.groups import check_groups
from scenewright.tools.relation_checker.objects import check_encounters

Copy = Callable[[RoadUser], RoadUser]
COPIES: dict[str, Copy] = {
    "as it is": lambda user: user,
    "mirrored": mirrored,
    "turned": lambda user: moved(user, turn=1.1, shift=(3.0, -7.0)),
    "resampled": lambda user: resampled(user, 0.05),
}
BICYCLE, SCOOTER = get_rider_shape("cyclist"), get_rider_shape("scooter")


@pytest.fixture(params=COPIES)
def copy(request: pytest.FixtureRequest) -> Copy:
    return COPIES[request.param]


def relate(kind: str, first: int, second: int, **more: Any) -> RelationRecord:
    return RelationRecord.model_validate({"type": kind, "from": first, "to": second, **more})


# Lane changes.


def change(
    *, aside: float = 3.3, ahead: float = 8.0, begins: float = 20.0, speed: float = 10.0
) -> list[RoadUser]:
    """Car 1 comes over from `aside` to the lane of car 2, `ahead` of its middle, over 25 m."""
    s = distance(speed, (0.0, 12.0))
    y = aside * (1.0 - np.clip((s - begins) / 25.0, 0.0, 1.0))
    cutter = RoadUser(1, Track(np.column_stack([s + ahead, y]), np.zeros(len(s)), 0.0), CAR)
    return [cutter, line(2, (0.0, 0.0), EAST, s)]


def has_cut_in(users: Sequence[RoadUser], time: float, pair: tuple[int, int] = (1, 2)) -> bool:
    """Whether the checker sees that the first cuts in on the second at an event."""
    event = Event.model_validate(
        {"type": "near_miss", "from": pair[0], "to": pair[1], "time": time, "location": (0, 0)}
    )
    wanted = relate("near_miss", *pair, manoeuvre="cuts_in")
    return find_missing_manoeuvre(wanted, event, observe(users)) is None


def test_copies_of_a_cut_in_are_seen_alike(copy: Copy) -> None:
    assert has_cut_in([copy(each) for each in change()], 4.0)


@pytest.mark.parametrize(
    ("users", "time", "pair"),
    [
        (change(aside=1.5), 4.0, (1, 2)),  # it was in the lane all along
        (change(ahead=25.0), 4.0, (1, 2)),  # it comes in far ahead
        (change(begins=0.0), 11.9, (1, 2)),  # it came over long before
        (change(), 4.0, (2, 1)),  # it is the other one
        (change(ahead=-9.0), 4.0, (1, 2)),  # it comes in behind
        ([line(1, (8.0, 3.3), EAST, distance(10.0, (0.0, 12.0))), change()[1]], 4.0, (1, 2)),
    ],
)  # fmt: skip
def test_what_only_looks_like_a_cut_in_is_refused(
    users: list[RoadUser], time: float, pair: tuple[int, int]
) -> None:
    assert not has_cut_in(users, time, pair)


def come_over_slowly(users: Sequence[RoadUser], time: float) -> bool:
    """Whether it was 2.2 m off the other's line within 6 s before, and comes over by 0.8 m."""
    xy, way = users[0].track.xy, users[1].track.xy
    apart = [min(float(np.hypot(*(point - other))) for other in way) for point in xy]
    times = users[0].track.times
    before = [d for d, t in zip(apart, times, strict=True) if time - 6.0 <= t <= time]
    after = [d for d, t in zip(apart, times, strict=True) if abs(t - time) <= 3.15]
    return max(before) >= 2.2 and max(before) - min(after) >= 0.8


@pytest.mark.parametrize("seed", range(12))
def test_a_lane_change_is_that_of_the_slow_search(seed: int) -> None:
    rng = np.random.default_rng(seed)
    aside, begins = float(rng.choice([0.4, 1.4, 2.8, 3.4])), float(rng.uniform(0.0, 60.0))
    users, time = change(aside=aside, begins=begins), float(rng.uniform(3.0, 9.0))
    # With 10 m/s and points 1 m apart the slow search is exact where both are sampled together.
    assert has_cut_in(users, time) == come_over_slowly(users, time)


# Riders.


def ride(s: FloatArray, shape: Any = BICYCLE) -> RoadUser:
    return line(1, (0.0, 0.0), EAST, s, shape=shape)


def list_broken(user: RoadUser) -> set[str]:
    return {each.rule for each in check(scene([user], duration=8.0)).implausible}


@pytest.mark.parametrize(
    ("user", "rules"),
    [
        (ride(distance(8.8, (0.0, 4.0))), set()),
        (ride(distance(9.3, (0.0, 4.0))), {"speed"}),
        (ride(distance(7.3, (0.0, 4.0)), SCOOTER), {"speed"}),
        (ride(distance(7.9, (-3.9, 2.0), (0.0, 2.0))), {"braking"}),
        (ride(distance(3.0, (2.4, 2.0), (0.0, 2.0))), {"acceleration"}),
    ],
)
def test_copies_of_riders_keep_or_break_the_same_limits(
    user: RoadUser, rules: set[str], copy: Copy
) -> None:
    if copy is not COPIES["resampled"]:  # a scene has one step, 0.1 s
        assert list_broken(copy(user)) == rules


@pytest.mark.parametrize("seed", range(10))
def test_limits_of_a_rider_are_those_of_plain_differences(seed: int) -> None:
    rng = np.random.default_rng(seed)
    phases = [(float(a), 1.5) for a in rng.choice([-4.2, -2.0, 0.0, 1.4, 2.8], size=3)]
    s = distance(float(rng.uniform(4.5, 9.6)), *phases)
    v = np.gradient(s, 0.1)
    if v.min() < 0.5 or np.abs(v.max() - 9.0) < 0.1:
        pytest.skip("it would ride backwards, or is at the limit")
    a = np.array([each for each, _ in phases])
    wanted = {"speed"} if v.max() > 9.0 else set()
    wanted |= {"braking"} if a.min() < -3.5 else set()
    wanted |= {"acceleration"} if a.max() > 2.0 else set()
    assert list_broken(ride(s)) == wanted


@pytest.mark.parametrize("name", ["as it is", "turned", "resampled"])
def test_copies_of_a_close_overtaking_are_seen_alike(name: str) -> None:
    """In a mirror it passes on the other side, which is no overtaking in right-hand traffic."""
    users = [
        line(1, (0.0, 0.925 + 0.325 + 1.1), EAST, distance(9.0, (0.0, 6.0))),
        line(2, (12.0, 0.0), EAST, distance(5.0, (0.0, 6.0)), shape=BICYCLE),
    ]
    (event,) = [
        e for e in find_events([COPIES[name](each) for each in users]) if e.type != "follow"
    ]
    assert (event.type, event.from_, event.to) == ("near_miss", 1, 2)
    assert event.evidence["clearance"] == pytest.approx(1.1, abs=0.02)


# Two on foot.


def meet(delay: float) -> list[RoadUser]:
    """Two walk at 1.4 m/s, one east and one north, over one place, the second so much later."""
    s = distance(1.4, (0.0, 10.0))
    return [walk(1, (-7.0, 0.0), EAST, s), walk(2, (0.0, -7.0), NORTH, s, at=delay)]


def list_wrong(users: Sequence[RoadUser], *relations: Any) -> set[str]:
    proof = check(scene(users, *relations, duration=14.0))
    return {each.rule for each in (*proof.missing, *proof.interference)}


ROOM = {"within": {"clearance": (0.0, 0.4)}}
"""With the tolerance of 0.2 m: at most 0.6 m."""


def nearly_meet_slowly(users: Sequence[RoadUser]) -> bool:
    """Discs of 0.3 m come within 0.6 m, and touch where one is at most 1.5 s early or late."""
    times = np.arange(0.0, 13.0, 0.02)
    one, two = (
        np.stack([np.interp(times, own.times, xy, np.nan, np.nan) for xy in own.xy.T], axis=1)
        for own in (each.track for each in users)
    )
    least = float(np.nanmin(np.hypot(*(one - two).T))) - 0.6
    touch = np.hypot(*(one[:, None] - two[None]).transpose(2, 0, 1)) <= 0.6
    pet = float(np.abs(times[:, None] - times[None])[touch].min()) if touch.any() else np.inf
    return 0.0 < least <= 0.6 and pet <= 1.5


@pytest.mark.parametrize("delay", [0.75, 0.9, 1.05, 1.4, 1.8, 2.5])
def test_two_on_foot_nearly_collide_as_the_slow_search_says(delay: float) -> None:
    users = meet(delay)
    assert (not list_wrong(users, ("near_miss", 1, 2, ROOM))) == nearly_meet_slowly(users)


def test_two_on_foot_mean_nothing_where_no_relation_binds_them() -> None:
    assert not list_wrong(meet(0.9))


def test_two_who_pass_one_another_side_by_side_nearly_hit_no_one() -> None:
    s = distance(1.4, (0.0, 10.0))
    users = [walk(1, (-7.0, 0.0), EAST, s), walk(2, (7.0, 0.8), WEST, s)]
    assert list_wrong(users, ("near_miss", 1, 2, ROOM))


@pytest.mark.parametrize("name", ["mirrored", "turned"])
def test_copies_of_two_on_foot_are_seen_alike(name: str) -> None:
    for delay, wrong in ((0.9, False), (2.5, True)):
        users = [COPIES[name](each) for each in meet(delay)]
        assert bool(list_wrong(users, ("near_miss", 1, 2, ROOM))) == wrong


# Chains.


def push(pushed: float, *, speed: float = 9.0) -> list[RoadUser]:
    """A car strikes one that stands 1 m behind a third, and pushes it on at 3 s."""
    times = 0.1 * np.arange(38)
    since = np.clip(times - 3.0, 0.0, None)
    way = pushed * since - 3.0 * since**2
    return [
        line(1, (-4.6 - 3.0 * speed, 0.0), EAST, speed * times[:32]),
        line(2, (0.0, 0.0), EAST, way[: int(np.argmax(way > 1.0)) + 1]),
        line(3, (5.6, 0.0), EAST, np.zeros(38)),
    ]


def is_push(users: Sequence[RoadUser], pair: tuple[int, int] = (2, 3)) -> bool:
    observed = observe(users)
    hits = [each for each in observed.events if {each.from_, each.to} == set(pair)]
    wanted = relate("collision", *pair, manoeuvre="pushed")
    return bool(hits) and find_missing_manoeuvre(wanted, hits[0], observed) is None


@pytest.mark.parametrize("name", ["as it is", "mirrored", "turned"])
def test_copies_of_a_push_are_seen_alike(name: str) -> None:
    for pushed, seen in ((5.0, True), (9.0, False)):
        assert is_push([COPIES[name](each) for each in push(pushed)]) == seen


def test_a_push_needs_all_three_and_their_order() -> None:
    users = push(5.0)
    assert not is_push(users[1:])  # no agent strikes it
    assert not is_push(users, (1, 2))  # the first is struck by no one
    rolling = [users[0], line(2, (-0.4, 0.0), EAST, np.linspace(0.0, 1.4, 35)), users[2]]
    assert not is_push(rolling)


def is_explained_slowly(users: Sequence[RoadUser], speed: float) -> bool:
    """Whether equal masses, restitutions up to 0.3 and braking up to 8 explain the metre."""
    way = users[1].track.xy[:, 0]
    found = []
    for late in (-0.03, 0.03):
        takes = 0.1 * (np.interp(1.0, way, np.arange(len(way))) - 30) + late
        for share, braking in ((0.5, 8.0), (0.5 * 1.3, 0.0)):
            v, moved = share * speed, 0.0
            for _ in range(round(takes / 0.0005)):
                moved, v = moved + v * 0.0005, max(v - braking * 0.0005, 0.0)
            found.append(moved)
    return min(found) <= 1.0 <= max(found)


@pytest.mark.parametrize("share", [0.43, 0.5, 0.6, 0.7, 1.0, 1.3])
def test_a_push_moves_as_momentum_has_it(share: float) -> None:
    users = push(9.0 * share)
    assert is_push(users) == is_explained_slowly(users, 9.0)


# Groups.


def stroll(*paths: FloatArray) -> tuple[list[AgentRecord], list[RoadUser]]:
    angle = [np.full(len(each), NORTH) for each in paths]
    users = [
        RoadUser(n, Track(path, turn, 0.0), PEDESTRIAN)
        for n, (path, turn) in enumerate(zip(paths, angle, strict=True), start=1)
    ]
    records = [
        AgentRecord.model_validate({
            "id": n, "type": "pedestrian", "spawn_time": 0.0, "goal": (0.0, 0.0),
            "trajectory": (), "role": "foreground", "name": f"pedestrian-{n}", "entry": "north",
            "exit": "south", "movement": "crossing", "route": "a", "heading": (),
            "length": 0.6, "width": 0.6, "group": None if n == 1 else 1,
        })
        for n in range(1, len(paths) + 1)
    ]  # fmt: skip
    return records, users


@pytest.mark.parametrize("seed", range(10))
def test_a_group_is_as_near_as_the_slow_search_says(seed: int) -> None:
    rng = np.random.default_rng(seed)
    y = distance(1.3, (0.0, 6.0))
    strays = float(rng.choice([0.0, 0.3, 1.4]))
    sway = strays * np.sin(np.linspace(0.0, 3.0, len(y)))
    paths = [
        np.column_stack([np.full(len(y), x) + (sway if k == 2 else 0.0), y + 0.1 * k])
        for k, x in enumerate((0.0, 0.8, float(rng.uniform(1.2, 2.4))))
    ]
    apart = max(
        min(float(np.hypot(*(own[t] - other[t]))) for other in paths if other is not own)
        for own in paths
        for t in range(len(y))
    )
    records, users = stroll(*paths)
    assert bool(check_groups(records, observe(users))) == (apart > 1.5)
    copies = [mirrored(each) for each in users]
    assert bool(check_groups(records, observe(copies))) == (apart > 1.5)


def test_a_member_that_leaves_for_a_moment_or_is_hardly_there_is_found() -> None:
    y = distance(1.3, (0.0, 6.0))
    near, away = (np.column_stack([np.full(len(y), x), y]) for x in (0.0, 0.8))
    gone = away.copy()
    gone[30:34, 0] = 1.8
    assert not check_groups(*_observed(near, away))
    assert check_groups(*_observed(near, gone))
    records, users = stroll(near, away)
    short = RoadUser(2, Track(away[:8], np.full(8, NORTH), 0.0), PEDESTRIAN)
    assert check_groups(records, observe([users[0], short]))
    apart = later(short, 20.0)
    assert check_groups(records, observe([users[0], apart]))


def _observed(*paths: FloatArray) -> tuple[list[AgentRecord], Any]:
    records, users = stroll(*paths)
    return records, observe(users)


# Orders and doors.


@pytest.mark.parametrize("delay", [-0.9, -0.4, 0.5, 1.1])
def test_copies_show_the_same_order(delay: float, copy: Copy) -> None:
    users = [
        line(1, (-40.0, 0.0), EAST, distance(8.0, (0.0, 10.0))),
        line(2, (0.0, -40.0), NORTH, distance(8.0, (0.0, 10.0)), at=max(delay, 0.0)),
    ]
    users[0] = later(users[0], max(-delay, 0.0))
    seen = observe([copy(each) for each in users])
    (event,) = [each for each in seen.events if each.type != "follow"]
    order = find_passing_order(seen, event)
    assert order is not None
    assert order.first == (1 if delay > 0 else 2)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_mirrored_door_is_ridden_into_alike(side: float) -> None:
    """Eastward at 6 m/s into a door 0.4 m ahead of the middle of a parked car, after 4 s."""
    start = 0.4 - 0.06 - 0.9 - 24.0
    rider = line(1, (start, -0.6 * side), EAST, distance(6.0, (0, 4.1)), shape=BICYCLE)
    car = ObjectRecord(
        id="object-1", kind="parked", subtype="car", height="high",
        length=4.6, width=1.85, x=0.0, y=-2.0 * side, heading=0.0,
    )  # fmt: skip
    door = ObjectRecord(
        id="object-1-door", kind="door", height="low", length=0.95, width=0.12, x=0.4,
        y=(-2.0 + 0.925 + 0.02 + 0.475) * side, heading=np.pi / 2 * side, since=3.5,
    )  # fmt: skip
    asked = EncounterRecord(agent=1, object="object-1", how="doored")
    for objects, seen in (((car, door), True), ((car,), False)):
        made = scene([rider], duration=6.0).model_copy(
            update={"objects": objects, "encounters": (asked,)}
        )
        assert (not check_encounters(made, observe([rider]))[1]) == seen
