"""The planner's question in words."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Sequence

from scenewright.backends import Prompt
from scenewright.backends.offline import VOCABULARY
from scenewright.nodes.prompts import (
    LONGEST_REQUEST,
    Example,
    describe_driving_side,
    format_rejections,
    quote_text,
    render_prompt,
)
from scenewright.nodes.scene_planner.reply import (
    build_manoeuvre_schema,
    build_motion_schema,
    build_object_schema,
    build_order_schema,
    build_plan_schema,
    find_similar_patterns,
)
from scenewright.nodes.schema import speaks_of
from scenewright.scene.base import COMPASS_RING
from scenewright.scene.kinds import list_kinds
from scenewright.scene.relations import Pattern
from scenewright.scene.route_table import RouteDescription

_PHRASES = 2
_OR_REFUSE = "\nIf the request itself fixes what was refused, answer refused: impossible."


def render_plan_prompt(
    instruction: str,
    previous: str | None,
    ways: Sequence[RouteDescription],
    *,
    left_hand: bool = False,
    rejections: Sequence[str] = (),
    roads: Sequence[tuple[str, str]] = (),
    examples: Sequence[Example] = (),
) -> Prompt:
    """What a model is asked for a social graph, and the schema of its reply.

    Args:
        roads: leg and the name of its street; given where the request may name one.
        left_hand: people drive on the left.
    """
    words = f"{instruction} {previous or ''}"
    patterns = find_similar_patterns(instruction, left_hand=left_hand)
    legs = {side for way in ways for side in (way.entry, way.exit)}
    turns = [way.entry for way in ways if way.movement == "uturn"]
    earlier = (
        f"Earlier request: {quote_text(previous)}. Unless the new one stands alone it changes "
        "this; then answer with the whole scene.\n"
        if previous is not None and previous.strip()
        else ""
    )
    values = {
        "crosswalks": describe_crosswalks(ways) + describe_streets(words, roads),
        "ways": describe_vehicle_routes(ways)
        + (f"; uturn {_format_legs(turns, legs)}" if turns else ""),
        "traffic": describe_driving_side(left_hand),
        "patterns": _format_patterns(patterns)
        + describe_manoeuvres(words)
        + describe_order(words)
        + describe_objects(words),
        "times": describe_times(words),
        "previous": earlier,
        "instruction": quote_text(instruction),
        "faults": format_rejections(rejections) + (_OR_REFUSE if rejections else ""),
    }
    schema = build_plan_schema(ways, patterns, words)
    shown = []
    for example in examples:  # without the classes of agents, which their ids contain
        agents = [
            {k: v for k, v in a.items() if k != "type"} for a in example.answer.get("agents", ())
        ]
        short = {"agents": agents} if agents else {}
        shown.append(Example(example.request, {**example.answer, **short}))
    return render_prompt("scene_planner", "prompt.md", values, schema=schema, examples=shown)


def describe_vehicle_routes(ways: Sequence[RouteDescription]) -> str:
    """Vehicles' ways by entry: "north (left east, straight south)"; every leg is there."""
    legs = dict.fromkeys(side for way in ways for side in (way.entry, way.exit))
    by_entry: dict[str, list[str]] = {leg: [] for leg in legs}
    for way in ways:
        if way.type == "vehicle" and way.movement != "uturn":
            words = f"{way.movement} {way.exit}"
            found = by_entry[way.entry]
            found += [] if words in found else [words]
    return ", ".join(f"{leg} ({', '.join(found) or 'none'})" for leg, found in by_entry.items())


def describe_streets(words: str, roads: Sequence[tuple[str, str]]) -> str:
    """The legs' streets, where a request may name one."""
    said = words.casefold()
    parts = {part for _, road in roads for part in road.casefold().split()} - _COMMON
    if not any(part in said for part in parts) and not _STREET.search(words):
        return ""
    return ". Streets: " + ", ".join(f"{leg} {road}" for leg, road in roads)


