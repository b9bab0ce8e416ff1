"""From a reading to a draft of the scene: directions, measures and times resolved by rule."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from itertools import product

from scenewright.backends.builtin.clock import is_pronoun, read_clock, read_time_words
from scenewright.backends.builtin.draft import (
    AgentDraft,
    Draft,
    MeasureDraft,
    Refused,
    RelationDraft,
    Site,
)
from scenewright.backends.builtin.normalise import clean
from scenewright.backends.builtin.reader.annotation import (
    EVENTS,
    MENTIONS,
    SEPARATOR,
    SIDES,
)
from scenewright.backends.builtin.reader.asked_numbers import NUMBERS, read_number, says_pace
from scenewright.backends.builtin.reader.groups import GROUP, takes_part
from scenewright.backends.builtin.reader.interpretation import AccountEntry, Interpretation
from scenewright.backends.builtin.reader.manoeuvres import (
    read_lanes,
    settle_lanes,
    settle_lead_braking,
)
from scenewright.backends.builtin.reader.measures import measure_in
from scenewright.backends.builtin.reader.numbers import TO_TWENTY, number_in
from scenewright.backends.builtin.reader.orders import has_order_words
from scenewright.backends.builtin.reader.reading import Reading, ReadSpan
from scenewright.backends.builtin.reader.words import (
    Patterns,
    find_class,
    find_subtype,
    time_words_in,
)
from scenewright.backends.builtin.scope import build_not_english, build_nothing_planned
from scenewright.scene.account import Became, format_background
from scenewright.scene.base import OPPOSITE, AgentClass
from scenewright.scene.kinds import find_marked, list_names
from scenewright.scene.relations import load_patterns
from scenewright.scene.social import (
    MOST_BACKGROUND,
    RelationType,
)

_PATTERNS = Patterns("interpret")

RELATIONS = {"hit": "collide_at", "near": "near_miss", "yield": "yield_to", "follow": "follow"}
_RELATIVE = {
    "opp": "opposite", "left": "of_left", "right": "of_right", "same": "same",
    "lateral": "lateral", "other": "other", "exit": "exit_crosswalk", "entry": "entry_crosswalk",
}  # fmt: skip
_UNKNOWN_CLASS = {
    "cyc": "Rickshaws and the like are not a class of this generator",
    "scoot": "Skateboards, wheelchairs and the like are not a class of this generator",
    "obj": "Objects that stand are not a class of this generator",
    "other": "This agent is not a class of this generator",
}
_BEYOND = {
    "weather": "weather is not modelled", "act": "this is not among the things agents can do",
    "sight": "sight between agents is not modelled", "broken": "defects are not modelled",
    "thing": "this object is not modelled", "speed": "speeds cannot be asked for",
    "headway": "headways cannot be asked for", "gap": "distances cannot be asked for",
    "dist": "distances cannot be asked for", "wait": "waiting times cannot be asked for",
    "when": "the time of the event cannot be asked for",
    "decel": "braking rates cannot be asked for", "accel": "accelerations cannot be asked for",
    "first": "the order of passing cannot be asked for",
}  # fmt: skip

_INITIAL = {"n": "north", "e": "east", "s": "south", "w": "west"}


Rule = Callable[[Interpretation, ReadSpan], None]


def interpret(reading: Reading, site: Site) -> Interpretation:
    """The draft of a scene that a reading says.

    Raises:
        Refused: what was read cannot be a scene: a class that is not there, an unknown number.
    """
    if reading.kind == "foreign":
        raise build_not_english()
    if reading.kind == "off" or not reading.spans:
        raise build_nothing_planned()
    result = Interpretation(Draft(site=site), reading.text)
    result.eventful = any(span.tag in EVENTS and not span.negated for span in reading.spans)
    change = reading.text.find(SEPARATOR) if reading.kind == "edit" else -1
    result.spans = tuple(sorted(reading.spans, key=lambda each: each.start))
    _introduce_drafts(result, reading)
    for span in sorted(_assign_owners(result, reading), key=lambda each: each.start):
        if 0 <= change < span.start and not result.changing:
            _settle(result)
            result.changing = True
        if span.tag not in MENTIONS:
            _RULES.get(span.tag, _leave_out)(result, span)
    _settle(result)
    return result


def _assign_owners(result: Interpretation, reading: Reading) -> tuple[ReadSpan, ...]:
    """The spans; routes without an agent get a vehicle that no word names ("drive west")."""
    ways = [s for s in reading.spans if s.tag in _DRIVEN and not (s.negated or s.subjects)]
    if result.users or not ways:
        return reading.spans
    vehicle = _add_implied_vehicle(result)
    return tuple(replace(s, subjects=(vehicle,)) if s in ways else s for s in reading.spans)


_DRIVEN = ("from", "to", "heading", "left", "right", "straight", "uturn", "red")


def _introduce_drafts(result: Interpretation, reading: Reading) -> None:
    """A draft for every road user; those of other classes are refused by name."""
    eventful = {user for span in reading.spans if span.tag in EVENTS for user in span.users}
    for number, index in reading.users.items():
        span = reading.spans[index]
        if span.tag not in MENTIONS:
            continue  # a thing that only says where somebody moves: "blocks the box"
        if span.negated:
            result.absent.append(span)
            kind = {"veh": "vehicles", "ped": "pedestrians"}.get(span.tag)
            if kind is not None:
                setattr(result.draft.context, kind, 0)
            value = format_background({kind: 0}) if kind else "0"
            result.enter(span, "background" if kind else "denied", value=value)
        elif _get_class(span) is None and number not in eventful:
            result.enter(span, "nothing", note=_UNKNOWN_CLASS[span.tag].lower())
        elif _get_class(span) is None:
            raise Refused(
                "out_of_scope",
                f"{_UNKNOWN_CLASS[span.tag]} ({span.words}); use vehicles, cyclists, e-scooters "
                "and pedestrians.",
            )
        elif span.value == "many" and len(span.subjects) == 1 and takes_part(number, reading):
            raise Refused(
                "out_of_scope",
                f"How many '{span.words}' are is not said; say a number, such as two.",
            )
        elif span.value == "many" and len(span.subjects) == 1:
            result.enter(span, "density", value="ordinary traffic")
        else:
            _add_user(result, number, span)


_CLASSES: dict[str, AgentClass] = {
    "veh": "vehicle", "ped": "pedestrian", "cyc": "cyclist", "scoot": "scooter",
}  # fmt: skip


def _get_class(span: ReadSpan) -> AgentClass | None:
    """The class that a mention introduces; None where agents of its kind are not modelled."""
    unknown = {"cyc": _PATTERNS.no_bicycle, "scoot": _PATTERNS.no_scooter}.get(span.tag)
    return None if unknown and unknown.search(span.words) else _CLASSES.get(span.tag)


_ONE_MORE = ("another", "another one", "a second", "a second one")


def _add_user(result: Interpretation, number: int, span: ReadSpan) -> None:
    agent = AgentDraft(type=_get_class(span) or "vehicle", head=span.words)
    agent.subtype = find_subtype(span.words) if span.tag == "veh" else None
    if span.words.lower() in _ONE_MORE and result.draft.agents:
        last = result.draft.agents[-1]  # "a car hits another": another car
        agent.type, agent.subtype = last.type, last.subtype
    result.users[number] = agent
    result.draft.agents.append(agent)
    kind = agent.subtype or agent.type
    if span.value is not None and span.value.startswith(GROUP):
        agent.members, kind = int(span.value.removeprefix(GROUP)), span.value
    note = None
    if span.value == "many":
        note = f"the words leave open how many; {TO_TWENTY[len(span.subjects)]} are made"
    result.enter(span, "agent", (number,), kind, note)
    _read_adjectives(result, number, span)


def _read_adjectives(result: Interpretation, number: int, span: ReadSpan) -> None:
    """What a mention says of the way by itself: "a northbound car", "the oncoming left-turner"."""
    agent = result.users[number]
    if agent.type == "pedestrian":
        if _PATTERNS.jaywalker.search(span.words):
            agent.movement = "jaywalking"
            result.enter(span, "movement", (number,), agent.movement)
        return
    if match := _PATTERNS.bound.search(span.words):
        bound = match[1].lower() if match[1] else _INITIAL[match[2].lower()]
        agent.entry = OPPOSITE[bound]
        result.enter(span, "entry", (number,), agent.entry)
    words = result.text[max(0, span.start - 6) : span.start] + span.words
    turn = "straight" if _PATTERNS.through.search(words) else None
    if match := _PATTERNS.turning.search(words):  # "left-turner", "thru vehicle"
        turn = "right" if (match[1] or match[2]).lower().startswith("r") else "left"
    if turn is not None:
        agent.movement = turn
        result.enter(span, "movement", (number,), turn)
    if _PATTERNS.oncoming.search(span.words):
        agent.relatives.append(("opposite", None))
        result.enter(span, "tie", (number,), "opposite")


def _read_yield(result: Interpretation, span: ReadSpan) -> None:
    """ "Lets nobody go first" is no yield;  "does not move until" is one."""
    turned = (_PATTERNS.until if span.negated else _PATTERNS.to_nobody).search(
        span.words
    ) is not None
    _relate(result, replace(span, negated=span.negated != turned))


def _note(became: Became) -> Rule:
    """The rule for spans that change nothing in the draft."""
    return lambda result, span: result.enter(span, became, span.subjects)


def _keep(held: str) -> Rule:
    """The rule for spans that are read once all that happens is known (`_settle`)."""
    return lambda result, span: getattr(result, held).append(span)


def _unless_denied(rule: Rule) -> Rule:
    """The rule, with denied spans kept until all that happens is known."""
    return lambda result, span: (_keep("denied") if span.negated else rule)(result, span)


def _refer(result: Interpretation, span: ReadSpan) -> None:
    """A later mention; it may say what vehicle the first one left open: "V1 ... the motorbike"."""
    agents = result.list_agents(span.subjects)
    if len(agents) == 1 and agents[0].type == "vehicle" and agents[0].subtype is None:
        agents[0].subtype = find_subtype(span.words)
    result.enter(span, "agent", span.subjects)


def _brake(result: Interpretation, span: ReadSpan) -> None:
    result.braking |= set(span.subjects)
    result.enter(span, "cause", span.subjects, find_marked("cause", "brakes"))


def _refuse_condition(_: Interpretation, span: ReadSpan) -> None:
    raise Refused(
        "out_of_scope", f"'{span.words}' leaves open what happens; say it as it should be."
    )


def _settle_places(result: Interpretation) -> None:
    """Two on foot may meet beside the road, at a corner; scenes have no other places."""
    walking = [e for e in result.draft.relations if e.from_.type == e.to.type == "pedestrian"]
    known: dict[str, str] = {
        pattern.relation: pattern.id
        for pattern in load_patterns()
        if pattern.zone == "sidewalk" and any(e.type == pattern.relation for e in walking)
    }
    for span in result.places:
        if not known or not _PATTERNS.corner.search(span.words):
            raise Refused(
                "out_of_scope",
                f"Scenes take place at one intersection, not at '{span.words}'; move it there.",
            )
        for edge in walking:
            edge.pattern = known.get(edge.type)
            result.enter(span, "relation", result.list_numbers(edge.ends), edge.type)
    result.places = []


def _leave_out(result: Interpretation, span: ReadSpan) -> None:
    if span.tag == "act" and _PATTERNS.sidewalk.search(span.words) and not span.negated:
        raise Refused(
            "impossible",
            f"Vehicles stay on the road here ('{span.words}'); move the vehicle to the road.",
        )
    note = _BEYOND.get(span.tag, "this is not modelled")
    result.enter(span, "nothing", span.subjects, note=note)


def _leave_out_act(result: Interpretation, span: ReadSpan) -> None:
    """What no agent can do, or nothing is there to do it to."""
    _leave_out(result, replace(span, tag="act"))


def _read_overtaking(result: Interpretation) -> None:
    """ "Passes too closely" of a vehicle, then a rider: as a near miss, or marked as no event."""
    agents, relations = result.draft.agents, result.draft.relations
    if [a.type == "vehicle" for a in agents] != [True, False] or not (
        agents[1].rides and agents[1].drives
    ):
        return
    said = " ".join(s.words for s in result.spans if s.tag in ("near", "act"))
    text = said if relations else result.text
    near = [measure_in(s.words) for s in result.numbers if s.tag in ("gap", "dist")]
    within = any(each and each.unit == "m" and each.value < _CLOSE_CLEARANCE for each in near)
    edge = RelationDraft("near_miss", agents[0], agents[1]) if not result.eventful else None
    edge = relations[0] if [relation.type for relation in relations] == ["near_miss"] else edge
    if edge is None or not (
        _PATTERNS.overtakes.search(text) and (within or _PATTERNS.closely.search(text))
    ):
        return
    edge.pattern = "rider_close_overtaking"
    _add_relation(result, edge)
    for n, entry in enumerate(result.entries):
        if entry.became == "nothing" and _PATTERNS.overtakes.search(entry.span.words):
            pair = tuple(result.list_numbers(agents))
            result.entries[n] = AccountEntry(entry.span, "relation", pair, "near_miss")


_CLOSE_CLEARANCE = 1.5
"""Below this a rider is overtaken too closely [m] (docs/relations.md)."""


def get_side(span: ReadSpan) -> str | None:
    """The compass name in the words of a span, else the one that the encoder sees there."""
    names = [(m[1] + (m[2] or "")).lower() for m in _PATTERNS.name.finditer(span.words)]
    if len(names) == 2 and span.tag == "cw":  # from corner to corner: the side that both share
        shared = [side for side in _INITIAL.values() if all(side in name for name in names)]
        names = shared if len(shared) == 1 else names
    if names:
        return names[0]
    if match := _PATTERNS.letter.search(span.words):
        return _INITIAL[match[1].lower()]
    return _INITIAL[span.side.lower()] if span.side else None


_GIVES_WAY = {
    "entry": ("exit",), "exit": ("movement",), "movement": ("exit",),
    "crosswalk": ("entry", "exit"),
}  # fmt: skip
"""What an edit of one field leaves open, since both together need not go."""


def _put(result: Interpretation, agent: AgentDraft, name: str, value: str, words: str) -> None:
    old = getattr(agent, name)
    if result.changing and old != value and name not in agent.edited:
        if name == "entry":
            agent.relatives = []
            if agent.walks and "crosswalk" not in agent.edited:
                agent.crosswalk = None
        for other in _GIVES_WAY[name]:
            if other not in agent.edited:
                setattr(agent, other, None)
        agent.edited.add(name)
    elif old is not None and old != value:
        raise Refused(
            "contradictory",
            f"The {agent.type} would have both {name} {old} and {name} {value} ('{words}'); keep "
            "one of them.",
        )
    setattr(agent, name, value)


def _place(result: Interpretation, span: ReadSpan) -> None:
    """Where agents come from, go to, head, or cross."""
    if span.value in _RELATIVE:
        _place_relatively(result, span)
        return
    side = _get_leg(result, span)
    if side is None:
        return
    for number, agent in result.find_users(span.subjects):
        leg, walks = side, agent.walks
        name: Became = "exit" if span.tag == "to" else "entry"
        if span.tag == "cw" and (walks or agent.rides):
            name = "crosswalk"
            agent.movement = agent.movement or "crossing"
            agent.marked = agent.marked or _PATTERNS.marked.search(span.words) is not None
        elif span.tag == "heading" and (walks or agent.entry not in (None, OPPOSITE[side])):
            name = "exit"
            if walks and agent.entry is None:
                agent.entry = OPPOSITE[side]
        elif span.tag == "heading":
            leg = OPPOSITE[side]
        _put(result, agent, name, leg, span.words)
        result.enter(span, name, (number,), leg)


def _get_leg(result: Interpretation, span: ReadSpan) -> str | None:
    """The leg that a span names by the compass; None where that is left open.

    Names of streets of the map are put as compass names before a text is read.

    Raises:
        Refused: a street that no leg of the map bears.
    """
    street, roads = _is_street_like(span.words), result.draft.site.roads
    if street and roads:
        known = ", ".join(dict.fromkeys(road for _, road in roads))
        raise Refused(
            "impossible", f"No leg here is called '{span.words}'; the streets are {known}."
        )
    side = None if street else get_side(span)
    if side is None:
        result.enter(span, "nothing", span.subjects, note="no leg has this name")
    return side


def _is_street_like(words: str) -> bool:
    """Whether some words are the name of a street: "Elm Road", not "the road"."""
    return (
        _PATTERNS.street.search(words) is not None
        and _PATTERNS.bare_road.match(words.strip()) is None
    )


def _read_road(result: Interpretation, span: ReadSpan) -> None:
    """ "On the main road", "on Elm Road"."""
    if _is_street_like(span.words):
        _get_leg(result, span)
    else:
        result.enter(span, "road", span.subjects)


def _place_relatively(result: Interpretation, span: ReadSpan) -> None:
    word = _RELATIVE[str(span.value)]
    struck = _PATTERNS.struck_side.search(_PATTERNS.hand_side.sub("", span.words))
    if word in ("of_left", "of_right") and struck and result.eventful:
        result.enter(span, "impact_point", span.objects)
        return
    if word == "exit_crosswalk" and _is_own_side(result, span):
        word = "entry_crosswalk"
    others: Sequence[AgentDraft | None] = result.list_agents(span.objects) or (None,)
    for agent in result.list_agents(span.subjects):
        for other in others:
            if agent is not other:
                agent.relatives.append((word, other))
        if (agent.walks or agent.rides) and span.tag == "cw":
            agent.movement = agent.movement or "crossing"
    result.enter(span, "tie", span.users, word)


def _is_own_side(result: Interpretation, span: ReadSpan) -> bool:
    """Whether the words and what follows name the leg by which the other road user comes."""
    following = _PATTERNS.clause.match(result.text, span.end)
    words = span.words + (following[0] if following else "")
    if _PATTERNS.that_leg.search(words):
        before = [
            s.tag
            for s in result.spans
            if s.end <= span.start and s.tag in ("from", "to") and set(s.subjects) & {*span.objects}
        ]
        return before[-1:] == ["from"]
    return _PATTERNS.own_side.search(words) is not None and _PATTERNS.far_side.search(words) is None


def _move(result: Interpretation, span: ReadSpan) -> None:
    name = {"cross": "crossing", "jay": "jaywalking"}.get(span.tag, span.tag)
    if span.tag in ("left", "right"):
        said = {each.lower() for each in re.findall(r"\b(left|right)", span.words, re.IGNORECASE)}
        name = said.pop() if len(said) == 1 else name
    walks = name in ("crossing", "jaywalking")
    for number, agent in result.find_users(span.subjects):
        fits = walks == (agent.type == "pedestrian")
        if agent.rides:  # a rider crosses where a crosswalk is named
            marked = agent.walks or _PATTERNS.marked.search(span.words) is not None
            fits = name == "crossing" and marked if walks else not agent.walks
        if not fits:
            continue
        if not walks:
            _put(result, agent, "movement", name, span.words)
        elif agent.movement != "jaywalking" or result.changing:
            agent.movement = name
            if name == "jaywalking" and result.changing:
                agent.crosswalk = None
        result.enter(span, "movement", (number,), name)


def _run_red(result: Interpretation, span: ReadSpan) -> None:
    for number, agent in result.find_users(span.subjects):
        agent.runs_red = True
        result.enter(span, "runs_red", (number,))


def _read_light(result: Interpretation, span: ReadSpan) -> None:
    """ "Crosses while it is red for her" is a red light run; "waits at the red light" a wait."""
    around = result.text[max(0, span.start - _NEAR_LIGHT) : span.end + _NEAR_LIGHT]
    said = f"{span.words}{result.text[span.end :][: len(' for her')]}"
    if _PATTERNS.stops.search(span.words) and _PATTERNS.is_red.search(span.words):
        agents = result.list_agents(span.subjects)
        result.draft.measures += [MeasureDraft("wait", e, None, *_AT_RED) for e in agents]
    named = [s for s in result.spans if s.names_user and s.subjects]
    after = [s.subjects for s in named if 0 <= s.start - span.end <= len(" for the ")]
    before = [s.subjects for s in named if s.start < span.start]
    owners = [each for each in (span.subjects, *after, *reversed(before)) if each]
    goes_on = (
        _PATTERNS.still_red.search(around)
        and _PATTERNS.is_red.search(said)
        and not _PATTERNS.stops.search(result.text)
    )
    if goes_on and owners:
        _run_red(result, replace(span, tag="red", subjects=owners[0]))
    else:
        result.enter(span, "signals", span.subjects)


_AT_RED = (0.5, 25.0)
"""How long who waits at a red light stands there at least and at most [s]."""
_NEAR_LIGHT = 24
"""Characters before and after words of a light that are searched for "although" and the like."""


def _relate(result: Interpretation, span: ReadSpan) -> None:
    if _PATTERNS.seconds_before.search(result.text[: span.start]):
        result.enter(span, "manner", span.subjects)
        return
    if span.negated:
        result.denied.append(span)
        return
    users = result.users
    if span.tag == "follow" and _PATTERNS.behind.search(span.words) and not result.settling:
        result.behind.append(span)
        return
    pairs = _list_pairs(span, users) or _add_implied(result, span)
    if not pairs and span.tag == "yield" and len(users) == 1 and _PATTERNS.stops.search(span.words):
        result.enter(span, "signals", span.subjects)  # alone it stops for a light
        return
    if not pairs:
        raise Refused(
            "out_of_scope",
            f"The text says '{span.words}', but not between which agents; say which road user "
            "collides with, nearly hits, gives way to or follows which other.",
        )
    for first, second in pairs:
        pair = {users[first], users[second]}
        near = any(e.type == "near_miss" and e.pair == pair for e in result.draft.relations)
        if near and _PATTERNS.head_on.fullmatch(span.words):  # it says how the two nearly collide
            users[second].relatives.append(("opposite", users[first]))
            result.enter(span, "relation", (first, second), "near_miss")
            continue
        edge = RelationDraft(RELATIONS[span.tag], users[first], users[second])
        # "Lets a pedestrian cross" says what the pedestrian does.
        lets_cross = span.tag == "yield" and _PATTERNS.crosses.search(span.words)
        if lets_cross and (users[second].type, users[second].movement) == ("pedestrian", None):
            users[second].movement = "crossing"
        turn = _PATTERNS.turn_crash.search(result.text[: span.start])
        edge.kind = find_marked("collision", span.value or "")
        if span.tag == "hit" and turn is not None and edge.kind is None:
            edge.kind = "left_turn" if turn[1].lower() == "left" else "right_turn"
        edge.first = users[first] if span.value == "cutoff" else None
        if span.tag == "hit" and _PATTERNS.too_late.search(span.words):
            result.braking.add(first)
        _add_relation(result, edge)
        result.enter(span, "relation", (first, second), edge.type)
        if edge.first is not None:
            result.enter(span, "order", (first, second))


def _list_pairs(span: ReadSpan, users: Mapping[int, AgentDraft]) -> list[tuple[int, int]]:
    """Every one with every other, but in turn where "a car with a woman and a van with a man".

    Several followers of one leader drive one behind the other: "seven cars follow a bus".
    """
    if _PATTERNS.one_of_them.search(span.words):
        span = replace(span, objects=span.objects[:1])
    pairs = list(zip(sorted(span.subjects), sorted(span.objects), strict=False))
    flat = [number for pair in pairs for number in pair]
    if len(span.subjects) != len(span.objects) or flat != sorted({*flat}):
        pairs = list(product(span.subjects, span.objects))
    pairs = [(a, b) for a, b in pairs if {a, b} <= users.keys() and a != b]
    followers, leaders = [a for a, _ in pairs], {b for _, b in pairs}
    if span.tag != "follow" or len(leaders) != 1:
        return pairs
    return list(zip(followers, [*leaders, *followers[:-1]], strict=True))


def _move_so(result: Interpretation, span: ReadSpan) -> None:
    """How pedestrians cross, and how vehicles pass a light."""
    motion = find_marked("motion", span.value or "")
    on_foot = motion in list_names("motion", of="pedestrian")
    for number in span.subjects:
        agent = result.users.get(number)
        if agent is None or on_foot != agent.walks:
            result.enter(span, "nothing", (number,), note=_BEYOND["act"])
        elif motion not in list_names("motion", of=agent.type):
            result.enter(span, "nothing", (number,), note="only vehicles can be asked to do that")
        elif span.negated:  # "does not run": the pedestrian walks
            agent.motion = None if agent.motion == motion else agent.motion
            result.enter(span, "manner", (number,))
        else:
            agent.motion = motion
            result.enter(span, "motion", (number,), motion)


def _react(result: Interpretation, span: ReadSpan) -> None:
    """How a threatened agent reacts, as far as agents of its class can be asked to."""
    if _PATTERNS.too_late.search(span.words) and result.eventful:
        _brake(result, span)
        return
    agents = result.list_agents(span.subjects[:1])
    mark = "jump" if span.value == "back" and _PATTERNS.jumps.search(span.words) else span.value
    known = find_marked("reaction", mark or "", of=agents[0].type) if agents else None
    threat = any(
        (each.tag in ("hit", "near") or (each.tag, each.value) == ("lane", "cutin"))
        and not each.negated
        for each in result.spans
    )
    if not threat and known in list_names("reaction", trait="reacts") and len(result.users) == 2:
        result.dodging = threat = not result.eventful
    if span.negated or known is None or not threat:
        _leave_out_act(result, span)
    else:
        _react_so(result, replace(span, value=mark, subjects=span.subjects[:1]))


def _react_so(result: Interpretation, span: ReadSpan) -> None:
    """How the agent reacts to the threat, or that it does not; as far as its class can."""
    for number, agent in result.find_users(span.subjects):
        known = find_marked("reaction", span.value or "", of=agent.type)
        if known is None:
            _leave_out_act(result, replace(span, subjects=(number,)))
        else:
            agent.reaction = known
            result.enter(span, "reaction", (number,), known)


def _add_implied(result: Interpretation, span: ReadSpan) -> list[tuple[int, int]]:
    """The pair of an event of which the text names but one party, or none: "pedestrian strike".

    The other one is a vehicle. Nothing is implied of a vehicle alone, but that it is hit from
    behind.
    """
    known = [number for number in span.users if number in result.users]
    behind = (span.tag, span.value) == ("hit", "rear") and not span.subjects
    if behind and [result.users[n].type for n in known] == ["vehicle"]:
        return [(_add_implied_vehicle(result), known[0])]
    if span.tag in ("hit", "near") and not result.users:
        return [(_add_implied_vehicle(result), _add_implied_vehicle(result))]
    on_foot = all(result.users[number].type == "pedestrian" for number in known)
    if span.tag in ("hit", "near") and known and on_foot:
        striker = _add_implied_vehicle(result)
        return [(striker, number) for number in known]
    return []


def _add_implied_vehicle(result: Interpretation) -> int:
    number = max(result.users, default=0) + 1
    agent = AgentDraft(type="vehicle")
    result.users[number] = agent
    result.draft.agents.append(agent)
    return number


def _add_relation(result: Interpretation, edge: RelationDraft) -> None:
    """One more relation; in a change it takes the place of what the two did before."""
    relations = result.draft.relations
    if result.changing:
        relations[:] = [relation for relation in relations if relation.pair != edge.pair]
    same = [
        relation
        for relation in relations
        if relation.type == edge.type and relation.pair == edge.pair
    ]
    if same:
        same[0].kind = same[0].kind or edge.kind
        same[0].first = same[0].first or edge.first
        same[0].pattern = same[0].pattern or edge.pattern
    else:
        relations.append(edge)


def _edit(result: Interpretation, span: ReadSpan) -> None:
    """Remove agents, swap roles, or change what an agent is."""
    draft, agents = result.draft, result.list_agents(span.users)
    if span.tag == "drop":
        draft.agents[:] = [each for each in draft.agents if each not in agents]
        draft.relations[:] = [edge for edge in draft.relations if edge.pair.isdisjoint(agents)]
        result.users = {n: each for n, each in result.users.items() if each not in agents}
    elif span.tag == "swap":
        for edge in draft.relations:
            if not agents or edge.pair <= set(agents):
                edge.from_, edge.to = edge.to, edge.from_
                if edge.first is not None:
                    edge.first = edge.get_other(edge.first)
                if edge.strikes is not None:
                    edge.strikes = edge.get_other(edge.strikes)
    else:
        kind = find_class(span.words)
        for agent in result.list_agents(span.subjects):
            person = kind == "pedestrian" and not _PATTERNS.on_foot.search(span.words)
            if kind not in (None, agent.type) and not (person and agent.rides):  # "a girl" rides
                agent.type, agent.movement, agent.crosswalk = kind, None, None
            agent.subtype = find_subtype(span.words) if agent.type == "vehicle" else None
            agent.head = span.words
    result.enter(span, "agent", span.subjects, span.tag)


_STEPS: dict[str, dict[str | None, str]] = {
    "up": {None: "high", "low": "medium", "medium": "high", "high": "high"},
    "down": {None: "low", "low": "low", "medium": "low", "high": "medium"},
}


def _set_normal(result: Interpretation, span: ReadSpan) -> None:
    result.draft.normal = not span.negated
    if result.changing and not span.negated:
        result.draft.relations.clear()
    result.enter(span, "normal")


def _set_background(result: Interpretation, span: ReadSpan) -> None:
    """Numbers of background agents; those per leg, of riders or without a figure become nothing."""
    none = span.negated or _PATTERNS.not_one.search(span.words) is not None
    number, after = 0 if none else number_in(span.words), result.text[span.end :]
    if number is None and _PATTERNS.nobody.search(span.words):
        number = 0
    if number is not None and number > MOST_BACKGROUND:
        raise Refused(
            "out_of_scope",
            f"'{span.words}' are more than the {MOST_BACKGROUND} that a scene can hold.",
        )
    if number == 0 and _PATTERNS.none_at_all.search(span.words):
        result.absent.append(span)
    if _PATTERNS.aboard.search(f"{span.words}{after}"):
        result.enter(span, "nothing", note="nobody inside a vehicle is shown")
        return
    uncounted = number is None and _PATTERNS.many.search(span.words) is not None
    if (
        uncounted
        or _PATTERNS.per_leg.match(after)
        or (number and _PATTERNS.riders.search(span.words))
    ):
        result.enter(span, "nothing", note="say how many vehicles or pedestrians in all")
        return
    if number and span.tag == "bgveh" and _PATTERNS.in_all.match(after):
        named = sum(agent.type == "vehicle" for agent in result.draft.agents)
        number = max(number - named, 0)
    context = result.draft.context
    if span.tag != "bgped" and number is not None:
        context.vehicles = number
    if span.tag != "bgveh" and number is not None:
        context.pedestrians = number
    kinds = {"bgveh": ("vehicles",), "bgped": ("pedestrians",)}.get(span.tag, _OF_BOTH)
    value = None if number is None else format_background(dict.fromkeys(kinds, number))
    result.enter(span, "background", value=value)


_OF_BOTH = ("vehicles", "pedestrians")


def _set_density(result: Interpretation, span: ReadSpan) -> None:
    context = result.draft.context
    value = str(span.value)
    if value == "medium" and not result.eventful and _PATTERNS.ordinary.search(span.words):
        result.draft.normal = True
        result.enter(span, "normal")
        return
    if span.negated:
        value = {"low": "high", "high": "low"}.get(value, value)
    steps = _STEPS.get(value)
    value = value if steps is None else steps[context.density]
    if not result.changing and {context.density, value} == {"low", "high"}:
        raise Refused("contradictory", "The traffic cannot be both busy and quiet; keep one.")
    context.density = value
    result.enter(span, "density", value=value)
    if not result.times and time_words_in(clean(span.words)):
        _set_time(result, span)


def _set_time(result: Interpretation, span: ReadSpan) -> None:
    """The time that all the words for it agree on."""
    if span.negated:
        raise Refused("out_of_scope", f"'{span.words}' says which time it is not; say which it is.")
    if result.changing and not result.retimed:
        result.times, result.retimed = [], True
    if is_pronoun(result.text, span.start):
        begins = span.start + len("one ")
        span = replace(span, start=begins, words=result.text[begins : span.end])
    low = clean(" , ".join(each.words for each in (*result.times, span)))
    names, clock = time_words_in(low), read_clock(low)
    if clock is None:
        figures = _PATTERNS.figures.search(low)
        clock = read_clock(f"at {figures[0] if figures else low}")
    if "rush hour" in names and {"morning", "evening", "afternoon"} & {*names}:
        names = ["morning rush" if "morning" in names else "evening rush"]
    elif len(names) > 1:
        names = [name for name in names if name != "rush hour"]
    time = _find_agreed_time(names, clock) if names or clock else None
    if time is None:  # a date, a weekday
        result.enter(span, "nothing", note="no time of day that is known")
        return
    result.times.append(span)
    result.draft.context.time_of_day = time
    result.enter(span, "time_of_day", value=time)


def _ask_half_of_day(result: Interpretation) -> None:
    """Refuses "half past three": people say it of the afternoon, a clock shows 03:30 by it."""
    time, said = result.draft.context.time_of_day, [each.words for each in result.times]
    low = clean(" , ".join(said))
    if time is None or not "01:00" <= time < "06:00" or not _PATTERNS.spoken.search(low):
        return
    if not time_words_in(low) and not re.search(r"\b[ap]m\b", low):
        later, words = _shift_half_a_day(time), said[-1]
        raise Refused(
            "out_of_scope",
            f"'{words}' may be {time} or {later}; say '{words} in the morning' or "
            f"'{words} in the afternoon'.",
        )


def _find_agreed_time(names: list[str], clock: str | None) -> str | None:
    """The clock time in the half of the day that the words name: "half past six, evening"."""
    if clock is not None and clock < "06:00" and {"morning", "night"} & set(names):
        return clock
    try:
        return read_time_words(names, clock=clock)
    except Refused:
        if clock is None:
            raise
    return read_time_words(names, clock=_shift_half_a_day(clock))


def _shift_half_a_day(clock: str) -> str:
    """The same clock times in the other half of the day: "03:30-06:00" becomes "15:30-18:00"."""
    return re.sub(r"\b(\d\d):", lambda m: f"{(int(m[1]) + 12) % 24:02d}:", clock)


_SEVERITY = {"pet": "pet", "ttc": "ttc", "contact_speed": "speed"}
"""Fields of the draft's context by kind of measure."""

