"""Zones of a map: what a relation's file may demand of the place of its event."""

from __future__ import annotations

import pytest

from scenewright.intersections import load_map
from scenewright.tools.relation_checker.conditions import is_in_zone

MAP = load_map("amsterdam_120")
MARKED = tuple(sum(end) / 2 for end in zip(*MAP.crosswalks[0].centreline, strict=True))
LANE = next(each for each in MAP.lanelets if each.kind == "approach")
ON_LEG = tuple(sum(end) / 2 for end in zip(LANE.centreline[0], LANE.centreline[-1], strict=True))


@pytest.mark.parametrize(
    ("place", "on_foot", "zones"),
    [
        ((0.0, 0.0), False, {"conflict", "roadway"}),
        (MARKED, False, {"crosswalk", "conflict", "roadway"}),
        (MARKED, True, {"crosswalk", "conflict"}),
        (ON_LEG, True, {"roadway"}),
        ((45.0, 45.0), False, set()),
    ],
)
def test_a_place_lies_in_these_zones(place, on_foot, zones):
    asked = ("crosswalk", "conflict", "roadway")
    assert {zone for zone in asked if is_in_zone(place, zone, MAP, on_foot=on_foot)} == zones
