"""OpenSCENARIO 1.2 with the map as OpenDRIVE beside it, in two forms.

`replay` gives every agent its trajectory, vertex by vertex. `reactive` gives it a route, a profile
of speeds and a trigger, so that a simulator's own drivers can react: who drives on lanes gets the
lanes, who walks, rides beside them or takes part in an event a line without times. Where an agent
is to meet the ego and enters after it, it sets off when the ego gets where it was at that moment.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any, NamedTuple
from xml.etree import ElementTree

import numpy as np

from scenewright.errors import InputError
from scenewright.geometry.kinematics import differentiate
from scenewright.geometry.polyline import (
    measure_arc_lengths,
    measure_courses,
    measure_distances,
    resample_by_spacing,
)
from scenewright.scene.base import FloatArray
from scenewright.scene.track import STEP
from scenewright.tools.formats.exported_scene import ExportedAgent, ExportedScene, wrap_angles
from scenewright.tools.formats.opendrive import Road, make_roads, number_signals, write_opendrive
from scenewright.tools.formats.sampled_recording import (
    AgentSamples,
    SampledRecording,
    find_road_user,
    resample_if_uneven,
    sort_out,
)
from scenewright.tools.formats.xml import add, parse_number, parse_xml, write_bytes

LINE_SPACING, SPEED_SPACING = 1.0, 0.5
"""Between the points of a line without times [m], and between entries of a speed profile [s]."""
OFF_LANES = 0.6
"""Who is further than this from the middle of all lanes of its route does not drive on them [m]."""
REAR_AXLE = 0.3
"""Of its length a vehicle's rear axle, its reference point, lies behind its middle."""
INSIDE = 0.5
"""From the end of a lane at least, so that a place is on it [m]."""
TRIGGER_RADIUS = 2.0
"""How near the ego comes to the place that sets another agent off [m]."""

_Element = ElementTree.Element


class _Arrival(NamedTuple):
    """So long after an agent reaches a place."""

    agent_name: str
    xy: FloatArray
    delay: float


_Trigger = _Arrival | float | str
"""What starts an event: an arrival, a time [s], or the parameter that holds a time."""
_Roads = Mapping[str, Road]
_Way = list[tuple[Road, float]]
"""Places on the lanes that one drives on: the road and the distance along it [m]."""
_HELD_FROM = 0.5
"""Nothing stands still within a step from such a speed [m/s]."""
_FOLLOW = "Action/PrivateAction/RoutingAction/FollowTrajectoryAction"
_TIME = "StartTrigger/ConditionGroup/Condition/ByValueCondition/SimulationTimeCondition"


def write(scene: ExportedScene, *, form: str = "replay") -> dict[str, bytes]:
    """The .xosc and .xodr of a scene.

    An ego that the caller named gets its place, speed and route, and is left alone from then on;
    time 0 is then the moment at which it enters.
    """
    if scene.ego_named:
        scene = scene.begin_at_ego()
    scene = replace(
        scene, ego=_refer_to_axle(scene.ego),
        agents=tuple(_refer_to_axle(agent) for agent in scene.agents),
        objects=tuple(_refer_to_axle(agent) for agent in scene.objects),
    )  # fmt: skip
    root = build_header(scene)
    parameters = add(root, "ParameterDeclarations")
    for name, value in _list_parameters(scene).items() if form == "reactive" else ():
        add(parameters, "ParameterDeclaration", name=name, parameterType="double", value=value)
    add(root, "CatalogLocations")
    _add_road_network(root, scene)
    entities = add(root, "Entities")
    for agent in (*scene.agents, *scene.objects):
        _add_entity(entities, agent)
    _add_storyboard(root, scene, form)
    return {
        f"{scene.name}.xosc": write_bytes(root),
        f"{scene.name}.xodr": write_opendrive(scene.intersection_map),
    }


def build_header(scene: ExportedScene) -> _Element:
    """A document with its header."""
    root = ElementTree.Element("OpenSCENARIO")
    add(root, "FileHeader", revMajor=1, revMinor=2, date=_find_clock(scene), author="scenewright",
        description=scene.record.meta.user_prompt)  # fmt: skip
    return root


def _find_clock(scene: ExportedScene) -> str:
    return f"2000-01-01T{scene.record.meta.time_of_day}:00"