_TOLD = {"pet": "pet {:.4g} s", "ttc": "ttc {:.4g} s", "contact_speed": "impact_speed {:.4g} m/s"}


def _read_numbers(result: Interpretation) -> None:
    """Figures, once all that happens is known, and then words of pace."""
    for span in (*result.numbers, *filter(says_pace, result.spans)):
        asked = read_number(span, result.text, result.draft, result.users, result.spans)
        bare = measure_in(span.words) is None
        if asked is None and bare and (span.tag in _SEVERE or _has_figure(result, span)):
            result.enter(span, "manner", span.subjects)
        elif asked is None and span.tag == "point":
            result.enter(span, "impact_point", span.subjects)
        elif asked is None:  # words that give no figure a scene can have
            note = _BEYOND.get(span.tag, "not modelled")
            result.enter(span, "nothing", span.subjects, note=note)
        elif asked.severity is not None:
            kind, value = asked.severity
            setattr(result.draft.context, _SEVERITY[kind], value)
            result.enter(span, "measure", value=_TOLD[kind].format(value))
        else:
            drafts, new = result.draft.measures, asked.measures
            if result.changing:  # they take the place of earlier ones of their kind
                drafts[:] = [e for e in drafts if not any(_is_of_same(e, each) for each in new)]
            drafts += new
            result.entries.append(AccountEntry(span, "measure", span.subjects, measures=new))
    result.numbers = []


