"""The page's server: one application on 127.0.0.1 that answers only to its own token."""

from __future__ import annotations

import asyncio
import json
import secrets
from collections.abc import AsyncIterator
from functools import lru_cache
from importlib.resources import files
from typing import Any

from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.exceptions import HTTPException
from starlette.middleware import Middleware
from starlette.middleware.base import BaseHTTPMiddleware
from starlette.requests import Request
from starlette.responses import HTMLResponse, JSONResponse, Response, StreamingResponse
from starlette.routing import Route

from scenewright.cli.page.answers import (
    answer_safely,
    describe_fault,
    read_object,
    read_text,
    refuse,
)
from scenewright.cli.page.batches import Batches
from scenewright.cli.page.conversations import Conversation, Conversations
from scenewright.cli.page.model_choice import ModelChoice
from scenewright.cli.page.own_maps import OwnMaps
from scenewright.cli.page.plan_form import describe_plan_file, read_plan_object
from scenewright.cli.page.saved import SAVED, write_saved
from scenewright.cli.page.schema import describe_routes
from scenewright.cli.page.suggestions import list_places, list_words
from scenewright.errors import BackendFault, BusyError, InputError, Unsatisfiable
from scenewright.extras import describe_missing
from scenewright.intersections import load_map
from scenewright.scene.called import speak_plainly
from scenewright.scene.plan_file import PlanFile, build_plan_schema

_POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; "
    "img-src 'self' data:; frame-src 'self'; base-uri 'none'; form-action 'none'; "
    "frame-ancestors 'none'"
)
_ASSETS = {
    name: "text/css" if name.endswith(".css") else "text/javascript"
    for name in ("app.css", "app.js", "batch.js", "places.js", "hand.js", "plan.js", "run_graph.js")
}


class Guard(BaseHTTPMiddleware):
    """Answers only requests with the token, to this host, and from this page or none.

    The host is checked because another site's name may be made to lead to 127.0.0.1.
    """

    def __init__(self, app: Any, *, token: str, hosts: frozenset[str]) -> None:
        super().__init__(app)
        self._token, self._hosts = token, hosts

    async def dispatch(self, request: Request, call_next: Any) -> Response:
        """The answer, or a refusal of the request."""
        origin = request.headers.get("origin")
        if request.headers.get("host") not in self._hosts:
            return refuse(403, "this page answers to its own address alone")
        if origin is not None and origin.removeprefix("http://") not in self._hosts:
            return refuse(403, "requests of other sites are refused")
        if request.url.path.lstrip("/") not in _ASSETS and not self._has_token(request):
            return refuse(401, "open the address that `scenewright serve` printed, token included")
        response: Response = await call_next(request)
        response.headers.setdefault("Content-Security-Policy", _POLICY)
        response.headers["X-Content-Type-Options"] = "nosniff"
        response.headers["Referrer-Policy"] = "no-referrer"
        response.headers["Cache-Control"] = "no-store"
        return response

    def _has_token(self, request: Request) -> bool:
        given = request.headers.get("x-token") or request.query_params.get("token") or ""
        return secrets.compare_digest(given.encode(), self._token.encode())


