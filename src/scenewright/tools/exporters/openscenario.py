"""OpenSCENARIO 1.2 with the map as OpenDRIVE beside it, in two forms.

`replay` gives every agent its trajectory, vertex by vertex. `reactive` gives it a route, a profile
of speeds and a trigger, so that a simulator's own drivers can react; where an agent is to meet the
ego and enters after it, it sets off when the ego gets where it was at that moment.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Any
from xml.etree import ElementTree

import numpy as np

from scenewright.scene.base import FloatArray
from scenewright.tools.exporters.exported_scene import ExportedAgent, ExportedScene
from scenewright.tools.exporters.opendrive import number_signals, write_opendrive
from scenewright.tools.exporters.xml_writing import add, write_bytes

WAYPOINT_SPACING, SPEED_SPACING = 10.0, 1.0
"""Between waypoints of a route [m], and between entries of a speed profile [s]."""
TRIGGER_RADIUS = 2.0
"""How near the ego comes to the place that sets another agent off [m]."""

_Element = ElementTree.Element
_Place = tuple[str, FloatArray]
"""The ego's name and a point that it is to reach."""


def write_openscenario(scene: ExportedScene, *, form: str = "replay") -> dict[str, bytes]:
    """The .xosc and .xodr of a scene.

    An ego that the caller named gets its place, speed and route, and is left alone from then on;
    time 0 is then the moment at which it enters.
    """
    if scene.ego_named:
        scene = scene.begin_at_ego()
    root = ElementTree.Element("OpenSCENARIO")
    clock = f"2000-01-01T{scene.record.meta.time_of_day}:00"
    add(root, "FileHeader", revMajor=1, revMinor=2, date=clock, author="scenewright",
        description=scene.record.meta.user_prompt)  # fmt: skip
    add(root, "ParameterDeclarations")
    add(root, "CatalogLocations")
    _add_road_network(root, scene)
    entities = add(root, "Entities")
    for agent in (*scene.agents, *scene.objects):
        _add_entity(entities, agent)
    _add_storyboard(root, scene, form, clock)
    return {
        f"{scene.name}.xosc": write_bytes(root),
        f"{scene.name}.xodr": write_opendrive(scene.intersection_map),
    }


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
    add(box, "Center", x=0.0, y=0.0, z=agent.height / 2)
    add(box, "Dimensions", width=width, length=length, height=agent.height)
    if category is not None:
        add(body, "Performance", maxSpeed=60.0, maxAcceleration=5.0, maxDeceleration=10.0)
        axles = add(body, "Axles")
        for name, at, steering in (("FrontAxle", 0.3, 0.6), ("RearAxle", -0.3, 0.0)):
            add(axles, name, maxSteering=steering, wheelDiameter=0.6, trackWidth=0.85 * width,
                positionX=at * length, positionZ=0.3)  # fmt: skip
    add(body, "Properties")


def _add_storyboard(root: _Element, scene: ExportedScene, form: str, clock: str) -> None:
    board = add(root, "Storyboard")
    actions = add(add(board, "Init"), "Actions")
    daytime = add(add(add(actions, "GlobalAction"), "EnvironmentAction"), "Environment",
                  name="daytime")  # fmt: skip
    add(daytime, "TimeOfDay", animation=False, dateTime=clock)
    act = add(add(board, "Story", name="story"), "Act", name="act")
    for agent in scene.agents:
        left_alone = scene.ego_named and agent.id == scene.ego.id
        if agent.first == 0:
            _add_start(actions, agent, routed=left_alone)
        if not left_alone:
            _add_maneuvers(act, agent, scene, form)
    for standing in scene.objects:
        _add_start(actions, standing, routed=False)
    _add_time_trigger(add(act, "StartTrigger"), 0.0)
    end = round((scene.steps - 1) * scene.step, 3)
    _add_time_trigger(add(board, "StopTrigger"), end)


def _add_start(actions: _Element, agent: ExportedAgent, *, routed: bool) -> None:
    """Place and speed at time 0; of an ego that is left alone the route as well."""
    private = add(actions, "Private", entityRef=agent.name)
    teleport = add(add(private, "PrivateAction"), "TeleportAction")
    _add_position(teleport, agent.xy[0], float(agent.heading[0]))
    _add_speed(add(private, "PrivateAction"), float(agent.speed[0]))
    if routed:
        _add_route(add(private, "PrivateAction"), agent)


def _add_maneuvers(act: _Element, agent: ExportedAgent, scene: ExportedScene, form: str) -> None:
    name = agent.name
    group = add(act, "ManeuverGroup", name=f"group {name}", maximumExecutionCount=1)
    actors = add(group, "Actors", selectTriggeringEntities=False)
    add(actors, "EntityRef", entityRef=name)
    maneuver = add(group, "Maneuver", name=f"maneuver {name}")
    starter = None if form == "replay" else _find_starter(agent, scene)
    if agent.first > 0:
        event = _add_event(maneuver, f"enter {name}", agent, starter)
        entity = add(add(event, "GlobalAction"), "EntityAction", entityRef=name)
        _add_position(add(entity, "AddEntityAction"), agent.xy[0], float(agent.heading[0]))
    if form == "replay":
        event = _add_event(maneuver, f"follow {name}", agent, None)
        held = agent.id in scene.collided
        _add_trajectory(add(event, "PrivateAction"), agent, held=held)
        if agent.id not in scene.collided and agent.last < scene.steps - 1:
            _add_exit(maneuver, agent)
    else:
        event = _add_event(maneuver, f"drive {name}", agent, starter)
        _add_route(add(event, "PrivateAction"), agent)
        event = _add_event(maneuver, f"speed {name}", agent, starter)
        _add_speed_profile(add(event, "PrivateAction"), agent, scene)


