"""The planner and reasoner, as the command line names it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from scenewright.backends import Backend

BackendNames = Annotated[
    list[str] | None,
    typer.Option(
        "--backend",
        metavar="NAME",
        help="Planner and reasoner: builtin (the default), anthropic:MODEL, openai:MODEL or "
        "recorded:FILE; or STAGE=NAME, repeated, with planner, filter or reasoner.",
    ),
]
BaseUrl = Annotated[
    str | None,
    typer.Option(
        metavar="URL",
        help="OpenAI-compatible endpoint that serves the model, such as http://localhost:8000/v1.",
    ),
]
Record = Annotated[
    str | None,
    typer.Option(metavar="FILE", help="Keep every answer there; what it holds is not asked again."),
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

Lawful = Annotated[
    bool,
    typer.Option(
        "--lawful", help="Refuse scenes in which an agent runs a red light that no word asks for."
    ),
]
LawfulOrder = Annotated[
    bool,
    typer.Option(
        "--lawful/--no-lawful",
        help="Refuse scenes in which an agent runs a red light that no word asks for.",
    ),
]

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

    backend: BackendNames = None
    base_url: BaseUrl = None
    record: Record = None
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
