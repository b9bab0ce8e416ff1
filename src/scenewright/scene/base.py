"""Two kinds of values: frozen models for what text may write, frozen arrays for numbers."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Annotated, Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field
from pydantic_core import ErrorDetails

FloatArray = NDArray[np.float64]

AgentClass = Literal["vehicle", "pedestrian", "cyclist", "scooter"]
RIDERS: tuple[AgentClass, ...] = ("cyclist", "scooter")
"""Classes that travel a vehicle's route beside the kerb, or a pedestrian's on a crosswalk."""

Compass = Literal[
    "north", "northeast", "east", "southeast", "south", "southwest", "west", "northwest"
]
COMPASS_RING: tuple[Compass, ...] = get_args(Compass)
"""All directions, clockwise."""
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


def find_model(annotation: Any) -> type[Model] | None:
    """The model in a type such as `tuple[AgentNode, ...]`; None where there is none."""
    if isinstance(annotation, type) and issubclass(annotation, Model):
        return annotation
    return next(filter(None, map(find_model, get_args(annotation))), None)


def find_model_at(path: Iterable[str | int], model: type[Model]) -> type[Model]:
    """The model of what stands at a path below a model; numbers are places in lists."""
    for step in path:
        if isinstance(step, str):
            info = next(i for n, i in model.model_fields.items() if step in (n, i.alias))
            model = find_model(info.annotation) or model
    return model


def list_fields(model: type[Model]) -> list[str]:
    """The fields of a model by the names that files use."""
    return [info.alias or name for name, info in model.model_fields.items()]


_LONGEST_QUOTE = 60
"""Characters of a value that a refusal quotes."""


def quote_value(value: object) -> str:
    """A value as a refusal quotes it, cut where it is too long."""
    text = repr(value)
    return text if len(text) <= _LONGEST_QUOTE else f"{text[:_LONGEST_QUOTE]}..."


def describe_fault(fault: ErrorDetails) -> str:
    """What is wrong with a value of a model, and the value, as feedback for its writer."""
    match fault["type"]:
        case "extra_forbidden":
            return "there is no such key; leave it out"
        case "missing":
            return "is missing"
        case "value_error":
            return str(fault["ctx"]["error"])
        case _:
            return f"{fault['msg']}, got {quote_value(fault['input'])}"


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
