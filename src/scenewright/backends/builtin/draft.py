"""What the reader has understood so far: mutable, before entailments and checks."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field

from scenewright.scene.base import RIDERS, AgentClass
from scenewright.scene.kinds import has_trait
from scenewright.scene.map import IntersectionMap
from scenewright.scene.measures import Measure, MeasureKind
from scenewright.scene.route_table import FOUR_LEGS, RouteDescription, describe_routes
from scenewright.scene.social import (
    AskedReaction,
    ImpactPoint,
    Manoeuvre,
    Motion,
    Refusal,
    SocialGraph,
)

LEFT_OF_HEADING = {"north": "west", "east": "north", "south": "east", "west": "south"}
_FOUR = frozenset({"north", "east", "south", "west"})


class Refused(Exception):
    """The text cannot become a scene; carries the Refusal's code and reason."""

    def __init__(self, code: str, reason: str) -> None:
        super().__init__(reason)
        self.code = code
        self.reason = reason

    def to_refusal(self) -> Refusal:
        """The refusal of the plan."""
        return Refusal.model_validate({"code": self.code, "reason": self.reason})


@dataclass(frozen=True)
class Site:
    """What must be known of the place to read a text about it.

    Attributes:
        compass: the legs' names are true of turns: an agent from the north that turns left leaves
            to the east. So it is wherever all legs are called north, east, south or west.
        left_hand: people drive on the left.
        ways: through the intersection.
        roads: leg and the name of its street; empty where no map is named.
        can_serve: whether the map has ways for a graph; it chooses where a street has several legs.
    """

    compass: bool = True
    left_hand: bool = False
    ways: tuple[RouteDescription, ...] = FOUR_LEGS
    roads: tuple[tuple[str, str], ...] = ()
    can_serve: Callable[[SocialGraph], bool] | None = field(default=None, compare=False)

    @property
    def across(self) -> str:
        """The turn that crosses the way of oncoming vehicles."""
        return "right" if self.left_hand else "left"


def is_compass(legs: Iterable[str]) -> bool:
    """Whether legs of these names lie as they are called (see `Site`)."""
    return _FOUR.issuperset(legs)


def build_site(intersection_map: IntersectionMap) -> Site:
    """What must be known of a map."""
    return Site(
        compass=is_compass(leg.name for leg in intersection_map.legs),
        left_hand=intersection_map.left_hand_traffic,
        ways=describe_routes(intersection_map),
        roads=tuple((leg.name, leg.road) for leg in intersection_map.legs),
    )


@dataclass(eq=False)
class AgentDraft:
    """One agent with what the text says of it.

    Attributes:
        relatives: (word, other agent or None): opposite, mutual, of_left, of_right, same,
            lateral, other, exit_crosswalk, entry_crosswalk.
        head: the noun it was introduced with.
        motion: how a pedestrian crosses, where the text says so; members: of a group on foot.
        reaction: how it reacts to a threat, where the text says so.
        marked: its crosswalk was called a crosswalk, not just a leg.
    """

    type: AgentClass
    subtype: str | None = None
    entry: str | None = None
    exit: str | None = None
    movement: str | None = None
    crosswalk: str | None = None
    runs_red: bool = False
    head: str = ""
    relatives: list[tuple[str, AgentDraft | None]] = field(default_factory=list)
    reaction: AskedReaction | None = None
    motion: Motion | None = None
    members: int | None = None
    marked: bool = False
    edited: set[str] = field(default_factory=set)

    @property
    def rides(self) -> bool:
        """Whether it is a cyclist or the rider of a scooter."""
        return self.type in RIDERS

    @property
    def walks(self) -> bool:
        """Whether it goes as pedestrians do: on foot, or riding on a crosswalk."""
        on_crosswalk = self.movement == "crossing" or self.crosswalk is not None
        return self.type == "pedestrian" or (self.rides and on_crosswalk)

    @property
    def drives(self) -> bool:
        """Whether it goes as vehicles do, on the lanes."""
        return not self.walks


@dataclass(eq=False)
class RelationDraft:
    """One relation with its roles; `kind` and `cause` where the text names them.

    Attributes:
        point_from, point_to: where on either vehicle a collision strikes.
        pattern: id of the relation file whose phrase the text uses.
        braker: the agent that brakes hard or late, where the text says so.
        first: the agent that passes first, where the text says so.
        strikes: the agent that strikes the other, where the text says so.
        manoeuvre: how it comes about in one lane, where the text says so.
    """

    type: str
    from_: AgentDraft
    to: AgentDraft
    kind: str | None = None
    cause: str | None = None
    point_from: ImpactPoint | None = None
    point_to: ImpactPoint | None = None
    pattern: str | None = None
    braker: AgentDraft | None = None
    first: AgentDraft | None = None
    strikes: AgentDraft | None = None
    manoeuvre: Manoeuvre | None = None

    @property
    def ahead(self) -> AgentDraft | None:
        """The agent that comes first by the type of the relation; None where that is left open."""
        if has_trait("manoeuvre", self.manoeuvre, "merges_ahead"):
            return self.from_
        in_one_lane = self.kind == "rear_end" or self.manoeuvre is not None
        return self.to if self.type in ("yield_to", "follow") or in_one_lane else None

    @property
    def ends(self) -> tuple[AgentDraft, AgentDraft]:
        """The two agents, in order."""
        return self.from_, self.to

    @property
    def pair(self) -> frozenset[AgentDraft]:
        """The two agents, unordered."""
        return frozenset(self.ends)

    def get_other(self, agent: AgentDraft) -> AgentDraft:
        """The other one of the two."""
        return self.to if agent is self.from_ else self.from_


@dataclass(eq=False)
class MeasureDraft:
    """A figure that the text asks for, of one agent or between two, in [low, high]."""

    kind: MeasureKind
    agent: AgentDraft
    other: AgentDraft | None
    low: float
    high: float

    def name_agents(self, names: Mapping[AgentDraft, str]) -> Measure | None:
        """The measure with agents by name; None if one has gone."""
        if self.agent not in names or self.other not in (None, *names):
            return None
        return Measure(
            kind=self.kind,
            agent=names[self.agent],
            other=None if self.other is None else names[self.other],
            low=round(self.low, 4),
            high=round(self.high, 4),
        )


@dataclass
class ContextDraft:
    """Density, clock time, explicit background numbers, severity."""

    density: str | None = None
    time_of_day: str | None = None
    vehicles: int | None = None
    pedestrians: int | None = None
    pet: float | None = None
    ttc: float | None = None
    speed: float | None = None


@dataclass
class Draft:
    """The whole text, understood."""

    agents: list[AgentDraft] = field(default_factory=list)
    relations: list[RelationDraft] = field(default_factory=list)
    measures: list[MeasureDraft] = field(default_factory=list)
    context: ContextDraft = field(default_factory=ContextDraft)
    denied: set[str] = field(default_factory=set)
    normal: bool = False
    site: Site = Site()
