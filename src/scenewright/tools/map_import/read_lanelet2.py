"""Reader of Lanelet2 maps (.osm): lanelets between a left and a right bound, in degrees.

Read with the standard parser: the files are plain XML once checked, and maps in the wild lack what
the Lanelet2 library insists on (types, subtypes, consistent bounds).
"""

from __future__ import annotations

import heapq
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import product
from pathlib import Path
from typing import Any, Literal
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
    measure_turn,
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
    describe_survey,
)
from scenewright.tools.map_import.lanelet2_crosswalks import read_lanelet2_crossings
from scenewright.tools.map_import.map_parts import geos
from scenewright.tools.map_import.rings import ROUNDABOUT, Ring, find_roundabouts
from scenewright.tools.map_import.survey import (
    NARROWEST,
    Survey,
    SurveyConnection,
    SurveyCrossing,
    SurveyLane,
    SurveyLight,
    describe_strips,
    keep_near,
)

_TOUCHING = 0.6
"""Ends of lanelets that lie closer are joined [m]; drawn maps share no nodes there."""
_OVERLAP = 2.5
"""Lanelets that share more ground cross or merge [m^2]."""
_DEFAULT_SPEED = 50.0
_MOST_LANELETS, _LEAST_WAYS = 12, 3
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
_BEND_GAP = 20
"""A bend behind so much straight street is none of the junction's [half metres]."""
_SAME_COURSE = math.radians(40.0)
_LONGEST_APPROACH = 120.0
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
        count = max(round(longest / 0.5), 4)
        left, right = (resample_to_count(side, count) for side in (self.left, self.right))
        object.__setattr__(self, "middle", (left + right) / 2)

    @cached_property
    def width(self) -> float:
        """The median over its length [m]."""
        count = len(self.middle)
        left, right = (resample_to_count(side, count) for side in (self.left, self.right))
        return float(np.median(np.hypot(*(left - right).T)))

    @property
    def outline(self) -> FloatArray:
        """[P, 2] round its ground [m]."""
        return np.concatenate([self.left, self.right[::-1]])


_Lanelets = Mapping[str, FileLanelet]


