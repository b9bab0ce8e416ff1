"""What is likely to be wanted, and the change that it is.

The planner's model of turns ranks intents. An intent and what the words name (agents, sides,
numbers) become a plain sentence, such as "make vehicle-1 slower", which the planner reads as if it
had been typed, or an edit where no sentence says it. Of two opposite intents, such as slower and
faster, the words themselves decide.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

from scenewright.authoring.read_turn import offer_sentences
from scenewright.authoring.talk import Talk, simplify
from scenewright.backends.offline import (
    WORDS,
    Named,
    Patterns,
    fill_in,
    find_named,
    rank_intents,
)
from scenewright.scene.account import NAME
from scenewright.scene.base import OPPOSITE
from scenewright.scene.edits import (
    AddAgent,
    AddObject,
    CallAgent,
    ChangeAgent,
    ChangeContext,
    DeclinedTurn,
    Edit,
    Edits,
    MoveStop,
    Reading,
    Redraw,
    Relate,
    RemoveAgent,
    RemoveObject,
    SetBackground,
    SetMeasure,
    SetPace,
    WaitLonger,
)
from scenewright.scene.kinds import has_trait, list_names
from scenewright.scene.measures import MOST_OF_CLASS, UNITS, Measure, MeasureKind
from scenewright.scene.route_table import WAY_FIELDS
from scenewright.scene.social import MOST_BACKGROUND, AgentNode, ObjectNode, RelationEdge
from scenewright.tools.gmm_sampler.background_counts import DENSITIES

_PATTERNS = Patterns("intent_edits")

SURE, LIKELY = 0.75, 0.45
"""Probabilities from which an intent overrides what was read otherwise, or is ignored."""
_MORE, _FEWER, _CLOSER = 1.4, 0.6, 0.6
_EARLIER = 3.0
"""By how much what happens is earlier or later, where no figure is said [s]."""
STEPS = {
    "undo": "undo", "redo": "redo", "restart": "restart", "show": "show", "play": "play",
    "gif": "gif", "mp4": "mp4", "html": "html", "save": "save", "quit": "quit", "help": "help",
    "why_refused": "why", "talk": "talk",
}  # fmt: skip
"""Intents that are about the conversation -> the kind of turn."""
MAKES: dict[str, list[str]] = WORDS["intent_edits"]["makes"]
"""Intents that change the scene -> the kinds of edits that do so."""
_DECLINES: dict[str, str] = WORDS["intent_edits"]["declines"]
_OF_OTHERS: list[str] = WORDS["intent_edits"]["of_others"]
_NUMBERS: dict[str, float] = WORDS["intent_edits"]["numbers"]
_JOINS = r"\b(?:with|beside|next to|alongside)\b"
_STANDS = r"\b(?:double[- ]?)?(?:parked|stalled|standing|broken[- ]down) "
_FIRST = r"\bfirst$"
_IN_METRES = r"\d ?(?:m\b|met)|\bmet(?:re|er)s?\b"
_UNITS = {"m/s": 1.0, "km/h": 1 / 3.6, "mph": 0.447}


class Guess(NamedTuple):
    """The likeliest intent and its probability, that of its opposite included."""

    intent: str
    chance: float

    @property
    def is_change(self) -> bool:
        """Whether the intent is to change the scene."""
        return self.intent in MAKES

    @property
    def is_question(self) -> bool:
        """Whether the intent is to know something of the scene."""
        return self.intent.startswith("q_")


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


def relates_known(reading: Edits, talk: Talk) -> bool:
    """Whether what happens between agents that are there becomes something else."""
    known = {agent.id for agent in talk.situation.graph.agents}
    edges = [edit.edge for edit in reading.edits if isinstance(edit, Relate)]
    return any(edge.pair <= known for edge in edges)


def is_consistent(reading: Reading, intent: str, words: str, talk: Talk) -> bool:
    """Whether a reading does what the intent is: its edits are of its kinds, of those that are
    named, its way as said."""
    kinds = MAKES.get(intent, ())
    if not isinstance(reading, Edits) or not all(edit.edit in kinds for edit in reading.edits):
        return False
    named = talk.find_agents(simplify(words))
    nodes = [edit.node for edit in reading.edits if isinstance(edit, ChangeAgent)]
    dials = [e.agent for e in reading.edits if isinstance(e, SetPace | WaitLonger | MoveStop)]
    if named and not {*dials, *(node.id for node in nodes)} <= {each.id for each in named}:
        return False
    does = _DOES.get(intent)
    return does is None or does(reading, EditIntent(intent, words.lower(), talk, tuple(named)))


def _sets_pace(reading: Edits, wish: EditIntent) -> bool:
    paces = [edit for edit in reading.edits if isinstance(edit, SetPace)]
    if not paces:
        return wish.says(r"\d")
    every = not wish.says(r"\b(?:both|them|each|everyone)\b") or len(paces) > 1
    return every and all((e.factor < 1) == (wish.intent == "slower") for e in paces)


def _keeps_events(reading: Edits, wish: EditIntent) -> bool:
    """Whether what happens stays, and only by how much does not."""
    now = {(edge.from_, edge.to, edge.type) for edge in wish.talk.list_edges()}
    edges = [edit.edge for edit in reading.edits if isinstance(edit, Relate)]
    return all((edge.from_, edge.to, edge.type) in now for edge in edges)


def _changes_way(reading: Edits, wish: EditIntent) -> bool:
    field = {"turn": "movement", "cross_at": "crosswalk", "come_from": "entry"}[wish.intent]
    said = _find_turn(wish.plain) if wish.intent == "turn" else _find_side(wish.plain)
    nodes = (edit.node for edit in reading.edits if isinstance(edit, ChangeAgent))
    return said is None or any(getattr(node, field) == said for node in nodes)


def _adds_agent(reading: Edits, wish: EditIntent) -> bool:
    related = any(isinstance(edit, Relate) for edit in reading.edits)
    if (wish.named and wish.says(_JOINS)) or relates_known(reading, wish.talk):
        return False
    return related or not wish.says(r"\b(?:behind|follow)")


def _changes_context(reading: Edits, wish: EditIntent) -> bool:
    """Whether the hour becomes another; or whether more, or fewer, others are around than now."""
    was, now = (
        wish.talk.situation.graph.context,
        sum(wish.talk.situation.count_background().values()),
    )
    edits = [edit for edit in reading.edits if isinstance(edit, ChangeContext)]
    if wish.intent == "clock":
        return any(edit.time_of_day != was.time_of_day for edit in edits)
    ranges = [DENSITIES[edit.density or "medium"] for edit in edits]
    return not (edits and wish.says(r"\b(?:half|twice|double)\b")) and all(
        now < least if wish.intent == "more_traffic" else now > most for least, most in ranges
    )


def _redraws(reading: Edits, wish: EditIntent) -> bool:
    return " for " in wish.plain or all(edit == Redraw() for edit in reading.edits)


_DOES: dict[str, Callable[[Edits, EditIntent], bool]] = {
    **dict.fromkeys(("slower", "faster"), _sets_pace),
    **dict.fromkeys(("clock", "more_traffic", "less_traffic"), _changes_context),
    **dict.fromkeys(("closer", "less_close", "harder", "softer"), _keeps_events),
    **dict.fromkeys(("turn", "cross_at", "come_from"), _changes_way),
    **dict.fromkeys(("yields", "swap"), lambda _reading, wish: not wish.says(_FIRST)),
    # Whether there is anything to react to, and of what red is run, is seen by the wish alone.
    **dict.fromkeys(("not_react", "obey", "brake_hard"), lambda *_: False),
    "add_agent": _adds_agent, "redraw": _redraws,
}  # fmt: skip
"""Intents -> whether the edits of a reading do that, beside being of its kinds."""


def _find_turn(plain: str) -> str | None:
    found = re.findall(r"(?<!not )\b(left|right|straight|u-?turn)", plain)
    return {"u-turn": "uturn"}.get(found[-1], found[-1]) if found else None


def _find_side(plain: str) -> str | None:
    found = _PATTERNS.side.search(plain)
    return None if found is None else OPPOSITE[found[1]] if found[2] else found[1]


def find_new_kind(plain: str) -> Named | None:
    """The noun of a new agent, as in "a bus" or "into a bus"; None where there is none."""
    ridden = _PATTERNS.ridden.sub("", plain)
    nouns = [each for each in find_named(ridden) if each.type not in (None, "none")]
    new = [noun for noun in nouns if noun.det in ("indefinite", "another")]
    bare = [e for e in nouns if e.det == "bare" and _PATTERNS.before_kind.search(ridden[: e.start])]
    return next(iter(new or bare), None)


def make_edits(*edits: Edit) -> Edits:
    """Edits that are made together."""
    return Edits(edits=edits)


def decline(reason: str) -> DeclinedTurn:
    """The refusal of what no scene can show."""
    return DeclinedTurn(code="impossible", reason=reason)


def replace_agent(node: AgentNode, new: Named, talk: Talk) -> Edits:
    """An agent of another class in the place of one: in its relations, on its way if it can."""
    situation = talk.situation
    name = next(situation.generate_ids(str(new.type)))
    kept = talk.keep_way(node)
    on_foot = "pedestrian" in (new.type, node.type)
    way = {} if on_foot else {key: getattr(kept, key) for key in WAY_FIELDS}
    subtype = new.subtype if new.type == "vehicle" else None
    added = AgentNode.model_validate({"id": name, "type": new.type, "subtype": subtype, **way})
    open_ = {"kind": None, "pattern": None, "point_from": None, "point_to": None}
    related = []
    for edge in talk.list_edges():
        ends = [key for key in ("from_", "to", "first", "strikes") if getattr(edge, key) == node.id]
        if ends:
            update = open_ | dict.fromkeys(ends, name)
            related.append(Relate(edge=edge.model_copy(update=update)))
    said = situation.graph.said
    own = [each.words for each in said if (each.note, each.agents) == (NAME, (node.id,))]
    called = [CallAgent(agent=name, name=each) for each in own]
    return make_edits(RemoveAgent(agent=node.id), AddAgent(node=added), *called, *related)


def _set_measure(kind: MeasureKind, value: float, agent: str, other: str | None = None) -> Edits:
    """The edit that asks for a figure, with the tolerance of its kind."""
    unit = UNITS[kind]
    value = min(max(value, unit.least), unit.most)
    low, high = round(max(value - unit.tolerance, 0.0), 2), round(value + unit.tolerance, 2)
    measure = {"kind": kind, "agent": agent, "other": other, "low": low, "high": high}
    return make_edits(SetMeasure(measure=Measure.model_validate(measure)))


def _relate(edge: RelationEdge, **update: float) -> Edits:
    return make_edits(Relate(edge=edge.model_copy(update=update)))


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

    def says(self, pattern: str) -> bool:
        """Whether the words have that form."""
        return re.search(pattern, self.plain) is not None

    def choose(self, *, vehicle_first: bool = True) -> AgentNode | None:
        """The agent of the wish: the one it names, else the last one named, else the vehicle."""
        every = self.talk.list_agents()
        spoken = [*self.named, *(each for each in every if each.id in self.talk.touched)]
        if spoken:
            return spoken[0]
        driving = [each for each in every if each.type == "vehicle"] if vehicle_first else []
        return driving[0] if len(driving) == 1 else every[0] if len(every) == 1 else None

    def find_walker(self) -> AgentNode | None:
        """The only pedestrian that takes part."""
        found = [agent for agent in self.talk.list_agents() if agent.type == "pedestrian"]
        return found[0] if len(found) == 1 else None

    def number(self, *units: str) -> float | None:
        """The first number in the words, with one of these units if any are named."""
        every = sorted(
            _PATTERNS.number.finditer(self.plain), key=lambda each: each["number"] in _NUMBERS
        )
        for found in every:  # "that one, at 50": figures before words
            if not units or (found["unit"] or "").startswith(units):
                text = found["number"].replace(",", ".")
                return float(_NUMBERS.get(text, text))
        return None

    def find_edge(self, *kinds: str) -> RelationEdge | None:
        """The only relation of these kinds; None where there is none, or several."""
        found = self.talk.list_edges(*kinds)
        return found[0] if len(found) == 1 else None

    def measured(self, figure: str) -> float | None:
        """A figure that the checker measured of the first event that has it."""
        figures = (event.evidence.get(figure) for event in self.talk.events)
        return next((each for each in figures if isinstance(each, float)), None)

    def pair(self) -> tuple[str, str] | None:
        """(actor, affected agent): the two that are named, else those of the only relation."""
        every = [agent.id for agent in self.talk.situation.graph.agents]
        edge = self.find_edge()
        if len(self.named) >= 2:
            return self.named[0].id, self.named[1].id
        if not self.named:
            both = [edge.from_, edge.to] if edge is not None else every
            return (both[0], both[1]) if len(both) == 2 else None
        first = self.named[0].id
        if edge is not None and first in edge.pair:
            return first, edge.get_other(first)
        others = [each for each in every if each != first]
        return (first, others[0]) if len(others) == 1 else None


_Answer = str | Reading | None


def spell_out(intent: str, words: str, talk: Talk) -> _Answer:
    """The wish as a plain sentence or a reading; None where the words leave out the agent or the
    change."""
    if intent in _DECLINES:
        return decline(_DECLINES[intent])
    if (make := _WISHES.get(intent)) is None:
        return None
    plain = simplify(words)
    named = talk.find_agents(plain)
    if intent not in _OF_OTHERS and not named and (noun := talk.find_stranger(plain)):
        there = ", ".join(f"{e.id} ({e.subtype or e.type})" for e in talk.list_agents())
        return decline(f"There is no {noun} that takes part; there is {there or 'none'}.")
    if intent not in _OF_OTHERS and talk.find_stranger(plain, new=True):
        return None  # "have a truck hit the car" brings in a truck, which no such change does
    return make(EditIntent(intent, plain, talk, tuple(named)))


def _change_pace(wish: EditIntent) -> _Answer:
    every = list(wish.named) if len(wish.named) > 1 else [wish.choose()]
    much = "a lot " if wish.says(r"\b(?:a lot|much|way|far|really|super)\b") else ""
    made = ", ".join(f"make {e.id} {much}{wish.intent}" for e in every if e is not None)
    return (f"now {made}" if len(every) > 1 else made) or None


def _change_speed(wish: EditIntent) -> _Answer:
    node, value = wish.choose(), wish.number()
    if node is None or value is None:
        return None
    unit = "m/s" if "m/s" in wish.plain else "mph" if "mph" in wish.plain else "km/h"
    view = wish.talk.view(node)
    if view is not None and wish.says(r"\bmore\b|\bby \d|\bexceed|\bextra\b"):
        value += round(view.speed / _UNITS[unit])
    if wish.says(r"(?<![a-z])-\d"):
        return decline("No agent drives backwards here; say a speed above zero.")
    return f"let {node.id} drive at {value:g} {unit}"


def _add(wish: EditIntent) -> _Answer:
    new, side = find_new_kind(wish.plain), _find_side(wish.plain)
    if new is None:
        return None
    if new.type == "pedestrian" and wish.named and wish.says(_JOINS):
        node = wish.named[0]
        walks = node.type == "pedestrian"
        return _change(wish, node, members=(node.members or 1) + 1) if walks else None
    where = f" from the {side}" if side else ""
    behind = wish.says(r"\b(?:follow|behind|after)") and wish.named
    if wish.says(r"\b(?:follow|behind)") and not behind:
        stranger = wish.talk.find_stranger(wish.plain)
        return decline(f"There is no {stranger} that takes part.") if stranger else None
    return f"add a {new.head}{where}" + (f" that follows {wish.named[0].id}" if behind else "")


def _become(wish: EditIntent) -> _Answer:
    new = find_new_kind(wish.plain)
    if new is None:
        return None
    on_foot = new.type == "pedestrian"
    alike = [e for e in wish.talk.list_agents() if (e.type == "pedestrian") == on_foot]
    node = wish.named[0] if wish.named else alike[0] if len(alike) == 1 else wish.choose()
    if node is None:
        return None
    if new.type != node.type:
        return replace_agent(node, new, wish.talk)
    return _change(wish, node, subtype=new.subtype) if node.type == "vehicle" else None


def _change(wish: EditIntent, node: AgentNode, **update: object) -> Edits:
    """Edit fields of an agent; it keeps the way that it takes now where no field names another."""
    node = wish.talk.keep_way(node).model_copy(update=update)
    return make_edits(ChangeAgent(node=AgentNode.model_validate(node.model_dump())))


def _turn(wish: EditIntent) -> _Answer:
    node, turn = wish.choose(), _find_turn(wish.plain)
    if node is None or turn is None:
        return None
    if node.type == "pedestrian":
        return decline(f"{node.id} walks; say which crosswalk, or from which side it comes.")
    return _change(wish, node, exit=None, movement=turn)


def _cross(wish: EditIntent) -> _Answer:
    node = next((each for each in wish.named if each.type == "pedestrian"), wish.find_walker())
    view, side = (None if node is None else wish.talk.view(node)), _find_side(wish.plain)
    if side is None and wish.says(r"\b(?:other|opposite)\b"):
        side = OPPOSITE[view.crosswalk] if view is not None and view.crosswalk else None
    return None if node is None or side is None else f"put {node.id} on the {side} crosswalk"


def _reverse(wish: EditIntent) -> _Answer:
    node = wish.choose()
    view = None if node is None else wish.talk.view(node)
    if node is None or view is None:
        return None
    if node.type != "pedestrian":
        return f"make {node.id} come from the {OPPOSITE[view.entry]}"
    return _change(wish, node, entry=view.exit, exit=view.entry)


def _change_clock(wish: EditIntent) -> _Answer:
    for known, pattern in WORDS["intent_edits"]["hours"]:
        found = re.search(pattern, wish.plain)
        if found is None:
            continue
        hour, density = known, wish.talk.situation.graph.context.density
        if not hour:
            late = wish.says(r"evening|afternoon|night|\bpm\b") and int(found[1]) < 12
            hour = f"{(int(found[1]) + (12 if late else 0)) % 24:02d}:{found[2] or '00'}"
        return make_edits(ChangeContext(density=density, time_of_day=hour))
    return None


def _make_event_rule(kind: str) -> Callable[[EditIntent], _Answer]:
    def make(wish: EditIntent) -> _Answer:
        edge, pair = wish.find_edge(), wish.pair()
        if edge is not None and len(wish.named) == 1 and wish.says(_FIRST):
            return _let_first(edge, wish.named[0].id)
        if edge is not None and (len(wish.named) < 2 or pair is None or kind != "yield_to"):
            turned = kind == "yield_to" and wish.named and wish.named[0].id == edge.to
            pair = (edge.to, edge.from_) if turned else (edge.from_, edge.to)
        if pair is None:
            return None
        fields = {"type": kind, "from": pair[0], "to": pair[1]}
        return make_edits(Relate(edge=RelationEdge.model_validate(fields)))

    return make


def _swap(wish: EditIntent) -> _Answer:
    return _make_event_rule("yield_to")(wish) if wish.says(_FIRST) else "swap roles"


def _let_first(edge: RelationEdge, first: str) -> Edits:
    """What happens between two with one of them ahead; of who gives way it is the other."""
    other = edge.get_other(first)
    update = {"from_": other, "to": first} if edge.type == "yield_to" else {"first": first}
    return make_edits(Relate(edge=edge.model_copy(update={**update, "pattern": None})))


def _change_gap(wish: EditIntent) -> _Answer:
    """What happens between two closer, or less close, than it is."""
    closer, edge = wish.intent == "closer", wish.find_edge("near_miss", "yield_to")
    if wish.number("s", "m") is not None:
        return _set_gap(wish)
    headway, pet = wish.measured("least_headway"), wish.measured("pet")
    if edge is not None and pet is not None:
        pet *= _CLOSER if closer else 1 / _CLOSER
        return _relate(edge, target_pet=round(min(max(pet, 0.3), 8.0), 1))
    edge = wish.find_edge("follow")
    if edge is not None and headway is not None:
        headway *= 0.6 if closer else 1.7
        return _set_measure("headway", round(headway, 1), edge.from_, edge.to)
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
    metres = wish.says(_IN_METRES)
    if edge.type == "follow":
        return _set_measure("gap" if metres else "headway", value, edge.from_, edge.to)
    if metres:
        return decline('How near they come is set in seconds (PET): say "a PET of 1 s".')
    if edge.type in ("near_miss", "yield_to"):
        return _relate(edge, target_pet=min(value, 8.0))
    return None


def _change_impact(wish: EditIntent) -> _Answer:
    """The speed at which they collide: as said, or a harder or softer crash than it is."""
    edge, value, speed = (
        wish.find_edge("collide_at"),
        wish.number(),
        wish.measured("relative_speed"),
    )
    if wish.intent == "set_impact":
        speed = None if value is None else value if "m/s" in wish.plain else value / 3.6
    elif speed is not None:
        speed *= _CLOSER if wish.intent == "softer" else 1 / _CLOSER
    if edge is None or speed is None:
        return None
    return _relate(edge, impact_speed=round(min(speed, 20.0), 2))


def _change_event_time(wish: EditIntent) -> _Answer:
    seconds, edge = wish.number("s"), wish.find_edge()
    if seconds and wish.says(r"\bs(?:ec(?:ond)?s?)? in(?:to)?\b"):
        return f"let it happen {seconds:g} s into the scene"
    if edge is None or not wish.talk.events:
        return None
    later = (seconds or _EARLIER) * (1 if wish.intent == "event_later" else -1)
    return _set_measure("time", wish.talk.events[0].time + later, edge.from_, edge.to)


def _make_stop(wish: EditIntent) -> _Answer:
    node, edge = wish.choose(), wish.find_edge("yield_to")
    if node is not None and edge is not None and edge.from_ == node.id:
        return f"make {node.id} stop"
    return None if node is None else _make_event_rule("yield_to")(wish)


def _brake(wish: EditIntent) -> _Answer:
    node, value = wish.choose(), wish.number("m/s") or wish.number()
    if node is None or node.type == "pedestrian":
        return None
    edge = wish.find_edge("collide_at", "near_miss")
    if edge is not None and wish.says(r"\blate\b") and node.type == "vehicle":
        cause = next(name for name in list_names("cause") if has_trait("cause", name, "late"))
        late = {"cause": cause, "braker": node.id, "pattern": None}
        return make_edits(Relate(edge=edge.model_copy(update=late)))
    gentle = wish.says(r"gentl|soft|less|light")
    most = MOST_OF_CLASS.get(node.type, {}).get("braking", UNITS["braking"].most)
    return _set_measure("braking", value or min(2.0 if gentle else 5.5, most - 0.5), node.id)


def _change_motion(wish: EditIntent) -> _Answer:
    node = wish.named[0] if wish.named else wish.choose(vehicle_first=False)
    node = node if node is not None and node.type == "pedestrian" else wish.find_walker()
    walks = wish.says(r"\bwalk(?!s? or run)|\bno running|\bnot run|\bstop running")
    return None if node is None else _change(wish, node, motion=None if walks else "runs")


def _change_reaction(wish: EditIntent) -> _Answer:
    """The agent of a collision or a near miss that does not react to it, or reacts after all."""
    node = wish.choose()
    drivers = [agent for agent in wish.talk.list_agents() if agent.type != "pedestrian"]
    if "brake" in wish.plain and (node is None or node.type == "pedestrian"):
        node = drivers[0] if len(drivers) == 1 else None
    if node is None:
        return None
    met = wish.talk.list_edges("collide_at", "near_miss")
    if any(node.id == edge.from_ for edge in wish.talk.list_edges("yield_to")):
        return offer_sentences(f"{node.id} gives way.", ["make it a near miss", "make it a crash"])
    if not any(node.id in edge.pair for edge in met):
        return decline(
            f"{node.id} is in no collision and no near miss, so there is nothing to react to. "
            'Say what shall happen first, such as "have it be a near miss".'
        )
    wanted = "none" if wish.says(r"\b(?:not|never|no|without)\b|n't|\bignor|\bunaware") else None
    if node.reaction == wanted:
        return decline(f"{node.id} {'does not react' if wanted else 'may react'} already.")
    return _change(wish, node, reaction=wanted)


def _find_kinds(plain: str) -> list[str]:
    people = re.search(r"\b(?:people|pedestrians?|walkers?|peds?|persons?|on foot)\b", plain)
    cars = re.search(r"\b(?:cars?|vehicles?)\b", plain)
    if people and not cars:
        return ["pedestrians"]
    return ["vehicles"] if cars and not people else ["vehicles", "pedestrians"]


def _change_background(wish: EditIntent) -> _Answer:
    others, kinds, number = (
        wish.talk.situation.count_background(),
        _find_kinds(wish.plain),
        wish.number(),
    )
    now = {f"{kind}s": count for kind, count in others.items()}
    more = wish.intent == "more_traffic"
    twice, half = wish.says(r"\b(?:twice|double)\b"), wish.says(r"\bhalf\b")
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
    rare = {e.subtype for e in find_named(wish.plain) if e.plural} - {None, "car"}
    if rare:
        gone = [each.id for each in wish.talk.situation.background if each.subtype in rare]
        if not gone:
            return decline("There is none of these besides those that you spoke of.")
        return make_edits(*(RemoveAgent(agent=each) for each in gone))
    kinds = _find_kinds(re.sub(r"\b(?:only|just|leave)\b.*", "", wish.plain))
    return make_edits(SetBackground.model_validate(dict.fromkeys(kinds, 0)))


def _set_count(wish: EditIntent) -> _Answer:
    number, kinds = wish.number(), _find_kinds(wish.plain)
    wanted = {f"{e.type}s": e.count for e in find_named(wish.plain) if e.count is not None}
    if not wanted.keys() <= {"vehicles", "pedestrians"} or len(wanted) < 2:
        wanted = {} if number is None else {kinds[0]: round(number)}
    most = {kind: min(count, MOST_BACKGROUND) for kind, count in wanted.items()}
    return make_edits(SetBackground.model_validate(most)) if most else None


def _redraw(wish: EditIntent) -> _Answer:
    one = wish.named and wish.says(r"\b(?:path|way|route)\b")
    return make_edits(Redraw(agent=wish.named[0].id if one else None))


def _park_vehicle(wish: EditIntent) -> _Answer:
    if (made := _change_standing(wish)) is not None:
        return made
    thing, side = re.search(r"\b(?:box|container|bin)\b", wish.plain), _find_side(wish.plain)
    nouns = find_named(re.sub(_STANDS, "", wish.plain))
    kinds = [noun.subtype for noun in nouns if noun.type == "vehicle"]
    if not (thing or kinds):
        return None
    number = max((int(o.id[7:]) for o in wish.talk.situation.graph.objects), default=0) + 1
    kind, subtype = (thing[0], None) if thing else ("parked", kinds[0])
    node = {"id": f"object-{number}", "kind": kind, "subtype": subtype, "leg": side}
    return make_edits(AddObject(node=ObjectNode.model_validate(node)))


def _change_standing(wish: EditIntent) -> Edits | None:
    """What stands becomes of another kind, stands elsewhere or, where neither is said, goes."""
    plain = re.sub(_STANDS, "", wish.plain)
    nouns, side = find_named(plain), _find_side(plain)
    old = [o for o in wish.talk.situation.graph.objects if o.id in plain or any(
        noun.det != "indefinite" and noun.subtype == (o.subtype or "car") for noun in nouns
    ) or re.search(rf"\bthe {o.kind}\b", plain)]  # fmt: skip
    new = [noun.subtype for noun in nouns if noun.det == "indefinite" and noun.type == "vehicle"]
    if len(old) != 1:
        return None
    update = {"subtype": new[0]} if new else {"leg": side, "side": None} if side else None
    gone = RemoveObject(object=old[0].id)
    if update is None:
        return make_edits(gone) if wish.intent in ("unpark", "remove") else None
    return make_edits(gone, AddObject(node=old[0].model_copy(update=update)))


def _remove_parked(wish: EditIntent) -> _Answer:
    objects = wish.talk.situation.graph.objects
    if not objects:
        return decline("Nothing stands in this scene that could be taken away.")
    if (made := _change_standing(wish)) is not None:
        return made
    return make_edits(RemoveObject(object=objects[0].id)) if len(objects) == 1 else None


def _hide(wish: EditIntent) -> _Answer:
    if wish.find_walker() is None:
        return decline(
            "A parked vehicle can hide a pedestrian from a vehicle; there is no pedestrian here."
        )
    found = re.search(r"\b(?:van|truck|bus|car|lorry)\b", re.sub(r"from the \w+", "", wish.plain))
    return f"have her step out from behind a parked {found[0] if found else 'van'}"


def _change_light(wish: EditIntent) -> _Answer:
    """Who runs the red light, or no longer does; then nothing comes of it any more, either."""
    runs = wish.intent == "run_red"
    causes = [e for e in wish.talk.list_edges() if has_trait("cause", e.cause, "red_light")]
    running = [agent for agent in wish.talk.situation.graph.agents if agent.runs_red]
    node = wish.choose() if runs else next(iter(running), None)
    if node is None and (runs or not causes):
        return None if runs else decline("No agent runs a red light in this scene.")
    changed = () if node is None else _change(wish, node, runs_red=runs).edits
    freed = [] if runs else [Relate(edge=e.model_copy(update={"cause": None})) for e in causes]
    return make_edits(*changed, *freed)


def _speak(wish: EditIntent) -> str | None:
    """The sentence that says the wish, with what the words name in its places."""
    sentence: str = WORDS["intent_edits"]["spoken"][wish.intent]
    named, walker = (wish.named[0] if wish.named else None), wish.find_walker()
    agents = {"named": named, "who": wish.choose(), "walker": walker,
              "anyone": wish.choose(vehicle_first=False)}  # fmt: skip
    places = {place: None if node is None else node.id for place, node in agents.items()} | {
        "side": _find_side(wish.plain), "let": f"let {named.id} " if named else "",
        "seconds": f"{wish.number('s') or 2.0:g}", "metres": f"{wish.number('m') or 1.0:g}",
    }  # fmt: skip
    said = sentence.format(**places)
    return None if "None" in said else said


_WISHES: dict[str, Callable[[EditIntent], _Answer]] = {
    "slower": _change_pace, "faster": _change_pace, "set_speed": _change_speed,
    **dict.fromkeys(WORDS["intent_edits"]["spoken"], _speak),
    "add_agent": _add, "become": _become, "turn": _turn,
    "cross_at": _cross, "reverse": _reverse, "clock": _change_clock,
    "collide": _make_event_rule("collide_at"), "near_miss": _make_event_rule("near_miss"),
    "yields": _make_event_rule("yield_to"), "follow": _make_event_rule("follow"),
    "swap": _swap,
    "closer": _change_gap, "less_close": _change_gap, "set_gap": _set_gap,
    **dict.fromkeys(("harder", "softer", "set_impact"), _change_impact),
    "event_earlier": _change_event_time, "event_later": _change_event_time,
    "make_stop": _make_stop, "brake_hard": _brake, "not_react": _change_reaction,
    "runs": _change_motion, "more_traffic": _change_background,
    "less_traffic": _change_background, "no_traffic": _remove_background, "set_count": _set_count,
    "redraw": _redraw, "park": _park_vehicle, "unpark": _remove_parked, "hide": _hide,
    "run_red": _change_light, "obey": _change_light,
}  # fmt: skip
