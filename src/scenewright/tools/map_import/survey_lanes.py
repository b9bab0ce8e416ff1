"""Junctions of lane graphs: where lanes share ground, and the paths through it."""

from __future__ import annotations

import heapq
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from typing import Any, Literal

import numpy as np

from scenewright.errors import InputError
from scenewright.geometry.geographic import project_to_degrees
from scenewright.geometry.polyline import (
    measure_distances,
    measure_length,
    measure_turn,
    resample_by_spacing,
    smooth_gaussian,
)
from scenewright.scene.base import FloatArray
from scenewright.tools.map_import.driving_side import find_lane_side
from scenewright.tools.map_import.junction_choice import (
    Junction,
    JunctionOverview,
    describe_survey,
)
from scenewright.tools.map_import.lane_graph import FileLane, LaneGraph
from scenewright.tools.map_import.map_parts import geos
from scenewright.tools.map_import.rings import ROUNDABOUT, Ring, find_roundabouts
from scenewright.tools.map_import.survey import (
    DrivingSide,
    Survey,
    SurveyConnection,
    SurveyLane,
    SurveyLight,
    keep_near,
)

_OVERLAP = 2.5
"""Lanes that share more ground cross or merge [m^2]."""
_MOST_LANES, _LEAST_WAYS = 12, 3
_SHORTEST_LANE = 2.0
"""A path that is outside the junction for less [m] at either end is cut off."""
_SHORTEST_LEG = 6.0
"""The same in a file of several junctions, of which some lie at the file's edge [m]."""
_MARGIN = 0.5
_APART = 9.0
"""Shared grounds that lie farther apart belong to different junctions [m]."""
_ABREAST = 5.0
"""Lanes that stay closer [m] all along lie side by side."""
_SPLIT = 4.0
"""Lanes at the edge of the map that begin closer to one another [m] split there."""
_SHARPEST = 35.0
"""Radius of a curve that belongs to a turn, not to a leg [m]."""
_BEND_REACH = 100
"""Bends farther from the shared ground belong to another junction [half metres]."""
_BEND_GAP = 20
"""A bend behind so much straight street is none of the junction's [half metres]."""
_LONGEST_APPROACH = 120.0
_WIDTHS = (2.4, 6.0)
"""Of lanes on the map [m]."""


@dataclass(frozen=True, eq=False)
class _Grounds:
    """What lanes share at a junction, and at the others nearby; ring: of a roundabout."""

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
    """A path through the whole map along lanes, and their joined middle.

    Attributes:
        line: [P, 2] every half metre; ends: [n] where each lane ends along it [m].
    """

    names: tuple[str, ...]
    line: FloatArray
    ends: FloatArray

    @classmethod
    def join(cls, held: LaneGraph, names: Sequence[str]) -> _Path:
        middles = np.concatenate([held.lanes[name].line for name in names])
        line = resample_by_spacing(middles, 0.5)
        last = np.array([held.lanes[name].line[-1] for name in names])
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


def read_lanes(held: LaneGraph, side: DrivingSide | None) -> JunctionOverview:
    """The junctions of a file that draws each lane by itself.

    Raises:
        InputError: it has no lanes for vehicles.
    """
    if not held.lanes:
        raise InputError(f"{held.file} has no lanes for vehicles")
    lines = [lane.line for lane in held.lanes.values()]
    surveys = _survey_places(held)

    def survey(chosen: Junction) -> Survey:
        drawn = {
            "roads": [bound for x in held.lanes.values() for bound in (x.left, x.right)],
            "paths": [bound for x in held.foot for bound in (x.left, x.right)],
            "crossings": [crossing.line for crossing in held.crossings],
            "lights": held.lights,
        }
        found = surveys[chosen]
        return replace(
            found,
            side=side or find_lane_side(lines),
            notes=[*held.notes, *found.notes],
            drawn=keep_near(drawn, np.array(found.offset)),
        )

    return JunctionOverview(tuple(surveys), tuple(lines), survey)


def _list_grounds(held: LaneGraph) -> Iterator[_Grounds]:
    """What lanes share at each junction; a ring with what lies on it is one."""
    lines = {name: each.line for name, each in held.lanes.items()}
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


def _survey_places(held: LaneGraph) -> dict[Junction, Survey]:
    """Places of three or more legs and ways, each by an id that no other has."""
    found: dict[Junction, Survey] = {}
    names = set[str]()
    for grounds in _list_grounds(held):
        touched = held.list_on(grounds.shared)
        survey = _survey_junction(held, grounds)
        if not touched or len(survey.connections) < _LEAST_WAYS:
            continue
        name = min(touched, key=lambda name: (name in names, len(name), name))
        refusal = "" if grounds.ring is None else grounds.ring.refusal
        if (junction := describe_survey(survey, id=name, refusal=refusal)) is not None:
            names.add(name)
            found[junction] = survey
    return found


