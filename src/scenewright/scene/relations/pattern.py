"""One relation as a file says it: roles, place, order, clauses, thresholds, proof and phrases."""

from __future__ import annotations

import re
from typing import Annotated, Literal, Self

from pydantic import Field, field_validator, model_validator

from scenewright.scene.base import RIDERS, AgentClass, Model, Movement
from scenewright.scene.events import EVENT_OF_RELATION, EventType, EventZone
from scenewright.scene.kinds import Kind, get_kind
from scenewright.scene.record import SegmentStatus
from scenewright.scene.social import Cause, CollisionKind, Manoeuvre, RelationType

Geometry = Literal[
    "crossing",
    "merging",
    "turn_across",
    "same_lane",
    "same_way",
    "overtaking",
    "cutting_in",
    "lane_change",
    "opposing",
]
RoleClass = Literal["vehicle", "pedestrian", "cyclist", "scooter", "rider"]
"""A class of agents; a rider is a cyclist or the rider of a scooter."""
RoleName = Literal["from", "to"]

_Number = Annotated[float, Field(ge=0.0, le=1000.0, allow_inf_nan=False)]
_Name = Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]*$", max_length=64)]
_Line = Annotated[str, Field(min_length=1, max_length=200)]
_PLACEHOLDER = re.compile(r"\{([^{}]*)\}")
_PHRASE = re.compile(r"\{(from|to)\} ([A-Za-z][A-Za-z' -]*[A-Za-z]) \{(from|to)\}")
_RIDING: frozenset[Movement] = frozenset({"straight", "left", "right", "crossing"})
_MOVEMENTS: dict[RoleClass, frozenset[Movement]] = {
    "vehicle": frozenset({"straight", "left", "right", "uturn"}),
    "pedestrian": frozenset({"crossing", "jaywalking"}),
    "cyclist": _RIDING,
    "scooter": _RIDING,
    "rider": _RIDING,
}
_PROVED_BY: dict[EventType, frozenset[str]] = {
    "collision": frozenset({"relative_speed"}),
    "near_miss": frozenset({"pet", "path_ttc", "clearance"}),
    "yielding": frozenset({"pet", "path_ttc"}),
    "follow": frozenset({"least_headway", "least_gap"}),
}
"""Figures of an event's evidence that a file may bound."""

_ONE_LANE = frozenset({"same_lane", "same_way", "overtaking", "cutting_in", "lane_change"})


class Role(Model):
    """The agents that fit a role.

    Attributes:
        segments: what the agent's behaviour program must hold for the relation to come about.
    """

    type: RoleClass
    movements: tuple[Movement, ...] = Field(min_length=1, max_length=4)
    segments: tuple[SegmentStatus, ...] = Field(min_length=1, max_length=4)

    def admits(self, kind: AgentClass) -> bool:
        """Whether an agent of a class can play the part."""
        return kind == self.type or (self.type == "rider" and kind in RIDERS)

    @model_validator(mode="after")
    def _check_class(self) -> Self:
        known = _MOVEMENTS[self.type]
        for movement in self.movements:
            if movement not in known:
                raise ValueError(
                    f"movements: a {self.type} has {_format_alternatives(known)}, not {movement!r}"
                )
        for field, values in (("movements", self.movements), ("segments", self.segments)):
            if len(set(values)) < len(values):
                raise ValueError(f"{field}: names one twice")
        return self


class ProofCondition(Model):
    """What the checker must observe for the relation to be proven.

    Attributes:
        event: the event; its roles are those of the relation.
        kind, cause: of the event; None: any.
        within: figure of its evidence -> name of the threshold that bounds it.
    """

    event: EventType
    kind: CollisionKind | None = None
    cause: Cause | None = None
    within: dict[_Name, _Name] = Field(default_factory=dict, max_length=4)

    @model_validator(mode="after")
    def _check_measures(self) -> Self:
        if self.kind is not None and self.event != "collision":
            raise ValueError(f"kind: only a collision has one, not a {self.event}")
        if self.cause is not None and self.event == "follow":
            raise ValueError("cause: a follow has none")
        known = _PROVED_BY[self.event]
        for figure in self.within:
            if figure not in known:
                raise ValueError(
                    f"within: a {self.event} is measured by {_format_alternatives(known)}, "
                    f"not {figure!r}"
                )
        return self


