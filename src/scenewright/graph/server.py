"""The graph as a LangGraph server runs it: plain JSON in, plain JSON out.

A server knows no `RunContext`, so the pipeline is a node of a small graph that makes one from the
request. Whatever the stages say is streamed as `custom` events.
"""

from __future__ import annotations

from typing import Any, NotRequired

from langgraph.config import get_stream_writer
from langgraph.graph import END, START, StateGraph
from langgraph.graph.state import CompiledStateGraph
from typing_extensions import TypedDict

from scenewright.errors import InputError, Unsatisfiable
from scenewright.graph.arguments import DEFAULT_INTERSECTION
from scenewright.graph.run import synthesize


class MakeRequest(TypedDict):
    """What a client sends.

    Attributes:
        instruction: what shall happen, in plain language.
        seed: the same seed makes the same scene; 0 if none is given.
        intersection: name of a bundle.
    """

    instruction: str
    seed: NotRequired[int]
    intersection: NotRequired[str]


class RefusedRequest(TypedDict):
    """Why there is no scene.

    Attributes:
        code: `unusable_input`, or `unsatisfiable` for a sane request that cannot be met.
        rejections: every refusal on the way, oldest first.
    """

    code: str
    reason: str
    rejections: list[dict[str, Any]]


class MakeReply(TypedDict):
    """What a client gets: a scene and its proof as in the files of those names, or a refusal."""

    scene: dict[str, Any] | None
    proof: dict[str, Any] | None
    refusal: RefusedRequest | None


class MakeState(MakeRequest, MakeReply):
    """Request and reply."""


def make_graph() -> CompiledStateGraph[MakeState, None, MakeRequest, MakeReply]:
    """The graph that langgraph.json names: an instruction in, a verified scene out.

    A request that is refused is an answer with `refusal`; a backend that fails is an error of the
    run (BackendFault).
    """
    graph: StateGraph[MakeState, None, MakeRequest, MakeReply] = StateGraph(
        MakeState, input_schema=MakeRequest, output_schema=MakeReply
    )
    graph.add_node("make", make)
    graph.add_edge(START, "make")
    graph.add_edge("make", END)
    return graph.compile(name="make")


def make(state: MakeRequest) -> MakeReply:
    """One run of the pipeline."""
    write = get_stream_writer()
    try:
        text: object = state.get("instruction")
        if not isinstance(text, str):
            raise InputError("a request needs an instruction, as a string")
        seed: Any = state.get("seed")
        if seed is not None and (not isinstance(seed, int) or isinstance(seed, bool)):
            raise InputError("a seed is a whole number")
        scene = synthesize(
            text,
            seed=seed or 0,
            intersection=state.get("intersection") or DEFAULT_INTERSECTION,
            log=lambda stage, line: write({"stage": stage, "line": line}),
        )
    except (InputError, Unsatisfiable) as error:
        rejections = error.rejections if isinstance(error, Unsatisfiable) else ()
        plain = [rejection.model_dump(mode="json") for rejection in rejections]
        refusal: RefusedRequest = {
            "code": error.code, "reason": str(error), "rejections": plain
        }  # fmt: skip
        return {"scene": None, "proof": None, "refusal": refusal}
    proof = scene.proof.model_dump(mode="json", by_alias=True)
    return {"scene": scene.record.to_json(), "proof": proof, "refusal": None}
