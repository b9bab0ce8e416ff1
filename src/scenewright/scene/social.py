"""The social graph: agents, relations between them, and conditions."""

from __future__ import annotations

from typing import Annotated, Literal, Self, get_args

from pydantic import Field, model_validator

from scenewright.scene.account import SaidSpan
from scenewright.scene.base import AgentClass, AgentId, Compass, Model, Movement, is_left_out
from scenewright.scene.measures import Measure

RelationType = Literal["collide_at", "near_miss", "yield_to", "follow"]
CollisionKind = Literal[
    "pedestrian_strike", "rear_end", "sideswipe", "head_on", "left_turn", "angle"
]
ImpactPoint = Literal[
    "front", "rear", "side", "left", "right",
    "front_left", "front_right", "rear_left", "rear_right",
]  # fmt: skip
"""Where on a vehicle it is struck or strikes; front and rear take in their corners."""

Cause = Literal["red_light_run", "late_brake"]
EntrySide = Literal["same", "other", "opposite", "lateral", "left", "right"]
"""How one entry lies to another: one leg, not that, oncoming, on the cross street, to its left."""

Manoeuvre = Literal["lead_brakes", "tailgates", "cuts_in", "changes_lane", "pushed"]
"""How a relation in one lane comes about: `to` brakes hard ahead of `from`; `from` drives close up;
`from` changes into the lane of `to`, ahead of it; or into its side; `from` stands behind `to` and
is pushed into it by the vehicle that rear-ends it (a chain collision)."""

PedestrianMotion = Literal["runs", "darts_out", "stops_midway", "turns_back"]
"""How a pedestrian crosses: it runs, runs onto the road at once, stands still on the way, or turns
round there and returns."""

EvasionOnFoot = Literal["steps_back", "jumps_back", "runs"]
AskedReaction = Literal["none", "swerves", "steps_back", "jumps_back", "runs"]
"""How a threatened agent is to react: not at all; a vehicle or rider swerves within its lane; a
pedestrian steps or jumps back or runs. Braking hard is a cause of its relation."""
VehicleMotion = Literal[
    "passes_yellow", "stops_at_yellow", "blocks_junction", "drives_wrong_way"
]  # fmt: skip
"""How a vehicle drives: over its stop line while the light is yellow; it brakes hard for that;
it stands in the junction while its light is red; or comes to the junction in an exit lane."""

Density = Literal["low", "medium", "high"]
Subtype = Literal[
    "car", "van", "taxi", "truck", "bus", "motorcycle",
    "emergency", "ambulance", "fire_engine", "police_car",
]  # fmt: skip
TimeOfDay = Annotated[str, Field(pattern=r"^([01]\d|2[0-3]):[0-5]\d(-([01]\d|2[0-3]):[0-5]\d)?$")]


MOST_AGENTS, MOST_RELATIONS, MOST_OBJECTS = 12, 12, 6
"""Named agents, relations between them, and standing objects that one graph holds."""


MOST_BACKGROUND = 60
"""Background agents of a class that a request may ask for."""


class AgentNode(Model):
    """A vertex of the social graph (paper 3.1). None means: left free."""

    id: AgentId
    type: AgentClass
    subtype: Subtype | None = None
    entry: Compass | None = Field(default=None, description="side the agent comes from")
    exit: Compass | None = Field(default=None, description="side the agent leaves towards")
    movement: Movement | None = None
    crosswalk: Compass | None = Field(default=None, description="leg that a pedestrian crosses")
    runs_red: bool = Field(default=False, description="the text says it ignores a red light")
    reaction: AskedReaction | None = Field(default=None, exclude_if=is_left_out)
    motion: PedestrianMotion | VehicleMotion | None = Field(default=None, exclude_if=is_left_out)
    members: int | None = Field(
        default=None, ge=2, le=8, exclude_if=is_left_out, description="of a group that walks as one"
    )

    @model_validator(mode="after")
    def _check_name(self) -> Self:
        if not self.id.startswith(self.type):
            raise ValueError(f"{self.id} is of type {self.type}; an id begins with its type")
        if self.motion in get_args(PedestrianMotion) and self.type != "pedestrian":
            raise ValueError(f"{self.id} is no pedestrian; only one of those {self.motion}")
        if self.motion in get_args(VehicleMotion) and self.type == "pedestrian":
            raise ValueError(f"{self.id} is no vehicle; only one of those {self.motion}")
        if self.reaction in get_args(EvasionOnFoot) and self.type != "pedestrian":
            raise ValueError(f"{self.id} is no pedestrian; only one of those {self.reaction}")
        if self.reaction == "swerves" and self.type == "pedestrian":
            raise ValueError(f"{self.id} is no vehicle; only one of those swerves")
        if self.members is not None and self.type != "pedestrian":
            raise ValueError(f"{self.id} is no pedestrian; only those walk in groups")
        return self


