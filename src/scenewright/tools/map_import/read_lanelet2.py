"""Reader of Lanelet2 maps (.osm): lanelets between a left and a right bound, in degrees.

Read with the standard parser: the files are plain XML once checked, and maps in the wild lack what
the Lanelet2 library insists on (types, subtypes, consistent bounds).
"""

from __future__ import annotations

import heapq
import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from scenewright.errors import InputError
from scenewright.geometry.geographic import (
    LatLon,
    is_in_degrees,
    project_mercator,
    project_to_degrees,
)
from scenewright.geometry.polyline import (
    drop_doubled_points,
    measure_distances,
    measure_length,
    resample_by_spacing,
    resample_to_count,
    smooth_gaussian,
)
from scenewright.scene.base import FloatArray
from scenewright.tools.map_import.driving_side import find_lanelet2_side, take_option
from scenewright.tools.map_import.junction_choice import (
    OTHER_SOURCE,
    Junction,
    JunctionOverview,
    check_importable,
    choose_junction,
)
from scenewright.tools.map_import.lanelet2_crosswalks import read_lanelet2_crossings
from scenewright.tools.map_import.legs import SurveyLeg, find_legs
from scenewright.tools.map_import.map_parts import geos
from scenewright.tools.map_import.rings import ROUNDABOUT, Ring, find_rings, join_rings
from scenewright.tools.map_import.survey import (
    ASSUMED_SIDE,
    DrivingSide,
    Survey,
    SurveyConnection,
    SurveyCrossing,
    SurveyLane,
    SurveyLight,
)

_TOUCHING = 0.6
"""Ends of lanelets that lie closer are joined [m]; drawn maps share no nodes there."""
_OVERLAP = 2.5
"""Lanelets that share more ground cross or merge [m^2]."""
_DEFAULT_SPEED = 50.0
_MOST_LANELETS = 12
_LONGEST_LANELET = 20_000.0
"""A longer one has a place that is wrong [m]."""
_SHORTEST_LANE = 2.0
"""A path that is outside the junction for less [m] at either end is cut off."""
_SHORTEST_LEG = 6.0
"""The same in a file of several junctions, of which some lie at the file's edge [m]."""
_MARGIN = 0.5
_ABREAST = 5.0
"""Lanelets that stay closer [m] all along are lanes side by side."""
_SPLIT = 4.0
"""Lanelets at the edge of the map that begin closer to one another [m] split there."""
_SHARPEST = 35.0
"""Radius of a curve that belongs to a turn, not to a leg [m]."""
_BEND_REACH = 100
"""Bends farther from the shared ground belong to another junction [half metres]."""
_GRAFT_TURN = math.radians(40.0)
_LONGEST_APPROACH = 150.0
_LIGHTS = ("traffic_light", "traffic_light_regulatory_element")
_FOR_PEDESTRIANS = ("crosswalk", "walkway")
_NOT_DRIVEN = (
    *("bikelane", "bicycle_lane", "stairs", "rail", "emergency_lane", "bus_lane", "busway"),
    *("parking", "parking_lot", "parking_aisle", "driveway", "track"),
)


@dataclass(frozen=True, eq=False)
class FileLanelet:
    """A lanelet of a file: bounds and middle in driving direction [m]."""

    id: str
    left: FloatArray
    right: FloatArray
    tags: Mapping[str, str]
    middle: FloatArray = field(init=False)

    def __post_init__(self) -> None:
        longest = max(measure_length(self.left), measure_length(self.right))
        if not longest < _LONGEST_LANELET:
            raise InputError(f"lanelet {self.id[:40]} is {longest:.3g} m long; this cannot be")
        sides = self._resample_sides(max(round(longest / 0.5), 4))
        object.__setattr__(self, "middle", (sides[0] + sides[1]) / 2)

    def _resample_sides(self, count: int) -> list[FloatArray]:
        return [resample_to_count(side, count) for side in (self.left, self.right)]

    @cached_property
    def width(self) -> float:
        """The median over its length [m]."""
        left, right = self._resample_sides(len(self.middle))
        return float(np.median(np.hypot(*(left - right).T)))

    @property
    def outline(self) -> FloatArray:
        """[P, 2] round its ground [m]."""
        return np.concatenate([self.left, self.right[::-1]])


