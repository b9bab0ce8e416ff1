"""Stage 3, waypoint filter: constraint program and the surviving combination (paper 3.3)."""

from __future__ import annotations

from typing import Any, TypedDict

from langgraph.runtime import Runtime

from scenewright.backends import Question
from scenewright.nodes.ask import ask, latest
from scenewright.nodes.context import RunContext
from scenewright.nodes.waypoint_filter.reply import (
    ProgramReply,
    on_the_ground,
    refuse_strangers,
    refuse_unserved,
)
from scenewright.nodes.waypoint_filter.wording import worded_program
from scenewright.scene.candidates import CandidateSet
from scenewright.scene.constraints import ConstraintProgram
from scenewright.scene.frozen_agents import FrozenAgents
from scenewright.scene.rejection import Rejection
from scenewright.scene.selection import Selection
from scenewright.scene.social import SocialGraph
from scenewright.tools.solver.select import select

_STRICT_ATTEMPTS = 4


class FilterReads(TypedDict):
    """Channels read."""

    instruction: str
    social_graph: SocialGraph
    candidates: CandidateSet
    pinned: FrozenAgents | None
    rejections: list[Rejection]


class FilterWrites(TypedDict):
    """Channels written."""

    constraints: ConstraintProgram
    selection: Selection


def filter_waypoints(state: FilterReads, *, runtime: Runtime[RunContext]) -> FilterWrites:
    """Asks for the constraint program and solves it."""
    context = runtime.context
    rejections = state.get("rejections", [])
    program = _asked(state, context)
    selection = select(
        program,
        state["candidates"],
        map_areas=context.ground,
        rng=context.rng("waypoint_filter", rejections),
        mode=context.selection,
        lenient=len(rejections) >= _STRICT_ATTEMPTS,
        frozen=state.get("pinned"),
    )
    tried = int(selection.figures["tuples"])
    context.tell("waypoint_filter", f"combination {tried} survives, nll {selection.nll:.1f} nats")
    return {"constraints": program, "selection": selection}


def _asked(state: FilterReads, context: RunContext) -> ConstraintProgram:
    """The program that the backend gives, and what goes without saying."""
    instruction, pool = state["instruction"], state["candidates"]
    if not pool.cast.routes:  # nobody is named of whom anything could be said
        return on_the_ground(ConstraintProgram(), pool)
    facts = _facts(instruction, state["social_graph"], pool)
    told = _told(state.get("rejections", []))
    question = Question(
        task="constraints",
        facts=facts,
        rejections=told,
        seed=context.seed,
        wording=lambda: worded_program(
            facts,
            [leg.name for leg in context.intersection.legs],
            left_hand=context.intersection.left_hand_traffic,
            rejections=told,
            examples=context.recall("constraints", instruction),
        ),
        account=context.account,
    )
    program = ask(context.backend, question, ProgramReply, stage="waypoint_filter").read()
    refuse_strangers(program, pool)
    refuse_unserved(program, facts["relations"])
    return on_the_ground(program, pool)


def _told(rejections: list[Rejection]) -> tuple[str, ...]:
    """What was wrong with the program. That a sample did not serve is no fault of it, unless one
    of its clauses never held."""
    return tuple(
        each.detail
        for each in latest(rejections, "waypoint_filter")
        if each.code in ("malformed_program", "malformed_reply") or each.missed is not None
    )


def _facts(instruction: str, graph: SocialGraph, pool: CandidateSet) -> dict[str, Any]:
    played = pool.cast.patterns
    return {
        "instruction": instruction,
        "told": [
            {"id": name, "movement": route.movement} for name, route in pool.cast.routes.items()
        ],
        "agents": [
            {"id": name, "type": draws.route.type, "movement": draws.route.movement}
            for name, draws in pool.agents.items()
        ],
        "relations": [
            graph.relations[each.edge].model_dump(mode="json", by_alias=True)
            | {"pattern": each.pattern, "from": each.from_, "to": each.to}
            | {"striker": graph.relations[each.edge].from_, "struck": graph.relations[each.edge].to}
            for each in played
        ],
        "violators": sorted(
            {each.violator for each in played if each.violator}
            | {agent.id for agent in graph.agents if agent.runs_red}
        ),
    }
