"""Which leg a track comes from, and how the entries of two tracks lie to one another."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from scenewright.scene.events import Finding
from scenewright.scene.map import IntersectionMap
from scenewright.scene.record import TieRecord
from scenewright.tools.relation_checker.motion import Mover

ALONG = np.deg2rad(40.0)
"""How far a track may begin off the direction of the leg that it comes in by [rad]."""
WELL_OUT = 8.0
"""How far out of the middle a track has chosen its exit [m]."""

_SEEN_AS = {"lateral": ("left", "right"), "other": ("left", "right", "opposite")}

_ROUND = ("north", "northeast", "east", "southeast", "south", "southwest", "west", "northwest")


def entry_of(mover: Mover, ground: IntersectionMap) -> str | None:
    """The leg along which a track comes in; None if it begins where that cannot be told."""
    inwards = {leg.name: leg.bearing + np.pi for leg in ground.legs}
    off = {name: abs(_turn(float(mover.heading[0]) - way)) for name, way in inwards.items()}
    name = min(off, key=off.__getitem__, default=None)
    if name is None or off[name] > ALONG:
        return None
    outward = float(mover.xy[0] @ (-np.cos(inwards[name]), -np.sin(inwards[name])))
    return name if outward > 0.0 else None


def exit_of(mover: Mover, ground: IntersectionMap) -> str | None:
    """The leg along which a track goes out; None if it ends before that can be told."""
    off = {leg.name: abs(_turn(float(mover.heading[-1]) - leg.bearing)) for leg in ground.legs}
    name = min(off, key=off.__getitem__, default=None)
    if name is None or off[name] > ALONG:
        return None
    way = next(leg.bearing for leg in ground.legs if leg.name == name)
    outward = float(mover.xy[-1] @ (np.cos(way), np.sin(way)))
    return name if outward > WELL_OUT else None


def side_of(entry: str, *, seen_from: str) -> str:
    """How an entry lies to another one: same, opposite, left or right.

    >>> side_of("east", seen_from="north"), side_of("south", seen_from="north")
    ('left', 'opposite')
    """
    turn = (_ROUND.index(entry) - _ROUND.index(seen_from)) % len(_ROUND)
    if turn % 4 == 0:
        return "opposite" if turn else "same"
    return "left" if turn < 4 else "right"


def misplaced(
    ties: Sequence[TieRecord], movers: Mapping[int, Mover], ground: IntersectionMap
) -> tuple[Finding, ...]:
    """Agents that do not come from where, seen by another one, they were to come from."""
    found: list[Finding] = []
    for tie in ties:
        entry, other = (entry_of(movers[n], ground) for n in (tie.agent, tie.of))
        seen = side_of(entry, seen_from=other) if entry and other else "none"
        if seen in _SEEN_AS.get(tie.side, (tie.side,)):
            continue
        found.append(
            Finding(
                rule="entry_elsewhere", agents=(tie.agent, tie.of),
                detail=f"agent {tie.agent} comes from the {entry or 'middle'}, agent {tie.of} from "
                f"the {other or 'middle'}: {seen} observed, {tie.side} asked for",
            )
        )  # fmt: skip
    return tuple(found)


def _turn(angle: float) -> float:
    return float((angle + np.pi) % (2.0 * np.pi) - np.pi)
