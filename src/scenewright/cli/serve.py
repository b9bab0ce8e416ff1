"""`scenewright serve`: a local page on which scenes are made, changed, seen and shared."""

from __future__ import annotations

import secrets
import socket
import threading
from contextlib import suppress

from scenewright.cli.console import log_line
from scenewright.cli.options import SessionOptions, option
from scenewright.errors import InputError, ScenewrightError
from scenewright.extras import require_extra
from scenewright.time_limit import check_time_limit

HOST = "127.0.0.1"


def serve(
    options: SessionOptions,
    port: int = option(8765, "0 takes any free port.", min=0, max=65535),
    open_: bool = option(False, "Open it in the browser.", "--open"),
) -> None:
    """Serve a page, to this machine alone, on which scenes are made and changed (extra `page`)."""
    require_extra("page", "serving a page", "starlette", "uvicorn")
    from scenewright.intersections import find_data_folder, load_map

    intersection, time_limit = options.intersection, options.time_limit
    check_time_limit(time_limit)
    load_map(intersection)
    backend = options.model.load()
    listener = _listen(port)
    port = listener.getsockname()[1]
    token = secrets.token_urlsafe(24)
    address = f"http://{HOST}:{port}/?token={token}"
    # It listens already: a browser that connects now waits until the page is loaded.
    log_line(f"open {address}\nCtrl-C ends it; conversations are kept")
    import uvicorn

    from scenewright.cli.page.server import Page, build_app

    hosts = frozenset({f"{HOST}:{port}", f"localhost:{port}"})
    page = Page(options, backend, find_data_folder())
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
        page.close()
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
