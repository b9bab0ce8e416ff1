"""Reader of SUMO networks, and of OpenStreetMap and OpenDRIVE files that netconvert converts."""

from __future__ import annotations

import math
import subprocess
from collections.abc import Iterator, Mapping
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from scenewright.errors import InputError
from scenewright.geometry.geographic import LatLon, is_in_degrees, project_to_degrees
from scenewright.geometry.polyline import find_point, measure_length
from scenewright.scene.base import Colour, FloatArray
from scenewright.tools.map_import.check_file import MapFormat
from scenewright.tools.map_import.junction_choice import (
    Junction,
    JunctionOverview,
    choose_junction,
)
from scenewright.tools.map_import.opendrive_features import (
    list_opendrive_crossings,
    read_opendrive_file,
)
from scenewright.tools.map_import.osm_features import list_osm_crossings, read_osm_file
from scenewright.tools.map_import.survey import (
    Survey,
    SurveyConnection,
    SurveyCrossing,
    SurveyLane,
)

_TIME_LIMIT = 60.0
"""netconvert is stopped after that long [s]."""
_LANE_REACH = 120.0
"""Lanes are followed that far out of the junction [m]."""
_STRAIGHT = math.radians(35.0)
_SAME_ROAD = math.radians(25.0)
_COLOURS: Mapping[str, Colour] = {"g": "green", "y": "yellow", "o": "green"}
_MISSING_SUMO = "importing this map needs SUMO{}: install the extra, scenewright[simulate]"
_CUT_OUT = "cut out the surroundings of the junction first"


def read_sumo(
    file: Path,
    map_format: MapFormat,
    scratch: Path,
    *,
    center: tuple[float, float] | None,
    junction: str | None,
    left_hand: bool | None,
) -> Survey:
    """One junction of a SUMO network, OpenStreetMap or OpenDRIVE file.

    Args:
        scratch: an empty folder for the converted network.

    Raises:
        InputError: not convertible, no junction in it, or several and none chosen.
    """
    origin = _find_middle_of_osm(file) if map_format == "osm" else None
    network = file
    if map_format != "sumo":
        network = scratch / "converted.net.xml"
        _convert(file, network, origin=origin, left_hand=bool(left_hand))
    net = _read_network(network, file)
    nodes = {node.getID(): node for node in net.getNodes() if _is_junction(node)}
    chosen = choose_junction(
        [_describe_junction(node) for node in nodes.values()],
        file=file,
        center=center,
        junction=junction,
        origin=origin,
    )
    left_hand = _is_left_hand(network) if left_hand is None else left_hand
    survey = _survey_junction(net, nodes[chosen.id], origin, left_hand)
    if map_format == "opendrive":
        drive = read_opendrive_file(file)
        own = list_opendrive_crossings(drive, np.array(survey.offset))
        survey = replace(survey, crossings=(*survey.crossings, *own))
    if map_format == "osm" and origin is not None:
        osm = read_osm_file(file, origin)
        survey = replace(survey, crossings=tuple(list_osm_crossings(osm, np.array(survey.offset))))
        survey.notes.append(
            "lane widths, turning lanes and signal times that the file does not tag are "
            "netconvert's guesses"
        )
    return survey


def survey_junctions(file: Path, map_format: MapFormat, scratch: Path) -> JunctionOverview:
    """All junctions of a SUMO network, OpenStreetMap or OpenDRIVE file, and the roads between them.

    Args:
        scratch: an empty folder for the converted network.

    Raises:
        InputError: not convertible.
    """
    origin = _find_middle_of_osm(file) if map_format == "osm" else None
    network = file
    if map_format != "sumo":
        network = scratch / "converted.net.xml"
        _convert(file, network, origin=origin, left_hand=False)
    net = _read_network(network, file)
    return JunctionOverview(
        tuple(_describe_junction(node) for node in net.getNodes() if _is_junction(node)),
        tuple(_get_shape(e) for e in net.getEdges(withInternal=False) if _list_driving_lanes(e)),
    )