def _is_of_same(first: MeasureDraft, second: MeasureDraft) -> bool:
    """Whether two figures are of the same agents and kind; all speeds of an agent are of one."""
    kinds = {each.kind.removeprefix("line_") for each in (first, second)}
    return len(kinds) == 1 and (first.agent, first.other) == (second.agent, second.other)


_SEVERE = ("impact", "pet", "ttc", "gap")


def _has_figure(result: Interpretation, span: ReadSpan) -> bool:
    """Whether other words give the figure that these announce: "approaching", "at 10 m/s"."""
    return any(
        other is not span
        and other.tag in (span.tag, *(("impact",) if span.tag == "speed" else ()))
        and measure_in(other.words) is not None
        and (set(other.subjects) >= set(span.subjects) or other.tag == "impact")
        for other in result.numbers
    )


def _settle(result: Interpretation) -> None:
    """Braking becomes a cause, and what is denied is held against what is said."""
    result.settling = True
    _read_behind(result)
    result.settling = False
    read_lanes(result, _BEYOND["act"])
    _read_order(result)
    draft = result.draft
    if _is_measured(result):
        _imply_near_miss(draft)
    _read_overtaking(result)
    _read_numbers(result)
    _ask_half_of_day(result)
    _settle_places(result)
    if result.braking or result.dodging:
        _imply_near_miss(draft)
    settle_lead_braking(result)
    settle_lanes(result)
    for agent in map(result.users.get, result.braking):
        for edge in draft.relations:
            dangerous = edge.type in ("near_miss", "collide_at") and edge.manoeuvre is None
            drives = agent is not None and agent.type == "vehicle"  # riders brake softly
            if drives and dangerous and agent in edge.ends:
                edge.cause, edge.braker = find_marked("cause", "brakes"), agent
    for span in result.absent if not result.changing else ():
        denied = {"veh": "vehicle", "ped": "pedestrian"}.get(span.tag.removeprefix("bg"))
        if any(a.type == denied for a in draft.agents) or (span.tag == "bgall" and draft.agents):
            raise Refused(
                "contradictory",
                f"'{span.words}' says that there is none, and the text describes one; drop one of "
                "the two.",
            )
    for span in result.denied:
        if span.tag in RELATIONS:
            _deny_event(result, span)
        else:
            _deny_way(result, span)
    result.denied = []


