"""Reader of SUMO networks, and of OpenStreetMap and OpenDRIVE files that netconvert converts."""

from __future__ import annotations

import heapq
import html
import math
import re
import subprocess
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from scenewright.errors import InputError
from scenewright.geometry.geographic import LatLon, unproject_ellipsoid
from scenewright.geometry.polyline import (
    drop_doubled_points,
    measure_courses,
    measure_length,
    measure_turn,
    resample_by_spacing,
)
from scenewright.scene.base import Colour, FloatArray
from scenewright.tools.map_import.check_file import MapFormat, require_sumo
from scenewright.tools.map_import.driving_side import (
    find_opendrive_side,
    find_osm_side,
)
from scenewright.tools.map_import.junction_choice import (
    Junction,
    JunctionOverview,
    describe_survey,
)
from scenewright.tools.map_import.junction_groups import StreetPiece, group_junctions
from scenewright.tools.map_import.map_parts import geos
from scenewright.tools.map_import.opendrive_features import (
    list_opendrive_crossings,
    list_opendrive_lights,
    read_opendrive_file,
)
from scenewright.tools.map_import.osm_features import (
    list_osm_crossings,
    list_osm_lights,
    list_osm_lines,
)
from scenewright.tools.map_import.osm_file import cut_out, read_osm_file
from scenewright.tools.map_import.osm_streets import list_osm_junctions
from scenewright.tools.map_import.osm_turns import (
    OsmTurns,
)
from scenewright.tools.map_import.rings import ROUNDABOUT, Ring, find_roundabouts
from scenewright.tools.map_import.survey import (
    NARROWEST,
    DrivingSide,
    Survey,
    SurveyConnection,
    SurveyCrossing,
    SurveyLane,
    SurveyLight,
    describe_strips,
    keep_near,
)

_TIME_LIMIT = 600.0
"""netconvert is stopped after that long [s]."""
_LANE_REACH = 120.0
"""Lanes are followed that far out of the junction [m]."""
_STRAIGHT = math.radians(35.0)
_COLOURS: Mapping[str, Colour] = {"g": "green", "y": "yellow", "o": "green"}
_DETOUR = math.radians(80.0)
"""How far a way turns back at least that goes round a turn that is banned."""
_ALL_ROUND = math.radians(225.0)
_CUT_OUT = "cut out the surroundings of the junction first"


def read_streets(
    file: Path, map_format: MapFormat, scratch: Path, side: DrivingSide | None
) -> JunctionOverview:
    """The junctions of a SUMO network or an OpenDRIVE file.

    Args:
        scratch: an empty folder for the converted network.
        side: on which traffic drives; None is as the file says.

    Raises:
        InputError: not convertible.
    """
    require_sumo(map_format)
    drive = read_opendrive_file(file) if map_format == "opendrive" else None
    network = file
    if drive is not None:
        side = side or find_opendrive_side(drive)
        network = _convert(file, scratch, origin=None, left_hand=side.left_hand)
    net = _read_network(network, file)
    side = side or _find_side(network)
    surveys = dict(_survey_junctions(net, side, file, _find_rings(net) if drive else []))

    def survey(chosen: Junction) -> Survey:
        found, shapes = surveys[chosen], _list_shapes(net)
        middle = np.array(found.offset)
        if drive is None:
            return replace(found, drawn=keep_near(shapes, middle))
        crossings = list_opendrive_crossings(drive, middle)
        lights = list_opendrive_lights(drive, middle)
        shapes["crossings"] = [crossing.line + middle for crossing in crossings]
        shapes["lights"] = [light.place + middle for light in lights]
        return _add_features(found, crossings, lights, shapes)

    roads = (_get_shape(e) for e in net.getEdges(withInternal=False) if _list_driving_lanes(e))
    return JunctionOverview(tuple(surveys), tuple(roads), survey)


