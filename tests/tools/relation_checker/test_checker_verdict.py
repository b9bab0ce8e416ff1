"""`check` on whole scenes: relations, certificate, plausibility, signals, wrecks, bad input."""

from __future__ import annotations

import numpy as np
import pytest

from checker_tracks import (
    CAR,
    EAST,
    NORTH,
    SOUTH,
    WEST,
    agent,
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
from scenewright.errors import InputError
from scenewright.scene.base import FloatArray
from scenewright.scene.map_elements import SignalGroup, SignalPhase, SignalProgram, VehicleMovement
from scenewright.scene.record import EventRecord, SceneRecord
from scenewright.scene.track import Track
from scenewright.tools.relation_checker import RoadUser, build_trajectory, check
from scenewright.tools.relation_checker.legs import find_entry_leg

MAP = plus_map()


def shaken(
    user: RoadUser, *, xy: FloatArray | None = None, heading: FloatArray | None = None
) -> RoadUser:
    track = user.track
    new = Track(
        track.xy if xy is None else xy, track.heading if heading is None else heading, track.start
    )
    return RoadUser(user.id, new, user.shape)


def yield_scene(*relations: tuple[object, ...]) -> SceneRecord:
    return scene([yielding_car(), crossing_walker()], *relations)


def test_a_yield_asked_for_and_observed_is_verified() -> None:
    proof = check(yield_scene(("yielding", 1, 2)), MAP)
    assert list_rules(proof) == set()
    assert proof.verified
    assert [e.type for e in proof.events] == ["yielding"]


def test_roles_matter_for_yielding() -> None:
    proof = check(yield_scene(("yielding", 2, 1)), MAP)
    assert not proof.verified
    assert list_rules(proof) == {"relation_not_realised", "unasked_yielding"}


def test_a_yield_nobody_asked_for_breaks_a_normal_scene() -> None:
    assert list_rules(check(yield_scene(), MAP)) == {"unasked_yielding"}


def test_background_agents_may_yield_to_one_another() -> None:
    users = [yielding_car(), crossing_walker()]
    proof = check(scene(users, background=(1, 2)), MAP)
    assert proof.verified
    assert [e.type for e in proof.incidental] == ["yielding"]


@pytest.mark.parametrize(
    ("cause", "agent", "told"),
    [
        ("late_brake", 1, None),
        ("red_light_run", 1, None),
        ("late_brake", 2, "late_brake by 1 observed, by 2 asked for"),
    ],
)
def test_late_braking_counts_beside_a_red_light_that_was_run(
    cause: str, agent: int, told: str | None
) -> None:
    s = distance(10.0, (0.0, 2.7), (-6.5, 10 / 6.5), (0.0, 4.0), (2.0, 4.0), (0.0, 5.0))
    users = [line(1, (-47.0, -1.75), EAST, s), crossing_walker(at=1.5)]
    asked = ("near_miss", 1, 2, {"cause": cause, "cause_agent": agent})
    proof = check(scene(users, asked, signals=(light("red", 0.0, 30.0),)), MAP)
    assert (proof.events[0].type, proof.events[0].cause) == ("near_miss", "red_light_run")
    details = [each.detail for each in proof.missing]
    assert len(details) == (told is not None)
    assert told is None or told in details[0]


def collided(impact_speed: float | None = None, kind: str = "pedestrian_strike") -> SceneRecord:
    # the front, at x = -47.7 + 8 t, reaches the disc at x = -8.3 after 4.925 s
    car = line(1, (-50.0, -1.75), EAST, distance(8.0, (0.0, 5.0)))
    walker = walk(2, (-8.0, -1.75 - 1.4 * 5.0), NORTH, distance(1.4, (0.0, 5.0)))
    return scene([car, walker], ("collision", 1, 2, {"kind": kind, "impact_speed": impact_speed}))


def test_a_collision_of_any_kind_is_verified_in_either_order_a_strike_only_in_its_own() -> None:
    proof = check(collided(8.4), MAP)
    assert list_rules(proof) == set()
    assert proof.events[0].time == pytest.approx(39.4 / 8, abs=0.03)
    turned = {"from_": 2, "to": 1}
    for kind, told in ((None, set()), ("pedestrian_strike", {"relation_not_realised"})):
        record = collided(8.4)
        relation = record.relations[0].model_copy(update={**turned, "kind": kind})
        found = list_rules(check(record.model_copy(update={"relations": (relation,)}), MAP))
        assert found - {"unasked_collision"} == told


def test_kind_and_impact_speed_must_be_as_asked_for() -> None:
    assert "relation_not_realised" in list_rules(check(collided(9.2), MAP))
    assert "relation_not_realised" in list_rules(check(collided(kind="angle"), MAP))


@pytest.mark.parametrize(
    ("across", "point", "asked_and_true"),
    [
        (0.0, "front", {"front"}),
        (0.8, "front_left", {"front", "front_left"}),
        (-0.8, "front_right", {"front", "front_right"}),
    ],
)
def test_a_collision_must_be_where_it_was_asked_for(
    across: float, point: str, asked_and_true: set[str]
) -> None:
    # the walker stands so far to the left of the car's middle
    car = line(1, (-50.0, -1.75), EAST, distance(8.0, (0.0, 5.0)))
    walker = walk(2, (-8.0, -1.75 + across), NORTH, distance(0.0, (0.0, 5.0)))
    for asked in ("front", "front_left", "front_right", "side", "rear"):
        proof = check(scene([car, walker], ("collision", 1, 2, {"point_from": asked})), MAP)
        assert proof.events[0].evidence["point_from"] == point
        assert "point_to" not in proof.events[0].evidence
        assert ("relation_not_realised" in list_rules(proof)) == (asked not in asked_and_true)


@pytest.mark.parametrize(("target", "verified"), [(1.0, True), (1.3, False)])
def test_target_pet(target: float, verified: bool) -> None:
    # PET = (60.65 - 50) / 10 - 0.645 ... both at 10 m/s, centres 1.6 s apart: 0.955 s
    s = distance(10.0, (0.0, 10.0))
    users = [line(1, (-50.0, 0.0), EAST, s), line(2, (0.0, -66.0), NORTH, s)]
    proof = check(scene(users, ("near_miss", 2, 1, {"target_pet": target})), MAP)
    assert proof.verified is verified


class TestCertificate:
    def test_foreground_pet_above_one_and_a_half_seconds(self) -> None:
        s = distance(10.0, (0.0, 10.0))
        one = line(1, (-50.0, 0.0), EAST, s)
        for metres, background, verified in (
            (70.0, (), False), (72.5, (), True), (70.0, (1, 2), True), (64.0, (1, 2), False),
        ):  # fmt: skip
            two = line(2, (0.0, -metres), NORTH, s)
            assert check(scene([one, two], background=background), MAP).verified is verified

    def test_half_a_metre_of_clearance(self) -> None:
        s = distance(10.0, (0.0, 8.0))
        for y, verified in ((2.3, False), (2.4, True)):
            users = [line(1, (-50.0, 0.0), EAST, s), line(2, (50.0, y), WEST, s)]
            proof = check(scene(users, background=(1, 2)), MAP)
            assert proof.verified is verified

    def test_queueing_is_fine_but_not_bumper_to_bumper(self) -> None:
        s = distance(8.0, (0.0, 2.0), (-2.0, 4.0), (0.0, 5.0))
        ahead = line(1, (-40.0, -1.75), EAST, s)
        for metres, broken in ((6.3, set()), (5.2, {"standing_gap"})):
            late = distance(8.0, (0.0, 2.0), (-2.0, 4.0), (0.0, 5.0))
            behind = line(2, (-40.0 - 8.0 - metres, -1.75), EAST,
                          distance(8.0, (0.0, 3.0), (-2.0, 4.0), (0.0, 4.0)))  # fmt: skip
            assert len(late) == len(s)
            found = list_rules(check(scene([ahead, behind]), MAP))
            assert found - {"headway"} == broken

    def test_driving_too_close_behind(self) -> None:
        s = distance(10.0, (0.0, 5.0))
        users = [line(1, (-40.0, -1.75), EAST, s), line(2, (-52.0, -1.75), EAST, s)]
        assert list_rules(check(scene(users), MAP)) == {"headway"}

    def test_overlap_at_spawn(self) -> None:
        s = distance(8.0, (0.0, 5.0))
        users = [line(1, (0.0, 0.0), EAST, s), line(2, (2.0, 0.5), EAST, s)]
        for relation in ((), (("collision", 1, 2),)):
            proof = check(scene(users, *relation), MAP)
            assert "contact" in list_rules(proof)

    def test_a_follow_nobody_asked_for_is_reported_only(self) -> None:
        s = distance(8.0, (0.0, 8.0))
        users = [line(1, (-40.0, -1.75), EAST, s), line(2, (-56.0, -1.75), EAST, s)]
        proof = check(scene(users), MAP)
        assert proof.verified
        assert [e.type for e in proof.incidental] == ["follow"]
        assert check(scene(users, ("follow", 2, 1)), MAP).verified
        assert not check(scene(users, ("follow", 1, 2)), MAP).verified


class TestWreck:
    def test_tracks_end_within_a_fifth_of_a_second(self) -> None:
        s = distance(8.0, (0.0, 5.5))
        car = line(1, (-50.0, -1.75), EAST, s)
        walker = walk(2, (-8.0, -1.75 - 1.4 * 5.0), NORTH, distance(1.4, (0.0, 5.0)))
        proof = check(scene([car, walker], ("collision", 1, 2)), MAP)
        assert list_rules(proof) == {"wreck_drives_on"}

    def test_everyone_else_keeps_clear_of_it(self) -> None:
        late = line(3, (60.0, -1.0), WEST, distance(8.0, (0.0, 14.0)), at=6.0)
        record = collided()
        users = (*record.agents, agent(late, background=True))
        proof = check(record.model_copy(update={"agents": users}), MAP)
        assert "wreck_clearance" in list_rules(proof)


class TestPlausibility:
    @pytest.mark.parametrize(
        ("phases", "rule"),
        [
            (((0.0, 2.0), (5.0, 1.0), (0.0, 2.0)), "acceleration"),
            (((0.0, 2.0), (-9.0, 1.0), (0.0, 2.0)), "braking"),
            (((0.0, 2.0), (4.0, 2.6), (0.0, 1.0)), "speed"),
            (((0.0, 2.0), (-7.5, 1.0), (0.0, 2.0)), None),
        ],
    )
    def test_limits_along_the_path(
        self, phases: tuple[tuple[float, float], ...], rule: str | None
    ) -> None:
        car = line(1, (-50.0, -1.75), EAST, distance(10.0, *phases))
        assert list_rules(check(scene([car]), MAP)) == ({rule} if rule else set())

    def test_emergency_braking_before_a_collision(self) -> None:
        # 9 m/s^2 for the last 0.8 s
        car = line(1, (-50.0, -1.75), EAST, distance(12.0, (0.0, 2.5), (-9.0, 1.0)))
        front = -50.0 + 30.0 + 12.0 * 0.9 - 4.5 * 0.81 + 2.3
        walker = walk(2, (front + 0.3, -1.75 - 1.4 * 3.4), NORTH, distance(1.4, (0.0, 3.5)))
        record = scene([car, walker], ("collision", 1, 2), movement="jaywalking")
        assert "braking" not in list_rules(check(record, MAP))

    def test_teleport(self) -> None:
        car = line(1, (-50.0, -1.75), EAST, distance(5.0, (0.0, 6.0)))
        xy = car.track.xy + np.where(np.arange(61) < 30, 0.0, 1.2)[:, None] * np.array((1.0, 0.0))
        assert "step_length" in list_rules(check(scene([shaken(car, xy=xy)]), MAP))

    def test_heading_flip(self) -> None:
        car = line(1, (-50.0, -1.75), EAST, distance(5.0, (0.0, 6.0)))
        flipped = np.where(np.arange(61) < 30, 0.0, np.pi)
        assert "heading" in list_rules(check(scene([shaken(car, heading=flipped)]), MAP))
        parked = line(1, (-50.0, -1.75), EAST, np.zeros(61))
        assert "heading_held" in list_rules(check(scene([shaken(parked, heading=flipped)]), MAP))

    def test_off_the_road_and_off_the_pavement(self) -> None:
        astray = line(1, (-50.0, 9.0), EAST, distance(8.0, (0.0, 4.0)))
        assert list_rules(check(scene([astray]), MAP)) == {"off_road"}
        jaywalker = walk(1, (-40.0, -6.0), NORTH, distance(1.4, (0.0, 8.0)))
        assert list_rules(check(scene([jaywalker]), MAP)) == {"off_walkable"}
        assert check(scene([jaywalker], movement="jaywalking"), MAP).verified


class TestSignals:
    RED = (light("red", 0.0, 30.0), light("red", 0.0, 30.0, crosswalk=True))

    def test_red_crossings(self) -> None:
        car = line(1, (-50.0, -1.75), EAST, distance(8.0, (0.0, 8.0)))
        walker = walk(1, (-8.0, -6.0), NORTH, distance(1.4, (0.0, 8.0)))
        for user in (car, walker):
            assert list_rules(check(scene([user], signals=self.RED), MAP)) == {"red_crossing"}
            assert check(scene([user], signals=self.RED, violates_signal=True), MAP).verified

    def test_leaving_the_junction_crosses_no_stop_line(self) -> None:
        car = line(1, (50.0, 1.75), WEST, distance(8.0, (0.0, 12.0)))
        assert check(scene([car], signals=self.RED), MAP).verified

    def test_yellow_and_green_may_be_crossed(self) -> None:
        car = line(1, (-50.0, -1.75), EAST, distance(8.0, (0.0, 8.0)))
        plan = (light("green", 0.0, 4.0), light("yellow", 4.0, 7.0), light("red", 7.0, 30.0))
        assert check(scene([car], signals=plan), MAP).verified


def test_the_plan_must_be_the_programme_of_the_map() -> None:
    movement = VehicleMovement(
        id="m", entry="west", exit="east", turn="straight", lanelets=(), stop_line="west:stop",
        centreline=(), signal_group="g",
    )  # fmt: skip
    phases = (
        SignalPhase(duration=20.0, colours={"g": "green"}),
        SignalPhase(duration=25.0, colours={"g": "red"}),
    )
    program = SignalProgram(groups=(SignalGroup(id="g", movements=("m",)),), phases=phases)
    ground = MAP.model_copy(update={"signals": program, "movements": (movement,)})
    honest = (light("red", 0.0, 12.0), light("green", 12.0, 30.0))
    forged = (light("green", 0.0, 12.0), light("red", 12.0, 14.0), light("green", 14.0, 30.0))
    assert list_rules(check(scene([], signals=honest), ground)) == set()
    assert list_rules(check(scene([], signals=forged), ground)) == {"signal_plan"}
    assert list_rules(check(scene([]), ground)) == {"no_signal_plan"}


def test_labels_give_no_licence_to_the_background() -> None:
    walker = walk(1, (-40.0, -6.0), NORTH, distance(1.4, (0.0, 8.0)))
    record = scene([walker], background=(1,), movement="jaywalking")
    assert list_rules(check(record, MAP)) == {"off_walkable"}
    car = line(1, (-50.0, -1.75), EAST, distance(8.0, (0.0, 8.0)))
    record = scene([car], background=(1,), signals=TestSignals.RED, violates_signal=True)
    assert list_rules(check(record, MAP)) == {"red_crossing"}


def test_a_shrunken_footprint_is_found_out() -> None:
    record = yield_scene(("yielding", 1, 2))
    agents = (record.agents[0], record.agents[1].model_copy(update={"width": 0.2}))
    assert list_rules(check(record.model_copy(update={"agents": agents}), MAP)) >= {"size"}


def test_a_yield_that_the_end_of_the_scene_cuts_short() -> None:
    car, walker = yielding_car(), crossing_walker()
    cut = RoadUser(1, Track(car.track.xy[:80], car.track.heading[:80], 0.0), car.shape)
    walker = RoadUser(2, Track(walker.track.xy[:81], walker.track.heading[:81], 0.0), walker.shape)
    record = scene([cut, walker], ("yielding", 1, 2), duration=8.0)
    assert check(record, MAP).verified


def test_a_label_that_the_tracks_contradict() -> None:
    record = yield_scene(("yielding", 1, 2))
    label = {"type": "yielding", "from": 1, "to": 2, "time": 5.3, "location": (-13.0, -1.75)}
    for change, verified in (({}, True), ({"time": 40.0}, False), ({"from": 2, "to": 1}, False)):
        event = EventRecord.model_validate({**label, **change})
        assert check(record.model_copy(update={"events": (event,)}), MAP).verified is verified


class TestBadInput:
    def test_one_clear_line(self) -> None:
        good = agent(yielding_car())
        cases = {
            "twice": (good, good),
            "NaN": (good.model_copy(update={"heading": (float("nan"),) * len(good.heading)}),),
            "empty": (good.model_copy(update={"trajectory": (), "heading": ()}),),
            "headings": (good.model_copy(update={"heading": good.heading[:-1]}),),
            "size": (good.model_copy(update={"length": 0.0}),),
            "spawn_time": (good.model_copy(update={"spawn_time": float("inf")}),),
        }
        for word, agents in cases.items():
            with pytest.raises(InputError, match=word):
                check(scene([]).model_copy(update={"agents": agents}), MAP)

    def test_a_relation_of_nobody(self) -> None:
        with pytest.raises(InputError, match="agent 9"):
            check(yield_scene(("yielding", 1, 9)), MAP)


def test_degenerate_scenes() -> None:
    assert check(scene([]), None).verified
    still = walk(1, (-20.0, 5.0), SOUTH, np.zeros(1))
    assert check(scene([still]), MAP).verified


class TestTies:
    """A car from the west and one from the east pass one another on the plus."""

    USERS = (
        line(1, (-50.0, -1.75), EAST, distance(8.0, (0.0, 8.0))),
        line(2, (50.0, 1.75), WEST, distance(8.0, (0.0, 8.0))),
    )

    def tied(self, side: str, *, agent: int = 2, of: int = 1) -> SceneRecord:
        ties = ({"agent": agent, "of": of, "side": side},)
        known = scene(self.USERS).to_json()
        return SceneRecord.model_validate(known | {"ties": ties})

    @pytest.mark.parametrize("side", ["same", "other", "opposite", "lateral", "left", "right"])
    def test_entries_lie_as_they_were_tied(self, side: str) -> None:
        proof = check(self.tied(side), MAP)
        assert proof.verified is (side in ("other", "opposite"))
        assert list_rules(proof) == (set() if proof.verified else {"entry_elsewhere"})

    def test_without_a_map_nobody_has_an_entry(self) -> None:
        assert check(self.tied("left")).verified

    def test_a_track_that_begins_past_the_middle_comes_from_nowhere(self) -> None:
        late = line(2, (-5.0, 1.75), WEST, distance(8.0, (0.0, 4.0)))
        assert find_entry_leg(build_trajectory(late), MAP) is None
        assert find_entry_leg(build_trajectory(self.USERS[1]), MAP) == "east"

    def test_a_tie_names_agents_of_the_scene(self) -> None:
        with pytest.raises(InputError, match="ties name agent 7"):
            check(self.tied("same", agent=7), MAP)


def test_who_was_to_run_red_and_does_not_is_told() -> None:
    car = line(1, (-50.0, -1.75), EAST, distance(8.0, (0.0, 8.0)))
    green = (light("green", 0.0, 30.0), light("green", 0.0, 30.0, crosswalk=True))
    obeys = check(scene([car], signals=green, violates_signal=True), MAP)
    assert list_rules(obeys) == {"red_light_not_run"}
    assert obeys.figures["red_light_runs"] == []
    runs = check(scene([car], signals=TestSignals.RED, violates_signal=True), MAP)
    (run,) = runs.figures["red_light_runs"]
    assert (run["agent"], run["light"]) == (1, "west:stop")
    assert run["time"] == pytest.approx((38.0 - CAR.length / 2) / 8.0, abs=0.05)


@pytest.mark.parametrize(
    ("cause", "told"),
    [
        ({"cause": "red_light_run", "cause_agent": 1}, None),
        ({"cause": "red_light_run"}, None),
        ({"cause": "red_light_run", "cause_agent": 2}, "by 1 observed, by 2 asked for"),
        ({"cause": "late_brake"}, "cause red_light_run observed, late_brake asked for"),
    ],
)
def test_a_cause_asked_for_is_looked_for(cause: dict[str, object], told: str | None) -> None:
    car = line(1, (-50.0, -1.75), EAST, distance(8.0, (0.0, 5.0)))
    walker = walk(2, (-8.0, -1.75 - 1.4 * 5.0), NORTH, distance(1.4, (0.0, 5.0)))
    lights = (light("red", 0.0, 30.0), light("green", 0.0, 30.0, crosswalk=True))
    record = scene([car, walker], ("collision", 1, 2, cause), signals=lights)
    details = [each.detail for each in check(record, MAP).missing]
    assert len(details) == (told is not None)
    assert told is None or told in details[0]


def test_no_cause_is_looked_for_where_no_lights_are_seen() -> None:
    record = collided()
    relation = record.relations[0].model_copy(update={"cause": "red_light_run", "cause_agent": 1})
    record = record.model_copy(update={"relations": (relation,)})
    assert check(record).missing == check(record, MAP).missing == ()
