"""scene.json: Listing 1 of the paper, plus additive keys (docs/formats.md)."""

from __future__ import annotations

from typing import Any, Literal

from pydantic import Field

from scenewright.scene.account import SaidRecord
from scenewright.scene.base import (
    AgentClass,
    Colour,
    Compass,
    Model,
    Movement,
    Point,
    is_left_out,
)
from scenewright.scene.events import EventZone
from scenewright.scene.measures import MeasureKind
from scenewright.scene.objects import EncounterRecord, ObjectRecord, SightRecord
from scenewright.scene.social import (
    AskedReaction,
    Cause,
    EntrySide,
    ImpactPoint,
    Manoeuvre,
    Motion,
    SocialGraph,
)

SegmentStatus = Literal["keep", "stop", "proceed", "terminate"]


class SceneMeta(Model):
    """Listing 1 `meta` with additive keys; `timestamp` is the time of day [s since midnight].

    Attributes:
        rules: 2 where yields are to end in time and reactions are proven (SEMANTICS 8), 3 where
            nobody stands without a reason, too; older scenes have none and are held to the rules
            that they were made by.
        driven_by: the policy that drove one of its agents; what its prompt says need not happen.
        plan: what it was made from, where that was no text; the prompt lists its fields.
    """

    scene_id: str
    map_id: int
    timestamp: float
    user_prompt: str
    schema_version: Literal[1] = 1
    intersection: str
    step: float
    duration: float
    time_of_day: str
    density: str | None = None
    seed: int
    driven_by: str | None = Field(default=None, exclude_if=is_left_out)
    rules: Literal[2, 3] | None = Field(default=None, exclude_if=is_left_out)
    plan: SocialGraph | None = Field(default=None, exclude_if=is_left_out)

    @property
    def texts(self) -> tuple[str, ...]:
        """The instruction and the later changes that are in force."""
        return tuple(self.user_prompt.split(NEXT_TEXT))


NEXT_TEXT = "; then: "
"""Stands between the texts of a conversation in a prompt."""


class SegmentRecord(Model):
    """One behavioral segment (paper Eq. 5): from `start` to `end` [s], ending at an anchor."""

    start: float
    end: float
    anchor: str
    status: SegmentStatus


class AgentRecord(Model):
    """Listing 1 `agents[]` with additive keys.

    Attributes:
        trajectory: centre positions [m] every `meta.step` from `spawn_time`.
        heading: [rad], one per position.
        waypoints: K = 10 points at equal arc length of the candidate that was selected.
        motion: how a pedestrian is to cross; written only where the request says so.
        reaction: how it is to react to a threat; written only where the request says so.
        group: id of the pedestrian whose group it belongs to, if that is another one.
    """

    id: int
    type: AgentClass
    spawn_time: float
    goal: Point
    trajectory: tuple[Point, ...]
    role: Literal["foreground", "background"]
    name: str
    subtype: str | None = None
    entry: Compass
    exit: Compass
    movement: Movement
    crosswalk: Compass | None = None
    route: str
    heading: tuple[float, ...]
    length: float
    width: float
    segments: tuple[SegmentRecord, ...] = ()
    waypoints: tuple[Point, ...] = ()
    violates_signal: bool = False
    reaction: AskedReaction | None = Field(default=None, exclude_if=is_left_out)
    motion: Motion | None = Field(default=None, exclude_if=is_left_out)
    group: int | None = Field(default=None, exclude_if=is_left_out)


class EventRecord(Model):
    """Listing 1 `events[]` with additive keys; a normal scene has one row with from/to null."""

    type: Literal["collision", "yielding", "near_miss", "follow", "normal"]
    from_: int | None = Field(alias="from")
    to: int | None
    time: float | None
    location: Point | None
    kind: str | None = None
    cause: str | None = None


