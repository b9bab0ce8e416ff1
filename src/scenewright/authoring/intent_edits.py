"""Words that no rule of form reads, by what they are likely to want.

The planner's model of turns ranks intents. An intent and what the words name (agents, sides,
numbers) become a plain sentence, such as "make vehicle-1 slower", which is read as if it had been
typed, or an edit. So a wish in unusual words is done by the same code as one in usual words. Of
two opposite intents, such as slower and faster, the words themselves decide.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

from scenewright.authoring.everyday_words import (
    LENGTH,
    WEATHER,
    Talk,
    decline,
    make_edits,
    replace_agent,
    set_measure,
    simplify,
)
from scenewright.authoring.vocabulary import compile_words, fill_in
from scenewright.backends.offline import CLASSES, WORDS, rank_intents
from scenewright.scene.base import OPPOSITE
from scenewright.scene.edits import (
    AgentView,
    ChangeAgent,
    Edits,
    Reading,
    Redraw,
    Relate,
    RemoveAgent,
    RemoveObject,
    SetBackground,
)
from scenewright.scene.measures import UNITS
from scenewright.scene.social import MOST_BACKGROUND, AgentNode, RelationEdge

SURE, LIKELY = 0.75, 0.45
"""Probabilities from which an intent overrides what was read otherwise, or is ignored."""
_MORE, _FEWER = 1.4, 0.6


class Guess(NamedTuple):
    """The likeliest intent and its probability, that of its opposite included."""

    intent: str
    chance: float


@lru_cache(maxsize=256)
def guess_intent(words: str) -> Guess:
    """What the words most likely want, with what stands around the wish or without it."""
    whole, bare = _guess(words), _guess(simplify(words) or words)
    return whole if whole.chance >= min(bare.chance, SURE) else bare


def _guess(words: str) -> Guess:
    denied = re.sub(r",? ?\bnot (?:an? )?(?:near miss|collision|crash|accident)\b", "", words)
    ranked = rank_intents(denied.strip() or words)
    chances, (first, _) = dict(ranked), ranked[0]
    for one, other, pattern in WORDS["intent_edits"]["opposites"]:
        if first in (one, other):
            meant = other if re.search(fill_in(pattern), words.lower()) else one
            return Guess(meant, chances[one] + chances[other])
    return Guess(first, ranked[0].chance)


def is_question(intent: str) -> bool:
    """Whether the intent is to know something of the scene."""
    return intent.startswith("q_")


STEPS = {
    "undo": "undo", "redo": "redo", "restart": "restart", "show": "show", "play": "play",
    "gif": "gif", "mp4": "mp4", "html": "html", "save": "save", "quit": "quit", "help": "help",
    "why_refused": "why", "talk": "talk",
}  # fmt: skip
"""Intents that are about the conversation -> the kind of turn."""

_MAKES: dict[str, list[str]] = WORDS["intent_edits"]["makes"]


def is_change(intent: str) -> bool:
    """Whether the intent is to change the scene."""
    return intent in _MAKES


def list_makes(intent: str) -> set[str]:
    """The kinds of edits that do what the intent is."""
    return set(_MAKES.get(intent, ()))


def is_consistent(reading: Reading, intent: str, words: str) -> bool:
    """Whether a reading does what the intent is: its edits are of its kinds, its way as said."""
    kinds = list_makes(intent)
    if not isinstance(reading, Edits) or not all(each.edit in kinds for each in reading.edits):
        return False
    nodes = [each.node for each in reading.edits if isinstance(each, ChangeAgent)]
    plain = words.lower()
    if intent in ("slower", "faster") and re.search(r"\b(?:both|them|each|everyone)\b", plain):
        return len(reading.edits) > 1
    if intent == "redraw":
        return all(each == Redraw() for each in reading.edits) or " for " in plain
    if intent == "turn" and (said := _find_turn(plain)) is not None:
        return any(node.movement == said for node in nodes)
    if intent == "cross_at" and (side := _find_side(plain)) is not None:
        return any(node.crosswalk == side for node in nodes)
    if intent == "add_agent" and re.search(r"\b(?:behind|follow)", plain):
        return any(isinstance(each, Relate) for each in reading.edits)
    if intent == "come_from" and (side := _find_side(plain)) is not None:
        return any(node.entry == side for node in nodes)
    return True


def _find_turn(plain: str) -> str | None:
    found = re.findall(r"(?<!not )\b(left|right|straight|u-?turn)", plain)
    return {"u-turn": "uturn"}.get(found[-1], found[-1]) if found else None


_NOUN = fill_in("{noun}")
_MENTION = compile_words("intent_edits.mention")
_KINDS = compile_words("intent_edits.kinds")
_BARE_KIND = compile_words("intent_edits.bare_kind")
_SIDE = re.compile(r"\b(north|south|east|west)(?:ern|erly)?\b")
_BOUND = re.compile(r"\b(north|south|east|west)bound\b")
_NUMBERS: dict[str, float] = WORDS["intent_edits"]["numbers"]
_NUMBER = compile_words("intent_edits.number")


def has_agent_noun(plain: str) -> bool:
    """Whether there is a noun of a road user in the words."""
    return re.search(rf"\b(?:{_NOUN}|people|somebody|someone)(?:e?s)?\b", plain) is not None


@dataclass(frozen=True)
class EditIntent:
    """Words with an intent, and the scene that they are about.

    Attributes:
        plain: the words in lower case without fillers; named: agents that take part, by the words.
    """

    intent: str
    plain: str
    talk: Talk
    named: tuple[AgentNode, ...]

    def choose(self, *, vehicle_first: bool = True) -> AgentNode | None:
        """The agent of the wish: the one it names, else the last one named, else the vehicle."""
        if self.named:
            return self.named[0]
        every = self.talk.list_named()
        spoken = [each for each in every if each.id in self.talk.touched]
        if spoken:
            return spoken[0]
        driving = [each for each in every if each.type == "vehicle"] if vehicle_first else []
        return driving[0] if len(driving) == 1 else every[0] if len(every) == 1 else None

    def find_walker(self) -> AgentNode | None:
        """The only pedestrian that takes part."""
        found = [each for each in self.talk.list_named() if each.type == "pedestrian"]
        return found[0] if len(found) == 1 else None

    def view(self, node: AgentNode) -> AgentView | None:
        """The agent as it is in the scene."""
        return next((each for each in self.talk.situation.present if each.id == node.id), None)

    def number(self, *units: str) -> float | None:
        """The first number in the words, with one of these units if any are named."""
        every = sorted(_NUMBER.finditer(self.plain), key=lambda each: each["number"] in _NUMBERS)
        for found in every:  # "that one, at 50": figures before words
            if not units or (found["unit"] or "").startswith(units):
                text = found["number"].replace(",", ".")
                return float(_NUMBERS.get(text, text))
        return None

    def find_edge(self, *kinds: str) -> RelationEdge | None:
        """The only relation of these kinds; None where there is none, or several."""
        edges = self.talk.situation.graph.relations
        found = [each for each in edges if not kinds or each.type in kinds]
        return found[0] if len(found) == 1 else None

    def pair(self) -> tuple[str, str] | None:
        """(actor, affected agent): the two that are named, else those of the only relation."""
        every = [each.id for each in self.talk.situation.graph.agents]
        edge = self.find_edge()
        if len(self.named) >= 2 and self.named[0].id != self.named[1].id:
            return self.named[0].id, self.named[1].id
        if self.named:
            first = self.named[0].id
            others = [each for each in every if each != first]
            if edge is not None and first in (edge.from_, edge.to):
                return first, edge.to if edge.from_ == first else edge.from_
            return (first, others[0]) if len(others) == 1 else None
        if edge is not None:
            return edge.from_, edge.to
        return (every[0], every[1]) if len(every) == 2 else None


_Answer = str | Reading | None


def spell_out(intent: str, words: str, talk: Talk) -> _Answer:
    """The wish as a plain sentence or a reading; None where the words leave out the agent or the
    change."""
    if (make := _WISHES.get(intent)) is None:
        return None
    plain = simplify(words)
    named = find_named(plain, talk)
    if intent not in _OF_OTHERS and not named and (noun := _find_stranger(plain, talk)):
        there = ", ".join(f"{e.id} ({e.subtype or e.type})" for e in talk.list_named())
        return decline(f"There is no {noun} that takes part; there is {there or 'none'}.")
    if intent not in _OF_OTHERS and _find_stranger(plain, talk, new=True):
        return None  # "have a truck hit the car" brings in a truck, which no such change does
    return make(EditIntent(intent, plain, talk, tuple(named)))


_OF_OTHERS: list[str] = WORDS["intent_edits"]["of_others"]


def _find_stranger(plain: str, talk: Talk, *, new: bool = False) -> str | None:
    """A noun of a road user of a class that no agent of the instruction has.

    Args:
        new: look at "a truck" and "another truck" instead of "the truck".
    """
    for each in _MENTION.finditer(plain):
        noun = each["noun"]
        if noun is not None and bool(each["new"]) is new:
            kind, subtype = CLASSES[noun]
            alike = [e for e in talk.situation.graph.agents if e.type == kind]
            if not any(subtype in (None, "car", each.subtype) for each in alike):
                return str(noun)
    return None


def find_named(plain: str, talk: Talk) -> list[AgentNode]:
    """The agents of the instruction that the words name, in their order."""
    if re.search(r"\b(?:both|the two|they|them|everyone|each other)\b", plain):
        return list(talk.situation.graph.agents)
    found: list[AgentNode] = []
    for each in _MENTION.finditer(plain):
        if each["new"]:
            continue
        said = each["id"] or each["word"]
        noun = f"{each['other'] or ''}{each['noun']}" if said is None else said
        node = talk.find("other one" if noun.startswith("the other") else noun)
        if node is not None and node not in found:
            found.append(node)
    return found


def _change_pace(wish: EditIntent) -> _Answer:
    faster = wish.intent == "faster"
    every = list(wish.named) if len(wish.named) > 1 else [wish.choose()]
    much = re.search(r"\b(?:a lot|much|way|far|really|super)\b", wish.plain)
    chosen = [each.id for each in every if each is not None]
    if not chosen:
        return None
    how = ("a lot " if much else "") + ("faster" if faster else "slower")
    return ", ".join(f"make {each} {how}" for each in chosen)


def _change_speed(wish: EditIntent) -> _Answer:
    node, value = wish.choose(), wish.number()
    if node is None or value is None:
        return None
    unit = "m/s" if "m/s" in wish.plain else "mph" if "mph" in wish.plain else "km/h"
    view = wish.view(node)
    if view is not None and re.search(r"\bmore\b|\bby \d|\bexceed|\bextra\b", wish.plain):
        value += round(view.speed / _UNITS[unit])
    if re.search(r"-\d", wish.plain):
        return decline("No agent drives backwards here; say a speed above zero.")
    return f"let {node.id} drive at {value:g} {unit}"


_UNITS = {"m/s": 1.0, "km/h": 1 / 3.6, "mph": 0.447}


def find_new_kind(plain: str) -> str | None:
    """The noun of a new agent, as in "a bus" or "into a bus"; None where there is none."""
    ridden = re.sub(
        r"\ban? (?:[a-z]+ )?[a-z]+ (?=(?:on|riding) an? )|\b(?:on|riding) (?=an? )", "", plain
    )
    found = _KINDS.search(ridden) or _BARE_KIND.search(ridden)
    return None if found is None else found["noun"] or found["only"]


def _add(wish: EditIntent) -> _Answer:
    noun = find_new_kind(wish.plain)
    if noun is None:
        return None
    side = _find_side(wish.plain)
    where = f" from the {side}" if side else ""
    behind = re.search(r"\b(?:follow|behind|after)", wish.plain) and wish.named
    if re.search(r"\b(?:follow|behind)", wish.plain) and not behind:
        stranger = _find_stranger(wish.plain, wish.talk)
        return decline(f"There is no {stranger} that takes part.") if stranger else None
    return f"add a {noun}{where}" + (f" that follows {wish.named[0].id}" if behind else "")


def _become(wish: EditIntent) -> _Answer:
    noun = find_new_kind(wish.plain)
    if noun is None:
        return None
    kind = CLASSES[noun][0]
    alike = [
        each
        for each in wish.talk.list_named()
        if (each.type == "pedestrian") == (kind == "pedestrian")
    ]
    node = wish.named[0] if wish.named else alike[0] if len(alike) == 1 else wish.choose()
    if node is None:
        return None
    return f"make {node.id} a {noun}" if kind == node.type else replace_agent(node, noun, wish.talk)


def _find_side(plain: str) -> str | None:
    bound = _BOUND.search(plain)
    if bound is not None:
        return OPPOSITE[bound[1]]
    found = _SIDE.search(plain)
    return None if found is None else found[1]


def _go(wish: EditIntent) -> _Answer:
    node, side = wish.choose(), _find_side(wish.plain)
    way = "come from" if wish.intent == "come_from" else "leave to"
    return None if node is None or side is None else f"make {node.id} {way} the {side}"


def _turn(wish: EditIntent) -> _Answer:
    node = wish.choose()
    turn = _find_turn(wish.plain)
    view = None if node is None else wish.view(node)
    if node is None or view is None or turn is None:
        return None
    if node.type == "pedestrian":
        return decline(f"{node.id} walks; say which crosswalk, or from which side it comes.")
    way = {"entry": view.entry, "exit": None, "movement": turn}
    return make_edits(ChangeAgent(node=AgentNode.model_validate({**node.model_dump(), **way})))


def _cross(wish: EditIntent) -> _Answer:
    node = next((each for each in wish.named if each.type == "pedestrian"), wish.find_walker())
    view, side = (None if node is None else wish.view(node)), _find_side(wish.plain)
    if side is None and re.search(r"\b(?:other|opposite)\b", wish.plain):
        side = OPPOSITE[view.crosswalk] if view is not None and view.crosswalk else None
    return None if node is None or side is None else f"put {node.id} on the {side} crosswalk"


def _reverse(wish: EditIntent) -> _Answer:
    node = wish.choose()
    view = None if node is None else wish.view(node)
    if node is None or view is None:
        return None
    if node.type == "pedestrian":
        return f"{node.id} goes the other way"
    return f"make {node.id} come from the {OPPOSITE[view.entry]}"


def _change_clock(wish: EditIntent) -> _Answer:
    for hour, pattern in WORDS["intent_edits"]["hours"]:
        found = re.search(pattern, wish.plain)
        if found is None:
            continue
        if not hour:
            late = re.search(r"evening|afternoon|night|\bpm\b", wish.plain) and int(found[1]) < 12
            return f"make it {(int(found[1]) + (12 if late else 0)) % 24:02d}:{found[2] or '00'}"
        return f"make it {hour}"
    return None


def _make_event_rule(kind: str) -> Callable[[EditIntent], _Answer]:
    def make(wish: EditIntent) -> _Answer:
        edge, pair = wish.find_edge(), wish.pair()
        if edge is not None and (len(wish.named) < 2 or pair is None or kind != "yield_to"):
            turned = kind == "yield_to" and wish.named and wish.named[0].id == edge.to
            pair = (edge.to, edge.from_) if turned else (edge.from_, edge.to)
        if pair is None:
            return None
        fields = {"type": kind, "from": pair[0], "to": pair[1]}
        return make_edits(Relate(edge=RelationEdge.model_validate(fields)))

    return make


def _say(answer: _Answer) -> Callable[[EditIntent], _Answer]:
    return lambda _wish: answer


def _change_gap(wish: EditIntent) -> _Answer:
    closer = wish.intent == "closer"
    number = wish.number("s", "m")
    if number is not None:
        return _set_gap(wish)
    edge = wish.find_edge("follow")
    event = next(
        (e for e in wish.talk.events if isinstance(e.evidence.get("least_headway"), float)), None
    )
    if edge is not None and event is not None:
        wanted = float(event.evidence["least_headway"]) * (0.6 if closer else 1.7)
        wanted = min(max(wanted, UNITS["headway"].least), UNITS["headway"].most)
        return set_measure("headway", round(wanted, 1), edge.from_, edge.to)
    if wish.find_edge("collide_at") is not None:
        return decline(
            'They collide, so there is no gap; say "make it a near miss", or "a softer crash".'
            if not closer else 'They collide already; say "a harder crash" or "a softer crash".'
        )  # fmt: skip
    return f"make the gap {'smaller' if closer else 'bigger'}"


def _set_gap(wish: EditIntent) -> _Answer:
    value, edge = wish.number("s", "m") or wish.number(), wish.find_edge()
    if value is None or edge is None:
        return None
    metres = re.search(r"\d ?(?:m\b|met)|\bmet(?:re|er)s?\b", wish.plain) is not None
    if edge.type == "follow":
        return set_measure("gap" if metres else "headway", value, edge.from_, edge.to)
    if metres:
        return decline('How near they come is set in seconds (PET): say "a PET of 1 s".')
    if edge.type in ("near_miss", "yield_to"):
        return make_edits(Relate(edge=edge.model_copy(update={"target_pet": min(value, 8.0)})))
    return None


def _change_impact(wish: EditIntent) -> _Answer:
    return f"make the crash {wish.intent}" if wish.find_edge("collide_at") else None


def _set_impact(wish: EditIntent) -> _Answer:
    value, edge = wish.number(), wish.find_edge("collide_at")
    if value is None or edge is None:
        return None
    speed = value if "m/s" in wish.plain else value / 3.6
    update = {"impact_speed": round(min(speed, 20.0), 2)}
    return make_edits(Relate(edge=edge.model_copy(update=update)))


def _change_event_time(wish: EditIntent) -> _Answer:
    seconds = wish.number("s")
    if seconds and re.search(r"\bsec(?:ond)?s? in(?:to)?\b|\bs in(?:to)?\b", wish.plain):
        return f"let it happen {seconds:g} s into the scene"
    when = "later" if wish.intent == "event_later" else "earlier"
    return f"{seconds:g} seconds {when}" if seconds else when


def _come(wish: EditIntent) -> _Answer:
    node, seconds = wish.choose(vehicle_first=False), wish.number("s") or 2.0
    when = "later" if wish.intent == "come_later" else "earlier"
    return None if node is None else f"{node.id} comes {seconds:g} seconds {when}"


def _stop(wish: EditIntent) -> _Answer:
    """How long it stands, or where."""
    subject = f"let {wish.named[0].id} " if wish.named else ""
    if wish.intent.startswith("wait"):
        more = "longer" if wish.intent == "wait_longer" else "less"
        return f"{subject}wait {wish.number('s') or 2.0:g} seconds {more}"
    where = "later" if wish.intent == "stop_later" else "earlier"
    return f"{subject}stop {wish.number('m') or 1.0:g} metres {where}"


def _make_stop(wish: EditIntent) -> _Answer:
    node = wish.choose()
    if node is None:
        return None
    edge = wish.find_edge("yield_to")
    if edge is not None and edge.from_ == node.id:
        return f"make {node.id} stop"
    return _make_event_rule("yield_to")(wish)


def _brake(wish: EditIntent) -> _Answer:
    node, value = wish.choose(), wish.number("m/s") or wish.number()
    if node is None or node.type == "pedestrian":
        return None
    gentle = re.search(r"gentl|soft|less|light", wish.plain)
    return set_measure("braking", value or (2.0 if gentle else 5.5), node.id)


def _change_motion(wish: EditIntent) -> _Answer:
    node = wish.named[0] if wish.named else wish.choose(vehicle_first=False)
    if node is None or node.type != "pedestrian":
        node = wish.find_walker()
    if node is None:
        return None
    walks = re.search(r"\bwalk(?!s? or run)|\bno running|\bnot run|\bstop running", wish.plain)
    update = {"motion": None if walks else "runs"}
    return make_edits(ChangeAgent(node=wish.talk.keep_way(node).model_copy(update=update)))


_PEOPLE = r"\b(?:people|pedestrians?|walkers?|peds?|persons?|on foot)\b"


def _find_kinds(plain: str) -> list[str]:
    people, cars = re.search(_PEOPLE, plain), re.search(r"\b(?:cars?|vehicles?)\b", plain)
    if people and not cars:
        return ["pedestrians"]
    return ["vehicles"] if cars and not people else ["vehicles", "pedestrians"]


def _change_background(wish: EditIntent) -> _Answer:
    now, kinds, number = wish.talk.count_others(), _find_kinds(wish.plain), wish.number()
    more = wish.intent == "more_traffic"
    twice, half = re.search(r"\b(?:twice|double)\b", wish.plain), re.search(r"\bhalf\b", wish.plain)
    wanted = {}
    for kind in kinds:
        was = now[kind]
        share = 2.0 if twice else 0.5 if half else _MORE if more else _FEWER
        change = round(was * share) - was
        if number is not None and number >= 1 and not twice and not half:
            change = round(number) if more else -round(number)
        elif more:
            change = max(change, 3)
        wanted[kind] = min(max(was + change, 0), MOST_BACKGROUND)
    if all(wanted[kind] == now[kind] for kind in kinds):
        return decline(
            f"There are {now['vehicles']} vehicles and {now['pedestrians']} pedestrians already."
        )
    return make_edits(SetBackground.model_validate(wanted))


def _remove_background(wish: EditIntent) -> _Answer:
    """No agent besides those of the event; or none of a kind of vehicle."""
    nouns = re.findall(rf"\b({_NOUN})(?:e?s)\b", wish.plain)
    if rare := {CLASSES[each][1] for each in nouns} - {None, "car"}:
        gone = [each.id for each in wish.talk.situation.present
                if each.role == "background" and each.subtype in rare]  # fmt: skip
        if not gone:
            return decline("There is none of these besides those that you spoke of.")
        return make_edits(*(RemoveAgent(agent=each) for each in gone))
    kinds = _find_kinds(re.sub(r"\bonly\b.*|\bjust\b.*|\bleave\b.*", "", wish.plain))
    return make_edits(SetBackground.model_validate(dict.fromkeys(kinds, 0)))


def _set_count(wish: EditIntent) -> _Answer:
    number, kinds = wish.number(), _find_kinds(wish.plain)
    if number is None:
        return None
    return make_edits(SetBackground.model_validate({kinds[0]: round(min(number, MOST_BACKGROUND))}))


def _redraw(wish: EditIntent) -> _Answer:
    one = wish.named and re.search(r"\b(?:path|way|route)\b", wish.plain)
    return make_edits(Redraw(agent=wish.named[0].id if one else None))


def _park_vehicle(wish: EditIntent) -> _Answer:
    found = re.search(rf"\b(?P<noun>{_NOUN}|box|container|bin)\b", wish.plain)
    side = _find_side(wish.plain)
    if found is None or side is None:
        return None
    parked = "" if found["noun"] in ("box", "container", "bin") else "parked "
    return f"add a {parked}{found['noun']} on the {side} leg"


def _remove_parked(wish: EditIntent) -> _Answer:
    objects = wish.talk.situation.graph.objects
    if not objects:
        return decline("Nothing stands in this scene that could be taken away.")
    return make_edits(RemoveObject(object=objects[0].id)) if len(objects) == 1 else None


def _hide(wish: EditIntent) -> _Answer:
    if wish.find_walker() is None:
        return decline(
            "A parked vehicle can hide a pedestrian from a vehicle; there is no pedestrian here."
        )
    found = re.search(r"\b(?:van|truck|bus|car|lorry)\b", re.sub(r"from the \w+", "", wish.plain))
    return f"have her step out from behind a parked {found[0] if found else 'van'}"


def _change_light(wish: EditIntent) -> _Answer:
    running = [each for each in wish.talk.situation.graph.agents if each.runs_red]
    runs = wish.intent == "run_red"
    node = wish.choose() if runs else (running[0] if running else None)
    if node is None:
        return None if runs else decline("No agent runs a red light in this scene.")
    made = wish.talk.keep_way(node).model_copy(update={"runs_red": runs})
    return make_edits(ChangeAgent(node=made))


def _make_jaywalker(wish: EditIntent) -> _Answer:
    walker = wish.find_walker()
    return None if walker is None else f"make {walker.id} jaywalk"


BEYOND = (
    "That cannot be had here: there are vehicles, cyclists, e-scooters and pedestrians at this "
    'intersection, how they move, and the hour. Say for instance "make the car a bus" or "make it '
    'night".'
)
_WISHES: dict[str, Callable[[EditIntent], _Answer]] = {
    "slower": _change_pace, "faster": _change_pace, "set_speed": _change_speed,
    "remove": lambda wish: f"remove {wish.named[0].id}" if wish.named else None,
    "add_agent": _add, "become": _become, "come_from": _go, "turn": _turn, "go_to": _go,
    "cross_at": _cross, "reverse": _reverse, "clock": _change_clock,
    "collide": _make_event_rule("collide_at"), "near_miss": _make_event_rule("near_miss"),
    "yields": _make_event_rule("yield_to"), "follow": _make_event_rule("follow"),
    "nothing_happens": _say("nothing happens"), "swap": _say("swap roles"), "closer": _change_gap,
    "less_close": _change_gap, "set_gap": _set_gap, "harder": _change_impact,
    "softer": _change_impact, "set_impact": _set_impact, "event_earlier": _change_event_time,
    "event_later": _change_event_time, "come_earlier": _come, "come_later": _come,
    **dict.fromkeys(("wait_longer", "wait_less", "stop_earlier", "stop_later"), _stop),
    "make_stop": _make_stop,
    "brake_hard": _brake, "runs": _change_motion, "more_traffic": _change_background,
    "less_traffic": _change_background, "no_traffic": _remove_background, "set_count": _set_count,
    "redraw": _redraw, "park": _park_vehicle, "unpark": _remove_parked, "hide": _hide,
    "run_red": _change_light, "obey": _change_light, "jaywalk": _make_jaywalker,
    "weather": _say(decline(WEATHER)), "length": _say(decline(LENGTH)),
    "beyond": _say(decline(BEYOND)),
}  # fmt: skip
