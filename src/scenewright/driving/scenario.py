"""A scene as arrays on one clock, ready to be driven: paths, schedules, lights, map lines."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from scenewright.errors import InputError
from scenewright.geometry.polyline import measure_arc_lengths, resample_to_count
from scenewright.scene.base import FloatArray
from scenewright.scene.map import IntersectionMap
from scenewright.scene.record import AgentRecord, SceneRecord
from scenewright.scene.track import STEP
from scenewright.tools.formats import ExportedScene, prepare_scene
from scenewright.tools.formats.exported_scene import ExportedAgent
from scenewright.tools.relation_checker import RoadUser
from scenewright.tools.relation_checker.external_events import ExternalTracks

BoolArray = NDArray[np.bool_]
IntArray = NDArray[np.int64]

KINDS = ("vehicle", "pedestrian", "cyclist", "scooter", "object")
"""Classes of road users by number; an object stands where it is."""
SPACING = 0.5
"""Between the points of a path [m]."""
COLOURS = ("green", "yellow", "red")
NO_LIGHT = -1
SLOWEST = {"vehicle": 6.0, "pedestrian": 1.2, "cyclist": 4.0, "scooter": 4.0}
GAIN = {"vehicle": 1.5, "pedestrian": 1.0, "cyclist": 1.0, "scooter": 1.0}
"""Least free speed [m/s] and acceleration [m/s^2] beyond the end of a recorded track."""
MAP_POINTS = 16
"""Points of every map line."""
DEFAULT_SPEED_LIMIT = 13.9
"""Where no map says another [m/s]."""


@dataclass(frozen=True, eq=False)
class AgentPath:
    """The way of one agent and when it is where on it.

    Attributes:
        xy: [P, 2] points every `SPACING` [m]; heading: [P] there, without jumps [rad].
        length: of the way [m]; the recorded track may end before it.
        progress: [T] distance along the way at every step of the scene [m]; held outside of the
            agent's own time.
        first, last: first and last step at which it is there; `last` is beyond the end of the
            scene where a collision ends the recorded track and the agent would go on.
        stops: (light, distance [m]) of the stop lines on the way: where the centre waits.
    """

    xy: FloatArray
    heading: FloatArray
    length: float
    progress: FloatArray
    first: int
    last: int
    stops: tuple[tuple[int, float], ...]

    def get_poses(self, s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Positions [n, 2] [m] and headings [n] [rad] at distances [n] along the way [m]."""
        x, y = (np.interp(s, self.arc, self.xy[:, k]) for k in (0, 1))
        return np.array([x, y]).T, np.interp(s, self.arc, self.heading)

    @cached_property
    def arc(self) -> FloatArray:
        """[P] distance of the points [m]."""
        return np.linspace(0.0, self.length, len(self.xy))

    @cached_property
    def curvature(self) -> FloatArray:
        """[P] [1/m]."""
        if len(self.xy) < 3:
            return np.zeros(len(self.xy))
        return np.asarray(np.gradient(self.heading, self.arc))

    @cached_property
    def spacing(self) -> float:
        """Between the points [m]; about `SPACING`."""
        return self.length / max(len(self.xy) - 1, 1)

    @cached_property
    def arrival(self) -> FloatArray:
        """[P] step at which the recorded agent reaches each point.

        Beyond its recorded track it goes on at its last speed from its last step: who waits to the
        end passes no agent before.
        """
        progress = self.progress[self.first :]
        steps = self.first + np.arange(len(progress), dtype=np.float64)
        moving = np.concatenate([[True], np.diff(progress) > 1e-9])
        known, times = progress[moving], steps[moving]
        last = max(float(self.progress[self.last] - self.progress[self.last - 1]), 0.1)
        beyond = self.last + (self.arc - known[-1]) / last
        within = np.interp(self.arc, known, times)
        return np.asarray(np.where(self.arc <= known[-1], within, beyond))


