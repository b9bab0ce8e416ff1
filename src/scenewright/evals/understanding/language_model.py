"""The language model's part: it reads the scene in words and answers in names that exist."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, cast

import numpy as np
from pydantic import Field, create_model, model_validator

from scenewright.backends import Backend, Prompt, Question, Task
from scenewright.evals.understanding.cases import ObservedAgent, ObservedScene, PairRelation
from scenewright.evals.understanding.scoring import AGENT_CLASSES
from scenewright.intersections import load_map
from scenewright.nodes.ask import ask
from scenewright.scene.base import FloatArray, Model
from scenewright.scene.events import Event
from scenewright.scene.map import IntersectionMap

TASK: Task = "plan"
"""Where stages have backends of their own, the planner's answers."""
SYSTEM = """You watch a traffic intersection and say early what will happen.
You are told the map, the lights, who has been seen so far, where first and where now, and how they
move, what a statistical model thinks about where they leave, and what a rule checker finds in
predicted tracks.

Answer with one JSON object:
- "exits": for every agent the side of the map towards which it will eventually leave.
- "relations": every relation between two agents that you expect, often none:
  - "collision": they will touch; order does not matter.
  - "yielding": "from" slows down or stops to let "to" pass first, then goes on.
  - "near_miss": they pass within a second and a half of one another without touching.
Most agents have none. A red light is no yielding. Use only the names given."""


class _NamedRelation(Model):
    """A relation in names; the subclass made for a scene knows which."""

    type: Literal["collision", "yielding", "near_miss"]
    from_: str = Field(alias="from")
    to: str

    @model_validator(mode="after")
    def _check_distinct(self) -> _NamedRelation:
        if self.from_ == self.to:
            raise ValueError(f"{self.from_} cannot have a relation with itself")
        return self


def ask_about_scene(
    description: SceneDescription,
    sides: tuple[str, ...],
    backend: Backend,
    *,
    rejections: tuple[str, ...] = (),
) -> tuple[dict[str, str], tuple[PairRelation, ...]]:
    """Ask for exits and relations; the answer is in ids.

    Raises:
        Rejected: the reply names what does not exist or misses an agent.
        BackendFault: no answer can be had.
    """
    ids = {name: code for code, name in description.names.items()}
    names = tuple(ids)
    # The reply for this scene: agents and sides are enumerations of what exists.
    side: Any = Literal[sides]
    name: Any = Literal[names]
    fields: dict[str, Any] = dict.fromkeys(names, (side, ...))
    exits = create_model("Exits", __base__=Model, **fields)
    relation: Any = create_model(
        "Relation", __base__=_NamedRelation, from_=(name, Field(alias="from")), to=(name, ...)
    )
    model = create_model(
        "Reply", __base__=Model, exits=(exits, ...), relations=(tuple[relation, ...], ...)
    )
    refused = [
        f"Your earlier answer was refused: {rejection[:400]}" for rejection in rejections[-3:]
    ]
    user = "\n".join([description.text, *refused])
    question = Question(
        task=TASK,
        facts={"scene": description.text, "agents": list(names), "sides": list(sides)},
        rejections=rejections,
        seed=0,
        prompt=lambda: Prompt(SYSTEM, user, model.model_json_schema()),
    )
    reply = cast(Any, ask(backend, question, model, stage="scene_planner"))
    relations = [PairRelation(r.type, ids[r.from_], ids[r.to]) for r in reply.relations]
    distinct = tuple({each.key: each for each in relations}.values())
    return {ids[name]: str(getattr(reply.exits, name)) for name in names}, distinct


_SUBTYPES = ((3.0, "motorcycle"), (6.5, "car"), (10.0, "truck"), (99.0, "bus"))
_JUNCTION = 15.0
"""Within this of the middle on both axes [m] is the junction."""
_RELATION = {"collision": "a collision", "yielding": "giving way", "near_miss": "a near miss"}
_LIKELY = 0.05


@dataclass(frozen=True, eq=False)
class SceneDescription:
    """The prompt of a language model.

    Attributes:
        names: plain name by id, such as `vehicle-1`, in the order of the ids.
        text: the facts.
    """

    names: Mapping[str, str]
    text: str