def _imply_near_miss(draft: Draft) -> None:
    """Add a near miss of two agents without a named event, where other words ask for one."""
    if not draft.relations and len(draft.agents) == 2:
        first, second = draft.agents
        draft.relations.append(RelationDraft("near_miss", first, second))


def _read_order(result: Interpretation) -> None:
    """The agent that goes first does so in the pair's event; without one, the other yields to
    it."""
    for span in result.first:
        ahead, behind = span.subjects, span.objects
        if span.negated:
            ahead, behind = behind, ahead
        pairs = [(a, b) for a in ahead for b in behind if {a, b} <= result.users.keys() and a != b]
        for first, second in pairs:
            _put_first(result, span, first, second)
        if not pairs:
            result.enter(span, "nothing", span.subjects, note=_BEYOND["first"])
    result.first = []


def _read_behind(result: Interpretation) -> None:
    """ "Passes behind" is a follow of two in one lane; of two that cross it says which one comes
    first."""
    for span in result.behind:
        both = [*result.list_agents(span.subjects)[:1], *result.list_agents(span.objects)[:1]]
        entries = {agent.entry for agent in both} - {None}
        classes = {agent.type for agent in both}
        if len(both) == 2 and (len(entries) == 2 or len(classes) == 2):
            result.first.append(replace(span, subjects=span.objects, objects=span.subjects))
        else:
            _relate(result, span)
    result.behind = []