class Page:
    """The routes, over the conversations they work on."""

    def __init__(
        self, conversations: Conversations, *, choice: ModelChoice, intersection: str,
        batches: Batches, own_maps: OwnMaps,
    ) -> None:  # fmt: skip
        self._conversations = conversations
        self._choice, self._intersection = choice, intersection
        self._batches, self._own_maps = batches, own_maps
        self._running: set[asyncio.Task[None]] = set()

    def list_routes(self) -> list[Route]:
        """Every address that the page asks for."""
        post = ["POST"]
        routes = [
            Route("/", self.send_index),
            *(Route(f"/{name}", _send_asset) for name in _ASSETS),
            Route("/api/start", answer_safely(self.describe_start)),
            Route("/api/threads", answer_safely(self.create_thread), methods=post),
            Route("/api/threads/{thread}", answer_safely(self.describe_thread)),
            Route("/api/threads/{thread}/turn", answer_safely(self.take_turn), methods=post),
            Route("/api/threads/{thread}/compare", answer_safely(self.compare_versions)),
            Route("/api/threads/{thread}/made", answer_safely(self.describe_making)),
            Route("/api/threads/{thread}/handles", answer_safely(self.list_handles)),
            Route("/api/threads/{thread}/log", answer_safely(self.list_log)),
            Route("/api/threads/{thread}/{name}", answer_safely(self.send_file)),
            Route("/api/intersections/{name}.png", answer_safely(self.draw_map)),
            Route("/api/plan/schema", answer_safely(self.send_plan_schema)),
            Route("/api/plan", answer_safely(self.describe_plan), methods=post),
            *self._choice.list_routes(),
            *self._batches.list_routes(),
            *self._own_maps.list_routes(),
        ]
        return [*routes, describe_routes(routes)]

    async def send_index(self, _request: Request) -> Response:
        """The page itself."""
        return HTMLResponse(_read_asset("index.html"))

    def describe_start(self, _request: Request) -> Response:
        """Intersections, words, formats, conversations, backend, what is missing to import maps."""
        from scenewright.tools.exporters import FORMATS
        from scenewright.tools.map_import.check_file import SUMO

        return JSONResponse(
            {
                "intersections": list_places(),
                "words": list_words(),
                "formats": {name: each.title for name, each in FORMATS.items()},
                "threads": self._conversations.list_names(),
                "backend": self._choice.name,
                "intersection": self._intersection,
                "missing": describe_missing(*SUMO),
            }
        )

    async def create_thread(self, request: Request) -> Response:
        """A new conversation: {"intersection", "seed"}."""
        asked = await read_object(request)
        name, seed = asked.get("intersection", self._intersection), asked.get("seed")
        if not isinstance(name, str) or not (seed is None or type(seed) is int):
            raise InputError("a conversation needs the name of an intersection and a whole seed")
        made = await run_in_threadpool(self._conversations.create, name, seed)
        return JSONResponse(await run_in_threadpool(made.describe))

    def describe_thread(self, request: Request) -> Response:
        """Versions, branches and what is current."""
        return JSONResponse(self._find(request).describe())

    async def take_turn(self, request: Request) -> Response:
        """One turn, {"action", "argument"}; answers lines of JSON: stages, then the reply.

        The turn goes on to its end when the browser leaves; its version is there afterwards.
        """
        asked = await read_object(request)
        found = await run_in_threadpool(self._find, request)
        action, argument = read_text(asked, "action"), read_text(asked, "argument", "")
        if found.busy:
            raise BusyError("a turn of this conversation is still being worked on")
        lines: asyncio.Queue[dict[str, Any] | None] = asyncio.Queue()
        task = asyncio.create_task(_work(found, action, argument, lines))
        self._running.add(task)
        task.add_done_callback(self._running.discard)
        return StreamingResponse(_send_lines(lines), media_type="application/x-ndjson")

    def compare_versions(self, request: Request) -> Response:
        """What differs between the versions `first` and `second`."""
        query = request.query_params
        lines = self._find(request).compare(query.get("first", ""), query.get("second", ""))
        return JSONResponse({"lines": lines})

    def list_handles(self, request: Request) -> Response:
        """What can be changed by hand in a version."""
        which = request.query_params.get("version")
        return JSONResponse({"handles": self._find(request).list_handles(which)})

    def list_log(self, request: Request) -> Response:
        """What was said so far, and every reply."""
        return JSONResponse({"turns": self._find(request).list_log()})

    def describe_making(self, request: Request) -> Response:
        """How a version came about: its provenance."""
        shown = self._find(request).find(request.query_params.get("version"))
        made = shown.provenance
        for each in made.get("rejections", []):
            each["detail"] = speak_plainly(each["detail"], shown.record)
        return JSONResponse(made)

    def send_file(self, request: Request) -> Response:
        """`page.html`, `scene.json` or `proof.json` of a version; `download=1` saves it.

        `scene.png`, `scene.gif` and `scene.mp4` are its views, `export.zip` its files in a
        `format`. The page may have another version, `over`, laid over it.
        """
        found, name, query = self._find(request), request.path_params["name"], request.query_params
        which = query.get("version")
        if name == "page.html":
            response: Response = HTMLResponse(found.build_page(which, query.get("over")))
            # the page carries its own policy; only this server may frame it
            response.headers["Content-Security-Policy"] = "frame-ancestors 'self'"
        elif name in ("scene.json", "proof.json"):
            shown = found.find(which)
            body = shown.scene_json if name == "scene.json" else shown.proof_json
            response = Response(body, media_type="application/json")
        elif name in SAVED:
            body = write_saved(found.find(which), name, query.get("format", ""))
            response = Response(body, media_type=SAVED[name])
        else:
            raise HTTPException(404)
        if "download" in query:
            response.headers["Content-Disposition"] = f'attachment; filename="{name}"'
        return response

    def draw_map(self, request: Request) -> Response:
        """A picture of an intersection."""
        return Response(_draw_intersection(request.path_params["name"]), media_type="image/png")

    def send_plan_schema(self, _request: Request) -> Response:
        """The JSON Schema of plans, of which the form is made."""
        return JSONResponse(build_plan_schema())

    async def describe_plan(self, request: Request) -> Response:
        """A plan and its words, of {"words"}, of the fields of a {"plan"}, or of a {"thread"}."""
        asked = await read_object(request)
        place = read_text(asked, "intersection", self._intersection)
        if "plan" in asked:
            found = await run_in_threadpool(read_plan_object, asked["plan"], place)
        elif "thread" in asked:
            name, which = read_text(asked, "thread"), asked.get("version")
            held = await run_in_threadpool(self._conversations.get, name)
            found = await run_in_threadpool(held.find_plan, which)
        else:
            words = read_text(asked, "words")
            plan = await run_in_threadpool(self._conversations.plan, words, place)
            found = PlanFile(plan, words, as_read=True)
        return JSONResponse(describe_plan_file(found))

    def _find(self, request: Request) -> Conversation:
        return self._conversations.get(request.path_params["thread"])


