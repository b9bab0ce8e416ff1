"""The question what words change, in words."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from scenewright.backends import Wording
from scenewright.nodes.revision.reply import edits_schema, new_ids
from scenewright.nodes.scene_planner.wording import (
    crosswalks_told,
    manoeuvres_told,
    order_told,
    times_told,
    ways_told,
)
from scenewright.nodes.wording import compact, faults_told, quoted, traffic_told, worded
from scenewright.scene.edits import AgentView, Situation
from scenewright.scene.route_table import RouteDescription

_SAID = 400
_LISTED = {"vehicle": 6, "pedestrian": 2}
"""Others who are listed one by one, of each class; words name few of them."""


def worded_edits(
    words: str,
    situation: Situation,
    *,
    before: str,
    ways: Sequence[RouteDescription],
    left_hand: bool = False,
    chosen: Mapping[str, str] | None = None,
    rejections: Sequence[str] = (),
) -> Wording:
    """What a model is asked for edits, and the schema of its reply."""
    graph, others = situation.graph, _others(situation)
    front = [each for each in situation.present if each.role == "foreground"]
    relations = [
        each.model_dump(mode="json", by_alias=True, exclude_none=True) for each in graph.relations
    ]
    context = graph.context.model_dump(mode="json", exclude_none=True, exclude={"background"})
    values = {
        "ways": ways_told(ways),
        "traffic": traffic_told(left_hand),
        "crosswalks": crosswalks_told(ways),
        "times": times_told(words) + manoeuvres_told(words) + order_told(words),
        "agents": compact({each.id: _agent(each) for each in front}),
        "free": ", ".join(new_ids(situation, words)),
        "relations": compact(relations),
        "context": f"Context: {compact(context)}." if context else "",
        "others": _counted(situation) + (f", such as {compact(others)}" if others else ""),
        "before": quoted(before, most=_SAID),
        "meant": f"Answered already: {compact(dict(chosen))}\n" if chosen else "",
        "words": quoted(words),
        "faults": faults_told(rejections),
    }
    named = [each.id for each in front] + list(others)
    return worded(
        "revision", "prompt.md", values, schema=edits_schema(situation, named, ways, words)
    )


def _agent(agent: AgentView) -> str:
    """What tells it apart, in a few words."""
    pace = f"{agent.speed:.1f} m/s" + _held(agent)
    if agent.type == "pedestrian":
        at = "jaywalking" if agent.crosswalk is None else f"on the {agent.crosswalk} crosswalk"
        return f"{at}, from {agent.entry} to {agent.exit}, {pace}"
    kind = agent.subtype or agent.type
    return f"{kind}, from {agent.entry}, {agent.movement} to {agent.exit}, {pace}"


def _held(agent: AgentView) -> str:
    if agent.stops:
        return ", stops"
    return "" if agent.slows_to is None else f", slows to {agent.slows_to:.1f} m/s"


def _others(situation: Situation) -> dict[str, str]:
    found: dict[str, str] = {}
    for kind in ("vehicle", "pedestrian"):
        here = [e for e in situation.present if e.role == "background" and e.type == kind]
        for each in here[: _LISTED[kind]]:
            found[each.id] = (
                f"on the {each.crosswalk} crosswalk"
                if kind == "pedestrian"
                else f"{each.subtype or 'vehicle'}, {each.entry} to {each.exit}"
            )
    return found


def _counted(situation: Situation) -> str:
    """How many others there are."""
    back = [each.type for each in situation.present if each.role == "background"]
    return f"{back.count('vehicle')} vehicles, {back.count('pedestrian')} pedestrians"
