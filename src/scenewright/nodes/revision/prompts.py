"""The question what words change, in words."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from scenewright.backends import Prompt
from scenewright.nodes.prompts import (
    describe_driving_side,
    format_json,
    format_rejections,
    quote_text,
    render_prompt,
)
from scenewright.nodes.revision.reply import build_edits_schema, list_new_ids
from scenewright.nodes.scene_planner.prompts import (
    describe_crosswalks,
    describe_manoeuvres,
    describe_order,
    describe_times,
    describe_vehicle_routes,
)
from scenewright.scene.edits import AgentView, Situation
from scenewright.scene.route_table import RouteDescription

_SAID = 400
_LISTED = {"vehicle": 6, "pedestrian": 2}
"""Background agents that are listed one by one, of each class; words name few of them."""


def render_edits_prompt(
    words: str,
    situation: Situation,
    *,
    before: str,
    ways: Sequence[RouteDescription],
    left_hand: bool = False,
    chosen: Mapping[str, str] | None = None,
    rejections: Sequence[str] = (),
) -> Prompt:
    """What a model is asked for edits, and the schema of its reply."""
    graph, others = situation.graph, _list_background(situation)
    front = situation.foreground
    relations = [
        relation.model_dump(mode="json", by_alias=True, exclude_none=True)
        for relation in graph.relations
    ]
    context = graph.context.model_dump(mode="json", exclude_none=True, exclude={"background"})
    values = {
        "ways": describe_vehicle_routes(ways),
        "traffic": describe_driving_side(left_hand),
        "crosswalks": describe_crosswalks(ways),
        "times": describe_times(words) + describe_manoeuvres(words) + describe_order(words),
        "agents": format_json({each.id: _describe_agent(each) for each in front}),
        "free": ", ".join(list_new_ids(situation, words)),
        "relations": format_json(relations),
        "context": f"Context: {format_json(context)}." if context else "",
        "others": _count_background(situation)
        + (f", such as {format_json(others)}" if others else ""),
        "before": quote_text(before, most=_SAID),
        "meant": f"Answered already: {format_json(dict(chosen))}\n" if chosen else "",
        "words": quote_text(words),
        "faults": format_rejections(rejections),
    }
    named = [each.id for each in front] + list(others)
    return render_prompt(
        "revision", "prompt.md", values, schema=build_edits_schema(situation, named, ways, words)
    )


def _describe_agent(agent: AgentView) -> str:
    """What distinguishes the agent, in a few words."""
    slows = "" if agent.slows_to is None else f", slows to {agent.slows_to:.1f} m/s"
    pace = f"{agent.speed:.1f} m/s{', stops' if agent.stops else slows}"
    if agent.type == "pedestrian":
        at = "jaywalking" if agent.crosswalk is None else f"on the {agent.crosswalk} crosswalk"
        return f"{at}, from {agent.entry} to {agent.exit}, {pace}"
    kind = agent.subtype or agent.type
    return f"{kind}, from {agent.entry}, {agent.movement} to {agent.exit}, {pace}"


def _list_background(situation: Situation) -> dict[str, str]:
    found: dict[str, str] = {}
    for kind in ("vehicle", "pedestrian"):
        here = [agent for agent in situation.background if agent.type == kind]
        for each in here[: _LISTED[kind]]:
            found[each.id] = (
                f"on the {each.crosswalk} crosswalk"
                if kind == "pedestrian"
                else f"{each.subtype or 'vehicle'}, {each.entry} to {each.exit}"
            )
    return found


def _count_background(situation: Situation) -> str:
    """How many others there are."""
    return ", ".join(f"{n} {kind}s" for kind, n in situation.count_background().items())
