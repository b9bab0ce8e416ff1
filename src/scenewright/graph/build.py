"""The state machine: stages as nodes, retries as conditional edges."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from functools import wraps
from typing import Any, TypeVar

from langgraph.graph import END, START, StateGraph
from langgraph.runtime import Runtime
from langgraph.types import RetryPolicy

from scenewright.errors import BackendFault, Rejected
from scenewright.graph import routes
from scenewright.memory.state import SceneState
from scenewright.nodes.agent_generator import generate_agents
from scenewright.nodes.context import RunContext
from scenewright.nodes.event_reasoner import reason_events
from scenewright.nodes.scene_planner import plan_scene
from scenewright.nodes.scene_verifier import verify_scene
from scenewright.nodes.trajectory_refiner import refine_trajectories
from scenewright.nodes.waypoint_filter import filter_waypoints
from scenewright.time_limit import TimeLimitReachedError
from scenewright.work_limit import WorkLimitReachedError, count_work

STAGES: dict[str, Callable[..., Any]] = {
    "scene_planner": plan_scene,
    "agent_generator": generate_agents,
    "waypoint_filter": filter_waypoints,
    "event_reasoner": reason_events,
    "trajectory_refiner": refine_trajectories,
    "scene_verifier": verify_scene,
}

NodeT = TypeVar("NodeT", bound=Callable[..., Any])


def build_graph() -> StateGraph[SceneState, RunContext, Any, Any]:
    """Build the graph, not yet compiled, so that the caller may add a checkpointer."""
    graph: StateGraph[SceneState, RunContext, Any, Any] = StateGraph(
        SceneState, context_schema=RunContext
    )
    transport = RetryPolicy(
        max_attempts=3, retry_on=lambda error: isinstance(error, BackendFault) and not error.final
    )
    for name, node in STAGES.items():
        graph.add_node(name, _catch_rejection(name, node), retry_policy=transport)
    graph.add_node("give_up", give_up)
    graph.add_edge(START, "scene_planner")
    graph.add_conditional_edges("scene_planner", routes.route_after_planner)
    graph.add_conditional_edges("agent_generator", routes.route_after_generator)
    graph.add_conditional_edges("waypoint_filter", routes.route_after_filter)
    graph.add_conditional_edges("event_reasoner", routes.route_after_reasoner)
    graph.add_edge("trajectory_refiner", "scene_verifier")
    ends: dict[Hashable, str] = {
        name: name for name in ("scene_planner", "trajectory_refiner", "agent_generator", "give_up")
    }
    graph.add_conditional_edges("scene_verifier", routes.route_after_verifier, ends | {"end": END})
    graph.add_edge("give_up", END)
    return graph


def give_up(state: SceneState) -> SceneState:
    """The budget is spent or the request cannot be met; the run raises what the state holds."""
    del state
    return {}


def _catch_rejection(name: str, node: NodeT) -> NodeT:
    """Wrap a node: a refused product becomes a rejection in the state, for the routes."""

    @wraps(node)
    def run(state: Any, *, runtime: Runtime[RunContext]) -> Any:
        try:
            count_work()
            return {**node(state, runtime=runtime), "refused": None}
        except Rejected as error:
            runtime.context.log(error.rejection.stage, f"refused: {error.rejection.detail}")
            return {**error.kept, "refused": error.rejection, "rejections": [error.rejection]}
        except (TimeLimitReachedError, WorkLimitReachedError) as error:
            error.stage = name
            raise

    return run  # type: ignore[return-value]