def _put_first(result: Interpretation, span: ReadSpan, first: int, second: int) -> None:
    """The order of two road users in the account, and in the event that they have.

    Raises:
        Refused: the event has the other order, or two orders are said.
    """
    ahead, behind = result.users[first], result.users[second]
    edges = [edge for edge in result.draft.relations if edge.pair == {ahead, behind}]
    if not edges:
        close = any(each.tag == "hit" for each in result.denied) or second in result.braking
        kind: RelationType = "near_miss" if close or _is_measured(result) else "yield_to"
        edges = [RelationDraft(kind, behind, ahead)]
        result.draft.relations += edges
    for edge in edges:
        if result.changing and edge.ahead is behind:
            edge.from_, edge.to = behind, ahead
        if result.changing:
            edge.first = None
        if (edge.ahead or edge.first or ahead) is not ahead:
            if not has_order_words(span.words):
                result.enter(span, "manner", (first, second))
                return
            does = {"yield_to": "gives way", "follow": "follows"}.get(edge.type, "runs into it")
            raise Refused(
                "contradictory",
                f"The text has either of the two pass first ('{span.words}'); keep one of the two."
                if edge.ahead is None
                else f"The agent that {does} comes second, so '{span.words}' contradicts it; keep "
                "one of the two, or say that the two nearly collide.",
            )
    (edge, *_) = edges
    if edge.ahead is not None:
        result.enter(span, "relation", (second, first), edge.type)
    else:
        edge.first = ahead
        result.enter(span, "order", (first, second))