def _list_parameters(scene: ExportedScene) -> dict[str, float]:
    """What can vary of the foreground: a factor of speeds, and who enters by the clock when [s]."""
    users = [agent for agent in scene.agents if agent.role == "foreground"]
    parameters = {name_parameter("speed", agent): 1.0 for agent in users}
    late = [
        user for user in users if user.first > 0 and isinstance(_find_trigger(user, scene), str)
    ]
    return parameters | {name_parameter("start", each): float(each.times[0]) for each in late}


def name_parameter(what: str, agent: ExportedAgent) -> str:
    """The name of a parameter of an agent."""
    return f"{what}_{re.sub(r'[^A-Za-z0-9]', '_', agent.name)}"


def _scale_speed(agent: ExportedAgent, k: int) -> float | str:
    """The speed at a sample [m/s], of who matters times its parameter."""
    speed = _get_speed(agent, k)
    if agent.role != "foreground":
        return speed
    return f"${{{speed} * ${name_parameter('speed', agent)}}}"


def _get_speed(agent: ExportedAgent, k: int) -> float:
    return round(float(agent.speed[k]), 3)


def _refer_to_axle(agent: ExportedAgent) -> ExportedAgent:
    """The agent with the motion of its reference point, of a vehicle the rear axle."""
    ahead = np.stack([np.cos(agent.heading), np.sin(agent.heading)], axis=1)
    xy = agent.xy - _find_offset(agent) * ahead
    return replace(agent, xy=xy, velocity=differentiate(xy, agent.step))


def _find_offset(agent: ExportedAgent) -> float:
    """From the reference point ahead to the middle of the box [m]."""
    return 0.0 if agent.names.openscenario is None else REAR_AXLE * agent.length


def _add_road_network(root: _Element, scene: ExportedScene) -> None:
    """The map's file, and what every light shows from time to time."""
    network = add(root, "RoadNetwork")
    add(network, "LogicFile", filepath=f"{scene.name}.xodr")
    ids = number_signals(scene.intersection_map)
    lights = {name: row for name, row in scene.list_colours().items() if name in ids}
    if not lights:
        return
    signals = add(network, "TrafficSignals")
    controller = add(signals, "TrafficSignalController", name="signals")
    columns = list(zip(*lights.values(), strict=True))
    changes = [0, *(k for k in range(1, len(columns)) if columns[k] != columns[k - 1])]
    for a, b in pairwise([*changes, len(columns)]):
        duration = round((b - a) * scene.step, 3)
        phase = add(controller, "Phase", name=f"from {a * scene.step:.1f} s", duration=duration)
        for name, colour in zip(lights, columns[a], strict=True):
            add(phase, "TrafficSignalState", trafficSignalId=ids[name], state=colour or "off")


def _add_entity(entities: _Element, agent: ExportedAgent) -> None:
    thing = add(entities, "ScenarioObject", name=agent.name)
    length, width, category = agent.length, agent.width, agent.names.openscenario
    if category is None and agent.role == "object":
        body = add(thing, "MiscObject", name=agent.kind, mass=100.0, miscObjectCategory="obstacle")
    elif category is None:
        body = add(thing, "Pedestrian", name=agent.kind, mass=75.0, model=agent.kind,
                   pedestrianCategory="pedestrian")  # fmt: skip
    else:
        body = add(thing, "Vehicle", name=agent.kind, vehicleCategory=category)
    add(body, "ParameterDeclarations")
    box = add(body, "BoundingBox")
    add(box, "Center", x=_find_offset(agent), y=0.0, z=agent.height / 2)
    add(box, "Dimensions", width=width, length=length, height=agent.height)
    if category is not None:
        add(body, "Performance", maxSpeed=60.0, maxAcceleration=5.0, maxDeceleration=10.0)
        axles = add(body, "Axles")
        for name, at, steering in (("FrontAxle", 2 * REAR_AXLE, 0.6), ("RearAxle", 0.0, 0.0)):
            add(axles, name, maxSteering=steering, wheelDiameter=0.6, trackWidth=0.85 * width,
                positionX=at * length, positionZ=0.3)  # fmt: skip
    add(body, "Properties")


