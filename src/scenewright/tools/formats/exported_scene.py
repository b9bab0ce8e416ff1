"""A scene as arrays on one clock, which is what every exporter writes from."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from scenewright.errors import InputError
from scenewright.geometry.kinematics import differentiate
from scenewright.geometry.polyline import (
    interpolate_points,
    measure_arc_lengths,
    measure_courses,
    resample_by_spacing,
)
from scenewright.geometry.spline import build_spline_path
from scenewright.scene.base import Colour, FloatArray, Point
from scenewright.scene.candidates import K
from scenewright.scene.kinds import has_trait
from scenewright.scene.map import IntersectionMap
from scenewright.scene.objects import OBJECT_SIZES, ObjectRecord, name_door
from scenewright.scene.record import AgentRecord, EventRecord, SceneRecord
from scenewright.tools.formats.road_users import ROAD_USERS, RoadUserNames, find_kind

ROUTE_SPACING = 2.0
"""Between the points of a route beyond the end of a track [m]."""
SLOWEST_CONTINUATION = {True: 3.0, False: 1.0}
"""At which a vehicle (True) or pedestrian goes on along its route, if it was slower [m/s]."""


@dataclass(frozen=True, eq=False)
class ExportedAgent:
    """One agent of an exported scene, or an object that stands in it.

    Attributes:
        id: number in scene.json, of objects above those; name: such as `vehicle-1`.
        kind: key of `ROAD_USERS`; type, role, waypoints: as in scene.json.
        length, width: [m].
        first: step of the first sample; step: time between samples [s].
        xy: [T, 2] centre [m]; heading: [T] in [−π, π] [rad].
        velocity: [T, 2] [m/s], by central differences of the positions.
    """

    id: int
    name: str
    kind: str
    type: str
    role: str
    length: float
    width: float
    waypoints: tuple[Point, ...]
    first: int
    step: float
    xy: FloatArray
    heading: FloatArray
    velocity: FloatArray

    @classmethod
    def build_from_record(cls, record: AgentRecord, step: float) -> ExportedAgent:
        """The agent of a scene.json whose samples are `step` seconds apart."""
        xy = np.array(record.trajectory, dtype=np.float64).reshape(-1, 2)
        heading = wrap_angles(np.array(record.heading, dtype=np.float64))
        velocity = differentiate(xy, step)
        kind = find_kind(record.type, record.subtype)
        return cls(
            id=record.id, name=record.name, kind=kind, type=record.type, role=record.role,
            length=record.length, width=record.width, waypoints=record.waypoints,
            first=round(record.spawn_time / step), step=step, xy=xy, heading=heading,
            velocity=velocity,
        )  # fmt: skip

    @classmethod
    def build_from_object(
        cls, record: ObjectRecord, number: int, steps: int, step: float
    ) -> ExportedAgent:
        """An object that stands where it is, a door from when it is opened."""
        kind = find_kind(record.kind if record.kind in OBJECT_SIZES else "vehicle", record.subtype)
        xy, heading = np.array([[record.x, record.y]]), wrap_angles(np.array([record.heading]))
        first = min(math.ceil((record.since or 0.0) / step - 1e-6), steps - 1)
        return cls(
            id=number, name=record.id, kind=kind, type="vehicle", role="object",
            length=record.length, width=record.width, waypoints=(), first=first, step=step,
            xy=xy, heading=heading, velocity=np.zeros_like(xy),
        ).hold(first, steps)  # fmt: skip

    @property
    def names(self) -> RoadUserNames:
        """What the formats call its kind."""
        return ROAD_USERS[self.kind]

    @property
    def height(self) -> float:
        """Usual height of its kind [m]."""
        return self.names.height

    @property
    def last(self) -> int:
        """Step of the last sample."""
        return self.first + len(self.xy) - 1

    @cached_property
    def times(self) -> FloatArray:
        """[T] times of the samples [s], to the millisecond."""
        return np.round((self.first + np.arange(len(self.xy))) * self.step, 3)

    @cached_property
    def speed(self) -> FloatArray:
        """[T] [m/s]."""
        return np.asarray(np.hypot(*self.velocity.T))

    @cached_property
    def acceleration(self) -> FloatArray:
        """[T, 2] [m/s²], by central differences of the velocity."""
        return differentiate(self.velocity, self.step)

    @cached_property
    def route_ahead(self) -> FloatArray:
        """[M, 2] the intended route from the last sample to the map's edge [m]; M may be 1.

        A collision ends a track, not the way that the agent was on.
        """
        if len(self.waypoints) != K:
            return self.xy[-1:]
        path = build_spline_path(np.array(self.waypoints)).xy
        nearest = int(np.argmin(np.hypot(*(path - self.xy[-1]).T)))
        rest = path[nearest:] - path[nearest] + self.xy[-1]
        length = np.hypot(*np.diff(rest, axis=0).T).sum()
        return resample_by_spacing(rest, ROUTE_SPACING) if length > ROUTE_SPACING else self.xy[-1:]

    def shift(self, start: int, steps: int) -> ExportedAgent | None:
        """The agent on a clock that starts at `start` and has `steps`; None if it is not there."""
        first = max(self.first - start, 0)
        part = slice(max(start - self.first, 0), max(start + steps - self.first, 0))
        if not len(self.xy[part]):
            return None
        return replace(
            self, first=first, xy=self.xy[part], heading=self.heading[part],
            velocity=self.velocity[part],
        )  # fmt: skip

    def hold(self, first: int, end: int) -> ExportedAgent:
        """A standing object there from a step on and before another."""
        count = end - first
        return replace(
            self, first=first, xy=np.repeat(self.xy[:1], count, axis=0),
            heading=np.repeat(self.heading[:1], count), velocity=np.zeros((count, 2)),
        )  # fmt: skip

    def continue_until(self, last: int) -> ExportedAgent:
        """The agent going on along its route at its last speed, up to a step or the map's edge."""
        speed = max(float(self.speed[-1]), SLOWEST_CONTINUATION[self.names.is_vehicle])
        along = measure_arc_lengths(self.route_ahead)
        count = min(int(along[-1] / (speed * self.step)), last - self.last)
        if count < 1:
            return self
        at = np.asarray(speed * self.step * np.arange(1, count + 1), dtype=np.float64)
        more = interpolate_points(at, along, self.route_ahead)
        turn = measure_courses(self.route_ahead)
        heading = wrap_angles(np.interp(at, (along[1:] + along[:-1]) / 2, turn))
        xy = np.concatenate([self.xy, more])
        return replace(
            self, xy=xy, heading=np.concatenate([self.heading, heading]),
            velocity=differentiate(xy, self.step),
        )  # fmt: skip


