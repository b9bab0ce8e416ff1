"""Choice of one junction of a map file."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from scenewright.errors import InputError
from scenewright.geometry.geographic import LatLon, project_to_metres
from scenewright.scene.base import FloatArray

_MAX_LISTED = 12
_MAX_DISTANCE = 150.0
"""From the given centre to the junction meant [m]."""


@dataclass(frozen=True)
class Junction:
    """A junction of a file.

    Attributes:
        id: in the file; xy: where it is [m]; name: of its roads.
        legs: how many; size: how many roads lead in or out.
    """

    id: str
    xy: tuple[float, float]
    legs: int
    name: str
    size: int


@dataclass(frozen=True, eq=False)
class JunctionOverview:
    """What a file has to choose from.

    Attributes:
        roads: [P, 2] middle of every carriageway [m], to draw the junctions on.
    """

    junctions: tuple[Junction, ...]
    roads: tuple[FloatArray, ...]


def choose_junction(
    junctions: Sequence[Junction],
    *,
    file: Path,
    center: tuple[float, float] | None,
    junction: str | None,
    origin: LatLon | None,
) -> Junction:
    """The junction of an id or nearest to the centre; without either, the only one.

    Args:
        center: latitude and longitude, or x and y where the file has no geographic origin.
        origin: latitude and longitude that lie at x = y = 0.

    Raises:
        InputError: none, several to choose from, or none of that id or so near.
    """
    if not junctions:
        raise InputError(f"{file} has no junction of three or more roads for vehicles")
    if junction is not None:
        found = next((each for each in junctions if each.id == junction), None)
        if found is None:
            raise InputError(f"{file} has no junction {junction[:60]!r}; {_list(junctions)}")
        return found
    if center is not None:
        return _find_nearest(junctions, file, center, origin)
    if len(junctions) > 1:
        raise InputError(
            f"{file} has {len(junctions)} junctions; choose one with --junction ID or "
            f"--center: {_list(junctions)}"
        )
    return junctions[0]


def _find_nearest(
    junctions: Sequence[Junction], file: Path, center: tuple[float, float], origin: LatLon | None
) -> Junction:
    xy = center if origin is None else tuple(project_to_metres(origin, center))
    distance, nearest = min(
        ((math.dist(each.xy, xy), each) for each in junctions),
        key=lambda pair: (pair[0], pair[1].id),
    )
    if distance > _MAX_DISTANCE:
        raise InputError(
            f"the junction of {file} nearest to {center[0]:g},{center[1]:g} is {distance:.0f} m "
            f"away; {_list(junctions)}"
        )
    return nearest


def _list(junctions: Sequence[Junction]) -> str:
    ordered = sorted(junctions, key=lambda each: (-each.size, each.id))
    shown = [
        f"{j.id} ({j.legs} legs{', ' + j.name if j.name else ''})" for j in ordered[:_MAX_LISTED]
    ]
    more = len(ordered) - len(shown)
    return "there are " + "; ".join(shown) + (f" and {more} more" if more else "")