_COMMON = frozenset(
    (
        *COMPASS_RING,
        *("street", "road", "avenue", "lane", "drive", "way", "the", "of", "leg", "high", "main"),
    )
)
_STREET = re.compile(r"\b[A-Z]\w+ (?:Street|St|Avenue|Ave|Road|Rd|Lane|Boulevard|Drive|Way)\b")


def describe_crosswalks(ways: Sequence[RouteDescription]) -> str:
    """The legs that have one."""
    legs = {side for way in ways for side in (way.entry, way.exit)}
    found = [way.crosswalk for way in ways if way.crosswalk is not None]
    return _format_legs(found, legs) or "none"


def _format_legs(found: Iterable[str], legs: Collection[str]) -> str:
    """Each of the legs once, or that it is all of them."""
    each = dict.fromkeys(found)
    return "on all" if set(legs) == each.keys() else ", ".join(each)


def _format_patterns(patterns: Sequence[Pattern]) -> str:
    """One line per relation file, with its phrases."""
    lines = []
    for pattern in patterns:
        phrases = [
            phrase.replace("{from}", "FROM").replace("{to}", "TO")
            for phrase in pattern.phrases[:_PHRASES]
        ]
        lines.append(f"{pattern.id} ({pattern.relation}): {' / '.join(phrases)}\n")
    head = "Patterns, to be set only if the request says just this:\n"
    return "".join([head, *lines]) if lines else ""


_MEMBERS = "members: how many pedestrians walk together as one agent (a couple: 2; a class: 6).\n"

_OBJECTS = (
    "objects stand and take no part: kind, subtype, leg if told; hides: a pedestrian, hidden_from: "
    "the vehicle; lead, if told: seconds in sight before the event, 0.8 is [0.65,0.95].\n"
)


def describe_objects(words: str) -> str:
    """What may stand, where a request may speak of it."""
    met = _describe_encounters() if speaks_of("in_the_way", words) else ""
    return _OBJECTS + met if build_object_schema(words, {}) else ""


def _describe_encounters() -> str:
    """What may be done about an object in the way, and the figure that goes with it."""
    kinds = list_kinds("encounter")
    lines = ", ".join(kind.prompt for kind in kinds if kind.prompt)
    figures = ", ".join(f"{k.id} {k.figure.name} {k.figure.unit}" for k in kinds if k.figure)
    return (
        f"of one in the way of a vehicle or rider: met_by, encounter: {lines}; figure, if told, "
        f"least and most: {figures}; lane: left or right; others: who else meets it, by agent and "
        "encounter.\n"
    )


def describe_manoeuvres(words: str) -> str:
    """What manoeuvres and motions on foot there are, where a request may speak of one."""
    found, asked = "", build_motion_schema(words)
    if build_manoeuvre_schema(words):
        lines = " ".join(kind.prompt for kind in list_kinds("manoeuvre") if kind.prompt)
        found = f"manoeuvre, of two in one lane: {lines}\n"
    if "motion" in asked:
        lines = ", ".join(kind.prompt for kind in list_kinds("motion") if kind.prompt)
        found += f"motion of a pedestrian: {lines}.\n"
    return found + (_MEMBERS if "members" in asked else "")


_ORDER = (
    'first, who passes first (collide_at: is in the way first): "X cuts off Y", "steps out before '
    'Y", "goes ahead of Y": X; "only after Y", "second to Y": Y. Not for follow and rear_end.\n'
)


def describe_order(words: str) -> str:
    """What `first` is, where a request may speak of an order."""
    return _ORDER if build_order_schema(words, {}) else ""


def describe_times(request: str) -> str:
    """The times of day that the request may speak of; a model need not hear of the others."""
    words, times = request[:LONGEST_REQUEST].lower(), list[str]()
    for name, time in VOCABULARY["times_of_day"].items():  # the more special first
        rest = re.sub(time["pattern"], ";", words)
        if rest != words:
            words = rest
            times.append(f"{name} {'/'.join(time['ranges'])}")
    return f"Times: {', '.join(times)}.\n" if times else ""
