"""Objects that the encoder reads in a text: where they stand, and whose sight or way they block."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

from scenewright.backends.builtin.draft import Refused
from scenewright.backends.builtin.encounters import (
    find_kind,
    find_side,
    reroute_agent,
    validate_objects,
)
from scenewright.backends.builtin.reader.interpret import get_side
from scenewright.backends.builtin.reader.measures import parse_range
from scenewright.backends.builtin.reader.reading import Reading, ReadSpan
from scenewright.backends.builtin.reader.words import find_subtype
from scenewright.backends.builtin.standing import THING, find_thing, let_cross, let_jaywalk
from scenewright.scene.account import Became, SaidSpan
from scenewright.scene.social import (
    MOST_OBJECTS,
    STANDING_VEHICLES,
    Encounter,
    ObjectKind,
    ObjectNode,
    SocialGraph,
)

_SPEED_TOLERANCE, _TIME_TOLERANCE = 0.5, 0.15
"""Of a speed [m/s] and a time [s] that are asked for (SEMANTICS 8)."""

_KINDS: dict[str | None, ObjectKind] = {
    "parked": "parked", "double": "double_parked", "stalled": "stalled", "stop": "bus_stop",
}  # fmt: skip
_ENCOUNTERS: dict[tuple[str, str | None], Encounter] = {
    ("meet", "around"): "goes_round",
    ("meet", "wait"): "waits_behind",
    ("meet", "short"): "stops_short",
    ("door", None): "doored",
}
_EVENTS: dict[str, Encounter] = {
    "hit": "hits", "near": "stops_short", "yield": "waits_behind", "follow": "waits_behind",
}  # fmt: skip
_FIGURES: dict[str, tuple[Encounter, ...]] = {
    "impact": ("hits", "doored"), "wait": ("waits_behind", "waits_then_passes"),
}  # fmt: skip
"""Tags of numbers, and what an agent does about an object of which they say how fast or long."""
_FOR_A_MOMENT = re.compile(r"\b(?:stopped|stationary|queu\w+|waiting|halted)\b", re.IGNORECASE)
_THINGS = re.compile(rf"\b{THING}\b", re.IGNORECASE)
_BETWEEN = re.compile(r"\bbetween\b", re.IGNORECASE)


@dataclass
class ReadObject:
    """A standing object of a text.

    Attributes:
        mentions: the words that name it; number: its own among the road users.
        beyond: the number of the second of two, between which a pedestrian comes out.
        place: where it stands; hidden: the number of the agent that it hides; sights: the words.
        seen: the words that say how long before the event the hidden one is seen.
        met_by: the number of the agent that meets it; meets: the words; figures: their numbers.
    """

    number: int
    mentions: list[ReadSpan]
    beyond: int | None = None
    place: list[ReadSpan] = field(default_factory=list)
    hidden: int | None = None
    sights: list[ReadSpan] = field(default_factory=list)
    seen: list[ReadSpan] = field(default_factory=list)
    met_by: int | None = None
    encounter: Encounter | None = None
    meets: list[ReadSpan] = field(default_factory=list)
    figures: list[ReadSpan] = field(default_factory=list)

    def list_spans(self) -> Iterator[ReadSpan]:
        """All words that are about it."""
        for part in (self.mentions, self.place, self.sights, self.seen, self.meets, self.figures):
            yield from part

    def get_figure(self) -> tuple[float, float] | None:
        """The range of the speed of a hit, or of the wait before it is passed."""
        tolerance = _TIME_TOLERANCE if self.encounter == "waits_then_passes" else _SPEED_TOLERANCE
        found = [parse_range(each.words, "", tolerance) for each in self.figures]
        ranges = [each for each in found if each is not None and each[1] is not None]
        return (ranges[0][0], ranges[0][1] or 0.0) if ranges else None


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
    taken = {id(span) for each in objects.values() for span in each.list_spans()}
    kept = [_without(span, objects) for span in reading.spans if id(span) not in taken]
    places = [n for n, span in enumerate(reading.spans) if id(span) not in taken]
    users = {u: places.index(at) for u, at in reading.users.items() if at in places}
    return replace(reading, spans=tuple(kept), users=users), _join_pairs(objects)


def _assign_span(span: ReadSpan, objects: Mapping[int, ReadObject]) -> None:
    """Give the span to the object that it is about, if it is about one."""
    subjects = [objects[n] for n in span.subjects if n in objects]
    things = subjects + [objects[n] for n in span.objects if n in objects]
    if not things or span.tag == "obj":
        return
    agents = [n for n in (*span.subjects, *span.objects) if n not in objects]
    encounter = _ENCOUNTERS.get((span.tag, span.value)) or _EVENTS.get(span.tag)
    if span.tag == "ref":
        things[0].mentions.append(span)
    elif span.tag in ("from", "to", "cw") and subjects:
        for each in subjects:
            each.place.append(span)
    elif span.tag == "sight" and agents:
        for each in things:
            each.hidden = agents[0]
            each.sights.append(span)
    elif encounter is not None and agents and not span.negated:
        things[0].met_by, things[0].encounter = agents[0], _join_meeting(things[0], encounter)
        things[0].meets.append(span)


def _join_meeting(each: ReadObject, encounter: Encounter) -> Encounter:
    """One that waits and then goes round does both; one that is doored does not hit as well."""
    if each.encounter == "doored":
        return "doored"
    both = {each.encounter, encounter} == {"waits_behind", "goes_round"}
    return "waits_then_passes" if both else encounter


def _assign_figures(reading: Reading, objects: Mapping[int, ReadObject]) -> None:
    """Numbers of a hit, of a wait and of the time at which a hidden agent is seen."""
    for span in reading.spans:
        for each in objects.values():
            own = not span.subjects or each.met_by in span.subjects
            if span.tag == "seen" and each.hidden is not None:
                each.seen.append(span)
            elif own and each.encounter in _FIGURES.get(span.tag, ()):
                each.figures.append(span)


def _without(span: ReadSpan, objects: Mapping[int, ReadObject]) -> ReadSpan:
    subjects = tuple(n for n in span.subjects if n not in objects)
    others = tuple(n for n in span.objects if n not in objects)
    same = subjects == span.subjects and others == span.objects
    return span if same else replace(span, subjects=subjects, objects=others)


def _join_pairs(objects: Mapping[int, ReadObject]) -> tuple[ReadObject, ...]:
    """The objects; of two named in one breath, between which an agent comes out, one pair."""
    found = list(objects.values())
    for first in found:
        same = [each for each in found if each.mentions[0] is first.mentions[0]]
        words = " ".join(span.words for span in first.sights)
        if len(same) >= 2 and first is same[0] and _BETWEEN.search(words):
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
    agents = list(graph.agents)
    for each in objects:
        node = _make_node(each, f"object-{len(nodes) + 1}")
        if each.hidden is not None:
            node = node.model_copy(update=_hide(graph, each, names))
            agents = [let_cross(agent) if agent.id == node.hides else agent for agent in agents]
        own = next((n for n, a in enumerate(agents) if a.id == names.get(each.met_by or 0)), None)
        if own is not None and agents[own].type != "pedestrian":
            agents[own] = reroute_agent(agents[own], node)
            side = find_side(agents[own], node) if node.leg is not None else {}
            meeting = {"met_by": agents[own].id, "encounter": each.encounter}
            node = node.model_copy(update={**side, **meeting, "figure": each.get_figure()})
        elif each.meets:
            raise Refused(
                "out_of_scope",
                f"It is not clear which vehicle or rider '{each.meets[0].words}' is said of; "
                "name it first.",
            )
        nodes.append(node)
        said += _list_said(each, node)
        if each.beyond is not None:
            agents = [let_jaywalk(agent) if agent.id == node.hides else agent for agent in agents]
            alone = {"hides": None, "hidden_from": None, "lead": None, "beyond": node.id}
            nodes.append(node.model_copy(update={"id": f"object-{len(nodes) + 1}", **alone}))
    if len(nodes) > MOST_OBJECTS:
        raise Refused("out_of_scope", f"At most {MOST_OBJECTS} standing objects can be placed.")
    said.sort(key=lambda each: each.start)
    parts = {"agents": tuple(agents), "objects": tuple(nodes), "said": tuple(said)}
    return validate_objects(graph.model_copy(update=parts), objects[0].mentions[0].words)


def _make_node(each: ReadObject, name: str) -> ObjectNode:
    span = each.mentions[0]
    subtype = find_subtype(span.words)
    thing = subtype is None and _THINGS.search(span.words) is not None
    kind = None if thing else _KINDS.get(span.value)
    kind = kind or ("parked" if subtype else find_thing(span.words))
    if kind == "bus_stop" and subtype != "bus":
        kind = "parked"
    if kind == "parked" and _FOR_A_MOMENT.search(span.words):
        raise Refused(
            "out_of_scope",
            f"'{span.words}' may drive on; say that they are parked or stalled.",
        )
    if each.encounter is not None:
        state = {"double": "double-parked", "stop": "unloading"}.get(span.value or "", span.value)
        kind = find_kind(f"{span.words} {state}", each.encounter)
    sides = [place for place in each.place if get_side(place) is not None]
    return ObjectNode.model_validate(
        {
            "id": name,
            "kind": kind,
            "subtype": subtype if kind in STANDING_VEHICLES else None,
            "leg": get_side(sides[0]) if sides else None,
            "side": "exit" if sides and sides[0].tag == "to" else None,
        }
    )


def _hide(graph: SocialGraph, each: ReadObject, names: Mapping[int, str]) -> dict[str, object]:
    """The fields of an object that hides an agent from the vehicle of their event.

    Raises:
        Refused: a vehicle is hidden, or nothing happens between the hidden agent and a vehicle.
    """
    types = {agent.id: agent.type for agent in graph.agents}
    walker = names.get(each.hidden or 0)
    pairs = [(e.from_, e.to) for e in graph.relations if walker in (e.from_, e.to)]
    drivers = [a if b == walker else b for a, b in pairs]
    drivers = [name for name in drivers if types[name] == "vehicle"]
    if walker is None or types[walker] == "vehicle" or not drivers:
        raise Refused(
            "out_of_scope",
            f"'{each.sights[0].words}' says that something is hidden, and only a pedestrian or "
            "rider that a vehicle hits, nearly hits or gives way to can be; say such an event.",
        )
    found = [parse_range(span.words, "", _TIME_TOLERANCE) for span in each.seen]
    leads = [(lead[0], lead[1]) for lead in found if lead is not None and lead[1] is not None]
    return {"hides": walker, "hidden_from": drivers[0], "lead": leads[0] if leads else None}


def _list_said(each: ReadObject, node: ObjectNode) -> Iterator[SaidSpan]:
    """The account of the words about one object."""
    for span in (*each.mentions, *each.place):
        yield _say(span, "object", (), node.describe())
    pair = (node.hidden_from or "", node.hides or "")
    for span in (*each.sights, *each.seen):
        yield _say(span, "sight", pair, node.id)
    for span in (*each.meets, *each.figures):
        yield _say(span, "encounter", (node.met_by or "",), f"{node.id} {each.encounter}")


def _say(span: ReadSpan, became: Became, agents: tuple[str, ...], value: str) -> SaidSpan:
    return SaidSpan(
        start=span.start, end=span.end, words=span.words, became=became, agents=agents, value=value
    )