def _add_storyboard(root: _Element, scene: ExportedScene, form: str) -> None:
    board = add(root, "Storyboard")
    actions = add(add(board, "Init"), "Actions")
    daytime = add(add(add(actions, "GlobalAction"), "EnvironmentAction"), "Environment",
                  name="daytime")  # fmt: skip
    add(daytime, "TimeOfDay", animation=False, dateTime=_find_clock(scene))
    act = add(add(board, "Story", name="story"), "Act", name="act")
    roads = make_roads(scene.intersection_map)
    for agent in scene.agents:
        if scene.ego_named and agent.id == scene.ego.id:
            way = _find_way(agent, scene, roads)
            speed = _scale_speed(agent, 0) if form == "reactive" else _get_speed(agent, 0)
            start = _add_start(actions, agent, way, speed)
            _add_way(add(start, "PrivateAction"), agent, way)
        elif form == "reactive":
            _add_reactive_agent(actions, act, agent, scene, _find_way(agent, scene, roads))
        else:
            _add_replayed_agent(actions, act, agent, scene)
    for standing in scene.objects:
        if standing.first == 0:
            _add_start(actions, standing, [], _get_speed(standing, 0))
        elif form == "reactive":
            _add_maneuver(act, standing, float(standing.times[0]), [])
        else:  # with a track, as some players know no other way to come late
            _add_replayed_agent(actions, act, standing, scene)
    _add_time_trigger(add(act, "StartTrigger"), 0.0)
    end = round((scene.steps - 1) * scene.step, 3)
    _add_time_trigger(add(board, "StopTrigger"), end)


def _add_start(actions: _Element, agent: ExportedAgent, way: _Way, speed: float | str) -> _Element:
    """Place and speed at time 0; the element."""
    private = add(actions, "Private", entityRef=agent.name)
    _add_place(add(add(private, "PrivateAction"), "TeleportAction"), agent, way)
    _add_speed(add(private, "PrivateAction"), speed)
    return private


def _add_speed(action: _Element, speed: float | str) -> None:
    change = add(add(action, "LongitudinalAction"), "SpeedAction")
    add(change, "SpeedActionDynamics", dynamicsShape="step", dynamicsDimension="time", value=0.0)
    add(add(change, "SpeedActionTarget"), "AbsoluteTargetSpeed", value=speed)


def _enter_on_lane(agent: ExportedAgent, road: Road) -> ExportedAgent:
    """The agent from when its axle is on its lane; at the map's edge it enters before that."""
    on_lane = (k for k, xy in enumerate(agent.xy.tolist()) if road.locate(xy)[0] > 0.0)
    count = next(on_lane, 0)
    return replace(
        agent, first=agent.first + count, xy=agent.xy[count:], heading=agent.heading[count:],
        velocity=agent.velocity[count:],
    )  # fmt: skip


def _add_place(parent: _Element, agent: ExportedAgent, way: _Way) -> None:
    """Where an agent is first: on its lane, as lanes overlap in the junction, or in the world."""
    (x, y), road = agent.xy[0].tolist(), way[0][0] if way else None
    s, t, ahead = (0.0, 0.0, 0.0) if road is None else road.locate((x, y))
    if road is None or not 0.0 < s < road.s[-1]:
        _add_position(parent, agent.xy[0], float(agent.heading[0]))
        return
    middle = road.lane * float(np.interp(s, road.s, road.width)) / 2
    place = add(add(parent, "Position"), "LanePosition", roadId=road.number, laneId=road.lane,
                s=s, offset=t - middle)  # fmt: skip
    turn = float(wrap_angles(agent.heading[:1] - ahead)[0])
    add(place, "Orientation", type="relative", h=turn, p=0.0, r=0.0)


def _add_replayed_agent(
    actions: _Element, act: _Element, agent: ExportedAgent, scene: ExportedScene
) -> None:
    """An agent that follows its track; where no collision ends the track, it is then removed."""
    if agent.first == 0:
        _add_start(actions, agent, [], _get_speed(agent, 0))
    enters = float(agent.times[0])
    maneuver = _add_maneuver(act, agent, enters, [])
    action = _add_triggered_action(maneuver, f"follow {agent.name}", enters)
    collides = agent.id in scene.collided
    _add_trajectory(add(action, "PrivateAction"), agent, held=collides)
    if not collides and agent.last < scene.steps - 1:
        _add_removal(maneuver, agent, round(float(agent.times[-1]) + agent.step, 3))


