"""The geometry of a map file as it stands there, for the picture beneath an imported map."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from scenewright.geometry.geographic import LatLon, project_mercator, project_to_degrees
from scenewright.scene.base import FloatArray
from scenewright.tools.map_import.check_file import MapFormat, unpack_map
from scenewright.tools.map_import.opendrive_features import (
    list_lane_borders,
    list_opendrive_crossings,
    read_opendrive_file,
)
from scenewright.tools.map_import.osm_features import read_osm_file
from scenewright.tools.map_import.osm_streets import cut_out_if_needed
from scenewright.tools.map_import.read_lane_maps import load_lane_map
from scenewright.tools.map_import.read_lanelet2 import read_elements

_REACH = 130.0
"""Lines farther from the junction are left out [m]."""


@dataclass(frozen=True, eq=False)
class RawGeometry:
    """Lines and places of a file in the frame of the imported map [m].

    Attributes:
        roads, paths, crossings: [P, 2] each; lights, crossing_nodes: [2] each.
    """

    roads: tuple[FloatArray, ...] = ()
    paths: tuple[FloatArray, ...] = ()
    crossings: tuple[FloatArray, ...] = ()
    lights: tuple[FloatArray, ...] = ()
    crossing_nodes: tuple[FloatArray, ...] = ()


def read_raw_geometry(
    file: Path, map_format: MapFormat, origin: LatLon | None, offset: tuple[float, float]
) -> RawGeometry:
    """The lines of a file round an imported junction.

    Args:
        origin: of the file's coordinates; offset: of the map's origin in them [m].
    """
    shift = np.array(offset)
    with tempfile.TemporaryDirectory() as scratch:
        path = unpack_map(file, Path(scratch))
        if map_format == "osm" and origin is not None:
            path = cut_out_if_needed(path, Path(scratch), project_to_degrees(origin, shift))
        layers = _READERS[map_format](path, origin or (0.0, 0.0))
        near = {
            name: tuple(
                line - shift
                for line in lines
                if len(line) and np.abs(np.atleast_2d(line - shift)).max(axis=1).min() < _REACH
            )
            for name, lines in layers.items()
        }
    return RawGeometry(**near)


_Layers = Mapping[str, Iterable[FloatArray]]


def _read_osm(file: Path, origin: LatLon) -> _Layers:
    osm = read_osm_file(file, origin)
    layers: dict[str, list[FloatArray]] = {"roads": [], "paths": [], "crossings": []}
    roads = {name for name, _, _ in osm.list_roads()}
    for name, (tags, nodes) in osm.ways.items():
        line = [osm.nodes[n] for n in nodes if n in osm.nodes]
        if "highway" not in tags or len(line) < 2:
            continue
        is_crossing = "crossing" in (tags.get("footway"), tags.get("path"), tags.get("cycleway"))
        kind = "roads" if name in roads else "crossings" if is_crossing else "paths"
        layers[kind].append(np.array(line))
    tagged = [(osm.nodes[n], tags) for n, tags in osm.node_tags.items() if n in osm.nodes]
    layers["crossing_nodes"] = [at for at, tags in tagged if tags.get("highway") == "crossing"]
    layers["lights"] = [at for at, tags in tagged if "traffic_signals" in tags.values()]
    return layers


def _read_lanelet2(file: Path, origin: LatLon) -> _Layers:
    elements = read_elements(file)
    layers: dict[str, list[FloatArray]] = {}
    on_foot = elements.list_crosswalk_bounds()
    for name, nodes in elements.ways.items():
        points = [project_mercator(origin, elements.nodes[n]) for n in nodes if n in elements.nodes]
        kind = elements.way_tags.get(name, {}).get("type", "")
        if len(points) < 2:
            continue
        layer = "crossings" if name in on_foot or "zebra" in kind else "roads"
        layers.setdefault("lights" if kind == "traffic_light" else layer, []).append(
            np.mean(points, axis=0) if kind == "traffic_light" else np.array(points)
        )
    return layers


def _read_opendrive(file: Path, _origin: LatLon) -> _Layers:
    drive = read_opendrive_file(file)
    crossings = list_opendrive_crossings(drive, np.zeros(2))
    return {
        "roads": [line for road in drive.roads for line in (road.points, *list_lane_borders(road))],
        "crossings": [each.line for each in crossings],
        "lights": list(drive.lights.values()),
    }


def _read_sumo(file: Path, _origin: LatLon) -> _Layers:
    layers: dict[str, list[FloatArray]] = {"roads": [], "paths": [], "crossings": []}
    kinds = {"crossing": "crossings", "walkingarea": "paths"}
    for _, edge in ElementTree.iterparse(file, events=("end",)):
        if edge.tag == "edge":
            for lane in edge.iter("lane"):
                points = [point.split(",")[:2] for point in (lane.get("shape") or "").split()]
                layer = kinds.get(edge.get("function", ""), "roads")
                layers[layer].append(np.array(points, dtype=float).reshape(-1, 2))
            edge.clear()
    return layers


def _read_lane_map(file: Path, map_format: str) -> _Layers:
    held = load_lane_map(file, map_format)
    return {
        "roads": [side for each in held.lanelets.values() for side in (each.left, each.right)],
        "crossings": [each.line for each in held.crossings],
    }


_READERS: Mapping[str, Callable[[Path, LatLon], _Layers]] = {
    "commonroad": lambda file, _: _read_lane_map(file, "commonroad"),
    "argoverse2": lambda file, _: _read_lane_map(file, "argoverse2"),
    "womd": lambda file, _: _read_lane_map(file, "womd"),
    "osm": _read_osm,
    "lanelet2": _read_lanelet2,
    "opendrive": _read_opendrive,
    "sumo": _read_sumo,
}
