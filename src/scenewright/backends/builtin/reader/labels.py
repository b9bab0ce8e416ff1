"""The labels that the encoder gives to spans, and their numbers."""

from __future__ import annotations

from scenewright.backends.builtin.reader.annotation import MENTIONS, SIDES, TAGS, Span

COMPASS = ("N", "E", "S", "W")
_VALUED = {
    "from": ("opp", "left", "right", "same", "lateral", "other"),
    "to": ("opp", "left", "right", "same", "other"),
    "heading": ("same", "opp"),
    "cw": ("exit", "entry"),
    "hit": ("rear", "side", "head", "tbone"),
    "near": ("cutoff",),
    "density": ("low", "medium", "high", "up", "down"),
    **dict.fromkeys(MENTIONS, ("many",)),
    "obj": ("many", "parked", "double", "stalled", "stop", "thing"),
    "meet": ("around", "wait", "short"),
    "motion": ("runs", "darts", "midway", "back", "yellow", "stopyellow", "box", "wrongway"),
    "lane": ("cutin", "change", "tailgate"),
    "react": ("none", "swerve", "back", "run"),
}
_ALWAYS_VALUED = frozenset({"density", "meet", "motion", "lane", "react"})

LABELS: tuple[str, ...] = tuple(
    label
    for tag in sorted(TAGS)
    for label in (
        *(() if tag in _ALWAYS_VALUED else (tag,)),
        *(f"{tag}={value}" for value in _VALUED.get(tag, ())),
    )
)
"""Every label, in the order of the encoder's outputs; changing it makes old weights unusable."""

LABEL_INDEX = {label: index for index, label in enumerate(LABELS)}
MOST_MEMBERS = 12
"""Members of a group that can be distinguished."""

LINKS = ("none", "subject", "object")


def label_of(span: Span) -> str:
    """The label of an annotated span: its tag, with a value that words alone do not show.

    Raises:
        KeyError: the value is not one that the tag can have.
    """
    label = f"{span.tag}={span.value}" if span.value in _VALUED.get(span.tag, ()) else span.tag
    if label not in LABEL_INDEX:
        raise KeyError(label)
    return label


def split_label(label: str) -> tuple[str, str | None]:
    """Tag and value of a label."""
    tag, _, value = label.partition("=")
    return tag, value or None


def is_side_label(label: str) -> bool:
    """Whether the words of such a span name a direction of the compass or a leg."""
    return label in SIDES


def is_mention(label: str) -> bool:
    """Whether such a span introduces a road user or an object."""
    return split_label(label)[0] in MENTIONS