class RelationEdge(Model):
    """A directed edge of the social graph; `from` gives way, follows, or strikes.

    Attributes:
        kind: collision kind, where the text names one (T-bone = angle, ...).
        cause: how it comes about, where the text says so.
        braker: the vehicle that brakes hard or late, where the cause is `late_brake`.
        manoeuvre: how it comes about in one lane, where the text says so.
        pattern: id of the one relation file that may play it, where the text uses its phrase.
        target_pet, target_ttc, impact_speed: severity asked for [s, s, m/s].
        point_from, point_to: where on either vehicle a collision strikes, where the text says so.
        first: the agent that leaves the two's conflict zone first; in a collision, enters it first.
        strikes: the agent that strikes the other, where the text says so.
    """

    type: RelationType
    from_: AgentId = Field(alias="from")
    to: AgentId
    kind: CollisionKind | None = None
    cause: Cause | None = None
    braker: AgentId | None = None
    manoeuvre: Manoeuvre | None = Field(default=None, exclude_if=is_left_out)
    pattern: str | None = Field(default=None, max_length=64)
    target_pet: float | None = Field(default=None, ge=0, le=8)
    target_ttc: float | None = Field(default=None, ge=0, le=8)
    impact_speed: float | None = Field(default=None, gt=0, le=20)
    point_from: ImpactPoint | None = None
    point_to: ImpactPoint | None = None
    first: AgentId | None = Field(default=None, exclude_if=is_left_out)
    strikes: AgentId | None = Field(default=None, exclude_if=is_left_out)

    @model_validator(mode="after")
    def _check_two_agents(self) -> Self:
        if self.from_ == self.to:
            raise ValueError(f"{self.type} needs two different agents, got {self.to} twice")
        if self.braker not in (None, self.from_, self.to):
            raise ValueError(f"braker must be {self.from_} or {self.to}, got {self.braker}")
        if self.first not in (None, self.from_, self.to):
            raise ValueError(f"first must be {self.from_} or {self.to}, got {self.first}")
        if self.strikes not in (None, self.from_, self.to):
            raise ValueError(f"strikes must be {self.from_} or {self.to}, got {self.strikes}")
        return self

    @property
    def brakes(self) -> bool:
        """Whether one of the two of a near miss brakes hard, and so lets the other pass first."""
        return self.target_ttc is not None or self.cause == "late_brake"

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
    of: _VehicleId
    side: EntrySide

    @model_validator(mode="after")
    def _check_two_agents(self) -> Self:
        if self.agent == self.of:
            raise ValueError(f"an entry is tied to another agent's, got {self.of} twice")
        return self


ObjectKind = Literal[
    "parked", "double_parked", "stalled", "bus_stop", "box", "bin", "container"
]  # fmt: skip
"""What stands: vehicles at the kerb, beside those parked there, in a lane, a bus at its stop; a
cabinet or kiosk, a litter bin, a shipping container."""

Encounter = Literal[
    "goes_round", "waits_behind", "hits", "stops_short", "waits_then_passes", "queues", "doored"
]  # fmt: skip
"""What a vehicle or rider does about an object in its way: it also brakes hard and stops just short
of it, goes round it after a wait, stands behind who waits there, or rides into the door of a parked
vehicle that opens just before (dooring)."""

FIGURES: dict[Encounter, tuple[str, str, float, float]] = {
    "goes_round": ("clearance", "m", 0.15, 2.5),
    "waits_behind": ("gap", "m", 0.5, 6.0),
    "hits": ("speed", "m/s", 1.0, 18.0),
    "stops_short": ("gap", "m", 0.3, 2.0),
    "waits_then_passes": ("waits", "s", 1.0, 12.0),
    "queues": ("gap", "m", 0.5, 6.0),
    "doored": ("speed", "m/s", 1.0, 18.0),
}
"""What may be asked of each: the figure that the checker measures, its unit, least and most."""