def _add_reactive_agent(
    actions: _Element, act: _Element, agent: ExportedAgent, scene: ExportedScene, way: _Way
) -> None:
    """An agent with a route and a profile of speeds, removed at the route's end."""
    if way:
        agent = _enter_on_lane(agent, way[0][0])
    if agent.first == 0:
        _add_start(actions, agent, way, _scale_speed(agent, 0))
    trigger = _find_trigger(agent, scene)
    maneuver = _add_maneuver(act, agent, trigger, way)
    action = _add_triggered_action(maneuver, f"drive {agent.name}", trigger)
    _add_way(add(action, "PrivateAction"), agent, way)
    action = _add_triggered_action(maneuver, f"speed {agent.name}", trigger)
    _add_speed_profile(add(action, "PrivateAction"), agent, scene.step)
    end = np.array(way[-1][0].lanelet.centreline[-1]) if way else _follow_track(agent)[0][-1]
    _add_removal(maneuver, agent, _Arrival(agent.name, end, 0.0))
    _add_stop(maneuver, agent, scene)


def _add_speed_profile(action: _Element, agent: ExportedAgent, step: float) -> None:
    """The agent's speed every half second and at last, which stays after a track's end."""
    profile = add(add(action, "LongitudinalAction"), "SpeedProfileAction", followingMode="position")
    stride = max(round(SPEED_SPACING / step), 1)
    last = len(agent.xy) - 1
    for k in sorted({*range(0, last, stride), last}):
        wait = round(min(k, (k - 1) % stride + 1) * step, 3)
        add(profile, "SpeedProfileEntry", speed=_scale_speed(agent, k), time=wait)


def _add_maneuver(act: _Element, agent: ExportedAgent, trigger: _Trigger, way: _Way) -> _Element:
    """The place of an agent's events, of which the first adds it if it is there only later."""
    name = agent.name
    group = add(act, "ManeuverGroup", name=f"group {name}", maximumExecutionCount=1)
    actors = add(group, "Actors", selectTriggeringEntities=False)
    add(actors, "EntityRef", entityRef=name)
    maneuver = add(group, "Maneuver", name=f"maneuver {name}")
    if agent.first > 0:
        action = _add_triggered_action(maneuver, f"enter {name}", trigger)
        entity = add(add(action, "GlobalAction"), "EntityAction", entityRef=name)
        _add_place(add(entity, "AddEntityAction"), agent, way)
    return maneuver


def _find_trigger(agent: ExportedAgent, scene: ExportedScene) -> _Trigger:
    """Where the ego was when its partner in an event entered; others start by the clock."""
    pairs = [{event.from_, event.to} for event in scene.events]
    k = agent.first - scene.ego.first
    if {agent.id, scene.ego.id} in pairs and 0 < k < len(scene.ego.xy):
        # Who stands there, or creeps, is near it long before.
        near = np.hypot(*(scene.ego.xy[: k + 1] - scene.ego.xy[k]).T) <= TRIGGER_RADIUS
        wait = round((k - int(np.argmax(near))) * scene.step, 3)
        return _Arrival(scene.ego.name, np.asarray(scene.ego.xy[k]), wait)
    if agent.role == "foreground" and agent.first > 0:
        return f"${name_parameter('start', agent)}"
    return float(agent.times[0])


def _add_triggered_action(maneuver: _Element, name: str, trigger: _Trigger) -> _Element:
    """The action of a new event that has no other, with what triggers it."""
    event = add(maneuver, "Event", name=name, priority="parallel", maximumExecutionCount=1)
    action = add(event, "Action", name=f"action {name}")
    start = add(event, "StartTrigger")
    if isinstance(trigger, _Arrival):
        _add_place_trigger(start, *trigger)
    else:
        _add_time_trigger(start, trigger)
    return action


def _add_removal(maneuver: _Element, agent: ExportedAgent, trigger: _Trigger) -> None:
    """An event in which the agent has left the map and disappears."""
    action = _add_triggered_action(maneuver, f"leave {agent.name}", trigger)
    entity = add(add(action, "GlobalAction"), "EntityAction", entityRef=agent.name)
    add(entity, "DeleteEntityAction")


