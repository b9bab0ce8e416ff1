"""Junctions of OpenStreetMap files of any size, and the surroundings of one cut out."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Set
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any
from xml.sax.saxutils import quoteattr

import numpy as np

from scenewright.errors import InputError
from scenewright.geometry.geographic import EARTH_RADIUS, LatLon, is_in_degrees
from scenewright.scene.base import FloatArray
from scenewright.tools.map_import.junction_choice import Junction, JunctionOverview
from scenewright.tools.map_import.junction_groups import (
    JunctionGroup,
    StreetPiece,
    group_junctions,
)
from scenewright.tools.map_import.osm_elements import (
    MOST_NODES,
    OsmNodes,
    OsmRelation,
    OsmWay,
    is_pbf,
    iterate_elements,
)

_DRIVEN = frozenset(
    (
        *("motorway", "trunk", "primary", "secondary", "tertiary", "unclassified", "residential"),
        *("motorway_link", "trunk_link", "primary_link", "secondary_link", "tertiary_link"),
        *("living_street", "road"),
    )
)
_SLIPS = frozenset(("trunk_link", "primary_link", "secondary_link", "tertiary_link"))
_RINGS = ("roundabout", "circular")
_ACCESS = ("motorcar", "motor_vehicle", "vehicle", "access")
"""Tags that say who may drive along a way; the first one that a way has holds for cars."""
_CLOSED = ("no", "bus", "psv", "agricultural", "forestry")
AROUND = 350.0
"""How much of a large file is cut out about a junction in every direction [m]."""


@dataclass(frozen=True, eq=False)
class StreetMap:
    """The driven streets of a file.

    Attributes:
        origin: latitude and longitude of x = y = 0; places: [2] by node [m].
    """

    origin: LatLon
    places: Mapping[str, FloatArray]
    pieces: tuple[StreetPiece, ...]


def read_streets(file: Path) -> StreetMap:
    """The driven streets of an OpenStreetMap file.

    Raises:
        InputError: unreadable, without nodes or streets, or with coordinates that are no degrees.
    """
    ids: list[Any] = []
    degrees: list[FloatArray] = []
    ways: list[OsmWay] = []
    count = 0
    for element in iterate_elements(file):
        if isinstance(element, OsmNodes):
            far = ~(np.abs(element.degrees) <= (85.0, 180.0)).all(axis=1)
            if far.any():
                lat, lon = element.degrees[far.argmax()]
                raise InputError(
                    f"{file} has a node at latitude {lat:g}, longitude {lon:g}: these are no "
                    "degrees; OpenStreetMap files are not projected"
                )
            ids.append(element.ids)
            degrees.append(element.degrees)
            if (count := count + len(element.ids)) > MOST_NODES:
                raise InputError(f"{file} has more than {MOST_NODES:,} nodes; cut out a part first")
        elif isinstance(element, OsmWay) and is_driven(element.tags):
            ways.append(element)
    if not count:
        raise InputError(f"{file} has no nodes")
    return _build_street_map(np.concatenate(ids), np.concatenate(degrees), ways, file)


def is_driven(tags: Mapping[str, str]) -> bool:
    """Whether cars drive along a way of these tags; service roads do not count."""
    street = tags.get("highway") in _DRIVEN and tags.get("area") != "yes"
    return street and not is_closed(tags)


def is_closed(tags: Mapping[str, str]) -> bool:
    """Whether a way of these tags is closed to cars, as one for buses alone."""
    access = next((tags[key] for key in _ACCESS if key in tags), "yes")
    bus = any(tags.get(key) in ("yes", "designated") for key in ("bus", "psv"))
    return access in _CLOSED or (access in ("private", "permit") and bus)


def _build_street_map(ids: Any, degrees: FloatArray, ways: list[OsmWay], file: Path) -> StreetMap:
    used = np.unique([node for way in ways for node in way.nodes])
    order = np.argsort(ids)
    at = np.clip(np.searchsorted(ids[order], used), 0, len(ids) - 1)
    known = ids[order][at] == used
    if not known.any():
        raise InputError(f"{file} has no streets for vehicles")
    found = degrees[order][at[known]]
    low, high = found.min(axis=0), found.max(axis=0)
    origin = float(low[0] + high[0]) / 2, float(low[1] + high[1]) / 2
    scale = np.array([math.cos(math.radians(origin[0])), 1.0]) * EARTH_RADIUS
    xy = np.radians(found[:, ::-1] - np.array(origin[::-1])) * scale
    places = {str(node): place for node, place in zip(used[known].tolist(), xy, strict=True)}
    return StreetMap(origin, places, tuple(_cut_ways(ways, places)))


def _cut_ways(ways: Iterable[OsmWay], places: Mapping[str, FloatArray]) -> Iterator[StreetPiece]:
    """The ways, cut where they meet."""
    lines = [([str(n) for n in way.nodes if str(n) in places], way.tags) for way in ways]
    count: Counter[str] = Counter()
    for nodes, _ in lines:
        count.update(nodes)
        count.update([*nodes[:1], *nodes[-1:]])
    for nodes, tags in lines:
        ring, oneway = tags.get("junction") in _RINGS, tags.get("oneway")
        cuts = [k for k, node in enumerate(nodes) if count[node] > 1]
        for a, b in pairwise(cuts):
            own = nodes[a : b + 1][:: -1 if oneway == "-1" else 1]
            yield StreetPiece(
                start=own[0],
                end=own[-1],
                line=np.array([places[node] for node in own]),
                name=tags.get("name") or tags.get("ref") or "",
                is_one_way=ring or oneway in ("yes", "1", "true", "-1"),
                is_ring=ring,
                is_slip=tags.get("highway") in _SLIPS,
            )


def survey_osm_junctions(file: Path) -> JunctionOverview:
    """The junctions of a file and its streets; the id of a junction is the least of its nodes' ids.

    So it does not depend on how the file is converted, nor on the side that is driven on.
    """
    streets = read_streets(file)
    # The pieces, those joined that only meet one another at the end of ways.
    at: dict[str, list[int]] = {}
    pieces: list[StreetPiece | None] = list(streets.pieces)
    for k, piece in enumerate(streets.pieces):
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
    found = group_junctions(streets.places, [each for each in pieces if each is not None])
    return JunctionOverview(
        tuple(describe_group(group, streets.origin) for group in found),
        tuple(piece.line for piece in streets.pieces),
    )


def _join_pieces(a: StreetPiece, b: StreetPiece, node: str) -> StreetPiece | None:
    if a.is_one_way or b.is_one_way:
        if not (a.is_one_way and b.is_one_way):
            return None
        a, b = (a, b) if a.end == node else (b, a)
        if a.end != node or b.start != node:
            return None
    first = a if a.end == node else _turn_round(a)
    second = b if b.start == node else _turn_round(b)
    return StreetPiece(
        first.start, second.end, np.concatenate([first.line, second.line[1:]]),
        first.name or second.name, a.is_one_way, a.is_ring, a.is_slip,
        second.name_at(second.end) or first.name,
    )  # fmt: skip


def _turn_round(piece: StreetPiece) -> StreetPiece:
    return StreetPiece(
        piece.end, piece.start, piece.line[::-1], piece.name_at(piece.end), piece.is_one_way,
        piece.is_ring, piece.is_slip, piece.name,
    )  # fmt: skip


def describe_group(group: JunctionGroup, origin: LatLon | None) -> Junction:
    """A group of nodes as a junction to choose."""
    return Junction(
        id=min(group.nodes, key=lambda node: (len(node), node)),
        xy=group.xy,
        legs=len(group.legs),
        name=", ".join(sorted({leg.street for leg in group.legs} - {""}))[:80],
        size=len(group.legs),
        streets=tuple(leg.street for leg in group.legs),
        bearings=tuple(leg.bearing for leg in group.legs),
        is_roundabout=group.is_roundabout,
        nodes=group.nodes,
        origin=origin,
    )


_LARGE = 2_000_000
"""Of a file larger than that only the surroundings of the junction are converted [bytes]."""


def cut_out_if_needed(file: Path, scratch: Path, middle: LatLon) -> Path:
    """The file, or the surroundings of a place in one that netconvert should not read whole.

    That is one that is large or of protocol buffers, or has streets that are closed to cars, which
    netconvert takes for open ones.
    """
    if not is_pbf(file) and file.stat().st_size <= _LARGE and not _has_closed_ways(file):
        return file
    part = scratch / "surroundings.osm"
    cut_out(file, part, middle=middle)
    return part


def count_barred_turns(file: Path, nodes: Set[str]) -> int:
    """How many turns at some nodes the file's restrictions may forbid: one, or all but one."""
    barred = 0
    for each in iterate_elements(file):
        if isinstance(each, OsmRelation) and any(str(n) in nodes for _, n, _ in each.members):
            kind = each.tags.get("restriction", "")
            barred += kind.startswith("no_") + 2 * kind.startswith("only_")
    return barred


