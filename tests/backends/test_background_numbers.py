"""What a number of background agents is of."""

from __future__ import annotations

import pytest

from lab.planner.plain_sentences import build_reading
from scenewright.backends.builtin.draft import Site
from scenewright.backends.builtin.reader.annotation import parse_annotation
from scenewright.backends.builtin.reader.learned_plan import plan_reading
from scenewright.scene.social import SocialGraph


def make_graph(line: str) -> SocialGraph:
    annotated = parse_annotation(line)
    made = plan_reading(build_reading(annotated), Site(), annotated.text).plan
    assert isinstance(made, SocialGraph)
    return made


def test_named_vehicles_are_among_all_that_are_counted() -> None:
    graph = make_graph(
        "[bgveh 4 cars] altogether; [veh:1 one] [yield:1>2 yields to] [veh:2 another]."
    )
    assert graph.context.background is not None
    assert graph.context.background.vehicles == 2


@pytest.mark.parametrize(
    "line",
    [
        "[bgveh 5 vehicles] per leg, [normal no events].",
        "[bgveh a couple of bikes], [normal nothing happens].",
        "[bgped lots of people on foot], [normal uneventful].",
    ],
)
def test_numbers_that_no_scene_can_have_become_nothing(line: str) -> None:
    graph = make_graph(line)
    assert "nothing" in [each.became for each in graph.said]
