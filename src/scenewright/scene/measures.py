"""Numbers that a text asks for: what is measured, of which agents, between which bounds."""

from __future__ import annotations

from typing import Literal, NamedTuple, Self, get_args

from pydantic import Field, model_validator

from scenewright.scene.base import AgentId, FieldError, Model

MeasureKind = Literal[
    "speed", "line_speed", "contact_speed", "braking", "acceleration", "wait", "line_distance",
    "headway", "gap", "pet", "ttc", "time", "front_point", "front_point_left",
    "front_point_right", "side_point",
]  # fmt: skip
"""What can be asked for (docs/constraint-language.md says how each is measured)."""


class MeasureUnit(NamedTuple):
    """How a kind of measure is counted.

    Attributes:
        unit: as the constraint language writes it.
        tolerance: how far from a number that was said the scene may be (SEMANTICS 8).
        margin: how far inside of its range a figure is aimed at.
        least, most: what a scene can have.
        of_two: it is measured between two agents.
    """

    unit: str
    tolerance: float
    margin: float
    least: float
    most: float
    of_two: bool = False


UNITS: dict[MeasureKind, MeasureUnit] = {
    "speed": MeasureUnit("m/s", 0.5, 0.4, 0.3, 20.0),
    "line_speed": MeasureUnit("m/s", 0.5, 0.4, 0.3, 20.0),
    "contact_speed": MeasureUnit("m/s", 0.5, 0.3, 0.0, 20.0, of_two=True),
    "braking": MeasureUnit("m/s2", 0.5, 0.2, 0.3, 10.0),
    "acceleration": MeasureUnit("m/s2", 0.5, 0.2, 0.3, 4.0),
    "wait": MeasureUnit("s", 0.15, 0.08, 0.5, 25.0),
    "line_distance": MeasureUnit("m", 0.3, 0.1, 0.0, 30.0),
    "headway": MeasureUnit("s", 0.15, 0.04, 0.5, 4.0, of_two=True),
    "gap": MeasureUnit("m", 0.3, 0.12, 2.0, 60.0, of_two=True),
    "pet": MeasureUnit("s", 0.15, 0.1, 0.0, 8.0, of_two=True),
    "ttc": MeasureUnit("s", 0.3, 0.2, 0.0, 8.0, of_two=True),
    "time": MeasureUnit("s", 0.3, 0.2, 1.0, 29.0, of_two=True),
    "front_point": MeasureUnit("%", 5.0, 2.5, 0.0, 100.0, of_two=True),
    "front_point_left": MeasureUnit("%", 5.0, 1.5, 0.0, 100.0, of_two=True),
    "front_point_right": MeasureUnit("%", 5.0, 1.5, 0.0, 100.0, of_two=True),
    "side_point": MeasureUnit("%", 5.0, 1.5, 0.0, 100.0, of_two=True),
}


MOST_OF_CLASS: dict[str, dict[str, float]] = {
    "pedestrian": {"speed": 4.5, "line_speed": 4.5, "acceleration": 3.0, "braking": 3.0},
    "cyclist": {"speed": 9.0, "line_speed": 9.0, "acceleration": 2.0, "braking": 3.5},
    "scooter": {"speed": 7.0, "line_speed": 7.0, "acceleration": 2.0, "braking": 3.5},
}
"""The most of a class, where it is less than a scene can have (SEMANTICS 5 and 8)."""
_UNIT_HELP = ", ".join(f"{kind} [{each.unit}]" for kind, each in UNITS.items())

_MEASURE_OF = {"kept_speed": "speed", "time_headway": "headway"}
"""Measures by clauses that are called otherwise."""

_BY_NAME: dict[str, MeasureUnit] = {str(kind): each for kind, each in UNITS.items()}


def get_unit(clause: str) -> str:
    """The unit of a clause that asks for a figure."""
    return _BY_NAME[_MEASURE_OF.get(clause, clause)].unit


class Measure(Model):
    """A figure of one agent, or between two, that lies in [low, high]; units as in `UNITS`."""

    kind: MeasureKind = Field(description=_UNIT_HELP)
    agent: AgentId
    other: AgentId | None = Field(default=None, description="of what is measured between two")
    low: float = Field(ge=0, le=100, description="least, in the unit of the kind")
    high: float = Field(ge=0, le=100, description="most, in the unit of the kind")

    @model_validator(mode="after")
    def _check_consistency(self) -> Self:
        if self.low > self.high:
            message = f"{self.kind}: range [{self.low:g}, {self.high:g}] is empty"
            raise FieldError(message, "high")
        if UNITS[self.kind].of_two != (self.other is not None):
            count = 1 + UNITS[self.kind].of_two
            raise FieldError(f"{self.kind} is measured of {count} agents", "other")
        if self.agent == self.other:
            message = f"{self.kind} needs two different agents, got {self.agent} twice"
            raise FieldError(message, "other")
        return self


def find_excess(measure: Measure) -> FieldError | None:
    """What no agent of its class can show, at the bound that is out of reach."""
    of, known = measure.agent.partition("-")[0], UNITS[measure.kind]
    most = MOST_OF_CLASS.get(of, {}).get(measure.kind, known.most)
    what = f"{measure.kind} of a {of} is {known.least:g} to {most:g} {known.unit}"
    if measure.low > most:
        return FieldError(what, "low")
    return FieldError(what, "high") if measure.high < known.least else None


def format_measure(measure: Measure) -> str:
    """A measure as text, such as "speed(vehicle-1) in [14.5, 15.5] m/s"."""
    agents = measure.agent if measure.other is None else f"{measure.agent}, {measure.other}"
    bounds = f"[{measure.low:.4g}, {measure.high:.4g}]"
    return f"{measure.kind}({agents}) in {bounds} {UNITS[measure.kind].unit}"


def get_aim(measure: Measure) -> tuple[float, float]:
    """The inner part of the range that is aimed at, so that small changes do not leave it."""
    margin = min(UNITS[measure.kind].margin, 0.4 * (measure.high - measure.low))
    return measure.low + margin, measure.high - margin


KINDS: tuple[MeasureKind, ...] = get_args(MeasureKind)
