"""Places and agents in words."""

from __future__ import annotations

import pytest

from scenewright.cli.console import format_one_line
from scenewright.cli.make import choose_folder_name
from scenewright.cli.scene_summary import place
from scenewright.intersections import load_map

ON = load_map("amsterdam_120")


@pytest.mark.parametrize("crosswalk", ON.crosswalks, ids=lambda each: each.leg)
def test_the_middle_of_a_crosswalk_is_on_it(crosswalk: object) -> None:
    (ax, ay), (bx, by) = crosswalk.centreline  # type: ignore[attr-defined]
    spot = ((ax + bx) / 2, (ay + by) / 2)
    assert place(spot, ON) == f"on the {crosswalk.leg} crosswalk"  # type: ignore[attr-defined]


def test_the_origin_is_in_the_junction_and_far_away_is_a_leg() -> None:
    assert place((0.0, 0.0), ON) == "in the junction"
    assert place((3.0, 55.0), ON) == "on the north leg"
    assert place((-55.0, 2.0), ON) == "on the west leg"


@pytest.mark.parametrize(
    ("scene_id", "name"),
    [("0a1b", "0a1b"), ("../../etc/passwd", "etc-passwd"), ("..", "scene"), ("Ä\0/ b", "b")],
)
def test_a_scene_id_is_never_a_path(scene_id: str, name: str) -> None:
    assert choose_folder_name(scene_id) == name


def test_one_line_cannot_steer_a_terminal() -> None:
    assert format_one_line("a\x1b[31mb\nc\u202ed\udcff") == "a [31mb c d"
    assert len(format_one_line("x" * 10_000)) == 600
