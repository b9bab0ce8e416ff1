"""Stage 1 without a model: instruction text -> social graph, or a refusal with its reason.

Text goes through `normalise` (tokens), `idioms` and `shorthand` (plainer words), `clock` (figures),
`lexicon` (tagged chunks), `grammar` (modifiers), `mentions` (noun phrases), `clauses` (agents,
relations), `context` and `entail`.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import deepcopy

from scenewright.backends.builtin import edits
from scenewright.backends.builtin.clauses import Reader
from scenewright.backends.builtin.clock import read_clock
from scenewright.backends.builtin.context import read_context
from scenewright.backends.builtin.draft import AgentDraft, Draft, Refused, RelationDraft, Site
from scenewright.backends.builtin.entail import entail
from scenewright.backends.builtin.grammar import modifiers
from scenewright.backends.builtin.impacts import Impacts, brakes_hard, read_impacts
from scenewright.backends.builtin.lexicon import Chunk, lexicon
from scenewright.backends.builtin.mentions import noun_phrases
from scenewright.backends.builtin.normalise import clean, tokenise
from scenewright.backends.builtin.phrases import cast
from scenewright.backends.builtin.scope import (
    check_language,
    check_scope,
    check_text,
    nothing_planned,
)
from scenewright.backends.builtin.shorthand import denied, expand
from scenewright.backends.builtin.ties import name_turns_across, ties
from scenewright.backends.builtin.unread import check_read
from scenewright.scene.recent import Recent
from scenewright.scene.relations import patterns
from scenewright.scene.social import (
    AgentNode,
    Background,
    EntryTie,
    Plan,
    Refusal,
    RelationEdge,
    SceneContext,
    SocialGraph,
)

_FASTEST, _LONGEST = 20.0, 8.0
"""Speed [m/s], and PET and TTC [s], that may be asked for."""

_MOST_BACKGROUND = 20
_NOTHING = (
    "nothing happens",
    "no incident",
    "without incident",
    "without any incident",
    "no event",
)
_SUBTYPES = frozenset({"car", "truck", "bus", "motorcycle"})

_KNOWN: Recent[tuple[str, str | None, Site], Plan] = Recent(most=256)
"""One text is asked for with many seeds."""


def plan(text: str, *, previous: str | None = None, site: Site | None = None) -> Plan:
    """The social graph that the text asks for, or why there is none (paper 3.1, SEMANTICS 2-4).

    Args:
        text: the instruction, in English, at most 2,000 characters.
        previous: an earlier instruction that `text` edits; a full instruction replaces it.
        site: where it is to happen; None: four legs in right-hand traffic.
    """
    asked = text, previous, site or Site()
    return _KNOWN.get(asked, patterns(), make=lambda: _planned(*asked))


def _planned(text: str, previous: str | None, site: Site) -> Plan:
    try:
        return _graph(_understand(text, previous, site))
    except Refused as verdict:
        return Refusal.model_validate({"code": verdict.code, "reason": verdict.reason})


def _understand(text: str, previous: str | None, site: Site) -> Draft:
    base = None
    if previous is not None and previous.strip() and edits.is_edit(text):
        base = _base(previous)
    if base is not None:
        draft = _edited(text, base)
        draft.site = site
        return _finish(draft)
    draft, reader = _draft(text)
    draft.site = site
    _finish(draft)
    check_read(draft, reader)
    return draft


def _base(previous: str) -> Draft | None:
    try:
        return _draft(previous)[0]
    except Refused:
        return None


def _draft(text: str) -> tuple[Draft, Reader]:
    """What a full instruction says, before entailments."""
    check_text(text)
    plain, impacts = read_impacts(expand(clean(text)))
    check_language(text, tokenise(plain))
    without_figures, clock = read_clock(plain)
    chunks = lexicon().chunks(tokenise(without_figures))
    check_scope(plain, chunks, measured=clock.pet is not None or clock.ttc is not None)
    draft = Draft(
        normal=any(chunk.has("NORMAL") and chunk.tags["NORMAL"] == "normal" for chunk in chunks)
    )
    reader = _read(draft, chunks, without_figures)
    read_context(draft, chunks, clock)
    _told_by_figures(draft, chunks)
    if brakes_hard(plain):
        _brakes(draft)
    _place_impacts(draft, impacts)
    _settle_normal(draft, reader, chunks)
    _check_denied(draft, denied(plain))
    if draft.agents and any(chunk.has("EMPTY") for chunk in chunks):
        raise Refused(
            "contradictory", "The scene cannot be empty and hold agents; drop one of the two."
        )
    return draft, reader


def _edited(text: str, base: Draft) -> Draft:
    check_text(text)
    whole = expand(clean(text))
    check_language(text, tokenise(whole))
    plain, clock = read_clock(whole)
    chunks = lexicon().chunks(tokenise(plain))
    check_scope(whole, chunks, editing=True)
    draft = deepcopy(base)
    edits.apply(draft, chunks, lambda words: _read(draft, words, plain, editing=True), clock)
    return draft


def _read(draft: Draft, chunks: Sequence[Chunk], text: str, *, editing: bool = False) -> Reader:
    reader = Reader(draft, editing=editing)
    reader.read(noun_phrases(modifiers(chunks), text=text))
    _failed_yields(draft, reader)
    if "late_brake" in reader.said:
        _too_late(draft)
        _cause(draft, "late_brake")
    return reader


def _told_by_figures(draft: Draft, chunks: Sequence[Chunk]) -> None:
    """A PET or TTC alone asks for a near miss, "truck versus pedestrian" for a collision."""
    if draft.relations or draft.normal or draft.denied - {"collide_at"} or len(draft.agents) != 2:
        return
    measured = draft.context.pet is not None or draft.context.ttc is not None
    versus = any(chunk.text in {"vs", "versus"} for chunk in chunks) and not draft.denied
    if measured or versus:
        type_ = "near_miss" if measured else "collide_at"
        first, second = draft.agents
        draft.relations.append(RelationDraft(type_, first, second))


def _too_late(draft: Draft) -> None:
    """ "cannot stop in time" means a collision where the text names no other event."""
    if not draft.relations and not draft.normal and not draft.denied and len(draft.agents) == 2:
        draft.relations.append(RelationDraft("collide_at", draft.agents[1], draft.agents[0]))


def _failed_yields(draft: Draft, reader: Reader) -> None:
    """A yield denied: contradicts the same yield, and alone amounts to a near miss."""
    for edge in reader.failed:
        same = [r for r in draft.relations if r.pair() == edge.pair()]
        if any(
            r.type == edge.type and (r.type != "yield_to" or r.from_ is edge.from_) for r in same
        ):
            raise Refused(
                "contradictory",
                "The text both asks for an event and denies it; keep one of the two.",
            )
    denied = [edge for edge in reader.failed if edge.type == "yield_to"]
    if denied and not draft.relations and not draft.normal:
        draft.relations.append(RelationDraft("near_miss", denied[0].from_, denied[0].to))


def _settle_normal(draft: Draft, reader: Reader, chunks: Sequence[Chunk]) -> None:
    if draft.denied & {relation.type for relation in draft.relations}:
        raise Refused(
            "contradictory", "The text both asks for an event and denies it; keep one of the two."
        )
    event = any(relation.type in {"collide_at", "near_miss"} for relation in draft.relations)
    if event and any(chunk.has("NORMAL") and chunk.text.startswith(_NOTHING) for chunk in chunks):
        raise Refused(
            "contradictory", "The text both asks for an event and denies it; keep one of the two."
        )
    if draft.relations:
        _drop_generic(draft)
        return
    _drop_generic(draft)
    for group in list(reader.counted):
        if not any(a.entry or a.exit or a.movement for a in group):
            reader.to_background(group)
    said = draft.normal or draft.denied or draft.agents
    context = draft.context
    traffic = any(
        chunk.tags.get("AGENT") == "traffic" or chunk.has("TRAFFIC_NOUN") for chunk in chunks
    )
    counted = context.vehicles is not None or context.pedestrians is not None
    if not said and not (traffic and (context.density or context.time_of_day)) and not counted:
        raise nothing_planned()


def _check_denied(draft: Draft, none: frozenset[str]) -> None:
    """ "no vehicles at all in which a truck ...": the text denies what it then tells."""
    events = "event" in none and bool(draft.relations)
    if events or any(agent.type in none for agent in draft.agents):
        raise Refused(
            "contradictory", "The text both asks for something and denies it; keep one of the two."
        )


def _drop_generic(draft: Draft) -> None:
    """ "cars and people move on as usual" names nobody in particular."""
    bound = [agent for edge in draft.relations for agent in (edge.from_, edge.to)]
    draft.agents[:] = [
        agent
        for agent in draft.agents
        if agent in bound
        or not agent.generic
        or agent.entry
        or agent.exit
        or agent.movement
        or agent.crosswalk
    ]


def _finish(draft: Draft) -> Draft:
    _one_event_per_pair(draft)
    for relation in draft.relations:
        cast(relation, draft.site)
    entail(draft)
    name_turns_across(draft)
    if any(agent.runs_red for agent in draft.agents):
        _cause(draft, "red_light_run")
    for relation in draft.relations:
        _orient(relation)
    speed = draft.context.speed
    if speed is not None and speed > _FASTEST:
        raise Refused(
            "impossible",
            f"{speed:.0f} m/s is too fast here; ask for at most {_FASTEST:.0f} m/s (72 km/h).",
        )
    for name, seconds in (("PET", draft.context.pet), ("TTC", draft.context.ttc)):
        if seconds is not None and seconds > _LONGEST:
            raise Refused(
                "impossible",
                f"A {name} of {seconds:g} s is no encounter; ask for at most {_LONGEST:g} s.",
            )
    empty = draft.context.vehicles == 0 and draft.context.pedestrians == 0
    if not draft.agents and empty:
        raise nothing_planned()
    return draft


def _one_event_per_pair(draft: Draft) -> None:
    """Collision, else yielding, else near miss (SEMANTICS 4); a follow may come before any."""
    for relation in list(draft.relations):
        types = {r.type for r in draft.relations if r.pair() == relation.pair()}
        if {"collide_at", "yield_to"} <= types:
            raise Refused(
                "contradictory",
                "An agent cannot yield to another and hit it in one encounter; keep "
                "one of the two.",
            )
        softened = relation.type == "yield_to" and relation.soft and "near_miss" in types
        overruled = relation.type == "near_miss" and types & {"collide_at", "yield_to"}
        if softened or overruled:
            draft.relations.remove(relation)


def _cause(draft: Draft, cause: str) -> None:
    for relation in draft.relations:
        ran = relation.from_.runs_red or relation.to.runs_red or cause == "late_brake"
        made_to_yield = relation.type == "yield_to" and relation.to.runs_red
        if relation.type in {"collide_at", "near_miss"} and ran:
            relation.cause = relation.cause or cause
        elif made_to_yield and cause == "red_light_run":
            relation.cause = cause


def _brakes(draft: Draft) -> None:
    """Who brakes hard and is missed owes it to the braking."""
    for relation in draft.relations:
        if relation.type == "near_miss" and not (relation.from_.runs_red or relation.to.runs_red):
            relation.cause = relation.cause or "late_brake"


def _place_impacts(draft: Draft, impacts: Impacts) -> None:
    """Points of impact belong to the one collision there is; pedestrians have none."""
    collisions = [each for each in draft.relations if each.type == "collide_at"]
    if len(collisions) != 1:
        return
    (hit,) = collisions
    vehicles = [agent for agent in (hit.from_, hit.to) if agent.type == "vehicle"]
    if len(vehicles) == 2:
        hit.point_from, hit.point_to = impacts.striking, impacts.struck
    elif vehicles == [hit.from_]:
        hit.point_from = impacts.striking
    else:  # "a pedestrian walks into the side of a bus"; the vehicle will be `from`
        hit.point_to = impacts.struck


def _orient(relation: RelationDraft) -> None:
    """The vehicle strikes the pedestrian, whoever is the subject of the sentence."""
    if relation.type in {"collide_at", "near_miss"} and relation.from_.type == "pedestrian":
        relation.from_, relation.to = relation.to, relation.from_
        relation.point_from, relation.point_to = relation.point_to, relation.point_from


def _graph(draft: Draft) -> SocialGraph:
    ids = _ids(draft.agents)
    nodes = tuple(_node(agent, ids[id(agent)]) for agent in draft.agents)
    edges = tuple(_edge(relation, ids, draft) for relation in draft.relations[:6])
    tied = tuple(
        EntryTie(agent=ids[id(agent)], of=ids[id(other)], side=side)
        for agent, other, side in ties(draft)
    )
    return SocialGraph(agents=nodes, relations=edges, ties=tied, context=_context(draft))


def _ids(agents: Sequence[AgentDraft]) -> dict[int, str]:
    counts = {"vehicle": 0, "pedestrian": 0}
    result: dict[int, str] = {}
    for agent in agents:
        counts[agent.type] += 1
        result[id(agent)] = f"{agent.type}-{counts[agent.type]}"
    return result


def _node(agent: AgentDraft, name: str) -> AgentNode:
    return AgentNode.model_validate(
        {
            "id": name,
            "type": agent.type,
            "subtype": agent.subtype if agent.subtype in _SUBTYPES else None,
            "entry": agent.entry,
            "exit": agent.exit,
            "movement": agent.movement,
            "crosswalk": agent.crosswalk,
            "runs_red": agent.runs_red,
        }
    )


def _edge(relation: RelationDraft, ids: dict[int, str], draft: Draft) -> RelationEdge:
    context = draft.context
    collision, miss = relation.type == "collide_at", relation.type == "near_miss"
    return RelationEdge.model_validate(
        {
            "type": relation.type,
            "from": ids[id(relation.from_)],
            "to": ids[id(relation.to)],
            "kind": relation.kind if collision else None,
            "cause": relation.cause,
            "pattern": relation.pattern,
            "target_pet": context.pet if not collision else None,
            "target_ttc": context.ttc if miss else None,
            "impact_speed": (context.speed or None) if collision else None,
            "point_from": relation.point_from if collision else None,
            "point_to": relation.point_to if collision else None,
        }
    )


def _context(draft: Draft) -> SceneContext:
    context = draft.context
    counts = {"vehicles": context.vehicles, "pedestrians": context.pedestrians}
    known = any(count is not None for count in counts.values())
    return SceneContext.model_validate(
        {
            "density": context.density,
            "time_of_day": context.time_of_day,
            "background": Background(**counts) if known else None,
        }
    )
