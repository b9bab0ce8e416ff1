"""Reader of Lanelet2 maps (.osm): lanelets between a left and a right bound, in degrees.

Read with the standard parser: the files are plain XML once checked, and maps in the wild lack what
the Lanelet2 library insists on (types, subtypes, consistent bounds).
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from scenewright.errors import InputError
from scenewright.geometry.geographic import LatLon, is_in_degrees, project_mercator
from scenewright.geometry.polyline import drop_doubled_points, resample_to_count, rotate_left
from scenewright.scene.base import FloatArray
from scenewright.tools.map_import.lane_graph import USUAL_LIMIT, FileLane, LaneGraph
from scenewright.tools.map_import.survey import SurveyCrossing

_LIGHTS = ("traffic_light", "traffic_light_regulatory_element")
_FOR_PEDESTRIANS = ("crosswalk", "walkway")
_NOT_DRIVEN = (
    *("bikelane", "bicycle_lane", "stairs", "rail", "emergency_lane", "bus_lane", "busway"),
    *("parking", "parking_lot", "parking_aisle", "driveway", "track"),
)

_MARKS = ("zebra_marking", "pedestrian_marking", "zebra")
"""Types of ways; the last is SinD's, the others are those of Lanelet2."""
_WIDTHS = (1.5, 10.0)
"""Between the two lines of one crosswalk [m]."""
_PARALLEL = math.radians(20.0)
_SHARED = 0.6
"""Of the shorter line's length that lies beside the other."""
_SHORTEST_MARK = 2.5
"""A mark shorter than this is a stripe, not the border of a crosswalk [m]."""
_ASSUMED_WIDTH = 3.0
"""Of a crosswalk of which one border is drawn [m]."""
_SAME_PLACE = 2.0
"""Marks whose middle lies closer to a crosswalk lanelet's are its own [m]."""

Tags = Mapping[str, str]


@dataclass(frozen=True)
class FileElements:
    """What a file holds.

    Attributes:
        origin: latitude and longitude of x = y = 0.
        nodes: [2] by id [m]; ways: tags and ids of nodes.
        relations: tags, and (role, id of a way or relation) of each member.
    """

    origin: LatLon
    nodes: Mapping[str, FloatArray]
    ways: Mapping[str, tuple[Tags, list[str]]]
    relations: Mapping[str, tuple[Tags, list[tuple[str, str]]]]

    def list_relations(self, kind: str) -> Iterator[tuple[str, Tags, list[tuple[str, str]]]]:
        """Id, tags and members of the relations of a type."""
        for name, (tags, members) in self.relations.items():
            if tags.get("type") == kind:
                yield name, tags, members

    def trace_way(self, name: str) -> FloatArray:
        """[P, 2] the nodes of a way that are there [m]; none of a way that is not."""
        known = [self.nodes[n] for n in self.ways.get(name, ({}, []))[1] if n in self.nodes]
        return np.array(known).reshape(-1, 2)


def load_lanelet2(file: Path, center: LatLon | None = None) -> LaneGraph:
    """The lanes of a Lanelet2 file.

    Args:
        center: latitude and longitude of x = y = 0; None takes the mean of all nodes.

    Raises:
        InputError: no lanelets, or bounds missing.
    """
    elements = read_elements(file, center)
    lanes: list[FileLane] = []
    foot: list[FileLane] = []
    crosswalks: list[FileLane] = []
    broken = others = 0
    for name, tags, members in elements.list_relations("lanelet"):
        try:
            left, right = (_read_bound(elements, members, role) for role in ("left", "right"))
        except (KeyError, ValueError):
            broken += 1
            continue
        lane = FileLane(name, *_orient_bounds(left, right), _find_street(tags), _read_limit(tags))
        subtype = tags.get("subtype", "road")
        cars = tags.get("participant:vehicle:car", tags.get("participant:vehicle"))
        if subtype in _FOR_PEDESTRIANS:
            foot.append(lane)
            crosswalks += [lane] * (subtype == "crosswalk")
        elif subtype in _NOT_DRIVEN or cars == "no":
            others += 1
        else:
            lanes.append(lane)
    if broken and not lanes:
        raise InputError(f"{file} has lanelets, but the bounds of all are missing")
    notes = [f"{broken} lanelets without two usable bounds were dropped"] * (broken > 0)
    if walks := len(foot) - len(crosswalks):
        notes.append(
            f"{walks} footways of the file are shown as they are not; sidewalks are derived along "
            "the kerbs"
        )
    return LaneGraph.build(
        file, lanes, others, *notes, foot=tuple(foot), origin=elements.origin,
        crossings=tuple(read_crossings(elements, crosswalks)),
        lights=tuple(_list_lights(elements, {lane.id: lane for lane in lanes})),
    )  # fmt: skip


