"""The constraint language as a typed tree (paper 3.3); its text form is parsed by `dsl_validator`.

A program is a conjunction of clauses about agents, checked on candidates (unary clauses) or
solved for (pair clauses). Metres, seconds, metres per second.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Literal, Self, TypeVar

from pydantic import Field, model_validator

from scenewright.scene.base import AgentId, Compass, Model
from scenewright.scene.kinds import KindOf, get_kind, list_shipped
from scenewright.scene.social import CollisionKind, ImpactPoint

_ModelT = TypeVar("_ModelT", bound=Model)

VehicleId = Annotated[str, Field(pattern=r"^vehicle-[1-9][0-9]*$", max_length=32)]
OnLaneId = Annotated[str, Field(pattern=r"^(vehicle|cyclist|scooter)-[1-9][0-9]*$", max_length=32)]
OnFootwayId = Annotated[
    str, Field(pattern=r"^(pedestrian|cyclist|scooter)-[1-9][0-9]*$", max_length=32)
]


if TYPE_CHECKING:
    MotionName = str
else:
    MotionName = Literal[tuple(k.clause for k in list_shipped("motion") if k.clause)]
"""Clauses that stand for a motion which the solver has a template for."""


class _Pair(Model):
    """Two different agents."""

    first: AgentId
    second: AgentId

    @model_validator(mode="after")
    def _differ(self) -> Self:
        return _check_two_agents(self, self.first, self.second)


class _Range(Model):
    """A clause with a range [low, high], each with bounds of its own."""

    if TYPE_CHECKING:
        low: float
        high: float

    @model_validator(mode="after")
    def _check_order(self) -> Self:
        if self.low > self.high:
            raise ValueError(f"range [{self.low:g}, {self.high:g}] is empty")
        return self


class OnRoad(Model):
    """At least 98 % of the path of a vehicle or rider lies on the road."""

    clause: Literal["on_road"] = "on_road"
    agent: OnLaneId


class OnWalkable(Model):
    """At least 98 % of the path of a pedestrian or rider lies on walkable area or a crosswalk."""

    clause: Literal["on_walkable"] = "on_walkable"
    agent: OnFootwayId


class MinLength(Model):
    """The path is at least this long [m]."""

    clause: Literal["min_length"] = "min_length"
    agent: AgentId
    metres: float = Field(gt=0, le=500)


class PassesThrough(Model):
    """The path crosses the crosswalk, the leg's roadway or the junction."""

    clause: Literal["passes_through"] = "passes_through"
    agent: AgentId
    region: Literal["crosswalk", "leg", "junction"]
    leg: Compass | None = None

    @model_validator(mode="after")
    def _check_leg(self) -> Self:
        if (self.leg is None) != (self.region == "junction"):
            raise ValueError("crosswalk and leg need a direction, junction takes none")
        return self


class SpeedBetween(_Range):
    """The free speed on a straight lies in [low, high] [m/s]."""

    clause: Literal["speed"] = "speed"
    agent: AgentId
    low: float = Field(ge=0, le=20)
    high: float = Field(gt=0, le=20)


class Near(_Pair):
    """The two paths come within this distance of one another [m]."""

    clause: Literal["near"] = "near"
    metres: float = Field(gt=0, le=200)


class SameLane(_Pair):
    """The two paths share a lane for at least this long [m]."""

    clause: Literal["same_lane"] = "same_lane"
    metres: float = Field(gt=0, le=200)


class Before(_Pair):
    """`first` leaves the pair's conflict zone before `second` enters it; of two that touch there,
    it enters the zone first."""

    clause: Literal["before"] = "before"


class Strikes(_Pair):
    """Of two that touch, `first` strikes: the other stands, or `first` alone is touched at its
    front, or it is the faster."""

    clause: Literal["strikes"] = "strikes"


class TimeGap(_Range, _Pair):
    """The pair's PET lies in [low, high] [s] (SEMANTICS section 4)."""

    clause: Literal["time_gap"] = "time_gap"
    low: float = Field(ge=0, le=30)
    high: float = Field(gt=0, le=30)


class Headway(_Range, _Pair):
    """`first` follows `second` in one lane at a time headway in [low, high] [s]."""

    clause: Literal["headway"] = "headway"
    low: float = Field(gt=0, le=10)
    high: float = Field(gt=0, le=10)


CONTACT_CAUSE = KindOf("cause", "manoeuvre", trait="of_contact")
"""How two come to touch, as far as a clause says so."""


class Contact(_Pair):
    """The two touch; `kind` restricts how, `speed` [m/s] is that of `first` at contact.

    Attributes:
        point_first, point_second: where on either vehicle the contact lies.
        cause: how it comes about, `first` being `from` or `braker` of its kind.
    """

    clause: Literal["contact"] = "contact"
    kind: CollisionKind | None = None
    speed: float | None = Field(default=None, gt=0, le=20)
    point_first: ImpactPoint | None = None
    point_second: ImpactPoint | None = None
    cause: Annotated[str, CONTACT_CAUSE] | None = None

    @model_validator(mode="after")
    def _check_vehicles(self) -> Self:
        for name, point in ((self.first, self.point_first), (self.second, self.point_second)):
            if point is not None and name.startswith("pedestrian"):
                raise ValueError(f"{name} is a pedestrian, which has no {point}")
        if self.cause is not None and self.first.startswith("pedestrian"):
            raise ValueError(f"{self.first} is a pedestrian, which does not brake")
        return self


