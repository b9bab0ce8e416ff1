"""SUMO networks, and whatever netconvert makes one of: OpenStreetMap and OpenDRIVE files."""

from __future__ import annotations

import math
import subprocess
from collections.abc import Iterator, Mapping
from importlib import import_module
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from scenewright.errors import InputError
from scenewright.scene.base import Colour, FloatArray
from scenewright.tools.map_import.choosing import Place, chosen
from scenewright.tools.map_import.survey import Survey, SurveyCrossing, SurveyLane, SurveyWay
from scenewright.tools.map_import.vetting import MapFormat

LONGEST_CONVERSION = 60.0
"""netconvert is stopped after that long [s]."""
FAR = 120.0
"""Lanes are followed that far out of the junction [m]."""
_STRAIGHT = math.radians(35.0)
_COLOURS: Mapping[str, Colour] = {"g": "green", "y": "yellow", "o": "green"}
_EARTH = 6_378_137.0


def read_sumo(
    file: Path,
    kind: MapFormat,
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
    middle = _middle_of_osm(file) if kind == "osm" else None
    network = file if kind == "sumo" else scratch / "converted.net.xml"
    if kind != "sumo":
        _convert(file, kind, network, middle=middle, left_hand=bool(left_hand))
    net = _read(network, file)
    nodes = {node.getID(): node for node in net.getNodes() if _is_junction(node)}
    places = [_place(node) for node in nodes.values()]
    picked = chosen(places, file=file, center=center, junction=junction, geographic=middle)
    survey = _survey(net, nodes[picked.id], network, middle=middle, left_hand=left_hand)
    if kind == "osm":
        survey.notes.append(
            "lane widths, turning lanes and signal times that the file does not tag are "
            "netconvert's guesses"
        )
    return survey


def _programs() -> Path:
    try:
        home = import_module("sumo").SUMO_HOME
    except ImportError:
        raise InputError(
            "importing this map needs SUMO: install the extra, scenewright[simulate]"
        ) from None
    return Path(home) / "bin"


def _convert(
    file: Path,
    kind: MapFormat,
    network: Path,
    *,
    middle: tuple[float, float] | None,
    left_hand: bool,
) -> None:
    command = [str(_programs() / "netconvert"), "-o", str(network), "--no-turnarounds", "true"]
    command += ["--junctions.internal-link-detail", "16", "--junctions.corner-detail", "8"]
    command += ["--no-warnings", "true", "--output.street-names", "true"]
    command += ["--offset.disable-normalization", "true"]
    if kind == "osm" and middle is not None:
        where = f"+proj=tmerc +lat_0={middle[0]:.8f} +lon_0={middle[1]:.8f} +k=1 +ellps=WGS84"
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
            command,
            capture_output=True,
            text=True,
            errors="replace",
            check=False,
            timeout=LONGEST_CONVERSION,
        )
    except subprocess.TimeoutExpired:
        raise InputError(
            f"netconvert did not finish {file} within {LONGEST_CONVERSION:.0f} s; "
            "cut out the surroundings of the junction first"
        ) from None
    if done.returncode != 0 or not network.is_file():
        said = next((line for line in done.stderr.splitlines() if line.strip()), "no reason given")
        raise InputError(f"netconvert cannot read {file}: {said.strip()[:200]}")


def _middle_of_osm(file: Path) -> tuple[float, float]:
    """Middle of all nodes of an OpenStreetMap file, latitude and longitude [deg]."""
    south, west, north, east = 91.0, 181.0, -91.0, -181.0
    for _, element in ElementTree.iterparse(file, events=("end",)):
        if element.tag == "node":
            try:
                lat, lon = float(element.attrib["lat"]), float(element.attrib["lon"])
            except (KeyError, ValueError):
                raise InputError(f"{file} has a node without latitude and longitude") from None
            if not (abs(lat) <= 85.0 and abs(lon) <= 180.0):
                raise InputError(
                    f"{file} has a node at latitude {lat:g}, longitude {lon:g}: these are no "
                    "degrees; OpenStreetMap files are not projected"
                )
            south, north = min(south, lat), max(north, lat)
            west, east = min(west, lon), max(east, lon)
        element.clear()
    if south > north:
        raise InputError(f"{file} has no nodes")
    if max(north - south, east - west) > 0.5:
        raise InputError(
            f"{file} spans {max(north - south, east - west):.1f} degrees; "
            "cut out the surroundings of the junction first"
        )
    return (south + north) / 2, (west + east) / 2


