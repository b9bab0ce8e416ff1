"""The words of a plan say all that it holds; what the reader knows is read back."""

from __future__ import annotations

import pytest

from scenewright.graph.run import plan_instruction
from scenewright.scene.measures import KINDS, UNITS, MeasureKind
from scenewright.scene.phrasing import describe_graph
from scenewright.scene.social import SocialGraph

CARS = [
    {"id": "vehicle-1", "type": "vehicle", "subtype": "car", "movement": "straight"},
    {"id": "vehicle-2", "type": "vehicle", "subtype": "bus", "movement": "straight"},
]
ACROSS = [CARS[0] | {"entry": "north"}, CARS[1] | {"entry": "east"}]
READ = ("speed", "braking", "wait", "headway", "gap")
"""Figures that sentences of their own ask for, too."""


@pytest.mark.parametrize("kind", KINDS)
def test_every_figure_is_said(kind: MeasureKind) -> None:
    unit = UNITS[kind]
    value = 40.0 if unit.unit == "%" else min(max(unit.least + 1.0, 3.0), unit.most)
    measure = {"kind": kind, "agent": "vehicle-1", "low": value - unit.tolerance,
               "high": value + unit.tolerance}  # fmt: skip
    measure |= {"other": "vehicle-2"} if unit.of_two else {}
    relation = {"type": "follow", "from": "vehicle-1", "to": "vehicle-2"}
    graph = SocialGraph.model_validate(
        {"agents": CARS, "relations": [relation], "measures": [measure]}
    )
    words = describe_graph(graph)
    said = f"{value * 3.6:g} km/h" if unit.unit == "m/s" else f"{value:g} {unit.unit}"
    assert said in words
    if kind in READ:
        assert plan_instruction(words).measures == graph.measures


@pytest.mark.parametrize(
    ("fields", "said"),
    [({"type": "near_miss", "cause": "late_brake", "braker": "vehicle-2"}, "the bus brakes late"),
     ({"type": "collide_at", "cause": "red_light_run"}, "one of them runs the red light"),
     ({"type": "collide_at", "point_to": "side"}, "on its side"),
     ({"type": "collide_at", "point_from": "front_left"}, "with its front left corner"),
     ({"type": "collide_at", "strikes": "vehicle-2"}, "The bus strikes the car")],
)  # fmt: skip
def test_how_it_comes_about_is_said(fields: dict[str, str], said: str) -> None:
    relation = {"from": "vehicle-1", "to": "vehicle-2"} | fields
    graph = SocialGraph.model_validate({"agents": ACROSS, "relations": [relation]})
    assert said in describe_graph(graph)