def _find_starter(agent: ExportedAgent, scene: ExportedScene) -> _Place | None:
    """Where the ego was when its partner in an event entered; None: it starts by the clock."""
    pairs = [{event.from_, event.to} for event in scene.record.events]
    k = agent.first - scene.ego.first
    if {agent.id, scene.ego.id} not in pairs or not 0 < k < len(scene.ego.xy):
        return None
    return scene.ego.name, np.asarray(scene.ego.xy[k])


def _add_event(
    maneuver: _Element, name: str, agent: ExportedAgent, starter: _Place | None
) -> _Element:
    """An event with one action, triggered when the agent enters; its action."""
    event = add(maneuver, "Event", name=name, priority="parallel", maximumExecutionCount=1)
    action = add(event, "Action", name=f"action {name}")
    trigger = add(event, "StartTrigger")
    if starter is None:
        _add_time_trigger(trigger, float(agent.times[0]))
    else:
        _add_place_trigger(trigger, *starter)
    return action


def _add_exit(maneuver: _Element, agent: ExportedAgent) -> None:
    """The agent has left the map and disappears."""
    event = add(maneuver, "Event", name=f"leave {agent.name}", priority="parallel",
                maximumExecutionCount=1)  # fmt: skip
    action = add(event, "Action", name=f"action leave {agent.name}")
    entity = add(add(action, "GlobalAction"), "EntityAction", entityRef=agent.name)
    add(entity, "DeleteEntityAction")
    _add_time_trigger(add(event, "StartTrigger"), round(float(agent.times[-1]) + agent.step, 3))


def _add_trajectory(action: _Element, agent: ExportedAgent, *, held: bool) -> None:
    """The track; one that a collision ends is held for a step, so that no clock misses its end."""
    follow = add(add(action, "RoutingAction"), "FollowTrajectoryAction")
    reference = add(follow, "TrajectoryRef")
    path = add(reference, "Trajectory", name=f"track {agent.name}", closed=False)
    add(path, "ParameterDeclarations")
    line = add(add(path, "Shape"), "Polyline")
    for t, xy, heading in zip(agent.times.tolist(), agent.xy, agent.heading.tolist(), strict=True):
        _add_position(add(line, "Vertex", time=t), xy, heading)
    if held:
        vertex = add(line, "Vertex", time=round(float(agent.times[-1]) + agent.step, 3))
        _add_position(vertex, agent.xy[-1], float(agent.heading[-1]))
    timing = add(follow, "TimeReference")
    add(timing, "Timing", domainAbsoluteRelative="absolute", scale=1.0, offset=0.0)
    add(follow, "TrajectoryFollowingMode", followingMode="position")


def _add_route(action: _Element, agent: ExportedAgent) -> None:
    """Waypoints about 10 m apart along the track and the intended route behind it."""
    way = np.concatenate([agent.xy, agent.route_ahead[1:]])
    along = np.concatenate([[0.0], np.hypot(*np.diff(way, axis=0).T).cumsum()])
    count = max(round(along[-1] / WAYPOINT_SPACING), 1)
    route = add(add(add(action, "RoutingAction"), "AssignRouteAction"), "Route",
                name=f"route {agent.name}", closed=False)  # fmt: skip
    for at in np.linspace(0.0, along[-1], count + 1):
        point = np.array([np.interp(at, along, way[:, axis]) for axis in (0, 1)])
        _add_position(add(route, "Waypoint", routeStrategy="shortest"), point, None)


def _add_speed_profile(action: _Element, agent: ExportedAgent, scene: ExportedScene) -> None:
    """The agent's speed every second; after a collision's end of a track its last speed stays."""
    profile = add(add(action, "LongitudinalAction"), "SpeedProfileAction", followingMode="follow")
    stride = max(round(SPEED_SPACING / scene.step), 1)
    for k in range(0, len(agent.xy), stride):
        wait = 0.0 if k == 0 else stride * scene.step
        add(profile, "SpeedProfileEntry", speed=round(float(agent.speed[k]), 3), time=wait)


def _add_speed(action: _Element, speed: float) -> None:
    change = add(add(action, "LongitudinalAction"), "SpeedAction")
    add(change, "SpeedActionDynamics", dynamicsShape="step", dynamicsDimension="time", value=0.0)
    add(add(change, "SpeedActionTarget"), "AbsoluteTargetSpeed", value=round(speed, 3))


def _add_position(parent: _Element, xy: FloatArray, heading: float | None) -> None:
    more: dict[str, Any] = {} if heading is None else {"h": heading, "p": 0.0, "r": 0.0}
    place = add(parent, "Position")
    add(place, "WorldPosition", x=float(xy[0]), y=float(xy[1]), z=0.0, **more)


def _add_time_trigger(trigger: _Element, time: float) -> None:
    condition = _add_condition(trigger, f"at {time:g} s")
    value = add(condition, "ByValueCondition")
    add(value, "SimulationTimeCondition", value=time, rule="greaterOrEqual")


def _add_place_trigger(trigger: _Element, ego: str, xy: FloatArray) -> None:
    """When the ego gets there."""
    by_entity = add(_add_condition(trigger, f"{ego} is there"), "ByEntityCondition")
    add(add(by_entity, "TriggeringEntities", triggeringEntitiesRule="any"), "EntityRef",
        entityRef=ego)  # fmt: skip
    condition = add(by_entity, "EntityCondition")
    reach = add(condition, "ReachPositionCondition", tolerance=TRIGGER_RADIUS)
    _add_position(reach, xy, None)


def _add_condition(trigger: _Element, name: str) -> _Element:
    group = add(trigger, "ConditionGroup")
    return add(group, "Condition", name=name, delay=0.0, conditionEdge="none")
