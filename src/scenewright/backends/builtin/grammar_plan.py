"""The second reading of an instruction: by a grammar of short plain orders and shorthand.

Text goes through `normalise` (tokens), `idioms` and `shorthand` (plainer words), `clock` (figures),
`lexicon` (tagged chunks), `grammar` (modifiers), `mentions` (noun phrases), `clauses` (agents,
relations), `context` and `entail`.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import deepcopy

from scenewright.backends.builtin import edits
from scenewright.backends.builtin.clauses import ClauseReader
from scenewright.backends.builtin.clock import read_clock
from scenewright.backends.builtin.context import read_context
from scenewright.backends.builtin.draft import Draft, Refused, RelationDraft, Site
from scenewright.backends.builtin.grammar import build_modifiers
from scenewright.backends.builtin.graph_making import (
    finish_draft,
    make_graph,
    place_impacts,
    set_cause,
)
from scenewright.backends.builtin.impacts import has_hard_braking, read_impacts
from scenewright.backends.builtin.lexicon import Chunk, load_lexicon
from scenewright.backends.builtin.mentions import build_noun_phrases
from scenewright.backends.builtin.normalise import clean, split_tokens
from scenewright.backends.builtin.scope import (
    build_nothing_planned,
    check_language,
    check_scope,
    check_text,
)
from scenewright.backends.builtin.shorthand import expand, find_denied
from scenewright.backends.builtin.unread import check_read
from scenewright.scene.base import RIDERS
from scenewright.scene.social import (
    Plan,
    Refusal,
)

_NOTHING = (
    "nothing happens",
    "no incident",
    "without incident",
    "without any incident",
    "no event",
)


def read_by_grammar(text: str, previous: str | None = None, site: Site | None = None) -> Plan:
    """The social graph that the grammar reads in a text, or why it reads none."""
    try:
        return make_graph(_read_draft(text, previous, site or Site()))
    except Refused as verdict:
        return Refusal.model_validate({"code": verdict.code, "reason": verdict.reason})


def _read_draft(text: str, previous: str | None, site: Site) -> Draft:
    base = None
    if previous is not None and previous.strip() and edits.is_edit(text):
        base = _build_base(previous)
    if base is not None:
        draft = _edit_draft(text, base)
        draft.site = site
        return finish_draft(draft)
    draft, reader = _build_draft(text)
    draft.site = site
    finish_draft(draft)
    check_read(draft, reader)
    return draft


def _build_base(previous: str) -> Draft | None:
    try:
        return _build_draft(previous)[0]
    except Refused:
        return None


def _build_draft(text: str) -> tuple[Draft, ClauseReader]:
    """What a full instruction says, before entailments."""
    check_text(text)
    plain, impacts = read_impacts(expand(clean(text)))
    check_language(text, split_tokens(plain))
    without_figures, clock = read_clock(plain)
    chunks = load_lexicon().split_chunks(split_tokens(without_figures))
    check_scope(plain, chunks, measured=clock.pet is not None or clock.ttc is not None)
    draft = Draft(
        normal=any(chunk.has("NORMAL") and chunk.tags["NORMAL"] == "normal" for chunk in chunks)
    )
    reader = _read(draft, chunks, without_figures)
    read_context(draft, chunks, clock)
    _infer_from_figures(draft, chunks)
    if has_hard_braking(plain):
        _infer_braking(draft)
    place_impacts(draft, impacts)
    _settle_normal(draft, reader, chunks)
    _check_denied(draft, find_denied(plain))
    if draft.agents and any(chunk.has("EMPTY") for chunk in chunks):
        raise Refused(
            "contradictory", "The scene cannot be empty and hold agents; drop one of the two."
        )
    _classify_riders(draft)
    return draft, reader


def _classify_riders(draft: Draft) -> None:
    """Cyclists and scooters, read like subtypes of vehicles, become agents of their own classes."""
    for agent in draft.agents:
        for kind in RIDERS:
            if agent.subtype == kind:
                agent.type, agent.subtype = kind, None


def _edit_draft(text: str, base: Draft) -> Draft:
    check_text(text)
    whole = expand(clean(text))
    check_language(text, split_tokens(whole))
    plain, clock = read_clock(whole)
    chunks = load_lexicon().split_chunks(split_tokens(plain))
    check_scope(whole, chunks, editing=True)
    draft = deepcopy(base)
    edits.apply(draft, chunks, lambda words: _read(draft, words, plain, editing=True), clock)
    _classify_riders(draft)
    return draft


def _read(
    draft: Draft, chunks: Sequence[Chunk], text: str, *, editing: bool = False
) -> ClauseReader:
    reader = ClauseReader(draft, editing=editing)
    reader.read(build_noun_phrases(build_modifiers(chunks), text=text))
    settle_failed_yields(draft, reader)
    if "late_brake" in reader.said:
        _infer_too_late(draft)
        set_cause(draft, "late_brake")
    return reader


def _infer_from_figures(draft: Draft, chunks: Sequence[Chunk]) -> None:
    """A PET or TTC alone asks for a near miss, "truck versus pedestrian" for a collision."""
    if draft.relations or draft.normal or draft.denied - {"collide_at"} or len(draft.agents) != 2:
        return
    measured = draft.context.pet is not None or draft.context.ttc is not None
    versus = any(chunk.text in {"vs", "versus"} for chunk in chunks) and not draft.denied
    if measured or versus:
        type_ = "near_miss" if measured else "collide_at"
        first, second = draft.agents
        draft.relations.append(RelationDraft(type_, first, second))


def _infer_too_late(draft: Draft) -> None:
    """ "cannot stop in time" means a collision where the text names no other event."""
    if not draft.relations and not draft.normal and not draft.denied and len(draft.agents) == 2:
        draft.relations.append(RelationDraft("collide_at", draft.agents[1], draft.agents[0]))


def settle_failed_yields(draft: Draft, reader: ClauseReader) -> None:
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


def _settle_normal(draft: Draft, reader: ClauseReader, chunks: Sequence[Chunk]) -> None:
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
            reader.move_to_background(group)
    said = draft.normal or draft.denied or draft.agents
    context = draft.context
    traffic = any(
        chunk.tags.get("AGENT") == "traffic" or chunk.has("TRAFFIC_NOUN") for chunk in chunks
    )
    counted = context.vehicles is not None or context.pedestrians is not None
    if not said and not (traffic and (context.density or context.time_of_day)) and not counted:
        raise build_nothing_planned()


def _check_denied(draft: Draft, none: frozenset[str]) -> None:
    """ "no vehicles at all in which a truck ...": the text denies what it then describes."""
    events = "event" in none and bool(draft.relations)
    if events or any(agent.type in none for agent in draft.agents):
        raise Refused(
            "contradictory", "The text both asks for something and denies it; keep one of the two."
        )


def _drop_generic(draft: Draft) -> None:
    """Drop agents that mean all traffic: "cars and people move on as usual"."""
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


def _infer_braking(draft: Draft) -> None:
    """A near miss with hard braking is caused by it."""
    for relation in draft.relations:
        if relation.type == "near_miss" and not (relation.from_.runs_red or relation.to.runs_red):
            relation.cause = relation.cause or "late_brake"
