"""CommonRoad XML 2020a: lanelets, lights, the junction, obstacles, the ego's planning problem.

Written by hand, as commonroad-io needs an older protobuf than scenewright can have.
"""

from __future__ import annotations

from collections import defaultdict
from itertools import groupby
from xml.etree import ElementTree

import numpy as np

from scenewright.errors import InputError
from scenewright.scene.base import FloatArray
from scenewright.scene.map_elements import Lanelet
from scenewright.tools.formats.exported_scene import ExportedAgent, ExportedScene
from scenewright.tools.formats.lanes import (
    Side,
    find_crosswalk_edges,
    find_neighbours,
    list_predecessors,
)
from scenewright.tools.formats.sampled_recording import (
    AgentSamples,
    SampledRecording,
    find_road_user,
    sort_out,
)
from scenewright.tools.formats.xml import add, format_value, parse_number, parse_xml, write_bytes

LANELETS, LIGHTS, JUNCTION, PROBLEM = 10_001, 20_001, 30_001, 40_001
"""First number of each kind; obstacles have the agents' ids."""
GOAL_TOLERANCE = 5.0
"""Length and width of the goal region [m]."""
_KINDS = {"approach": "urban", "exit": "urban", "connector": "intersection", "parking": "parking"}
_TURNS = {"right": "successorsRight", "straight": "successorsStraight", "left": "successorsLeft"}
_ADJACENT: dict[Side, str] = {"left": "adjacentLeft", "right": "adjacentRight"}
_Element = ElementTree.Element
_STATE = ("time/exact", "position/point/x", "position/point/y", "orientation/exact")


def write(scene: ExportedScene) -> dict[str, bytes]:
    """The scene; an ego that the caller named is a planning problem instead of an obstacle.

    The scene then begins when the ego enters, as a planning problem begins at time step 0.
    """
    if scene.ego_named:
        scene = scene.begin_at_ego()
    place = "".join(c for c in scene.intersection_map.name.title() if c.isalnum())
    root = ElementTree.Element("commonRoad")
    head = {
        "commonRoadVersion": "2020a",
        "benchmarkID": f"ZAM_{place}-1_1_T-1",
        "date": "2000-01-01",
        "author": "scenewright",
        "affiliation": "",
        "source": f"scenewright: {scene.record.meta.user_prompt}",
        "timeStepSize": scene.step,
    }
    root.attrib.update({key: format_value(value) for key, value in head.items()})
    location = add(root, "location")
    for name, value in (("geoNameId", -999), ("gpsLatitude", 999), ("gpsLongitude", 999)):
        _add_text(location, name, value)
    tags = add(root, "scenarioTags")
    for name in ("urban", "intersection", "simulated"):
        add(tags, name)
    _add_map(root, scene)
    for standing in scene.objects:
        _add_obstacle(root, standing)
    for agent in scene.agents:
        if not (scene.ego_named and agent.id == scene.ego.id):
            _add_obstacle(root, agent)
    if scene.ego_named:
        _add_problem(root, scene)
    return {f"{scene.name}.cr.xml": write_bytes(root)}


def _add_map(root: _Element, scene: ExportedScene) -> None:
    """Lanelets, of crosswalks too; traffic lights; the junction."""
    intersection = scene.intersection_map
    lanelets = {each.id: LANELETS + k for k, each in enumerate(intersection.lanelets)}
    crossings = {
        each.id: LANELETS + len(lanelets) + k for k, each in enumerate(intersection.crosswalks)
    }
    lights = {name: LIGHTS + k for k, name in enumerate(scene.list_colours())}
    before, beside = list_predecessors(intersection), find_neighbours(intersection)
    for lanelet in intersection.lanelets:
        element = add(root, "lanelet", id=lanelets[lanelet.id])
        _add_points(add(element, "leftBound"), np.array(lanelet.left))
        _add_points(add(element, "rightBound"), np.array(lanelet.right))
        for name in before[lanelet.id]:
            add(element, "predecessor", ref=lanelets[name])
        for name in lanelet.successors:
            add(element, "successor", ref=lanelets[name])
        for side, tag in _ADJACENT.items():
            if (lanelet.id, side) in beside:
                name, same = beside[lanelet.id, side]
                add(element, tag, ref=lanelets[name], drivingDir="same" if same else "opposite")
        _add_rules(element, lanelet, lights, scene)
    for crosswalk in intersection.crosswalks:
        element = add(root, "lanelet", id=crossings[crosswalk.id])
        for tag, edge in zip(
            ("leftBound", "rightBound"), find_crosswalk_edges(crosswalk), strict=True
        ):
            _add_points(add(element, tag), edge)
        _add_text(element, "laneletType", "crosswalk")
        _add_text(element, "userBidirectional", "pedestrian")
        if crosswalk.id in lights:
            add(element, "trafficLightRef", ref=lights[crosswalk.id])
    for name, colours in scene.list_colours().items():
        # The colours of the scene as a cycle that lasts as long as the scene.
        cycle = add(add(root, "trafficLight", id=lights[name]), "cycle")
        for colour, steps in groupby(colours):
            element = add(cycle, "cycleElement")
            _add_text(element, "duration", len(list(steps)))
            _add_text(element, "color", colour or "inactive")
    _add_junction(root, scene, lanelets, crossings)


