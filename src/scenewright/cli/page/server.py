"""The page's server: one application on 127.0.0.1 that answers only to its own token."""

from __future__ import annotations

import asyncio
import json
import secrets
from collections.abc import AsyncIterator
from functools import lru_cache, partial
from importlib.resources import files
from pathlib import Path
from typing import Any

from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.exceptions import HTTPException
from starlette.middleware import Middleware
from starlette.middleware.base import BaseHTTPMiddleware
from starlette.requests import Request
from starlette.responses import HTMLResponse, JSONResponse, Response, StreamingResponse
from starlette.routing import Route

from scenewright.backends import Backend
from scenewright.cli.options import SessionOptions
from scenewright.cli.page.answers import (
    answer_safely,
    describe_fault,
    read_model,
    refuse,
)
from scenewright.cli.page.batches import Batches
from scenewright.cli.page.conversations import (
    Conversation,
    Conversations,
    check_plan_object,
    describe_plan_file,
)
from scenewright.cli.page.model_choice import ModelChoice
from scenewright.cli.page.own_maps import OwnMaps
from scenewright.cli.page.saved import SAVED, write_saved
from scenewright.cli.page.schema import NewThread, PlanSource, Turn, describe_routes
from scenewright.cli.page.suggestions import list_places, list_words
from scenewright.cli.views import render
from scenewright.errors import BackendFault, BusyError, InputError, Unsatisfiable
from scenewright.extras import describe_missing
from scenewright.intersections import load_map
from scenewright.scene.phrasing import speak_plainly
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

    def __init__(self, options: SessionOptions, backend: Backend, folder: Path) -> None:
        """Batches and maps of one's own lie in the folder."""
        self._intersection = options.intersection
        self._conversations = Conversations(options, backend)
        name = ", ".join(options.model.backend or ["builtin"])
        self._choice = ModelChoice(self._conversations, name)
        self._batches = Batches(
            folder / "page-batches", time_limit=options.time_limit, lawful=options.lawful
        )
        self._own_maps = OwnMaps(folder / "page-maps")
        self._running: set[asyncio.Task[None]] = set()

    def close(self) -> None:
        """Ends what runs; all of it can be gone on with."""
        self._conversations.close()
        self._batches.close()

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
        from scenewright.tools.formats import FORMATS
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
        asked = await read_model(request, NewThread)
        place = asked.intersection or self._intersection
        made = await run_in_threadpool(self._conversations.create, place, asked.seed)
        return JSONResponse(await run_in_threadpool(made.describe))

    def describe_thread(self, request: Request) -> Response:
        """Versions, branches and what is current."""
        return JSONResponse(self._find(request).describe())

    async def take_turn(self, request: Request) -> Response:
        """One turn, {"action", "argument"}; answers lines of JSON: stages, then the reply.

        The turn goes on to its end when the browser leaves; its version is there afterwards.
        """
        asked = await read_model(request, Turn)
        found = await run_in_threadpool(self._find, request)
        if found.busy:
            raise BusyError("a turn of this conversation is still being worked on")
        lines: asyncio.Queue[dict[str, Any] | None] = asyncio.Queue()
        task = asyncio.create_task(_work(found, asked, lines))
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
        found, name = self._find(request), request.path_params["name"]
        query, headers = request.query_params, {}
        if name == "page.html":
            body: str | bytes = found.build_page(query.get("version"), query.get("over"))
            kind = "text/html"
            # the page carries its own policy; only this server may frame it
            headers["Content-Security-Policy"] = "frame-ancestors 'self'"
        elif name in ("scene.json", "proof.json"):
            shown = found.find(query.get("version"))
            body = shown.scene_json if name == "scene.json" else shown.proof_json
            kind = "application/json"
        elif name in SAVED:
            shown = found.find(query.get("version"))
            body, kind = write_saved(shown, name, query.get("format", "")), SAVED[name]
        else:
            raise HTTPException(404)
        if "download" in query:
            headers["Content-Disposition"] = f'attachment; filename="{name}"'
        return Response(body, media_type=kind, headers=headers)

    def draw_map(self, request: Request) -> Response:
        """A picture of an intersection."""
        return Response(_draw_intersection(request.path_params["name"]), media_type="image/png")

    def send_plan_schema(self, _request: Request) -> Response:
        """The JSON Schema of plans, of which the form is made."""
        return JSONResponse(build_plan_schema())

    async def describe_plan(self, request: Request) -> Response:
        """A plan and its words, of {"words"}, of the fields of a {"plan"}, or of a {"thread"}."""
        asked = await read_model(request, PlanSource)
        found = await run_in_threadpool(self._find_plan, asked)
        return JSONResponse(describe_plan_file(found))

    def _find_plan(self, asked: PlanSource) -> PlanFile:
        place = asked.intersection or self._intersection
        if asked.plan is not None:
            return check_plan_object(asked.plan, place)
        if asked.thread is not None:
            return self._conversations.get(asked.thread).find_plan(asked.version)
        if asked.words is None:
            raise InputError("name words, a plan or a thread")
        return PlanFile(self._conversations.plan(asked.words, place), asked.words, as_read=True)

    def _find(self, request: Request) -> Conversation:
        return self._conversations.get(request.path_params["thread"])


def build_app(page: Page, *, token: str, hosts: frozenset[str]) -> Starlette:
    """The whole application."""
    guard = Middleware(Guard, token=token, hosts=hosts)
    return Starlette(routes=page.list_routes(), middleware=[guard])


async def _work(
    found: Conversation, asked: Turn, lines: asyncio.Queue[dict[str, Any] | None]
) -> None:
    loop = asyncio.get_running_loop()

    def log(stage: str, line: str) -> None:
        loop.call_soon_threadsafe(lines.put_nowait, {"stage": stage, "line": line})

    try:
        reply = await run_in_threadpool(found.act, asked.action, asked.argument, log)
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
    from scenewright.viz.intersection_picture import draw_intersection

    return render(partial(draw_intersection, intersection=load_map(name), dpi=80))