def _add_stop(maneuver: _Element, agent: ExportedAgent, scene: ExportedScene) -> None:
    """An event in which the last collision of an agent ends its way."""
    hits = [e for e in scene.events if e.type == "collision" and agent.id in (e.from_, e.to)]
    last = max(hits, key=lambda each: each.time or 0.0, default=None)
    names = {each.id: each.name for each in (*scene.agents, *scene.objects)}
    other = last and names.get((last.to if last.from_ == agent.id else last.from_) or 0)
    if not other:
        return
    event = add(maneuver, "Event", name=f"stop {agent.name}", priority="override",
                maximumExecutionCount=1)  # fmt: skip
    action = add(event, "Action", name=f"action stop {agent.name}")
    _add_speed(add(action, "PrivateAction"), 0.0)
    condition = _add_condition(add(event, "StartTrigger"), f"{agent.name} has hit {other}")
    by_entity = _add_entity_condition(condition, agent.name)
    add(add(by_entity, "CollisionCondition"), "EntityRef", entityRef=other)


def _add_trajectory(action: _Element, agent: ExportedAgent, *, held: bool) -> None:
    """The track; one that a collision ends is held for a step, so that no clock misses its end."""
    times, xy, heading = agent.times.tolist(), agent.xy, agent.heading
    if held:
        times = [*times, round(times[-1] + agent.step, 3)]
        xy, heading = np.concatenate([xy, xy[-1:]]), np.append(heading, heading[-1])
    reference = _add_line(action, f"track {agent.name}", xy, heading, times)
    add(reference, "Timing", domainAbsoluteRelative="absolute", scale=1.0, offset=0.0)


def _add_line(
    action: _Element, name: str, xy: FloatArray, heading: FloatArray, times: list[float] | None
) -> _Element:
    """A line to follow through places [n, 2]; the element that says whether its times count."""
    follow = add(add(action, "RoutingAction"), "FollowTrajectoryAction")
    path = add(add(follow, "TrajectoryRef"), "Trajectory", name=name, closed=False)
    add(path, "ParameterDeclarations")
    line = add(add(path, "Shape"), "Polyline")
    for k, (place, turn) in enumerate(zip(xy, heading.tolist(), strict=True)):
        vertex = add(line, "Vertex") if times is None else add(line, "Vertex", time=times[k])
        _add_position(vertex, place, turn)
    reference = add(follow, "TimeReference")
    add(follow, "TrajectoryFollowingMode", followingMode="position")
    return reference


def _find_way(agent: ExportedAgent, scene: ExportedScene, roads: _Roads) -> _Way:
    """Where it drives on lanes: its place, the lanes after that, and their end; else empty.

    Who takes part in an event keeps to its own line, unless it is left to the user.
    """
    (record,) = (each for each in scene.record.agents if each.id == agent.id)
    used = [m for m in scene.intersection_map.movements if record.route.endswith(m.id)]
    left_alone = scene.ego_named and agent.id == scene.ego.id
    if agent.id in scene.list_event_agents() and not left_alone:
        return []
    chains = [chain for way in used for chain in _list_chains(way.lanelets, roads)]
    if agent.type == "pedestrian" or not chains:
        return []
    lines = [_follow_track(_enter_on_lane(agent, chain[0]))[0] for chain in chains]
    apart = [_measure_distance(*each) for each in zip(lines, chains, strict=True)]
    if min(apart) > OFF_LANES:
        return []
    best = int(np.argmin(apart))
    line, chain = lines[best], chains[best]
    first = int(np.argmin([_measure_distance(line[:1], [road]) for road in chain]))
    start, *_ = chain[first].locate((float(line[0, 0]), float(line[0, 1])))
    end = float(chain[-1].s[-1]) - INSIDE
    middle = [(road, float(road.s[-1]) / 2) for road in chain[first + 1 : -1]]
    return [(chain[first], min(start, float(chain[first].s[-1]) - INSIDE)), *middle,
            (chain[-1], end)]  # fmt: skip


def _list_chains(lanelets: Sequence[str], roads: _Roads) -> list[list[Road]]:
    """Ways along lanelets, each from one that none of them leads to."""
    used = [name for name in lanelets if name in roads]
    led_to = {after for name in used for after in roads[name].lanelet.successors}
    chains = [[roads[name]] for name in used if name not in led_to]
    whole = []
    while chains:
        chain = chains.pop()
        after = [roads[name] for name in chain[-1].lanelet.successors if name in used]
        chains += [[*chain, each] for each in after]
        whole += [] if after else [chain]
    return whole


