"""`scenewright serve`: a local page on which scenes are made, changed, seen and shared."""

from __future__ import annotations

import secrets
import socket
import threading
from contextlib import suppress
from typing import Annotated

import typer

from scenewright.cli.backend_options import Lawful, ModelOptions, TimeLimit
from scenewright.cli.common_options import spread_options
from scenewright.cli.console import log_line
from scenewright.errors import InputError, ScenewrightError
from scenewright.extras import require_extra
from scenewright.time_limit import DEFAULT_LIMIT, check_time_limit

HOST = "127.0.0.1"


@spread_options
def serve(
    *,
    intersection: Annotated[
        str, typer.Option(help="Where new conversations begin.")
    ] = "amsterdam_120",
    model: ModelOptions,
    time_limit: TimeLimit = DEFAULT_LIMIT,
    lawful: Lawful = False,
    seed: Annotated[int, typer.Option(help="Of everything drawn, in a new conversation.")] = 0,
    port: Annotated[int, typer.Option(min=0, max=65535, help="0 takes any free port.")] = 8765,
    threads: Annotated[
        str | None, typer.Option(metavar="FILE", help="Where conversations are kept.")
    ] = None,
    open_: Annotated[bool, typer.Option("--open", help="Open it in the browser.")] = False,
) -> None:
    """Serve a page, to this machine alone, on which scenes are made and changed (extra `page`)."""
    require_extra("page", "serving a page", "starlette", "uvicorn")
    from scenewright.intersections import find_data_folder, load_map

    check_time_limit(time_limit)
    load_map(intersection)
    backend = model.load()
    listener = _listen(port)
    port = listener.getsockname()[1]
    token = secrets.token_urlsafe(24)
    address = f"http://{HOST}:{port}/?token={token}"
    # It listens already: a browser that connects now waits until the page is loaded.
    log_line(f"open {address}\nCtrl-C ends it; conversations are kept")
    import uvicorn

    from scenewright.cli.page.batches import Batches
    from scenewright.cli.page.conversations import Conversations
    from scenewright.cli.page.model_choice import ModelChoice
    from scenewright.cli.page.own_maps import OwnMaps
    from scenewright.cli.page.server import Page, build_app
    from scenewright.cli.user_folders import find_threads_file

    conversations = Conversations(
        str(find_threads_file(threads)), backend=backend, seed=seed, time_limit=time_limit,
        lawful=lawful,
    )  # fmt: skip
    name = ", ".join(model.backend or ["builtin"])
    hosts = frozenset({f"{HOST}:{port}", f"localhost:{port}"})
    batches = Batches(find_data_folder() / "page-batches", time_limit=time_limit, lawful=lawful)
    page = Page(
        conversations, choice=ModelChoice(conversations, name), intersection=intersection,
        batches=batches, own_maps=OwnMaps(find_data_folder() / "page-maps"),
    )  # fmt: skip
    config = uvicorn.Config(
        build_app(page, token=token, hosts=hosts), log_level="warning", lifespan="off",
        access_log=False,
    )  # fmt: skip
    warming = threading.Thread(target=_warm_up, args=(intersection,), daemon=True)
    warming.start()
    if open_:
        import webbrowser

        webbrowser.open(address)
    try:
        uvicorn.Server(config).run(sockets=[listener])
    finally:
        conversations.close()
        batches.close()
        warming.join()  # a thread that is cut off while it loads a library can hang the exit


def _warm_up(intersection: str) -> None:
    """Loads what the first scene needs while the page is opened; a fault shows with that scene."""
    from scenewright.graph.run import synthesize

    with suppress(ScenewrightError):
        synthesize("A normal scene", intersection=intersection)


def _listen(port: int) -> socket.socket:
    """A socket that listens on this machine alone; InputError if the port is taken."""
    try:
        return socket.create_server((HOST, port))
    except OSError as error:
        raise InputError(
            f"cannot listen on port {port}: {error.strerror or error}; --port 0 takes a free one"
        ) from error
