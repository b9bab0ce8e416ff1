"""Figures that a request asks for, measured on tracks whose figures are known."""

from __future__ import annotations

import numpy as np
import pytest

from scenewright.scene.events import Event
from scenewright.scene.measures import MeasureKind
from scenewright.scene.record import MeasureRecord
from scenewright.scene.track import Shape, Track
from scenewright.tools.relation_checker.events import observe
from scenewright.tools.relation_checker.measured import MeasuredFigures, measure_impact_share
from scenewright.tools.relation_checker.trajectory import RoadUser, build_trajectory

CAR = Shape("vehicle", 4.6, 1.85)
WALKER = Shape("pedestrian", 0.6, 0.6)


def drive(x: np.ndarray, y: float = 0.0, *, number: int = 1, shape: Shape = CAR) -> RoadUser:
    """A road user that moves to the east along a row of x every 0.1 s."""
    xy = np.column_stack([x, np.full(len(x), y)])
    return RoadUser(number, Track(xy, np.zeros(len(x)), 0.0), shape)


def figures_of(*users: RoadUser) -> MeasuredFigures:
    observed = observe(users, until=20.0)
    return MeasuredFigures(observed.events, observed, None)


def test_speed_braking_and_wait_of_a_known_motion() -> None:
    clock = np.arange(0.0, 12.0, 0.1)
    # 10 m/s for 4 s, braking at 4 m/s^2 to a stop at 6.5 s, standing to 10 s, 2 m/s^2 from there
    speed = np.select(
        [clock < 4.0, clock < 6.5, clock < 10.0], [10.0, 10.0 - 4.0 * (clock - 4.0), 0.0],
        2.0 * (clock - 10.0),
    )  # fmt: skip
    found = figures_of(drive(np.concatenate([[0.0], np.cumsum(speed * 0.1)[:-1]])))
    for kind, value, within in (
        ("speed", 10.0, 0.02), ("braking", 4.0, 0.1), ("acceleration", 2.0, 0.1), ("wait", 3.7, 0.2)
    ):  # fmt: skip
        (seen,) = found.measure(MeasureRecord(kind=kind, agent=1, low=0, high=100))
        assert seen == pytest.approx(value, abs=within), kind


@pytest.mark.parametrize(("low", "high", "met"), [(9.5, 10.5, True), (10.1, 10.5, False)])
def test_a_figure_outside_of_its_range_is_found_and_not_evidence(
    low: float, high: float, met: bool
) -> None:
    found = figures_of(drive(np.arange(0.0, 60.0, 1.0)))
    record = MeasureRecord(kind="speed", agent=1, low=low, high=high)
    assert (found.find_shortfalls([record])[0] == ()) is met


def test_headway_and_gap_of_two_in_one_lane() -> None:
    ahead = drive(np.arange(19.6, 140.0, 1.0), number=2)
    found = figures_of(drive(np.arange(0.0, 120.4, 1.0)), ahead)
    for kind, value in (("headway", 1.5), ("gap", 15.0)):
        record = MeasureRecord(kind=kind, agent=1, other=2, low=0, high=100)
        assert found.measure(record) == pytest.approx((value, value), abs=0.02)


@pytest.mark.parametrize(
    ("kind", "across", "walks", "share"),
    [
        ("front_point_left", 0.4625, 1.0, 25.0),
        ("front_point_right", 0.4625, 1.0, 75.0),
        ("front_point", -0.4625, 1.0, 25.0),
        ("front_point", -0.4625, -1.0, 75.0),
    ],
)
def test_the_share_of_the_front_is_counted_from_the_side_asked(
    kind: MeasureKind, across: float, walks: float, share: float
) -> None:
    """A walker that goes to the left (+1) comes from the right, so that counts from there."""
    car = build_trajectory(drive(np.arange(0.0, 20.0, 1.0)))
    y = across + walks * (np.arange(20.0) - 10.0) * 0.1
    xy = np.column_stack([np.full(20, 12.6), y])
    walker = build_trajectory(RoadUser(2, Track(xy, np.full(20, np.pi / 2), 0.0), WALKER))
    place = (10.0 + 2.3, across)
    hit = Event.model_validate(
        {"type": "collision", "from": 1, "to": 2, "time": 1.0, "location": place}
    )
    assert measure_impact_share(kind, car, walker, hit) == pytest.approx((share,))
