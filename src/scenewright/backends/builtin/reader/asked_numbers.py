"""Numbers with a unit, as figures that the plan asks for (SEMANTICS 8)."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from typing import get_args

from scenewright.backends.builtin.draft import (
    AgentDraft,
    Draft,
    MeasureDraft,
    Refused,
    RelationDraft,
)
from scenewright.backends.builtin.reader.annotation import EVENTS, MENTIONS
from scenewright.backends.builtin.reader.measures import parse_range
from scenewright.backends.builtin.reader.reading import ReadSpan
from scenewright.backends.builtin.reader.words import Patterns
from scenewright.scene.kinds import has_trait
from scenewright.scene.measures import MOST_OF_CLASS, UNITS, MeasureKind
from scenewright.scene.social import RelationType

_PATTERNS = Patterns("asked_numbers")

NUMBERS = ("speed", "headway", "gap", "dist", "wait", "when", "decel", "accel", "point")
"""Tags whose words give a figure."""

_KIND_OF: dict[str, MeasureKind] = {
    "speed": "speed", "headway": "headway", "gap": "gap", "dist": "line_distance", "wait": "wait",
    "when": "time", "decel": "braking", "accel": "acceleration", "point": "front_point",
    "pet": "pet", "ttc": "ttc", "impact": "contact_speed",
}  # fmt: skip
_MOST = MOST_OF_CLASS | {
    "vehicle": {"braking": 8.0},
    "pedestrian": MOST_OF_CLASS["pedestrian"] | {"speed": 3.0, "line_speed": 3.0},
}
"""The most that words ask of a class; a plan file may have people run faster."""

_PACES: dict[str, tuple[tuple[float, float], tuple[float, float]]] = {
    "vehicle": ((2.5, 6.5), (11.7, 16.0)),
    "pedestrian": ((0.6, 1.15), (2.05, 3.0)),
    "cyclist": ((1.8, 4.0), (6.4, 9.0)),
    "scooter": ((1.8, 3.6), (5.5, 7.0)),
}
"""Kept speeds of slow and of fast agents of a class [m/s]; a fast vehicle exceeds 25 mph."""

_EVENTS_OF: dict[str, tuple[RelationType, ...]] = {
    "headway": ("follow",),
    "gap": ("follow",),
    "contact_speed": ("collide_at",),
    "pet": ("near_miss", "yield_to"),
    "ttc": ("near_miss",),
}
"""Relations whose figure a kind is; any, where it is not here."""


def list_measured_relations(kind: MeasureKind) -> tuple[RelationType, ...]:
    """The relations that have such a figure."""
    if "_point" in kind:
        return ("collide_at",)
    return _EVENTS_OF.get(kind, get_args(RelationType))


_SEVERITY = ("contact_speed", "pet", "ttc")
"""Kinds for which a relation has a field of its own, where the text gives a plain number."""

_NEAR = 26
"""Characters before and after a figure in which words belong to it."""


@dataclass(frozen=True)
class AskedNumber:
    """What one span asks for; `severity` names a figure that a relation has a field for."""

    measures: tuple[MeasureDraft, ...] = ()
    severity: tuple[str, float] | None = None


def read_number(
    span: ReadSpan, text: str, draft: Draft, users: dict[int, AgentDraft], spans: Sequence[ReadSpan]
) -> AskedNumber | None:
    """What the words of a span ask for; None where they give no figure that a scene can have.

    Args:
        spans: all spans of the text, in order.

    Raises:
        Refused: a figure that no scene can have, with the most that it can.
    """
    if span.tag not in _KIND_OF:
        timed = [measure.agent for measure in draft.measures if measure.kind == "speed"]
        agents = (users[n] for n in span.subjects if n in users and users[n] not in timed)
        fast = bool(_PATTERNS.fast.search(span.words))
        return AskedNumber(
            tuple(MeasureDraft("speed", a, None, *_PACES[a.type][fast]) for a in agents)
        )
    # What stands before the words in their own clause, and touches them.
    tail = _PATTERNS.tail.search(text[max(0, span.start - _NEAR) : span.start])
    touching = _PATTERNS.touches.search(tail[0]) if tail else None
    before = touching[0] if touching else ""
    unit = parse_range(span.words, before, 0.0)
    after = text[span.end : span.end + _NEAR].partition(",")[0]
    kind = _find_kind(span, users, spans, after)
    about = [users[n] for n in span.users if n in users]
    kind = None if unit is None or kind is None else _fit_unit(kind, unit[2], draft, about)
    named = [other.start for other in spans if other.names_user]
    # "2 m from a cyclist" is a distance to the road user named right after it.
    elsewhere = span.tag == "dist" and any(0 <= start - span.end <= 1 for start in named)
    if (
        span.negated
        or kind is None
        or elsewhere
        or _PATTERNS.relative.search(f"{span.words}{after}")
    ):
        return None
    found = parse_range(span.words, before, UNITS[kind].tolerance)
    if found is None:
        return None
    low, high, _ = found
    if kind in _SEVERITY and unit is not None and unit[0] == unit[1]:
        return AskedNumber(severity=(kind, unit[0]))
    ends = _find_ends(kind, span, draft, users, spans)
    bounded = [
        (*_limit_bounds(kind, agent, low, high, span.words), agent, other) for agent, other in ends
    ]
    if not bounded:
        return None
    return AskedNumber(tuple(MeasureDraft(kind, a, o, lo, hi) for lo, hi, a, o in bounded))


def says_pace(span: ReadSpan) -> bool:
    """Whether the words ask for a fast or a slow agent: "speeding", "a slow van"."""
    if span.tag not in ("pace", "follow", "red", "left", "right", "straight", *MENTIONS):
        return False
    return not span.negated and bool(_PATTERNS.fast.search(span.words)) != bool(
        _PATTERNS.slow.search(span.words)
    )


def _find_kind(
    span: ReadSpan, users: dict[int, AgentDraft], spans: Sequence[ReadSpan], after: str
) -> MeasureKind | None:
    """The kind of measure that a tag and its company say."""
    kind = _KIND_OF.get(span.tag)
    if span.tag == "point":
        words = f"{span.words}{after}"
        if _PATTERNS.side.search(words) and not re.search("front|width", words.lower()):
            return "side_point"
        if _PATTERNS.left.search(words):
            return "front_point_left"
        return "front_point_right" if _PATTERNS.right.search(words) else "front_point"
    if span.tag in ("wait", "when") and _PATTERNS.into.search(f"{span.words}{after}"):
        return "time"
    if span.tag != "speed":
        return kind
    before = [s for s in spans if s.start < span.start and not s.negated]
    near = next((s for s in reversed(before) if s.tag == "red" or s.names_user), None)
    said_of = set(span.subjects)
    if near is not None and near.tag == "red":
        return "line_speed"
    hits = [s for s in before if s.tag == "hit" and said_of and said_of <= set(s.subjects)]
    met = near is not None and bool(hits) and set(near.subjects) <= set(hits[-1].objects)
    drives = all(users[n].type == "vehicle" for n in said_of if n in users)
    return "contact_speed" if met and drives else kind


def _is_in_lane(relation: RelationDraft) -> bool:
    """Whether one of the two drives behind the other, so that there is a headway."""
    return relation.type == "follow" or has_trait("manoeuvre", relation.manoeuvre, "merges_ahead")


def _fit_unit(
    kind: MeasureKind, unit: str, draft: Draft, about: Collection[AgentDraft]
) -> MeasureKind | None:
    """The kind that has this unit, where words such as "gap" leave that open.

    Args:
        about: those that the figure is said of.
    """
    theirs = [e for e in draft.relations if e.from_ in about and e.to in about] or draft.relations
    follows = bool(theirs) and all(map(_is_in_lane, theirs))
    if kind in ("headway", "gap"):
        if unit == "m":
            return "gap" if follows else None
        return ("headway" if follows else "pet") if unit == "s" else None
    if kind == "line_distance" and follows and unit == "m":
        return "gap"
    if unit == "" and kind in ("pet", "ttc"):
        return kind
    return kind if unit == UNITS[kind].unit else None


def _find_ends(
    kind: MeasureKind,
    span: ReadSpan,
    draft: Draft,
    users: dict[int, AgentDraft],
    spans: Sequence[ReadSpan],
) -> Iterator[tuple[AgentDraft, AgentDraft | None]]:
    """The agent that the figure is asked of."""
    subjects = [users[n] for n in span.subjects if n in users]
    if not UNITS[kind].of_two:
        vehicles = [agent for agent in draft.agents if agent.type == "vehicle"]
        if not subjects:
            subjects = vehicles if len(vehicles) == 1 else []
        yield from ((agent, None) for agent in subjects)
        return
    relation = _find_relation(kind, span, draft, subjects, users, spans)
    if relation is not None:
        first, second = relation.ends
        strikes = first.type == "vehicle" or second.type != "vehicle"
        turned = kind == "side_point" or ("_point" in kind and subjects[:1] == [second])
        turned = turned or (
            kind in ("headway", "gap")
            and has_trait("manoeuvre", relation.manoeuvre, "merges_ahead")
        )
        yield (second, first) if turned or not strikes else (first, second)


def _find_relation(
    kind: MeasureKind,
    span: ReadSpan,
    draft: Draft,
    subjects: Sequence[AgentDraft],
    users: dict[int, AgentDraft],
    spans: Sequence[ReadSpan],
) -> RelationDraft | None:
    """The event whose figure it is: of the agents named, else the last one described before."""
    wanted = list_measured_relations(kind)
    spaced = kind in ("headway", "gap")
    fitting = [e for e in draft.relations if e.type in wanted or (spaced and _is_in_lane(e))]
    named = [e for e in fitting if any(a in e.ends for a in subjects)] if subjects else []
    named = named or fitting
    if len(named) <= 1:
        return named[0] if named else None
    earlier = [s for s in spans if s.tag in EVENTS and s.start < span.start]
    for event in reversed(earlier):
        pair = {users[n] for n in event.users if n in users}
        theirs = [relation for relation in named if relation.pair <= pair]
        if theirs:
            return theirs[-1]
    return None


def _limit_bounds(
    kind: MeasureKind, agent: AgentDraft, low: float, high: float | None, words: str
) -> tuple[float, float]:
    """The bounds, within what a scene can have.

    Raises:
        Refused: nothing of the range can be, with the nearest that can.
    """
    unit = UNITS[kind]
    most = _MOST[agent.type].get(kind, unit.most)
    high = most if high is None else high
    slack = unit.tolerance
    if low + slack > most + 1e-6 and low > unit.least:
        raise Refused(
            "impossible",
            f"'{words}' is more than a scene can have: {kind.replace('_', ' ')} of a {agent.type} "
            f"is at most {most:g} {unit.unit}.",
        )
    if high - slack < unit.least - 1e-6 and high < most:
        raise Refused(
            "impossible",
            f"'{words}' is less than a scene can have: {kind.replace('_', ' ')} of a {agent.type} "
            f"is at least {unit.least:g} {unit.unit}.",
        )
    return min(low, most), min(high, most)