def build_app(page: Page, *, token: str, hosts: frozenset[str]) -> Starlette:
    """The whole application."""
    guard = Middleware(Guard, token=token, hosts=hosts)
    return Starlette(routes=page.list_routes(), middleware=[guard])


async def _work(
    found: Conversation, action: str, argument: str, lines: asyncio.Queue[dict[str, Any] | None]
) -> None:
    loop = asyncio.get_running_loop()

    def log(stage: str, line: str) -> None:
        loop.call_soon_threadsafe(lines.put_nowait, {"stage": stage, "line": line})

    try:
        reply = await run_in_threadpool(found.act, action, argument, log)
    except (InputError, Unsatisfiable, BackendFault) as error:
        reply = {"kind": "refused", "lines": [f"refused: {error}"], "why": [], "choices": []}
    except Exception as error:
        reply = {"kind": "refused", "lines": [describe_fault(error)], "why": [], "choices": []}
    lines.put_nowait({"reply": reply})
    lines.put_nowait(None)


async def _send_lines(lines: asyncio.Queue[dict[str, Any] | None]) -> AsyncIterator[bytes]:
    while (line := await lines.get()) is not None:
        yield json.dumps(line).encode() + b"\n"


async def _send_asset(request: Request) -> Response:
    name = request.url.path.lstrip("/")
    return Response(_read_asset(name), media_type=_ASSETS[name])


@lru_cache
def _read_asset(name: str) -> str:
    return (files("scenewright.cli.page") / "assets" / name).read_text(encoding="utf-8")


@lru_cache(maxsize=32)
def _draw_intersection(name: str) -> bytes:
    import tempfile
    from pathlib import Path

    from scenewright.viz.intersection_picture import draw_intersection

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "map.png"
        draw_intersection(path, intersection=load_map(name), dpi=80)
        return path.read_bytes()
