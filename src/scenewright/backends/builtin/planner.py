"""Stage 1 without a language model: two readings of a text, checked against one another."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import chain, islice

from scenewright.backends.builtin.beyond import find_lost_words, note_beyond, refuse_beyond
from scenewright.backends.builtin.chains import add_push, link_collisions, take_out_push
from scenewright.backends.builtin.cut_ins import add_space, read_cut_ins, take_out_space
from scenewright.backends.builtin.draft import Refused, Site
from scenewright.backends.builtin.encounters import add_encounters, take_out_encounters
from scenewright.backends.builtin.grammar_plan import read_by_grammar
from scenewright.backends.builtin.leaders import read_leaders
from scenewright.backends.builtin.normalise import clean, split_tokens
from scenewright.backends.builtin.phrases import has_phrase, is_of_phrase
from scenewright.backends.builtin.plurals import count_plurals
from scenewright.backends.builtin.reader.alternatives import find_doubtful, read_otherwise
from scenewright.backends.builtin.reader.coverage import (
    find_passed_over,
    is_exception_unread,
    is_order_unread,
)
from scenewright.backends.builtin.reader.learned_plan import (
    OPENERS,
    LearnedPlan,
    is_no_change,
    plan_reading,
    read_again,
    read_plan,
)
from scenewright.backends.builtin.reader.negations import compile_negations
from scenewright.backends.builtin.reader.reading import Reading
from scenewright.backends.builtin.scope import check_language, check_text
from scenewright.backends.builtin.standing import add_objects, take_out
from scenewright.backends.builtin.standing_notes import read_notes
from scenewright.backends.builtin.street_names import CompassText, list_compass_texts
from scenewright.backends.builtin.wrong_way import add_wrong_way, take_out_wrong_way
from scenewright.scene.cache import RecentCache
from scenewright.scene.edits import still_holds
from scenewright.scene.measures import MeasureKind
from scenewright.scene.phrasing import describe_graph
from scenewright.scene.relations import load_patterns
from scenewright.scene.social import (
    EntryTie,
    Plan,
    Refusal,
    RelationEdge,
    SceneContext,
    SocialGraph,
)

SURE = 0.6
"""A reading as confident as this stands by itself; chosen on development voices."""

SURE_OF_HARD = 0.9
"""The same for texts that take words back or deny them, which turn a scene round if misread."""

_TAKEN_BACK = re.compile(
    r"\b(?:(?:no|oh),? wait|wait,? no|i mean(?:t)?|scratch that|strike that|ignore that|sorry|"
    r"or rather|actually|make that|correction|other way (?:a)?round|oops|hang on|typo|my bad|"
    r"second thoughts?|should have said|misspoke)\b|[,.] no[,:]",
    re.IGNORECASE,
)
_DENIED = compile_negations("nor", "instead", "all but", "either")
LEAST_SURE = 0.1
"""Below, no plan stands, however often it comes out."""

MOST_OFFERS = 3
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
        return Refusal.model_validate({"code": verdict.code, "reason": verdict.reason})
    if not choices:
        return _plan_once(text, previous, site)
    first = seed % len(choices)
    return _plan_with_streets((*choices[first:], *choices[:first]), previous, site)


def _plan_with_streets(choices: Sequence[CompassText], previous: str | None, site: Site) -> Plan:
    """The plan for the first choice of legs that the map can serve, else the first there is."""
    found = []
    for each in choices:
        made = _plan_once(each.text, previous, site)
        if isinstance(made, SocialGraph) and (site.can_serve is None or site.can_serve(made)):
            return each.restore_plan(made)
        found.append((each, made))
    graphs = (pair for pair in found if isinstance(pair[1], SocialGraph))
    read, plan_ = next(graphs, found[0])
    return read.restore_plan(plan_)


def _plan_once(text: str, previous: str | None, site: Site) -> Plan:
    """The plan of a text; of one refused with plurals in it, that with a number before each."""
    found = _plan_cached(text, previous, site)
    counted = count_plurals(text) if isinstance(found, Refusal) and not previous else None
    if counted is None:
        return found
    made = _plan_cached(counted.text, previous, site)
    # Where nothing happens, plurals say what traffic there is, not who takes part.
    happens = isinstance(made, SocialGraph) and made.relations
    return counted.restore_plan(made) if happens else found


def _plan_cached(text: str, previous: str | None, site: Site) -> Plan:
    asked = text, previous, site
    return _KNOWN.get(asked, load_patterns(), make=lambda: _plan(*asked))


_NO_MORE = ". Nothing else happens."


@dataclass(frozen=True)
class Readings:
    """Both readings of a text.

    Attributes:
        says_a_phrase: the text holds a phrase of a relation file, which only the grammar knows.
    """

    learned: LearnedPlan
    by_grammar: Plan
    says_a_phrase: bool = False


def read_twice(text: str, previous: str | None, site: Site) -> Readings:
    """The learned reading and that of the grammar.

    Raises:
        Refused: blank or oversized text, or control characters.
    """
    check_text(text)
    check_language(text, split_tokens(clean(text)))
    learned = read_plan(text, previous=previous, site=site)
    return Readings(learned, read_by_grammar(text, previous, site), has_phrase(text))


def _plan(text: str, previous: str | None, site: Site) -> Plan:
    """The plan of a text; what the phrases do not know is read by the encoder alone."""
    by_phrases = _plan_by_phrases(text, previous, site)
    refused = isinstance(by_phrases, Refusal)
    if previous is not None:
        return by_phrases
    try:
        check_text(text)
        if has_phrase(text):
            return by_phrases
        check_language(text, split_tokens(clean(text)))
        learned = read_plan(text, site=site)
    except Refused:
        return by_phrases
    if isinstance(learned.plan, Refusal) or not (learned.objects or refused):
        return by_phrases
    if (refused or learned.confidence >= SURE_OF_HARD) and is_unanimous(learned, site):
        return _refuse_lost_words(link_collisions(read_cut_ins(learned.plan)), text)
    offered = refused and learned.objects
    return _offer_with_objects(by_phrases, learned.plan, site) if offered else by_phrases


def _offer_with_objects(refusal: Plan, meant: SocialGraph, site: Site) -> Plan:
    """The refusal with a sentence that says what the encoder reads, objects included."""
    sentence = describe_graph(meant)
    if not isinstance(refusal, Refusal) or not _is_understood(sentence, meant, site):
        return refusal
    reason = f"{_cut_offers(refusal).reason}{_OFFERS}{sentence!r}?"
    return refusal.model_copy(update={"reason": reason, "did_you_mean": (sentence,)})


def _cut_offers(refusal: Refusal) -> Refusal:
    """The refusal without sentences that would be understood."""
    reason = refusal.reason.partition(_OFFERS)[0]
    return refusal.model_copy(update={"reason": reason, "did_you_mean": ()})


def _is_same_with_objects(first: Plan, second: Plan) -> bool:
    """Whether two plans are the same, objects included."""
    if isinstance(first, Refusal) or isinstance(second, Refusal):
        return False
    left, right = (
        [(o.kind, o.leg, o.side, o.hides, o.encounter) for o in each.objects]
        for each in (first, second)
    )
    return left == right and is_same_plan(first, second)


def _refuse_lost_words(graph: SocialGraph, text: str) -> Plan:
    """The graph, or a refusal if it knows nothing of some words of what happens."""
    lost = find_lost_words(graph, text)
    if lost is None:
        return graph
    reason = f"It is not clear what '{lost}' says; say who does it."
    return refuse_beyond(Refusal(code="out_of_scope", reason=reason), text)


def _plan_by_phrases(text: str, previous: str | None, site: Site) -> Plan:
    try:
        check_text(text)
        notes = None if previous else read_notes(text)
        if notes is not None:
            return notes
        single, push = (text, None) if previous else take_out_push(text)
        single, space = (single, None) if previous else take_out_space(single)
        lawful, wrong = take_out_wrong_way(single)
        plain, met = take_out_encounters(lawful)
        rest, standing = take_out(plain)
        earlier = None if previous is None else take_out(take_out_encounters(previous)[0])[0]
        again = () if earlier else _read_after_openers(rest, site)
        readings = read_twice(rest, earlier, site)
        found = decide(readings, site, again)
        taken_out = not earlier and rest.strip() != text.strip()
        if isinstance(found, Refusal) and taken_out and is_unanimous(readings.learned, site):
            found = readings.learned.plan
        if isinstance(found, Refusal) and (met or wrong or _is_motion_alone(readings.learned.plan)):
            # "A car drives" is no scene by itself, but with what it meets or does it is one.
            said = rest.rstrip(" .")
            found = decide(read_twice(f"{said}{_NO_MORE}", earlier, site), site)
            found = _drop_beyond(found, len(said))
        if isinstance(found, Refusal):
            # What stands is in none of the sentences that are offered for the rest.
            return refuse_beyond(_cut_offers(found) if met or standing else found, rest)
        found = add_encounters(found, met, text) if met else found
        found = add_wrong_way(found, wrong, text) if wrong else found
        found = read_leaders(read_cut_ins(found), rest)
        found = add_space(found, space) if space else found
        found = add_push(found, push, text) if push else link_collisions(found)
        found = note_beyond(add_objects(found, standing, text) if standing else found, rest)
        return found if previous else _refuse_lost_words(found, text)
    except Refused as verdict:
        refused = Refusal.model_validate({"code": verdict.code, "reason": verdict.reason})
        return refuse_beyond(refused, text)


def _drop_beyond(plan: Plan, end: int) -> Plan:
    """The plan with the account of the words up to an end alone."""
    if isinstance(plan, Refusal):
        return plan
    return plan.model_copy(update={"said": tuple(each for each in plan.said if each.end <= end)})


def _is_motion_alone(plan: Plan) -> bool:
    """Whether nothing is read but how agents move, such as that one blocks the junction."""
    if isinstance(plan, Refusal) or plan.relations:
        return False
    return all(agent.motion is not None for agent in plan.agents)


def _read_after_openers(text: str, site: Site) -> Iterator[LearnedPlan]:
    """The learned reading after each opener; none of a text so long that it would take seconds."""
    for opener in OPENERS if len(text) <= LONGEST_READ_AGAIN else ():
        try:
            yield read_again(text, opener, site=site)
        except Refused:
            return


def decide(readings: Readings, site: Site, again: Iterable[LearnedPlan] = ()) -> Plan:
    """The plan that both readings agree on, or a confident one; else what might be meant.

    Args:
        again: the learned reading of the same text after some openers, made only if need be.
    """
    learned, other = readings.learned, readings.by_grammar
    if (readings.says_a_phrase or _has_pattern_phrase(other)) and not _is_losing_numbers(
        other, learned
    ):
        return _add_account(_soften_collisions(other, learned.plan), learned)
    if _are_one(learned, other):
        return _fill_plan(learned.plan, other)
    hard = _is_hard(learned.reading.text)
    sure = learned.confidence >= (SURE_OF_HARD if hard else SURE) and not _is_bare(learned.plan)
    if sure and learned.confidence >= SURE_OF_HARD:
        return learned.plan
    seconds = tuple(again)
    for each in seconds if learned.reading.kind == "scene" else ():
        one = not isinstance(other, Refusal) and _are_one(each, other)
        if one and _is_covered(learned.reading, each.reading):
            return _fill_plan(each.plan, other)
    if sure and all(is_same_plan(each.plan, learned.plan) for each in seconds):
        return learned.plan
    return _offer(readings, seconds, site)


def _is_covered(first: Reading, second: Reading) -> bool:
    """Whether a second reading marks all words that the first takes for more than a scene shows."""
    beyond = [each for each in first.spans if each.tag in _BEYOND]
    ends = [(each.start, each.end) for each in second.spans]
    return all(any(a < s.end and s.start < b for a, b in ends) for s in beyond)


_BEYOND = ("place", "act", "thing", "cond", "broken", "weather", "sight", "obj", "other")
"""Tags of words that refuse a text, or that need a place or an object of their own."""


def _is_hard(text: str) -> bool:
    """Whether a text takes words back or denies them, which turn a scene round if misread."""
    return _TAKEN_BACK.search(text) is not None or _DENIED.search(text) is not None


def is_unanimous(learned: LearnedPlan, site: Site) -> bool:
    """Whether a plan comes out whatever harmless words stand around the text.

    The least probability of a mark says little where it is low: of 115 such plans of development
    texts below 0.6 that stood this test 103 were right, of 54 that did not 27.
    """
    text, plan_ = learned.reading.text, learned.plan
    doubtful = learned.confidence < LEAST_SURE or len(text) > LONGEST_READ_AGAIN
    doubtful = doubtful or learned.reading.kind != "scene" or _is_hard(text)
    if doubtful or isinstance(plan_, Refusal) or _is_bare(plan_):
        return False
    return all(_is_same_with_objects(plan_, each) for each in _read_in_other_forms(text, site))


def _read_in_other_forms(text: str, site: Site) -> Iterator[Plan]:
    """Plans of the text after openers, before thanks, and in other capitals."""
    for opener in (*OPENERS, "Scenario - "):
        yield read_again(text, opener, site=site).plan
    capitals = text.lower() if text != text.lower() else text.capitalize()
    for form in (f"{text} Thanks.", capitals):
        yield read_plan(form, site=site).plan


def _are_one(learned: LearnedPlan, other: Plan) -> bool:
    """Whether a learned reading is that of the grammar, and no doubt is left beside it."""
    reading = learned.reading
    if is_no_change(reading):
        return False
    doubtful = learned.confidence < SURE and reading.kind == "scene"
    taken_back = _TAKEN_BACK.search(reading.text) is not None
    doubt = taken_back or _is_refused(learned.plan) or is_order_unread(reading)
    doubt = doubt or is_exception_unread(reading)
    return is_same_plan(learned.plan, other) and not (doubtful and doubt)


def _soften_collisions(plan: Plan, learned: Plan) -> Plan:
    """A collision's phrase beside "nearly hit", of which only the learned reading sees both.

    What it makes of the phrase itself counts for nothing: it does not know the relation files.
    """
    if isinstance(plan, Refusal) or isinstance(learned, Refusal):
        return plan
    misses = [e for e in learned.said if (e.became, e.value) == ("relation", "near_miss")]
    known = {each.id for each in load_patterns()}

    def soften_edge(edge: RelationEdge) -> RelationEdge:
        if edge.type != "collide_at" or not edge.pattern:
            return edge
        said = [each.words for each in misses if set(each.agents) == {edge.from_, edge.to}]
        if all(is_of_phrase(words, edge.pattern) for words in said):
            return edge
        name = edge.pattern.replace("_collision", "_near_miss")
        pattern = name if name in known and name != edge.pattern else None
        return edge.model_copy(update={"type": "near_miss", "kind": None, "pattern": pattern})

    return plan.model_copy(update={"relations": tuple(map(soften_edge, plan.relations))})


def _is_refused(plan: Plan) -> bool:
    return isinstance(plan, Refusal)


def _fill_plan(plan: Plan, other: Plan) -> Plan:
    """The plan with what only the other reading of the same events says: cause, kind, severity."""
    if isinstance(plan, Refusal) or isinstance(other, Refusal):
        return plan
    yellow = any(agent.motion == "passes_yellow" for agent in plan.agents)
    edges = tuple(_fill_edge(edge, other.relations, yellow=yellow) for edge in plan.relations)
    # The grammar takes every speed for that of the impact, and every bound for a number.
    asked = {each.kind for each in plan.measures}
    dropped = [name for name, kinds in _INSTEAD.items() if asked & kinds]
    edges = tuple(
        edge.model_copy(update={name: getattr(own, name) for name in dropped})
        for edge, own in zip(edges, plan.relations, strict=True)
    )
    return plan.model_copy(update={"relations": edges})


_INSTEAD: dict[str, set[MeasureKind]] = {
    "impact_speed": {"speed", "line_speed", "contact_speed"},
    "target_pet": {"pet", "headway", "gap"},
    "target_ttc": {"ttc"},
}
"""Fields of a relation that are not filled in where the other reading has these measures."""


def _fill_edge(edge: RelationEdge, others: Sequence[RelationEdge], *, yellow: bool) -> RelationEdge:
    ends = (edge.type, edge.from_, edge.to)
    same = next((each for each in others if (each.type, each.from_, each.to) == ends), None)
    if same is None:
        return edge
    fields = ("kind", "cause", "target_pet", "target_ttc", "impact_speed", "point_from", "point_to")
    open_ = {name: getattr(same, name) for name in fields if getattr(edge, name) is None}
    if edge.manoeuvre is not None or yellow:  # it says who brakes; yellow is not red
        open_.pop("cause", None)
    return edge.model_copy(update=open_)


def _fill_order(edge: RelationEdge, others: Sequence[RelationEdge]) -> RelationEdge:
    """The edge with the order that only the learned reading sees between the two."""
    pair = {edge.from_, edge.to}
    found = [o.first for o in others if {o.from_, o.to} == pair and o.type == edge.type]
    return edge.model_copy(update={"first": found[0]}) if found and not edge.first else edge


def _is_bare(plan: Plan) -> bool:
    """Whether agents are there, and nothing is said to happen: not even that nothing does.

    Of one agent alone it is enough to say where it goes.
    """
    if isinstance(plan, Refusal) or plan.relations or not plan.agents:
        return False
    ways = any(
        a.entry or a.exit or a.movement or a.crosswalk or a.runs_red or a.motion
        for a in plan.agents
    )
    said = {each.became for each in plan.said}
    return said.isdisjoint(("normal", "denied")) and not (ways and len(plan.agents) == 1)


def _has_pattern_phrase(plan: Plan) -> bool:
    """Whether a text uses the phrase of a relation file, which only the grammar knows."""
    return isinstance(plan, SocialGraph) and any(edge.pattern for edge in plan.relations)


def _is_losing_numbers(plan: Plan, learned: LearnedPlan) -> bool:
    """Whether figures that the learned reading sees are of other agents than the grammar's."""
    if isinstance(plan, Refusal) or isinstance(learned.plan, Refusal):
        return False
    ways = [[(a.id, a.type, a.entry) for a in each.agents] for each in (plan, learned.plan)]
    return bool(learned.plan.measures) and ways[0] != ways[1]


