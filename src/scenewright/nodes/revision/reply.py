"""What a model may say of a turn: the reply model, its schema for a scene, what it amounts to."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from itertools import count, islice
from typing import Annotated, Any, Literal, Self, get_args

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from scenewright.backends.offline import build_clarification
from scenewright.errors import Rejected
from scenewright.nodes.scene_planner.reply import (
    TIME,
    build_manoeuvre_schema,
    build_motion_schema,
    build_order_schema,
    build_point_schema,
    build_severity_schema,
    build_subtype_schema,
    complete_plan,
)
from scenewright.nodes.schema import (
    Schema,
    build_array,
    build_enum,
    build_integer,
    build_number,
    build_object,
    build_reference,
    build_text,
)
from scenewright.scene.base import RIDERS, AgentClass, AgentId, Model
from scenewright.scene.edits import (
    AddAgent,
    ChangeAgent,
    ChangeContext,
    ComeLater,
    DeclinedTurn,
    Edit,
    Edits,
    MoveStop,
    NewScene,
    Reading,
    Redraw,
    Relate,
    RemoveAgent,
    SetBackground,
    SetPace,
    Situation,
    Unrelate,
    WaitLonger,
    apply_edits,
)
from scenewright.scene.kinds import list_names
from scenewright.scene.rejection import Rejection
from scenewright.scene.route_table import WAY_FIELDS, RouteDescription, resolve_route
from scenewright.scene.social import (
    MOST_BACKGROUND,
    AgentNode,
    Density,
    RelationEdge,
    RelationType,
    SocialGraph,
)

_MOST_EDITS = 12
_NEW = 2
"""Ids that are free for a new agent, of each class."""

_IN_GRAPH = (AddAgent, ChangeAgent, Relate, Unrelate, ChangeContext)
"""Edits that leave everything as it is where they leave the graph."""


class _EditLine(BaseModel):
    model_config = ConfigDict(extra="forbid")


class AgentLine(_EditLine):
    """An agent that changes, or is new."""

    edit: Literal["change_agent", "add_agent"]
    agent: AgentId
    subtype: str | None = None
    entry: str | None = None
    exit: str | None = None
    movement: str | None = None
    crosswalk: str | None = None
    runs_red: bool | None = None
    motion: str | None = None
    members: int | None = None


class RemoveLine(_EditLine):
    """An agent that is removed."""

    edit: Literal["remove_agent"]
    agent: AgentId


class RedrawLine(_EditLine):
    """An agent, or all agents, to take another path."""

    edit: Literal["redraw"]
    agent: AgentId | None = None


class RelateLine(_EditLine):
    """What is to happen between two; `none` ends it."""

    edit: Literal["relate"]
    from_: AgentId = Field(alias="from")
    to: AgentId
    type: RelationType | Literal["none"]
    kind: str | None = None
    cause: str | None = None
    manoeuvre: str | None = None
    target_pet: float | None = None
    target_ttc: float | None = None
    impact_speed: float | None = None
    point_from: str | None = None
    point_to: str | None = None
    first: AgentId | None = None


class PaceLine(_EditLine):
    """An agent that becomes slower or faster: by a factor, or at a speed [m/s]."""

    edit: Literal["set_pace"]
    agent: AgentId
    factor: float | None = Field(default=None, gt=0)
    speed: float | None = Field(default=None, gt=0)

    @model_validator(mode="after")
    def _check_one_pace(self) -> Self:
        if (self.factor is None) == (self.speed is None):
            raise ValueError("set_pace needs either 'factor' or 'speed'")
        return self


class AmountLine(_EditLine):
    """A stop that is to be further along [m], a wait that is longer, an entry that is later [s]."""

    edit: Literal["move_stop", "wait_longer", "come_later"]
    agent: AgentId
    by: float


class ContextLine(_EditLine):
    """What shall be new of density and time of day, and how many others there shall be."""

    edit: Literal["change_context"]
    density: str | None = None
    time_of_day: str | None = None
    vehicles: int | None = None
    pedestrians: int | None = None


Line = (
    AgentLine | RemoveLine | RedrawLine | RelateLine | PaceLine | AmountLine | ContextLine
)  # fmt: skip


class AskLine(_EditLine):
    """Words that may mean any of several agents."""

    about: str = Field(min_length=1, max_length=40)
    among: tuple[AgentId, ...] = Field(min_length=2, max_length=24)


class EditsReply(Model):
    """Edits; or in their place a question, a scene of its own or a refusal."""

    edits: tuple[Annotated[Line, Field(discriminator="edit")], ...] = Field(
        default=(), max_length=_MOST_EDITS
    )
    ask: AskLine | None = None
    fresh: bool | None = None
    refused: Literal["out_of_scope", "contradictory", "impossible", "no_change"] | None = None
    reason: str | None = Field(default=None, max_length=400)

    @model_validator(mode="after")
    def _check_one_answer(self) -> Self:
        kinds = [self.edits, self.ask, self.fresh, self.refused]
        if sum(bool(each) for each in kinds) != 1:
            raise ValueError("say one thing: edits, or with none of them ask, fresh or refused")
        if self.refused and not self.reason:
            raise ValueError("a refusal needs its 'reason'")
        return self


_RIDES = re.compile(r"cycl|bik|scoot", re.IGNORECASE)


def list_new_ids(situation: Situation, words: str = "") -> list[str]:
    """Unused ids, the first of each class; of riders where the words speak of them."""
    taken = {each.id for each in situation.present} | {e.id for e in situation.graph.agents}
    found: list[str] = []
    for kind in get_args(AgentClass):
        if kind in RIDERS and not _RIDES.search(words):
            continue
        free = (name for n in count(1) if (name := f"{kind}-{n}") not in taken)
        found += islice(free, _NEW)
    return found


def build_edits_schema(
    situation: Situation, named: Sequence[str], ways: Sequence[RouteDescription], words: str
) -> Schema:
    """The reply's schema: agents, sides and new ids are those there are.

    Args:
        named: ids of those that the words may mean.
        words: figures and places on a vehicle are asked for where they may speak of them.
    """
    agent, side = build_reference("agent"), build_reference("side")
    node = {
        "subtype": build_subtype_schema(words),
        "entry": side,
        "exit": side,
        "movement": build_enum(way.movement for way in ways),
        "crosswalk": side,
        "runs_red": {"type": "boolean"},
        **build_motion_schema(words),
    }
    relation: dict[str, Schema] = {
        "kind": build_enum(list_names("collision")),
        "cause": build_enum(list_names("cause")),
        **build_order_schema(words, agent),
    }
    relation |= build_severity_schema(words) | build_manoeuvre_schema(words)
    ends = {"from": agent, "to": agent, "type": build_enum((*get_args(RelationType), "none"))}
    context = {
        "density": build_enum(get_args(Density)),
        "time_of_day": build_text(TIME),
        "vehicles": build_integer(0, MOST_BACKGROUND),
        "pedestrians": build_integer(0, MOST_BACKGROUND),
    }
    forms = [
        _build_edit_schema(("change_agent", "add_agent"), {"agent": agent}, node),
        _build_edit_schema(("remove_agent", "redraw"), {}, {"agent": agent}),
        _build_edit_schema(("relate",), ends, relation),
        _build_edit_schema(
            ("set_pace",),
            {"agent": agent},
            {"factor": build_number(0.3, 2), "speed": build_number(0.1, 20)},
        ),
        _build_edit_schema(
            ("move_stop", "wait_longer", "come_later"),
            {"agent": agent, "by": build_number(-20, 20)},
        ),
        _build_edit_schema(("change_context",), {}, context),
    ]
    asked = {"about": build_reference("text"), "among": build_array(agent, least=2, most=6)}
    return build_object(
        {
            "edits": build_array({"anyOf": forms}, most=_MOST_EDITS),
            "ask": build_object(asked, required=asked),
            "fresh": {"type": "boolean"},
            "refused": build_enum(("out_of_scope", "contradictory", "impossible", "no_change")),
            "reason": build_reference("text"),
        },
        required=("edits",),
        defs={
            "text": build_text(),
            "agent": build_enum([*named, *list_new_ids(situation, words)]),
            "side": build_enum(side for way in ways for side in (way.entry, way.exit)),
            **build_point_schema(words),
        },
    )


def _build_edit_schema(
    kinds: Sequence[str], needed: Mapping[str, Schema], at_will: Mapping[str, Schema] | None = None
) -> Schema:
    keys = {"edit": build_enum(kinds), **needed}
    return build_object({**keys, **(at_will or {})}, required=keys)


def to_reading(
    reply: EditsReply,
    situation: Situation,
    *,
    ways: Sequence[RouteDescription],
    chosen: Mapping[str, str],
) -> Reading:
    """What the reply amounts to, as a reading of the words.

    Raises:
        Rejected: it names what does not exist, or changes nothing; says what.
    """
    if reply.refused is not None:
        return DeclinedTurn(code=reply.refused, reason=str(reply.reason))
    if reply.fresh:
        return NewScene()
    if reply.ask is not None:
        if chosen:
            choices = ", ".join(f"{noun}: {name}" for noun, name in chosen.items())
            raise _build_rejection(f"ask: it was answered already ({choices}); give the edits")
        here = {each.id: each for each in situation.present}
        for name in reply.ask.among:
            if name not in here:
                raise _build_rejection(f"ask: there is no {name} in the scene")
        found = [here[name] for name in dict.fromkeys(reply.ask.among)]
        if len(found) < 2:
            raise _build_rejection("ask: there is nothing to ask where only one agent is meant")
        return build_clarification(found, reply.ask.about)
    reader = _ReplyReader(situation, ways)
    for line in reply.edits:
        reader.take(line)
    if not reader.found:
        raise _build_rejection("these edits leave everything as it is")
    return Edits(edits=tuple(reader.found))


class _ReplyReader:
    """The edits so far, and the graph that they leave."""

    def __init__(self, situation: Situation, ways: Sequence[RouteDescription]) -> None:
        self.found: list[Edit] = []
        self._graph, self._ways = situation.graph, ways
        self._present = {each.id: each for each in situation.present}
        self._free = list_new_ids(situation, "cyclist")

    def take(self, line: Line) -> None:
        """One line more.

        Raises:
            Rejected: it cannot be; says why.
        """
        try:
            made = (
                self._build_context_edits(line)
                if isinstance(line, ContextLine)
                else (self._build_edit(line),)
            )
        except ValidationError as error:
            first = error.errors(include_url=False)[0]
            where = ".".join(str(part) for part in first["loc"])
            raise _build_rejection(f"{line.edit}: {where}: {first['msg']}") from error
        for edit in made:
            graph = apply_edits(self._graph, (edit,))
            if not (isinstance(edit, _IN_GRAPH) and graph == self._graph):
                self.found.append(edit)
            self._graph = graph

    def _build_edit(self, line: Line) -> Edit:
        match line:
            case AgentLine(edit="add_agent"):
                if line.agent in self._present or line.agent in {e.id for e in self._graph.agents}:
                    raise _build_rejection(
                        f"add_agent: {line.agent} is there already; take {self._free[0]}"
                    )
                node = {"id": line.agent, "type": line.agent.partition("-")[0]}
                return AddAgent(node=self._fit_route(AgentNode.model_validate(node), line))
            case AgentLine():
                self._require_participant(line.agent)
                if not _list_fields(line):
                    raise _build_rejection(
                        f"change_agent: nothing is said that {line.agent} shall be"
                    )
                return ChangeAgent(node=self._fit_route(self._graph.agent(line.agent), line))
            case RemoveLine():
                return RemoveAgent(agent=self._require_present(line.agent))
            case RedrawLine():
                return Redraw(
                    agent=None if line.agent is None else self._require_present(line.agent)
                )
            case RelateLine():
                return self._build_relation_edit(line)
            case PaceLine():
                agent = self._present[self._require_present(line.agent)]
                factor = line.factor or (line.speed or 0.0) / max(agent.speed, 0.1)
                return SetPace(agent=line.agent, factor=round(factor, 3))
            case AmountLine(edit="move_stop"):
                return MoveStop(agent=self._require_stop(line.agent), metres=line.by)
            case AmountLine(edit="wait_longer"):
                return WaitLonger(agent=self._require_stop(line.agent), seconds=line.by)
            case AmountLine():
                return ComeLater(agent=self._require_present(line.agent), seconds=line.by)
        raise TypeError(f"{line.edit} is read elsewhere")

    def _build_relation_edit(self, line: RelateLine) -> Relate | Unrelate:
        for name in (line.from_, line.to):
            self._require_participant(name)
        if line.type != "none":
            fields = line.model_dump(by_alias=True, exclude={"edit"})
            return Relate(edge=RelationEdge.model_validate(fields))
        pair = {line.from_, line.to}
        if not any({each.from_, each.to} == pair for each in self._graph.relations):
            raise _build_rejection(f"nothing happens between {line.from_} and {line.to} as it is")
        return Unrelate(first=line.from_, second=line.to)

    def _require_present(self, name: str) -> str:
        if name not in self._present:
            raise _build_rejection(f"there is no {name} in the scene")
        return name

    def _require_stop(self, name: str) -> str:
        agent = self._present[self._require_present(name)]
        if not agent.stops and agent.slows_to is None:
            raise _build_rejection(f"{name} does not stop anywhere in this scene")
        return name

    def _require_participant(self, name: str) -> None:
        if name in {each.id for each in self._graph.agents}:
            return
        if name in self._present:
            raise _build_rejection(f"{name} is one of the others; add_agent an agent of an event")
        raise _build_rejection(f"there is no {name} in the scene; add_agent comes first")

    def _build_context_edits(self, line: ContextLine) -> list[Edit]:
        was, found = self._graph.context, list[Edit]()
        given = {
            "density": line.density or was.density,
            "time_of_day": line.time_of_day or was.time_of_day,
        }
        if line.density or line.time_of_day:
            found.append(ChangeContext.model_validate(given))
        if line.vehicles is not None or line.pedestrians is not None:
            found.append(SetBackground(vehicles=line.vehicles, pedestrians=line.pedestrians))
        if not found:
            raise _build_rejection("change_context: nothing is said that shall be new")
        return found

    def _fit_route(self, node: AgentNode, line: AgentLine) -> AgentNode:
        """The agent with the fields given, and of its former route as much as fits these."""
        fields = _list_fields(line)
        AgentNode.model_validate({"id": node.id, "type": node.type, **fields})
        was = {each: getattr(node, each) for each in WAY_FIELDS}
        way = {each: fields[each] for each in WAY_FIELDS if each in fields}
        if way.items() <= was.items():
            return AgentNode.model_validate({**node.model_dump(), **fields})
        found = resolve_route(node.type, was, way, self._ways)
        if found is None:
            words = ", ".join(f"{key} {value}" for key, value in way.items())
            raise _build_rejection(f"{node.id}: there is no way here with {words}")
        made = AgentNode.model_validate({**node.model_dump(), **fields, **found})
        return complete_plan(SocialGraph(agents=(made,)), self._ways).agents[0]


def _list_fields(line: AgentLine) -> dict[str, Any]:
    return line.model_dump(exclude={"edit", "agent"}, exclude_none=True)


def _build_rejection(detail: str) -> Rejected:
    return Rejected(Rejection(stage="scene_planner", code="contradictory", detail=detail))
