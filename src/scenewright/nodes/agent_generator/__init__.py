"""Stage 2, agent generator: amplified scene and waypoint candidates (paper 3.2, Eq. 1-2)."""

from __future__ import annotations

from typing import NotRequired, TypedDict

from scenewright.errors import Rejected
from scenewright.nodes.context import RunContext, Runtime
from scenewright.scene.candidates import CandidateSet, Grounding
from scenewright.scene.frozen_agents import FrozenAgents
from scenewright.scene.refinement import Refinement
from scenewright.scene.rejection import Rejection
from scenewright.scene.social import SocialGraph
from scenewright.tools.gmm_sampler.frozen_agents import build_candidates_with_frozen
from scenewright.tools.gmm_sampler.generate import amplify, assign_foreground, choose_hour

_KEEPS = 6
"""Samples for which the numbers of background agents stay as drawn."""
_CROWD_DRAWS = 4
"""Candidates of a background agent where the first that has room is taken (`draw`)."""


class GeneratorReads(TypedDict):
    """Channels read."""

    social_graph: SocialGraph
    grounding: Grounding
    pinned: FrozenAgents | None
    rejections: list[Rejection]
    refinement: NotRequired[Refinement]


class GeneratorWrites(TypedDict):
    """Channels written."""

    candidates: CandidateSet


def generate_agents(state: GeneratorReads, *, runtime: Runtime) -> GeneratorWrites:
    """Draws the foreground agents, the number of background agents and M candidates per agent.

    Lawful samples come first; where there can be none, or after as many as the budget has, those in
    which an agent runs a red light unasked.
    """
    context = runtime.context
    lawful = (
        context.lawful
        or count_samples(state.get("rejections", []), state.get("refinement"))
        <= context.budgets.generator
    )
    try:
        return _draw(state, context, lawful=lawful)
    except Rejected as error:
        if context.lawful or error.rejection.code != "unlawful":
            raise
        context.log("agent_generator", error.rejection.detail)
    return _draw(state, context, lawful=False)


def count_samples(rejections: list[Rejection], refinement: Refinement | None) -> int:
    """Count refusals after the planner, each a fresh sample unless it led to refining less."""
    spent = sum(rejection.stage != "scene_planner" for rejection in rejections)
    return spent - (0 if refinement is None else refinement.retries)


def _draw(state: GeneratorReads, context: RunContext, *, lawful: bool) -> GeneratorWrites:
    """One sample: lawful, or with a red light that is run unasked."""
    graph, pins = state["social_graph"], state.get("pinned")
    rejections = state.get("rejections", [])
    rng = context.make_rng("agent_generator", rejections)
    background_size = _CROWD_DRAWS if context.selection == "draw" else None
    if pins is not None:  # around agents of an earlier version
        pool = build_candidates_with_frozen(
            graph,
            state["grounding"],
            pins,
            context.priors,
            intersection_map=context.intersection,
            size=context.draws,
            background_size=background_size,
            rng=rng,
            lawful=lawful,
        )
        context.log("agent_generator", f"{len(pins.same)} agents stay as they were")
        return {"candidates": pool}
    hour = choose_hour(graph.context, context.priors, context.make_rng("agent_generator", []))
    # Fresh numbers after every failure would leave thin streets, where all find room.
    kept = rejections[: len(rejections) // _KEEPS * _KEEPS]
    cast = assign_foreground(
        graph,
        state["grounding"],
        context.priors,
        intersection_map=context.intersection,
        hour=hour,
        rng=rng,
        lawful=lawful,
    )
    pool = amplify(
        graph,
        cast,
        context.priors,
        intersection_map=context.intersection,
        hour=hour,
        size=context.draws,
        background_size=background_size,
        numbers=context.make_rng("background_numbers", kept),
        max_agents=context.max_agents,
        rng=rng,
    )
    wanted = sum(pool.background.values())
    context.log("agent_generator", f"{len(graph.agents)} + {wanted} agents at {hour:.2f} h")
    return {"candidates": pool}
