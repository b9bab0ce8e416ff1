"""Stage 4, event reasoner: event summary and behavior program (paper 3.4, Eq. 5)."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import TypedDict

from langgraph.runtime import Runtime

from scenewright.backends import Question
from scenewright.errors import Rejected
from scenewright.nodes.ask import ask, earlier
from scenewright.nodes.context import RunContext
from scenewright.scene.behavior import AgentSummary, BehaviorProgram, EventSummary, Segment
from scenewright.scene.candidates import CandidateSet
from scenewright.scene.grounding import Cast
from scenewright.scene.rejection import Rejection, RejectionCode
from scenewright.scene.relations import pattern_named
from scenewright.scene.selection import Selection
from scenewright.scene.track import STEP
from scenewright.tools.event_summary import facts_of, summarise


class ReasonerReads(TypedDict):
    """Channels read."""

    instruction: str
    candidates: CandidateSet
    selection: Selection
    rejections: list[Rejection]


class ReasonerWrites(TypedDict):
    """Channels written."""

    summary: EventSummary
    behavior: BehaviorProgram


def reason_events(state: ReasonerReads, *, runtime: Runtime[RunContext]) -> ReasonerWrites:
    """Summarises the selected priors and asks which segments realise the relations."""
    context = runtime.context
    summary = summarise(state["selection"], ground=context.ground)
    owed = _owed(state["candidates"].cast)
    question = Question(
        task="behavior",
        facts={"instruction": state["instruction"], "owed": owed, **facts_of(summary)},
        rejections=earlier(state.get("rejections", []), "event_reasoner"),
    )
    program = ask(context.backend, question, BehaviorProgram, stage="event_reasoner")
    for agent in summary.agents:
        _validate(agent, program.segments.get(agent.agent), owed.get(agent.agent, []))
    stops = sum(s.status == "stop" for each in program.segments.values() for s in each)
    context.tell("event_reasoner", f"{stops} stops among {len(program.segments)} agents")
    return {"summary": summary, "behavior": program}


def _owed(cast: Cast) -> dict[str, list[str]]:
    """By agent: the statuses that the files of its relations want among its segments."""
    owed: dict[str, list[str]] = {}
    for played in cast.patterns:
        pattern = pattern_named(played.pattern)
        for name, role in ((played.from_, pattern.from_), (played.to, pattern.to)):
            known = owed.setdefault(name, [])
            known += [status for status in role.segments if status not in known]
    return owed


def _validate(
    agent: AgentSummary, segments: tuple[Segment, ...] | None, owed: Sequence[str]
) -> None:
    """Every agent has segments that realise its relations, on anchors that exist, in order."""
    if not segments:
        raise _refused("malformed_reply", agent, "has no segments")
    known = {anchor.id for anchor in agent.anchors}
    for segment in segments:
        # A contact is a moment: one may go until it or end at it, but not wait there.
        at_contact = segment.anchor == "contact" and segment.status != "stop"
        if segment.anchor not in known and not at_contact:
            raise _refused("unknown_anchor", agent, f"has no anchor {segment.anchor!r}")
        if segment.end < segment.start:
            raise _refused("times_not_increasing", agent, f"ends before {segment.start:g} s")
        if segment.status == "terminate" and segment.start < max(agent.enters, 0.0) + 2 * STEP:
            raise _refused("times_not_increasing", agent, "ends before it has been seen")
    for before, after in pairwise(segments):
        if after.start < before.end - 1e-6:
            raise _refused("times_not_increasing", agent, f"overlaps at {after.start:g} s")
    statuses = [segment.status for segment in segments]
    for status in owed:
        if status not in statuses and not _excused(status, statuses):
            raise _refused("malformed_reply", agent, f"has no {status}, which its role demands")


def _excused(status: str, statuses: Sequence[str]) -> bool:
    """Who stands to the end never goes on; who stands from the start never went before."""
    if status == "proceed":
        return statuses[-1] in ("stop", "terminate")
    return status == "keep" and statuses[0] == "stop"


def _refused(code: RejectionCode, agent: AgentSummary, what: str) -> Rejected:
    return Rejected(
        Rejection(
            stage="event_reasoner", code=code, agents=(agent.agent,), detail=f"{agent.agent} {what}"
        )
    )