def read_elements(file: Path, center: LatLon | None) -> FileElements:
    """Nodes, ways and relations of a file that is known to be well-formed."""
    degrees: dict[str, LatLon] = {}
    ways: dict[str, tuple[Tags, list[str]]] = {}
    relations: dict[str, tuple[Tags, list[tuple[str, str]]]] = {}
    try:
        for _, element in ElementTree.iterparse(file):
            if element.tag not in ("node", "way", "relation"):
                continue
            name = element.attrib["id"]
            tags = {t.attrib["k"]: t.attrib["v"] for t in element.iter("tag")}
            if element.tag == "node":
                degrees[name] = _read_degrees(element, file)
            elif element.tag == "way":
                ways[name] = tags, [n.attrib["ref"] for n in element.iter("nd")]
            else:
                members = [(m.get("role", ""), m.get("ref", "")) for m in element.iter("member")]
                relations[name] = tags, members
            element.clear()
    except (KeyError, ValueError) as fault:
        raise InputError(f"{file} is no Lanelet2 map: {fault} is missing or wrong") from None
    if not degrees:
        raise InputError(f"{file} has no lanelets")
    latitudes, longitudes = np.array(list(degrees.values())).T.copy()
    origin = center or (float(latitudes.mean()), float(longitudes.mean()))
    nodes = {name: project_mercator(origin, place) for name, place in degrees.items()}
    return FileElements(origin, nodes, ways, relations)


def _read_degrees(element: Any, file: Path) -> LatLon:
    """Latitude and longitude of a node."""
    if not element.attrib["lat"].strip():
        raise InputError(
            f"{file} gives its places by local_x and local_y alone; latitudes and longitudes are "
            "needed: save it with a map projection"
        )
    node = float(element.attrib["lat"]), float(element.attrib["lon"])
    if not is_in_degrees(node):
        raise InputError(
            f"{file} has a node at latitude {node[0]:g}, longitude {node[1]:g}: these are no "
            "degrees"
        )
    return node


def _list_lights(elements: FileElements, lanes: Mapping[str, FileLane]) -> Iterator[FloatArray]:
    """Where the lanes end that obey the traffic lights of the file, and their stop lines [m]."""
    rules = elements.list_relations("regulatory_element")
    lit = {name: members for name, tags, members in rules if tags.get("subtype") in _LIGHTS}
    for name, _, members in elements.list_relations("lanelet"):
        if name in lanes and any(x == "regulatory_element" and ref in lit for x, ref in members):
            yield lanes[name].line[-1]
    for name in sorted(lit):
        lines = (elements.trace_way(ref) for role, ref in lit[name] if role == "ref_line")
        yield from (np.mean(line, axis=0) for line in lines if len(line))


def _read_bound(
    elements: FileElements, members: Sequence[tuple[str, str]], role: str
) -> FloatArray:
    """[P, 2] a bound [m]; KeyError or ValueError where it is missing or too short."""
    ways = [elements.ways[ref][1] for own, ref in members if own == role]
    pieces = [np.array([elements.nodes[n] for n in way]) for way in ways if way]
    line = drop_doubled_points(chain_pieces(pieces)) if pieces else np.zeros((0, 2))
    if len(line) < 2:
        raise ValueError(role)
    return line


def chain_pieces(pieces: Sequence[FloatArray]) -> FloatArray:
    """[P, 2] one line of the ways of a bound, which may be listed in any order and direction."""
    line, rest = pieces[0], list(pieces[1:])
    while rest:
        # (distance, which, whether its last point meets, whether at the line's beginning)
        joins = [
            (float(np.hypot(*(end - piece[-1 if reversed_ else 0]))), n, reversed_, early)
            for n, piece in enumerate(rest)
            for reversed_ in (False, True)
            for early, end in ((False, line[-1]), (True, line[0]))
        ]
        _, n, reversed_, early = min(joins)
        piece = rest.pop(n)
        piece = piece[::-1] if reversed_ else piece
        line = np.concatenate([piece[::-1], line] if early else [line, piece])
    return line


