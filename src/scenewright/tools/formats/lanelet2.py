"""The lanelets of an intersection as a Lanelet2 map, for other tools and for importing it again."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import count
from xml.etree import ElementTree

from scenewright.geometry.geographic import LatLon, unproject_mercator
from scenewright.scene.base import Point
from scenewright.scene.map import IntersectionMap
from scenewright.tools.formats.lanes import find_crosswalk_edges
from scenewright.tools.formats.xml import add, write_bytes

NOWHERE: LatLon = (0.0, 0.0)
"""Where a map lies whose place is not known."""


def write_lanelet2(intersection_map: IntersectionMap, origin: LatLon | None) -> bytes:
    """The .osm of a map: lanelets of vehicles with their streets and limits, and crosswalks.

    Args:
        origin: latitude and longitude of the map's middle.
    """
    writer = _Writer(origin or NOWHERE)
    roads = {leg.name: leg.road for leg in intersection_map.legs}
    for lanelet in intersection_map.lanelets:
        if lanelet.kind == "parking":
            continue
        tags = {
            "type": "lanelet", "subtype": "road", "location": "urban", "one_way": "yes",
            "participant:vehicle": "yes", "speed_limit": f"{3.6 * lanelet.speed_limit:.0f} km/h",
        }  # fmt: skip
        if lanelet.leg is not None:
            tags["name"] = roads[lanelet.leg]
        writer.add_lanelet(lanelet.left, lanelet.right, tags)
    for crosswalk in intersection_map.crosswalks:
        left, right = (
            [(x, y) for x, y in edge] for edge in find_crosswalk_edges(crosswalk).tolist()
        )
        tags = {"type": "lanelet", "subtype": "crosswalk", "participant:pedestrian": "yes"}
        writer.add_lanelet(left, right, tags)
    return write_bytes(writer.finish())


class _Writer:
    """Nodes, ways and relations with numbers; points at one place are one node."""

    def __init__(self, origin: LatLon) -> None:
        self._origin = origin
        self._numbers = count(1)
        self._points: dict[Point, int] = {}
        # In the order in which a document has them.
        self._nodes, self._ways, self._relations = (ElementTree.Element("osm") for _ in range(3))

    def _add_way(self, line: Sequence[Point]) -> int:
        for point in line:
            if point not in self._points:
                self._points[point] = number = next(self._numbers)
                lat, lon = unproject_mercator(self._origin, point)
                add(self._nodes, "node", id=number, lat=f"{lat:.9f}", lon=f"{lon:.9f}")
        number = next(self._numbers)
        way = add(self._ways, "way", id=number)
        for point in line:
            add(way, "nd", ref=self._points[point])
        add(way, "tag", k="type", v="line_thin")
        return number

    def add_lanelet(
        self, left: Sequence[Point], right: Sequence[Point], tags: dict[str, str]
    ) -> None:
        """A lanelet between two bounds [m]."""
        bounds = {"left": self._add_way(left), "right": self._add_way(right)}
        relation = add(self._relations, "relation", id=next(self._numbers))
        for role, number in bounds.items():
            add(relation, "member", type="way", ref=number, role=role)
        for key, value in tags.items():
            add(relation, "tag", k=key, v=value)

    def finish(self) -> ElementTree.Element:
        """The document."""
        root = ElementTree.Element("osm", version="0.6", generator="scenewright")
        for part in (self._nodes, self._ways, self._relations):
            root.extend(part)
        return root