@dataclass(frozen=True, eq=False)
class Scenario:
    """A scene ready to be driven. N agents, objects behind them, T steps.

    Attributes:
        name: of the scene; step: [s].
        names, kinds: [N] such as `vehicle-1`, and positions in `KINDS`.
        sizes: [N, 2] length and width [m].
        xy: [N, T, 2] recorded centres [m]; heading: [N, T] [rad]; present: [N, T].
        paths: one for each agent; objects have a path of one point.
        ego: index of the agent that is driven.
        lights: names of the lights; colours: [L, T] positions in `COLOURS`, `NO_LIGHT` for none.
        map_lines: [M, MAP_POINTS, 2] lane centres, then crosswalk outlines [m].
        map_kinds: [M] 0 for lanes, 1 for crosswalks.
        priority: [N] agents that have the right of way over the ego.
        violators: [N] agents that the scene lets run red.
        speed_limit: on the ego's route [m/s].
        partner: agents bound to the ego by a relation, in order of the relations.
        record, intersection_map: where they are known.
    """

    name: str
    step: float
    names: tuple[str, ...]
    kinds: IntArray
    sizes: FloatArray
    xy: FloatArray
    heading: FloatArray
    present: BoolArray
    paths: tuple[AgentPath, ...]
    ego: int
    lights: tuple[str, ...]
    colours: IntArray
    map_lines: FloatArray
    map_kinds: IntArray
    priority: BoolArray
    violators: BoolArray
    speed_limit: float
    partner: tuple[int, ...] = ()
    record: SceneRecord | None = None
    intersection_map: IntersectionMap | None = None

    @property
    def steps(self) -> int:
        """Steps of the scene."""
        return int(self.xy.shape[1])

    @property
    def start(self) -> int:
        """Step at which the ego enters, and the drive begins."""
        return self.paths[self.ego].first

    @cached_property
    def is_disc(self) -> BoolArray:
        """[N] whether the footprint is a disc."""
        return np.asarray(self.kinds == KINDS.index("pedestrian"))

    @cached_property
    def reach(self) -> FloatArray:
        """[N] radius of the circle round each footprint [m]."""
        return np.where(self.is_disc, self.sizes[:, 0] / 2, np.hypot(*self.sizes.T) / 2)

    @cached_property
    def moves(self) -> BoolArray:
        """[N] whether it is a road user other than the ego."""
        moves = self.kinds != KINDS.index("object")
        moves[self.ego] = False
        return np.asarray(moves)

    def get_colour(self, light: int, step: int) -> int:
        """The colour that a light shows at a step; the last one holds on."""
        return int(self.colours[light, min(step, self.colours.shape[1] - 1)])


def build_scenario(
    record: SceneRecord, intersection_map: IntersectionMap, *, ego: str | None = None
) -> Scenario:
    """A scene of scenewright as a scenario.

    Args:
        ego: name or number of the agent to drive; None: the first vehicle of the foreground.

    Raises:
        InputError: no such agent, or a pedestrian.
    """
    scene = prepare_scene(record, intersection_map, ego=ego)
    ids = [agent.id for agent in scene.agents]
    lights = tuple(sorted(scene.list_colours()))
    colours = _number_colours(scene, lights)
    records = [*record.agents, *(None for _ in scene.objects)]
    stops = [_find_stops(row, lights, intersection_map) for row in records]
    agents = _continue_collided(scene, stops, colours)
    paths = tuple(
        _build_path(agent, scene, gates) for agent, gates in zip(agents, stops, strict=True)
    )
    me = ids.index(scene.ego.id)
    _check_ego(agents[me])
    return _assemble(
        scene.name, scene.step, agents, paths, ego=me, steps=scene.steps, lights=lights,
        colours=colours, intersection_map=intersection_map,
        priority=_find_priority(record, intersection_map, me, len(agents)),
        violators=[row is not None and row.violates_signal for row in records],
        speed_limit=_find_speed_limit(record.agents[me], intersection_map),
        partner=_find_partners(record, ids, me), record=record,
    )  # fmt: skip


def build_scenario_from_tracks(
    tracks: ExternalTracks, *, ego: int, span: tuple[float, float], name: str = "tracks"
) -> Scenario:
    """Recorded tracks as a scenario without map and lights, in which all others replay.

    Args:
        ego: id of the user to drive; span: start and end [s] of the stretch to drive, in which
            the ego must be present for at least 1 s.

    Raises:
        InputError: the ego is not there, or is a pedestrian.
    """
    agents = [
        agent for agent in (_cut_user(user, span) for user in tracks.users) if agent is not None
    ]
    ids = [agent.id for agent in agents]
    if ego not in ids or len(agents[ids.index(ego)].xy) * STEP < 1.0:
        raise InputError(f"agent {ego} is not there from {span[0]:.1f} to {span[1]:.1f} s")
    me = ids.index(ego)
    _check_ego(agents[me])
    steps = round((span[1] - span[0]) / STEP) + 1
    return _assemble(
        name, STEP, agents, tuple(_build_path(agent, None, {}) for agent in agents), ego=me,
        steps=steps, lights=(), colours=np.zeros((0, steps), dtype=np.int64),
        intersection_map=None, priority=np.array([agent.type == "pedestrian" for agent in agents]),
        violators=[False] * len(agents), speed_limit=DEFAULT_SPEED_LIMIT, partner=(), record=None,
    )  # fmt: skip


