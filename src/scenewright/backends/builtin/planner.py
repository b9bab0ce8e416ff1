"""Stage 1 without a language model: one reading of a text, and a measured doubt about it."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace
from itertools import chain, islice

from scenewright.backends.builtin.draft import Refused, Site
from scenewright.backends.builtin.phrases import replace_phrases
from scenewright.backends.builtin.reader.annotation import EVENTS
from scenewright.backends.builtin.reader.learned_plan import (
    OPENERS,
    LearnedPlan,
    plan_reading,
    read_again,
    read_plan,
)
from scenewright.backends.builtin.reader.reading import Reading, ReadSpan
from scenewright.backends.builtin.scope import check_language, check_text
from scenewright.backends.builtin.spelling import mend_spelling
from scenewright.backends.builtin.street_names import list_compass_texts
from scenewright.scene.cache import RecentCache
from scenewright.scene.kinds import find_marked
from scenewright.scene.phrasing import describe_graph
from scenewright.scene.relations import load_patterns
from scenewright.scene.social import Plan, Refusal, SceneContext, SocialGraph


def link_collisions(graph: SocialGraph) -> SocialGraph:
    """The graph in which who is struck from behind and strikes a third is pushed into that.

    "A van hits a taxi and the taxi hits a bus": the taxi's motion ends with its first collision,
    unless that leads to the second.
    """
    kinds = {agent.id: agent.type for agent in graph.agents}
    hits = [  # collisions of two vehicles that may be ones from behind
        edge
        for edge in graph.relations
        if edge.type == "collide_at"
        and {kinds[edge.from_], kinds[edge.to]} == {"vehicle"}
        and edge.kind in (None, "rear_end")
        and {edge.manoeuvre, edge.pattern, edge.cause} == {None}
    ]
    struck = {edge.to: edge.from_ for edge in hits}
    second = [e for e in hits if e.from_ in struck and struck[e.from_] != e.to]
    linked = {each.from_ for each in second} | {struck[each.from_] for each in second}
    pushed = find_marked("manoeuvre", "chain")
    edges = sorted(
        (
            edge.model_copy(
                update={"kind": "rear_end", "manoeuvre": pushed if edge in second else None}
            )
            if edge in hits and edge.from_ in linked
            else edge
            for edge in graph.relations
        ),
        key=lambda edge: edge.is_pushed,
    )
    return graph.model_copy(update={"relations": tuple(edges)}) if second else graph


SURE = 0.5
"""A reading as confident as this stands by itself; another one, if it comes out in every form. Of
texts in voices kept apart such plans are right in 308 of 360 and 111 of 148 cases."""

MOST_OFFERS, LONGEST_OFFER = 3, 25
"""Sentences that are offered, and words of each, which are fewer."""

_OFFERS = " Did you mean: "
LONGEST_READ_AGAIN = 600
"""Characters of a text that is read again where there is doubt."""

MOST_TRIED = 12
"""Readings that are put into sentences for the offers, which have to be read again each."""

_KNOWN: RecentCache[tuple[str, str | None, Site], Plan] = RecentCache(most=256)
"""One text is asked for with many seeds."""


def plan(
    text: str, *, previous: str | None = None, site: Site | None = None, seed: int = 0
) -> Plan:
    """The social graph that the text asks for, or why there is none (paper 3.1, SEMANTICS 2-4).

    Args:
        text: the instruction, in English, at most 2,000 characters.
        previous: an earlier instruction that `text` edits; a full instruction replaces it.
        site: where it is to happen; None: four legs in right-hand traffic.
        seed: chooses the leg of a street that has several.
    """
    site = site or Site()
    try:
        choices = list_compass_texts(text, site.roads)
    except Refused as verdict:
        return verdict.to_refusal()
    if not choices:
        return _plan_once(text, previous, site)
    first, found = seed % len(choices), []
    # The first choice of legs that the map can serve counts, else the first with a plan.
    for choice in (*choices[first:], *choices[:first]):
        made = _plan_once(choice.text, previous, site)
        if isinstance(made, SocialGraph) and (site.can_serve is None or site.can_serve(made)):
            return choice.restore_plan(made)
        found.append((choice, made))
    graphs = (pair for pair in found if isinstance(pair[1], SocialGraph))
    read, plan_ = next(graphs, found[0])
    return read.restore_plan(plan_)


def _plan_once(text: str, previous: str | None, site: Site) -> Plan:
    asked = text, previous, site
    return _KNOWN.get(asked, load_patterns(), make=lambda: _plan(*asked))


def _plan(text: str, previous: str | None, site: Site) -> Plan:
    try:
        check_text(text)
        mended = mend_spelling(text)
        check_language(text, mended.text)
        phrased = replace_phrases(mended.text)
        learned = read_plan(phrased.text, previous=previous, site=site, phrases=phrased.phrases)
    except Refused as verdict:
        return verdict.to_refusal()
    found = learned.plan if is_sure(learned, site) else _offer(learned, site)
    if isinstance(found, SocialGraph):
        found = link_collisions(found)
    return mended.restore_plan(phrased.restore_plan(found))


def is_sure(learned: LearnedPlan, site: Site) -> bool:
    """Whether a plan is confident, or comes out whatever harmless words stand around the text."""
    plan_ = learned.plan
    if isinstance(plan_, Refusal) or _is_bare(plan_):
        return False
    if learned.confidence >= SURE:
        return True
    long = len(learned.reading.text) > LONGEST_READ_AGAIN
    if long or learned.reading.kind != "scene":
        return False
    return all(is_same_plan(plan_, each) for each in _read_in_other_forms(learned, site))


def _read_in_other_forms(learned: LearnedPlan, site: Site) -> Iterator[Plan]:
    """Plans of the text after openers and before thanks."""
    text, phrases = learned.reading.text, learned.phrases
    for opener in (*OPENERS, "Scenario - "):
        yield read_again(text, opener, site=site, phrases=phrases).plan
    yield read_plan(f"{text} Thanks.", site=site, phrases=phrases).plan


def _is_bare(plan_: SocialGraph) -> bool:
    """Whether agents are there, and nothing is said to happen: not even that nothing does.

    Of one agent alone it is enough to say where it goes.
    """
    if plan_.relations or not plan_.agents:
        return False
    ways = any(
        a.entry or a.exit or a.movement or a.crosswalk or a.runs_red or a.motion
        for a in plan_.agents
    )
    objects = any(scene_object.met_by for scene_object in plan_.objects)
    said = {each.became for each in plan_.said}
    settled = not said.isdisjoint(("normal", "denied", "signals"))
    return not (settled or objects or (ways and len(plan_.agents) == 1))


def is_same_plan(first: Plan, second: Plan) -> bool:
    """Whether two plans are the same but for their accounts, subtypes and the order of agents."""
    if isinstance(first, Refusal) or isinstance(second, Refusal):
        return isinstance(first, Refusal) and isinstance(second, Refusal)
    return _reduce_graph(first) == _reduce_graph(second)


def _reduce_graph(graph: SocialGraph) -> object:
    ways = {
        agent.id: (agent.type, agent.entry, agent.exit, agent.movement, agent.crosswalk)
        for agent in graph.agents
    }
    edges = sorted(
        (edge.type, *(sorted(ends, key=str) if edge.type in _SYMMETRIC else ends))
        for edge in graph.relations
        for ends in ([str(ways[edge.from_]), str(ways[edge.to])],)
    )
    objects = [(o.kind, o.leg, o.side, o.hides, o.encounter) for o in graph.objects]
    return sorted(map(str, ways.values())), edges, objects, graph.context.model_dump()


_SYMMETRIC = ("collide_at", "near_miss")


def _offer(learned: LearnedPlan, site: Site) -> Refusal:
    """A refusal that quotes the doubtful words, with plain sentences that would be understood."""
    offers = tuple(islice(_list_sentences(learned, site), MOST_OFFERS))
    doubtful = _find_doubtful(learned.reading)
    words = f"'{doubtful[0].words}' says" if doubtful else "the text says"
    hint = f"{_OFFERS}{' or '.join(repr(offer) for offer in offers)}?" if offers else ""
    unmade = [s for s in getattr(learned.plan, "said", ()) if s.became == "nothing" and s.note]
    if isinstance(learned.plan, Refusal):
        reason = learned.plan.reason + hint
        return Refusal(code=learned.plan.code, reason=reason, did_you_mean=offers)
    reason = f"It is not clear what {words}; say it in other words."
    if unmade:
        reason = f"'{unmade[0].words}' cannot be part of a scene: {unmade[0].note}."
    return Refusal(code="out_of_scope", reason=reason + hint, did_you_mean=offers)


def _list_sentences(learned: LearnedPlan, site: Site) -> Iterator[str]:
    """What the text may mean, likeliest first, each once and only if it would be understood."""
    known: set[str] = set()
    text = learned.reading.text
    others = (plan_reading(each, site, "").plan for each in _read_otherwise(learned.reading))
    forms = _read_in_other_forms(learned, site) if len(text) <= LONGEST_READ_AGAIN else ()
    happens = any(span.tag in EVENTS and not span.negated for span in learned.reading.spans)
    for plan_ in islice(chain((learned.plan,), forms, others), MOST_TRIED):
        if isinstance(plan_, Refusal) or (happens and not plan_.relations):
            continue
        if plan_.agents or plan_.context != SceneContext():
            sentence = describe_graph(plan_)
            if len(sentence.split()) >= LONGEST_OFFER:
                sentence = _shorten(sentence)
            if sentence not in known and len(sentence.split()) < LONGEST_OFFER:
                again = read_plan(sentence, site=site)
                if is_same_plan(again.plan, plan_) and is_sure(again, site):
                    yield sentence
            known.add(sentence)


_INTRODUCES = re.compile(
    r"(?:There is )?(?P<who>An? [\w -]+?|[A-Za-z-]+ \d)"
    r"(?: comes (?P<from>from the \w+))?(?: and)?"
    r"(?: (?P<does>turns (?:left|right)|goes straight|makes a U-turn|jaywalks|crosses)"
    r"(?P<where>(?: (?:on|from) the [\w ]+)*))?",
    re.IGNORECASE,
)
_DOING = {"turns": "turning", "goes": "going", "makes": "making", "crosses": "crossing"}


def _shorten(sentences: str) -> str:
    """Shorten sentences: the way of a road user is put into the first event that names it."""
    events: list[str] = []
    about: dict[str, str] = {}
    for each in sentences.rstrip(".").split(". "):
        found = _INTRODUCES.fullmatch(each)
        if found is not None and found["does"] != "jaywalks":
            verb, _, rest = (found["does"] or "").partition(" ")
            where = (found["where"] or "").strip()
            doing = None if where.startswith("on ") else _DOING.get(verb)
            own = (found["from"], doing, rest, where)
            who = found["who"][:1].lower() + found["who"][1:]
            about[re.sub("^an? ", "the ", who)] = " ".join((who, *filter(None, own)))
            continue
        event = each
        for name in [n for n in about if re.search(rf"\b{n}\b", event, re.IGNORECASE)]:
            event = re.sub(rf"\b{name}\b", about.pop(name), event, count=1, flags=re.IGNORECASE)
        events.append(event[:1].upper() + event[1:])
    return ". ".join((*events, *(f"There is {each}" for each in about.values()))) + "."


_DOUBTFUL_SPANS = 2
_NO_MATTER = ("manner", "ref", "pace")


def _find_doubtful(reading: Reading) -> list[ReadSpan]:
    """The least certain spans that matter for a plan, the least certain first."""
    spans = [span for span in reading.spans if span.tag not in _NO_MATTER]
    return sorted(spans, key=lambda span: span.confidence)[:_DOUBTFUL_SPANS]


def _read_otherwise(reading: Reading) -> Iterator[Reading]:
    """Readings in which one doubtful span is left out, turned round or said of another agent."""
    introducing = set(reading.users.values())
    for span in _find_doubtful(reading):
        at = reading.spans.index(span)
        if at in introducing:
            continue
        if span.tag in EVENTS and span.objects and span.subjects:
            yield _replace_span(
                reading, at, replace(span, subjects=span.objects, objects=span.subjects)
            )
        elif len(span.subjects) == 1:
            for user in reading.users:
                if user not in span.subjects:
                    yield _replace_span(reading, at, replace(span, subjects=(user,)))
        if span.negated:
            yield _replace_span(reading, at, replace(span, negated=False))
        yield _replace_span(reading, at, replace(span, tag="manner", subjects=(), objects=()))


def _replace_span(reading: Reading, at: int, span: ReadSpan) -> Reading:
    spans = (*reading.spans[:at], replace(span, confidence=1.0), *reading.spans[at + 1 :])
    return replace(reading, spans=spans)
