"""The stages as tools for agents: typed arguments in, short facts out, refusals that can be mended.

A `ToolState` holds what has been made so far. Every tool reads what earlier ones have made and puts
its own product there; what was made from an older one goes. An agent is shown facts, never
coordinates to write. A refusal is a result with `ok` false, a code and a sentence, as a retry edge
would have it (`scene/rejection.py`).
"""

from __future__ import annotations

import json
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any, cast

from langgraph.runtime import Runtime
from pydantic import Field, ValidationError, create_model

from scenewright.errors import Rejected, describe_misfit
from scenewright.memory.state import SceneState
from scenewright.nodes.agent_generator import generate_agents
from scenewright.nodes.context import RunContext
from scenewright.nodes.event_reasoner import edit_segments, reason_events
from scenewright.nodes.event_reasoner.reply import SegmentReply
from scenewright.nodes.scene_planner import plan_scene
from scenewright.nodes.scene_verifier import verify_scene
from scenewright.nodes.trajectory_refiner import refine_trajectories
from scenewright.nodes.waypoint_filter import filter_waypoints, solve_program
from scenewright.scene.base import Model
from scenewright.scene.events import Proof
from scenewright.scene.map_elements import Route
from scenewright.scene.record import SceneRecord
from scenewright.scene.rejection import Rejection
from scenewright.scene.social import SocialGraph
from scenewright.tools.dsl_validator.parse import format_clause, parse

if TYPE_CHECKING:
    from langchain_core.tools import BaseTool

Facts = dict[str, Any]
Recorder = Callable[[SceneRecord, Proof], str]
"""Keeps a verified scene somewhere that the caller chose; says where."""

_CHANNELS: tuple[tuple[str, ...], ...] = (
    ("social_graph", "grounding"),
    ("candidates",),
    ("added_clauses", "constraints", "selection"),
    ("added_stops", "summary", "behavior", "edited"),
    ("refined", "refinement", "rolled"),
    ("scene", "proof"),
)
"""By step, in order: what it writes to the tool state."""

_STEPS = ("ground_plan", "draw_candidates", "solve", "edit_segments", "refine", "check_scene")
_MOST_ANCHORS = 8


class AgentSegments(Model):
    """The behavior segments of one agent, in order of time."""

    agent: str
    segments: list[SegmentReply]


class ToolState:
    """What has been made so far, and the tools that make it.

    Args:
        instruction: what shall happen, for the scene's prompt.
        context: map, priors, seed; its backend answers what remaining words ask for.
        record: where a verified scene is kept.
    """

    def __init__(
        self, instruction: str, context: RunContext, *, record: Recorder | None = None
    ) -> None:
        self._context, self._record = context, record
        self._state: SceneState = {"instruction": instruction, "rejections": []}

    @property
    def state(self) -> SceneState:
        """Every product so far."""
        return self._state

    @property
    def verified(self) -> bool:
        """Whether there is a scene, and it is proven."""
        return "proof" in self._state and self._state["proof"].verified

    def ground_plan(self, plan: SocialGraph) -> Facts:
        """Map grounding (paper 3.1): binds the agents and relations of a plan to the map."""
        made = self._step("ground_plan", plan_scene, {"planned": plan})
        routes = {
            name: list(dict.fromkeys(map(_describe_route, open_)))[:_MOST_ANCHORS]
            for name, open_ in made["grounding"].routes.items()
        }
        return {"agents": [agent.id for agent in plan.agents], "ways": routes}

    def draw_candidates(self) -> Facts:
        """GMM sampler (paper 3.2): draws the background agents, and candidate paths for all
        agents."""
        made = self._step("draw_candidates", generate_agents)["candidates"]
        return {
            "candidates_each": self._context.draws,
            "background": dict(made.background),
            "hour": round(made.hour, 2),
            "relations_played": [pattern.pattern for pattern in made.cast.patterns],
        }

    def check_program(self, program: str) -> Facts:
        """DSL validator (paper 3.3): reads a constraint program; says where it goes wrong."""
        return {"clauses": [format_clause(clause) for clause in parse(program).clauses]}

    def solve(self, program: str | None = None) -> Facts:
        """DSL validator (paper 3.3, Eq. 4): candidates, times and standstills that serve."""
        node = filter_waypoints if program is None else partial(solve_program, program)
        made = self._step("solve", node)["selection"]
        return {
            "duration": made.duration,
            "events": [{"clause": e.clause, "time": round(e.time, 1)} for e in made.events],
            "foreground": {
                name: {
                    "enters": round(each.enters, 1),
                    "way": f"{each.candidate.route.movement} from {each.candidate.route.entry}",
                    "stops": [round(stop.start, 1) for stop in each.stops],
                }
                for name, each in made.agents.items()
                if each.role == "foreground"
            },
            "background": sum(agent.role == "background" for agent in made.agents.values()),
        }

    def edit_segments(self, agents: list[AgentSegments] | None = None) -> Facts:
        """Segment editor (paper 3.4, 3.5, Eq. 6): keep, stop, proceed, terminate, at anchors."""
        segments = {agent.agent: agent.segments for agent in agents or []}
        node = partial(edit_segments, segments) if segments else reason_events
        made = self._step("edit_segments", node)
        front = {agent.id for agent in self._state["social_graph"].agents}
        return {
            "agents": {
                agent.agent: {
                    "anchors": [a.id for a in agent.anchors][:_MOST_ANCHORS],
                    "segments": [
                        f"{s.status} {s.start:.1f}-{s.end:.1f} s at {s.anchor}"
                        for s in made["behavior"].segments[agent.agent]
                    ],
                }
                for agent in made["summary"].agents
                if agent.agent in front
            }
        }

    def refine(self) -> Facts:
        """TrajNet++ refiner (paper 3.5, Eq. 7): turns the edited priors into final tracks."""
        made = self._step("refine", refine_trajectories)
        return {"tracks": len(made["refined"]), "refinement": made["refinement"].note}

    def check_scene(self) -> Facts:
        """Relation checker (paper 4.3): looks at the final tracks and decides."""
        made = self._step("check_scene", verify_scene)
        names = {agent.id: agent.name for agent in made["scene"].agents}
        proof = made["proof"]
        return {
            **proof.build_verdict(),
            "events": [
                f"{e.type} of {names[e.from_]} and {names[e.to]} at {e.time:.1f} s"
                for e in proof.events
            ],
            "against": [
                f"{f.rule} ({', '.join(names.get(n, str(n)) for n in f.agents)}): {f.detail}"
                for f in (*proof.missing, *proof.interference)
            ],
        }

    def record_scene(self) -> Facts:
        """Recorder: saves the verified scene at the configured place."""
        if not self.verified:
            raise _build_order_rejection("record_scene", "check_scene")
        if self._record is None:
            return {"kept": None, "why": "no place to save scenes was given"}
        return {"kept": self._record(self._state["scene"], self._state["proof"])}

    def _step(
        self, step: str, node: Callable[..., Any], given: Facts | None = None
    ) -> dict[str, Any]:
        """Runs a stage on what is there; its products replace the old, and later ones go."""
        at = _STEPS.index(step)
        for before, names in zip(_STEPS[:at], _CHANNELS[:at], strict=True):
            # The segment editor and the refiner are one stage in the pipeline, and two tools here.
            if not set(names) - {"edited", "refinement", "rolled"} <= self._state.keys():
                raise _build_order_rejection(step, before)
        state: Any = {**self._state, **(given or {})}
        try:
            made = node(state, runtime=Runtime(context=self._context))
        except Rejected as error:
            self._state["rejections"] = [*self._state["rejections"], error.rejection]
            raise
        later = {name for names in _CHANNELS[at:] for name in names}
        kept = {name: value for name, value in self._state.items() if name not in later}
        self._state = cast(SceneState, {**kept, **made})
        found: dict[str, Any] = made
        return found


