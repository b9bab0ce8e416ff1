"""The HTTP interface as an OpenAPI document, made from the routes themselves.

Addresses, methods and summaries are those of the routes; what they are asked with is listed here,
bodies as the models by which they are read.
"""

from __future__ import annotations

import inspect
from collections.abc import Mapping, Sequence
from typing import Any, Literal

from pydantic import Field
from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.routing import Route

from scenewright.scene.base import Model

SCHEMA = "/api/openapi.json"
_TEXT = {"type": "string"}
_BYTES = {"type": "string", "format": "binary"}
ACTIONS = ("say", "say_without", "make", "make_without", "plan", "edit", "undo", "redo", "branch")


class NewThread(Model):
    """Where a conversation is begun; the page's own place and seed where none is given."""

    intersection: str | None = None
    seed: int | None = Field(default=None, strict=True)


class Turn(Model):
    """A turn of a conversation."""

    action: str = Field(json_schema_extra={"enum": list(ACTIONS)})
    argument: str = ""


class PlanSource(Model):
    """What a plan is made from: its fields, a version of a conversation, or words."""

    intersection: str | None = None
    plan: Any = None
    thread: str | None = None
    version: str | None = None
    words: str | None = None


class BackendChoice(Model):
    """Who plans and reasons from now on."""

    backend: str
    base_url: str = ""


class JunctionChoice(Model):
    """A junction of a map file, and how it becomes an intersection."""

    name: str
    junction: str | None = None
    side: Literal["", "left", "right"] = ""
    signals: Literal["", "keep", "assume", "none"] = ""


_BODIES: Mapping[str, type[Model]] = {
    "/api/threads": NewThread,
    "/api/threads/{thread}/turn": Turn,
    "/api/plan": PlanSource,
    "/api/settings/backend": BackendChoice,
    "/api/maps/{map}/import": JunctionChoice,
}
"""Address -> the JSON that is its body; that of other POSTs is a file."""
_FILES = {"/api/batches/new": "application/x-ndjson", "/api/maps": "application/octet-stream"}
_QUERIES: dict[str, tuple[str, ...]] = {
    "/api/threads/{thread}/compare": ("first", "second"),
    "/api/threads/{thread}/made": ("version",),
    "/api/threads/{thread}/handles": ("version",),
    "/api/threads/{thread}/{name}": ("version", "over", "download", "format"),
    "/api/batches/new": ("intersection", "backend"),
    "/api/batches/{batch}": ("after",),
    "/api/maps": ("name",),
}
"""Address -> what may stand behind its question mark."""
_ANSWERS = {
    "/api/threads/{thread}/turn": "application/x-ndjson",
    "/api/threads/{thread}/{name}": "*/*",
    "/api/intersections/{name}.png": "image/png",
    "/api/batches/{batch}/{row}/page.html": "text/html",
}
"""Address -> type of an answer that is not JSON."""
_REFUSED = {
    "description": "refused, with the reason",
    "content": {
        "application/json": {
            "schema": {
                "type": "object",
                "required": ["reason"],
                "properties": {"reason": _TEXT},
            }
        }
    },
}


def describe_routes(routes: Sequence[Route]) -> Route:
    """The route that answers with the document about the routes, itself included."""

    async def send_schema(_request: Request) -> Response:
        """This document."""
        return JSONResponse(document)

    own = Route(SCHEMA, send_schema)
    document = build_schema([*routes, own])
    return own


def build_schema(routes: Sequence[Route]) -> dict[str, Any]:
    """The OpenAPI 3.1 document of all routes under /api/."""
    from scenewright import __version__

    paths: dict[str, dict[str, Any]] = {}
    for route in routes:
        if route.path.startswith("/api/"):
            method = "post" if route.methods and "POST" in route.methods else "get"
            paths.setdefault(_write_path(route), {})[method] = _describe(route, method)
    key = {"type": "apiKey", "in": "header", "name": "X-Token"}
    return {
        "openapi": "3.1.0",
        "info": {"title": "scenewright serve", "version": __version__},
        "security": [{"token": []}],
        "components": {"securitySchemes": {"token": key}},
        "paths": paths,
    }


def _write_path(route: Route) -> str:
    """The address without the types that starlette lets parameters have."""
    return route.path.replace(":int}", "}")


def _describe(route: Route, method: str) -> dict[str, Any]:
    path = _write_path(route)
    named = [
        {"name": name, "in": "path", "required": True, "schema": _TEXT}
        for name in route.param_convertors
    ]
    asked = [{"name": name, "in": "query", "schema": _TEXT} for name in _QUERIES.get(path, ())]
    answer: dict[str, Any] = {_ANSWERS.get(path, "application/json"): {}}
    said = inspect.getdoc(route.endpoint) or ""
    found: dict[str, Any] = {
        "summary": " ".join(said.split("\n\n")[0].split()),
        "responses": {
            "200": {"description": "done", "content": answer},
            **dict.fromkeys(("400", "401", "403", "404", "409"), _REFUSED),
        },
    }
    if named or asked:
        found["parameters"] = [*named, *asked]
    content: dict[str, Any] = {}
    if method == "post" and path in _BODIES:
        content = {"application/json": {"schema": _BODIES[path].model_json_schema()}}
    elif method == "post" and path in _FILES:
        content = {_FILES[path]: {"schema": _BYTES}}
    if content:
        found["requestBody"] = {"required": True, "content": content}
    return found
