"""Faults of a model's client: which may pass, and asking again after those, with growing pauses."""

from __future__ import annotations

import re
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeVar

import httpx
from tenacity import RetryCallState, Retrying, retry_if_exception_type, stop_after_attempt

from scenewright.errors import BackendFault

ResultT = TypeVar("ResultT")


class TransientError(Exception):
    """A fault that may pass.

    Attributes:
        after: seconds that the endpoint asks to wait; None if it says nothing.
    """

    def __init__(self, reason: str, *, after: float | None = None) -> None:
        super().__init__(reason)
        self.after = after


@dataclass(frozen=True)
class RetryPolicy:
    """How often to ask, and how long to wait in between.

    Attributes:
        attempts: in all; first, longest: pauses [s], each twice the one before.
    """

    attempts: int = 4
    first: float = 1.0
    longest: float = 20.0

    def compute_pause(self, state: RetryCallState) -> float:
        """Seconds to wait after a failed attempt; longer where the endpoint asks for it."""
        fault = state.outcome.exception() if state.outcome else None
        asked_for = fault.after if isinstance(fault, TransientError) else None
        pause = self.first * 2.0 ** (state.attempt_number - 1)
        return min(max(pause, asked_for or 0.0), self.longest)


def retry_transient(ask: Callable[[], ResultT], *, policy: RetryPolicy) -> tuple[ResultT, int]:
    """What `ask` returns, and how often it was called.

    Raises:
        BackendFault: every attempt failed, or one for good; says how, and how many there were.
    """
    retrying = Retrying(
        stop=stop_after_attempt(policy.attempts),
        wait=policy.compute_pause,
        retry=retry_if_exception_type(TransientError),
        sleep=time.sleep,
        reraise=True,
    )
    try:
        found = retrying(ask)
    except TransientError as fault:
        words = f"{fault} ({policy.attempts} attempts)"
        raise BackendFault(words, final=True, asked=policy.attempts) from None
    except BackendFault as fault:
        fault.asked = retrying.statistics["attempt_number"]
        raise
    return found, int(retrying.statistics["attempt_number"])


_MAY_PASS = frozenset({408, 409, 425, 429, 500, 502, 503, 504, 520, 522, 524, 529})
_LONGEST = 200
_PIECE = 8
"""So many characters in a row of a key, where it is twice as long or more, are as good as it."""
_WORD = re.compile(r"[^\s\"',;{}()\[\]]+")
_ABOUT_KEYS = re.compile(
    r"\bkeys?\b|api.?key|authori[sz]ation|bearer|secret|password|credential|\bsk-|://[^/\s]*@",
    re.IGNORECASE,
)
_OPTIONS = {
    "response_format": (
        *("response_format", "json_schema", "output_config", "output_format"),
        "structured output",
    ),
    "temperature": ("temperature",),
    "seed": ("seed",),
}
"""Options that some endpoints do not know, by the words in which they say so."""


def is_cut_off(error: Exception) -> bool:
    """Whether the reply ended where its tokens did."""
    return "LengthFinishReasonError" in _list_class_names(error)


def is_filtered(error: Exception) -> bool:
    """Whether the endpoint withheld the reply."""
    return "ContentFilterFinishReasonError" in _list_class_names(error)


def find_refused_option(error: Exception) -> str | None:
    """The option of a request that the endpoint does not take, if that is what is wrong."""
    status, words = _get_status(error), _get_message(error).lower()
    if status == 500 and "response_format" in words:
        return "response_format"  # llama-cpp-python's server calls every bad request its own fault
    if status not in (400, 404, 422, 501):
        return None
    for option, names in _OPTIONS.items():
        if any(name in words for name in names):
            return option
    return None


def convert_fault(error: Exception, *, model: str, key: str | None) -> Exception | None:
    """A TransientError or a BackendFault; None if the exception is no fault of an endpoint."""
    names = _list_class_names(error)
    status = _get_status(error)
    if status is not None:
        reason = _format_reason(error, status, key)
        if status in _MAY_PASS:
            return TransientError(
                f"{model} answered {status}{reason}", after=_parse_retry_after(error)
            )
        return BackendFault(f"{model} answered {status}{reason}", final=True)
    if "APITimeoutError" in names or isinstance(error, httpx.TimeoutException):
        return TransientError(f"{model} did not answer in time")
    if "APIConnectionError" in names or isinstance(error, httpx.TransportError):
        cause: BaseException = error
        while cause.__cause__ is not None:
            cause = cause.__cause__
        what = (
            "sent no reply" if isinstance(cause, httpx.RemoteProtocolError) else "cannot be reached"
        )
        return TransientError(f"{model} {what}: {quote(cause, key) or type(cause).__name__}")
    if "APIResponseValidationError" in names or _is_garbled(error):
        return TransientError(f"{model} sent no answer of a chat model")
    return None


def _is_garbled(error: Exception) -> bool:
    """Whether a client stumbled over a body that is not what the protocol says."""
    packages = ("openai", "anthropic", "langchain_openai", "langchain_anthropic", "json", "httpx")
    known = isinstance(error, ValueError | TypeError | KeyError | AttributeError | IndexError)
    trace = error.__traceback__
    while trace is not None and trace.tb_next is not None:
        trace = trace.tb_next
    raised_in = "" if trace is None else str(trace.tb_frame.f_globals.get("__name__", ""))
    return known and raised_in.partition(".")[0] in (*packages, "pydantic", "langchain_core")


def _list_class_names(error: Exception) -> set[str]:
    return {each.__name__ for each in type(error).__mro__}


def _get_status(error: Exception) -> int | None:
    status = getattr(error, "status_code", None)
    return status if isinstance(status, int) else None


def _get_message(error: Exception) -> str:
    body = getattr(error, "body", None)
    inner: Any = body.get("error", body) if isinstance(body, dict) else body
    message = inner.get("message") if isinstance(inner, dict) else None
    return message if isinstance(message, str) else str(error)


def _format_reason(error: Exception, status: int, key: str | None) -> str:
    """What the endpoint says; nothing on keys, as such messages quote them."""
    match status:
        case 401 | 403:
            return ": it does not accept the key in the environment"
        case 404:
            return ": there is no such model or address"
        case 300 | 301 | 302 | 303 | 307 | 308:
            return ": it redirects elsewhere, which is not followed"
    text = quote(_get_message(error), key)
    return f": {text}" if text else ""


def quote(words: object, key: str | None) -> str:
    """One short line of what another program says; nothing of it where it speaks of keys."""
    text = " ".join("".join(c if c.isprintable() else " " for c in str(words)).split())
    if _ABOUT_KEYS.search(text) or hide_key(text, key) != text:
        return "what it says is about keys and is not repeated"
    return text[:_LONGEST]


def hide_key(text: str, key: str | None) -> str:
    """The text without the words that have the key, or a piece of it, in them."""
    key = key if key and len(key) > 3 else ""
    size = _PIECE if len(key) >= 2 * _PIECE else len(key)
    pieces = [key[i : i + size] for i in range(len(key) - size + 1)] if key else []
    if not any(piece in text for piece in pieces):
        return text
    return _WORD.sub(
        lambda word: "[key]" if any(piece in word[0] for piece in pieces) else word[0], text
    )


def _parse_retry_after(error: Exception) -> float | None:
    headers = getattr(getattr(error, "response", None), "headers", None) or {}
    try:
        seconds = float(headers.get("retry-after", ""))
    except ValueError:
        return None
    return seconds if 0.0 <= seconds < 1e6 else None