def read_osm(file: Path, scratch: Path, side: DrivingSide | None) -> JunctionOverview:
    """The junctions of an OpenStreetMap file.

    Ids and places come from the file itself, so that no option of the conversion moves them.

    Args:
        scratch: an empty folder for the converted network.
        side: on which traffic drives; None is as the file says.

    Raises:
        InputError: see `list_osm_junctions`.
    """
    junctions, roads = list_osm_junctions(file)
    return JunctionOverview(junctions, roads, lambda own: _survey_osm(file, own, scratch, side))


def _survey_osm(file: Path, chosen: Junction, scratch: Path, side: DrivingSide | None) -> Survey:
    """A junction of an OpenStreetMap file, with what is drawn round it."""
    origin = chosen.degrees
    assert origin is not None  # noqa: S101 - junctions of OpenStreetMap lie somewhere
    part = scratch / "surroundings.osm"
    is_widened = cut_out(file, part, middle=origin)
    osm = read_osm_file(part, origin)
    side = side or find_osm_side(osm, origin)
    net = _read_network(_convert(part, scratch, origin=origin, left_hand=side.left_hand), file)
    nodes = {name for name in chosen.nodes if net.hasNode(name)}
    if not nodes:
        raise InputError(
            f"junction {chosen.id} of {file} ({chosen.name}) cannot be imported: netconvert finds "
            "no junction there, as where a street ends at the edge of the file"
        )
    places = [net.getNode(name).getCoord()[:2] for name in sorted(nodes)]
    x, y = np.mean(places, axis=0).tolist()
    group = replace(chosen, nodes=frozenset(nodes), xy=(x, y))
    turns = OsmTurns(osm, side.left_hand)
    survey = _survey_junction(net, group, side, file, turns, origin)
    survey.notes.append(
        "lane widths, turning lanes and signal times that the file does not tag are netconvert's "
        "guesses"
    )
    if is_widened:
        survey.notes.append("streets near by that are tagged too narrow got 2.5 m for each lane")
    middle = np.array(survey.offset)
    crossings, lights = list_osm_crossings(osm, middle), list_osm_lights(osm, middle)
    return _add_features(survey, crossings, lights, list_osm_lines(osm))


def _add_features(
    survey: Survey,
    crossings: Sequence[SurveyCrossing],
    lights: Sequence[SurveyLight],
    drawn: Mapping[str, Sequence[FloatArray]],
) -> Survey:
    """A survey with what netconvert leaves out, and without the phases that it makes up."""
    return replace(
        survey, crossings=(*survey.crossings, *crossings), lights=tuple(lights), phases=(),
        drawn=keep_near(drawn, np.array(survey.offset)),
    )  # fmt: skip


def _find_rings(net: Any) -> list[Ring]:
    """The roundabouts of a network whose file does not name them, by its lanes."""
    lines: dict[str, FloatArray] = {}
    follows: dict[str, list[str]] = {}
    for edge in net.getEdges(withInternal=False):
        for lane in _list_driving_lanes(edge):
            lines[lane.getID()] = _get_shape(lane)
            for link in lane.getOutgoing():
                after = link.getToLane()
                if not _is_internal(after) and _is_for_cars(after):
                    name = f"{lane.getID()}>{after.getID()}"
                    lines[name], follows[name] = _trace_connection(net, link), [after.getID()]
                    follows.setdefault(lane.getID(), []).append(name)
    return find_roundabouts(lines, follows)


def _list_ring_edges(net: Any, ring: Ring) -> set[str]:
    return {net.getLane(name).getEdge().getID() for name in ring.lanes if ">" not in name}


