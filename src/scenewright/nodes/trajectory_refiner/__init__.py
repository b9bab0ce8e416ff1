"""Stage 5, trajectory refiner: edited priors, then learned refinement (paper 3.5, Eq. 6-7).

Refined tracks that the verifier refuses come back here. The agents it named are then supervised
more strongly, then drawn anew, and last left on the edited prior, which the solver's proof holds
for. A figure that is refused twice leaves the agents that it names on their priors at once; refused
a third time, or on the last attempt of the budget, all agents are.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, NotRequired, TypedDict

import numpy as np

from scenewright.geometry.driving_profile import Motion, sample_track
from scenewright.memory.state import Tracks
from scenewright.nodes.context import RunContext, Runtime
from scenewright.nodes.trajectory_refiner.guides import build_guides
from scenewright.nodes.trajectory_refiner.spacing import find_crowded
from scenewright.scene.base import RIDERS, FloatArray
from scenewright.scene.behavior import BehaviorProgram, EventSummary
from scenewright.scene.frozen_agents import FrozenAgents
from scenewright.scene.refinement import AgentRefinement, Refinement
from scenewright.scene.rejection import Rejection
from scenewright.scene.selection import Selection
from scenewright.scene.track import Track
from scenewright.tools.segment_editor import compute_edited_motion

if TYPE_CHECKING:
    from scenewright.tools.trajnet_refiner.guided import Guide

NOT_ASKED = "the edited priors are final, no learned model ran"
NO_WEIGHTS = "there are no weights of a refiner that serve this intersection: " + NOT_ASKED
NOT_TRAINED = "the network was not trained on its class"
NO_WALKERS = "drawn from real walkers; the network has not shown that it knows more of them"
SHARES = (1.0, 0.5, 0.5, 0.25, 0.0)
"""Largest share of the proposed deviation that an agent gets, by how often it was refused."""
DRAWN_ANEW = 2
"""Refusals at which an agent is drawn anew, among the others as they are."""


class RefinerReads(TypedDict):
    """Channels read; the last four when tracks come back from the verifier."""

    selection: Selection
    summary: EventSummary
    behavior: BehaviorProgram
    pinned: FrozenAgents | None
    rejections: list[Rejection]
    refused: NotRequired[Rejection | None]
    rolled: NotRequired[Mapping[str, FloatArray]]
    refinement: NotRequired[Refinement]


class RefinerWrites(TypedDict):
    """Channels written."""

    edited: Tracks
    refined: Tracks
    rolled: Mapping[str, FloatArray]
    refinement: Refinement


def refine_trajectories(state: RefinerReads, *, runtime: Runtime) -> RefinerWrites:
    """Edits every selected prior by its segments, and refines what came of it."""
    motions, edited = _edit_motions(state)
    refiner = runtime.context.learned
    if refiner is None or not motions:
        note = NOT_ASKED if runtime.context.refiner == "none" else NO_WEIGHTS
        runtime.context.log("trajectory_refiner", f"{len(edited)} tracks, refiner none")
        return {
            "edited": edited, "refined": _keep_frozen_tracks(edited, state), "rolled": {},
            "refinement": Refinement(refiner="none", note=note),
        }  # fmt: skip
    # What was tried before with these very tracks; None where they are new.
    earlier, most = state.get("refinement"), runtime.context.budgets.refiner
    before = earlier if state.get("refused") is not None else None
    last = before is not None and (before.attempt >= most or _has_recurred(state, 3))
    agents, rolled, refined = _refine_motions(
        motions, edited, before, state, runtime.context, last=last
    )
    kept = sum(agent.reason is not None for agent in agents.values())
    note = f"{len(agents) - kept} refined, {kept} kept as edited"
    if refiner.place not in ("", runtime.context.intersection.name):
        note += f", with the weights of {refiner.place}: there are none of its own"
    ran = Refinement(
        refiner="trajnet",
        note=note,
        weights=refiner.digest,
        attempt=1 if before is None else most + 1 if last else before.attempt + 1,
        retries=(0 if earlier is None else earlier.retries) + (before is not None),
        agents=agents,
    )
    runtime.context.log("trajectory_refiner", f"{len(refined)} tracks, {ran.note}")
    return {
        "edited": edited, "refined": _keep_frozen_tracks(refined, state), "rolled": rolled,
        "refinement": ran,
    }  # fmt: skip


def _edit_motions(state: RefinerReads) -> tuple[dict[str, Motion], dict[str, Track]]:
    """The prior of each agent seen in the scene, edited by its segments, and its track."""
    selection, program = state["selection"], state["behavior"]
    anchors = {
        agent.agent: {anchor.id: anchor.s for anchor in agent.anchors}
        for agent in state["summary"].agents
    }
    motions = {
        name: compute_edited_motion(
            agent, program.segments[name], anchors[name], duration=selection.duration
        )
        for name, agent in selection.agents.items()
    }
    tracks = {name: _sample_scene_track(name, motion, state) for name, motion in motions.items()}
    seen = {name: track for name, track in tracks.items() if track is not None}
    return {name: motions[name] for name in seen}, seen


def _sample_scene_track(name: str, motion: Motion, state: RefinerReads) -> Track | None:
    selection = state["selection"]
    return sample_track(motion, enters=selection.agents[name].enters, until=selection.duration)


def _keep_frozen_tracks(tracks: Tracks, state: RefinerReads) -> Tracks:
    """The tracks, those of an earlier version that shall stay bit for bit as they were."""
    pins = state.get("pinned")
    if pins is None or pins.earlier.duration != state["selection"].duration:
        return tracks  # a longer scene shows more of each agent
    same = {name: pins.earlier.agents[name].track for name in pins.same}
    return {name: same.get(name, track) for name, track in tracks.items()}


def _has_recurred(state: RefinerReads, times: int) -> bool:
    """Whether so many refinements were refused for one figure: then the prior has the fault."""
    details = [each.detail for each in state["rejections"][-times:]]
    return len(details) == times and len({*details}) == 1


def _refine_motions(
    motions: dict[str, Motion],
    edited: Mapping[str, Track],
    before: Refinement | None,
    state: RefinerReads,
    context: RunContext,
    *,
    last: bool,
) -> tuple[dict[str, AgentRefinement], dict[str, FloatArray], dict[str, Track]]:
    """The treatment of each agent, the deviations proposed, and the tracks that result."""
    from scenewright.tools.trajnet_refiner.kinematic_layer import limit_deviation

    named, recurs = _list_refused_agents(state), before is not None and _has_recurred(state, 2)
    refusals = dict.fromkeys(motions, 0)  # while these tracks were tried
    if before is not None:
        earlier = {name: each.refusals for name, each in before.agents.items()}
        refusals = {n: earlier.get(n, 0) + (n in named or not named) for n in motions}
    guides = build_guides(motions, state["selection"], state["behavior"])
    even = _list_unpredicted(guides, context)
    rolled = _roll_out_agents(guides, refusals, before, state, context) | even
    agents: dict[str, AgentRefinement] = {}
    tracks: dict[str, Track] = {}
    shares = {name: SHARES[min(refusals[name], len(SHARES) - 1)] for name in guides}
    shares |= {n: 0.0 for n in guides if last or n in even or (n in named and recurs)}
    ripples = _draw_ripples(guides, state, context)
    shapes = {name: each.candidate.shape for name, each in state["selection"].agents.items()}

    def refine(name: str) -> None:
        guide, most = guides[name], shares[name]
        s, share = limit_deviation(
            guide.s, rolled[name], kept=guide.kept, path=guide.path, kind=guide.kind, most=most,
            ripple=ripples.get(name), steady=guide.steady,
        )  # fmt: skip
        track = _sample_scene_track(name, replace(motions[name], s=s), state)
        tracks[name] = edited[name] if track is None or most == 0.0 else track
        free = ~guide.kept & guide.is_within(state["selection"].duration)
        taken, refused = share[free], state.get("refused")
        reason = None
        if len(taken) and most == 0.0 and refused is not None:
            reason = f"refused {refusals[name]} times, last: {refused.detail}"
        elif len(taken) and not taken.any():
            reason = "no share of what the network proposed keeps the limits"
        mean = round(float(taken.mean()), 3) if len(taken) else 0.0
        agents[name] = AgentRefinement(share=mean, refusals=refusals[name], reason=reason)

    changed = list(guides)
    while changed:
        for name in changed:
            refine(name)
        # Who would come too close to another gets less, as both keep their distance unrefined.
        crowded = find_crowded(tracks, edited, shapes, changed)
        changed = [name for name in guides if name in crowded and shares[name] > 0.0]
        shares |= {name: max(each for each in SHARES if each < shares[name]) for name in changed}
    for name in guides:
        if state["selection"].agents[name].candidate.shape.type in RIDERS:
            agents[name] = agents[name].model_copy(update={"reason": NOT_TRAINED})
        elif name in even:
            agents[name] = agents[name].model_copy(update={"share": 0.0, "reason": NO_WALKERS})
    return agents, rolled, tracks


def _draw_ripples(
    guides: Mapping[str, Guide], state: RefinerReads, context: RunContext
) -> dict[str, FloatArray]:
    """How the speed of each vehicle ripples, the same however often its tracks are refused."""
    from scenewright.tools.trajnet_refiner.guided import draw_ripple

    shapes = {name: each.candidate.shape for name, each in state["selection"].agents.items()}
    pins = state.get("pinned")
    same = frozenset[str]() if pins is None else pins.same
    return {
        name: draw_ripple(guide.s, context.make_rng(f"ripple of {name}", []))
        for name, guide in guides.items()
        if shapes[name].type == "vehicle" and name not in same
    }


def _list_refused_agents(state: RefinerReads) -> frozenset[str]:
    """Agents that the verifier named last; none if it named none in particular."""
    refused = state.get("refused")
    return frozenset() if refused is None else frozenset(refused.agents)


def _roll_out_agents(
    guides: dict[str, Guide],
    refusals: Mapping[str, int],
    before: Refinement | None,
    state: RefinerReads,
    context: RunContext,
) -> dict[str, FloatArray]:
    """The deviations proposed: as before, except for agents that have to be drawn anew."""
    from scenewright.tools.trajnet_refiner.guided import compute_deviation, compute_deviations

    known = dict(state.get("rolled", {})) if before is not None else {}
    named = _list_refused_agents(state)
    anew = {n for n, count in refusals.items() if count == DRAWN_ANEW and n in named}
    if known and not anew:
        return known
    fixed = {
        name: SHARES[min(refusals[name], len(SHARES) - 1)] * each
        for name, each in known.items()
        if name not in anew
    }
    pins, held = state.get("pinned"), fixed
    if not fixed and pins is not None:  # unchanged agents stay as far ahead of their priors
        was = pins.earlier.agents
        held = {n: compute_deviation(g, was[n].track) for n, g in guides.items() if n in pins.same}
    learned = context.learned
    assert learned is not None  # noqa: S101
    drawn = compute_deviations(
        learned.net,
        guides,
        duration=state["selection"].duration,
        rng=context.make_rng("trajectory_refiner", state.get("rejections", [])),
        fixed=held | _list_unpredicted(guides, context),
    )
    return {name: known[name] if name in fixed else each for name, each in drawn.items()}


def _list_unpredicted(guides: Mapping[str, Guide], context: RunContext) -> dict[str, FloatArray]:
    """Pedestrians that the network may not move, as they are: without any deviation."""
    if context.learned is None or context.learned.walks:
        return {}
    return {n: np.zeros(len(g.s)) for n, g in guides.items() if g.kind == "pedestrian"}