def _add_account(plan: Plan, learned: LearnedPlan) -> Plan:
    """The grammar's plan with as much of the learned account as is true of it."""
    if isinstance(plan, SocialGraph) and isinstance(learned.plan, SocialGraph):
        said = learned.plan.said
        edges = tuple(_fill_order(edge, learned.plan.relations) for edge in plan.relations)
        reactions = {(a.id, a.subtype, a.entry): a.reaction for a in learned.plan.agents}
        nodes = tuple(
            a.model_copy(update={"reaction": reactions.get((a.id, a.subtype, a.entry))})
            for a in plan.agents
        )
        plan = plan.model_copy(update={"agents": nodes, "relations": edges})
        ties = plan.ties or _list_fitting_ties(learned.plan, plan)
        plan = plan.model_copy(update={"measures": learned.plan.measures, "ties": ties})
        held = tuple(e for e in said if e.became != "nothing" and still_holds(e, plan))
        return plan.model_copy(update={"said": held})
    return plan


def _list_fitting_ties(learned: SocialGraph, plan: SocialGraph) -> tuple[EntryTie, ...]:
    """List ties of the learned plan between agents that another plan has, their entries open."""
    alike = {a.id for a in plan.agents for b in learned.agents if (a.id, a.type) == (b.id, b.type)}
    return tuple(
        tie
        for tie in learned.ties
        if {tie.agent, tie.of} <= alike and plan.agent(tie.agent).entry is None
    )


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
    return sorted(map(str, ways.values())), edges, graph.context.model_dump()