def _survey_junctions(
    net: Any, side: DrivingSide, file: Path, found: Sequence[Ring]
) -> Iterator[tuple[Junction, Survey]]:
    """The junctions of a network as drivers see them, with the legs that an import gives them.

    Args:
        found: roundabouts that the network does not name.
    """
    edges = [each for each in net.getEdges(withInternal=False) if _list_driving_lanes(each)]
    rings = {name for ring in net.getRoundabouts() for name in ring.getEdges()}
    rings |= {name for ring in found for name in _list_ring_edges(net, ring)}
    places = {each.getID(): np.array(each.getCoord()[:2], dtype=float) for each in net.getNodes()}
    back = {(edge.getToNode().getID(), edge.getFromNode().getID()) for edge in edges}
    pieces: list[StreetPiece] = []
    seen = set[tuple[str, str]]()
    for edge in sorted(edges, key=lambda each: str(each.getID())):
        start, end = edge.getFromNode().getID(), edge.getToNode().getID()
        both = (start, end) in back and edge.getID() not in rings
        if both and (end, start) in seen:
            continue
        seen.add((start, end))
        name, kind = _read_street(edge), str(edge.getType() or "")
        is_ring, is_slip = edge.getID() in rings, kind.endswith("_link")
        line = drop_doubled_points(np.array([places[start], *_get_shape(edge), places[end]]))
        pieces.append(StreetPiece(start, end, line, name, not both, is_ring, is_slip))
    refused = {
        net.getEdge(name).getToNode().getID(): ring.refusal
        for ring in found
        for name in _list_ring_edges(net, ring)
    }
    for group in group_junctions(places, pieces):
        survey = _survey_junction(net, group, side, file)
        refusal = next(filter(None, (refused.get(node, "") for node in sorted(group.nodes))), "")
        each = describe_survey(survey, id=group.id, nodes=group.nodes, refusal=refusal)
        if each is not None:
            yield each, survey


def _convert(file: Path, scratch: Path, *, origin: LatLon | None, left_hand: bool) -> Path:
    """The network that netconvert makes of a file, in an empty folder."""
    network = scratch / "converted.net.xml"
    home = Path(import_module("sumo").SUMO_HOME)
    command = [str(home / "bin" / "netconvert"), "-o", str(network), "--no-turnarounds", "true"]
    command += ["--junctions.internal-link-detail", "16", "--junctions.corner-detail", "8"]
    command += ["--no-warnings", "true", "--output.street-names", "true"]
    command += ["--offset.disable-normalization", "true", "--default.spreadtype", "roadCenter"]
    if origin is not None:
        where = f"+proj=tmerc +lat_0={origin[0]:.8f} +lon_0={origin[1]:.8f} +k=1 +ellps=WGS84"
        command += ["--osm-files", str(file), "--proj", f"{where} +units=m +no_defs"]
        command += ["--keep-edges.by-vclass", "passenger", "--junctions.join", "false"]
        command += ["--geometry.remove", "true", "--tls.join", "true", "--tls.discard-simple"]
        command += ["true", "--osm.turn-lanes", "true", "--roundabouts.guess", "true"]
        command += ["--remove-edges.by-type", "highway.service,highway.track,highway.unsurfaced"]
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
    return network


def _read_network(network: Path, file: Path) -> Any:
    reader = import_module("sumolib").net
    try:
        return reader.readNet(str(network), withInternal=True, withPrograms=True)
    except Exception as fault:  # the reader raises all kinds of exceptions for strange files
        raise InputError(f"cannot read the network in {file}: {str(fault)[:160]}") from None


def _read_street(edge: Any) -> str:
    """The name of an edge's street; netconvert escapes that of OpenStreetMap twice."""
    return html.unescape(str(edge.getName() or ""))


def _list_driving_lanes(edge: Any) -> list[Any]:
    return [lane for lane in edge.getLanes() if _is_for_cars(lane)]


def _is_for_cars(lane: Any) -> bool:
    """Whether cars may drive on a lane and fit on it; one without a width has SUMO's usual one."""
    return bool(lane.allows("passenger")) and not 0.0 < float(lane.getWidth()) < NARROWEST


