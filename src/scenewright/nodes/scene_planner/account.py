"""The account of words of a language model's plan: located, completed, asked for again."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from itertools import chain

from scenewright.backends import Question
from scenewright.errors import Rejected
from scenewright.scene.account import Became, SaidSpan, format_background
from scenewright.scene.measures import format_measure
from scenewright.scene.rejection import Rejection
from scenewright.scene.social import SocialGraph

UNSAID = "said leaves out"
"""How the rejection of an incomplete account begins."""

_UNPLANNED = ("nothing", "constraint", "behavior")
"""What words became that no field of the plan holds."""

_CONTENT = re.compile(
    r"\b(?:\d[\w.:/%]*|not|no|never|nobody|none|neither|nor|without|n't|both|either|each|every|all|"
    r"only|several|two|three|four|five|six|seven|eight|nine|ten|eleven|twelve)\b",
    re.IGNORECASE,
)
"""Numbers, negations and quantifiers: words that no account may leave out."""


def complete_account(plan: SocialGraph, question: Question) -> tuple[SaidSpan, ...]:
    """The account of a model's plan, with the words that it leaves out.

    A model that gives no account at all is not asked for one: the words that nothing in a scene
    can express, or that are left to later stages, are then those in which the offline planner
    sees such a thing.

    Raises:
        Rejected: `malformed_reply`, once, for an account that leaves out a number, a negation, a
            quantifier or words that nothing in a scene can express, or that calls words a part
            of the plan which the plan lacks.
    """
    text = str(question.facts["instruction"])
    located = tuple(_locate(plan.said, text))
    said = tuple(chain.from_iterable(_fill_values(each, plan) for each in located))
    read = tuple(_leave_to_a_stage(each, plan) for each in _read_offline(question))
    if not located:
        kept = (each for each in read if each.became in ("manner", *_UNPLANNED))
        return tuple(_keep_known_agents(plan, each) for each in kept)
    left_out = [
        *(
            _build_left_out(each.start, each.end, each.words)
            for each in said
            if each.value == _LACKING
        ),
        *_find_uncovered_content(text, said),
        *_find_uncovered_spans(read, said, plan),
    ]
    said = tuple(each for each in said if each.value != _LACKING)
    if left_out and not any(UNSAID in each for each in question.rejections):
        words = ", ".join(f"'{each.words}'" for each in left_out)
        raise _build_rejection(f"{UNSAID} {words}; add what they became, or nothing")
    return tuple(sorted((*said, *left_out), key=lambda each: each.start))


def _locate(said: Sequence[SaidSpan], text: str) -> Iterator[SaidSpan]:
    """The entries with their places in the text, each after the one before where that is so.

    Words that the text does not hold are no account of it.
    """
    low, at = text.lower(), 0
    for each in said:
        words = each.words.lower()
        start = low.find(words, at)
        start = low.find(words) if start < 0 else start
        if start < 0:
            continue
        at = start
        yield each.model_copy(update={"start": start, "end": start + len(words)})


def _fill_values(entry: SaidSpan, plan: SocialGraph) -> Iterator[SaidSpan]:
    """The entry with its value, which a model leaves to the plan; one for each agent or relation.

    Where the plan has no such value, it is `_LACKING`.
    """
    agents = [each for each in plan.agents if not entry.agents or each.id in entry.agents]
    found: list[tuple[tuple[str, ...], str | None]]
    match entry.became:
        case _ if entry.value is not None:
            found = [(entry.agents, entry.value)]
        case "entry" | "exit" | "movement" | "crosswalk" | "motion" | "reaction":
            given = [each for each in agents if getattr(each, entry.became) is not None]
            found = [((each.id,), getattr(each, entry.became)) for each in given]
        case "runs_red":
            found = [((each.id,), None) for each in agents if each.runs_red]
        case "relation":
            found = [
                ((edge.from_, edge.to), edge.type)
                for edge in plan.relations
                if {edge.from_, edge.to}.issuperset(entry.agents)
            ]
        case "order":
            found = [
                ((first, edge.to if first == edge.from_ else edge.from_), None)
                for edge in plan.relations
                if {edge.from_, edge.to}.issuperset(entry.agents)
                and (first := edge.get_first()) is not None
            ]
        case "manoeuvre":
            found = [
                ((edge.from_, edge.to), edge.manoeuvre)
                for edge in plan.relations
                if edge.manoeuvre and {edge.from_, edge.to}.issuperset(entry.agents)
            ]
        case "time_of_day":
            time = plan.context.time_of_day
            found = [] if time is None else [((), time)]
        case "measure" if plan.measures:
            about = [m for m in plan.measures if {m.agent, m.other} & {a.id for a in agents}]
            found = [(entry.agents, "; ".join(map(format_measure, about)) or None)]
        case "background" if (counts := plan.context.background) is not None:
            found = [((), format_background(counts.model_dump(exclude_none=True)))]
        case "density":
            found = [((), plan.context.density)]
        case _:
            stands = entry.became in ("object", "sight")
            found = _list_objects(entry, plan) if stands else [(entry.agents, None)]
    for names, value in found or [(entry.agents, _LACKING)]:
        yield entry.model_copy(update={"agents": names, "value": value})


def _list_objects(entry: SaidSpan, plan: SocialGraph) -> list[tuple[tuple[str, ...], str | None]]:
    """A parked object, or the agent that it hides and from which agent."""
    if entry.became == "object":
        return [((), f"{each.id} {each.kind}") for each in plan.objects]
    hiding = [each for each in plan.objects if each.hides is not None]
    return [((str(each.hidden_from), str(each.hides)), each.id) for each in hiding]


_LACKING = "?"
"""The value of an entry that the plan has no part for."""


def _find_uncovered_content(text: str, said: Sequence[SaidSpan]) -> Iterator[SaidSpan]:
    for match in _CONTENT.finditer(text):
        if not any(each.start <= match.start() < each.end for each in said):
            yield _build_left_out(match.start(), match.end(), match[0])


def _find_uncovered_spans(
    read: Sequence[SaidSpan], said: Sequence[SaidSpan], plan: SocialGraph
) -> Iterator[SaidSpan]:
    """Words that no field of a plan holds, as the offline planner sees it, and no entry covers."""
    for each in read:
        overlaps = any(other.start < each.end and each.start < other.end for other in said)
        if each.became == "nothing" and not overlaps:
            yield _build_left_out(each.start, each.end, each.words)
        elif each.became in _UNPLANNED and not overlaps:
            yield _keep_known_agents(plan, each)


def _leave_to_a_stage(entry: SaidSpan, plan: SocialGraph) -> SaidSpan:
    """A figure that the offline planner reads and the plan lacks is left to a later stage."""
    value = entry.value or ""
    if entry.became != "measure" or " in [" not in value:
        return entry
    if set(value.split("; ")) <= {format_measure(each) for each in plan.measures}:
        return entry
    became: Became = "behavior" if value.startswith(_IN_BEHAVIOR) else "constraint"
    return entry.model_copy(update={"became": became, "value": None})


_IN_BEHAVIOR = ("wait(", "braking(", "acceleration(")
"""Figures that the event reasoner may serve; clauses may serve the others."""


def _keep_known_agents(plan: SocialGraph, entry: SaidSpan) -> SaidSpan:
    """The entry of another reading, with those of its agents that the plan names alike."""
    known = {agent.id for agent in plan.agents}
    return entry.model_copy(update={"agents": tuple(n for n in entry.agents if n in known)})


def _build_left_out(start: int, end: int, words: str) -> SaidSpan:
    note = "the plan says nothing of it"
    return SaidSpan(start=start, end=end, words=words, became="nothing", note=note)


def _read_offline(question: Question) -> tuple[SaidSpan, ...]:
    from scenewright.backends.offline import read_account

    return read_account(question.facts)


def _build_rejection(detail: str) -> Rejected:
    return Rejected(Rejection(stage="scene_planner", code="malformed_reply", detail=detail))