class GivesWay(_Pair):
    """`first` slows or stops upstream of the conflict zone until `second` has left it."""

    clause: Literal["gives_way"] = "gives_way"


class BrakesFor(_Range, _Pair):
    """`first` brakes hard for `second`, at more than 5 m/s^2, and lets it pass.

    The least path TTC of the two lies in [low, high] [s] (SEMANTICS section 4).
    """

    clause: Literal["brakes_for"] = "brakes_for"
    first: VehicleId
    low: float = Field(ge=0, le=8)
    high: float = Field(gt=0, le=8)


class PassesBeside(_Range, _Pair):
    """`first` overtakes `second` at a least clearance in [low, high] [m], both moving."""

    clause: Literal["passes_beside"] = "passes_beside"
    low: float = Field(ge=0, le=10)
    high: float = Field(gt=0, le=10)


AgentFigureName = Literal[
    "kept_speed", "line_speed", "braking", "acceleration", "wait", "line_distance"
]
PairFigureName = Literal[
    "contact_speed", "time_headway", "gap", "ttc", "time", "front_point",
    "front_point_left", "front_point_right", "side_point",
]  # fmt: skip


class AgentFigure(_Range):
    """A figure of the agent's motion in the scene lies in [low, high]; units as in `UNITS`."""

    clause: AgentFigureName
    agent: AgentId
    low: float = Field(ge=0, le=100)
    high: float = Field(ge=0, le=100)


class PairFigure(_Range, _Pair):
    """A figure of what happens between the two lies in [low, high]; units as in `UNITS`."""

    clause: PairFigureName
    low: float = Field(ge=0, le=100)
    high: float = Field(ge=0, le=100)


class StopsBehind(_Range, _Pair):
    """`second` brakes hard ahead of `first` in one lane, which stops behind it without a contact.

    The least path TTC of the two lies in [low, high] [s] (SEMANTICS section 4).
    """

    clause: Literal["stops_behind"] = "stops_behind"
    first: VehicleId
    second: VehicleId
    low: float = Field(ge=0, le=8)
    high: float = Field(gt=0, le=8)


class RunsRed(Model):
    """The agent enters the junction or the crosswalk against its red light."""

    clause: Literal["runs_red"] = "runs_red"
    agent: AgentId


class RunsYellow(Model):
    """The vehicle or rider enters the junction while its light is yellow."""

    clause: Literal["runs_yellow"] = "runs_yellow"
    agent: AgentId


class AgentMotion(Model):
    """The agent moves as the kind of motion says that the clause stands for."""

    clause: MotionName
    agent: AgentId

    @model_validator(mode="after")
    def _fit(self) -> Self:
        agents = next(k.agents for k in list_shipped("motion") if k.clause == self.clause)
        if self.agent.partition("-")[0] not in agents:
            raise ValueError(f"{self.agent} is no {agents[0]}")
        return self


class NoReaction(Model):
    """The agent does not react to who threatens it."""

    clause: Literal["no_reaction"] = "no_reaction"
    agent: AgentId


REACTS = KindOf("reaction", trait="reacts")
"""Ways of reacting, without the one that is none."""


class Reacts(Model):
    """The agent reacts to who threatens it, in this way."""

    clause: Literal["reacts"] = "reacts"
    agent: AgentId
    how: Annotated[str, REACTS]

    @model_validator(mode="after")
    def _fit(self) -> Self:
        if self.agent.partition("-")[0] not in get_kind("reaction", self.how).agents:
            raise ValueError(f"{self.agent} is no agent that {self.how.replace('_', ' ')}")
        return self


class NoInteraction(Model):
    """Clearance >= 0.5 m and PET > 1.5 s between the pair; without `second`: with all agents."""

    clause: Literal["no_interaction"] = "no_interaction"
    first: AgentId
    second: AgentId | None = None

    @model_validator(mode="after")
    def _differ(self) -> Self:
        return _check_two_agents(self, self.first, self.second)


UnaryClause = (
    OnRoad
    | OnWalkable
    | MinLength
    | PassesThrough
    | SpeedBetween
    | RunsRed
    | RunsYellow
    | AgentFigure
    | AgentMotion
    | NoReaction
    | Reacts
)
PairClause = (
    Near
    | SameLane
    | Before
    | Strikes
    | TimeGap
    | Headway
    | Contact
    | GivesWay
    | BrakesFor
    | PassesBeside
    | StopsBehind
    | NoInteraction
    | PairFigure
)
Figure = SpeedBetween | TimeGap | Headway | AgentFigure | PairFigure
Clause = Annotated[UnaryClause | PairClause, Field(discriminator="clause")]


class ConstraintProgram(Model):
    """A conjunction of clauses."""

    clauses: tuple[Clause, ...] = ()


def _check_two_agents(model: _ModelT, first: str, second: str | None) -> _ModelT:
    if first == second:
        raise ValueError(f"needs two different agents, got {first} twice")
    return model
