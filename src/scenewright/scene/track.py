"""Where one agent is, evenly sampled, and how large it is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scenewright.scene.base import AgentClass, FloatArray, frozen
from scenewright.scene.kinds import list_shipped

STEP = 0.1
"""Output time step [s] (SEMANTICS section 1)."""

PEDESTRIAN_RADIUS = 0.30
VEHICLE_SIZES = {k.id: (k.figures["length"], k.figures["width"]) for k in list_shipped("subtype")}
"""Length and width [m] by vehicle subtype."""

VEHICLE_MASSES = {kind.id: kind.figures["mass"] for kind in list_shipped("subtype")}
"""Usual mass [kg], with its driver, by vehicle subtype; decides how far a collision pushes one."""

EMERGENCY = frozenset(k.id for k in list_shipped("subtype") if "emergency" in k.traits)
"""Subtypes that may pass a red light while others give way (SEMANTICS section 8)."""


@dataclass(frozen=True, eq=False)
class Track:
    """Where one agent is, evenly sampled.

    Attributes:
        xy: [T, 2] centre positions in the map frame [m], finite.
        heading: [T] direction the agent faces [rad], held at standstill.
        start: time of the first sample [s] since scene start.
        step: time between samples [s].
    """

    xy: FloatArray
    heading: FloatArray
    start: float
    step: float = STEP

    def __post_init__(self) -> None:
        if self.xy.ndim != 2 or self.xy.shape[1] != 2 or len(self.xy) != len(self.heading):
            raise ValueError(f"track needs xy [T, 2] and heading [T], got {self.xy.shape}")
        object.__setattr__(self, "xy", frozen(self.xy))
        object.__setattr__(self, "heading", frozen(self.heading))

    @property
    def times(self) -> FloatArray:
        """[T] sample times [s]."""
        return self.start + self.step * np.arange(len(self.xy), dtype=np.float64)

    @property
    def end(self) -> float:
        """Time of the last sample [s]."""
        return self.start + self.step * (len(self.xy) - 1)


@dataclass(frozen=True)
class Shape:
    """Footprint of an agent: a disc for pedestrians, else a rectangle centred on the position.

    Attributes:
        type: agent class.
        length: along the heading [m]; the diameter of a pedestrian.
        width: across [m].
    """

    type: AgentClass
    length: float
    width: float


RIDER_SIZES: dict[AgentClass, tuple[float, float]] = {
    "cyclist": (1.8, 0.65),
    "scooter": (1.2, 0.55),
}
"""Length and width [m] of a bicycle and a standing e-scooter, rider included."""

PEDESTRIAN = Shape("pedestrian", 2 * PEDESTRIAN_RADIUS, 2 * PEDESTRIAN_RADIUS)


def get_vehicle_shape(subtype: str = "car") -> Shape:
    """The default footprint of a vehicle subtype (SEMANTICS section 1)."""
    length, width = VEHICLE_SIZES[subtype]
    return Shape("vehicle", length, width)


def get_rider_shape(kind: AgentClass) -> Shape:
    """The footprint of a cyclist or scooter rider (SEMANTICS section 8)."""
    length, width = RIDER_SIZES[kind]
    return Shape(kind, length, width)
