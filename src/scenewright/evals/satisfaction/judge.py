"""Whether a scene shows what its instruction's label says, and nothing else that is dangerous."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from scenewright.evals.planning import does_time_fit
from scenewright.evals.satisfaction.seen import SeenAgent
from scenewright.scene.events import Event

Label = Mapping[str, Any]
_DIRECTED = frozenset({"yielding", "follow"})
_BACKGROUND_PET = 1.0
"""Agents that the instruction does not name pass one another with more than this [s]."""


@dataclass(frozen=True)
class Submission:
    """One scene as it is judged.

    Attributes:
        agents, events: what the tracks show; time_of_day: HH:MM or a range, None if not given.
        fault: what speaks against the scene whatever it shows, such as words left out.
    """

    agents: Sequence[SeenAgent]
    events: Sequence[Event]
    time_of_day: Any = None
    fault: str | None = None


@dataclass(frozen=True)
class Verdict:
    """What came of one instruction: satisfied, wrong, refused, or rightly_refused; and why."""

    id: str
    outcome: str
    reason: str | None = None


def judge(row: Mapping[str, Any], submission: Submission | None) -> Verdict:
    """One row of the set, {"id", "expected"}, with the scene that was submitted for it."""
    label, name = row["expected"], row["id"]
    if submission is None:
        return Verdict(name, "rightly_refused" if label["refused"] else "refused")
    if label["refused"]:
        return Verdict(name, "wrong", "no scene can show this instruction, yet there is one")
    reason = submission.fault or _find_fault(label, submission)
    return Verdict(name, "satisfied" if reason is None else "wrong", reason)


def _find_fault(label: Label, submission: Submission) -> str | None:
    """Why a scene is not what its label says; None if it is."""
    time = label["context"]["time_of_day"]
    ours = submission.time_of_day
    if time is not None and ours is not None and not does_time_fit(time, ours):
        return f"is at {ours}, not at {time}"
    relations = [each for each in label["relations"] if each["type"] != "normal"]
    missing = "what was asked for does not happen between such agents"
    for bound, pairs in _list_bindings(relations, label, submission, {}, frozenset()):
        named = frozenset(bound.values())
        # What the certificate of no other interaction forbids (SEMANTICS 4).
        stray = [
            event
            for event in submission.events
            if event.type != "follow"
            and _pair(event) not in pairs
            and (
                event.type == "collision"
                or float(event.evidence.get("pet", 0.0)) <= _BACKGROUND_PET
                or _pair(event) & named
            )
        ]
        if stray:
            first = stray[0]
            missing = f"unasked {first.type} of {first.from_} and {first.to} at {first.time:.1f} s"
        elif _has_other_agents(label, submission, bound):
            return None
        else:
            missing = "an agent that was asked for is not there"
    return missing


def _list_bindings(
    relations: Sequence[Mapping[str, Any]],
    label: Label,
    submission: Submission,
    bound: dict[str, int],
    pairs: frozenset[frozenset[int]],
) -> Iterator[tuple[dict[str, int], frozenset[frozenset[int]]]]:
    """Every way of giving the relations' agents to tracks so that each relation is an event."""
    if not relations:
        yield bound, pairs
        return
    first, *rest = relations
    wanted = {each["id"]: each for each in label["agents"]}
    seen = {each.id: each for each in submission.agents}
    for event in submission.events:
        if event.type != first["type"]:
            continue
        ends = [(event.from_, event.to)]
        # Labels name the yielding and the following agent, not always the striking one.
        if event.type not in _DIRECTED:
            ends.append((event.to, event.from_))
        for pair in ends:
            named = dict(zip((first["from"], first["to"]), pair, strict=True))
            both = {**bound, **named}
            # Names and tracks stay one to one.
            if len({*both.values()}) == len(both) and all(
                bound.get(name, n) == n and is_like(wanted[name], seen[n])
                for name, n in named.items()
            ):
                more = pairs | {_pair(event)}
                yield from _list_bindings(rest, label, submission, both, more)


def _pair(event: Event) -> frozenset[int]:
    return frozenset((event.from_, event.to))


def is_like(wanted: Mapping[str, Any], seen: SeenAgent) -> bool:
    """Whether nothing that a track shows contradicts what the label says of an agent."""
    if wanted["type"] != seen.type:
        return False
    if seen.type == "pedestrian":
        leg = wanted["crosswalk"]
        crossing = wanted["movement"] in (None, seen.movement) or seen.movement is None
        return crossing and (leg is None or not seen.crosswalks or leg in seen.crosswalks)
    pairs = ((wanted[key], getattr(seen, key)) for key in ("entry", "exit", "movement"))
    return all(a is None or b is None or a == b for a, b in pairs)


def _has_other_agents(label: Label, submission: Submission, bound: Mapping[str, int]) -> bool:
    """Whether agents without events can be found among the tracks that are left."""
    left = [each for each in submission.agents if each.id not in bound.values()]
    for wanted in label["agents"]:
        if wanted["id"] in bound:
            continue
        found = next((each for each in left if is_like(wanted, each)), None)
        if found is None:
            return False
        left.remove(found)
    return True