_Lanelets = Mapping[str, FileLanelet]


@dataclass(frozen=True, eq=False)
class _Grounds:
    """What lanelets share at a junction, and at all others; ring: of a roundabout."""

    shared: Any
    others: Any
    ring: Ring | None = None


@dataclass(frozen=True, eq=False)
class _Path:
    """A path through the whole map along lanelets, and their joined middle.

    Attributes:
        line: [P, 2] every half metre; ends: [n] where each lanelet ends along it [m].
    """

    names: tuple[str, ...]
    line: FloatArray
    ends: FloatArray

    @classmethod
    def join(cls, lanelets: _Lanelets, names: Sequence[str]) -> _Path:
        line = np.concatenate([lanelets[name].middle for name in names])
        line = resample_by_spacing(_graft(line, names, lanelets), 0.5)
        last = np.array([lanelets[name].middle[-1] for name in names])
        return cls(tuple(names), line, 0.5 * measure_distances(last, line).argmin(axis=1))

    @property
    def length(self) -> float:
        return 0.5 * (len(self.line) - 1)

    def find_junction(self, shared: Any, others: Any) -> tuple[float, float] | None:
        """Where along it the junction begins and ends [m]; None if it leads through none.

        Bends before and behind the shared ground belong to it, if they lie no nearer to others'.
        """
        inside = np.flatnonzero(geos.contains_xy(shared.buffer(0.5), *self.line.T))
        bends = np.flatnonzero(_measure_curvature(self.line) > 1.0 / _SHARPEST)
        if not len(inside):
            return None
        elsewhere = np.flatnonzero(geos.contains_xy(others, *self.line.T))
        low, high = inside[0] - _BEND_REACH, inside[-1] + _BEND_REACH
        if len(before := elsewhere[elsewhere < inside[0]]):
            low = max(low, (before[-1] + inside[0]) // 2)
        if len(behind := elsewhere[elsewhere > inside[-1]]):
            high = min(high, (behind[0] + inside[-1]) // 2)
        bends = bends[(bends > low) & (bends < high)]
        first, last = min([inside[0], *bends[:1]]), max([inside[-1], *bends[-1:]])
        return 0.5 * float(first) - _MARGIN, 0.5 * float(last) + _MARGIN

    def name_at(self, s: float) -> str:
        return self.names[min(int(np.searchsorted(self.ends, s)), len(self.names) - 1)]

    def take_until(self, s: float) -> FloatArray:
        return np.asarray(self.line[: max(round(s / 0.5), 1) + 1])

    def take_from(self, s: float) -> FloatArray:
        return np.asarray(self.line[min(round(s / 0.5), len(self.line) - 2) :])


@dataclass(frozen=True, eq=False)
class LaneletFile:
    """What a file of lanelets holds, in metres from an origin.

    Attributes:
        lanelets: for vehicles, by id; foot: for pedestrians.
        origin: latitude and longitude of x = y = 0; None where the file has no degrees.
        crossings: for pedestrians, as drawn; lights: [2] where lanelets end that obey one.
        notes: what was dropped.
    """

    file: Path
    lanelets: dict[str, FileLanelet]
    foot: tuple[FileLanelet, ...]
    origin: LatLon | None
    crossings: tuple[SurveyCrossing, ...] = ()
    lights: tuple[FloatArray, ...] = ()
    notes: tuple[str, ...] = ()


def read_lanelet2(
    file: Path,
    *,
    center: tuple[float, float] | None,
    left_hand: bool | None,
    junction: str | None = None,
    streets: Sequence[str] = (),
) -> Survey:
    """One junction of a Lanelet2 file; see `survey_lanelets`."""
    return survey_lanelets(
        load_lanelet2(file, center),
        center=center,
        junction=junction,
        streets=streets,
        left_hand=left_hand,
    )


def load_lanelet2(file: Path, center: LatLon | None = None) -> LaneletFile:
    """The lanelets of a Lanelet2 file.

    Raises:
        InputError: no lanelets, or bounds missing.
    """
    elements = read_elements(file)
    nodes = np.array(list(elements.nodes.values()))
    origin = center or (float(nodes[:, 0].mean()), float(nodes[:, 1].mean()))
    notes: list[str] = []
    lanelets, foot = build_lanelets(elements, origin, file, notes)
    crossings = tuple(read_lanelet2_crossings(elements, foot, origin))
    lights = tuple(_list_lights(elements, lanelets, origin))
    return LaneletFile(file, lanelets, tuple(foot), origin, crossings, lights, tuple(notes))


def survey_lanelets(
    held: LaneletFile,
    *,
    center: tuple[float, float] | None,
    junction: str | None,
    streets: Sequence[str],
    left_hand: bool | None,
) -> Survey:
    """The junction that is chosen, or the one that all lanelets make up.

    Args:
        center: near which the junction lies. Without it, an id or streets all of the file is one
            junction, if it can be.

    Raises:
        InputError: nothing that joins lanelets, or several junctions and none chosen.
    """
    notes = [*held.notes]
    if not held.lanelets:
        raise InputError(f"{held.file} has no lanelets for vehicles there")
    lines = [each.middle for each in held.lanelets.values()]
    side = take_option(left_hand) or find_lanelet2_side(lines)
    rings = _find_rings(held)
    if center is None and junction is None and not streets and not rings:
        far = max(float(np.hypot(*each.middle.T).max()) for each in held.lanelets.values())
        if far <= _ONE_JUNCTION:
            return _survey_junction(held, held.lanelets, None, notes, side)
    found = _find_places(held, rings)
    if not found and center is None:
        return _survey_junction(held, held.lanelets, None, notes, side)
    chosen = choose_junction(
        [each for each, _ in found],
        file=held.file,
        center=center,
        junction=junction,
        origin=held.origin,
        streets=streets,
    )
    check_importable(chosen, held.file)
    ground = next(grounds for each, grounds in found if each is chosen)
    near = _take_near(held.lanelets, chosen.xy)
    return _survey_junction(held, near, ground, notes, side)


_ONE_JUNCTION = 250.0
"""A file whose lanelets lie within that of its middle is taken to be of one junction [m]."""
_APART = 9.0
"""Shared grounds that lie farther apart belong to different junctions [m]."""


def _take_near(lanelets: _Lanelets, xy: tuple[float, float]) -> dict[str, FileLanelet]:
    return {
        name: each
        for name, each in lanelets.items()
        if np.hypot(*(each.middle - np.array(xy)).T).min() < _LONGEST_APPROACH
    }


def list_lanelet_junctions(held: LaneletFile) -> JunctionOverview:
    """The junctions of a file of lanelets, and its lanelets."""
    found = tuple(each for each, _ in _find_places(held, _find_rings(held)))
    return JunctionOverview(found, tuple(each.middle for each in held.lanelets.values()))


def _find_rings(held: LaneletFile) -> list[Ring]:
    lines = {name: each.middle for name, each in held.lanelets.items()}
    return join_rings(find_rings(lines, _find_successors(held.lanelets)))


def _list_grounds(held: LaneletFile, rings: Sequence[Ring]) -> Iterator[_Grounds]:
    """What lanelets share at each junction; a ring with what lies on it is one."""
    follows = _find_successors(held.lanelets)
    shared = _find_shared_ground(held.lanelets, follows, sorted(held.lanelets))
    grown = shared.buffer(_APART / 2)
    if rings:
        shared = geos.union_all([shared, *(ring.carriageway for ring in rings)])
        grown = geos.union_all([shared.buffer(_APART / 2), *(ring.disc for ring in rings)])
    for area in getattr(grown, "geoms", [grown]):
        own = next((ring for ring in rings if ring.disc.intersects(area)), None)
        yield _Grounds(shared.intersection(area), shared.difference(area), own)


def _find_places(held: LaneletFile, rings: Sequence[Ring]) -> list[tuple[Junction, _Grounds]]:
    """Junctions with the ground that lanelets share there; those of three or more legs."""
    found: list[tuple[Junction, _Grounds]] = []
    for grounds in _list_grounds(held, rings):
        middle = np.array(grounds.shared.envelope.centroid.coords[0])
        xy = float(middle[0]), float(middle[1])
        near = _take_near(held.lanelets, xy)
        touched = [
            n for n, each in near.items() if geos.LineString(each.middle).intersects(grounds.shared)
        ]
        legs: tuple[SurveyLeg, ...] = ()
        refusal = "" if grounds.ring is None else grounds.ring.refusal
        if not refusal:
            try:
                survey = _survey_junction(held, near, grounds, [], ASSUMED_SIDE)
                legs = find_legs(survey)
            except InputError as fault:
                refusal = str(fault)
            else:
                refusal = "" if len(survey.connections) >= 3 else "it has fewer than three ways"
        if not touched or (refusal and grounds.ring is None):
            continue
        taken = {each.id for each, _ in found}
        junction = Junction(
            id=min(touched, key=lambda name: (name in taken, len(name), name)),
            xy=xy,
            legs=len(legs),
            name=", ".join(sorted({leg.road for leg in legs} - {""}))[:80],
            size=len(legs),
            streets=tuple(leg.road for leg in legs),
            bearings=tuple(leg.bearing for leg in legs),
            origin=held.origin,
            is_roundabout=grounds.ring is not None,
            refusal=refusal and f"{refusal}; {OTHER_SOURCE}",
        )
        found.append((junction, grounds))
    return found


def _list_lights(
    elements: FileElements, lanelets: _Lanelets, origin: LatLon
) -> Iterator[FloatArray]:
    """Where the lanelets end that obey the traffic lights of the file, and their stop lines [m]."""
    lit = {name for name, (tags, _) in elements.rules.items() if tags.get("subtype") in _LIGHTS}
    for tags, members in elements.relations:
        rules = [ref for role, ref in members if role == "regulatory_element" and ref in lit]
        if rules and tags["id"] in lanelets:
            yield lanelets[tags["id"]].middle[-1]
    for name in sorted(lit):
        for role, ref in elements.rules[name][1]:
            points = [elements.nodes[n] for n in elements.ways.get(ref, ()) if n in elements.nodes]
            if role == "ref_line" and points:
                yield np.mean([project_mercator(origin, point) for point in points], axis=0)


@dataclass(frozen=True)
class FileElements:
    """What a file holds.

    Attributes:
        nodes: latitude and longitude; ways: ids of nodes; way_tags: of those that have some.
        relations: (tags, (role, id of a way) of each member) of the lanelets; rules: the same of
            the regulatory elements, by id.
    """

    nodes: dict[str, LatLon] = field(default_factory=dict)
    ways: dict[str, list[str]] = field(default_factory=dict)
    way_tags: dict[str, dict[str, str]] = field(default_factory=dict)
    relations: list[tuple[dict[str, str], list[tuple[str, str]]]] = field(default_factory=list)
    rules: dict[str, tuple[dict[str, str], list[tuple[str, str]]]] = field(default_factory=dict)


def read_elements(file: Path) -> FileElements:
    """Nodes, ways and lanelets of a file that is known to be well-formed."""
    found = FileElements()
    try:
        for _, element in ElementTree.iterparse(file, events=("end",)):
            if element.tag in ("node", "way", "relation"):
                _add_element(found, element, file)
                element.clear()
    except (KeyError, ValueError) as fault:
        raise InputError(f"{file} is no Lanelet2 map: {fault} is missing or wrong") from None
    if not found.nodes or not found.relations:
        raise InputError(f"{file} has no lanelets")
    return found


def _add_element(found: FileElements, element: Any, file: Path) -> None:
    name = element.attrib["id"]
    if element.tag == "node":
        if not element.attrib["lat"].strip():
            raise InputError(
                f"{file} gives its places by local_x and local_y alone; latitudes and longitudes "
                "are needed: save it with a map projection"
            )
        node = float(element.attrib["lat"]), float(element.attrib["lon"])
        if not is_in_degrees(node):
            raise InputError(
                f"{file} has a node at latitude {node[0]:g}, longitude {node[1]:g}: these are no "
                "degrees"
            )
        found.nodes[name] = node
    elif element.tag == "way":
        found.ways[name] = [n.attrib["ref"] for n in element.iter("nd")]
        if tags := {t.attrib["k"]: t.attrib["v"] for t in element.iter("tag")}:
            found.way_tags[name] = tags
    else:
        tags = {t.attrib["k"]: t.attrib["v"] for t in element.iter("tag")}
        members = [(m.get("role", ""), m.get("ref", "")) for m in element.iter("member")]
        if tags.get("type") == "lanelet":
            found.relations.append((tags | {"id": name}, members))
        elif tags.get("type") == "regulatory_element":
            found.rules[name] = tags, members


def build_lanelets(
    elements: FileElements, origin: LatLon, file: Path, notes: list[str]
) -> tuple[dict[str, FileLanelet], list[FileLanelet]]:
    """Lanelets for vehicles by id, and those for pedestrians, in metres from an origin."""
    lanelets: dict[str, FileLanelet] = {}
    foot: list[FileLanelet] = []
    broken = others = 0
    for tags, members in elements.relations:
        try:
            left, right = (
                _read_bound(elements, members, role, origin) for role in ("left", "right")
            )
        except (KeyError, ValueError):
            broken += 1
            continue
        lanelet = FileLanelet(tags["id"], *_orient_bounds(left, right), tags)
        subtype = tags.get("subtype", "road")
        if subtype in _FOR_PEDESTRIANS:
            foot.append(lanelet)
        elif subtype in _NOT_DRIVEN or _is_closed(tags):
            others += 1
        else:
            lanelets[lanelet.id] = lanelet
    if broken:
        notes.append(f"{broken} lanelets without two usable bounds were dropped")
    if others:
        notes.append(
            f"{others} lanelets were dropped: car parks, tracks, and those for buses, bicycles or "
            "others than cars"
        )
    if broken and not lanelets:
        raise InputError(f"{file} has lanelets, but the bounds of all are missing")
    return lanelets, foot


def _is_closed(tags: Mapping[str, str]) -> bool:
    """Whether the file says that cars may not drive on a lanelet."""
    keys = ("participant:vehicle:car", "participant:vehicle")
    return next((tags[key] for key in keys if key in tags), "yes") == "no"


def _read_bound(
    elements: FileElements, members: Sequence[tuple[str, str]], role: str, origin: LatLon
) -> FloatArray:
    """[P, 2] a bound; KeyError or ValueError where it is missing or too short."""
    ways = [elements.ways[ref] for own, ref in members if own == role]
    pieces = [np.array([project_mercator(origin, elements.nodes[n]) for n in way]) for way in ways]
    line = chain_pieces([piece for piece in pieces if len(piece)])
    line = drop_doubled_points(line) if len(line) else line
    if len(line) < 2:
        raise ValueError(role)
    return line


def chain_pieces(pieces: Sequence[FloatArray]) -> FloatArray:
    """[P, 2] one line of the ways of a bound, which may be listed in any order and direction."""
    if not pieces:
        return np.zeros((0, 2))
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


def _survey_junction(
    held: LaneletFile,
    lanelets: _Lanelets,
    grounds: _Grounds | None,
    notes: list[str],
    side: DrivingSide,
) -> Survey:
    """The junction of some lanelets.

    Args:
        grounds: that lanelets share there, and at other junctions; None is one junction of all.
    """
    file, foot, crossings = held.file, held.foot, held.crossings
    follows = _find_successors(lanelets)
    is_roundabout = grounds is not None and grounds.ring is not None
    list_names = _list_shortest_paths if is_roundabout else _list_paths
    paths = [_Path.join(lanelets, names) for names in list_names(lanelets, follows)]
    used = sorted({name for path in paths for name in path.names})
    if grounds is None:
        grounds = _Grounds(_find_shared_ground(lanelets, follows, used), geos.Polygon())
    shared = grounds.shared
    shortest = _SHORTEST_LANE if grounds.others.is_empty else _SHORTEST_LEG
    approaches, exits, found = _split_paths(paths, grounds, shortest, notes)
    if not found:
        raise InputError(
            f"{file} has {len(lanelets)} lanelets for vehicles, but no way leads from outside "
            "through a junction to outside"
        )
    middle = np.round(np.array(shared.envelope.centroid.coords[0]), 3)
    if walks := sum(each.tags.get("subtype") != "crosswalk" for each in foot):
        notes.append(
            f"{walks} footways of the file are shown as they are not; sidewalks are derived along "
            "the kerbs"
        )
    if unused := len(lanelets) - len(used):
        notes.append(f"{unused} lanelets that lead nowhere were dropped")
    if is_roundabout:
        notes.append(ROUNDABOUT)
    names = sorted({_find_street(each.tags) for each in lanelets.values()} - {""})
    return Survey(
        title=(", ".join(names) if 0 < len(names) <= 6 else f"junction of {file.name}")[:80],
        approaches={
            name: _build_lane(name, lanelets, line - middle) for name, line in approaches.items()
        },
        exits={name: _build_lane(name, lanelets, line - middle) for name, line in exits.items()},
        connections=tuple(
            SurveyConnection(a, b, _take_between(line, approaches[a][-1], exits[b][0]) - middle)
            for (a, b), line in found.items()
        ),
        crossings=tuple(each.move(-middle) for each in crossings),
        areas=tuple(lanelets[name].outline - middle for name in used),
        side=side,
        origin=None if held.origin is None else project_to_degrees(held.origin, middle),
        offset=(round(float(middle[0]), 3), round(float(middle[1]), 3)),
        file_origin=held.origin,
        lights=tuple(SurveyLight(each - middle) for each in held.lights),
        is_roundabout=is_roundabout,
        notes=notes,
    )


_Lines = dict[str, FloatArray]


def _split_paths(
    paths: Sequence[_Path], grounds: _Grounds, shortest: float, notes: list[str]
) -> tuple[_Lines, _Lines, dict[tuple[str, str], FloatArray]]:
    """Approaches and exits by name, and whole paths by both names."""
    approaches: _Lines = {}
    exits: _Lines = {}
    found: dict[tuple[str, str], FloatArray] = {}
    cut_off = 0
    for path in paths:
        junction = path.find_junction(grounds.shared, grounds.others)
        if junction is None:
            continue
        begin, end = junction
        if begin < shortest or path.length - end < shortest:
            cut_off += 1
            continue
        before, after = f"{path.name_at(begin)}>", f">{path.name_at(end)}"
        _keep_shorter(approaches, before, path.take_until(begin))
        _keep_shorter(exits, after, path.take_from(end))
        # Of the ways round a ring the shortest one is driven.
        if (before, after) not in found or grounds.ring is None:
            found[before, after] = path.line
        else:
            found[before, after] = min(found[before, after], path.line, key=len)
    if cut_off:
        notes.append(f"{cut_off} ways begin or end inside the junction and were dropped")
    return approaches, exits, found


def _keep_shorter(lines: _Lines, name: str, line: FloatArray) -> None:
    """Of two stretches of one lane, keep that which stays farther from the junction."""
    if name not in lines or measure_length(line) < measure_length(lines[name]):
        lines[name] = line


def _find_successors(lanelets: _Lanelets) -> dict[str, list[str]]:
    """Which lanelets begin where one ends, both bounds within reach."""
    names = sorted(lanelets)
    starts = np.array([[lanelets[n].left[0], lanelets[n].right[0]] for n in names])
    found: dict[str, list[str]] = {}
    for name in names:
        ends = np.array([lanelets[name].left[-1], lanelets[name].right[-1]])
        away = np.hypot(*(starts - ends).transpose(2, 0, 1)).max(axis=1)
        found[name] = [n for n, d in zip(names, away, strict=True) if d < _TOUCHING and n != name]
    return found


def _list_shortest_paths(
    lanelets: _Lanelets, follows: Mapping[str, list[str]]
) -> Iterator[list[str]]:
    """The shortest path from each lanelet without a predecessor to each without a successor."""
    followers = {name for each in follows.values() for name in each}
    length = {name: measure_length(each.middle) for name, each in lanelets.items()}
    for first in sorted(set(lanelets) - followers):
        todo, done = [(length[first], [first])], set[str]()
        while todo:
            so_far, path = heapq.heappop(todo)
            if path[-1] in done:
                continue
            done.add(path[-1])
            if not follows[path[-1]]:
                yield path
            for name in follows[path[-1]]:
                heapq.heappush(todo, (so_far + length[name], [*path, name]))


def _list_paths(lanelets: _Lanelets, follows: Mapping[str, list[str]]) -> Iterator[list[str]]:
    """Every path from a lanelet without a predecessor to one without a successor."""
    followers = {name for each in follows.values() for name in each}
    todo = [[name] for name in sorted(lanelets, reverse=True) if name not in followers]
    while todo:
        path = todo.pop()
        onwards = [name for name in follows[path[-1]] if name not in path]
        if not onwards:
            yield path
        elif len(path) < _MOST_LANELETS:
            todo += [[*path, name] for name in onwards]


_ENDS = 6
"""So many points at either end of a path have no curvature of their own."""
_LEAST_POINTS = 4
"""A path of fewer points has no direction to go on in."""


def _measure_curvature(line: FloatArray) -> FloatArray:
    """[P] curvature of a line with points half a metre apart, over some metres [1/m]."""
    if len(line) <= 2 * _ENDS:
        return np.zeros(len(line))
    step = np.gradient(smooth_gaussian(line, 4.0), axis=0)
    course = np.unwrap(np.arctan2(step[:, 1], step[:, 0]))
    bend = np.abs(np.gradient(course)) / np.maximum(np.hypot(*step.T), 1e-6)
    bend[:_ENDS] = bend[-_ENDS:] = 0.0
    return np.asarray(bend)


def _graft(line: FloatArray, names: Sequence[str], lanelets: _Lanelets) -> FloatArray:
    """A path that ends upon another lanelet goes on along it, and begins along one likewise."""
    if len(line) < _LEAST_POINTS:
        return line
    others = [lanelet for name, lanelet in lanelets.items() if name not in names]
    after = _find_beneath(line[-1], line[-1] - line[-4], others)
    if after is not None:
        line = np.concatenate([line, after[1][after[0] + 8 :]])
    before = _find_beneath(line[0], line[3] - line[0], others)
    if before is not None:
        line = np.concatenate([before[1][: max(before[0] - 8, 0)], line])
    return line


def _find_beneath(
    point: FloatArray, direction: FloatArray, lanelets: Iterable[FileLanelet]
) -> tuple[int, FloatArray] | None:
    """The nearest lanelet that runs the same way beneath a point: where along it, its middle."""
    course = math.atan2(direction[1], direction[0])
    best: tuple[float, int, FloatArray] | None = None
    for lanelet in lanelets:
        apart = np.hypot(*(lanelet.middle - point).T)
        k = int(np.argmin(apart))
        if apart[k] > lanelet.width / 2 or not 4 <= k < len(lanelet.middle) - 4:
            continue
        ahead = lanelet.middle[k + 2] - lanelet.middle[k - 2]
        turn = abs(math.remainder(math.atan2(ahead[1], ahead[0]) - course, math.tau))
        if turn < _GRAFT_TURN and (best is None or apart[k] < best[0]):
            best = (float(apart[k]), k, lanelet.middle)
    return None if best is None else best[1:]


def _find_shared_ground(
    lanelets: _Lanelets, follows: Mapping[str, list[str]], names: Sequence[str]
) -> Any:
    """The ground of lanelets that overlap without following one another: they cross or join."""
    followers = {name for each in follows.values() for name in each}
    shapes = [geos.Polygon(lanelets[n].outline).buffer(0) for n in names]
    tree = geos.STRtree(shapes)
    pieces = []
    for i, name in enumerate(names):
        for j in tree.query(shapes[i]).tolist():
            other = names[j]
            if j <= i or other in follows[name] or name in follows[other]:
                continue
            pair = lanelets[name], lanelets[other]
            starts = name not in followers and other not in followers
            ends = not follows[name] and not follows[other]
            if _are_abreast(*pair) or _split_at_edge(*pair, starts=starts, ends=ends):
                continue
            piece = shapes[i].intersection(shapes[j])
            if piece.area >= _OVERLAP:
                pieces.append(piece)
    return geos.union_all(pieces)


def _split_at_edge(a: FileLanelet, b: FileLanelet, *, starts: bool, ends: bool) -> bool:
    """Whether two lanelets begin together where the map begins, or end together where it ends.

    Args:
        starts: whether the map begins with both; ends: whether it ends with both.
    """
    apart = np.hypot(*(a.middle[[0, -1]] - b.middle[[0, -1]]).T)
    return bool((starts and apart[0] < _SPLIT) or (ends and apart[1] < _SPLIT))


def _are_abreast(a: FileLanelet, b: FileLanelet) -> bool:
    """Whether two lanelets are neighbours in one road all along, drawn a little too wide."""
    few, many = sorted((a.middle, b.middle), key=len)
    away = measure_distances(few[:: max(len(few) // 12, 1)], many).min(axis=1).max()
    ends = np.hypot(*(a.middle[[0, -1]] - b.middle[[0, -1]]).T).max()
    return bool(away < _ABREAST and ends < 3 * _ABREAST)


def _take_between(line: FloatArray, first: FloatArray, last: FloatArray) -> FloatArray:
    """The stretch of a line between the points nearest to two others."""
    a, b = measure_distances(np.array([first, last]), line).argmin(axis=1)
    return line[a : max(b, a + 1) + 1]


def _build_lane(name: str, lanelets: _Lanelets, line: FloatArray) -> SurveyLane:
    own = lanelets[name.strip(">")]
    limit = own.tags.get("speed_limit") or own.tags.get("maxspeed") or ""
    digits = "".join(c for c in limit.split(" ")[0] if c.isdigit() or c == ".")
    speed = float(digits) if digits.strip(".") else _DEFAULT_SPEED
    return SurveyLane(
        id=name,
        line=resample_by_spacing(line, 1.0),
        width=float(np.clip(own.width, 2.4, 6.0)),
        speed=speed / 3.6,
        road=_find_street(own.tags),
    )


def _find_street(tags: Mapping[str, str]) -> str:
    """The street's name; "" for what only names the lanelet, such as N_en_1 or R2In1_to_R1Out1."""
    name = tags.get("road_name") or tags.get("name", "")
    return name if re.search(r"[^\W\d_]{3}", name) and not re.search(r"_|\w\d\b", name) else ""
