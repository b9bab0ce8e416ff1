"""Features of OpenStreetMap files that netconvert leaves out: crossings, lights, countries."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from scenewright.geometry.geographic import LatLon, project_ellipsoid
from scenewright.scene.base import FloatArray
from scenewright.tools.map_import.map_parts import geos, list_points
from scenewright.tools.map_import.osm_elements import OsmNodes, OsmWay, iterate_elements
from scenewright.tools.map_import.survey import SurveyCrossing, SurveyLight

_ROADS = (
    "motorway", "trunk", "primary", "secondary", "tertiary", "unclassified", "residential",
    "living_street", "service", "road", "busway",
)  # fmt: skip
_ROAD_KINDS = {*_ROADS, *(f"{road}_link" for road in _ROADS[:5])}
_WALKED = ("footway", "path", "pedestrian", "cycleway", "steps", "bridleway")
_LANE = 3.25
_ASSUMED_WIDTH = 4.0
"""Of a crossing [m]; OpenStreetMap seldom says."""
_SAME_PLACE = 3.0
"""A crossing's way and node on one road that lie closer are the same [m]."""
_REACH = 150.0
"""Crossings are looked for that far from the junction [m]."""
_UNMARKED = ("unmarked", "no", "informal")

Tags = Mapping[str, str]


@dataclass(frozen=True, eq=False)
class OsmFile:
    """Nodes [m] from an origin, with those tags that matter here, and ways.

    Attributes:
        ways: (tags, node ids) by id.
    """

    nodes: dict[str, FloatArray] = field(default_factory=dict)
    node_tags: dict[str, Tags] = field(default_factory=dict)
    ways: dict[str, tuple[Tags, tuple[str, ...]]] = field(default_factory=dict)

    def list_roads(self) -> Iterator[tuple[str, Tags, tuple[str, ...]]]:
        """Ways for vehicles."""
        for name, (tags, nodes) in self.ways.items():
            if tags.get("highway") in _ROAD_KINDS and tags.get("area") != "yes":
                yield name, tags, nodes


def read_osm_file(file: Path, origin: LatLon) -> OsmFile:
    """The nodes and ways of a file that is known to be well-formed."""
    found = OsmFile()
    for each in iterate_elements(file):
        if isinstance(each, OsmNodes):
            for name, place in zip(each.ids.tolist(), each.degrees.tolist(), strict=True):
                found.nodes[str(name)] = project_ellipsoid(origin, place)
            found.node_tags.update((str(name), tags) for name, tags in each.tags.items())
        elif isinstance(each, OsmWay):
            found.ways[str(each.id)] = each.tags, tuple(map(str, each.nodes))
    return found


def list_osm_crossings(osm: OsmFile, middle: FloatArray) -> list[SurveyCrossing]:
    """The crossings of roads round a place: nodes of roads, and footways that cross one."""
    roads = [each for each in osm.list_roads() if _is_near(osm, each[2], middle)]
    ways = [each for each in _list_crossing_ways(osm) if _is_near(osm, each[2], middle)]
    way_at = {node: each for each in ways for node in each[2]}
    found: list[tuple[bool, SurveyCrossing | None]] = []
    for _, road, nodes in roads:
        for i, node in enumerate(nodes):
            tags, way = osm.node_tags.get(node, {}), way_at.get(node)
            is_crossing = _is_crossing_node(tags) or way is not None
            if node in osm.nodes and is_crossing:
                ends_here = i in (0, len(nodes) - 1)
                found.append((ends_here, _build_crossing(osm, road, nodes, i, tags, way)))
        found += [(False, each) for each in _list_unshared(osm, road, nodes, ways)]
    # Where roads meet, that which goes on is crossed rather than that which ends there.
    found.sort(key=lambda each: each[0])
    kept = _drop_repeated([each for _, each in found if each is not None])
    return [each.move(-middle) for each in kept]


def list_osm_lights(osm: OsmFile, middle: FloatArray) -> list[SurveyLight]:
    """The traffic lights on roads round a place."""
    on_roads = {
        node
        for _, _, nodes in osm.list_roads()
        if _is_near(osm, nodes, middle)
        for node in nodes
        if node in osm.nodes and osm.node_tags.get(node, {}).get("highway") == "traffic_signals"
    }
    return [SurveyLight(osm.nodes[node] - middle) for node in sorted(on_roads)]


def _is_near(osm: OsmFile, nodes: tuple[str, ...], middle: FloatArray) -> bool:
    points = [osm.nodes[n] for n in nodes if n in osm.nodes]
    if not points:
        return False
    low, high = np.min(points, axis=0), np.max(points, axis=0)
    return bool((low < middle + _REACH).all() and (high > middle - _REACH).all())


def _is_crossing_node(tags: Tags) -> bool:
    kind = tags.get("highway"), tags.get("crossing")
    if kind[1] == "no":
        return False
    return kind[0] == "crossing" or (kind[0] == "traffic_signals" and kind[1] is not None)


