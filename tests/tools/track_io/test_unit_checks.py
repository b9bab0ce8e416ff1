"""Notes about tracks whose units or headings cannot be right; good tracks have none."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from checker_tracks import EAST, NORTH, crossing_walker, distance, line, yielding_car
from scenewright.tools.relation_checker import RoadUser
from scenewright.tools.track_io.external_tracks import read_tracks

Row = tuple[float, int, str, float, float, float]
"""Time, id, class, x, y, heading."""


def rows(*users: RoadUser) -> list[Row]:
    return [
        (float(t), u.id, u.shape.type, float(x), float(y), float(h))
        for u in users
        for t, (x, y), h in zip(u.track.times, u.track.xy, u.track.heading, strict=True)
    ]


def notes(users: list[RoadUser], change: Callable[[Row], Row], *, headed: bool = True) -> str:
    columns = "t,id,class,x,y" + ",heading" * headed
    lines = [
        f"{t:.4f},{n},{kind},{x:.9f},{y:.9f}" + f",{h:.5f}" * headed
        for t, n, kind, x, y, h in map(change, rows(*users))
    ]
    return " ".join(read_tracks("\n".join((columns, *lines)).encode(), name="t.csv").notes)


GIVING = [yielding_car(), crossing_walker()]
CROSSING = [
    line(1, (-50.0, 0.0), EAST, distance(10.0, (0.0, 8.0))),
    line(2, (0.0, -80.0), NORTH, distance(10.0, (0.0, 8.0))),
]
RNG = np.random.default_rng(3)


@pytest.mark.parametrize(
    ("change", "headed", "told"),
    [
        (lambda r: r, True, ""),
        (lambda r: r, False, ""),
        (lambda r: (*r[:5], np.pi / 2 - r[5]), True, "headings of 2 vehicles"),
        (lambda r: (*r[:5], r[5] + 0.3), True, ""),
        (lambda r: (*r[:5], r[5] + 0.4), True, "headings of 2 vehicles"),
        (lambda r: (*r[:3], 8.0 + r[3] / 8e4, 49.0 + r[4] / 1.1e5, r[5]), False, "not degrees"),
        (lambda r: (10.0 * r[0], *r[1:]), True, "not frames"),
        (lambda r: (*r[:3], 6.0 * r[3], 6.0 * r[4], r[5]), True, "vehicles reach 60 m/s"),
        (
            lambda r: (*r[:3], r[3] + RNG.normal(0, 0.1), r[4] + RNG.normal(0, 0.1), r[5]),
            False,
            "too uneven",
        ),
    ],
    ids=["fine", "plain", "compass", "17", "23", "degrees", "frames", "pixels", "noise"],
)
def test_what_cannot_be_right_is_told(
    change: Callable[[Row], Row], headed: bool, told: str
) -> None:
    found = notes(CROSSING, change, headed=headed)
    assert told in found
    assert bool(found) is bool(told)


def test_who_stops_and_goes_is_not_doubted() -> None:
    assert notes(GIVING, lambda r: r) == notes(GIVING, lambda r: r, headed=False) == ""
