"""Nodes of a street network that drivers see as one junction, and the legs of each."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy as np

from scenewright.geometry.geographic import LatLon
from scenewright.geometry.polyline import find_point, measure_length
from scenewright.scene.base import FloatArray
from scenewright.tools.map_import.junction_choice import Junction
from scenewright.tools.map_import.legs import (
    LEAST_LEGS,
    OTHER_STREET,
    WIDEST_MEDIAN,
    Arm,
    explain_count,
    group_arms,
    measure_bearing,
)

_SHORT = 15.0
"""Pieces of street so short lie inside a junction [m]."""
_SHORT_ONE_WAY = 25.0
"""The same of one-way pieces [m]."""
_TRIANGLE = 45.0
"""Three pieces so short that lead round a triangle lie inside one junction [m]."""
_LONGEST_SLIP = 70.0
"""Slip lanes that are longer are streets of their own [m]."""
_WIDEST_ISLAND = 35.0
"""A slip lane of no class of its own passes the junction's node so near [m]."""
_FARTHEST = 130.0
"""The nodes of one junction, a roundabout's aside, lie no farther apart to north or east [m]."""
_OPPOSITE = math.radians(40.0)


@dataclass(frozen=True, eq=False)
class StreetPiece:
    """A piece of street between two nodes of a network, in driving direction where it has one.

    Attributes:
        line: [P, 2] from the first node to the last [m].
        name: of the street at the first node; last_name: at the last one, where it is another.
        is_ring: of a roundabout; is_slip: of a lane for turning that leaves the junction out.
    """

    start: str
    end: str
    line: FloatArray
    name: str
    is_one_way: bool = False
    is_ring: bool = False
    is_slip: bool = False
    last_name: str = ""

    def name_at(self, node: str) -> str:
        """What the street is called at one of its ends."""
        return self.name if node == self.start else self.last_name or self.name


def group_junctions(
    places: Mapping[str, FloatArray], pieces: Sequence[StreetPiece], origin: LatLon | None = None
) -> list[Junction]:
    """Every junction of three or more legs as drivers see it; its id is the least of its nodes'.

    Joined to one are the nodes of a roundabout, of the carriageways of a divided street, of slip
    lanes, and nodes that short pieces of street connect, as far as one map can show them.

    Args:
        places: [2] by node [m].
        origin: latitude and longitude of x = y = 0.
    """
    pieces = [piece for piece in pieces if measure_length(piece.line) > 0.01]
    at: dict[str, list[StreetPiece]] = defaultdict(list)
    for piece in pieces:
        at[piece.start].append(piece)
        at[piece.end].append(piece)
    branching = {node for node, own in at.items() if _count_arms(own) >= 3}
    # Its functions have no types.
    joined: Any = import_module("scipy.cluster.hierarchy").DisjointSet(at)
    ring = {node for piece in pieces if piece.is_ring for node in (piece.start, piece.end)}

    def join(a: str, b: str) -> None:
        spots = np.array([places[node] for node in {*joined.subset(a), *joined.subset(b)}])
        if np.ptp(spots, axis=0).max() < _FARTHEST:
            joined.merge(a, b)

    for piece in sorted(pieces, key=lambda each: (not each.is_ring, measure_length(each.line))):
        ends = {piece.start, piece.end}
        # A slip lane of a roundabout leads to a street of its own unless it is very short.
        leaves_ring = piece.is_slip and len(ends & ring) == 1
        short = _SHORT_ONE_WAY if piece.is_one_way else _SHORT
        is_slip = piece.is_slip and not leaves_ring
        near = measure_length(piece.line) < (_LONGEST_SLIP if is_slip else short)
        if piece.is_ring:
            joined.merge(piece.start, piece.end)
        elif ends <= branching and (near or (not is_slip and _joins_carriageways(piece, at))):
            join(piece.start, piece.end)
    for a, b in (*_find_sides(pieces, branching, joined), *_find_slips(pieces, places, at)):
        join(a, b)
    # To a junction belong the places beside it off which its own streets alone lead: no legs.
    for node, own in sorted(at.items()):
        around = {piece.start if piece.end == node else piece.end for piece in own} - {node}
        near = all(math.dist(places[node], places[each]) < WIDEST_MEDIAN for each in around)
        if near and len(around) > 1 and len({joined[each] for each in around}) == 1:
            joined.merge(node, min(around))
    nodes = [own for own in joined.subsets() if len(own) > 1 or own <= branching]
    found = [
        _build_junction(own, places, at, origin, is_roundabout=not own.isdisjoint(ring))
        for own in sorted(nodes, key=min)
    ]
    return [each for each in found if each.legs >= LEAST_LEGS]


