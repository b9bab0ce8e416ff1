"""Choice of one junction of a map file."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from rapidfuzz import fuzz

from scenewright.errors import InputError
from scenewright.geometry.geographic import LatLon, project_to_degrees, project_to_metres
from scenewright.scene.base import FloatArray
from scenewright.scene.streets import expand_name
from scenewright.tools.map_import.legs import LEAST_LEGS, explain_refusal, list_legs
from scenewright.tools.map_import.survey import Survey

_MAX_LISTED = 12
_MAX_DISTANCE = 150.0
"""From the given centre to the junction meant [m]."""


@dataclass(frozen=True)
class Junction:
    """A junction of a file.

    Attributes:
        id: in the file; xy: where it is [m].
        streets: of the legs, "" where one has no name; bearings: of the legs [rad].
        is_roundabout: whether it has a ring.
        nodes: of the network, that make it up.
        origin: latitude and longitude of x = y = 0; None where the file has none.
        refusal: why it cannot be imported and what can; "" if nothing speaks against it.
    """

    id: str
    xy: tuple[float, float]
    streets: tuple[str, ...]
    bearings: tuple[float, ...]
    is_roundabout: bool = False
    nodes: frozenset[str] = frozenset()
    origin: LatLon | None = None
    refusal: str = ""

    @property
    def legs(self) -> int:
        """How many legs it has."""
        return len(self.streets)

    @property
    def name(self) -> str:
        """The names of its streets."""
        return ", ".join(sorted(set(self.streets) - {""}))[:80]

    @property
    def degrees(self) -> LatLon | None:
        """Its latitude and longitude, where the file has degrees."""
        return None if self.origin is None else project_to_degrees(self.origin, np.array(self.xy))


def describe_survey(
    survey: Survey, *, id: str, nodes: frozenset[str] = frozenset(), refusal: str = ""
) -> Junction | None:
    """The junction that an import of a survey makes; None if it has fewer than three legs.

    Args:
        refusal: why it cannot be imported, "" if nothing is known yet.
    """
    legs = list_legs(survey)
    if len(legs) < LEAST_LEGS:
        return None
    return Junction(
        id=id,
        xy=survey.offset,
        streets=tuple(leg.road for leg in legs),
        bearings=tuple(leg.bearing for leg in legs),
        is_roundabout=survey.is_roundabout,
        nodes=nodes,
        origin=survey.file_origin,
        refusal=refusal or explain_refusal(legs),
    )


@dataclass(frozen=True, eq=False)
class JunctionOverview:
    """What a file has to choose from.

    Attributes:
        roads: [P, 2] middle of every carriageway [m], to draw the junctions on.
        survey: what the file holds of one of its junctions, as long as the file is there.
    """

    junctions: tuple[Junction, ...]
    roads: tuple[FloatArray, ...]
    survey: Callable[[Junction], Survey]


def choose_junction(
    junctions: Sequence[Junction],
    *,
    file: Path,
    center: tuple[float, float] | None,
    junction: str | None,
    streets: Sequence[str] = (),
) -> Junction:
    """The junction of an id, of streets or nearest to the centre; without any, the only one.

    Args:
        center: latitude and longitude, or x and y where the file has no geographic origin.
        streets: names of streets, all of which it has.

    Raises:
        InputError: none, several to choose from, none of that id or so near, or one that is known
            not to be representable.
    """
    chosen = _find_junction(junctions, file, center, junction, streets)
    if chosen.refusal:
        kind = "roundabout" if chosen.is_roundabout else "junction"
        raise InputError(f"{kind} {chosen.id} of {file} cannot be imported: {chosen.refusal}")
    return chosen


def _find_junction(
    junctions: Sequence[Junction],
    file: Path,
    center: tuple[float, float] | None,
    junction: str | None,
    streets: Sequence[str],
) -> Junction:
    if not junctions:
        raise InputError(f"{file} has no junction of three or more legs for vehicles")
    if junction is not None:
        found = next((each for each in junctions if junction in (each.id, *each.nodes)), None)
        if found is None:
            raise InputError(f"{file} has no junction {junction[:60]!r}; {_list(junctions)}")
        return found
    if streets:
        junctions = find_streets(junctions, file, streets)
    if center is not None:
        return _find_nearest(junctions, file, center)
    if len(junctions) > 1:
        raise InputError(
            f"{file} has {len(junctions)} junctions; choose one with --junction ID, --at or "
            f"--street: {_list(junctions)}"
        )
    return junctions[0]


def find_streets(
    junctions: Sequence[Junction], file: Path, streets: Sequence[str]
) -> list[Junction]:
    """The junctions of which each of the streets is a leg."""
    wanted = [expand_name(street) for street in streets]
    own = [
        (junction, [f" {expand_name(x)} " for x in junction.streets if x]) for junction in junctions
    ]
    found = [
        each
        for each, names in own
        if all(any(f" {name} " in known for known in names) for name in wanted)
    ]
    if not found:
        known = sorted({street for each in junctions for street in each.streets if street})
        near = [
            each for each in known if any(fuzz.ratio(expand_name(each), w) > 70 for w in wanted)
        ]
        listed = ", ".join((near or known)[:_MAX_LISTED])
        raise InputError(
            f"{file} has no junction of {' and '.join(streets)[:120]}; its streets are {listed}"
        )
    return found


def _find_nearest(
    junctions: Sequence[Junction], file: Path, center: tuple[float, float]
) -> Junction:
    origin = junctions[0].origin
    xy = center if origin is None else tuple(project_to_metres(origin, center))
    distance, nearest = min(
        ((math.dist(junction.xy, xy), junction) for junction in junctions),
        key=lambda pair: (pair[0], pair[1].id),
    )
    if distance > _MAX_DISTANCE:
        raise InputError(
            f"the junction of {file} nearest to {center[0]:g},{center[1]:g} is {distance:.0f} m "
            f"away; {_list(junctions)}"
        )
    return nearest


def _list(junctions: Sequence[Junction]) -> str:
    ordered = sorted(junctions, key=lambda each: (-each.legs, each.id))
    shown = [
        f"{j.id} ({j.legs} legs{', ' + j.name if j.name else ''})" for j in ordered[:_MAX_LISTED]
    ]
    more = len(ordered) - len(shown)
    return "there are " + "; ".join(shown) + (f" and {more} more" if more else "")
