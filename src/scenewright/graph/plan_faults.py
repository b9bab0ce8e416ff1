"""Why a plan cannot be bound to a map, with the line and the field at fault."""

from __future__ import annotations

from contextlib import suppress

from scenewright.errors import Rejected
from scenewright.graph.arguments import DEFAULT_INTERSECTION
from scenewright.intersections import load_map
from scenewright.scene.kinds import list_values
from scenewright.scene.map import IntersectionMap
from scenewright.scene.plan_file import PlanFault, PlanFile
from scenewright.scene.social import AgentNode, SocialGraph
from scenewright.tools.map_grounding.grounding import ground_graph


def check_plan(given: PlanFile, *, intersection: str = DEFAULT_INTERSECTION) -> None:
    """Bind a plan to a map.

    Raises:
        InputError: no such map; or it has no way for an agent, which names line and field.
    """
    place = load_map(intersection)
    try:
        ground_graph(given.plan, intersection_map=place)
    except Rejected as error:
        agents, what = error.rejection.agents, error.rejection.detail
        faults: dict[tuple[str | int, ...], str] = {}
        for n, node in enumerate(given.plan.agents):
            own = what if agents == (node.id,) else None
            try:
                ground_graph(SocialGraph(agents=(node,)), intersection_map=place)
            except Rejected as alone:
                own = alone.rejection.detail
            if own is not None:
                name, advice = _find_blocking_field(node, place)
                faults["agents", n, *name] = own + advice
        entries = [
            *(("objects", n) for n, each in enumerate(given.plan.objects)
              if what.startswith(f"{each.id}:")),
            *(("relations", n) for n, edge in enumerate(given.plan.relations)
              if set(agents) == {edge.from_, edge.to}),
        ]  # fmt: skip
        raise PlanFault(given.name, given.lines, faults or {(*entries, ())[0]: what}) from error


def _find_blocking_field(node: AgentNode, place: IntersectionMap) -> tuple[tuple[str, ...], str]:
    """The field without which an agent has a way, and what would do; both empty if none has."""

    def has_way(name: str, value: object) -> bool:
        with suppress(Rejected):
            alone = SocialGraph(agents=(node.model_copy(update={name: value}),))
            return bool(ground_graph(alone, intersection_map=place))
        return False

    for name in ("movement", "crosswalk", "exit", "entry"):
        if getattr(node, name) is not None and has_way(name, None):
            known = list_values([AgentNode.model_fields[name].annotation])
            fitting = ", ".join(each for each in known if has_way(name, each))
            return (name,), f"; {f'there is one with {fitting}' if fitting else 'leave it out'}"
    return (), ""
