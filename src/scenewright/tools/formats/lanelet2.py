"""The lanelets of an intersection as a Lanelet2 map, for other tools and for importing it again."""

from __future__ import annotations

from collections.abc import Sequence
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
        self.origin = origin
        self.nodes: dict[Point, int] = {}
        self.ways: list[tuple[int, list[int]]] = []
        self.relations: list[tuple[int, int, int, dict[str, str]]] = []
        self._last = 0

    def _number(self) -> int:
        self._last += 1
        return self._last

    def _add_way(self, line: Sequence[Point]) -> int:
        for point in line:
            if point not in self.nodes:
                self.nodes[point] = self._number()
        nodes = [self.nodes[point] for point in line]
        number = self._number()
        self.ways.append((number, nodes))
        return number

    def add_lanelet(
        self, left: Sequence[Point], right: Sequence[Point], tags: dict[str, str]
    ) -> None:
        """A lanelet between two bounds [m]."""
        bounds = self._add_way(left), self._add_way(right)
        self.relations.append((self._number(), *bounds, tags))

    def finish(self) -> ElementTree.Element:
        """The document."""
        root = ElementTree.Element("osm", version="0.6", generator="scenewright")
        for point, number in self.nodes.items():
            lat, lon = unproject_mercator(self.origin, point)
            add(root, "node", id=number, lat=f"{lat:.9f}", lon=f"{lon:.9f}")
        for number, nodes in self.ways:
            way = add(root, "way", id=number)
            for node in nodes:
                add(way, "nd", ref=node)
            add(way, "tag", k="type", v="line_thin")
        for number, left, right, tags in self.relations:
            relation = add(root, "relation", id=number)
            add(relation, "member", type="way", ref=left, role="left")
            add(relation, "member", type="way", ref=right, role="right")
            for key, value in tags.items():
                add(relation, "tag", k=key, v=value)
        return root