@dataclass(frozen=True, eq=False)
class _Grounds:
    """What lanelets share at a junction, and at the others nearby; ring: of a roundabout."""

    shared: Any
    others: Any
    ring: Ring | None = None

    @cached_property
    def inside(self) -> Any:
        """The ground on which a path is in the junction."""
        area = self.shared.buffer(0.5)
        geos.prepare(area)
        return area


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
    def join(cls, held: LaneletFile, names: Sequence[str]) -> _Path:
        middles = np.concatenate([held.lanelets[name].middle for name in names])
        line = resample_by_spacing(middles, 0.5)
        last = np.array([held.lanelets[name].middle[-1] for name in names])
        return cls(tuple(names), line, 0.5 * measure_distances(last, line).argmin(axis=1))

    @property
    def length(self) -> float:
        return 0.5 * (len(self.line) - 1)

    def find_junction(self, grounds: _Grounds) -> tuple[float, float] | None:
        """Where along it the junction begins and ends [m]; None if it leads through none.

        Bends before and behind the shared ground belong to it, if they lie no nearer to others'.
        """
        inside = np.flatnonzero(geos.contains_xy(grounds.inside, *self.line.T))
        if not len(inside):
            return None
        low, high = max(inside[0] - _BEND_REACH, 0), inside[-1] + _BEND_REACH
        elsewhere = low + np.flatnonzero(geos.contains_xy(grounds.others, *self.line[low:high].T))
        bends = np.flatnonzero(_measure_curvature(self.line[: high + 1]) > 1.0 / _SHARPEST)
        if len(before := elsewhere[elsewhere < inside[0]]):
            low = (before[-1] + inside[0]) // 2
        if len(behind := elsewhere[elsewhere > inside[-1]]):
            high = (behind[0] + inside[-1]) // 2
        bends = bends[(bends > low) & (bends < high)]
        reach = np.union1d(bends, np.arange(inside[0], inside[-1] + 1))
        runs = np.split(reach, np.flatnonzero(np.diff(reach) > _BEND_GAP) + 1)
        own = next(run for run in runs if inside[0] in run)
        return 0.5 * float(own[0]) - _MARGIN, 0.5 * float(own[-1]) + _MARGIN

    def name_at(self, s: float) -> str:
        return self.names[min(int(np.searchsorted(self.ends, s)), len(self.names) - 1)]


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

    @cached_property
    def follows(self) -> Mapping[str, list[str]]:
        """Which lanelets begin where one ends, both bounds within reach.

        Where nothing else follows, or leads there, one bound and the direction will do: the lane
        becomes wider there, or narrower.
        """
        names = sorted(self.lanelets)
        lanes = [self.lanelets[name] for name in names]
        met: list[set[tuple[int, int]]] = []
        for side in ("left", "right"):
            starts, ends = (geos.points([getattr(x, side)[k] for x in lanes]) for k in (0, -1))
            i, j = geos.STRtree(starts).query(ends, "dwithin", _TOUCHING).tolist()
            met.append({(a, b) for a, b in zip(i, j, strict=True) if a != b})
        both = met[0] & met[1]
        ended, begun = {a for a, _ in both}, {b for _, b in both}
        for a, b in sorted(met[0] ^ met[1]):
            before, after = lanes[a].middle, lanes[b].middle
            turn = measure_turn(before[-1] - before[-2], after[1] - after[0])
            if (a not in ended or b not in begun) and abs(turn) < _SAME_COURSE:
                both.add((a, b))
        found: dict[str, list[str]] = {name: [] for name in names}
        for a, b in sorted(both):
            found[names[a]].append(names[b])
        return found

    @cached_property
    def leads_to(self) -> Mapping[str, list[str]]:
        """Which lanelets end where one begins."""
        found: dict[str, list[str]] = {name: [] for name in self.lanelets}
        for name, following in self.follows.items():
            for after in following:
                found[after].append(name)
        return found

    @cached_property
    def _tree(self) -> Any:
        return geos.STRtree([geos.LineString(each.middle) for each in self.lanelets.values()])

    def list_on(self, place: Any) -> list[str]:
        """The lanelets with a middle that meets a geometry."""
        names = list(self.lanelets)
        return sorted(names[i] for i in self._tree.query(place, predicate="intersects"))


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
    if not held.lanelets:
        raise InputError(f"{held.file} has no lanelets for vehicles there")
    lines = [each.middle for each in held.lanelets.values()]
    side = take_option(left_hand) or find_lanelet2_side(lines)
    found = _find_places(held)
    chosen = choose_junction(
        [each for each, _ in found],
        file=held.file,
        center=center,
        junction=junction,
        origin=held.origin,
        streets=streets,
    )
    check_importable(chosen, held.file)
    survey = next(survey for each, survey in found if each is chosen)
    drawn = {
        "roads": [bound for x in held.lanelets.values() for bound in (x.left, x.right)],
        "paths": [bound for x in held.foot for bound in (x.left, x.right)],
        "crossings": [each.line for each in held.crossings],
        "lights": held.lights,
    }
    return replace(
        survey,
        side=side,
        notes=[*held.notes, *survey.notes],
        drawn=keep_near(drawn, np.array(survey.offset)),
    )


_APART = 9.0
"""Shared grounds that lie farther apart belong to different junctions [m]."""


def list_lanelet_junctions(held: LaneletFile) -> JunctionOverview:
    """The junctions of a file of lanelets, and its lanelets."""
    found = tuple(each for each, _ in _find_places(held))
    return JunctionOverview(found, tuple(each.middle for each in held.lanelets.values()))


def _list_grounds(held: LaneletFile) -> Iterator[_Grounds]:
    """What lanelets share at each junction; a ring with what lies on it is one."""
    lines = {name: each.middle for name, each in held.lanelets.items()}
    rings = find_roundabouts(lines, held.follows)
    shared = _find_shared_ground(held)
    grown = shared.buffer(_APART / 2)
    if rings:
        shared = geos.union_all([shared, *(ring.carriageway for ring in rings)])
        grown = geos.union_all([shared.buffer(_APART / 2), *(ring.disc for ring in rings)])
    areas = [each for each in getattr(grown, "geoms", [grown]) if not each.is_empty]
    parts = np.array(getattr(shared, "geoms", [shared]), dtype=object)
    inside, tree = geos.STRtree(parts), geos.STRtree(areas)
    own = [geos.union_all(parts[inside.query(area, "intersects")]) for area in areas]
    for k, area in enumerate(areas):
        near = tree.query(area, predicate="dwithin", distance=_LONGEST_APPROACH).tolist()
        ring = next((ring for ring in rings if ring.disc.intersects(area)), None)
        yield _Grounds(own[k], geos.union_all([own[j] for j in near if j != k]), ring)


