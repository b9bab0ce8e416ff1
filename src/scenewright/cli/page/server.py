"""The page's server: one application on 127.0.0.1 that answers only to its own token."""

from __future__ import annotations

import asyncio
import json
import os
import re
import secrets
import tomllib
from collections.abc import AsyncIterator, Callable
from functools import cache, lru_cache, partial
from importlib.resources import files
from pathlib import Path
from typing import Any

from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.exceptions import HTTPException
from starlette.middleware import Middleware
from starlette.middleware.base import BaseHTTPMiddleware
from starlette.requests import Request
from starlette.responses import Response, StreamingResponse
from starlette.routing import Route

from scenewright.backends import Backend, load_backend
from scenewright.cli.batch import RunOptions
from scenewright.cli.options import SessionOptions
from scenewright.cli.page.asked import BackendChoice, NewThread, PlanSource, Turn
from scenewright.cli.page.batches import Batches
from scenewright.cli.page.conversations import (
    Conversation,
    Conversations,
    check_plan_object,
    describe_plan_file,
)
from scenewright.cli.page.own_maps import OwnMaps
from scenewright.cli.page.routes import build_routes, describe_fault, refuse
from scenewright.cli.saved import SAVED, write_saved
from scenewright.cli.views import render
from scenewright.errors import BackendFault, BusyError, InputError, Unsatisfiable
from scenewright.extras import describe_missing
from scenewright.intersections import list_intersections, load_map
from scenewright.scene.map import IntersectionMap
from scenewright.scene.phrasing import speak_plainly
from scenewright.scene.plan_file import PlanFile, build_plan_schema

KEYS = {"anthropic": "ANTHROPIC_API_KEY", "openai": "OPENAI_API_KEY"}
_NAMES = re.compile(r"builtin|(?:anthropic|openai):[\w./:@-]{1,100}")


class ModelChoice:
    """The backend of all conversations, until another is chosen."""

    def __init__(self, conversations: Conversations, name: str) -> None:
        self._conversations = conversations
        self.name = name

    def list_answers(self) -> dict[str, Callable[..., Any]]:
        """The addresses of the settings."""
        return {"GET /api/settings": self.describe, "POST /api/settings/backend": self.choose}

    def describe(self) -> dict[str, Any]:
        """The backend, and whether the environment holds the key of each maker."""
        keys = {key: bool(os.environ.get(key)) for key in KEYS.values()}
        return {"backend": self.name, "keys": keys}

    def choose(self, asked: BackendChoice) -> dict[str, Any]:
        """Another backend from now on.

        Raises:
            InputError: there is none such, or its key or package is missing.
        """
        if not _NAMES.fullmatch(asked.backend):
            raise InputError("a backend is builtin, anthropic:MODEL or openai:MODEL")
        self._conversations.speak_with(load_backend(asked.backend, base_url=asked.base_url or None))
        self.name = asked.backend
        return self.describe()


EVENTS = (
    "hits", "is hit by", "rear-ends", "is rear-ended by", "sideswipes", "T-bones",
    "collides head-on with", "narrowly misses", "yields to", "follows", "cuts off",
    "runs the red light", "turning left", "turning right", "going straight", "crosses",
    "jaywalks", "brakes hard", "hidden behind a parked truck", "in light traffic",
    "in heavy traffic", "at night", "at noon", "at rush hour",
)  # fmt: skip


def list_places() -> list[dict[str, Any]]:
    """The intersections: name, title, examples that can happen there, and words for places."""
    places = [load_map(intersection) for intersection in list_intersections()]
    return [
        {"name": place.name, "title": place.title, "examples": write_examples(place),
         "words": _name_places(place)}
        for place in places
    ]  # fmt: skip


@cache
def list_words() -> list[str]:
    """Road users and events, shorter ones first."""
    source = files("scenewright.tools.account").joinpath("words.toml").read_text("utf-8")
    nouns = {
        word.lstrip("=") for group in tomllib.loads(source)["nouns"].values() for word in group
    }
    return sorted({*nouns, *EVENTS}, key=lambda each: (len(each), each))