def _cut_user(user: RoadUser, span: tuple[float, float]) -> ExportedAgent | None:
    """A road user from the start of a span to its end, on the steps of a scene; None if absent."""
    track = user.track
    first = max(int(np.ceil((track.start - span[0]) / STEP - 1e-6)), 0)
    last = int(np.floor((min(track.end, span[1]) - span[0]) / STEP + 1e-6))
    if last < first + 1:
        return None
    at = span[0] + STEP * np.arange(first, last + 1)
    xy = np.stack([np.interp(at, track.times, track.xy[:, k]) for k in (0, 1)], axis=-1)
    heading = np.interp(at, track.times, np.unwrap(track.heading))
    shape = user.shape
    return ExportedAgent(
        user.id, f"{shape.type}-{user.id}", shape.type, shape.type, "background", shape.length,
        shape.width, (), first, STEP, xy, heading, np.gradient(xy, STEP, axis=0),
    )  # fmt: skip


def _assemble(
    name: str,
    step: float,
    agents: Sequence[ExportedAgent],
    paths: tuple[AgentPath, ...],
    *,
    ego: int,
    steps: int,
    lights: tuple[str, ...],
    colours: IntArray,
    intersection_map: IntersectionMap | None,
    priority: BoolArray,
    violators: Sequence[bool],
    speed_limit: float,
    partner: tuple[int, ...],
    record: SceneRecord | None,
) -> Scenario:
    samples = [_spread(agent, steps) for agent in agents]
    lines, kinds = _list_map_lines(intersection_map)
    return Scenario(
        name=name, step=step, names=tuple(agent.name for agent in agents),
        kinds=np.array([KINDS.index("object" if a.role == "object" else a.type) for a in agents]),
        sizes=np.array([(agent.length, agent.width) for agent in agents]),
        xy=np.stack([xy for xy, _, _ in samples]),
        heading=np.stack([heading for _, heading, _ in samples]),
        present=np.stack([present for _, _, present in samples]),
        paths=paths, ego=ego, lights=lights, colours=colours, map_lines=lines, map_kinds=kinds,
        priority=priority, violators=np.array(violators, dtype=bool),
        speed_limit=speed_limit, partner=partner,
        record=record, intersection_map=intersection_map,
    )  # fmt: skip


def _check_ego(agent: ExportedAgent) -> None:
    if agent.type == "pedestrian":
        raise InputError(f"{agent.name} is a pedestrian; the ego is a vehicle or a rider")
    if len(agent.xy) < 2:
        raise InputError(f"{agent.name} has no track to drive")


def _spread(agent: ExportedAgent, steps: int) -> tuple[FloatArray, FloatArray, BoolArray]:
    """Positions, headings and presence at every step, held outside of the agent's own time."""
    at = np.arange(steps) - agent.first
    held = np.clip(at, 0, len(agent.xy) - 1)
    return agent.xy[held], np.unwrap(agent.heading)[held], held == at


# ---- paths --------------------------------------------------------------------------------------


def _continue_collided(
    scene: ExportedScene, stops: Sequence[Mapping[int, FloatArray]], colours: IntArray
) -> list[ExportedAgent]:
    """The agents, those that a collision ends going on along their routes; then the objects."""
    ends = {
        n: event.time for event in scene.record.events if event.type == "collision"
        for n in (event.from_, event.to)
    }  # fmt: skip
    agents = []
    for agent, gates in zip(scene.agents, stops, strict=False):
        time = ends.get(agent.id)
        if time is None:
            agents.append(agent)
            continue
        before = max(int(np.floor(time / scene.step + 1e-6)) - agent.first + 1, 2)
        cut = replace(
            agent, xy=agent.xy[:before], heading=agent.heading[:before],
            velocity=agent.velocity[:before],
        )  # fmt: skip
        agents.append(_continue(cut, scene, gates, colours))
    return [*agents, *scene.objects]


