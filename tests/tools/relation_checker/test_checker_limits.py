"""One pair of scenes either side of every limit of SEMANTICS sections 4 and 5."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from checker_tracks import (
    EAST,
    NORTH,
    SOUTH,
    along,
    bend,
    crossing_walker,
    distance,
    light,
    line,
    list_rules,
    plus_map,
    scene,
    walk,
    yielding_car,
)
from scenewright.scene.base import FloatArray
from scenewright.scene.events import Event
from scenewright.scene.track import Track
from scenewright.tools.relation_checker import (
    RoadUser,
    build_trajectories,
    check,
    compute_pet,
    find_events,
)
from scenewright.tools.relation_checker.events import observe
from scenewright.tools.relation_checker.motions import describe_motion

MAP = plus_map()
ZONE = -8.3
"""Where the zone of a car on y = -1.75 and of the walker on x = -8 begins [m]."""
CLEARED = 3.0 + 5.475 / 1.4
"""When the walker that starts at 3 s has left it [s]."""
ROUND = 0.125
"""By how much the PET is longer than the time between leaving and entering the zone [s]."""


def events(*users: RoadUser, on_map: bool = False) -> list[Event]:
    found = find_events(list(users), intersection_map=MAP if on_map else None)
    return [e for e in found if e.type != "follow"]


def types(*users: RoadUser, on_map: bool = False) -> list[str]:
    return [e.type for e in events(*users, on_map=on_map)]


def stopping(
    gap: float, *after: tuple[float, float], until: float, braking: float = 3.0
) -> RoadUser:
    """East at 10 m/s, stands with its nose `gap` metres before the zone up to a time [s]."""
    slowing = 10.0 / braking
    cruise = (ZONE - gap - 2.3 - 5.0 * slowing + 50.0) / 10.0
    stands = until - cruise - slowing
    s = distance(10.0, (0.0, cruise), (-braking, slowing), (0.0, stands), *after)
    return line(1, (-50.0, -1.75), EAST, s)


def off(gap: float, *, until: float, braking: float = 3.0) -> RoadUser:
    return stopping(gap, (2.0, 4.0), (0.0, 4.0), until=until, braking=braking)


class TestYields:
    @pytest.mark.parametrize(("late", "yields"), [(-0.2, True), (0.2, False)])
    def test_eight_seconds_of_pet(self, late: float, yields: bool) -> None:
        # from 12 m away at 1.5 m/s: 8.5 s after it starts, and the round walker is a little further
        car = stopping(12.0, (1.5, 1.0), (0.0, 16.0), until=CLEARED + 8.0 + late - 8.5 - ROUND)
        walker = crossing_walker()
        pet = compute_pet(*build_trajectories([car, walker]))
        assert pet == pytest.approx(8.0 + late, abs=0.03)
        assert types(car, walker) == ["yielding"] * yields

    @pytest.mark.parametrize(("late", "yields"), [(3.3, True), (3.8, False)])
    def test_resumes_within_four_seconds(self, late: float, yields: bool) -> None:
        # above 1 m/s half a second after it starts
        assert types(off(2.4, until=CLEARED + late), crossing_walker()) == ["yielding"] * yields

    def test_unless_another_bound_agent_holds_it(self) -> None:
        s = distance(0.0, (0.0, 8.0), (7.0, 0.2), (0.0, 6.0))
        waits = walk(3, (-7.0, 3.4), SOUTH, s)
        users = [off(2.4, until=12.6), crossing_walker(), waits]
        asked = (("yielding", 1, 2), ("yielding", 1, 3))
        found = check(scene(users, *asked), MAP).events
        assert {(e.type, e.from_, e.to) for e in found} == {("yielding", 1, 2), ("yielding", 1, 3)}
        alone = check(scene(users, asked[0]), MAP).events
        assert {(e.type, e.from_, e.to) for e in alone} == {("yielding", 1, 3)}

    def test_a_standstill_lasts_half_a_second(self) -> None:
        # below 0.3 m/s for 0.45 s or for 0.65 s; then the place is where it began to stand
        for hold, early in ((0.0, 0.0), (0.2, 0.3)):
            s = distance(
                10.0, (0.0, 2.0), (-3.0, 3.0), (-1.0, 1.0), (0.0, hold), (2.0, 4.0), (0.0, 4.0)
            )
            car = line(1, (ZONE - 3.0 - 2.3 - 37.0, -1.75), EAST, s)
            (event,) = events(car, crossing_walker(at=1.8))
            assert event.type == "yielding"
            assert event.time == pytest.approx(6.0 - early, abs=0.11)

    @pytest.mark.parametrize(("at", "yields"), [(4.1, True), (4.5, False)])
    def test_two_seconds_beside_the_other(self, at: float, yields: bool) -> None:
        # driving on, it would have left the zone at 4.46 s; the walker enters it at `at` + 2.16 s
        assert types(yielding_car(), crossing_walker(at=at)) == ["yielding"] * yields

    @pytest.mark.parametrize(("gap", "yields"), [(19.0, True), (21.5, False)])
    def test_twenty_metres_upstream(self, gap: float, yields: bool) -> None:
        assert types(off(gap, until=8.0), crossing_walker()) == ["yielding"] * yields

    @pytest.mark.parametrize(("speed", "yields"), [(2.1, True), (1.9, False)])
    def test_moving_at_two_metres_a_second(self, speed: float, yields: bool) -> None:
        s = distance(speed, (0.0, 3.0), (-speed, 1.0), (0.0, 4.0), (2.0, 4.0), (0.0, 3.0))
        car = line(1, (ZONE - 2.3 - 2.0 - 3.5 * speed, -1.75), EAST, s)
        assert types(car, crossing_walker(at=1.5)) == ["yielding"] * yields

    @pytest.mark.parametrize(
        ("low", "at", "kind"), [(4.5, 2.0, "yielding"), (5.5, 1.35, "near_miss")]
    )
    def test_half_its_free_speed(self, low: float, at: float, kind: str) -> None:
        # slow 10 m before the zone; it enters a second after the walker left
        slowing = (10.0 - low) / 2.0
        cruise = (ZONE - 2.3 - 10.0 - (10.0 + low) / 2.0 * slowing + 60.0) / 10.0
        s = distance(10.0, (0.0, cruise), (-2.0, slowing), (0.0, 3.0), (2.0, (10.0 - low) / 2.0))
        car = line(1, (-60.0, -1.75), EAST, s)
        assert types(car, crossing_walker(at=at)) == [kind]

    @pytest.mark.parametrize("on_map", [True, False])
    def test_who_is_on_the_crosswalk_already_is_a_cause(self, on_map: bool) -> None:
        s = distance(1.4, (0.0, 0.9), (-7.0, 0.2), (0.0, 5.5), (7.0, 0.2), (0.0, 6.0))
        walker = walk(2, (-8.0, -4.8), NORTH, s)
        assert types(yielding_car(), walker, on_map=on_map) == ["yielding"] * on_map

    @pytest.mark.parametrize(("gap", "yields"), [(0.2, False), (0.4, True)])
    def test_thirty_centimetres_of_clearance(self, gap: float, yields: bool) -> None:
        found = types(off(gap, until=CLEARED + 1.0), crossing_walker())
        assert ("yielding" in found) is yields

    @pytest.mark.parametrize(("pet", "kind"), [(0.4, "near_miss"), (0.65, "yielding")])
    def test_half_a_second_of_pet(self, pet: float, kind: str) -> None:
        # half a metre from the zone: 0.71 s after it starts
        car, walker = off(0.5, until=CLEARED + pet - np.sqrt(0.5) - ROUND), crossing_walker()
        assert compute_pet(*build_trajectories([car, walker])) == pytest.approx(pet, abs=0.03)
        assert types(car, walker) == [kind]

    @pytest.mark.parametrize(("braking", "kind"), [(4.8, "yielding"), (5.3, "near_miss")])
    def test_braking_at_five(self, braking: float, kind: str) -> None:
        car = off(2.4, until=CLEARED, braking=braking)
        assert types(car, crossing_walker()) == [kind]


@pytest.mark.parametrize(
    ("braking", "gap", "found"),
    [(3.3, 2.0, []), (3.6, 2.0, ["near_miss"]), (3.6, 3.5, ["near_miss"]), (3.6, 4.5, [])],
)
def test_near_misses_by_braking_and_path_ttc(braking: float, gap: float, found: list[str]) -> None:
    # behind a car that stands: the least TTC is sqrt(2 gap / braking)
    cruise = (60.0 - 4.6 - gap - 50.0 / braking) / 10.0
    s = distance(10.0, (0.0, cruise), (-braking, 10.0 / braking), (0.0, 3.0))
    users = line(1, (0.0, 0.0), EAST, s), line(2, (60.0, 0.0), EAST, np.zeros(150))
    assert types(*users) == found


class TestCollisions:
    @pytest.mark.parametrize(("faster", "found"), [(0.9, []), (1.1, ["collision"])])
    def test_a_metre_a_second(self, faster: float, found: list[str]) -> None:
        ahead = line(1, (0.0, 0.0), EAST, distance(3.0, (0.0, 12.0)))
        behind = line(2, (-8.0, 0.0), EAST, distance(3.0 + faster, (0.0, 12.0)))
        assert types(ahead, behind) == found

    @pytest.mark.parametrize(("speed", "kind"), [(1.9, None), (2.1, "pedestrian_strike")])
    def test_strikes_at_two_metres_a_second(self, speed: float, kind: str | None) -> None:
        car = line(1, (-20.0, 0.0), EAST, distance(speed, (0.0, 14.0)))
        (event,) = events(car, walk(2, (0.0, 0.0), NORTH, np.zeros(141)))
        assert (event.type, event.kind) == ("collision", kind)

    @pytest.mark.parametrize(("degrees", "kind"), [(138.0, "head_on"), (132.0, "angle")])
    def test_fronts_at_135_degrees(self, degrees: float, kind: str) -> None:
        s, angle = distance(8.0, (0.0, 4.5)), np.deg2rad(degrees)
        one = line(1, (-34.3, 0.0), EAST, s)
        way = np.array((np.cos(angle), np.sin(angle)))
        two = line(2, (0.4 - 34.3 * way[0], -34.3 * way[1]), angle, s)
        assert [e.kind for e in events(one, two)] == [kind]

    @pytest.mark.parametrize(("degrees", "kind"), [(26.0, "sideswipe"), (34.0, "angle")])
    def test_one_direction_is_thirty_degrees(self, degrees: float, kind: str) -> None:
        s = distance(8.0, (0.0, 5.0))
        users = line(1, (0.0, 0.0), EAST, s), line(2, (1.5, 6.0), -np.deg2rad(degrees), s)
        assert [e.kind for e in events(*users)] == [kind]

    @pytest.mark.parametrize(("degrees", "kind"), [(20.0, "head_on"), (30.0, "left_turn")])
    def test_fronts_after_a_turn_of_25_degrees(self, degrees: float, kind: str) -> None:
        turn = np.deg2rad(degrees)
        path = bend((-60.0, 0.0), EAST, 20.0, 30.0, turn, 40.0)
        driven = 20.0 + 30.0 * turn + 10.0
        meets = path[round(driven / 0.05)]
        way = np.array((np.cos(turn), np.sin(turn)))
        start = meets + way * (driven + 4.6)
        other = line(2, tuple(start), turn + np.pi, distance(8.0, (0.0, driven / 8.0 + 0.5)))
        one = along(1, path, distance(8.0, (0.0, driven / 8.0 + 0.5)))
        assert [e.kind for e in events(one, other)] == [kind]


class TestFollowing:
    @pytest.mark.parametrize(("seconds", "found"), [(2.8, False), (3.2, True)])
    def test_three_seconds(self, seconds: float, found: bool) -> None:
        s = distance(8.0, (0.0, seconds))
        users = [line(1, (0.0, 0.0), EAST, s), line(2, (-16.6, 0.0), EAST, s)]
        assert bool(find_events(users)) is found

    @pytest.mark.parametrize(
        ("headway", "found"), [(0.45, False), (0.55, True), (3.9, True), (4.1, False)]
    )
    def test_headways(self, headway: float, found: bool) -> None:
        s = distance(8.0, (0.0, 8.0))
        users = [line(1, (0.0, 0.0), EAST, s), line(2, (-4.6 - 8.0 * headway, 0.0), EAST, s)]
        assert bool(find_events(users)) is found


def car(s: FloatArray, x: float = -70.0) -> RoadUser:
    return line(1, (x, -1.75), EAST, s)


def walker(s: FloatArray) -> RoadUser:
    return walk(1, (-60.0, 5.0), EAST, s)


def turned(user: RoadUser, degrees: float) -> RoadUser:
    track = user.track
    heading = track.heading + np.deg2rad(degrees)
    return RoadUser(user.id, Track(track.xy, heading, track.start), user.shape)


def curve(lateral: float) -> RoadUser:
    path = bend((-60.0, -1.75), EAST, 40.0, 10.0, np.pi / 2, 30.0)
    return along(1, path, distance(np.sqrt(10.0 * lateral), (0.0, 11.0)))


@pytest.mark.parametrize(
    ("within", "beyond", "rule", "subtype"),
    [
        (car(distance(19.9, (0.0, 5.0))), car(distance(20.1, (0.0, 5.0))), "speed", None),
        (
            car(distance(10.0, (0.0, 2.0), (3.9, 1.0), (0.0, 2.0))),
            car(distance(10.0, (0.0, 2.0), (4.2, 1.0), (0.0, 2.0))),
            "acceleration",
            None,
        ),
        (
            car(distance(10.0, (0.0, 2.0), (-7.9, 1.0), (0.0, 2.0))),
            car(distance(10.0, (0.0, 2.0), (-8.2, 1.0), (0.0, 2.0))),
            "braking",
            None,
        ),
        (curve(4.7), curve(5.3), "lateral_acceleration", None),
        (
            turned(car(distance(10.0, (0.0, 5.0))), 18.0),
            turned(car(distance(10.0, (0.0, 5.0))), 22.0),
            "heading",
            None,
        ),
        (walker(distance(2.95, (0.0, 5.0))), walker(distance(3.1, (0.0, 5.0))), "speed", None),
        (
            walker(distance(4.4, (0.0, 5.0))),
            walker(distance(4.6, (0.0, 5.0))),
            "speed",
            "running",
        ),
        (
            walker(distance(0.0, (0.0, 1.0), (2.9, 0.9), (0.0, 2.0))),
            walker(distance(0.0, (0.0, 1.0), (3.2, 0.9), (0.0, 2.0))),
            "acceleration",
            None,
        ),
    ],
    ids=[
        "speed",
        "acceleration",
        "braking",
        "lateral",
        "heading",
        "walking",
        "running",
        "pedestrian",
    ],
)
def test_plausible_motion(
    within: RoadUser, beyond: RoadUser, rule: str, subtype: str | None
) -> None:
    ground = None if rule == "lateral_acceleration" else MAP
    assert list_rules(check(scene([within], subtype=subtype), ground)) == set()
    assert list_rules(check(scene([beyond], subtype=subtype), ground)) == {rule}


@pytest.mark.parametrize(
    ("braking", "seconds", "rest", "broken"),
    [(9.8, 0.8, 0.0, False), (10.3, 0.8, 0.0, True), (9.0, 0.6, 0.7, False), (9.0, 0.6, 1.6, True)],
)
def test_emergency_braking(braking: float, seconds: float, rest: float, broken: bool) -> None:
    # ten at most, and only in the last second and a half
    s = distance(14.0, (0.0, 1.5), (-braking, seconds), (0.0, rest))
    there = walk(2, (-50.0 + s[-1] + 2.3 + 0.3 - 0.1, -1.75), NORTH, np.zeros(len(s)))
    record = scene([car(s, x=-50.0), there], ("collision", 1, 2), movement="jaywalking")
    proof = check(record, MAP)
    assert [e.type for e in proof.events] == ["collision"]
    assert ("braking" in list_rules(proof)) is broken


@pytest.mark.parametrize(("duration", "broken"), [(30.0, set()), (30.2, {"duration"})])
def test_thirty_seconds(duration: float, broken: set[str]) -> None:
    record = scene([car(distance(8.0, (0.0, 5.0)))], duration=duration)
    assert list_rules(check(record, MAP)) == broken


class TestTargets:
    @pytest.mark.parametrize(("more", "verified"), [(0.14, True), (0.16, False)])
    @pytest.mark.parametrize("sign", [-1.0, 1.0])
    def test_pet(self, more: float, sign: float, verified: bool) -> None:
        s = distance(10.0, (0.0, 10.0))
        users = [line(1, (-50.0, 0.0), EAST, s), line(2, (0.0, -66.0), NORTH, s)]
        pet = compute_pet(*build_trajectories(users)) or 0.0
        asked = ("near_miss", 1, 2, {"target_pet": pet + sign * more})
        assert check(scene(users, asked), MAP).verified is verified

    @pytest.mark.parametrize(("more", "verified"), [(0.28, True), (0.32, False)])
    @pytest.mark.parametrize("sign", [-1.0, 1.0])
    def test_path_ttc(self, more: float, sign: float, verified: bool) -> None:
        s = distance(10.0, (0.0, 2.0), (-4.0, 2.5), (0.0, 3.0))
        users = [car(s, x=-60.0), line(2, (-60.0 + s[-1] + 4.6 + 2.0, -1.75), EAST, np.zeros(76))]
        (event,) = events(*users)
        ttc = event.evidence["path_ttc"]
        assert ttc == pytest.approx(1.0, abs=0.1)
        asked = ("near_miss", 1, 2, {"target_ttc": ttc + sign * more})
        assert check(scene(users, asked), MAP).verified is verified

    @pytest.mark.parametrize(("more", "verified"), [(0.45, True), (0.55, False)])
    @pytest.mark.parametrize("sign", [-1.0, 1.0])
    def test_impact_speed(self, more: float, sign: float, verified: bool) -> None:
        one = car(distance(8.0, (0.0, 5.0)), x=-50.0)
        there = walk(2, (-8.0, -1.75), NORTH, np.zeros(51))
        asked = ("collision", 1, 2, {"impact_speed": 8.0 + sign * more})
        record = scene([one, there], asked, movement="jaywalking")
        assert check(record, MAP).verified is verified


@pytest.mark.parametrize(
    ("turns", "late", "seen"),
    [(3.0, 0.0, True), (3.0, 4.0, False), (4.3, 0.0, False), (1.0, 0.0, False)],
)
def test_who_passes_on_yellow_does_so_while_it_lasts(turns: float, late: float, seen: bool) -> None:
    """The front passes the line at 4.46 s; forgeries come later, as it turns, or on red."""
    over = turns + 3.0
    plan = (light("green", 0.0, turns), light("yellow", turns, over), light("red", over, 30.0))
    one = car(distance(8.0, (0.0, 8.0)), x=-50.0)
    moved = replace(one, track=replace(one.track, start=late))
    observed = observe([moved], intersection_map=MAP, signals=plan)
    found = describe_motion("passes_yellow", observed.tracks[0], observed, MAP)
    assert (found is not None) == seen


@pytest.mark.parametrize(("since", "broken"), [(0.06, set()), (0.2, {"red_crossing"})])
def test_a_tenth_of_a_second_of_red(since: float, broken: set[str]) -> None:
    turns = (38.0 - 2.3) / 8.0 - since
    plan = (light("yellow", 0.0, turns), light("red", turns, 30.0))
    record = scene([car(distance(8.0, (0.0, 8.0)), x=-50.0)], signals=plan)
    assert list_rules(check(record, MAP)) == broken
