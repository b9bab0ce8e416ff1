"""Stage 4, event reasoner: event summary and behavior program (paper 3.4, Eq. 5)."""

from __future__ import annotations

from typing import Any, TypedDict

from langgraph.runtime import Runtime

from scenewright.backends import Question
from scenewright.nodes.ask import ask, latest
from scenewright.nodes.context import RunContext
from scenewright.nodes.event_reasoner.reply import (
    SUMMARY,
    BehaviorReply,
    SummaryReply,
    check_segments,
    places_of,
)
from scenewright.nodes.event_reasoner.wording import bound, worded_behavior, worded_summary
from scenewright.scene.behavior import BehaviorProgram, EventSummary
from scenewright.scene.candidates import CandidateSet
from scenewright.scene.frozen_agents import FrozenAgents
from scenewright.scene.grounding import RoleAssignment
from scenewright.scene.rejection import Rejection
from scenewright.scene.relations import get_pattern
from scenewright.scene.selection import Selection
from scenewright.tools.event_summary import summarise, to_facts


class ReasonerReads(TypedDict):
    """Channels read."""

    instruction: str
    candidates: CandidateSet
    selection: Selection
    pinned: FrozenAgents | None
    rejections: list[Rejection]


class ReasonerWrites(TypedDict):
    """Channels written."""

    summary: EventSummary
    behavior: BehaviorProgram


def reason_events(state: ReasonerReads, *, runtime: Runtime[RunContext]) -> ReasonerWrites:
    """Summarises the selected priors and asks which segments realise the relations."""
    context = runtime.context
    summary = summarise(state["selection"], map_areas=context.ground)
    owed = _owed(state["candidates"].cast)
    seen = _summarised(summary, owed, state, context)
    program = _as_before(_reasoned(summary, seen, owed, state, context), state)
    for agent in summary.agents:
        check_segments(agent, program.segments.get(agent.agent), owed.get(agent.agent, []))
    stops = sum(s.status == "stop" for each in program.segments.values() for s in each)
    context.tell("event_reasoner", f"{stops} stops among {len(program.segments)} agents")
    return {"summary": summary, "behavior": program}


def _summarised(
    summary: EventSummary, owed: dict[str, list[str]], state: ReasonerReads, context: RunContext
) -> EventSummary:
    """The summary that is reasoned on: of those whom relations bind, the places that matter."""
    agents = bound(summary, owed)
    if not agents:
        return summary
    instruction, relations = state["instruction"], _relations(state["candidates"].cast)
    told = tuple(each for each in _told(state, context) if each.startswith(SUMMARY))
    question = Question(
        task="summary",
        facts={
            "instruction": instruction,
            **to_facts(summary.model_copy(update={"agents": agents})),
        },
        rejections=told,
        seed=context.seed,
        wording=lambda: worded_summary(instruction, summary, owed, relations, rejections=told),
        account=context.account,
    )
    reply = ask(context.backend, question, SummaryReply, stage="event_reasoner", of=SUMMARY)
    return summary.keep_places(places_of(reply.anchors, agents))


def _reasoned(
    summary: EventSummary,
    seen: EventSummary,
    owed: dict[str, list[str]],
    state: ReasonerReads,
    context: RunContext,
) -> BehaviorProgram:
    """The segments; without a relation there is nothing to reason on."""
    if not bound(summary, owed):
        return BehaviorReply(segments={}).read(summary)
    instruction, relations = state["instruction"], _relations(state["candidates"].cast)
    told = tuple(each for each in _told(state, context) if not each.startswith(SUMMARY))
    facts: dict[str, Any] = {"instruction": instruction, "owed": owed, **to_facts(seen)}
    question = Question(
        task="behavior",
        facts=facts,
        rejections=told,
        seed=context.seed,
        wording=lambda: worded_behavior(
            instruction,
            seen,
            owed,
            relations,
            rejections=told,
            examples=context.recall("behavior", instruction),
        ),
        account=context.account,
    )
    reply = ask(context.backend, question, BehaviorReply, stage="event_reasoner")
    return reply.read(summary)


def _told(state: ReasonerReads, context: RunContext) -> tuple[str, ...]:
    """Why the last segments were refused, here or by the verifier; none after a fresh sample.

    Once the budget is spent every refusal leads to a fresh sample (graph/routes.py), of which
    nothing has been said yet.
    """
    found = latest(state.get("rejections", []), "event_reasoner", "scene_verifier")
    if found and sum(each.stage == found[-1].stage for each in state["rejections"]) > (
        context.budgets.reasoner
    ):
        return ()
    return tuple(each.detail for each in found)


def _relations(cast: RoleAssignment) -> list[str]:
    return [
        f"{each.from_} {get_pattern(each.pattern).relation} {each.to}" for each in cast.patterns
    ]


def _as_before(program: BehaviorProgram, state: ReasonerReads) -> BehaviorProgram:
    """The program in which those who stay as they were do what they did."""
    pins = state.get("pinned")
    if pins is None or pins.earlier.duration != state["selection"].duration:
        return program  # a longer scene has more of everybody to tell
    kept = {name: pins.earlier.agents[name].segments for name in pins.same}
    here = {name: each for name, each in kept.items() if name in program.segments}
    return program.model_copy(update={"segments": {**program.segments, **here}})


def _owed(cast: RoleAssignment) -> dict[str, list[str]]:
    """By agent: the statuses that the files of its relations want among its segments."""
    owed: dict[str, list[str]] = {}
    for played in cast.patterns:
        pattern = get_pattern(played.pattern)
        for name, role in ((played.from_, pattern.from_), (played.to, pattern.to)):
            known = owed.setdefault(name, [])
            known += [status for status in role.segments if status not in known]
    return owed
