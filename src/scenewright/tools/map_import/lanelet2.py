"""Lanelet2 maps (.osm): lanelets between a left and a right bound, in degrees.

Read with the standard parser: the files are plain XML once vetted, and maps in the wild lack what
the Lanelet2 library insists on (types, subtypes, consistent bounds).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from scenewright.errors import InputError
from scenewright.scene.base import FloatArray
from scenewright.tools.map_import.areas import even, len_of
from scenewright.tools.map_import.survey import Survey, SurveyCrossing, SurveyLane, SurveyWay

geos: Any = import_module("shapely")

_EARTH = 6_378_137.0
_FARTHEST = 3_000.0
"""A node farther from the middle belongs to no intersection [m]."""
_TOUCHING = 0.6
"""Ends of lanelets that lie closer are joined [m]; drawn maps share no nodes there."""
_OVERLAP = 2.5
"""Lanelets that share more ground cross or merge [m^2]."""
_DEFAULT_SPEED = 50.0
_LONGEST_WAY = 12
_LEAST_LANE = 2.0
"""A way that is outside the junction for less [m] at either end is cut off."""
_MARGIN = 0.5
_NEIGHBOUR = 5.0
"""Lanelets that stay closer [m] all along are lanes side by side."""
_SPLIT = 4.0
"""Lanelets at the edge of the map that begin closer to one another [m] split there."""
_SHARPEST = 35.0
"""Radius of a curve that belongs to a turn, not to a leg [m]."""
_GRAFT_TURN = math.radians(40.0)
_LONGEST_APPROACH = 150.0
_NOT_DRIVEN = (
    "crosswalk",
    "walkway",
    "bikelane",
    "bicycle_lane",
    "stairs",
    "rail",
    "emergency_lane",
)


@dataclass(frozen=True, eq=False)
class _Lane:
    """A lanelet for vehicles: bounds and middle in driving direction [m]."""

    id: str
    left: FloatArray
    right: FloatArray
    tags: Mapping[str, str]
    middle: FloatArray = field(init=False)

    def __post_init__(self) -> None:
        count = max(round(max(len_of(self.left), len_of(self.right)) / 0.5), 4)
        sides = [_count(side, count) for side in (self.left, self.right)]
        object.__setattr__(self, "middle", (sides[0] + sides[1]) / 2)

    @property
    def width(self) -> float:
        sides = [_count(side, len(self.middle)) for side in (self.left, self.right)]
        return float(np.median(np.hypot(*(sides[0] - sides[1]).T)))

    @property
    def area(self) -> Any:
        return geos.Polygon(np.concatenate([self.left, self.right[::-1]])).buffer(0)


@dataclass(frozen=True, eq=False)
class _Path:
    """A way through the whole map: lanelets one after the other, and their joined middle.

    Attributes:
        line: [P, 2] every half metre; ends: [n] where each lanelet ends along it [m].
    """

    names: tuple[str, ...]
    line: FloatArray
    ends: FloatArray

    @classmethod
    def of(cls, lanes: Mapping[str, _Lane], names: Sequence[str]) -> _Path:
        line = np.concatenate([lanes[name].middle for name in names])
        line = even(_grafted(line, names, lanes), 0.5)
        last = [lanes[name].middle[-1] for name in names]
        near = [int(np.argmin(np.hypot(*(line - end).T))) for end in last]
        return cls(tuple(names), line, 0.5 * np.array(near, dtype=float))

    @property
    def length(self) -> float:
        return 0.5 * (len(self.line) - 1)

    def inside(self, shared: Any) -> tuple[float, float] | None:
        """Where along it the junction begins and ends [m]; None if it leads through none."""
        where = np.flatnonzero(geos.contains_xy(shared.buffer(0.5), *self.line.T))
        bends = np.flatnonzero(_curvature(self.line) > 1.0 / _SHARPEST)
        if not len(where):
            return None
        first, last = (min([where[0], *bends[:1]]), max([where[-1], *bends[-1:]]))
        return 0.5 * float(first) - _MARGIN, 0.5 * float(last) + _MARGIN

    def at(self, s: float) -> str:
        return self.names[min(int(np.searchsorted(self.ends, s)), len(self.names) - 1)]

    def upto(self, s: float) -> FloatArray:
        return np.asarray(self.line[: max(round(s / 0.5), 1) + 1])

    def since(self, s: float) -> FloatArray:
        return np.asarray(self.line[min(round(s / 0.5), len(self.line) - 2) :])


def read_lanelet2(file: Path, *, center: tuple[float, float] | None, left_hand: bool) -> Survey:
    """The one junction of a Lanelet2 file.

    Args:
        center: latitude and longitude near which the junction lies; lanelets are kept within
            150 m of it. None takes all of the file.

    Raises:
        InputError: no lanelets, bounds missing, or nothing that joins them.
    """
    nodes, ways, relations = _elements(file)
    middle = center or _middle(nodes)
    xy = {name: _metres(middle, place) for name, place in nodes.items()}
    if max(float(np.hypot(*each)) for each in xy.values()) > _FARTHEST and center is None:
        raise InputError(f"{file} spans more than {_FARTHEST:.0f} m; choose a junction by --center")
    notes: list[str] = []
    lanes, foot = _lanelets(relations, ways, xy, file, notes)
    if center is not None:
        near = {k: v for k, v in lanes.items() if np.hypot(*v.middle.T).min() < _LONGEST_APPROACH}
        lanes = near
    if not lanes:
        raise InputError(f"{file} has no lanelets for vehicles there")
    if left_hand:
        notes.append("traffic drives on the left, as asked")
    return _surveyed(lanes, foot, middle, notes, file, left_hand)


_Elements = tuple[
    dict[str, tuple[float, float]],
    dict[str, list[str]],
    list[tuple[dict[str, str], list[tuple[str, str]]]],
]


def _elements(file: Path) -> _Elements:
    """Nodes (latitude, longitude), ways (node ids), and lanelets (tags, members by role)."""
    nodes: dict[str, tuple[float, float]] = {}
    ways: dict[str, list[str]] = {}
    relations = []
    try:
        for _, element in ElementTree.iterparse(file, events=("end",)):
            if element.tag == "node":
                nodes[element.attrib["id"]] = _degrees(element, file)
            elif element.tag == "way":
                ways[element.attrib["id"]] = [n.attrib["ref"] for n in element.iter("nd")]
            elif element.tag == "relation":
                tags = {t.attrib["k"]: t.attrib["v"] for t in element.iter("tag")}
                members = [(m.get("role", ""), m.get("ref", "")) for m in element.iter("member")]
                if tags.get("type") == "lanelet":
                    relations.append((tags | {"id": element.attrib["id"]}, members))
            else:
                continue
            element.clear()
    except (KeyError, ValueError) as fault:
        raise InputError(f"{file} is no Lanelet2 map: {fault} is missing or wrong") from None
    if not nodes or not relations:
        raise InputError(f"{file} has no lanelets")
    return nodes, ways, relations


def _degrees(element: Any, file: Path) -> tuple[float, float]:
    lat, lon = float(element.attrib["lat"]), float(element.attrib["lon"])
    if not (abs(lat) <= 85.0 and abs(lon) <= 180.0):
        raise InputError(
            f"{file} has a node at latitude {lat:g}, longitude {lon:g}: these are no degrees"
        )
    return lat, lon


def _middle(nodes: Mapping[str, tuple[float, float]]) -> tuple[float, float]:
    places = np.array(list(nodes.values()))
    return float(places[:, 0].mean()), float(places[:, 1].mean())


def _metres(middle: tuple[float, float], place: tuple[float, float]) -> FloatArray:
    """East and north of the middle [m], on the sphere of web maps: Mercator, scaled back there."""
    scale = _EARTH * math.cos(math.radians(middle[0]))

    def northing(lat: float) -> float:
        return math.log(math.tan(math.pi / 4 + math.radians(lat) / 2))

    east = scale * math.radians(place[1] - middle[1])
    return np.array([east, scale * (northing(place[0]) - northing(middle[0]))])


def _lanelets(
    relations: Iterable[tuple[dict[str, str], list[tuple[str, str]]]],
    ways: Mapping[str, Sequence[str]],
    xy: Mapping[str, FloatArray],
    file: Path,
    notes: list[str],
) -> tuple[dict[str, _Lane], list[_Lane]]:
    """Lanelets for vehicles by id, and those for people on foot."""
    lanes: dict[str, _Lane] = {}
    foot: list[_Lane] = []
    broken = others = 0
    for tags, members in relations:
        try:
            left, right = (_bound(role, members, ways, xy) for role in ("left", "right"))
        except (KeyError, ValueError):
            broken += 1
            continue
        lane = _Lane(tags["id"], *_aligned(left, right), tags)
        subtype = tags.get("subtype", "road")
        if subtype in ("crosswalk", "walkway"):
            foot.append(lane)
        elif subtype in _NOT_DRIVEN:
            others += 1
        else:
            lanes[lane.id] = lane
    if broken:
        notes.append(f"{broken} lanelets without two usable bounds were dropped")
    if others:
        notes.append(f"{others} lanelets for bicycles and others were dropped")
    if broken and not lanes:
        raise InputError(f"{file} has lanelets, but the bounds of all are missing")
    return lanes, foot


def _bound(
    role: str,
    members: Sequence[tuple[str, str]],
    ways: Mapping[str, Sequence[str]],
    xy: Mapping[str, FloatArray],
) -> FloatArray:
    pieces = [[xy[n] for n in ways[ref]] for r, ref in members if r == role]
    line = _chained([np.array(piece) for piece in pieces if len(piece)])
    if len(line) < 2:
        raise ValueError(role)
    joined = line
    kept = np.concatenate([[True], np.hypot(*np.diff(joined, axis=0).T) > 1e-6])
    if kept.sum() < 2:
        raise ValueError(role)
    return np.asarray(joined[kept])


def _chained(pieces: Sequence[FloatArray]) -> FloatArray:
    """[P, 2] one line of the ways of a bound, which may be listed in any order and direction."""
    if not pieces:
        return np.zeros((0, 2))
    line, rest = pieces[0], list(pieces[1:])
    while rest:
        # (distance, which, whether its last point meets, whether at the line's beginning)
        joins = [
            (float(np.hypot(*(end - piece[-1 if turned else 0]))), n, turned, early)
            for n, piece in enumerate(rest)
            for turned in (False, True)
            for early, end in ((False, line[-1]), (True, line[0]))
        ]
        _, n, turned, early = min(joins)
        piece = rest.pop(n)
        piece = piece[::-1] if turned else piece
        line = np.concatenate([piece[::-1], line] if early else [line, piece])
    return line


def _aligned(left: FloatArray, right: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Bounds in driving direction: the left one lies to the left of who drives."""
    same = float(np.hypot(*(left[0] - right[0])) + np.hypot(*(left[-1] - right[-1])))
    crossed = float(np.hypot(*(left[0] - right[-1])) + np.hypot(*(left[-1] - right[0])))
    if crossed < same:
        right = right[::-1]
    a, b = _count(left, 20), _count(right, 20)
    ahead = np.diff((a + b) / 2, axis=0)
    aside = ((a - b)[1:] + (a - b)[:-1]) / 2
    leftness = float((ahead[:, 0] * aside[:, 1] - ahead[:, 1] * aside[:, 0]).sum())
    return (left, right) if leftness > 0 else (left[::-1], right[::-1])