class Pattern(Model):
    """A conflict pattern, leaf of the taxonomy theme -> subtype -> pattern.

    Attributes:
        geometry: how the two routes must meet on the map.
        entries: how the two entries must lie to one another.
        zone: where the event must lie (docs/relations.md).
        order: the role that passes first; None: either.
        striker: the role that strikes the other; None: either.
        violator: the role that runs the red light where the two never have green together.
        manoeuvre: how it comes about; such a pattern is drawn only where the request says that.
        weight: how often it is drawn where the text leaves the pattern open.
        is_last_resort: it is tried only where no other pattern fits the routes.
        phrases: words that ask for this pattern, `{from} ... {to}` or `{to} ... {from}`.
        thresholds: named numbers, or ranges [low, high], for clauses and proof.
        constraints: clauses of the constraint language, `{from}`, `{to}` and thresholds filled in.
        proof: what must be observed.
    """

    id: _Name
    theme: _Line
    subtype: _Line
    relation: RelationType
    geometry: Geometry
    entries: Literal["any", "same", "opposite", "lateral"] = "any"
    zone: EventZone
    order: RoleName | None = None
    striker: RoleName | None = None
    violator: RoleName | None = None
    manoeuvre: Manoeuvre | None = None
    weight: float = Field(default=1.0, gt=0.0, le=1000.0, allow_inf_nan=False)
    is_last_resort: bool = False
    phrases: tuple[_Line, ...] = Field(min_length=1, max_length=12)
    constraints: tuple[_Line, ...] = Field(min_length=1, max_length=40)
    thresholds: dict[_Name, _Number | tuple[_Number, _Number]] = Field(
        default_factory=dict, max_length=20
    )
    proof: ProofCondition
    from_: Role = Field(alias="from")
    to: Role

    @property
    def is_common(self) -> bool:
        """Whether an order may be filled with it that names neither manoeuvre nor U-turn.

        A last resort is played only where the routes fit nothing else, so no order counts on it.
        """
        turns_round = any(role.movements == ("uturn",) for role in (self.from_, self.to))
        return not (self.manoeuvre or self.is_last_resort or turns_round)

    @property
    def is_of_paper(self) -> bool:
        """Whether it is of the classes that the paper knows, of which one drives."""
        kinds = {self.from_.type, self.to.type}
        return "vehicle" in kinds and kinds <= {"vehicle", "pedestrian"}

    @field_validator("phrases")
    @classmethod
    def _check_phrases(cls, phrases: tuple[str, ...]) -> tuple[str, ...]:
        for phrase in phrases:
            found = _PHRASE.fullmatch(phrase)
            if found is None or found[1] == found[3]:
                raise ValueError(
                    "expected plain words between the two roles, such as "
                    f"'{{from}} cuts off {{to}}', got {phrase!r}"
                )
        return phrases

    @model_validator(mode="after")
    def _agrees(self) -> Self:
        for check in (_check_classes, _check_place, _check_proof, _names_known):
            check(self)
        return self

    @property
    def kind(self) -> CollisionKind | None:
        """The kind of collision that proves it; None: any, or no collision."""
        return self.proof.kind

    def find_kind(self, field: str) -> Kind:
        """The kind of collision that proves it, if it has such words, else the relation."""
        own = get_kind("collision", self.kind) if self.kind is not None else None
        return own if own and getattr(own, field) else get_kind("relation", self.relation)

    @property
    def names_a_turn(self) -> bool:
        """Whether its phrases speak of a left or a right turn; in left-hand traffic the pattern is
        played in a mirror, and they mean something else."""
        return any(role.movements in (("left",), ("right",)) for role in (self.from_, self.to))

    @property
    def clauses(self) -> tuple[str, ...]:
        """The constraints, and the order of passing as one more."""
        if self.order is None or self.relation != "near_miss":
            return self.constraints
        first, second = ("from", "to") if self.order == "from" else ("to", "from")
        return (*self.constraints, f"before({{{first}}}, {{{second}}})")

    def fill(self, clause: str, *, from_: str, to: str) -> str:
        """A clause with the names of two agents and with the thresholds."""
        values = {"from": from_, "to": to}
        values |= {
            name: f"[{value[0]:g}, {value[1]:g}]" if isinstance(value, tuple) else f"{value:g}"
            for name, value in self.thresholds.items()
        }
        return _PLACEHOLDER.sub(lambda found: values[found[1]], clause)

    def compute_bounds(self) -> dict[str, tuple[float, float]]:
        """Figure of the event's evidence -> lowest and highest value that prove the relation."""
        found = {}
        for figure, name in self.proof.within.items():
            limits = self.thresholds[name]
            found[figure] = limits if isinstance(limits, tuple) else (limits, limits)
        return found

    def list_phrase_words(self) -> tuple[tuple[str, bool], ...]:
        """The phrases' words in lower case, and whether `to` stands before them."""
        found = (_PHRASE.fullmatch(phrase) for phrase in self.phrases)
        return tuple((each[2].lower(), each[1] == "to") for each in found if each)


