"""Objects that the encoder reads in a text: where they stand, and whose sight or way they block."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

from scenewright.backends.builtin.draft import Refused
from scenewright.backends.builtin.reader.interpret import get_side
from scenewright.backends.builtin.reader.measures import parse_range
from scenewright.backends.builtin.reader.reading import Reading, ReadSpan
from scenewright.backends.builtin.reader.words import Patterns, find_subtype
from scenewright.scene.account import Became, SaidSpan
from scenewright.scene.base import Compass
from scenewright.scene.kinds import Trait, find_marked, has_trait
from scenewright.scene.social import (
    MOST_OBJECTS,
    STANDING_VEHICLES,
    AgentNode,
    Encounter,
    Meeting,
    ObjectKind,
    ObjectNode,
    SocialGraph,
    get_figure,
)

_PATTERNS = Patterns("read_objects")

_SPEED_TOLERANCE, _TIME_TOLERANCE = 0.5, 0.15
"""Of a speed [m/s] and a time [s] that are asked for (SEMANTICS 8)."""

_KINDS: dict[str | None, ObjectKind] = {
    "parked": "parked", "double": "double_parked", "stalled": "stalled", "stop": "bus_stop",
}  # fmt: skip
_FIGURES: dict[str, Trait] = {"impact": "ends", "wait": "waits"}
"""Tags of numbers, and the trait of what an agent does of which they say how fast or long."""


@dataclass
class ReadObject:
    """A standing object of a text.

    Attributes:
        mentions: the words that name it; number: its own among the road users.
        beyond: the number of the second of two, between which a pedestrian comes out.
        place: where it stands; hidden: the number of the agent that it hides; hides_several: the
            words speak of more; sights: these words.
        seen: the words that say how long before the event the hidden one is seen.
        meetings: what each agent does that meets it, by its number; meets: the words; figures:
            their numbers.
    """

    number: int
    mentions: list[ReadSpan]
    beyond: int | None = None
    place: list[ReadSpan] = field(default_factory=list)
    hidden: int | None = None
    hides_several: bool = False
    sights: list[ReadSpan] = field(default_factory=list)
    seen: list[ReadSpan] = field(default_factory=list)
    meetings: dict[int, Encounter] = field(default_factory=dict)
    meets: list[ReadSpan] = field(default_factory=list)
    figures: list[ReadSpan] = field(default_factory=list)

    @property
    def encounter(self) -> Encounter | None:
        """What the first one does that meets it."""
        return next(iter(self.meetings.values()), None)

    def list_spans(self) -> Iterator[ReadSpan]:
        """All words that are about it."""
        for part in (self.mentions, self.place, self.sights, self.seen, self.meets, self.figures):
            yield from part

    def get_figure(self) -> tuple[float, float] | None:
        """The range of the speed of a hit, or of the wait before it is passed."""
        unit = get_figure(self.encounter).unit if self.encounter else ""
        return _find_range(self.figures, _TIME_TOLERANCE if unit == "s" else _SPEED_TOLERANCE)


def _find_range(spans: Sequence[ReadSpan], tolerance: float) -> tuple[float, float] | None:
    """The first range with two ends that words give."""
    for span in spans:
        asked = parse_range(span.words, "", tolerance)
        if asked is not None and asked[1] is not None:
            return round(asked[0], 3), round(asked[1], 3)
    return None


def take_out_objects(reading: Reading) -> tuple[Reading, tuple[ReadObject, ...]]:
    """A reading without the spans about standing objects, and these objects."""
    objects = {
        number: ReadObject(number, [reading.spans[at]])
        for number, at in reading.users.items()
        if reading.spans[at].tag == "obj" and not reading.spans[at].negated
        if reading.spans[at].value in (*_KINDS, "thing")
    }
    if not objects:
        return reading, ()
    for span in reading.spans:
        _assign_span(span, objects)
    _assign_figures(reading, objects)
    taken = {id(span) for thing in objects.values() for span in thing.list_spans()}
    rest = reading.select_spans(
        [at for at, span in enumerate(reading.spans) if id(span) not in taken]
    )
    spans = tuple(
        replace(
            span,
            subjects=tuple(n for n in span.subjects if n not in objects),
            objects=tuple(n for n in span.objects if n not in objects),
        )
        for span in rest.spans
    )
    return replace(rest, spans=spans), _join_pairs(objects)


def _assign_span(span: ReadSpan, objects: Mapping[int, ReadObject]) -> None:
    """Give the span to the object that it is about, if it is about one."""
    subjects = [objects[n] for n in span.subjects if n in objects]
    things = subjects + [objects[n] for n in span.objects if n in objects]
    if not things or span.tag == "obj":
        return
    agents = [number for number in span.users if number not in objects]
    full = find_marked("encounter", f"{span.tag} {span.value}") if span.value else None
    encounter = full or find_marked("encounter", span.tag)
    if span.tag == "ref":
        things[0].mentions.append(span)
    elif span.tag in ("from", "to", "cw") and subjects:
        for subject in subjects:
            subject.place.append(span)
    elif span.tag == "sight" and agents:
        several = len([n for n in span.subjects if n not in objects]) > 1
        for each in things:
            each.hidden, each.hides_several = agents[0], several
            each.sights.append(span)
    elif encounter is not None and agents and span.negated:
        things[0].meets.append(span)  # "neither passes" only says that what is said is all
    elif encounter is not None and agents:
        for agent in agents:
            before = things[0].meetings.get(agent)
            things[0].meetings[agent] = _join_meeting(before, encounter)
        things[0].meets.append(span)


def _join_meeting(before: Encounter | None, encounter: Encounter) -> Encounter:
    """One that waits and then goes round does both; one that is doored does not hit as well."""
    if has_trait("encounter", before, "door"):
        return before or encounter
    both = {before, encounter} == {
        find_marked("encounter", f"meet {w}") for w in ("wait", "around")
    }
    return (find_marked("encounter", "meet wait around") if both else None) or encounter


def _assign_figures(reading: Reading, objects: Mapping[int, ReadObject]) -> None:
    """Numbers of a hit, of a wait and of the time at which a hidden agent is seen."""
    for span in reading.spans:
        trait = _FIGURES.get(span.tag)
        for thing in objects.values():
            about = not span.subjects or not thing.meetings.keys().isdisjoint(span.subjects)
            if span.tag == "seen" and thing.hidden is not None:
                thing.seen.append(span)
            elif about and trait and has_trait("encounter", thing.encounter, trait):
                thing.figures.append(span)


def _join_pairs(objects: Mapping[int, ReadObject]) -> tuple[ReadObject, ...]:
    """The objects; of two named in one breath, between which an agent comes out, one pair."""
    found = list(objects.values())
    for first in found:
        same = [each for each in found if each.mentions[0] is first.mentions[0]]
        words = " ".join(span.words for span in first.sights)
        if len(same) >= 2 and first is same[0] and _PATTERNS.between.search(words):
            first.beyond = same[1].number
    beyond = {each.beyond for each in found}
    return tuple(each for each in found if each.number not in beyond)


def add_read_objects(
    graph: SocialGraph, objects: Sequence[ReadObject], names: Mapping[int, str]
) -> SocialGraph:
    """The graph with the objects, and the account of their words.

    Args:
        names: road user by number -> agent of the graph.

    Raises:
        Refused: what an object is said to do cannot be shown, or there are too many.
    """
    nodes: list[ObjectNode] = []
    said = list(graph.said)
    agents = {agent.id: agent for agent in graph.agents}
    for thing in objects:
        node = _make_node(thing, f"object-{len(nodes) + 1}")
        if thing.hidden is not None:
            node = node.model_copy(update=_hide(graph, thing, names))
        node = _add_meetings(node, thing, agents, names)
        nodes.append(node)
        said += _list_said(thing, node)
        if thing.beyond is not None:
            alone = {"hides": None, "hidden_from": None, "lead": None, "beyond": node.id}
            nodes.append(node.model_copy(update={"id": f"object-{len(nodes) + 1}", **alone}))
        if (walker := agents.get(node.hides or "")) is not None:
            # Who comes out from behind an object crosses the road, if nothing else is said. No
            # vehicle parks on a crosswalk: who comes out between two is beside it.
            beside = thing.beyond and (walker.type, walker.crosswalk) == ("pedestrian", None)
            movement = "jaywalking" if beside else walker.movement or "crossing"
            agents[walker.id] = walker.model_copy(update={"movement": movement})
    if len(nodes) > MOST_OBJECTS:
        raise Refused("out_of_scope", f"At most {MOST_OBJECTS} standing objects can be placed.")
    said.sort(key=lambda entry: entry.start)
    parts = {"agents": tuple(agents.values()), "objects": tuple(nodes), "said": tuple(said)}
    return validate_objects(graph.model_copy(update=parts), objects[0].mentions[0].words)


def _add_meetings(
    node: ObjectNode, thing: ReadObject, agents: dict[str, AgentNode], names: Mapping[int, str]
) -> ObjectNode:
    """The object with those that meet it, whose routes lead by its leg from now on.

    Raises:
        Refused: they are no vehicles or riders, or come and leave by other legs.
    """
    meetings: list[Meeting] = []
    for number, encounter in thing.meetings.items():
        agent = agents.get(names.get(number, ""))
        if agent is None or agent.type == "pedestrian":
            raise Refused(
                "out_of_scope",
                f"It is not clear which vehicle or rider '{thing.meets[0].words}' is said of; "
                "name it first.",
            )
        agent = agents[agent.id] = reroute_agent(agent, node)
        if node.leg is not None and not meetings:
            side = "entry" if agent.entry == node.leg else "exit"
            node = node.model_copy(update={"side": side})
        waits = any(has_trait("encounter", m.encounter, "heads_queue") for m in meetings)
        queues = waits and has_trait("encounter", encounter, "heads_queue")
        how = (find_marked("encounter", "queue") if queues else None) or encounter
        figure = None if meetings else thing.get_figure()
        meetings.append(Meeting(agent=agent.id, encounter=how, figure=figure))
    if not meetings:
        return node
    first, *others = meetings
    fields = {"met_by": first.agent, "encounter": first.encounter, "figure": first.figure}
    return node.model_copy(update={**fields, "others": tuple(others)})


def _make_node(thing: ReadObject, name: str) -> ObjectNode:
    span = thing.mentions[0]
    subtype = find_subtype(span.words)
    no_vehicle = subtype is None and _PATTERNS.things.search(span.words) is not None
    kind = None if no_vehicle else _KINDS.get(span.value)
    low = span.words.lower()
    if kind is None and subtype is None and re.search(r"container|skip|dumpster", low):
        kind = "container"
    elif kind is None and subtype is None:
        kind = "bin" if re.search(r"\b(?:dust)?bins?\b|trash can", low) else "box"
    kind = kind or "parked"
    if kind == "bus_stop" and subtype != "bus":
        kind = "parked"
    if kind == "parked" and _PATTERNS.for_a_moment.search(span.words):
        raise Refused(
            "out_of_scope",
            f"'{span.words}' may drive on; say that they are parked or stalled.",
        )
    if thing.encounter is not None and kind not in STANDING_VEHICLES:
        raise Refused(
            "out_of_scope",
            f"'{span.words}' is no vehicle, and only vehicles that stand can be hit, gone round or "
            "waited behind; say a parked or stalled one.",
        )
    if thing.encounter is not None:
        state = {"double": "double-parked", "stop": "unloading"}.get(span.value or "", span.value)
        kind = find_kind(f"{span.words} {state}", thing.encounter)
    sides = [place for place in thing.place if get_side(place) is not None]
    return ObjectNode.model_validate(
        {
            "id": name,
            "kind": kind,
            "subtype": subtype if kind in STANDING_VEHICLES and kind != "bus_stop" else None,
            "leg": get_side(sides[0]) if sides else None,
            "side": "exit" if sides and sides[0].tag == "to" else None,
        }
    )


def _hide(graph: SocialGraph, thing: ReadObject, names: Mapping[int, str]) -> dict[str, object]:
    """The fields of an object that hides an agent from the vehicle of their event.

    Raises:
        Refused: a vehicle is hidden, or nothing happens between the hidden agent and a vehicle.
    """
    if thing.hides_several:
        raise Refused(
            "out_of_scope",
            f"'{thing.sights[0].words}' seems to hide several, and one pedestrian can be hidden; "
            "say one of them.",
        )
    types = {agent.id: agent.type for agent in graph.agents}
    walker = names.get(thing.hidden or 0, "")
    met = [edge.get_other(walker) for edge in graph.relations if walker in edge.pair]
    drivers = [name for name in met if types[name] == "vehicle"]
    if not drivers or types[walker] == "vehicle":
        raise Refused(
            "out_of_scope",
            f"'{thing.sights[0].words}' says that something is hidden, and only a pedestrian or "
            "rider that a vehicle hits, nearly hits or gives way to can be; say such an event.",
        )
    lead = _find_range(thing.seen, _TIME_TOLERANCE)
    return {"hides": walker, "hidden_from": drivers[0], "lead": lead}


def _list_said(thing: ReadObject, node: ObjectNode) -> Iterator[SaidSpan]:
    """The account of the words about one object."""
    pair, met = (node.hidden_from or "", node.hides or ""), (node.met_by or "",)
    meanings: tuple[tuple[Sequence[ReadSpan], Became, tuple[str, ...], str], ...] = (
        ((*thing.mentions, *thing.place), "object", (), node.describe()),
        ((*thing.sights, *thing.seen), "sight", pair, node.id),
        ((*thing.meets, *thing.figures), "encounter", met, f"{node.id} {thing.encounter}"),
    )
    for spans, became, agents, value in meanings:
        for span in spans:
            yield SaidSpan(
                start=span.start, end=span.end, words=span.words, became=became, agents=agents,
                value=value,
            )  # fmt: skip


def validate_objects(graph: SocialGraph, words: str) -> SocialGraph:
    """The graph, once what stands in it is found to be consistent.

    Args:
        words: those that a refusal quotes.

    Raises:
        Refused: an object cannot be what the words say, such as one that two agents hit.
    """
    try:
        return SocialGraph.model_validate(graph.model_dump(by_alias=True))
    except ValueError as error:
        reason = str(error).split("Value error, ")[-1].split(" [type")[0]
        raise Refused("out_of_scope", f"'{words}': {reason}.") from error


def find_kind(words: str, how: Encounter) -> ObjectKind:
    """What stands in the way is in a lane; what is hit may also stand at the kerb."""
    low = words.lower()
    in_lane = re.search(r"\b(?:lane|way|path|road)\b", low) is not None
    if has_trait("encounter", how, "door"):
        return "parked"
    if re.search(r"double[- ]?parked|unloading|\b(?:bus|coach)\b.*\bstop\b", low):
        return "double_parked"
    if "parked" in low:
        return "double_parked" if in_lane or how != find_marked("encounter", "hit") else "parked"
    return "stalled"


def reroute_agent(agent: AgentNode, node: ObjectNode) -> AgentNode:
    """The agent with a route by the leg on which the object stands.

    Raises:
        Refused: it comes and leaves by other legs.
    """
    leg: Compass | None = node.leg
    if leg is None or leg in (agent.entry, agent.exit):
        return agent
    if agent.entry is None and node.side != "exit":
        return agent.model_copy(update={"entry": leg})
    if agent.exit is None:
        return agent.model_copy(update={"exit": leg})
    raise Refused(
        "out_of_scope", f"{agent.id} does not come by the {leg} leg, where {node.id} is to stand."
    )