def _count(line: FloatArray, count: int) -> FloatArray:
    s = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(line, axis=0).T))])
    wanted = np.linspace(0.0, s[-1], count)
    return np.stack([np.interp(wanted, s, line[:, axis]) for axis in (0, 1)], axis=1)


def _surveyed(
    lanes: dict[str, _Lane],
    foot: Sequence[_Lane],
    middle: tuple[float, float],
    notes: list[str],
    file: Path,
    left_hand: bool,
) -> Survey:
    follows = _successors(lanes)
    paths = [_Path.of(lanes, names) for names in _paths(lanes, follows)]
    shared = _shared(lanes, follows, paths)
    approaches: dict[str, FloatArray] = {}
    exits: dict[str, FloatArray] = {}
    found: dict[tuple[str, str], FloatArray] = {}
    cut_off = 0
    for path in paths:
        ends = path.inside(shared)
        if ends is None:
            continue
        before, after = f"{path.at(ends[0])}>", f">{path.at(ends[1])}"
        if ends[0] < _LEAST_LANE or path.length - ends[1] < _LEAST_LANE:
            cut_off += 1
            continue
        key = (before, after)
        approaches[before] = _shorter(approaches.get(before), path.upto(ends[0]))
        exits[after] = _shorter(exits.get(after), path.since(ends[1]))
        found[key] = path.line
    if cut_off:
        notes.append(f"{cut_off} ways begin or end inside the junction and were dropped")
    if not found:
        raise InputError(
            f"{file} has {len(lanes)} lanelets for vehicles, but no way leads from outside "
            "through a junction to outside"
        )
    at = np.round(np.array(shared.envelope.centroid.coords[0]), 3)
    ways = [
        SurveyWay(a, b, _between(line, approaches[a][-1], exits[b][0]) - at)
        for (a, b), line in found.items()
    ]
    crossings, walks = _on_foot(foot, at)
    if walks:
        notes.append(f"{len(walks)} footways of the file are shown as they are not; sidewalks "
                     "are derived along the kerbs")  # fmt: skip
    unused = len(lanes) - len({n for path in paths for n in path.names})
    if unused:
        notes.append(f"{unused} lanelets that lead nowhere were dropped")
    return Survey(
        title=_title(lanes.values(), file),
        approaches={n: _lane(n, lanes[n.strip(">")], line - at) for n, line in approaches.items()},
        exits={n: _lane(n, lanes[n.strip(">")], line - at) for n, line in exits.items()},
        ways=tuple(ways),
        crossings=tuple(crossings),
        areas=tuple(
            np.concatenate([lanes[n].left, lanes[n].right[::-1]]) - at
            for n in sorted({name for path in paths for name in path.names})
        ),
        left_hand=left_hand,
        signalised=None,
        origin=_back(middle, at),
        offset=(round(float(at[0]), 3), round(float(at[1]), 3)),
        notes=notes,
    )