def _format_alternatives(words: frozenset[str]) -> str:
    return ", ".join(sorted(words))


def _check_classes(pattern: Pattern) -> None:
    walkers = [pattern.from_.type, pattern.to.type].count("pedestrian")
    if walkers == 2 and pattern.relation == "yield_to":
        raise ValueError("relation: two pedestrians have no right of way over one another")
    if walkers and pattern.geometry != "crossing":
        raise ValueError("geometry: with a pedestrian it must be 'crossing'")
    if "crossing" in (*pattern.from_.movements, *pattern.to.movements) and (
        pattern.geometry != "crossing"
    ):
        raise ValueError("geometry: on a crosswalk it must be 'crossing'")
    if walkers and pattern.relation == "follow":
        raise ValueError("relation: a pedestrian neither follows nor is followed")
    struck = pattern.kind == "pedestrian_strike"
    if pattern.kind is not None and struck != (walkers == 1):
        raise ValueError(f"proof.kind: {pattern.kind} cannot happen between these two classes")


def _check_place(pattern: Pattern) -> None:
    movements = {*pattern.from_.movements, *pattern.to.movements}
    if pattern.zone == "crosswalk" and not movements >= {"crossing"}:
        raise ValueError("zone: 'crosswalk' needs a role with the movement 'crossing'")
    if pattern.zone == "sidewalk" and movements != {"crossing"}:
        raise ValueError("zone: 'sidewalk' needs both roles to have the movement 'crossing'")
    if pattern.zone == "lane" and pattern.geometry not in _ONE_LANE:
        raise ValueError(f"zone: 'lane' needs a geometry of {_format_alternatives(_ONE_LANE)}")
    if pattern.order is not None and pattern.relation not in ("near_miss", "yield_to"):
        raise ValueError(f"order: there is no order of passing in {pattern.relation}")
    if pattern.striker is not None and pattern.relation != "collide_at":
        raise ValueError(f"striker: nobody strikes in {pattern.relation}")
    if pattern.order == "from" and pattern.relation == "yield_to":
        raise ValueError("order: the agent with priority passes first, so it must be 'to'")


def _check_proof(pattern: Pattern) -> None:
    wanted = EVENT_OF_RELATION[pattern.relation]
    if pattern.proof.event != wanted:
        raise ValueError(f"proof.event: {pattern.relation} is proven by {wanted!r}")
    for figure, name in pattern.proof.within.items():
        limits = pattern.thresholds.get(name)
        if not isinstance(limits, tuple):
            raise ValueError(f"proof.within.{figure}: expected a threshold [low, high], got {name}")


def _names_known(pattern: Pattern) -> None:
    known = {"from", "to", *pattern.thresholds}
    used = set(pattern.proof.within.values())
    for number, clause in enumerate(pattern.constraints):
        names = _PLACEHOLDER.findall(clause)
        for name in names:
            if name not in known:
                raise ValueError(
                    f"constraints.{number}: {{{name}}} is neither a role nor a threshold"
                )
        if set("{}") & set(_PLACEHOLDER.sub("", clause)):
            raise ValueError(f"constraints.{number}: a brace without its partner")
        used.update(names)
    for name, limits in pattern.thresholds.items():
        if name in ("from", "to"):
            raise ValueError(f"thresholds.{name}: the name of a role")
        if isinstance(limits, tuple) and limits[0] > limits[1]:
            raise ValueError(f"thresholds.{name}: [low, high] with low above high")
        if name not in used:
            raise ValueError(f"thresholds.{name}: neither a clause nor the proof uses it")
