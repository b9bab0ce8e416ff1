"""The commands of authoring in conversation: `chat`, `memory`, `mcp`."""

from __future__ import annotations

from scenewright.cli.console import Result, format_one_line
from scenewright.cli.options import ChatOptions, Commands, Quiet, SessionOptions, option
from scenewright.cli.output_folder import try_folder

memory = Commands(name="memory", help="Accepted scenes, recalled as examples for prompts.")


def open_chat(
    options: ChatOptions,
    list_: bool = option(False, "List the threads there are.", "--list"),
    quiet: Quiet = False,
    as_json: bool = option(False, "One JSON object for every line of stdin.", "--json"),
) -> Result | None:
    """Make a scene in conversation, and change it in words until it is right."""
    from scenewright.cli.chat import run_chat
    from scenewright.cli.sessions import list_threads

    if list_:
        names = list_threads(options.threads)
        return Result({"threads": names}, "".join(f"{name}\n" for name in names))
    run_chat(options, quiet=quiet, as_json=as_json)
    return None


def serve_mcp(
    options: SessionOptions,
    thread: str = option("mcp", "Thread that the tools work on."),
    out: str | None = option(None, "Folder that scenes may be kept in.", check=try_folder),
) -> None:
    """Serve the tools over the Model Context Protocol, on stdin and stdout (extra `mcp`)."""
    from scenewright.cli.mcp import build_server

    build_server(options, thread=thread, out=out).run("stdio")


@memory.command("list")
def list_memory() -> Result:
    """List what is remembered."""
    from scenewright.cli.sessions import find_memory_file
    from scenewright.memory.episodes import Episodes

    found = Episodes(find_memory_file()).list_all()
    rows = [{"request": e.request, "taxonomy": list(e.taxonomy)} for e in found]
    lines = (f"{', '.join(e.taxonomy) or 'normal'}: {format_one_line(e.request)}\n" for e in found)
    return Result({"file": str(find_memory_file()), "episodes": rows}, "".join(lines))


@memory.command("wipe")
def wipe_memory() -> Result:
    """Forget everything that is remembered."""
    from scenewright.cli.sessions import find_memory_file
    from scenewright.memory.episodes import Episodes

    count = Episodes(find_memory_file()).wipe()
    return Result({"forgotten": count}, "", notes=[f"{count} episodes forgotten"])
