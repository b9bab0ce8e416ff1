"""Plain sentences for a social graph, which the offline planner understands; agents' names."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Mapping
from itertools import chain
from typing import TypeVar

from scenewright.scene.account import NAME
from scenewright.scene.base import AgentClass
from scenewright.scene.kinds import get_kind, has_trait
from scenewright.scene.measures import UNITS, Measure, MeasureKind
from scenewright.scene.record import SceneRecord
from scenewright.scene.social import AgentNode, RelationEdge, SocialGraph

Key = TypeVar("Key")
_TIES = {
    "opposite": "oncoming to", "left": "from the left of", "right": "from the right of",
    "same": "from the same approach as", "lateral": "on the cross street of",
    "other": "from another approach than",
}  # fmt: skip
_MOVEMENTS = {
    "straight": "goes straight", "left": "turns left", "right": "turns right",
    "uturn": "makes a U-turn", "crossing": "crosses", "jaywalking": "jaywalks",
}  # fmt: skip
_NOUNS: dict[AgentClass, str] = {
    "vehicle": "vehicle", "pedestrian": "pedestrian", "cyclist": "cyclist", "scooter": "e-scooter",
}  # fmt: skip
_STATES = {
    "parked": "parked ", "double_parked": "double-parked ", "stalled": "stalled ", "bus_stop": "",
}  # fmt: skip
_MEASURES: dict[MeasureKind, str] = {
    "speed": "{a} drives at {value}", "line_speed": "{a} crosses the stop line at {value}",
    "contact_speed": "{a} hits {b} at {value}", "braking": "{a} brakes at {value}",
    "acceleration": "{a} accelerates at {value}", "wait": "{a} waits for {value}",
    "line_distance": "{a} stops {value} before the stop line",
    "headway": "{a} keeps a time gap of {value} to {b}",
    "gap": "the gap between {a} and {b} is {value}", "pet": "the PET of {a} and {b} is {value}",
    "ttc": "the TTC of {a} and {b} is {value}", "time": "{a} meets {b} after {value}",
    "front_point": "{a} is hit by {b} at {value} of its front",
    "front_point_left": "{a} is hit by {b} at {value} of its front from the left",
    "front_point_right": "{a} is hit by {b} at {value} of its front from the right",
    "side_point": "{a} is hit by {b} at {value} of its side",
}  # fmt: skip
_KMH = 3.6  # in a metre a second; people say speeds so
_DENSITY = {"low": "light", "medium": "moderate", "high": "heavy"}


def describe_graph(graph: SocialGraph) -> str:
    """The graph in plain English, one short sentence for each agent and each relation."""
    names = choose_names(graph)
    sentences = [_describe_agent(agent, names[agent.id]) for agent in graph.agents]
    sentences += chain(*(_describe_relation(edge, graph, names) for edge in graph.relations))
    sentences += [
        f"{names[tie.agent]} comes {_TIES[tie.side]} {names[tie.of]}"
        for tie in graph.ties
        if graph.agent(tie.agent).entry is None or graph.agent(tie.of).entry is None
    ]
    if not graph.relations and not any(scene_object.met_by for scene_object in graph.objects):
        sentences.append("nothing happens")
    sentences += _describe_objects(graph, names)
    sentences += [_describe_measure(measure, names) for measure in graph.measures]
    context, counts = graph.context, graph.context.background
    if context.time_of_day is not None:
        first, _, last = context.time_of_day.partition("-")
        sentences.append(f"it is between {first} and {last}" if last else f"it is {first}")
    if context.density is not None:
        sentences.append(f"the traffic is {_DENSITY[context.density]}")
    if counts is not None:
        parts = [
            f"{number or 'no'} background {noun}s"
            for number, noun in ((counts.vehicles, "vehicle"), (counts.pedestrians, "pedestrian"))
            if number is not None
        ]
        sentences.append(f"there are {' and '.join(parts)}")
    return ". ".join(sentence[0].upper() + sentence[1:] for sentence in sentences) + "."


def choose_names(graph: SocialGraph) -> dict[str, str]:
    """ "the car", or "car 1" and "car 2" where there are several of a kind."""
    return number_nouns({
        agent.id: f"group of {agent.members} pedestrians"
        if agent.members
        else name_kind(agent.subtype)
        if agent.subtype
        else _NOUNS[agent.type]
        for agent in graph.agents
    })  # fmt: skip


def name_kind(kind: str) -> str:
    """The noun of a class or a kind of vehicle, such as "police car"."""
    return "emergency vehicle" if kind == "emergency" else kind.replace("_", " ")


def number_nouns(nouns: Mapping[Key, str]) -> dict[Key, str]:
    """What things are called that have these nouns: "the car", or "car 1" and "car 2"."""
    seen = Counter[str]()
    found = {}
    for key, noun in nouns.items():
        seen[noun] += 1
        alone = list(nouns.values()).count(noun) == 1
        found[key] = f"the {noun}" if alone else f"{noun} {seen[noun]}"
    return found


def _describe_agent(agent: AgentNode, name: str) -> str:
    subject = re.sub("^the ", "a ", re.sub("^the (?=[aeiou])", "an ", name))
    route = list(_describe_route(agent))
    return f"{subject} {' and '.join(route)}" if route else f"there is {subject}"


def _describe_route(agent: AgentNode) -> Iterator[str]:
    walks = agent.type == "pedestrian" or agent.movement == "crossing"
    if agent.crosswalk is not None and agent.movement != "jaywalking":
        way = f"crosses on the {agent.crosswalk} crosswalk"
        yield way + (f" from the {agent.entry}" if agent.entry else "")
    elif walks and agent.movement is not None:
        yield _MOVEMENTS[agent.movement] + (f" from the {agent.entry}" if agent.entry else "")
    elif agent.entry is not None:
        yield f"comes from the {agent.entry}"
    if not walks and agent.movement is not None:
        yield _MOVEMENTS[agent.movement]
    elif not walks and agent.exit is not None:
        yield f"leaves to the {agent.exit}"
    if agent.motion is not None:
        yield get_kind("motion", agent.motion).say()
    if agent.runs_red:
        yield "runs the red light"
    if agent.reaction is not None:
        yield get_kind("reaction", agent.reaction).say()


def _describe_relation(
    edge: RelationEdge, graph: SocialGraph, names: dict[str, str]
) -> Iterator[str]:
    own = get_kind("relation", edge.type)
    if edge.kind is not None and get_kind("collision", edge.kind).says:
        own = get_kind("collision", edge.kind)
    if edge.manoeuvre is not None:
        own = get_kind("manoeuvre", edge.manoeuvre)
    words = own.say(names[edge.from_], names[edge.to], relation=edge.type)
    if edge.point_to is not None:
        words += f" on its {_name_point(edge.point_to)}"
    if edge.point_from is not None:
        words += f" with its {_name_point(edge.point_from)}"
    if edge.target_pet is not None:
        words += f" with a PET of {edge.target_pet:.3g} s"
    if edge.target_ttc is not None:
        words += f" with a TTC of {edge.target_ttc:.3g} s"
    if edge.impact_speed is not None:
        words += f" at an impact speed of {edge.impact_speed * _KMH:.3g} km/h"
    runs = any(graph.agent(name).runs_red for name in edge.pair)
    if has_trait("cause", edge.cause, "late"):
        words += f" because {names[edge.braker] if edge.braker else 'one of them'} brakes late"
    elif has_trait("cause", edge.cause, "red_light") and not runs:
        words += " because one of them runs the red light"
    if edge.first is not None and edge.type != "yield_to":
        words += f", and {names[edge.first]} passes first"
    yield words
    if edge.strikes is not None:
        yield f"{names[edge.strikes]} strikes {names[edge.get_other(edge.strikes)]}"


def _name_point(point: str) -> str:
    return f"{point.replace('_', ' ')} corner" if "_" in point else point


def _describe_measure(measure: Measure, names: dict[str, str]) -> str:
    unit, slack = UNITS[measure.kind].unit, UNITS[measure.kind].tolerance
    said, scale = ("km/h", _KMH) if unit == "m/s" else (unit, 1.0)
    value = f"{(measure.low + measure.high) / 2 * scale:.3g} {said}"
    if measure.high - measure.low > 2 * slack + 1e-6:
        value = f"between {measure.low * scale:.3g} and {measure.high * scale:.3g} {said}"
    other = "" if measure.other is None else names[measure.other]
    return _MEASURES[measure.kind].format(a=names[measure.agent], b=other, value=value)


def _describe_objects(graph: SocialGraph, names: dict[str, str]) -> Iterator[str]:
    """What stands, whom it hides and who meets it."""
    ends = {scene_object.beyond for scene_object in graph.objects}
    for node in graph.objects:
        place = f" on the {node.leg} {'exit' if node.side == 'exit' else 'leg'}" if node.leg else ""
        noun: str = (node.subtype or "car") if node.kind in _STATES else node.kind
        noun = "bus at its stop" if node.kind == "bus_stop" else noun
        thing = f"a {_STATES.get(node.kind, '')}{noun.replace('_', ' ')}{place}"
        for meeting in node.list_meetings():
            yield get_kind("encounter", meeting.encounter).say(names[meeting.agent], thing)
        if node.hides is not None and node.id in ends:
            yield f"{names[node.hides]} comes out from between two parked {node.subtype or 'car'}s"
        elif node.hides is not None:
            lead = f", seen {sum(node.lead) / 2:.3g} s before the event" if node.lead else ""
            yield f"{names[node.hides]} comes out from behind {thing}{lead}"
        elif node.met_by is None and node.beyond is None:
            yield f"there is {thing}"


_NOUN_PHRASE = re.compile(
    r"(?:(?:an?|the|my|our|one|some|this|that) )?([\w' -]{1,30})", re.IGNORECASE
)
PRONOUNS = "it they them he him she her who that which both one another someone somebody anyone"
"""Words that are never a name."""
_NUMBERS = re.compile(r"\bagents? (\d+(?:, \d+)*)\b|(?<=\bof )(\d+ and \d+)(?= at )")
_CODE = re.compile(r"\b([a-z_]+)\(([^()]*)\)|\b[a-z]+(?:_[a-z]+)+\b")
_RELATIONS = {"collide_at": "collision", "yield_to": "yielding"}


def call_agents(scene: SceneRecord) -> dict[int, str]:
    """By id: "Anna" or "the taxi" where the words say so, "car 1" and "car 2" for two of a noun.

    Those that it does not name keep the name that edits know, "vehicle-7".
    """
    named = [agent for agent in scene.agents if agent.role == "foreground"]
    nouns = {each.id: name_kind(each.subtype or each.type) for each in named}
    spans = Counter(each.start for each in scene.said if each.became == "agent")
    in_capitals = all(each.words.isupper() for each in scene.said if each.became == "agent")
    for each in reversed(scene.said):
        is_pronoun = each.words.lower() in PRONOUNS.split()
        phrase = None if is_pronoun else _NOUN_PHRASE.fullmatch(each.words)
        alone = each.became == "agent" and len(each.agents) == 1 and spans[each.start] == 1
        if phrase and alone and each.value and each.agents[0] in nouns:
            nouns[each.agents[0]] = phrase[1].lower() if in_capitals else phrase[1]
    own = {each.agents[0]: each.words for each in scene.said if each.note == NAME and each.agents}
    return {agent.id: agent.name for agent in scene.agents} | number_nouns(nouns) | own


def speak_plainly(
    text: str, scene: SceneRecord | None, planned: Mapping[str, str] | None = None
) -> str:
    """The text with agents, `planned` ones too, and objects as they are called, without code."""
    called, names = {} if scene is None else call_agents(scene), dict(planned or {})
    if scene is not None:
        things = {x.id: f"{x.kind} {x.subtype or ''}".strip() for x in scene.objects}
        things = {name: noun.replace("_", "-") for name, noun in things.items()}
        named = {x.name: called[x.id] for x in scene.agents if x.role == "foreground"}
        names = number_nouns(things) | named | names

    def spell(found: re.Match[str]) -> str:
        words = f"{found[1]} of {found[2]}" if found[1] else found[0]
        return " ".join(_RELATIONS.get(each, each.replace("_", " ")) for each in words.split())

    def name_numbers(found: re.Match[str]) -> str:
        numbers = found[1] or found[2]
        return re.sub(r"\d+", lambda each: called.get(int(each[0]), each[0]), numbers)

    text = re.sub(r" \(\d+ such(?:; \d+ is [\w-]+)*\)", "", text)  # a key to numbers
    text = _NUMBERS.sub(name_numbers, _CODE.sub(spell, text))
    for name, meant in names.items():  # what stands in brackets behind a name repeats its noun

        def rename(found: re.Match[str], meant: str = meant) -> str:
            return meant + " (" * (found[1] is not None)

        pattern = rf"\b(?:{re.escape(name)}|{re.escape(meant)})\b(?: \([\w' -]+(?:\)|(, )))?"
        text = re.sub(pattern, rename, text)
    return re.sub(r"\b(\w+) the \1\b", r"the \1", text)  # "parked the parked truck"
