"""Turns of a conversation that ask for a figure: "make it 10 m/s", "with a headway of 1 s"."""

from __future__ import annotations

import re
from collections.abc import Iterator

from scenewright.backends.builtin.draft import Refused
from scenewright.backends.builtin.reader.measures import parse_range
from scenewright.backends.builtin.reader.words import WORDS
from scenewright.backends.builtin.references import People
from scenewright.scene.edits import AgentView, SetMeasure, Situation
from scenewright.scene.measures import UNITS, Measure, MeasureKind
from scenewright.scene.social import RelationEdge

_KINDS: list[tuple[MeasureKind, str, str]] = WORDS["asked_figures"]["kinds"]

_SERVES: dict[str, tuple[str, ...]] = {
    "headway": ("follow",),
    "gap": ("follow",),
    "contact_speed": ("collide_at",),
}
_DIAL = re.compile(r"\b(?:driv|go|travel|mov|walk|run|speed|slow)\w*.*\b(?:at|to|with) \d")
"""Speeds to drive at are changed by a share of what they are."""

_WALKING = 3.0
"""The fastest pedestrian [m/s]."""

_RELATIVE = re.compile(r"\b(?:more|less|longer|shorter|later|earlier|sooner|further|closer|by)\b")


def read_figure(
    text: str, situation: Situation, people: People, agent: AgentView | None
) -> SetMeasure | None:
    """The figure that a turn asks for; None if it asks for none.

    Args:
        agent: the agent that the words name; None if none.

    Raises:
        Refused: a figure of what does not happen in the scene.
    """
    low = " ".join(text.lower().split())
    if _RELATIVE.search(low) or _DIAL.search(low):
        return None
    for kind, words, unit in _KINDS:
        found = parse_range(low, "", UNITS[kind].tolerance)
        if found is not None and found[2] == unit and re.search(words, low):
            first, second, _ = found
            name, other = _choose_ends(kind, situation, people, agent)
            walks = name.startswith("pedestrian") and unit == "m/s"
            most = _WALKING if walks else UNITS[kind].most
            high = most if second is None else min(second, most)
            if first > high:
                raise Refused("impossible", f"That is too much; ask for at most {most:g} {unit}.")
            return SetMeasure(
                measure=Measure(
                    kind=kind, agent=name, other=other, low=round(first, 4), high=round(high, 4)
                )
            )
    return None


def _choose_ends(
    kind: MeasureKind, situation: Situation, people: People, agent: AgentView | None
) -> tuple[str, str | None]:
    """The agent of the figure: the one named, or the only one that it can be of."""
    if not UNITS[kind].of_two:
        here = [each for each in people.list_foreground() if each.type == "vehicle"]
        return (agent or people.pick(here or people.list_foreground(), "vehicle")).id, None
    edges = list(_list_fitting(kind, situation, agent))
    if len(edges) != 1:
        raise Refused("impossible", f"Say between which two the {kind.replace('_', ' ')} is.")
    struck = kind == "side_point"
    edge = edges[0]
    return (edge.to, edge.from_) if struck else (edge.from_, edge.to)


def _list_fitting(
    kind: MeasureKind, situation: Situation, agent: AgentView | None
) -> Iterator[RelationEdge]:
    points = ("collide_at",) if "_point" in kind else None
    types = points or _SERVES.get(kind, ("collide_at", "near_miss", "yield_to", "follow"))
    for edge in situation.graph.relations:
        if edge.type in types and (agent is None or agent.id in (edge.from_, edge.to)):
            yield edge
