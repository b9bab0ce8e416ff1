"""OpenStreetMap files, read by osmium: their elements, and what lies round one place."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from scenewright.errors import InputError
from scenewright.geometry.geographic import EARTH_RADIUS, LatLon, project_ellipsoid
from scenewright.scene.base import FloatArray
from scenewright.tools.map_import.check_file import is_pbf

AROUND = 350.0
"""How much of a file is cut out about a junction in every direction [m]."""
_DRIVEN = frozenset(
    (
        *("motorway", "trunk", "primary", "secondary", "tertiary", "unclassified", "residential"),
        *("motorway_link", "trunk_link", "primary_link", "secondary_link", "tertiary_link"),
        *("living_street", "road"),
    )
)
RINGS = ("roundabout", "circular")
"""Values of the tag `junction`, of ways round an island."""
_ROADS = _DRIVEN | {"service", "busway"}
_ACCESS = ("motorcar", "motor_vehicle", "vehicle", "access")
"""Tags that say who may drive along a way; the first one that a way has holds for cars."""
_NARROWEST = 2.5
"""Of a lane of a street that cars drive on [m]."""
_CLOSED = ("no", "bus", "psv", "agricultural", "forestry")

Tags = Mapping[str, str]


class Restriction(NamedTuple):
    """A rule on turns: `no_...`, or `only_...`; ids of ways, and of nodes between them."""

    kind: str
    from_: frozenset[str]
    via: frozenset[str]
    to: frozenset[str]


@dataclass(frozen=True, eq=False)
class OsmFile:
    """A part of a file, its nodes in metres from an origin.

    Attributes:
        node_tags: of the few nodes that have some; ways: (tags, node ids) by id.
        restrictions: of turns that are forbidden, or alone allowed.
    """

    nodes: dict[str, FloatArray] = field(default_factory=dict)
    node_tags: dict[str, Tags] = field(default_factory=dict)
    ways: dict[str, tuple[Tags, tuple[str, ...]]] = field(default_factory=dict)
    restrictions: list[Restriction] = field(default_factory=list)

    def list_roads(self) -> Iterator[tuple[str, Tags, tuple[str, ...]]]:
        """Ways for vehicles."""
        for name, (tags, nodes) in self.ways.items():
            if tags.get("highway") in _ROADS and tags.get("area") != "yes":
                yield name, tags, nodes


def is_driven(tags: Tags) -> bool:
    """Whether cars drive along a way of these tags; service roads do not count."""
    street = tags.get("highway") in _DRIVEN and tags.get("area") != "yes"
    return street and not _is_closed(tags)


def _is_closed(tags: Tags) -> bool:
    """Whether a way of these tags is closed to cars, as one for buses alone."""
    access = next((tags[key] for key in _ACCESS if key in tags), "yes")
    bus = any(tags.get(key) in ("yes", "designated") for key in ("bus", "psv"))
    return access in _CLOSED or (access in ("private", "permit") and bus)


def iterate_elements(file: Path, *filters: Any) -> Iterator[Any]:
    """The elements of a file in its order, ways with the places of their nodes.

    Args:
        filters: of osmium, that leave elements out.

    Raises:
        InputError: damaged, or with coordinates that are no degrees.
    """
    osmium = import_module("osmium")
    source = osmium.io.File(str(file), "pbf" if is_pbf(file) else "osm")
    places = osmium.index.create_map("flex_mem")
    collect = osmium.NodeLocationsForWays(places)
    collect.ignore_errors()
    try:
        osmium.apply(source, collect)  # first all places: some files hold ways before their nodes
        found = osmium.FileProcessor(source).with_locations(places)
        for each in filters:
            found = found.with_filter(each)
        yield from found
    except osmium.InvalidLocationError as fault:
        raise InputError(
            f"{file} has coordinates that are no degrees ({str(fault)[-40:]}); OpenStreetMap files "
            "are not projected"
        ) from None
    except RuntimeError as fault:
        raise InputError(f"{file} is damaged or no OpenStreetMap file: {str(fault)[:80]}") from None


def list_places(way: Any) -> list[tuple[str, float, float]]:
    """Id, latitude and longitude of those nodes of a way whose place is known.

    Raises:
        InputError: a node has an id below zero, which osmium has no room for.
    """
    if any(node.ref < 0 for node in way.nodes):
        raise InputError(
            f"way {way.id} has nodes with ids below zero, as editors give them until a file is "
            "uploaded; give them new ones first (osmium renumber)"
        )
    return [(str(n.ref), n.lat, n.lon) for n in way.nodes if n.location.valid()]


def cut_out(file: Path, target: Path, *, middle: LatLon) -> bool:
    """Writes the surroundings of a place as OpenStreetMap XML, without streets closed to cars.

    Ways that reach into the square are kept whole, and restrictions of turns between them. A street
    whose tagged width leaves cars no room gets 2.5 m for each lane; whether there are such.
    """
    osmium = import_module("osmium")
    reach = np.degrees(AROUND / EARTH_RADIUS) / np.array([1.0, math.cos(math.radians(middle[0]))])
    low, high = np.array(middle) - reach, np.array(middle) + reach

    def is_near(lat: float, lon: float) -> bool:
        return bool(low[0] <= lat <= high[0] and low[1] <= lon <= high[1])

    ways, is_widened = set[int](), False
    out = osmium.io.File(str(target), "osm")
    source = osmium.io.File(str(file), "pbf" if is_pbf(file) else "osm")
    with osmium.BackReferenceWriter(out, ref_src=source, overwrite=True) as writer:
        for each in iterate_elements(file, osmium.filter.EmptyTagFilter()):
            if each.is_node() and each.location.valid() and is_near(each.lat, each.lon):
                writer.add(each)
            elif each.is_way() and any(is_near(*place) for _, *place in list_places(each)):
                tags = dict(each.tags)
                if tags.get("highway") not in _DRIVEN or not _is_closed(tags):
                    ways.add(each.id)
                    wide = _widen(tags)
                    is_widened |= wide != tags
                    writer.add(each.replace(tags=wide))
            elif each.is_relation() and "restriction" in each.tags:
                own = {member.ref for member in each.members if member.type == "w"}
                if own & ways:
                    writer.add(each)
    return is_widened


def _widen(tags: Tags) -> Tags:
    """The tags of a way, its lanes no narrower than 2.5 m as netconvert divides its width."""
    width, lanes = (read_number(tags.get(key)) for key in ("width", "lanes"))
    least = _NARROWEST * max(lanes or 1.0, 1.0 if is_one_way(tags) else 2.0)
    if tags.get("highway") not in _DRIVEN or width is None or width >= least:
        return tags
    return {**tags, "width": f"{least:g}"}


def is_one_way(tags: Tags) -> bool:
    """Whether vehicles drive one way along a way of these tags."""
    return tags.get("junction") in RINGS or tags.get("oneway") in ("yes", "1", "true", "-1")


def read_number(text: str | None) -> float | None:
    """The number that a tag begins with, if there is one."""
    try:
        return float((text or "").split()[0])
    except (ValueError, IndexError):
        return None


def read_osm_file(file: Path, origin: LatLon) -> OsmFile:
    """The nodes, ways and restrictions of a file that is not large."""
    found = OsmFile()
    for each in iterate_elements(file):
        tags = dict(each.tags)
        if each.is_node():
            if each.location.valid():
                found.nodes[str(each.id)] = project_ellipsoid(origin, (each.lat, each.lon))
            if tags:
                found.node_tags[str(each.id)] = tags
        elif each.is_way():
            found.ways[str(each.id)] = tags, tuple(str(node.ref) for node in each.nodes)
        elif "restriction" in tags:
            members = [(member.role, str(member.ref)) for member in each.members]
            roles = (
                frozenset(ref for own, ref in members if own == role)
                for role in ("from", "via", "to")
            )
            found.restrictions.append(Restriction(tags["restriction"], *roles))
    return found
