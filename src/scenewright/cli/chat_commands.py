"""The commands of authoring in conversation: `chat`, `memory`, `mcp`."""

from __future__ import annotations

from typing import Annotated

import typer

from scenewright.cli.backend_options import Lawful, ModelOptions, TimeLimit
from scenewright.cli.chat_options import ChatOptions
from scenewright.cli.common_options import Json, Quiet, spread_options
from scenewright.cli.console import format_one_line, log_line, write_json, write_stdout
from scenewright.cli.output_folder import try_folder
from scenewright.time_limit import DEFAULT_LIMIT

memory = typer.Typer(name="memory", help="Accepted scenes, recalled as examples for prompts.")


@spread_options
def open_chat(
    options: ChatOptions,
    list_: Annotated[bool, typer.Option("--list", help="List the threads there are.")] = False,
    quiet: Quiet = False,
    as_json: Annotated[
        bool, typer.Option("--json", help="One JSON object for every line of stdin.")
    ] = False,
) -> None:
    """Make a scene in conversation, and change it in words until it is right."""
    from scenewright.cli.chat import list_threads, run_chat

    if list_:
        names = list_threads(options.threads)
        if as_json:
            write_json({"ok": True, "threads": names})
        else:
            write_stdout("".join(f"{name}\n" for name in names))
        return
    run_chat(options, quiet=quiet, as_json=as_json)


@spread_options
def serve_mcp(
    *,
    thread: Annotated[str, typer.Option(help="Thread that the tools work on.")] = "mcp",
    intersection: Annotated[str, typer.Option(help="Where it happens.")] = "amsterdam_120",
    model: ModelOptions,
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

    serve(ServerOptions(threads, thread, intersection, model.load(), seed, out, time_limit, lawful))


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
