"""Stage 3, waypoint filter: constraint program and the surviving combination (paper 3.3)."""

from __future__ import annotations

from typing import TypedDict

from langgraph.runtime import Runtime
from pydantic import BaseModel, ConfigDict

from scenewright.backends import Question
from scenewright.errors import Rejected
from scenewright.nodes.ask import ask, earlier
from scenewright.nodes.context import RunContext
from scenewright.scene.candidates import CandidateSet
from scenewright.scene.constraints import ConstraintProgram, UnaryClause
from scenewright.scene.rejection import Rejection
from scenewright.scene.selection import Selection
from scenewright.scene.social import SocialGraph
from scenewright.tools.dsl_validator.parse import format_clause, parse
from scenewright.tools.dsl_validator.select import select

_STRICT_ATTEMPTS = 4


class FilterReads(TypedDict):
    """Channels read."""

    instruction: str
    social_graph: SocialGraph
    candidates: CandidateSet
    rejections: list[Rejection]


class FilterWrites(TypedDict):
    """Channels written."""

    constraints: ConstraintProgram
    selection: Selection


class ProgramReply(BaseModel):
    """A constraint program in its text form."""

    model_config = ConfigDict(extra="forbid")

    program: str


def filter_waypoints(state: FilterReads, *, runtime: Runtime[RunContext]) -> FilterWrites:
    """Asks for the constraint program and solves it."""
    context = runtime.context
    rejections = state.get("rejections", [])
    question = Question(
        task="constraints",
        facts=_facts(state["instruction"], state["social_graph"], state["candidates"]),
        rejections=earlier(rejections, "waypoint_filter"),
    )
    reply = ask(context.backend, question, ProgramReply, stage="waypoint_filter")
    program = parse(reply.program)
    _refuse_strangers(program, state["candidates"])
    selection = select(
        program,
        state["candidates"],
        ground=context.ground,
        rng=context.rng("waypoint_filter", rejections),
        mode=context.selection,
        lenient=len(rejections) >= _STRICT_ATTEMPTS,
    )
    tried = int(selection.figures["tuples"])
    context.tell("waypoint_filter", f"combination {tried} survives, nll {selection.nll:.1f} nats")
    return {"constraints": program, "selection": selection}


def _refuse_strangers(program: ConstraintProgram, pool: CandidateSet) -> None:
    """Every agent that a clause names takes part."""
    for clause in program.clauses:
        named = (
            (clause.agent,) if isinstance(clause, UnaryClause) else (clause.first, clause.second)
        )
        for name in named:
            if name is not None and name not in pool.agents:
                raise Rejected(
                    Rejection(
                        stage="waypoint_filter",
                        code="malformed_program",
                        agents=(name,),
                        detail=f"{format_clause(clause)}: there is no {name} in the scene",
                    )
                )


def _facts(instruction: str, graph: SocialGraph, pool: CandidateSet) -> dict[str, object]:
    played = pool.cast.patterns
    return {
        "instruction": instruction,
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
