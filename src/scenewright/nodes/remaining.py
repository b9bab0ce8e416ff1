"""Words that no field of the plan holds: which are left to a stage, and what became of them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, Literal

from scenewright.backends import STAGE_OF, Backend, Task, get_backend_of_task
from scenewright.errors import Rejected
from scenewright.nodes.ask import list_latest_rejections
from scenewright.scene.account import AccountEntry, SaidSpan
from scenewright.scene.phrasing import describe_graph
from scenewright.scene.rejection import Rejection, Stage
from scenewright.scene.remaining import AddedClauses, AddedStops, Unserved
from scenewright.scene.social import SocialGraph
from scenewright.tools.dsl_validator.parse import format_clause

Left = tuple[int, SaidSpan]
"""An entry of the account by its index, and the words."""

OR_LENIENT = ". Allow to leave it out with --lenient, or say: "
"""Between what cannot be shown and a sentence without it, in the refusal of words."""


def list_remaining(graph: SocialGraph, became: Literal["constraint", "behavior"]) -> list[Left]:
    """The words that the plan leaves to a stage."""
    return [(n, each) for n, each in enumerate(graph.said) if each.became == became]


def list_word_facts(left: Sequence[Left], graph: SocialGraph) -> list[dict[str, Any]]:
    """The words as a question has them, numbered from 1, with the agents that there are."""
    known = {agent.id for agent in graph.agents}
    return [
        {
            "number": number,
            "words": each.words,
            "agents": [name for name in each.agents if name in known],
        }
        for number, (_, each) in enumerate(left, start=1)
    ]


def is_last_answer(
    backend: Backend, task: Task, rejections: list[Rejection], *, budget: int
) -> bool:
    """Whether the stage may not ask again: a rule answers alike, and a model has its budget."""
    return (
        get_backend_of_task(backend, task).deterministic
        or len(list_latest_rejections(rejections, STAGE_OF[task])) >= budget
    )


def list_unserved(
    served: Sequence[int], cannot: Sequence[int], entries: Sequence[int], *, stage: Stage, note: str
) -> tuple[Unserved, ...]:
    """The words that a reply does not serve, each of which must stand under `cannot`.

    Args:
        served, cannot: numbers of words, from 1; entries: theirs in the account.
        note: why they are not served.

    Raises:
        Rejected: `malformed_reply`, naming numbers that are missing or that no words have.
    """
    asked, said = set(range(1, len(entries) + 1)), {*served, *cannot}
    if unknown := sorted(said - asked):
        detail = f"words {unknown[0]}: they are numbered from 1 to {len(entries)}"
        raise Rejected(Rejection(stage=stage, code="malformed_reply", detail=detail))
    if missing := sorted(asked - said):
        numbers = ", ".join(map(str, missing))
        detail = f"nothing is said of words {numbers}; serve them, or list them under 'cannot'"
        raise Rejected(Rejection(stage=stage, code="malformed_reply", detail=detail))
    unserved = dict.fromkeys(number for number in cannot if number not in served)
    return tuple(Unserved(entry=entries[number - 1], note=note) for number in unserved)


def leave_all(left: Sequence[Left], note: str) -> tuple[Unserved, ...]:
    """All of the words as unserved, for one reason."""
    return tuple(Unserved(entry=entry, note=note) for entry, _ in left)


def refuse_unrealised(graph: SocialGraph, unserved: Sequence[Unserved], stage: Stage) -> None:
    """Words that nothing in a scene can express are refused, not dropped (SEMANTICS 8).

    Raises:
        Rejected: `out_of_scope`, naming the words and a sentence without them.
    """
    if not unserved:
        return
    named = [
        AccountEntry(
            start=graph.said[each.entry].start,
            end=graph.said[each.entry].end,
            words=graph.said[each.entry].words,
            state="not_shown",
            evidence=each.note,
        )
        for each in unserved
    ]
    raise Rejected(refuse_words(named, graph, stage))


def refuse_words(words: Iterable[AccountEntry], graph: SocialGraph, stage: Stage) -> Rejection:
    """The refusal of words that no scene shows, with a sentence without them."""
    return Rejection(
        stage=stage,
        code="out_of_scope",
        detail=f"This cannot be part of a scene: {quote_words(words)}{OR_LENIENT}"
        f"'{describe_graph(graph)}'",
    )


def quote_words(words: Iterable[AccountEntry]) -> str:
    """The words, each with why it is not shown."""
    return "; ".join(f"'{word.words}' ({word.evidence})" for word in words)


def close_account(
    said: Sequence[SaidSpan], clauses: AddedClauses, stops: AddedStops
) -> tuple[SaidSpan, ...]:
    """The account, with what the words left to later stages became."""
    values: dict[int, list[str]] = {}
    for added in clauses.clauses:
        values.setdefault(added.entry, []).append(format_clause(added.clause))
    for stop in stops.stops:
        if stop.start is not None and stop.until is not None:
            stands = f"{stop.agent} stands {stop.start:.1f}-{stop.until:.1f} s"
            values.setdefault(stop.entry, []).append(stands)
    notes = {each.entry: each.note for each in (*clauses.unserved, *stops.unserved)}
    return tuple(
        each.model_copy(update={"became": "nothing", "note": notes[n]})
        if n in notes
        else each.model_copy(update={"value": "; ".join(values[n])})
        if n in values
        else each
        for n, each in enumerate(said)
    )
