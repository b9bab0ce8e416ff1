"""Scenes that only look verified: plans, labels and ends that were tampered with."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest

from checker_tracks import (
    CAR,
    EAST,
    NORTH,
    WEST,
    agent,
    box,
    crossing_walker,
    distance,
    later,
    light,
    line,
    list_rules,
    plus_map,
    scene,
    walk,
    yielding_car,
)
from scenewright.scene.map_elements import (
    GoalRegion,
    Route,
    SignalGroup,
    SignalPhase,
    SignalProgram,
    VehicleMovement,
)
from scenewright.scene.record import EventRecord, SceneRecord, SignalRecord
from scenewright.scene.track import Track
from scenewright.tools.relation_checker import RoadUser, check, find_events

MAP = plus_map()


def cut(user: RoadUser, seconds: float) -> RoadUser:
    """The track up to a time [s]."""
    n = round((seconds - user.track.start) / 0.1) + 1
    track = Track(user.track.xy[:n], user.track.heading[:n], user.track.start)
    return RoadUser(user.id, track, user.shape)


class TestTheEndOfTheScene:
    def test_a_giver_that_vanishes_long_before_gives_way_to_nobody(self) -> None:
        for seconds in (6.4, 7.9):
            users = [cut(yielding_car(), seconds), crossing_walker()]
            proof = check(scene(users, ("yielding", 1, 2)), MAP)
            assert "relation_not_realised" in list_rules(proof)
            ends = scene([cut(u, seconds) for u in users], ("yielding", 1, 2), duration=seconds)
            assert check(ends, MAP).verified is (seconds > 7.0)  # by then the walker is across

    @pytest.mark.parametrize("background", [(), (2,)])
    def test_who_waits_when_the_scene_ends_gives_way_unasked(
        self, background: tuple[int, ...]
    ) -> None:
        users = [cut(yielding_car(), 7.9), cut(crossing_walker(), 8.0)]
        proof = check(scene(users, background=background, duration=8.0), MAP)
        assert list_rules(proof) == {"unasked_yielding"}
        proof = check(scene(users, background=(1, 2), duration=8.0), MAP)
        assert proof.verified
        assert [e.type for e in proof.incidental] == ["yielding"]

    def test_so_it_does_when_a_recording_ends(self) -> None:
        users = [cut(yielding_car(), 7.9), cut(crossing_walker(), 8.0)]
        (event,) = find_events(users)
        assert (event.type, event.from_, event.to) == ("yielding", 1, 2)
        assert find_events(users, until=30.0) == ()

    def test_who_stands_since_long_or_for_what_is_behind_waits_for_nobody(self) -> None:
        car = line(1, (-50.0, -1.75), EAST, distance(10.0, (0.0, 61 / 30), (-3.0, 10 / 3)))
        for walker in (later(crossing_walker(), -8.0), walk(2, (-35.0, -6.0), NORTH, np.zeros(1))):
            assert find_events([car, walker]) == ()


@cache  # what the checker prepares is kept by map
def lit_map() -> Any:
    """The plus with a programme for its stop line and its crosswalk."""
    movement = VehicleMovement(
        id="m", entry="west", exit="east", turn="straight", lanelets=(), stop_line="west:stop",
        centreline=(), signal_group="cars",
    )  # fmt: skip
    groups = (
        SignalGroup(id="cars", movements=("m",)),
        SignalGroup(id="walkers", crosswalks=("west:crosswalk",)),
    )
    phases = (
        SignalPhase(duration=20.0, colours={"cars": "green", "walkers": "red"}),
        SignalPhase(duration=25.0, colours={"cars": "red", "walkers": "green"}),
    )
    program = SignalProgram(groups=groups, phases=phases)
    return MAP.model_copy(update={"signals": program, "movements": (movement,)})


WALK = (light("green", 0.0, 12.0, crosswalk=True), light("red", 12.0, 30.0, crosswalk=True))
RED, GREEN = light("red", 0.0, 12.0), light("green", 12.0, 30.0)
NAN = RED.model_copy(update={"start": float("nan")})


@pytest.mark.parametrize(
    "plan",
    [
        WALK,
        (RED, GREEN),
        (RED.model_copy(update={"end": 10.0}), *WALK, GREEN),
        (light("red", 0.0, 3.0), light("red", 6.0, 12.0), GREEN, *WALK),
        (RED, light("green", 12.0, 29.0), *WALK),
        (light("green", 100.0, 100.1), *WALK),
        (RED.model_copy(update={"stop_line": "nowhere"}),),
        (RED, GREEN, RED.model_copy(update={"stop_line": "nowhere"}), *WALK),
        (RED, GREEN, RED.model_copy(update={"crosswalk": "west:crosswalk"}), *WALK),
        (NAN, RED, GREEN, *WALK),
        (RED.model_copy(update={"stop_line": None}), RED, GREEN, *WALK),
        (RED, RED, GREEN, *WALK),
        (light("green", 0.0, 12.0), RED, GREEN, *WALK),
        (*(light("green", k * 0.3, k * 0.3 + 0.3) for k in range(40)), GREEN, *WALK),
        (light("red", 0.0, 4.5), light("green", 4.5, 4.8), light("red", 4.8, 12.0), GREEN, *WALK),
    ],
    ids=[
        "left-out", "crosswalk-out", "cut", "hole", "early-end",
        "far", "unknown", "unknown-too", "both", "nan", "neither", "same-twice",
        "twice", "chopped", "flash",
    ],
)  # fmt: skip
def test_an_incomplete_plan_hides_no_red_runner(plan: tuple[SignalRecord, ...]) -> None:
    ground = lit_map()
    runner = line(1, (-50.0, -1.75), EAST, distance(8.0, (0.0, 8.0)))
    assert check(scene([], signals=(RED, GREEN, *WALK)), ground).verified
    honest = check(scene([runner], signals=(RED, GREEN, *WALK)), ground)
    assert list_rules(honest) == {"red_crossing"}
    assert "signal_plan" in list_rules(check(scene([runner], signals=plan), ground))


def collision_scene() -> SceneRecord:
    car = line(1, (-50.0, -1.75), EAST, distance(8.0, (0.0, 5.0)))
    other = line(2, (-7.0, -1.75 - 8.0 * 4.9), NORTH, distance(8.0, (0.0, 5.0)))
    yields = (later(yielding_car(3), 8.0), later(crossing_walker(4), 8.0))
    return scene([car, other], ("collision", 1, 2), movement="straight").model_copy(
        update={"agents": tuple(agent(u) for u in (car, other, *yields)[:2])}
    )


def labelled(record: SceneRecord, *changes: dict[str, Any] | None) -> SceneRecord:
    """With the events of its proof as rows; None leaves a row out."""
    events = check(record).events
    rows = [
        EventRecord.model_validate(
            e.model_dump(by_alias=True, include=set(EventRecord.model_fields)) | change
        )
        for e, change in zip(events, changes, strict=True)
        if change is not None
    ]
    return record.model_copy(update={"events": tuple(rows)})


class TestLabels:
    @pytest.mark.parametrize(
        ("change", "verified"),
        [
            ({}, True),
            ({"time": 4.9}, True),
            ({"kind": "head_on"}, False),
            ({"kind": None}, False),
            ({"cause": "late_brake"}, False),
            ({"from": 2, "to": 1}, False),
            ({"type": "near_miss"}, False),
            ({"time": None}, False),
            ({"time": 5.4}, False),
            ({"location": (-7.0, 3.0)}, False),
        ],
    )
    def test_of_a_collision(self, change: dict[str, Any], verified: bool) -> None:
        record = collision_scene()
        assert check(record).verified
        assert check(labelled(record, change)).verified is verified

    def test_a_symmetric_event_may_be_told_as_it_was_asked_for(self) -> None:
        record = collision_scene()
        asked = record.relations[0].model_copy(update={"from_": 2, "to": 1})
        record = record.model_copy(update={"relations": (asked,)})
        assert check(labelled(record, {"from": 2, "to": 1})).verified

    def test_every_event_has_its_row(self) -> None:
        normal = EventRecord.model_validate(
            {"type": "normal", "from": None, "to": None, "time": None, "location": None}
        )
        record = collision_scene()
        (row,) = labelled(record, {}).events
        for rows, told in (
            ((normal,), {"label_contradicted", "label_missing"}),
            ((row, row), {"label_contradicted"}),
            ((row, normal), {"label_contradicted"}),
        ):
            assert list_rules(check(record.model_copy(update={"events": rows}))) == told
        near = crossing_walker(4)
        two = [yielding_car(3), near, *(line(5, (30.0, 1.0), WEST, np.zeros(1)),)]
        both = scene(two, ("yielding", 3, 4))
        assert check(labelled(both, {})).verified
        assert list_rules(check(both.model_copy(update={"events": (normal,)}))) == {
            "label_contradicted", "label_missing",
        }  # fmt: skip
        empty = scene([yielding_car()]).model_copy(update={"events": (normal,)})
        assert check(empty).verified


@cache  # what the checker prepares is kept by map
def routed_map() -> Any:
    routes = (
        Route(id="through", type="vehicle", entry="west", exit="east", movement="straight",
              movement_id="m"),
        Route(id="back", type="vehicle", entry="east", exit="west", movement="straight"),
        Route(id="kerb", type="pedestrian", entry="west", exit="east", movement="crossing",
              crosswalk="south"),
    )  # fmt: skip
    goals = (
        GoalRegion(id="e", type="vehicle", leg="east", polygon=box(90.0, -3.5, 100.0, 0.0)),
        GoalRegion(id="w", type="vehicle", leg="west", polygon=box(-100.0, 0.0, -90.0, 3.5)),
        GoalRegion(id="k", type="pedestrian", leg="west", polygon=box(-90.0, -9.0, -80.0, -3.5)),
    )
    return MAP.model_copy(update={"routes": routes, "goal_regions": goals})


class TestJourneys:
    ROUTE: dict[str, Any] = {"route": "through", "goal": (95.0, -1.75)}  # noqa: RUF012

    @pytest.mark.parametrize(
        ("change", "verified"),
        [
            ({}, True),
            ({"goal": (0.0, 0.0)}, False),
            ({"movement": "left"}, False),
            ({"entry": "east"}, False),
            ({"exit": "north"}, False),
            ({"route": "nowhere"}, False),
            ({"route": "back", "entry": "east", "exit": "west", "goal": (-95.0, 1.75)}, False),
        ],
    )
    def test_labels_are_those_of_the_route_and_of_the_track(
        self, change: dict[str, Any], verified: bool
    ) -> None:
        car = line(1, (-50.0, -1.75), EAST, distance(10.0, (0.0, 10.0)))
        record = scene([car], duration=10.0, **{**self.ROUTE, **change})
        proof = check(record, routed_map())
        assert list_rules(proof) == (set() if verified else {"journey_contradicted"})

    @pytest.mark.parametrize(("angle", "verified"), [(EAST, True), (WEST, False)])
    def test_who_walks_backwards(self, angle: float, verified: bool) -> None:
        walker = walk(1, (-40.0, -6.0), angle, distance(1.4, (0.0, 10.0)))
        record = scene(
            [walker], duration=10.0, route="kerb", movement="crossing", crosswalk="south",
            goal=(-85.0, -6.0),
        )  # fmt: skip
        proof = check(record, routed_map())
        assert list_rules(proof) == (set() if verified else {"journey_contradicted"})

    @pytest.mark.parametrize(("duration", "verified"), [(4.1, True), (4.4, False)])
    def test_nobody_vanishes_in_the_middle(self, duration: float, verified: bool) -> None:
        car = line(1, (-50.0, -1.75), EAST, distance(10.0, (0.0, 4.0)))
        proof = check(scene([car], duration=duration, **self.ROUTE), routed_map())
        assert list_rules(proof) == (set() if verified else {"vanishes"})

    @pytest.mark.parametrize(("y", "told"), [(-8.0, set()), (0.0, {"journey_contradicted"})])
    def test_a_jaywalker_is_bound_for_a_place_beside_the_road(
        self, y: float, told: set[str]
    ) -> None:
        route = Route(id="mid", type="pedestrian", entry="south", exit="north",
                      movement="jaywalking", crosswalk="west")  # fmt: skip
        ground = routed_map().model_copy(update={"routes": (route,)})
        walker = walk(1, (-40.0, -6.0), NORTH, distance(1.4, (0.0, 8.0)))
        record = scene([walker], duration=8.0, route="mid", movement="jaywalking", entry="south",
                       exit="north", crosswalk="west", goal=(-40.0, y))  # fmt: skip
        assert list_rules(check(record, ground)) == told

    @pytest.mark.parametrize(("seconds", "told"), [(5.0, {"vanishes"}), (8.0, set())])
    def test_who_walks_may_end_beside_the_road_but_not_on_it(
        self, seconds: float, told: set[str]
    ) -> None:
        walker = walk(1, (-8.0, -6.0), NORTH, distance(1.4, (0.0, seconds)))
        ground = routed_map().model_copy(update={"routes": ()})
        assert list_rules(check(scene([walker]), ground)) == told

    def test_but_who_reaches_a_goal_or_collides_may_end(self) -> None:
        arrives = line(1, (50.0, -1.75), EAST, distance(10.0, (0.0, 4.0)))
        assert check(scene([arrives], **self.ROUTE), routed_map()).verified
        record = collision_scene()
        assert "vanishes" not in list_rules(check(record, routed_map()))


@pytest.mark.parametrize(
    ("subtype", "length", "width", "usual"),
    [
        ("car", 4.6, 1.85, True),
        ("car", 3.4, 1.6, True),
        ("car", 1.6, 0.5, False),
        ("bus", 4.6, 1.85, False),
        ("motorcycle", 2.2, 0.9, True),
        (None, 8.5, 2.5, True),
        (None, 1.2, 0.5, False),
    ],
)
def test_the_size_is_that_of_the_subtype(
    subtype: str | None, length: float, width: float, usual: bool
) -> None:
    car = line(1, (-50.0, -1.75), EAST, distance(8.0, (0.0, 4.0)))
    proof = check(scene([car], subtype=subtype, length=length, width=width), MAP)
    assert list_rules(proof) == (set() if usual else {"size"})


class TestTimesOffTheGrid:
    @pytest.mark.parametrize("shift", [0.02, 0.037, 0.05, 0.08, 0.15])
    def test_all_tracks_shifted_by_one_time(self, shift: float) -> None:
        s = distance(10.0, (0.0, 4.7))
        crash = [line(1, (-50.0, 0.0), EAST, s), line(2, (0.0, -50.0), NORTH, s)]
        for users in (crash, [yielding_car(), crossing_walker()]):
            plain, moved = find_events(users), find_events([later(u, shift) for u in users])
            for one, two in zip(plain, moved, strict=True):
                assert two.time == pytest.approx(one.time + shift, abs=2e-3)
                assert (two.type, two.kind, two.cause) == (one.type, one.kind, one.cause)
                assert two.evidence.keys() == one.evidence.keys()

    @pytest.mark.parametrize("shift", [0.03, 0.05, 0.07])
    def test_one_track_between_the_times_of_the_others_keeps_its_ends(self, shift: float) -> None:
        # fronts meet the side at 4.6775 s; the track of one ends right after
        s = distance(10.0, (0.0, 4.7))
        one = line(1, (-50.0 + 10.0 * shift, 0.0), EAST, s, at=shift)
        others = [line(2, (0.0, -50.0), NORTH, s), line(3, (40.0, 40.0), EAST, np.zeros(50))]
        (event,) = find_events([one, *others])
        assert (event.type, event.cause) == ("collision", None)
        assert event.time == pytest.approx(4.6775, abs=0.01)


@pytest.mark.parametrize(
    ("phases", "rule"),
    [
        (((0.0, 3.0), (-12.0, 0.3)), "braking"),
        (((-12.0, 0.3), (0.0, 3.0)), "braking"),
        (((0.0, 3.0), (-7.5, 0.3)), None),
        (((0.0, 3.0), (6.0, 0.3)), "acceleration"),
    ],
)
def test_the_ends_of_a_track_are_looked_at(
    phases: tuple[tuple[float, float], ...], rule: str | None
) -> None:
    car = line(1, (-50.0, -1.75), EAST, distance(10.0, *phases))
    assert list_rules(check(scene([car]), MAP)) == ({rule} if rule else set())


class TestRedLights:
    RED = (light("red", 0.0, 30.0), light("red", 0.0, 30.0, crosswalk=True))

    @pytest.mark.parametrize("y", [-1.75, 0.7, 2.5])
    def test_the_other_half_of_the_road_is_no_way_round(self, y: float) -> None:
        car = line(1, (-50.0, y), EAST, distance(8.0, (0.0, 8.0)))
        assert "red_crossing" in list_rules(check(scene([car], signals=self.RED), MAP))

    def test_who_leaves_the_junction_there_is_free(self) -> None:
        for angle, start in ((WEST, 50.0), (WEST - 0.05, 50.0)):
            car = line(1, (start, 1.75), angle, distance(8.0, (0.0, 7.0)))
            assert "red_crossing" not in list_rules(check(scene([car], signals=self.RED), MAP))

    def test_who_begins_on_the_crosswalk(self) -> None:
        walker = walk(1, (-8.0, -3.3), NORTH, distance(1.4, (0.0, 6.0)))
        assert list_rules(check(scene([walker], signals=self.RED), MAP)) == {"red_crossing"}
        plan = (light("green", 0.0, 1.0, crosswalk=True), light("red", 1.0, 30.0, crosswalk=True))
        assert check(scene([walker], signals=plan), MAP).verified


def test_who_reverses_into_a_stander_strikes_it() -> None:
    back = line(1, (0.0, 0.0), EAST, -distance(3.0, (0.0, 6.0)))
    stands = line(2, (-14.0, 0.0), EAST, np.zeros(61), shape=CAR)
    (event,) = [e for e in find_events([back, stands]) if e.type == "collision"]
    assert (event.from_, event.to) == (1, 2)
