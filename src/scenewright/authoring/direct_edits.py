"""Changes made by hand on a picture: what may be taken hold of, and the typed edits it becomes."""

from __future__ import annotations

from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, TypeAdapter, ValidationError

from scenewright.errors import InputError, describe_misfit
from scenewright.geometry.polyline import interpolate_points, measure_arc_lengths
from scenewright.scene.base import AgentId, Compass, Model, Movement
from scenewright.scene.edits import ChangeAgent, ComeLater, Edit, MoveStop, SetPace, WaitLonger
from scenewright.scene.frozen_agents import PreviousVersion
from scenewright.scene.map import IntersectionMap
from scenewright.scene.selection import SelectedAgent
from scenewright.scene.social import SocialGraph

REACH = 15.0
"""How far [m] a stop may be moved along its path, either way."""


class ChooseWay(Model):
    """An agent takes another way through the intersection."""

    edit: Literal["choose_way"] = "choose_way"
    agent: AgentId
    entry: Compass
    exit: Compass
    movement: Movement
    crosswalk: Compass | None = None


DirectEdit = Annotated[
    ChooseWay | MoveStop | WaitLonger | ComeLater | SetPace, Field(discriminator="edit")
]
_DIRECT: TypeAdapter[tuple[DirectEdit, ...]] = TypeAdapter(
    Annotated[tuple[DirectEdit, ...], Field(min_length=1, max_length=8)]
)


def read_direct_edits(asked: Any, graph: SocialGraph) -> tuple[tuple[Edit, ...], str]:
    """The typed edits of a change made by hand, and what it is in words.

    Args:
        asked: a list of objects as `DirectEdit` describes them.

    Raises:
        InputError: it is no such list, or names no agent of the graph.
    """
    try:
        edits = _DIRECT.validate_python(asked)
    except ValidationError as error:
        raise InputError(f"this is no change: {describe_misfit(error)}") from None
    typed: list[Edit] = []
    for edit in edits:
        if not isinstance(edit, ChooseWay):
            typed.append(edit)
            continue
        node = next((agent for agent in graph.agents if agent.id == edit.agent), None)
        if node is None:
            raise InputError(f"{edit.agent} does nothing in particular here, so its way is drawn")
        way = edit.model_dump(include={"entry", "exit", "movement", "crosswalk"})
        typed.append(ChangeAgent(node=node.model_copy(update=way)))
    return tuple(typed), "; ".join(_describe(edit) for edit in edits)


def _describe(edit: ChooseWay | Edit) -> str:
    match edit:
        case ChooseWay():
            over = f" over the {edit.crosswalk} crosswalk" if edit.crosswalk else ""
            return f"{edit.agent} goes from the {edit.entry} to the {edit.exit}{over}"
        case MoveStop():
            later = "later" if edit.metres > 0 else "earlier"
            return f"{edit.agent} stops {abs(edit.metres):g} m {later}"
        case WaitLonger():
            more = "longer" if edit.seconds > 0 else "less"
            return f"{edit.agent} waits {abs(edit.seconds):g} s {more}"
        case ComeLater():
            later = "later" if edit.seconds > 0 else "sooner"
            return f"{edit.agent} comes {abs(edit.seconds):g} s {later}"
        case SetPace():
            # The factor stands in the edit: of the words, tracks can show which of the two it is.
            return f"{edit.agent} drives {'slower' if edit.factor < 1 else 'faster'}"
    raise TypeError(f"{edit.edit} is not made by hand")


def list_handles(
    graph: SocialGraph, earlier: PreviousVersion, intersection_map: IntersectionMap
) -> list[dict[str, Any]]:
    """What can be changed by hand of every agent, as plain JSON values.

    `stop` is where it stands [m along `line`], with the stretch of its path that it may be dragged
    along; None for those that stand nowhere but at a red light, and for the background, which has
    no `ways` to choose from either.
    """
    named = {agent.id for agent in graph.agents}
    return [
        {
            "agent": name,
            "comes": round(each.agent.enters, 1),
            "stop": _describe_stop(each.agent) if name in named else None,
            "ways": _list_ways(each.agent, intersection_map) if name in named else [],
        }
        for name, each in earlier.agents.items()
    ]


def _describe_stop(agent: SelectedAgent) -> dict[str, Any] | None:
    stops = [stand for stand in agent.stands if stand.reason == "gives_way"] or agent.stands
    if not stops:
        return None
    stop, line = stops[0], agent.candidate.path.xy
    known = measure_arc_lengths(line)
    s = np.arange(max(stop.s - REACH, 2.0), min(stop.s + REACH, known[-1] - 1.0), 0.5)
    if not len(s):
        return None
    points = interpolate_points(s, known, line)
    return {"at": round(stop.s - float(s[0]), 2), "from": round(stop.start, 1),
            "until": round(stop.until, 1), "line": np.round(points, 2).tolist()}  # fmt: skip


def _list_ways(agent: SelectedAgent, intersection_map: IntersectionMap) -> list[dict[str, Any]]:
    """The ways through the intersection for a class, the present one marked."""
    now = agent.candidate.route
    ways = {
        (r.entry, r.exit, r.movement, r.crosswalk): r.id == now.id
        for r in sorted(intersection_map.routes, key=lambda r: r.id == now.id)
        if r.type == now.type
    }
    keys = ("entry", "exit", "movement", "crosswalk")
    return [{**dict(zip(keys, way, strict=True)), "now": here} for way, here in ways.items()]
