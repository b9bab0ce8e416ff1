"""The commands of authoring in conversation: `chat`, `memory`, `mcp`."""

from __future__ import annotations

from typing import Annotated

import typer

from scenewright.cli.backend_options import (
    BackendNames,
    BaseUrl,
    Lawful,
    Record,
    TimeLimit,
    Timeout,
    load_named_backend,
)
from scenewright.cli.common_options import Json, Quiet
from scenewright.cli.console import format_one_line, log_line, write_json, write_stdout
from scenewright.cli.output_folder import try_folder
from scenewright.time_limit import DEFAULT_LIMIT

memory = typer.Typer(name="memory", help="Accepted scenes, recalled as examples for prompts.")


def open_chat(
    thread: Annotated[
        str | None, typer.Option(help="Thread to go on with; a new one if none is named.")
    ] = None,
    intersection: Annotated[str, typer.Option(help="Where it happens.")] = "amsterdam_120",
    backend: BackendNames = None,
    base_url: BaseUrl = None,
    record: Record = None,
    timeout: Timeout = None,
    time_limit: TimeLimit = DEFAULT_LIMIT,
    lawful: Lawful = False,
    seed: Annotated[int, typer.Option(help="Of everything drawn, in a new thread.")] = 0,
    refiner: Annotated[
        str | None, typer.Option(help="trajnet or none, in a new thread; that of make.")
    ] = None,
    out: Annotated[
        str | None, typer.Option(help="Folder that /save writes to.", callback=try_folder)
    ] = None,
    threads: Annotated[
        str | None, typer.Option(metavar="FILE", help="Where threads are kept.")
    ] = None,
    no_memory: Annotated[
        bool, typer.Option("--no-memory", help="Recall nothing, remember nothing.")
    ] = False,
    list_: Annotated[bool, typer.Option("--list", help="List the threads there are.")] = False,
    quiet: Quiet = False,
    as_json: Annotated[
        bool, typer.Option("--json", help="One JSON object for every line of stdin.")
    ] = False,
) -> None:
    """Make a scene in conversation, and change it in words until it is right."""
    from scenewright.cli.chat import ChatRequest, list_threads
    from scenewright.cli.chat import run_chat as talk

    if list_:
        names = list_threads(threads)
        if as_json:
            write_json({"ok": True, "threads": names})
        else:
            write_stdout("".join(f"{name}\n" for name in names))
        return
    talk(
        ChatRequest(
            thread=thread,
            threads=threads,
            intersection=intersection,
            backend=load_named_backend(backend, base_url=base_url, record=record, timeout=timeout),
            seed=seed,
            refiner=refiner,
            out=out,
            memory=not no_memory,
            time_limit=time_limit,
            lawful=lawful,
            quiet=quiet,
            as_json=as_json,
        )
    )


def serve_mcp(
    thread: Annotated[str, typer.Option(help="Thread that the tools work on.")] = "mcp",
    intersection: Annotated[str, typer.Option(help="Where it happens.")] = "amsterdam_120",
    backend: BackendNames = None,
    base_url: BaseUrl = None,
    record: Record = None,
    timeout: Timeout = None,
    time_limit: TimeLimit = DEFAULT_LIMIT,
    lawful: Lawful = False,
    seed: Annotated[int, typer.Option(help="Of everything drawn, in a new thread.")] = 0,
    out: Annotated[
        str | None, typer.Option(help="Folder that scenes may be kept in.", callback=try_folder)
    ] = None,
    threads: Annotated[
        str | None, typer.Option(metavar="FILE", help="Where threads are kept.")
    ] = None,
) -> None:
    """Serve the tools over the Model Context Protocol, on stdin and stdout (extra `mcp`)."""
    from scenewright.cli.mcp import ServerOptions, serve

    chosen_backend = load_named_backend(backend, base_url=base_url, record=record, timeout=timeout)
    serve(
        ServerOptions(threads, thread, intersection, chosen_backend, seed, out, time_limit, lawful)
    )


@memory.command("list")
def list_memory(as_json: Json = False) -> None:
    """List what is remembered."""
    from scenewright.cli.user_folders import find_memory_file
    from scenewright.memory.episodes import Episodes

    found = Episodes(find_memory_file()).list_all()
    if as_json:
        rows = [{"request": e.request, "taxonomy": list(e.taxonomy)} for e in found]
        write_json({"ok": True, "file": str(find_memory_file()), "episodes": rows})
    else:
        write_stdout(
            "".join(
                f"{', '.join(e.taxonomy) or 'normal'}: {format_one_line(e.request)}\n"
                for e in found
            )
        )


@memory.command("wipe")
def wipe_memory(as_json: Json = False) -> None:
    """Forget everything that is remembered."""
    from scenewright.cli.user_folders import find_memory_file
    from scenewright.memory.episodes import Episodes

    count = Episodes(find_memory_file()).wipe()
    if as_json:
        write_json({"ok": True, "forgotten": count})
    else:
        log_line(f"{count} episodes forgotten")