ObjectId = Annotated[str, Field(pattern=r"^object-[1-9][0-9]*$", max_length=32)]
STANDING_VEHICLES = ("parked", "double_parked", "stalled", "bus_stop")


def _check_figure(name: str, how: Encounter, figure: tuple[float, float] | None) -> None:
    what, unit, least, most = FIGURES[how]
    if figure is not None and not least <= figure[1] <= most + 1.0:
        raise ValueError(f"{name}: {what} of who {how} must be {least:g} to {most:g} {unit}")
    if figure is not None and figure[0] >= figure[1]:
        raise ValueError(f"{name}: {what} must be two rising numbers, in {unit}")


class Meeting(Model):
    """One more agent that meets an object, after those before it.

    Attributes:
        figure: range of the figure of `FIGURES`, where one is asked for.
    """

    agent: _VehicleId
    encounter: Encounter
    figure: tuple[float, float] | None = Field(default=None, exclude_if=is_left_out)


class ObjectNode(Model):
    """Something that stands all the time and takes no part (SEMANTICS 8).

    Attributes:
        subtype: of a vehicle; a car where the text leaves it open, a bus at a bus stop.
        leg: the arm it stands on; side: that of the approach (`entry`) or of the exit; lane: the
            outermost one on that side, as the traffic there sees it.
        hides: the pedestrian or rider that it hides from the vehicle `hidden_from`, up to `lead`
            before what the two do.
        lead: least and most seconds between the first free line of sight and the event.
        beyond: the object that hides a pedestrian stepping out between it and this one.
        met_by: whose way it is in, and `encounter` what that one does about it, with a `figure`
            in that range (`FIGURES`); others: others that meet it, one after the other.
    """

    id: ObjectId
    kind: ObjectKind
    subtype: Subtype | None = None
    leg: Compass | None = None
    side: Literal["entry", "exit"] | None = None
    lane: Literal["left", "right"] | None = Field(default=None, exclude_if=is_left_out)
    hides: AgentId | None = None
    hidden_from: AgentId | None = None
    lead: tuple[float, float] | None = None
    beyond: ObjectId | None = Field(default=None, exclude_if=is_left_out)
    met_by: _VehicleId | None = Field(default=None, exclude_if=is_left_out)
    encounter: Encounter | None = Field(default=None, exclude_if=is_left_out)
    figure: tuple[float, float] | None = Field(default=None, exclude_if=is_left_out)
    others: tuple[Meeting, ...] = Field(default=(), max_length=3, exclude_if=is_left_out)

    @model_validator(mode="after")
    def _check_consistency(self) -> Self:
        if self.subtype is not None and self.kind not in STANDING_VEHICLES:
            raise ValueError(f"{self.id}: a {self.kind} has no subtype")
        if (self.hides is None) != (self.hidden_from is None):
            raise ValueError(f"{self.id}: hides and hidden_from go together")
        if self.lead is not None and not 0 <= self.lead[0] < self.lead[1] <= 10:
            raise ValueError(f"{self.id}: lead must be two rising numbers of seconds up to 10")
        if (self.met_by is None) != (self.encounter is None):
            raise ValueError(f"{self.id}: met_by and encounter go together")
        if self.encounter is not None and self.kind not in STANDING_VEHICLES:
            raise ValueError(f"{self.id}: a {self.kind} is in no agent's way")
        if self.encounter is None and (self.figure is not None or self.others):
            raise ValueError(f"{self.id}: figure and others need met_by")
        if self.encounter == "doored" and self.kind != "parked":
            raise ValueError(f"{self.id}: only a parked vehicle opens a door, not a {self.kind}")
        if self.encounter == "queues":
            raise ValueError(f"{self.id}: the first behind it waits_behind, the others queue")
        if self.lane is not None and self.kind not in ("stalled", "double_parked"):
            raise ValueError(f"{self.id}: a {self.kind} stands in no lane")
        for each in self.list_meetings():
            _check_figure(self.id, each.encounter, each.figure)
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

    vehicles: int | None = Field(default=None, ge=0, le=MOST_BACKGROUND)
    pedestrians: int | None = Field(default=None, ge=0, le=MOST_BACKGROUND)


