"""How vehicles drive, in the checker: at yellow, in the junction, the wrong way; and forgeries."""

from __future__ import annotations

import pytest

from checker_tracks import EAST, WEST, distance, light, line, plus_map, resampled
from scenewright.scene.base import FloatArray
from scenewright.scene.map_elements import Lanelet
from scenewright.scene.record import SignalRecord
from scenewright.tools.relation_checker.events import observe
from scenewright.tools.relation_checker.motions import describe_motion

LANES = tuple(
    Lanelet(
        id=f"west:{kind}", kind=kind, leg="west", left=((a, 0.0), (b, 0.0)),
        right=((a, y), (b, y)), centreline=((a, y / 2), (b, y / 2)), width=3.5, speed_limit=13.9,
    )
    for kind, a, b, y in (("approach", -100.0, -12.0, -3.5), ("exit", -12.0, -100.0, 3.5))
)  # fmt: skip
MAP = plus_map().model_copy(update={"lanelets": LANES})
HARD = distance(10.0, (0, 4.5), (-5, 2), (0, 6))
"""From x = -70 to a stand with the front 0.7 m before the stop line, braking from 4.5 s on."""
SOFT = distance(10.0, (0, 2.5), (-2.5, 4), (0, 6))[:-1]
INSIDE = distance(10.0, (0, 5.5), (-5, 2), (0, 6), (2, 4))
"""Past the line at about 5.7 s, standing at x = -5 from 7.5 to 13.5 s, then on."""
CROSS = SignalRecord(stop_line="south:stop", start=0.0, end=30.0, colour="green")


def lights(yellow: float, red: float) -> list[SignalRecord]:
    return [light("green", 0, yellow), light("yellow", yellow, red), light("red", red, 30)]


@pytest.mark.parametrize(
    ("s", "shown", "seen"),
    [
        (HARD, lights(3.7, 6.7), True),
        (HARD, lights(9.0, 12.0), False),
        (HARD, lights(1.0, 4.0), False),
        (SOFT, lights(1.7, 4.7), False),
        (HARD + 6.0, lights(3.7, 6.7), False),
        (HARD[:50], lights(3.7, 6.7), False),
    ],
)
def test_who_stops_at_yellow(s: FloatArray, shown: list[SignalRecord], seen: bool) -> None:
    observed = observe(
        [line(1, (-70.0, -1.75), EAST, s)], intersection_map=MAP, signals=tuple(shown)
    )
    found = describe_motion("stops_at_yellow", observed.tracks[0], observed, MAP)
    assert (found is not None) == seen


@pytest.mark.parametrize(
    ("s", "shown", "seen"),
    [
        (INSIDE, [*lights(6.0, 9.0), CROSS], True),
        (INSIDE, [*lights(6.0, 9.0)], False),
        (INSIDE, [*lights(20.0, 23.0), CROSS], False),
        (INSIDE, [*lights(2.0, 5.0), CROSS], False),
        (INSIDE - 20.0, [*lights(6.0, 9.0), CROSS], False),
    ],
)
def test_who_blocks_the_junction(s: FloatArray, shown: list[SignalRecord], seen: bool) -> None:
    observed = observe(
        [line(1, (-70.0, -1.75), EAST, s)], intersection_map=MAP, signals=tuple(shown)
    )
    found = describe_motion("blocks_junction", observed.tracks[0], observed, MAP)
    assert (found is not None) == seen


@pytest.mark.parametrize(
    ("place", "heading", "seen"),
    [
        ((-60.0, 1.75), EAST, True),
        ((-60.0, -1.75), EAST, False),
        ((0.0, 1.75), WEST, False),
        ((-9.0, 1.75), EAST, False),
        ((-60.0, 12.0), EAST, False),
    ],
)
def test_who_drives_the_wrong_way(place: tuple[float, float], heading: float, seen: bool) -> None:
    user = line(1, place, heading, distance(8.0, (0, 5)))
    for each in (user, resampled(user, 0.05)):
        observed = observe([each], intersection_map=MAP, signals=())
        found = describe_motion("drives_wrong_way", observed.tracks[0], observed, MAP)
        assert (found is not None) == seen


def test_who_stands_in_a_lane_that_leads_the_other_way_drives_no_wrong_way() -> None:
    observed = observe(
        [line(1, (-40.0, 1.75), EAST, distance(0.0, (0, 10)))], intersection_map=MAP, signals=()
    )
    track = observed.tracks[0]
    assert describe_motion("drives_wrong_way", track, observed, MAP) is None