def _measure_distance(points: FloatArray, chain: Sequence[Road]) -> float:
    """Largest distance of points [n, 2] from the middle of some lanes [m]."""
    middle = np.concatenate([
        resample_by_spacing(np.array(road.lanelet.centreline), LINE_SPACING) for road in chain
    ])  # fmt: skip
    return float(measure_distances(points, middle).min(axis=1).max())


def _follow_track(agent: ExportedAgent) -> tuple[FloatArray, FloatArray]:
    """[n, 2] places of the track and of the intended route behind it, and [n] headings there.

    Two at least; who stands gets a place ahead.
    """
    arc = measure_arc_lengths(agent.xy)
    kept = np.unique(np.searchsorted(arc, np.append(np.arange(0, arc[-1], LINE_SPACING), arc[-1])))
    line = np.concatenate([agent.xy[kept], agent.route_ahead[1:]])
    courses = measure_courses(agent.route_ahead)
    heading = np.concatenate([agent.heading[kept], wrap_angles(courses)])
    if len(line) == 1:
        ahead = np.array([np.cos(heading[0]), np.sin(heading[0])])
        line, heading = np.stack([line[0], line[0] + INSIDE * ahead]), heading.repeat(2)
    return line, heading


def _add_way(action: _Element, agent: ExportedAgent, way: _Way) -> None:
    """The lanes to drive on, or the line to go along where there are none."""
    if not way:
        # A trajectory without times: where to go, not when.
        add(_add_line(action, f"way {agent.name}", *_follow_track(agent), None), "None")
        return
    route = add(add(add(action, "RoutingAction"), "AssignRouteAction"), "Route",
                name=f"route {agent.name}", closed=False)  # fmt: skip
    for road, s in way:
        waypoint = add(route, "Waypoint", routeStrategy="shortest")
        add(add(waypoint, "Position"), "LanePosition", roadId=road.number, laneId=road.lane,
            s=round(s, 3), offset=0.0)  # fmt: skip


def _add_position(parent: _Element, xy: FloatArray, heading: float | None) -> None:
    more: dict[str, Any] = {} if heading is None else {"h": heading, "p": 0.0, "r": 0.0}
    place = add(parent, "Position")
    add(place, "WorldPosition", x=float(xy[0]), y=float(xy[1]), z=0.0, **more)


def _add_time_trigger(trigger: _Element, time: float | str) -> None:
    condition = _add_condition(
        trigger, "at its time" if isinstance(time, str) else f"at {time:g} s"
    )
    value = add(condition, "ByValueCondition")
    add(value, "SimulationTimeCondition", value=time, rule="greaterOrEqual")


def _add_place_trigger(trigger: _Element, name: str, xy: FloatArray, wait: float) -> None:
    """So long after an agent gets there [s]."""
    condition = _add_entity_condition(_add_condition(trigger, f"{name} is there", wait), name)
    reach = add(condition, "ReachPositionCondition", tolerance=TRIGGER_RADIUS)
    _add_position(reach, xy, None)


def _add_entity_condition(condition: _Element, name: str) -> _Element:
    by_entity = add(condition, "ByEntityCondition")
    add(add(by_entity, "TriggeringEntities", triggeringEntitiesRule="any"), "EntityRef",
        entityRef=name)  # fmt: skip
    return add(by_entity, "EntityCondition")


def _add_condition(trigger: _Element, name: str, delay: float = 0.0) -> _Element:
    group = add(trigger, "ConditionGroup")
    return add(group, "Condition", name=name, delay=delay, conditionEdge="none")


def read(data: bytes, *, name: str) -> list[SampledRecording]:
    """The trajectories of all entities that have one.

    Vertices that are not evenly 0.1 s apart are resampled, as the standard defines the track
    between two vertices.

    Raises:
        InputError: no OpenSCENARIO, no trajectory, or one that is not in world positions.
    """
    root = parse_xml(data, name=name)
    if root.tag != "OpenSCENARIO":
        raise InputError(f"{name} is no OpenSCENARIO file: its root is {root.tag[:40]!r}")
    entities = {each.get("name", ""): each for each in root.iterfind("Entities/ScenarioObject")}
    found = []
    for group in root.iter("ManeuverGroup"):
        actors = [each.get("entityRef", "") for each in group.iterfind("Actors/EntityRef")]
        for event in group.iterfind("Maneuver/Event"):
            follow = event.find(_FOLLOW)
            if follow is not None:
                found += [_read_agent(entities.get(a), a, event, follow, name) for a in actors]
    if not found:
        raise InputError(f"{name} has no trajectories; routes and speeds cannot be checked")
    return [sort_out("", found)]