def _back(middle: tuple[float, float], xy: FloatArray) -> tuple[float, float]:
    lat = middle[0] + math.degrees(float(xy[1]) / _EARTH)
    lon = middle[1] + math.degrees(float(xy[0]) / (_EARTH * math.cos(math.radians(middle[0]))))
    return round(lat, 7), round(lon, 7)


def _successors(lanes: Mapping[str, _Lane]) -> dict[str, list[str]]:
    """Which lanelets begin where one ends, both bounds within reach."""
    names = sorted(lanes)
    starts = np.array([[lanes[n].left[0], lanes[n].right[0]] for n in names])
    found: dict[str, list[str]] = {}
    for name in names:
        ends = np.array([lanes[name].left[-1], lanes[name].right[-1]])
        away = np.hypot(*(starts - ends).transpose(2, 0, 1)).max(axis=1)
        found[name] = [n for n, d in zip(names, away, strict=True) if d < _TOUCHING and n != name]
    return found


def _paths(lanes: Mapping[str, _Lane], follows: Mapping[str, list[str]]) -> Iterator[list[str]]:
    """Every way from a lanelet without a predecessor to one without a successor."""
    led_to = {name for each in follows.values() for name in each}
    todo = [[name] for name in sorted(lanes, reverse=True) if name not in led_to]
    while todo:
        path = todo.pop()
        onwards = [name for name in follows[path[-1]] if name not in path]
        if not onwards:
            yield path
        elif len(path) < _LONGEST_WAY:
            todo += [[*path, name] for name in onwards]