def _get_shape(part: Any) -> FloatArray:
    """[P, 2] the line of an edge or a lane [m]."""
    return np.asarray(np.array(part.getShape())[:, :2])


def _survey_junction(
    net: Any,
    group: Junction,
    side: DrivingSide,
    file: Path,
    turns: OsmTurns | None = None,
    origin: LatLon | None = None,
) -> Survey:
    try:
        return _survey_nodes(net, group, origin, side, turns)
    except (KeyError, IndexError) as fault:  # sumolib follows names that lead nowhere
        raise InputError(f"{file} names a part that it lacks: {str(fault)[:80]}") from None


def _survey_nodes(
    net: Any, group: Junction, origin: LatLon | None, side: DrivingSide, turns: OsmTurns | None
) -> Survey:
    nodes = [net.getNode(name) for name in sorted(group.nodes)]
    outlines = [_get_shape(node) for node in nodes if node.getShape()]
    outlines = [outline for outline in outlines if len(outline) > 2]
    middle = np.array(group.xy).round(3)
    if len(nodes) == 1:
        own = np.array(nodes[0].getCoord()[:2], dtype=float)
        middle = outlines[0].mean(axis=0) if outlines else own
    roads_in = [
        edge
        for node in nodes
        for edge in node.getIncoming()
        if _is_street(edge) and edge.getFromNode().getID() not in group.nodes
    ]
    roads_out = [
        edge
        for node in nodes
        for edge in node.getOutgoing()
        if _is_street(edge) and edge.getToNode().getID() not in group.nodes
    ]
    approaches, exits = (
        {
            lane.getID(): _build_lane(lane, middle, inwards=inwards)
            for edge in roads
            for lane in _list_driving_lanes(edge)
        }
        for roads, inwards in ((roads_in, True), (roads_out, False))
    )
    parts = [f"{len(nodes)} nodes that lie close together are one intersection"]
    parts = [ROUNDABOUT] if group.is_roundabout else parts if len(nodes) > 1 else []
    connections: list[SurveyConnection] = []
    told: list[str] = []
    for edge in roads_in:
        names = [lane.getID() for lane in _list_driving_lanes(edge)]
        given = (net, exits, group, middle)
        ways = [way for name in names for way in _trace_connections(name, *given, None)]
        if turns is not None and not group.is_roundabout:
            more = [way for name in names for way in _trace_connections(name, *given, turns)]
            more.sort(key=lambda way: -measure_length(way.line))
            reached = {way.exit: way.line for way in more}
            lanes = {**approaches, **exits}
            ways, faults = turns.complete_ways(edge, roads_out, lanes, ways, reached)
            told += faults
        connections += ways
    used = {way.approach for way in connections}, {way.exit for way in connections}
    # Only nodes that a way leads through: streets that lead nowhere end at others.
    ways = geos.union_all([geos.LineString(connection.line) for connection in connections])
    moved = [outline - middle for outline in outlines]
    names = sorted({*map(_read_street, (*roads_in, *roads_out))} - {""})
    crossings = tuple(each for node in nodes for each in _read_crossings(net, node, middle))
    lights = {connection.light for connection in connections} | {
        crossing.light for crossing in crossings
    }
    phases = _read_phases(net, {light for light in lights if light is not None})
    return Survey(
        title=_choose_title(names, group),
        approaches={name: lane for name, lane in approaches.items() if name in used[0]},
        exits={name: lane for name, lane in exits.items() if name in used[1]},
        connections=tuple(connections),
        crossings=crossings,
        areas=tuple(each for each in moved if geos.Polygon(each).intersects(ways)),
        phases=phases,
        side=side,
        is_signalised=any(str(node.getType()).startswith("traffic_light") for node in nodes),
        origin=None if origin is None else unproject_ellipsoid(origin, middle),
        offset=(round(float(middle[0]), 3), round(float(middle[1]), 3)),
        is_roundabout=group.is_roundabout,
        file_origin=origin,
        lost=len(approaches) - len(used[0]) + len(exits) - len(used[1]),
        notes=[
            *parts,
            *told,
            *describe_strips(
                lane.allows("passenger") and not _is_for_cars(lane)
                for edge in (*(e for node in nodes for e in node.getIncoming()), *roads_out)
                for lane in edge.getLanes()
            ),
            *(
                f"lane {name} leads nowhere here and was dropped"
                for name in (*approaches, *exits)
                if name not in used[0] | used[1]
            ),
            *(
                f"a phase of the lights that lasts {_LONGEST_PHASE:.0f} s or more was cut to that"
                for duration, _ in phases
                if duration >= _LONGEST_PHASE
            ),
        ],
    )


