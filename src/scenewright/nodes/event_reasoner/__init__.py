"""Stage 4, event reasoner: event summary and behavior program (paper 3.4, Eq. 5)."""

from __future__ import annotations

from itertools import pairwise
from typing import TypedDict

from langgraph.runtime import Runtime

from scenewright.backends import Question
from scenewright.errors import Rejected
from scenewright.nodes.ask import ask, earlier
from scenewright.nodes.context import RunContext
from scenewright.scene.behavior import AgentSummary, BehaviorProgram, EventSummary, Segment
from scenewright.scene.rejection import Rejection, RejectionCode
from scenewright.scene.selection import Selection
from scenewright.scene.track import STEP
from scenewright.tools.event_summary import facts_of, summarise


class ReasonerReads(TypedDict):
    """Channels read."""

    instruction: str
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
    question = Question(
        task="behavior",
        facts={"instruction": state["instruction"], **facts_of(summary)},
        rejections=earlier(state.get("rejections", []), "event_reasoner"),
    )
    program = ask(context.backend, question, BehaviorProgram, stage="event_reasoner")
    for agent in summary.agents:
        _validate(agent, program.segments.get(agent.agent))
    stops = sum(s.status == "stop" for each in program.segments.values() for s in each)
    context.tell("event_reasoner", f"{stops} stops among {len(program.segments)} agents")
    return {"summary": summary, "behavior": program}


def _validate(agent: AgentSummary, segments: tuple[Segment, ...] | None) -> None:
    """Every agent has segments, on anchors that exist, in order of time."""
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


def _refused(code: RejectionCode, agent: AgentSummary, what: str) -> Rejected:
    return Rejected(
        Rejection(
            stage="event_reasoner", code=code, agents=(agent.agent,), detail=f"{agent.agent} {what}"
        )
    )
