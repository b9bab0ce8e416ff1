"""What stands in a scene and takes no part: its size, where it stands, and which agent it hides."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from scenewright.scene.base import Model, is_left_out
from scenewright.scene.social import Encounter, ObjectKind, ObjectNode
from scenewright.scene.track import VEHICLE_SIZES

OBJECT_SIZES: dict[str, tuple[float, float]] = {
    "box": (1.6, 1.0),
    "bin": (0.7, 0.7),
    "container": (6.06, 2.44),
    "door": (0.95, 0.12),
}
"""Length and width [m] of what is no vehicle."""

_LOW = frozenset({"bin", "motorcycle"})
"""Kinds and subtypes that people see over."""


class ObjectRecord(Model):
    """A standing object in scene.json.

    Attributes:
        height: `high` blocks the line of sight, `low` is seen over.
        length, width: of its footprint [m], a rectangle centred on (x, y) [m].
        heading: direction of its length [rad], counter-clockwise from east.
        lane: the outermost lane that it was to stand in.
        since: when it is there [s]; None: all the time. Of a `door`, which is opened.
    """

    id: str
    kind: ObjectKind | Literal["door"]
    subtype: str | None = None
    height: Literal["low", "high"]
    length: float
    width: float
    x: float
    y: float
    heading: float
    lane: Literal["left", "right"] | None = Field(default=None, exclude_if=is_left_out)
    since: float | None = Field(default=None, exclude_if=is_left_out)


class SightRecord(Model):
    """A line of sight that an object blocks, as asked for.

    Attributes:
        observer, subject: numbers of agents; object: what hides the second from the first.
        lead: least and most seconds between the first free line of sight and their event.
        between: the other one of two objects between which the second comes out.
    """

    observer: int
    subject: int
    object: str
    lead: tuple[float, float]
    between: str | None = Field(default=None, exclude_if=is_left_out)


class EncounterRecord(Model):
    """What an agent was to do about an object in its way: go round it, wait behind it, hit it.

    Attributes:
        figure: range of the figure asked for (`scene.social.FIGURES`).
    """

    agent: int
    object: str
    how: Encounter
    figure: tuple[float, float] | None = Field(default=None, exclude_if=is_left_out)


def name_door(vehicle: str) -> str:
    """The id of the door of a standing vehicle."""
    return f"{vehicle}-door"


def get_subtype(node: ObjectNode) -> str | None:
    """What vehicle an object is; None where it is none."""
    if node.kind in OBJECT_SIZES:
        return None
    return node.subtype or ("bus" if node.kind == "bus_stop" else "car")


def get_size(node: ObjectNode) -> tuple[float, float]:
    """Length and width of an object [m]."""
    subtype = get_subtype(node)
    return OBJECT_SIZES[node.kind] if subtype is None else VEHICLE_SIZES[subtype]


def is_high(node: ObjectNode) -> bool:
    """Whether an object blocks the line of sight of agents behind it."""
    return node.kind not in _LOW and node.subtype not in _LOW
