"""The social graph: agents, relations between them, and conditions."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Annotated, Literal, Self

from pydantic import Field, JsonValue, model_validator

from scenewright.scene.account import SaidSpan
from scenewright.scene.base import (
    AgentClass,
    AgentId,
    Compass,
    FieldError,
    FieldErrors,
    Model,
    Movement,
    is_left_out,
)
from scenewright.scene.kinds import (
    AskedFigure,
    Axis,
    KindOf,
    get_kind,
    has_trait,
    list_shipped,
)
from scenewright.scene.measures import UNITS, Measure, find_excess

RelationType = Literal["collide_at", "near_miss", "yield_to", "follow"]
CollisionKind = Annotated[str, KindOf("collision")]
ImpactPoint = Literal[
    "front", "rear", "side", "left", "right",
    "front_left", "front_right", "rear_left", "rear_right",
]  # fmt: skip
"""Where on a vehicle it is struck or strikes; front and rear take in their corners."""

Cause = Annotated[str, KindOf("cause")]
EntrySide = Literal["same", "other", "opposite", "lateral", "left", "right"]
"""How one entry lies to another: one leg, not that, oncoming, on the cross street, to its left."""

Manoeuvre = Annotated[str, KindOf("manoeuvre")]
"""How a relation in one lane comes about."""

AskedReaction = Annotated[str, KindOf("reaction")]
"""How a threatened agent is to react. Braking hard is a cause of its relation."""
Motion = Annotated[str, KindOf("motion")]
"""How a pedestrian crosses, or a vehicle drives."""

Density = Literal["low", "medium", "high"]
Subtype = Annotated[str, KindOf("subtype")]
TimeOfDay = Annotated[str, Field(pattern=r"^([01]\d|2[0-3]):[0-5]\d(-([01]\d|2[0-3]):[0-5]\d)?$")]


MOST_AGENTS, MOST_RELATIONS, MOST_OBJECTS = 12, 12, 6
"""Named agents, relations between them, and standing objects that one graph holds."""


GAINED, HARD, DRIVES = 5.0, 4.5, 1.0
"""Most that a vehicle's speed grows in a second [m/s]; least braking of who brakes hard [m/s^2];
slowest of who keeps a headway [m/s] (SEMANTICS 5 and 8, and what figures may be off)."""
MOST_BACKGROUND = 60
"""Background agents of a class that a request may ask for."""


SECONDS: dict[str, JsonValue] = {"unit": "s"}
"""Marks fields of times, in the schema too."""


class AgentNode(Model):
    """A vertex of the social graph (paper 3.1). None means: left free."""

    id: AgentId = Field(description="class and number, such as vehicle-1")
    type: AgentClass
    subtype: Subtype | None = Field(default=None, description="of a vehicle")
    entry: Compass | None = Field(default=None, description="side the agent comes from")
    exit: Compass | None = Field(default=None, description="side the agent leaves towards")
    movement: Movement | None = Field(default=None, description="turn, or way across the road")
    crosswalk: Compass | None = Field(default=None, description="leg that a pedestrian crosses")
    runs_red: bool = Field(default=False, description="whether it ignores a red light")
    reaction: AskedReaction | None = Field(
        default=None, exclude_if=is_left_out, description="what it does about a threat"
    )
    motion: Motion | None = Field(
        default=None, exclude_if=is_left_out, description="how it crosses or drives"
    )
    members: int | None = Field(
        default=None,
        ge=2,
        le=8,
        exclude_if=is_left_out,
        description="number of a group walking as one",
    )

    @model_validator(mode="after")
    def _check_name(self) -> Self:
        if not self.id.startswith(self.type):
            raise FieldError(f"{self.id} is of type {self.type}; an id begins with its type", "id")
        self._check_kind("motion", self.motion)
        self._check_kind("reaction", self.reaction)
        self._check_kind("subtype", self.subtype)
        if self.members is not None and self.type != "pedestrian":
            raise FieldError(f"{self.id} is no pedestrian; only those walk in groups", "members")
        return self

    def _check_kind(self, axis: Axis, name: str | None) -> None:
        """Check that such a kind can be asked of an agent of this class."""
        agents = get_kind(axis, name).agents if name is not None else (self.type,)
        if self.type not in agents:
            raise FieldError(f"{self.id} is no {agents[0]}, so its {axis} cannot be {name}", axis)


class RelationEdge(Model):
    """A directed edge of the social graph; `from` gives way, follows, or strikes."""

    type: RelationType
    from_: AgentId = Field(alias="from", description="agent that gives way, follows or strikes")
    to: AgentId = Field(description="the other agent")
    kind: CollisionKind | None = Field(default=None, description="kind of collision")
    cause: Cause | None = Field(default=None, description="how it comes about")
    braker: AgentId | None = Field(
        default=None, description="vehicle that brakes hard or late, where the cause is late_brake"
    )
    manoeuvre: Manoeuvre | None = Field(
        default=None, exclude_if=is_left_out, description="how it comes about in one lane"
    )
    pattern: str | None = Field(
        default=None, max_length=64, description="id of the one relation file that may play it"
    )
    target_pet: float | None = Field(
        default=None, ge=0, le=8, description="post-encroachment time", json_schema_extra=SECONDS
    )
    target_ttc: float | None = Field(
        default=None, ge=0, le=8, description="least time to collision", json_schema_extra=SECONDS
    )
    impact_speed: float | None = Field(
        default=None, gt=0, le=20, description="at contact", json_schema_extra={"unit": "m/s"}
    )
    point_from: ImpactPoint | None = Field(default=None, description="where `from` is touched")
    point_to: ImpactPoint | None = Field(default=None, description="where `to` is touched")
    first: AgentId | None = Field(
        default=None,
        exclude_if=is_left_out,
        description="agent leaving the conflict zone first; in a collision, entering it first",
    )
    strikes: AgentId | None = Field(
        default=None, exclude_if=is_left_out, description="agent that strikes the other"
    )

    @model_validator(mode="after")
    def _check_two_agents(self) -> Self:
        if self.from_ == self.to:
            message = f"{self.type} needs two different agents, got {self.to} twice"
            raise FieldError(message, "to")
        for name in ("braker", "first", "strikes"):
            if (own := getattr(self, name)) not in (None, self.from_, self.to):
                raise FieldError(f"{name} must be {self.from_} or {self.to}, got {own}", name)
        if self.impact_speed is not None and self.type != "collide_at":
            raise FieldError(f"a {self.type} has no impact; that is a collide_at", "impact_speed")
        return self

    @property
    def pair(self) -> frozenset[str]:
        """The two agents, unordered."""
        return frozenset((self.from_, self.to))

    def get_other(self, name: str) -> str:
        """The other one of the two."""
        return self.to if name == self.from_ else self.from_

    @property
    def brakes(self) -> bool:
        """Whether one of the two of a near miss brakes hard, and so lets the other pass first."""
        return self.target_ttc is not None or has_trait("cause", self.cause, "late")

    @property
    def is_pushed(self) -> bool:
        """Whether `from` is pushed into `to` by what strikes it."""
        return has_trait("manoeuvre", self.manoeuvre, "chain")

    def get_first(self) -> str | None:
        """The agent that passes first, as asked for or as the relation itself has it."""
        ahead = self.to if self.type in ("yield_to", "follow") else None
        return self.first or ahead


_VehicleId = Annotated[
    str, Field(pattern=r"^(vehicle|cyclist|scooter)-[1-9][0-9]*$", max_length=32)
]


class EntryTie(Model):
    """Where a vehicle comes from as seen by another one, where the text says that."""

    agent: _VehicleId
    of: _VehicleId = Field(description="agent from whose entry the side is seen")
    side: EntrySide

    @property
    def pair(self) -> frozenset[str]:
        """The two agents, unordered."""
        return frozenset((self.agent, self.of))

    @model_validator(mode="after")
    def _check_two_agents(self) -> Self:
        if self.agent == self.of:
            raise FieldError(f"an entry is tied to another agent's, got {self.of} twice", "of")
        return self


ObjectKind = Literal[
    "parked", "double_parked", "stalled", "bus_stop", "box", "bin", "container"
]  # fmt: skip
"""What stands: vehicles at the kerb, beside those parked there, in a lane, a bus at its stop; a
cabinet or kiosk, a litter bin, a shipping container."""

Encounter = Annotated[str, KindOf("encounter")]
"""What a vehicle or rider does about an object in its way."""


def get_figure(encounter: str) -> AskedFigure:
    """What may be asked of an encounter: the figure that the checker measures."""
    figure = get_kind("encounter", encounter).figure
    if figure is None:
        raise KeyError(encounter)
    return figure


_FIGURE_HELP = "least and most; " + ", ".join(
    f"{each.id}: {each.figure.name} [{each.figure.unit}]"
    for each in list_shipped("encounter")
    if each.figure is not None
)

ObjectId = Annotated[str, Field(pattern=r"^object-[1-9][0-9]*$", max_length=32)]
STANDING_VEHICLES = ("parked", "double_parked", "stalled", "bus_stop")


class Meeting(Model):
    """One more agent that meets an object, after those before it."""

    agent: _VehicleId
    encounter: Encounter
    figure: tuple[float, float] | None = Field(
        default=None, exclude_if=is_left_out, description=_FIGURE_HELP
    )


def _check_figure(name: str, each: Meeting, *at: str | int) -> None:
    figure, own = each.figure, get_figure(each.encounter)
    if figure is not None and not own.least <= figure[1] <= own.most + 1.0:
        raise FieldError(
            f"{name}: {own.name} of who {each.encounter} must be {own.least:g} to {own.most:g} "
            f"{own.unit}",
            *at,
        )
    if figure is not None and figure[0] >= figure[1]:
        raise FieldError(f"{name}: {own.name} must be two rising numbers, in {own.unit}", *at)


class ObjectNode(Model):
    """Something that stands all the time and takes no part (SEMANTICS 8)."""

    id: ObjectId = Field(description="such as object-1")
    kind: ObjectKind
    subtype: Subtype | None = Field(
        default=None, description="of a vehicle; left open a car, at a bus stop a bus"
    )
    leg: Compass | None = Field(default=None, description="arm it stands on")
    side: Literal["entry", "exit"] | None = Field(
        default=None, description="that of the approach or of the exit"
    )
    lane: Literal["left", "right"] | None = Field(
        default=None,
        exclude_if=is_left_out,
        description="outermost one on that side, as the traffic there sees it",
    )
    hides: AgentId | None = Field(default=None, description="pedestrian or rider that it hides")
    hidden_from: AgentId | None = Field(default=None, description="vehicle that cannot see it")
    lead: tuple[float, float] | None = Field(
        default=None,
        description="least and most time between the first free line of sight and the event",
        json_schema_extra=SECONDS,
    )
    beyond: ObjectId | None = Field(
        default=None,
        exclude_if=is_left_out,
        description="object that hides a pedestrian stepping out between it and this one",
    )
    met_by: _VehicleId | None = Field(
        default=None, exclude_if=is_left_out, description="agent whose way it is in"
    )
    encounter: Encounter | None = Field(
        default=None, exclude_if=is_left_out, description="what that one does about it"
    )
    figure: tuple[float, float] | None = Field(
        default=None, exclude_if=is_left_out, description=_FIGURE_HELP
    )
    others: tuple[Meeting, ...] = Field(
        default=(), max_length=3, exclude_if=is_left_out, description="agents that meet it after"
    )

    @model_validator(mode="after")
    def _check_consistency(self) -> Self:
        if self.subtype is not None and self.kind not in STANDING_VEHICLES:
            raise FieldError(f"{self.id}: a {self.kind} has no subtype", "subtype")
        if (self.hides is None) != (self.hidden_from is None):
            raise FieldError(f"{self.id}: hides and hidden_from go together", "hides")
        if self.lead is not None and not 0 <= self.lead[0] < self.lead[1] <= 10:
            raise FieldError(
                f"{self.id}: lead must be two rising numbers of seconds up to 10", "lead"
            )
        if (self.met_by is None) != (self.encounter is None):
            raise FieldError(f"{self.id}: met_by and encounter go together", "encounter")
        if self.encounter is not None and self.kind not in STANDING_VEHICLES:
            raise FieldError(f"{self.id}: a {self.kind} is in no agent's way", "encounter")
        if self.encounter is None and (self.figure is not None or self.others):
            raise FieldError(f"{self.id}: figure and others need met_by", "figure")
        if has_trait("encounter", self.encounter, "door") and self.kind != "parked":
            raise FieldError(
                f"{self.id}: only a parked vehicle opens a door, not a {self.kind}", "encounter"
            )
        if has_trait("encounter", self.encounter, "behind_agent"):
            raise FieldError(
                f"{self.id}: the first behind it waits_behind, the others queue", "encounter"
            )
        if self.lane is not None and self.kind not in ("stalled", "double_parked"):
            raise FieldError(f"{self.id}: a {self.kind} stands in no lane", "lane")
        for n, each in enumerate(self.list_meetings()):
            _check_figure(self.id, each, *(("others", n - 1) if n else ()), "figure")
        return self

    def describe(self) -> str:
        """Id, kind and subtype, as the account of words has them."""
        return f"{self.id} {self.kind} {self.subtype or ''}".strip()

    def list_meetings(self) -> tuple[Meeting, ...]:
        """List the agents that meet it, one after the other."""
        if self.met_by is None or self.encounter is None:
            return ()
        first = Meeting(agent=self.met_by, encounter=self.encounter, figure=self.figure)
        return first, *self.others


DEFAULT_LEAD = (1.0, 3.0)
"""How long before an event the line of sight is free where the text does not say [s]: less than a
conflict would be perceptible (SEMANTICS 8)."""


class Background(Model):
    """Explicit numbers of background agents; None where the text leaves a class free."""

    vehicles: int | None = Field(default=None, ge=0, le=MOST_BACKGROUND, description="how many")
    pedestrians: int | None = Field(default=None, ge=0, le=MOST_BACKGROUND, description="how many")


class SceneContext(Model):
    """Global context C of the social graph (paper 3.1, SEMANTICS section 3)."""

    density: Density | None = Field(default=None, description="of the traffic around")
    time_of_day: TimeOfDay | None = Field(
        default=None, description='clock time such as "08:00", or a span, "07:00-09:30"'
    )
    background: Background | None = Field(default=None, description="numbers of the others")


def _check_unique(names: Sequence[str], where: str) -> Iterator[FieldError]:
    for n, name in enumerate(names):
        if name in names[:n]:
            message = f"{where.removesuffix('s')} ids must be unique; {name} is there twice"
            yield FieldError(message, where, n, "id")


UNIT_OF = {
    name: str(extra["unit"])
    for model in (RelationEdge, ObjectNode)
    for name, info in model.model_fields.items()
    if isinstance(extra := info.json_schema_extra, dict)
}
"""Fields of relations and objects that have a unit."""


class SocialGraph(Model):
    """G = (V, E, C). No relations means a normal scene."""

    agents: tuple[AgentNode, ...] = Field(
        max_length=MOST_AGENTS, description="who takes part; the traffic around is no part of it"
    )
    relations: tuple[RelationEdge, ...] = Field(
        default=(), max_length=MOST_RELATIONS, description="what happens between two of them"
    )
    ties: tuple[EntryTie, ...] = Field(
        default=(),
        max_length=66,
        description="entries fixed by one another, such as those of oncoming vehicles",
    )
    context: SceneContext = SceneContext()
    objects: tuple[ObjectNode, ...] = Field(
        default=(),
        max_length=MOST_OBJECTS,
        exclude_if=is_left_out,
        description="what stands on the road or the sidewalk; hides or blocks the way",
    )
    measures: tuple[Measure, ...] = Field(
        default=(),
        max_length=24,
        exclude_if=is_left_out,
        description="figures asked for beside the severity of relations",
    )
    said: tuple[SaidSpan, ...] = Field(
        default=(), max_length=500, description="what the words of the instruction became"
    )

    @model_validator(mode="after")
    def _check_consistency(self) -> Self:
        checks = self._list_faults, self._check_chains, self._check_objects, self._check_figures
        if faults := [fault for check in checks for fault in check()]:
            raise FieldErrors(faults)
        return self

    def _list_faults(self) -> Iterator[FieldError]:
        ids = [agent.id for agent in self.agents]
        yield from _check_unique(ids, "agents")
        known = ", ".join(ids) or "none"
        for n, edge in enumerate(self.relations):
            for field, name in (("from", edge.from_), ("to", edge.to)):
                if name not in ids:
                    message = f"{edge.type}: {name} is not among the agents, {known}"
                    yield FieldError(message, "relations", n, field)
        for n, tie in enumerate(self.ties):
            for field, name in (("agent", tie.agent), ("of", tie.of)):
                if name not in ids:
                    message = f"a tie of entries names {name}; the agents are {known}"
                    yield FieldError(message, "ties", n, field)
        for n, each in enumerate(self.measures):
            for field, asked in (("agent", each.agent), ("other", each.other)):
                if asked not in (None, *ids):
                    message = f"{each.kind} is asked of {asked}; the agents are {known}"
                    yield FieldError(message, "measures", n, field)
            if fault := find_excess(each):
                yield FieldError(str(fault), "measures", n, *fault.at)

    def _check_chains(self) -> Iterator[FieldError]:
        """Check that who is pushed into another vehicle is struck by a third."""
        struck = {edge.to for edge in self.relations if edge.type == "collide_at"}
        for n, edge in enumerate(self.relations):
            if edge.is_pushed and edge.from_ not in struck:
                message = f"{edge.from_} is pushed into {edge.to}, but no agent strikes it"
                yield FieldError(message, "relations", n, "manoeuvre")

    def _check_objects(self) -> Iterator[FieldError]:
        yield from _check_unique([scene_object.id for scene_object in self.objects], "objects")
        bound = {edge.pair for edge in self.relations}
        hiding = {
            scene_object.id for scene_object in self.objects if scene_object.hides is not None
        }
        for n, each in enumerate(self.objects):
            at, hides = ("objects", n), each.hides
            if each.beyond is not None and each.beyond not in hiding - {each.id}:
                message = f"{each.id} is beyond {each.beyond}, which hides no agent"
                yield FieldError(message, *at, "beyond")
            if hides is not None and frozenset((hides, each.hidden_from)) not in bound:
                who = f"{each.id} hides {hides} from {each.hidden_from}"
                yield FieldError(f"{who}, but no relation binds the two", *at, "hides")
            if hides is not None and hides.startswith("vehicle"):
                message = f"{each.id} can hide a pedestrian or rider, not {hides}"
                yield FieldError(message, *at, "hides")
        yield from self._check_encounters()

    def _check_figures(self) -> Iterator[FieldError]:
        """Figures that exclude one another wherever and however the agents move."""
        asked = {(measure.kind, measure.agent, measure.other): measure for measure in self.measures}
        for n, edge in enumerate(self.relations):
            # Of two of which one is a pedestrian, the other one's speed is that of the impact.
            striker = edge.to if edge.from_.startswith("pedestrian") else edge.from_
            kept = asked.get(("speed", striker, None))
            if edge.impact_speed and kept and edge.impact_speed > kept.high + GAINED:
                message = f"{striker} keeps {kept.high:.3g} m/s at most and gains {GAINED:g} m/s"
                message += (
                    f" in the last second, so it cannot strike at {edge.impact_speed:.3g} m/s"
                )
                yield FieldError(message, "relations", n, "impact_speed")
            brakes = asked.get(("braking", edge.to, None))
            if (
                has_trait("manoeuvre", edge.manoeuvre, "by_to")
                and brakes
                and brakes.high < HARD - 0.5
            ):
                at = "measures", self.measures.index(brakes), "high"
                yield FieldError(f"who {edge.manoeuvre} brakes at {HARD:g} m/s2 or more", *at)
        for n, gap in enumerate(self.measures):
            headway = asked.get(("headway", gap.agent, gap.other))
            if gap.kind != "gap" or headway is None:
                continue
            least, most = DRIVES * headway.low, UNITS["speed"].most * headway.high
            if gap.high < least or gap.low > most:
                message = f"a headway of {headway.low:.3g} to {headway.high:.3g} s is a gap of "
                message += f"{least:.3g} to {most:.3g} m, not of {gap.low:.3g} to {gap.high:.3g} m"
                yield FieldError(message, "measures", n, "high")

    def _check_encounters(self) -> Iterator[FieldError]:
        """Check that agents meeting an object exist, meet one only, and pass it only on the way
        to another relation."""
        met = [
            (("objects", n, *(("others", k - 1, "agent") if k else ("met_by",))), own, each)
            for n, own in enumerate(self.objects)
            for k, each in enumerate(own.list_meetings())
        ]
        busy = {name for edge in self.relations for name in edge.pair}
        ids = {agent.id for agent in self.agents}
        for at, own, each in met:
            if each.agent not in ids:
                yield FieldError(f"{own.id} is met by {each.agent}, which is not in the scene", *at)
            if sum(other.agent == each.agent for *_, other in met) > 1:
                yield FieldError(f"{each.agent} can meet one object only", *at)
            if not has_trait("encounter", each.encounter, "drives_on") and each.agent in busy:
                yield FieldError(f"{each.agent} stops at {own.id}, so no relation can bind it", *at)

    def agent(self, agent_id: str) -> AgentNode:
        """The vertex with this id; KeyError if there is none."""
        for agent in self.agents:
            if agent.id == agent_id:
                return agent
        raise KeyError(agent_id)


class Refusal(Model):
    """The planner's no: why the text cannot become a scene.

    Attributes:
        did_you_mean: sentences near it that would be understood, the nearest first.
    """

    code: Literal["out_of_scope", "contradictory", "impossible"]
    reason: str
    did_you_mean: tuple[str, ...] = Field(default=(), max_length=3)


Plan = SocialGraph | Refusal
