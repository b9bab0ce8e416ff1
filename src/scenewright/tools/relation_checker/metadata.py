"""What a scene says of itself as a whole and of its agents, held against itself and the map."""

from __future__ import annotations

import re
from collections.abc import Container, Iterator

from scenewright.scene.events import EVENT_OF_RELATION, Finding
from scenewright.scene.map import IntersectionMap
from scenewright.scene.objects import OBJECT_SIZES, ObjectRecord
from scenewright.scene.record import AgentRecord, SceneRecord
from scenewright.scene.track import VEHICLE_SIZES
from scenewright.tools.relation_checker.plausibility import SIZE

RUNNERS = ("running", "runner")
"""Subtypes of pedestrians."""
_CLOCK = re.compile(r"([01]\d|2[0-3]):([0-5]\d)")
_SEEN_OVER = frozenset({"bin", "door", "motorcycle"})
"""Kinds and subtypes of objects that do not block the view."""
_CUT = "…"
"""Stands in a prompt for words of a long conversation that were left out."""


def find_false_metadata(
    scene: SceneRecord, intersection_map: IntersectionMap | None
) -> tuple[Finding, ...]:
    """What contradicts the map, or another part of the same file."""
    named = {number for entry in scene.said for number in entry.agents}
    bound = named.union(*({each.from_, each.to} for each in scene.relations))
    rows = (
        *(((), detail) for detail in _check_meta(scene, intersection_map)),
        *(((each.id,), detail) for each in scene.agents for detail in _check_agent(each, bound)),
        *(((), detail) for each in scene.objects for detail in _check_object(each)),
        *_check_names(scene),
        *_check_relations_said(scene),
    )
    return tuple(
        Finding(rule="metadata_contradicted", agents=agents, detail=detail)
        for agents, detail in rows
    )


def _check_meta(scene: SceneRecord, intersection_map: IntersectionMap | None) -> Iterator[str]:
    """The map and the time are those named; the account's words stand where it has them."""
    if intersection_map is not None and scene.meta.map_id != intersection_map.map_id:
        yield (
            f"map_id is {scene.meta.map_id}; that of {intersection_map.name} is "
            f"{intersection_map.map_id}"
        )
    time = _CLOCK.fullmatch(scene.meta.time_of_day)
    if time is None:
        yield f"time_of_day {scene.meta.time_of_day!r} is no time such as 08:00"
    elif not 0.0 <= scene.meta.timestamp - 3600 * int(time[1]) - 60 * int(time[2]) < 60.0:
        yield (
            f"timestamp {scene.meta.timestamp:g} s after midnight is not at "
            f"{scene.meta.time_of_day}"
        )
    prompt = scene.meta.user_prompt
    for entry in scene.said if _CUT not in prompt else ():
        if entry.end and prompt[entry.start : entry.end].casefold() != entry.words.casefold():
            yield f"the instruction does not say {entry.words!r} where the account has it"


def _check_agent(agent: AgentRecord, bound: Container[int]) -> Iterator[str]:
    if agent.role == "background" and agent.id in bound:
        yield f"{agent.type} {agent.id} was asked for and is called background"
    if not re.fullmatch(rf"{agent.type}-[1-9]\d*", agent.name):
        yield f"{agent.type} {agent.id} has the name {agent.name!r}, not one like {agent.type}-1"
    known = {"pedestrian": RUNNERS, "vehicle": VEHICLE_SIZES}.get(agent.type, ())
    if agent.subtype is not None and agent.subtype not in known:
        yield f"there is no {agent.type} of the subtype {agent.subtype!r}"


def _check_object(each: ObjectRecord) -> Iterator[str]:
    """An object has about the size of its kind, and blocks the view as its kind does."""
    if each.kind in OBJECT_SIZES:
        sizes = [OBJECT_SIZES[each.kind]]
    elif each.subtype is None:
        sizes = list(VEHICLE_SIZES.values())
    else:
        sizes = [size for name, size in VEHICLE_SIZES.items() if name == each.subtype]
    ratios = [(each.length / length, each.width / width) for length, width in sizes]
    if not any(max(abs(a - 1), abs(b - 1)) <= SIZE for a, b in ratios):
        what = f"{each.kind} {each.subtype or ''}".strip()
        yield f"{each.id}, a {what}, measures {each.length:g} x {each.width:g} m"
    if (each.height == "low") != bool(_SEEN_OVER & {each.kind, each.subtype}):
        yield f"{each.id}, a {each.subtype or each.kind}, is not {each.height}"


def _check_names(scene: SceneRecord) -> Iterator[tuple[tuple[int, ...], str]]:
    first: dict[str, int] = {}
    for agent in scene.agents:
        other = first.setdefault(agent.name, agent.id)
        if other != agent.id:
            detail = f"agents {other} and {agent.id} have the same name {agent.name!r}"
            yield (other, agent.id), detail


def _check_relations_said(scene: SceneRecord) -> Iterator[tuple[tuple[int, ...], str]]:
    """A relation that the account says was asked for stands among the relations."""
    asked = {(each.type, frozenset((each.from_, each.to))) for each in scene.relations}
    for entry in scene.said:
        event = EVENT_OF_RELATION.get(entry.value or "")
        if entry.became != "relation" or event is None:
            continue
        if (event, frozenset(entry.agents)) not in asked:
            detail = f"'{entry.words}' asks for {event}; relations has none of these agents"
            yield entry.agents, detail