def _continue(
    agent: ExportedAgent, scene: ExportedScene, gates: Mapping[int, FloatArray], colours: IntArray
) -> ExportedAgent:
    """The agent going on along its route to its free speed, stopping for red and yellow lights."""
    path = _build_path(agent, scene, gates)
    s, speed = float(path.progress[-1]), float(agent.speed[-1])
    top, gain = max(float(agent.speed.max()), SLOWEST[agent.type]), GAIN[agent.type]
    ahead = []
    for step in range(agent.last + 1, scene.steps):
        shut = [at - s for light, at in path.stops if at > s - 0.3 and colours[light, step] > 0]
        limit = np.sqrt(2 * gain * max(min(shut), 0.0)) if shut else np.inf
        speed = min(speed + gain * scene.step, top, max(limit, speed - 4.0 * scene.step))
        s += speed * scene.step
        if s >= path.length:
            break
        ahead.append(s)
    xy, heading = path.get_poses(np.array(ahead))
    return replace(
        agent, xy=np.concatenate([agent.xy, xy]),
        heading=np.concatenate([agent.heading, heading]),
        velocity=np.concatenate([agent.velocity, np.zeros_like(xy)]),
    )  # fmt: skip


def _build_path(
    agent: ExportedAgent, scene: ExportedScene | None, stops: Mapping[int, FloatArray]
) -> AgentPath:
    """The way of an agent: its track, and beyond it the route to the map's edge."""
    line = np.concatenate([agent.xy, agent.route_ahead[1:]])
    steps = agent.last + 1 if scene is None else max(scene.steps, agent.last + 1)
    kept = np.concatenate([[True], np.hypot(*np.diff(line, axis=0).T) > 1e-3])
    line = line[kept]
    along = measure_arc_lengths(agent.xy)
    held = along[np.clip(np.arange(steps) - agent.first, 0, len(along) - 1)]
    if len(line) < 2:
        heading = agent.heading[:1]
        return AgentPath(line[:1], heading, 0.0, held * 0.0, agent.first, agent.last, ())
    arc = measure_arc_lengths(line)
    count = max(int(np.ceil(arc[-1] / SPACING)), 1) + 1
    xy = resample_to_count(line, count)
    heading = _find_headings(agent, along, arc, line, np.linspace(0.0, arc[-1], count))
    path = AgentPath(
        xy, heading, float(arc[-1]), np.minimum(held, arc[-1]), agent.first, agent.last, ()
    )
    found = tuple(
        (light, s) for light, gate in stops.items()
        if (s := _find_crossing(path, gate, agent)) is not None
    )  # fmt: skip
    return AgentPath(xy, heading, path.length, path.progress, agent.first, agent.last, found)


def _find_headings(
    agent: ExportedAgent, along: FloatArray, arc: FloatArray, line: FloatArray, s: FloatArray
) -> FloatArray:
    """[P] headings: as recorded as far as the track goes, then those of the route."""
    moving = np.concatenate([[True], np.diff(along) > 1e-4])
    recorded = np.unwrap(agent.heading)
    legs = np.diff(line, axis=0)
    tangent = np.unwrap(np.arctan2(legs[:, 1], legs[:, 0]))
    middle = (arc[1:] + arc[:-1]) / 2
    beyond = np.interp(s, middle, tangent)
    own = np.interp(s, along[moving], recorded[moving])
    turn = np.interp(along[-1], middle, tangent) - recorded[-1]
    beyond = beyond - 2 * np.pi * np.round(turn / (2 * np.pi))
    return np.asarray(np.where(s <= along[-1], own, beyond))


def _find_stops(
    record: AgentRecord | None, lights: tuple[str, ...], intersection_map: IntersectionMap
) -> dict[int, FloatArray]:
    """By number of a light that holds for the agent, the line or outline before which it waits."""
    if record is None or record.movement == "jaywalking":
        return {}
    walks = ((w.id, w.leg == record.crosswalk, w.polygon) for w in intersection_map.crosswalks)
    lines = ((s.id, s.leg == record.entry, s.line) for s in intersection_map.stop_lines)
    places = lines if record.crosswalk is None else walks
    gates = {name: np.array(place) for name, holds, place in places if holds}
    return {k: gates[name] for k, name in enumerate(lights) if name in gates}