def describe_scene(
    observation: ObservedScene,
    exits: Mapping[str, FloatArray],
    sides: tuple[str, ...],
    events: Sequence[Event],
    predictor: str,
) -> SceneDescription:
    """Describe a scene in words.

    Args:
        exits: of every agent, the probability of each side by the statistical model.
        events: findings of the rule checker in the tracks that `predictor` predicts.
    """
    intersection_map = load_map(observation.intersection)
    names = name_agents(observation)
    agents = (
        f"- {names[agent.id]}: {_describe_agent(agent, intersection_map)}; statistical model: "
        "leaves "
        + " or ".join(
            f"{sides[n]} {100 * exits[agent.id][n]:.0f} %"
            for n in np.argsort(-exits[agent.id])
            if exits[agent.id][n] > _LIKELY
        )
        for agent in observation.agents
    )
    last = {light.stop_line or light.crosswalk or "": light for light in observation.lights}
    states = [
        f"{name.replace(':', ' ')} {light.colour}"
        + (f" for {light.end - light.start:.0f} s" if light.start > 0 else "")
        for name, light in sorted(last.items())
    ]
    ids = observation.ids
    findings = [
        f"- close encounter of {names[ids[e.from_]]} and {names[ids[e.to]]} in "
        f"{max(e.time - observation.now, 0):.0f} s: {_RELATION[e.type]}"
        + (f" ({names[ids[e.from_]]} gives way)" if e.type == "yielding" else "")
        for e in events
    ]
    lines = [
        *_describe_map(intersection_map),
        *([f"Lights: {', '.join(states)}."] if states else []),
        f"Agents after {observation.now:g} s:",
        *agents,
        f"Rule checker on the tracks that {predictor} predicts:",
        *(findings or ["- no close encounter"]),
    ]
    return SceneDescription(names, "\n".join(lines))


def name_agents(observation: ObservedScene) -> dict[str, str]:
    """Name the agents by class, numbered in the order of their ids."""
    counts = dict.fromkeys(AGENT_CLASSES, 0)
    names = {}
    for agent in observation.agents:
        counts[agent.type] += 1
        names[agent.id] = f"{agent.type}-{counts[agent.type]}"
    return names


def _describe_map(intersection_map: IntersectionMap) -> list[str]:
    """Legs, movements, crosswalks and conflicting routes."""
    routes = ", ".join(f"{m.entry} to {m.exit} ({m.turn})" for m in intersection_map.movements)
    walks = ", ".join(
        f"the {c.leg} crosswalk between the {c.sides[0]} and the {c.sides[1]} side"
        for c in intersection_map.crosswalks
    )
    movements = {m.id: f"{m.entry} to {m.exit}" for m in intersection_map.movements}
    conflicts = sorted(
        " and ".join(
            movements.get(route, route.replace(":", " ")) for route in (zone.first, zone.second)
        )
        for zone in intersection_map.conflict_zones
    )
    legs = ", ".join(leg.name for leg in intersection_map.legs)
    return [
        f"Intersection: {intersection_map.title}, legs {legs}.",
        f"Vehicles go {routes}.",
        f"Pedestrians use {walks}.",
        f"Ways that cross or merge: {'; '.join(conflicts)}.",
    ]


def _describe_agent(agent: ObservedAgent, intersection_map: IntersectionMap) -> str:
    middle = float(np.abs(agent.xy[0]).max()) < _JUNCTION
    first = "in the junction" if middle else f"on the {_find_side(agent.xy[0])} side"
    kind: str = agent.type
    if kind == "vehicle":
        kind = next(n for m, n in _SUBTYPES if agent.length < m)
    if agent.left:
        return f"{kind}, first seen {first}, has left"
    speed = float(agent.speed[-1])
    before = float(agent.speed[-8:][0])
    change = "steady"
    if abs(speed - before) > 0.5:
        change = "speeding up" if speed > before else "slowing down"
    motion = f"{speed:.0f} m/s, {change}" if agent.is_vehicle else f"walking, {change}"
    if speed < 0.3:
        stood = agent.standstill
        motion = f"standing{f' for {stood:.0f} s' if stood >= 1.0 else ''}"
    # How near the junction, and where it faces.
    xy, heading = agent.xy[-1], float(agent.heading[-1])
    facing = _name_direction(heading)
    away = float(np.abs(xy).max())
    if away < _JUNCTION:
        place = "in or at the junction"
    elif float(xy @ np.array([np.cos(heading), np.sin(heading)])) >= 0:
        place = f"leaving on the {_find_side(xy)} leg"
    else:
        near = "near" if away < _JUNCTION + 12 else "far from"
        place = f"on the {_find_side(xy)} approach, {near} the stop line"
    for lane in intersection_map.lanelets if agent.type == "vehicle" else ():
        # The inner or outer lane, where an approach has two.
        if lane.kind == "approach" and lane.id.endswith((":inner", ":outer")):
            line, half = np.array(lane.centreline), lane.width / 2
            if ((xy >= line.min(axis=0) - half) & (xy <= line.max(axis=0) + half)).all():
                place += f", in the {lane.id.rsplit(':', 1)[1]} lane"
                break
    return f"{kind}, first seen {first}, now {place}, facing {facing}, {motion}"


def _find_side(xy: FloatArray) -> str:
    """The side of the map on which a point [m] lies."""
    return _name_direction(float(np.arctan2(xy[1], xy[0])))


def _name_direction(angle: float) -> str:
    """The nearest compass direction to an angle [rad], which counts from east to north."""
    return ("east", "north", "west", "south")[round(angle / (np.pi / 2)) % 4]
