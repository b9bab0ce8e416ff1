"""Which turns an OpenStreetMap file allows, and from which lanes, on the streets of netconvert.

netconvert guesses the ways through a junction. It loses some: where the short streets inside one
have lanes for other turns only, and where the marks of lanes leave a turn unsaid.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from scenewright.geometry.polyline import (
    find_point,
    measure_distances,
    measure_turn,
    resample_by_spacing,
)
from scenewright.scene.base import FloatArray
from scenewright.tools.map_import.curves import draw_curve
from scenewright.tools.map_import.osm_file import OsmFile, Tags, is_one_way
from scenewright.tools.map_import.survey import SurveyConnection, SurveyLane

Marks = list[frozenset[str]]
"""Of the lanes of a street, from left to right: the turns that each is for; empty: unsaid."""
_STRAIGHTEST, _STRAIGHT, _SLIGHT = (math.radians(each) for each in (60.0, 20.0, 5.0))
"""The straightest way goes through if it turns less than the first, others less than the second;
one that turns more than the second is a turn as well, and more than the third a slight one."""
_BACK, _BACK_SAME = math.radians(160.0), math.radians(120.0)
"""So far a way turns back, and one into the same street."""
_STRAYS = 8.0
"""So far from the streets inside a junction a way may be drawn [m]."""
_AHEAD = 12.0
"""Over so much of a street its direction is measured [m]."""


@dataclass(frozen=True, eq=False)
class OsmTurns:
    """The file's word on turns; its streets are edges of the network that was made of it."""

    osm: OsmFile
    left_hand: bool

    def find_way(self, edge: Any, node: str) -> tuple[str, Tags]:
        """Id and tags of the way of the file that an edge is at one of its nodes."""
        first = edge.getID().lstrip("-").split("#")[0]
        names = edge.getLanes()[0].getParam("origId", first).split()
        held = [(name, *self.osm.ways[name]) for name in names if name in self.osm.ways]
        return next(((name, tags) for name, tags, nodes in held if node in nodes), (names[0], {}))

    def allows(self, edge: Any, onto: Any) -> bool:
        """Whether one may drive from an edge on to one that begins where it ends."""
        node = edge.getToNode().getID()
        (first, _), (second, _) = self.find_way(edge, node), self.find_way(onto, node)
        return not any(
            (second in rule.to) == rule.kind.startswith("no_")
            for rule in self.osm.restrictions
            if node in rule.via and first in rule.from_
        ) and not turns_back(edge, onto)

    def complete_ways(
        self,
        edge: Any,
        roads_out: Sequence[Any],
        lanes: Mapping[str, SurveyLane],
        ways: Sequence[SurveyConnection],
        reached: Mapping[str, FloatArray],
    ) -> tuple[Sequence[SurveyConnection], list[str]]:
        """The ways from an edge that the file allows, from the lanes that it marks for them.

        Also what speaks against the marks, and what they leave out.

        Args:
            lanes: by id, of the edge and of the roads out.
            ways: of the network; reached: by lane out, a way to it that the file allows [P, 2].
        """
        text, marks = self._read_marks(edge)
        sides = self._sort_lanes(edge)
        own = [lanes[name] for name in sides if name in lanes]
        faults = []
        if len(marks) == len(sides):
            marks = [each for name, each in zip(sides, marks, strict=True) if name in lanes]
        else:
            faults += [f"are not followed: {len(sides)} lanes are there"] if marks else []
            marks = [frozenset[str]() for _ in own]
        met = {way.exit for way in ways}
        exits = []
        for onto in (each for each in roads_out if not turns_back(edge, each)):
            out = [lanes[name] for name in self._sort_lanes(onto) if name in lanes]
            ids = {lane.id for lane in out}
            if not ids & met and ids & reached.keys():
                way = _draw_allowed(own, marks, out, reached)
                if way is None:
                    faults.append(
                        f"name no lane for {out[0].road or onto.getID()}: no way leads there"
                    )
                    continue
                ways = [*ways, way]
            exits.append(out)
        if any(marks):
            ways, more = follow_marks(own, marks, exits, ways)
            faults += more
        return ways, [f"{text} {fault}" for fault in faults]

    def _sort_lanes(self, edge: Any) -> list[str]:
        """The lanes of an edge from left to right."""
        step = 1 if self.left_hand else -1
        return [lane.getID() for lane in edge.getLanes()[::step]]

    def _read_marks(self, edge: Any) -> tuple[str, Marks]:
        """What the file says of the turns from the lanes of an edge, and that for each lane."""
        name, tags = self.find_way(edge, edge.getToNode().getID())
        key = "turn:lanes:backward" if edge.getID().startswith("-") else "turn:lanes:forward"
        text = tags.get(key) or (tags.get("turn:lanes") if is_one_way(tags) else None)
        lanes = text.split("|") if text else []
        marks = [frozenset(each.split(";")) - {"", "none"} for each in lanes]
        return f"turn:lanes of way {name} ({text})", marks


