"""What a proven scene holds, as the tests of the account ask for it."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from scenewright.scene.base import FloatArray
from scenewright.scene.events import Event, Proof
from scenewright.scene.map import IntersectionMap
from scenewright.scene.measures import UNITS
from scenewright.scene.objects import ObjectRecord
from scenewright.scene.record import AgentRecord, SceneRecord
from scenewright.scene.social import get_figure
from scenewright.scene.track import EMERGENCY
from scenewright.tools.relation_checker.clock import parse_clock

_STANDING = 0.4
"""Speed below which an agent stands [m/s]."""
_BESIDE, _ALIKE, _CLEAR = 5.0, 0.8, 1.0
"""Who overtakes is no farther aside [m], heads alike (cosine) and gets clear of the other [m]."""
_STEP = 0.02
"""Shorter steps than this have no direction [m]."""


@dataclass(frozen=True, eq=False)
class SceneFacts:
    """A scene, what the checker found in it, and its map, if there is one."""

    scene: SceneRecord
    proof: Proof
    intersection_map: IntersectionMap | None

    @cached_property
    def agents(self) -> dict[int, AgentRecord]:
        """All agents by number."""
        return {agent.id: agent for agent in self.scene.agents}

    @cached_property
    def foreground(self) -> tuple[int, ...]:
        """Agents that the request is about; of a group its first member."""
        bound = {n for each in self.scene.relations for n in (each.from_, each.to)}
        bound |= {encounter.agent for encounter in self.scene.encounters}
        bound |= {n for each in self.scene.sights for n in (each.observer, each.subject)}
        return tuple(
            agent.id
            for agent in self.scene.agents
            if (agent.role == "foreground" or agent.id in bound)
            and (agent.group is None or agent.group == agent.id)
        )

    @cached_property
    def events(self) -> tuple[Event, ...]:
        """What the checker found, between foreground agents first."""
        return (*self.proof.events, *self.proof.incidental)

    def count_members(self, number: int) -> int:
        """How many walk in the group of an agent; 1 where it has none."""
        return 1 + sum(agent.group == number and agent.id != number for agent in self.scene.agents)

    def fits_class(self, number: int, classes: frozenset[str]) -> bool:
        """Whether a noun of these classes may stand for an agent."""
        return fits_noun(self.agents[number], classes)

    def list_between(self, first: int, second: int, kinds: Sequence[str]) -> Iterator[Event]:
        """Events of these types of two agents, whichever is first; groups count as one."""
        for event in self.events:
            pair = {self._get_leader(event.from_), self._get_leader(event.to)}
            if event.type in kinds and pair == {first, second}:
                yield event

    def has_role(self, event: Event, first: int) -> bool:
        """Whether an agent, or its group, is `from` in an event."""
        return self._get_leader(event.from_) == first

    def _get_leader(self, number: int) -> int:
        return self.agents[number].group or number

    def find_order(self, first: int, second: int) -> bool | None:
        """Whether one passes before the other in what the two do; None where nothing says."""
        for relation in self.scene.relations:
            if {relation.from_, relation.to} == {first, second} and relation.first is not None:
                return relation.first == first
        for row in self.proof.figures.get("passing_orders", ()):
            if {row["first"], row["second"]} == {first, second}:
                return bool(row["first"] == first)
        for event in self.list_between(first, second, ("yielding", "follow")):
            return not self.has_role(event, first)
        return None

    def compute_speed(self, number: int) -> FloatArray:
        """Speed of an agent at each sample [m/s]."""
        xy = np.array(self.agents[number].trajectory)
        if len(xy) < 3:
            return np.zeros(len(xy))
        east, north = np.gradient(xy, self.scene.meta.step, axis=0).T
        speed: FloatArray = np.hypot(east, north)
        return speed

    def stands(self, number: int) -> float:
        """How long an agent stands [s]."""
        return sum(self.list_standstills(number))

    def list_standstills(self, number: int) -> list[float]:
        """How long each standstill of an agent lasts [s], in order."""
        slow = np.concatenate(([False], self.compute_speed(number) < _STANDING, [False]))
        edges = np.flatnonzero(slow[1:] != slow[:-1])
        return [float(each) for each in np.diff(edges)[::2] * self.scene.meta.step]

    def waits_at_red(self, number: int) -> bool:
        """Whether an agent stands before the junction while its stop line or crosswalk is red."""
        agent, step = self.agents[number], self.scene.meta.step
        walks = agent.type == "pedestrian"
        own = f"{agent.crosswalk}:crosswalk" if walks else f"{agent.entry}:stop"
        red = [
            (signal.start, signal.end)
            for signal in self.scene.signals
            if signal.colour == "red" and own in (signal.crosswalk, signal.stop_line)
        ]
        return any(
            start <= agent.spawn_time + k * step < end
            and (walks or self._is_before_line(agent.trajectory[k], own))
            for k in np.flatnonzero(self.compute_speed(number) < _STANDING)
            for start, end in red
        )

    def _is_before_line(self, point: tuple[float, float], stop_line: str) -> bool:
        """Whether a place is farther out of the junction than a stop line."""
        lines = self.intersection_map.stop_lines if self.intersection_map else ()
        legs = self.intersection_map.legs if self.intersection_map else ()
        for line in (each for each in lines if each.id == stop_line):
            bearing = next(leg.bearing for leg in legs if leg.name == line.leg)
            (ax, ay), (bx, by) = line.line[0], line.line[-1]
            east, north = point[0] - (ax + bx) / 2.0, point[1] - (ay + by) / 2.0
            return east * math.cos(bearing) + north * math.sin(bearing) > 0.0
        return False

    def compute_kept_speed(self, number: int) -> float | None:
        """The highest speed that an agent keeps for a second [m/s]; None of a shorter track."""
        speed, window = self.compute_speed(number), round(1.0 / self.scene.meta.step)
        if len(speed) <= window:
            return None
        return float(np.lib.stride_tricks.sliding_window_view(speed, window).min(axis=1).max())

    def overtakes(self, first: int, second: int) -> bool:
        """Whether one gets from behind another one to ahead of it, beside it on its way."""
        pair = [self.agents[first], self.agents[second]]
        starts = [round(each.spawn_time / self.scene.meta.step) for each in pair]
        begin = max(starts)
        end = min(at + len(each.trajectory) for at, each in zip(starts, pair, strict=True))
        parts = [slice(begin - at, max(end, begin) - at) for at in starts]
        (xy, turn), (around, heading) = (
            (np.array(each.trajectory)[part], np.array(each.heading)[part])
            for each, part in zip(pair, parts, strict=True)
        )
        east, north = (xy - around).T
        along = east * np.cos(heading) + north * np.sin(heading)
        across = np.abs(north * np.cos(heading) - east * np.sin(heading))
        along = along[(across < _BESIDE) & (np.cos(turn - heading) > _ALIKE)]
        behind = np.flatnonzero(along < -_CLEAR)
        return len(behind) > 0 and bool((along[behind[0] :] > _CLEAR).any())

    def compute_turn(self, number: int) -> float:
        """How far an agent turns to the left on its track [rad]; negative to the right."""
        xy = np.array(self.agents[number].trajectory)
        steps = np.diff(xy, axis=0)
        steps = steps[np.hypot(*steps.T) > _STEP]
        if len(steps) < 2:
            return 0.0
        heading = np.unwrap(np.arctan2(steps[:, 1], steps[:, 0]))
        return float(heading[-1] - heading[0])

    def find_speed_limit(self, number: int) -> float | None:
        """The lowest limit of the lanes by which a vehicle enters [m/s]."""
        lanes = self.intersection_map.lanelets if self.intersection_map else ()
        entry = self.agents[number].entry
        return min((lane.speed_limit for lane in lanes if lane.leg == entry), default=None)

    def compute_braking(self, number: int) -> float:
        """The hardest braking of an agent before its track ends [m/s²]."""
        speed = self.compute_speed(number)[:-2]
        return float(-np.gradient(speed, self.scene.meta.step).min()) if len(speed) > 4 else 0.0

    @cached_property
    def red_runners(self) -> frozenset[int]:
        """Agents that pass a light on red."""
        return frozenset(run["agent"] for run in self.proof.figures.get("red_light_runs", ()))

    @cached_property
    def reactions(self) -> Sequence[dict[str, Any]]:
        """Rows of reactions that the checker measured."""
        rows: Sequence[dict[str, Any]] = self.proof.figures.get("reactions", ())
        return rows

    def count_background(self, classes: frozenset[str] = frozenset({"any"})) -> int:
        """Background agents that nouns may stand for; "cars" are vehicles of any kind."""
        loosely = classes - {"car"} | ({"vehicle"} if "car" in classes else set())
        return sum(
            agent.role == "background" and fits_noun(agent, loosely) for agent in self.scene.agents
        )

    def get_minutes(self) -> int | None:
        """Time of day [min since midnight]; None where the scene's clock is no time."""
        return parse_clock(self.scene.meta.time_of_day)

    def list_figures(
        self, *, standstills: bool = False
    ) -> Iterator[tuple[str, float, float, frozenset[int]]]:
        """Unit, least, most and agents of every figure that was asked for and is proven.

        Args:
            standstills: only those that say how long an agent stands.
        """
        for measure in self.scene.measures:
            of = frozenset(
                {measure.agent, measure.agent if measure.other is None else measure.other}
            )
            if not standstills or measure.kind == "wait":
                yield UNITS[measure.kind].unit, measure.low, measure.high, of
        for met in self.scene.encounters:
            unit = get_figure(met.how).unit
            if met.figure is not None and (unit == "s" or not standstills):
                yield unit, *met.figure, frozenset({met.agent})
        if standstills:
            return
        for relation in self.scene.relations:
            of = frozenset({relation.from_, relation.to})
            for unit, value, slack in (
                ("s", relation.target_pet, 0.16), ("s", relation.target_ttc, 0.31),
                ("m/s", relation.impact_speed, 0.51),
            ):  # fmt: skip
                if value is not None:
                    yield unit, value - slack, value + slack, of
        for sight in self.scene.sights:
            yield "s", *sight.lead, frozenset({sight.observer, sight.subject})

    def find_leg(self, name: str) -> str | None:
        """The leg whose lane is nearest to a standing object."""
        return self._find_lane(name, ("approach", "exit", "parking"), "leg")

    def find_side(self, name: str) -> str | None:
        """The side of a leg, `entry` or `exit`, whose lane is nearest to a standing object."""
        sides = {"approach": "entry", "exit": "exit", None: None}
        return sides[self._find_lane(name, ("approach", "exit"), "kind")]

    def _find_lane(self, name: str, kinds: Sequence[str], field: str) -> str | None:
        """A field of the lane of these kinds that is nearest to a standing object."""
        each = next(o for o in self.scene.objects if o.id == name)
        lanes = self.intersection_map.lanelets if self.intersection_map else ()
        away = [
            (min(math.dist((each.x, each.y), point) for point in lane.centreline), value)
            for lane in lanes
            if lane.kind in kinds and (value := getattr(lane, field)) is not None
        ]
        return min(away)[1] if away else None

    def find_objects(self, sense: str) -> tuple[ObjectRecord, ...]:
        """Standing objects of a kind; `thing` is any that is no vehicle."""
        if sense == "thing":
            return tuple(o for o in self.scene.objects if o.kind in ("bin", "box", "container"))
        kinds = ("parked", "double_parked") if sense == "parked" else (sense,)
        return tuple(o for o in self.scene.objects if o.kind in kinds)


def fits_object(each: ObjectRecord, classes: frozenset[str]) -> bool:
    """Whether a noun of these classes may stand for a standing object."""
    if each.kind not in ("parked", "double_parked", "stalled", "bus_stop"):
        return True
    return not classes or bool(classes & {"any", "vehicle", each.subtype or "car"})


def fits_noun(agent: AgentRecord, classes: frozenset[str]) -> bool:
    """Whether a noun of these classes may stand for an agent."""
    return not classes or any(_fits(agent, class_) for class_ in classes)


def _fits(agent: AgentRecord, kind: str) -> bool:
    if kind == "any":
        return True
    if kind == "rider":
        return agent.type in ("cyclist", "scooter") or agent.subtype == "motorcycle"
    if kind in ("pedestrian", "cyclist", "scooter"):
        return agent.type == kind
    if agent.type != "vehicle":
        return False
    if kind == "vehicle":
        return True
    if kind == "emergency":
        return agent.subtype in EMERGENCY
    if kind == "car":
        return agent.subtype in ("car", None)
    return agent.subtype == kind
