"""Addresses of the page: what one is asked with is the signature of the function that answers.

Of this their OpenAPI document is made, too: addresses and summaries are those of the functions.
"""

from __future__ import annotations

import inspect
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, get_args, get_type_hints

from pydantic import TypeAdapter, ValidationError
from starlette.concurrency import run_in_threadpool
from starlette.exceptions import HTTPException
from starlette.requests import ClientDisconnect, Request
from starlette.responses import JSONResponse, Response
from starlette.routing import Route

from scenewright.cli.options import Asked
from scenewright.errors import BackendFault, BusyError, InputError, Unsatisfiable, describe_misfit

SCHEMA = "/api/openapi.json"
MOST_BODY = 100_000
"""Bytes of a request in JSON; words are far shorter."""


@dataclass(frozen=True)
class Upload:
    """Marks a parameter that is the body as it is sent: its most bytes, and its media type."""

    most: int
    kind: str


class _Parameter:
    """A parameter of an answer: a part of the address, the body, or what follows the `?`."""

    def __init__(self, each: inspect.Parameter, hint: Any, path: str) -> None:
        self.name, self.default = each.name, each.default
        self.adapter = TypeAdapter[Any](hint)
        self.upload = next((note for note in get_args(hint) if isinstance(note, Upload)), None)
        self.is_list = hint == list[str]
        is_body = self.upload or (isinstance(hint, type) and issubclass(hint, Asked))
        is_path = f"{{{each.name}}}" in path or f"{{{each.name}:" in path
        self.place = "path" if is_path else "body" if is_body else "query"

    async def read(self, request: Request) -> Any:
        """Its value in a request; InputError, which names the field, if it has none."""
        if self.upload is not None:
            return await read_bytes(request, self.upload.most)
        try:
            if self.place == "body":
                return self.adapter.validate_json(await read_bytes(request, MOST_BODY))
            if self.place == "path":
                return request.path_params[self.name]
            if (
                self.name not in request.query_params
                and self.default is not inspect.Parameter.empty
            ):
                return self.default
            given = request.query_params.getlist(self.name)
            return self.adapter.validate_python(given if self.is_list else "".join(given[-1:]))
        except ValidationError as error:
            whole = "the request" if self.place == "body" else self.name
            raise InputError(describe_misfit(error, whole)) from error


def build_routes(answers: Mapping[str, Callable[..., Any]]) -> list[Route]:
    """The routes of answers by `METHOD /address`, and that of the document about all of them.

    An answer that is no coroutine has a thread; it gives a response, or what is sent as JSON.
    """
    document: dict[str, Any] = {}

    def send_schema() -> dict[str, Any]:
        """This document."""
        return document

    routes, paths = [], dict[str, dict[str, Any]]()
    for address, answer in {**answers, f"GET {SCHEMA}": send_schema}.items():
        method, path = address.split()
        hints = get_type_hints(answer, include_extras=True)
        own = [
            _Parameter(each, hints[name], path)
            for name, each in inspect.signature(answer).parameters.items()
        ]
        routes.append(Route(path, _answer_safely(answer, own), methods=[method]))
        told = _describe(answer, own, getattr(hints["return"], "media_type", "application/json"))
        paths.setdefault(path.replace(":int}", "}"), {})[method.lower()] = told
    from scenewright import __version__

    key = {"type": "apiKey", "in": "header", "name": "X-Token"}
    document |= {
        "openapi": "3.1.0",
        "info": {"title": "scenewright serve", "version": __version__},
        "security": [{"token": []}],
        "components": {"securitySchemes": {"token": key}},
        "paths": paths,
    }
    return routes


def _answer_safely(answer: Callable[..., Any], own: list[_Parameter]) -> Callable[..., Any]:
    """The answer to a request, with what goes wrong as one line of JSON."""

    async def run(request: Request) -> Response:
        try:
            given = {each.name: await each.read(request) for each in own}
            if inspect.iscoroutinefunction(answer):
                result = await answer(**given)
            else:
                result = await run_in_threadpool(answer, **given)
            return result if isinstance(result, Response) else JSONResponse(result)
        except BusyError as error:
            return refuse(409, str(error))
        except (InputError, Unsatisfiable, BackendFault) as error:
            return refuse(400, str(error))
        except HTTPException:
            return refuse(404, "there is nothing at this address")
        except Exception as error:
            return refuse(500, describe_fault(error))

    return run


def describe_fault(error: Exception) -> str:
    """One line for the page; the same goes to stderr."""
    line = f"a fault in scenewright itself: {type(error).__name__}: {error}"[:300]
    print(f"scenewright: {line}", file=sys.stderr)
    return line


def refuse(status: int, reason: str) -> JSONResponse:
    """A refusal with its reason."""
    return JSONResponse({"reason": reason}, status_code=status)


async def read_bytes(request: Request, limit: int) -> bytes:
    """The body of a request.

    Raises:
        InputError: it is longer than `limit` bytes, or ends before its length.
    """
    parts, size = [], 0
    try:
        async for part in request.stream():
            size += len(part)
            if size > limit:
                raise InputError(f"this may have at most {limit:,} bytes")
            parts.append(part)
    except ClientDisconnect as error:
        raise InputError("the request ended before its body") from error
    return b"".join(parts)


_REASON = {"type": "object", "required": ["reason"], "properties": {"reason": {"type": "string"}}}
_REFUSED = {
    "description": "refused, with the reason",
    "content": {"application/json": {"schema": _REASON}},
}


def _describe(
    answer: Callable[..., Any], own: list[_Parameter], kind: str | None
) -> dict[str, Any]:
    """An address in the document."""
    said = inspect.getdoc(answer) or ""
    told: dict[str, Any] = {
        "summary": " ".join(said.split("\n\n")[0].split()),
        "responses": {
            "200": {"description": "done", "content": {kind or "*/*": {}}},
            **dict.fromkeys(("400", "401", "403", "404", "409"), _REFUSED),
        },
    }
    if named := [each for each in own if each.place != "body"]:
        told["parameters"] = [
            {"name": each.name, "in": each.place, "required": each.place == "path",
             "schema": each.adapter.json_schema()}
            for each in named
        ]  # fmt: skip
    for each in own:
        if each.place == "body":
            sent = "application/json" if each.upload is None else each.upload.kind
            content = {sent: {"schema": each.adapter.json_schema()}}
            told["requestBody"] = {"required": True, "content": content}
    return told
