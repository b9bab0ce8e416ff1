"""Edits: what a turn of a conversation changes in a scene, as typed values."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import count
from typing import Annotated, Literal

from pydantic import Field, ValidationError

from scenewright.errors import Rejected, describe_misfit
from scenewright.scene.account import NAME, SaidSpan, read_background
from scenewright.scene.base import AgentClass, AgentId, Compass, Model, Movement
from scenewright.scene.measures import Measure, format_measure
from scenewright.scene.rejection import Rejection
from scenewright.scene.social import (
    MOST_BACKGROUND,
    AgentNode,
    Background,
    EntryTie,
    ObjectId,
    ObjectNode,
    RelationEdge,
    SceneContext,
    SocialGraph,
)


class AgentView(Model):
    """An agent of the scene as it is, as context for reading an edit.

    Attributes:
        number: its id in scene.json.
        speed: free speed [m/s]; stops: whether it stands anywhere; for a foreground
            agent, elsewhere than at a red light.
        slows_to: lowest speed of an agent that gives way without standing [m/s].
        called: what people call it, such as "the old man" or "Anna".
    """

    id: AgentId
    number: int
    type: AgentClass
    subtype: str | None = None
    entry: Compass
    exit: Compass
    movement: Movement
    crosswalk: Compass | None = None
    role: Literal["foreground", "background"]
    speed: float
    stops: bool = False
    slows_to: float | None = None
    called: str = ""


class Situation(Model):
    """What words of a conversation are read against."""

    graph: SocialGraph
    present: tuple[AgentView, ...]

    @property
    def foreground(self) -> list[AgentView]:
        """The agents of the social graph, as they are in the scene."""
        return [agent for agent in self.present if agent.role == "foreground"]

    @property
    def background(self) -> list[AgentView]:
        """The agents besides those."""
        return [agent for agent in self.present if agent.role == "background"]

    def count_background(self) -> dict[str, int]:
        """How many vehicles and pedestrians the background has, by class."""
        types = [agent.type for agent in self.background]
        return {kind: types.count(kind) for kind in ("vehicle", "pedestrian")}

    def generate_ids(self, kind: str) -> Iterator[str]:
        """The ids of a class that no agent has, in order."""
        taken = {agent.id for agent in self.present} | {node.id for node in self.graph.agents}
        return (name for n in count(1) if (name := f"{kind}-{n}") not in taken)


class ChangeAgent(Model):
    """An agent of the social graph becomes this."""

    edit: Literal["change_agent"] = "change_agent"
    node: AgentNode


class AddAgent(Model):
    """One agent more in the social graph."""

    edit: Literal["add_agent"] = "add_agent"
    node: AgentNode


class CallAgent(Model):
    """An agent has a name from now on, such as Anna; nothing else changes."""

    edit: Literal["call_agent"] = "call_agent"
    agent: AgentId
    name: str = Field(min_length=1, max_length=30, pattern=r"^[^\W\d_][\w' -]*$")


class RemoveAgent(Model):
    """An agent goes, and every relation it has; also one of the background."""

    edit: Literal["remove_agent"] = "remove_agent"
    agent: AgentId


class Relate(Model):
    """The relation between two agents becomes this one."""

    edit: Literal["relate"] = "relate"
    edge: RelationEdge


class Unrelate(Model):
    """Nothing happens between two agents any more."""

    edit: Literal["unrelate"] = "unrelate"
    first: AgentId
    second: AgentId


class Tie(Model):
    """Entries that lie to one another in some way, all of them."""

    edit: Literal["tie"] = "tie"
    ties: tuple[EntryTie, ...]


class ChangeContext(Model):
    """Density and time of day become these, and the background is drawn anew where they differ;
    numbers of the background are edits of their own."""

    edit: Literal["change_context"] = "change_context"
    density: Literal["low", "medium", "high"] | None = None
    time_of_day: str | None = None


class SetBackground(Model):
    """So many background agents of a class; None leaves it as it is."""

    edit: Literal["set_background"] = "set_background"
    vehicles: int | None = Field(default=None, ge=0, le=MOST_BACKGROUND)
    pedestrians: int | None = Field(default=None, ge=0, le=MOST_BACKGROUND)


class AddObject(Model):
    """Something more stands in the scene."""

    edit: Literal["add_object"] = "add_object"
    node: ObjectNode


class RemoveObject(Model):
    """Something that stands goes."""

    edit: Literal["remove_object"] = "remove_object"
    object: ObjectId


class SetPace(Model):
    """An agent is slower or faster: its free speed times `factor`."""

    edit: Literal["set_pace"] = "set_pace"
    agent: AgentId
    factor: float = Field(ge=0.3, le=2.0)


class MoveStop(Model):
    """An agent stands `metres` further along its path, or before."""

    edit: Literal["move_stop"] = "move_stop"
    agent: AgentId
    metres: float = Field(ge=-15.0, le=15.0)


class WaitLonger(Model):
    """An agent stands `seconds` longer, or less long; who only slowed down stands that long."""

    edit: Literal["wait_longer"] = "wait_longer"
    agent: AgentId
    seconds: float = Field(ge=-20.0, le=20.0)


class ComeLater(Model):
    """An agent comes `seconds` later, or sooner."""

    edit: Literal["come_later"] = "come_later"
    agent: AgentId
    seconds: float = Field(ge=-20.0, le=20.0)


class SetMeasure(Model):
    """A figure is asked for; it takes the place of an earlier one of its kind and agents."""

    edit: Literal["set_measure"] = "set_measure"
    measure: Measure


class Redraw(Model):
    """An agent takes another path at another time; None: all agents."""

    edit: Literal["redraw"] = "redraw"
    agent: AgentId | None = None


Edit = (
    ChangeAgent | AddAgent | CallAgent | RemoveAgent | Relate | Unrelate | Tie | ChangeContext
    | SetBackground | AddObject | RemoveObject | SetPace | MoveStop | WaitLonger | ComeLater
    | Redraw | SetMeasure
)  # fmt: skip


class Edits(Model):
    """Everything that one turn changes, in order."""

    reading: Literal["edits"] = "edits"
    edits: tuple[Annotated[Edit, Field(discriminator="edit")], ...] = Field(max_length=32)


class Choice(Model):
    """One answer to a question: what to type, and what it means."""

    answer: str = Field(max_length=40)
    means: str = Field(max_length=1000)


class Clarification(Model):
    """The words may mean several things; the question is put once."""

    reading: Literal["ask"] = "ask"
    question: str
    choices: tuple[Choice, ...] = Field(min_length=2, max_length=24)


class DeclinedTurn(Model):
    """The words cannot become an edit; the reason says why and what would."""

    reading: Literal["decline"] = "decline"
    code: Literal["out_of_scope", "contradictory", "impossible", "no_change", "backend_failed"]
    reason: str


class NewScene(Model):
    """The words describe a scene of their own."""

    reading: Literal["fresh"] = "fresh"


Reading = Edits | Clarification | DeclinedTurn | NewScene
"""What the words of a turn amount to."""


def apply_edits(graph: SocialGraph, edits: Iterable[Edit]) -> SocialGraph:
    """The social graph after the edits.

    Raises:
        Rejected: `contradictory`, an edit names what is not there or leaves no valid graph.
    """
    try:
        for edit in edits:
            edited = _drop_idle_hiding(_apply_edit(graph, edit))
            graph = SocialGraph.model_validate(edited.model_dump(by_alias=True))
    except ValidationError as error:
        words = describe_misfit(error).replace("Value error, ", "", 1)
        raise _build_refusal(words) from error
    return graph.model_copy(update={"said": tuple(e for e in graph.said if still_holds(e, graph))})


def still_holds(entry: SaidSpan, graph: SocialGraph) -> bool:
    """Whether what words became is in the graph."""
    agents = {agent.id: agent for agent in graph.agents}
    if any(name not in agents for name in entry.agents):
        return False
    named = [agents[name] for name in entry.agents]
    match entry.became:
        case "entry" | "exit" | "movement" | "crosswalk" | "motion" | "reaction":
            return all(getattr(agent, entry.became) == entry.value for agent in named)
        case "agent":
            kinds = {k for a in named for k in (a.type, a.subtype, f"group of {a.members}")}
            return entry.value is None or entry.value in kinds
        case "runs_red":
            return all(agent.runs_red for agent in named)
        case "relation" | "tie":
            known = {(str(edge.type), edge.pair) for edge in graph.relations}
            ties = {(str(tie.side), tie.pair) for tie in graph.ties}
            return (entry.value, frozenset(entry.agents)) in known | ties
        case "order" | "striker":
            edges = [e for e in graph.relations if e.pair == set(entry.agents)]
            leads = (e.get_first() if entry.became == "order" else e.strikes for e in edges)
            return entry.agents[0] in leads
        case "manoeuvre":
            return any(
                edge.manoeuvre == entry.value and edge.pair.issuperset(entry.agents)
                for edge in graph.relations
            )
        case "time_of_day" | "density":
            return bool(getattr(graph.context, entry.became) == entry.value)
        case "measure" if entry.value and " in [" in entry.value:
            return set(entry.value.split("; ")) <= {format_measure(m) for m in graph.measures}
        case "background":
            background = graph.context.background
            asked = read_background(entry.value)
            return bool(asked) and all(getattr(background, k, None) == n for k, n in asked.items())
        case "normal" | "denied" | "cause" | "measure" | "impact_point":
            return False
        case "object" | "sight":
            name = (entry.value or "").split(" ", maxsplit=1)[0]
            kept = (scene_object for scene_object in graph.objects if scene_object.id == name)
            return any(entry.became == "object" or each.hides is not None for each in kept)
    return True


def _apply_edit(graph: SocialGraph, edit: Edit) -> SocialGraph:
    match edit:
        case ChangeAgent(node=node):
            _check_known(graph, node.id)
            agents = tuple(node if each.id == node.id else each for each in graph.agents)
            return graph.model_copy(update={"agents": agents})
        case AddAgent(node=node):
            return graph.model_copy(update={"agents": (*graph.agents, node)})
        case CallAgent(agent=agent):
            _check_known(graph, agent)
            said = SaidSpan(words=edit.name, became="agent", agents=(agent,), note=NAME)
            others = (e for e in graph.said if (e.note, e.agents) != (NAME, (agent,)))
            return graph.model_copy(update={"said": (*others, said)})
        case RemoveAgent(agent=name):
            # One of the background is in no graph.
            left = {
                "agents": tuple(each for each in graph.agents if each.id != name),
                "relations": tuple(e for e in graph.relations if name not in e.pair),
                "ties": tuple(tie for tie in graph.ties if name not in tie.pair),
                "measures": tuple(m for m in graph.measures if name not in (m.agent, m.other)),
            }
            return graph.model_copy(update=left)
        case Relate(edge=edge):
            kept = [relation for relation in graph.relations if relation.pair != edge.pair]
            earlier = [at for at, e in enumerate(graph.relations) if e.pair == edge.pair]
            kept.insert(earlier[0] if earlier else len(kept), edge)
            same = any(graph.relations[at].type == edge.type for at in earlier)
            measures = graph.measures if same else _drop_measures(graph, edge.pair)
            return graph.model_copy(update={"relations": tuple(kept), "measures": measures})
        case Unrelate(first=first, second=second):
            kept = [edge for edge in graph.relations if edge.pair != {first, second}]
            measures = _drop_measures(graph, frozenset((first, second)))
            return graph.model_copy(update={"relations": tuple(kept), "measures": measures})
        case SetMeasure(measure=measure):
            about = (measure.kind, measure.agent, measure.other)
            kept_ = [e for e in graph.measures if (e.kind, e.agent, e.other) != about]
            return graph.model_copy(update={"measures": (*kept_, measure)})
        case Tie(ties=ties):
            return graph.model_copy(update={"ties": ties})
        case ChangeContext():
            changes = {"density": edit.density, "time_of_day": edit.time_of_day}
            # The later word counts, not a number before.
            kept_counts = (
                graph.context.background if edit.density == graph.context.density else None
            )
            context = {**graph.context.model_dump(), **changes, "background": kept_counts}
            return graph.model_copy(update={"context": SceneContext.model_validate(context)})
        case AddObject(node=node):
            return graph.model_copy(update={"objects": (*graph.objects, node)})
        case RemoveObject(object=name):
            _check_known(graph, name)
            objects = tuple(
                scene_object for scene_object in graph.objects if scene_object.id != name
            )
            return graph.model_copy(update={"objects": objects})
        case SetBackground():
            before = graph.context.background or Background()
            counts = Background(
                vehicles=before.vehicles if edit.vehicles is None else edit.vehicles,
                pedestrians=before.pedestrians if edit.pedestrians is None else edit.pedestrians,
            )
            context_ = graph.context.model_copy(update={"background": counts})
            return graph.model_copy(update={"context": context_})
    return graph


def _drop_idle_hiding(graph: SocialGraph) -> SocialGraph:
    """The graph in which nothing hides an agent from another that it has no relation with, and
    no agent meets an object that is not there."""
    there = {agent.id for agent in graph.agents}
    bound = {edge.pair for edge in graph.relations}
    free = {"hides": None, "hidden_from": None, "lead": None}
    objects = tuple(
        scene_object
        if scene_object.hides is None
        or frozenset((scene_object.hides, scene_object.hidden_from)) in bound
        else scene_object.model_copy(update=free)
        for scene_object in graph.objects
        if scene_object.met_by in (None, *there)
    )
    return graph.model_copy(update={"objects": objects})


def _drop_measures(graph: SocialGraph, pair: frozenset[str]) -> tuple[Measure, ...]:
    """The figures asked for, but for those of what happens between two agents."""
    return tuple(measure for measure in graph.measures if {measure.agent, measure.other} != pair)


def _check_known(graph: SocialGraph, name: str) -> None:
    known = {agent.id for agent in graph.agents} | {
        scene_object.id for scene_object in graph.objects
    }
    if name not in known:
        raise _build_refusal(f"there is no {name} in the scene")


def _build_refusal(detail: str) -> Rejected:
    return Rejected(Rejection(stage="scene_planner", code="contradictory", detail=detail))


def diff_graphs(before: SocialGraph, after: SocialGraph) -> tuple[Edit, ...]:
    """The edits that lead from one graph to the other, where ids mean the same agents."""
    old = {agent.id: agent for agent in before.agents}
    new = {agent.id: agent for agent in after.agents}
    found: list[Edit] = [RemoveAgent(agent=name) for name in old if name not in new]
    found += [ChangeAgent(node=n) for name, n in new.items() if name in old and n != old[name]]
    found += [AddAgent(node=node) for name, node in new.items() if name not in old]
    pairs = {edge.pair: edge for edge in before.relations}
    now_bound = {edge.pair for edge in after.relations}
    found += [
        Unrelate(first=edge.from_, second=edge.to)
        for pair, edge in pairs.items()
        if pair not in now_bound and pair <= new.keys()
    ]
    found += [Relate(edge=edge) for edge in after.relations if pairs.get(edge.pair) != edge]
    if tuple(tie for tie in before.ties if tie.pair <= new.keys()) != after.ties:
        found.append(Tie(ties=after.ties))
    found += [RemoveObject(object=o.id) for o in before.objects if o not in after.objects]
    found += [AddObject(node=o) for o in after.objects if o not in before.objects]
    was, now = before.context, after.context
    if (was.density, was.time_of_day) != (now.density, now.time_of_day):
        found.append(ChangeContext(density=now.density, time_of_day=now.time_of_day))
    counts = now.background
    if counts is not None and counts != was.background:
        found.append(SetBackground(vehicles=counts.vehicles, pedestrians=counts.pedestrians))
    return tuple(found)