def _orient_bounds(left: FloatArray, right: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Bounds in driving direction, in which the left one lies on the left."""
    same = float(np.hypot(*(left[0] - right[0])) + np.hypot(*(left[-1] - right[-1])))
    crossed = float(np.hypot(*(left[0] - right[-1])) + np.hypot(*(left[-1] - right[0])))
    if crossed < same:
        right = right[::-1]
    a, b = resample_to_count(left, 20), resample_to_count(right, 20)
    ahead = np.diff((a + b) / 2, axis=0)
    aside = ((a - b)[1:] + (a - b)[:-1]) / 2
    leftness = float((ahead[:, 0] * aside[:, 1] - ahead[:, 1] * aside[:, 0]).sum())
    return (left, right) if leftness > 0 else (left[::-1], right[::-1])


def _read_limit(tags: Tags) -> float:
    """The speed limit [m/s]."""
    limit = tags.get("speed_limit") or tags.get("maxspeed") or ""
    digits = "".join(c for c in limit.split(" ")[0] if c.isdigit() or c == ".")
    return float(digits) / 3.6 if digits.strip(".") else USUAL_LIMIT


def _find_street(tags: Tags) -> str:
    """The street's name; "" for what only names the lanelet, such as N_en_1 or R2In1_to_R1Out1."""
    name = tags.get("road_name") or tags.get("name", "")
    return name if re.search(r"[^\W\d_]{3}", name) and not re.search(r"_|\w\d\b", name) else ""


def read_crossings(elements: FileElements, crosswalks: Sequence[FileLane]) -> list[SurveyCrossing]:
    """Crossings in metres: crosswalk lanelets, and marks that are not such a lanelet's."""
    lanelets = [
        SurveyCrossing(
            crosswalk.line[[0, -1]], float(np.clip(crosswalk.width, 1.0, 12.0)),
            source=f"crosswalk lanelet {crosswalk.id}",
        )
        for crosswalk in crosswalks
    ]  # fmt: skip
    drawn = _pair_marks(dict(_list_marks(elements)))
    places = [lanelet.line.mean(axis=0) for lanelet in lanelets]
    return [
        *lanelets,
        *(
            each
            for each in drawn
            if all(math.dist(each.line.mean(axis=0), place) >= _SAME_PLACE for place in places)
        ),
    ]


def _list_marks(elements: FileElements) -> Iterator[tuple[str, FloatArray]]:
    """Ends [2, 2] [m] of every mark that is no bound of a crosswalk lanelet."""
    own = (members for _, tags, members in elements.list_relations("lanelet")
           if tags.get("subtype") == "crosswalk")  # fmt: skip
    bounds = {ref for members in own for _, ref in members}
    for name, (tags, _) in elements.ways.items():
        if tags.get("type") in _MARKS and name not in bounds:
            line = elements.trace_way(name)
            if len(line) > 1 and math.dist(line[0], line[-1]) >= _SHORTEST_MARK:
                yield name, line[[0, -1]]


def _pair_marks(marks: Mapping[str, FloatArray]) -> Iterator[SurveyCrossing]:
    """A crossing for each two marks beside one another, nearest first; then for single ones."""
    pairs = []
    for a, b in combinations(sorted(marks), 2):
        if (width := _measure_gap(marks[a], marks[b])) is not None:
            pairs.append((width, a, b))
    left = set(marks)
    for width, a, b in sorted(pairs):
        if {a, b} <= left:
            left -= {a, b}
            first, second = marks[a], _align(marks[b], marks[a])
            yield SurveyCrossing((first + second) / 2, width, source=f"zebra lines {a} and {b}")
    for name in sorted(left):
        yield SurveyCrossing(marks[name], _ASSUMED_WIDTH, source=f"zebra line {name}")


def _align(line: FloatArray, other: FloatArray) -> FloatArray:
    """A line in the direction of another."""
    return line if float((line[1] - line[0]) @ (other[1] - other[0])) > 0 else line[::-1]


def _measure_gap(a: FloatArray, b: FloatArray) -> float | None:
    """How far apart two lines run beside one another [m]; None if they do not."""
    b = _align(b, a)
    lengths = [float(np.hypot(*(line[1] - line[0]))) for line in (a, b)]
    ahead = (a[1] - a[0]) / lengths[0]
    left = rotate_left(ahead)
    turn = math.asin(min(abs(float((b[1] - b[0]) @ left)) / lengths[1], 1.0))
    along = (b - a[0]) @ ahead
    shared = min(along.max(), lengths[0]) - max(along.min(), 0.0)
    aside = abs(float((b - a[0]).mean(axis=0) @ left))
    fits = _WIDTHS[0] <= aside <= _WIDTHS[1] and shared >= _SHARED * min(lengths)
    return aside if turn < _PARALLEL and fits else None