def _add_rules(
    element: _Element, lanelet: Lanelet, lights: dict[str, int], scene: ExportedScene
) -> None:
    """Stop line, kind, users and lights of a lanelet."""
    lines = [s for s in scene.intersection_map.stop_lines if lanelet.id in s.lanelets]
    shown = [lights[line.id] for line in lines if line.id in lights]
    if lines:
        stop = add(element, "stopLine")
        _add_text(stop, "lineMarking", "solid")
        for number in shown:
            add(stop, "trafficLightRef", ref=number)
    _add_text(element, "laneletType", _KINDS[lanelet.kind])
    _add_text(element, "userOneWay", "vehicle")
    for number in shown:
        add(element, "trafficLightRef", ref=number)


def _add_junction(
    root: _Element, scene: ExportedScene, lanelets: dict[str, int], crossings: dict[str, int]
) -> None:
    """Where each leg's approach leads by a right turn, straight on or by a left turn."""
    intersection = scene.intersection_map
    turns = {name: m.turn for m in intersection.movements for name in m.lanelets}
    approaches: dict[str, list[Lanelet]] = defaultdict(list)
    for lanelet in intersection.lanelets:
        if lanelet.kind == "approach":
            approaches[str(lanelet.leg)].append(lanelet)
    junction = add(root, "intersection", id=JUNCTION)
    for k, lanes in enumerate(approaches.values(), start=1):
        incoming = add(junction, "incoming", id=JUNCTION + k)
        for lane in lanes:
            add(incoming, "incomingLanelet", ref=lanelets[lane.id])
        ways = sorted({name for lane in lanes for name in lane.successors})
        for turn, tag in _TURNS.items():
            for name in ways:
                if turns.get(name) == turn:
                    add(incoming, tag, ref=lanelets[name])
    if crossings:
        crossing = add(junction, "crossing")
        for number in crossings.values():
            add(crossing, "crossingLanelet", ref=number)


def _add_obstacle(root: _Element, agent: ExportedAgent) -> None:
    """An agent or an object; what is there only later, as a door is, cannot be static."""
    stands = agent.role == "object" and agent.first == 0
    element = add(root, "staticObstacle" if stands else "dynamicObstacle", id=agent.id)
    parked = stands and agent.names.is_vehicle
    _add_text(element, "type", "parkedVehicle" if parked else agent.names.commonroad)
    shape = add(element, "shape")
    if agent.type == "pedestrian":
        _add_text(add(shape, "circle"), "radius", agent.length / 2)
    else:
        box = add(shape, "rectangle")
        _add_text(box, "length", agent.length)
        _add_text(box, "width", agent.width)
    _add_state(add(element, "initialState"), agent, 0, exact=False)
    if stands:
        return
    track = add(element, "trajectory")
    for k in range(1, len(agent.xy)):
        _add_state(add(track, "state"), agent, k, exact=False)


def _add_state(state: _Element, agent: ExportedAgent, k: int, *, exact: bool) -> None:
    """The state of an agent at its k-th sample; `exact` adds what a planning problem needs."""
    _add_points(add(state, "position"), agent.xy[k : k + 1])
    _add_exact(state, "orientation", float(agent.heading[k]))
    _add_exact(state, "time", agent.first + k)
    _add_exact(state, "velocity", float(agent.speed[k]))
    if exact:
        _add_exact(state, "yawRate", 0.0)
        _add_exact(state, "slipAngle", 0.0)


