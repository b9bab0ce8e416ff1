"""What one scene is to show, before it is worded: a leaf of the taxonomy with its agents.

Sides are chosen such that the map has them and the two ways meet, so that a text never asks for
what cannot be.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from scenewright.scene.base import RIDERS, AgentClass, Compass, Movement
from scenewright.scene.map import IntersectionMap
from scenewright.scene.map_elements import Route
from scenewright.scene.relations import Pattern, Role, load_patterns
from scenewright.scene.social import Density
from scenewright.tools.map_grounding.route_meetings import list_meetings


@dataclass(frozen=True)
class Party:
    """An agent of a story.

    Attributes:
        side: where it comes from, if that is given; crosswalk: leg that a pedestrian crosses.
        tie: `oncoming` or `cross`: how it comes, relative to the other agent; `corner`: the two
            meet beside the road.
    """

    type: AgentClass
    movement: Movement
    side: Compass | None = None
    crosswalk: Compass | None = None
    tie: str | None = None


@dataclass(frozen=True)
class Story:
    """One scene to be worded.

    Attributes:
        event: as the checker calls it, or `normal`; leaf: id of the pattern, None for normal.
        minute: time of day [min], None: not given.
        runner: the party that runs a red light, if one does.
    """

    event: str
    leaf: str | None
    parties: tuple[Party, ...]
    minute: int | None
    density: Density | None
    runner: int | None = None

    @property
    def clock(self) -> str | None:
        """HH:MM."""
        return None if self.minute is None else format_clock(self.minute)


def format_clock(minute: int) -> str:
    """A minute of the day as HH:MM."""
    return f"{minute // 60 % 24:02d}:{minute % 60:02d}"


def list_parties(
    pattern: Pattern,
    *,
    intersection_map: IntersectionMap,
    detail: int,
    rng: np.random.Generator,
    rider: AgentClass | None = None,
) -> tuple[Party, Party]:
    """Returns the two agents of a pattern and their origins.

    Args:
        detail: 0 movements alone, 1 ties and crosswalks of one of them, 2 sides.
        rider: class of the riders; None: either.
    """
    kinds = [
        (rider or RIDERS[int(rng.integers(len(RIDERS)))]) if role.type == "rider" else role.type
        for role in (pattern.from_, pattern.to)
    ]
    options = _list_meetings(pattern, intersection_map)
    met = bool(options) and options[0][1].tie is not None
    if not options or (detail == 0 and not met):
        bare = _make_bare_party(pattern.from_, kinds[0], rng)
        return bare, _make_bare_party(pattern.to, kinds[1], rng)
    first, second = (
        replace(party, type=kind)
        for party, kind in zip(options[int(rng.integers(len(options)))], kinds, strict=True)
    )
    if detail >= 2 or met:
        return first, second
    if "crossing" in (first.movement, second.movement):
        # One of the two places is given; the other follows from it or stays open.
        hide_walk = bool(rng.integers(2))
        return _drop_side(first, hide_walk), _drop_side(second, hide_walk)
    tie = {"opposite": "oncoming", "lateral": "cross"}.get(pattern.entries)
    return _drop_side(first, False), Party(second.type, second.movement, tie=tie)


def draw_passers(
    intersection_map: IntersectionMap, rng: np.random.Generator
) -> tuple[Party, Party]:
    """Two agents that do not interact: a vehicle, and a vehicle or a pedestrian."""
    ways = [way for way in intersection_map.movements if way.turn != "uturn"]
    one, other = (ways[int(k)] for k in rng.choice(len(ways), size=2, replace=False))
    driver = Party("vehicle", one.turn, side=one.entry)
    if intersection_map.crosswalks and rng.random() < 0.5:
        walk = intersection_map.crosswalks[int(rng.integers(len(intersection_map.crosswalks)))]
        return driver, Party("pedestrian", "crossing", crosswalk=walk.leg)
    return driver, Party("vehicle", other.turn, side=other.entry)


def _make_bare_party(role: Role, kind: AgentClass, rng: np.random.Generator) -> Party:
    return Party(kind, role.movements[int(rng.integers(len(role.movements)))])


def _drop_side(party: Party, hide_walk: bool) -> Party:
    if party.movement in ("crossing", "jaywalking"):
        return Party(party.type, party.movement, crosswalk=None if hide_walk else party.crosswalk)
    return Party(party.type, party.movement, side=party.side if hide_walk else None)


def _list_meetings(
    pattern: Pattern, intersection_map: IntersectionMap
) -> list[tuple[Party, Party]]:
    """Every pair of ways on the map that the pattern's two can take."""
    if pattern.zone == "sidewalk":
        return [(Party("pedestrian", "crossing"), Party("pedestrian", "crossing", tie="corner"))]
    met = list_meetings(pattern, intersection_map)
    return list(dict.fromkeys((_make_party(one), _make_party(other)) for one, other in met))


def _make_party(route: Route) -> Party:
    if route.type == "vehicle":
        return Party("vehicle", route.movement, side=route.entry)
    walk = route.crosswalk if route.movement == "crossing" else None
    return Party("pedestrian", route.movement, crosswalk=walk)


def has_likelier_twin(pattern: Pattern) -> bool:
    """Whether only its own phrase names it: a likelier pattern has the same parties, or none does
    it without saying how."""
    return pattern.manoeuvre is not None or any(
        other.id != pattern.id
        and other.weight > pattern.weight
        and _get_shape(other) == _get_shape(pattern)
        for other in load_patterns()
    )


def _get_shape(pattern: Pattern) -> tuple[object, ...]:
    return (
        pattern.relation, pattern.kind, pattern.entries, pattern.from_.type, pattern.to.type,
        frozenset(pattern.from_.movements), frozenset(pattern.to.movements),
    )  # fmt: skip


def draw_minute(
    windows: Sequence[tuple[int, int]], rng: np.random.Generator, share: float | None = None
) -> int:
    """A minute of the day from windows, full fives more often.

    Args:
        share: how far into the windows, from 0 to 1; None: each minute as likely.
    """
    windows = windows or [(0, 24 * 60)]
    spans = [max(end - start, 1) for start, end in windows]
    at = int((rng.random() if share is None else share) * sum(spans))
    which = int(np.searchsorted(np.cumsum(spans), at, side="right"))
    within = at - sum(spans[:which])
    coarse = within - within % (30 if rng.random() < 0.5 else 5)
    return (windows[which][0] + coarse) % (24 * 60)