def _find_crossing(path: AgentPath, gate: FloatArray, agent: ExportedAgent) -> float | None:
    """Where the centre waits before a line [2, 2] or outline [Q, 2]; None if it never meets it."""
    closed = gate if len(gate) == 2 else np.concatenate([gate, gate[:1]])
    hits = [s for a, b in pairwise(closed) for s in _intersect(path, a, b)]
    if not hits:
        return None
    front = agent.length / 2 + (0.4 if len(gate) == 2 else 0.2)
    return max(min(hits) - front, 0.0)


def _intersect(path: AgentPath, a: FloatArray, b: FloatArray) -> list[float]:
    """Distances [m] at which a path crosses the segment from a to b."""
    p, r = path.xy[:-1], np.diff(path.xy, axis=0)
    q = b - a
    cross = r[:, 0] * q[1] - r[:, 1] * q[0]
    safe = np.where(np.abs(cross) < 1e-12, np.inf, cross)
    off = a - p
    t = (off[:, 0] * q[1] - off[:, 1] * q[0]) / safe
    u = (off[:, 0] * r[:, 1] - off[:, 1] * r[:, 0]) / safe
    hit = (t >= 0) & (t < 1) & (u >= 0) & (u <= 1) & np.isfinite(safe)
    return [
        float(path.arc[k] + t[k] * (path.arc[k + 1] - path.arc[k])) for k in np.flatnonzero(hit)
    ]


# ---- lights, right of way, map ------------------------------------------------------------------


def _number_colours(scene: ExportedScene, lights: tuple[str, ...]) -> IntArray:
    shown = scene.list_colours()
    rows = [[NO_LIGHT if c is None else COLOURS.index(c) for c in shown[name]] for name in lights]
    return np.array(rows, dtype=np.int64).reshape(len(lights), scene.steps)


def _find_partners(record: SceneRecord, ids: list[int], ego: int) -> tuple[int, ...]:
    pairs = [(row.from_, row.to) for row in record.relations]
    others = [b if a == ids[ego] else a for a, b in pairs if ids[ego] in (a, b)]
    return tuple(dict.fromkeys(ids.index(n) for n in others))


def _find_priority(
    record: SceneRecord, intersection_map: IntersectionMap, ego: int, count: int
) -> BoolArray:
    """Find the agents [N] with the right of way over the ego, lights aside.

    Pedestrians and riders on a crosswalk; for a left turn, those from the opposite leg that
    do not turn left too; without lights, those from the right.
    """
    bearings = {leg.name: leg.bearing for leg in intersection_map.legs}
    me, priority = record.agents[ego], np.zeros(count, dtype=bool)
    for k, agent in enumerate(record.agents):
        if k == ego:
            continue
        if agent.crosswalk is not None:
            priority[k] = agent.movement != "jaywalking"
            continue
        turn = (bearings[agent.entry] - bearings[me.entry] + np.pi) % (2 * np.pi) - np.pi
        opposite = abs(turn) > np.deg2rad(135)
        from_right = np.deg2rad(45) < turn < np.deg2rad(135)
        if intersection_map.left_hand_traffic:
            from_right = np.deg2rad(-135) < turn < np.deg2rad(-45)
        across = "right" if intersection_map.left_hand_traffic else "left"
        turns = me.movement in (across, "uturn") and agent.movement not in (across, "uturn")
        priority[k] = (opposite and turns) or (from_right and not record.signals)
    return priority


def _list_map_lines(place: IntersectionMap | None) -> tuple[FloatArray, IntArray]:
    """[M, MAP_POINTS, 2] lane centres and crosswalk outlines [m], and what each is."""
    if place is None:
        return np.zeros((0, MAP_POINTS, 2)), np.zeros(0, dtype=np.int64)
    lanes = [np.array(lane.centreline) for lane in place.lanelets if lane.kind != "parking"]
    walks = [np.array([*walk.polygon, walk.polygon[0]]) for walk in place.crosswalks]
    lines = np.array([resample_to_count(line, MAP_POINTS) for line in (*lanes, *walks)])
    return lines.reshape(-1, MAP_POINTS, 2), np.array([0] * len(lanes) + [1] * len(walks))


def _find_speed_limit(ego: AgentRecord, place: IntersectionMap) -> float:
    """The lowest limit on the lanes outside the junction that the ego's movement uses [m/s]."""
    ways = [movement for movement in place.movements if ego.route.endswith(movement.id)]
    used = {name for way in ways for name in way.lanelets}
    limits = [lane.speed_limit for lane in place.lanelets if lane.id in used]
    return min(limits, default=DEFAULT_SPEED_LIMIT)
