"""The planner's question in words."""

from __future__ import annotations

from collections.abc import Sequence

from scenewright.backends import Wording
from scenewright.nodes.scene_planner.reply import Way, patterns_told, plan_schema
from scenewright.nodes.wording import Example, examples_told, faults_told, quoted, worded
from scenewright.scene.relations import Pattern

_PHRASES = 2


def worded_plan(
    instruction: str,
    previous: str | None,
    ways: Sequence[Way],
    *,
    rejections: Sequence[str] = (),
    examples: Sequence[Example] = (),
) -> Wording:
    """What a model is asked for a social graph, and the schema of its reply."""
    told = patterns_told(instruction)
    legs = dict.fromkeys(side for way in ways for side in (way.entry, way.exit))
    crosswalks = dict.fromkeys(way.crosswalk for way in ways if way.crosswalk is not None)
    values = {
        "legs": ", ".join(legs),
        "crosswalks": ", ".join(crosswalks) or "none",
        "ways": _ways(ways),
        "patterns": _patterns(told),
        "examples": examples_told(examples),
        "previous": _previous(previous),
        "instruction": quoted(instruction),
        "faults": faults_told(rejections),
    }
    return worded("scene_planner", "prompt.md", values, schema=plan_schema(ways, told))


def _ways(ways: Sequence[Way]) -> str:
    """Vehicles' ways by entry: "from north: left to east, straight to south"."""
    by_entry: dict[str, list[str]] = {}
    for way in ways:
        if way.type == "vehicle" and way.movement != "uturn":
            words = f"{way.movement} to {way.exit}"
            found = by_entry.setdefault(way.entry, [])
            found += [] if words in found else [words]
    return "; ".join(f"from {entry} {', '.join(found)}" for entry, found in by_entry.items())


def _patterns(told: Sequence[Pattern]) -> str:
    """One line per relation file, with its phrases."""
    lines = []
    for pattern in told:
        phrases = [
            each.replace("{from}", "FROM").replace("{to}", "TO")
            for each in pattern.phrases[:_PHRASES]
        ]
        lines.append(f"{pattern.id} ({pattern.relation}): {' / '.join(phrases)}\n")
    return "".join(["Patterns:\n", *lines]) if lines else ""


def _previous(previous: str | None) -> str:
    """The earlier turn that a request may change; the answer is the whole scene as changed."""
    if previous is None or not previous.strip():
        return ""
    return (
        f"Earlier request: {quoted(previous)}. Unless the request stands alone it changes this "
        "one; then answer with the whole scene as changed.\n"
    )