def _find_places(held: LaneletFile) -> list[tuple[Junction, Survey]]:
    """Places of three or more legs and ways, each by an id that no other has."""
    found: dict[str, tuple[Junction, Survey]] = {}
    for grounds in _list_grounds(held):
        touched = held.list_on(grounds.shared)
        survey = _survey_junction(held, grounds)
        if not touched or len(survey.connections) < _LEAST_WAYS:
            continue
        name = min(touched, key=lambda name: (name in found, len(name), name))
        refusal = "" if grounds.ring is None else grounds.ring.refusal
        each = describe_survey(survey, id=name, refusal=refusal and f"{refusal}; {OTHER_SOURCE}")
        if each is not None:
            found[name] = each, survey
    return list(found.values())


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
        cars = tags.get("participant:vehicle:car", tags.get("participant:vehicle"))
        if subtype in _FOR_PEDESTRIANS:
            foot.append(lanelet)
        elif subtype in _NOT_DRIVEN or cars == "no":
            others += 1
        else:
            lanelets[lanelet.id] = lanelet
    notes += describe_strips(each.width < NARROWEST for each in lanelets.values())
    lanelets = {name: each for name, each in lanelets.items() if each.width >= NARROWEST}
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


def _survey_junction(held: LaneletFile, grounds: _Grounds) -> Survey:
    """The junction of the lanelets that share some ground."""
    lanelets, shared = held.lanelets, grounds.shared
    notes: list[str] = []
    is_roundabout = grounds.ring is not None
    inside = set(held.list_on(shared.convex_hull.buffer(-0.3)))
    paths = [_Path.join(held, names) for names in _list_paths(held, inside, is_roundabout)]
    used = sorted({name for path in paths for name in path.names})
    shortest = _SHORTEST_LANE if grounds.others.is_empty else _SHORTEST_LEG
    approaches, exits, found, cut_off = _split_paths(paths, grounds, shortest)
    middle = np.round(np.array(shared.envelope.centroid.coords[0]), 3)
    if walks := sum(each.tags.get("subtype") != "crosswalk" for each in held.foot):
        notes.append(
            f"{walks} footways of the file are shown as they are not; sidewalks are derived along "
            "the kerbs"
        )
    if cut_off:
        notes.append(f"{cut_off} ways begin or end inside the junction and were dropped")
    if unused := len(inside.difference(used)):
        notes.append(f"{unused} lanelets that lead nowhere were dropped")
    if is_roundabout:
        notes.append(ROUNDABOUT)
    names = sorted({_find_street(lanelets[name].tags) for name in used} - {""})
    return Survey(
        title=(", ".join(names) if 0 < len(names) <= 6 else f"junction of {held.file.name}")[:80],
        approaches={
            name: _build_lane(name, lanelets, line - middle) for name, line in approaches.items()
        },
        exits={name: _build_lane(name, lanelets, line - middle) for name, line in exits.items()},
        connections=tuple(
            SurveyConnection(a, b, line[first : max(last, first + 1) + 1] - middle)
            for (a, b), line in found.items()
            for first, last in [
                measure_distances(np.array([approaches[a][-1], exits[b][0]]), line).argmin(axis=1)
            ]
        ),
        crossings=tuple(each.move(-middle) for each in held.crossings),
        areas=tuple(lanelets[name].outline - middle for name in used),
        origin=None if held.origin is None else project_to_degrees(held.origin, middle),
        offset=(round(float(middle[0]), 3), round(float(middle[1]), 3)),
        file_origin=held.origin,
        lights=tuple(SurveyLight(each - middle) for each in held.lights),
        is_roundabout=is_roundabout,
        lost=cut_off + unused,
        notes=notes,
    )


_Lines = dict[str, FloatArray]


def _split_paths(
    paths: Sequence[_Path], grounds: _Grounds, shortest: float
) -> tuple[_Lines, _Lines, dict[tuple[str, str], FloatArray], int]:
    """Approaches and exits by name, whole paths by both names, how many begin or end inside."""
    approaches: _Lines = {}
    exits: _Lines = {}
    found: dict[tuple[str, str], FloatArray] = {}
    cut_off = 0
    for path in paths:
        junction = path.find_junction(grounds)
        if junction is None:
            continue
        begin, end = junction
        if begin < shortest or path.length - end < shortest:
            cut_off += 1
            continue
        before, after = f"{path.name_at(begin)}>", f">{path.name_at(end)}"
        # Of two stretches of one lane, that which stays farther from the junction is kept.
        for lines, name, line in (
            (approaches, before, path.line[: max(round(begin / 0.5), 1) + 1]),
            (exits, after, path.line[min(round(end / 0.5), len(path.line) - 2) :]),
        ):
            if name not in lines or measure_length(line) < measure_length(lines[name]):
                lines[name] = line
        # Of the ways round a ring the shortest one is driven.
        if (before, after) not in found or grounds.ring is None:
            found[before, after] = path.line
        else:
            found[before, after] = min(found[before, after], path.line, key=len)
    return approaches, exits, found, cut_off