class SceneContext(Model):
    """Global context C of the social graph (paper 3.1, SEMANTICS section 3)."""

    density: Density | None = None
    time_of_day: TimeOfDay | None = None
    background: Background | None = None


class SocialGraph(Model):
    """G = (V, E, C). No relations means a normal scene.

    Attributes:
        ties: entries that the text fixes by one another, such as those of oncoming vehicles.
        objects: what stands on the road or the sidewalk; hides or blocks the way.
        measures: figures that the text asks for beside the severity of relations.
        said: what the words of the instruction became.
    """

    agents: tuple[AgentNode, ...] = Field(max_length=MOST_AGENTS)
    relations: tuple[RelationEdge, ...] = Field(default=(), max_length=MOST_RELATIONS)
    ties: tuple[EntryTie, ...] = Field(default=(), max_length=66)
    context: SceneContext = SceneContext()
    objects: tuple[ObjectNode, ...] = Field(
        default=(), max_length=MOST_OBJECTS, exclude_if=is_left_out
    )
    measures: tuple[Measure, ...] = Field(default=(), max_length=24, exclude_if=is_left_out)
    said: tuple[SaidSpan, ...] = Field(default=(), max_length=500)

    @model_validator(mode="after")
    def _check_consistency(self) -> Self:
        ids = [agent.id for agent in self.agents]
        if len(set(ids)) != len(ids):
            raise ValueError("agent ids must be unique")
        for edge in self.relations:
            for name in (edge.from_, edge.to):
                if name not in ids:
                    known = ", ".join(ids) or "none"
                    raise ValueError(f"{edge.type}: {name} is not among the agents, {known}")
        self._check_chains()
        for tie in self.ties:
            if not {tie.agent, tie.of} <= set(ids):
                raise ValueError("a tie of entries names an agent that is not in the scene")
        self._check_objects()
        for each in self.measures:
            if not {each.agent, each.other or each.agent} <= set(ids):
                raise ValueError(f"{each.kind} is asked of an agent that is not in the scene")
        return self

    def _check_chains(self) -> None:
        """Check that who is pushed into another vehicle is struck by a third."""
        struck = {edge.to for edge in self.relations if edge.type == "collide_at"}
        for edge in self.relations:
            if edge.manoeuvre == "pushed" and edge.from_ not in struck:
                raise ValueError(f"{edge.from_} is pushed into {edge.to}, but no agent strikes it")

    def _check_objects(self) -> None:
        names = [each.id for each in self.objects]
        if len(set(names)) != len(names):
            raise ValueError("object ids must be unique")
        bound = {frozenset((edge.from_, edge.to)) for edge in self.relations}
        hiding = {each.id for each in self.objects if each.hides is not None}
        for each in self.objects:
            if each.beyond is not None and each.beyond not in hiding - {each.id}:
                raise ValueError(f"{each.id} is beyond {each.beyond}, which hides no agent")
            pair = frozenset((each.hides, each.hidden_from))
            if each.hides is not None and pair not in bound:
                raise ValueError(
                    f"{each.id} hides {each.hides} from {each.hidden_from}, but no relation binds "
                    "the two"
                )
            if each.hides is not None and each.hides.startswith("vehicle"):
                raise ValueError(f"{each.id} can hide a pedestrian or rider, not {each.hides}")
        self._check_encounters()

    def _check_encounters(self) -> None:
        """Check that agents meeting an object exist, meet one only, and pass it only on the way
        to another relation."""
        met = [(own, each) for own in self.objects for each in own.list_meetings()]
        busy = {name for edge in self.relations for name in (edge.from_, edge.to)}
        ids = {agent.id for agent in self.agents}
        for own, each in met:
            if each.agent not in ids:
                raise ValueError(f"{own.id} is met by {each.agent}, which is not in the scene")
            if sum(other.agent == each.agent for _, other in met) > 1:
                raise ValueError(f"{each.agent} can meet one object only")
            if each.encounter != "goes_round" and each.agent in busy:
                raise ValueError(f"{each.agent} stops at {own.id}, so no relation can bind it")

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
