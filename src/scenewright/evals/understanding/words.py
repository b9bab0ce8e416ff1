"""A scene in words for a language model: entrances, map features and findings, no coordinates."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from scenewright.evals.understanding.observing import Observation, Seen
from scenewright.intersections import load_map
from scenewright.scene.base import FloatArray
from scenewright.scene.events import Event
from scenewright.scene.map import IntersectionMap

_SUBTYPES = ((3.0, "motorcycle"), (6.5, "car"), (10.0, "truck"), (99.0, "bus"))
_JUNCTION = 15.0
"""Within this of the middle on both axes [m] is the junction."""
_RELATION = {"collision": "a collision", "yielding": "giving way", "near_miss": "a near miss"}
_LIKELY = 0.05


@dataclass(frozen=True, eq=False)
class Description:
    """What a language model is told.

    Attributes:
        names: plain name by code, such as `vehicle-1`, in the order of the codes.
        text: the facts.
    """

    names: Mapping[str, str]
    text: str


def describe(
    observation: Observation,
    exits: Mapping[str, FloatArray],
    sides: tuple[str, ...],
    events: Sequence[Event],
    predictor: str,
) -> Description:
    """The scene in words.

    Args:
        exits: of every agent, how likely each side is by the statistical model.
        events: what the rule checker finds in the predicted tracks.
    """
    intersection_map = load_map(observation.intersection)
    names = names_of(observation)
    lines = [
        *map_lines(intersection_map),
        *_lights(observation),
        f"Agents after {observation.now:g} s:",
        *(
            f"- {names[agent.id]}: {_agent(agent, intersection_map)}; statistical model: "
            f"{_chances(exits[agent.id], sides)}"
            for agent in observation.agents
        ),
        f"Rule checker on the tracks that {predictor} predicts:",
        *(_findings(events, observation, names) or ["- no close encounter"]),
    ]
    return Description(names, "\n".join(lines))


def names_of(observation: Observation) -> dict[str, str]:
    """Plain names, numbered in the order of the codes."""
    counts = {"vehicle": 0, "pedestrian": 0}
    names = {}
    for agent in observation.agents:
        counts[agent.type] += 1
        names[agent.id] = f"{agent.type}-{counts[agent.type]}"
    return names


def map_lines(intersection_map: IntersectionMap) -> list[str]:
    """Legs, movements, crosswalks and what crosses what."""
    ways = ", ".join(f"{m.entry} to {m.exit} ({m.turn})" for m in intersection_map.movements)
    walks = ", ".join(
        f"the {c.leg} crosswalk between the {c.sides[0]} and the {c.sides[1]} side"
        for c in intersection_map.crosswalks
    )
    clashes = sorted(
        f"{_way(zone.first, intersection_map)} and {_way(zone.second, intersection_map)}"
        for zone in intersection_map.conflict_zones
    )
    legs = ", ".join(leg.name for leg in intersection_map.legs)
    return [
        f"Intersection: {intersection_map.title}, legs {legs}.",
        f"Vehicles go {ways}.",
        f"Pedestrians use {walks}.",
        f"Ways that cross or merge: {'; '.join(clashes)}.",
    ]


def _way(name: str, intersection_map: IntersectionMap) -> str:
    for movement in intersection_map.movements:
        if movement.id == name:
            return f"{movement.entry} to {movement.exit}"
    return name.replace(":", " ")


def _lights(observation: Observation) -> list[str]:
    last = {}
    for light in observation.lights:
        last[light.stop_line or light.crosswalk or ""] = light
    told = [
        f"{name.replace(':', ' ')} {light.colour}"
        + (f" for {light.end - light.start:.0f} s" if light.start > 0 else "")
        for name, light in sorted(last.items())
    ]
    return [f"Lights: {', '.join(told)}."] if told else []


def _agent(agent: Seen, intersection_map: IntersectionMap) -> str:
    side = _side(agent.xy[0])
    kind = "pedestrian" if not agent.vehicle else next(n for m, n in _SUBTYPES if agent.length < m)
    if agent.left:
        return f"{kind}, came from the {side}, has left"
    return f"{kind}, came from the {side}, {_where(agent, intersection_map)}, {_motion(agent)}"


def _side(xy: FloatArray) -> str:
    x, y = float(xy[0]), float(xy[1])
    if abs(x) > abs(y):
        return "east" if x > 0 else "west"
    return "north" if y > 0 else "south"


def _where(agent: Seen, intersection_map: IntersectionMap) -> str:
    """In words: how near the junction, and where it faces."""
    xy, heading = agent.xy[-1], float(agent.heading[-1])
    facing = ("east", "north", "west", "south")[round(heading / (np.pi / 2)) % 4]
    middle = float(np.abs(xy).max())
    inwards = float(xy @ np.array([np.cos(heading), np.sin(heading)])) < 0
    if middle < _JUNCTION:
        place = "in or at the junction"
    elif not inwards:
        place = f"leaving on the {_side(xy)} leg"
    else:
        near = "near" if middle < _JUNCTION + 12 else "far from"
        place = f"on the {_side(xy)} approach, {near} the stop line"
    lane = _lane(agent, intersection_map)
    return f"{place}{f', in the {lane} lane' if lane else ''}, facing {facing}"


def _lane(agent: Seen, intersection_map: IntersectionMap) -> str | None:
    """The inner or outer lane, where an approach has two."""
    if not agent.vehicle:
        return None
    for lanelet in intersection_map.lanelets:
        if lanelet.kind == "approach" and lanelet.id.endswith((":inner", ":outer")):
            line = np.array(lanelet.centreline)
            low, high = line.min(axis=0) - lanelet.width / 2, line.max(axis=0) + lanelet.width / 2
            if bool(((agent.xy[-1] >= low) & (agent.xy[-1] <= high)).all()):
                return lanelet.id.rsplit(":", 1)[1]
    return None


def _motion(agent: Seen) -> str:
    speed = float(agent.speed[-1])
    if speed < 0.3:
        stood = int(np.argmax(agent.speed[::-1] >= 0.3)) if (agent.speed >= 0.3).any() else 0
        return f"standing{f' for {stood / 10:.0f} s' if stood >= 10 else ''}"
    before = float(agent.speed[-min(len(agent.speed), 8)])
    change = "steady"
    if abs(speed - before) > 0.5:
        change = "speeding up" if speed > before else "slowing down"
    return f"{speed:.0f} m/s, {change}" if agent.vehicle else f"walking, {change}"


def _chances(likely: FloatArray, sides: tuple[str, ...]) -> str:
    order = np.argsort(-likely)
    told = [f"{sides[n]} {100 * likely[n]:.0f} %" for n in order if likely[n] > _LIKELY]
    return "leaves " + " or ".join(told)


def _findings(
    events: Sequence[Event], observation: Observation, names: Mapping[str, str]
) -> list[str]:
    ids = observation.ids
    return [
        f"- close encounter of {names[ids[e.from_]]} and {names[ids[e.to]]} in "
        f"{max(e.time - observation.now, 0):.0f} s: {_RELATION[e.type]}"
        + (f" ({names[ids[e.from_]]} gives way)" if e.type == "yielding" else "")
        for e in events
    ]
