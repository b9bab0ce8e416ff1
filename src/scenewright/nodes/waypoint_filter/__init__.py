"""Stage 3, waypoint filter: constraint program and the surviving combination (paper 3.3).

The program that follows from the plan is written by rule. The backend is asked only for words that
no field of the plan holds, once a run: what it adds outlasts a failed sample.
"""

from __future__ import annotations

from typing import Any, NotRequired, TypedDict

from scenewright.backends import Question
from scenewright.errors import Rejected
from scenewright.nodes.ask import ask, list_latest_rejections
from scenewright.nodes.context import RunContext, Runtime
from scenewright.nodes.remaining import (
    Left,
    is_last_answer,
    leave_all,
    list_remaining,
    list_word_facts,
    refuse_unrealised,
)
from scenewright.nodes.waypoint_filter.prompts import render_clauses_prompt
from scenewright.nodes.waypoint_filter.reply import (
    ClausesReply,
    extend_program,
    ground_program,
    refuse_strangers,
    refuse_unserved,
    select_clauses,
)
from scenewright.scene.candidates import CandidateSet
from scenewright.scene.constraints import ConstraintProgram
from scenewright.scene.frozen_agents import FrozenAgents
from scenewright.scene.rejection import Rejection
from scenewright.scene.remaining import AddedClauses
from scenewright.scene.selection import Selection
from scenewright.scene.social import SocialGraph
from scenewright.tools.dsl_validator.parse import format_program, parse
from scenewright.tools.dsl_validator.write import write_program
from scenewright.tools.solver.select import select

_STRICT_ATTEMPTS = 4


class FilterReads(TypedDict):
    """Channels read; the last one when a sample with it has failed."""

    instruction: str
    social_graph: SocialGraph
    candidates: CandidateSet
    pinned: FrozenAgents | None
    rejections: list[Rejection]
    added_clauses: NotRequired[AddedClauses]


class FilterWrites(TypedDict):
    """Channels written."""

    added_clauses: AddedClauses
    constraints: ConstraintProgram
    selection: Selection


def filter_waypoints(state: FilterReads, *, runtime: Runtime) -> FilterWrites:
    """Writes the constraint program, with what the remaining words add, and solves it."""
    facts = _collect_facts(state)
    program = write_program(facts)
    added = _add_clauses(state, facts, program, runtime.context)
    whole = extend_program(program, [clause.clause for clause in added.clauses])
    try:
        return _solve(whole, added, facts, state, runtime.context)
    except Rejected as error:
        raise Rejected(error.rejection, kept={"added_clauses": added}) from error


def solve_program(text: str, state: FilterReads, *, runtime: Runtime) -> FilterWrites:
    """Solves a constraint program that an agent has written itself, in its text form."""
    return _solve(parse(text), AddedClauses(), _collect_facts(state), state, runtime.context)


def _solve(
    program: ConstraintProgram,
    added: AddedClauses,
    facts: dict[str, Any],
    state: FilterReads,
    context: RunContext,
) -> FilterWrites:
    rejections, pool = state.get("rejections", []), state["candidates"]
    refuse_strangers(program, pool)
    refuse_unserved(program, facts["relations"])
    program = ground_program(program, pool)
    selection = select(
        program,
        pool,
        map_areas=context.ground,
        rng=context.make_rng("waypoint_filter", rejections),
        mode=context.selection,
        lenient=len(rejections) >= _STRICT_ATTEMPTS,
        frozen=state.get("pinned"),
        objects=state["social_graph"].objects,
    )
    tried = int(selection.figures["tuples"])
    context.log("waypoint_filter", f"combination {tried} survives, nll {selection.nll:.1f} nats")
    return {"added_clauses": added, "constraints": program, "selection": selection}


def _add_clauses(
    state: FilterReads, facts: dict[str, Any], program: ConstraintProgram, context: RunContext
) -> AddedClauses:
    """The clauses of the remaining words, as known from an earlier sample or asked for.

    Raises:
        Rejected: `malformed_program`, `malformed_reply`: the backend may mend it; `out_of_scope`:
            words stay without a clause, and leaving them out is not allowed.
    """
    graph, rejections = state["social_graph"], state.get("rejections", [])
    left = list_remaining(graph, "constraint")
    if not left:
        return AddedClauses()
    if "added_clauses" in state:
        return state["added_clauses"]
    try:
        added = _ask_for_clauses(left, state, facts, program, context)
    except Rejected as error:
        if not is_last_answer(
            context.backend, "constraints", rejections, budget=context.budgets.filter
        ):
            raise
        added = AddedClauses(unserved=leave_all(left, error.rejection.detail))
    if not context.lenient:
        refuse_unrealised(graph, added.unserved, "waypoint_filter")
    return added


def _ask_for_clauses(
    left: list[Left],
    state: FilterReads,
    facts: dict[str, Any],
    program: ConstraintProgram,
    context: RunContext,
) -> AddedClauses:
    rejections = tuple(
        rejection.detail
        for rejection in list_latest_rejections(state.get("rejections", []), "waypoint_filter")
    )
    asked = {
        "instruction": state["instruction"],
        "words": list_word_facts(left, state["social_graph"]),
        "agents": facts["told"],
        "relations": facts["relations"],
        "program": format_program(select_clauses(program, facts["told"])),
    }
    question = Question(
        task="constraints",
        facts=asked,
        rejections=rejections,
        seed=context.seed,
        prompt=lambda: render_clauses_prompt(
            asked,
            [leg.name for leg in context.intersection.legs],
            rejections=rejections,
        ),
        account=context.account,
    )
    reply = ask(context.backend, question, ClausesReply, stage="waypoint_filter")
    return reply.read([entry for entry, _ in left], asked["agents"], facts["relations"])


def _collect_facts(state: FilterReads) -> dict[str, Any]:
    """The plan as it is played by the candidates: agents, relations with patterns, violators."""
    graph, pool = state["social_graph"], state["candidates"]
    played = pool.cast.patterns
    return {
        "told": [
            {"id": name, "type": route.type, "movement": route.movement}
            for name, route in pool.cast.routes.items()
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
        "kinds": [
            {"id": agent.id, "axis": axis, "kind": getattr(agent, axis)}
            for axis in ("motion", "reaction")
            for agent in graph.agents
            if getattr(agent, axis) is not None
        ],
        "measures": [measure.model_dump() for measure in graph.measures],
        "violators": sorted(
            {each.violator for each in played if each.violator}
            | {agent.id for agent in graph.agents if agent.runs_red}
        ),
    }
