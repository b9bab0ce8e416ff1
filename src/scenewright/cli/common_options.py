"""Options that many commands have, and commands that take theirs as one object."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator
from dataclasses import is_dataclass
from functools import cache
from typing import Annotated, Any, get_type_hints

import typer

Json = Annotated[bool, typer.Option("--json", help="Print one JSON object on stdout.")]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="No progress, no summary.")]
BoardFile = Annotated[
    str | None,
    typer.Option("--board", metavar="F.json", help="Leaderboard to enter; a page is beside it."),
]
BoardName = Annotated[str | None, typer.Option("--name", help="Of the submission, on the board.")]


def spread_options(command: Callable[..., None]) -> Callable[..., None]:
    """The command with every dataclass among its parameters spread: each field is an option.

    Fields are annotated as typer wants it; those that are dataclasses are spread in turn.
    """

    def run(**values: Any) -> None:
        command(**_collect(command, values))

    run.__doc__, run.__name__, run.__module__ = (
        command.__doc__, command.__name__, command.__module__,
    )  # fmt: skip
    run.__signature__ = inspect.Signature(list(_list_parameters(command)))  # type: ignore[attr-defined]
    run.__annotations__ = {}
    return run


@cache  # the same options stand in several commands
def _get_hints(made: Callable[..., Any]) -> dict[str, Any]:
    return get_type_hints(made, include_extras=True)


def _list_parameters(made: Callable[..., Any]) -> Iterator[inspect.Parameter]:
    hints = _get_hints(made)
    for name, each in inspect.signature(made).parameters.items():
        if is_dataclass(hints[name]):
            yield from _list_parameters(hints[name])
        else:
            yield each.replace(kind=inspect.Parameter.KEYWORD_ONLY, annotation=hints[name])


def _collect(made: Callable[..., Any], values: dict[str, Any]) -> dict[str, Any]:
    """The arguments of a command or a dataclass from the values of all options."""
    hints = _get_hints(made)
    return {
        name: hints[name](**_collect(hints[name], values)) if is_dataclass(hints[name])
        else values[name]
        for name in inspect.signature(made).parameters
    }  # fmt: skip