_CLOSE_PET = 1.5
"""At most this is a near miss [s] (SEMANTICS 4)."""


def _is_measured(result: Interpretation) -> bool:
    """Whether a TTC, or a PET of a near miss, is asked for."""
    for span in result.numbers:
        figure = measure_in(span.words)
        if span.tag == "ttc" or (span.tag == "pet" and figure and figure.value <= _CLOSE_PET):
            return not span.negated
    return False


def _deny_event(result: Interpretation, span: ReadSpan) -> None:
    """A denied event contradicts the same event; a yield that fails, alone, is a near miss."""
    draft, kind = result.draft, RELATIONS[span.tag]
    involved = result.list_agents(span.users)
    both = [result.list_agents(each) for each in (span.subjects, span.objects)]
    same = [  # "A did not hit B, B hit A" denies another one
        edge
        for edge in draft.relations
        if edge.type == kind
        and (
            edge.from_ in both[0] and edge.to in both[1]
            if all(both)
            else edge.pair.issuperset(involved)
        )
    ]
    result.enter(span, "denied", span.users, kind)
    if result.changing:
        draft.relations[:] = [edge for edge in draft.relations if edge not in same]
    elif any(span.tag != "yield" or edge.from_ is involved[0] for edge in same if involved) or (
        same and not involved
    ):
        raise Refused(
            "contradictory", "The text both asks for an event and denies it; keep one of the two."
        )
    if span.tag == "yield" and len(involved) >= 2 and not result.changing:
        first, *others = involved
        if not any(edge.pair == {first, other} for edge in draft.relations for other in others):
            draft.relations += [RelationDraft("near_miss", first, other) for other in others]
    draft.denied.add(kind)


