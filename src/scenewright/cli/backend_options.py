"""The planner and reasoner, as the command line names it, and what conversations begin with."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

import typer

from scenewright.cli.common_options import option
from scenewright.time_limit import DEFAULT_LIMIT

if TYPE_CHECKING:
    from scenewright.backends import Backend

BaseUrl = Annotated[
    str | None,
    typer.Option(
        metavar="URL",
        help="OpenAI-compatible endpoint that serves the model, such as http://localhost:8000/v1.",
    ),
]
Timeout = Annotated[
    float | None, typer.Option(metavar="S", help="Longest wait for one reply of a model [s].")
]
MaxAgents = Annotated[
    int | None,
    typer.Option(
        "--max-agents",
        metavar="N",
        envvar="SCENEWRIGHT_MAX_AGENTS",
        help="Most agents that a scene may hold; without it as many as the time of day has.",
    ),
]
UNASKED = "Refuse scenes in which an agent runs a red light that no word asks for."
Lawful = Annotated[bool, typer.Option("--lawful", help=UNASKED)]
TimeLimit = Annotated[
    float,
    typer.Option(
        "--time-limit",
        metavar="S",
        help="Emergency brake: longest that a scene may be computed [s], answers of models aside. "
        "Counted work ends long before, and alone decides what is made.",
    ),
]


@dataclass(frozen=True)
class ModelOptions:
    """Who plans and reasons, and how models are asked."""

    backend: list[str] | None = option(
        None,
        "Planner and reasoner: builtin (the default), anthropic:MODEL, openai:MODEL or "
        "recorded:FILE; or STAGE=NAME, repeated, with planner, filter or reasoner.",
        metavar="NAME",
    )
    base_url: BaseUrl = None
    record: str | None = option(
        None, "Keep every answer there; what it holds is not asked again.", metavar="FILE"
    )
    timeout: Timeout = None

    def load(self) -> Backend:
        """The backend that the options name.

        Raises:
            InputError: there is none such; says which option to mend.
        """
        from scenewright.backends import load_backend

        named = self.backend or ["builtin"]
        return load_backend(
            named[0] if len(named) == 1 else named,
            base_url=self.base_url, record=self.record, timeout=self.timeout,
        )  # fmt: skip


@dataclass(frozen=True)
class SessionOptions:
    """What conversations of `chat`, `mcp` and `serve` begin with, and where they are kept."""

    intersection: str = option("amsterdam_120", "Where new conversations happen.")
    model: ModelOptions = ModelOptions()
    time_limit: TimeLimit = DEFAULT_LIMIT
    lawful: Lawful = False
    seed: int = option(0, "Of everything drawn, in a new conversation.")
    threads: str | None = option(None, "Where conversations are kept.", metavar="FILE")
