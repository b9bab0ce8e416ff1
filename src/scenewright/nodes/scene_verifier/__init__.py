"""The gate: the relation checker decides on the final tracks (paper 4.3, A.2)."""

from __future__ import annotations

from typing import Any, NotRequired, TypedDict

from scenewright.backends import get_backend_of_task
from scenewright.errors import Rejected
from scenewright.memory.state import Tracks
from scenewright.nodes.context import RunContext, Runtime
from scenewright.nodes.remaining import close_account, quote_words, refuse_words
from scenewright.nodes.scene_verifier.assemble import assemble
from scenewright.scene.account import AccountEntry
from scenewright.scene.behavior import BehaviorProgram
from scenewright.scene.candidates import CandidateSet
from scenewright.scene.digest import digest_scene
from scenewright.scene.events import Finding, Proof
from scenewright.scene.frozen_agents import FrozenAgents
from scenewright.scene.kinds import has_trait
from scenewright.scene.phrasing import describe_graph
from scenewright.scene.record import SceneRecord
from scenewright.scene.refinement import Refinement
from scenewright.scene.rejection import Rejection, RejectionCode
from scenewright.scene.remaining import AddedClauses, AddedStops
from scenewright.scene.selection import Selection
from scenewright.scene.social import SocialGraph
from scenewright.tools.account import prove
from scenewright.tools.relation_checker import check

REDRAWN = ("sequence", "stop", "braking", "order", "cause", "crossing", "side centre")
"""Types of claims that hold of some samples of a plan and not of others."""
SERVED = ("constraint", "behavior", "measure")
"""What the stages after the planner serve words as; a sample may miss it by a little."""


def find_unshown_words(
    proof: Proof, scene: SceneRecord, state: Any, context: RunContext
) -> Rejection | None:
    """The rejection for words that are not shown or contradicted; None where there is none.

    A model is shown the words once and may plan again. What another sample may show is sampled
    again; all else is refused.
    """
    others = [each for each in proof.missing if each.rule != "word_contradicted"]
    if others or proof.interference or proof.implausible or proof.signal_violations:
        return None
    false = proof.list_words("contradicted")
    unshown = () if context.lenient else proof.list_words("not_shown")
    if not (false or unshown):
        return None
    detail = f"the scene shows nothing of {quote_words((*false, *unshown))}"
    if all(_may_be_redrawn(each, scene) for each in (*false, *unshown)):
        return Rejection(stage="scene_verifier", code="relation_not_realised", detail=detail,
                         repairable=False)  # fmt: skip
    asked = any(each.code == "words_not_shown" for each in state.get("rejections", ()))
    planned = state.get("planned") is not None
    if not (asked or planned or get_backend_of_task(context.backend, "plan").deterministic):
        ask = f"{detail}; plan what they say, or note them in said as constraint or behavior, or "
        ask += "answer refused: out_of_scope"
        return Rejection(stage="scene_verifier", code="words_not_shown", detail=ask)
    if false:
        graph = describe_graph(state["social_graph"])
        return Rejection(
            stage="scene_verifier",
            code="out_of_scope",
            detail="The scene would show something else than "
            f"{quote_words((*false, *unshown))}: the text was read as '{graph}' Say it in other "
            "words, or with more of who does what to whom.",
        )
    return refuse_words(unshown, state["social_graph"], "scene_verifier")


def _may_be_redrawn(word: AccountEntry, scene: SceneRecord) -> bool:
    """Whether another sample of the same plan may show a word."""
    served = any(
        each.became in SERVED and each.start < word.end and word.start < each.end
        for each in scene.said
    )
    if word.state == "not_shown":
        return served
    claim = word.claim or ""
    if claim.startswith("movement"):  # one that turns may turn earlier
        ways = claim.removeprefix("movement ").split("/")
        return any(agent.movement in ways for agent in scene.agents if agent.role == "foreground")
    walks = any(agent.type == "pedestrian" for agent in scene.agents if agent.role == "foreground")
    if walks and claim in ("tie left", "tie right"):  # no plan ties where walkers come from
        return True
    return served or claim.startswith(REDRAWN) or claim.endswith("to a stop")


def find_wrong_braker(graph: SocialGraph, scene: SceneRecord, proof: Proof) -> Rejection | None:
    """`wrong_braker`, if the plan has another agent brake than the tracks, or the hints do.

    Only another plan can mend that: the solver and the reasoner do as the plan says.
    """
    names = {agent.id: agent.name for agent in scene.agents}
    for edge, relation in zip(graph.relations, scene.relations, strict=True):
        if not has_trait("cause", relation.cause, "late"):
            continue
        pair = {relation.from_, relation.to}
        hinted = (
            min(pair.intersection(each.agents))
            for each in scene.said
            if each.became == "cause" and len(pair.intersection(each.agents)) == 1
        )
        meant = next(hinted, relation.cause_agent)
        for event in proof.events:
            seen = event.evidence.get("late_brake")
            same = event.type == relation.type and {event.from_, event.to} == pair
            if same and seen is not None and meant is not None and seen != meant:
                return Rejection(
                    stage="scene_verifier",
                    code="wrong_braker",
                    agents=(edge.from_, edge.to),
                    detail=f"{edge.type} of {edge.from_} and {edge.to}: {names[seen]} brakes in "
                    f"the scene, the plan has {names[meant]} do so; write cause {relation.cause} "
                    f"and as braker who brakes{_HINTS.get(edge.type, '')}",
                    repairable=False,
                )
    return None