def _deny_way(result: Interpretation, span: ReadSpan) -> None:
    """ "Not from the north": harmless beside where it does come from, else it leaves that open."""
    names = {"from": "entry", "heading": "entry", "to": "exit", "cw": "crosswalk"}
    name = names.get(span.tag, "movement")
    agents = result.list_agents(span.subjects)
    if span.tag == "red":
        for agent in agents:
            agent.runs_red = False
        result.enter(span, "signals", span.subjects)
    elif span.tag in ("cw", "cross") and agents and span.tag not in SIDES[:3]:
        known = all(a.movement == "jaywalking" or a.crosswalk is not None for a in agents)
        if not known:
            for agent in agents:
                agent.movement = "jaywalking"
        result.enter(span, "movement", span.subjects)
    elif agents and all(getattr(agent, name) is not None for agent in agents):
        result.enter(span, "retracted", span.subjects)
    else:
        raise Refused(
            "out_of_scope", f"'{span.words}' says what is not so; say which way it goes instead."
        )


_RULES: dict[str, Rule] = {
    **dict.fromkeys(SIDES, _unless_denied(_place)),
    **dict.fromkeys(("left", "right", "straight", "uturn", "cross", "jay"), _unless_denied(_move)),
    **dict.fromkeys(EVENTS, _relate),
    "yield": _read_yield,
    "density": _set_density,
    "normal": _set_normal,
    **dict.fromkeys(("bgveh", "bgped", "bgall"), _set_background),
    **dict.fromkeys(("impact", "pet", "ttc", *NUMBERS), _keep("numbers")),
    **dict.fromkeys(("drop", "swap", "becomes"), _edit),
    **dict.fromkeys(("manner", "pace", "turn"), _note("manner")),
    "time": _set_time,
    "first": _keep("first"),
    "motion": _move_so,
    "reaction": _react_so,
    "react": _react,
    # An agent that is hit from behind is pushed on into another one.
    "push": lambda result, span: _relate(result, replace(span, tag="hit", value="rear")),
    "lane": _keep("lanes"),
    **dict.fromkeys(("meet", "door"), _leave_out_act),
    "red": _unless_denied(_run_red),
    "brake": _brake,
    "cond": _refuse_condition,
    "place": _keep("places"),
    "ref": _refer,
    "del": _note("retracted"),
    "light": _read_light,
    "road": _read_road,
}
"""What is done with a span, by its tag; all others are left out, and said to be."""
