"""The learned reading of an instruction as a plan with its account of words."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from itertools import pairwise

from scenewright.backends.builtin.draft import Draft, Refused, Site
from scenewright.backends.builtin.graph_making import (
    finish_draft,
    make_graph,
    name_agents,
    place_impacts,
)
from scenewright.backends.builtin.impacts import read_impacts
from scenewright.backends.builtin.phrases import Phrase, play_phrase
from scenewright.backends.builtin.read_objects import (
    ReadObject,
    add_read_objects,
    take_out_objects,
)
from scenewright.backends.builtin.reader.annotation import EVENTS, MENTIONS, SEPARATOR
from scenewright.backends.builtin.reader.groups import count_plurals, join_groups
from scenewright.backends.builtin.reader.interpret import interpret
from scenewright.backends.builtin.reader.interpretation import Interpretation
from scenewright.backends.builtin.reader.manoeuvres import correct_manoeuvres
from scenewright.backends.builtin.reader.orders import orient_orders
from scenewright.backends.builtin.reader.reactions import read_reactions
from scenewright.backends.builtin.reader.reading import Reading, ReadSpan, read_text
from scenewright.backends.builtin.reader.words import (
    WORDS,
    Patterns,
    find_nouns,
)
from scenewright.backends.builtin.scope import build_nothing_planned
from scenewright.scene.account import SaidSpan
from scenewright.scene.edits import still_holds
from scenewright.scene.social import Plan, SocialGraph

_PATTERNS = Patterns("learned_plan")

_FUNCTION_WORDS = frozenset(WORDS["merging"]["function_words"])

_SURELY = 0.95


def merge_mentions(reading: Reading) -> Reading:
    """The reading with mentions of one road user made one: "the oncoming", "truck"."""
    reading = _drop_function_words(reading)
    reading = replace(reading, spans=tuple(_read_axes(reading)))
    reading = replace(reading, spans=tuple(map(_correct_class, reading.spans)))
    reading = replace(reading, spans=tuple(_let_ride(span, reading) for span in reading.spans))
    for kept, dropped in list(_find_same(reading)):
        if kept in reading.users and dropped in reading.users:
            reading = _merge(reading, kept, dropped)
    return reading


def refer_back(reading: Reading, end: int) -> Reading:
    """The reading of a change in which "the car" or "car 2" is the one that is there.

    Args:
        end: where the sentences of what is there end.
    """
    known = {
        re.sub(r"^(?:an?|the) ", "", reading.spans[at].words.lower()): user
        for user, at in reading.users.items()
        if reading.spans[at].start < end
    }
    for user, at in list(reading.users.items()):
        span = reading.spans[reading.users.get(user, at)]
        noun = span.words.lower().removeprefix("the ")
        definite = span.words.lower() != noun or noun[-1].isdecimal()
        if span.start >= end and definite and noun in known and len(span.subjects) == 1:
            reading = _merge(reading, known[noun], user)
    return reading


def _read_axes(reading: Reading) -> Iterator[ReadSpan]:
    """The spans, with "east-west" as a way from the one side to the other."""
    yield from reading.spans[:1]
    for before, span in pairwise(reading.spans):
        between = reading.text[before.end : span.start].strip()
        axis = before.tag == span.tag == "from" and {before.value, span.value} == {None}
        if axis and between in ("-", "/", "–") and before.subjects == span.subjects:
            yield replace(span, tag="to", confidence=max(span.confidence, _SURELY))
        else:
            yield span


def _correct_class(span: ReadSpan) -> ReadSpan:
    """The mention as one of a rider where its noun can be nothing else."""
    kinds = {noun.kind for noun in find_nouns(span.words)} if span.tag == "veh" else set()
    tag = {"cyclist": "cyc", "scooter": "scoot"}.get("".join(kinds))
    return replace(span, tag=tag, confidence=max(span.confidence, _SURELY)) if tag else span


def _let_ride(span: ReadSpan, reading: Reading) -> ReadSpan:
    """A crosswalk said right after the rider who opens the text, or who alone could be on it, is
    where that one rides."""
    riders = [each for each in reading.spans if each.tag in ("cyc", "scoot")]
    before = [
        rider
        for rider in riders
        if rider.end <= span.start
        and _PATTERNS.on_the.fullmatch(reading.text[rider.end : span.start])
    ]
    if span.tag not in ("cw", "cross") or len(before) != 1 or len(before[0].subjects) != 1:
        return span
    walkers = [each for each in reading.spans if each.tag == "ped" and each.start < span.start]
    if any(n in span.subjects for each in walkers for n in each.subjects):
        return span
    sure = max(span.confidence, _SURELY)
    return replace(span, subjects=before[0].subjects, objects=(), confidence=sure)


def _drop_function_words(reading: Reading) -> Reading:
    """The reading without spans of "at", "of the" and the like, which say nothing alone."""
    kept = [
        at
        for at, span in enumerate(reading.spans)
        if span.names_user or set(span.words.lower().split()) - _FUNCTION_WORDS
    ]
    return reading.select_spans(kept)


def _find_same(reading: Reading) -> Iterator[tuple[int, int]]:
    """Pairs of road users that are one, the one that is kept first."""
    single = {
        user: reading.spans[at]
        for user, at in reading.users.items()
        if len(reading.spans[at].subjects) == 1
    }
    text, spans = reading.text, reading.spans
    for user, span in single.items():
        # A mention without a noun, and the one of its class right behind it: "through", "vehicle".
        for other, later in single.items():
            beside = span.end < later.start and not text[span.end : later.start].strip(" -")
            if beside and span.tag == later.tag and not find_nouns(span.words):
                yield other, user
        # An article alone, and the next mention: "a jaywalking pedestrian".
        later_users = [
            u
            for u in (single if _PATTERNS.article.fullmatch(span.words) else ())
            if 0 <= single[u].start - span.end <= _MOST_BETWEEN
            and re.fullmatch(r"[\w' -]*", text[span.end : single[u].start])
            and not any(e.tag in EVENTS and span.end <= e.start < single[u].start for e in spans)
        ]
        if later_users:
            yield min(later_users, key=lambda u: single[u].start), user


_MOST_BETWEEN = 40
"""Characters between an article and the noun that it belongs to."""


def _merge(reading: Reading, kept: int, dropped: int) -> Reading:
    """The reading without one road user, whose spans now belong to another."""
    first, second = reading.spans[reading.users[kept]], reading.spans[reading.users[dropped]]
    spans = tuple(_renumber_span(span, kept, dropped) for span in reading.spans)
    at_kept, at_dropped = reading.users[kept], reading.users[dropped]
    gone = replace(second, tag="ref", value=None, subjects=(kept,))
    if second.end <= first.start and not reading.text[second.end : first.start].strip(" -"):
        whole = reading.text[second.start : first.end]
        first = replace(first, words=whole, start=second.start)
    spans = tuple(
        gone if at == at_dropped else first if at == at_kept else span
        for at, span in enumerate(spans)
    )
    users = {user: at for user, at in reading.users.items() if user != dropped}
    return replace(reading, spans=spans, users=users)


def _renumber_span(span: ReadSpan, kept: int, dropped: int) -> ReadSpan:
    if span.tag in MENTIONS:
        return span

    def renumber_users(users: tuple[int, ...]) -> tuple[int, ...]:
        return tuple(dict.fromkeys(kept if user == dropped else user for user in users))

    subjects = renumber_users(span.subjects)
    objects = tuple(user for user in renumber_users(span.objects) if user not in subjects)
    return replace(span, subjects=subjects, objects=objects)


@dataclass(frozen=True)
class LearnedPlan:
    """A plan, what it was made of, and how sure the reading is.

    Attributes:
        objects: what stands in the text, which is part of the plan.
        confidence: the least probability of a choice that the plan rests on; 0 where a change
            changes nothing.
        users: number of a road user in the reading -> id of its agent.
    """

    plan: Plan
    reading: Reading
    confidence: float
    objects: tuple[ReadObject, ...] = ()
    phrases: tuple[Phrase, ...] = ()
    users: Mapping[int, str] = field(default_factory=dict)


def read_plan(
    text: str,
    *,
    previous: str | None = None,
    site: Site | None = None,
    phrases: tuple[Phrase, ...] = (),
    changes: bool = False,
) -> LearnedPlan:
    """The plan that the encoder reads in a text (paper 3.1, SEMANTICS 2-4 and 8).

    Args:
        phrases: verbs of the text that stand for phrases of relation files.
        changes: the text is known to change the previous one, whatever it looks like.
    """
    if changes and previous is not None:
        joint = replace(read_text(text, previous=previous), kind="edit")
        reading = refer_back(joint, len(previous))
    else:
        reading = _read(text, previous)
    return plan_reading(reading, site or Site(), text, phrases)


OPENERS = ("Show me this: ", "ok so ")
"""Words before a text that change nothing in what it asks for."""


def read_again(
    text: str, opener: str, *, site: Site | None = None, phrases: tuple[Phrase, ...] = ()
) -> LearnedPlan:
    """The plan that the encoder reads in a text after an opener, with places as in the text.

    A reading that the encoder is sure of comes out the same; one that hangs by a thread does not.
    """
    reading = read_text(opener + text)
    cut = len(opener)
    kept = [at for at, span in enumerate(reading.spans) if span.start >= cut]
    reading = reading.select_spans(kept)
    spans = tuple(replace(s, start=s.start - cut, end=s.end - cut) for s in reading.spans)
    return plan_reading(replace(reading, text=text, spans=spans), site or Site(), text, phrases)


def plan_reading(
    whole: Reading, site: Site, text: str, phrases: tuple[Phrase, ...] = ()
) -> LearnedPlan:
    """The plan that follows from a reading by rule."""
    reading, objects = take_out_objects(whole)
    reading = count_plurals(join_groups(merge_mentions(reading)))
    reading = read_reactions(correct_manoeuvres(reading))
    reading = orient_orders(reading)
    confidence = _compute_confidence(reading, objects)
    try:
        interpretation = interpret(reading, site)
        draft = _settle(interpretation, text)
        offset = reading.text.find(SEPARATOR) + len(SEPARATOR) if reading.kind == "edit" else 0
        for phrase in phrases:
            _play_phrase(phrase, reading, interpretation, offset)
        finished = finish_draft(draft)
        names = name_agents(finished.agents)
        said = interpretation.build_account(names, offset)
        graph = make_graph(finished)
        graph = graph.model_copy(update={"said": tuple(_match_plan(e, graph) for e in said)})
        users = {n: names[a] for n, a in interpretation.users.items() if a in names}
        plan: Plan = add_read_objects(graph, objects, users) if objects else graph
    except Refused as verdict:
        return LearnedPlan(verdict.to_refusal(), reading, confidence, objects, phrases)
    return LearnedPlan(plan, reading, confidence, objects, phrases, users)


def _play_phrase(
    phrase: Phrase, reading: Reading, interpretation: Interpretation, offset: int
) -> None:
    """Give the event that is read at a phrase the pattern of the phrase's relation file.

    Raises:
        Refused: the phrase cannot be said of these two.
    """
    start, end = phrase.start + offset, phrase.end + offset
    spans = (s for s in reading.spans if s.start < end and start < s.end and s.objects)
    for span in spans:
        ends = [interpretation.users.get(n) for n in (*span.subjects[:1], *span.objects[:1])]
        relations = interpretation.draft.relations
        theirs = [
            relation for relation in relations if relation.from_ in ends and relation.to in ends
        ]
        if any(each.type == "near_miss" for each in theirs):  # "and nearly hits it"
            for collision in [each for each in theirs if each.type == "collide_at"]:
                theirs.remove(collision)
                relations.remove(collision)
        for relation in theirs:
            play_phrase(relation, phrase, interpretation.draft.site)


def _compute_confidence(reading: Reading, objects: tuple[ReadObject, ...]) -> float:
    """The least probability of a choice that the plan rests on."""
    spans = [span.confidence for span in reading.spans if span.tag not in ("manner", "ref")]
    spans += [span.confidence for each in objects for span in each.list_spans()]
    if is_no_change(reading):
        return 0.0
    return min([reading.kind_confidence, *spans])


def is_no_change(reading: Reading) -> bool:
    """Whether nothing is read in the words that are to change an earlier instruction."""
    cut = reading.text.find(SEPARATOR)
    return reading.kind == "edit" and not any(span.start > cut for span in reading.spans)


def _match_plan(entry: SaidSpan, graph: SocialGraph) -> SaidSpan:
    """An entry as the graph has it, where one event of two agents overrules another."""
    if entry.became == "relation":
        edges = [edge for edge in graph.relations if edge.pair == set(entry.agents)]
        types = [edge.type for edge in edges]
        if entry.value not in types:
            update = {"value": types[0]} if types else {"became": "manner", "value": None}
            return entry.model_copy(update=update)
    elif entry.became == "order" and not still_holds(entry, graph):
        return entry.model_copy(update={"became": "manner"})
    elif entry.became == "cause" and all(edge.cause != entry.value for edge in graph.relations):
        return entry.model_copy(update={"became": "manner", "value": None})
    return entry


def _read(text: str, previous: str | None) -> Reading:
    """The reading of a text alone, or of the change that it makes to a previous one."""
    alone = read_text(text)
    if previous is None or not previous.strip() or _stands_alone(alone, previous):
        return alone
    joint = read_text(text, previous=previous)
    changes = any(span.start > len(previous) for span in joint.spans)
    kind = "edit" if changes or joint.kind == "edit" else joint.kind
    return Reading(joint.text, kind, joint.kind_confidence, joint.spans, joint.users)


def _stands_alone(reading: Reading, previous: str) -> bool:
    """Whether a text introduces two road users to one another, or is in another language."""
    if reading.kind == "foreign":
        return True
    mentions = [reading.spans[at].words for at in reading.users.values()]
    return (
        len(reading.users) >= 2
        and any(span.tag in EVENTS and span.subjects and span.objects for span in reading.spans)
        and not any(_is_known(words, previous) for words in mentions)
    )


def _is_known(words: str, previous: str) -> bool:
    """Whether a mention is of an agent of an earlier instruction: "he", "the van" after "a van"."""
    if _PATTERNS.pronoun.fullmatch(words):
        return True
    noun = re.fullmatch(r"(?:the|that|this) (?:\w+ )*?(\w+)", words, re.IGNORECASE)
    return noun is not None and re.search(rf"\b{noun[1]}\b", previous, re.IGNORECASE) is not None


def _settle(interpretation: Interpretation, text: str) -> Draft:
    """Nothing is planned without an agent, an event or a context; impacts are placed."""
    draft = interpretation.draft
    context = draft.context
    said = draft.agents or draft.normal or draft.denied or context.density or context.time_of_day
    if not said and context.vehicles is None and context.pedestrians is None:
        raise build_nothing_planned()
    impacts = read_impacts(re.sub(r"(?<!driver)(?<!passenger)['’]s ", "  ", text.lower()))
    place_impacts(draft, impacts)
    return draft
