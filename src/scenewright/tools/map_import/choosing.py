"""Which junction of a file is meant."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from scenewright.errors import InputError

_EARTH = 6_378_137.0
_LISTED = 12
_FARTHEST = 150.0
"""A junction farther from the centre given is not the one meant [m]."""


@dataclass(frozen=True)
class Place:
    """A junction of a file: its id there, where it is [m], how many legs, of which roads."""

    id: str
    xy: tuple[float, float]
    legs: int
    name: str
    size: int


def chosen(
    places: Sequence[Place],
    *,
    file: Path,
    center: tuple[float, float] | None,
    junction: str | None,
    geographic: tuple[float, float] | None,
) -> Place:
    """The junction named by its id or nearest to the centre; the only one if nothing is said.

    Args:
        center: latitude and longitude, or x and y where the file has no geographic origin.
        geographic: latitude and longitude that lie at x = y = 0.

    Raises:
        InputError: none, several to choose from, or none so named or so near.
    """
    if not places:
        raise InputError(f"{file} has no junction of three or more roads for vehicles")
    if junction is not None:
        found = next((each for each in places if each.id == junction), None)
        if found is None:
            raise InputError(f"{file} has no junction {junction[:60]!r}; {_listing(places)}")
        return found
    if center is not None:
        x, y = center if geographic is None else _metres(geographic, center)
        nearest = min(places, key=lambda each: (math.dist(each.xy, (x, y)), each.id))
        away = math.dist(nearest.xy, (x, y))
        if away > _FARTHEST:
            raise InputError(
                f"the junction of {file} nearest to {center[0]:g},{center[1]:g} is {away:.0f} m "
                f"away; {_listing(places)}"
            )
        return nearest
    if len(places) > 1:
        raise InputError(
            f"{file} has {len(places)} junctions; choose one with --junction ID or "
            f"--center: {_listing(places)}"
        )
    return places[0]


def _metres(origin: tuple[float, float], place: tuple[float, float]) -> tuple[float, float]:
    east = math.radians(place[1] - origin[1]) * math.cos(math.radians(origin[0]))
    return _EARTH * east, _EARTH * math.radians(place[0] - origin[0])


def _listing(places: Sequence[Place]) -> str:
    ordered = sorted(places, key=lambda each: (-each.size, each.id))
    words = [f"{p.id} ({p.legs} legs{', ' + p.name if p.name else ''})" for p in ordered[:_LISTED]]
    more = len(ordered) - len(words)
    return "there are " + "; ".join(words) + (f" and {more} more" if more else "")