def _read(network: Path, file: Path) -> Any:
    try:
        reader = import_module("sumolib").net
    except ImportError:
        raise InputError(
            "importing this map needs SUMO's library: install the extra, scenewright[simulate]"
        ) from None
    try:
        return reader.readNet(str(network), withInternal=True, withPrograms=True)
    except Exception as fault:  # the reader raises whatever a strange file leads to
        raise InputError(f"cannot read the network in {file}: {str(fault)[:160]}") from None


def _lanes_in(node: Any) -> list[Any]:
    return [e for e in node.getIncoming() if not e.getFunction() and _driving(e)]


def _lanes_out(node: Any) -> list[Any]:
    return [e for e in node.getOutgoing() if not e.getFunction() and _driving(e)]


def _driving(edge: Any) -> list[Any]:
    return [lane for lane in edge.getLanes() if lane.allows("passenger")]


def _is_junction(node: Any) -> bool:
    return len(_directions(node)) >= 3 and bool(_lanes_in(node)) and bool(_lanes_out(node))


def _directions(node: Any) -> list[float]:
    """Outward directions of a node's roads, those within 25 degrees of one another as one."""
    found: list[float] = []
    for edge, inwards in [
        *((e, True) for e in _lanes_in(node)),
        *((e, False) for e in _lanes_out(node)),
    ]:
        line = np.array(edge.getShape())[:, :2]
        line = line[::-1] if inwards else line
        way = _at(line, 15.0) - line[0]
        angle = math.atan2(way[1], way[0])
        if all(abs(math.remainder(angle - other, math.tau)) > math.radians(25) for other in found):
            found.append(angle)
    return found


def _at(line: FloatArray, distance: float) -> FloatArray:
    s = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(line, axis=0).T))])
    return np.array([np.interp(distance, s, line[:, axis]) for axis in (0, 1)])


def _place(node: Any) -> Place:
    x, y = (float(value) for value in node.getCoord()[:2])
    roads = sorted({edge.getName() for edge in [*_lanes_in(node), *_lanes_out(node)]} - {"", None})
    return Place(
        id=str(node.getID()),
        xy=(x, y),
        legs=len(_directions(node)),
        name=", ".join(roads)[:80],
        size=len(_lanes_in(node)) + len(_lanes_out(node)),
    )


def _survey(
    net: Any,
    node: Any,
    network: Path,
    *,
    middle: tuple[float, float] | None,
    left_hand: bool | None,
) -> Survey:
    outline = np.array(node.getShape())[:, :2] if node.getShape() else np.zeros((0, 2))
    at = outline.mean(axis=0) if len(outline) > 2 else np.array(node.getCoord()[:2], dtype=float)
    approaches = {
        lane.getID(): _lane(lane, at, inwards=True)
        for edge in _lanes_in(node)
        for lane in _driving(edge)
    }
    exits = {
        lane.getID(): _lane(lane, at, inwards=False)
        for edge in _lanes_out(node)
        for lane in _driving(edge)
    }
    ways, lights = [], set()
    for name in approaches:
        for link in net.getLane(name).getOutgoing():
            target = link.getToLane().getID()
            if target not in exits:
                continue
            light = _light(link)
            lights.add(light)
            line = np.array(_inside(net, link), dtype=float).reshape(-1, 2) - at
            ways.append(SurveyWay(name, target, line, light))
    crossings = tuple(_crossings(net, node, at))
    used = {w.approach for w in ways}
    notes = [
        f"lane {name} leads nowhere and was dropped" for name in approaches if name not in used
    ]
    return Survey(
        title=_place(node).name or f"junction {node.getID()}",
        approaches={k: v for k, v in approaches.items() if k in used},
        exits={k: v for k, v in exits.items() if k in {w.exit for w in ways}},
        ways=tuple(ways),
        crossings=crossings,
        areas=(outline - at,) if len(outline) > 2 else (),
        phases=_phases(net, lights - {None}),
        left_hand=_left_hand(network) if left_hand is None else left_hand,
        signalised=str(node.getType()).startswith("traffic_light"),
        origin=None if middle is None else _degrees(middle, (float(at[0]), float(at[1]))),
        offset=(round(float(at[0]), 3), round(float(at[1]), 3)),
        notes=notes,
    )


