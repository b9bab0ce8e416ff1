"""What a modifier says, written onto the agents it belongs to."""

from __future__ import annotations

from collections.abc import Iterable

from scenewright.backends.builtin.coreference import OPPOSITE
from scenewright.backends.builtin.draft import AgentDraft, Refused
from scenewright.backends.builtin.grammar import Modifier
from scenewright.scene.base import RIDERS

VEHICLE_ONLY = frozenset({"turn", "uturn", "straight"})
PEDESTRIAN_ONLY = frozenset({"crosswalk", "on_crosswalk"})
IGNORED = frozenset({"axis", "corner"})
LEFT_OF_HEADING = {"north": "west", "east": "north", "south": "east", "west": "south"}


def attach(modifier: Modifier, agents: Iterable[AgentDraft], *, crossing: bool = False) -> None:
    """Write the modifier onto every agent it can hold for.

    Args:
        crossing: the sentence says that the pedestrian crosses, so a side names a crosswalk.
    """
    for agent in agents:
        _attach(modifier, agent, crossing=crossing)


def put(agent: AgentDraft, field: str, value: str) -> None:
    """Set one field; Refused where the text has said something else before."""
    old = getattr(agent, field)
    if (
        old is not None
        and old != value
        and field not in agent.edited
        and not _is_refinement(old, value)
    ):
        raise Refused(
            "contradictory",
            f"The {agent.type} would have both {field} {old} and {field} {value}; keep "
            "one of them.",
        )
    setattr(agent, field, value)
    agent.edited.discard(field)


def _is_refinement(old: str, value: str) -> bool:
    return {old, value} == {"crossing", "jaywalking"}


def _attach(modifier: Modifier, agent: AgentDraft, *, crossing: bool) -> None:
    means, values = modifier.means, modifier.values
    if agent.type == "pedestrian" and means in VEHICLE_ONLY:
        return
    if agent.type == "vehicle" and agent.subtype not in RIDERS and means in PEDESTRIAN_ONLY:
        return
    if means in {"from", "from_to", "cross_from_to"}:
        put(agent, "entry", values[0])
    if means in {"from_to", "cross_from_to"}:
        put(agent, "exit", values[1])
    if means in {"to", "head_to"}:
        _set_towards(modifier, agent)
    if means in {"bound", "cross_bound"}:
        _bound(modifier, agent)
    if means in {"turn", "uturn", "straight"}:
        put(agent, "movement", values[0] if values else means)
        agent.turned = means == "turn" and modifier.first not in {"left", "right"}
    if means in {"cross_bound", "cross_from_to", "on_crosswalk", "crosswalk"}:
        cross(agent)
    if means == "crosswalk":
        put(agent, "crosswalk", values[0])
        agent.marked = agent.marked or any(chunk.has("XWALK") for chunk in modifier.chunks)
    if means == "leg":
        _set_leg(modifier, agent, crossing=crossing)


def cross(agent: AgentDraft) -> None:
    """The pedestrian, or the rider on a crosswalk, crosses, unless it is known to jaywalk."""
    if (agent.type == "pedestrian" or agent.subtype in RIDERS) and agent.movement != "jaywalking":
        agent.movement = "crossing"


def _bound(modifier: Modifier, agent: AgentDraft) -> None:
    if agent.turned and modifier.chunks[0].words[0] not in {
        "from",
        "off",
        "northbound",
        "southbound",
        "eastbound",
        "westbound",
    }:
        put(agent, "exit", modifier.values[0])
    else:
        put(agent, "entry", OPPOSITE[modifier.values[0]])


def _set_towards(modifier: Modifier, agent: AgentDraft) -> None:
    heading = modifier.first in {"head", "heading", "headed", "heads", "bound", "facing"}
    if modifier.means == "head_to" and heading and not agent.turned:
        put(agent, "entry", OPPOSITE[modifier.values[0]])
        return
    toward = any(word.startswith("toward") for chunk in modifier.chunks for word in chunk.words)
    if toward and modifier.means == "head_to" and not agent.turned and agent.entry is None:
        put(agent, "entry", OPPOSITE[modifier.values[0]])
        return
    put(agent, "exit", modifier.values[0])


def _set_leg(modifier: Modifier, agent: AgentDraft, *, crossing: bool) -> None:
    named_leg = any(chunk.tags.get("LEG") == "leg" for chunk in modifier.chunks)
    if agent.type == "pedestrian":
        if named_leg or crossing:
            put(agent, "crosswalk", modifier.values[0])
            cross(agent)
    elif named_leg:
        put(agent, "entry", modifier.values[0])