def _choose_title(names: Sequence[str], group: Junction) -> str:
    """The streets' names; the junction's id where they are only numbers or too many to read."""
    spoken = [name for name in names if re.sub(r"(?i)road|street|[\W\d_]", "", name)]
    if not spoken or len(spoken) > _MOST_NAMES:
        short = len(group.id) <= _LONGEST_ID
        return f"junction {group.id}" if short else "junction without street names"
    return ", ".join(spoken)[:80]


_MOST_NAMES = 6
_LONGEST_ID = 24
"""netconvert names a joined junction after all its nodes."""


def _is_street(edge: Any) -> bool:
    return not edge.getFunction() and bool(_list_driving_lanes(edge))


def _trace_connections(
    approach: str,
    net: Any,
    exits: Mapping[str, Any],
    group: Junction,
    middle: FloatArray,
    turns: OsmTurns | None,
) -> Iterator[SurveyConnection]:
    """The shortest way from an approach over lanes inside the junction to every exit lane.

    Args:
        turns: what the file allows; None for what the network has.
    """
    start = net.getLane(approach)
    todo: list[tuple[float, int, Any, FloatArray, str | None]] = [
        (0.0, 0, start, np.zeros((0, 2)), None)
    ]
    count, done = 0, set[str]()
    while todo:
        _, _, lane, line, light = heapq.heappop(todo)
        if lane.getID() in done:
            continue
        done.add(lane.getID())
        if lane.getID() in exits and lane is not start:
            if group.is_roundabout or not is_detour(line):
                yield SurveyConnection(approach, lane.getID(), line - middle, light)
            continue
        for after, between, lit in _list_links(net, lane, turns, is_inside=lane is not start):
            if _is_internal(after) or not _is_for_cars(after):
                continue
            inner, edge = after.getID() not in exits, after.getEdge()
            ends = {edge.getFromNode().getID(), edge.getToNode().getID()}
            if inner and not ends <= group.nodes:
                continue
            longer = np.concatenate([line, between, *([_get_shape(after)] if inner else [])])
            count += 1
            heapq.heappush(todo, (measure_length(longer), count, after, longer, light or lit))


def _list_links(
    net: Any, lane: Any, turns: OsmTurns | None, *, is_inside: bool
) -> Iterator[tuple[Any, FloatArray, str | None]]:
    """The lanes that one leads to, the line between them, and its light.

    Where the file decides, every lane of a street inside the junction leads where one of them does,
    and on to the streets to which the network has no way.
    """
    edge = lane.getEdge()
    own = edge.getLanes() if turns is not None and is_inside else [lane]
    for link in (link for each in own for link in each.getOutgoing()):
        yield link.getToLane(), _trace_connection(net, link), _find_light(link)
    if turns is not None:
        led = {link.getTo() for each in edge.getLanes() for link in each.getOutgoing()}
        for onto in edge.getToNode().getOutgoing():
            if _is_street(onto) and onto not in led and turns.allows(edge, onto):
                for after in onto.getLanes():
                    yield after, np.array([_get_shape(lane)[-1], _get_shape(after)[0]]), None