def _read_agent(
    entity: _Element | None, actor: str, event: _Element, follow: _Element, name: str
) -> tuple[str, AgentSamples | None]:
    """The word for what the entity is, and its samples if it is a road user."""
    if entity is None:
        raise InputError(f"{name}: no entity {actor[:40]!r}")
    # What the entity is in a word, and its element, where it is not in a catalogue.
    word, body = "object", None
    for part in entity:
        if part.tag in ("Vehicle", "Pedestrian"):
            animal = part.get("pedestrianCategory") == "animal"
            walks = "animal" if animal else "pedestrian"
            word = part.get("vehicleCategory", "") if part.tag == "Vehicle" else walks
            body = part
            break
        if part.tag == "CatalogReference":
            entry = part.get("entryName", "").replace("_", " ").split()
            word = next((each for each in entry if find_road_user(each)), "catalogue entry")
            break
    subtype = find_road_user(word)
    if subtype is None:
        return word, None
    t, places = _read_vertices(event, follow, f"{name}, {actor[:40]}")
    size = None if body is None else body.find("BoundingBox/Dimensions")
    middle = None if body is None else body.find("BoundingBox/Center")
    heading = places[:, 2] if np.isfinite(places[:, 2]).all() else None
    xy = places[:, :2]
    if middle is not None and heading is not None:
        x, y = (parse_number(middle.get(axis), name=name, what=axis) for axis in ("x", "y"))
        c, s = np.cos(heading), np.sin(heading)
        xy = xy + np.stack([c * x - s * y, s * x + c * y], axis=1)
    length, width = (
        None if size is None else parse_number(size.get(key), name=name, what=key)
        for key in ("length", "width")
    )
    agent = AgentSamples(actor, subtype, t, xy, heading, length, width)
    return word, resample_if_uneven(agent, STEP)


def _read_vertices(event: _Element, follow: _Element, name: str) -> tuple[FloatArray, FloatArray]:
    """[T] times [s] on the scenario's clock and [T, 3] x, y, heading (NaN where not stated)."""
    vertices = list(follow.iter("Vertex"))
    if not vertices:
        raise InputError(f"{name}: only trajectories as polylines can be checked")
    if any(vertex.get("time") is None for vertex in vertices):
        raise InputError(f"{name}: the trajectory has no times, so where it is when is open")
    rows = np.full((len(vertices), 3), np.nan)
    for row, vertex in zip(rows, vertices, strict=True):
        place = vertex.find("Position/WorldPosition")
        if place is None:
            raise InputError(f"{name}: only trajectories in world positions can be checked")
        for k, axis in enumerate(("x", "y", "h")):
            if axis != "h" or place.get("h") is not None:
                row[k] = parse_number(place.get(axis), name=name, what=axis)
    t = np.array([parse_number(vertex.get("time"), name=name, what="time") for vertex in vertices])
    timing = follow.find("TimeReference/Timing")
    if timing is None:
        raise InputError(f"{name}: the trajectory has no timing, so where it is when is open")
    scale, offset = (
        parse_number(timing.get(key, default), name=name, what=key)
        for key, default in (("scale", "1"), ("offset", "0"))
    )
    t = scale * t + offset
    if timing.get("domainAbsoluteRelative") != "absolute":
        trigger = event.find(_TIME)
        if trigger is None:
            raise InputError(f"{name}: it starts by a trigger other than time, so when is open")
        t = t + parse_number(trigger.get("value"), name=name, what="trigger")
    if (np.diff(t) <= 0).any():
        raise InputError(f"{name}: the times of the vertices do not rise")
    if len(t) > 2 and (rows[-1] == rows[-2]).all():
        before = np.hypot(*(rows[-2] - rows[-3])[:2]) / (t[-2] - t[-3])
        if before > _HELD_FROM:  # the last one only holds an agent whose track a collision ended
            return t[:-1], rows[:-1]
    return t, rows