class RelationRecord(Model):
    """A relation that was asked for, in scene ids: what the proof must find.

    Attributes:
        cause, cause_agent: how it is to come about, and by which agent, where the request says so.
        manoeuvre: how it is to come about in one lane; written only where the request says so.
        zone: where the event must lie; first: who must pass first, or enter
            the zone of a collision first, as the request or its relation file says.
        strikes: who must strike the other in a collision; written only where that is asked for.
        within: figure of the event's evidence -> lowest and highest value that prove it.
    """

    type: Literal["collision", "yielding", "near_miss", "follow"]
    from_: int = Field(alias="from")
    to: int
    kind: str | None = None
    cause: Cause | None = None
    cause_agent: int | None = None
    manoeuvre: Manoeuvre | None = Field(default=None, exclude_if=is_left_out)
    target_pet: float | None = None
    target_ttc: float | None = None
    impact_speed: float | None = None
    point_from: ImpactPoint | None = None
    point_to: ImpactPoint | None = None
    zone: EventZone | None = None
    first: int | None = None
    strikes: int | None = Field(default=None, exclude_if=is_left_out)
    within: dict[str, tuple[float, float]] = Field(default_factory=dict)


class TieRecord(Model):
    """Entries that were to lie to one another in some way: that of `agent` as seen by `of`."""

    agent: int
    of: int
    side: EntrySide


class MeasureRecord(Model):
    """A figure that was asked for, of an agent or between two, in scene ids (`UNITS`)."""

    kind: MeasureKind
    agent: int
    other: int | None = None
    low: float
    high: float


class SignalRecord(Model):
    """A stretch [s] during which the light of a stop line or crosswalk shows one colour."""

    stop_line: str | None = None
    crosswalk: str | None = None
    start: float
    end: float
    colour: Colour


class SceneRecord(Model):
    """A whole scene.json.

    Attributes:
        objects: standing objects; sights: which pedestrian they hide from which driver;
            encounters: what an agent does about an object in its way.
    """

    meta: SceneMeta
    agents: tuple[AgentRecord, ...]
    events: tuple[EventRecord, ...]
    relations: tuple[RelationRecord, ...] = ()
    ties: tuple[TieRecord, ...] = ()
    measures: tuple[MeasureRecord, ...] = Field(default=(), exclude_if=is_left_out)
    signals: tuple[SignalRecord, ...] = ()
    said: tuple[SaidRecord, ...] = ()
    objects: tuple[ObjectRecord, ...] = Field(default=(), exclude_if=is_left_out)
    sights: tuple[SightRecord, ...] = Field(default=(), exclude_if=is_left_out)
    encounters: tuple[EncounterRecord, ...] = Field(default=(), exclude_if=is_left_out)

    def to_json(self) -> dict[str, Any]:
        """Plain JSON with the file's key names."""
        return self.model_dump(mode="json", by_alias=True)

    def to_paper(self) -> dict[str, Any]:
        """Plain JSON with the keys of Listing 1 alone.

        Listing 1 knows collisions and yielding; other events are dropped. Where none is left it
        wants one row `normal` that names two agents: the first two, as far as there are any.
        """
        rows = [event for event in self.events if event.type in ("collision", "yielding")]
        events = [_select_fields(row, PAPER_EVENT) for row in rows]
        if not events:
            ids = [*(agent.id for agent in self.agents[:2]), None, None]
            events = [
                {"type": "normal", "from": ids[0], "to": ids[1], "time": None, "location": None}
            ]
        return {
            "meta": _select_fields(self.meta, PAPER_META),
            "agents": [_select_fields(agent, PAPER_AGENT) for agent in self.agents],
            "events": events,
        }


PAPER_META = ("scene_id", "map_id", "timestamp", "user_prompt")
PAPER_AGENT = ("id", "type", "spawn_time", "goal", "trajectory")
PAPER_EVENT = ("type", "from_", "to", "time", "location")


def _select_fields(model: Model, fields: tuple[str, ...]) -> dict[str, Any]:
    return model.model_dump(mode="json", by_alias=True, include=set(fields))