@dataclass(frozen=True, eq=False)
class ExportedScene:
    """A scene with its map, ready to be written in any format.

    Attributes:
        name: of its files.
        objects: what stands: parked vehicles, boxes, bins, containers.
        steps: samples of the clock, from time 0 to the end of the scene.
        ego: the agent that is left to a user, or around which a format is centred.
        ego_named: whether the caller named the ego, and so takes it over.
        offset: scene time of step 0 [steps].
    """

    record: SceneRecord
    name: str
    intersection_map: IntersectionMap
    agents: tuple[ExportedAgent, ...]
    steps: int
    ego: ExportedAgent
    ego_named: bool = False
    offset: int = 0
    objects: tuple[ExportedAgent, ...] = ()

    @property
    def step(self) -> float:
        """Time between samples [s]."""
        return self.record.meta.step

    @property
    def times(self) -> FloatArray:
        """[steps] [s], to the millisecond."""
        return np.round(np.arange(self.steps) * self.step, 3)

    @cached_property
    def events(self) -> tuple[EventRecord, ...]:
        """The events of the scene, and as collisions who drives into an object or its door."""
        ids = {scene_object.name: scene_object.id for scene_object in self.objects}
        tracks = {agent.id: agent for agent in self.record.agents}
        hits = []
        for encounter in self.record.encounters:
            if has_trait("encounter", encounter.how, "ends") and encounter.object in ids:
                agent = tracks[encounter.agent]
                end = agent.spawn_time + (len(agent.trajectory) - 1) * self.step
                to = ids.get(name_door(encounter.object), ids[encounter.object])
                hits.append(EventRecord.model_validate({
                    "type": "collision", "from": agent.id, "to": to, "time": end,
                    "location": agent.trajectory[-1],
                }))  # fmt: skip
        return (*self.record.events, *hits)

    @cached_property
    def collided(self) -> frozenset[int]:
        """Ids of those that a collision ends, and of objects that are driven into."""
        rows = [event for event in self.events if event.type == "collision"]
        return frozenset(n for row in rows for n in (row.from_, row.to) if n is not None)

    def list_colours(self) -> Mapping[str, list[Colour | None]]:
        """By stop line or crosswalk the colour at every step; None where none is stated."""
        lights: dict[str, list[Colour | None]] = {}
        for row in self.record.signals:
            name = row.stop_line or row.crosswalk or ""
            colours = lights.setdefault(name, [None] * self.steps)
            for k in range(self.steps):
                if row.start - 1e-6 <= (k + self.offset) * self.step <= row.end + 1e-6:
                    colours[k] = row.colour
        return lights

    def list_lane_lights(self) -> list[tuple[str, Point, list[Colour | None]]]:
        """Id, end and colours at every step of each lane that ends at a stop line with a light."""
        ends = {lanelet.id: lanelet.centreline[-1] for lanelet in self.intersection_map.lanelets}
        colours = self.list_colours()
        return [
            (lane, ends[lane], colours[line.id])
            for line in self.intersection_map.stop_lines
            for lane in line.lanelets
            if line.id in colours
        ]

    def begin_at_ego(self) -> ExportedScene:
        """Cut the scene to begin when the ego enters; agents that have left by then are dropped."""
        return self.cut(self.ego.first, self.steps - self.ego.first)

    def cut(self, start: int, steps: int) -> ExportedScene:
        """Cut the scene from a step on, so many steps long, to where its ego is there.

        Absent agents are dropped; before and after the scene only objects are there.
        """
        agents = tuple(
            a for a in (agent.shift(start, steps) for agent in self.agents) if a is not None
        )
        (ego,) = (agent for agent in agents if agent.id == self.ego.id)
        firsts = [
            max(scene_object.first - start, 0) if scene_object.first else 0
            for scene_object in self.objects
        ]
        rows = zip(self.objects, firsts, strict=True)
        objects = tuple(each.hold(first, steps) for each, first in rows if first < steps)
        return replace(
            self, agents=agents, ego=ego, steps=steps, offset=self.offset + start, objects=objects
        )

    def cut_window(self, steps: int, *, now: int, event: int) -> ExportedScene:
        """Cut to so many steps, at step `now` of which the ego is there.

        The event lies at step `event`, or later so that the window ends with the scene, or earlier
        so that it begins when the ego enters, but after `now`; steps before the scene are empty.
        An ego that nobody named and that is not there just before the event gives way to an agent
        that is; of a named one the event may lie outside.
        """
        ego, at = self.ego, self.find_event_step()
        there = tuple(a for a in self.agents if a.first < at <= a.last + 1)
        if there and not self.ego_named:
            ego = ego if ego in there else _find_ego(there, None)
        at = min(max(at, ego.first + 1), ego.last + 1)
        start = max(min(at - event, self.steps - steps), min(ego.first, at - now - 1))
        return replace(self, ego=ego).cut(start, steps)

    def find_event_step(self) -> int:
        """Step of the first collision, else of the first event, else the middle of the scene."""
        events = [event for event in self.events if event.time is not None]
        first = min(events, key=lambda each: (each.type != "collision", each.time), default=None)
        return self.steps // 2 if first is None else round((first.time or 0.0) / self.step)

    def list_event_agents(self) -> list[int]:
        """Ids of agents and objects of the events that are there, in order of the events."""
        present = {each.id for each in (*self.agents, *self.objects)}
        ids = [n for event in self.events for n in (event.from_, event.to)]
        return [n for n in dict.fromkeys(ids) if n in present and n is not None]


