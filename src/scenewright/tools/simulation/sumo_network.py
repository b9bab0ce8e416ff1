"""The SUMO network that lies on our own map: same lanes, connectors, crosswalks and signals.

Lanes are numbered from the kerb: 0 sidewalk, 1 parking (closed), then driving lanes outer first.
Connectors and crossings get our curves as custom shapes, so that tracks lie on our lanelets.
"""

from __future__ import annotations

import subprocess
from collections.abc import Iterable
from pathlib import Path
from typing import Any
from xml.sax.saxutils import quoteattr

from scenewright.errors import InputError
from scenewright.scene.base import Compass
from scenewright.scene.map import IntersectionMap, Lanelet, SignalProgram
from scenewright.tools.map_import.four_leg_map import LEGS, FourLegPlan, locate_point

REACH = 300.0
"""How far the approach roads reach from the middle [m]."""
_LATERAL_LIMIT = 2.5
"""Lateral acceleration that limits speed in turns [m/s^2]."""
_FIRST_DRIVING_LANE = 2


def write_network(folder: Path, plan: FourLegPlan, place: IntersectionMap) -> Path:
    """Write the network and its signal programme; the path of the `.net.xml`.

    The programme is `signals.add.xml` beside it. InputError where SUMO is not installed.
    """
    network = converted(
        folder, nodes=_nodes(plan), edges=_edges(plan), connections=_connections(plan, place)
    )
    write_signals(folder, programme_lines(network, place))
    return network


def converted(
    folder: Path,
    *options: str,
    nodes: Iterable[str],
    edges: Iterable[str],
    connections: Iterable[str],
) -> Path:
    """The network that netconvert makes of plain elements; the path of its `.net.xml`.

    Args:
        options: further ones of netconvert.

    Raises:
        InputError: SUMO is not installed, or does not take the network.
    """
    files = {
        "plain.nod.xml": document("nodes", nodes),
        "plain.edg.xml": document("edges", edges),
        "plain.con.xml": document("connections", connections),
    }
    for name, text in files.items():
        (folder / name).write_text(text, encoding="utf-8")
    network = folder / "intersection.net.xml"
    netconvert(folder, network, *options)
    return network


def write_signals(folder: Path, lines: Iterable[str]) -> None:
    """The signal programme of a network, `signals.add.xml` beside it."""
    (folder / "signals.add.xml").write_text(document("additional", lines), encoding="utf-8")


def sumo_home() -> Path:
    """Where SUMO's programs are; InputError with the remedy where it is not installed."""
    try:
        import sumo
    except ImportError:
        raise InputError(
            "building a corpus needs SUMO: install the extra, scenewright[simulate]"
        ) from None
    return Path(sumo.SUMO_HOME)


def edge_id(leg: Compass, *, inwards: bool) -> str:
    """The name of an approach or exit road."""
    return f"{leg}_{'in' if inwards else 'out'}"


def tag(name: str, **attributes: object) -> str:
    """One empty XML element; a trailing underscore in a name is dropped."""
    inside = " ".join(f"{k.rstrip('_')}={quoteattr(str(v))}" for k, v in attributes.items())
    return f"<{name} {inside}/>"


def document(root: str, lines: Iterable[str]) -> str:
    """An XML document of lines."""
    return f"<{root}>\n" + "\n".join(lines) + f"\n</{root}>\n"


def shape_of(points: Iterable[tuple[float, float]]) -> str:
    """Points as SUMO writes a shape."""
    return " ".join(f"{x:.3f},{y:.3f}" for x, y in points)


def _nodes(plan: FourLegPlan) -> list[str]:
    outline: list[tuple[float, float]] = []
    for leg in reversed(LEGS):
        side = plan.road(leg).half_width + plan.road(leg).sidewalk
        outline += [locate_point(leg, plan.stop(leg), sign * side) for sign in (-1, 1)]
    middle = tag("node", id="J", x=0, y=0, type="traffic_light", tl="J", shape=shape_of(outline))
    ends = [(leg, *locate_point(leg, REACH, 0.0)) for leg in LEGS]
    return [middle, *(tag("node", id=leg, x=x, y=y, type="priority") for leg, x, y in ends)]


def _edges(plan: FourLegPlan) -> list[str]:
    return [_edge(plan, leg, inwards) for leg in LEGS for inwards in (True, False)]


def _edge(plan: FourLegPlan, leg: Compass, inwards: bool) -> str:
    road = plan.road(leg)
    lanes = [
        tag("lane", index=0, width=road.sidewalk, allow="pedestrian", speed=2.8),
        tag("lane", index=1, width=road.parking, disallow="all"),
    ]
    for number, width in enumerate(reversed(road.lanes)):
        index = number + _FIRST_DRIVING_LANE
        lanes.append(tag("lane", index=index, width=width, disallow="pedestrian"))
    ends = (leg, "J") if inwards else ("J", leg)
    head = tag(
        "edge",
        id=edge_id(leg, inwards=inwards),
        from_=ends[0],
        to=ends[1],
        numLanes=len(lanes),
        speed=plan.speed_limit,
        priority=1,
    )
    return head.replace("/>", ">") + "".join(lanes) + "</edge>"