_HINTS = {"collide_at": ", in a collision the one that strikes (from), or leave out late_brake"}


_SYMMETRIC = ("collision", "near_miss")


class VerifierReads(TypedDict):
    """Channels read."""

    instruction: str
    social_graph: SocialGraph
    candidates: CandidateSet
    selection: Selection
    behavior: BehaviorProgram
    edited: Tracks
    refined: Tracks
    refinement: NotRequired[Refinement]
    pinned: FrozenAgents | None
    planned: NotRequired[SocialGraph | None]
    rejections: NotRequired[list[Rejection]]
    added_clauses: NotRequired[AddedClauses]
    added_stops: NotRequired[AddedStops]


class VerifierWrites(TypedDict):
    """Channels written."""

    scene: SceneRecord
    proof: Proof


def verify_scene(state: VerifierReads, *, runtime: Runtime) -> VerifierWrites:
    """Assembles the scene and proves it, or says with evidence why it is none."""
    context = runtime.context
    scene = _assemble(state, state["refined"], context)
    proof = prove(scene, context.intersection)
    words = find_unshown_words(proof, scene, state, context)
    if not proof.verified or words is not None:
        misplanned = find_wrong_braker(state["social_graph"], scene, proof)
        fault = misplanned or words or _build_rejection(proof, scene)
        mendable = fault.repairable and _can_refining_less_mend(state, context)
        raise Rejected(fault.model_copy(update={"repairable": mendable}))
    context.log("scene_verifier", f"{proof.verdict}: {len(proof.events)} events")
    scene = add_events(scene, proof)
    return {"scene": scene, "proof": proof.model_copy(update={"scene_digest": digest_scene(scene)})}


def _assemble(state: VerifierReads, tracks: Tracks, context: RunContext) -> SceneRecord:
    """Assemble the scene with these tracks."""
    # The social graph, its account with what later stages made of the words left to them.
    graph = state["social_graph"]
    clauses = state.get("added_clauses", AddedClauses())
    stops = state.get("added_stops", AddedStops())
    return assemble(
        state["instruction"],
        graph.model_copy(update={"said": close_account(graph.said, clauses, stops)}),
        state["candidates"],
        state["selection"],
        state["behavior"],
        tracks,
        intersection_map=context.intersection,
        seed=context.seed,
        pins=state.get("pinned"),
    )


def _can_refining_less_mend(state: VerifierReads, context: RunContext) -> bool:
    """Return whether the tracks are a scene unrefined; looked at where they are refused first."""
    refinement = state.get("refinement")
    if refinement is None or not refinement.may_retry or refinement.attempt > 1:
        return True
    pins = state.get("pinned")
    # Not all that were to stay as they were are in the scene: the solver may leave some out.
    frozen = pins.same if pins else frozenset()
    same = {name: track for name, track in state["refined"].items() if name in frozen}
    unrefined = _assemble(state, {**state["edited"], **same}, context)
    return check(unrefined, context.intersection).verified


def add_events(scene: SceneRecord, proof: Proof) -> SceneRecord:
    """The scene with the events that the proof found; a normal scene says so in one row.

    Symmetric events name their agents in the order in which they were asked for.
    """
    from scenewright.scene.record import EventRecord

    asked = {(relation.type, relation.from_, relation.to) for relation in scene.relations}
    rows = []
    for event in proof.events:
        row = event.model_dump(by_alias=True, include=set(EventRecord.model_fields))
        if event.type in _SYMMETRIC and (event.type, event.to, event.from_) in asked:
            row |= {"from": event.to, "to": event.from_}
        rows.append(EventRecord.model_validate(row))
    if not rows:
        row = {"type": "normal", "from": None, "to": None, "time": None, "location": None}
        rows = [EventRecord.model_validate(row)]
    return scene.model_copy(update={"events": tuple(rows)})


def _build_rejection(proof: Proof, scene: SceneRecord) -> Rejection:
    """The first fault, weightiest kind first, and all agents of any fault."""
    kinds: tuple[tuple[RejectionCode, tuple[Finding, ...]], ...] = (
        ("relation_not_realised", proof.missing),
        ("background_interferes", proof.interference + proof.signal_violations),
        ("implausible_motion", proof.implausible),
    )
    names = {agent.id: agent.name for agent in scene.agents}
    every = [each for _, findings in kinds for finding in findings for each in finding.agents]
    agents = tuple(dict.fromkeys(names.get(each, str(each)) for each in every))
    for code, findings in kinds:
        if findings:
            first = findings[0]
            named = (f"{agent} is {names[agent]}" for agent in first.agents if agent in names)
            detail = (
                f"{first.rule}: {first.detail} ({'; '.join([f'{len(findings)} such', *named])})"
            )
            return Rejection(stage="scene_verifier", code=code, agents=agents, detail=detail)
    return Rejection(
        stage="scene_verifier", code="relation_not_realised", detail="the scene is not verified"
    )