def _survey_junction(held: LaneGraph, grounds: _Grounds) -> Survey:
    """The junction of the lanes that share some ground."""
    lanes, shared = held.lanes, grounds.shared
    notes: list[str] = []
    is_roundabout = grounds.ring is not None
    inside = set(held.list_on(shared.convex_hull.buffer(-0.3)))
    paths = [_Path.join(held, names) for names in _list_paths(held, inside, is_roundabout)]
    used = sorted({name for path in paths for name in path.names})
    shortest = _SHORTEST_LANE if grounds.others.is_empty else _SHORTEST_LEG
    approaches, exits, found, cut_off = _split_paths(paths, grounds, shortest)
    middle = np.round(np.array(shared.envelope.centroid.coords[0]), 3)
    if cut_off:
        notes.append(f"{cut_off} ways begin or end inside the junction and were dropped")
    if unused := len(inside.difference(used)):
        notes.append(f"{unused} lanes that lead nowhere were dropped")
    if is_roundabout:
        notes.append(ROUNDABOUT)
    names = sorted({lanes[name].road for name in used} - {""})
    return Survey(
        title=(", ".join(names) if 0 < len(names) <= 6 else f"junction of {held.file.name}")[:80],
        approaches={
            name: _cut_lane(name, lanes, line - middle) for name, line in approaches.items()
        },
        exits={name: _cut_lane(name, lanes, line - middle) for name, line in exits.items()},
        connections=tuple(
            SurveyConnection(a, b, line[first : max(last, first + 1) + 1] - middle)
            for (a, b), line in found.items()
            for first, last in [
                measure_distances(np.array([approaches[a][-1], exits[b][0]]), line).argmin(axis=1)
            ]
        ),
        crossings=tuple(crossing.move(-middle) for crossing in held.crossings),
        areas=tuple(lanes[name].outline - middle for name in used),
        origin=None if held.origin is None else project_to_degrees(held.origin, middle),
        offset=(round(float(middle[0]), 3), round(float(middle[1]), 3)),
        file_origin=held.origin,
        lights=tuple(SurveyLight(light - middle) for light in held.lights),
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


def _list_paths(held: LaneGraph, inside: set[str], is_ring: bool) -> Iterator[list[str]]:
    """Every path through the lanes inside a junction, with what lies before and behind it.

    Round a ring only the shortest one from each lane before it to each behind it.
    """
    length = {name: measure_length(held.lanes[name].line) for name in inside}
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
            if len(path) < _MOST_LANES:
                for name in set(onwards).difference(behind):
                    heapq.heappush(todo, (so_far + length[name], [*path, name]))


def _go_straight(
    name: str, held: LaneGraph, onwards: Mapping[str, Sequence[str]], step: Literal[1, -1]
) -> list[str]:
    """A lane and those behind it (step -1: before it), of several the straightest one."""
    names, reach = [name], 0.0
    while True:
        here = held.lanes[names[-1]].line[::step]
        reach += measure_length(here)
        turns = []
        for onward in onwards[names[-1]]:
            line = held.lanes[onward].line[::step]
            turn = measure_turn(here[-1] - here[-2], line[: _AHEAD + 1][-1] - line[0])
            turns.append((abs(turn), onward))
        if not turns or reach > _LONGEST_APPROACH or min(turns)[1] in names:
            return names[::step]
        names.append(min(turns)[1])


_AHEAD = 30
"""Lanes part within so far, in points about half a metre apart."""
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


def _find_shared_ground(held: LaneGraph) -> Any:
    """The ground of lanes that overlap without following one another: they cross or join."""
    lanes, follows, names = held.lanes, held.follows, sorted(held.lanes)
    followers = {name for each in follows.values() for name in each}
    shapes = np.array([geos.Polygon(lanes[n].outline).buffer(0) for n in names], dtype=object)
    kept = []
    for i, j in geos.STRtree(shapes).query(shapes).T:
        name, other = names[i], names[j]
        if i >= j or other in follows[name] or name in follows[other]:
            continue
        piece = shapes[i].intersection(shapes[j])
        if piece.area < _OVERLAP:
            continue
        pair = lanes[name], lanes[other]
        # Where the map begins with both or ends with both, two that lie close split there.
        apart = np.hypot(*(pair[0].line[[0, -1]] - pair[1].line[[0, -1]]).T)
        begin = apart[0] < _SPLIT and name not in followers and other not in followers
        end = apart[1] < _SPLIT and not follows[name] and not follows[other]
        # Neighbours in one road all along may be drawn a little too wide.
        few, many = sorted((each.line for each in pair), key=len)
        away = measure_distances(few[:: max(len(few) // 12, 1)], many).min(axis=1).max()
        if not begin and not end and not (away < _ABREAST and apart.max() < 3 * _ABREAST):
            kept.append(piece)
    return geos.union_all(kept)


def _cut_lane(name: str, lanes: Mapping[str, FileLane], line: FloatArray) -> SurveyLane:
    """The stretch of a lane outside a junction."""
    own = lanes[name.strip(">")]
    width = float(np.clip(own.width, *_WIDTHS))
    return SurveyLane(name, resample_by_spacing(line, 1.0), width, own.speed, own.road)
