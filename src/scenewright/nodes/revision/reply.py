"""What a model may say of a turn: the reply model, its schema for a scene, what it amounts to."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import islice
from typing import Any, Literal, Self, get_args

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from scenewright.backends.offline import build_clarification
from scenewright.errors import Rejected, describe_misfit
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
    speaks_of,
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


_AGENT = (
    "subtype", "entry", "exit", "movement", "crosswalk", "runs_red", "motion", "reaction",
    "members",
)  # fmt: skip
_FORMS = (
    (("change_agent", "add_agent"), ("agent",), _AGENT),
    (("remove_agent", "redraw"), (), ("agent",)),
    (("relate",), ("from", "to", "type"), (
        "kind", "cause", "first", "target_pet", "target_ttc", "impact_speed", "point_from",
        "point_to", "manoeuvre",
    )),
    (("set_pace",), ("agent",), ("factor", "speed")),
    (("move_stop", "wait_longer", "come_later"), ("agent", "by"), ()),
    (("change_context",), (), ("density", "time_of_day", "vehicles", "pedestrians")),
)  # fmt: skip
"""Kinds of edits with the keys that they need, and those that they may have."""


class EditLine(BaseModel):
    """One edit, with the keys of its form.

    Attributes:
        type: what is to happen between `from` and `to`; `none` ends it.
        factor: of the pace; speed: in its place [m/s].
        by: how much further along [m], longer or later [s].
    """

    model_config = ConfigDict(extra="forbid")

    edit: Literal[
        "change_agent", "add_agent", "remove_agent", "redraw", "relate", "set_pace", "move_stop",
        "wait_longer", "come_later", "change_context",
    ]  # fmt: skip
    agent: AgentId | None = None
    subtype: str | None = None
    entry: str | None = None
    exit: str | None = None
    movement: str | None = None
    crosswalk: str | None = None
    runs_red: bool | None = None
    motion: str | None = None
    reaction: str | None = None
    members: int | None = None
    from_: AgentId | None = Field(default=None, alias="from")
    to: AgentId | None = None
    type: RelationType | Literal["none"] | None = None
    kind: str | None = None
    cause: str | None = None
    manoeuvre: str | None = None
    target_pet: float | None = None
    target_ttc: float | None = None
    impact_speed: float | None = None
    point_from: str | None = None
    point_to: str | None = None
    first: AgentId | None = None
    factor: float | None = Field(default=None, gt=0)
    speed: float | None = Field(default=None, gt=0)
    by: float | None = None
    density: str | None = None
    time_of_day: str | None = None
    vehicles: int | None = None
    pedestrians: int | None = None

    @model_validator(mode="after")
    def _check_form(self) -> Self:
        needed, at_will = next(keys for kinds, *keys in _FORMS if self.edit in kinds)
        given = self.model_dump(by_alias=True, exclude_none=True, exclude={"edit"}).keys()
        for key in given - {*needed, *at_will}:
            raise ValueError(f"{self.edit} has no key {key!r}; leave it out")
        for key in needed:
            if key not in given:
                raise ValueError(f"{self.edit} needs {key!r}")
        if self.edit == "set_pace" and (self.factor is None) == (self.speed is None):
            raise ValueError("set_pace needs either 'factor' or 'speed'")
        return self


class AskLine(BaseModel):
    """Words that may mean any of several agents."""

    model_config = ConfigDict(extra="forbid")

    about: str = Field(min_length=1, max_length=40)
    among: tuple[AgentId, ...] = Field(min_length=2, max_length=24)


class EditsReply(Model):
    """Edits; or in their place a question, a scene of its own or a refusal."""

    edits: tuple[EditLine, ...] = Field(default=(), max_length=_MOST_EDITS)
    ask: AskLine | None = None
    fresh: bool | None = None
    refused: Literal["out_of_scope", "contradictory", "impossible", "no_change"] | None = None
    reason: str | None = Field(default=None, max_length=400)

    @model_validator(mode="after")
    def _check_one_answer(self) -> Self:
        kinds = [self.edits, self.ask, self.fresh, self.refused]
        if sum(bool(kind) for kind in kinds) != 1:
            raise ValueError("say one thing: edits, or with none of them ask, fresh or refused")
        if self.refused and not self.reason:
            raise ValueError("a refusal needs its 'reason'")
        return self


def list_new_ids(situation: Situation, words: str = "") -> list[str]:
    """Unused ids, the first of each class; of riders where the words speak of them."""
    found: list[str] = []
    for kind in get_args(AgentClass):
        if kind in RIDERS and not speaks_of("riders", words):
            continue
        found += islice(situation.generate_ids(kind), _NEW)
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
    known: dict[str, Schema] = {
        "agent": agent,
        "subtype": build_subtype_schema(words),
        "entry": side,
        "exit": side,
        "movement": build_enum(way.movement for way in ways),
        "crosswalk": side,
        "runs_red": {"type": "boolean"},
        **build_motion_schema(words),
        "from": agent,
        "to": agent,
        "type": build_enum((*get_args(RelationType), "none")),
        "kind": build_enum(list_names("collision")),
        "cause": build_enum(list_names("cause")),
        **build_order_schema(words, agent),
        **build_severity_schema(words),
        **build_manoeuvre_schema(words),
        "factor": build_number(0.3, 2),
        "speed": build_number(0.1, 20),
        "by": build_number(-20, 20),
        "density": build_enum(get_args(Density)),
        "time_of_day": build_text(TIME),
        "vehicles": build_integer(0, MOST_BACKGROUND),
        "pedestrians": build_integer(0, MOST_BACKGROUND),
    }
    forms = [
        build_object(
            {"edit": build_enum(kinds), **{k: known[k] for k in (*needed, *free) if k in known}},
            required=("edit", *needed),
        )
        for kinds, needed, free in _FORMS
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

    def take(self, line: EditLine) -> None:
        """One line more.

        Raises:
            Rejected: it cannot be; says why.
        """
        try:
            made = self._build_edits(line)
        except ValidationError as error:
            raise _build_rejection(f"{line.edit}: {describe_misfit(error)}") from error
        for edit in made:
            graph = apply_edits(self._graph, (edit,))
            if not (isinstance(edit, _IN_GRAPH) and graph == self._graph):
                self.found.append(edit)
            self._graph = graph

    def _build_edits(self, line: EditLine) -> list[Edit]:
        name, by = str(line.agent), line.by or 0.0
        if line.agent is not None and line.edit not in ("add_agent", "change_agent"):
            self._require_present(name)
        match line.edit:
            case "add_agent":
                if name in self._present or name in {agent.id for agent in self._graph.agents}:
                    raise _build_rejection(
                        f"add_agent: {name} is there already; take {self._free[0]}"
                    )
                node = AgentNode.model_validate({"id": name, "type": name.partition("-")[0]})
                return [AddAgent(node=self._fit_route(node, line))]
            case "change_agent":
                self._require_participant(name)
                if not _list_fields(line):
                    raise _build_rejection(f"change_agent: nothing is said that {name} shall be")
                return [ChangeAgent(node=self._fit_route(self._graph.agent(name), line))]
            case "remove_agent":
                return [RemoveAgent(agent=self._require_present(name))]
            case "redraw":
                return [Redraw(agent=line.agent)]
            case "relate":
                return [self._build_relation_edit(line)]
            case "set_pace":
                factor = line.factor or (line.speed or 0.0) / max(self._present[name].speed, 0.1)
                return [SetPace(agent=name, factor=round(factor, 3))]
            case "move_stop":
                return [MoveStop(agent=self._require_stop(name), metres=by)]
            case "wait_longer":
                return [WaitLonger(agent=self._require_stop(name), seconds=by)]
            case "come_later":
                return [ComeLater(agent=name, seconds=by)]
        return self._build_context_edits(line)

    def _build_relation_edit(self, line: EditLine) -> Relate | Unrelate:
        first, second = str(line.from_), str(line.to)
        for name in (first, second):
            self._require_participant(name)
        if line.type != "none":
            fields = line.model_dump(by_alias=True, exclude={"edit"}, exclude_none=True)
            return Relate(edge=RelationEdge.model_validate(fields))
        if all(edge.pair != {first, second} for edge in self._graph.relations):
            raise _build_rejection(f"nothing happens between {first} and {second} as it is")
        return Unrelate(first=first, second=second)

    def _require_present(self, name: str) -> str:
        if name not in self._present:
            raise _build_rejection(f"there is no {name} in the scene")
        return name

    def _require_stop(self, name: str) -> str:
        agent = self._present[name]
        if not agent.stops and agent.slows_to is None:
            raise _build_rejection(f"{name} does not stop anywhere in this scene")
        return name

    def _require_participant(self, name: str) -> None:
        if name in {agent.id for agent in self._graph.agents}:
            return
        if name in self._present:
            raise _build_rejection(f"{name} is one of the others; add_agent an agent of an event")
        raise _build_rejection(f"there is no {name} in the scene; add_agent comes first")

    def _build_context_edits(self, line: EditLine) -> list[Edit]:
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

    def _fit_route(self, node: AgentNode, line: EditLine) -> AgentNode:
        """The agent with the fields given, and of its former route as much as fits these."""
        fields = _list_fields(line)
        AgentNode.model_validate({"id": node.id, "type": node.type, **fields})
        was = {field: getattr(node, field) for field in WAY_FIELDS}
        way = {field: fields[field] for field in WAY_FIELDS if field in fields}
        if way.items() <= was.items():
            return AgentNode.model_validate({**node.model_dump(), **fields})
        found = resolve_route(node.type, was, way, self._ways)
        if found is None:
            words = ", ".join(f"{key} {value}" for key, value in way.items())
            raise _build_rejection(f"{node.id}: there is no way here with {words}")
        made = AgentNode.model_validate({**node.model_dump(), **fields, **found})
        return complete_plan(SocialGraph(agents=(made,)), self._ways).agents[0]


def _list_fields(line: EditLine) -> dict[str, Any]:
    return line.model_dump(exclude={"edit", "agent"}, exclude_none=True)


def _build_rejection(detail: str) -> Rejected:
    return Rejected(Rejection(stage="scene_planner", code="contradictory", detail=detail))
