"""What all answers of the page's server share: bodies read with a limit, faults as one line."""

from __future__ import annotations

import json
import sys
from collections.abc import Awaitable, Callable
from functools import wraps
from typing import Any

from starlette.concurrency import run_in_threadpool
from starlette.exceptions import HTTPException
from starlette.requests import ClientDisconnect, Request
from starlette.responses import JSONResponse, Response

from scenewright.errors import BackendFault, BusyError, InputError, Unsatisfiable

MOST_BODY = 100_000
"""Bytes of a request in JSON; words are far shorter."""
Answer = Callable[[Request], Awaitable[Response]]


def answer_safely(answer: Answer | Callable[[Request], Response]) -> Answer:
    """The route, with what goes wrong as one line of JSON; one that is no coroutine runs aside."""

    @wraps(answer)
    async def run(request: Request) -> Response:
        try:
            given: Response | Awaitable[Response] = await run_in_threadpool(answer, request)
            return given if isinstance(given, Response) else await given
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


async def read_object(request: Request) -> dict[str, Any]:
    """The JSON object of a request.

    Raises:
        InputError: it is too long, or no object.
    """
    try:
        value = json.loads(await read_bytes(request, MOST_BODY))
    except (ValueError, RecursionError) as error:
        raise InputError("the request is no JSON") from error
    if not isinstance(value, dict):
        raise InputError("the request is no JSON object")
    return value


def read_text(values: dict[str, Any], key: str, default: str | None = None) -> str:
    """A text of an object; InputError if it is none."""
    value = values.get(key, default)
    if not isinstance(value, str) or any("\ud800" <= char <= "\udfff" for char in value):
        raise InputError(f"{key} must be text")
    return value