def _convert(file: Path, network: Path, *, origin: LatLon | None, left_hand: bool) -> None:
    try:
        home = Path(import_module("sumo").SUMO_HOME)
    except ImportError:
        raise InputError(_MISSING_SUMO.format("")) from None
    command = [str(home / "bin" / "netconvert"), "-o", str(network), "--no-turnarounds", "true"]
    command += ["--junctions.internal-link-detail", "16", "--junctions.corner-detail", "8"]
    command += ["--no-warnings", "true", "--output.street-names", "true"]
    command += ["--offset.disable-normalization", "true", "--default.spreadtype", "roadCenter"]
    if origin is not None:
        where = f"+proj=tmerc +lat_0={origin[0]:.8f} +lon_0={origin[1]:.8f} +k=1 +ellps=WGS84"
        command += ["--osm-files", str(file), "--proj", f"{where} +units=m +no_defs"]
        command += ["--keep-edges.by-vclass", "passenger", "--junctions.join", "true"]
        command += ["--geometry.remove", "true", "--tls.join", "true", "--tls.discard-simple"]
        command += ["true", "--osm.turn-lanes", "true", "--roundabouts.guess", "true"]
    else:
        command += ["--opendrive-files", str(file), "--opendrive.curve-resolution", "1"]
    if left_hand:
        command += ["--lefthand", "true"]
    try:
        done = subprocess.run(
            command, capture_output=True, text=True, errors="replace", check=False,
            timeout=_TIME_LIMIT,
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        raise InputError(
            f"netconvert did not finish {file} within {_TIME_LIMIT:.0f} s; {_CUT_OUT}"
        ) from None
    if done.returncode != 0 or not network.is_file():
        lines = (line.strip() for line in done.stderr.splitlines() if line.strip())
        raise InputError(f"netconvert cannot read {file}: {next(lines, 'no reason given')[:200]}")


def _find_middle_of_osm(file: Path) -> LatLon:
    """Middle of all nodes of an OpenStreetMap file."""
    nodes = []
    for _, element in ElementTree.iterparse(file, events=("end",)):
        if element.tag == "node":
            try:
                node = float(element.attrib["lat"]), float(element.attrib["lon"])
            except (KeyError, ValueError):
                raise InputError(f"{file} has a node without latitude and longitude") from None
            if not is_in_degrees(node):
                raise InputError(
                    f"{file} has a node at latitude {node[0]:g}, longitude {node[1]:g}: these are "
                    "no degrees; OpenStreetMap files are not projected"
                )
            nodes.append(node)
        element.clear()
    if not nodes:
        raise InputError(f"{file} has no nodes")
    (south, west), (north, east) = np.min(nodes, axis=0), np.max(nodes, axis=0)
    if (span := max(north - south, east - west)) > 0.5:
        raise InputError(f"{file} spans {span:.1f} degrees; {_CUT_OUT}")
    return float(south + north) / 2, float(west + east) / 2


def _read_network(network: Path, file: Path) -> Any:
    try:
        reader = import_module("sumolib").net
    except ImportError:
        raise InputError(_MISSING_SUMO.format("'s library")) from None
    try:
        return reader.readNet(str(network), withInternal=True, withPrograms=True)
    except Exception as fault:  # the reader raises all kinds of exceptions for strange files
        raise InputError(f"cannot read the network in {file}: {str(fault)[:160]}") from None


def _list_roads_in(node: Any) -> list[Any]:
    return [e for e in node.getIncoming() if not e.getFunction() and _list_driving_lanes(e)]


def _list_roads_out(node: Any) -> list[Any]:
    return [e for e in node.getOutgoing() if not e.getFunction() and _list_driving_lanes(e)]


def _list_driving_lanes(edge: Any) -> list[Any]:
    return [lane for lane in edge.getLanes() if lane.allows("passenger")]


def _is_junction(node: Any) -> bool:
    roads_in, roads_out = _list_roads_in(node), _list_roads_out(node)
    return len(_measure_directions(node)) >= 3 and bool(roads_in) and bool(roads_out)


def _measure_directions(node: Any) -> list[float]:
    """Outward directions of a node's roads, those close to one another as one [rad]."""
    lines = [_get_shape(edge)[::-1] for edge in _list_roads_in(node)]
    lines += [_get_shape(edge) for edge in _list_roads_out(node)]
    found: list[float] = []
    for line in lines:
        ahead = find_point(line, 15.0) - line[0]
        angle = math.atan2(ahead[1], ahead[0])
        if all(abs(math.remainder(angle - other, math.tau)) > _SAME_ROAD for other in found):
            found.append(angle)
    return found


def _get_shape(part: Any) -> FloatArray:
    """[P, 2] the line of an edge or a lane [m]."""
    return np.asarray(np.array(part.getShape())[:, :2])


def _describe_junction(node: Any) -> Junction:
    roads = [*_list_roads_in(node), *_list_roads_out(node)]
    x, y = (float(value) for value in node.getCoord()[:2])
    return Junction(
        id=str(node.getID()),
        xy=(x, y),
        legs=len(_measure_directions(node)),
        name=", ".join(sorted({edge.getName() for edge in roads} - {"", None}))[:80],
        size=len(roads),
    )


def _survey_junction(net: Any, node: Any, origin: LatLon | None, left_hand: bool) -> Survey:
    outline = _get_shape(node) if node.getShape() else np.zeros((0, 2))
    middle = (
        outline.mean(axis=0) if len(outline) > 2 else np.array(node.getCoord()[:2], dtype=float)
    )
    approaches, exits = (
        {
            lane.getID(): _build_lane(lane, middle, inwards=inwards)
            for edge in roads
            for lane in _list_driving_lanes(edge)
        }
        for roads, inwards in ((_list_roads_in(node), True), (_list_roads_out(node), False))
    )
    connections = [
        SurveyConnection(
            name, link.getToLane().getID(), _trace_connection(net, link) - middle, _find_light(link)
        )
        for name in approaches
        for link in net.getLane(name).getOutgoing()
        if link.getToLane().getID() in exits
    ]
    used = {way.approach for way in connections}, {way.exit for way in connections}
    return Survey(
        title=_describe_junction(node).name or f"junction {node.getID()}",
        approaches={name: lane for name, lane in approaches.items() if name in used[0]},
        exits={name: lane for name, lane in exits.items() if name in used[1]},
        connections=tuple(connections),
        crossings=tuple(_read_crossings(net, node, middle)),
        areas=(outline - middle,) if len(outline) > 2 else (),
        phases=_read_phases(net, {way.light for way in connections if way.light is not None}),
        left_hand=left_hand,
        is_signalised=str(node.getType()).startswith("traffic_light"),
        origin=None if origin is None else project_to_degrees(origin, middle),
        offset=(round(float(middle[0]), 3), round(float(middle[1]), 3)),
        file_origin=origin,
        notes=[
            f"lane {name} leads nowhere and was dropped"
            for name in approaches
            if name not in used[0]
        ],
    )


def _build_lane(lane: Any, middle: FloatArray, *, inwards: bool) -> SurveyLane:
    """A lane with what lies straight before or behind it."""
    line = _get_shape(lane)
    here, reach = lane, measure_length(line)
    for _ in range(20):
        beyond = None if reach >= _LANE_REACH else _find_straight_lane(here, inwards=inwards)
        if beyond is None:
            break
        more = _get_shape(beyond)
        line = np.concatenate([more, line] if inwards else [line, more])
        here, reach = beyond, reach + measure_length(more)
    return SurveyLane(
        id=lane.getID(),
        line=line - middle,
        width=float(lane.getWidth()) or 3.2,
        speed=float(lane.getSpeed()),
        road=str(lane.getEdge().getName() or ""),
    )


def _find_straight_lane(lane: Any, *, inwards: bool) -> Any | None:
    """The lane before (or behind) that leads straight into this one, if there is one."""
    if inwards:
        found = [(x, _measure_turn(x, lane)) for x in lane.getIncoming() if not _is_internal(x)]
    else:
        following = (link.getToLane() for link in lane.getOutgoing())
        found = [(other, _measure_turn(lane, other)) for other in following]
    straight = [
        (turn, other.getID(), other)
        for other, turn in found
        if turn < _STRAIGHT and other.allows("passenger")
    ]
    return min(straight)[2] if straight else None


def _is_internal(lane: Any) -> bool:
    return bool(lane.getEdge().getFunction())


def _measure_turn(first: Any, second: Any) -> float:
    """The angle between the end of one lane and the beginning of another [rad]."""
    a, b = _get_shape(first), _get_shape(second)
    before, after = a[-1] - a[-2], b[1] - b[0]
    turn = math.atan2(after[1], after[0]) - math.atan2(before[1], before[0])
    return abs(math.remainder(turn, math.tau))


def _trace_connection(net: Any, link: Any) -> FloatArray:
    """[P, 2] the line of a connection inside the junction [m]."""
    points: list[Any] = []
    via, seen = link.getViaLaneID(), set()
    while via and via not in seen:
        seen.add(via)
        lane = net.getLane(via)
        points += [p[:2] for p in lane.getShape()]
        following = [each.getViaLaneID() for each in lane.getOutgoing()]
        via = next((each for each in following if each), "")
    if not points:
        ends = link.getFromLane().getShape()[-1], link.getToLane().getShape()[0]
        points = [end[:2] for end in ends]
    return np.array(points, dtype=float).reshape(-1, 2)


def _find_light(link: Any) -> str | None:
    name, index = link.getTLSID(), link.getTLLinkIndex()
    return f"{name}#{index}" if name and index >= 0 else None


def _read_crossings(net: Any, node: Any, middle: FloatArray) -> Iterator[SurveyCrossing]:
    for edge in net.getEdges(withInternal=True):
        if edge.getFunction() == "crossing" and str(edge.getID()).startswith(f":{node.getID()}_c"):
            lane = edge.getLanes()[0]
            line, name = _get_shape(lane) - middle, f"crossing {edge.getID()}"
            yield SurveyCrossing(line[[0, -1]], float(lane.getWidth()), source=name)


def _read_phases(net: Any, lights: set[str]) -> tuple[tuple[float, Mapping[str, Colour]], ...]:
    names = {light.rsplit("#", 1)[0] for light in lights}
    programs = net.getTLS(names.pop()).getPrograms() if len(names) == 1 else {}
    if not programs:
        return ()
    index = {light: int(light.rsplit("#", 1)[1]) for light in lights}
    return tuple(
        (
            float(phase.duration),
            {light: _COLOURS.get(phase.state[i].lower(), "red") for light, i in index.items()},
        )
        for phase in next(iter(programs.values())).getPhases()
        if phase.duration > 0
    )


def _is_left_hand(network: Path) -> bool:
    for _, element in ElementTree.iterparse(network, events=("start",)):
        return element.get("lefthand") in ("true", "1")
    return False
