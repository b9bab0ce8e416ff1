"""Turns of a conversation that ask for a figure: "make it 10 m/s", "with a headway of 1 s"."""

from __future__ import annotations

import re

from scenewright.backends.builtin.draft import Refused
from scenewright.backends.builtin.reader.asked_numbers import list_measured_relations
from scenewright.backends.builtin.reader.measures import parse_range
from scenewright.backends.builtin.reader.words import WORDS, Patterns
from scenewright.backends.builtin.references import People
from scenewright.scene.edits import AgentView, SetMeasure, Situation
from scenewright.scene.measures import UNITS, Measure, MeasureKind

_PATTERNS = Patterns("asked_figures")

_KINDS: list[tuple[MeasureKind, str]] = WORDS["asked_figures"]["kinds"]


_WALKING = 3.0
"""The fastest pedestrian [m/s]."""


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
    if _PATTERNS.relative.search(low) or _PATTERNS.dial.search(low):
        return None
    for kind, words in _KINDS:
        found, unit = parse_range(low, "", UNITS[kind].tolerance), UNITS[kind].unit
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
    types = list_measured_relations(kind)
    edges = [edge for edge in situation.graph.relations if edge.type in types]
    edges = [edge for edge in edges if agent is None or agent.id in edge.pair]
    if len(edges) != 1:
        raise Refused("impossible", f"Say between which two the {kind.replace('_', ' ')} is.")
    struck = kind == "side_point"
    return (edges[0].to, edges[0].from_) if struck else (edges[0].from_, edges[0].to)