def write_examples(place: IntersectionMap) -> list[str]:
    """Sentences whose ways there are on this map."""
    walked = {crosswalk.leg for crosswalk in place.crosswalks}
    ways = {
        movement.turn: movement
        for movement in reversed(place.movements)
        if movement.turn == "straight" or movement.exit in walked
    }
    wanted = {
        "left": "A car from the {0} turning left narrowly misses a pedestrian on the {1} crosswalk "
        "at 8 am",
        "straight": "A van is rear-ended by a car on the approach from the {0}",
        "right": "A truck from the {0} turning right yields to a pedestrian on the {1} crosswalk",
    }
    found = [text.format(ways[t].entry, ways[t].exit) for t, text in wanted.items() if t in ways]
    return [*found, "A taxi hits a cyclist at night", "A normal morning in dense traffic"]


def _name_places(place: IntersectionMap) -> list[str]:
    legs = [f"from the {leg.name}" for leg in place.legs]
    walks = [f"on the {crosswalk.leg} crosswalk" for crosswalk in place.crosswalks]
    streets = [f"on {leg.road}" for leg in place.legs if leg.road]
    return list(dict.fromkeys([*legs, *walks, *streets]))


_POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; "
    "img-src 'self' data:; frame-src 'self'; base-uri 'none'; form-action 'none'; "
    "frame-ancestors 'none'"
)
_ASSETS = ("app.css", "app.js", "batch.js", "places.js", "hand.js", "plan.js", "run_graph.js")
_KINDS = {".html": "text/html", ".css": "text/css", ".js": "text/javascript"}


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
        run = RunOptions(workers=1, time_limit=options.time_limit, lawful=options.lawful)
        self._batches = Batches(folder / "page-batches", run)
        self._own_maps = OwnMaps(folder / "page-maps")
        self._running: set[asyncio.Task[None]] = set()

    def close(self) -> None:
        """Ends what runs; all of it can be gone on with."""
        self._conversations.close()
        self._batches.close()

    def list_routes(self) -> list[Route]:
        """Every address that the page asks for."""
        answers: dict[str, Callable[..., Any]] = {
            "GET /api/start": self.describe_start,
            "POST /api/threads": self.create_thread,
            "GET /api/threads/{thread}": self.describe_thread,
            "POST /api/threads/{thread}/turn": self.take_turn,
            "GET /api/threads/{thread}/compare": self.compare_versions,
            "GET /api/threads/{thread}/made": self.describe_making,
            "GET /api/threads/{thread}/handles": self.list_handles,
            "GET /api/threads/{thread}/log": self.list_log,
            "GET /api/threads/{thread}/{name}": self.send_file,
            "GET /api/intersections/{name}.png": self.draw_map,
            "GET /api/plan/schema": self.send_plan_schema,
            "POST /api/plan": self.describe_plan,
            **self._choice.list_answers(),
            **self._batches.list_answers(),
            **self._own_maps.list_answers(),
        }
        assets = [Route(f"/{name}", _send_asset) for name in ("", *_ASSETS)]
        return [*assets, *build_routes(answers)]

    def describe_start(self) -> dict[str, Any]:
        """Intersections, words, formats, conversations, backend, what is missing to import maps."""
        from scenewright.tools.formats import FORMATS
        from scenewright.tools.map_import.check_file import SUMO

        return {
            "intersections": list_places(),
            "words": list_words(),
            "formats": {name: each.title for name, each in FORMATS.items()},
            "threads": self._conversations.list_names(),
            "backend": self._choice.name,
            "intersection": self._intersection,
            "missing": describe_missing(*SUMO),
        }

    def create_thread(self, asked: NewThread) -> dict[str, Any]:
        """A new conversation: {"intersection", "seed"}, else those of the page."""
        return self._conversations.create(asked).describe()

    def describe_thread(self, thread: str) -> dict[str, Any]:
        """Versions, branches and what is current."""
        return self._conversations.get(thread).describe()

    async def take_turn(self, thread: str, asked: Turn) -> LinesResponse:
        """One turn, {"action", "argument"}; answers lines of JSON: stages, then the reply.

        The turn goes on to its end when the browser leaves; its version is there afterwards.
        """
        found = await run_in_threadpool(self._conversations.get, thread)
        if found.busy:
            raise BusyError("a turn of this conversation is still being worked on")
        lines: asyncio.Queue[dict[str, Any] | None] = asyncio.Queue()
        task = asyncio.create_task(_work(found, asked, lines))
        self._running.add(task)
        task.add_done_callback(self._running.discard)
        return LinesResponse(_send_lines(lines))

    def compare_versions(self, thread: str, first: str = "", second: str = "") -> dict[str, Any]:
        """What differs between the versions `first` and `second`."""
        return {"lines": self._conversations.get(thread).compare(first, second)}

    def list_handles(self, thread: str, version: str | None = None) -> dict[str, Any]:
        """What can be changed by hand in a version."""
        return {"handles": self._conversations.get(thread).list_handles(version)}

    def list_log(self, thread: str) -> dict[str, Any]:
        """What was said so far, and every reply."""
        return {"turns": self._conversations.get(thread).list_log()}

    def describe_making(self, thread: str, version: str | None = None) -> dict[str, Any]:
        """How a version came about: its provenance."""
        shown = self._conversations.get(thread).find(version)
        made = shown.provenance
        for each in made.get("rejections", []):
            each["detail"] = speak_plainly(each["detail"], shown.record)
        return made

    def send_file(
        self,
        thread: str,
        name: str,
        version: str | None = None,
        over: str | None = None,
        download: str | None = None,
        format: str = "",
    ) -> Response:
        """`page.html`, `scene.json` or `proof.json` of a version; `download=1` saves it.

        `scene.png`, `scene.gif` and `scene.mp4` are its views, `export.zip` its files in a
        `format`. The page may have another version, `over`, laid over it.
        """
        if name not in SAVED:
            raise HTTPException(404)
        found, headers = self._conversations.get(thread), {}
        upper = found.find(over) if over else None
        body = write_saved(found.find(version), name, form=format, over=upper)
        if name == "page.html":  # it carries its own policy; only this server may frame it
            headers["Content-Security-Policy"] = "frame-ancestors 'self'"
        if download is not None:
            headers["Content-Disposition"] = f'attachment; filename="{name}"'
        return Response(body, media_type=SAVED[name], headers=headers)

    def draw_map(self, name: str) -> PictureResponse:
        """A picture of an intersection."""
        return PictureResponse(_draw_intersection(name))

    def send_plan_schema(self) -> dict[str, Any]:
        """The JSON Schema of plans, of which the form is made."""
        return build_plan_schema()

    def describe_plan(self, asked: PlanSource) -> dict[str, Any]:
        """A plan and its words, of {"words"}, of the fields of a {"plan"}, or of a {"thread"}."""
        place = asked.intersection or self._intersection
        if asked.plan is not None:
            return describe_plan_file(check_plan_object(asked.plan, place))
        if asked.thread is not None:
            found = self._conversations.get(asked.thread)
            return describe_plan_file(found.find_plan(asked.version))
        if asked.words is None:
            raise InputError("name words, a plan or a thread")
        plan = self._conversations.plan(asked.words, place)
        return describe_plan_file(PlanFile(plan, asked.words, as_read=True))


class LinesResponse(StreamingResponse):
    """Lines of JSON, each sent when it is there."""

    media_type = "application/x-ndjson"


class PictureResponse(Response):
    """A picture."""

    media_type = "image/png"


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
    name = request.url.path.lstrip("/") or "index.html"
    return Response(_read_asset(name), media_type=_KINDS[Path(name).suffix])


@lru_cache
def _read_asset(name: str) -> str:
    return (files("scenewright.cli.page") / "assets" / name).read_text(encoding="utf-8")


@lru_cache(maxsize=32)
def _draw_intersection(name: str) -> bytes:
    from scenewright.viz.intersection_picture import draw_intersection

    return render(partial(draw_intersection, intersection=load_map(name), dpi=80))