def _curvature(line: FloatArray) -> FloatArray:
    """[P] curvature of a line with points half a metre apart, over some metres [1/m]."""
    from scipy import ndimage

    filters: Any = ndimage
    smooth = filters.gaussian_filter1d(line, 4.0, axis=0, mode="nearest")
    step = np.gradient(smooth, axis=0)
    course = np.unwrap(np.arctan2(step[:, 1], step[:, 0]))
    bend = np.abs(np.gradient(course)) / np.maximum(np.hypot(*step.T), 1e-6)
    bend[:6] = bend[-6:] = 0.0
    return np.asarray(bend)


def _grafted(line: FloatArray, names: Sequence[str], lanes: Mapping[str, _Lane]) -> FloatArray:
    """A way that ends upon another lanelet goes on along it, and begins along one likewise."""
    after = _beneath(line[-1], line[-1] - line[-4], names, lanes)
    if after is not None:
        line = np.concatenate([line, after[1][after[0] + 8 :]])
    before = _beneath(line[0], line[3] - line[0], names, lanes)
    if before is not None:
        line = np.concatenate([before[1][: max(before[0] - 8, 0)], line])
    return line


def _beneath(
    point: FloatArray, way: FloatArray, names: Sequence[str], lanes: Mapping[str, _Lane]
) -> tuple[int, FloatArray] | None:
    """Another lanelet's middle that runs the same way beneath a point, and where along it."""
    best: tuple[float, int, FloatArray] | None = None
    for name, lane in lanes.items():
        if name in names:
            continue
        apart = np.hypot(*(lane.middle - point).T)
        k = int(np.argmin(apart))
        if apart[k] > lane.width / 2 or not 4 <= k < len(lane.middle) - 4:
            continue
        ahead = lane.middle[k + 2] - lane.middle[k - 2]
        turn = abs(
            math.remainder(math.atan2(ahead[1], ahead[0]) - math.atan2(way[1], way[0]), math.tau)
        )
        if turn < _GRAFT_TURN and (best is None or apart[k] < best[0]):
            best = (float(apart[k]), k, lane.middle)
    return None if best is None else best[1:]