def _count_arms(pieces: Iterable[StreetPiece]) -> int:
    """Ends of pieces at a node; the two directions of one street count once."""
    ends = {
        (frozenset((piece.start, piece.end)), round(measure_length(piece.line))) for piece in pieces
    }
    return len(ends) + sum(piece.start == piece.end for piece in pieces)


def _find_slips(
    pieces: Sequence[StreetPiece],
    places: Mapping[str, FloatArray],
    at: Mapping[str, Sequence[StreetPiece]],
) -> Iterator[tuple[str, str]]:
    """Nodes of slip lanes that the file does not class as such, each with the node passed by.

    Such a lane leaves a street for the next one, both of which lead on to the junction's node.
    """
    forks = {node for node, own in at.items() if _count_arms(own) == 3}
    for slip in pieces:
        if not slip.is_one_way or slip.is_ring or measure_length(slip.line) > _LONGEST_SLIP:
            continue
        if slip.start == slip.end or not {slip.start, slip.end} <= forks:
            continue
        onwards = {
            piece.end if piece.start == slip.start else piece.start
            for piece in at[slip.start]
            if piece is not slip and (piece.start == slip.start or not piece.is_one_way)
        }
        back = {
            piece.start if piece.end == slip.end else piece.end
            for piece in at[slip.end]
            if piece is not slip and (piece.end == slip.end or not piece.is_one_way)
        }
        for node in sorted(onwards & back - {slip.start, slip.end}):
            middle = find_point(slip.line, measure_length(slip.line) / 2)
            if math.dist(middle, places[node]) < _WIDEST_ISLAND:
                yield from ((slip.start, node), (slip.end, node))


def _find_sides(
    pieces: Sequence[StreetPiece], branching: set[str], joined: Any
) -> list[tuple[str, str]]:
    """Sides of small triangles of streets, which as a rule stand round an island."""
    ends = {node: joined[node] for node in branching}
    sides = {
        frozenset((ends[piece.start], ends[piece.end]))
        for piece in pieces
        if {piece.start, piece.end} <= branching and measure_length(piece.line) < _TRIANGLE
    }
    pairs = sorted(tuple(sorted(side)) for side in sides if len(side) == 2)
    beside: dict[str, set[str]] = defaultdict(set)
    for a, b in pairs:
        beside[a].add(b)
        beside[b].add(a)
    return [(a, b) for a, b in pairs if beside[a] & beside[b]]


def _joins_carriageways(piece: StreetPiece, at: Mapping[str, Sequence[StreetPiece]]) -> bool:
    """Whether a piece leads from one carriageway of a divided street across to the other."""
    across = piece.line[-1] - piece.line[0]
    ways = [
        [
            (math.atan2(*(each.line[-1] - each.line[0])[::-1]), each.name_at(node))
            for each in at[node]
            if each.is_one_way and each is not piece and not each.is_slip
        ]
        for node in (piece.start, piece.end)
    ]
    course, length = math.atan2(across[1], across[0]), measure_length(piece.line)
    return any(
        length < (WIDEST_MEDIAN if name == other else OTHER_STREET)
        and abs(math.remainder(a - b - math.pi, math.tau)) < _OPPOSITE
        and math.radians(45) < abs(math.remainder(a - course, math.tau)) < math.radians(135)
        for a, name in ways[0]
        for b, other in ways[1]
    )


def _build_junction(
    nodes: set[str],
    places: Mapping[str, FloatArray],
    at: Mapping[str, Sequence[StreetPiece]],
    origin: LatLon | None,
    *,
    is_roundabout: bool,
) -> Junction:
    arms = []
    for node in sorted(nodes):
        for piece in at[node]:
            if piece.start not in nodes or piece.end not in nodes:
                line = piece.line if piece.start == node else piece.line[::-1]
                leads = "out" if piece.start == node else "in"
                leads = leads if piece.is_one_way else "in out"
                arms.append(Arm(line, piece.name_at(node), leads))
    middle = np.mean([places[node] for node in sorted(nodes)], axis=0)
    found = []
    for own in group_arms(arms):
        ahead = sum(np.exp(1j * measure_bearing(arms[i].line)) for i in own)
        name = min((arms[i].street for i in own), key=lambda name: (not name, name))
        found.append((float(np.angle(ahead)), name))
    found.sort()
    return Junction(
        id=min(nodes, key=lambda node: (len(node), node)),
        xy=(float(middle[0]), float(middle[1])),
        streets=tuple(street for _, street in found),
        bearings=tuple(bearing for bearing, _ in found),
        is_roundabout=is_roundabout,
        nodes=frozenset(nodes),
        origin=origin,
        refusal=explain_count(len(found)),
    )
