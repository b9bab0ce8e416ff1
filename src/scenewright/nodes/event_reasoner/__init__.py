"""Stage 4, event reasoner: event summary and behavior program (paper 3.4, Eq. 5).

Summary and segments follow from the selection and are written by rule. The backend is asked only
for words that name a way of moving, once a run: the standstills that it adds outlast a failed
sample.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NotRequired, TypedDict

from scenewright.backends import Question
from scenewright.errors import Rejected
from scenewright.nodes.ask import ask, list_latest_rejections
from scenewright.nodes.context import RunContext, Runtime
from scenewright.nodes.event_reasoner.prompts import render_stops_prompt
from scenewright.nodes.event_reasoner.reply import (
    SegmentReply,
    StopsReply,
    chain_segments,
    check_segments,
    check_track,
)
from scenewright.nodes.remaining import (
    Left,
    is_last_answer,
    leave_all,
    list_remaining,
    list_word_facts,
    refuse_unrealised,
)
from scenewright.scene.behavior import BehaviorProgram, EventSummary
from scenewright.scene.candidates import CandidateSet
from scenewright.scene.frozen_agents import FrozenAgents
from scenewright.scene.rejection import Rejection
from scenewright.scene.relations import get_pattern
from scenewright.scene.remaining import AddedStops
from scenewright.scene.selection import Selection
from scenewright.scene.social import SocialGraph
from scenewright.tools.added_stops import place_stops
from scenewright.tools.event_summary import summarise, to_facts


class ReasonerReads(TypedDict):
    """Channels read; the last one when a sample with it has failed."""

    instruction: str
    social_graph: SocialGraph
    candidates: CandidateSet
    selection: Selection
    pinned: FrozenAgents | None
    rejections: list[Rejection]
    added_stops: NotRequired[AddedStops]


class ReasonerWrites(TypedDict):
    """Channels written; the selection with the standstills that words ask for."""

    added_stops: AddedStops
    selection: Selection
    summary: EventSummary
    behavior: BehaviorProgram


def reason_events(state: ReasonerReads, *, runtime: Runtime) -> ReasonerWrites:
    """Summarises the selected priors and writes the segments that realise the relations."""
    context = runtime.context
    added, selection = _add_stops(state, context)
    summary = summarise(selection, map_areas=context.ground)
    program = _keep_frozen_segments(summary.suggest_segments(), state)
    return _write_channels(added, selection, summary, program, state, context)


def edit_segments(
    segments: Mapping[str, Sequence[SegmentReply]],
    state: ReasonerReads,
    *,
    runtime: Runtime,
) -> ReasonerWrites:
    """The same with segments that an agent has written itself, checked against the tracks."""
    context, selection = runtime.context, state["selection"]
    summary = summarise(selection, map_areas=context.ground)
    own = chain_segments(segments, summary)
    program = BehaviorProgram(segments={**summary.suggest_segments().segments, **own})
    for agent in summary.agents:
        if agent.agent in own:
            check_track(agent, own[agent.agent], selection.agents[agent.agent], selection.duration)
    return _write_channels(AddedStops(), selection, summary, program, state, context)


def _write_channels(
    added: AddedStops,
    selection: Selection,
    summary: EventSummary,
    program: BehaviorProgram,
    state: ReasonerReads,
    context: RunContext,
) -> ReasonerWrites:
    owed: dict[str, list[str]] = {}  # statuses that the files of its relations want of an agent
    for played in state["candidates"].cast.patterns:
        pattern = get_pattern(played.pattern)
        for name, role in ((played.from_, pattern.from_), (played.to, pattern.to)):
            known = owed.setdefault(name, [])
            known += [status for status in role.segments if status not in known]
    for agent in summary.agents:
        check_segments(agent, program.segments.get(agent.agent), owed.get(agent.agent, []))
    stops = sum(s.status == "stop" for each in program.segments.values() for s in each)
    context.log("event_reasoner", f"{stops} stops among {len(program.segments)} agents")
    return {
        "added_stops": added, "selection": selection, "summary": summary, "behavior": program,
    }  # fmt: skip


def _add_stops(state: ReasonerReads, context: RunContext) -> tuple[AddedStops, Selection]:
    """The standstills of the remaining words, as known from an earlier sample or asked for, placed.

    Raises:
        Rejected: with `kept` where another sample may serve them, else the backend may mend it;
            `out_of_scope`: words stay unserved, and leaving them out is not allowed.
    """
    graph, rejections = state["social_graph"], state.get("rejections", [])
    left = list_remaining(graph, "behavior")
    if not left:
        return AddedStops(), state["selection"]
    known = state.get("added_stops")
    try:
        asked = known or _ask_for_stops(left, state, context)
        added, selection = _place(asked, state, context, known=known is not None)
    except Rejected as error:
        if not error.rejection.repairable or not is_last_answer(
            context.backend, "behavior", rejections, budget=context.budgets.reasoner
        ):
            raise
        added = AddedStops(unserved=leave_all(left, error.rejection.detail))
        selection = state["selection"]
    if not context.lenient:
        refuse_unrealised(graph, added.unserved, "event_reasoner")
    return added, selection


def _place(
    added: AddedStops, state: ReasonerReads, context: RunContext, *, known: bool
) -> tuple[AddedStops, Selection]:
    """The standstills on these tracks.

    Raises:
        Rejected: with the answer kept where these tracks have no room, but others may have.
    """
    try:
        return place_stops(added, state["selection"], map_areas=context.ground)
    except Rejected as error:
        if not known and error.rejection.repairable:
            raise
        rejection = error.rejection.model_copy(update={"repairable": False})
        raise Rejected(rejection, kept={"added_stops": added}) from error


def _ask_for_stops(left: list[Left], state: ReasonerReads, context: RunContext) -> AddedStops:
    rejections = tuple(
        rejection.detail
        for rejection in list_latest_rejections(state.get("rejections", []), "event_reasoner")
    )
    summary = summarise(state["selection"], map_areas=context.ground)
    front = state["candidates"].cast.routes
    agents = tuple(agent for agent in summary.agents if agent.agent in front)
    seen = summary.model_copy(update={"agents": agents})
    segments = seen.suggest_segments().model_dump(mode="json")["segments"]
    facts: dict[str, Any] = {
        "instruction": state["instruction"],
        "words": list_word_facts(left, state["social_graph"]),
        "relations": [
            f"{pattern.from_} {get_pattern(pattern.pattern).relation} {pattern.to}"
            for pattern in state["candidates"].cast.patterns
        ],
        "segments": segments,
        **to_facts(seen),
    }
    question = Question(
        task="behavior",
        facts=facts,
        rejections=rejections,
        seed=context.seed,
        prompt=lambda: render_stops_prompt(facts, seen, rejections=rejections),
        account=context.account,
    )
    reply = ask(context.backend, question, StopsReply, stage="event_reasoner")
    return reply.read([entry for entry, _ in left], agents)


def _keep_frozen_segments(program: BehaviorProgram, state: ReasonerReads) -> BehaviorProgram:
    """The program in which unchanged agents act as before."""
    pins = state.get("pinned")
    if pins is None or pins.earlier.duration != state["selection"].duration:
        return program  # a longer scene has more of each agent
    kept = {name: pins.earlier.agents[name].segments for name in pins.same}
    here = {name: each for name, each in kept.items() if name in program.segments}
    return program.model_copy(update={"segments": {**program.segments, **here}})
