"""The SUMO network of any map: its lanelets as lanes, its ways through as connections.

Only driving lanes are built. Lanes are numbered as SUMO wants them, from the kerb, and get our
lanelets as their shapes, prolonged straight beyond the map so that traffic has settled when it
comes into view.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np

from scenewright.scene.base import Compass, FloatArray
from scenewright.scene.map import IntersectionMap, Lanelet
from scenewright.tools.gmm_sampler.sumo_network import (
    converted,
    edge_id,
    programme_lines,
    shape_of,
    tag,
    write_signals,
)

BEYOND = 180.0
"""How far lanes go on beyond the edge of the map [m]."""


def write_place(folder: Path, place: IntersectionMap) -> Path:
    """Write the network of a map; the path of the `.net.xml`, `signals.add.xml` beside it.

    Raises:
        InputError: SUMO is not installed, or does not take the network.
    """
    lanes = {leg.name: _numbered(place, leg.name) for leg in place.legs}
    network = converted(
        folder,
        *(("--lefthand", "true") if place.left_hand_traffic else ()),
        nodes=_nodes(place),
        edges=_edges(lanes),
        connections=_connections(place, lanes),
    )
    write_signals(folder, [] if place.signals is None else programme_lines(network, place))
    return network


_Numbered = Mapping[str, tuple[Lanelet, ...]]
"""`in` and `out`: a leg's lanes, from the kerb."""


def _numbered(place: IntersectionMap, leg: Compass) -> _Numbered:
    found: dict[str, tuple[Lanelet, ...]] = {}
    for side, kind in (("in", "approach"), ("out", "exit")):
        own = [x for x in place.lanelets if x.kind == kind and x.leg == leg]
        found[side] = tuple(sorted(own, key=lambda x: _from_kerb(x, place.left_hand_traffic)))
    return found


def _from_kerb(lane: Lanelet, left_hand: bool) -> float:
    """Grows with the distance from the kerb on the right (on the left, in left-hand traffic)."""
    line = np.array(lane.centreline)
    near = line[-1] if lane.kind == "approach" else line[0]
    ahead = line[-1] - line[0]
    left = np.array([-ahead[1], ahead[0]]) / max(float(np.hypot(*ahead)), 1e-9)
    return float(near @ left) * (-1.0 if left_hand else 1.0)


def _nodes(place: IntersectionMap) -> list[str]:
    kind = "priority" if place.signals is None else "traffic_light"
    more = {} if place.signals is None else {"tl": "J"}
    middle = tag("node", id="J", x=0, y=0, type=kind, **more)
    far = place.extent + BEYOND
    ends = [
        tag(
            "node",
            id=leg.name,
            x=round(far * float(np.cos(leg.bearing)), 2),
            y=round(far * float(np.sin(leg.bearing)), 2),
            type="priority",
        )
        for leg in place.legs
    ]
    return [middle, *ends]


def _edges(lanes: Mapping[Compass, _Numbered]) -> Iterator[str]:
    for leg, sides in lanes.items():
        for side, own in sides.items():
            if not own:
                continue
            inwards = side == "in"
            rows = [
                tag("lane", index=i, width=x.width, shape=shape_of(_prolonged(x, inwards)))
                for i, x in enumerate(own)
            ]
            ends = (leg, "J") if inwards else ("J", leg)
            head = tag(
                "edge",
                id=edge_id(leg, inwards=inwards),
                from_=ends[0],
                to=ends[1],
                numLanes=len(own),
                speed=own[0].speed_limit,
                priority=1,
                shape=shape_of(_prolonged(own[0], inwards)),
            )
            yield head.replace("/>", ">") + "".join(rows) + "</edge>"


def _prolonged(lane: Lanelet, inwards: bool) -> list[tuple[float, float]]:
    line = np.array(lane.centreline)
    end, before = (line[0], line[1]) if inwards else (line[-1], line[-2])
    way: FloatArray = (end - before) / max(float(np.hypot(*(end - before))), 1e-9)
    far = end + BEYOND * way
    points = np.concatenate([far[None], line] if inwards else [line, far[None]])
    return [(float(x), float(y)) for x, y in points]


def _connections(place: IntersectionMap, lanes: Mapping[Compass, _Numbered]) -> Iterator[str]:
    lanelets = {each.id: each for each in place.lanelets}
    for movement in place.movements:
        for first in range(0, len(movement.lanelets), 3):
            before, inside, after = (lanelets[n] for n in movement.lanelets[first : first + 3])
            yield tag(
                "connection",
                from_=edge_id(movement.entry, inwards=True),
                to=edge_id(movement.exit, inwards=False),
                fromLane=lanes[movement.entry]["in"].index(before),
                toLane=lanes[movement.exit]["out"].index(after),
                shape=shape_of(inside.centreline),
            )
