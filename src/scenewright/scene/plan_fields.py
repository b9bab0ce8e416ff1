"""The fields of a plan as the text of its scene: each is a claim, as words are (SEMANTICS 9)."""

from __future__ import annotations

from typing import Any, NamedTuple, cast, get_args

from scenewright.scene.account import LEFT_TO_STAGES, Became, SaidSpan
from scenewright.scene.base import Model
from scenewright.scene.measures import format_measure
from scenewright.scene.plan_file import PlanFile
from scenewright.scene.social import Background, SocialGraph

_HEADS: dict[str, tuple[Became, tuple[str, ...]]] = {
    "agents": ("agent", ("id", "type")),
    "relations": ("relation", ("type", "from_", "to")),
    "ties": ("tie", ("agent", "of", "side")),
    "objects": ("object", ("id", "kind", "subtype")),
    "measures": ("measure", ("kind", "agent", "other", "low", "high")),
}
"""What an entry of each section is, and the fields that name it."""
_SIGHT = ("hides", "hidden_from", "lead", "beyond")
_BECAME: dict[str, Became] = {
    "subtype": "agent", "members": "agent", "first": "order", "strikes": "striker",
    "point_from": "impact_point", "point_to": "impact_point", "braker": "cause",
    "vehicles": "background", "pedestrians": "background", "met_by": "encounter",
    **dict.fromkeys(_SIGHT, "sight"),
}  # fmt: skip


class PlanField(NamedTuple):
    """A field that says something, and its characters in the text.

    Attributes:
        section: where it stands; number: of its entry there; name: "" for what names the entry.
    """

    section: str
    number: int
    name: str
    value: Any
    words: str
    start: int

    @property
    def end(self) -> int:
        """The character after it."""
        return self.start + len(self.words)


def list_fields(plan: SocialGraph) -> tuple[PlanField, ...]:
    """The fields that are set, in the order of the text."""
    found: list[PlanField] = []

    def add(section: str, index: int, name: str, value: Any, words: str) -> None:
        start = found[-1].end + 2 if found else 0
        found.append(PlanField(section, index, name, value, words, start))

    for section, (_, heads) in _HEADS.items():
        for index, entry in enumerate(getattr(plan, section)):
            add(section, index, "", entry, _name_entry(section, entry))
            for name, value in _list_set(entry):
                if name not in heads:
                    add(section, index, name, value, f"{name} {_format(value)}")
    for name, value in _list_set(plan.context):
        counts = _list_set(value) if isinstance(value, Background) else [(name, value)]
        for own, number in counts:
            add("context", 0, own, number, f"{own} {number}")
    for index, each in enumerate(plan.said):
        if each.became in LEFT_TO_STAGES:
            add("said", index, "", each, each.words)
    if not plan.relations and not any(scene_object.met_by for scene_object in plan.objects):
        add("normal", 0, "", None, "nothing else happens")
    return tuple(found)


def join_fields(fields: tuple[PlanField, ...]) -> str:
    """The text that they are."""
    return ", ".join(field.words for field in fields)


def word_plan(given: PlanFile) -> tuple[str, SocialGraph]:
    """What a plan's scene has as its text, and the plan with what that text says."""
    if given.as_read:
        return given.text, given.plan
    fields = list_fields(given.plan)
    said = tuple(_build_span(field, given.plan) for field in fields)
    return join_fields(fields), given.plan.model_copy(update={"said": said})


def _build_span(each: PlanField, plan: SocialGraph) -> SaidSpan:
    if each.section == "said":
        return cast(SaidSpan, each.value).model_copy(update={"start": each.start, "end": each.end})
    known = {agent.id for agent in plan.agents}
    entry = getattr(plan, each.section)[each.number] if each.section in _HEADS else None
    names = (getattr(entry, name, None) for name in ("id", "from_", "agent", "to", "of", "other"))
    own = each.name in get_args(Became)
    became: Became = _BECAME.get(each.name) or cast(
        Became, each.name if own else _HEADS[each.section][0] if entry else "normal"
    )
    value = _format(each.value) if each.name else getattr(entry, "type", None)
    if each.section == "objects":
        value = f"{entry.id} {value or entry.kind}" if entry else None
    return SaidSpan(
        start=each.start,
        end=each.end,
        words=each.words[:400],
        became=became,
        agents=tuple(name for name in names if name in known),
        value=value,
    )


def _list_set(entry: Model) -> list[tuple[str, Any]]:
    """The fields of a model that are not as they are when nobody sets them."""
    values = ((name, getattr(entry, name)) for name in type(entry).model_fields)
    return [
        (name, value)
        for name, value in values
        if value is not None and value is not False and value != ()
    ]


def _name_entry(section: str, entry: Any) -> str:
    match section:
        case "relations":
            return f"{entry.from_} {entry.type} {entry.to}"
        case "ties":
            return f"{entry.agent} {entry.side} of {entry.of}"
        case "measures":
            return format_measure(entry)
        case "objects":
            return str(entry.describe())
        case _:
            return str(entry.id)


def _format(value: Any) -> str:
    if isinstance(value, tuple):
        return " to ".join(map(_format, value))
    if isinstance(value, Model):
        return " ".join(_format(own) for _, own in _list_set(value))
    return f"{value:.4g}" if isinstance(value, float) else str(value)
