"""The SUMO network of any map: its lanelets as lanes, its ways through as connections.

Lanes are numbered as SUMO wants them, from the kerb: 0 is the sidewalk, then come driving lanes,
outer first. These get our lanelets as their shapes, prolonged straight beyond the map so that
traffic has settled when it comes into view. Crosswalks are ours; what joins them to the sidewalks
SUMO makes up, so that walked tracks are brought on to our walkable area afterwards.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np

from scenewright.geometry.polyline import compute_tangents
from scenewright.scene.base import Compass, FloatArray
from scenewright.scene.map import Crosswalk, IntersectionMap, Lanelet
from scenewright.tools.simulation.sumo_network import (
    converted,
    edge_id,
    programme_lines,
    shape_of,
    tag,
    write_signals,
)

BEYOND = 180.0
"""How far lanes go on beyond the edge of the map [m]."""
SIDEWALK = 3.0
"""Width of a derived sidewalk [m]."""


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
        edges=_edges(lanes, place),
        connections=[*_connections(place, lanes), *_crossings(place, lanes)],
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


def _edges(lanes: Mapping[Compass, _Numbered], place: IntersectionMap) -> Iterator[str]:
    walks = {each.leg: each for each in place.crosswalks}
    for leg, sides in lanes.items():
        for side, own in sides.items():
            if not own:
                continue
            inwards = side == "in"
            beside = _beside(own[0], inwards, place.left_hand_traffic)
            rows = [_sidewalk(beside, inwards, walks.get(leg))] + [
                tag(
                    "lane",
                    index=i,
                    width=x.width,
                    disallow="pedestrian",
                    shape=shape_of(_prolonged(x, inwards)),
                )
                for i, x in enumerate(own, start=1)
            ]
            ends = (leg, "J") if inwards else ("J", leg)
            head = tag(
                "edge",
                id=edge_id(leg, inwards=inwards),
                from_=ends[0],
                to=ends[1],
                numLanes=len(own) + 1,
                speed=own[0].speed_limit,
                priority=1,
                shape=shape_of(_prolonged(own[0], inwards)),
            )
            yield head.replace("/>", ">") + "".join(rows) + "</edge>"


def _beside(lane: Lanelet, inwards: bool, left_hand: bool) -> FloatArray:
    """[P, 2] the middle of the sidewalk along the outermost lane."""
    line = np.array(_prolonged(lane, inwards))
    ahead = compute_tangents(line)
    kerbwards = np.stack([ahead[:, 1], -ahead[:, 0]], axis=1) * (-1.0 if left_hand else 1.0)
    return np.asarray(line + (lane.width + SIDEWALK) / 2 * kerbwards)


def _sidewalk(beside: FloatArray, inwards: bool, crosswalk: Crosswalk | None) -> str:
    """A sidewalk that ends where the leg's crosswalk begins: nobody walks on to come back."""
    line = beside[::-1] if inwards else beside  # from the junction outwards
    if crosswalk is not None:
        line = _from_crosswalk(line, crosswalk)
    line = line[::-1] if inwards else line
    return tag(
        "lane",
        index=0,
        width=SIDEWALK,
        allow="pedestrian",
        speed=2.8,
        shape=shape_of((float(x), float(y)) for x, y in line),
    )


def _from_crosswalk(line: FloatArray, crosswalk: Crosswalk) -> FloatArray:
    """What of a sidewalk [P, 2], from the junction outwards, lies beyond its leg's crosswalk."""
    s = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(line, axis=0).T))])
    even = np.arange(0.0, s[-1], 0.5)
    fine = np.stack([np.interp(even, s, line[:, axis]) for axis in (0, 1)], axis=1)
    kerbs = np.array(crosswalk.centreline)
    away = np.hypot(*(fine[:, None] - kerbs[None]).transpose(2, 0, 1)).min(axis=1)
    begin = even[int(away.argmin())] + crosswalk.width / 2 + 0.5
    kept = s > begin + 0.5
    if not kept.any():
        return line
    first = np.array([[np.interp(begin, s, line[:, axis]) for axis in (0, 1)]])
    return np.concatenate([first, line[kept]])


def _crossings(place: IntersectionMap, lanes: Mapping[Compass, _Numbered]) -> Iterator[str]:
    """Our crosswalks; SUMO wants their shapes clockwise round the junction."""
    for walk in place.crosswalks:
        roads = [edge_id(walk.leg, inwards=s == "in") for s in ("in", "out") if lanes[walk.leg][s]]
        (ax, ay), (bx, by) = walk.centreline
        clockwise = ax * by - ay * bx < 0.0
        shape = walk.centreline if clockwise else walk.centreline[::-1]
        yield tag(
            "crossing",
            node="J",
            edges=" ".join(roads),
            priority="true",
            width=round(walk.width, 2),
            shape=shape_of(shape),
        )


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
                fromLane=lanes[movement.entry]["in"].index(before) + 1,
                toLane=lanes[movement.exit]["out"].index(after) + 1,
                shape=shape_of(inside.centreline),
            )