def prepare_scene(
    record: SceneRecord,
    intersection_map: IntersectionMap,
    *,
    ego: str | None = None,
    name: str | None = None,
) -> ExportedScene:
    """The scene as arrays.

    Args:
        ego: name of an agent such as `vehicle-1`, or its number; None: the first vehicle of the
            foreground, failing that the first vehicle, failing that the first agent.
        name: of the files; None is the scene's id.

    Raises:
        InputError: no agents, no such ego, or a kind of road user that no format knows.
    """
    step = record.meta.step
    agents = tuple(ExportedAgent.build_from_record(agent, step) for agent in record.agents)
    if not agents:
        raise InputError(f"scene {record.meta.scene_id[:40]} has no agents to export")
    steps = max(round(record.meta.duration / step), *(agent.last for agent in agents)) + 1
    # A name that any file system takes.
    clean = re.sub(r"[^A-Za-z0-9._-]", "_", name or record.meta.scene_id)[:80].lstrip(".")
    first = max(agent.id for agent in agents) + 1
    objects = tuple(
        ExportedAgent.build_from_object(each, number, steps, step)
        for number, each in enumerate(record.objects, start=first)
    )
    return ExportedScene(
        record, clean or "scene", intersection_map, agents, steps, _find_ego(agents, ego),
        ego_named=ego is not None, objects=objects,
    )  # fmt: skip


def _find_ego(agents: tuple[ExportedAgent, ...], ego: str | None) -> ExportedAgent:
    if ego is None:
        return min(agents, key=lambda a: (not a.names.is_vehicle, a.role != "foreground", a.id))
    for agent in agents:
        if ego in (agent.name, str(agent.id)):
            return agent
    there = ", ".join(agent.name for agent in agents[:20])
    raise InputError(f"no agent {ego[:40]!r} in the scene; there are: {there}")


def wrap_angles(angles: FloatArray) -> FloatArray:
    """Angles brought into [−π, π] [rad]."""
    return np.asarray(np.arctan2(np.sin(angles), np.cos(angles)))
