"""The SUMO network of a four-leg plan: same lanes, connectors, crosswalks and signals as our map.

Lanes are numbered from the kerb: 0 sidewalk, 1 parking (closed), then driving lanes outer first.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from lab.bundle.four_leg_plan import LEGS, FourLegPlan, locate_point
from scenewright.scene.base import Compass
from scenewright.scene.map import IntersectionMap
from scenewright.scene.map_elements import Lanelet
from scenewright.tools.simulation.sumo_network import (
    convert_network,
    format_connection,
    format_shape,
    format_signal_program,
    format_tag,
    list_lane_triples,
    name_edge,
    write_signals,
)

REACH = 300.0
"""How far the approach roads reach from the middle [m]."""
_FIRST_DRIVING_LANE = 2


def write_network(folder: Path, plan: FourLegPlan, intersection_map: IntersectionMap) -> Path:
    """Write the network and its signal programme; the path of the `.net.xml`.

    The programme is `signals.add.xml` beside it. InputError where SUMO is not installed.
    """
    network = convert_network(
        folder,
        nodes=_format_nodes(plan),
        edges=_format_edges(plan),
        connections=_format_connections(plan, intersection_map),
    )
    write_signals(folder, format_signal_program(network, intersection_map))
    return network


def _format_nodes(plan: FourLegPlan) -> list[str]:
    outline: list[tuple[float, float]] = []
    for leg in reversed(LEGS):
        side = plan.get_road(leg).half_width + plan.get_road(leg).sidewalk
        outline += [locate_point(leg, plan.measure_stop(leg), sign * side) for sign in (-1, 1)]
    middle = format_tag(
        "node", id="J", x=0, y=0, type="traffic_light", tl="J", shape=format_shape(outline)
    )
    ends = [(leg, *locate_point(leg, REACH, 0.0)) for leg in LEGS]
    return [middle, *(format_tag("node", id=leg, x=x, y=y, type="priority") for leg, x, y in ends)]


def _format_edges(plan: FourLegPlan) -> list[str]:
    return [_format_edge(plan, leg, inwards) for leg in LEGS for inwards in (True, False)]


def _format_edge(plan: FourLegPlan, leg: Compass, inwards: bool) -> str:
    road = plan.get_road(leg)
    lanes = [
        format_tag("lane", index=0, width=road.sidewalk, allow="pedestrian", speed=2.8),
        format_tag("lane", index=1, width=road.parking, disallow="all"),
    ]
    for number, width in enumerate(reversed(road.lanes)):
        index = number + _FIRST_DRIVING_LANE
        lanes.append(format_tag("lane", index=index, width=width, disallow="pedestrian"))
    ends = (leg, "J") if inwards else ("J", leg)
    head = format_tag(
        "edge",
        id=name_edge(leg, inwards=inwards),
        from_=ends[0],
        to=ends[1],
        numLanes=len(lanes),
        speed=plan.speed_limit,
        priority=1,
    )
    return head.replace("/>", ">") + "".join(lanes) + "</edge>"


def _format_connections(plan: FourLegPlan, intersection_map: IntersectionMap) -> Iterator[str]:
    for before, inside, after in list_lane_triples(intersection_map):
        yield format_connection(
            before, inside, after, _find_lane_index(plan, before), _find_lane_index(plan, after)
        )
    for leg in LEGS:
        yield _format_crossing(plan, intersection_map, leg)


def _find_lane_index(plan: FourLegPlan, lanelet: Lanelet) -> int:
    lanes = len(plan.get_road(lanelet.leg or "north").lanes)
    inner = lanelet.id.endswith(":inner")
    return _FIRST_DRIVING_LANE + (1 if lanes > 1 and inner else 0)


def _format_crossing(plan: FourLegPlan, intersection_map: IntersectionMap, leg: Compass) -> str:
    crosswalk = next(c for c in intersection_map.crosswalks if c.leg == leg)
    edges = f"{name_edge(leg, inwards=True)} {name_edge(leg, inwards=False)}"
    # SUMO wants crossings clockwise: the other way round, pedestrians appear mirrored
    start, end = crosswalk.centreline
    return format_tag(
        "crossing",
        node="J",
        edges=edges,
        priority="true",
        width=plan.crosswalk_width,
        shape=format_shape((end, start)),
    )