def _add_problem(root: _Element, scene: ExportedScene) -> None:
    """From where the ego enters to the end of its intended route, within the scene."""
    problem = add(root, "planningProblem", id=PROBLEM)
    _add_state(add(problem, "initialState"), scene.ego, 0, exact=True)
    goal = add(problem, "goalState")
    time = add(goal, "time")
    _add_text(time, "intervalStart", 1)
    _add_text(time, "intervalEnd", scene.steps - 1)
    route = np.concatenate([scene.ego.xy, scene.ego.route_ahead[1:]])
    end, before = route[-1], route[-min(len(route), 3)]
    box = add(add(goal, "position"), "rectangle")
    _add_text(box, "length", GOAL_TOLERANCE)
    _add_text(box, "width", GOAL_TOLERANCE)
    _add_text(box, "orientation", float(np.arctan2(*(end - before)[::-1])))
    _add_point(add(box, "center"), end)


def _add_points(parent: _Element, points: FloatArray) -> None:
    for point in points:
        _add_point(add(parent, "point"), point)


def _add_point(element: _Element, point: FloatArray) -> None:
    for name, value in zip("xy", point.tolist(), strict=True):
        _add_text(element, name, value)


def _add_exact(parent: _Element, name: str, value: float) -> None:
    _add_text(add(parent, name), "exact", value)


def _add_text(parent: _Element, name: str, value: object) -> None:
    """An element that holds a value; the schema's decimals know no exponents."""
    text = f"{value:.9f}" if isinstance(value, float) and "e" in repr(value) else value
    add(parent, name).text = format_value(text)


def read(data: bytes, *, name: str) -> list[SampledRecording]:
    """The dynamic obstacles that have trajectories; static ones are left out.

    Raises:
        InputError: a state that is not exact, a shape other than one rectangle or circle, or a
            prediction by sets of places.
    """
    root = parse_xml(data, name=name)
    step = parse_number(root.get("timeStepSize"), name=name, what="timeStepSize")
    found: list[tuple[str, AgentSamples | None]] = [
        (each.findtext("type") or "static obstacle", None) for each in root.iter("staticObstacle")
    ]
    for obstacle in root.iter("dynamicObstacle"):
        word = (obstacle.findtext("type") or "").strip()
        subtype = find_road_user(word)
        where = f"{name}, obstacle {obstacle.get('id', '')[:40]}"
        agent = None if subtype is None else _read_obstacle(obstacle, subtype, step, where)
        found.append((word, agent))
    return [sort_out("", found)]


def _read_obstacle(obstacle: _Element, subtype: str, step: float, name: str) -> AgentSamples:
    if obstacle.find("occupancySet") is not None:
        raise InputError(f"{name}: it is predicted by sets of places; only trajectories are read")
    shapes = list(obstacle.iterfind("shape/*"))
    if len(shapes) != 1 or shapes[0].tag not in ("rectangle", "circle"):
        raise InputError(f"{name}: only shapes of one rectangle or one circle can be read")
    shape = shapes[0]
    if float(shape.findtext("orientation") or 0.0):
        raise InputError(f"{name}: rectangles that are turned in their own frame cannot be read")
    if shape.tag == "circle":
        length = width = 2 * parse_number(shape.findtext("radius"), name=name, what="radius")
    else:
        length, width = (
            parse_number(shape.findtext(key), name=name, what=key) for key in ("length", "width")
        )
    rows = []
    for state in (obstacle.find("initialState"), *obstacle.iterfind("trajectory/state")):
        if state is None:
            continue
        if any(state.find(path) is None for path in _STATE):
            raise InputError(
                f"{name}: only states with exact time, place and orientation can be read"
            )
        rows.append([
            parse_number(state.findtext(path), name=name, what=path.split("/", maxsplit=1)[0])
            for path in _STATE
        ])  # fmt: skip
    if not rows:
        raise InputError(f"{name}: it has no states")
    t, x, y, heading = np.array(rows).T
    # The middle of the shape may lie beside the origin of the obstacle's own frame.
    ahead, left = (float(shape.findtext(f"center/{axis}") or 0.0) for axis in ("x", "y"))
    c, s = np.cos(heading), np.sin(heading)
    xy = np.stack([x + (c * ahead - s * left), y + (s * ahead + c * left)], axis=1)
    return AgentSamples(obstacle.get("id", ""), subtype, t * step, xy, heading, length, width)
