"""Which turns an OpenStreetMap file allows, and from which lanes, on the streets of netconvert.

netconvert guesses the ways through a junction. It loses some: where the short streets inside one
have lanes for other turns only, and where the marks of lanes leave a turn unsaid.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
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
        ways: list[SurveyConnection],
        reached: Mapping[str, FloatArray],
    ) -> tuple[list[SurveyConnection], list[str]]:
        """The ways from an edge that the file allows, from the lanes that it marks for them.

        Also what the marks contradict, and what they leave out.

        Args:
            lanes: by id, of the edge and of the roads out.
            ways: of the network; reached: by lane out, a way to it that the file allows [P, 2].
        """
        name, tags = self.find_way(edge, edge.getToNode().getID())
        key = "turn:lanes:backward" if edge.getID().startswith("-") else "turn:lanes:forward"
        text = tags.get(key) or (tags.get("turn:lanes") if is_one_way(tags) else None)
        marks = [frozenset(x.split(";")) - {"", "none"} for x in text.split("|")] if text else []
        sides = self._sort_lanes(edge)
        told = [f"are not followed: {len(sides)} lanes are there"] * (len(marks) != len(sides))
        marks = [frozenset()] * len(sides) if told else marks
        marked = [(lanes[x], own) for x, own in zip(sides, marks, strict=True) if x in lanes]
        streets = []
        for onto in (each for each in roads_out if not turns_back(edge, each)):
            out = [lanes[name] for name in self._sort_lanes(onto) if name in lanes]
            ids = {lane.id for lane in out}
            met = [way for way in ways if way.exit in ids]
            if met or ids & reached.keys():
                streets.append((_measure_turn(marked[-1][0].line, out[0].line), out, met))
        said = {way.exit for _, _, met in streets for way in met}
        is_guessed_whole = not any(marks) and all(met for _, _, met in streets)
        found = [way for way in ways if is_guessed_whole or way.exit not in said]
        named = {"reverse", "merge_to_left", "merge_to_right"}
        for turn, out, met in () if is_guessed_whole else streets:
            names = _name_turn(turn, is_straightest=abs(turn) == min(abs(x[0]) for x in streets))
            named |= names
            fit = [lane for lane, own in marked if own & names]
            unsaid = [lane for lane, own in marked if not own]
            if not (fit or unsaid):
                lost = "" if met else ": no way leads there"
                told.append(f"name no lane for the way to {out[0].road or 'a street'}{lost}")
            if not (fit or met):
                fit = unsaid[:1] if turn > 0 else unsaid[-1:]
            found += [way for way in met if not fit or way.approach in {x.id for x in unsaid}]
            # Who turns left from the lanes on the left begins with them, others on the right.
            shift = 0 if turn > _STRAIGHT else len(out) - len(fit)
            for k, lane in enumerate(fit):
                target = out[min(max(k + shift, 0), len(out) - 1)]
                known = [way for way in met if way.approach == lane.id]
                found += known or [_draw_way(lane, target, met, reached.get(target.id))]
        told += [f"name {x}, where no street leads" for x in sorted(set().union(*marks) - named)]
        left = {lane.id for lane, _ in marked} - {way.approach for way in found}
        found += [way for way in ways if way.approach in left]
        return found, [f"turn:lanes of way {name} ({text}) {why}" for why in told if text]

    def _sort_lanes(self, edge: Any) -> list[str]:
        """The lanes of an edge from left to right."""
        step = 1 if self.left_hand else -1
        return [lane.getID() for lane in edge.getLanes()[::step]]


def turns_back(edge: Any, onto: Any) -> bool:
    """Whether one who drives from one edge on to another turns back, as into the same street."""
    turn = _measure_turn(*(np.array(each.getShape())[:, :2] for each in (edge, onto)))
    return abs(turn) > (_BACK_SAME if edge.getName() == onto.getName() else _BACK)


def _measure_turn(before: FloatArray, after: FloatArray) -> float:
    """How far one turns from the end of a line to the beginning of another [rad]."""
    ahead = before[-1] - find_point(before[::-1], _AHEAD)
    return measure_turn(ahead, find_point(after, _AHEAD) - after[0])


def _draw_way(
    lane: SurveyLane,
    exit_: SurveyLane,
    beside: Sequence[SurveyConnection],
    streets: FloatArray | None,
) -> SurveyConnection:
    """A way between two lanes that the network lacks, unless streets inside lead far beside it.

    Args:
        beside: ways to the same street; streets: [P, 2] the way along them.
    """
    a, b = lane.line, exit_.line
    line = draw_curve(a[-1], a[-1] - find_point(a[::-1], 2.0), b[0], find_point(b, 2.0) - b[0])
    if streets is not None:
        away = measure_distances(line, resample_by_spacing(streets, 1.0)).min(axis=1)
        line = streets if away.max() > _STRAYS else line
    light = beside[0].light if beside else None
    return SurveyConnection(lane.id, exit_.id, line, light, is_added=True)


def _name_turn(turn: float, *, is_straightest: bool) -> set[str]:
    """The marks of lanes that lead where one turns so far [rad]."""
    marks = {"through"} if abs(turn) < (_STRAIGHTEST if is_straightest else _STRAIGHT) else set()
    side = "left" if turn > 0 else "right"
    marks |= {f"slight_{side}"} if abs(turn) > _SLIGHT else set()
    return marks | ({side, f"sharp_{side}"} if abs(turn) > _STRAIGHT else set())
