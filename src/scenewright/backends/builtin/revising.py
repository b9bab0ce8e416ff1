"""What a turn of a conversation means: words, and the scene as it is -> a reading of them.

Dials, removals and numbers are read here; everything else by the planner's own reader (`redraft`).
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace

from scenewright.backends.builtin.asked_figures import read_figure
from scenewright.backends.builtin.clock import read_clock
from scenewright.backends.builtin.dials import build_motion_edit, number
from scenewright.backends.builtin.draft import Refused, Site
from scenewright.backends.builtin.grammar import Modifier, build_modifiers
from scenewright.backends.builtin.lexicon import Chunk, load_lexicon
from scenewright.backends.builtin.mentions import Item, Mention, build_noun_phrases
from scenewright.backends.builtin.normalise import clean, split_tokens
from scenewright.backends.builtin.order_edits import read_order
from scenewright.backends.builtin.reader.words import narrow_subtype
from scenewright.backends.builtin.redraft import free_name, get_next_item, read_change
from scenewright.backends.builtin.references import People, Unclear
from scenewright.backends.builtin.spelling import mend_spelling
from scenewright.backends.builtin.standing_edits import find_removed
from scenewright.backends.builtin.street_names import ask_which_leg, list_compass_texts
from scenewright.errors import Rejected
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
    SetBackground,
    Situation,
    Unrelate,
    apply_edits,
)
from scenewright.scene.social import MOST_BACKGROUND, RelationEdge, RelationType
from scenewright.scene.track import VEHICLE_SIZES

_PARTS = re.compile(
    r"\s*(?:;|\.\s|,?\s+and then|,?\s+and|,\s*then|,)\s+(?=(?:then |also |please |now )*"
    r"(?:make|add|remove|delete|drop|slow|speed|stop|put|set|move|change|turn it|delay|replace|"
    r"have the|have it|let the|give it|no background)\b)"
)
_CUE = re.compile(
    r"^\s*(?:then|and|next|afterwards|finally|ok|okay)\b|\b(instead|now|change|switch|"
    r"same (?:but|scene|thing|setup|again)|keep|actually|add|remove|drop|delete|swap|"
    r"replace|also|make (?:it|the|that|him|her|them|this|one)"
    r"|turn (?:it|that) into|set the|this time|what if|let the|have the|have it|let it|"
    r"should|more|less|busier|quieter|earlier|later|reverse|other way a?round|but|"
    r"without|move)\b"
)
_FRESH = re.compile(r"\b(?:new scene|start over|from scratch|forget (?:that|it|the))\b")
_REMOVES = re.compile(r"\b(?:remove|delete|drop|get rid of|take out|take away|lose)\b")
_ADDS = re.compile(r"\b(?:add|throw in|include|put in|insert)\b|\bmore\b|\badditional\b")
_FEWER = re.compile(r"\b(?:fewer|less)\b")
_ANOTHER = re.compile(
    r"^(?:please )?(?:try (?:it )?again|another (?:one|version|try|take)|again|re-?roll|redraw|"
    r"something else|surprise me|a different one|"
    r"(?:(?:try|draw|give me|take) )?(?:another|a different)(?: (?:one|version|path|way))?"
    r"(?: for (?P<who>.*))?)[.!]?$"
)
_BECOMES = re.compile(r"\b(?:make|turn|change|replace|swap|switch|should be|becomes?)\b")
_PRONOUN = re.compile(
    r"\b(?:make|have|let|get)\s+(?P<it>it|him|her)\s+(?=(?:turn|come|go|run|drive|walk|stop|cross|"
    r"yield|give|wait|hit|follow|leave|enter|head|jaywalk|brake|start)\b)"
)
_PERSON = re.compile(r"(?<=\b(?:make|slow|have|stop)\s)(?:her|him)\b", re.IGNORECASE)
_ORDINARY = re.compile(
    r"\b(?:normal|ordinary|usual|regular|typical)\s+(?=(?:\w+\s+)?"
    r"(?:morning|day|weekday|workday|afternoon|evening|night|rush hour)\b)",
    re.IGNORECASE,
)
"""An ordinary morning says nothing of the event, unlike a normal scene."""
_HOLDS = re.compile(r"\s*(?:stop|wait|come to an? (?:\w+ )?(?:stop|halt|standstill))\b")
_EVENTS = ("COLLIDE", "NEAR", "YIELD", "FOLLOW", "WAIT", "LET")
_EVENT_WORDS = {
    "collide_at": r"collision|crash|accident|hit",
    "near_miss": r"near[- ]miss|close call",
    "yield_to": r"yield(?:ing)?|giving way|right of way",
    "follow": r"follow(?:ing)?",
}
_TYPES: dict[str, RelationType] = {
    "NEAR": "near_miss", "COLLIDE": "collide_at", "FOLLOW": "follow", "YIELD": "yield_to",
    "WAIT": "yield_to", "LET": "yield_to",
}  # fmt: skip


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
    if situation is None or _FRESH.search(plain):
        return NewScene()
    site = site or Site()
    try:
        worded = list_compass_texts(words, site.roads, chosen)
        plain_site = replace(site, roads=())
        made = [read(each.text, situation, chosen=chosen, site=plain_site) for each in worded]
        edits = [each for each in made if isinstance(each, Edits)]
        if any(each != edits[0] for each in edits):
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
    return _FRESH.search(" ".join(words.lower().split())) is not None


def _build_edits(
    words: str, situation: Situation, chosen: Mapping[str, str], site: Site
) -> Reading:
    again = _ANOTHER.match(" ".join(words.lower().split()))
    if again is not None:
        return Edits(edits=(_redraw(again, situation, chosen),))
    if standing := find_removed(words, situation):
        return Edits(edits=standing)
    if not _is_edit(words) and not _is_about_scene(words, situation, chosen):
        return NewScene()
    found: list[Edit] = []
    for part in _PARTS.split(words.strip()):
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
    chunks = load_lexicon().split_chunks(split_tokens(plain))
    agents = [at for at, chunk in enumerate(chunks) if chunk.has("AGENT")]
    introduced = [at for at in agents if _is_indefinite(chunks, at)]
    counted = [at for at in agents if at and chunks[at - 1].tags.get("NUMBER", "1") != "1"]
    happens = any(chunk.has(*_EVENTS) for chunk in chunks)
    if happens and (len(introduced) >= 2 or (counted and not _CUE.search(plain))):
        return False  # it brings its own parties and event
    return bool(_CUE.search(plain)) or len(agents) < 2


def _is_indefinite(chunks: Sequence[Chunk], at: int) -> bool:
    for chunk in reversed(chunks[max(0, at - 4) : at]):
        if chunk.has("AGENT") or chunk.mark:
            return False
        if chunk.has("DET"):
            return chunk.tags["DET"] in {"indefinite", "another"}
    return False


def _is_about_scene(words: str, situation: Situation, chosen: Mapping[str, str]) -> bool:
    """Whether the words, though they describe an event, name agents of the scene."""
    people = People(situation, chosen)
    try:
        items = _build_items(clean(words))
        return any(
            people.find_named(item, get_next_item(items, at)) is not None
            for at, item in enumerate(items)
            if isinstance(item, Mention) and item.det == "definite"
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
    agent = _find_subject(_build_items(clean(name)), people) or people.find_by_id(name)
    if agent is None:
        raise Refused("impossible", f"I do not see which agent {name!r} means.")
    return Redraw(agent=agent.id)


def _read_part(
    text: str, situation: Situation, chosen: Mapping[str, str], site: Site
) -> tuple[Edit, ...]:
    """The edits that one clause asks for."""
    people = People(situation, chosen)
    text = _ORDINARY.sub("", _spell_out(text, people))
    plain = clean(text)
    items = _build_items(plain)
    event = any(isinstance(each, Chunk) and each.has(*_EVENTS) for each in items)
    related = (
        _choose_events(items, situation, people) if event and not _has_figures(plain) else None
    )
    if related is not None:
        return related
    made = _read_removal(text, plain, items, situation, people)
    made = made or (None if event else _read_count_change(plain, items, situation))
    made = made or (None if event else read_order(plain, items, situation, people))
    made = made or _read_figure(text, items, situation, people)
    made = made or _read_motion(text, items, people)
    made = made or (None if event else _read_kind(plain, items, situation, people))
    return made or read_change(text, items, situation, people, site=site)


def _has_figures(plain: str) -> bool:
    """Whether the words say how severe it shall be: those are for the reader."""
    clock = read_clock(plain)[1]
    return any(each is not None for each in (clock.pet, clock.ttc, clock.speed))


def _read_figure(
    text: str, items: Sequence[Item], situation: Situation, people: People
) -> tuple[Edit, ...] | None:
    """The figure that a clause asks for; a speed at which to drive is a dial."""
    found = read_figure(text, situation, people, _find_subject(items, people))
    return None if found is None else (found,)


def _choose_events(
    items: Sequence[Item], situation: Situation, people: People
) -> tuple[Relate, ...] | None:
    """The relations as they shall be, where there are several and no agent is named.

    An agent of several equal relations changes all of them, but can hit only one other agent.

    Raises:
        Unclear: the answer is the agent that acts.
    """
    edges = situation.graph.relations
    if len(edges) < 2 or any(isinstance(each, Mention) for each in items):
        return None
    types = [
        type_
        for tag, type_ in _TYPES.items()
        for item in items
        if isinstance(item, Chunk) and item.has(tag)
    ]
    acting = {each.from_ for each in edges}
    actor = people.pick([p for p in people.list_foreground() if p.id in acting], "event, that of")
    meant = [each for each in edges if each.from_ == actor.id]
    meant = [each for each in meant if each.type == meant[0].type]
    return tuple(
        Relate(
            edge=RelationEdge.model_validate({"type": types[0], "from": each.from_, "to": each.to})
        )
        for each in (meant[:1] if types[0] == "collide_at" else meant)
    )


def _build_items(plain: str) -> list[Item]:
    chunks = load_lexicon().split_chunks(split_tokens(plain))
    return build_noun_phrases(build_modifiers(chunks), text=plain)


def _spell_out(text: str, people: People) -> str:
    """ "have it turn left" with the vehicle instead of the pronoun."""
    walkers = [each for each in people.list_foreground() if each.type == "pedestrian"]
    if len(walkers) == 1:
        text = _PERSON.sub(walkers[0].id, text)
    found = _PRONOUN.search(text.lower())
    if found is None:
        return text
    kind = "vehicle" if found["it"] == "it" else "pedestrian"
    if _HOLDS.match(text[found.end() :].lower()):
        held = [e for e in people.list_foreground() if e.stops or e.slows_to is not None]
        if len(held) == 1 and held[0].type == kind:
            return f"{text[: found.start('it')]}{held[0].id}{text[found.end('it') :]}"
    if not any(each.type == kind for each in people.list_foreground()):
        return text
    return f"{text[: found.start('it')]}the {kind}{text[found.end('it') :]}"


def _find_subject(items: Sequence[Item], people: People) -> AgentView | None:
    """The first agent that is named."""
    for at, item in enumerate(items):
        if isinstance(item, Mention):
            agent = people.find_named(item, get_next_item(items, at))
            if agent is not None:
                return agent
    return None


def _read_motion(text: str, items: Sequence[Item], people: People) -> tuple[Edit, ...] | None:
    lowered = " ".join(text.lower().split())
    if re.search(r"\b(?:pet|ttc|impact|collid|hits?)\b", lowered):
        return None
    agent = people.find_by_id(text) or _find_subject(items, people)
    edit = build_motion_edit(lowered, people, agent)
    return None if edit is None else (edit,)


def _read_removal(
    text: str, plain: str, items: Sequence[Item], situation: Situation, people: People
) -> tuple[Edit, ...] | None:
    """ "remove the truck", "drop the collision", "remove all pedestrians"."""
    if not _REMOVES.search(plain):
        return None
    agent = people.find_by_id(text) or _find_subject(items, people)
    if agent is not None:
        return (RemoveAgent(agent=agent.id),)
    for type_, pattern in _EVENT_WORDS.items():
        edges = [each for each in situation.graph.relations if each.type == type_]
        if edges and re.search(rf"\b(?:{pattern})\b", plain):
            return tuple(Unrelate(first=each.from_, second=each.to) for each in edges)
    groups = [each for each in items if isinstance(each, Mention) and each.type is not None]
    if not groups and re.search(r"\b(?:background|everybody|everyone|others?)\b", plain):
        return (SetBackground(vehicles=0, pedestrians=0),)
    if not groups:
        return None
    rare = {_get_kind(each) for each in groups} & (VEHICLE_SIZES.keys() - {"car"})
    if rare and len(groups) == 1 and not groups[0].counted:
        return _remove_kind(groups[0], situation)
    counts = _count_background(situation)
    for group in groups:
        kind = str(group.type)
        counts[kind] = max(counts[kind] - group.count, 0) if group.counted else 0
    return (_build_background_edit(counts, [str(each.type) for each in groups]),)


def _remove_kind(group: Mention, situation: Situation) -> tuple[Edit, ...]:
    """ "remove the buses": all of that kind in the background, and no other agent."""
    kind = _get_kind(group)
    others = [each for each in situation.present if each.role == "background"]
    gone = [each.id for each in others if each.subtype == kind]
    if not gone:
        raise Refused("impossible", f"There is no {kind} among the others in this scene.")
    return tuple(RemoveAgent(agent=each) for each in gone[:32])


def _read_count_change(
    plain: str, items: Sequence[Item], situation: Situation
) -> tuple[Edit, ...] | None:
    """ "add three cars", "two more pedestrians", "fewer cars"; kinds of vehicles by name."""
    more, fewer = _ADDS.search(plain) is not None, _FEWER.search(plain) is not None
    groups = [each for each in items if isinstance(each, Mention) and each.type is not None]
    modifiers = [each for each in items if isinstance(each, Modifier)]
    if not groups or not (more or fewer) or modifiers:
        return None
    if any(each.det == "definite" or each.premods for each in groups if not each.counted):
        return None
    named = [each for each in groups if _get_kind(each) in VEHICLE_SIZES.keys() - {"car"}]
    if named and more:
        return _read_kinds(groups, situation)
    counts = _count_background(situation)
    for group in groups:
        many = group.count if group.counted else (_parse_vague(plain) if group.plural else 1)
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


def _parse_vague(plain: str) -> int:
    found = re.search(r"\b(a couple of|a few|some|several)\b", plain)
    return 3 if found is None else int(number(found[1]))


def _read_kinds(groups: Sequence[Mention], situation: Situation) -> tuple[Edit, ...]:
    """Trucks, buses and motorcycles take part by name: a crowd has the kinds it was drawn with."""
    taken = {each.id for each in situation.present} | {a.id for a in situation.graph.agents}
    made: list[Edit] = []
    for group in groups:
        for _ in range(group.count):
            name = free_name(str(group.type), taken)
            taken.add(name)
            made.append(
                AddAgent.model_validate(
                    {"node": {"id": name, "type": group.type, "subtype": _get_kind(group)}}
                )
            )
    return tuple(made)


def _get_kind(mention: Mention) -> str | None:
    return narrow_subtype(mention.subtype, mention.head)


def _count_background(situation: Situation) -> dict[str, int]:
    others = [each for each in situation.present if each.role == "background"]
    return {kind: sum(each.type == kind for each in others) for kind in ("vehicle", "pedestrian")}


def _build_background_edit(counts: Mapping[str, int], kinds: Sequence[str]) -> SetBackground:
    return SetBackground(
        vehicles=counts["vehicle"] if "vehicle" in kinds else None,
        pedestrians=counts["pedestrian"] if "pedestrian" in kinds else None,
    )


def _read_kind(
    plain: str, items: Sequence[Item], situation: Situation, people: People
) -> tuple[Edit, ...] | None:
    """ "make the car a truck", "replace the bus with a motorcycle"."""
    mentions = [(at, each) for at, each in enumerate(items) if isinstance(each, Mention)]
    if not _BECOMES.search(plain) or not mentions:
        return None
    at, last = mentions[-1]
    if last.det != "indefinite" or last.subtype not in VEHICLE_SIZES:
        return None
    earlier = [each for _, each in mentions[:-1]]
    subject = _find_subject(earlier, people)
    if subject is None:
        vehicles = [each for each in people.list_foreground() if each.type == "vehicle"]
        if not vehicles:
            return None
        subject = people.pick(vehicles, "vehicle")
    if subject.type == "pedestrian" or subject.role == "background":
        raise Refused("impossible", f"{subject.id} cannot become that; remove it and add another.")
    if any(isinstance(each, Modifier) for each in items[at:]):
        return None
    node = situation.graph.agent(subject.id)
    return (ChangeAgent(node=node.model_copy(update={"subtype": _get_kind(last)})),)