def is_detour(line: FloatArray) -> bool:
    """Whether a way [T, 2] turns one way and back, or all round, as about a banned turn."""
    courses = measure_courses(resample_by_spacing(line, 1.0))
    turn = abs(float(courses[-1] - courses[0]))
    return float(np.ptp(courses)) - turn > _DETOUR or turn > _ALL_ROUND


def _build_lane(lane: Any, middle: FloatArray, *, inwards: bool) -> SurveyLane:
    """A lane with what lies straight before or behind it."""
    line = _get_shape(lane)
    here, reach = lane, measure_length(line)
    for _ in range(20):
        pairs = (
            [(x, here) for x in here.getIncoming() if not _is_internal(x)]
            if inwards
            else [(here, link.getToLane()) for link in here.getOutgoing()]
        )
        turns = []
        for first, second in pairs if reach < _LANE_REACH else ():
            a, b, beyond = _get_shape(first), _get_shape(second), first if inwards else second
            turn = abs(measure_turn(a[-1] - a[-2], b[1] - b[0]))
            if turn < _STRAIGHT and _is_for_cars(beyond):
                turns.append((turn, beyond.getID(), beyond))
        if not turns:
            break
        here = min(turns)[2]
        more = _get_shape(here)
        line = np.concatenate([more, line] if inwards else [line, more])
        reach += measure_length(more)
    return SurveyLane(
        id=lane.getID(),
        line=line - middle,
        width=float(lane.getWidth()) or 3.2,
        speed=float(lane.getSpeed()),
        road=_read_street(lane.getEdge()),
    )


def _is_internal(lane: Any) -> bool:
    return bool(lane.getEdge().getFunction())


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


def _list_shapes(net: Any) -> dict[str, list[FloatArray]]:
    """The lanes of a network by kind, for pictures [m]."""
    kinds = {"crossing": "crossings", "walkingarea": "paths"}
    found: dict[str, list[FloatArray]] = {}
    for edge in net.getEdges(withInternal=True):
        layer = kinds.get(edge.getFunction(), "roads")
        found.setdefault(layer, []).extend(_get_shape(lane) for lane in edge.getLanes())
    return found


def _read_crossings(net: Any, node: Any, middle: FloatArray) -> Iterator[SurveyCrossing]:
    for edge in net.getEdges(withInternal=True):
        if edge.getFunction() == "crossing" and str(edge.getID()).startswith(f":{node.getID()}_c"):
            lane = edge.getLanes()[0]
            line, name = _get_shape(lane) - middle, f"crossing {edge.getID()}"
            leading = (link for links in edge.getIncoming().values() for link in links)
            light = next((x for x in map(_find_light, leading) if x), None)
            yield SurveyCrossing(line[[0, -1]], float(lane.getWidth()), light, source=name)


_LONGEST_PHASE = 120.0
"""Networks write hours for a phase that lasts until traffic ends it [s]."""


def _read_phases(net: Any, lights: set[str]) -> tuple[tuple[float, Mapping[str, Colour]], ...]:
    """Durations and colours of a programme's phases; a phase lasts two minutes at most."""
    names = {light.rsplit("#", 1)[0] for light in lights}
    programs = net.getTLS(names.pop()).getPrograms() if len(names) == 1 else {}
    if not programs:
        return ()
    index = {light: int(light.rsplit("#", 1)[1]) for light in sorted(lights)}
    return tuple(
        (
            min(float(phase.duration), _LONGEST_PHASE),
            {light: _COLOURS.get(phase.state[i].lower(), "red") for light, i in index.items()},
        )
        for phase in next(iter(programs.values())).getPhases()
        if phase.duration > 0
    )


def _find_side(network: Path) -> DrivingSide:
    _, root = next(ElementTree.iterparse(network, events=("start",)))
    left = root.get("lefthand") in ("true", "1")
    return DrivingSide(left, "the network says so" if left else "the network's default")