def _connections(plan: FourLegPlan, place: IntersectionMap) -> list[str]:
    lanelets = {lanelet.id: lanelet for lanelet in place.lanelets}
    lines = []
    for movement in place.movements:
        for first in range(0, len(movement.lanelets), 3):
            way = [lanelets[name] for name in movement.lanelets[first : first + 3]]
            lines.append(_connection(plan, way))
    return lines + [_crossing(plan, place, leg) for leg in LEGS]


def _connection(plan: FourLegPlan, way: list[Lanelet]) -> str:
    before, inside, after = way
    return tag(
        "connection",
        from_=f"{before.leg}_in",
        to=f"{after.leg}_out",
        fromLane=_lane_index(plan, before),
        toLane=_lane_index(plan, after),
        shape=shape_of(inside.centreline),
    )


def _lane_index(plan: FourLegPlan, lanelet: Lanelet) -> int:
    lanes = len(plan.road(lanelet.leg or "north").lanes)
    inner = lanelet.id.endswith(":inner")
    return _FIRST_DRIVING_LANE + (1 if lanes > 1 and inner else 0)


def _crossing(plan: FourLegPlan, place: IntersectionMap, leg: Compass) -> str:
    crosswalk = next(c for c in place.crosswalks if c.leg == leg)
    edges = f"{edge_id(leg, inwards=True)} {edge_id(leg, inwards=False)}"
    # SUMO wants crossings clockwise: the other way round, walkers appear mirrored
    start, end = crosswalk.centreline
    return tag(
        "crossing",
        node="J",
        edges=edges,
        priority="true",
        width=plan.crosswalk_width,
        shape=shape_of((end, start)),
    )


def netconvert(folder: Path, network: Path, *more: str) -> None:
    """Make a network of the plain files in a folder; InputError with netconvert's reason."""
    command = [
        str(sumo_home() / "bin" / "netconvert"),
        *("-n", str(folder / "plain.nod.xml"), "-e", str(folder / "plain.edg.xml")),
        *("-x", str(folder / "plain.con.xml"), "-o", str(network)),
        *("--no-turnarounds", "true", "--walkingareas", "true", "--offset.disable-normalization"),
        *("true", "--junctions.internal-link-detail", "24"),
        *("--junctions.limit-turn-speed", str(_LATERAL_LIMIT)),
        *("--default.spreadtype", "right", "--no-warnings", "true"),
        *more,
    ]
    finished = subprocess.run(command, capture_output=True, text=True, check=False)
    if finished.returncode != 0:
        raise InputError(f"netconvert refused the network: {finished.stderr.strip()[:300]}")


def programme_lines(network: Path, place: IntersectionMap) -> list[str]:
    """Our signal phases in terms of SUMO's link indices."""
    if place.signals is None:
        raise InputError(f"{place.name} has no signals to simulate")
    links = _link_groups(network, place.signals)
    head = tag("tlLogic", id="J", type="static", programID="plan", offset=0).replace("/>", ">")
    phases = [
        tag(
            "phase",
            duration=phase.duration,
            state="".join(_letter(phase.colours[group], kind) for group, kind in links),
        )
        for phase in place.signals.phases
    ]
    return [head, *phases, "</tlLogic>"]


def _letter(colour: str, kind: str) -> str:
    if kind == "crossing":
        return "G" if colour == "green" else "r"
    if colour == "green":
        return "G" if kind == "straight" else "g"
    return colour[0]


def _link_groups(network: Path, signals: SignalProgram) -> list[tuple[str, str]]:
    """By link index: the signal group and what the link is (a turn, or a crossing)."""
    from xml.etree import ElementTree

    root = ElementTree.parse(network).getroot()
    links: dict[int, tuple[str, str]] = {}
    for element in root.iter("connection"):
        if element.get("tl") == "J":
            links[int(element.attrib["linkIndex"])] = _link(element, root, signals)
    return [links[index] for index in range(len(links))]


def _link(element: Any, root: Any, signals: SignalProgram) -> tuple[str, str]:
    target = element.attrib["to"]
    if target.startswith(":"):
        edge = next(e for e in root.iter("edge") if e.get("id") == target)
        leg = edge.attrib["crossingEdges"].split()[0].split("_")[0]
        group = next(g.id for g in signals.groups if f"{leg}:crosswalk" in g.crosswalks)
        return group, "crossing"
    entry, exit_ = element.attrib["from"].split("_")[0], target.split("_")[0]
    start = f"{entry}>{exit_}:"
    ruling = next(g for g in signals.groups if any(m.startswith(start) for m in g.movements))
    straight = any(m == f"{start}straight" for m in ruling.movements)
    return ruling.id, "straight" if straight else "turn"
