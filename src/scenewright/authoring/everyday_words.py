"""Everyday phrasings of a change, read against the scene before the planner's reader is asked.

Each rule is a form of words and its edit. The agent that the words mean is decided here as well:
"her", "the truck", "the other one". Words that fit no rule are left to the planner; what the
planner makes of words is refused where it omits an agent that they name.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from scenewright.authoring.vocabulary import compile_words, fill_in
from scenewright.backends.offline import CLASSES, WORDS
from scenewright.scene.base import RIDERS
from scenewright.scene.edits import (
    AddAgent,
    ChangeAgent,
    DeclinedTurn,
    Edit,
    Edits,
    NewScene,
    Reading,
    Relate,
    RemoveAgent,
    SetBackground,
    SetMeasure,
    SetPace,
    Situation,
    WaitLonger,
)
from scenewright.scene.events import Event
from scenewright.scene.measures import UNITS, Measure, MeasureKind
from scenewright.scene.social import MOST_BACKGROUND, AgentNode, RelationEdge

WEATHER = (
    "There is no weather here: the road is dry and all agents see equally far. What can be had "
    'instead: "make it night", "slow the car down", "have her step out from behind a parked van".'
)
LENGTH = (
    "How long a scene lasts follows from what happens in it, 30 s at the most. To have it happen "
    'at another time, say "let it happen 12 s into the scene".'
)
_SLOW, _FAST = 0.8, 1.25
_EARLIER = 3.0
_VERY = 0.6
_CLOSER = 0.6


@dataclass(frozen=True)
class Talk:
    """What everyday words are read against.

    Attributes:
        touched: agents that were spoken of, the last first; events: of the current version.
        narrator: the noun of what the one who writes drives or is, such as "taxi".
    """

    situation: Situation
    touched: Sequence[str]
    events: Sequence[Event]
    narrator: str | None = None

    def list_named(self) -> list[AgentNode]:
        """The agents of the instruction, those spoken of last first."""
        place = {name: n for n, name in enumerate(self.touched)}
        return sorted(self.situation.graph.agents, key=lambda a: place.get(a.id, len(place)))

    def count_others(self) -> dict[str, int]:
        """How many there are besides the agents of the instruction."""
        others = [each for each in self.situation.present if each.role == "background"]
        walking = sum(each.type == "pedestrian" for each in others)
        return {"vehicles": len(others) - walking, "pedestrians": walking}

    def keep_way(self, node: AgentNode) -> AgentNode:
        """The node with the way that its agent takes now, where the graph leaves that open."""
        view = next((each for each in self.situation.present if each.id == node.id), None)
        if view is None:
            return node
        now = {key: getattr(view, key) for key in ("entry", "exit", "movement", "crosswalk")}
        return node.model_copy(
            update={key: value for key, value in now.items() if getattr(node, key) is None}
        )

    def find(self, phrase: str) -> AgentNode | None:
        """The agent that the words mean; None where that is no agent, or several equally."""
        words = re.sub(r"^(?:the|that|this|my) ", "", phrase)
        if words in ("me", "i", "myself"):
            return self.find(self.narrator) if self.narrator else None
        if words == "ego":
            words = "vehicle"
        named = self.list_named()
        if words in {each.id for each in named}:
            return self.situation.graph.agent(words)
        if words == "other one":  # of two that were spoken of, the one that was not meant last
            last = next((each for each in named if each.id in self.touched), None)
            rest = [each for each in named if last is not None and each.id != last.id]
            alike = [each for each in rest if last is not None and each.type == last.type]
            return rest[0] if len(rest) == 1 else alike[0] if len(alike) == 1 else None
        if words == "that one":
            return named[0] if named else None
        other = words.startswith("other ")
        if words in ("him", "her", "he", "she"):
            found = [each for each in named if each.type != "vehicle"] or named
        elif words in ("it", "that", "them", "they"):
            moving = [each for each in named if each.type != "pedestrian"]
            last = next((each for each in moving if each.id in self.touched), None)
            found = [each for each in named if each.type == "vehicle"] or named
            found = [last] if last is not None and words in ("it", "that") else found
        elif (noun := re.sub(r" rider$", "", words).split()[-1]) not in CLASSES:
            return None  # the name of one of the others
        else:
            kind, subtype = CLASSES[noun]
            found = [each for each in named if each.type == kind]
            exact = [each for each in found if subtype is None or each.subtype in (subtype, None)]
            found = exact or ([] if subtype not in (None, "car") else found)
        if other:
            found = [each for each in found if each.id not in self.touched[:1]]
        spoken = [each for each in found if each.id in self.touched]
        if len(found) == 1 or (spoken and words in _PRONOUNS):
            return found[0]
        return None


_PRONOUNS = ("him", "her", "he", "she", "it", "that", "them", "they")
_Rule = Callable[[re.Match[str], Talk], Reading | None]


def read_everyday(words: str, talk: Talk) -> Reading | None:
    """What the words amount to; None where no rule knows them.

    Words of several parts are read only where every part is known.
    """
    plain = simplify(words)
    whole = _read_part(plain, talk)
    if whole is not None:
        return whole
    parts = [each for each in re.split(r"\s*(?:[.;,!]|\band (?:then )?)\s*", plain) if each]
    edits: list[Edit] = []
    for part in parts if len(parts) > 1 else ():
        found = _read_part(part, talk)
        if not isinstance(found, Edits):
            return None
        edits += found.edits
    return Edits(edits=tuple(edits)) if edits else None


_FILLER = compile_words("everyday_words.filler")


def simplify(words: str) -> str:
    """The words in lower case, without fillers before and after them."""
    plain = " ".join(words.lower().replace("’", "'").split()).rstrip(" .!?")
    while (bare := _FILLER.sub("", plain).strip(" ,.!")) != plain and bare:
        plain = bare
    return plain


def _read_part(plain: str, talk: Talk) -> Reading | None:
    for pattern, rule in _RULES:
        found = pattern.search(plain)
        if found is not None and (reading := rule(found, talk)) is not None:
            return reading
    return None


def make_edits(*edits: Edit) -> Edits:
    """Edits that are made together."""
    return Edits(edits=edits)


def decline(reason: str) -> DeclinedTurn:
    """The refusal of what no scene can show."""
    return DeclinedTurn(code="impossible", reason=reason)


def _change_pace(found: re.Match[str], talk: Talk) -> Reading | None:
    groups = found.groupdict()
    spoken = [each for each in talk.list_named() if each.id in talk.touched]
    node = spoken[0] if spoken and not groups.get("who") else talk.find(groups.get("who") or "it")
    if node is None:
        return None
    slower = groups["pace"] in ("slower", "slowly", "slow", "less fast", "down")
    if groups.get("toofast"):
        slower = groups["pace"] == "fast"
    very = groups.get("much") in ("a lot", "much", "way", "far", "really", "very")
    strong = _VERY if slower else 1 / _VERY
    return make_edits(SetPace(agent=node.id, factor=strong if very else _SLOW if slower else _FAST))


def _change_reaction(found: re.Match[str], talk: Talk) -> Reading | None:
    """The agent of a collision or a near miss that does not react to it, or reacts after all."""
    node, groups = talk.find(found["who"]), found.groupdict()
    if "brake" in found[0] and (node is None or node.type == "pedestrian"):
        drivers = [each for each in talk.list_named() if each.type != "pedestrian"]
        node = drivers[0] if len(drivers) == 1 else None
    if node is None:
        return None
    if not any(node.id in (e.from_, e.to) for e in _list_edges(talk, ("collide_at", "near_miss"))):
        return decline(
            f"{node.id} is in no collision and no near miss, so there is nothing to react to. "
            'Say what shall happen first, such as "have it be a near miss".'
        )
    wanted = "none" if groups.get("not") else None
    if node.reaction == wanted:
        return decline(f"{node.id} {'does not react' if wanted else 'may react'} already.")
    return make_edits(ChangeAgent(node=talk.keep_way(node).model_copy(update={"reaction": wanted})))


def _remove(found: re.Match[str], talk: Talk) -> Reading | None:
    node = talk.find(found["who"])
    return None if node is None else make_edits(RemoveAgent(agent=node.id))


def _become(found: re.Match[str], talk: Talk) -> Reading | None:
    node, noun = talk.find(found["who"]), found["what"]
    if node is None:
        return None
    kind, subtype = CLASSES[noun]
    if kind != node.type and kind in RIDERS and node.type != "pedestrian":
        return replace_agent(node, noun, talk)
    if kind != node.type:
        return decline(
            f"{node.id} stays a {node.type}: those of another class move in other ways. Say what "
            f'the {noun} does instead, such as "new scene: a {noun} ...".'
        )
    if kind != "vehicle" or subtype in (None, node.subtype):
        return None
    return make_edits(ChangeAgent(node=talk.keep_way(node).model_copy(update={"subtype": subtype})))


def _reverse(found: re.Match[str], talk: Talk) -> Reading | None:
    node = talk.find(found["who"])
    view = next((e for e in talk.situation.present if node is not None and e.id == node.id), None)
    if node is None or view is None or (node.type == "vehicle" and view.movement != "straight"):
        return None
    way = {"entry": view.exit, "exit": view.entry}
    return make_edits(ChangeAgent(node=talk.keep_way(node).model_copy(update=way)))


def _wait(found: re.Match[str], talk: Talk) -> Reading | None:
    node = talk.find(found["who"])
    if node is None:
        return None
    seconds = float(found["seconds"]) if found["seconds"] else 2.0
    return make_edits(WaitLonger(agent=node.id, seconds=min(seconds, 20.0)))


def _change_numbers(found: re.Match[str], talk: Talk) -> Reading | None:
    """Half of the others, or twice as many."""
    groups = found.groupdict()
    factor = 0.5 if groups["share"] == "half" else 2.0
    noun = groups.get("noun") or "cars"
    counts = talk.count_others()
    kinds = ["pedestrians"] if noun in ("pedestrians", "people", "walkers") else ["vehicles"]
    if noun in ("traffic", "agents", "others", "everybody"):
        kinds = ["vehicles", "pedestrians"]
    wanted = {kind: min(round(counts[kind] * factor), MOST_BACKGROUND) for kind in kinds}
    return make_edits(SetBackground.model_validate(wanted))


def _change_gap(found: re.Match[str], talk: Talk) -> Reading | None:
    """A near miss or a yield closer, or less close, than it is."""
    event = next((e for e in talk.events if isinstance(e.evidence.get("pet"), float)), None)
    edge = _find_edge(talk, ("near_miss", "yield_to"))
    if event is None or edge is None:
        return None
    closer = not re.search(
        r"bigger|larger|wider|less close|further|farther|more (?:space|room)", found[0]
    )
    pet = float(event.evidence["pet"]) * (_CLOSER if closer else 1 / _CLOSER)
    wanted = edge.model_copy(update={"target_pet": round(min(max(pet, 0.3), 8.0), 1)})
    return make_edits(Relate(edge=wanted))


def _change_impact(found: re.Match[str], talk: Talk) -> Reading | None:
    event = next((e for e in talk.events if "relative_speed" in e.evidence), None)
    edge = _find_edge(talk, ("collide_at",))
    if event is None or edge is None:
        return None
    softer = re.search(r"less|softer|lighter|gentler|milder|slower", found[0]) is not None
    speed = float(event.evidence["relative_speed"]) * (_CLOSER if softer else 1 / _CLOSER)
    return make_edits(
        Relate(edge=edge.model_copy(update={"impact_speed": round(min(speed, 20.0), 1)}))
    )


def _shift_event(found: re.Match[str], talk: Talk) -> Reading | None:
    """What happens, earlier or later in the scene."""
    edge = talk.situation.graph.relations
    if len(edge) != 1 or not talk.events or talk.events[0].time is None:
        return None
    seconds = float(found["seconds"]) if found["seconds"] else _EARLIER
    time = talk.events[0].time + (seconds if found["when"] == "later" else -seconds)
    low, high = UNITS["time"].least, UNITS["time"].most
    return set_measure("time", min(max(time, low), high), edge[0].from_, edge[0].to)


def set_measure(kind: MeasureKind, value: float, agent: str, other: str | None = None) -> Edits:
    """The edit that asks for a figure, with the tolerance of its kind."""
    tolerance = UNITS[kind].tolerance
    bounds = {"low": round(max(value - tolerance, 0.0), 2), "high": round(value + tolerance, 2)}
    measure = Measure.model_validate({"kind": kind, "agent": agent, "other": other, **bounds})
    return make_edits(SetMeasure(measure=measure))


def _find_edge(talk: Talk, kinds: tuple[str, ...]) -> RelationEdge | None:
    found = _list_edges(talk, kinds)
    return found[0] if len(found) == 1 else None


def _list_edges(talk: Talk, kinds: tuple[str, ...]) -> list[RelationEdge]:
    return [each for each in talk.situation.graph.relations if each.type in kinds]


def choose_id(kind: str, talk: Talk) -> str:
    """The first id of a class that no agent has."""
    taken = {each.id for each in talk.situation.present} | {
        each.id for each in talk.situation.graph.agents
    }
    return next(f"{kind}-{n}" for n in range(1, 99) if f"{kind}-{n}" not in taken)


def replace_agent(node: AgentNode, noun: str, talk: Talk) -> Edits:
    """An agent of another class in the place of one: in its relations, on its way if it can."""
    kind, subtype = CLASSES[noun]
    name, kept = choose_id(kind, talk), talk.keep_way(node)
    way = {key: getattr(kept, key) for key in ("entry", "exit", "movement", "crosswalk")}
    way = {} if "pedestrian" in (kind, node.type) else way
    added = AgentNode.model_validate({"id": name, "type": kind, "subtype": subtype, **way})
    open_ = {"kind": None, "pattern": None, "point_from": None, "point_to": None}
    related = []
    for edge in talk.situation.graph.relations:
        ends = [key for key in ("from_", "to", "first", "strikes") if getattr(edge, key) == node.id]
        if ends:
            update = open_ | dict.fromkeys(ends, name)
            related.append(Relate(edge=edge.model_copy(update=update)))
    return make_edits(RemoveAgent(agent=node.id), AddAgent(node=added), *related)


_BY_NAME: dict[str, _Rule] = {
    "pace": _change_pace, "reaction": _change_reaction, "remove": _remove,
    "become": _become, "reverse": _reverse,
    "no_subject": lambda _found, _talk: decline(
        'Say who does that, such as "the car from the west follows the bus".'
    ),
    "time": _shift_event, "wait": _wait, "numbers": _change_numbers, "gap": _change_gap,
    "impact": _change_impact,
}  # fmt: skip
_RULES = [
    (re.compile(fill_in(form)), _BY_NAME[name]) for name, form in WORDS["everyday_words"]["rules"]
]


def _doubt(reason: str) -> DeclinedTurn:
    """A refusal of what was not understood, so that another reading may stand instead."""
    return DeclinedTurn(code="no_change", reason=reason)


def check_reading(words: str, reading: Reading, talk: Talk) -> Reading:
    """The planner's reading, unless it passes over what the words plainly say.

    Refused are a scene of its own made of words that change this one, an addition that takes away
    what happens now, and a change that leaves out the rider that the words name.
    """
    plain = simplify(words)
    graph = talk.situation.graph
    if isinstance(reading, NewScene) and graph.agents and _SPEAKS_OF_THIS.match(plain):
        return _doubt(
            'I cannot tell what shall be different. Say one change at a time, or "new scene: ..." '
            "to begin another one."
        )
    if not isinstance(reading, Edits):
        return reading
    pairs = {frozenset((each.from_, each.to)) for each in graph.relations}
    if re.match(r"(?:add|put|place)\b", plain) and any(
        frozenset((each.edge.from_, each.edge.to)) in pairs
        if isinstance(each, Relate)
        else each.edit in ("remove_agent", "unrelate")
        for each in reading.edits
    ):
        return _doubt(
            "That would take away what happens now. Say whom to add and what it does, such as "
            '"add a car that follows the bus".'
        )
    riders = re.findall(r"\b(?:cyclist|bike|bicycle|e-scooter|scooter)\b", plain)
    named = " ".join(edit.model_dump_json(by_alias=True) for edit in reading.edits)
    if passed := next((e for e in riders if f'"{CLASSES[e][0]}-' not in named), None):
        return _doubt(
            f"I cannot tell what shall become of the {passed}. Say it by its id, such as "
            f'"{CLASSES[passed][0]}-1 goes slower", or "add a {passed} from the south".'
        )
    return Edits(edits=tuple(_keep_entry(each, talk) for each in reading.edits))


def _keep_entry(edit: Edit, talk: Talk) -> Edit:
    """A turn that leaves open where an agent comes from: it still comes from where it did."""
    if not isinstance(edit, ChangeAgent) or edit.node.entry is not None:
        return edit
    view = next((each for each in talk.situation.present if each.id == edit.node.id), None)
    if view is None or edit.node.movement in (None, view.movement):
        return edit
    return ChangeAgent(node=edit.node.model_copy(update={"entry": view.entry}))


_SPEAKS_OF_THIS = compile_words("everyday_words.speaks_of_this")