_SYMMETRIC = ("collide_at", "near_miss")


def _offer(readings: Readings, again: Sequence[LearnedPlan], site: Site) -> Refusal:
    """A refusal that quotes the doubtful words, with plain sentences that would be understood."""
    reading = readings.learned.reading
    offers = tuple(islice(_list_sentences(readings, again, site), MOST_OFFERS))
    doubtful = find_doubtful(reading)
    passed = find_passed_over(reading)
    words = f"'{doubtful[0].words}' says" if doubtful else "the text says"
    words = f"'{passed[0]}' says" if passed else words
    hint = f"{_OFFERS}{' or '.join(repr(each) for each in offers)}?" if offers else ""
    for refused in (readings.by_grammar, readings.learned.plan):
        if isinstance(refused, Refusal) and not passed:
            return Refusal(code=refused.code, reason=refused.reason + hint, did_you_mean=offers)
    return Refusal(
        code="out_of_scope",
        reason=f"It is not clear what {words}; say it in other words.{hint}",
        did_you_mean=offers,
    )


def _list_sentences(readings: Readings, again: Sequence[LearnedPlan], site: Site) -> Iterator[str]:
    """What the text may mean, likeliest first, each once and only if it would be understood."""
    known: set[str] = set()
    learned = readings.learned
    others = (plan_reading(each, site, "").plan for each in read_otherwise(learned.reading))
    seconds = (each.plan for each in again)
    candidates = chain((learned.plan, *seconds, readings.by_grammar), others)
    for plan in islice(candidates, MOST_TRIED):
        if isinstance(plan, SocialGraph) and (plan.agents or plan.context != SceneContext()):
            sentence = describe_graph(plan)
            if sentence not in known and _is_understood(sentence, plan, site):
                yield sentence
            known.add(sentence)


def _is_understood(sentence: str, meant: SocialGraph, site: Site) -> bool:
    """Whether a sentence would be read as it is meant."""
    if meant.objects:
        return _is_same_with_objects(_plan_by_phrases(sentence, None, site), meant)
    learned, other = read_plan(sentence, site=site), read_by_grammar(sentence, None, site)
    if not is_same_plan(learned.plan, meant):
        return False
    if is_same_plan(other, meant) or learned.confidence >= SURE_OF_HARD:
        return True
    seconds = _read_after_openers(sentence, site)
    return learned.confidence >= SURE and all(is_same_plan(each.plan, meant) for each in seconds)