def _shared(
    lanes: Mapping[str, _Lane], follows: Mapping[str, list[str]], paths: Sequence[_Path]
) -> Any:
    """The ground that lanelets share without following one another: where ways cross or join."""
    names = sorted({name for path in paths for name in path.names})
    led_to = {name for each in follows.values() for name in each}
    shapes = [lanes[n].area for n in names]
    tree = geos.STRtree(shapes)
    pieces = []
    for i, name in enumerate(names):
        for j in tree.query(shapes[i]).tolist():
            other = names[j]
            if j <= i or other in follows[name] or name in follows[other]:
                continue
            if _side_by_side(lanes[name].middle, lanes[other].middle):
                continue
            if _split_outside(lanes[name], lanes[other], name in led_to, other in led_to, follows):
                continue
            piece = shapes[i].intersection(shapes[j])
            if piece.area >= _OVERLAP:
                pieces.append(piece)
    return geos.union_all(pieces)


def _split_outside(
    a: _Lane, b: _Lane, a_led_to: bool, b_led_to: bool, follows: Mapping[str, list[str]]
) -> bool:
    """Whether two lanelets begin together where the map begins, or end together where it ends."""
    together = float(np.hypot(*(a.middle[0] - b.middle[0]))) < _SPLIT
    if together and not a_led_to and not b_led_to:
        return True
    together = float(np.hypot(*(a.middle[-1] - b.middle[-1]))) < _SPLIT
    return together and not follows[a.id] and not follows[b.id]


def _side_by_side(a: FloatArray, b: FloatArray) -> bool:
    """Whether two lanelets are neighbours in one road all along, drawn a little too wide."""
    few, many = (a, b) if len(a) <= len(b) else (b, a)
    away = max(float(np.hypot(*(many - point).T).min()) for point in few[:: max(len(few) // 12, 1)])
    ends = [np.hypot(*(a[k] - b[k])) for k in (0, -1)]
    return away < _NEIGHBOUR and max(float(end) for end in ends) < 3 * _NEIGHBOUR


def _shorter(known: FloatArray | None, line: FloatArray) -> FloatArray:
    """Of two stretches of one lane, that which stays farther from the junction."""
    return line if known is None or len_of(line) < len_of(known) else known


def _between(line: FloatArray, first: FloatArray, last: FloatArray) -> FloatArray:
    """The stretch of a line between the places nearest to two points."""
    a = int(np.argmin(np.hypot(*(line - first).T)))
    b = int(np.argmin(np.hypot(*(line - last).T)))
    return line[a : max(b, a + 1) + 1]


def _lane(name: str, own: _Lane, line: FloatArray) -> SurveyLane:
    limit = own.tags.get("speed_limit") or own.tags.get("maxspeed") or ""
    digits = "".join(c for c in limit.split(" ")[0] if c.isdigit() or c == ".")
    speed = float(digits) if digits.strip(".") else _DEFAULT_SPEED
    return SurveyLane(
        id=name,
        line=even(line, 1.0),
        width=float(np.clip(own.width, 2.4, 6.0)),
        speed=speed / 3.6,
        road=own.tags.get("name", ""),
    )


def _on_foot(
    foot: Sequence[_Lane], at: FloatArray
) -> tuple[list[SurveyCrossing], list[FloatArray]]:
    crossings, walks = [], []
    for lane in foot:
        middle = lane.middle - at
        if lane.tags.get("subtype") == "crosswalk":
            crossings.append(SurveyCrossing(middle[[0, -1]], float(np.clip(lane.width, 2.0, 8.0))))
        else:
            walks.append(middle)
    return crossings, walks


def _title(lanes: Iterable[_Lane], file: Path) -> str:
    names = sorted({lane.tags["name"] for lane in lanes if lane.tags.get("name")})
    return ", ".join(names)[:80] if names else f"junction of {file.name}"[:80]
