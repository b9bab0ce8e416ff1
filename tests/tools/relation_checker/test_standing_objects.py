"""Standing objects in the checker: lines of sight, contacts, and scenes that only look hidden."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import shapely

from checker_tracks import EAST, NORTH, distance, line, mirrored, plus_map, resampled, scene, walk
from scenewright.errors import InputError
from scenewright.scene.events import Proof
from scenewright.scene.objects import ObjectRecord, SightRecord
from scenewright.scene.record import SceneRecord
from scenewright.scene.track import get_vehicle_shape
from scenewright.tools.relation_checker import RoadUser, build_trajectory, check
from scenewright.tools.relation_checker.footprints import make_pose, meets_box
from scenewright.tools.relation_checker.line_of_sight import (
    find_first_visible,
    locate_eyes,
    locate_marks,
)

MAP = plus_map()


def block(x: float, y: float, length: float, width: float, **more: Any) -> ObjectRecord:
    values = {
        "id": "object-1", "kind": "parked", "subtype": "truck", "height": "high",
        "length": length, "width": width, "x": x, "y": y, "heading": 0.0, **more,
    }  # fmt: skip
    return ObjectRecord.model_validate(values)


TRUCK = block(-26.75, -4.8, 8.5, 2.4)


def struck_pair() -> list[RoadUser]:
    """A car eastward at 10 m/s hits a walker at x = -20, who comes from the south at 1.4 m/s."""
    car = line(1, (-80.0, -1.75), EAST, distance(10.0, (0.0, 5.8)))
    return [car, walk(2, (-20.0, -6.4), NORTH, distance(1.4, (0.0, 3.5)), at=2.3)]


def hidden_scene(
    truck: ObjectRecord = TRUCK, lead: tuple[float, float] = (1.0, 2.0)
) -> SceneRecord:
    made = scene(struck_pair(), ("collision", 1, 2), movement="jaywalking", goal=(-20.0, 10.0))
    sight = SightRecord(observer=1, subject=2, object="object-1", lead=lead)
    return made.model_copy(update={"objects": (truck,), "sights": (sight,)})


def rules(proof: Proof) -> set[str]:
    return {
        f.rule for group in (proof.missing, proof.interference, proof.implausible) for f in group
    }


def test_a_walker_is_seen_when_its_rim_passes_the_edge_of_a_wall() -> None:
    """The wall ends at y = -1 and x = 10.1, so at x = 20 the shade ends at y = -1.98."""
    watcher = build_trajectory(walk(1, (0.0, 0.0), NORTH, np.zeros(121)))
    walker = build_trajectory(walk(2, (20.0, -9.0), NORTH, distance(1.0, (0.0, 12.0))))
    wall = block(10.0, -3.0, 0.2, 4.0)
    found = find_first_visible(watcher, walker, objects=(wall,), until=12.0)
    assert found is not None
    assert found.time == pytest.approx(6.8)  # 9 - 1.98 - 0.3 = 6.72 s, at the next sample
    low = find_first_visible(
        watcher, walker, objects=(wall.model_copy(update={"height": "low"}),), until=12.0
    )
    assert low is not None
    assert low.time == 0.0


def test_a_driver_sits_behind_the_front_on_the_inner_side() -> None:
    car = build_trajectory(line(1, (0.0, 0.0), EAST, distance(10.0, (0.0, 1.0))))
    times = np.array([0.5])
    assert locate_eyes(car, times)[0] == pytest.approx((5.46, 0.4625))
    assert locate_eyes(car, times, left_hand=True)[0] == pytest.approx((5.46, -0.4625))


def test_segments_meet_boxes_as_in_shapely() -> None:
    rng = np.random.default_rng(3)
    ends = rng.uniform(-4, 4, (400, 2, 2))
    middle, heading = rng.uniform(-2, 2, (400, 2)), rng.uniform(-4, 4, 400)
    for k in range(400):
        outline = shapely.box(-1.5, -0.5, 1.5, 0.5)
        outline = shapely.affinity.rotate(outline, heading[k], (0, 0), use_radians=True)
        outline = shapely.affinity.translate(outline, *middle[k])
        met = meets_box(*ends[k], make_pose(*middle[k], heading[k]), 3.0, 1.0)
        assert met == outline.intersects(shapely.LineString(ends[k]))


def first_visible_slowly(pair: list[RoadUser], truck: ObjectRecord, until: float) -> float | None:
    """Sample by sample, line by line, with shapely."""
    car, walker = (build_trajectory(each) for each in pair)
    half = (truck.length / 2, truck.width / 2)
    box = shapely.box(truck.x - half[0], truck.y - half[1], truck.x + half[0], truck.y + half[1])
    run, first = 0, None
    for k in range(round(max(car.start, walker.start) * 10), int(until * 10 + 1e-6) + 1):
        time = np.array([k / 10])
        eye = locate_eyes(car, time)[0]
        marks = locate_marks(walker, time)[0]
        free = any(not box.intersects(shapely.LineString([eye, mark])) for mark in marks)
        run = run + 1 if free else 0
        if run == 4 and first is None:
            first = (k - 3) / 10
    return first


@pytest.mark.parametrize("x", [-34.0, -30.0, -26.75, -25.0])
def test_the_first_sight_is_that_of_the_slow_search(x: float) -> None:
    truck = block(x, -4.8, 8.5, 2.4)
    car, walker = (build_trajectory(each) for each in struck_pair())
    found = find_first_visible(car, walker, objects=(truck,), until=5.7)
    slow = first_visible_slowly(struck_pair(), truck, 5.7)
    assert slow is not None
    assert found is not None
    assert found.time == pytest.approx(slow)


def test_mirrored_and_resampled_tracks_are_seen_at_the_same_time() -> None:
    car, walker = struck_pair()
    upside = TRUCK.model_copy(update={"y": -TRUCK.y})
    times = [
        find_first_visible(
            *map(build_trajectory, pair), objects=(truck,), until=5.7, left_hand=left
        )
        for pair, truck, left in (
            ((car, walker), TRUCK, False),
            ((mirrored(car), mirrored(walker)), upside, True),
            ((resampled(car, 0.05), resampled(walker, 0.05)), TRUCK, False),
        )
    ]
    assert times[0] is not None
    assert times[0] == times[1] == times[2]


def test_another_vehicle_blocks_the_view_while_it_is_there() -> None:
    car, walker = (build_trajectory(each) for each in struck_pair())
    van = build_trajectory(
        line(3, (-26.75, -4.8), EAST, np.zeros(46), at=0.0, shape=get_vehicle_shape("truck"))
    )
    seen = find_first_visible(car, walker, vehicles=(van,), until=5.7)
    unseen = find_first_visible(car, walker, until=5.7)
    assert unseen is not None
    assert unseen.time == pytest.approx(2.3)
    assert seen is not None
    assert seen.time > 2.3


def test_a_hidden_pedestrian_is_proven_with_its_first_sight() -> None:
    proof = check(hidden_scene(), MAP)
    assert not rules(proof)
    (figure,) = proof.figures["first_visible"]
    assert figure["first_visible"] == first_visible_slowly(struck_pair(), TRUCK, 5.7)
    assert 1.0 <= figure["before_event"] <= 2.0
    assert figure["hidden_for"] >= 0.5


@pytest.mark.parametrize(
    ("truck", "lead"),
    [
        (TRUCK.model_copy(update={"height": "low"}), (1.0, 2.0)),
        (TRUCK.model_copy(update={"x": -60.0}), (1.0, 2.0)),
        (TRUCK.model_copy(update={"y": 10.0}), (1.0, 2.0)),
        (TRUCK, (0.2, 0.9)),
        (TRUCK, (2.5, 3.5)),
    ],
    ids=["seen over", "too far off", "on the other side", "seen too soon", "seen too late"],
)
def test_what_does_not_hide_as_asked_is_found(
    truck: ObjectRecord, lead: tuple[float, float]
) -> None:
    assert "sight_not_blocked" in rules(check(hidden_scene(truck, lead), MAP))


@pytest.mark.parametrize(
    ("x", "broken"), [(-15.2, set()), (-40.0, {"sight_not_blocked"}), (-9.0, {"sight_not_blocked"})]
)
def test_who_comes_out_between_two_vehicles_has_one_on_either_side(
    x: float, broken: set[str]
) -> None:
    made = hidden_scene()
    second = block(x, -4.8, 4.6, 1.85, id="object-2", subtype="car")
    (sight,) = made.sights
    sights = (sight.model_copy(update={"between": "object-2"}),)
    proof = check(made.model_copy(update={"objects": (TRUCK, second), "sights": sights}), MAP)
    assert rules(proof) == broken


def test_somebody_who_comes_into_the_scene_just_then_is_not_hidden() -> None:
    car, walker = struck_pair()
    late = walk(2, (-20.0, -4.3), NORTH, distance(1.4, (0.0, 2.0)), at=3.8)
    made = hidden_scene().model_copy(
        update={"agents": scene([car, late], movement="jaywalking").agents}
    )
    assert walker.track.xy[15] == pytest.approx(late.track.xy[0])
    assert "sight_not_blocked" in rules(check(made, MAP))


@pytest.mark.parametrize(
    ("place", "rule"),
    [
        ({"x": -50.0, "y": -2.0}, "object_contact"),
        ({"x": -50.0, "y": -3.4}, "object_contact"),
        ({"x": -20.0, "y": -6.0}, "object_contact"),
        ({"x": -8.0, "y": 2.2}, "object_place"),
        ({"x": 30.0, "y": 30.0}, "object_place"),
    ],
)
def test_an_object_in_the_way_or_out_of_place_is_found(place: dict[str, float], rule: str) -> None:
    assert rule in rules(check(hidden_scene(TRUCK.model_copy(update=place)), MAP))


def test_objects_overlap_nobody_and_one_another() -> None:
    other = TRUCK.model_copy(update={"id": "object-2", "x": -24.0})
    made = hidden_scene().model_copy(update={"objects": (TRUCK, other)})
    assert "object_place" in rules(check(made, MAP))


@pytest.mark.parametrize(
    "change",
    [
        {"objects": (TRUCK, TRUCK)},
        {"objects": (TRUCK.model_copy(update={"width": float("nan")}),)},
        {"objects": (TRUCK.model_copy(update={"length": 500.0}),)},
        {"sights": (SightRecord(observer=1, subject=7, object="object-1", lead=(1, 2)),)},
        {"sights": (SightRecord(observer=1, subject=2, object="object-9", lead=(1, 2)),)},
    ],
)
def test_unusable_objects_are_refused(change: dict[str, Any]) -> None:
    with pytest.raises(InputError):
        check(hidden_scene().model_copy(update=change), MAP)