def _list_crossing_ways(osm: OsmFile) -> Iterator[tuple[str, Tags, tuple[str, ...]]]:
    """Ways on foot that are crossings."""
    for name, (tags, nodes) in osm.ways.items():
        kind = tags.get("highway")
        if kind not in _WALKED or "crossing" not in (
            tags.get("footway"),
            tags.get("path"),
            tags.get(kind),
        ):
            continue
        on_foot = kind != "cycleway" or tags.get("foot") in ("yes", "designated")
        if on_foot and tags.get("crossing") != "no":
            yield name, tags, nodes


def _build_crossing(
    osm: OsmFile,
    road: Tags,
    nodes: tuple[str, ...],
    i: int,
    tags: Tags,
    way: tuple[str, Tags, tuple[str, ...]] | None,
) -> SurveyCrossing | None:
    """The crossing of a road at its node number i, along the crossing way where there is one."""
    place = osm.nodes[nodes[i]]
    ahead = _find_direction(osm, nodes, i)
    if ahead is None:
        return None
    across = np.array([-ahead[1], ahead[0]])
    known = dict(way[1]) | dict(tags) if way is not None else tags
    if way is not None:
        drawn = _find_direction(osm, way[2], way[2].index(nodes[i]))
        if drawn is not None and abs(float(drawn @ across)) > math.cos(math.radians(50.0)):
            across = drawn
    source = f"node {nodes[i]}" if _is_crossing_node(tags) else f"way {way[0]}" if way else ""
    limits = None if way is None else _find_ends(osm, way[2])
    return _finish(place, across, road, known, source, limits)


def _find_ends(osm: OsmFile, nodes: tuple[str, ...]) -> FloatArray | None:
    """[2, 2] where a way begins and ends [m]."""
    known = [osm.nodes[n] for n in nodes if n in osm.nodes]
    return np.array([known[0], known[-1]]) if len(known) > 1 else None


def _finish(
    place: FloatArray,
    across: FloatArray,
    road: Tags,
    known: Tags,
    source: str,
    limits: FloatArray | None,
) -> SurveyCrossing:
    # [m] the lanes that are tagged, else one for each direction; and a little beside them.
    is_oneway = road.get("oneway") in ("yes", "1", "true", "-1")
    is_oneway = is_oneway or road.get("junction") == "roundabout"
    lanes = _read_number(road.get("lanes")) or (1.5 if is_oneway else 2.0)
    half = (_LANE * max(lanes, 1.0) + (1.0 if is_oneway else 3.0)) / 2
    signalised = {"traffic_signals": True, "uncontrolled": False, "zebra": False, "unmarked": False}
    kind = (
        "traffic_signals" if known.get("crossing:signals") == "yes" else known.get("crossing", "")
    )
    return SurveyCrossing(
        place + np.outer([-half, half], across),
        _read_number(known.get("width")) or _ASSUMED_WIDTH,
        source=source,
        is_bounded=False,
        is_marked=known.get("crossing") not in _UNMARKED and known.get("crossing:markings") != "no",
        has_island=known.get("crossing:island") == "yes",
        is_signalised=signalised.get(kind),
        limits=limits,
    )


def _find_direction(osm: OsmFile, nodes: tuple[str, ...], i: int) -> FloatArray | None:
    """[2] unit vector along a way at its node number i."""
    around = [osm.nodes[n] for n in nodes[max(i - 1, 0) : i + 2] if n in osm.nodes]
    step = around[-1] - around[0] if len(around) > 1 else np.zeros(2)
    length = float(np.hypot(*step))
    return None if length < 0.1 else np.asarray(step / length)


def _read_number(text: str | None) -> float | None:
    try:
        return float((text or "").split()[0])
    except (ValueError, IndexError):
        return None


def _list_unshared(
    osm: OsmFile,
    road: Tags,
    nodes: tuple[str, ...],
    ways: list[tuple[str, Tags, tuple[str, ...]]],
) -> Iterator[SurveyCrossing]:
    """Where crossing ways cross a road without sharing a node with it."""
    line = [osm.nodes[n] for n in nodes if n in osm.nodes]
    for name, tags, own in ways:
        steps = [osm.nodes[n] for n in own if n in osm.nodes]
        if set(own) & set(nodes) or len(steps) < 2 or len(line) < 2:
            continue
        walk = geos.LineString(steps)
        for point in list_points(walk.intersection(geos.LineString(line))):
            s = walk.project(point)
            a, b = (np.array(walk.interpolate(max(s + d, 0.0)).coords[0]) for d in (-0.1, 0.1))
            across = (b - a) / max(float(np.hypot(*(b - a))), 1e-9)
            place = np.array(point.coords[0])
            yield _finish(place, across, road, tags, f"way {name}", _find_ends(osm, own))


def _drop_repeated(found: list[SurveyCrossing]) -> list[SurveyCrossing]:
    """Without crossings that two pieces of one road, or a node and a way, both give."""
    kept: list[SurveyCrossing] = []
    for each in sorted(found, key=lambda x: not x.source.startswith("node")):
        middle = each.line.mean(axis=0)
        if all(float(np.hypot(*(x.line.mean(axis=0) - middle))) > _SAME_PLACE for x in kept):
            kept.append(each)
    return kept