def _degrees(middle: tuple[float, float], xy: tuple[float, float]) -> tuple[float, float]:
    """Latitude and longitude of a place near the origin of the projection [deg]."""
    lat = middle[0] + math.degrees(xy[1] / _EARTH)
    lon = middle[1] + math.degrees(xy[0] / (_EARTH * math.cos(math.radians(middle[0]))))
    return round(lat, 7), round(lon, 7)


def _lane(lane: Any, at: FloatArray, *, inwards: bool) -> SurveyLane:
    """A lane with what lies straight before or behind it, as far as FAR."""
    line = np.array(lane.getShape())[:, :2]
    here, reach = lane, _length(line)
    for _ in range(20):
        if reach >= FAR:
            break
        beyond = _straight_on(here, inwards=inwards)
        if beyond is None:
            break
        more = np.array(beyond.getShape())[:, :2]
        line = np.concatenate([more, line] if inwards else [line, more])
        here, reach = beyond, reach + _length(more)
    edge = lane.getEdge()
    return SurveyLane(
        id=lane.getID(),
        line=line - at,
        width=float(lane.getWidth()) or 3.2,
        speed=float(lane.getSpeed()),
        road=str(edge.getName() or ""),
    )


def _length(line: FloatArray) -> float:
    return float(np.hypot(*np.diff(line, axis=0).T).sum())


def _straight_on(lane: Any, *, inwards: bool) -> Any | None:
    """The lane before (or behind) that leads straight into this one, if there is one."""
    if inwards:
        links = [(each, each) for each in lane.getIncoming() if not _internal(each)]
        found = [other for other, _ in links]
    else:
        found = [link.getToLane() for link in lane.getOutgoing()]
    turns = [(abs(_turn(a, lane) if inwards else _turn(lane, a)), a.getID(), a) for a in found]
    best = min((t for t in turns if t[0] < _STRAIGHT and t[2].allows("passenger")), default=None)
    return None if best is None else best[2]


def _internal(lane: Any) -> bool:
    return bool(lane.getEdge().getFunction())


def _turn(first: Any, second: Any) -> float:
    a, b = np.array(first.getShape())[:, :2], np.array(second.getShape())[:, :2]
    before, after = a[-1] - a[-2], b[1] - b[0]
    return math.remainder(
        math.atan2(after[1], after[0]) - math.atan2(before[1], before[0]), math.tau
    )


def _inside(net: Any, link: Any) -> list[tuple[float, float]]:
    """The points of a connection inside the junction."""
    points: list[tuple[float, float]] = []
    via, seen = link.getViaLaneID(), set()
    while via and via not in seen:
        seen.add(via)
        lane = net.getLane(via)
        points += [tuple(p[:2]) for p in lane.getShape()]
        following = [each.getViaLaneID() for each in lane.getOutgoing()]
        via = next((each for each in following if each), "")
    if not points:
        points = [
            tuple(link.getFromLane().getShape()[-1][:2]),
            tuple(link.getToLane().getShape()[0][:2]),
        ]
    return points


def _light(link: Any) -> str | None:
    name, index = link.getTLSID(), link.getTLLinkIndex()
    return f"{name}#{index}" if name and index >= 0 else None


def _crossings(net: Any, node: Any, at: FloatArray) -> Iterator[SurveyCrossing]:
    for edge in net.getEdges(withInternal=True):
        if edge.getFunction() == "crossing" and str(edge.getID()).startswith(f":{node.getID()}_c"):
            lane = edge.getLanes()[0]
            line = np.array(lane.getShape())[:, :2] - at
            yield SurveyCrossing(line[[0, -1]], float(lane.getWidth()))


def _phases(net: Any, lights: set[str | None]) -> tuple[tuple[float, Mapping[str, Colour]], ...]:
    names = {str(light).rsplit("#", 1)[0] for light in lights}
    if len(names) != 1:
        return ()
    programs = net.getTLS(names.pop()).getPrograms()
    if not programs:
        return ()
    phases = next(iter(programs.values())).getPhases()
    made = []
    for phase in phases:
        colours: dict[str, Colour] = {}
        for light in lights:
            letter = phase.state[int(str(light).rsplit("#", 1)[1])].lower()
            colours[str(light)] = _COLOURS.get(letter, "red")
        if phase.duration > 0:
            made.append((float(phase.duration), colours))
    return tuple(made)


def _left_hand(network: Path) -> bool:
    for _, element in ElementTree.iterparse(network, events=("start",)):
        return element.get("lefthand") in ("true", "1")
    return False
