"""Features of OpenStreetMap files that netconvert leaves out: crossings and lights."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

import numpy as np

from scenewright.geometry.polyline import rotate_left
from scenewright.scene.base import FloatArray
from scenewright.tools.map_import.map_parts import geos, list_points
from scenewright.tools.map_import.osm_file import OsmFile, Tags, is_one_way, read_number
from scenewright.tools.map_import.survey import SurveyCrossing, SurveyLight

_WALKED = ("footway", "path", "pedestrian", "cycleway", "steps", "bridleway")
_LANE = 3.25
_ASSUMED_WIDTH = 4.0
"""Of a crossing [m]; OpenStreetMap seldom says."""
_SAME_PLACE = 3.0
"""A crossing's way and node on one road that lie closer are the same [m]."""
_CROSSINGS = (("crossing", True), ("crossing", False), ("traffic_signals", True))
"""Values of the tag `highway` of nodes that are crossings, and whether they have one more tag."""
_UNMARKED = ("unmarked", "no", "informal")
_SIGNALISED = {"traffic_signals": True, "uncontrolled": False, "zebra": False, "unmarked": False}
_MOST_ASKEW = math.radians(50.0)
"""Between a crossing's way and the line straight across; one more askew leads along the road."""


def list_osm_crossings(osm: OsmFile, middle: FloatArray) -> list[SurveyCrossing]:
    """The crossings of roads round a place: nodes of roads, and footways that cross one."""
    walks = [(name, tags, nodes) for name, tags, nodes in _list_crossing_ways(osm)]
    way_at = {node: k for k, (_, _, nodes) in enumerate(walks) for node in nodes}
    lines = [geos.LineString([osm.nodes[n] for n in nodes]) for _, _, nodes in walks]
    tree = geos.STRtree(lines)
    found: list[tuple[bool, bool, SurveyCrossing]] = []
    for _, road, names in osm.list_roads():
        nodes = [node for node in names if node in osm.nodes]
        if len(nodes) < 2:
            continue
        line = geos.LineString([osm.nodes[n] for n in nodes])
        places = [
            (geos.Point(osm.nodes[n]), f"node {n}", osm.node_tags[n], way_at.get(n))
            for n in nodes
            if (own := osm.node_tags.get(n, {})).get("crossing") != "no"
            and (own.get("highway"), "crossing" in own) in _CROSSINGS
        ]
        places += [
            (point, f"way {walks[k][0]}", {}, k)
            for k in tree.query(line, predicate="intersects").tolist()
            for point in list_points(line.intersection(lines[k]))
        ]
        for point, source, tags, k in places:
            s = line.project(point)
            a, b = (np.array(line.interpolate(max(s + d, 0.0)).coords[0]) for d in (-1.0, 1.0))
            straight = rotate_left((b - a) / max(float(np.hypot(*(b - a))), 1e-9))
            known, limits, across = tags, None, straight
            if k is not None:
                known, walk = {**walks[k][1], **tags}, lines[k]
                limits = np.array([walk.coords[0], walk.coords[-1]])
                w = walk.project(point)
                c, d = (np.array(walk.interpolate(max(w + x, 0.0)).coords[0]) for x in (-0.1, 0.1))
                drawn = (d - c) / max(float(np.hypot(*(d - c))), 1e-9)
                across = drawn if abs(drawn @ straight) > math.cos(_MOST_ASKEW) else straight
            # [m] the lanes that are tagged, else one for each direction; and a little beside them.
            is_oneway = is_one_way(road)
            lanes = read_number(road.get("lanes")) or (1.5 if is_oneway else 2.0)
            half = (_LANE * max(lanes, 1.0) + (1.0 if is_oneway else 3.0)) / 2
            kind = known.get("crossing", "")
            lit = "traffic_signals" if known.get("crossing:signals") == "yes" else kind
            crossing = SurveyCrossing(
                np.array(point.coords[0]) + np.outer([-half, half], across),
                read_number(known.get("width")) or _ASSUMED_WIDTH,
                source=source,
                is_bounded=False,
                is_marked=kind not in _UNMARKED and known.get("crossing:markings") != "no",
                has_island=known.get("crossing:island") == "yes",
                is_signalised=_SIGNALISED.get(lit),
                limits=limits,
            )
            ends_here = not 0.1 < s < line.length - 0.1
            found.append((source.startswith("way"), ends_here, crossing))
    # One drawn as node and way counts once; where roads meet, that which goes on is crossed.
    kept: list[SurveyCrossing] = []
    for _, _, each in sorted(found, key=lambda x: x[:2]):
        at = each.line.mean(axis=0)
        if all(math.dist(x.line.mean(axis=0), at) > _SAME_PLACE for x in kept):
            kept.append(each)
    return [each.move(-middle) for each in kept]


def list_osm_lights(osm: OsmFile, middle: FloatArray) -> list[SurveyLight]:
    """The traffic lights on roads round a place."""
    on_roads = {
        node
        for _, _, nodes in osm.list_roads()
        for node in nodes
        if node in osm.nodes and osm.node_tags.get(node, {}).get("highway") == "traffic_signals"
    }
    return [SurveyLight(osm.nodes[node] - middle) for node in sorted(on_roads)]


def list_osm_lines(osm: OsmFile) -> Mapping[str, list[FloatArray]]:
    """Ways, crossings and lights of a file by kind, for pictures [m]."""
    found: dict[str, list[FloatArray]] = {"roads": [], "paths": [], "crossings": []}
    roads = {name for name, _, _ in osm.list_roads()}
    walks = {name for name, _, _ in _list_crossing_ways(osm)}
    for name, (tags, nodes) in osm.ways.items():
        line = [osm.nodes[n] for n in nodes if n in osm.nodes]
        if "highway" in tags and len(line) > 1:
            kind = "roads" if name in roads else "crossings" if name in walks else "paths"
            found[kind].append(np.array(line))
    tagged = [(osm.nodes[n], tags) for n, tags in osm.node_tags.items() if n in osm.nodes]
    found["crossing_nodes"] = [at for at, tags in tagged if tags.get("highway") == "crossing"]
    found["lights"] = [at for at, tags in tagged if "traffic_signals" in tags.values()]
    return found


def _list_crossing_ways(osm: OsmFile) -> Iterator[tuple[str, Tags, list[str]]]:
    """Ways on foot that are crossings, with those of their nodes that have a place."""
    for name, (tags, nodes) in osm.ways.items():
        kind = tags.get("highway")
        if kind not in _WALKED or tags.get("crossing") == "no":
            continue
        is_crossing = "crossing" in (tags.get("footway"), tags.get("path"), tags.get(kind))
        on_foot = kind != "cycleway" or tags.get("foot") in ("yes", "designated")
        known = [node for node in nodes if node in osm.nodes]
        if is_crossing and on_foot and len(known) > 1:
            yield name, tags, known