def _list_paths(held: LaneletFile, inside: set[str], is_ring: bool) -> Iterator[list[str]]:
    """Every path through the lanelets inside a junction, with what lies before and behind it.

    Round a ring only the shortest one from each lanelet before it to each behind it.
    """
    length = {name: measure_length(held.lanelets[name].middle) for name in inside}
    for first in sorted(inside):
        before = [name for name in held.leads_to[first] if name not in inside]
        if not before and held.leads_to[first]:
            continue
        starts = [_go_straight(name, held, held.leads_to, -1) for name in before] or [[]]
        todo, done = [(0.0, [first])], set[str]()
        while todo:
            so_far, path = heapq.heappop(todo)
            if is_ring and path[-1] in done:
                continue
            done.add(path[-1])
            onwards = [name for name in held.follows[path[-1]] if name not in path]
            behind = [name for name in onwards if name not in inside]
            ends = [_go_straight(name, held, held.follows, 1) for name in behind]
            for start, end in product(starts, ends if onwards else [[]]):
                yield [*start, *path, *end]
            if len(path) < _MOST_LANELETS:
                for name in set(onwards).difference(behind):
                    heapq.heappush(todo, (so_far + length[name], [*path, name]))


def _go_straight(
    name: str, held: LaneletFile, onwards: Mapping[str, Sequence[str]], step: Literal[1, -1]
) -> list[str]:
    """A lanelet and those behind it (step -1: before it), of several the straightest one."""
    names, reach = [name], 0.0
    while True:
        here = held.lanelets[names[-1]].middle[::step]
        reach += measure_length(here)
        turns = []
        for each in onwards[names[-1]]:
            line = held.lanelets[each].middle[::step]
            turn = measure_turn(here[-1] - here[-2], line[: _AHEAD + 1][-1] - line[0])
            turns.append((abs(turn), each))
        if not turns or reach > _LONGEST_APPROACH or min(turns)[1] in names:
            return names[::step]
        names.append(min(turns)[1])


_AHEAD = 30
"""Lanelets part within so far, in points about half a metre apart."""
_ENDS = 6
"""So many points at either end of a path have no curvature of their own."""


def _measure_curvature(line: FloatArray) -> FloatArray:
    """[P] curvature of a line with points half a metre apart, over some metres [1/m]."""
    if len(line) <= 2 * _ENDS:
        return np.zeros(len(line))
    step = np.gradient(smooth_gaussian(line, 4.0), axis=0)
    course = np.unwrap(np.arctan2(step[:, 1], step[:, 0]))
    bend = np.abs(np.gradient(course)) / np.maximum(np.hypot(*step.T), 1e-6)
    bend[:_ENDS] = bend[-_ENDS:] = 0.0
    return np.asarray(bend)


def _find_shared_ground(held: LaneletFile) -> Any:
    """The ground of lanelets that overlap without following one another: they cross or join."""
    lanelets, follows, names = held.lanelets, held.follows, sorted(held.lanelets)
    followers = {name for each in follows.values() for name in each}
    shapes = np.array([geos.Polygon(lanelets[n].outline).buffer(0) for n in names], dtype=object)
    kept = []
    for i, j in geos.STRtree(shapes).query(shapes).T:
        name, other = names[i], names[j]
        if i >= j or other in follows[name] or name in follows[other]:
            continue
        piece = shapes[i].intersection(shapes[j])
        if piece.area < _OVERLAP:
            continue
        pair = lanelets[name], lanelets[other]
        # Where the map begins with both or ends with both, two that lie close split there.
        apart = np.hypot(*(pair[0].middle[[0, -1]] - pair[1].middle[[0, -1]]).T)
        begin = apart[0] < _SPLIT and name not in followers and other not in followers
        end = apart[1] < _SPLIT and not follows[name] and not follows[other]
        # Neighbours in one road all along may be drawn a little too wide.
        few, many = sorted((each.middle for each in pair), key=len)
        away = measure_distances(few[:: max(len(few) // 12, 1)], many).min(axis=1).max()
        if not begin and not end and not (away < _ABREAST and apart.max() < 3 * _ABREAST):
            kept.append(piece)
    return geos.union_all(kept)


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
