"""Two kinds of values: frozen models for what text may write, frozen arrays for numbers."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field

FloatArray = NDArray[np.float64]

AgentClass = Literal["vehicle", "pedestrian", "cyclist", "scooter"]
RIDERS: tuple[AgentClass, ...] = ("cyclist", "scooter")
"""Classes that travel a vehicle's route beside the kerb, or a pedestrian's on a crosswalk."""

Compass = Literal[
    "north", "northeast", "east", "southeast", "south", "southwest", "west", "northwest"
]
OPPOSITE: dict[str, Compass] = {
    "north": "south", "south": "north", "east": "west", "west": "east",
    "northeast": "southwest", "southwest": "northeast",
    "northwest": "southeast", "southeast": "northwest",
}  # fmt: skip
Movement = Literal["straight", "left", "right", "uturn", "crossing", "jaywalking"]
Colour = Literal["green", "yellow", "red"]

AgentId = Annotated[
    str, Field(pattern=r"^(vehicle|pedestrian|cyclist|scooter)-[1-9][0-9]*$", max_length=32)
]
Point = tuple[float, float]


def is_left_out(value: object) -> bool:
    """Whether an optional field is empty, so that files do not hold it."""
    return value is None or value in ((), {})


class Model(BaseModel):
    """A frozen value that a language model, a file or a checkpoint may have written."""

    model_config = ConfigDict(frozen=True, extra="forbid", populate_by_name=True, defer_build=True)


class FieldError(ValueError):
    """A fault of the field at a path below the model that finds it; pydantic keeps it."""

    def __init__(self, message: str, *at: str | int) -> None:
        super().__init__(message)
        self.at = at


class FieldErrors(ValueError):
    """All faults that a model finds, where it finds some."""

    def __init__(self, faults: Iterable[FieldError]) -> None:
        self.faults = tuple(faults)
        super().__init__("; ".join(map(str, self.faults)))


def frozen(array: FloatArray) -> FloatArray:
    """The array as read-only float64; raises ValueError unless every entry is finite."""
    result = np.ascontiguousarray(array, dtype=np.float64)
    # One pass: a sum is finite only if every term is.
    if not math.isfinite(np.add.reduce(result, axis=None)):
        raise ValueError("array holds NaN or infinity")
    if result.flags.writeable:
        result = result.copy() if result is array else result
        result.setflags(write=False)
    return result
