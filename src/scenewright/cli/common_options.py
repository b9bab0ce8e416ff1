"""Options that many commands have."""

from __future__ import annotations

from typing import Annotated

import typer

Json = Annotated[bool, typer.Option("--json", help="Print one JSON object on stdout.")]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="No progress, no summary.")]
BoardFile = Annotated[
    str | None,
    typer.Option("--board", metavar="F.json", help="Leaderboard to enter; a page is beside it."),
]
BoardName = Annotated[str | None, typer.Option("--name", help="Of the submission, on the board.")]