def _describe_route(route: Route) -> str:
    crosswalk = f" on the {route.crosswalk} crosswalk" if route.crosswalk else ""
    return f"{route.movement} from {route.entry} to {route.exit}{crosswalk}"


def _build_order_rejection(step: str, before: str) -> Rejected:
    detail = f"{step} needs what {before} makes; call {before} first"
    return Rejected(Rejection(stage="scene_planner", code="malformed_reply", detail=detail))


def build_tools(bench: ToolState) -> list[BaseTool]:
    """The tools on a tool state for any LangChain chat model, in the order in which they are
    used."""
    from langchain_core.tools import StructuredTool

    plan = Field(description="the agents, and their relations")
    clauses = Field(max_length=8000, description="clauses of the constraint language, a line each")
    held = Field(
        default=None,
        max_length=8000,
        description="clauses to hold; leave out for those of the relation files",
    )
    table: list[tuple[Callable[..., Facts], dict[str, Any]]] = [
        (bench.ground_plan, {"plan": (SocialGraph, plan)}),
        (bench.draw_candidates, {}),
        (bench.check_program, {"program": (str, clauses)}),
        (bench.solve, {"program": (str | None, held)}),
        (bench.edit_segments, {
            "agents": (list[AgentSegments], Field(default_factory=list, max_length=28))
        }),
        (bench.refine, {}),
        (bench.check_scene, {}),
        (bench.record_scene, {}),
    ]  # fmt: skip
    return [
        StructuredTool.from_function(
            func=_return_rejections(run),
            name=run.__name__,
            description=str(run.__doc__),
            args_schema=create_model(f"{run.__name__}_arguments", __base__=Model, **arguments),
            handle_validation_error=_format_validation_error,
        )
        for run, arguments in table
    ]


def _return_rejections(run: Callable[..., Facts]) -> Callable[..., str]:
    """The tool's facts as JSON; a refusal is a result that a model can act on."""

    def act(**arguments: Any) -> str:
        try:
            return json.dumps({"ok": True, **run(**arguments)})
        except Rejected as error:
            fields = error.rejection.model_dump(mode="json", include={"code", "agents", "detail"})
            return json.dumps({"ok": False, **fields})

    return act


def _format_validation_error(error: ValidationError | Any) -> str:
    """Arguments that do not fit: the first fault, and where it is."""
    detail = str(error)[:300]
    if isinstance(error, ValidationError):
        detail = describe_misfit(error, "arguments")
    return json.dumps({"ok": False, "code": "malformed_reply", "detail": detail})
