"""What a turn of a conversation means: words, and the scene as it is -> a reading of them.

Dials, removals and numbers are read here; everything else by the planner's own reader (`redraft`).
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import islice

from scenewright.backends.builtin.asked_figures import read_figure
from scenewright.backends.builtin.dials import build_motion_edit, number
from scenewright.backends.builtin.draft import Refused, Site
from scenewright.backends.builtin.named import Named, find_named, find_ways
from scenewright.backends.builtin.normalise import clean
from scenewright.backends.builtin.reader.measures import measure_in
from scenewright.backends.builtin.reader.words import WORDS, Patterns, find_subtype
from scenewright.backends.builtin.redraft import read_change
from scenewright.backends.builtin.references import People, Unclear
from scenewright.backends.builtin.spelling import mend_spelling
from scenewright.backends.builtin.street_names import ask_which_leg, list_compass_texts
from scenewright.errors import Rejected
from scenewright.scene.base import RIDERS
from scenewright.scene.edits import (
    AddAgent,
    AgentView,
    ChangeAgent,
    DeclinedTurn,
    Edit,
    Edits,
    NewScene,
    Reading,
    Redraw,
    Relate,
    RemoveAgent,
    RemoveObject,
    SetBackground,
    Situation,
    Unrelate,
    apply_edits,
)
from scenewright.scene.social import MOST_BACKGROUND, ObjectNode, RelationEdge, RelationType
from scenewright.scene.track import VEHICLE_SIZES

_PATTERNS = Patterns("revising")

_EVENT_WORDS: dict[RelationType, str] = WORDS["revising"]["event_words"]
"""What happens between two, as said by nouns and verbs."""

_WAITS: str = WORDS["revising"]["waits"]
"""Verbs of one that yields, which also say other things."""

_HAPPENS = re.compile(rf"\b(?:{'|'.join(_EVENT_WORDS.values())}|{_WAITS})\b")


def read(
    words: str,
    situation: Situation | None,
    *,
    chosen: Mapping[str, str] | None = None,
    site: Site | None = None,
) -> Reading:
    """What the words mean where the scene is as it is.

    Args:
        situation: None where there is no scene yet.
        chosen: answers given to questions about these words: phrase -> agent id or leg.
        site: where it happens; None: four legs in right-hand traffic.
    """
    words = mend_spelling(words).text
    plain = " ".join(words.lower().split())
    if situation is None or _PATTERNS.fresh.search(plain):
        return NewScene()
    site = site or Site()
    try:
        worded = list_compass_texts(words, site.roads, chosen)
        plain_site = replace(site, roads=())
        made = [read(each.text, situation, chosen=chosen, site=plain_site) for each in worded]
        edits = [each for each in made if isinstance(each, Edits)]
        if any(edit != edits[0] for edit in edits):
            return ask_which_leg(words, worded[0].left_open[0])
        found = edits or made
        return found[0] if found else _build_edits(words, situation, chosen or {}, site)
    except Unclear as unclear:
        return unclear.ask
    except Refused as refused:
        return DeclinedTurn.model_validate({"code": refused.code, "reason": refused.reason})
    except Rejected as rejected:
        return DeclinedTurn(code="contradictory", reason=rejected.rejection.detail)


def begins_anew(words: str) -> bool:
    """Whether the words say that a new scene begins."""
    return _PATTERNS.fresh.search(" ".join(words.lower().split())) is not None


def _build_edits(
    words: str, situation: Situation, chosen: Mapping[str, str], site: Site
) -> Reading:
    again = _PATTERNS.another.match(" ".join(words.lower().split()))
    if again is not None:
        return Edits(edits=(_redraw(again, situation, chosen),))
    if standing := _find_removed(words, situation):
        return Edits(edits=standing)
    if not _is_edit(words) and not _is_about_scene(words, situation, chosen):
        return NewScene()
    found: list[Edit] = []
    for part in _PATTERNS.parts.split(words.strip()):
        if part.strip():
            made = _read_part(part, situation, chosen, site)
            found += made
            graph = apply_edits(situation.graph, made)
            situation = situation.model_copy(update={"graph": graph})
    if not found:
        return DeclinedTurn(
            code="no_change",
            reason="That changes nothing in the scene; say what shall be different.",
        )
    return Edits(edits=tuple(found))


def _is_edit(text: str) -> bool:
    """True if the text changes an earlier turn rather than describing a scene of its own."""
    plain = clean(text)
    every = [each for each in find_named(plain) if each.type not in (None, "none")]
    introduced = [each for each in every if each.det in ("indefinite", "another")]
    counted = [each for each in every if each.count not in (None, 1) and each.det != "both"]
    changes = _PATTERNS.cue.search(plain) is not None
    if _HAPPENS.search(plain) and (len(introduced) >= 2 or (counted and not changes)):
        return False  # it brings its own parties and event
    return changes or len(every) + ("traffic" in plain) < 2


def _is_about_scene(words: str, situation: Situation, chosen: Mapping[str, str]) -> bool:
    """Whether the words, though they describe an event, name agents of the scene."""
    people = People(situation, chosen)
    try:
        return any(
            people.find_agent(each) is not None
            for each in find_named(clean(words))
            if each.det == "definite"
        )
    except Unclear:
        return True
    except Refused:
        return False


def _redraw(found: re.Match[str], situation: Situation, chosen: Mapping[str, str]) -> Redraw:
    name = found.group("who")
    if not name:
        return Redraw()
    people = People(situation, chosen)
    agent = _find_subject(find_named(clean(name)), people) or people.find_by_id(name)
    if agent is None:
        raise Refused("impossible", f"I do not see which agent {name!r} means.")
    return Redraw(agent=agent.id)


def _read_part(
    text: str, situation: Situation, chosen: Mapping[str, str], site: Site
) -> tuple[Edit, ...]:
    """The edits that one clause asks for."""
    people = People(situation, chosen)
    text = _PATTERNS.ordinary.sub("", _PATTERNS.scooter.sub("e-scooter", _spell_out(text, people)))
    plain = clean(text)
    every = find_named(plain)
    for each in every:
        if each.type == "none":
            raise Refused("impossible", f"There is no {each.head} in this scene, and none can be.")
    event = _HAPPENS.search(plain) is not None
    related = None
    if event and not every and not _has_figures(plain) and people.find_by_id(text) is None:
        related = _choose_events(plain, situation, people)
    if related is not None:
        return related
    made = _read_removal(text, plain, every, situation, people)
    made = made or (None if event else _read_count_change(plain, every, situation))
    if not made and (figure := read_figure(text, situation, people, _find_subject(every, people))):
        made = (figure,)  # a speed at which to drive is a dial
    made = made or _read_motion(text, every, people)
    made = made or (None if event else _read_kind(plain, every, situation, people))
    return made or read_change(text, every, situation, people, site=site)


def _has_figures(plain: str) -> bool:
    """Whether the words say how severe it shall be: those are for the reader."""
    measure = measure_in(plain)
    return measure is not None and (measure.unit == "m/s" or bool(_PATTERNS.severity.search(plain)))


def _choose_events(plain: str, situation: Situation, people: People) -> tuple[Relate, ...] | None:
    """The relations as they shall be, where there are several.

    An agent of several equal relations changes all of them, but can hit only one other agent.

    Raises:
        Unclear: the answer is the agent that acts.
    """
    edges = situation.graph.relations
    if len(edges) < 2:
        return None
    said = (type_ for type_, verbs in _EVENT_WORDS.items() if re.search(rf"\b(?:{verbs})\b", plain))
    type_: RelationType = next(said, "yield_to")
    acting = {edge.from_ for edge in edges}
    actor = people.pick([p for p in people.list_foreground() if p.id in acting], "event, that of")
    meant = [edge for edge in edges if edge.from_ == actor.id]
    meant = [each for each in meant if each.type == meant[0].type]
    return tuple(
        Relate(edge=RelationEdge.model_validate({"type": type_, "from": each.from_, "to": each.to}))
        for each in (meant[:1] if type_ == "collide_at" else meant)
    )


def _spell_out(text: str, people: People) -> str:
    """ "have it turn left" with the vehicle instead of the pronoun."""
    walkers = [each for each in people.list_foreground() if each.type == "pedestrian"]
    if len(walkers) == 1:
        text = _PATTERNS.person.sub(walkers[0].id, text)
    found = _PATTERNS.pronoun.search(text.lower())
    if found is None:
        return text
    kind = "vehicle" if found["it"] == "it" else "pedestrian"
    if _PATTERNS.holds.match(text[found.end() :].lower()):
        held = [e for e in people.list_foreground() if e.stops or e.slows_to is not None]
        if len(held) == 1 and held[0].type == kind:
            return f"{text[: found.start('it')]}{held[0].id}{text[found.end('it') :]}"
    if not any(each.type == kind for each in people.list_foreground()):
        return text
    return f"{text[: found.start('it')]}the {kind}{text[found.end('it') :]}"


def _find_subject(every: Sequence[Named], people: People) -> AgentView | None:
    """The first agent that is named."""
    found = map(people.find_agent, every)
    return next((each for each in found if each is not None), None)


def _read_motion(text: str, every: Sequence[Named], people: People) -> tuple[Edit, ...] | None:
    lowered = " ".join(text.lower().split())
    if re.search(r"\b(?:pet|ttc|impact|collid|hits?)\b", lowered):
        return None
    agent = people.find_by_id(text) or _find_subject(every, people)
    edit = build_motion_edit(lowered, people, agent)
    return None if edit is None else (edit,)


def _read_removal(
    text: str, plain: str, every: Sequence[Named], situation: Situation, people: People
) -> tuple[Edit, ...] | None:
    """ "remove the truck", "drop the collision", "remove all pedestrians"."""
    if not _PATTERNS.removes.search(plain) or any(each.det == "indefinite" for each in every):
        return None
    agent = people.find_by_id(text) or _find_subject(every, people)
    if agent is not None:
        return (RemoveAgent(agent=agent.id),)
    for type_, pattern in _EVENT_WORDS.items():
        edges = [relation for relation in situation.graph.relations if relation.type == type_]
        if edges and re.search(rf"\b(?:{pattern})\b", plain):
            return tuple(Unrelate(first=edge.from_, second=edge.to) for edge in edges)
    groups = [each for each in every if each.type is not None]
    if not groups and re.search(r"\b(?:background|everybody|everyone|others?)\b", plain):
        return (SetBackground(vehicles=0, pedestrians=0),)
    if not groups:
        return None
    rare = {_get_kind(group) for group in groups} & _BY_NAME
    if rare and len(groups) == 1 and groups[0].count is None:
        return _remove_kind(groups[0], situation)
    counts = situation.count_background()
    for group in groups:
        kind = str(group.type)
        counts[kind] = max(counts[kind] - group.count, 0) if group.count else 0
    return (_build_background_edit(counts, [str(group.type) for group in groups]),)


def _remove_kind(group: Named, situation: Situation) -> tuple[Edit, ...]:
    """ "remove the buses": all of that kind in the background, and no other agent."""
    kind = _get_kind(group)
    gone = [agent.id for agent in situation.background if kind in (agent.subtype, agent.type)]
    if not gone:
        raise Refused("impossible", f"There is no {kind} among the others in this scene.")
    return tuple(RemoveAgent(agent=each) for each in gone[:32])


def _read_count_change(
    plain: str, every: Sequence[Named], situation: Situation
) -> tuple[Edit, ...] | None:
    """ "add three cars", "two more pedestrians", "fewer cars"; kinds of vehicles by name."""
    more, fewer = (
        _PATTERNS.adds.search(plain) is not None,
        _PATTERNS.fewer.search(plain) is not None,
    )
    groups = [each for each in every if each.type is not None]
    if not groups or not (more or fewer) or find_ways(plain):
        return None
    if any(each.det == "definite" for each in groups if each.count is None):
        return None
    if more and any(_get_kind(each) in _BY_NAME for each in groups):
        return _read_kinds(groups, situation)
    if any(each.type in RIDERS for each in groups):
        return None
    counts = situation.count_background()
    for group in groups:
        vague = re.search(r"\b(a couple of|a few|some|several)\b", plain)
        several = 3 if vague is None else int(number(vague[1]))
        many = group.count or (several if group.plural else 1)
        counts[str(group.type)] += -many if fewer else many
    kinds = [str(each.type) for each in groups]
    for kind in kinds:
        if counts[kind] > MOST_BACKGROUND:
            raise Refused(
                "impossible",
                f"{counts[kind]} others of one class are too many; at most {MOST_BACKGROUND}.",
            )
        counts[kind] = max(counts[kind], 0)
    return (_build_background_edit(counts, kinds),)


def _read_kinds(groups: Sequence[Named], situation: Situation) -> tuple[Edit, ...]:
    """Trucks, buses and riders take part by name: a crowd has the kinds it was drawn with."""
    free = {group.type: situation.generate_ids(str(group.type)) for group in groups}
    return tuple(
        AddAgent.model_validate(
            {"node": {"id": name, "type": group.type, "subtype": group.subtype}}
        )
        for group in groups
        for name in islice(free[group.type], group.count or 1)
    )


_BY_NAME = {*VEHICLE_SIZES, *RIDERS} - {"car"}
"""Kinds that a crowd is not asked for by."""


def _get_kind(named: Named) -> str | None:
    if named.type in RIDERS:
        return named.type
    return named.subtype


def _build_background_edit(counts: Mapping[str, int], kinds: Sequence[str]) -> SetBackground:
    return SetBackground(
        vehicles=counts["vehicle"] if "vehicle" in kinds else None,
        pedestrians=counts["pedestrian"] if "pedestrian" in kinds else None,
    )


def _read_kind(
    plain: str, every: Sequence[Named], situation: Situation, people: People
) -> tuple[Edit, ...] | None:
    """ "make the car a truck", "replace the bus with a motorcycle"."""
    if not _PATTERNS.becomes.search(plain) or not every:
        return None
    *earlier, last = every
    if last.det != "indefinite" or last.subtype not in VEHICLE_SIZES:
        return None
    subject = _find_subject(earlier, people)
    if subject is None:
        vehicles = [each for each in people.list_foreground() if each.type == "vehicle"]
        if not vehicles:
            return None
        subject = people.pick(vehicles, "vehicle")
    if subject.type == "pedestrian" or subject.role == "background":
        raise Refused("impossible", f"{subject.id} cannot become that; remove it and add another.")
    if subject.type in RIDERS or any(way.start > last.start for way in find_ways(plain)):
        return None
    node = situation.graph.agent(subject.id)
    return (ChangeAgent(node=node.model_copy(update={"subtype": _get_kind(last)})),)


def _find_removed(words: str, situation: Situation) -> tuple[Edit, ...]:
    """The standing objects that the words take away; none if they say nothing of that kind."""
    match = _PATTERNS.takes_away.match(" ".join(words.split()))
    objects = situation.graph.objects
    if match is None or not objects:
        return ()
    what = match["what"]
    if _PATTERNS.any_object.search(what):
        return tuple(RemoveObject(object=scene_object.id) for scene_object in objects)
    named = [
        scene_object
        for scene_object in objects
        if scene_object.id in what or _names_object(scene_object, what)
    ]
    moving = {each.subtype for each in situation.present} & {find_subtype(what)} - {None}
    if len(named) != 1 or (moving and not _PATTERNS.state.search(what) and named[0].id not in what):
        return ()
    return (RemoveObject(object=named[0].id),)


def _names_object(node: ObjectNode, what: str) -> bool:
    """Whether words such as "the parked truck" or "the bin" name an object."""
    kind = node.kind.replace("_", "[- ]?")
    subtype = find_subtype(what)
    if subtype is not None:
        return subtype == (node.subtype or ("bus" if node.kind == "bus_stop" else None))
    return re.search(rf"\b{kind}\b", what, re.IGNORECASE) is not None
