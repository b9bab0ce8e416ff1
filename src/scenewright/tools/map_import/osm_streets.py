"""The streets of OpenStreetMap files of any size, and the junctions at which they meet."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from importlib import import_module
from itertools import pairwise
from pathlib import Path

import numpy as np

from scenewright.errors import InputError
from scenewright.geometry.geographic import EARTH_RADIUS
from scenewright.scene.base import FloatArray
from scenewright.tools.map_import.junction_choice import Junction
from scenewright.tools.map_import.junction_groups import StreetPiece, group_junctions
from scenewright.tools.map_import.osm_file import (
    RINGS,
    Tags,
    is_driven,
    is_one_way,
    iterate_elements,
    list_places,
)

_SLIPS = frozenset(("trunk_link", "primary_link", "secondary_link", "tertiary_link"))


def _cut_ways(
    ways: Iterable[tuple[list[str], Tags]], places: Mapping[str, FloatArray]
) -> Iterator[StreetPiece]:
    """The ways, cut where they meet."""
    count: Counter[str] = Counter()
    for nodes, _ in ways:
        count.update(nodes)
        count.update([*nodes[:1], *nodes[-1:]])
    for nodes, tags in ways:
        ring = tags.get("junction") in RINGS
        cuts = [k for k, node in enumerate(nodes) if count[node] > 1]
        for a, b in pairwise(cuts):
            own = nodes[a : b + 1][:: -1 if tags.get("oneway") == "-1" else 1]
            yield StreetPiece(
                start=own[0],
                end=own[-1],
                line=np.array([places[node] for node in own]),
                name=tags.get("name") or tags.get("ref") or "",
                is_one_way=is_one_way(tags),
                is_ring=ring,
                is_slip=tags.get("highway") in _SLIPS,
            )


def list_osm_junctions(file: Path) -> tuple[tuple[Junction, ...], tuple[FloatArray, ...]]:
    """The junctions of a file and its streets; the id of a junction is the least of its nodes' ids.

    So it does not depend on how the file is converted, nor on the side that is driven on.

    Raises:
        InputError: unreadable, without streets, or with coordinates that are no degrees.
    """
    osmium = import_module("osmium")
    degrees: dict[str, tuple[float, float]] = {}
    ways: list[tuple[list[str], Tags]] = []
    streets = osmium.filter.KeyFilter("highway"), osmium.filter.EntityFilter(osmium.osm.WAY)
    for way in iterate_elements(file, *streets):
        if is_driven(tags := dict(way.tags)):
            known = list_places(way)
            degrees.update((name, (lat, lon)) for name, lat, lon in known)
            ways.append(([name for name, _, _ in known], tags))
    if not degrees:
        raise InputError(f"{file} has no streets for vehicles")
    spots = np.array(list(degrees.values()))
    low, high = spots.min(axis=0), spots.max(axis=0)
    origin = float(low[0] + high[0]) / 2, float(low[1] + high[1]) / 2
    scale = np.array([math.cos(math.radians(origin[0])), 1.0]) * EARTH_RADIUS
    xy = np.radians(spots[:, ::-1] - np.array(origin[::-1])) * scale
    places = dict(zip(degrees, xy, strict=True))
    cut = list(_cut_ways(ways, places))
    # The pieces, those joined that only meet one another at the end of ways.
    at: dict[str, list[int]] = {}
    pieces: list[StreetPiece | None] = list(cut)
    for k, piece in enumerate(cut):
        for node in (piece.start, piece.end):
            at.setdefault(node, []).append(k)
    for node, own in at.items():
        if len(own) != 2 or own[0] == own[1]:
            continue
        a, b = (pieces[k] for k in own)
        if a is None or b is None or (a.is_ring, a.is_slip) != (b.is_ring, b.is_slip):
            continue
        if (joined := _join_pieces(a, b, node)) is None:
            continue
        pieces[own[0]], pieces[own[1]] = joined, None
        for other in (joined.start, joined.end):
            at[other] = [own[0] if k == own[1] else k for k in at[other]]
    found = group_junctions(places, [piece for piece in pieces if piece is not None], origin)
    return tuple(found), tuple(piece.line for piece in cut)


def _join_pieces(a: StreetPiece, b: StreetPiece, node: str) -> StreetPiece | None:
    if a.is_one_way or b.is_one_way:
        if not (a.is_one_way and b.is_one_way):
            return None
        a, b = (a, b) if a.end == node else (b, a)
        if a.end != node or b.start != node:
            return None
    first = a if a.end == node else _turn_round(a)
    second = b if b.start == node else _turn_round(b)
    return replace(
        first, end=second.end, line=np.concatenate([first.line, second.line[1:]]),
        name=first.name or second.name, last_name=second.name_at(second.end) or first.name,
    )  # fmt: skip


def _turn_round(piece: StreetPiece) -> StreetPiece:
    return replace(
        piece, start=piece.end, end=piece.start, line=piece.line[::-1],
        name=piece.name_at(piece.end), last_name=piece.name,
    )  # fmt: skip
