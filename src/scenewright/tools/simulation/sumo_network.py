"""Networks for SUMO that lie on our own maps, and their signals.

Connectors and crossings get our curves as custom shapes, so that tracks lie on our lanelets.
"""

from __future__ import annotations

import subprocess
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any
from xml.etree import ElementTree
from xml.sax.saxutils import quoteattr

from scenewright.errors import InputError
from scenewright.scene.base import Compass
from scenewright.scene.map import IntersectionMap
from scenewright.scene.map_elements import Lanelet, SignalProgram

_LATERAL_LIMIT = 2.5
"""Lateral acceleration that limits speed in turns [m/s^2]."""


def convert_network(
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
        "plain.nod.xml": _format_document("nodes", nodes),
        "plain.edg.xml": _format_document("edges", edges),
        "plain.con.xml": _format_document("connections", connections),
    }
    for name, text in files.items():
        (folder / name).write_text(text, encoding="utf-8")
    network = folder / "intersection.net.xml"
    command = [
        str(find_sumo() / "bin" / "netconvert"),
        *("-n", str(folder / "plain.nod.xml"), "-e", str(folder / "plain.edg.xml")),
        *("-x", str(folder / "plain.con.xml"), "-o", str(network)),
        *("--no-turnarounds", "true", "--walkingareas", "true", "--offset.disable-normalization"),
        *("true", "--junctions.internal-link-detail", "24"),
        *("--junctions.limit-turn-speed", str(_LATERAL_LIMIT)),
        *("--default.spreadtype", "right", "--no-warnings", "true"),
        *options,
    ]
    finished = subprocess.run(command, capture_output=True, text=True, check=False)
    if finished.returncode != 0:
        raise InputError(f"netconvert refused the network: {finished.stderr.strip()[:300]}")
    return network


def write_signals(folder: Path, lines: Iterable[str]) -> None:
    """The signal programme of a network, `signals.add.xml` beside it."""
    (folder / "signals.add.xml").write_text(_format_document("additional", lines), encoding="utf-8")


def find_sumo() -> Path:
    """Where SUMO's programs are; InputError with the remedy where it is not installed."""
    try:
        import sumo
    except ImportError:
        raise InputError(
            "building a corpus needs SUMO: install the extra, scenewright[simulate]"
        ) from None
    return Path(sumo.SUMO_HOME)


def name_edge(leg: Compass, *, inwards: bool) -> str:
    """The name of an approach or exit road."""
    return f"{leg}_{'in' if inwards else 'out'}"


def format_tag(name: str, **attributes: object) -> str:
    """One empty XML element; a trailing underscore in a name is dropped."""
    inside = " ".join(f"{k.rstrip('_')}={quoteattr(str(v))}" for k, v in attributes.items())
    return f"<{name} {inside}/>"


def _format_document(root: str, lines: Iterable[str]) -> str:
    """An XML document of lines."""
    return f"<{root}>\n" + "\n".join(lines) + f"\n</{root}>\n"


def format_shape(points: Iterable[tuple[float, float]]) -> str:
    """Points as SUMO writes a shape."""
    return " ".join(f"{x:.3f},{y:.3f}" for x, y in points)


def list_lane_triples(
    intersection_map: IntersectionMap,
) -> Iterator[tuple[Lanelet, Lanelet, Lanelet]]:
    """The approach, connector and exit of every path of every movement."""
    lanelets = {lanelet.id: lanelet for lanelet in intersection_map.lanelets}
    for movement in intersection_map.movements:
        names = iter(movement.lanelets)
        for before, inside, after in zip(names, names, names, strict=True):
            yield lanelets[before], lanelets[inside], lanelets[after]


def format_connection(
    before: Lanelet, inside: Lanelet, after: Lanelet, from_lane: int, to_lane: int
) -> str:
    """A connection between lanes of given numbers along our connector."""
    return format_tag(
        "connection",
        from_=f"{before.leg}_in",
        to=f"{after.leg}_out",
        fromLane=from_lane,
        toLane=to_lane,
        shape=format_shape(inside.centreline),
    )


def format_signal_program(network: Path, intersection_map: IntersectionMap) -> list[str]:
    """Our signal phases by SUMO's link indices, as XML lines."""
    if intersection_map.signals is None:
        raise InputError(f"{intersection_map.name} has no signals to simulate")
    links = _find_link_groups(network, intersection_map.signals)
    head = format_tag("tlLogic", id="J", type="static", programID="plan", offset=0).replace(
        "/>", ">"
    )
    phases = [
        format_tag(
            "phase",
            duration=phase.duration,
            state="".join(_choose_letter(phase.colours[group], kind) for group, kind in links),
        )
        for phase in intersection_map.signals.phases
    ]
    return [head, *phases, "</tlLogic>"]


def _choose_letter(colour: str, kind: str) -> str:
    if kind == "crossing":
        return "G" if colour == "green" else "r"
    if colour == "green":
        return "G" if kind == "straight" else "g"
    return colour[0]


def _find_link_groups(network: Path, signals: SignalProgram) -> list[tuple[str, str]]:
    """By link index: the signal group and what the link is (a turn, or a crossing)."""
    root = ElementTree.parse(network).getroot()
    links: dict[int, tuple[str, str]] = {}
    for element in root.iter("connection"):
        if element.get("tl") == "J":
            links[int(element.attrib["linkIndex"])] = _classify_link(element, root, signals)
    return [links[index] for index in range(len(links))]


def _classify_link(element: Any, root: Any, signals: SignalProgram) -> tuple[str, str]:
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