def _has_closed_ways(file: Path) -> bool:
    return any(isinstance(x, OsmWay) and _is_closed_street(x) for x in iterate_elements(file))


def _is_closed_street(way: OsmWay) -> bool:
    return way.tags.get("highway") in _DRIVEN and is_closed(way.tags)


def cut_out(file: Path, target: Path, *, middle: LatLon) -> None:
    """The surroundings of a place as an OpenStreetMap file of XML, without streets closed to cars.

    Ways keep the nodes inside and one beyond; relations are kept where a way of theirs is.
    """
    if not is_in_degrees(middle):
        raise InputError(f"{middle[0]:g},{middle[1]:g} are no latitude and longitude")
    reach = np.degrees(AROUND / EARTH_RADIUS) / np.array([1.0, math.cos(math.radians(middle[0]))])
    inside: set[int] = set()
    kept_ways: list[OsmWay] = []
    relations: list[OsmRelation] = []
    ways: set[int] = set()
    for element in iterate_elements(file):
        if isinstance(element, OsmNodes):
            near = (np.abs(element.degrees - np.array(middle)) <= reach).all(axis=1)
            inside.update(element.ids[near].tolist())
        elif isinstance(element, OsmWay):
            if not inside.isdisjoint(element.nodes) and not _is_closed_street(element):
                # From one node before the first inside to one after the last.
                where = [k for k, node in enumerate(element.nodes) if node in inside]
                stretch = element.nodes[max(where[0] - 1, 0) : where[-1] + 2]
                kept_ways.append(OsmWay(element.id, stretch, element.tags))
                ways.add(element.id)
        elif any(kind == "way" and number in ways for kind, number, _ in element.members):
            relations.append(element)
    wanted = inside.union(*(way.nodes for way in kept_ways))
    with target.open("w", encoding="utf-8") as stream:
        stream.write('<?xml version="1.0" encoding="UTF-8"?>\n<osm version="0.6">\n')
        for element in iterate_elements(file):
            if not isinstance(element, OsmNodes):
                break
            for number, (lat, lon) in zip(
                element.ids.tolist(), element.degrees.tolist(), strict=True
            ):
                if number in wanted:
                    tags = _write_tags(element.tags.get(number, {}))
                    stream.write(
                        f'<node id="{number}" lat="{lat:.8f}" lon="{lon:.8f}">{tags}</node>\n'
                    )
        stream.writelines(map(_write_element, kept_ways))
        stream.writelines(map(_write_element, relations))
        stream.write("</osm>\n")


def _write_element(element: OsmWay | OsmRelation) -> str:
    if isinstance(element, OsmWay):
        inner = "".join(f'<nd ref="{node}"/>' for node in element.nodes)
        return f'<way id="{element.id}">{inner}{_write_tags(element.tags)}</way>\n'
    inner = "".join(
        f'<member type="{kind}" ref="{number}" role={quoteattr(role)}/>'
        for kind, number, role in element.members
    )
    return f'<relation id="{element.id}">{inner}{_write_tags(element.tags)}</relation>\n'


def _write_tags(tags: Mapping[str, str]) -> str:
    return "".join(f"<tag k={quoteattr(k)} v={quoteattr(v)}/>" for k, v in tags.items())
