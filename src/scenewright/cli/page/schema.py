"""The HTTP interface as an OpenAPI document, made from the routes themselves.

Addresses, methods and summaries are those of the routes; what they are asked with is listed here.
"""

from __future__ import annotations

import inspect
from collections.abc import Sequence
from typing import Any

from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.routing import Route

SCHEMA = "/api/openapi.json"
_TEXT: dict[str, Any] = {"type": "string"}
_WHOLE: dict[str, Any] = {"type": "integer"}


def _build_object(required: Sequence[str], **properties: dict[str, Any]) -> dict[str, Any]:
    return {"type": "object", "required": list(required), "properties": properties}


ACTIONS = ("say", "say_without", "make", "make_without", "plan", "edit", "undo", "redo", "branch")
_BODIES: dict[str, tuple[str, dict[str, Any]]] = {
    "/api/threads": ("application/json", _build_object((), intersection=_TEXT, seed=_WHOLE)),
    "/api/threads/{thread}/turn": (
        "application/json",
        _build_object(("action",), action={"enum": list(ACTIONS)}, argument=_TEXT),
    ),
    "/api/plan": (
        "application/json",
        _build_object((), intersection=_TEXT, words=_TEXT, plan={"type": "object"}, thread=_TEXT),
    ),
    "/api/settings/backend": (
        "application/json", _build_object(("backend",), backend=_TEXT, base_url=_TEXT)
    ),
    "/api/batches/new": ("application/x-ndjson", {"type": "string", "format": "binary"}),
    "/api/maps": ("application/octet-stream", {"type": "string", "format": "binary"}),
    "/api/maps/{map}/import": (
        "application/json",
        _build_object(
            ("name",), name=_TEXT, junction=_TEXT,
            side={"enum": ["", "left", "right"]}, signals={"enum": ["", "keep", "assume", "none"]},
        ),
    ),
}  # fmt: skip
"""Address -> type and schema of the body of a POST."""
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
    "content": {"application/json": {"schema": _build_object(("reason",), reason=_TEXT)}},
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
    if method == "post" and path in _BODIES:
        kind, schema = _BODIES[path]
        found["requestBody"] = {"required": True, "content": {kind: {"schema": schema}}}
    return found