def turns_back(edge: Any, onto: Any) -> bool:
    """Whether one who drives from one edge on to another turns back, as into the same street."""
    turn = _measure_turn(*(np.array(each.getShape())[:, :2] for each in (edge, onto)))
    return abs(turn) > (_BACK_SAME if edge.getName() == onto.getName() else _BACK)


def _measure_turn(before: FloatArray, after: FloatArray) -> float:
    """How far one turns from the end of a line to the beginning of another [rad]."""
    ahead = before[-1] - find_point(before[::-1], _AHEAD)
    return measure_turn(ahead, find_point(after, _AHEAD) - after[0])


def _draw_way(
    approach: SurveyLane, exit_: SurveyLane, light: str | None = None
) -> SurveyConnection:
    """A way from one lane to another that the network lacks."""
    a, b = approach.line, exit_.line
    line = draw_curve(a[-1], a[-1] - find_point(a[::-1], 2.0), b[0], find_point(b, 2.0) - b[0])
    return SurveyConnection(approach.id, exit_.id, line, light, is_added=True)


def _draw_allowed(
    lanes: Sequence[SurveyLane],
    marks: Marks,
    exits: Sequence[SurveyLane],
    reached: Mapping[str, FloatArray],
) -> SurveyConnection | None:
    """A way from the outermost lane that may lead to a street; None if none may.

    It is drawn anew, unless the streets inside the junction lead elsewhere.
    """
    turn = _measure_turn(lanes[-1].line, exits[0].line)
    names = _name_turn(turn, is_straightest=True)
    fit = [lane for lane, each in zip(lanes, marks, strict=True) if not each or each & names]
    side = 0 if turn > 0 else -1
    if not fit:
        return None
    way = _draw_way(fit[side], exits[side])
    streets = next(reached[lane.id] for lane in exits if lane.id in reached)
    strays = measure_distances(way.line, resample_by_spacing(streets, 1.0)).min(axis=1).max()
    return replace(way, line=streets) if strays > _STRAYS else way


def follow_marks(
    lanes: Sequence[SurveyLane],
    marks: Marks,
    exits: Sequence[Sequence[SurveyLane]],
    ways: Sequence[SurveyConnection],
) -> tuple[list[SurveyConnection], list[str]]:
    """The ways from the lanes of one street as these are marked, and what the marks contradict.

    Args:
        lanes: from left to right, as the marks; exits: those of every street out, likewise.
        ways: from the lanes.
    """
    streets = [(own, [way for way in ways if way.exit in {x.id for x in own}]) for own in exits]
    streets = [(own, met) for own, met in streets if met]
    turns = [_measure_turn(lanes[-1].line, own[0].line) for own, _ in streets]
    known = {lane.id for own in exits for lane in own}
    back = [way for way in ways if way.exit not in known]
    found: list[SurveyConnection] = []
    faults, named = [], set[str]()
    unsaid = {lane.id for lane, each in zip(lanes, marks, strict=True) if not each}
    for (own, met), turn in zip(streets, turns, strict=True):
        names = _name_turn(turn, is_straightest=abs(turn) == min(map(abs, turns)))
        named |= names
        fit = [lane for lane, each in zip(lanes, marks, strict=True) if each & names]
        if fit:
            found += [way for way in met if way.approach in unsaid]
            found += _spread(fit, own, met, from_left=turn > _STRAIGHT)
        else:
            found += met
            if not unsaid:
                faults.append(f"name no lane for the way to {own[0].road or 'a street'}")
    said = frozenset().union(*marks) - {"reverse", "merge_to_left", "merge_to_right"}
    faults += [f"name {mark}, where no street leads" for mark in sorted(said - named)]
    left = {lane.id for lane in lanes} - {way.approach for way in found}
    return [*back, *found, *(x for x in ways if x.approach in left and x not in back)], faults


def _name_turn(turn: float, *, is_straightest: bool) -> set[str]:
    """The marks of lanes that lead where one turns so far [rad]."""
    marks = {"through"} if abs(turn) < (_STRAIGHTEST if is_straightest else _STRAIGHT) else set()
    side = "left" if turn > 0 else "right"
    marks |= {f"slight_{side}"} if abs(turn) > _SLIGHT else set()
    return marks | ({side, f"sharp_{side}"} if abs(turn) > _STRAIGHT else set())


def _spread(
    lanes: Sequence[SurveyLane],
    exits: Sequence[SurveyLane],
    ways: Sequence[SurveyConnection],
    *,
    from_left: bool,
) -> Iterator[SurveyConnection]:
    """The ways from some lanes to those of one street: the given ones, else a new one for each.

    Args:
        from_left: whether the lanes on the left lead to one another, else those on the right.
    """
    shift = 0 if from_left else len(exits) - len(lanes)
    for k, lane in enumerate(lanes):
        target = exits[min(max(k + shift, 0), len(exits) - 1)]
        known = [way for way in ways if way.approach == lane.id]
        yield from known or [_draw_way(lane, target, ways[0].light)]
