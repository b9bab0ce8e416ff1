"""What `scenewright chat` is asked for; apart from it, so that `--help` does not load maps."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import typer

from scenewright.cli.backend_options import Lawful, ModelOptions, TimeLimit
from scenewright.cli.output_folder import try_folder
from scenewright.time_limit import DEFAULT_LIMIT


@dataclass(frozen=True, kw_only=True)
class ChatOptions:
    """What `chat` is asked for."""

    thread: Annotated[
        str | None, typer.Option(help="Thread to go on with; a new one if none is named.")
    ] = None
    intersection: Annotated[str, typer.Option(help="Where it happens.")] = "amsterdam_120"
    model: ModelOptions
    time_limit: TimeLimit = DEFAULT_LIMIT
    lawful: Lawful = False
    seed: Annotated[int, typer.Option(help="Of everything drawn, in a new thread.")] = 0
    refiner: Annotated[
        str | None, typer.Option(help="trajnet or none, in a new thread; that of make.")
    ] = None
    out: Annotated[
        str | None, typer.Option(help="Folder that /save writes to.", callback=try_folder)
    ] = None
    threads: Annotated[str | None, typer.Option(metavar="FILE", help="Where threads are kept.")] = (
        None
    )
    no_memory: Annotated[
        bool, typer.Option("--no-memory", help="Recall nothing, remember nothing.")
    ] = False
